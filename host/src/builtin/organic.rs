//! `organic`: a closed, knotted, blobby tube, the stand-in for a scanned figure: smooth, with overhangs and
//! self-shadowing, triangles of about one size and no flat parts.

use super::strip::{Row, strip};
use super::vector::{V, add, cross, dot, narrow, scale, sub, unit};
use crate::model::{CameraSpec, Mesh, Model, Objects};
use core::f64::consts::PI;
use hybray_shading::{Highlight, Light, LightKind, Material};

/// Segments of the tube's length for each segment around it: so triangles come out about as long as wide.
const SLENDERNESS: f64 = 7.0;

/// Mean radius of the tube.
const RADIUS: f64 = 0.5;
/// The trefoil's half height, more than the usual 1: so the strands keep clear of one another.
const RISE: f64 = 1.4;
/// Strengths of the waves of the radius; it is never more than 1 + their sum times the mean.
const WAVES: [f64; 4] = [0.18, 0.11, 0.06, 0.015];

/// A watertight surface of exactly `triangles` triangles, or one fewer if that is odd (a closed surface of triangles
/// has an even number: three edges each, and every edge belongs to two).
pub fn organic(triangles: u32) -> Model {
    let triangles = triangles - triangles % 2;
    let skin = [0.74, 0.47, 0.31];
    let mut model = Model {
        lights: vec![light([-0.55, 0.45, -0.7], [1.15, 1.1, 1.0]), light([0.8, 0.3, -0.25], [0.25, 0.28, 0.35])],
        cameras: vec![camera()],
        background: [0.16, 0.18, 0.21],
        ambient: [0.1; 3],
        objects: Objects { polygons: u64::from(triangles), ..Objects::default() },
        ..Model::default()
    };
    let material = Material {
        diffuse: skin,
        ambient: skin,
        specular: [0.12; 3],
        exponent: 40.0,
        highlight: Highlight::Blinn as u32,
        ..Material::MATT
    };
    let material = model.add_material("skin", material);
    model.meshes.push(Mesh { name: "organic".to_owned(), material, ..tube(triangles) });
    model
}

fn light(along: V, colour: [f32; 3]) -> Light {
    let axis = narrow(unit(along));
    Light { kind: LightKind::Directional as u32, axis, colour, samples: 1, ..Light::default() }
}

fn camera() -> CameraSpec {
    CameraSpec {
        name: "whole".to_owned(),
        eye: [1.2, -5.6, 7.8],
        target: [0.0, 0.0, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y_degrees: 45.0,
        hither: 0.0,
        size: None,
        ..CameraSpec::default()
    }
}

/// Rings of vertices around a trefoil, joined by strips, the last one to the first. Rings of c segments have 2 c
/// triangles between them; the first ones have a segment more where the count does not divide evenly.
fn tube(triangles: u32) -> Mesh {
    let around = (f64::from(triangles) / (2.0 * SLENDERNESS)).sqrt() as u32;
    let around = around.max(3);
    let rings = triangles / 2 / around;
    // Fewer than `around`, so fewer than there are rings.
    let longer = triangles / 2 - rings * around;

    let mut mesh = Mesh {
        positions: Vec::with_capacity(triangles as usize / 2),
        triangles: Vec::with_capacity(triangles as usize),
        ..Mesh::default()
    };
    let mut row = Row { first: 0, segments: around + u32::from(longer > 0) };
    let start = row;
    for i in 0..rings {
        let t = 2.0 * PI * f64::from(i) / f64::from(rings);
        let frame = Frame::at(t);
        let point = |j: u32| narrow(frame.skin(t, 2.0 * PI * f64::from(j) / f64::from(row.segments)));
        mesh.positions.extend((0..row.segments).map(point));
        let next = if i + 1 == rings {
            start
        } else {
            Row { first: row.first + row.segments, segments: around + u32::from(i + 1 < longer) }
        };
        strip(row, next, true, i, &mut mesh.triangles);
        row = next;
    }
    mesh
}

/// A point of the trefoil and two directions across it (Frenet's normal and binormal; its curvature is never 0).
struct Frame {
    point: V,
    normal: V,
    binormal: V,
}

impl Frame {
    fn at(t: f64) -> Self {
        let (s1, c1) = (libm::sin(t), libm::cos(t));
        let (s2, c2) = (libm::sin(2.0 * t), libm::cos(2.0 * t));
        let (s3, c3) = (libm::sin(3.0 * t), libm::cos(3.0 * t));
        let point = [s1 + 2.0 * s2, c1 - 2.0 * c2, -RISE * s3];
        let velocity = [c1 + 4.0 * c2, -s1 + 4.0 * s2, -3.0 * RISE * c3];
        let acceleration = [-s1 - 8.0 * s2, -c1 + 8.0 * c2, 9.0 * RISE * s3];
        let tangent = unit(velocity);
        let normal = unit(sub(acceleration, scale(tangent, dot(acceleration, tangent))));
        Self { point, normal, binormal: cross(tangent, normal) }
    }

    /// The surface at the angle `a` around the tube: its radius swells and shrinks by whole waves along and around.
    fn skin(&self, t: f64, a: f64) -> V {
        let swell = WAVES[0] * libm::sin(9.0 * t + 0.5)
            + WAVES[1] * libm::sin(17.0 * t + 3.0 * a)
            + WAVES[2] * libm::sin(23.0 * t - 4.0 * a + 1.0)
            + WAVES[3] * libm::sin(61.0 * t + 7.0 * a + 2.0);
        let radius = RADIUS * (1.0 + swell);
        let across = add(scale(self.normal, libm::cos(a)), scale(self.binormal, libm::sin(a)));
        add(self.point, scale(across, radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;
    use crate::builtin::vector::length;

    #[test]
    fn watertight_at_every_size() {
        for triangles in (200..260).chain([1_001, 9_998, 70_000]) {
            let model = organic(triangles);
            checks::sound(&model);
            let mesh = &model.meshes[0];
            assert_eq!(mesh.triangles.len() as u32, triangles / 2 * 2);
            assert_eq!(model.objects.polygons as usize, mesh.triangles.len());
            assert_eq!(checks::open_edges(mesh), 0, "{triangles}");
            // A torus: V - E + F = 0, with E = 3 F / 2.
            assert_eq!(2 * mesh.positions.len(), mesh.triangles.len());
            let mut used = vec![false; mesh.positions.len()];
            mesh.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
            assert!(used.iter().all(|&u| u));
        }
    }

    /// Pappus: cross-section times the length of the curve, but for the waves, whose squares add two percent.
    #[test]
    fn volume_is_that_of_a_tube() {
        let speed = |i: u32| {
            let t = f64::from(i) * 2.0 * PI / 1_000.0;
            length(sub(Frame::at(t + 1e-4).point, Frame::at(t).point)) / 1e-4
        };
        let curve: f64 = (0..1_000).map(speed).sum::<f64>() * 2.0 * PI / 1_000.0;
        let tube = PI * RADIUS * RADIUS * curve;
        let found = checks::volume(&organic(70_000).meshes[0]);
        assert!((found / tube - 1.0).abs() < 0.05, "{found} {tube}");
    }

    /// Strands stay clear of one another: points a tenth of the curve or more apart along it are farther apart than two
    /// of the largest radii.
    #[test]
    fn does_not_run_into_itself() {
        let points: Vec<V> = (0..600).map(|i| Frame::at(f64::from(i) * 2.0 * PI / 600.0).point).collect();
        for i in 0..600_usize {
            for j in i + 60..(i + 541).min(600) {
                assert!(
                    length(sub(points[i], points[j])) > 2.0 * RADIUS * (1.0 + WAVES.iter().sum::<f64>()),
                    "{i} {j}"
                );
            }
        }
    }

    #[test]
    fn seen_whole() {
        assert_eq!(checks::share_in_view(&organic(10_000)), 1.0);
    }
}
