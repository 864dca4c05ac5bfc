//! PyraClip: a pyramid of rays against the caller's own bintree, front to back, never missing a cell.
//!
//! The form of van der Zwaan, Reinhard and Jansen, *Pyramid Clipping for Efficient Ray Traversal* (1995), appendix A of
//! the 1995 report. It needs three things of the caller: a tree that implements [`Bintree`], rays from one apex inside
//! a [`ClipPyramid`], and a test of his own objects. [`clip`] lists the leaves that the pyramid meets, nearest first;
//! [`traverse`] takes one ray after the other along that list. The crate allocates nothing, knows no object, page or
//! thread, and its work is bounded by the tree: at most [`MAX_DEPTH`] levels, on a stack of fixed size.
//!
//! | section | file |
//! |---|---|
//! | A.2, the tree | `tree` |
//! | A.2, pyramid made ready for clipping | `pyramid` |
//! | A.2, distances averaged on the way down (figure A.5), and what they may be off by | `distances` |
//! | A.2, first test: outcodes and nine subspaces (figure A.2) | `classify` |
//! | A.2, second test: edges (equation A.1), both exceptions | `edge` |
//! | A.2, nearest child first; the cliplist | `cliplist` |
//! | A.3, exit points | `traverse` |
//!
//! # What is promised
//!
//! - **Nothing is missed.** The cliplist holds every leaf that any ray of the pyramid touches, closed faces included,
//!   and every leaf that `f32` slab arithmetic takes a ray to touch. [`traverse`] finds exactly the hit that testing
//!   every object would find: least distance first, then least id.
//! - **Little is kept in vain.** A leaf in the list overlaps the pyramid, or misses it by no more than the leaning of
//!   [`ClipPyramid`] (2e-5 of its distance, up to an opening of 100 degrees) and the margins of `distances`.
//!
//! # Where it departs from the paper
//!
//! - Every decision has a margin; what lies within it is kept.
//! - The four planes cut space into more than the paper's nine subspaces: what is behind the apex is outside several,
//!   and a wall there has vertices in A, C, F and H too. A fifth plane through the apex, the sum of the four, tells
//!   whether a cell is ahead of it; only then do those four subspaces mean that it surrounds the pyramid.
//! - "Three consecutive subspaces" is taken as what makes it right: all vertices are beyond one plane.
//! - A cell that no edge test keeps and that is not wholly ahead is a case that the paper leaves out: it surrounds the
//!   pyramid only if the axis ray meets it.
//! - A cell that holds the apex is kept untested.
//! - A split off the midpoint is allowed: its four vertices' distances are computed anew.
//! - In A.3, comparing exits alone neither keeps all that it must nor drops all that it can: see [`traverse`].
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod classify;
mod cliplist;
mod distances;
mod edge;
mod midpoint;
mod packet;
mod pyramid;
pub mod shadow;
mod span;
mod traverse;
mod tree;
pub mod wide;

pub use classify::{Verdict, classify};
pub use cliplist::{ClipCell, ClipCounts, ClipError, MAX_DEPTH, STACK_BYTES, clip, clip_into};
pub use pyramid::ClipPyramid;
pub use traverse::{TraverseCounts, traverse};
pub use tree::{Bintree, Split, midpoint};
