//! A bundle of rays as four planes and a near bound that contain every one of them (DESIGN section 5).

use core::borrow::Borrow;

use crate::simd::{Lanes, Mask, Simd};
use crate::{Aabb, Ray, UNIT_ROUNDOFF, Vec3, normalize};

/// Four planes and an axis around some rays. What is outside a plane, or behind the axis, is met by none of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bundle {
    /// Inward normals of four planes, then the axis.
    normals: [Vec3; 5],
    /// Least value of `normal . p` of any point of any ray.
    offsets: [f32; 5],
    /// What each value computed for a box may be off by.
    margins: [f32; 5],
    /// No ray starts further along the axis than this.
    last_origin: f32,
    /// Units of `t` of the fastest ray for one unit along the axis, rounded down.
    t_per_depth: f32,
}

/// Rays further from the axis than this (cosine) are not a bundle: its planes would be almost flat.
const COSINE_MIN: f32 = 0.1;

impl Bundle {
    /// The bundle around `rays` in a scene whose boxes (and the rays' origins) have no coordinate beyond `magnitude`.
    ///
    /// `None` if there are no rays, or they are not coherent: then they are traced singly. Bounded by two passes over
    /// the rays. Everything that rounding can do is in the margins: `tests/extremes` checks them in `f64`.
    #[must_use]
    pub fn around<R: Borrow<Ray>>(rays: impl Iterator<Item = R> + Clone, magnitude: f32) -> Option<Self> {
        let sum = rays.clone().map(|r| r.borrow().direction).fold(Vec3::ZERO, |s, d| s + d / d.length());
        let w = normalize(sum);
        if !w.is_finite() {
            return None;
        }
        let least = w.abs();
        let other = if least.x <= least.y && least.x <= least.z {
            Vec3::X
        } else if least.y <= least.z {
            Vec3::Y
        } else {
            Vec3::Z
        };
        let u = normalize(w.cross(other));
        let v = w.cross(u);

        let (mut slope_lo, mut slope_hi) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut fastest = 0.0f32;
        for ray in rays.clone() {
            let d = ray.borrow().direction;
            let along = d.dot(w);
            if !(along >= COSINE_MIN * d.length()) {
                return None;
            }
            fastest = fastest.max(along);
            for (i, axis) in [u, v].into_iter().enumerate() {
                let slope = d.dot(axis) / along;
                slope_lo[i] = slope_lo[i].min(slope);
                slope_hi[i] = slope_hi[i].max(slope);
            }
        }
        let normals = [u - w * slope_lo[0], w * slope_hi[0] - u, v - w * slope_lo[1], w * slope_hi[1] - v, w];
        let mut offsets = [f32::INFINITY; 5];
        let mut last_origin = f32::NEG_INFINITY;
        let mut reach = magnitude;
        for ray in rays {
            let origin = ray.borrow().origin;
            reach = reach.max(origin.abs().max_element());
            for i in 0..5 {
                offsets[i] = offsets[i].min(normals[i].dot(origin));
            }
            last_origin = last_origin.max(w.dot(origin));
        }
        // A point of a ray is at most 2 sqrt(3) reach from its origin (inside the boxes), its slopes and both dot
        // products are off by a few roundings of terms of that size each, and slopes are at most 10.
        let margins = normals.map(|n| 96.0 * UNIT_ROUNDOFF * (n.abs().element_sum() + 1.0) * reach);
        let bounded =
            magnitude.is_finite() && reach.is_finite() && margins.iter().chain(&offsets).all(|m| m.is_finite());
        (bounded && fastest > 0.0).then_some(Self {
            normals,
            offsets,
            margins,
            last_origin: last_origin + margins[4],
            t_per_depth: (1.0 - 8.0 * UNIT_ROUNDOFF) / fastest,
        })
    }

    /// Which of eight boxes any ray of the bundle may meet, and the least `t` at which one could.
    #[inline(always)]
    pub fn meets<S: Simd>(&self, simd: S, lo: &[[f32; 8]; 3], hi: &[[f32; 8]; 3]) -> (u32, [f32; 8]) {
        let mut outside = 0;
        for i in 0..4 {
            // The corner furthest inward: if that is outside, all are.
            let value = self.value(simd, i, hi, lo);
            outside |= value.lt(simd.splat8(self.offsets[i] - self.margins[i])).bits();
        }
        // Behind: the whole box lies before the origins.
        let last = self.value(simd, 4, hi, lo);
        outside |= last.lt(simd.splat8(self.offsets[4] - self.margins[4])).bits();
        let depth = self.value(simd, 4, lo, hi) - simd.splat8(self.last_origin);
        let near = (depth * simd.splat8(self.t_per_depth)).or_greater(simd.splat8(0.0));
        (!outside & 0xff, near.to_array())
    }

    /// `normal . corner` for eight boxes: the corner with `upper` coordinates where the normal points up.
    #[inline(always)]
    fn value<S: Simd>(&self, simd: S, i: usize, upper: &[[f32; 8]; 3], lower: &[[f32; 8]; 3]) -> S::F8 {
        let n = self.normals[i].to_array();
        let term = |axis: usize| {
            let corner = if n[axis] >= 0.0 { &upper[axis] } else { &lower[axis] };
            simd.splat8(n[axis]) * simd.load8(corner)
        };
        term(0) + term(1) + term(2)
    }

    /// [`Bundle::meets`] for one box.
    #[must_use]
    pub fn meets_box(&self, aabb: &Aabb) -> bool {
        let eight = |v: Vec3| v.to_array().map(|x| [x; 8]);
        self.meets(crate::simd::Portable, &eight(aabb.lo), &eight(aabb.hi)).0 != 0
    }
}
