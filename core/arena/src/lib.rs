//! A budget of memory, carved once into slices, and containers in them that hand the item back when they are full.
//!
//! - [`Arena`] cuts borrowed memory into typed slices, term by term, until it is sealed. [`Sum`] adds up the same terms
//!   without any memory, so that a plan can be printed before anything starts. Both count the same bytes.
//! - [`Slab`] keeps any number of queues ([`List`]) in one pool of items.
//! - [`Ring`] is one queue with a room of its own.
//!
//! The crate never allocates, grows, drops an item or frees a slice, and knows nothing of what is stored. All sizes are in
//! bytes, and bytes are counted in lines of [`LINE_BYTES`]: every slice begins at a line. So what a set of terms takes
//! depends neither on their order nor on where the memory lies; only the line in which the memory begins may be lost on top.
//! (DESIGN section 2, law 2.)
#![no_std]
#![deny(unsafe_code)]

mod arena;
mod carve;
mod ring;
mod slab;
mod sum;

pub use arena::{Arena, Short};
pub use ring::Ring;
pub use slab::{List, Slab};
pub use sum::{LINE_BYTES, Sum, TERMS_MAX, Term};

/// The README's sample is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
