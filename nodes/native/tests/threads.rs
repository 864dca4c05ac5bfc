//! A farm of threads over scenes made of nothing: what is tested is that it ends, and how.

use hybray_bintree::walk::Resident;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Aabb, Vec3};
use hybray_native::{DispatcherAt, Farm, Traced, trace};
use hybray_scene::{Child, Directory, Node, PageEntry};
use hybray_scheduler::{Options, Outcome, Progress};
use hybray_tracer::{Layer, Scene};
use hybray_wire::Frame;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

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

/// A scene of these directory nodes, without pages.
fn scene<'a>(nodes: &'a [Node], entries: &'a [PageEntry]) -> Scene<'a> {
    Scene {
        resident: Resident { directory: Directory { nodes, entries }, pages: &[] },
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

/// Fails, instead of hanging, if `work` does not end.
fn in_time<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (send, receive) = channel();
    thread::spawn(move || send.send(work()));
    receive.recv_timeout(Duration::from_secs(60)).expect("it does not end")
}

fn farm(nodes: u16, dispatcher: DispatcherAt) -> Farm {
    Farm { nodes, kernels: Kernels::Portable, dispatcher, shadow_bundles: true, options: Options::default() }
}

fn sky(nodes: u16, dispatcher: DispatcherAt, watch: impl FnMut(Progress) -> bool + Send + 'static) -> Traced {
    in_time(move || {
        let mut watch = watch;
        trace(&scene(&[], &[]), 1, &FRAME, &farm(nodes, dispatcher), &mut watch).unwrap()
    })
}

#[test]
fn any_number_of_threads_draws_the_same_sky() {
    for nodes in [0, 1, 2, 3, 7, 40] {
        for dispatcher in [DispatcherAt::Host, DispatcherAt::Node] {
            let traced = sky(nodes, dispatcher, |_| true);
            assert_eq!(traced.outcome, Outcome::Finished, "{nodes} nodes, {dispatcher:?}");
            assert_eq!(traced.radiance, vec![[0.25, 0.5, 1.0]; 150 * 70]);
            assert_eq!(traced.nodes.len(), usize::from(nodes.max(1)));
            assert_eq!(traced.refused_frames, 0);
        }
    }
}

#[test]
fn a_farm_that_is_stopped_ends() {
    for dispatcher in [DispatcherAt::Host, DispatcherAt::Node] {
        assert_eq!(sky(3, dispatcher, |_| false).outcome, Outcome::Stopped);
        let traced = sky(3, dispatcher, |progress| progress.finished < 20);
        // It may be done before anybody looks.
        let whole = traced.progress.finished == traced.progress.tiles;
        assert!(traced.outcome == Outcome::Stopped || whole, "{:?}", traced.outcome);
        assert!(traced.progress.finished >= 20);
    }
}

/// A page that a directory names and nobody has is a bug, and stops the thread that finds it. The others do not wait
/// for it, and the caller hears of it.
#[test]
fn a_thread_that_panics_is_told_and_does_not_hang_the_rest() {
    let quiet = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let ended: Vec<bool> = [(1, DispatcherAt::Host), (4, DispatcherAt::Host), (4, DispatcherAt::Node)]
        .into_iter()
        .map(|(nodes, dispatcher)| {
            in_time(move || {
                let mut node = Node::EMPTY;
                node.set(0, &Aabb { lo: Vec3::NEG_ONE, hi: Vec3::ONE }, Child::Page(0));
                let (nodes_above, entries) = ([node], [PageEntry { bytes: 64, owner: 0, kind: 0 }]);
                let broken = scene(&nodes_above, &entries);
                std::panic::catch_unwind(|| trace(&broken, 1, &FRAME, &farm(nodes, dispatcher), &mut |_| true)).is_err()
            })
        })
        .collect();
    std::panic::set_hook(quiet);
    assert_eq!(ended, [true; 3]);
}
