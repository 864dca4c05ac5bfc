//! Light from all around: what is sampled from the sky and what is sampled from the surface are the same light.

use hybray::build;
use hybray::import::Surroundings;
use hybray::model::{CameraSpec, Mesh, Model, NamedMaterial, Settings};
use hybray::prepare::Prepared;
use hybray::texture::Image;
use hybray_native::{DispatcherAt, Farm, trace};
use hybray_scheduler::Options;
use hybray_shading::{Format, Maps, Material, to_shared_exponent};
use hybray_tests::kernels;

fn square(y: f32, half: f32, material: u16) -> Mesh {
    Mesh {
        positions: vec![[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]],
        triangles: vec![[0, 2, 1], [0, 3, 2]],
        material,
        ..Mesh::default()
    }
}

/// A dim sky with a window of `window`.
fn sky(window: f32) -> Image {
    Image::from_fn(512, 256, |x, y| {
        let in_window = (240..280).contains(&x) && (64..104).contains(&y);
        to_shared_exponent([if in_window { window } else { 1.0 }, 1.0, 0.5]).to_le_bytes()
    })
}

/// Mean radiance of a floor of `material` under that sky, seen at a slant, with a pane above it if there is one.
fn mean(material: Material, pane: Option<Material>, window: f32, samples: u16, spp: u32) -> [f64; 3] {
    let mut model = Model {
        meshes: vec![square(0.0, 50.0, 0)],
        cameras: vec![CameraSpec {
            eye: [-3.0, 2.0, 0.3],
            target: [0.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y_degrees: 20.0,
            ..CameraSpec::default()
        }],
        ..Model::default()
    };
    let named = |material| NamedMaterial { material, ..NamedMaterial::default() };
    model.materials.push(named(material));
    if let Some(pane) = pane {
        // Above the camera.
        model.meshes.push(square(5.0, 1000.0, 1));
        model.materials.push(NamedMaterial { maps: Maps { coverage: 0.5, ..Maps::EMPTY }, ..named(pane) });
    }
    let surroundings = Surroundings { samples, ..Surroundings::default() };
    surroundings.give_picture(&mut model, "sky".to_owned(), sky(window), Format::SharedExponent);
    let wanted =
        Settings { size: Some([48, 36]), spp: Some(spp), depth: Some(6), cutoff: Some(0.0), ..Settings::default() };
    let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
    let pages = prepared.packed.open().unwrap();
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let farm = Farm {
        nodes: 2,
        kernels: kernels(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
    let traced = trace(&prepared.scene(&pages), prepared.hash, &frame, &farm, &mut |_| true).unwrap();
    let count = traced.radiance.len() as f64;
    [0, 1, 2].map(|c| traced.radiance.iter().map(|r| f64::from(r[c])).sum::<f64>() / count)
}

fn metal(rough: f32) -> Material {
    let flags = Material::PHYSICAL;
    Material { diffuse: [0.9; 3], mirror: [1.0; 3], exponent: rough, ior: 1.5, flags, ..Material::MATT }
}

/// Without shadow rays a rough metal shows the sky by its facets alone: as much as with both, but for noise.
#[test]
fn facets_and_cells_show_the_same_light() {
    for (rough, window) in [(0.3, 10.0), (0.5, 30.0), (0.9, 30.0)] {
        let both = mean(metal(rough), None, window, 8, 64);
        let facets = mean(metal(rough), None, window, 0, 400);
        for c in 0..3 {
            assert!((both[c] / facets[c] - 1.0).abs() < 0.02, "{rough} {window}: {both:?} {facets:?}");
        }
        // The window counts.
        assert!(both[0] > 1.2 * both[1], "{both:?}");
    }
}

/// Also behind a pane that is half there, through which shadow rays and mirrored rays both go on; and behind glass that bends
/// nothing.
#[test]
fn also_behind_panes() {
    let half = Material { flags: Material::DETAIL | Material::BLEND, diffuse: [0.0; 3], ..Material::MATT };
    let glass = Material { diffuse: [0.0; 3], transmission: [0.7; 3], ior: 1.0, ..Material::MATT };
    let open = mean(metal(0.5), None, 30.0, 8, 64);
    for (pane, left) in [(half, 0.5), (glass, 0.7)] {
        let both = mean(metal(0.5), Some(pane), 30.0, 8, 64);
        let facets = mean(metal(0.5), Some(pane), 30.0, 0, 400);
        for c in 0..3 {
            assert!((both[c] / facets[c] - 1.0).abs() < 0.02, "{both:?} {facets:?}");
            assert!((both[c] / (left * open[c]) - 1.0).abs() < 0.02, "{both:?} {open:?}");
        }
    }
}

/// A white matt floor under a sky of radiance 1 shows 1, whatever the number of shadow rays.
#[test]
fn an_even_sky_lights_a_matt_floor_evenly() {
    let white = Material { diffuse: [1.0; 3], ..Material::MATT };
    for samples in [1, 5, 16] {
        let shown = mean(white, None, 1.0, samples, 64);
        assert!((shown[0] - 1.0).abs() < 0.01 && (shown[2] - 0.5).abs() < 0.005, "{samples}: {shown:?}");
    }
}
