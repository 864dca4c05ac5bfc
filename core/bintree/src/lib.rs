//! Bintrees by midpoint or surface area, wide nodes cut into pages, and the single-ray walk: the same nearest hit as
//! testing every primitive, whatever the tree.
//!
//! The crate allocates nothing, recurses nowhere and runs on one thread: a caller lends it slices, and may build parts
//! side by side. The steps:
//!
//! 1. An [`Item`] for each primitive: its box, kind and number.
//! 2. [`sah`] or [`midpoint`] makes a binary tree of [`BinaryNode`]s over them, which [`reinsert`](mod@reinsert) betters.
//! 3. [`cut`] collapses it to wide nodes and cuts it into pages, and [`top`] puts the directory above them.
//! 4. [`walk`] finds the nearest hit, or any hit, of a ray.
//! 5. [`check()`] proves that a tree is what the walk needs.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "alloc")]
extern crate alloc;

mod binary;
pub mod check;
mod collapse;
pub mod cut;
pub mod midpoint;
pub mod reinsert;
pub mod sah;
pub mod top;
pub mod walk;

pub use binary::{BinaryNode, Item};
pub use check::check;
pub use collapse::Forest;

/// Levels of a binary tree at most; two of them make at most one level of wide nodes.
pub const BINARY_DEPTH_MAX: u32 = 2 * hybray_scene::DEPTH_MAX as u32 - 2;
