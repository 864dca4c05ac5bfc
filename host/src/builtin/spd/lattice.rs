//! `lattice`: shiny spheres at the corners of a cube of cells, joined by matt rods (Antonio Costa).

use super::super::vector::{V, add, narrow, scale};
use super::{View, scene, surface};
use crate::model::{Cone, Model, Sphere};

const LIGHTS: [V; 6] =
    [[2.0, 0.5, 0.5], [-1.0, 0.5, 0.5], [0.5, 2.0, 0.5], [0.5, -1.0, 0.5], [0.5, 0.5, 2.0], [0.5, 0.5, -1.0]];

/// (size + 1)^3 spheres and 3 size (size + 1)^2 cylinders in the unit cube.
pub fn lattice(size: u32) -> Model {
    let n = f64::from(size);
    // The eye is within the cube, on its upper side, in the middle of a cell.
    let across = (f64::from(size / 2) + 0.5) / n;
    let half_cell = 0.5 / n;
    let view = View {
        eye: [across, 1.0, 1.0 - half_cell],
        target: [across, -1.0, -1.0 - half_cell],
        up: [0.2, 1.0, 0.0],
        fov_degrees: 60.0,
        hither: 0.0,
    };
    let mut model = scene(&view, &LIGHTS);
    let ball = model.add_material("ball", surface([0.9; 3], 0.5, 0.5, 37.0, 0.0, 0.0));
    let mut rod = |name, rgb| model.add_material(name, surface(rgb, 0.99, 0.0, 0.0, 0.0, 0.0));
    let rods = [rod("x-rod", [0.9, 0.1, 0.1]), rod("y-rod", [0.1, 0.9, 0.1]), rod("z-rod", [0.1, 0.1, 0.9])];

    let (ball_radius, rod_radius) = (0.25 / n, 0.0625 / n);
    // Rods end a little within the balls (the root of the radii's ratio is the published way to say so).
    let inset = ball_radius * (1.0 - (rod_radius / ball_radius).sqrt()) * 0.99;
    for x in 0..=size {
        for y in 0..=size {
            for z in 0..=size {
                let corner = [x, y, z].map(|i| f64::from(i) / n);
                model.spheres.push(Sphere { centre: narrow(corner), radius: ball_radius as f32, material: ball });
                for axis in 0..3 {
                    if [x, y, z][axis] == size {
                        continue;
                    }
                    let along = |distance: f64| {
                        let mut step = [0.0; 3];
                        step[axis] = 1.0;
                        narrow(add(corner, scale(step, distance)))
                    };
                    model.cones.push(Cone {
                        base: along(inset),
                        base_radius: rod_radius as f32,
                        apex: along(1.0 / n - inset),
                        apex_radius: rod_radius as f32,
                        material: rods[axis],
                    });
                }
            }
        }
    }
    model.objects.spheres = model.spheres.len() as u64;
    model.objects.cylinders = model.cones.len() as u64;
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::vector::{length, sub};

    /// Both ends of each rod lie in a ball, with their rims: no gap shows.
    #[test]
    fn rods_end_in_balls() {
        let model = lattice(3);
        for rod in &model.cones {
            for end in [rod.base, rod.apex] {
                let within = model.spheres.iter().any(|s| {
                    let axial = length(sub(end.map(f64::from), s.centre.map(f64::from)));
                    let rim = (axial * axial + f64::from(rod.base_radius).powi(2)).sqrt();
                    rim < f64::from(s.radius)
                });
                assert!(within, "{rod:?}");
            }
        }
    }
}
