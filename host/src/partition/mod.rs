//! Who gets what of a scene: voxels (report, chapter 3), and where their pages live.
//!
//! Pure functions: nothing here holds pages, opens files, or knows what a node is doing. Lengths are in the scene's
//! internal unit, memory in bytes.

mod barred;
mod budget;
mod light_cache;
mod owners;
mod pilot;
mod placement;
mod voxels;

pub(crate) use barred::square;
pub use barred::{NoCandidate, barred};
pub use budget::{Fit, NoFit, Wanted, page_bytes_for};
pub use light_cache::{LightCaches, light_caches};
pub use owners::{Misfit, PlacedPage, owners};
pub use pilot::{PILOT_RAYS, Parts, Pilot};
pub use placement::{copies, owners_by_use};
pub use voxels::{Plan, Step, VOXELS_MAX, Voxels};
