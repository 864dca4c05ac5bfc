//! A flat surface does not shadow itself, wherever it lies: also where its coordinates are exactly zero, and a hit's
//! position has no error at all.

use hybray::build;
use hybray::model::{CameraSpec, Mesh, Model, NamedMaterial, Settings};
use hybray::prepare::Prepared;
use hybray_geometry::Vec3;
use hybray_native::{DispatcherAt, Farm, trace};
use hybray_scheduler::Options;
use hybray_shading::{Light, LightKind, Material};
use hybray_tests::kernels;

/// A white square across `axis` at `height`, lit and seen from above at a slant, is white all over.
fn check(axis: usize, height: f32, size: f32) {
    let across = |u: f32, v: f32, h: f32| {
        let mut p = Vec3::ZERO;
        p[axis] = height + h;
        p[(axis + 1) % 3] = u * size;
        p[(axis + 2) % 3] = v * size;
        p.to_array()
    };
    let direction = (Vec3::from_array(across(0.3, 0.2, -size)) - Vec3::from_array(across(0.0, 0.0, 0.0))).normalize();
    let cosine = direction[axis].abs();
    let light = Light {
        kind: LightKind::Directional as u32,
        axis: direction.to_array(),
        colour: [1.0 / cosine; 3],
        ..Light::default()
    };
    let point =
        Light { kind: LightKind::Point as u32, position: across(0.1, 0.1, 50.0 * size), colour: [0.0; 3], ..light };
    let model = Model {
        meshes: vec![Mesh {
            positions: vec![
                across(-1.0, -1.0, 0.0),
                across(1.0, -1.0, 0.0),
                across(1.0, 1.0, 0.0),
                across(-1.0, 1.0, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }],
        materials: vec![NamedMaterial {
            material: Material { diffuse: [1.0; 3], ..Material::MATT },
            ..NamedMaterial::default()
        }],
        lights: vec![light, point],
        cameras: vec![CameraSpec {
            name: "above".to_owned(),
            eye: across(-0.4, 0.3, 2.0 * size),
            target: across(0.05, 0.0, 0.0),
            up: across(1.0, 0.0, -height),
            fov_y_degrees: 30.0,
            hither: 0.0,
            size: None,
            ..CameraSpec::default()
        }],
        ..Model::default()
    };
    let wanted = Settings { size: Some([24, 24]), spp: Some(4), ..Settings::default() };
    let what = format!("axis {axis}, height {height}, size {size}");
    let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
    let pages = prepared.packed.open().unwrap();
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let farm = Farm {
        nodes: 1,
        kernels: kernels(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
    let traced = trace(&prepared.scene(&pages), prepared.hash, &frame, &farm, &mut |_| true).unwrap();
    for (pixel, radiance) in traced.radiance.iter().enumerate() {
        assert!(radiance.iter().all(|c| (c - 1.0).abs() < 1e-4), "{what}: pixel {pixel} is {radiance:?}");
    }
}

#[test]
fn a_floor_is_lit_wherever_it_lies() {
    for axis in 0..3 {
        for size in [1.0, 1e-6, 1e6, 0.3] {
            for height in [0.0, 1.0, -0.1, 1e-3, 1e3] {
                check(axis, height * size, size);
            }
        }
    }
}

/// A lamp modelled where its light is stays lit through a pane of glass: the light's end is aimed at anew behind the pane.
#[test]
fn a_lamp_shines_through_glass() {
    let square = |y: f32, half: f32, material: u16, down: bool| Mesh {
        positions: vec![[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]],
        triangles: if down { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] },
        material,
        ..Mesh::default()
    };
    let material = |material| NamedMaterial { material, ..NamedMaterial::default() };
    let mean = |with_lamp: bool| {
        let mut meshes = vec![square(-2.0, 1.0, 0, false), square(-1.0, 1.0, 1, true)];
        if with_lamp {
            meshes.push(square(0.0, 0.05, 2, true));
        }
        let model = Model {
            meshes,
            materials: vec![
                material(Material { diffuse: [1.0; 3], ..Material::MATT }),
                material(Material { diffuse: [0.0; 3], transmission: [1.0; 3], ior: 1.0, ..Material::MATT }),
                material(Material { diffuse: [0.0; 3], emission: [1.0; 3], ..Material::MATT }),
            ],
            lights: vec![Light {
                kind: LightKind::Rectangle as u32,
                position: [-0.05, 0.0, -0.05],
                u: [0.1, 0.0, 0.0],
                v: [0.0, 0.0, 0.1],
                colour: [1.0; 3],
                samples: 4,
                ..Light::default()
            }],
            cameras: vec![CameraSpec {
                name: "beside".to_owned(),
                eye: [0.0, -1.5, 0.0],
                target: [0.0, -2.0, 0.0],
                up: [1.0, 0.0, 0.0],
                fov_y_degrees: 60.0,
                hither: 0.0,
                size: None,
                ..CameraSpec::default()
            }],
            ..Model::default()
        };
        let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
        let pages = prepared.packed.open().unwrap();
        let wanted = Settings { size: Some([16, 16]), spp: Some(1), ..Settings::default() };
        let frame = prepared.frame(&prepared.cameras[0], &wanted);
        let farm = Farm {
            nodes: 1,
            kernels: kernels(),
            dispatcher: DispatcherAt::Host,
            shadow_bundles: true,
            options: Options::default(),
        };
        let traced = trace(&prepared.scene(&pages), prepared.hash, &frame, &farm, &mut |_| true).unwrap();
        traced.radiance.iter().map(|r| r[0]).sum::<f32>() / 256.0
    };
    let (bare, modelled) = (mean(false), mean(true));
    assert!(bare > 0.5, "the light lights the floor: {bare}");
    assert!((modelled - bare).abs() < 1e-3, "{modelled} with the lamp, {bare} without");
}
