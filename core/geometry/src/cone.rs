//! Cones and cylinders as NFF has them: open, seen from both sides.
//!
//! Their quadratic cancels badly in `f32`; they are few in most scenes, so it is solved in `f64`, one at a time.

use crate::{Aabb, Candidate, RayKernel, SurfacePoint, Vec3, gamma};
use glam::DVec3;

/// The side of a truncated cone between two circles around its axis; a cylinder if the radii are equal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Centre of the first circle.
    pub base: Vec3,
    /// Its radius, 0 or more.
    pub base_radius: f32,
    /// Centre of the second circle, apart from the first.
    pub apex: Vec3,
    /// Its radius, 0 or more.
    pub apex_radius: f32,
}

/// A cone in `f64`, seen from its base.
struct Frame {
    axis: DVec3,
    axis_squared: f64,
    radius: f64,
    /// Change of the radius from base to apex.
    slope: f64,
}

impl Frame {
    /// Height (0 at the base, 1 at the apex) of `p`, and its part across the axis.
    fn split(&self, p: DVec3) -> (f64, DVec3) {
        let height = p.dot(self.axis) / self.axis_squared;
        (height, p - self.axis * height)
    }

    fn radius_at(&self, height: f64) -> f64 {
        self.radius + self.slope * height
    }
}

impl Cone {
    fn frame(&self) -> Frame {
        let axis = self.apex.as_dvec3() - self.base.as_dvec3();
        let (r0, r1) = (f64::from(self.base_radius), f64::from(self.apex_radius));
        Frame { axis, axis_squared: axis.dot(axis), radius: r0, slope: r1 - r0 }
    }

    /// The box around both circles, rounded outwards.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        let f = self.frame();
        // A circle of radius r across a unit axis a reaches r sqrt(1 - a_i^2) along axis i.
        let across = (DVec3::ONE - f.axis * f.axis / f.axis_squared).max(DVec3::ZERO);
        let reach = DVec3::new(libm::sqrt(across.x), libm::sqrt(across.y), libm::sqrt(across.z));
        let circle = |centre: Vec3, radius: f32| {
            let (c, r) = (centre.as_dvec3(), reach * f64::from(radius));
            let down = |x: f64| (x as f32).next_down();
            let up = |x: f64| (x as f32).next_up();
            let (lo, hi) = (c - r, c + r);
            Aabb { lo: Vec3::new(down(lo.x), down(lo.y), down(lo.z)), hi: Vec3::new(up(hi.x), up(hi.y), up(hi.z)) }
        };
        circle(self.base, self.base_radius).union(&circle(self.apex, self.apex_radius))
    }

    /// The hit of `ray` before `best`, if there is one: the first at or after `t_min`, clamped to the own box.
    #[must_use]
    pub fn hit(&self, ray: &RayKernel, id: u32, best: &Candidate) -> Option<Candidate> {
        let f = self.frame();
        let d = Vec3::from_array(ray.direction).as_dvec3();
        let m = Vec3::from_array(ray.origin).as_dvec3() - self.base.as_dvec3();
        let ((dh, dx), (mh, mx)) = (f.split(d), f.split(m));
        let r = f.radius_at(mh);
        let a = dx.dot(dx) - f.slope * f.slope * dh * dh;
        let b = mx.dot(dx) - f.slope * dh * r;
        let c = mx.dot(mx) - r * r;
        let discriminant = b * b - a * c;
        if !(discriminant >= 0.0) {
            return None;
        }
        let root = libm::sqrt(discriminant);
        let q = if b < 0.0 { root - b } else { -root - b };
        let (t0, t1) = (q / a, c / q);
        let (near, far) = ray.slab(&self.aabb());
        if !(near <= far) {
            return None;
        }
        let ordered = if t0 < t1 { [t0, t1] } else { [t1, t0] };
        ordered.into_iter().find_map(|t| {
            let height = mh + t * dh;
            if !((0.0..=1.0).contains(&height) && f.radius_at(height) >= 0.0) {
                return None;
            }
            let t = t as f32;
            let t = if t < near {
                near
            } else if t > far {
                far
            } else {
                t
            };
            let found = Candidate { t, id };
            (t >= ray.t_min && found.precedes(best)).then_some(found)
        })
    }

    /// The place of a hit that [`Cone::hit`] found at `t`: projected back onto the side.
    #[must_use]
    pub fn surface(&self, ray: &RayKernel, t: f32) -> SurfacePoint {
        let f = self.frame();
        let o = Vec3::from_array(ray.origin).as_dvec3() - self.base.as_dvec3();
        let (height, across) = f.split(o + Vec3::from_array(ray.direction).as_dvec3() * f64::from(t));
        let height = height.clamp(0.0, 1.0);
        let length = libm::sqrt(across.dot(across));
        let side =
            if length > 0.0 { across / length } else { (f.axis / libm::sqrt(f.axis_squared)).any_orthonormal_vector() };
        let position = (self.base.as_dvec3() + f.axis * height + side * f.radius_at(height)).as_vec3();
        let normal = side * f.axis_squared - f.axis * f.slope;
        let normal = (normal / libm::sqrt(normal.dot(normal))).as_vec3();
        SurfacePoint {
            t,
            t_error: gamma(4) * t.abs(),
            position,
            test_error: gamma(4) * self.aabb().magnitude(),
            error: position.abs() * gamma(2) + Vec3::splat(gamma(1) * (self.base_radius + self.apex_radius)),
            normal,
            uv: [0.0; 2],
        }
    }
}
