//! The protocol between nodes, small enough that every order of events can be tried.
//!
//! A ray is a list of the pages that it needs, one after the other, and the rays that its hit spawns. What takes no part in
//! who waits for what is left out: geometry, sums of light, bytes. Who does what next is open at every moment: any node may
//! do a unit of work, look at one wanted page, or say one thing, and any link may deliver its first message. That is more
//! freedom than the code has, which does several of these in one call: what holds here holds there.
//!
//! Decisions are the code's own: `hybray_scheduler::rules`, `policy::decide` and `Balance`.

use crate::bug::Bug;
use hybray_scheduler::Balance;
use hybray_scheduler::policy::{Choice, LinkCost, Policy, Situation, decide};
use hybray_scheduler::rules::{self, PlaceState};
use hybray_wire::RayKind;

/// Nodes at most, the host as a home of pages counted.
pub const NODES: usize = 3;
/// Pages and rays at most: sets of them are bits.
pub const ITEMS: usize = 8;
const PLACES: usize = 3;
pub const ROOM: usize = 2;

/// A set of rays, pages or nodes.
pub type Set = u8;

pub fn members(set: Set) -> impl Iterator<Item = usize> {
    (0..ITEMS).filter(move |i| set >> i & 1 == 1)
}

pub const fn bit(i: usize) -> Set {
    1 << i
}

pub fn count(set: Set) -> usize {
    set.count_ones() as usize
}

/// What a ray will need.
#[derive(Clone, Debug)]
pub struct RayPlan {
    /// The node whose tile it is of.
    pub home: usize,
    /// Pages, in order.
    pub pages: Vec<usize>,
    /// Rays that its hit spawns.
    pub children: Vec<usize>,
}

/// What is checked.
#[derive(Clone, Debug)]
pub struct Farm {
    pub nodes: usize,
    /// The last node is the host: it has pages and traces nothing.
    pub host: bool,
    /// Owner of each page.
    pub owners: Vec<usize>,
    pub rays: Vec<RayPlan>,
    /// Of each node's pool, rays.
    pub capacity: usize,
    /// Places of each cache that all share; the lane's comes on top.
    pub common: usize,
    /// Messages that may be on their way between two nodes, each direction.
    pub room: usize,
    /// Rays in a message.
    pub granularity: usize,
    /// Entries owed to others that a node has room for.
    pub partials: usize,
    /// Pages that may be on their way to a node, the lane's not counted.
    pub requests: usize,
    /// `None`: either choice, wherever policies have one.
    pub policy: Option<Policy>,
    /// Times that the dispatcher has a node share.
    pub shares: u8,
    pub bug: Option<Bug>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Message {
    None,
    Rays(Set),
    Took(bool),
    Fetch(u8),
    Part(u8),
    /// Entries of these rays.
    Partials(Set),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// The page; none if it is free.
    pub page: Option<u8>,
    pub whole: bool,
}

impl Place {
    pub fn state(self) -> PlaceState {
        match self.page {
            None => PlaceState::Free,
            Some(_) if self.whole => PlaceState::Whole,
            Some(_) => PlaceState::Landing,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Node {
    /// Its tile was begun.
    pub begun: bool,
    pub balance: Balance,
    /// Rays whose hits are records of the lane: each was spawned by one of the others.
    pub lane: Set,
    pub aside: Option<u8>,
    /// Rays in the pool's lists by page.
    pub waiting: Set,
    /// Pages that are queued as ready.
    pub ready: Set,
    pub outbox: [Set; NODES],
    pub flight: [Set; NODES],
    /// Peers that had no room the last time.
    pub full: Set,
    /// Peers that stand in the queue of those to send rays to.
    pub sends: Set,
    /// Those who are to be told that there is nothing to share.
    pub none_to_share: Set,
    pub answers: [Option<bool>; NODES],
    /// Pages that each peer has asked for.
    pub serves: [[Option<u8>; 2]; NODES],
    /// Pages that have a place and are to be asked for; and those that were.
    pub asked: Set,
    pub sent: Set,
    /// The last of `common + 1` is the lane's.
    pub places: [Place; PLACES],
    /// Rays whose entries are owed to each node.
    pub owed: [Set; NODES],
    pub helped: bool,
}

/// What must not happen in a step, and did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Broken {
    /// A part of a page came that has no place.
    NoPlace,
    /// A page was given up while it was landing.
    GivenUp,
    /// Rays came from a node that waits for an answer.
    TwoFrames,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct State {
    pub nodes: [Node; NODES],
    pub wires: [[[Message; ROOM]; NODES]; NODES],
    /// Pages that each ray has behind it.
    pub step: [u8; ITEMS],
    /// How often it went to another node since its last page.
    pub hops: [u8; ITEMS],
    /// How often it came back since then, for want of room: 2 is often.
    pub back: [u8; ITEMS],
    /// Children that its hit has spawned.
    pub cursor: [u8; ITEMS],
    /// Entries of it that have come home.
    pub ended: [u8; ITEMS],
    /// Rays that there are or were.
    pub born: Set,
    /// Nodes that were given a share and have not said that they are idle again.
    pub helping: Set,
    pub shares: u8,
    pub broken: Option<Broken>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Deliver {
        from: usize,
        to: usize,
    },
    /// A unit; of the pool's rays that are ready this one, or this page is found gone.
    Work {
        node: usize,
        page: usize,
        ray: usize,
    },
    Answer {
        node: usize,
        to: usize,
    },
    Pay {
        node: usize,
        to: usize,
    },
    Serve {
        node: usize,
        to: usize,
    },
    /// A wanted page; of the places that could go the `nth`.
    Decide {
        node: usize,
        page: usize,
        choice: Choice,
        nth: usize,
    },
    /// The page of the ray that the lane has in hand.
    DecideLane {
        node: usize,
        nth: usize,
    },
    Ask {
        node: usize,
        page: usize,
    },
    Send {
        node: usize,
        to: usize,
        rays: Set,
    },
    SayNone {
        node: usize,
        to: usize,
    },
    Share {
        node: usize,
        with: usize,
    },
    SayIdle {
        node: usize,
    },
}

impl Action {
    /// Whether it needs the room of a link. Such actions are given a turn if they can be taken again and again, though
    /// not always: the code asks for room in a fixed order, and what may go round in circles, rays, comes last.
    pub const fn needs_room(&self) -> bool {
        use Action::{Answer, Ask, Pay, SayNone, Send, Serve};
        matches!(self, Answer { .. } | Pay { .. } | Serve { .. } | Ask { .. } | Send { .. } | SayNone { .. })
    }

    /// What is given its turn if it can be taken all the time: choices within are not. `None` for what the protocol does
    /// not rest on.
    pub const fn class(&self) -> Option<u32> {
        let (kind, a, b) = match *self {
            Self::Deliver { from, to } => (0, from, to),
            Self::Answer { node, to } => (1, node, to),
            Self::Pay { node, to } => (2, node, to),
            Self::Serve { node, to } => (3, node, to),
            Self::Send { node, to, .. } => (4, node, to),
            Self::Work { node, .. } => (5, node, 0),
            Self::DecideLane { node, .. } => (5, node, 1),
            Self::SayIdle { node } => (5, node, 2),
            Self::SayNone { node, to } => (6, node, to),
            Self::Decide { node, page, .. } => return Some((7 * 9 + node * ITEMS + page) as u32),
            Self::Ask { node, page } => return Some((7 * 9 + (NODES + node) * ITEMS + page) as u32),
            Self::Share { .. } => return None,
        };
        Some((kind * 9 + a * NODES + b) as u32)
    }
}

/// What a node would do next.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    Nothing,
    /// The lane waits for a page.
    Stuck,
    Aside,
    Lane,
    Ready,
    Primary,
    Begin,
}

impl Farm {
    pub fn is(&self, bug: Bug) -> bool {
        self.bug == Some(bug)
    }

    pub fn id(ray: usize) -> u64 {
        (ray as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5555
    }

    pub fn entry(&self, ray: usize) -> u64 {
        let children = self.rays[ray].children.iter().filter(|_| !self.is(Bug::EntryWithoutChildren));
        children.fold(Self::id(ray).wrapping_neg(), |sum, &child| sum.wrapping_add(Self::id(child)))
    }

    pub fn is_primary(&self, ray: usize) -> bool {
        !self.rays.iter().any(|plan| plan.children.contains(&ray))
    }

    pub fn traces(&self, node: usize) -> bool {
        !self.host || node + 1 < self.nodes
    }

    pub fn primaries(&self, node: usize) -> Set {
        (0..self.rays.len()).filter(|&r| self.rays[r].home == node && self.is_primary(r)).fold(0, |set, r| set | bit(r))
    }

    /// Primaries that are still to be begun.
    pub fn pending(&self, s: &State, node: usize) -> Set {
        self.primaries(node) & !s.born
    }

    /// The page that a ray needs.
    pub fn page(&self, s: &State, ray: usize) -> usize {
        self.rays[ray].pages[usize::from(s.step[ray])]
    }

    pub fn at_hand(&self, s: &State, node: usize, page: usize) -> bool {
        let places = &s.nodes[node].places[..=self.common];
        self.owners[page] == node || places.iter().any(|p| p.page == Some(page as u8) && p.whole)
    }

    pub fn waiting_for(&self, s: &State, node: usize, page: usize) -> Set {
        members(s.nodes[node].waiting).filter(|&r| self.page(s, r) == page).fold(0, |set, r| set | bit(r))
    }

    /// Whether one of these rays has had its move: then the others stay with it.
    pub fn moved(&self, s: &State, rays: Set) -> bool {
        members(rays).any(|ray| s.back[ray] > 0) && !self.is(Bug::ForwardsToTheFull)
    }

    /// Records of the pool in use.
    pub fn in_pool(node: &Node) -> usize {
        let lists = node.outbox.iter().chain(&node.flight).map(|&set| count(set));
        count(node.waiting) + lists.sum::<usize>()
    }

    pub fn free(&self, node: &Node) -> usize {
        self.capacity.saturating_sub(Self::in_pool(node))
    }

    pub fn partials_free(&self, node: &Node) -> usize {
        self.partials.saturating_sub(node.owed.iter().map(|&set| count(set)).sum())
    }

    pub fn unit(&self, s: &State, n: usize) -> Unit {
        let node = &s.nodes[n];
        if !self.traces(n) || self.partials_free(node) == 0 {
            return Unit::Nothing;
        }
        if let Some(ray) = node.aside {
            let here = self.at_hand(s, n, self.page(s, usize::from(ray)));
            return if rules::lane_waits(here) { Unit::Stuck } else { Unit::Aside };
        }
        if node.lane != 0 {
            return Unit::Lane;
        }
        if node.ready != 0 {
            return Unit::Ready;
        }
        if node.begun {
            return if self.pending(s, n) == 0 { Unit::Nothing } else { Unit::Primary };
        }
        let may = rules::may_begin(Self::in_pool(node), self.capacity, self.capacity);
        if may && self.primaries(n) != 0 { Unit::Begin } else { Unit::Nothing }
    }

    /// As the node's last step told it: it found nothing to do.
    pub fn is_idle(&self, s: &State, node: usize) -> bool {
        self.unit(s, node) == Unit::Nothing
    }

    pub fn start(&self) -> State {
        let node = Node {
            begun: false,
            balance: Balance::ZERO,
            lane: 0,
            aside: None,
            waiting: 0,
            ready: 0,
            outbox: [0; NODES],
            flight: [0; NODES],
            full: 0,
            sends: 0,
            none_to_share: 0,
            answers: [None; NODES],
            serves: [[None; 2]; NODES],
            asked: 0,
            sent: 0,
            places: [Place { page: None, whole: false }; PLACES],
            owed: [0; NODES],
            helped: false,
        };
        State {
            nodes: [node; NODES],
            wires: [[[Message::None; ROOM]; NODES]; NODES],
            step: [0; ITEMS],
            hops: [0; ITEMS],
            back: [0; ITEMS],
            cursor: [0; ITEMS],
            ended: [0; ITEMS],
            born: 0,
            helping: 0,
            shares: self.shares,
            broken: None,
        }
    }

    /// Whatever could be next; some of it changes nothing.
    pub fn actions(&self, s: &State, out: &mut Vec<Action>) {
        for node in 0..self.nodes {
            let me = &s.nodes[node];
            for to in (0..self.nodes).filter(|&to| to != node) {
                if s.wires[node][to][0] != Message::None {
                    out.push(Action::Deliver { from: node, to });
                }
                if me.answers[to].is_some() {
                    out.push(Action::Answer { node, to });
                }
                if me.owed[to] != 0 {
                    out.push(Action::Pay { node, to });
                }
                if me.serves[to][0].is_some() {
                    out.push(Action::Serve { node, to });
                }
                if me.none_to_share & bit(to) != 0 {
                    out.push(Action::SayNone { node, to });
                }
                if me.sends & bit(to) != 0 {
                    // The code's outbox is in order of arrival: any order is tried.
                    let size = count(me.outbox[to]).min(self.granularity);
                    let subsets = (0..=me.outbox[to]).filter(|&rays| rays & !me.outbox[to] == 0 && count(rays) == size);
                    out.extend(subsets.map(|rays| Action::Send { node, to, rays }));
                }
                if s.shares > 0 {
                    out.push(Action::Share { node, with: to });
                }
            }
            match self.unit(s, node) {
                Unit::Nothing | Unit::Stuck => {}
                Unit::Ready => {
                    for page in members(me.ready) {
                        if !self.at_hand(s, node, page) {
                            out.push(Action::Work { node, page, ray: 0 });
                            continue;
                        }
                        let rays = members(self.waiting_for(s, node, page));
                        out.extend(rays.map(|ray| Action::Work { node, page, ray }));
                    }
                }
                _ => out.push(Action::Work { node, page: 0, ray: 0 }),
            }
            for page in 0..self.owners.len() {
                let wanted = me.ready & bit(page) == 0 && self.waiting_for(s, node, page) != 0;
                if wanted && (me.asked | me.sent) & bit(page) == 0 {
                    for choice in self.choices(s, node, page) {
                        let places = if choice == Choice::Fetch { self.common } else { 1 };
                        out.extend((0..places).map(|nth| Action::Decide { node, page, choice, nth }));
                    }
                }
                if me.asked & bit(page) != 0 {
                    out.push(Action::Ask { node, page });
                }
            }
            if me.aside.is_some() {
                out.extend((0..self.common).map(|nth| Action::DecideLane { node, nth }));
            }
            if me.helped {
                out.push(Action::SayIdle { node });
            }
        }
    }

    pub fn choices(&self, s: &State, n: usize, page: usize) -> Vec<Choice> {
        let (node, owner) = (&s.nodes[n], self.owners[page]);
        let rays = self.waiting_for(s, n, page);
        let primary = members(rays).next().is_some_and(|ray| self.is_primary(ray));
        let ready = members(node.ready).map(|page| count(self.waiting_for(s, n, page)) as u32).sum();
        let situation = Situation {
            rays: count(rays) as u32,
            kind: if primary { RayKind::Primary } else { RayKind::Mirror },
            page_bytes: 4096,
            uses: count(rays) as u32,
            owner_is_full: node.full & bit(owner) != 0 && !self.is(Bug::ForwardsToTheFull),
            owner_traces: self.traces(owner),
            outbox: 0,
            owner_load: 0,
            load: ready,
            granularity: self.granularity as u32,
            ray_ns: 2_000,
            link: LinkCost { message_ns: 20_000, byte_ps: 1_000 },
        };
        match self.policy {
            _ if self.moved(s, rays) => vec![Choice::Fetch],
            Some(policy) => vec![decide(policy, &situation)],
            None => {
                let (a, b) = (decide(Policy::DataParallel, &situation), decide(Policy::DemandDriven, &situation));
                if a == b { vec![a] } else { vec![a, b] }
            }
        }
    }
}
