//! Nodes with a budget: the picture is that of nodes that have everything, whatever the budget, the policy and the owners;
//! and what a plan says would do does, by no line less.

use hybray::build;
use hybray::model;
use hybray::partition::light_caches;
use hybray::prepare::Prepared;
use hybray_native::{Budget, DispatcherAt, Farm, plan, trace, trace_within};
use hybray_scene::PageForm;
use hybray_scheduler::policy::{Policy, Tiles};
use hybray_scheduler::{Options, Outcome, Plan, PlanError, Settings, Sizes};
use hybray_tests::{Random, kernels, scene, within};
use hybray_tracer::Scene;
use hybray_wire::Counts;

/// Bytes of a line of memory: budgets are counted in them.
const LINE: u64 = 64;

/// Draws a scene on farms with every policy, and with the least memory that will do and half as much again. Returns how many
/// pages were in light caches.
fn check(name: &str, page_bytes: usize, pages: PageForm, samples: u32) -> usize {
    let prepared = Prepared::new(scene(name), &build::Settings { page_bytes, pages, ..build::Settings::default() })
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    let opened = prepared.packed.open().unwrap_or_else(|e| panic!("{name}: {e}"));
    let scene = prepared.scene(&opened);
    let pages = prepared.packed.page_slices();
    let size = Some([96, 64]);
    let wanted = model::Settings { size, spp: Some(samples), depth: Some(4), ..model::Settings::default() };
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let farm = |nodes, dispatcher| Farm {
        nodes,
        kernels: kernels(),
        dispatcher,
        shadow_bundles: true,
        options: Options::default(),
    };
    let expected =
        trace(&scene, prepared.hash, &frame, &farm(1, DispatcherAt::Host), &mut |_| true).expect("a picture");
    let seed = name.bytes().fold(page_bytes as u64, |seed, byte| seed.wrapping_mul(31) + u64::from(byte));
    let (random, ways) = (&mut Random(seed), &mut Random(!seed));
    let mut light_pages = 0;
    for nodes in [1, 2, 3, 7] {
        let owners: Vec<u16> = pages.iter().map(|_| random.below(nodes) as u16 + 1).collect();
        let nodes = nodes as u16;
        for (_, policy) in Policy::ALL {
            let least = least(&scene, &owners, nodes, policy);
            for memory in [least, least + least / 2] {
                let dispatcher = [DispatcherAt::Host, DispatcherAt::Node][random.below(2)];
                let steps = [16, 4096][random.below(2)];
                let subhosts = [None, Some(0), Some(1), Some(nodes / 2)][ways.below(4)];
                let settings = Settings { policy, steps, subhosts, ..Settings::default() };
                let count = Tiles::PixelCount { pixels: 300 };
                let tiles = [Tiles::Dynamic, Tiles::Static, count][ways.below(3)];
                let options = Options { tiles, take_over: ways.below(2) == 0, ..Options::default() };
                let barred: Vec<bool> = (0..=nodes).map(|_| ways.below(3) == 0).collect();
                let plan = planned(&scene, &owners, nodes, memory, policy).expect("it is enough");
                let room = plan.room_for_copies(memory);
                let asked = [None, Some(0), Some(room / 2), Some(room)][random.below(4)];
                let (plan, caches) = light_caches(plan, memory, asked, policy, &scene, &owners, nodes).expect("room");
                assert!(plan.sum().total_bytes() <= memory, "{plan:?}");
                light_pages += caches.pages.iter().map(Vec::len).sum::<usize>();
                let (pages, copies) = (&pages, &caches.pages);
                let budget = Budget { memory, owners: &owners, pages, copies, parts: &[], settings, barred: &barred };
                let shadow_bundles = ways.below(3) > 0;
                let farm = Farm { shadow_bundles, options, ..farm(nodes, dispatcher) };
                let what = || {
                    let lights = caches.bytes;
                    format!(
                        "{name}, seed {seed}, {farm:?}, {memory} bytes, {lights} of them in light caches, {settings:?}, \
                         no tiles for {barred:?}"
                    )
                };
                let traced =
                    within(60, what, || trace_within(&scene, prepared.hash, &frame, &farm, &budget, &mut |_| true));
                let traced = traced.unwrap_or_else(|e| panic!("{}: {e}", what())).expect("a picture");
                assert_eq!((traced.outcome, traced.film), (Outcome::Finished, expected.film), "{}", what());
                assert_eq!(counts(&traced.nodes), counts(&expected.nodes), "{}", what());
                for node in &traced.worked {
                    let high = node.high_water;
                    let all = [high.rays, high.partials, high.tiles, high.requests];
                    assert!(all.iter().all(|(most, limit)| most <= limit), "{}: {high:?}", what());
                    assert!(high.page_bytes <= memory, "{}: {high:?}", what());
                    assert_eq!(node.traffic.nonsense, 0, "{}", what());
                }
            }
        }
    }
    light_pages
}

fn counts(nodes: &[hybray_scheduler::NodeReport]) -> Counts {
    let mut counts = Counts::default();
    nodes.iter().for_each(|node| counts += node.counts);
    counts
}

/// The plan of nodes that own what `owners` says.
fn planned(scene: &Scene<'_>, owners: &[u16], nodes: u16, memory: u64, policy: Policy) -> Result<Plan, PlanError> {
    let mut entries = scene.resident.directory.entries.to_vec();
    entries.iter_mut().zip(owners).for_each(|(entry, &owner)| entry.owner = owner);
    let mut owned = *scene;
    owned.resident.directory.entries = &entries;
    plan(&owned, nodes, memory, policy)
}

/// The least memory that will do, as the refusal of less says.
fn least(scene: &Scene<'_>, owners: &[u16], nodes: u16, policy: Policy) -> u64 {
    let plan = |memory| planned(scene, owners, nodes, memory, policy);
    let least = needed(plan(0)).expect("nothing is too little");
    let fits = plan(least).unwrap_or_else(|e| panic!("{nodes} nodes: {e}"));
    assert!(fits.sum().total_bytes() <= least, "{fits:?}");
    assert_eq!(needed(plan(least - LINE)), Some(least), "{nodes} nodes");
    assert_eq!(needed(plan(least / 2)), Some(least), "{nodes} nodes");
    least
}

fn needed(plan: Result<Plan, PlanError>) -> Option<u64> {
    match plan {
        Err(PlanError::Memory { needed } | PlanError::Pages { needed }) => Some(needed),
        Ok(_) | Err(PlanError::LightCache { .. }) => None,
    }
}

#[test]
fn balls() {
    check("spd:balls:2", 4096, PageForm::Full, 2);
    check("spd:balls:2", 16_384, PageForm::Full, 1);
}

#[test]
fn lenses_and_projections() {
    check("spd:balls:2@blades", 4096, PageForm::Full, 2);
    check("spd:teapot:3@lens", 4096, PageForm::Compact, 1);
    check("spd:balls:2@orthographic", 4096, PageForm::Full, 1);
    check("organic:2000@spherical", 4096, PageForm::Full, 1);
}

#[test]
fn glass() {
    let light_pages =
        check("spd:teapot:3", 4096, PageForm::Full, 1) + check("spd:teapot:3", 16_384, PageForm::Compact, 1);
    assert!(light_pages > 40, "{light_pages} pages in light caches");
}

#[test]
fn mirrors() {
    check("cornell:mirror", 4096, PageForm::Full, 2);
    check("cornell:mirror", 16_384, PageForm::Compact, 1);
}

#[test]
fn meshes_without_end() {
    let light_pages =
        check("organic:2000", 4096, PageForm::Full, 1) + check("organic:2000", 16_384, PageForm::Compact, 1);
    assert!(light_pages > 40, "{light_pages} pages in light caches");
}

#[test]
fn textures() {
    check("gallery:64", 4096, PageForm::Full, 2);
    check("gallery:64", 8192, PageForm::Compact, 1);
}

#[test]
fn many_lights() {
    check("paper:vase", 4096, PageForm::Full, 1);
    check("paper:vase", 16_384, PageForm::Full, 1);
}

/// Even shares, for scenes and budgets of all sizes: what is refused says what would do, and no less would.
#[test]
fn a_refusal_says_what_would_do() {
    let random = &mut Random(11);
    let (mut too_few, mut not_even_a_node) = (0, 0);
    for round in 0..4000 {
        let (pages_log2, nodes_log2) = (1 + random.below(14), random.below(9));
        let pages = 1 + random.below(1 << pages_log2);
        let page_bytes_max = LINE as usize * (1 + random.below(1024));
        let pages_bytes = LINE * (0..pages.min(64)).map(|_| 1 + random.below(page_bytes_max / 64) as u64).sum::<u64>();
        let pages_bytes = (pages_bytes * pages as u64 / pages.min(64) as u64 / LINE * LINE).max(page_bytes_max as u64);
        let directory_nodes = 1 + pages / 4;
        let (materials, lights) = (random.below(100), random.below(40));
        let (maps, texel_pages_of_a_hit) = ([random.below(30); 3], 2 * random.below(5));
        let cells = [random.below(2000), random.below(4000)];
        let sizes = Sizes {
            pages,
            pages_bytes,
            page_bytes_max,
            directory_nodes,
            materials,
            lights,
            maps,
            cells,
            texel_pages_of_a_hit,
        };
        let (nodes, policy) = (1 + random.below(1 << nodes_log2) as u16, Policy::ALL[random.below(4)].1);
        let memory = random.bits() % (1 << (10 + random.below(20)));
        let plan = |nodes, memory| Plan::new(sizes, nodes, memory, None, policy);
        let what = format!("round {round}: {sizes:?}, {nodes} nodes of {memory} bytes, {policy:?}");
        match plan(nodes, memory) {
            Ok(plan) => {
                assert!(plan.sum().total_bytes() <= memory, "{what}: {plan:?}");
                let room = plan.room_for_copies(memory);
                let all = plan.with_copies(room, memory).unwrap_or_else(|e| panic!("{what}: {e}"));
                assert!(all.sum().total_bytes() <= memory, "{what}: {all:?}");
                let more = plan.with_copies(room + LINE, memory);
                let refused = Err(PlanError::LightCache { bytes: room + LINE, room });
                assert!(more == refused || plan.holds_all && more == Ok(plan), "{what}: {more:?}");
                let some = LINE * (random.bits() % (room / LINE + 1));
                let some = plan.with_copies(some, memory).unwrap_or_else(|e| panic!("{what}: {e}"));
                assert!(some.sum().total_bytes() <= memory && some.places <= plan.places, "{what}: {some:?}");
                assert!(plan.holds_all || some.fixed_bytes() == plan.fixed_bytes() + 64 * some.copied_lines as u64);
            }
            Err(error) => {
                let needed = needed(Err(error)).expect("a refusal");
                let fits = plan(nodes, needed).unwrap_or_else(|e| panic!("{what}: {needed} should do: {e}"));
                assert!(fits.sum().total_bytes() <= needed, "{what}: {fits:?}");
                assert!(plan(nodes, needed - LINE).is_err(), "{what}: less than {needed} does too");
                match error {
                    PlanError::LightCache { .. } => panic!("{what}: nobody asked for one"),
                    PlanError::Memory { .. } => not_even_a_node += 1,
                    PlanError::Pages { .. } => too_few += 1,
                }
            }
        }
    }
    let seen = [too_few, not_even_a_node];
    assert!(seen.iter().all(|&count| count > 50), "some of each kind: {seen:?}");
}
