//! The default: whichever costs less by what is known.
//!
//! A page that comes here costs two messages and its bytes once, shared by all rays that will want it; a ray that goes to
//! its page costs its own bytes and its part of two messages, every time. How many will want the page is taken to be as
//! many as wanted it lately. Where the owner has more to do than this node, rays that stay here are traced sooner, and
//! that counts for fetching.

use super::{Choice, Situation};
use hybray_wire::RayRecord;

/// Rays that a frame is taken to hold when it goes, if more do not wait for it already: others join while it waits.
const FRAME: u32 = 16;

pub(super) fn decide(s: &Situation) -> Choice {
    let bytes = |n: u64| n * u64::from(s.link.byte_ps) / 1000;
    let (message, ray) = (u64::from(s.link.message_ns), u64::from(s.ray_ns));
    let uses = u64::from(s.uses.max(s.rays).max(1));
    let fetch = 2 * message + bytes(u64::from(s.page_bytes));
    let frame = u64::from((s.rays + s.outbox).max(FRAME).min(s.granularity.max(1)));
    let forward = uses * (bytes(size_of::<RayRecord>() as u64) + 2 * message / frame);
    // What is evened out by keeping these rays.
    let behind = u64::from(s.owner_load.saturating_sub(s.load)) / 2;
    let sooner = behind.min(u64::from(s.rays)) * ray;
    if fetch <= forward + sooner { Choice::Fetch } else { Choice::Forward }
}
