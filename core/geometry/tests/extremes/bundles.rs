//! Bundles keep every box that one of their rays meets, by `f64` and by the walk's own test, and never too late.

use crate::random::Random;
use hybray_geometry::simd::{Kernel, Kernels, Simd};
use hybray_geometry::{Aabb, Bundle, Ray, RayKernel, Vec3};

struct Meets<'a>(&'a Bundle, [[f32; 8]; 3], [[f32; 8]; 3]);

impl Kernel for Meets<'_> {
    type Output = (u32, [f32; 8]);
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        self.0.meets(simd, &self.1, &self.2)
    }
}

/// Where the ray enters the box in `f64`, if it does at 0 or later.
fn entry(ray: &Ray, aabb: &Aabb) -> Option<f64> {
    let (mut near, mut far) = (0f64, f64::INFINITY);
    for i in 0..3 {
        let (o, d) = (f64::from(ray.origin[i]), f64::from(ray.direction[i]));
        let (lo, hi) = (f64::from(aabb.lo[i]) - o, f64::from(aabb.hi[i]) - o);
        if d == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = if d > 0.0 { (lo / d, hi / d) } else { (hi / d, lo / d) };
        near = near.max(a);
        far = far.min(b);
    }
    (near <= far).then_some(near)
}

/// Boxes in a scene of `magnitude` that touch a ray, mostly by a corner.
fn boxes(ray: &Ray, magnitude: f32, random: &mut Random) -> [Aabb; 8] {
    let inside = |p: Vec3| p.clamp(Vec3::splat(-magnitude), Vec3::splat(magnitude));
    let whole = Aabb { lo: Vec3::splat(-magnitude), hi: Vec3::splat(magnitude) };
    let from = entry(ray, &whole).unwrap_or(0.0) as f32;
    std::array::from_fn(|_| {
        let reach = 3.4 * magnitude / ray.direction.length();
        let t = if random.below(8) == 0 { 0.0 } else { from + reach * random.unit() };
        let p = inside(ray.origin + ray.direction * t);
        let q = inside(p + random.vec() * magnitude * random.decades(-7.0, 0.0));
        Aabb::around(&[p, q])
    })
}

#[derive(Default)]
struct Totals {
    bundles: usize,
    refused: usize,
    met: usize,
    kept: usize,
    tested: usize,
}

fn check(name: &str, rays: &[Ray], magnitude: f32, random: &mut Random, totals: &mut Totals) {
    let Some(bundle) = Bundle::around(rays.iter(), magnitude) else {
        totals.refused += 1;
        return;
    };
    totals.bundles += 1;
    for ray in rays {
        let kernel = RayKernel::new(ray);
        let eight = boxes(ray, magnitude, random);
        let planes = |f: fn(&Aabb) -> Vec3| std::array::from_fn(|axis| eight.each_ref().map(|b| f(b)[axis]));
        let (lo, hi) = (planes(|b| b.lo), planes(|b| b.hi));
        for kernels in Kernels::available() {
            let (mask, depth) = kernels.run(Meets(&bundle, lo, hi));
            for (i, aabb) in eight.iter().enumerate() {
                let (near, far) = kernel.slab(aabb);
                let walk = (near <= far && far >= 0.0).then_some(near.max(0.0));
                let kept = mask >> i & 1 != 0;
                totals.tested += 1;
                totals.kept += usize::from(kept);
                if let Some(t) = entry(ray, aabb) {
                    totals.met += 1;
                    assert!(kept, "{name}: {ray:?} meets {aabb:?} at {t} and the bundle does not");
                    assert!(f64::from(depth[i]) <= t, "{name}: {ray:?} {aabb:?}: {} is after {t:e}", depth[i]);
                }
                if let Some(t) = walk {
                    assert!(kept, "{name}: the walk of {ray:?} enters {aabb:?} and the bundle does not");
                    assert!(depth[i] <= t, "{name}: {ray:?} {aabb:?}: {} is after the walk's {t:e}", depth[i]);
                }
            }
        }
    }
}

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}

fn table(name: &str, rounds: usize, mut make: impl FnMut(&mut Random) -> Option<Vec<Ray>>) {
    let mut random = Random(name.len() as u64);
    let mut totals = Totals::default();
    for _ in 0..rounds {
        let Some(rays) = make(&mut random) else { continue };
        let magnitude = [1.0, 1.0, 100.0, 1e-3][random.below(4)];
        let scaled: Vec<Ray> = rays.iter().map(|r| Ray { origin: r.origin * magnitude, ..*r }).collect();
        check(name, &scaled, magnitude, &mut random, &mut totals);
    }
    let Totals { bundles, refused, met, kept, tested } = totals;
    eprintln!(
        "{name}: {bundles} bundles ({refused} refused), {met} of {tested} boxes met by the ray they are near, {kept} kept"
    );
    assert!(bundles > rounds / 20 && met > 1000, "{name}: {bundles} bundles, {met} boxes");
}

#[test]
fn bundles_contain_their_rays() {
    let spread = |spread: f32, jitter: f32, far: f32| {
        move |random: &mut Random| {
            let (axis, apex) = (random.direction(), random.vec() * far);
            let towards = if far > 2.0 { -apex / apex.length() } else { axis };
            let rays = (0..24).map(|_| {
                let direction = (towards + random.vec() * spread) * random.decades(-2.0, 2.0);
                ray(apex + random.vec() * jitter, direction)
            });
            Some(rays.filter(|r| r.direction != Vec3::ZERO).collect())
        }
    };
    table("one direction", 400, spread(0.0, 0.0, 1.0));
    table("parallel rays", 400, spread(0.0, 0.5, 1.0));
    table("tiny", 400, spread(1e-6, 0.0, 1.0));
    table("a pixel", 400, spread(1e-3, 1e-4, 1.0));
    table("a tile", 400, spread(0.03, 0.0, 1.0));
    table("wide", 400, spread(0.5, 0.1, 1.0));
    table("as wide as may be", 4_000, spread(1.1, 0.3, 1.0));
    table("far apex", 400, spread(0.01, 0.0, 30.0));
    table("very far apex", 400, spread(1e-4, 1e-3, 3_000.0));
}

#[test]
fn bundles_along_axes() {
    table("axis-parallel", 600, |random| {
        let axis = random.below(3);
        let mut direction = Vec3::ZERO;
        direction[axis] = if random.below(2) == 0 { 1.0 } else { -1.0 };
        let apex = (random.vec() * 4.0).round() * 0.25;
        Some((0..16).map(|i| ray(apex + (random.vec() * 2.0).round() * 0.125 * (i % 2) as f32, direction)).collect())
    });
    table("around an axis", 600, |random| {
        let axis = random.below(3);
        let apex = (random.vec() * 4.0).round() * 0.25;
        let spread = random.decades(-7.0, 0.0);
        let rays = (0..16).map(|i| {
            let mut direction = Vec3::ZERO;
            direction[axis] = -1.0;
            direction[(axis + 1) % 3] = spread * (i % 4) as f32;
            direction[(axis + 2) % 3] = spread * (i / 4) as f32 - spread;
            ray(apex, direction)
        });
        Some(rays.collect())
    });
}

/// Sixteen pixels square, with a filter of radius 2 pixels, as a camera makes them.
#[test]
fn bundles_of_pixels() {
    table("pixels", 600, |random| {
        let eye = random.vec() * 3.0;
        let forward = random.direction();
        let right = forward.any_orthonormal_vector();
        let up = forward.cross(right);
        let slope = random.decades(-4.0, -1.5);
        let corner = (random.signed() * 400.0, random.signed() * 400.0);
        let rays = (0..64).map(|i| {
            let (x, y) = ((i % 8) as f32 * 2.0 + 2.0 * random.signed(), (i / 8) as f32 * 2.0 + 2.0 * random.signed());
            let along = forward + right * ((corner.0 + x) * slope) + up * ((corner.1 + y) * slope);
            ray(eye, along / along.length())
        });
        Some(rays.collect())
    });
}

#[test]
fn what_is_no_bundle_is_refused() {
    let apart = [Vec3::X, -Vec3::X].map(|d| ray(Vec3::ZERO, d));
    assert_eq!(Bundle::around(apart.iter(), 1.0), None);
    assert_eq!(Bundle::around([].iter(), 1.0), None);
    for broken in [f32::NAN, f32::INFINITY] {
        assert_eq!(Bundle::around([ray(Vec3::splat(broken), Vec3::X)].iter(), 1.0), None);
        assert_eq!(Bundle::around([ray(Vec3::ZERO, Vec3::splat(broken))].iter(), 1.0), None);
        assert_eq!(Bundle::around([ray(Vec3::ZERO, Vec3::X)].iter(), broken), None);
    }
}
