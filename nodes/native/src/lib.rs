//! Nodes as threads of this process: POV||Ray's process farm over the in-memory link.
#![forbid(unsafe_code)]

use hybray_geometry::simd::Kernels;
use hybray_link::{HOST, Peer};
use hybray_memory::links;
use hybray_runner::{run_master, run_node};
use hybray_scheduler::{
    Dispatcher, Film, Master, Node, NodeMemory, NodeReport, NodeState, Options, Outcome, Progress, TileState, can_draw,
};
use hybray_tracer::Scene;
use hybray_wire::{Frame, TileMap};
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
    /// T, and the least run.
    pub options: Options,
}

/// Nodes of one process at most: links between all pairs are counted one by one.
pub const NODES_MAX: Peer = 1024;

/// Sums of a picture, and how it came about.
pub struct Traced {
    /// How it ended.
    pub outcome: Outcome,
    /// From the picture's beginning to the last tile.
    pub time: Duration,
    /// Mean radiance of each pixel, row by row from the top.
    pub radiance: Vec<[f32; 3]>,
    /// Hash of the accumulated picture.
    pub film: u64,
    /// Which pixels belong to finished tiles.
    pub progress: Progress,
    /// What each node did.
    pub nodes: Vec<NodeReport>,
    /// Nodes, blocks and pages of all walks.
    pub walks: hybray_bintree::walk::Counts,
    /// Frames that made no sense.
    pub refused_frames: u64,
}

/// Traces `frame` on `farm.nodes` threads that all have `scene`. `watch` is called often, on this thread; the picture ends
/// as it is when it returns false. `None` if nodes cannot draw it ([`can_draw`]).
///
/// # Panics
/// If a node's thread panics: that is a bug.
pub fn trace(
    scene: &Scene<'_>,
    scene_hash: u64,
    frame: &Frame,
    farm: &Farm,
    watch: &mut dyn FnMut(Progress) -> bool,
) -> Option<Traced> {
    let map = TileMap::new(frame.width, frame.height).filter(|_| can_draw(frame))?;
    let nodes = farm.nodes.clamp(1, NODES_MAX);
    let peers = usize::from(nodes) + 1;
    let dispatcher_at = match farm.dispatcher {
        DispatcherAt::Host => HOST,
        DispatcherAt::Node => 1,
    };
    let walks = Mutex::new(hybray_bintree::walk::Counts::default());

    let mut sums = vec![[0; 3]; map.width() as usize * map.height() as usize];
    let mut tiles = vec![TileState::default(); map.len() as usize];
    let film = Film::new(frame, &mut sums, &mut tiles)?;
    let mut reports = vec![NodeReport::default(); peers];
    let mut master = Master::new(*frame, film, &mut reports, scene_hash, dispatcher_at);

    let start = Instant::now();
    let clock = || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    let mut ends = links(nodes + 1).into_iter();
    let mut host_link = ends.next()?;
    let (outcome, time) = std::thread::scope(|threads| {
        for (peer, mut link) in (1..).zip(ends) {
            let walks = &walks;
            threads.spawn(move || {
                let here = peer == dispatcher_at;
                let mut states = vec![NodeState::default(); if here { peers } else { 0 }];
                let dispatcher = here.then(|| Dispatcher::new(&mut states, farm.options));
                let mut memory = Box::<NodeMemory>::default();
                let mut node = Node::new(*scene, scene_hash, farm.kernels, dispatcher_at, &mut memory);
                run_node(&mut node, dispatcher, &mut link, &mut { clock });
                let counts = node.walk_counts();
                let mut all = walks.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                *all += counts;
            });
        }
        let mut states = vec![NodeState::default(); peers];
        let dispatcher = (dispatcher_at == HOST).then(|| Dispatcher::new(&mut states, farm.options));
        let outcome = run_master(&mut master, dispatcher, &mut host_link, &mut { clock }, watch);
        drop(host_link);
        (outcome, start.elapsed())
    });
    let film = master.film();
    Some(Traced {
        outcome,
        time,
        radiance: (0..film.sums().len()).map(|pixel| film.radiance(pixel)).collect(),
        film: film.hash(),
        progress: master.progress(),
        nodes: master.reports()[1..].to_vec(),
        walks: walks.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner),
        refused_frames: master.refused_frames(),
    })
}
