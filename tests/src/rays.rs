//! Rays at a scene: at random, close together, and a camera's.

use crate::Random;
use hybray::model::Model;
use hybray_geometry::{Ray, Vec3};
use hybray_shading::{Camera, Filter, Lens, Pose, Projection};

/// A ray through the box around -1 to 1; every fourth on a coarse grid, along an axis or a diagonal.
pub fn random_ray(random: &mut Random) -> Ray {
    let (mut origin, mut direction) = (random.vec() * 2.0, random.vec() - random.vec());
    if random.below(4) == 0 {
        origin = (origin * 4.0).round() * 0.25;
        direction = (direction * 1.4).round();
    }
    if direction == Vec3::ZERO {
        direction = Vec3::Z;
    }
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}

/// A point in a box that is blown up by `grow` around its middle.
fn point(random: &mut Random, [lo, hi]: [Vec3; 2], grow: f32) -> Vec3 {
    (lo + hi) * 0.5 + random.vec() * (hi - lo) * (0.5 * grow)
}

/// Rays through a scene's box, from in and around it; every fourth along axes, every third of bounded reach.
pub fn rays_at(random: &mut Random, extent: [Vec3; 2], count: usize) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let (origin, target) = (point(random, extent, 2.0), point(random, extent, 1.0));
            let mut direction = target - origin;
            if i % 4 == 0 {
                direction[random.below(3)] = 0.0;
                direction[random.below(3)] = 0.0;
            }
            if direction == Vec3::ZERO {
                direction = Vec3::Y;
            }
            let (t_min, t_max) = if i % 3 == 0 { (0.125, 0.75) } else { (0.0, f32::INFINITY) };
            Ray { origin, direction, t_min, t_max }
        })
        .collect()
}

/// `count` rays that start in a small box and end in another: no common apex, lengths and intervals that differ.
pub fn close_rays(random: &mut Random, extent: [Vec3; 2], count: usize) -> Vec<Ray> {
    let (from, to) = (point(random, extent, 1.5), point(random, extent, 0.8));
    let size = (extent[1] - extent[0]).length();
    let (near, far) = ([0.0, 0.01, 0.1][random.below(3)] * size, [0.003, 0.03, 0.2][random.below(3)] * size);
    (0..count)
        .map(|_| {
            let origin = from + random.vec() * near;
            let direction = (to + random.vec() * far - origin) * (1.5 + random.signed());
            let (t_min, t_max) = [(0.0, f32::INFINITY), (0.0, 1.0), (0.2, 3.0)][random.below(3)];
            Ray { origin, direction: if direction == Vec3::ZERO { Vec3::X } else { direction }, t_min, t_max }
        })
        .collect()
}

/// The rays through the pixels of a square picture of the model's first camera and its lens, along Morton's curve, so that
/// every run of them is compact. `unit`: internal units of a file unit; `side` is a power of two.
///
/// # Panics
/// If there is no camera, or it is none.
#[must_use]
pub fn camera_rays(model: &Model, unit: f32, side: u32) -> Vec<Ray> {
    let spec = &model.cameras[0];
    let scaled = |p: [f32; 3]| Vec3::from(p) * unit;
    let (eye, target, up, hither) = (scaled(spec.eye), scaled(spec.target), spec.up.into(), spec.hither * unit);
    let pose = Pose { eye, target, up, hither, size: [side, side] };
    let camera = match spec.projection {
        Projection::Perspective => {
            let (radius, focus) = (spec.aperture * unit, spec.focus_distance() * unit);
            let (blades, rotation_degrees) = (spec.blades.into(), spec.blade_rotation_degrees);
            Camera::perspective(&pose, spec.fov_y_degrees, Lens { radius, focus, blades, rotation_degrees })
        }
        Projection::Orthographic => Camera::orthographic(&pose, spec.picture_height() * unit),
        Projection::Spherical => Camera::spherical(&pose),
    };
    let camera = camera.unwrap_or_else(|e| panic!("{e}"));
    let even_bits = |code: u32| (0..16).fold(0, |bits, i| bits | (code >> (2 * i) & 1) << i);
    (0..side * side)
        .map(|code| {
            let seen = camera.sample(Filter::Box, 0, [even_bits(code), even_bits(code >> 1)], 0, 1);
            Ray { origin: seen.origin, direction: seen.direction, t_min: seen.t_min, t_max: f32::INFINITY }
        })
        .collect()
}
