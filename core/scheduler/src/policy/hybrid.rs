//! The default: whichever costs less by what is known.
//!
//! A page that comes here costs two messages and its bytes once, shared by all rays that will want it; a ray that goes to
//! its page costs its own bytes and its part of a message, every time, and waits behind what the owner has to do. How many
//! will want the page is taken to be as many as wanted it lately.

use super::{Choice, Situation};
use hybray_wire::RayRecord;

pub(super) fn decide(s: &Situation) -> Choice {
    let bytes = |n: u64| n * u64::from(s.link.byte_ps) / 1000;
    let message = u64::from(s.link.message_ns);
    let uses = u64::from(s.uses.max(s.rays).max(1));
    let fetch = (2 * message + bytes(u64::from(s.page_bytes))) / uses;
    let frame = u64::from(s.rays.clamp(1, s.granularity.max(1)));
    let mut forward = bytes(size_of::<RayRecord>() as u64) + 2 * message / frame;
    // What waits at the owner beyond what waits here is time that the ray loses there.
    let behind = u64::from(s.owner_load.saturating_sub(s.load));
    forward += behind * u64::from(s.ray_ns) / uses;
    // A node without work does best to bring some about where it is.
    if s.idle {
        forward *= 2;
    }
    if fetch <= forward { Choice::Fetch } else { Choice::Forward }
}
