//! Random schedules on the simulated farm: whatever is drawn, the film is the same, and no limit is passed.
//!
//! A seed draws everything: scene, nodes, owners, memory, policy and its settings, the machine and its network, delays, and
//! in every third seed faults. What was drawn is printed when something is wrong, and `HYBRAY_SEED=n` runs that seed alone.
//! `cargo xtask soak` runs thousands (`HYBRAY_SEEDS`, from `HYBRAY_FIRST` on).

use hybray::build;
use hybray::model;
use hybray::partition::{Voxels, light_caches, owners};
use hybray::prepare::Prepared;
use hybray_native::{DispatcherAt, Farm as Threads, plan, trace};
use hybray_scene::{PageForm, lines_for};
use hybray_scheduler::policy::{Grid, LinkCost, Policy, Tiles};
use hybray_scheduler::{Options, Outcome, Plan, PlanError, Settings};
use hybray_simulated::{
    Budget, Farm, LinkModel, MACHINES, Machine, Network, NetworkModel, Simulated, Topology, simulate_run,
};
use hybray_tests::{Random, kernels, scene, within};
use hybray_tracer::Scene;
use hybray_wire::{Counts, Frame};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicU64, Ordering};

/// Seeds in the gate.
const SEEDS: u64 = 300;
/// Every so many seeds one is run twice.
const TWICE: u64 = 10;
/// Every so many seeds one is run with several pictures, too.
const SEVERAL: u64 = 2;
const NAMES: [&str; 9] = [
    "spd:balls:1",
    "spd:teapot:2",
    "cornell:mirror",
    "spd:gears:1@lens",
    "spd:mount:2",
    "organic:400@orthographic",
    "gallery:48",
    "spd:balls:1@blades",
    "spd:teapot:2@spherical",
];
const PAGE_BYTES: [usize; 3] = [1024, 4096, 16_384];
const SIZES: [([u32; 2], u32, u32); 3] = [([24, 24], 1, 4), ([40, 24], 2, 3), ([64, 48], 1, 2)];

/// A scene in pages of one size, and what it looks like.
struct Drawn {
    name: String,
    prepared: Prepared,
    /// Frames, their films, and what is traced for them.
    frames: Vec<(Frame, u64, Counts)>,
}

impl Drawn {
    fn all() -> Vec<Self> {
        let cuts = [Voxels::One, Voxels::Grid([2, 2, 1]), Voxels::Adaptive(5)];
        let all =
            NAMES.iter().flat_map(|name| PAGE_BYTES.iter().zip(cuts).map(move |(&bytes, cut)| (name, bytes, cut)));
        let forms = [PageForm::Full, PageForm::Compact].into_iter().cycle();
        all.zip(forms)
            .map(|((name, page_bytes, voxels), pages)| {
                let settings = build::Settings { page_bytes, pages, voxels, ..build::Settings::default() };
                let prepared = Prepared::new(scene(name), &settings).unwrap_or_else(|e| panic!("{name}: {e}"));
                let pages = prepared.packed.open().unwrap_or_else(|e| panic!("{name}: {e}"));
                let farm = Threads {
                    nodes: 1,
                    kernels: kernels(),
                    dispatcher: DispatcherAt::Host,
                    shadow_bundles: false,
                    options: Options { spread: Some(1.0), atomic: None, ..Options::default() },
                };
                let frames = SIZES.map(|(size, samples, depth)| {
                    let (size, spp, depth) = (Some(size), Some(samples), Some(depth));
                    let wanted = model::Settings { size, spp, depth, ..model::Settings::default() };
                    let frame = prepared.frame(&prepared.cameras[0], &wanted);
                    let traced =
                        trace(&prepared.scene(&pages), prepared.hash, &frame, &farm, &mut |_| true).expect(name);
                    assert_eq!(traced.outcome, Outcome::Finished, "{name}");
                    (frame, traced.film, traced.nodes[0].counts)
                });
                drop(pages);
                let name = format!("{name} in {page_bytes}");
                Self { name, prepared, frames: frames.to_vec() }
            })
            .collect()
    }
}

/// Something that happens to the network.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Cut { a: u16, b: u16, from_ns: u64, until_ns: u64 },
    Lose { node: u16, at_ns: u64, notice_ns: u64 },
}

/// What nodes have, and where pages and tiles are to begin with.
#[derive(Debug)]
struct Given {
    memory: u64,
    owners: Vec<u16>,
    copies: Vec<Vec<u32>>,
    parts: Vec<u32>,
}

/// What a seed draws beside its scene.
#[derive(Debug)]
struct Draw {
    machine: Machine,
    nodes: u16,
    dispatcher: u16,
    settings: Settings,
    options: Options,
    /// Every node has everything if there is none.
    budget: Option<Given>,
    /// Nodes that are given no tiles, where they have a budget.
    barred: Vec<bool>,
    delays: Option<(u64, u64)>,
    faults: Vec<Fault>,
}

fn one_of<T: Copy>(random: &mut Random, values: &[T]) -> T {
    values[random.below(values.len())]
}

fn network(random: &mut Random, nodes: u16, machine: &Machine) -> NetworkModel {
    let topologies = [
        Topology::Crossbar,
        Topology::Mesh2d { columns: 1 + random.below(usize::from(nodes)) as u16 },
        Topology::Chain,
        Topology::Bus,
    ];
    let link = |random: &mut Random| LinkModel {
        latency_ns: machine.network.link.latency_ns * one_of(random, &[0, 1, 1, 10]) / one_of(random, &[1, 1, 5]),
        bytes_per_second: (machine.network.link.bytes_per_second / one_of(random, &[1, 1, 10])).max(1),
    };
    NetworkModel {
        topology: one_of(random, &topologies),
        link: link(random),
        host_link: link(random),
        room_frames: one_of(random, &[1, 1, 2, 3, 8]),
    }
}

/// The least memory that will do.
fn planned(scene: &Scene<'_>, owners: &[u16], nodes: u16, memory: u64, policy: Policy) -> Result<Plan, PlanError> {
    let mut entries = scene.resident.directory.entries.to_vec();
    entries.iter_mut().zip(owners).for_each(|(entry, &owner)| entry.owner = owner);
    let mut owned = *scene;
    owned.resident.directory.entries = &entries;
    plan(&owned, nodes, memory, policy)
}

fn least(scene: &Scene<'_>, owners: &[u16], nodes: u16, policy: Policy) -> u64 {
    match planned(scene, owners, nodes, 0, policy) {
        Err(PlanError::Memory { needed } | PlanError::Pages { needed }) => needed,
        plan => panic!("nothing is enough: {plan:?}"),
    }
}

impl Draw {
    fn new(random: &mut Random, drawn: &Drawn, scene: &Scene<'_>, faulty: bool) -> Self {
        let nodes = one_of(random, &[1, 2, 2, 3, 4, 5, 7, 8, 13, 16, 32, 64]);
        let mut machine = one_of(random, &MACHINES);
        machine.network = network(random, nodes, &machine);
        let policy = Policy::ALL[random.below(4)].1;
        let usual = machine.settings(policy);
        let settings = Settings {
            granularity: one_of(random, &[1, 7, 30, 100, 186, 1000]),
            deadline_ns: usual.deadline_ns * one_of(random, &[0, 1, 1, 20]),
            steps: one_of(random, &[1, 2, 16, 16, 300, 4096]),
            bundle_tiles: one_of(random, &[1, 4]),
            in_system: one_of(random, &[1, 64, 4096]),
            requests: one_of(random, &[1, 2, 8, 16]),
            link: one_of(random, &[usual.link, LinkCost { message_ns: 1, byte_ps: 1 }]),
            // Without drawing: what a seed draws stays as it was.
            shadow_bundles: !random.0.is_multiple_of(4),
            ..usual
        };
        let options =
            Options { spread: one_of(random, &[None, Some(1.0), Some(8.0)]), atomic: None, ..Options::default() };
        let budget = (random.below(8) > 0).then(|| Self::budget(random, drawn, scene, nodes, policy));
        let message_ns = usual.deadline_ns / 8;
        let delays = (random.below(2) == 0).then(|| (random.bits(), message_ns * one_of(random, &[1, 10])));
        let mut draw = Self {
            machine,
            nodes,
            dispatcher: one_of(random, &[0, 0, 1]),
            settings,
            options,
            budget,
            barred: Vec::new(),
            delays,
            faults: Vec::new(),
        };
        if faulty {
            draw.spoil(random, message_ns);
        }
        draw.give_out(random);
        draw.settings.grid = Self::grid(random, scene);
        draw
    }

    /// A grid that rays go through from voxel to voxel, the scene's or any other.
    fn grid(random: &mut Random, scene: &Scene<'_>) -> Option<Grid> {
        let any = [0; 3].map(|_| one_of(random, &[1, 2, 3, 4, 8]));
        let sides = one_of(random, &[any, [2, 2, 1]]);
        Voxels::Grid(sides).grid(scene).filter(|_| random.below(3) == 0)
    }

    /// When nodes are given tiles, which of them, and who clips for them.
    fn give_out(&mut self, random: &mut Random) {
        let count = Tiles::PixelCount { pixels: one_of(random, &[1, 200, 4096]) };
        let tiles = one_of(random, &[Tiles::Dynamic, Tiles::Dynamic, Tiles::Static, count]);
        self.settings.subhosts =
            one_of(random, &[None, None, Some(0), Some(1), Some(self.nodes / 2), Some(self.nodes)]);
        self.options = Options { tiles, take_over: random.below(4) > 0, ..self.options };
        let some = random.below(2) == 0;
        self.barred = (0..=self.nodes).map(|_| some && random.below(2) == 0).collect();
    }

    fn budget(random: &mut Random, drawn: &Drawn, scene: &Scene<'_>, nodes: u16, policy: Policy) -> Given {
        let count = drawn.prepared.packed.pages();
        let any = |random: &mut Random| 1 + random.below(usize::from(nodes)) as u16;
        let only = any(random);
        let owners = match random.below(4) {
            0 => (0..count).map(|page| 1 + (page % usize::from(nodes)) as u16).collect(),
            1 => vec![only; count],
            2 => {
                let packed = &drawn.prepared.packed;
                owners(&packed.placed_pages(), packed.voxels(), nodes, u64::MAX).expect("room for all")
            }
            _ => (0..count).map(|_| any(random)).collect(),
        };
        let least = least(scene, &owners, nodes, policy);
        let memory = least + least * one_of(random, &[0, 0, 0, 1, 4, 16]) / 16;
        let plan = planned(scene, &owners, nodes, memory, policy).expect("it is enough");
        let room = plan.room_for_copies(memory);
        let asked = one_of(random, &[None, Some(0), Some(room / 2), Some(room)]);
        let (plan, caches) = light_caches(plan, memory, asked, policy, scene, &owners, nodes).expect("there is room");
        let mut copies = caches.pages;
        if random.below(2) == 0 {
            // Any pages that they have not, as far as there is room: what a pilot finds is no better for that.
            copies.resize(usize::from(nodes), Vec::new());
            let entries = scene.resident.directory.entries;
            for (node, copies) in (1..).zip(&mut copies) {
                let mut room = plan.room_for_copies(memory);
                for _ in 0..random.below(20) {
                    let page = random.below(count);
                    let bytes = 64 * lines_for(entries[page].bytes as usize) as u64;
                    if owners[page] != node && !copies.contains(&(page as u32)) && bytes <= room {
                        room -= bytes;
                        copies.push(page as u32);
                    }
                }
            }
        }
        let mut parts: Vec<u32> = (0..usize::from(nodes) + 1).map(|_| random.below(40) as u32).collect();
        parts.sort_unstable();
        parts[0] = 0;
        if random.below(2) == 0 {
            parts.clear();
        }
        Given { memory, owners, copies, parts }
    }

    /// Faults at moments of the picture: most take as long as it does, or are over before it begins.
    fn spoil(&mut self, random: &mut Random, message_ns: u64) {
        let peer = |random: &mut Random| random.below(usize::from(self.nodes) + 1) as u16;
        let moment = |random: &mut Random| {
            let most = message_ns * one_of(random, &[4, 40, 400]) + 100_000;
            random.bits() % most
        };
        if random.below(3) == 0 {
            self.delays = Some((random.bits(), 100 * message_ns));
        }
        for _ in 0..random.below(4) {
            let (a, b, from_ns) = (peer(random), peer(random), moment(random));
            self.faults.push(Fault::Cut { a, b, from_ns, until_ns: from_ns + 100 * moment(random) });
        }
        // The dispatcher's node is the farm's; one of the others, at least, is left.
        let (first, nodes) = (1 + self.dispatcher, self.nodes);
        let all: Vec<u16> = random.shuffled((first..=nodes).collect());
        let most = usize::from(nodes).saturating_sub(1).min(all.len());
        let lost = if most == 0 { 0 } else { random.below(most.min(4) + 1) };
        for &node in &all[..lost] {
            let (at_ns, notice_ns) = (moment(random), moment(random));
            self.faults.push(Fault::Lose { node, at_ns, notice_ns });
        }
    }

    fn run(&self, drawn: &Drawn, scene: &Scene<'_>, pages: &[&[u8]], frames: &[Frame]) -> Simulated {
        let budget = self.budget.as_ref().map(|given| Budget {
            memory: given.memory,
            page_memory: None,
            owners: &given.owners,
            copies: &given.copies,
            parts: &given.parts,
            barred: &self.barred,
        });
        let Self { nodes, dispatcher, options, settings, .. } = *self;
        let farm = Farm { machine: &self.machine, nodes, dispatcher, options, settings, budget };
        let spoil = &mut |network: &mut Network| {
            if let Some((seed, most_ns)) = self.delays {
                network.delay(seed, most_ns);
            }
            for fault in &self.faults {
                match *fault {
                    Fault::Cut { a, b, from_ns, until_ns } => network.cut(a, b, from_ns, until_ns),
                    Fault::Lose { node, at_ns, notice_ns } => network.lose(node, at_ns, notice_ns),
                }
            }
        };
        simulate_run(scene, drawn.prepared.hash, pages, frames, &farm, spoil, &mut |_| true)
            .unwrap_or_else(|e| panic!("{e}"))
    }
}

/// The same farm draws several pictures, one after the other: faults fall into any of them, or between two.
fn several(seed: u64, drawn: &Drawn, draw: &Draw, scene: &Scene<'_>, pages: &[&[u8]]) {
    let random = &mut Random(!seed);
    let expected: Vec<_> = (0..2 + random.below(3)).map(|_| drawn.frames[random.below(SIZES.len())]).collect();
    let frames: Vec<Frame> = expected.iter().map(|&(frame, ..)| frame).collect();
    let run = draw.run(drawn, scene, pages, &frames);
    let (last, before) = expected.split_last().expect("several");
    let lost = draw.faults.iter().any(|fault| matches!(fault, Fault::Lose { .. }));
    assert_eq!((run.outcome, run.film, run.refused_frames), (Outcome::Finished, last.1, 0), "the last of {frames:?}");
    assert_eq!(run.before.len(), before.len());
    for (picture, (_, film, counts)) in run.before.iter().zip(before) {
        assert_eq!(picture.film, *film, "another picture among {frames:?}");
        assert!(lost || picture.counts == Some(*counts), "{:?} and not {counts:?} among {frames:?}", picture.counts);
    }
    assert!(run.nodes.iter().all(|node| node.exchange.nonsense == 0));
}

/// Draws and runs one seed.
fn check(seed: u64, all: &[Drawn], closeness: &Closeness) {
    let random = &mut Random(seed);
    let drawn = &all[random.below(all.len())];
    let (frame, film, counts) = drawn.frames[random.below(SIZES.len())];
    let opened = drawn.prepared.packed.open().expect("pages");
    let scene = drawn.prepared.scene(&opened);
    let pages = drawn.prepared.packed.page_slices();
    let draw = Draw::new(random, drawn, &scene, seed % 3 == 2);
    let what = || {
        let [width, height, samples] = [frame.width, frame.height, u32::from(frame.samples)];
        format!("HYBRAY_SEED={seed}: {}, {width}x{height}, {samples} samples, {draw:?}", drawn.name)
    };
    let tried = catch_unwind(AssertUnwindSafe(|| {
        within(600, what, || {
            let run = draw.run(drawn, &scene, &pages, &[frame]);
            expect(&run, &draw, film, &counts, closeness);
            if seed % SEVERAL == 1 {
                several(seed, drawn, &draw, &scene, &pages);
            }
            if seed.is_multiple_of(TWICE) {
                let again = draw.run(drawn, &scene, &pages, &[frame]);
                assert_eq!((again.events, again.film), (run.events, run.film), "another time another history");
                assert_eq!(again.nodes, run.nodes, "another time another history");
            }
        });
    }));
    if let Err(panic) = tried {
        eprintln!("{}", what());
        resume_unwind(panic);
    }
}

/// How near runs without faults came to their bounds, billionths.
#[derive(Debug, Default)]
struct Closeness {
    gap: AtomicU64,
    wait: AtomicU64,
    round: AtomicU64,
}

impl Closeness {
    /// Between two ends of rays, while nobody traces, and from asking to the answer no more time passes than the plan says
    /// (docs/PROGRESS.md). A fault begins the argument anew, and what is held up by one is no shorter for it.
    fn look(&self, run: &Simulated, draw: &Draw) {
        let held_ns = draw.faults.iter().map(|fault| match *fault {
            Fault::Cut { from_ns, until_ns, .. } => until_ns - from_ns,
            Fault::Lose { notice_ns, .. } => notice_ns,
        });
        let (held_ns, faults) = (u128::from(held_ns.sum::<u64>()), draw.faults.len() as u128);
        let (longest, bound) = (&run.longest, &run.bound);
        let all = [
            ("from one ray's end to the next", longest.gap_ns, bound.gap_ns, &self.gap),
            ("in which nobody traced", longest.wait_ns, bound.wait_ns, &self.wait),
            ("from asking to the answer", longest.round_ns, bound.round_ns, &self.round),
        ];
        for (what, longest_ns, bound_ns, closest) in all {
            let allowed_ns = (faults + 1) * bound_ns + held_ns;
            assert!(u128::from(longest_ns) <= allowed_ns, "{longest_ns} ns {what}, {allowed_ns} at most: {bound:?}");
            if faults == 0 {
                let near = u128::from(longest_ns) * 1_000_000_000 / allowed_ns;
                closest.fetch_max(near as u64, Ordering::Relaxed);
            }
        }
    }
}

fn expect(run: &Simulated, draw: &Draw, film: u64, expected: &Counts, closeness: &Closeness) {
    let lost = draw.faults.iter().any(|fault| matches!(fault, Fault::Lose { .. }));
    assert_eq!(run.outcome, Outcome::Finished);
    assert_eq!(run.film, film, "another picture");
    assert_eq!(run.refused_frames, 0);
    for (number, node) in run.nodes.iter().enumerate() {
        let high = node.high_water;
        let limits = run.plan.limits;
        let bounds = [(high.rays, limits.rays), (high.partials, limits.partials), (high.tiles, limits.tiles)];
        for ((most, limit), planned) in bounds {
            assert!(most <= limit && limit <= planned, "node {}: {most} of {limit}, planned {planned}", number + 1);
        }
        // More than the settings say: what the lane asked for stays asked for when its ray goes into the pool.
        assert!(high.requests.0 <= high.requests.1, "{high:?}");
        assert!(high.page_bytes <= 64 * run.plan.lines as u64, "node {}: {high:?}", number + 1);
        assert_eq!(node.exchange.nonsense, 0, "node {}", number + 1);
    }
    closeness.look(run, draw);
    if let Some(Given { memory, .. }) = draw.budget {
        assert!(run.plan.sum().total_bytes() <= memory, "over budget: {:?}", run.plan);
    }
    // Who is cut off from the host for all of the picture, and not from others, does not tell what it did for them.
    let known = run.nodes.iter().all(|node| node.report.is_known());
    let cut = draw.faults.iter().any(|fault| matches!(fault, Fault::Cut { .. }));
    assert!(known || lost || cut, "a node was not heard of");
    if !lost && known {
        let mut counts = Counts::default();
        run.nodes.iter().for_each(|node| counts += node.report.counts);
        assert_eq!(counts, *expected, "other rays");
        let ended: u64 = run.nodes.iter().map(|node| node.ended).sum();
        assert_eq!(ended, counts.primary + counts.secondary + counts.shadow, "rays that ended");
        let sum = |of: fn(&Simulated, usize) -> u64| (0..run.nodes.len()).map(|node| of(run, node)).sum::<u64>();
        let forwarded = sum(|run, node| run.nodes[node].exchange.forwarded);
        // The word that the last ones were taken may be on its way when all is finished.
        let arrived = sum(|run, node| run.nodes[node].exchange.arrived);
        assert!(forwarded <= arrived, "{forwarded} rays went, {arrived} came");
    }
}

fn variable(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(value.parse().unwrap_or_else(|_| panic!("{name} is a number, not {value}")))
}

#[test]
fn random_schedules() {
    let (first, count) = match variable("HYBRAY_SEED") {
        Some(seed) => (seed, 1),
        None => (variable("HYBRAY_FIRST").unwrap_or(0), variable("HYBRAY_SEEDS").unwrap_or(SEEDS)),
    };
    let all = Drawn::all();
    let (next, closeness) = (AtomicU64::new(first), Closeness::default());
    std::thread::scope(|threads| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            threads.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first.saturating_add(count) {
                        break;
                    }
                    check(seed, &all, &closeness);
                }
            });
        }
    });
    eprintln!("{closeness:?} of what is allowed at most, in billionths");
}
