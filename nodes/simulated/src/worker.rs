//! A node as the simulator sees it. All contact with `Node` is here.

use crate::machine::Operations;
use hybray_arena::{Arena, LINE_BYTES};
use hybray_bintree::walk::Counts;
use hybray_geometry::simd::Kernels;
use hybray_link::{Link, Peer};
use hybray_scheduler::{Cache, Charged, HighWater, Node, Plan, Settings, Traffic};
use hybray_tracer::Scene;
use hybray_wire::{Message, View};
use std::mem::MaybeUninit;

/// What a node works in, uncarved.
pub(crate) type Memory = Box<[MaybeUninit<u8>]>;

/// Room for a node of this plan, whose pages and tables are charged but not copied.
pub(crate) fn memory(plan: &Plan) -> Memory {
    Box::new_uninit_slice(plan.charged_bytes() as usize + LINE_BYTES - 1)
}

/// What all nodes refer to.
#[derive(Clone, Copy)]
pub(crate) struct Shared<'s> {
    /// The scene, with the owners of its pages.
    pub scene: Scene<'s>,
    pub scene_hash: u64,
    /// Parents in the directory.
    pub up: &'s [u32],
    /// The bytes of each page.
    pub pages: &'s [&'s [u8]],
    /// What each node has of others' pages for good, node 1's first.
    pub copies: &'s [Vec<u32>],
    pub plan: Plan,
    pub settings: Settings,
    pub dispatcher: Peer,
}

/// A node.
pub(crate) struct Worker<'s> {
    node: Node<'s, 's, Cache<'s, Charged<'s>>>,
    tiles: u64,
    /// What it counted for pictures before this one.
    before: hybray_wire::Counts,
}

impl<'s> Worker<'s> {
    /// It runs the portable walk, whatever the processor has: what it counts is the same everywhere (DESIGN, law 7).
    pub fn new(shared: &Shared<'s>, me: Peer, memory: &'s mut Memory) -> Self {
        let Shared { scene, scene_hash, up, pages, copies, plan, settings, dispatcher } = *shared;
        let (memory, mut cache) =
            plan.charge(&mut Arena::new(memory), &scene, up, pages).expect("the sum of its terms");
        for (page, entry) in (0..).zip(scene.resident.directory.entries) {
            if plan.holds_all || entry.owner == me {
                cache.put(page, entry.bytes as usize);
            }
        }
        let copies = copies.get(usize::from(me) - 1).filter(|_| !plan.holds_all);
        for &page in copies.into_iter().flatten() {
            cache.put(page, scene.resident.directory.entries[page as usize].bytes as usize);
            if settings.grid.is_some() {
                cache.for_shadows(page);
            }
        }
        let settings = plan.settings(settings);
        let node = Node::new(scene, cache, scene_hash, Kernels::Portable, me, dispatcher, settings, memory);
        Self { node, tiles: 0, before: hybray_wire::Counts::default() }
    }

    /// Tiles of its own that are finished.
    pub fn finished_tiles(&self) -> u32 {
        self.node.finished_tiles()
    }

    /// Rays that have ended here.
    pub fn ended(&self) -> u64 {
        self.node.ended()
    }

    /// What it did besides tracing.
    pub fn exchange(&self) -> Traffic {
        self.node.traffic()
    }

    /// Most that was ever in use.
    pub fn high_water(&self) -> HighWater {
        self.node.high_water()
    }

    /// Takes in a message.
    pub fn handle(&mut self, from: Peer, view: &View<'_>) {
        if let Message::Tiles { count, .. } = view.message {
            self.tiles += u64::from(count);
        }
        let before = self.node.counts();
        self.node.handle(from, view);
        // A node counts anew for each picture.
        if self.node.counts() != before {
            self.before += before;
        }
    }

    /// A peer is gone.
    pub fn lost(&mut self, peer: Peer) {
        self.node.lost(peer);
    }

    /// Traces for a while; returns whether there was anything to do. What that took is known afterwards, by what was
    /// counted, so the node's own clock stands still: see [`timed`].
    pub fn step(&mut self, now_ns: u64) -> bool {
        self.node.step(&mut || now_ns)
    }

    /// Sends what it has to say.
    pub fn poll(&mut self, link: &mut dyn Link, now_ns: u64) -> bool {
        self.node.poll(link, now_ns)
    }

    /// What it has counted so far. Tiles are counted when they are given to it.
    pub fn operations(&self) -> Operations {
        let (walks, mut counts) = (self.node.walk_counts(), self.node.counts());
        counts += self.before;
        Operations {
            hits: counts.hits,
            rays: counts.primary + counts.secondary + counts.shadow,
            contributions: counts.contributions,
            tiles: self.tiles,
            ..of_walks(&walks)
        }
    }

    /// Whether it has been told to stop and has said what it did.
    pub fn is_stopped(&self) -> bool {
        self.node.is_stopped()
    }
}

/// What walks have counted.
pub(crate) fn of_walks(walks: &Counts) -> Operations {
    Operations { cells: walks.nodes, blocks: walks.blocks, pages: walks.pages, ..Operations::default() }
}

/// Records in a message.
pub(crate) fn records(message: &Message) -> u64 {
    match message {
        Message::Contributions { .. } => 1,
        Message::Rays { rays, shadows, .. } => u64::from(*rays) + u64::from(*shadows),
        Message::Partials { count } => u64::from(*count),
        Message::Cliplist { pages, .. } => u64::from(*pages),
        _ => 0,
    }
}

/// `message` with the times that the node would have read off a clock: of the run that it ends, and of all its work.
pub(crate) fn timed(message: Message, run_ns: &mut u64, all_ns: u64) -> Message {
    match message {
        Message::Done { first, count, .. } => Message::Done { first, count, nanoseconds: std::mem::take(run_ns) },
        Message::Report { counts, tiles, runs, .. } => {
            Message::Report { counts, tiles, runs, busy_nanoseconds: all_ns }
        }
        other => other,
    }
}
