//! `rings`: a pyramid of objects, each of six interlocking pentagonal rings that join the midpoints of a
//! dodecahedron's edges, before a white wall.

use super::super::vector::{Affine, V, X, Z, add, narrow};
use super::{View, add_quad, scene, surface};
use crate::model::{Cone, Model, Sphere};
use core::f64::consts::PI;

/// Radius of rods and joints: rings just touch (a published number, without derivation there).
const RADIUS: f64 = 0.07412;

/// 30 spheres and 30 cylinders for each of 1 + 4 + ... + size^2 objects.
pub fn rings(size: u32) -> Model {
    // At this distance, a layer of the pyramid is as wide as the view.
    let spread = 1.0 / libm::sin(PI / 8.0);
    let eye = [-1.0, -spread, 0.5];
    let target = add(eye, [0.0, 1.0, 0.0]);
    let view = View { eye, target, up: Z, fov_degrees: 45.0, hither: 1.0 };
    let mut model = scene(&view, &[[3.0, -spread, 3.0], [-4.0, -spread, 1.0], [2.0, -spread, -4.0]]);

    let depth = spread * f64::from(size + 1);
    let reach = 1.01 * (depth - eye[1]) * libm::tan(PI / 8.0);
    let corner = |x: f64, z: f64| [eye[0] + x * reach, depth, eye[2] + z * reach];
    let wall = [corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)];
    add_quad(&mut model, "wall", wall, surface([1.0; 3], 1.0, 0.0, 0.0, 0.0, 0.0));

    let mut ring = |name, rgb| model.add_material(name, surface(rgb, 0.5, 0.2, 37.0, 0.0, 0.0));
    let materials = [
        ring("red", [1.0, 0.0, 0.0]),
        ring("green", [0.0, 1.0, 0.0]),
        ring("blue", [0.0, 0.0, 1.0]),
        ring("cyan", [0.0, 1.0, 1.0]),
        ring("magenta", [1.0, 0.0, 1.0]),
        ring("yellow", [1.0, 1.0, 0.0]),
    ];
    let joints = joints();
    for layer in 0..size {
        let place = |i: u32| f64::from(2 * i) - f64::from(layer);
        for iz in 0..=layer {
            for ix in 0..=layer {
                let centre = [place(ix), spread * f64::from(layer + 1), place(iz)];
                for (pentagon, material) in joints.iter().zip(materials) {
                    for (i, &joint) in pentagon.iter().enumerate() {
                        let at = narrow(add(joint, centre));
                        let before = narrow(add(pentagon[(i + 4) % 5], centre));
                        let radius = RADIUS as f32;
                        let (base_radius, apex_radius) = (radius, radius);
                        model.cones.push(Cone { base: at, base_radius, apex: before, apex_radius, material });
                        model.spheres.push(Sphere { centre: at, radius, material });
                    }
                }
            }
        }
    }
    model.objects.spheres = model.spheres.len() as u64;
    model.objects.cylinders = model.cones.len() as u64;
    model
}

/// The six pentagons of one object; with their rods they fit into the unit sphere.
fn joints() -> [[V; 5]; 6] {
    let fit = 1.0 / (1.0 + RADIUS);
    let flat: [V; 5] = core::array::from_fn(|i| {
        let angle = i as f64 * 2.0 * PI / 5.0;
        [fit * libm::cos(angle), fit * libm::sin(angle), 0.0]
    });
    // The angle between neighbouring faces of a dodecahedron.
    let tilt = Affine::turn_by(X, 2.0 * libm::acos(libm::cos(PI / 3.0) / libm::sin(PI / 5.0)));
    core::array::from_fn(|i| {
        if i == 0 {
            return flat;
        }
        let turn = Affine::turn_by(Z, PI * (2.0 * (i - 1) as f64 + 1.0) / 5.0);
        flat.map(|v| turn.after(&tilt).apply(v))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::vector::{cross, dot, length, sub, unit};

    /// The normals of the six rings are the six diagonals of an icosahedron: any two meet at arccos(1 / sqrt 5).
    #[test]
    fn rings_lie_as_a_dodecahedron_has_them() {
        let joints = joints();
        let normals = joints.map(|p| unit(cross(sub(p[1], p[0]), sub(p[2], p[0]))));
        for (i, a) in normals.iter().enumerate() {
            for b in &normals[..i] {
                assert!((dot(*a, *b).abs() - 0.2_f64.sqrt()).abs() < 1e-12);
            }
        }
        let fit = 1.0 / (1.0 + RADIUS);
        assert!(joints.iter().flatten().all(|&v| (length(v) - fit).abs() < 1e-12));
    }

    /// The published picture shows no background: the wall fills the view.
    #[test]
    fn wall_fills_the_view() {
        let model = rings(7);
        let eye = model.cameras[0].eye;
        for corner in &model.meshes[0].positions {
            let [x, y, z] = [0, 1, 2].map(|i| f64::from(corner[i]) - f64::from(eye[i]));
            let edge = libm::tan(PI / 8.0) * y;
            assert!(x.abs() > edge && z.abs() > edge && x.abs() < 1.02 * edge);
        }
    }
}
