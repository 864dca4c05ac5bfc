//! A stand-in for SKYVASE of the POV-Ray package, "a very simple scene" of "just a few curved objects": a mirroring
//! vase of cones, with a ball in its mouth, on a marble pedestal under a sky with a few clouds.

use super::super::vector::{V, narrow};
use super::{SIZE_POV, empty, glowing, matt, point_light, shiny};
use crate::model::{Cone, Mesh, Model, Objects, Sphere};
use hybray_shading::Material;

/// Radius and height of an outline's point.
type Point = [f64; 2];

/// The vase, from foot to lip.
const VASE: [Point; 20] = [
    [0.62, 0.04],
    [0.6, 0.1],
    [0.44, 0.17],
    [0.26, 0.26],
    [0.2, 0.36],
    [0.22, 0.48],
    [0.34, 0.66],
    [0.52, 0.86],
    [0.7, 1.08],
    [0.83, 1.3],
    [0.9, 1.52],
    [0.91, 1.72],
    [0.86, 1.94],
    [0.74, 2.14],
    [0.58, 2.33],
    [0.44, 2.5],
    [0.37, 2.66],
    [0.39, 2.8],
    [0.49, 2.92],
    [0.66, 3.0],
];

/// Its pedestal, from the ground to the flat cone that the vase stands on.
const PEDESTAL: [Point; 8] =
    [[1.5, -2.4], [1.5, -2.1], [1.05, -1.95], [0.92, -0.45], [1.25, -0.25], [1.25, -0.02], [1.2, 0.03], [0.0, 0.04]];

/// Half the edge of the ground, and its height.
const GROUND: [f64; 2] = [2_000.0, -2.4];

/// Middle and radius of the largest ball of each cloud.
const CLOUDS: [(V, f64); 5] = [
    ([-88.0, 260.0, 44.0], 13.0),
    ([62.0, 300.0, 62.0], 16.0),
    ([112.0, 330.0, 20.0], 9.0),
    ([-160.0, -200.0, 120.0], 34.0),
    ([170.0, -150.0, 90.0], 30.0),
];

/// 29 cones and cylinders, 25 spheres and the ground; one light.
pub fn vase() -> Model {
    let mut model = empty("vase", [0.9, -9.8, 1.5], [0.0, 0.0, 0.78], 37.0, SIZE_POV);
    model.background = [0.16, 0.38, 0.8];
    model.ambient = [0.25; 3];
    model.lights = vec![point_light([-40.0, -60.0, 70.0], [0.95, 0.92, 0.85])];

    let glaze = model.add_material("glaze", shiny([0.08, 0.14, 0.3], 0.62, 120.0));
    let gilt = Material { mirror: [0.62, 0.44, 0.16], ..shiny([0.3, 0.2, 0.06], 0.3, 60.0) };
    let gilt = model.add_material("gilt", gilt);
    let marble = model.add_material("marble", shiny([0.68, 0.64, 0.58], 0.1, 50.0));
    let field = model.add_material("field", matt([0.22, 0.34, 0.1]));
    let cloud = Material { diffuse: [0.3; 3], ..glowing([0.55, 0.56, 0.6]) };
    let cloud = model.add_material("cloud", cloud);

    outline(&mut model, &VASE, glaze);
    outline(&mut model, &PEDESTAL, marble);
    // Bands about the waist, the neck and the lip.
    for band in [[[0.24, 0.32], [0.24, 0.41]], [[0.4, 2.62], [0.4, 2.7]], [[0.66, 2.98], [0.69, 3.03]]] {
        outline(&mut model, &band, gilt);
    }
    let mut ball = |centre: V, radius: f64, material| {
        model.spheres.push(Sphere { centre: narrow(centre), radius: radius as f32, material });
    };
    ball([0.0, 0.0, 3.12], 0.52, gilt);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        ball([2.1 * x, 2.1 * y, GROUND[1] + 0.45], 0.45, gilt);
    }
    for ([x, y, z], radius) in CLOUDS {
        ball([x, y, z], radius, cloud);
        for (along, share) in [(-1.15, 0.72), (1.1, 0.78), (2.0, 0.5)] {
            ball([x + along * radius, y + 0.1 * radius, z - (1.0 - share) * radius], share * radius, cloud);
        }
    }

    let [half, z] = GROUND;
    let corners = [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
    model.meshes.push(Mesh {
        name: "field".to_owned(),
        positions: corners.map(narrow).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material: field,
        ..Mesh::default()
    });
    let cylinders = model.cones.iter().filter(|c| c.base_radius == c.apex_radius).count() as u64;
    model.objects = Objects {
        polygons: 1,
        spheres: model.spheres.len() as u64,
        cones: model.cones.len() as u64 - cylinders,
        cylinders,
    };
    model
}

/// Cones about the z axis, one from each point to the next.
fn outline(model: &mut Model, points: &[Point], material: u16) {
    let cone = |w: &[Point]| Cone {
        base: narrow([0.0, 0.0, w[0][1]]),
        base_radius: w[0][0] as f32,
        apex: narrow([0.0, 0.0, w[1][1]]),
        apex_radius: w[1][0] as f32,
        material,
    };
    model.cones.extend(points.windows(2).map(cone));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    #[test]
    fn a_few_curved_objects() {
        let model = vase();
        checks::sound(&model);
        assert_eq!(model.objects, Objects { polygons: 1, spheres: 25, cones: 25, cylinders: 4 });
        assert_eq!((model.primitives(), model.lights.len(), model.materials.len()), (2 + 25 + 29, 1, 5));
        assert_eq!(model.cameras[0].size, Some([640, 480]));
    }

    /// Vase and pedestal are seen whole, and the ball rests in the mouth: it does not reach the neck.
    #[test]
    fn stands_in_the_picture() {
        let model = Model { spheres: Vec::new(), meshes: Vec::new(), ..vase() };
        assert_eq!(checks::share_in_view(&model), 1.0);
        let ball = vase().spheres[0];
        assert!(ball.centre[2] - ball.radius > VASE[16][1] as f32 - 0.1);
    }
}
