//! `tetra`: a tetrahedron made of four, each made of four, and so on (Mandelbrot and Norton; as Glassner and Kay and
//! Kajiya used it).

use super::super::vector::{V, add, narrow, scale};
use super::{View, scene, surface};
use crate::model::{Mesh, Model};

const VIEW: View = View {
    eye: [1.022846, -3.177154, -2.174512],
    target: [-0.004103, -0.004103, 0.216539],
    up: [-0.816497, -0.816497, 0.816497],
    fov_degrees: 45.0,
    hither: 1.0,
};

/// Every other corner of a cube.
const CORNERS: [V; 4] = [[-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [1.0, 1.0, 1.0]];

const FACES: [[u32; 3]; 4] = [[0, 1, 2], [3, 2, 1], [2, 3, 0], [1, 0, 3]];

/// 4^size triangles.
pub fn tetra(size: u32) -> Model {
    let mut model = scene(&VIEW, &[[2.0, -18.0, -5.0]]);
    let material = model.add_material("tetra", surface([1.0, 0.2, 0.2], 1.0, 0.0, 0.0, 0.0, 0.0));
    let triangles = 4_usize.pow(size);
    let mut mesh = Mesh {
        name: "tetra".to_owned(),
        positions: Vec::with_capacity(triangles),
        triangles: Vec::with_capacity(triangles),
        material,
        ..Mesh::default()
    };
    // At most three waiting siblings for each level.
    let mut waiting = vec![([0.0; 3], 1.0, size)];
    while let Some((centre, half, levels)) = waiting.pop() {
        if levels > 1 {
            let part = |corner: &V| (add(centre, scale(*corner, half / 2.0)), half / 2.0, levels - 1);
            waiting.extend(CORNERS.iter().rev().map(part));
            continue;
        }
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(CORNERS.map(|corner| narrow(add(centre, scale(corner, half)))));
        mesh.triangles.extend(FACES.map(|face| face.map(|v| first + v)));
    }
    model.objects.polygons = mesh.triangles.len() as u64;
    model.meshes.push(mesh);
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    /// Each of 4^(size - 1) tetrahedra has a third of its cube's volume, and all face outward.
    #[test]
    fn closed_and_of_the_right_volume() {
        for size in 1..6 {
            let model = tetra(size);
            let mesh = &model.meshes[0];
            assert_eq!(checks::open_edges(mesh), 0);
            let expected = 8.0 / 3.0 / 2.0_f64.powi(size as i32 - 1);
            assert!((checks::volume(mesh) - expected).abs() < 1e-6, "{size}");
        }
    }
}
