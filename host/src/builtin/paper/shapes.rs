//! What rooms and yards are built of: blocks, sheets, turned pieces, cushions and tubes, as triangles.
//!
//! Flat pieces (`block`, `wedge`, `stone`, `quad`, `surround`) go into meshes without normals; curved ones share their vertices, and
//! [`smooth`] gives a mesh of them its normals at the end. All face outward.

use super::super::vector::{Affine, V, add, cross, dot, length, narrow, scale, sub, unit};
use crate::model::Mesh;
use core::f64::consts::PI;

/// Moves by `t`.
pub fn at(t: V) -> Affine {
    Affine { t, ..Affine::IDENTITY }
}

/// Turns about z by an angle in degrees, then moves by `t`.
pub fn turned(degrees: f64, t: V) -> Affine {
    Affine { t, ..Affine::turn_by([0.0, 0.0, 1.0], degrees * PI / 180.0) }
}

/// A box with edges along the axes of `frame`: 12 triangles.
pub fn block(mesh: &mut Mesh, frame: &Affine, low: V, high: V) {
    wedge(mesh, frame, low, high, 0.0);
}

/// A box whose top is smaller than its bottom by `inset` at each side: 12 triangles.
pub fn wedge(mesh: &mut Mesh, frame: &Affine, low: V, high: V, inset: f64) {
    let first = mesh.positions.len() as u32;
    for (z, d) in [(low[2], 0.0), (high[2], inset)] {
        let [x0, x1, y0, y1] = [low[0] + d, high[0] - d, low[1] + d, high[1] - d];
        let ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        mesh.positions.extend(ring.map(|[x, y]| narrow(frame.apply([x, y, z]))));
    }
    const FACES: [[u32; 4]; 6] = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    for [a, b, c, d] in FACES.map(|face| face.map(|v| first + v)) {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
}

/// The upper half of a stone that lies in the ground: sides and top, 10 triangles.
pub fn stone(mesh: &mut Mesh, frame: &Affine, low: V, high: V, inset: f64) {
    let bottom = mesh.triangles.len();
    wedge(mesh, frame, low, high, inset);
    mesh.triangles.drain(bottom..bottom + 2);
}

/// A quadrilateral, counterclockwise.
pub fn quad(mesh: &mut Mesh, frame: &Affine, corners: [V; 4]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners.map(|c| narrow(frame.apply(c))));
    mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

/// A frame around an opening in the xz plane, `width` wide, its front at `y[0]`; without the back, at `y[1]`: 24
/// triangles.
pub fn surround(mesh: &mut Mesh, frame: &Affine, x: [f64; 2], z: [f64; 2], y: [f64; 2], width: f64) {
    let first = mesh.positions.len() as u32;
    // Back of the outer edge, its front, front of the inner edge, its back.
    for (y, inset) in [(y[1], 0.0), (y[0], 0.0), (y[0], width), (y[1], width)] {
        let [x0, x1, z0, z1] = [x[0] + inset, x[1] - inset, z[0] + inset, z[1] - inset];
        let ring = [[x0, z0], [x1, z0], [x1, z1], [x0, z1]];
        mesh.positions.extend(ring.map(|[x, z]| narrow(frame.apply([x, y, z]))));
    }
    for ring in 0..3 {
        for i in 0..4 {
            let [a, b] = [i, (i + 1) % 4].map(|i| first + 4 * ring + i);
            mesh.triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
}

/// A grid of points: `rows` of them from below to above, `columns` segments from left to right, the last joined to the
/// first if `closed`. Rows that are one point become one vertex; triangles of no area are left out.
pub fn sheet(mesh: &mut Mesh, rows: u32, columns: u32, closed: bool, point: impl Fn(u32, u32) -> V) {
    let vertices = columns + u32::from(!closed);
    let mut below: Option<(u32, u32)> = None;
    for i in 0..rows {
        let first = mesh.positions.len();
        mesh.positions.extend((0..vertices).map(|j| narrow(point(i, j))));
        let row = &mesh.positions[first..];
        if row.iter().all(|p| *p == row[0]) {
            mesh.positions.truncate(first + 1);
        }
        let row = (first as u32, (mesh.positions.len() - first) as u32);
        if let Some(low) = below {
            let vertex = |(first, count): (u32, u32), j: u32| first + j % count;
            for j in 0..columns {
                let [a, b, c, d] = [vertex(low, j), vertex(low, j + 1), vertex(row, j + 1), vertex(row, j)];
                for t in [[a, b, c], [a, c, d]] {
                    let [p, q, r] = t.map(|v| mesh.positions[v as usize]);
                    if p != q && q != r && r != p {
                        mesh.triangles.push(t);
                    }
                }
            }
        }
        below = Some(row);
    }
}

/// A piece turned about the frame's z: radius and height, with the outside to the right of somebody who walks along
/// the profile. A point that stands twice makes an edge.
pub fn lathe(mesh: &mut Mesh, frame: &Affine, profile: &[[f64; 2]], segments: u32) {
    sheet(mesh, profile.len() as u32, segments, true, |i, j| {
        let [radius, height] = profile[i as usize];
        let a = 2.0 * PI * f64::from(j) / f64::from(segments);
        frame.apply([radius * libm::cos(a), radius * libm::sin(a), height])
    });
}

/// A superellipsoid about the origin of `shape`'s domain, its poles at +-z; `power` 1 is an ellipsoid, less is more
/// like a box. `shape` puts its points in place and may bend it.
pub fn cushion(mesh: &mut Mesh, half: V, power: f64, [around, rows]: [u32; 2], shape: impl Fn(V) -> V) {
    let bulge = |c: f64| if c.abs() < 1e-9 { 0.0 } else { libm::copysign(libm::pow(c.abs(), power), c) };
    sheet(mesh, rows + 1, around, true, |i, j| {
        let up = PI * (f64::from(i) / f64::from(rows) - 0.5);
        // Half a step on, so that the corners of the box are not cut.
        let a = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(around);
        let reach = bulge(libm::cos(up));
        let p = [reach * bulge(libm::cos(a)), reach * bulge(libm::sin(a)), bulge(libm::sin(up))];
        shape([p[0] * half[0], p[1] * half[1], p[2] * half[2]])
    });
}

/// A round bar along a path of two points or more, open at its ends.
pub fn tube(mesh: &mut Mesh, frame: &Affine, path: &[V], radius: f64, sides: u32) {
    let along = |i: usize| unit(sub(path[(i + 1).min(path.len() - 1)], path[i.max(1) - 1]));
    // Carried along the path, so that the bar does not twist.
    let mut across = Vec::with_capacity(path.len());
    let start = along(0);
    let mut side = if start[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    for i in 0..path.len() {
        let t = along(i);
        side = unit(sub(side, scale(t, dot(side, t))));
        across.push((side, cross(t, side)));
    }
    sheet(mesh, path.len() as u32, sides, true, |i, j| {
        let a = 2.0 * PI * f64::from(j) / f64::from(sides);
        let (u, v) = across[i as usize];
        let out = add(scale(u, radius * libm::cos(a)), scale(v, radius * libm::sin(a)));
        frame.apply(add(path[i as usize], out))
    });
}

/// Gives every vertex the mean of its triangles' normals, by area.
pub fn smooth(mut mesh: Mesh) -> Mesh {
    let mut sums = vec![[0.0; 3]; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
        let face = cross(sub(b, a), sub(c, a));
        t.iter().for_each(|&v| sums[v as usize] = add(sums[v as usize], face));
    }
    let upright = |n: V| if length(n) > 0.0 { unit(n) } else { [0.0, 0.0, 1.0] };
    mesh.normals = sums.into_iter().map(|n| narrow(upright(n))).collect();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    /// Closed, facing outward, and as large as the formula says, within what facets cut off.
    #[track_caller]
    fn check(mesh: &Mesh, triangles: usize, volume: f64, slack: f64) {
        assert_eq!((mesh.triangles.len(), checks::open_edges(mesh)), (triangles, 0));
        let found = checks::volume(mesh);
        assert!(found <= volume * (1.0 + 1e-6) && found > volume * (1.0 - slack), "{found} {volume}");
    }

    #[test]
    fn solids_have_their_volumes() {
        let mut mesh = Mesh::default();
        block(&mut mesh, &turned(30.0, [5.0, 1.0, 2.0]), [-1.0, 0.0, 0.0], [1.0, 3.0, 0.5]);
        check(&mesh, 12, 3.0, 1e-6);
        let mut mesh = Mesh::default();
        wedge(&mut mesh, &at([0.0; 3]), [0.0; 3], [2.0, 2.0, 3.0], 0.5);
        // A frustum: h / 3 (A + a + sqrt(A a)).
        check(&mesh, 12, 4.0 + 1.0 + 2.0, 1e-6);
        let mut mesh = Mesh::default();
        // The missing back lies in y = 0, so that it has no part in the volume.
        surround(&mut mesh, &at([0.0; 3]), [0.0, 2.0], [0.0, 1.0], [-0.5, 0.0], 0.1);
        assert_eq!((mesh.triangles.len(), checks::open_edges(&mesh)), (24, 8));
        assert!((checks::volume(&mesh) - 0.5 * (2.0 - 1.8 * 0.8)).abs() < 1e-6);
        let mut mesh = Mesh::default();
        lathe(&mut mesh, &turned(10.0, [1.0; 3]), &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]], 64);
        check(&mesh, 4 * 64, 2.0 * PI, 0.01);
        let mut mesh = Mesh::default();
        cushion(&mut mesh, [1.0, 2.0, 3.0], 1.0, [48, 24], |p| p);
        check(&mesh, 2 * 48 * 23, 8.0 * PI, 0.02);
    }

    #[test]
    fn tubes_keep_their_width() {
        let mut mesh = Mesh::default();
        let path: [V; 4] = [[0.0; 3], [0.0, 0.0, 1.0], [0.5, 0.0, 2.0], [2.0, 1.0, 2.0]];
        tube(&mut mesh, &at([0.0; 3]), &path, 0.1, 6);
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (36, 24));
        for (i, p) in mesh.positions.iter().enumerate() {
            let distance = length(sub(p.map(f64::from), path[i / 6]));
            assert!((distance - 0.1).abs() < 1e-6);
        }
        // Sides face outward.
        let mesh = smooth(mesh);
        for (i, (p, n)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
            assert!(dot(sub(p.map(f64::from), path[i / 6]), n.map(f64::from)) > 0.05);
        }
    }

    #[test]
    fn stones_lack_their_bottoms() {
        let mut mesh = Mesh::default();
        stone(&mut mesh, &at([0.0; 3]), [0.0; 3], [1.0; 3], 0.1);
        assert_eq!((mesh.triangles.len(), checks::open_edges(&mesh)), (10, 4));
    }

    /// An edge of a profile keeps the faces at both sides flat.
    #[test]
    fn doubled_points_make_edges() {
        let mut mesh = Mesh::default();
        let profile = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0], [0.0, 1.0]];
        lathe(&mut mesh, &at([0.0; 3]), &profile, 12);
        let mesh = smooth(mesh);
        assert!(mesh.normals.iter().all(|n| n[2].abs() < 1e-6 || n[2].abs() > 1.0 - 1e-6));
        assert_eq!(mesh.triangles.len(), 4 * 12);
    }
}
