//! Nodes on a virtual clock: the real machines trace the real scene, and a [`Machine`] says what that would take.
//!
//! Every participant takes in what has arrived, works, and sends, as `nodes/runner` has it; each of these takes as long
//! as the machine model says for what was counted, and nothing that it sends is seen before. The pictures are those of
//! any other farm, bit for bit; the times are the model's, in whole nanoseconds, and the same on every computer (DESIGN
//! section 12). Nothing here reads a clock or starts a thread.
#![forbid(unsafe_code)]

mod bound;
mod gaps;
mod machine;
mod meter;
mod schedule;
mod take;
mod turn;
mod worker;
mod world;

pub use bound::Bound;
pub use gaps::Longest;
pub use hybray_scheduler::Traffic as Exchange;
pub use hybray_sim::{LinkCounts, LinkModel, Network, NetworkModel, Topology, Traffic};
pub use machine::{Costs, MACHINES, Machine, MessageCosts, Operations};

use hybray_geometry::simd::Kernels;
use hybray_link::Peer;
use hybray_scene::{Line, lines_for, parents};
use hybray_scheduler::{
    Asked, Clipper, Film, HighWater, Master, NodeReport, NodeState, Options, Outcome, PageServer, Plan, PlanError,
    Progress, Settings, Sizes, TileState, Unclipped, bytes_of_copies, can_draw,
};
use hybray_tracer::Scene;
use hybray_wire::{Counts, Frame, TileMap};

/// Nodes at most.
pub const NODES_MAX: Peer = 4096;

/// What may be chosen about a simulated farm. None of it changes a picture.
#[derive(Clone, Copy, Debug)]
pub struct Farm<'a> {
    /// What everything costs.
    pub machine: &'a Machine,
    /// Nodes, 1 to [`NODES_MAX`].
    pub nodes: Peer,
    /// Who gives out tiles: the host, or node 1 (POV||Ray, section 2.2).
    pub dispatcher: Peer,
    /// T, the least run, and when nodes are given tiles.
    pub options: Options,
    /// How nodes work.
    pub settings: Settings,
    /// What each node has, if not everything.
    pub budget: Option<Budget<'a>>,
}

/// A node's memory, and where pages are to begin with.
#[derive(Clone, Copy, Debug)]
pub struct Budget<'a> {
    /// What each node has, bytes: everything that it works in.
    pub memory: u64,
    /// What of it is for pages at most, bytes; what there is if it is not given.
    pub page_memory: Option<u64>,
    /// The node that owns each page.
    pub owners: &'a [u16],
    /// Pages of others that each node has from the beginning, node 1's first; or none.
    pub copies: &'a [Vec<u32>],
    /// Where each node's part of the picture begins, in tiles, node 1's first, and the last one ends; none if all are of as many.
    pub parts: &'a [u32],
    /// Nodes that are given no tiles: entry 0 is the host's. None if it is empty.
    pub barred: &'a [bool],
}

/// Why there is no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulateError {
    /// Nodes cannot draw it.
    #[error("the picture has no pixels, or too many: give --size, such as 640x480")]
    NoPicture,
    /// Nodes, or who gives out tiles.
    #[error("a simulated farm has 1 to {NODES_MAX} nodes, and its dispatcher is the host (0) or node 1")]
    NoFarm,
    /// The budget is too small.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Nothing goes on. This is a bug, or a network that was cut.
    #[error("stuck at {seconds} virtual seconds: {state}")]
    Stuck {
        /// Whole virtual seconds.
        seconds: u64,
        /// What everybody does.
        state: String,
    },
}

/// What a node did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NodeRun {
    /// What it said itself: rays and tiles; its time is virtual.
    pub report: NodeReport,
    /// What was counted.
    pub operations: Operations,
    /// Time spent on that.
    pub computing_ns: u64,
    /// Time spent on sending and receiving, before, during and after the run.
    pub messaging_ns: u64,
    /// Time of either kind, by interval, from the first tile given out to the last one finished.
    pub busy_ns: Vec<u64>,
    /// Frames and bytes to and from others.
    pub traffic: Traffic,
    /// Rays and pages to and from others.
    pub exchange: Exchange,
    /// Most that was ever in use.
    pub high_water: HighWater,
    /// Rays that ended here.
    pub ended: u64,
}

/// What became of a picture that another followed: it was finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// Hash of the accumulated picture.
    pub film: u64,
    /// What was traced for it; not known if some node was never heard of.
    pub counts: Option<Counts>,
}

/// A picture, and what it took.
#[derive(Clone, Debug)]
pub struct Simulated {
    /// How it ended.
    pub outcome: Outcome,
    /// Pictures that were drawn before it in the same run: times, bytes and operations are of all together.
    pub before: Vec<Drawn>,
    /// Hash of the accumulated picture.
    pub film: u64,
    /// Hash of all deliveries: equal for equal histories.
    pub events: u64,
    /// From the beginning to the first tile given out.
    pub loading_ns: u64,
    /// From then to the last operation on a tile, at the node that had it.
    pub time_ns: u64,
    /// From then until the film has everything; 0 if it never had.
    pub gathering_ns: u64,
    /// How long nothing came of it at worst.
    pub longest: Longest,
    /// What these are at most, if nothing is wrong with the network.
    pub bound: Bound,
    /// Length of the intervals of [`NodeRun::busy_ns`] and of the host's.
    pub interval_ns: u64,
    /// Each node, from node 1 on.
    pub nodes: Vec<NodeRun>,
    /// The host's frames and bytes.
    pub host: Traffic,
    /// Time that the host spent on messages, by interval, as [`NodeRun::busy_ns`].
    pub host_busy_ns: Vec<u64>,
    /// Time that the host spent on clipping, where there are no subhosts.
    pub host_clipping_ns: u64,
    /// Every directed physical link.
    pub links: Vec<LinkCounts>,
    /// Frames and bytes of each kind of message, to others.
    pub kinds: Vec<(&'static str, (u64, u64))>,
    /// Frames delivered.
    pub frames: u64,
    /// Frames that made no sense.
    pub refused_frames: u64,
    /// What every node is made of.
    pub plan: Plan,
}

impl Simulated {
    /// Busy over total time of all nodes (equation 6.2 of the 1995 report), 0 to 1.
    #[must_use]
    pub fn busy(&self) -> f64 {
        let busy: u64 = self.nodes.iter().flat_map(|node| &node.busy_ns).sum();
        busy as f64 / (self.time_ns as f64 * self.nodes.len() as f64).max(1.0)
    }

    /// What all nodes counted.
    #[must_use]
    pub fn operations(&self) -> Operations {
        let mut all = Operations::default();
        self.nodes.iter().for_each(|node| all += node.operations);
        all
    }
}

/// Draws `frame` on a simulated farm whose nodes all have `scene`. `watch` is called often with how far it is; the
/// picture ends as it is when it returns false.
///
/// # Errors
/// If there is no such picture or farm, or if nothing goes on any more.
pub fn simulate(
    scene: &Scene<'_>,
    scene_hash: u64,
    pages: &[&[u8]],
    frame: &Frame,
    farm: &Farm<'_>,
    watch: &mut dyn FnMut(Progress) -> bool,
) -> Result<Simulated, SimulateError> {
    simulate_spoiled(scene, scene_hash, pages, frame, farm, &mut |_| {}, watch)
}

/// [`simulate`] on a network that `spoil` may do something to first: delay frames, cut participants off from each other,
/// or have nodes lost.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_spoiled(
    scene: &Scene<'_>,
    scene_hash: u64,
    pages: &[&[u8]],
    frame: &Frame,
    farm: &Farm<'_>,
    spoil: &mut dyn FnMut(&mut Network),
    watch: &mut dyn FnMut(Progress) -> bool,
) -> Result<Simulated, SimulateError> {
    simulate_run(scene, scene_hash, pages, core::slice::from_ref(frame), farm, spoil, watch)
}

/// Draws pictures one after the other on the same nodes, as [`simulate_spoiled`] draws one: what it says is of the last, and
/// what it took of all.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_run(
    scene: &Scene<'_>,
    scene_hash: u64,
    pages: &[&[u8]],
    frames: &[Frame],
    farm: &Farm<'_>,
    spoil: &mut dyn FnMut(&mut Network),
    watch: &mut dyn FnMut(Progress) -> bool,
) -> Result<Simulated, SimulateError> {
    let drawable = |frame: &Frame| TileMap::new(frame.width, frame.height).filter(|_| can_draw(frame));
    let maps: Option<Vec<TileMap>> = frames.iter().map(drawable).collect();
    let maps = maps.filter(|maps| (1..=1 << 16).contains(&maps.len())).ok_or(SimulateError::NoPicture)?;
    if !(1..=NODES_MAX).contains(&farm.nodes) || farm.dispatcher > 1 {
        return Err(SimulateError::NoFarm);
    }
    let peers = usize::from(farm.nodes) + 1;
    let memory = |map: &TileMap| {
        (vec![[0; 3]; map.width() as usize * map.height() as usize], vec![TileState::default(); map.len() as usize])
    };
    let mut films: Vec<_> = maps.iter().map(memory).collect();
    let mut reports = vec![NodeReport::default(); peers];
    let films = frames.iter().zip(&mut films);
    let films: Option<Vec<_>> =
        films.map(|(frame, (sums, tiles))| Some((*frame, Film::new(frame, sums, tiles)?))).collect();
    let mut films = films.ok_or(SimulateError::NoPicture)?;
    let (frame, film) = films.remove(0);
    let last = films.is_empty();
    let master = Master::of_run(0, last, frame, film, &mut reports, scene_hash, farm.dispatcher);
    let mut states = vec![NodeState::default(); peers];
    let mut entries = scene.resident.directory.entries.to_vec();
    let mut scene = *scene;
    let mut plan = Plan::without_budget(Sizes::of(&scene));
    if let Some(budget) = &farm.budget {
        let mut owned = vec![0; peers];
        for (entry, &owner) in entries.iter_mut().zip(budget.owners) {
            entry.owner = owner;
            owned[usize::from(owner)] += (lines_for(entry.bytes as usize) * size_of::<Line>()) as u64;
        }
        let owned_max = owned.into_iter().max();
        plan = Plan::new(Sizes::of(&scene), farm.nodes, budget.memory, owned_max, farm.settings.policy)?;
        if let Some(bytes) = budget.page_memory {
            plan = plan.with_page_memory(bytes, farm.nodes, owned_max);
        }
        let memory = budget.page_memory.map_or(budget.memory, |_| plan.sum().total_bytes());
        plan = plan.with_copies(bytes_of_copies(&entries, budget.copies), memory)?;
    }
    scene.resident.directory.entries = &entries;
    let mut up = vec![0; scene.resident.directory.nodes.len() + entries.len()];
    parents(scene.resident.directory.nodes, &mut up);
    let (settings, dispatcher) = (farm.settings, farm.dispatcher);
    let copies = farm.budget.map_or(&[][..], |budget| budget.copies);
    let shared = worker::Shared { scene, scene_hash, up: &up, pages, copies, plan, settings, dispatcher };
    let mut memories: Vec<worker::Memory> = (1..peers).map(|_| worker::memory(&plan)).collect();
    let workers = (1..).zip(&mut memories).map(|(me, memory)| worker::Worker::new(&shared, me, memory)).collect();
    let (mut asked, mut turns) = (vec![Asked::NONE; peers], vec![0; peers]);
    let server = PageServer::new(&mut asked, &mut turns);
    let (mut unclipped, mut clip_turns) = (vec![Unclipped::NONE; peers], vec![0; peers]);
    // Where there are no subhosts the host clips.
    let clipper =
        (settings.subhosts == Some(0)).then(|| Clipper::new(scene, Kernels::Portable, &mut unclipped, &mut clip_turns));
    let world = world::World::new(farm, plan, master, &mut states, clipper, server, pages, workers);
    let mut world = world.followed_by(scene_hash, films);
    spoil(world.network());
    let delay_ns = world.network().delay_ns_max();
    let bound = Bound::new(&shared.scene, &plan, &settings, farm.machine, farm.nodes, &frame, delay_ns);
    Ok(Simulated { bound, ..world.run(watch)? })
}

#[cfg(test)]
mod tests;
