//! What a test finds, and what is known of the place.

use crate::Vec3;

/// A possible nearest hit: what a walk keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Global id of the primitive; [`Candidate::NOTHING`] if none.
    pub id: u32,
}

impl Candidate {
    /// The id of no primitive: greater than all.
    pub const NOTHING: u32 = u32::MAX;

    /// No hit up to `t_max`.
    #[must_use]
    pub const fn none(t_max: f32) -> Self {
        Self { t: t_max, id: Self::NOTHING }
    }

    /// Whether this goes before `other`: nearer, or as near with a lower id. Never, if `t` is NaN.
    #[must_use]
    #[inline(always)]
    pub fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.id < other.id)
    }

    /// Whether a primitive was hit.
    #[must_use]
    pub fn is_hit(&self) -> bool {
        self.id != Self::NOTHING
    }
}

/// A hit worked out from its primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Bound on the absolute error of `t` before it was clamped to the own box.
    pub t_error: f32,
    /// Point on the primitive.
    pub position: Vec3,
    /// Bound on the absolute error of `position` on each axis.
    pub error: Vec3,
    /// Bound on how far from the primitive a ray that starts at `position` may still be found to meet it: the error
    /// of the test itself, which is relative to the primitive's size. Never 0: a position may be exact, as on a plane
    /// through the origin, and a ray from there still meets the plane at `t` = 0.
    pub test_error: f32,
    /// Unit normal of the primitive: counterclockwise side of a triangle, outside of a sphere or cone.
    pub normal: Vec3,
    /// Weights of a triangle's second and third vertex; 0 for other primitives.
    pub uv: [f32; 2],
}
