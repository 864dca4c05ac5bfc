//! Simulated runs: collected, each made once, all cores at work.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};

use hybray::build::Settings as Build;
use hybray::model::Settings as Wanted;
use hybray::partition::PILOT_RAYS;
use hybray::prepare::Prepared;
use hybray::simulate::runs::{Experiment, RunError};
use hybray_scheduler::policy::{Criterion, Policy, Tiles};
use hybray_scheduler::{Options, Outcome, Sizes};
use hybray_simulated::{Machine, NodeRun, Simulated};
use hybray_tests::scene;
use rayon::prelude::*;

use crate::appendix_a::{self, Measured};

/// A run that is watched so often for each tile and sample without coming to its end never comes to it: then it failed.
const TURNS_MAX: u64 = 3000;

/// One run: a scene, cut in some way, on a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// A built-in scene.
    pub scene: String,
    /// As `--voxels` has it; `1` is the scene in one piece.
    pub voxels: String,
    /// Most bytes of a page.
    pub page_bytes: usize,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Rays go from voxel to voxel, as in the report's data-parallel network.
    pub walks: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// The machine.
    pub machine: &'static str,
    /// Nodes.
    pub nodes: u16,
    /// Scheduler.
    pub policy: Policy,
    /// Memory of a node, MiB; without it every node has the scene.
    pub memory_mib: Option<u64>,
    /// A node has page memory for the scene's pages divided by this.
    pub share: Option<u64>,
    /// Bytes for light caches, if it is not the scheduler's default.
    pub light_cache: Option<u64>,
    /// Node 1 gives out tiles, not the host.
    pub is_dispatched_by_node: bool,
    /// T, if it is not learned.
    pub spread: Option<u8>,
    /// Least tiles of a run, if they are not learned.
    pub atomic: Option<u32>,
    /// Rays in a message, if it is not the default.
    pub granularity: Option<u16>,
    /// Rays that wait in a node before it begins a tile, if it is not the default.
    pub in_system: Option<u32>,
    /// Tiles of a pyramid, if it is not the default.
    pub bundle_tiles: Option<u8>,
    /// Shadow rays are traced as bundles where they can be.
    pub shadow_bundles: bool,
    /// When nodes are given tiles.
    pub tiles: Tiles,
    /// Which nodes are.
    pub criterion: Criterion,
    /// Subhosts, if not every node clips for itself.
    pub subhosts: Option<u16>,
    /// Nodes that have nothing to do at the end are given rays of others.
    pub take_over: bool,
    /// Rays of the pilot at most, if the policy has one.
    pub pilot: u32,
}

impl Job {
    /// A run of the 1995 report with the default scheduler: 256 x 256 pixels, one sample, nodes of 32 MB.
    pub fn of_1995(scene: &str, nodes: u16) -> Self {
        Self {
            scene: scene.to_owned(),
            voxels: "1".to_owned(),
            page_bytes: Build::default().page_bytes,
            size: [256, 256],
            walks: false,
            samples: 1,
            machine: "powerxplorer",
            nodes,
            policy: Policy::Hybrid,
            memory_mib: Some(32),
            share: None,
            light_cache: None,
            is_dispatched_by_node: false,
            spread: None,
            atomic: None,
            granularity: None,
            in_system: None,
            bundle_tiles: None,
            shadow_bundles: true,
            tiles: Tiles::Dynamic,
            criterion: Criterion::All,
            subhosts: None,
            take_over: true,
            pilot: PILOT_RAYS,
        }
    }

    /// The same with page memory for the scene's pages divided by `share`, in pages of 4 KiB.
    pub fn with_share(self, share: u64) -> Self {
        Self { share: Some(share), page_bytes: 4096, ..self }
    }

    /// The same by a scheduler of the report, with its grid of voxels and the settings of its table 6.1.
    pub fn in_1995(self, policy: Policy, grid: &str) -> Self {
        let in_system = Some(9000 / u32::from(self.nodes));
        Self { policy, voxels: format!("{grid}x1"), granularity: Some(100), in_system, bundle_tiles: Some(4), ..self }
    }

    /// The same with the report's data-parallel network: rays go from voxel to voxel, and shadow rays nowhere.
    pub fn walking(self) -> Self {
        Self { walks: true, light_cache: Some(1 << 40), ..self }
    }

    /// One node with the same constants and unlimited memory (DESIGN section 12).
    fn alone(&self) -> Self {
        let same = Self { tiles: Tiles::Dynamic, criterion: Criterion::All, take_over: true, ..self.clone() };
        let same = Self { subhosts: None, walks: false, pilot: PILOT_RAYS, shadow_bundles: true, ..same };
        Self { nodes: 1, policy: Policy::Hybrid, memory_mib: None, share: None, light_cache: None, ..same }
    }
}

/// What a run took.
#[derive(Clone, Debug, Default)]
pub struct Figures {
    /// Virtual seconds.
    pub seconds: f64,
    /// Busy over total time (equation 6.2), 0 to 1.
    pub busy: f64,
    /// Until pages are in place, virtual seconds.
    pub loading_seconds: f64,
    /// What a node would have taken for the pilot, which is before that, virtual seconds.
    pub pilot_seconds: f64,
    /// Until the film is at the host, virtual seconds.
    pub gathering_seconds: f64,
    /// Frames that nodes sent.
    pub messages: u64,
    /// Bytes that nodes sent.
    pub bytes: u64,
    /// Times that a ray went from one node to another.
    pub forwarded: u64,
    /// Messages with rays.
    pub ray_messages: u64,
    /// Pages that came to nodes.
    pub fetched: u64,
    /// The node that needed most, bytes.
    pub memory_high_water: u64,
    /// Time that the host spent on clipping for all nodes, virtual seconds.
    pub clipping_seconds: f64,
    /// Nodes that could be given tiles.
    pub with_tiles: usize,
    film: u64,
}

impl Figures {
    fn of(run: &Simulated, with_tiles: usize, pilot_seconds: f64) -> Self {
        let sum = |of: &dyn Fn(&NodeRun) -> u64| run.nodes.iter().map(of).sum::<u64>();
        let ray_messages = run.kinds.iter().find(|(kind, _)| *kind == "rays").map_or(0, |(_, (frames, _))| *frames);
        let fixed = run.plan.sum().total_bytes() - run.plan.lines as u64 * 64;
        Self {
            seconds: run.time_ns as f64 * 1e-9,
            busy: run.busy(),
            loading_seconds: run.loading_ns as f64 * 1e-9,
            pilot_seconds,
            gathering_seconds: run.gathering_ns as f64 * 1e-9,
            messages: sum(&|node| node.traffic.sent_frames),
            bytes: sum(&|node| node.traffic.sent_bytes),
            forwarded: sum(&|node| node.exchange.forwarded),
            ray_messages,
            fetched: sum(&|node| node.exchange.fetched),
            memory_high_water: run.nodes.iter().map(|node| fixed + node.high_water.page_bytes).max().unwrap_or(0),
            clipping_seconds: run.host_clipping_ns as f64 * 1e-9,
            with_tiles,
            film: run.film,
        }
    }
}

/// Why there are no figures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Without {
    /// They are not made yet.
    NotYet,
    /// The scene does not fit: `o.m.` in the papers' tables.
    Memory,
    /// No node would be given tiles.
    Nobody,
    /// It went wrong.
    Failed(String),
}

impl Without {
    /// For a table.
    pub fn cell(&self) -> String {
        match self {
            Self::NotYet => String::new(),
            Self::Memory => "o.m.".to_owned(),
            Self::Nobody => "no node".to_owned(),
            Self::Failed(_) => "failed".to_owned(),
        }
    }
}

type Found = Result<Figures, Without>;

/// A run beside that of one node.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The run.
    pub run: Figures,
    /// Time of one node over its time.
    pub speedup: f64,
    /// The same, divided by the nodes.
    pub efficiency: f64,
}

/// Runs that are wanted, and those that are made.
#[derive(Default)]
pub struct Bench {
    is_small: bool,
    wanted: RefCell<Vec<Job>>,
    known: Vec<(Job, Found)>,
    /// Appendix A's scenes: wanted, and seen.
    to_measure: RefCell<Vec<appendix_a::Job>>,
    measured: Vec<(appendix_a::Job, Result<Measured, String>)>,
}

impl Bench {
    /// One whose pictures have 16 x 16 pixels: whether everything runs, not what it measures.
    #[cfg(test)]
    pub fn small() -> Self {
        Self { is_small: true, ..Self::default() }
    }

    /// The figures of `job`, and of the one-node run beside it; notes what is not known yet.
    ///
    /// # Errors
    /// If there are none.
    pub fn compared(&self, job: &Job) -> Result<Compared, Without> {
        let (alone, run) = (self.figures(&job.alone()), self.figures(job));
        let (alone, run) = (alone?, run?);
        let speedup = alone.seconds / run.seconds;
        Ok(Compared { run, speedup, efficiency: speedup / f64::from(job.nodes) })
    }

    /// The figures of `job`; notes it if they are not known yet.
    ///
    /// # Errors
    /// If there are none.
    pub fn figures(&self, job: &Job) -> Found {
        let job = if self.is_small { Job { size: [16, 16], samples: 1, ..job.clone() } } else { job.clone() };
        let known = self.known.iter().find(|(known, _)| *known == job);
        known.map(|(_, found)| found.clone()).unwrap_or_else(|| {
            self.wanted.borrow_mut().push(job);
            Err(Without::NotYet)
        })
    }

    /// What became of a scene of appendix A; notes it if that is not known yet. `None` if there is nothing.
    pub fn measured(&self, job: &appendix_a::Job) -> Option<&Measured> {
        let known = self.measured.iter().find(|(known, _)| known == job);
        if known.is_none() && !self.to_measure.borrow().contains(job) {
            self.to_measure.borrow_mut().push(job.clone());
        }
        known?.1.as_ref().ok()
    }

    /// Makes all runs that are wanted. Those of a scene that is cut in the same way share its pages.
    pub fn run(&mut self) {
        let mut scenes: BTreeMap<_, Vec<Job>> = BTreeMap::new();
        for job in self.wanted.take() {
            let jobs = scenes.entry((job.scene.clone(), job.voxels.clone(), job.page_bytes)).or_default();
            if !jobs.contains(&job) {
                jobs.push(job);
            }
        }
        let scenes: Vec<_> = scenes.into_values().collect();
        let found: Vec<_> = scenes.into_par_iter().flat_map_iter(|jobs| of_scene(&jobs)).collect();
        self.known.extend(found);
        // One after the other: some are timed.
        for job in self.to_measure.take() {
            let found = appendix_a::measure(&if self.is_small { job.small() } else { job.clone() });
            self.measured.push((job, found));
        }
    }

    /// How many runs there are.
    pub fn len(&self) -> usize {
        self.known.len()
    }

    /// What failed, and pictures that are not those of the other runs of a scene (law 1).
    pub fn wrong(&self) -> Vec<String> {
        let mut films: HashMap<_, u64> = HashMap::new();
        let mut wrong = Vec::new();
        for (job, found) in &self.known {
            match found {
                Ok(run) => {
                    let film = *films.entry((&job.scene, job.size, job.samples)).or_insert(run.film);
                    if film != run.film {
                        wrong.push(format!("another picture: {job:?}"));
                    }
                    if job.memory_mib.is_some_and(|mib| run.memory_high_water > mib << 20) {
                        wrong.push(format!("over its budget: {job:?}"));
                    }
                }
                Err(Without::Failed(why)) => wrong.push(format!("{why}: {job:?}")),
                Err(_) => {}
            }
        }
        let failed = self.measured.iter().filter_map(|(job, found)| Some((job, found.as_ref().err()?)));
        wrong.extend(failed.map(|(job, why)| format!("{why}: {}", job.scene)));
        wrong
    }
}

fn of_scene(jobs: &[Job]) -> Vec<(Job, Found)> {
    let first = &jobs[0];
    let voxels = first.voxels.parse().unwrap_or_else(|e| panic!("{}: {e}", first.voxels));
    let build = Build { page_bytes: first.page_bytes, voxels, ..Build::default() };
    let prepared = Prepared::new(scene(&first.scene), &build).unwrap_or_else(|e| panic!("{}: {e}", first.scene));
    jobs.par_iter().map(|job| (job.clone(), made(job, &prepared))).collect()
}

fn made(job: &Job, prepared: &Prepared) -> Found {
    let failed = |why: String| Without::Failed(why);
    let pages = prepared.packed.open().map_err(|e| failed(e.to_string()))?;
    let scene = prepared.scene(&pages);
    let wanted = Wanted { size: Some(job.size), spp: Some(job.samples), ..Wanted::default() };
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let machine = Machine::named(job.machine).ok_or_else(|| failed(format!("no machine {}", job.machine)))?;
    let mut experiment = Experiment::new(prepared, &scene, &frame, machine);
    experiment.dispatcher = job.is_dispatched_by_node.into();
    let Job { atomic, tiles, take_over, criterion, .. } = *job;
    experiment.pilot_rays = job.pilot;
    experiment.options = Options { spread: job.spread.map(f32::from), atomic, tiles, take_over };
    (experiment.criterion, experiment.voxels) = (criterion, job.voxels.parse().map_err(failed)?);
    let settings = machine.settings(job.policy);
    experiment.settings = hybray_scheduler::Settings {
        granularity: job.granularity.unwrap_or(settings.granularity),
        in_system: job.in_system.unwrap_or(settings.in_system),
        bundle_tiles: job.bundle_tiles.unwrap_or(settings.bundle_tiles),
        shadow_bundles: job.shadow_bundles,
        subhosts: job.subhosts,
        grid: job.walks.then(|| experiment.voxels.grid(&scene)).flatten(),
        ..settings
    };
    let scene_bytes = Sizes::of(&scene).pages_bytes;
    experiment.memory = job.memory_mib.map(|mib| mib << 20);
    experiment.light_cache = job.light_cache;
    experiment.page_memory = job.share.map(|share| scene_bytes / share);
    let tiles: u64 = job.size.iter().map(|&side| u64::from(side.div_ceil(8))).product();
    let mut turns = TURNS_MAX * (tiles + u64::from(job.nodes)) * u64::from(job.samples);
    let goes_on = &mut |_| {
        turns -= 1;
        turns > 0
    };
    let fit = experiment.fit(job.nodes).ok().flatten();
    let barred = fit.and_then(|fit| experiment.barred(&fit.owners, job.nodes).ok());
    let barred = barred.map_or(0, |barred| barred.iter().filter(|&&barred| barred).count());
    match experiment.simulated(job.nodes, goes_on) {
        Ok(run) if run.outcome == Outcome::Finished => {
            let budgeted = job.memory_mib.is_some() && job.nodes > 1;
            let pilot_seconds = if budgeted { experiment.pilot_seconds() } else { 0.0 };
            Ok(Figures::of(&run, usize::from(job.nodes) - barred, pilot_seconds))
        }
        Ok(run) => Err(failed(format!("{:?}", run.outcome))),
        Err(RunError::NoCandidate(_)) => Err(Without::Nobody),
        Err(RunError::NoFit(_)) => Err(Without::Memory),
        Err(error) => Err(failed(error.to_string())),
    }
}
