//! Axis-aligned boxes and the slab interval.

use crate::Vec3;
use crate::simd::Lanes;

/// A closed box. Empty if `lo` is above `hi` on any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub lo: Vec3,
    /// Greatest corner.
    pub hi: Vec3,
}

impl Aabb {
    /// Contains nothing; the union with it changes nothing.
    pub const EMPTY: Self = Self { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

    /// What fills an unused slot of a wide node: no ray and no bundle meets it, and its arithmetic gives no NaN, as that
    /// of infinite corners would.
    pub const UNUSED: Self = Self { lo: Vec3::MAX, hi: Vec3::MIN };

    /// The least box around `points`.
    #[must_use]
    #[inline]
    pub fn around(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |b, &p| b.union(&Self { lo: p, hi: p }))
    }

    /// The least box around both.
    #[must_use]
    #[inline]
    pub fn union(&self, b: &Self) -> Self {
        let pick = |f: fn(f32, f32) -> bool, a: Vec3, b: Vec3| {
            Vec3::new(
                if f(a.x, b.x) { a.x } else { b.x },
                if f(a.y, b.y) { a.y } else { b.y },
                if f(a.z, b.z) { a.z } else { b.z },
            )
        };
        Self { lo: pick(|a, b| a < b, self.lo, b.lo), hi: pick(|a, b| a > b, self.hi, b.hi) }
    }

    /// What both contain; empty if they share no point.
    #[must_use]
    #[inline]
    pub fn intersection(&self, b: &Self) -> Self {
        Self { lo: self.lo.max(b.lo), hi: self.hi.min(b.hi) }
    }

    /// Whether they share a point; faces count.
    #[must_use]
    #[inline]
    pub fn overlaps(&self, b: &Self) -> bool {
        self.lo.cmple(b.hi).all() && b.lo.cmple(self.hi).all()
    }

    /// Whether `b` lies inside; an empty box lies inside everything.
    #[must_use]
    #[inline]
    pub fn contains(&self, b: &Self) -> bool {
        b.is_empty() || (self.lo.cmple(b.lo).all() && self.hi.cmpge(b.hi).all())
    }

    /// Whether it holds no point.
    #[must_use]
    #[inline]
    pub fn is_empty(&self) -> bool {
        !self.lo.cmple(self.hi).all()
    }

    /// Half the surface: what the surface-area heuristic compares. 0 if empty.
    #[must_use]
    #[inline]
    pub fn half_area(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let e = self.hi - self.lo;
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// The greatest absolute coordinate of its corners.
    #[must_use]
    pub fn magnitude(&self) -> f32 {
        self.lo.abs().max(self.hi.abs()).max_element()
    }
}

/// What a slab's far side is widened by: two units in the last place, the error of the reciprocal, the difference and
/// the product together (Ize, *Robust BVH Ray Traversal*, 2013).
pub const SLAB_WIDEN: f32 = 1.0 + 2.0 * f32::EPSILON;

/// The interval of `t` in which each ray is inside its box, given the planes that it meets first and last on each axis.
///
/// Entry starts at `near`; exit at infinity. `(plane - origin) * inverse` is NaN only for a ray that lies in the plane,
/// and such a plane bounds nothing: NaN is dropped by the order of the operands. All operations round monotonely, so a
/// box that contains another is entered no later and left no earlier.
#[inline(always)]
pub fn slab<F: Lanes>(origin: &[F; 3], inverse: &[F; 3], near_planes: &[F; 3], far_planes: &[F; 3], near: F) -> (F, F) {
    let mut entry = near;
    let mut exit = near.splat_like(f32::INFINITY);
    for i in 0..3 {
        entry = ((near_planes[i] - origin[i]) * inverse[i]).or_greater(entry);
        exit = ((far_planes[i] - origin[i]) * inverse[i]).or_less(exit);
    }
    (entry, exit * exit.splat_like(SLAB_WIDEN))
}
