//! Routes: which link a frame takes next. No route has a loop (DESIGN section 10).

use crate::model::{LinkModel, NetworkModel, Topology};
use hybray_link::{HOST, Peer};

/// Where a frame is: at a participant, a router or the switch.
pub(crate) type Place = u32;

/// Directions out of a router; the host's link is beside them.
const LEFT: u32 = 0;
const RIGHT: u32 = 1;
const UP: u32 = 2;
const DOWN: u32 = 3;

/// A network's shape for so many participants.
pub(crate) struct Routes {
    model: NetworkModel,
    peers: u32,
    /// Mesh: routers. Their places are the first ones, and the host's is after them.
    routers: u32,
}

impl Routes {
    pub fn new(model: &NetworkModel, peers: Peer) -> Self {
        let peers = u32::from(peers);
        let routers = match model.topology {
            Topology::Mesh2d { columns } => {
                let columns = u32::from(columns.max(1));
                peers.saturating_sub(1).div_ceil(columns).max(1) * columns
            }
            _ => 0,
        };
        Self { model: *model, peers, routers }
    }

    /// How many directed links there are.
    pub fn links(&self) -> usize {
        let links = match self.model.topology {
            Topology::Crossbar | Topology::Chain => 2 * self.peers,
            Topology::Mesh2d { .. } => 4 * self.routers + 2,
            Topology::Bus => 1,
        };
        links as usize
    }

    /// Links of the longest route, and ordered pairs of participants whose routes have one link in common at most.
    pub fn most(&self) -> (u64, u64) {
        let peers = u64::from(self.peers);
        let others = peers.saturating_sub(1);
        match self.model.topology {
            Topology::Bus => (1, peers * others),
            Topology::Crossbar => (2, others),
            Topology::Chain => (others, peers * peers / 4),
            Topology::Mesh2d { columns } => {
                let columns = u64::from(columns.max(1));
                let rows = u64::from(self.routers) / columns;
                // Behind link i of a row are i + 1 routers of that row, on the first one the host, too; before it, all
                // that are farther to the right. Down a column it is the other way about.
                let line = |length: u64, lines: u64| {
                    (0..length).map(|i| (i + 2) * (length - i - 1) * lines).max().unwrap_or(0)
                };
                (columns + rows - 1, line(columns, rows).max(line(rows, columns)).max(others))
            }
        }
    }

    /// What link `number` is like.
    pub fn link(&self, number: usize) -> &LinkModel {
        let host = match self.model.topology {
            Topology::Crossbar | Topology::Chain => number < 2,
            Topology::Mesh2d { .. } => number >= 4 * self.routers as usize,
            Topology::Bus => false,
        };
        if host { &self.model.host_link } else { &self.model.link }
    }

    /// Where a participant is.
    pub fn place(&self, peer: Peer) -> Place {
        match self.model.topology {
            Topology::Mesh2d { .. } if peer == HOST => self.routers,
            Topology::Mesh2d { .. } => u32::from(peer) - 1,
            _ => u32::from(peer),
        }
    }

    /// The next link from `at` towards participant `to`, and where it leads; nothing if the frame is there.
    pub fn next(&self, at: Place, to: Peer) -> Option<(usize, Place)> {
        let goal = self.place(to);
        if at == goal {
            return None;
        }
        let (link, place) = match self.model.topology {
            Topology::Bus => (0, goal),
            Topology::Crossbar if at == self.peers => (2 * goal + 1, goal),
            Topology::Crossbar => (2 * at, self.peers),
            // Link 2 i leads from i to i + 1, link 2 i + 1 back: the host's two are the first.
            Topology::Chain if at < goal => (2 * at, at + 1),
            Topology::Chain => (2 * at - 1, at - 1),
            Topology::Mesh2d { columns } => self.mesh(at, goal, u32::from(columns.max(1))),
        };
        Some((link as usize, place))
    }

    fn mesh(&self, at: Place, goal: Place, columns: u32) -> (u32, Place) {
        let host = self.routers;
        if at == host {
            return (4 * host, 0);
        }
        if goal == host && at == 0 {
            return (4 * host + 1, host);
        }
        let goal = if goal == host { 0 } else { goal };
        let (direction, place) = match ((at % columns).cmp(&(goal % columns)), at < goal) {
            (std::cmp::Ordering::Less, _) => (RIGHT, at + 1),
            (std::cmp::Ordering::Greater, _) => (LEFT, at - 1),
            (std::cmp::Ordering::Equal, true) => (DOWN, at + columns),
            (std::cmp::Ordering::Equal, false) => (UP, at - columns),
        };
        (4 * at + direction, place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn route(topology: Topology, peers: Peer, from: Peer, to: Peer) -> (Vec<Place>, Vec<usize>) {
        let link = LinkModel { latency_ns: 0, bytes_per_second: 1 };
        let routes = Routes::new(&NetworkModel { topology, link, host_link: link, room_frames: 1 }, peers);
        let mut places = vec![routes.place(from)];
        let mut links = Vec::new();
        while let Some((link, place)) = routes.next(places[places.len() - 1], to) {
            assert!(link < routes.links() && places.len() < 100);
            places.push(place);
            links.push(link);
        }
        (places, links)
    }

    fn check(topology: Topology, from: Peer, to: Peer, expected: &[Place]) {
        assert_eq!(route(topology, 9, from, to).0, expected, "{topology:?} {from} to {to}");
    }

    #[test]
    fn routes_are_those_of_the_picture() {
        // Nodes 1 to 8 in rows of three; routers count from 0, and 9 is the host's place.
        let mesh = Topology::Mesh2d { columns: 3 };
        check(mesh, 1, 8, &[0, 1, 4, 7]);
        check(mesh, 8, 1, &[7, 6, 3, 0]);
        check(mesh, 0, 6, &[9, 0, 1, 2, 5]);
        check(mesh, 6, 0, &[5, 4, 3, 0, 9]);
        check(mesh, 0, 1, &[9, 0]);
        // By the router at 8, that no node has.
        check(mesh, 7, 3, &[6, 7, 8, 5, 2]);
        check(Topology::Chain, 0, 3, &[0, 1, 2, 3]);
        check(Topology::Chain, 8, 6, &[8, 7, 6]);
        check(Topology::Crossbar, 2, 7, &[2, 9, 7]);
        check(Topology::Bus, 2, 7, &[2, 7]);
        check(Topology::Bus, 5, 5, &[5]);
    }

    /// Every route of every pair, link by link.
    #[test]
    fn no_route_is_longer_and_no_link_has_more_pairs() {
        for peers in 2..=20 {
            let meshes = (1..=6).map(|columns| Topology::Mesh2d { columns });
            for topology in [Topology::Bus, Topology::Crossbar, Topology::Chain].into_iter().chain(meshes) {
                let link = LinkModel { latency_ns: 0, bytes_per_second: 1 };
                let routes = Routes::new(&NetworkModel { topology, link, host_link: link, room_frames: 1 }, peers);
                let mut pairs = vec![0; routes.links()];
                let mut longest = 0;
                for (from, to) in (0..peers).flat_map(|a| (0..peers).map(move |b| (a, b))).filter(|(a, b)| a != b) {
                    let links = route(topology, peers, from, to).1;
                    longest = longest.max(links.len() as u64);
                    links.iter().for_each(|&link| pairs[link] += 1);
                }
                let (links, most) = routes.most();
                let found = pairs.into_iter().max().unwrap_or(0);
                let what = format!("{topology:?}, {peers}: {longest} of {links} links, {found} of {most} pairs");
                assert!(longest <= links && found <= most, "{what}");
                // It is what is there; of a mesh, where the host is one more in its corner, up to twice as many pairs.
                let (is_mesh, whole) = match topology {
                    Topology::Mesh2d { columns } => (true, (peers - 1) % columns == 0),
                    _ => (false, true),
                };
                assert!(!whole || (longest == links && most <= if is_mesh { 2 * found } else { found }), "{what}");
            }
        }
    }

    /// A directed link leads from one place to one other, whoever uses it.
    #[test]
    fn links_have_two_ends() {
        for topology in [Topology::Crossbar, Topology::Mesh2d { columns: 3 }, Topology::Chain] {
            let mut ends = std::collections::BTreeMap::new();
            for (from, to) in (0..9).flat_map(|from| (0..9).map(move |to| (from, to))) {
                let (places, links) = route(topology, 9, from, to);
                for (link, hop) in links.iter().zip(places.windows(2)) {
                    assert_eq!(*ends.entry(*link).or_insert((hop[0], hop[1])), (hop[0], hop[1]), "{topology:?} {link}");
                }
            }
            let mut hops: Vec<_> = ends.values().collect();
            hops.sort();
            hops.dedup();
            assert_eq!(hops.len(), ends.len(), "{topology:?}: two links for one way");
        }
    }
}
