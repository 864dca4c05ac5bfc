//! Which nodes may be given tiles at all? The 1995 report's criteria (chapter 6.2, table 6.2), decided before the start.

/// Which nodes are given tiles: all others only trace what is sent to them. None of it changes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Criterion {
    /// Every node.
    #[default]
    All,
    /// Every node but the one where the host is: node 1.
    AllButHost,
    /// Those whose voxel lies at the boundary of the grid.
    Location,
    /// Those with so many objects at most.
    Objects(u64),
}

/// What is known of a node before the picture begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The host is there.
    pub has_host: bool,
    /// Its voxel lies at the boundary of the grid.
    pub at_boundary: bool,
    /// Objects in its pages.
    pub objects: u64,
}

/// Whether a node may be given tiles.
#[must_use]
pub const fn admits(criterion: Criterion, node: &Candidate) -> bool {
    match criterion {
        Criterion::All => true,
        Criterion::AllButHost => !node.has_host,
        Criterion::Location => node.at_boundary,
        Criterion::Objects(most) => node.objects <= most,
    }
}
