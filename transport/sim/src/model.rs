//! What a network is made of.

use crate::route::Routes;
use hybray_link::Peer;

/// How participants are connected. The host is participant 0, nodes count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topology {
    /// Each participant has one link in each direction to a switch that is never busy itself.
    Crossbar,
    /// Nodes fill the rows of a grid of routers from node 1 on; frames go along the row first, then along the column.
    /// The host hangs on node 1's router by a link of its own. Routers of an unfinished last row are there all the
    /// same.
    Mesh2d {
        /// Nodes in a row, 1 or more.
        columns: u16,
    },
    /// Each participant is connected to the one before it and the one after it.
    Chain,
    /// One medium, that one frame at a time crosses.
    Bus,
}

/// A physical link, in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkModel {
    /// From a frame's last byte sent to its last byte there; the next frame may be on its way meanwhile.
    pub latency_ns: u64,
    /// How fast bytes are sent, 1 or more.
    pub bytes_per_second: u64,
}

impl LinkModel {
    /// How long a frame keeps the link busy, rounded up. Exact: a frame has less than 2^32 bytes.
    #[must_use]
    pub fn crossing_ns(&self, bytes: u32) -> u64 {
        (u64::from(bytes) * 1_000_000_000).div_ceil(self.bytes_per_second.max(1))
    }
}

/// A network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkModel {
    /// How participants are connected.
    pub topology: Topology,
    /// Every link.
    pub link: LinkModel,
    /// The host's, in place of `link`: to the switch, to node 1's router, to node 1 of a chain. A bus has no such link.
    pub host_link: LinkModel,
    /// Frames that one participant may have on the way to another, or unread there, 1 or more.
    pub room_frames: u32,
}

impl NetworkModel {
    /// Room where nothing says otherwise.
    pub const ROOM_FRAMES: u32 = 8;

    /// The longest that a frame of at most `bytes_max` can be on its way between two of so many participants, nanoseconds:
    /// on each link of the longest route it waits for every other frame that the network has room for and whose route has
    /// the link, too. Participants read what arrives in their own time: until they do, it takes room.
    #[must_use]
    pub fn way_ns(&self, peers: Peer, bytes_max: u32) -> u128 {
        let (links, pairs) = Routes::new(self, peers).most();
        let crossing_ns = u128::from(self.link.crossing_ns(bytes_max).max(self.host_link.crossing_ns(bytes_max)));
        let latency_ns = u128::from(self.link.latency_ns.max(self.host_link.latency_ns));
        let frames = u128::from(pairs) * u128::from(self.room_frames.max(1));
        u128::from(links) * (frames * crossing_ns + latency_ns)
    }
}
