//! One step of a ray against the pages at hand: it hits and spawns, or it leaves, and what it brings goes to the film.
//!
//! A ray carries its weight, so nothing ever comes back to its parent (DESIGN section 4). A hit is a [`HitRecord`] with a
//! cursor: it stays until it has spawned its last child, one at a time. [`Lane`] finishes a ray depth first in as many
//! records as rays may be deep, which is what makes progress certain (DESIGN section 2, law 3).
#![no_std]
#![forbid(unsafe_code)]

mod hit;
mod lane;
mod layer;
mod scene;
mod together;

pub use hit::{HitRecord, Origin, surface, surface_point};
pub use lane::{Beyond, Lane, SHADOW_CHAIN_MAX, Sink, Walker, begin};
pub use layer::Layer;
pub use scene::Scene;
pub use together::{TOGETHER, Together, goes_together};
