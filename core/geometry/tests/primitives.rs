//! The primitive tests against f64 and against their own laws.

use hybray_geometry::simd::{Kernel, Kernels, Lanes, Simd};
use hybray_geometry::{Aabb, Bundle, Candidate, Cone, LaneRay, Ray, RayKernel, Sphere, Triangle, Vec3, triangle_lanes};

/// Numbers that depend on nothing but the seed.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
    fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

fn ray(origin: Vec3, direction: Vec3) -> RayKernel {
    RayKernel::new(&Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY })
}

const FAR: Candidate = Candidate::none(f32::INFINITY);

/// A closed octahedron-like fan around a vertex: every ray aimed at the vertex, or at an edge, hits some triangle.
#[test]
fn rays_aimed_at_vertices_and_edges_never_leak() {
    let mut random = Random(1);
    for round in 0..20_000 {
        let apex = random.vec();
        let ring: Vec<Vec3> = (0..6)
            .map(|i| {
                let (s, c) = (i as f32 * std::f32::consts::FRAC_PI_3).sin_cos();
                apex + Vec3::new(c, s, -0.3) * (0.5 + 0.4 * random.signed().abs()) + random.vec() * 0.1
            })
            .collect();
        let origin = apex + Vec3::new(random.signed(), random.signed(), 4.0);
        let along = random.signed().abs() * 0.9;
        let target = if round % 2 == 0 { apex } else { apex + (ring[round % 6] - apex) * along };
        let ray = ray(origin, target - origin);
        let hits =
            (0..6).filter(|&i| Triangle { v: [apex, ring[i], ring[(i + 1) % 6]] }.hit(&ray, 0, &FAR).is_some()).count();
        assert!(hits > 0, "round {round}: {ray:?}");
    }
}

#[test]
fn a_triangle_hit_agrees_with_f64() {
    let mut random = Random(2);
    let mut hits = 0;
    for _ in 0..20_000 {
        let triangle = Triangle { v: [random.vec(), random.vec(), random.vec()] };
        let o = random.vec() * 3.0;
        let d = triangle.v[0] + random.vec() - o;
        let ray = ray(o, d);
        let [a, b, c] = triangle.v.map(|p| p.as_dvec3());
        let n = (b - a).cross(c - a);
        let t = n.dot(a - o.as_dvec3()) / n.dot(d.as_dvec3());
        let p = o.as_dvec3() + d.as_dvec3() * t;
        let sides = [(a, b), (b, c), (c, a)].map(|(p0, p1)| (p1 - p0).cross(p - p0).dot(n) / n.length_squared());
        let found = triangle.hit(&ray, 7, &FAR);
        let least = sides.iter().copied().fold(f64::INFINITY, f64::min);
        if t > 1e-4 && least > 1e-4 {
            let surface = triangle.surface(&ray, found.expect("a clear hit").t);
            assert!((f64::from(surface.t) - t).abs() <= f64::from(surface.t_error) + 1e-6 * t, "{surface:?} {t}");
            let off = (surface.position.as_dvec3() - a).dot(n) / n.length();
            assert!(off.abs() <= surface.error.as_dvec3().element_sum(), "{off} {surface:?}");
            hits += 1;
        } else if t < -1e-4 || least < -1e-4 {
            assert_eq!(found, None, "a clear miss: {t} {sides:?}");
        }
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn distant_spheres_are_hit_where_f64_says() {
    let mut random = Random(4);
    let mut hits = 0;
    for _ in 0..20_000 {
        let sphere = Sphere { centre: random.vec(), radius: 0.5 };
        let aim = random.vec();
        let origin = sphere.centre + aim / aim.length() * 5000.0;
        let target = sphere.centre + random.vec() * 0.45;
        let ray = ray(origin, (target - origin) / 5000.0);
        let (o, d) = (origin.as_dvec3() - sphere.centre.as_dvec3(), Vec3::from_array(ray.direction).as_dvec3());
        let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - 0.25);
        let discriminant = b * b - a * c;
        if discriminant / a > 1e-3 {
            let t = (-b - discriminant.sqrt()) / a;
            let hit = sphere.hit(&ray, 0, &FAR).expect("a clear hit");
            let surface = sphere.surface(&ray, hit.t);
            assert!((f64::from(hit.t) - t).abs() <= f64::from(surface.t_error), "{} {t} {}", hit.t, surface.t_error);
            let radius = (surface.position.as_dvec3() - sphere.centre.as_dvec3()).length();
            assert!((radius - 0.5).abs() <= surface.error.as_dvec3().element_sum());
            hits += 1;
        } else if discriminant / a < -1e-3 {
            assert_eq!(sphere.hit(&ray, 0, &FAR), None);
        }
    }
    assert!(hits > 5000);
}

#[test]
fn a_cone_hit_lies_on_its_side_and_in_its_box() {
    let mut random = Random(5);
    let mut hits = 0;
    for i in 0..20_000 {
        let apex_radius = [0.0, 0.3, 0.1][i % 3];
        let cone = Cone { base: random.vec(), base_radius: 0.3, apex: random.vec() * 2.0, apex_radius };
        let o = random.vec() * 4.0;
        let ray = ray(o, cone.base + random.vec() - o);
        if let Some(hit) = cone.hit(&ray, 0, &FAR) {
            hits += 1;
            let p =
                Vec3::from_array(ray.origin).as_dvec3() + Vec3::from_array(ray.direction).as_dvec3() * f64::from(hit.t);
            let axis = cone.apex.as_dvec3() - cone.base.as_dvec3();
            let height = (p - cone.base.as_dvec3()).dot(axis) / axis.length_squared();
            let across = (p - cone.base.as_dvec3() - axis * height).length();
            let radius = 0.3 + (f64::from(apex_radius) - 0.3) * height;
            assert!((across - radius).abs() < 2e-6 * (1.0 + f64::from(hit.t)), "{across} {radius}");
            assert!((-1e-5..=1.000_01).contains(&height));
            let surface = cone.surface(&ray, hit.t);
            assert!((surface.normal.length() - 1.0).abs() < 1e-6);
            let outward = surface.normal.as_dvec3().dot(p - cone.base.as_dvec3() - axis * height);
            assert!(outward > -1e-6, "outside is away from the axis: {outward}");
            assert!(cone.aabb().contains(&Aabb::around(&[surface.position])) || hit.t > 100.0);
        }
    }
    assert!(hits > 1000);
}

#[test]
fn ties_go_to_the_lowest_id() {
    let triangle = Triangle { v: [Vec3::ZERO, Vec3::X, Vec3::Y] };
    let r = ray(Vec3::new(0.2, 0.2, 1.0), -Vec3::Z);
    let best = triangle.hit(&r, 5, &FAR).unwrap();
    assert_eq!(triangle.hit(&r, 6, &best), None);
    assert_eq!(triangle.hit(&r, 4, &best), Some(Candidate { t: 1.0, id: 4 }));
}

#[test]
fn a_ray_in_a_face_of_a_box_is_inside_it() {
    let unit = Aabb { lo: Vec3::ZERO, hi: Vec3::ONE };
    let check = |o: [f32; 3], d: [f32; 3], inside: bool| {
        let (near, far) = ray(o.into(), d.into()).slab(&unit);
        assert_eq!(near <= far && far >= 0.0, inside, "{o:?} {d:?}: {near} {far}");
    };
    check([0.0, 0.5, -1.0], [0.0, 0.0, 1.0], true);
    check([1.0, 0.5, -1.0], [0.0, 0.0, 1.0], true);
    check([1.0, 1.0, -1.0], [-0.0, -0.0, 1.0], true);
    check([1.0, 1.0, 2.0], [0.0, -0.0, -1.0], true);
    check([1.1, 0.5, -1.0], [0.0, 0.0, 1.0], false);
    check([-0.1, 0.5, -1.0], [-0.0, 0.0, 1.0], false);
}

/// Four triangles at once, with whatever the processor has.
struct Four<'a>(&'a RayKernel, &'a [Triangle; 4]);

impl Kernel for Four<'_> {
    type Output = ([f32; 4], u32);
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let like = simd.splat4(0.0);
        let lanes = core::array::from_fn(|vertex| {
            self.0.axes.map(|axis| simd.load4(&core::array::from_fn(|i| self.1[i].v[vertex].to_array()[axis])))
        });
        let (t, hit) = triangle_lanes(&self.0.splat(like), &lanes);
        (t.to_array(), hit)
    }
}

#[test]
fn lanes_agree_with_single_tests_to_the_bit() {
    let mut random = Random(6);
    for _ in 0..20_000 {
        // A coarse grid makes edge values of exactly zero common.
        let mut grid = || (random.vec() * 3.0).round() * 0.25;
        let triangles: [Triangle; 4] = core::array::from_fn(|_| Triangle { v: [grid(), grid(), grid()] });
        let (o, d) = (grid() * 4.0, grid());
        if d == Vec3::ZERO {
            continue;
        }
        let r = ray(o, d);
        for kernels in Kernels::available() {
            let (t, hit) = kernels.run(Four(&r, &triangles));
            for i in 0..4 {
                let single = triangles[i].hit(&r, 0, &FAR).map(|c| c.t.to_bits());
                let lane = (hit >> i & 1 != 0 && t[i] >= 0.0).then(|| t[i].to_bits());
                assert_eq!(lane, single, "{kernels:?} {:?} {r:?}", triangles[i]);
            }
        }
    }
}

#[test]
fn a_bundle_contains_its_rays() {
    let mut random = Random(7);
    let mut kept = 0;
    for round in 0..3_000 {
        let (apex, towards) = (random.vec() * 2.0, random.vec());
        let spread = [0.0, 0.01, 0.2][round % 3];
        let rays: Vec<Ray> = (0..16)
            .map(|_| Ray {
                origin: apex + random.vec() * if round % 2 == 0 { 0.0 } else { 0.05 },
                direction: (towards + random.vec() * spread) * (1.0 + 0.5 * random.signed()),
                t_min: 0.0,
                t_max: f32::INFINITY,
            })
            .collect();
        let Some(bundle) = Bundle::around(rays.iter(), 4.0) else { continue };
        for ray in &rays {
            let kernel = RayKernel::new(ray);
            for _ in 0..8 {
                let p = ray.origin + ray.direction * random.signed().abs() * 2.0 + random.vec() * 0.3;
                let b = Aabb { lo: p, hi: p + random.vec().abs() * 0.5 };
                let (near, far) = kernel.slab(&b);
                if near <= far && far >= 0.0 {
                    kept += 1;
                    let eight = |v: Vec3| v.to_array().map(|x| [x; 8]);
                    let (mask, depth) = Kernels::Portable.run(Meets(&bundle, eight(b.lo), eight(b.hi)));
                    assert_eq!(mask, 0xff, "{ray:?} {b:?}");
                    assert!(depth[0] <= near.max(0.0), "{} {near}", depth[0]);
                }
            }
        }
    }
    assert!(kept > 5_000, "{kept}");
    let apart = [Vec3::X, -Vec3::X].map(|direction| Ray { origin: Vec3::ZERO, direction, t_min: 0.0, t_max: 1.0 });
    assert_eq!(Bundle::around(apart.iter(), 1.0), None);
}

struct Meets<'a>(&'a Bundle, [[f32; 8]; 3], [[f32; 8]; 3]);

impl Kernel for Meets<'_> {
    type Output = (u32, [f32; 8]);
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        self.0.meets(simd, &self.1, &self.2)
    }
}

#[test]
fn an_unused_slot_is_never_met() {
    let mut random = Random(8);
    for _ in 0..1000 {
        let r = Ray { origin: random.vec(), direction: random.vec().round() + Vec3::X * 2.0, t_min: 0.0, t_max: 1.0 };
        let (near, far) = RayKernel::new(&r).slab(&Aabb::UNUSED);
        assert!(!(near <= far));
        assert!(!Bundle::around([r].iter(), 1.0).unwrap().meets_box(&Aabb::UNUSED));
    }
}

struct SideBySide<'a>(&'a [Ray]);

impl Kernel for SideBySide<'_> {
    type Output = Option<Vec<[f32; 13]>>;
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let rays = &self.0[..self.0.len().min(S::Packet::LANES)];
        let lanes = LaneRay::side_by_side(simd.splat_packet(0.0), rays)?;
        let values = [lanes.origin, lanes.direction, lanes.inverse, lanes.shear].concat();
        let at = |value: S::Packet, lane: usize| value.to_array().as_ref()[lane];
        let lane = |i: usize| std::array::from_fn(|k| at(*values.get(k).unwrap_or(&lanes.t_min), i));
        assert_eq!(lanes.axes, RayKernel::new(&rays[0]).axes);
        Some((0..S::Packet::LANES).map(lane).collect())
    }
}

/// Rays side by side are to the bit what each is alone; those whose longest axes or signs differ are refused, and no others.
#[test]
fn rays_side_by_side_are_what_they_are_alone() {
    let mut random = Random(5);
    let (mut taken, mut refused) = (0, 0);
    for round in 0..20_000 {
        let (spread, towards) = ([0.0, 0.05, 1.0][round % 3], random.vec());
        let coarse = |v: Vec3| if round % 7 == 0 { (v * 2.0).round() } else { v };
        let rays: Vec<Ray> = (0..1 + random.bits() as usize % 16)
            .map(|_| {
                let direction = coarse(towards + random.vec() * spread);
                let direction = if direction == Vec3::ZERO { Vec3::NEG_Z } else { direction };
                Ray { origin: random.vec(), direction, t_min: random.signed().abs(), t_max: 1.0 }
            })
            .collect();
        for kernels in Kernels::available() {
            let found = kernels.run(SideBySide(&rays));
            let lanes = if kernels.name() == "avx512" { 16 } else { 8 };
            let alone: Vec<RayKernel> = rays.iter().take(lanes).map(RayKernel::new).collect();
            assert_eq!(found.is_some(), alone.iter().all(|ray| ray.axes == alone[0].axes), "{kernels:?} {rays:?}");
            let Some(found) = found else {
                refused += 1;
                continue;
            };
            assert_eq!(found.len(), lanes);
            for (lane, found) in found.iter().enumerate() {
                let ray = &alone[lane.min(alone.len() - 1)];
                let expected = [&ray.origin[..], &ray.direction, &ray.inverse, &ray.shear, &[ray.t_min]].concat();
                assert_eq!(
                    found.map(f32::to_bits)[..],
                    expected.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
                    "{ray:?}"
                );
            }
            taken += 1;
        }
    }
    assert!(taken > 5_000 && refused > 5_000, "{taken} {refused}");
}
