//! `teapot`: Martin Newell's, of 32 Bezier patches with a bottom, on a checkerboard as fine as its patches.
//!
//! The published table of 290 control points says less than it seems to: rim, body, lid and bottom are surfaces of
//! revolution, and handle and spout are two mirrored halves of a tube. So we keep the profiles and make the patches.

use super::super::vector::{V, Z, add, cross, narrow, scale, unit};
use super::{View, scene, surface};
use crate::model::{Mesh, Model};
use hybray_shading::Material;

const VIEW: View = View { eye: [4.86, 7.2, 5.4], target: [0.0; 3], up: Z, fov_degrees: 45.0, hither: 1.0 };

const LIGHTS: [V; 2] = [[-3.1, 9.8, 12.1], [11.3, 5.1, 8.8]];

/// 64 size^2 - 8 size patches (triangles) and size^2 squares.
pub fn teapot(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    for (name, shade, odd) in [("white", 1.0, 1), ("grey", 0.5, 0)] {
        add_squares(&mut model, name, size, odd, surface([shade; 3], 0.5, 0.5, 30.0, 0.0, 0.0));
    }
    let material = model.add_material("teapot", surface([1.0, 0.5, 0.1], 0.75, 0.25, 37.0, 0.0, 0.0));
    let mut mesh = Mesh { name: "teapot".to_owned(), material, ..Mesh::default() };
    for patch in &patches() {
        tessellate(patch, size, &mut mesh);
    }
    model.objects.polygons += mesh.triangles.len() as u64;
    model.meshes.push(mesh);
    model
}

/// Adds the squares of one colour of the board, each with its own vertices.
fn add_squares(model: &mut Model, name: &str, size: u32, odd: u32, material: Material) {
    let material = model.add_material(name, material);
    let mut mesh = Mesh { name: name.to_owned(), material, ..Mesh::default() };
    let place = |i: u32| 4.0 * (2.0 * f64::from(i) / f64::from(size) - 1.0);
    for x in 0..size {
        for y in (0..size).filter(|y| (x + y) % 2 == odd) {
            let first = mesh.positions.len() as u32;
            let corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
            mesh.positions.extend(corners.map(|(i, j)| narrow([place(i), place(j), 0.0])));
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            model.objects.polygons += 1;
        }
    }
    if !mesh.triangles.is_empty() {
        model.meshes.push(mesh);
    }
}

/// Control points by rows.
type Patch = [[V; 4]; 4];

/// Radius and height of four rings, which Bezier curves join.
type Profile = [[f64; 2]; 4];

/// Inner x and z, outer x and z, half the width: one ring of control points of handle or spout.
type Ring = [f64; 5];

const RIM: Profile = [[1.4, 2.4], [1.3375, 2.53125], [1.4375, 2.53125], [1.5, 2.4]];
const SHOULDER: Profile = [[1.5, 2.4], [1.75, 1.875], [2.0, 1.35], [2.0, 0.9]];
const BELLY: Profile = [[2.0, 0.9], [2.0, 0.45], [1.5, 0.225], [1.5, 0.15]];
const KNOB: Profile = [[0.0, 3.15], [0.8, 3.15], [0.0, 2.85], [0.2, 2.7]];
const LID: Profile = [[0.2, 2.7], [0.4, 2.55], [1.3, 2.55], [1.3, 2.4]];
const BOTTOM: Profile = [[0.0, 0.0], [1.425, 0.0], [1.5, 0.075], [1.5, 0.15]];

const HANDLE: [Ring; 7] = [
    [-1.6, 2.025, -1.5, 2.25, 0.3],
    [-2.3, 2.025, -2.5, 2.25, 0.3],
    [-2.7, 2.025, -3.0, 2.25, 0.3],
    [-2.7, 1.8, -3.0, 1.8, 0.3],
    [-2.7, 1.575, -3.0, 1.35, 0.3],
    [-2.5, 1.125, -2.65, 0.9375, 0.3],
    [-2.0, 0.9, -1.9, 0.6, 0.3],
];

const SPOUT: [Ring; 7] = [
    [1.7, 1.425, 1.7, 0.6, 0.66],
    [2.6, 1.425, 3.1, 0.825, 0.66],
    [2.3, 2.1, 2.4, 2.025, 0.25],
    [2.7, 2.4, 3.3, 2.4, 0.25],
    [2.8, 2.475, 3.525, 2.49375, 0.25],
    [2.9, 2.475, 3.45, 2.5125, 0.15],
    [2.8, 2.4, 3.2, 2.4, 0.15],
];

fn patches() -> Vec<Patch> {
    let mut all = Vec::with_capacity(32);
    for profile in [RIM, SHOULDER, BELLY] {
        revolve(profile, -1.0, &mut all);
    }
    for rings in [HANDLE, SPOUT] {
        for half in [&rings[..4], &rings[3..]] {
            for side in [-1.0, 1.0] {
                all.push(core::array::from_fn(|row| tube(half[row], side)));
            }
        }
    }
    for profile in [KNOB, LID] {
        revolve(profile, -1.0, &mut all);
    }
    // The other way round, so that it faces down.
    revolve(BOTTOM, 1.0, &mut all);
    all
}

/// Four patches, a quarter of a circle each, from +x towards y times `turn`.
fn revolve(profile: Profile, turn: f64, out: &mut Vec<Patch>) {
    for quarter in 0..4 {
        out.push(profile.map(|[radius, height]| {
            // Newell's quarter circles have handles of 0.56 of the radius, the wide ring of the knob of 0.5625.
            let reach = if radius == 0.8 { 0.45 } else { 0.56 * radius };
            let corners = [[radius, 0.0], [radius, reach], [reach, radius], [0.0, radius]];
            corners.map(|[x, y]| {
                let [x, y] = match quarter {
                    0 => [x, y],
                    1 => [-y, x],
                    2 => [-x, -y],
                    _ => [y, -x],
                };
                [x, y * turn, height]
            })
        }));
    }
}

/// One row of the half of a tube on the side of y that `side` says.
fn tube([inner_x, inner_z, outer_x, outer_z, width]: Ring, side: f64) -> [V; 4] {
    let y = side * width;
    let row = [[inner_x, 0.0, inner_z], [inner_x, y, inner_z], [outer_x, y, outer_z], [outer_x, 0.0, outer_z]];
    // The far side runs from outer to inner: so both face outward.
    if side < 0.0 { row } else { [row[3], row[2], row[1], row[0]] }
}

/// Cubic Bernstein polynomials and their derivatives.
fn bernstein(t: f64) -> ([f64; 4], [f64; 4]) {
    let u = 1.0 - t;
    let value = [u * u * u, 3.0 * t * u * u, 3.0 * t * t * u, t * t * t];
    let slope = [-3.0 * u * u, 3.0 * u * (u - 2.0 * t), 3.0 * t * (2.0 * u - t), 3.0 * t * t];
    (value, slope)
}

fn weigh(patch: &Patch, rows: [f64; 4], columns: [f64; 4]) -> V {
    let mut sum = [0.0; 3];
    for (row, r) in patch.iter().zip(rows) {
        for (&point, c) in row.iter().zip(columns) {
            sum = add(sum, scale(point, r * c));
        }
    }
    sum
}

/// Whether a point is on the axis, where the knob and the bottom come together.
fn on_axis(v: V) -> bool {
    v[0].abs() < 1e-4 && v[1].abs() < 1e-4
}

/// Adds size x size cells of two triangles, less those with an edge on the axis.
fn tessellate(patch: &Patch, size: u32, mesh: &mut Mesh) {
    let first = mesh.positions.len() as u32;
    let mut axis = Vec::with_capacity(((size + 1) * (size + 1)) as usize);
    for i in 0..=size {
        let (row, row_slope) = bernstein(f64::from(i) / f64::from(size));
        for j in 0..=size {
            let (column, column_slope) = bernstein(f64::from(j) / f64::from(size));
            let point = weigh(patch, row, column);
            let normal = if on_axis(point) {
                // All columns meet here, so there is no tangent along the row.
                [0.0, 0.0, if point[2] > 1.5 { 1.0 } else { -1.0 }]
            } else {
                unit(cross(weigh(patch, row, column_slope), weigh(patch, row_slope, column)))
            };
            axis.push(on_axis(point));
            mesh.positions.push(narrow(point));
            mesh.normals.push(narrow(normal));
        }
    }
    for i in 0..size {
        for j in 0..size {
            let low = i * (size + 1) + j;
            let high = low + size + 1;
            for triangle in [[low, low + 1, high + 1], [high + 1, high, low]] {
                if triangle.iter().filter(|&&v| axis[v as usize]).count() < 2 {
                    mesh.triangles.push(triangle.map(|v| first + v));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::vector::{dot, length, sub};

    /// Control points of the published table, by patch, row and column.
    #[test]
    fn published_control_points() {
        let patches = patches();
        assert_eq!(patches.len(), 32);
        for (patch, row, column, expected) in [
            (0, 0, 1, [1.4, -0.784, 2.4]),
            (1, 2, 2, [-1.4375, -0.805, 2.53125]),
            (4, 1, 2, [0.98, -1.75, 1.875]),
            (11, 3, 3, [1.5, 0.0, 0.15]),
            (12, 0, 1, [-1.6, -0.3, 2.025]),
            (13, 0, 1, [-1.5, 0.3, 2.25]),
            (14, 3, 2, [-1.9, -0.3, 0.6]),
            (17, 1, 2, [2.6, 0.66, 1.425]),
            (18, 2, 2, [3.45, -0.15, 2.5125]),
            (20, 1, 1, [0.8, -0.45, 3.15]),
            (20, 3, 2, [0.112, -0.2, 2.7]),
            (24, 2, 1, [1.3, -0.728, 2.55]),
            (28, 1, 1, [1.425, 0.798, 0.0]),
            (29, 2, 2, [-1.5, 0.84, 0.075]),
        ] {
            let found = patches[patch][row][column];
            assert!(length(sub(found, expected)) < 1e-12, "{patch} {row} {column}: {found:?}");
        }
    }

    #[test]
    fn slopes_are_derivatives() {
        let h = 1e-6;
        for t in [0.0, 0.2, 0.5, 0.9, 1.0] {
            let (value, slope) = bernstein(t);
            assert!((value.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            for k in 0..4 {
                let difference = (bernstein(t + h).0[k] - bernstein(t - h).0[k]) / (2.0 * h);
                assert!((slope[k] - difference).abs() < 1e-8);
            }
        }
    }

    /// Triangles face the way their normals do, but for the few that the strongly bent patches twist.
    #[test]
    fn triangles_agree_with_their_normals() {
        let model = teapot(12);
        let mesh = model.meshes.last().expect("the teapot is the last mesh");
        assert_eq!(mesh.normals.len(), mesh.positions.len());
        assert!(mesh.normals.iter().all(|n| (length(n.map(f64::from)) - 1.0).abs() < 1e-6));
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
            let face = cross(sub(b, a), sub(c, a));
            assert!(length(face) > 0.0);
            let agree = t.iter().filter(|&&i| dot(face, mesh.normals[i as usize].map(f64::from)) > 0.0);
            assert!(agree.count() >= 2, "{t:?}");
        }
    }

    /// Away from the axis at the height of the body's middle, the normals point outward.
    #[test]
    fn body_faces_outward() {
        let model = teapot(6);
        let mesh = model.meshes.last().expect("the teapot is the last mesh");
        let mut seen = 0;
        for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
            let radius = (p[0] * p[0] + p[1] * p[1]).sqrt();
            // Clear of spout and handle, which are 0.66 wide at most to each side.
            if (0.4..1.3).contains(&p[2]) && radius > 1.5 && p[1].abs() > 0.7 {
                seen += 1;
                assert!(p[0] * n[0] + p[1] * n[1] > 0.0, "{p:?} {n:?}");
            }
        }
        assert!(seen > 50, "{seen}");
    }
}
