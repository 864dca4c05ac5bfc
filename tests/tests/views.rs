//! Pictures one after the other in one run: each is what it is alone, film and counts, whatever nodes keep from those before.

use hybray::build;
use hybray::model::{CameraSpec, Settings as Wanted};
use hybray::partition::light_caches;
use hybray::prepare::Prepared;
use hybray_native::{Budget, DispatcherAt, Farm, Traced, Watch, plan, trace, trace_all, trace_all_within};
use hybray_scheduler::policy::{Policy, Tiles};
use hybray_scheduler::{Film, NodeReport, Options, Outcome, PlanError, Progress, Settings};
use hybray_simulated::{Budget as Room, Farm as Simulation, Machine, simulate_run};
use hybray_tests::{Random, kernels, scene, within};
use hybray_tracer::Scene;
use hybray_wire::{Counts, Frame};

const PAGE_BYTES: usize = 4096;

fn farm(nodes: u16, dispatcher: DispatcherAt) -> Farm {
    Farm { nodes, kernels: kernels(), dispatcher, shadow_bundles: true, options: Options::default() }
}

fn counts(nodes: &[NodeReport]) -> Counts {
    let mut counts = Counts::default();
    nodes.iter().for_each(|node| counts += node.counts);
    counts
}

/// The scene from several sides, in sizes of few and many tiles, with other samples, depths and seeds.
fn frames(prepared: &Prepared) -> Vec<Frame> {
    let own = &prepared.cameras[0];
    let views = [
        ([48, 40], 1, 4, 0.0),
        ([96, 64], 2, 2, 0.7),
        ([8, 8], 3, 4, -0.4),
        ([48, 40], 1, 4, 0.0),
        ([33, 70], 1, 1, 1.5),
    ];
    let frame = |&(size, samples, depth, turn): &([u32; 2], u32, u32, f32)| {
        let [x, y, z] = [0, 1, 2].map(|axis| own.eye[axis] - own.target[axis]);
        let (sin, cos) = turn.sin_cos();
        let eye = [x * cos - y * sin, x * sin + y * cos, z];
        let eye = [0, 1, 2].map(|axis| own.target[axis] + eye[axis]);
        let camera = CameraSpec { eye, ..own.clone() };
        let wanted = Wanted { size: Some(size), spp: Some(samples), depth: Some(depth), ..Wanted::default() };
        prepared.frame(&camera, &wanted)
    };
    let mut frames: Vec<Frame> = views.iter().map(frame).collect();
    // Layers of the second, and its halves.
    let light = frames[1];
    frames.extend([1, 2, 3, 4].map(|layer| Frame { layer, ..light }));
    frames.extend([1, 2].map(|half| Frame { half, ..light }));
    frames
}

/// The least memory that will do.
fn least(scene: &Scene<'_>, owners: &[u16], nodes: u16, policy: Policy) -> u64 {
    let mut entries = scene.resident.directory.entries.to_vec();
    entries.iter_mut().zip(owners).for_each(|(entry, &owner)| entry.owner = owner);
    let mut owned = *scene;
    owned.resident.directory.entries = &entries;
    match plan(&owned, nodes, 0, policy) {
        Err(PlanError::Memory { needed } | PlanError::Pages { needed }) => needed,
        other => panic!("nothing is enough: {other:?}"),
    }
}

fn same(all: &[Traced], alone: &[Traced], what: &dyn Fn() -> String) {
    assert_eq!(all.len(), alone.len(), "{}", what());
    for (number, (one, expected)) in all.iter().zip(alone).enumerate() {
        assert_eq!((one.outcome, one.film), (Outcome::Finished, expected.film), "{number}: {}", what());
        assert_eq!(counts(&one.nodes), counts(&expected.nodes), "{number}: {}", what());
        assert_eq!((one.refused_frames, one.progress.tiles), (0, expected.progress.tiles), "{number}: {}", what());
        assert!(one.worked.iter().all(|node| node.traffic.nonsense == 0), "{number}: {}", what());
    }
}

fn check(name: &str) {
    let settings = build::Settings { page_bytes: PAGE_BYTES, ..build::Settings::default() };
    let prepared = Prepared::new(scene(name), &settings).unwrap_or_else(|e| panic!("{name}: {e}"));
    let opened = prepared.packed.open().unwrap_or_else(|e| panic!("{name}: {e}"));
    let (scene, pages) = (prepared.scene(&opened), prepared.packed.page_slices());
    let frames = frames(&prepared);
    let one = farm(1, DispatcherAt::Host);
    let alone: Vec<Traced> = frames
        .iter()
        .map(|frame| trace(&scene, prepared.hash, frame, &one, &mut |_| true).expect("a picture"))
        .collect();
    assert_eq!(alone[0].film, alone[3].film, "a picture that comes twice");
    let random = &mut Random(name.bytes().fold(7, |seed: u64, byte| seed.wrapping_mul(31) + u64::from(byte)));
    for nodes in [1, 2, 3, 7] {
        for dispatcher in [DispatcherAt::Host, DispatcherAt::Node] {
            let farm = farm(nodes, dispatcher);
            let what = || format!("{name}, {farm:?}");
            let all = within(60, what, || trace_all(&scene, prepared.hash, &frames, &farm, &mut |_| true));
            same(&all.expect("pictures"), &alone, &what);
        }
        let owners: Vec<u16> = pages.iter().map(|_| random.below(usize::from(nodes)) as u16 + 1).collect();
        for (_, policy) in Policy::ALL {
            let least = least(&scene, &owners, nodes, policy);
            for memory in [least, 2 * least] {
                let dispatcher = [DispatcherAt::Host, DispatcherAt::Node][random.below(2)];
                let subhosts = [None, Some(0), Some(1), Some(nodes / 2)][random.below(4)];
                let steps = [16, 4096][random.below(2)];
                let settings = Settings { policy, subhosts, steps, ..Settings::default() };
                let tiles = [Tiles::Dynamic, Tiles::Static, Tiles::PixelCount { pixels: 300 }][random.below(3)];
                let options = Options { tiles, take_over: random.below(2) == 0, ..Options::default() };
                let mut entries = scene.resident.directory.entries.to_vec();
                entries.iter_mut().zip(&owners).for_each(|(entry, &owner)| entry.owner = owner);
                let mut owned = scene;
                owned.resident.directory.entries = &entries;
                let plan = plan(&owned, nodes, memory, policy).expect("it is enough");
                let (_, caches) = light_caches(plan, memory, None, policy, &scene, &owners, nodes).expect("room");
                let barred: Vec<bool> = (0..=nodes).map(|_| random.below(3) == 0).collect();
                let (pages, copies) = (&pages, &caches.pages);
                let budget = Budget { memory, owners: &owners, pages, copies, parts: &[], settings, barred: &barred };
                let farm = Farm { options, ..farm(nodes, dispatcher) };
                let what = || format!("{name}, {farm:?}, {memory} bytes, {settings:?}, no tiles for {barred:?}");
                let all = within(60, what, || {
                    trace_all_within(&scene, prepared.hash, &frames, &farm, &budget, &mut |_| true)
                });
                same(&all.unwrap_or_else(|e| panic!("{}: {e}", what())).expect("pictures"), &alone, &what);
            }
        }
    }
}

#[test]
fn balls() {
    check("spd:balls:2");
}

#[test]
fn glass() {
    check("spd:teapot:3");
}

#[test]
fn mirrors() {
    check("cornell:mirror");
}

/// Pages that nodes have fetched stay with them from one picture to the next. On virtual machines, where that is counted alike
/// at every time.
#[test]
fn pages_are_not_fetched_again() {
    let settings = build::Settings { page_bytes: PAGE_BYTES, ..build::Settings::default() };
    let prepared = Prepared::new(scene("organic:2000"), &settings).expect("a scene");
    let opened = prepared.packed.open().expect("pages");
    let (scene, pages) = (prepared.scene(&opened), prepared.packed.page_slices());
    let owners: Vec<u16> = (0..pages.len()).map(|page| 1 + (page % 2) as u16).collect();
    let policy = Policy::DemandDriven;
    let machine = Machine::named("threads").expect("a machine");
    let settings = Settings { policy, ..machine.settings(policy) };
    // As much as there can be of a cache: a plan that had room for all would put them there before the start.
    let holds_all = |memory| {
        let mut entries = scene.resident.directory.entries.to_vec();
        entries.iter_mut().zip(&owners).for_each(|(entry, &owner)| entry.owner = owner);
        let mut owned = scene;
        owned.resident.directory.entries = &entries;
        plan(&owned, 2, memory, policy).expect("it is enough").holds_all
    };
    let mut memory = least(&scene, &owners, 2, policy);
    while !holds_all(memory + 1024) {
        memory += 1024;
    }
    let budget = Room { memory, page_memory: None, owners: &owners, copies: &[], parts: &[], barred: &[] };
    let farm =
        Simulation { machine, nodes: 2, dispatcher: 0, options: Options::default(), settings, budget: Some(budget) };
    let wanted = Wanted { size: Some([64, 64]), spp: Some(1), ..Wanted::default() };
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let fetched = |count| {
        let frames = vec![frame; count];
        let run =
            simulate_run(&scene, prepared.hash, &pages, &frames, &farm, &mut |_| {}, &mut |_| true).expect("a run");
        assert!(!run.plan.holds_all && run.before.len() == count - 1);
        assert!(run.before.iter().all(|before| before.film == run.film));
        run.nodes.iter().map(|node| node.exchange.fetched).sum::<u64>()
    };
    let (one, four) = (fetched(1), fetched(4));
    assert!(one > 10 && four + one / 4 < 4 * one, "{one} pages for one picture, {four} for four");
}

/// Stops in one picture of three, and notes how each ended.
struct Stops {
    at: usize,
    begun: usize,
    ended: Vec<Outcome>,
    /// Before anything is said to nodes.
    first: bool,
}

impl Watch for Stops {
    fn begin(&mut self, _: &mut Film<'_>) -> bool {
        self.begun += 1;
        !(self.first && self.begun - 1 == self.at)
    }

    fn look(&mut self, progress: Progress, _: &Film<'_>) -> bool {
        self.begun - 1 != self.at || progress.finished == 0
    }

    fn end(&mut self, outcome: Outcome, _: &Film<'_>) {
        self.ended.push(outcome);
    }
}

#[test]
fn a_run_that_is_stopped_ends_where_it_is() {
    let prepared = Prepared::new(scene("spd:balls:2"), &build::Settings::default()).expect("a scene");
    let opened = prepared.packed.open().expect("pages");
    let scene = prepared.scene(&opened);
    let frames = &frames(&prepared)[..3];
    for (at, dispatcher) in (0..4).flat_map(|at| [(at, DispatcherAt::Host), (at, DispatcherAt::Node)]) {
        for first in [true, false] {
            let farm = farm(3, dispatcher);
            let mut watch = Stops { at, begun: 0, ended: Vec::new(), first };
            let what = || format!("{at}, {dispatcher:?}");
            let all = within(60, what, || trace_all(&scene, prepared.hash, frames, &farm, &mut watch)).expect("some");
            let outcomes: Vec<_> = all.iter().map(|one| one.outcome).collect();
            assert_eq!(outcomes, watch.ended);
            let last = all.len() - 1;
            assert!(outcomes[..last].iter().all(|&outcome| outcome == Outcome::Finished), "{outcomes:?}");
            if outcomes[last] == Outcome::Stopped {
                assert_eq!((last, watch.begun), (at, at + 1));
            } else {
                // It may have been done before anybody looked.
                assert!(last == 2 && !(first && at < 3), "{outcomes:?}");
            }
        }
    }
}
