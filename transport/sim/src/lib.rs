//! A network on a virtual clock: what the simulator (DESIGN section 12) has in place of cables.
//!
//! Frames carry their real bytes from one participant to another, over directed physical links that each have a latency
//! and a rate and carry one frame at a time: a frame is stored whole at each place on its way before it goes on, and
//! waits in the order of requests where a link is busy. Time is whole nanoseconds, comes in from outside, and is never
//! read from a clock; all arithmetic is exact. The same calls give the same arrivals, to the last digit, on any
//! machine.
//!
//! Nothing here knows what frames mean, or what it costs a participant to write or read one.
#![forbid(unsafe_code)]

mod model;
mod network;
mod route;

pub use model::{LinkModel, NetworkModel, Topology};
pub use network::{End, LinkCounts, Network, Traffic};
