//! Triangles gathered into meshes: one for each material, with and without vertex normals.

use super::polygon::{Polygons, newell, unit};
use crate::model::Mesh;
use std::collections::BTreeMap;

/// A mesh is closed and another begun before it has more vertices than this, so that `u32` always reaches them.
const VERTICES_MAX: usize = 1 << 31;

/// See the module's page.
#[derive(Default)]
pub(crate) struct Meshes {
    meshes: Vec<Mesh>,
    /// The mesh that takes more triangles, by material and whether it has normals and texture coordinates.
    open: BTreeMap<(u16, bool, bool), usize>,
}

impl Meshes {
    /// Adds a polygon and returns how many triangles it made. `normals` is empty or has one for each corner, of any
    /// length; where one is zero, the polygon's own stands in.
    pub(crate) fn add_polygon(
        &mut self,
        polygons: &mut Polygons,
        material: u16,
        corners: &[[f32; 3]],
        normals: &[[f32; 3]],
    ) -> usize {
        let triangles = polygons.triangulate(corners);
        if triangles.is_empty() {
            return 0;
        }
        let mesh = self.open_mesh(material, !normals.is_empty(), corners.len(), "polygons");
        let base = mesh.positions.len() as u32;
        mesh.positions.extend_from_slice(corners);
        if !normals.is_empty() {
            let own = unit(newell(corners)).unwrap_or([0.0, 0.0, 1.0]);
            let units = normals.iter().map(|n| unit(n.map(f64::from)).unwrap_or(own).map(|c| c as f32));
            mesh.normals.extend(units);
        }
        mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| base + i)));
        triangles.len()
    }

    /// Adds a mesh: to the open one of its kind if both together have at most `triangles_max` triangles, else as the
    /// new open one.
    pub(crate) fn append(&mut self, mut piece: Mesh, triangles_max: usize) {
        if piece.triangles.is_empty() {
            return;
        }
        let key = (piece.material, !piece.normals.is_empty(), !piece.coordinates.is_empty());
        if let Some(mesh) = self.open.get(&key).and_then(|&at| self.meshes.get_mut(at)) {
            let vertices = mesh.positions.len() + piece.positions.len();
            if mesh.triangles.len() + piece.triangles.len() <= triangles_max && vertices <= VERTICES_MAX {
                let base = mesh.positions.len() as u32;
                mesh.positions.append(&mut piece.positions);
                mesh.normals.append(&mut piece.normals);
                mesh.coordinates.append(&mut piece.coordinates);
                mesh.triangles.extend(piece.triangles.iter().map(|t| t.map(|i| base + i)));
                return;
            }
            shrink(mesh);
        }
        self.open.insert(key, self.meshes.len());
        self.meshes.push(piece);
    }

    fn open_mesh(&mut self, material: u16, normals: bool, vertices: usize, name: &str) -> &mut Mesh {
        let next = self.meshes.len();
        let mut at = *self.open.get(&(material, normals, false)).unwrap_or(&next);
        if self.meshes.get(at).is_some_and(|m| m.positions.len() + vertices > VERTICES_MAX) {
            at = next;
        }
        if at == next {
            self.open.insert((material, normals, false), at);
            self.meshes.push(Mesh { name: name.to_owned(), material, ..Mesh::default() });
        }
        &mut self.meshes[at]
    }

    /// The meshes, in the order in which they were begun.
    pub(crate) fn finish(mut self) -> Vec<Mesh> {
        self.meshes.iter_mut().for_each(shrink);
        self.meshes
    }
}

fn shrink(mesh: &mut Mesh) {
    mesh.positions.shrink_to_fit();
    mesh.normals.shrink_to_fit();
    mesh.coordinates.shrink_to_fit();
    mesh.triangles.shrink_to_fit();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(material: u16, triangles: usize) -> Mesh {
        let corner = |i: usize| [i as f32, 0.0, 0.0];
        Mesh {
            positions: (0..triangles * 3).map(corner).collect(),
            triangles: (0..triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            material,
            ..Mesh::default()
        }
    }

    #[test]
    fn pieces_of_a_kind_are_joined_up_to_the_limit() {
        let mut meshes = Meshes::default();
        for (material, triangles) in [(0, 2), (1, 1), (0, 3), (0, 1), (1, 0)] {
            meshes.append(piece(material, triangles), 5);
        }
        let found: Vec<(u16, usize)> = meshes.finish().iter().map(|m| (m.material, m.triangles.len())).collect();
        assert_eq!(found, [(0, 5), (1, 1), (0, 1)]);
    }

    #[test]
    fn joined_triangles_keep_their_corners() {
        let mut meshes = Meshes::default();
        meshes.append(piece(0, 1), 9);
        meshes.append(piece(0, 2), 9);
        let mesh = &meshes.finish()[0];
        let corners: Vec<f32> = mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize][0]).collect();
        assert_eq!(corners, [0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
