//! The decisions on which it rests that nothing waits in vain (DESIGN section 2, law 3): who takes rays, which place of
//! the cache may go, who may ask, send and begin, and what becomes of what was refused.
//!
//! Pure functions of a few numbers. The node calls them, and so does the model of the protocol (`tests/model`), which tries
//! every order of events with small numbers: what is checked there is what runs here. [`crate::policy::decide`] and
//! [`crate::Balance`] are the others that both call.

use crate::server::FETCHES;

/// How far a place of the cache is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlaceState {
    /// No page is in it.
    Free,
    /// It is reserved, and its page on its way.
    Landing,
    /// Its page is at hand.
    Whole,
}

/// Whether a frame of `rays` is taken: all of them or none. A share of the pool is kept for the rays of a node's own tiles;
/// else they would only ever go where the pool is.
#[must_use]
pub const fn takes(rays: usize, free: usize, capacity: usize) -> bool {
    free >= rays + capacity / 8
}

/// Whether a place that all share can be given to another page. One that is landing is certain to come, and one that rays
/// wait for is needed: only the lane's own place goes all the same ([`lane_can_have`]).
#[must_use]
pub const fn can_go(place: PlaceState, rays_wait: bool) -> bool {
    match place {
        PlaceState::Free => true,
        PlaceState::Landing => false,
        PlaceState::Whole => !rays_wait,
    }
}

/// Whether the lane can have the place that is kept for it. Whoever else waits for the page in it waits on: the lane must
/// come on.
#[must_use]
pub const fn lane_can_have(place: PlaceState) -> bool {
    !matches!(place, PlaceState::Landing)
}

/// Whether one more page may be on its way to a node that has `open` under way. The lane has one beyond all others.
#[must_use]
pub const fn may_request(open: usize, requests: usize, requests_max: usize, for_lane: bool) -> bool {
    if for_lane { open <= requests_max } else { open < requests }
}

/// Whether a peer may be asked for one more page when `asked` that it was asked for have not come: a peer
/// hears no more than that.
#[must_use]
pub const fn may_ask(asked: usize) -> bool {
    asked < FETCHES
}

/// Whether rays may be sent to a peer now: one frame at a time is under way to each.
#[must_use]
pub const fn may_send(in_flight: usize) -> bool {
    in_flight == 0
}

/// Whether the records of a frame are free: when it was taken. Else they wait here again.
#[must_use]
pub const fn frees(taken: bool) -> bool {
    taken
}

/// Whether rays for whose page there is no place go to its owner, though it had no room for others the last time: unless
/// they `moved` since their last page, be it in vain.
#[must_use]
pub const fn goes_again(moved: bool, owner_is_full: bool, owner_traces: bool) -> bool {
    !moved && owner_is_full && owner_traces
}

/// Whether the lane stands still until the page of the ray in hand has come. There was no room for that ray in the pool:
/// it is finished on the spot, though room came meanwhile. So each ray that the lane stands still for ends, or is a record
/// of the lane, which gets no shallower before a ray ends.
#[must_use]
pub const fn lane_waits(at_hand: bool) -> bool {
    !at_hand
}

/// Whether a ray that was taken up so many times in vain since its hit is known, for want of texels, is finished on the spot: a hit
/// needs up to `texel_pages` of them at once, and a small cache may never have all. Twice as often is enough where it may.
#[must_use]
pub const fn goes_to_the_lane(tries: u8, texel_pages: usize) -> bool {
    tries as usize > 2 * texel_pages + 2
}

/// Whether a new bundle may be begun: old work is finished first.
#[must_use]
pub const fn may_begin(waiting: usize, capacity: usize, in_system: usize) -> bool {
    waiting < in_system && capacity - waiting >= capacity / 2
}

/// Whether partial sums are sent now, or wait for more: a node that has nothing better to do sends, and one that has little
/// room left.
#[must_use]
pub const fn pays(idle: bool, free: usize, capacity: usize, owed: usize, granularity: usize) -> bool {
    idle || free * 2 < capacity || owed >= granularity
}

/// Whether a frame of rays, taken or not, means that somebody was told to share with this node. One that was not taken may
/// have been a share: better to say once too often that there is nothing to do than never.
#[must_use]
pub const fn was_helped(taken: bool, settled_primary: bool) -> bool {
    !taken || settled_primary
}

/// Whether a node that was given a share says that it has nothing to do again.
#[must_use]
pub const fn says_idle(helped: bool, idle: bool, waiting: usize) -> bool {
    helped && idle && waiting == 0
}
