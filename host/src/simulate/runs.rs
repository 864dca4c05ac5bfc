//! From a simulated farm to its record.
//!
//! A run's speed-up is over the run of one node of the same machine, with the same dispatcher and costs; that run is
//! made once for all the others.

use super::record::{NodeRun, QueueRun, Rays, Run};
use crate::partition::{Fit, NoCandidate, NoFit, PILOT_RAYS, Pilot, Voxels, Wanted, barred};
use crate::prepare::Prepared;
use hybray_link::{HOST, Peer};
use hybray_scheduler::policy::{Criterion, Policy};
use hybray_scheduler::{Options, Outcome, Progress, Settings, Sizes};
use hybray_simulated::{Budget, Farm, Machine, Operations, SimulateError, Simulated, simulate};
use hybray_tracer::Scene;
use hybray_wire::{Counts, Frame};
use std::cell::OnceCell;

/// The same picture on one machine, for any number of nodes.
pub struct Experiment<'a> {
    /// What is drawn.
    pub prepared: &'a Prepared,
    /// Its pages, opened.
    pub scene: &'a Scene<'a>,
    /// How.
    pub frame: &'a Frame,
    /// What everything costs.
    pub machine: &'a Machine,
    /// Who gives out tiles: the host or node 1.
    pub dispatcher: Peer,
    /// How.
    pub options: Options,
    /// How nodes work.
    pub settings: Settings,
    /// What each node has, bytes; everything if it is not given.
    pub memory: Option<u64>,
    /// What of it is for pages at most, bytes.
    pub page_memory: Option<u64>,
    /// What of that is for light caches, bytes; as the policy has it if it is not given.
    pub light_cache: Option<u64>,
    /// Rays at most that go ahead of the picture where the policy has a pilot; 0 for none.
    pub pilot_rays: u32,
    /// What rays of the picture found that were ahead of it, when that was asked for.
    pilot: OnceCell<Option<Pilot>>,
    /// Which nodes are given tiles, where they have memory; one alone always is.
    pub criterion: Criterion,
    /// How the scene was cut: some criterion needs to know.
    pub voxels: Voxels,
    /// The run of one node, when it has been made.
    alone: Option<Simulated>,
    pages: Vec<&'a [u8]>,
}

/// The scheduler of that name.
#[must_use]
pub fn scheduler(name: &str) -> Option<Policy> {
    Policy::ALL.iter().find(|(known, _)| *known == name).map(|&(_, policy)| policy)
}

/// The name of a scheduler.
#[must_use]
pub fn name_of(policy: Policy) -> &'static str {
    Policy::ALL.iter().find(|&&(_, known)| known == policy).map_or("", |&(name, _)| name)
}

impl<'a> Experiment<'a> {
    /// Nothing has been run yet.
    #[must_use]
    pub fn new(prepared: &'a Prepared, scene: &'a Scene<'a>, frame: &'a Frame, machine: &'a Machine) -> Self {
        Self {
            prepared,
            scene,
            frame,
            machine,
            dispatcher: HOST,
            options: Options::default(),
            settings: machine.settings(Policy::default()),
            memory: None,
            page_memory: None,
            light_cache: None,
            pilot_rays: PILOT_RAYS,
            pilot: OnceCell::new(),
            criterion: Criterion::All,
            voxels: Voxels::One,
            alone: None,
            pages: prepared.packed.page_slices(),
        }
    }

    /// Who owns which page, and what every node is made of, if nodes have a budget.
    ///
    /// # Errors
    /// If it does not fit.
    pub fn fit(&self, nodes: Peer) -> Result<Option<Fit>, NoFit> {
        // The one-node run has unlimited memory (DESIGN section 12).
        let Some(memory) = self.memory.filter(|_| nodes > 1) else { return Ok(None) };
        let (sizes, page_memory, policy) = (Sizes::of(self.scene), self.page_memory, self.settings.policy);
        let packed = &self.prepared.packed;
        let first_dispatches = self.dispatcher != HOST;
        let wanted = Wanted { sizes, nodes, memory, page_memory, policy, first_dispatches };
        let pilot = self.pilot(policy);
        let (pages, voxels) = (packed.placed_pages(), packed.voxels());
        wanted.fit_picture(&pages, voxels, self.scene, self.light_cache, pilot).map(Some)
    }

    /// What went ahead of the picture, where `policy` has a pilot and it is wanted: traced once.
    #[must_use]
    pub fn pilot(&self, policy: Policy) -> Option<&Pilot> {
        if policy != Policy::Hybrid {
            return None;
        }
        self.pilot.get_or_init(|| Pilot::trace(self.scene, self.frame, self.pilot_rays)).as_ref()
    }

    /// What one of the machine's nodes would have taken for the pilot, seconds: time before the first tile.
    #[must_use]
    pub fn pilot_seconds(&self) -> f64 {
        let Some(Pilot { walks, counts, .. }) = self.pilot(self.settings.policy) else { return 0.0 };
        let operations = Operations {
            cells: walks.nodes,
            blocks: walks.blocks,
            pages: walks.pages,
            hits: counts.hits,
            rays: rays(counts),
            ..Operations::default()
        };
        self.machine.costs.of(&operations) as f64 * 1e-12
    }

    /// Which of so many nodes are given no tiles: entry 0 is the host's.
    ///
    /// # Errors
    /// If that would be all.
    pub fn barred(&self, owners: &[u16], nodes: Peer) -> Result<Vec<bool>, NoCandidate> {
        barred(self.criterion, self.voxels, &self.prepared.packed.objects_of(owners, nodes))
    }

    /// Draws it on so many nodes. `watch` is called often; the picture ends as it is when it returns false.
    ///
    /// # Errors
    /// See [`simulate`].
    pub fn simulated(&self, nodes: Peer, watch: &mut dyn FnMut(Progress) -> bool) -> Result<Simulated, RunError> {
        self.simulated_with(nodes, self.fit(nodes)?.as_ref(), watch)
    }

    fn simulated_with(
        &self,
        nodes: Peer,
        fit: Option<&Fit>,
        watch: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Simulated, RunError> {
        let Self { machine, dispatcher, options, settings, page_memory, .. } = *self;
        let barred = fit.map(|fit| self.barred(&fit.owners, nodes)).transpose()?.unwrap_or_default();
        let budget = self.memory.zip(fit).map(|(memory, fit)| Budget {
            memory,
            page_memory,
            owners: &fit.owners,
            copies: &fit.copies,
            parts: &fit.parts,
            barred: &barred,
        });
        let farm = Farm { machine, nodes, dispatcher, options, settings, budget };
        Ok(simulate(self.scene, self.prepared.hash, &self.pages, self.frame, &farm, watch)?)
    }

    /// The record of so many nodes, after that of one if it was not made yet; nothing if `watch` has ended a picture.
    ///
    /// # Errors
    /// See [`simulate`]; and when a picture ends unfinished for any other reason.
    pub fn run(&mut self, nodes: Peer, watch: &mut dyn FnMut(Progress) -> bool) -> Result<Option<Run>, RunError> {
        if self.alone.is_none() {
            let Some(alone) = self.finished(1, None, watch)? else { return Ok(None) };
            self.alone = Some(alone);
        }
        let fit = self.fit(nodes)?;
        let many = if nodes == 1 { None } else { self.finished(nodes, fit.as_ref(), watch)? };
        let Some(alone) = &self.alone else { return Ok(None) };
        match &many {
            None if nodes != 1 => Ok(None),
            many => Ok(Some(self.record(many.as_ref().unwrap_or(alone), fit.as_ref(), alone.time_ns))),
        }
    }

    fn finished(
        &self,
        nodes: Peer,
        fit: Option<&Fit>,
        watch: &mut dyn FnMut(Progress) -> bool,
    ) -> Result<Option<Simulated>, RunError> {
        let run = self.simulated_with(nodes, fit, watch)?;
        match run.outcome {
            Outcome::Finished => Ok(Some(run)),
            Outcome::Stopped => Ok(None),
            outcome => Err(RunError::Unfinished { nodes, outcome }),
        }
    }

    fn record(&self, run: &Simulated, fit: Option<&Fit>, alone_ns: u64) -> Run {
        let mut counts = Counts::default();
        run.nodes.iter().for_each(|node| counts += node.report.counts);
        let speedup = alone_ns as f64 / run.time_ns.max(1) as f64;
        let packed = &self.prepared.packed;
        let mut held = vec![(0u64, 0u64); run.nodes.len()];
        for page in 0..packed.pages() as u32 {
            let primitives = u64::from(packed.primitives_of(page));
            let nodes = match fit.map(|fit| usize::from(fit.owners[page as usize])) {
                Some(owner) => owner - 1..owner,
                None => 0..run.nodes.len(),
            };
            for (count, pages) in &mut held[nodes] {
                *count += primitives;
                *pages += 1;
            }
        }
        let fixed = run.plan.sum().total_bytes() - run.plan.lines as u64 * 64;
        let memory = |node: &hybray_simulated::NodeRun| fixed + node.high_water.page_bytes;
        let nodes = run.nodes.iter().zip(&held).map(|(node, &(primitives, pages))| NodeRun {
            primitives,
            pages,
            tiles: u64::from(node.report.tiles),
            demand_driven: rays(&node.report.counts).saturating_sub(node.exchange.arrived),
            data_parallel: node.exchange.arrived,
            forwarded: node.exchange.forwarded,
            fetched_pages: node.exchange.fetched,
            queues: queues(node),
            busy_seconds: seconds(node.busy_ns.iter().sum::<u64>().into()),
            busy_intervals: shares(&node.busy_ns, run),
            sent_messages: node.traffic.sent_frames,
            sent_bytes: node.traffic.sent_bytes,
            memory_high_water: memory(node),
        });
        let forwarded = run.nodes.iter().map(|node| node.exchange.forwarded).sum();
        Run {
            nodes: run.nodes.len() as u32,
            scheduler: name_of(self.settings.policy).to_owned(),
            seconds: seconds(run.time_ns.into()),
            speedup,
            efficiency: speedup / run.nodes.len() as f64,
            busy: run.busy(),
            loading_seconds: seconds(run.loading_ns.into()),
            gathering_seconds: seconds(run.gathering_ns.into()),
            longest_gap: seconds(run.longest.gap_ns.into()),
            longest_gap_bound: seconds(run.bound.gap_ns),
            longest_wait: seconds(run.longest.wait_ns.into()),
            longest_wait_bound: seconds(run.bound.wait_ns),
            longest_round: seconds(run.longest.round_ns.into()),
            longest_round_bound: seconds(run.bound.round_ns),
            messages: run.nodes.iter().map(|node| node.traffic.sent_frames).sum(),
            bytes: run.nodes.iter().map(|node| node.traffic.sent_bytes).sum(),
            memory_high_water: run.nodes.iter().map(memory).max().unwrap_or(0),
            memory_limit: self.memory,
            film: format!("{:016x}", run.film),
            events: format!("{:016x}", run.events),
            rays: Rays { primary: counts.primary, secondary: counts.secondary, shadow: counts.shadow, forwarded },
            per_node: nodes.collect(),
            host_busy_intervals: shares(&run.host_busy_ns, run),
            interval_seconds: seconds(run.interval_ns.into()),
        }
    }
}

/// Why there is no record.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RunError {
    /// The simulator says so.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The pages do not fit.
    #[error(transparent)]
    NoFit(#[from] NoFit),
    /// No node would be given tiles.
    #[error(transparent)]
    NoCandidate(#[from] NoCandidate),
    /// The machines say so, and that is a bug.
    #[error("the picture on {nodes} nodes is not finished but {outcome:?}: please report this, with the scene")]
    Unfinished {
        /// How many nodes.
        nodes: Peer,
        /// What became of it.
        outcome: Outcome,
    },
}

/// Seconds, of whole nanoseconds.
#[must_use]
pub fn seconds(nanoseconds: u128) -> f64 {
    nanoseconds as f64 * 1e-9
}

/// Which part of each interval of a run is busy time.
fn shares(busy_ns: &[u64], run: &Simulated) -> Vec<f32> {
    let share = |(interval, &busy): (u64, &u64)| {
        let length = run.interval_ns.min(run.time_ns - interval * run.interval_ns);
        busy as f32 / length.max(1) as f32
    };
    (0..).zip(busy_ns).map(share).collect()
}

fn rays(counts: &Counts) -> u64 {
    counts.primary + counts.secondary + counts.shadow
}

fn queues(node: &hybray_simulated::NodeRun) -> Vec<QueueRun> {
    let h = &node.high_water;
    let all = [("rays", h.rays), ("partial sums", h.partials), ("tiles", h.tiles), ("page requests", h.requests)];
    all.into_iter()
        .map(|(name, (high, limit))| QueueRun { name: name.to_owned(), high_water: high as u64, limit: limit as u64 })
        .collect()
}
