//! `gears`: a cube of meshed gears over a mirroring square; every face is one concave polygon of 144 vertices.

use super::super::vector::{V, narrow};
use super::{View, add_quad, scene, surface};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;
use earcut::Earcut;
use std::collections::BTreeMap;

const TEETH: usize = 36;
const RIM: usize = 4 * TEETH;
/// Teeth reach to here, of the radius at which gears would touch: so they never do.
const OUTER: f64 = 0.995;
/// And the gaps between them down to here.
const INNER: f64 = 0.9;

const VIEW: View =
    View { eye: [-1.1, -2.1, 2.6], target: [0.0; 3], up: [0.0, 0.0, 1.0], fov_degrees: 45.0, hither: 1.0 };

/// The last one is just behind the eye.
const LIGHTS: [V; 5] =
    [[2.0, 4.0, 4.0], [-2.0, 4.0, 3.0], [2.0, -2.5, 2.5], [-1.0, -4.0, 2.0], [-1.111, -2.121, 2.626]];

/// `size` gears along each side of the cube, 146 polygons each.
pub fn gears(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    let corner = |x: f64, y: f64| [x, y, 0.0];
    let square = [corner(2.0, 2.0), corner(-2.0, 2.0), corner(-2.0, -2.0), corner(2.0, -2.0)];
    add_quad(&mut model, "ground", square, surface([1.0, 0.85, 0.7], 0.3, 0.6, 37.0, 0.0, 0.0));

    let n = f64::from(size);
    let radius = 1.0 / (n - (n - 1.0) * (1.0 - INNER) / 2.0);
    let pitch = radius * (1.0 + INNER);
    let thickness = f64::min(0.1, 0.5 / n);
    // Every other gear is turned by half a tooth, and all are alike otherwise: two outlines, one triangulation.
    let outlines = [0.0, PI / TEETH as f64].map(|angle| outline(radius, angle));
    let face = triangulate(&outlines[0]);
    let mut meshes = BTreeMap::new();
    for iz in 0..size {
        for iy in 0..size {
            for ix in 0..size {
                let colour = Colour::of(ix, iy, iz);
                let mesh = *meshes.entry(colour).or_insert_with(|| colour.add_mesh(&mut model));
                let place = |i: u32| f64::from(i) * pitch - 1.0 + radius;
                let centre = [place(ix), place(iy), 1.0 - f64::from(iz) / n];
                let outline = &outlines[((ix + iy + iz) % 2) as usize];
                add_gear(&mut model.meshes[mesh], outline, &face, centre, thickness);
            }
        }
    }
    model.objects.polygons += u64::from(size).pow(3) * (2 + RIM as u64);
    model
}

/// A gear's pseudo-random colour in sevenths, and whether it is clear. Of 343 colours, so gears share meshes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Colour {
    sevenths: [u32; 3],
    clear: bool,
}

impl Colour {
    fn of(x: u32, y: u32, z: u32) -> Self {
        let sevenths =
            [(x * 3 + y * 2 + z + 1) * 5 % 7, (y * 3 + z * 2 + x + 1) * 3 % 7, (z * 3 + x * 2 + y + 1) * 2 % 7];
        Self { sevenths, clear: (x * 4 + y * 2 + z).is_multiple_of(5) }
    }

    /// Adds an empty mesh of this colour; returns its place.
    fn add_mesh(self, model: &mut Model) -> usize {
        let rgb = self.sevenths.map(|s| 0.01 + f64::from(s) / 7.0);
        let most = rgb.into_iter().fold(0.0, f64::max);
        let rgb = rgb.map(|c| c / most);
        let material =
            if self.clear { surface(rgb, 0.2, 0.0, 0.0, 0.8, 1.1) } else { surface(rgb, 1.0, 0.0, 0.0, 0.0, 0.0) };
        let [r, g, b] = self.sevenths;
        let name = format!("gear-{r}{g}{b}{}", if self.clear { "-clear" } else { "" });
        let material = model.add_material(&name, material);
        model.meshes.push(Mesh { name, material, ..Mesh::default() });
        model.meshes.len() - 1
    }
}

/// The rim, counterclockwise, four vertices for each tooth.
fn outline(radius: f64, angle: f64) -> Vec<[f64; 2]> {
    let tooth = 2.0 * PI / TEETH as f64;
    let corners = [(-0.19, OUTER), (0.19, OUTER), (0.3, INNER), (0.7, INNER)];
    let point = |i: usize| {
        let (along, reach) = corners[i % 4];
        let a = angle + tooth * (i / 4) as f64 + along * tooth;
        [radius * reach * libm::cos(a), radius * reach * libm::sin(a)]
    };
    (0..RIM).map(point).collect()
}

/// Triangles of the face within the rim, counterclockwise.
fn triangulate(outline: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut indices: Vec<u32> = Vec::new();
    Earcut::new().earcut_slice(outline, &[], &mut indices);
    let counterclockwise = |t: &[u32]| {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| outline[i as usize]);
        let left = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0;
        if left { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] }
    };
    indices.chunks_exact(3).map(counterclockwise).collect()
}

/// A closed surface: both faces and the rim between them share their vertices.
fn add_gear(mesh: &mut Mesh, outline: &[[f64; 2]], face: &[[u32; 3]], centre: V, thickness: f64) {
    let top = mesh.positions.len() as u32;
    let rim = outline.len() as u32;
    let bottom = top + rim;
    for z in [centre[2], centre[2] - thickness] {
        mesh.positions.extend(outline.iter().map(|p| narrow([centre[0] + p[0], centre[1] + p[1], z])));
    }
    mesh.triangles.extend(face.iter().map(|t| t.map(|i| top + i)));
    mesh.triangles.extend(face.iter().map(|&[a, b, c]| [bottom + a, bottom + c, bottom + b]));
    for i in 0..rim {
        let next = (i + 1) % rim;
        mesh.triangles.push([top + i, bottom + i, bottom + next]);
        mesh.triangles.push([top + i, bottom + next, top + next]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    /// The face's triangles cover the polygon exactly: 142 of them, and their areas add up to the shoelace formula's.
    #[test]
    fn face_is_covered() {
        for angle in [0.0, PI / TEETH as f64] {
            let rim = outline(1.0, angle);
            let face = triangulate(&outline(1.0, 0.0));
            assert_eq!((rim.len(), face.len()), (144, 142));
            let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
            let polygon: f64 = (0..RIM).map(|i| cross(rim[i], rim[(i + 1) % RIM])).sum();
            let area = |t: &[u32; 3]| {
                let [a, b, c] = t.map(|i| rim[i as usize]);
                cross([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]])
            };
            assert!(face.iter().all(|t| area(t) > 0.0));
            assert!((face.iter().map(area).sum::<f64>() - polygon).abs() < 1e-12);
        }
    }

    #[test]
    fn gears_are_closed_and_face_outward() {
        let model = gears(3);
        for mesh in &model.meshes[1..] {
            assert_eq!(checks::open_edges(mesh), 0, "{}", mesh.name);
            assert!(checks::volume(mesh) > 0.0, "{}", mesh.name);
        }
        assert_eq!(model.meshes[1..].iter().map(|m| m.triangles.len()).sum::<usize>(), 27 * (2 * 142 + 2 * 144));
    }

    /// A gear in five or so lets light through: of 64, those with 4 x + 2 y + z divisible by 5.
    #[test]
    fn some_gears_are_clear() {
        let model = gears(4);
        let clear = |m: &&Mesh| model.materials[usize::from(m.material)].material.transmits();
        let triangles: usize = model.meshes.iter().filter(clear).map(|m| m.triangles.len()).sum();
        let expected = (0..64).filter(|i| ((i % 4) * 4 + (i / 4 % 4) * 2 + i / 16) % 5 == 0).count();
        assert_eq!(triangles, expected * (2 * 142 + 2 * 144));
    }
}
