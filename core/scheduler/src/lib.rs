//! Dispatcher, node, ledger and film: state machines and pure functions that know no clock, thread or socket.
//!
//! A machine has three verbs. `handle` takes in what arrived; `step` does a bounded amount of work; `poll` sends what
//! the link has room for, and keeps the rest. Time comes in as nanoseconds. The same machines run on threads, under
//! MPI, on a board and in the simulator.
#![no_std]
#![forbid(unsafe_code)]

mod chunk;
mod clips;
mod dispatcher;
mod film;
mod ledger;
mod master;
mod node;
mod plan;
pub mod policy;
pub mod rules;
mod server;

pub use chunk::{Shares, chunk};
pub use clips::{Clipper, Unclipped};
pub use dispatcher::{Dispatcher, NodeState, Options};
pub use film::{Film, FilmError, Fixed, Step, TileState, hash_sums};
pub use ledger::Balance;
pub use master::{Master, NodeReport, Outcome, Progress};
pub use node::{
    All, BUNDLE, Backing, Cache, CachePlace, Charged, DEPTH_MAX, HighWater, Landed, Limits, Node, NodeMemory, Own,
    REQUESTS_MAX, Settings, Store, Traffic, camera, can_draw,
};

pub use plan::{Plan, PlanError, Sizes, bytes_of_copies};
pub use server::{Asked, FETCHES, PART_BYTES, PageServer};

use hybray_link::{Link, Peer};
use hybray_wire::{HEAD_BYTES_MAX, Message, encode};

/// Sends a message about `picture` without a body; false if there is no room now.
pub(crate) fn send(link: &mut dyn Link, to: Peer, picture: u16, message: &Message) -> bool {
    link.send(to, HEAD_BYTES_MAX, &mut |room| {
        encode(picture, message, room, |_| {}).expect("the room for a message is enough for any")
    })
}

/// The README's sample is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
