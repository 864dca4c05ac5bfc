//! Scenes by name, and the pictures that farms make of them.

use hybray::build;
use hybray::model::{Model, Settings};
use hybray::prepare::Prepared;
use hybray::{framing, import};
use hybray_geometry::simd::Kernels;
use hybray_native::{Farm, trace};
use hybray_scheduler::Outcome;
use hybray_shading::Projection;
use hybray_wire::Counts;

/// What a picture came to: all of it a function of the scene and the settings that change pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Hash of the film.
    pub film: u64,
    /// Rays, hits and contributions of all nodes together.
    pub counts: Counts,
    /// Tiles that nodes traced: each of the picture's once.
    pub tiles: u32,
}

/// A built-in scene or a file, with camera and lights, as the program has it. After its name may stand `@lens`, `@blades`,
/// `@orthographic` or `@spherical`: its first camera is one of those then.
///
/// # Panics
/// If there is no such scene, or camera.
#[must_use]
pub fn scene(name: &str) -> Model {
    let (name, optics) = name.split_once('@').unwrap_or((name, ""));
    let mut model = import::load(name).unwrap_or_else(|e| panic!("{e}"));
    framing::complete_with_up(&mut model, import::up_axis(name));
    let camera = &mut model.cameras[0];
    let distance = camera.focus_distance();
    match optics {
        "" => {}
        "lens" => (camera.aperture, camera.focus) = (0.03 * distance, Some(0.8 * distance)),
        "blades" => (camera.aperture, camera.blades, camera.blade_rotation_degrees) = (0.1 * distance, 5, 20.0),
        "orthographic" => camera.projection = Projection::Orthographic,
        "spherical" => {
            // From nearer by, so that not all but a few pixels are background.
            let closer = |i: usize| 0.5 * (camera.eye[i] + camera.target[i]);
            (camera.eye, camera.hither) = ([closer(0), closer(1), closer(2)], 0.0);
            camera.projection = Projection::Spherical;
        }
        other => panic!("there is no camera @{other}"),
    }
    model
}

/// The kernels that `HYBRAY_KERNELS` asks for: `portable`, `avx2`, `avx512`, or else the best that the processor has.
#[must_use]
pub fn kernels() -> Kernels {
    let asked = std::env::var("HYBRAY_KERNELS").unwrap_or_default();
    Kernels::available().find(|kernels| kernels.name() == asked).unwrap_or_else(Kernels::detect)
}

/// Draws `prepared`, seen by its first camera, on `farm`. `what` is named when that fails.
///
/// # Panics
/// If the picture is not finished, or nodes sent anything that made no sense.
#[must_use]
pub fn drawn(prepared: &Prepared, wanted: &Settings, farm: &Farm, what: &str) -> Picture {
    let pages = prepared.packed.open().unwrap_or_else(|e| panic!("{what}: {e}"));
    let frame = prepared.frame(&prepared.cameras[0], wanted);
    let traced = trace(&prepared.scene(&pages), prepared.hash, &frame, farm, &mut |_| true)
        .unwrap_or_else(|| panic!("{what}: no picture"));
    assert_eq!((traced.outcome, traced.refused_frames), (Outcome::Finished, 0), "{what}");
    let mut counts = Counts::default();
    traced.nodes.iter().for_each(|node| counts += node.counts);
    let tiles = traced.nodes.iter().map(|node| node.tiles).sum();
    assert_eq!(tiles, traced.progress.tiles, "{what}: tiles traced twice, or not at all");
    let primary = u64::from(frame.width) * u64::from(frame.height) * u64::from(frame.samples);
    assert_eq!(counts.primary, primary, "{what}");
    Picture { film: traced.film, counts, tiles }
}

impl Picture {
    /// Builds `model` with `settings` and draws it.
    ///
    /// # Panics
    /// See [`drawn`].
    #[must_use]
    pub fn of(model: Model, settings: &build::Settings, wanted: &Settings, farm: &Farm, what: &str) -> Self {
        let prepared = Prepared::new(model, settings).unwrap_or_else(|e| panic!("{what}: {e}"));
        drawn(&prepared, wanted, farm, what)
    }
}
