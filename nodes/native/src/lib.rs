//! Nodes as threads of this process: POV||Ray's process farm over the in-memory link.
#![forbid(unsafe_code)]

use hybray_arena::{Arena, LINE_BYTES};
use hybray_geometry::simd::Kernels;
use hybray_link::{HOST, Peer};
use hybray_memory::{MemoryLink, links};
pub use hybray_runner::Watch;
use hybray_runner::{run_master, run_node};
use hybray_scene::{Line, lines_for};
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{
    All, Asked, Clipper, Dispatcher, Film, HighWater, Limits, Master, Node, NodeMemory, NodeReport, NodeState, Options,
    Outcome, PageServer, Plan, PlanError, Progress, Settings, Sizes, Store, TileState, Traffic, Unclipped,
    bytes_of_copies, can_draw,
};
use hybray_tracer::Scene;
use hybray_wire::{Frame, TileMap};
use std::mem::MaybeUninit;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Where tiles are given out (POV||Ray, section 2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DispatcherAt {
    /// At the host, beside the film.
    #[default]
    Host,
    /// On the first node.
    Node,
}

/// What may be chosen about a farm. None of it changes a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Farm {
    /// Threads that trace, 1 to [`NODES_MAX`].
    pub nodes: Peer,
    /// Which kernels they run.
    pub kernels: Kernels,
    /// Where tiles are given out.
    pub dispatcher: DispatcherAt,
    /// Shadow rays are traced as bundles where they can be.
    pub shadow_bundles: bool,
    /// T, the least run, and when nodes are given tiles: pixels can be counted at the host only.
    pub options: Options,
}

/// A node's memory, and where pages are to begin with.
#[derive(Clone, Copy)]
pub struct Budget<'a> {
    /// What each node has, bytes: everything that it works in.
    pub memory: u64,
    /// The node that owns each page.
    pub owners: &'a [u16],
    /// The bytes of each page.
    pub pages: &'a [&'a [u8]],
    /// Pages of others that each node has from the beginning, node 1's first; or none.
    pub copies: &'a [Vec<u32>],
    /// Where each node's part of the picture begins, in tiles, node 1's first, and the last one ends; none if all are of as many.
    pub parts: &'a [u32],
    /// How nodes work.
    pub settings: Settings,
    /// Nodes that are given no tiles: entry 0 is the host's. None if it is empty.
    pub barred: &'a [bool],
}

/// Pictures of one run at most: they are numbered with 16 bits.
pub const PICTURES_MAX: usize = 1 << 16;

/// Nodes of one process at most: links between all pairs are counted one by one.
pub const NODES_MAX: Peer = 1024;

/// Sums of a picture, and how it came about.
pub struct Traced {
    /// How it ended.
    pub outcome: Outcome,
    /// From the picture's beginning to the last tile.
    pub time: Duration,
    /// Mean radiance of each pixel, row by row from the top; empty where pictures are several.
    pub radiance: Vec<[f32; 3]>,
    /// Hash of the accumulated picture.
    pub film: u64,
    /// Which pixels belong to finished tiles.
    pub progress: Progress,
    /// What each node did.
    pub nodes: Vec<NodeReport>,
    /// Nodes, blocks and pages of all walks.
    pub walks: hybray_bintree::walk::Counts,
    /// What each node did besides its report.
    pub worked: Vec<Worked>,
    /// Frames that made no sense.
    pub refused_frames: u64,
}

/// Traces `frame` on `farm.nodes` threads that all have `scene`. `watch` is called on this thread. `None` if nodes cannot draw it ([`can_draw`]).
///
/// # Panics
/// If a node's thread panics: that is a bug.
pub fn trace(scene: &Scene<'_>, scene_hash: u64, frame: &Frame, farm: &Farm, watch: &mut dyn Watch) -> Option<Traced> {
    let mut watch = Seen { watch, radiance: Vec::new() };
    let traced = trace_all(scene, scene_hash, core::slice::from_ref(frame), farm, &mut watch)?;
    watch.put_into(traced)
}

/// Traces pictures one after the other, on the same nodes: as [`trace`], but that [`Traced::radiance`] is empty, since `watch`
/// sees each film when it ends. The last one of them may have ended early: those behind it were not begun.
///
/// # Panics
/// As [`trace`].
pub fn trace_all(
    scene: &Scene<'_>,
    scene_hash: u64,
    frames: &[Frame],
    farm: &Farm,
    watch: &mut dyn Watch,
) -> Option<Vec<Traced>> {
    let limits = Limits::all_at_hand();
    let bytes = NodeMemory::sum(&limits).total_bytes();
    run(frames, scene_hash, farm, None, None, watch, &|peer, link, dispatcher, clock, ended| {
        let mut memory = room(bytes);
        let memory = NodeMemory::carve(&mut Arena::new(&mut memory), &limits).expect("the sum of its terms");
        let (store, at) = (All(scene.resident.pages, scene.texels), dispatcher_at(farm));
        let settings = Settings { shadow_bundles: farm.shadow_bundles, ..Settings::default() };
        let node = Node::new(*scene, store, scene_hash, farm.kernels, peer, at, settings, memory);
        turn(node, link, dispatcher, clock, ended);
    })
}

/// Traces `frame` on `farm.nodes` threads with `budget` each: every node works in one piece of memory of that size, copies
/// of its pages included, and what it does not have it must ask others for, as over a network.
///
/// # Errors
/// If the budget is too small: what would do. Otherwise as [`trace`].
///
/// # Panics
/// If a node's thread panics: that is a bug.
pub fn trace_within(
    scene: &Scene<'_>,
    scene_hash: u64,
    frame: &Frame,
    farm: &Farm,
    budget: &Budget<'_>,
    watch: &mut dyn Watch,
) -> Result<Option<Traced>, PlanError> {
    let mut watch = Seen { watch, radiance: Vec::new() };
    let traced = trace_all_within(scene, scene_hash, core::slice::from_ref(frame), farm, budget, &mut watch)?;
    Ok(traced.and_then(|traced| watch.put_into(traced)))
}

/// Traces pictures one after the other with `budget`: nodes keep what they have fetched. As [`trace_all`].
///
/// # Errors
/// If the budget is too small: what would do.
///
/// # Panics
/// As [`trace`].
pub fn trace_all_within(
    scene: &Scene<'_>,
    scene_hash: u64,
    frames: &[Frame],
    farm: &Farm,
    budget: &Budget<'_>,
    watch: &mut dyn Watch,
) -> Result<Option<Vec<Traced>>, PlanError> {
    let mut entries = scene.resident.directory.entries.to_vec();
    for (entry, &owner) in entries.iter_mut().zip(budget.owners) {
        entry.owner = owner;
    }
    let mut scene = *scene;
    scene.resident.directory.entries = &entries;
    let plan = plan(&scene, farm.nodes, budget.memory, budget.settings.policy)?;
    let light_bytes = bytes_of_copies(scene.resident.directory.entries, budget.copies);
    let plan = plan.with_copies(light_bytes, budget.memory)?;
    let bytes = plan.sum().total_bytes();
    // Where there are no subhosts the host clips.
    let clips = (budget.settings.subhosts == Some(0)).then_some(&scene);
    Ok(run(frames, scene_hash, farm, Some(budget), clips, watch, &|peer, link, dispatcher, clock, ended| {
        let mut memory = room(bytes);
        let (memory, mut cache, scene) =
            plan.carve(&mut Arena::new(&mut memory), &scene).expect("the sum of its terms");
        for (page, bytes) in (0..).zip(budget.pages) {
            if plan.holds_all || scene.resident.directory.entries[page as usize].owner == peer {
                assert!(cache.put(page, bytes), "page {page} is none");
            }
        }
        let copies = budget.copies.get(usize::from(peer) - 1).filter(|_| !plan.holds_all);
        for &page in copies.into_iter().flatten() {
            assert!(cache.put(page, budget.pages[page as usize]), "page {page} is none");
            if budget.settings.grid.is_some() {
                cache.for_shadows(page);
            }
        }
        let settings = Settings { shadow_bundles: farm.shadow_bundles, ..budget.settings };
        let settings = plan.settings(settings);
        let node = Node::new(scene, cache, scene_hash, farm.kernels, peer, dispatcher_at(farm), settings, memory);
        turn(node, link, dispatcher, clock, ended);
    }))
}

/// A watch beside another, for one picture: what it looks like at its end.
struct Seen<'a> {
    watch: &'a mut dyn Watch,
    radiance: Vec<[f32; 3]>,
}

impl Seen<'_> {
    fn put_into(self, traced: Vec<Traced>) -> Option<Traced> {
        let traced = traced.into_iter().next()?;
        Some(Traced { radiance: self.radiance, ..traced })
    }
}

impl Watch for Seen<'_> {
    fn begin(&mut self, film: &mut Film<'_>) -> bool {
        self.watch.begin(film)
    }

    fn look(&mut self, progress: Progress, film: &Film<'_>) -> bool {
        self.watch.look(progress, film)
    }

    fn end(&mut self, outcome: Outcome, film: &Film<'_>) {
        self.radiance = (0..film.sums().len()).map(|pixel| film.radiance(pixel)).collect();
        self.watch.end(outcome, film);
    }
}

/// The plan for nodes that have `memory` bytes each, and own the pages that the directory says.
///
/// # Errors
/// If that is too little: what would do.
pub fn plan(scene: &Scene<'_>, nodes: Peer, memory: u64, policy: Policy) -> Result<Plan, PlanError> {
    let mut owned = vec![0; usize::from(nodes) + 1];
    for entry in scene.resident.directory.entries {
        if let Some(owned) = owned.get_mut(usize::from(entry.owner)) {
            *owned += (lines_for(entry.bytes as usize) * size_of::<Line>()) as u64;
        }
    }
    Plan::new(Sizes::of(scene), nodes, memory, owned.into_iter().max(), policy)
}

/// Memory for an arena of `bytes`.
fn room(bytes: u64) -> Box<[MaybeUninit<u8>]> {
    Box::new_uninit_slice(bytes as usize + LINE_BYTES - 1)
}

fn dispatcher_at(farm: &Farm) -> Peer {
    match farm.dispatcher {
        DispatcherAt::Host => HOST,
        DispatcherAt::Node => 1,
    }
}

/// Where nodes must ask for pages, each does best to draw on the same ones for long.
fn dispatcher<'m>(
    states: &'m mut [NodeState],
    kept: &'m mut [u64],
    farm: &Farm,
    budget: Option<&Budget<'m>>,
) -> Dispatcher<'m> {
    let dispatcher = Dispatcher::new(states, farm.options).keeping(kept);
    let Some(budget) = budget else { return dispatcher };
    dispatcher.biased(!budget.pages.is_empty()).with_parts(budget.parts).barring(budget.barred)
}

type Clock = dyn Fn() -> u64 + Sync;
/// Hears which picture a node has done its last for, and what it has done up to then.
type Ended<'a> = dyn FnMut(u16, Worked) + 'a;
/// Makes and turns a node, on a thread of its own.
type Turn<'a> = dyn Fn(Peer, &mut MemoryLink, Option<Dispatcher<'_>>, &Clock, &mut Ended<'_>) + Sync + 'a;

fn turn<P: Store>(
    mut node: Node<'_, '_, P>,
    link: &mut MemoryLink,
    dispatcher: Option<Dispatcher<'_>>,
    clock: &Clock,
    ended: &mut Ended<'_>,
) {
    run_node(&mut node, dispatcher, link, &mut || clock(), &mut |picture, node| {
        ended(picture, Worked { walks: node.walk_counts(), traffic: node.traffic(), high_water: node.high_water() });
    });
}

/// What a node did for a picture, besides its report.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worked {
    /// Nodes, blocks and pages of its walks.
    pub walks: hybray_bintree::walk::Counts,
    /// Rays and pages that went to and fro.
    pub traffic: Traffic,
    /// Most that was ever in use, in this picture or one before.
    pub high_water: HighWater,
}

impl core::ops::AddAssign for Worked {
    /// What was done for one picture and a later one.
    fn add_assign(&mut self, b: Self) {
        self.walks += b.walks;
        self.traffic += b.traffic;
        self.high_water = b.high_water;
    }
}

impl Worked {
    /// What came since `before`.
    fn since(self, before: &Self) -> Self {
        Self { walks: self.walks - before.walks, traffic: self.traffic - before.traffic, ..self }
    }
}

/// Runs the machines, picture by picture; the host gives out pages of the `budget` whose owners are lost, and clips the scene of `clips`. `node`
/// makes and turns each node, on a thread of its own.
fn run(
    frames: &[Frame],
    scene_hash: u64,
    farm: &Farm,
    budget: Option<&Budget<'_>>,
    clips: Option<&Scene<'_>>,
    watch: &mut dyn Watch,
    node: &Turn<'_>,
) -> Option<Vec<Traced>> {
    let maps: Option<Vec<_>> =
        frames.iter().map(|frame| TileMap::new(frame.width, frame.height).filter(|_| can_draw(frame))).collect();
    let maps = maps.filter(|maps| (1..=PICTURES_MAX).contains(&maps.len()))?;
    let nodes = farm.nodes.clamp(1, NODES_MAX);
    let peers = usize::from(nodes) + 1;
    let pages = budget.map_or(&[][..], |budget| budget.pages);
    let pixels = |map: &TileMap| map.width() as usize * map.height() as usize;
    let tiles_max = maps.iter().map(TileMap::len).max()?;
    // A bit for each tile, where tiles are given out.
    let kept_words = tiles_max.div_ceil(64) as usize;
    let dispatcher_at = dispatcher_at(farm);
    // Up to the end of each picture, node by node.
    let worked = Mutex::new(vec![vec![Worked::default(); usize::from(nodes)]; frames.len()]);

    let mut sums = vec![[0; 3]; maps.iter().map(pixels).max()?];
    let mut tiles = vec![TileState::default(); tiles_max as usize];
    let mut reports = vec![NodeReport::default(); peers];

    let start = Instant::now();
    let clock = move || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let mut ends = links(nodes + 1).into_iter();
    let mut host_link = ends.next()?;
    let mut all = Vec::with_capacity(frames.len());
    std::thread::scope(|threads| {
        for (peer, mut link) in (1..).zip(ends) {
            let (worked, clock) = (&worked, &clock);
            threads.spawn(move || {
                let here = peer == dispatcher_at;
                let mut states = vec![NodeState::default(); if here { peers } else { 0 }];
                let mut kept = vec![0; if here { kept_words } else { 0 }];
                let dispatcher = here.then(|| dispatcher(&mut states, &mut kept, farm, budget).on(peer));
                node(peer, &mut link, dispatcher, clock, &mut |picture, did| {
                    let mut worked = worked.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    worked[usize::from(picture)][usize::from(peer) - 1] = did;
                });
            });
        }
        let (mut states, mut kept) = (vec![NodeState::default(); peers], vec![0; kept_words]);
        let mut dispatcher = (dispatcher_at == HOST).then(|| dispatcher(&mut states, &mut kept, farm, budget));
        let (mut asked, mut turns) = (vec![Asked::NONE; peers], vec![0; peers]);
        let mut server = PageServer::new(&mut asked, &mut turns);
        let (mut unclipped, mut turns) = (vec![Unclipped::NONE; peers], vec![0; peers]);
        let mut clipper = clips.map(|scene| Clipper::new(*scene, farm.kernels, &mut unclipped, &mut turns));
        let mut begun = start;
        for (number, (frame, map)) in (0..).zip(frames.iter().zip(&maps)) {
            let film = Film::new(frame, &mut sums[..pixels(map)], &mut tiles[..map.len() as usize])?;
            let last = usize::from(number) + 1 == frames.len();
            let mut master = Master::of_run(number, last, *frame, film, &mut reports, scene_hash, dispatcher_at);
            if number > 0 {
                dispatcher.iter_mut().for_each(|dispatcher| dispatcher.next(number));
                clipper.iter_mut().for_each(|clipper| clipper.next(number));
                begun = Instant::now();
            }
            let (dispatcher, clipper) = (dispatcher.as_mut(), clipper.as_mut());
            let (link, clock) = (&mut host_link, &mut { clock });
            let outcome = run_master(&mut master, dispatcher, clipper, &mut server, pages, link, clock, watch);
            all.push(Traced {
                outcome,
                time: begun.elapsed(),
                radiance: Vec::new(),
                film: master.film().hash(),
                progress: master.progress(),
                nodes: master.reports()[1..].to_vec(),
                walks: hybray_bintree::walk::Counts::default(),
                worked: Vec::new(),
                refused_frames: master.refused_frames(),
            });
            if outcome != Outcome::Finished {
                break;
            }
        }
        drop(host_link);
        Some(())
    })?;
    let worked = worked.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let none = vec![Worked::default(); usize::from(nodes)];
    let before = std::iter::once(&none).chain(&worked);
    for (traced, (worked, before)) in all.iter_mut().zip(worked.iter().zip(before)) {
        traced.worked = worked.iter().zip(before).map(|(worked, before)| worked.since(before)).collect();
        traced.worked.iter().for_each(|node| traced.walks += node.walks);
    }
    Some(all)
}
