//! Spheres: the quadratic of *Ray Tracing Gems*, chapter 7, whose discriminant does not cancel for distant spheres.

use crate::simd::{Lanes, Mask, ONE_LANE};
use crate::{Aabb, Candidate, LaneRay, RayKernel, SurfacePoint, Vec3, gamma, normalize};

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

    /// The place of a hit that [`Sphere::hit`] found at `t`: projected back onto the sphere.
    #[must_use]
    pub fn surface(&self, ray: &RayKernel, t: f32) -> SurfacePoint {
        let (o, d) = (Vec3::from_array(ray.origin), Vec3::from_array(ray.direction));
        let f = o - self.centre;
        let normal = normalize(f + d * t);
        let along = normal * self.radius;
        // The discriminant's error moves the root by error / (2 root), and by no more than its own root.
        let a = d.dot(d);
        let nearest = f + d * (-f.dot(d) / a);
        let discriminant = self.radius * self.radius - nearest.dot(nearest);
        let reach = self.radius + gamma(4) * f.length();
        let error = gamma(10) * reach * reach + 2.0 * gamma(6) * f.length() * reach;
        let moved = error / libm::sqrtf(if discriminant > error { discriminant } else { error });
        SurfacePoint {
            t,
            t_error: moved / libm::sqrtf(a) + gamma(6) * t.abs(),
            position: self.centre + along,
            test_error: gamma(12) * self.radius,
            error: along.abs() * gamma(6) + self.centre.abs() * gamma(2),
            normal,
            uv: [0.0; 2],
        }
    }
}
