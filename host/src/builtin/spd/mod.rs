//! Eric Haines' Standard Procedural Databases (SPD), made again from their published construction.
//!
//! Source: Haines, *A Proposal for Standard Graphics Environments*, IEEE Computer Graphics and Applications 7(11),
//! 1987, and the package of v3.14 (2005), whose README declares it free to use: dimensions, cameras, lights and
//! materials are its values, in curves (spheres and cones stay what they are). Sizes are its size factors. Lights have
//! no colour there: each of n gets 1 / sqrt(n), as its generators do for renderers that want one.
//!
//! Each scene is computed in `f64` and rounded once. NFF files of the package carry six digits, so theirs differ from
//! ours by that much.

mod balls;
mod gears;
mod lattice;
mod mount;
mod rings;
mod sombrero;
mod teapot;
mod tetra;
mod tree;

use super::vector::{V, narrow};
use crate::model::{CameraSpec, Mesh, Model, Objects, Settings};
use crate::nff_material::nff_material;
use hybray_shading::{Light, LightKind, Material};

pub use balls::{balls, balls_noground};
pub use gears::gears;
pub use lattice::lattice;
pub use mount::mount;
pub use rings::rings;
pub use sombrero::sombrero;
pub use teapot::teapot;
pub use tetra::tetra;
pub use tree::tree;

/// The package's "UNC sky blue", which all its scenes have.
const SKY: [f32; 3] = [0.078, 0.361, 0.753];

/// What SPD's `v` line says; pictures are 512 x 512.
struct View {
    eye: V,
    target: V,
    up: V,
    fov_degrees: f32,
    hither: f32,
}

/// A scene without objects.
fn scene(view: &View, lights: &[V]) -> Model {
    let strength = (1.0 / (lights.len() as f64).sqrt()) as f32;
    let light = |&position: &V| Light {
        position: narrow(position),
        kind: LightKind::Point as u32,
        colour: [strength; 3],
        samples: 1,
        ..Light::default()
    };
    let camera = CameraSpec {
        name: "spd".to_owned(),
        eye: narrow(view.eye),
        target: narrow(view.target),
        up: narrow(view.up),
        fov_y_degrees: view.fov_degrees,
        hither: view.hither,
        size: Some([512, 512]),
        ..CameraSpec::default()
    };
    Model {
        lights: lights.iter().map(light).collect(),
        cameras: vec![camera],
        background: SKY,
        // Testing procedure 7 of the package: rays to depth 5, the eye's being of depth 1.
        settings: Settings { depth: Some(5), ..Settings::default() },
        ..Model::default()
    }
}

/// A material as the generators state it: the highlight by the angle, in degrees, at which it has half its strength.
fn surface(rgb: V, kd: f32, ks: f32, half_angle_degrees: f64, t: f32, ior: f32) -> Material {
    nff_material(narrow(rgb), kd, ks, shine(half_angle_degrees), t, ior)
}

/// Phong's exponent for a highlight that falls to a half at this angle. No angle at all is written as a very sharp one.
fn shine(half_angle_degrees: f64) -> f32 {
    if half_angle_degrees <= 0.0 {
        return 100_000.0;
    }
    let cosine = libm::cos(half_angle_degrees * core::f64::consts::PI / 180.0);
    (libm::log(0.5) / libm::log(cosine)) as f32
}

/// Adds a convex quadrilateral as a mesh and counts it.
fn add_quad(model: &mut Model, name: &str, corners: [V; 4], material: Material) {
    let material = model.add_material(name, material);
    model.meshes.push(Mesh {
        name: name.to_owned(),
        positions: corners.map(narrow).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Mesh::default()
    });
    model.objects = Objects { polygons: model.objects.polygons + 1, ..model.objects };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::{builtin, checks};

    fn make(name: &str) -> Model {
        builtin(name).expect("a built-in name").expect("a size in range")
    }

    /// Polygons, spheres, cones and cylinders.
    #[track_caller]
    fn check(name: &str, polygons: u64, spheres: u64, cones: u64, cylinders: u64) {
        let model = make(name);
        assert_eq!(model.objects, Objects { polygons, spheres, cones, cylinders }, "{name}");
        checks::sound(&model);
        assert_eq!(model.spheres.len() as u64, spheres);
        assert_eq!(model.cones.len() as u64, cones + cylinders);
        let unequal = model.cones.iter().filter(|c| c.base_radius != c.apex_radius).count();
        assert_eq!(unequal as u64, cones);
    }

    /// The table of sizes at the head of each generator of SPD v3.14.
    #[test]
    fn published_counts() {
        check("spd:balls:1", 1, 10, 0, 0);
        check("spd:balls:2", 1, 91, 0, 0);
        check("spd:balls:3", 1, 820, 0, 0);
        check("spd:balls:4", 1, 7_381, 0, 0);
        check("spd:balls-noground:4", 0, 7_381, 0, 0);
        check("spd:gears:1", 2 + 144 + 1, 0, 0, 0);
        check("spd:gears:2", 16 + 1_152 + 1, 0, 0, 0);
        check("spd:gears:3", 54 + 3_888 + 1, 0, 0, 0);
        check("spd:gears:4", 128 + 9_216 + 1, 0, 0, 0);
        check("spd:lattice:1", 0, 8, 0, 12);
        check("spd:lattice:2", 0, 27, 0, 54);
        check("spd:lattice:3", 0, 64, 0, 144);
        check("spd:lattice:5", 0, 216, 0, 540);
        check("spd:lattice:12", 0, 2_197, 0, 6_084);
        check("spd:mount:1", 8, 4, 0, 0);
        check("spd:mount:2", 32, 4, 0, 0);
        check("spd:mount:3", 128, 4, 0, 0);
        check("spd:mount:6", 8_192, 4, 0, 0);
        check("spd:rings:1", 1, 30, 0, 30);
        check("spd:rings:2", 1, 150, 0, 150);
        check("spd:rings:3", 1, 420, 0, 420);
        check("spd:rings:7", 1, 4_200, 0, 4_200);
        check("spd:teapot:2", 240 + 4, 0, 0, 0);
        check("spd:teapot:3", 552 + 9, 0, 0, 0);
        check("spd:teapot:12", 9_120 + 144, 0, 0, 0);
        check("spd:tetra:1", 4, 0, 0, 0);
        check("spd:tetra:2", 16, 0, 0, 0);
        check("spd:tetra:3", 64, 0, 0, 0);
        check("spd:tetra:6", 4_096, 0, 0, 0);
        check("spd:tree:1", 1, 3, 3, 0);
        check("spd:tree:2", 1, 7, 7, 0);
        check("spd:tree:3", 1, 15, 15, 0);
        check("spd:tree:11", 1, 4_095, 4_095, 0);
        // A grid of 32 x 32 heights, so 31 x 31 cells of two triangles.
        check("spd:sombrero:1", 2 * 31 * 31, 0, 0, 0);
        check("spd:sombrero:2", 2 * 63 * 63, 0, 0, 0);
    }

    /// "total prim." and "lights" of the package's README, at the default sizes.
    #[test]
    fn readme_totals() {
        for (name, primitives, lights) in [
            ("spd:balls", 7_382, 3),
            ("spd:gears", 9_345, 5),
            ("spd:mount", 8_196, 1),
            ("spd:rings", 8_401, 3),
            ("spd:teapot", 9_264, 2),
            ("spd:tetra", 4_096, 1),
            ("spd:tree", 8_191, 7),
        ] {
            let model = make(name);
            let o = model.objects;
            assert_eq!(o.polygons + o.spheres + o.cones + o.cylinders, primitives, "{name}");
            assert_eq!(model.lights.len(), lights, "{name}");
            let total: f32 = model.lights.iter().map(|l| l.colour[0] * l.colour[0]).sum();
            assert!((total - 1.0).abs() < 1e-5, "{name}: {total}");
        }
    }

    /// The published cameras crop grounds and fields, but each looks at its object.
    #[test]
    fn cameras_see_the_objects() {
        for (name, share) in [
            ("spd:balls-noground", 1.0),
            ("spd:gears", 0.9),
            ("spd:lattice", 0.1),
            ("spd:mount", 0.9),
            ("spd:rings", 0.95),
            ("spd:sombrero", 0.65),
            ("spd:teapot", 0.95),
            ("spd:tetra", 1.0),
            ("spd:tree", 0.98),
        ] {
            let seen = checks::share_in_view(&make(name));
            assert!(seen >= share, "{name}: {seen}");
        }
    }

    #[test]
    fn exponents() {
        // cos(37 degrees)^n = 1/2, by hand: cos = 0.7986355, ln = -0.2248506.
        assert!((shine(37.0) - 3.0827).abs() < 1e-4, "{}", shine(37.0));
        assert!((shine(60.0) - 1.0).abs() < 1e-6);
        assert_eq!(shine(0.0), 100_000.0);
    }
}
