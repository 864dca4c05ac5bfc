//! Spheres: the quadratic of *Ray Tracing Gems*, chapter 7, whose discriminant does not cancel for distant spheres.

use crate::simd::{Lanes, Mask, ONE_LANE};
use crate::{Aabb, Candidate, LaneRay, RayKernel, SurfacePoint, Vec3, gamma};

/// A sphere, hit from outside and inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub centre: Vec3,
    /// Radius, more than 0.
    pub radius: f32,
}

/// Tests each lane's ray against its sphere: the first hit at or after `t_min`, clamped to the own box, for the lanes
/// in the mask.
#[inline(always)]
pub fn sphere_lanes<F: Lanes>(ray: &LaneRay<F>, centre: &[F; 3], radius: F) -> (F, u32) {
    let dot = |a: &[F; 3], b: &[F; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let d = &ray.direction;
    let f = [ray.origin[0] - centre[0], ray.origin[1] - centre[1], ray.origin[2] - centre[2]];
    let a = dot(d, d);
    let b = -dot(&f, d);
    let along = b / a;
    let nearest = [f[0] + along * d[0], f[1] + along * d[1], f[2] + along * d[2]];
    let discriminant = radius * radius - dot(&nearest, &nearest);
    let zero = radius.splat_like(0.0);
    let accepted = zero.le(discriminant);
    if accepted.bits() == 0 {
        return (zero, 0);
    }
    let root = (a * discriminant.abs()).sqrt();
    let c = dot(&f, &f) - radius * radius;
    let q = b + (-root).select(b.lt(zero), root);
    let (t0, t1) = (c / q, q / a);
    let (first, last) = (t0.or_less(t1), t0.or_greater(t1));

    let lo = [centre[0] - radius, centre[1] - radius, centre[2] - radius];
    let hi = [centre[0] + radius, centre[1] + radius, centre[2] + radius];
    let (near, far) = ray.own_slab(&lo, &hi);
    let clamp = |t: F| near.select(t.lt(near), far.select(far.lt(t), t));
    let (first, last) = (clamp(first), clamp(last));
    let t = first.select(ray.t_min.le(first), last);
    (t, (accepted & near.le(far) & ray.t_min.le(t)).bits())
}

impl Sphere {
    /// Centre minus and plus radius, rounded: what the test clamps to.
    #[must_use]
    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb { lo: self.centre - self.radius, hi: self.centre + self.radius }
    }

    /// The hit of `ray` before `best`, if there is one: [`sphere_lanes`] with one lane.
    #[must_use]
    pub fn hit(&self, ray: &RayKernel, id: u32, best: &Candidate) -> Option<Candidate> {
        let centre = self.centre.to_array().map(|x| ONE_LANE.splat_like(x));
        let (t, hit) = sphere_lanes(&ray.splat(ONE_LANE), &centre, ONE_LANE.splat_like(self.radius));
        let found = Candidate { t: t.to_array()[0], id };
        (hit != 0 && found.precedes(best)).then_some(found)
    }

    /// The place of a hit that [`Sphere::hit`] found at `t`: that root of the quadratic again, in `f64`, since whatever is
    /// off here grows by the distance over the radius at each mirror.
    #[must_use]
    pub fn surface(&self, ray: &RayKernel, t: f32) -> SurfacePoint {
        let (o, d) = (Vec3::from_array(ray.origin).as_dvec3(), Vec3::from_array(ray.direction).as_dvec3());
        let radius = f64::from(self.radius);
        let f = o - self.centre.as_dvec3();
        let a = d.dot(d);
        let along = -f.dot(d) / a;
        let nearest = f + d * along;
        let discriminant = radius * radius - nearest.dot(nearest);
        let half = libm::sqrt(if discriminant > 0.0 { discriminant / a } else { 0.0 });
        let root = if f64::from(t) < along { along - half } else { along + half };
        let point = f + d * root;
        let normal = (point / libm::sqrt(point.dot(point))).as_vec3();
        let position = (self.centre.as_dvec3() + normal.as_dvec3() * radius).as_vec3();
        // A ray that f32 takes to graze the sphere, and that misses it in truth, has no root: the nearest point is meant.
        let grazing = libm::sqrt(if discriminant < 0.0 { -discriminant / a } else { 0.0 });
        // What f64 itself is off by: a few roundings of the discriminant's terms, through the root's slope.
        let noise = 16.0 * f64::EPSILON * (f.dot(f) + radius * radius) / a;
        let floor = libm::sqrt(noise);
        let own = noise / if half > floor { half } else { floor } + 8.0 * f64::EPSILON * along.abs();
        let off = (f64::from(t) - root).abs() + grazing + own;
        SurfacePoint {
            t,
            test_error: gamma(12) * self.radius,
            t_error: (off as f32).next_up() + gamma(2) * t.abs(),
            position,
            error: position.abs() * gamma(1) + Vec3::splat(gamma(2) * self.radius),
            normal,
            uv: [0.0; 2],
        }
    }
}
