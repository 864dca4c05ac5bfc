//! Ways to get the protocol wrong, one at a time: the checker must find each.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bug {
    /// Rays are taken whether there is room or not.
    TakesWithoutRoom,
    /// Records are free as soon as they are sent.
    FreesBeforeTook,
    /// A second frame is sent before the first is answered.
    SendsTwoFrames,
    /// Pages are asked for without a place to land in.
    FetchesWithoutPlace,
    /// A place is given up while its page is landing.
    GivesUpLanding,
    /// A place is given up though rays wait for its page.
    GivesUpWanted,
    /// No place is kept for the lane.
    LaneHasNoPlace,
    /// The ray that the lane has in hand is not fetched for.
    LaneDoesNotFetch,
    /// Rays go to an owner that has no room, whatever the policy, and go there again when they come back: nothing is fetched
    /// instead.
    ForwardsToTheFull,
    /// Peers are asked for more pages than they hear.
    AsksForMore,
    /// Pages that were given up still count as ready.
    StaysReady,
    /// A ray's entry leaves its children out.
    EntryWithoutChildren,
    /// Entries are sent again.
    PaysTwice,
    /// Who was to be given a share is not told that there is none, or that it was refused: as it was before this model.
    ForgetsShare,
}
