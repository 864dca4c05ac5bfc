//! The error bounds of a hit's distance and position, against 106 bits.

use crate::exact::{Wide, Wide3};
use crate::random::Random;
use crate::slabs::unclamped;
use hybray_geometry::{Aabb, Candidate, Cone, Ray, RayKernel, Sphere, SurfacePoint, Triangle, Vec3};

const FAR: Candidate = Candidate::none(f32::INFINITY);

/// Bound over error, of many hits.
struct Ratios {
    what: &'static str,
    all: Vec<f64>,
}

impl Ratios {
    fn new(what: &'static str) -> Self {
        Self { what, all: Vec::new() }
    }

    fn add(&mut self, error: f64, bound: f64, context: &dyn Fn() -> String) {
        assert!(
            error <= bound,
            "{}: error {error:e} above its bound {bound:e} (after {} hits): {}",
            self.what,
            self.all.len(),
            context()
        );
        if error > 0.0 {
            self.all.push(bound / error);
        }
    }

    /// Prints, and refuses bounds that say nothing.
    fn finish(mut self, hits: usize, median_max: f64) {
        self.all.sort_by(f64::total_cmp);
        assert!(self.all.len() > hits, "{}: only {} hits", self.what, self.all.len());
        let at = |share: f64| self.all[(self.all.len() as f64 * share) as usize];
        eprintln!(
            "{}: bound over error: least {:.2}, 1 % {:.1}, median {:.1}",
            self.what,
            self.all[0],
            at(0.01),
            at(0.5)
        );
        assert!(at(0.5) < median_max, "{} is absurdly loose", self.what);
    }
}

/// Whether the distance is the test's own, which the bound is about, and not an end of the own box's interval.
fn is_own(kernel: &RayKernel, t: f32, aabb: &Aabb) -> bool {
    let (near, far) = kernel.slab(aabb);
    near < t && t < far
}

/// A unit vector across `n`.
fn across(n: Vec3, random: &mut Random) -> Vec3 {
    let v = random.direction().cross(n);
    if v.length() > 1e-3 { v / v.length() } else { n.any_orthonormal_vector() }
}

/// How far `position` is from a surface with this `normal`, over what the error box reaches along it.
fn reach(error: Vec3, normal: [f64; 3]) -> f64 {
    (0..3).map(|i| f64::from(error[i]) * normal[i]).sum()
}

/// A ray to `target` from `distance` away, `sine` above the surface with normal `n`; its direction has any length.
fn aimed(target: Vec3, n: Vec3, distance: f32, sine: f32, random: &mut Random) -> Ray {
    let back = across(n, random) * (1.0 - sine * sine).sqrt() + n * sine;
    let origin = target + back * distance;
    let direction = (target - origin) * (random.decades(-4.0, 4.0) / distance);
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}

#[test]
fn of_triangles() {
    let mut random = Random(1);
    let (mut t_ratios, mut p_ratios) = (Ratios::new("triangle, distance"), Ratios::new("triangle, position"));
    let mut plain_ratios = Ratios::new("triangle in plain view, distance");
    for _ in 0..60_000 {
        let size = random.decades(-4.0, 3.0);
        let at = random.vec() * random.decades(-3.0, 3.0);
        let v = [at, at + random.vec() * size, at + random.vec() * size * random.decades(-2.0, 0.0)];
        let triangle = Triangle { v };
        let n = triangle.normal();
        let (b, c) = (random.unit(), random.unit());
        let target = v[0] + (v[1] - v[0]) * (b * (1.0 - c)) + (v[2] - v[0]) * (c * 0.5);
        let sine = random.decades(-4.0, 0.0);
        let distance = random.decades(-2.0, 4.0);
        let ray = aimed(target, n, distance, sine, &mut random);
        if !(ray.direction.length() > 0.0) {
            continue;
        }
        let kernel = RayKernel::new(&ray);
        let Some(hit) = triangle.hit(&kernel, 0, &FAR) else { continue };
        let surface = triangle.surface(&kernel, hit.t);
        let [p, q, r] = v.map(Wide3::from);
        let normal = (q - p).cross(r - p);
        let (o, d) = (Wide3::from(ray.origin), Wide3::from(ray.direction));
        let slope = normal.dot(d);
        if f64::from(slope) == 0.0 {
            continue;
        }
        let exact = f64::from(normal.dot(p - o) / slope);
        let raw = f64::from(unclamped(&kernel, &v));
        let context = || format!("{triangle:?} {ray:?} {surface:?} exact t {exact:e}");
        t_ratios.add((raw - exact).abs(), surface.t_error.into(), &context);
        if sine > 0.1 && (0.1..10.0).contains(&(distance / size)) {
            plain_ratios.add((raw - exact).abs(), surface.t_error.into(), &context);
        }
        let off = f64::from(normal.dot(Wide3::from(surface.position) - p)).abs();
        p_ratios.add(off, reach(surface.error, normal.abs()), &context);
    }
    // Far away, the bound on a triangle that is small from there is loose: its edges are no longer told apart.
    t_ratios.finish(20_000, 1e5);
    plain_ratios.finish(1_000, 1e4);
    p_ratios.finish(20_000, 100.0);
}

/// A sphere and a ray that hits it, or nearly: from far, near, inside and its surface; many graze it.
fn spheres(random: &mut Random) -> (Sphere, Ray) {
    let sphere = Sphere { centre: random.vec() * random.decades(-3.0, 3.0), radius: random.decades(-3.0, 2.0) };
    let r = sphere.radius;
    let distance = match random.below(4) {
        // From the surface itself, as mirrored rays start; from inside; from near and far.
        0 => r * (1.0 + random.signed() * 1e-6),
        1 => r * random.unit(),
        _ => r * random.decades(0.0, 4.0),
    };
    let out = random.direction();
    let origin = sphere.centre + out * distance;
    let side = across(out, random);
    let miss = if random.below(3) == 0 { 1.0 - random.decades(-6.0, 0.0) } else { random.unit() };
    let target = sphere.centre + side * (miss * r);
    let direction = (target - origin) * (random.decades(-4.0, 4.0) / distance);
    (sphere, Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY })
}

#[test]
fn of_spheres() {
    let mut random = Random(2);
    let (mut t_ratios, mut p_ratios) = (Ratios::new("sphere, distance"), Ratios::new("sphere, position"));
    for _ in 0..60_000 {
        let (sphere, ray) = spheres(&mut random);
        if !(ray.direction.length() > 0.0) {
            continue;
        }
        let kernel = RayKernel::new(&ray);
        let Some(hit) = sphere.hit(&kernel, 0, &FAR) else { continue };
        let surface = sphere.surface(&kernel, hit.t);
        let (f, d) = (Wide3::from(ray.origin) - Wide3::from(sphere.centre), Wide3::from(ray.direction));
        let r = Wide::from(sphere.radius);
        let a = d.dot(d);
        let along = Wide::ZERO - f.dot(d) / a;
        let nearest = f + d.times(along);
        // A ray that truly passes by is measured by its nearest point.
        let half = ((r * r - nearest.dot(nearest)) / a).sqrt();
        let roots = [along - half, along + half].map(f64::from);
        let error = roots.map(|t| (f64::from(hit.t) - t).abs()).into_iter().fold(f64::INFINITY, f64::min);
        let context = || format!("{sphere:?} {ray:?} {surface:?} exact t {roots:?}");
        if is_own(&kernel, hit.t, &sphere.aabb()) {
            t_ratios.add(error, surface.t_error.into(), &context);
        }
        let out = Wide3::from(surface.position) - Wide3::from(sphere.centre);
        let length = out.dot(out).sqrt();
        let off = f64::from(length - r).abs();
        p_ratios.add(off, reach(surface.error, out.abs()) / f64::from(length), &context);
    }
    t_ratios.finish(20_000, 1e4);
    p_ratios.finish(20_000, 100.0);
}

fn cones(random: &mut Random) -> (Cone, Ray) {
    let base = random.vec() * random.decades(-3.0, 3.0);
    let length = random.decades(-3.0, 2.0);
    let axis = random.direction();
    let base_radius = random.decades(-3.0, 1.0) * length;
    let apex_radius = [0.0, base_radius, base_radius * random.unit(), base_radius * 2.0][random.below(4)];
    let cone = Cone { base, base_radius, apex: base + axis * length, apex_radius };
    let height = random.unit();
    let side = across(axis, random);
    let radius = base_radius + (apex_radius - base_radius) * height;
    let target = base + axis * (length * height) + side * radius;
    let sine = random.decades(-4.0, 0.0);
    let distance = length * random.decades(-3.0, 4.0);
    (cone, aimed(target, side, distance, sine, random))
}

/// Distance of `p` from the whole cone's side, with its sign, and the outward normal's absolute components.
fn cone_distance(cone: &Cone, p: Wide3) -> (f64, [f64; 3]) {
    let axis = Wide3::from(cone.apex) - Wide3::from(cone.base);
    let p = p - Wide3::from(cone.base);
    let squared = axis.dot(axis);
    let height = p.dot(axis) / squared;
    let out = p - axis.times(height);
    let length = out.dot(out).sqrt();
    let slope = Wide::from(cone.apex_radius) - Wide::from(cone.base_radius);
    let radius = Wide::from(cone.base_radius) + slope * height;
    let normal = out.times(squared / length) - axis.times(slope);
    let normal_length = normal.dot(normal).sqrt();
    let cosine = squared / normal_length;
    (f64::from((length - radius) * cosine), normal.abs().map(|x| x / f64::from(normal_length)))
}

/// The roots of a cone's quadratic in 106 bits.
fn cone_roots(cone: &Cone, ray: &Ray) -> [f64; 2] {
    let axis = Wide3::from(cone.apex) - Wide3::from(cone.base);
    let squared = axis.dot(axis);
    let split = |p: Wide3| {
        let height = p.dot(axis) / squared;
        (height, p - axis.times(height))
    };
    let (dh, dx) = split(ray.direction.into());
    let (mh, mx) = split(Wide3::from(ray.origin) - Wide3::from(cone.base));
    let slope = Wide::from(cone.apex_radius) - Wide::from(cone.base_radius);
    let r = Wide::from(cone.base_radius) + slope * mh;
    let a = dx.dot(dx) - slope * slope * dh * dh;
    let b = mx.dot(dx) - slope * dh * r;
    let c = mx.dot(mx) - r * r;
    let root = (b * b - a * c).sqrt();
    let q = if f64::from(b) < 0.0 { root - b } else { Wide::ZERO - root - b };
    [f64::from(q / a), f64::from(c / q)]
}

/// Thinner than its coordinates can tell.
fn base_radius_is_lost(cone: &Cone) -> bool {
    cone.base_radius < 1e-5 * cone.base.abs().max_element()
}

#[test]
fn of_cones() {
    let mut random = Random(3);
    let (mut t_ratios, mut p_ratios) = (Ratios::new("cone, distance"), Ratios::new("cone, position"));
    for _ in 0..60_000 {
        let (cone, ray) = cones(&mut random);
        if !(ray.direction.length() > 0.0) || cone.apex == cone.base || base_radius_is_lost(&cone) {
            continue;
        }
        let kernel = RayKernel::new(&ray);
        let Some(hit) = cone.hit(&kernel, 0, &FAR) else { continue };
        let surface: SurfacePoint = cone.surface(&kernel, hit.t);
        let roots = cone_roots(&cone, &ray);
        let error = roots.map(|t| (f64::from(hit.t) - t).abs()).into_iter().fold(f64::INFINITY, f64::min);
        let context = || format!("{cone:?} {ray:?} {surface:?} exact t {roots:?}");
        if is_own(&kernel, hit.t, &cone.aabb()) {
            t_ratios.add(error, surface.t_error.into(), &context);
        }
        let (off, normal) = cone_distance(&cone, surface.position.into());
        p_ratios.add(off.abs(), reach(surface.error, normal), &context);
    }
    t_ratios.finish(20_000, 1e4);
    p_ratios.finish(20_000, 100.0);
}
