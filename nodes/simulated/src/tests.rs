//! Farms over scenes made of nothing: what is tested is that they end, when, and alike.

use super::*;
use hybray_bintree::walk::Resident;
use hybray_link::HOST;
use hybray_scene::Directory;
use hybray_scheduler::policy::Policy;
use hybray_tracer::Layer;

const FRAME: Frame = Frame {
    width: 150,
    height: 70,
    samples: 2,
    depth_max: 3,
    filter: 1,
    seed: 5,
    weight_cutoff: 0.0,
    step_log2: -32,
    eye: [0.0, 0.0, -5.0],
    target: [0.0; 3],
    up: [0.0, 1.0, 0.0],
    fov_y_degrees: 40.0,
    hither: 0.0,
    layer: 0,
    half: 0,
    optics: hybray_wire::Optics::PINHOLE,
};

fn sky() -> Scene<'static> {
    Scene {
        resident: Resident { directory: Directory { nodes: &[], entries: &[] }, pages: &[] },
        shading: hybray_shading::Scene {
            materials: &[],
            lights: &[],
            ambient: [0.0; 3],
            ray_depth_max: 3,
            weight_cutoff: 0.0,
            distance_scale: 1.0,
            shadow_rays: 0,
            maps: hybray_shading::MapTables::default(),
        },
        background: [0.25, 0.5, 1.0],
        magnitude: 1.0,
        transmits: false,
        texels: &[],
        layer: Layer::Light,
        eye: [0.0; 3],
    }
}

fn farm(machine: &'static str, nodes: Peer, dispatcher: Peer) -> Farm<'static> {
    let machine = Machine::named(machine).unwrap();
    let settings = machine.settings(Policy::default());
    Farm { machine, nodes, dispatcher, options: Options::default(), settings, budget: None }
}

fn run(farm: &Farm<'_>, frame: &Frame) -> Simulated {
    let run = simulate(&sky(), 1, &[], frame, farm, &mut |_| true).unwrap_or_else(|e| panic!("{farm:?}: {e}"));
    assert_eq!((run.outcome, run.refused_frames), (Outcome::Finished, 0), "{farm:?}");
    let tiles: u32 = run.nodes.iter().map(|node| node.report.tiles).sum();
    assert_eq!(tiles, TileMap::new(frame.width, frame.height).unwrap().len(), "{farm:?}");
    run
}

#[test]
fn every_machine_draws_the_same_sky_and_the_same_way_again() {
    let film = run(&farm("threads", 1, HOST), &FRAME).film;
    for machine in &MACHINES {
        for nodes in [1, 2, 7, 40] {
            for dispatcher in [HOST, 1] {
                let farm = farm(machine.name, nodes, dispatcher);
                let (first, again) = (run(&farm, &FRAME), run(&farm, &FRAME));
                assert_eq!(first.film, film, "{farm:?}");
                assert_eq!((first.events, first.time_ns), (again.events, again.time_ns), "{farm:?}");
                assert_eq!(first.nodes, again.nodes, "{farm:?}");
                let busy = first.busy();
                assert!(busy > 0.0 && busy <= 1.0, "{farm:?}: {busy}");
            }
        }
    }
}

/// One node alone computes without a pause, but for its messages: its time is the sum of its costs.
#[test]
fn one_nodes_time_is_the_sum_of_its_costs() {
    let run = run(&farm("powerxplorer", 1, HOST), &FRAME);
    let computing_ns = Machine::named("powerxplorer").unwrap().costs.of(&run.operations()) / 1000;
    let node = &run.nodes[0];
    assert!(computing_ns.abs_diff(node.computing_ns) < 1000 * u64::from(node.report.tiles), "{run:?}");
    let before_and_after = 20_000_000;
    let all = node.computing_ns + node.messaging_ns;
    assert!(run.time_ns <= all && all <= run.time_ns + before_and_after, "{} of {all}", run.time_ns);
    assert_eq!(node.report.counts.primary, 150 * 70 * 2);
    assert_eq!(node.operations.rays, 150 * 70 * 2);
}

#[test]
fn a_thousand_nodes_share_a_small_picture() {
    for (machine, dispatcher) in [("gigabit", HOST), ("powerxplorer", 1)] {
        let run = run(&farm(machine, 1024, dispatcher), &Frame { width: 256, height: 256, samples: 8, ..FRAME });
        assert_eq!(run.nodes.len(), 1024);
        let at_work = run.nodes.iter().filter(|node| node.report.tiles > 0).count();
        assert!(at_work > 300, "{machine}: {at_work}");
    }
}

#[test]
fn what_is_stopped_ends() {
    let farm = farm("gigabit", 5, HOST);
    let run = simulate(&sky(), 1, &[], &FRAME, &farm, &mut |progress| progress.finished < 20).unwrap();
    assert_eq!(run.outcome, Outcome::Stopped);
}

#[test]
fn a_cut_network_is_an_error_that_says_where() {
    let farm = farm("gigabit", 1, HOST);
    let cut = &mut |network: &mut Network| network.cut(HOST, 1, 0, u64::MAX);
    let error = simulate_spoiled(&sky(), 1, &[], &FRAME, &farm, cut, &mut |_| true).unwrap_err();
    assert!(matches!(&error, SimulateError::Stuck { state, .. } if state.contains("node 1: Asleep")), "{error}");
    // For a while only: it goes on.
    let cut = &mut |network: &mut Network| network.cut(HOST, 1, 0, 3_000_000_000);
    let run = simulate_spoiled(&sky(), 1, &[], &FRAME, &farm, cut, &mut |_| true).unwrap();
    assert_eq!(run.outcome, Outcome::Finished);
    assert!((3_000_000_000..3_001_000_000).contains(&run.loading_ns), "{}", run.loading_ns);
}

#[test]
fn a_lost_node_is_done_without() {
    let farm = farm("gigabit", 3, HOST);
    let film = run(&farm, &FRAME).film;
    let lose = &mut |network: &mut Network| network.lose(2, 30_000_000, 1_000_000);
    let run = simulate_spoiled(&sky(), 1, &[], &FRAME, &farm, lose, &mut |_| true).unwrap();
    assert_eq!((run.outcome, run.film), (Outcome::Finished, film));
}

#[test]
fn what_cannot_be_is_refused() {
    let none = farm("gigabit", 0, HOST);
    assert_eq!(simulate(&sky(), 1, &[], &FRAME, &none, &mut |_| true).unwrap_err(), SimulateError::NoFarm);
    let empty = Frame { width: 0, ..FRAME };
    let error = simulate(&sky(), 1, &[], &empty, &farm("gigabit", 1, HOST), &mut |_| true).unwrap_err();
    assert_eq!(error, SimulateError::NoPicture);
}
