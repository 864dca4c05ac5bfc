//! The simulated farm against the native one, and against the published times that its machines are fitted to.

use hybray::build::Settings;
use hybray::model;
use hybray::prepare::Prepared;
use hybray::simulate::runs::Experiment;
use hybray_geometry::simd::Kernels;
use hybray_native::{DispatcherAt, Farm};
use hybray_scheduler::{Options, Outcome};
use hybray_simulated::{MACHINES, Machine, Simulated};
use hybray_tests::{drawn, scene};
use hybray_wire::Counts;

fn wanted(side: u32, samples: u32) -> model::Settings {
    model::Settings { size: Some([side, side]), spp: Some(samples), ..model::Settings::default() }
}

/// Runs what `simulate` says of an experiment.
fn with<T>(name: &str, wanted: &model::Settings, machine: &Machine, work: impl FnOnce(&mut Experiment<'_>) -> T) -> T {
    let prepared = Prepared::new(scene(name), &Settings::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
    let pages = prepared.packed.open().unwrap_or_else(|e| panic!("{name}: {e}"));
    let frame = prepared.frame(&prepared.cameras[0], wanted);
    let scene = prepared.scene(&pages);
    work(&mut Experiment::new(&prepared, &scene, &frame, machine))
}

fn simulated(experiment: &Experiment<'_>, nodes: u16) -> Simulated {
    let run = experiment.simulated(nodes, &mut |_| true).unwrap_or_else(|e| panic!("{nodes} nodes: {e}"));
    assert_eq!(run.outcome, Outcome::Finished, "{nodes} nodes");
    run
}

/// Law 1: the same bits, and the same rays, as on threads.
#[test]
fn simulated_nodes_draw_the_native_picture() {
    let wanted = wanted(64, 2);
    let farms = [(1, 0), (2, 1), (7, 0), (64, 1)];
    for name in ["spd:balls:2", "cornell:mirror"] {
        let prepared = Prepared::new(scene(name), &Settings::default()).unwrap();
        let native = Farm {
            nodes: 2,
            kernels: Kernels::detect(),
            dispatcher: DispatcherAt::Host,
            shadow_bundles: true,
            options: Options::default(),
        };
        let expected = drawn(&prepared, &wanted, &native, name);
        for machine in &MACHINES {
            with(name, &wanted, machine, |experiment| {
                // One machine with all of them, the others with one: each test of this file traces for seconds.
                let some = if machine.name == "powerxplorer" { &farms[..] } else { &farms[2..3] };
                for &(nodes, dispatcher) in some {
                    experiment.dispatcher = dispatcher;
                    let run = simulated(experiment, nodes);
                    let mut counts = Counts::default();
                    run.nodes.iter().for_each(|node| counts += node.report.counts);
                    let what = format!("{name} on {nodes} nodes of {}, dispatcher at {dispatcher}", machine.name);
                    assert_eq!((run.film, counts), (expected.film, expected.counts), "{what}");
                    assert_eq!(simulated(experiment, nodes).events, run.events, "{what}, again");
                }
            });
        }
    }
}

/// Table 6.4, no subhosts, 1 processor: the one figure that the machine's compute costs are fitted to.
#[test]
fn the_powerxplorer_is_fitted() {
    fitted("powerxplorer", "paper:balls", &wanted(256, 1), |_| 63_100_000_000);
}

/// What the machine is defined by.
#[test]
fn a_small_board_takes_50_us_a_ray() {
    fitted("gigabit", "paper:balls", &wanted(256, 1), |run| run.operations().rays * 50_000);
}

/// POV||Ray, section 6: SKYVASE, 640 x 480, on one worker.
#[test]
fn the_cc48_is_fitted() {
    let wanted = model::Settings { size: Some([640, 480]), spp: Some(1), ..model::Settings::default() };
    fitted("cc48", "paper:vase", &wanted, |_| 251_000_000_000);
}

fn fitted(machine: &str, name: &str, wanted: &model::Settings, wanted_ns: impl Fn(&Simulated) -> u64) {
    let machine = Machine::named(machine).unwrap();
    let run = with(name, wanted, machine, |experiment| simulated(experiment, 1));
    let wanted_ns = wanted_ns(&run);
    let factor = machine.costs.fitted(&run.operations(), run.time_ns, wanted_ns);
    assert!(
        run.time_ns.abs_diff(wanted_ns) * 1000 <= wanted_ns,
        "{}: {} ns instead of {wanted_ns}: multiply its compute costs by {factor:?} thousandths",
        machine.name,
        run.time_ns,
    );
}

#[test]
fn speed_ups_are_over_the_run_of_one_node() {
    with("spd:balls-noground:3", &wanted(128, 1), Machine::named("infiniband").unwrap(), |experiment| {
        let four = experiment.run(4, &mut |_| true).unwrap().unwrap();
        let one = experiment.run(1, &mut |_| true).unwrap().unwrap();
        assert_eq!((one.nodes, one.speedup, one.efficiency), (1, 1.0, 1.0));
        // It was divided in nanoseconds: seconds are rounded.
        assert!((four.speedup * four.seconds / one.seconds - 1.0).abs() < 1e-12, "{}", four.speedup);
        assert_eq!(four.efficiency, four.speedup / 4.0);
        assert!(four.speedup > 2.0 && four.speedup <= 4.0, "{four:?}");
        assert_eq!(four.film, one.film);
        assert!((150..=400).contains(&four.per_node[0].busy_intervals.len()), "{four:?}");
        assert!(four.per_node.iter().flat_map(|node| &node.busy_intervals).all(|busy| (0.0..=1.0).contains(busy)));
        assert!(experiment.run(2, &mut |_| false).unwrap().is_none(), "stopped");
    });
}
