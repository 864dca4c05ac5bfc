//! A glass ball over a floor under a spherical lamp, as a PPM picture on standard output.
//!
//! The tracer is brute force over two primitives; all that is between its hits is this crate.

use std::io::Write;

use glam::Vec3;
use hybray_shading::{
    Camera, Child, Filter, Light, LightKind, Look, MapTables, Material, Scene, Surface, id, sample_offset, spawn,
};

const SIZE: u32 = 256;
const SPP: u32 = 16;

/// The ball has radius 1 about the origin; the floor is z = -1.
fn hit(origin: Vec3, direction: Vec3, t_max: f32, medium: u16) -> Option<(f32, Surface)> {
    let a = direction.dot(direction);
    let along = -origin.dot(direction) / a;
    let nearest = origin + direction * along;
    let half_chord = ((1.0 - nearest.dot(nearest)) / a).sqrt();
    let ball = [along - half_chord, along + half_chord].into_iter().find(|&t| t > 0.0 && t < t_max);
    let floor = Some((-1.0 - origin.z) / direction.z).filter(|&t| t > 0.0 && t < ball.unwrap_or(t_max));
    let t = floor.or(ball)?;
    let position = origin + direction * t;
    let (position, normal) = match floor {
        Some(_) => (position.with_z(-1.0), Vec3::Z),
        None => (position / position.dot(position).sqrt(), position / position.dot(position).sqrt()),
    };
    let surface = Surface {
        position,
        error: Vec3::splat(1e-5),
        geometric_normal: normal,
        shading_normal: normal,
        shadow_offset: Vec3::ZERO,
        incoming: direction / a.sqrt(),
        material: u16::from(floor.is_none()),
        medium,
    };
    Some((t, surface))
}

/// What is left of a shadow ray's contribution at the light.
fn lit(scene: &Scene, mut origin: Vec3, direction: Vec3, mut t_max: f32, mut left: [f32; 3]) -> Option<[f32; 3]> {
    while let Some((t, surface)) = hit(origin, direction, t_max, 0) {
        (origin, left) = spawn::pass_through(scene, &surface, 1.0, left)?;
        t_max -= t;
    }
    Some(left)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let floor = Material { ambient: [0.75; 3], ..Material::MATT };
    let glass = Material {
        diffuse: [0.0; 3],
        transmission: [0.8, 0.95, 0.9],
        ior: 1.5,
        flags: Material::FRESNEL,
        ..Material::MATT
    };
    let lamp = Light {
        position: [-2.0, 1.0, 4.0],
        radius: 0.5,
        colour: [20.0; 3],
        kind: LightKind::Sphere as u32,
        samples: 4,
        flags: Light::FALLOFF,
        ..Light::default()
    };
    let (materials, lights) = ([floor, glass], [lamp]);
    let scene = Scene {
        materials: &materials,
        lights: &lights,
        ambient: [0.1; 3],
        ray_depth_max: 8,
        weight_cutoff: 1.0 / 512.0,
        distance_scale: 1.0,
        shadow_rays: spawn::shadow_rays(&lights),
        maps: MapTables::default(),
    };
    let camera = Camera::look(Vec3::new(0.0, -5.0, 1.5), Vec3::ZERO, Vec3::Z, 35.0, 0.0, SIZE, SIZE)?;
    let mut picture = Vec::new();
    for pixel in 0..SIZE * SIZE {
        let mut sum = Vec3::ZERO;
        for sample in 0..SPP {
            let offset = sample_offset(Filter::Gaussian, id::pixel_id(0, pixel), sample, SPP);
            let ray = camera.ray(pixel % SIZE, pixel / SIZE, offset);
            let mut waiting = vec![(ray.origin, ray.direction, [1.0; 3], 1, 0, id::primary_id(0, pixel, sample))];
            while let Some((origin, direction, weight, depth, medium, id)) = waiting.pop() {
                let Some((_, surface)) = hit(origin, direction, f32::INFINITY, medium) else {
                    sum += Vec3::from(weight) * Vec3::new(0.5, 0.7, 1.0);
                    continue;
                };
                let facing = spawn::Facing::new(&surface, Look::PLAIN);
                sum += Vec3::from(spawn::local(&scene, &facing, [1.0; 3], weight));
                for cursor in 0..spawn::children(&scene, &surface) {
                    match spawn::child(&scene, &facing, weight, depth, id, cursor) {
                        Child::Shadow { origin, direction, t_max, contribution, .. } => {
                            let left = lit(&scene, origin, direction, t_max, contribution);
                            sum += left.map_or(Vec3::ZERO, Vec3::from);
                        }
                        Child::Mirror { origin, direction, weight, medium, branch, .. }
                        | Child::Refract { origin, direction, weight, medium, branch } => {
                            waiting.push((origin, direction, weight, depth + 1, medium, id::child_id(id, branch)));
                        }
                        Child::None => {}
                    }
                }
            }
        }
        let shown = (sum / SPP as f32).to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0 + 0.5) as u8);
        picture.extend(shown);
    }
    let mut out = std::io::stdout().lock();
    write!(out, "P6\n{SIZE} {SIZE}\n255\n")?;
    out.write_all(&picture)?;
    Ok(())
}
