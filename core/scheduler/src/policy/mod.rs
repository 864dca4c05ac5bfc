//! Forward or fetch? Who is given tiles, and when? Pure functions: what is known in, a choice out (DESIGN section 9).

mod criterion;
mod data_parallel;
mod demand_driven;
mod grid;
mod hybrid;
mod hybrid_1995;
mod subhosts;
mod tiles;

pub use criterion::{Candidate, Criterion, admits};
pub use grid::Grid;
pub use subhosts::subhost;
pub use tiles::{Hand, Tiles, gives, missing};

use hybray_wire::RayKind;

/// How work and pages are brought together. None of them changes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// Rays go to the pages (the report's chapter 6.3).
    DataParallel,
    /// Pages come to the rays (POV||Ray, sections 1 and 2).
    DemandDriven,
    /// Primary rays demand driven, the others data parallel (the report's chapters 3 and 4).
    Hybrid1995,
    /// Whichever costs less.
    #[default]
    Hybrid,
}

impl Policy {
    /// All of them, with the names that users give them.
    pub const ALL: [(&str, Self); 4] = [
        ("hybrid", Self::Hybrid),
        ("hybrid-1995", Self::Hybrid1995),
        ("data-parallel", Self::DataParallel),
        ("demand-driven", Self::DemandDriven),
    ];
}

/// What a link is known to cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkCost {
    /// A message, nanoseconds: sender and receiver together.
    pub message_ns: u32,
    /// A byte on its way, picoseconds.
    pub byte_ps: u32,
}

/// What is known when rays wait for a page that is not at hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situation {
    /// Rays that wait for the page.
    pub rays: u32,
    /// What the oldest of them is.
    pub kind: RayKind,
    /// Bytes of the page.
    pub page_bytes: u32,
    /// How often the page was wanted lately, these rays included.
    pub uses: u32,
    /// Whether the page's owner has said that it has no room.
    pub owner_is_full: bool,
    /// Whether the page's owner is this node's peer at all: if not, its home has the page, and nobody takes the rays.
    pub owner_traces: bool,
    /// Rays that are to go to the owner already.
    pub outbox: u32,
    /// Rays that wait at the owner, as it said last.
    pub owner_load: u32,
    /// Rays that wait here for pages at hand.
    pub load: u32,
    /// Rays that may go into one message.
    pub granularity: u32,
    /// What a ray takes to trace, nanoseconds.
    pub ray_ns: u32,
    /// What the link costs.
    pub link: LinkCost,
}

/// What is done about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The rays go to the page's owner.
    Forward,
    /// The page comes here.
    Fetch,
}

/// Decides. A ray that can be forwarded to nobody fetches, whatever the policy: nothing waits for room that may never come.
#[must_use]
pub fn decide(policy: Policy, s: &Situation) -> Choice {
    if !s.owner_traces || s.owner_is_full {
        return Choice::Fetch;
    }
    match policy {
        Policy::DataParallel => data_parallel::decide(s),
        Policy::DemandDriven => demand_driven::decide(s),
        Policy::Hybrid1995 => hybrid_1995::decide(s),
        Policy::Hybrid => hybrid::decide(s),
    }
}
