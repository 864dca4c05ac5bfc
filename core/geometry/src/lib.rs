//! Every floating-point decision of Hybray: rays, boxes, primitives, pyramids and bundles, with the same bits on every
//! machine.
//!
//! The crate knows no tree, no page and no material. Its rules (DESIGN section 13, `docs/NUMERICS.md`):
//!
//! - **One order of operations.** Each test is written once, over [`simd::Lanes`]; a scalar call is the same code with
//!   one lane's worth of data. Nothing is fused, nothing is reassociated.
//! - **The own-box rule.** A primitive is hit where its test accepts *and* the ray's slab interval of the primitive's own
//!   box is not empty; its distance is the test's, clamped to that interval. So no tree, whatever its boxes, can change
//!   which hit is nearest, as long as its boxes contain the primitives' own.
//! - **Ties** go to the least primitive id.
//! - Positions come from the primitive (barycentrics, re-projection) with an absolute error bound, never from `o + t d`.
#![no_std]
#![deny(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

mod aabb;
mod bundle;
mod cone;
mod hit;
mod pyramid;
mod ray;
pub mod simd;
mod sphere;
mod triangle;

pub use aabb::{Aabb, SLAB_WIDEN, slab};
pub use bundle::Bundle;
pub use cone::Cone;
pub use glam::Vec3;
pub use hit::{Candidate, SurfacePoint};
pub use pyramid::Pyramid;
pub use ray::{LaneRay, Ray, RayKernel, turn};
pub use sphere::{Sphere, sphere_lanes};
pub use triangle::{Triangle, TriangleLanes, triangle_lanes};

/// Half a unit in the last place of 1: the relative error of one rounded operation.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` rounded operations (Higham's gamma).
#[must_use]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// `v` over its length, the same bits on every target; not finite if `v` is zero or its square overflows.
#[must_use]
#[inline]
pub fn normalize(v: Vec3) -> Vec3 {
    v / libm::sqrtf(v.dot(v))
}
