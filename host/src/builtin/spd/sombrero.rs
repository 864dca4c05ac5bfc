//! `sombrero`: a height field, the cosine of the distance from the middle, dying away (Alexander Enzmann).

use super::super::vector::{V, Z, narrow};
use super::{View, scene, surface};
use crate::model::{Mesh, Model};

const VIEW: View = View { eye: [0.0, 5.0, -8.0], target: [0.0; 3], up: Z, fov_degrees: 40.0, hither: 0.01 };

const LIGHTS: [V; 1] = [[10.0, 10.0, -10.0]];

/// A grid of 32 x 2^(size - 1) heights each way. The package writes height fields to NFF as plain polygons, so there
/// are no vertex normals.
pub fn sombrero(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    let material = model.add_material("sombrero", surface([1.0, 0.1, 0.1], 0.8, 0.0, 40.0, 0.0, 1.0));
    let points = 32_u32 << (size - 1);
    let cells = points - 1;
    let mut positions = Vec::with_capacity((points * points) as usize);
    for i in 0..points {
        for j in 0..points {
            // The heights are sampled 8 / points apart and then set 8 / (points - 1) apart: so the published picture
            // has its peak a little beside the middle.
            let sample = |k: u32| -4.0 + 8.0 * f64::from(k) / f64::from(points);
            let place = |k: u32| -4.0 + 8.0 * f64::from(k) / f64::from(cells);
            positions.push(narrow([place(j), -3.0 + height(sample(j), sample(i)), place(i)]));
        }
    }
    let mut triangles = Vec::with_capacity(2 * (cells * cells) as usize);
    for i in 0..cells {
        for j in 0..cells {
            let near = i * points + j;
            let far = near + points;
            triangles.push([near, far + 1, near + 1]);
            triangles.push([near, far, far + 1]);
        }
    }
    model.objects.polygons = triangles.len() as u64;
    model.meshes.push(Mesh { name: "sombrero".to_owned(), positions, triangles, material, ..Mesh::default() });
    model
}

fn height(x: f64, y: f64) -> f64 {
    let distance = (x * x + y * y).sqrt();
    libm::cos(2.0 * core::f64::consts::PI * distance) * libm::exp(-distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    #[test]
    fn one_sheet_that_faces_up() {
        let model = sombrero(1);
        let mesh = &model.meshes[0];
        assert_eq!(checks::open_edges(mesh), 4 * 31);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            let up = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]);
            assert!(up > 0.0);
        }
    }

    #[test]
    fn heights_by_hand() {
        // The middle sample of 32 is at 0, where the height is 1; a quarter of a wave off it is 0.
        assert_eq!(sombrero(1).meshes[0].positions[16 * 32 + 16][1], -2.0);
        assert!(height(0.25, 0.0).abs() < 1e-15);
        assert!((height(0.3, 0.4) + 0.606_530_659).abs() < 1e-8);
    }
}
