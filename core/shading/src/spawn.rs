//! What a hit shows by itself, and the rays that it spawns: Whitted's model, one child at a time.
//!
//! A child is a function of the hit and of a cursor, so a tracer can stop between any two of them and keep nothing but
//! the cursor. What light a ray brings is sent to the film times the ray's weight; nothing comes back to the parent.
//!
//! A hit shows, for each channel, times the ray's weight:
//!
//! ```text
//! emission + ambient x scene ambient
//!   + sum over lights of  E/pi x (diffuse x max(0, n.l) + specular x highlight)
//!   + mirror' x (what the mirrored ray sees) + transmission' x (what the refracted ray sees)
//! ```
//!
//! E/pi is what the light sends against its direction (see [`Light`]); without `FRESNEL`, mirror' and transmission' are
//! the material's; with it, Fresnel's share of the transmission moves to the mirrored ray; at total reflection all of
//! it does.
//! Source: Whitted, *An Improved Illumination Model for Shaded Display*, CACM 23(6), 1980.

use core::ops::Range;

use glam::Vec3;

use crate::highlight;
use crate::id;
use crate::illuminate::arrival;
use crate::light::{Light, LightKind};
use crate::material::Material;
use crate::optics::{self, Boundary};
use crate::stratify::stratified;
use crate::surface::{Surface, offset_origin};
use crate::vector::normalize;

/// What shading needs to know of the scene besides the hit.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// By material index. A hit on a material that is not there is shaded as [`Material::MATT`].
    pub materials: &'a [Material],
    /// All of them light every hit.
    pub lights: &'a [Light],
    /// Ambient light, multiplied by each material's `ambient`.
    pub ambient: [f32; 3],
    /// Primary rays have depth 1; a hit at this depth spawns shadow rays only.
    pub ray_depth_max: u32,
    /// Mirrored and refracted rays whose weight is below this in every channel are not spawned.
    pub weight_cutoff: f32,
    /// File units in one internal unit, for [`Light::FALLOFF`].
    pub distance_scale: f32,
    /// What [`shadow_rays`] says of `lights`: the scene is asked for it at every hit.
    pub shadow_rays: u32,
}

/// A ray that a hit spawns.
///
/// `branch` tells the children of one hit apart: the child's id is [`id::child_id`]`(parent's id, branch)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Child {
    /// Brings `contribution` to the film if nothing opaque lies in `0..t_max`.
    Shadow {
        /// Where `t` is 0.
        origin: Vec3,
        /// The whole way to the light, not of unit length: the light is at `t` = 1, whatever the distance, so that
        /// neither a square root nor a product of length and direction moves the end of the ray. Of unit length for
        /// a directional light.
        direction: Vec3,
        /// A few units in the last place below 1; infinite for a directional light.
        t_max: f32,
        /// Radiance times the ray's weight.
        contribution: [f32; 3],
        /// Cursor + 1.
        branch: u32,
    },
    /// The mirrored ray.
    Mirror {
        /// Where `t` is 0.
        origin: Vec3,
        /// Unit vector.
        direction: Vec3,
        /// The new ray's weight.
        weight: [f32; 3],
        /// What it runs through.
        medium: u16,
        /// Cursor + 1.
        branch: u32,
    },
    /// The refracted ray.
    Refract {
        /// Where `t` is 0.
        origin: Vec3,
        /// Unit vector.
        direction: Vec3,
        /// The new ray's weight.
        weight: [f32; 3],
        /// What it runs through.
        medium: u16,
        /// Cursor + 1.
        branch: u32,
    },
    /// This cursor position spawns nothing.
    None,
}

/// Shadow rays that one hit may send to `lights`.
#[must_use]
pub fn shadow_rays(lights: &[Light]) -> u32 {
    lights.iter().fold(0, |sum: u32, light| sum.saturating_add(light.shadow_rays()))
}

/// What the surface shows without any light: emission and ambient light, times `weight`.
#[must_use]
pub fn local(scene: &Scene<'_>, surface: &Surface, weight: [f32; 3]) -> [f32; 3] {
    let material = material(scene, surface.material);
    channels(|c| weight[c] * (material.emission[c] + material.ambient[c] * scene.ambient[c]))
}

/// Cursor positions of a hit on this surface: those of the shadow rays, light by light, then one for the mirrored ray
/// and one for the refracted ray, as far as its material has any use for them.
#[must_use]
pub fn children(scene: &Scene<'_>, surface: &Surface) -> u32 {
    let material = material(scene, surface.material);
    let last = if material.transmits() {
        2
    } else if material.mirrors() {
        1
    } else {
        0
    };
    scene.shadow_rays.saturating_add(last)
}

/// The child at `cursor`, of a hit of ray `id` with `weight` at `depth` (1 for a primary ray).
///
/// Bounded work: constant if every light casts one shadow ray, else at most one look at each light.
#[must_use]
pub fn child(scene: &Scene<'_>, facing: &Facing, weight: [f32; 3], depth: u32, id: u64, cursor: u32) -> Child {
    let material = material(scene, facing.material);
    if let Some(past_lights) = cursor.checked_sub(scene.shadow_rays) {
        let deeper = depth < scene.ray_depth_max;
        return match past_lights {
            0 if deeper && (material.mirrors() || material.transmits()) => {
                mirrored(scene, material, facing, weight, cursor)
            }
            1 if deeper && material.transmits() => refracted(scene, material, facing, weight, cursor),
            _ => Child::None,
        };
    }
    let dark = [0.0; 3];
    if material.diffuse == dark && material.specular == dark {
        return Child::None;
    }
    let Some((light, first)) = find_light(scene, cursor) else {
        return Child::None;
    };
    shadow(scene, material, facing, light, first, weight, id, cursor)
}

/// The cursor positions of the shadow rays to the light that `cursor` is one of; none past the last light.
#[must_use]
pub fn of_one_light(scene: &Scene<'_>, cursor: u32) -> Range<u32> {
    find_light(scene, cursor).map_or(0..0, |(light, first)| first..first.saturating_add(light.shadow_rays()))
}

/// What a material lets through of a shadow ray's `contribution`; `None` if nothing.
#[must_use]
pub fn let_through(scene: &Scene<'_>, material: u16, contribution: [f32; 3]) -> Option<[f32; 3]> {
    let material = self::material(scene, material);
    let left = channels(|c| contribution[c] * material.transmission[c]);
    (left != [0.0; 3]).then_some(left)
}

/// What goes on of a shadow ray that meets this surface: where it starts again, and what is left of its contribution.
/// `None` if the surface is opaque. The direction stays; the new `t_max` is the old one minus the hit's `t`.
#[must_use]
pub fn pass_through(scene: &Scene<'_>, surface: &Surface, contribution: [f32; 3]) -> Option<(Vec3, [f32; 3])> {
    let left = let_through(scene, surface.material, contribution)?;
    let ahead = if surface.geometric_normal.dot(surface.incoming) < 0.0 {
        -surface.geometric_normal
    } else {
        surface.geometric_normal
    };
    let origin = offset_origin(surface.position, surface.error, ahead, ahead);
    Some((origin, left))
}

/// Cosine between a spawned ray and the surface that it must at least have, some 0.001 degrees: more than the roundings
/// of both vectors, and less than a picture shows.
const GRAZING: f32 = 1.0 / 65_536.0;

/// A hit from the side from which it is seen: what all rays that it spawns begin with, computed once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facing {
    position: Vec3,
    error: Vec3,
    incoming: Vec3,
    geometric: Vec3,
    shading: Vec3,
    /// Where shadow rays start.
    shadow_origin: Vec3,
    /// Whether that lies above the surface.
    lifted: bool,
    material: u16,
    medium: u16,
}

impl Facing {
    /// What fills unused room.
    pub const EMPTY: Self = Self {
        position: Vec3::ZERO,
        error: Vec3::ZERO,
        incoming: Vec3::ZERO,
        geometric: Vec3::ZERO,
        shading: Vec3::ZERO,
        shadow_origin: Vec3::ZERO,
        lifted: false,
        material: 0,
        medium: 0,
    };

    /// The hit on `surface`.
    #[must_use]
    pub fn new(surface: &Surface) -> Self {
        let Surface { position, error, geometric_normal, shading_normal, shadow_offset, incoming, material, medium } =
            *surface;
        let geometric = if geometric_normal.dot(incoming) > 0.0 { -geometric_normal } else { geometric_normal };
        // By the geometric normal and not by the view: a shading normal may lean away from the viewer.
        let shading = if shading_normal.dot(geometric) < 0.0 { -shading_normal } else { shading_normal };
        let lifted = shadow_offset.dot(geometric) > 0.0;
        // The lifted point is rounded once more. Shadow rays start on the viewer's side, wherever the light is.
        let shadow_offset = if lifted { shadow_offset } else { Vec3::ZERO };
        let start = position + shadow_offset;
        let start_error = error + (start.abs() + shadow_offset.abs()) * f32::EPSILON;
        let start_error = if lifted { start_error } else { error };
        let shadow_origin = offset_origin(start, start_error, geometric, geometric);
        Self { position, error, incoming, geometric, shading, shadow_origin, lifted, material, medium }
    }

    /// The shading normal, bent just enough to face the viewer, and its cosine with the view.
    fn towards_viewer(&self) -> (Vec3, f32) {
        let normal = lift(self.shading, -self.incoming);
        let cosine = -normal.dot(self.incoming);
        (normal, if cosine < 1.0 { cosine } else { 1.0 })
    }
}

/// `direction`, bent towards `normal` if it makes less than the grazing angle with the surface.
fn lift(direction: Vec3, normal: Vec3) -> Vec3 {
    let cosine = direction.dot(normal);
    if cosine >= GRAZING { direction } else { normalize(direction + normal * (GRAZING - cosine)) }
}

fn material<'a>(scene: &Scene<'a>, index: u16) -> &'a Material {
    scene.materials.get(usize::from(index)).unwrap_or(&Material::MATT)
}

fn channels(f: impl Fn(usize) -> f32) -> [f32; 3] {
    [f(0), f(1), f(2)]
}

/// The light whose shadow rays `cursor` is among, and the first of its cursor positions.
fn find_light<'a>(scene: &Scene<'a>, cursor: u32) -> Option<(&'a Light, u32)> {
    if scene.shadow_rays as usize == scene.lights.len() {
        return scene.lights.get(cursor as usize).map(|light| (light, cursor));
    }
    let mut first = 0u32;
    for light in scene.lights {
        let next = first.saturating_add(light.shadow_rays());
        if cursor < next {
            return Some((light, first));
        }
        first = next;
    }
    None
}

fn shadow(
    scene: &Scene<'_>,
    material: &Material,
    facing: &Facing,
    light: &Light,
    first: u32,
    weight: [f32; 3],
    id: u64,
    cursor: u32,
) -> Child {
    let rays = light.shadow_rays();
    let sample = match light.kind() {
        LightKind::Point | LightKind::Directional | LightKind::Spot => [0.5; 2],
        LightKind::Sphere | LightKind::Rectangle => stratified(id::random(id, first), cursor - first, rays),
    };
    let origin = facing.shadow_origin;
    let Some(found) = arrival(light, origin, scene.distance_scale, sample) else {
        return Child::None;
    };
    // Light from behind is shut out here, and spares a ray; but on a lifted point the shading normal alone decides, and
    // the ray finds out: the facets that turn from the light before the smooth surface does are what it was lifted for.
    let behind = facing.geometric.dot(found.direction) <= 0.0;
    let cosine = facing.shading.dot(found.direction);
    if !(cosine > 0.0) || (behind && !facing.lifted) {
        return Child::None;
    }
    let highlight = highlight::strength(material, facing.incoming, facing.shading, found.direction);
    let strength = found.strength / rays as f32;
    let contribution = channels(|c| {
        weight[c] * (light.colour[c] * strength) * (material.diffuse[c] * cosine + material.specular[c] * highlight)
    });
    // What is not finite goes on: the film counts it.
    if contribution == [0.0; 3] {
        return Child::None;
    }
    Child::Shadow { origin, direction: found.path, t_max: found.t_max, contribution, branch: cursor.saturating_add(1) }
}

/// What happens at the boundary of a transmitting material.
struct Crossing {
    normal: Vec3,
    cos_in: f32,
    eta: f32,
    boundary: Boundary,
    /// On the far side.
    medium: u16,
}

impl Crossing {
    fn new(scene: &Scene<'_>, material: &Material, facing: &Facing) -> Self {
        let inside = facing.material.saturating_add(1);
        let here = match facing.medium.checked_sub(1) {
            None => 1.0,
            Some(around) => scene.materials.get(usize::from(around)).map_or(1.0, index_of_refraction),
        };
        let (there, medium) = if facing.medium == inside { (1.0, 0) } else { (index_of_refraction(material), inside) };
        let eta = here / there;
        let (normal, cos_in) = facing.towards_viewer();
        Self { normal, cos_in, eta, boundary: optics::boundary(eta, cos_in), medium }
    }

    /// Share of the transmitted light that is mirrored instead.
    fn mirrored(&self, material: &Material) -> f32 {
        if self.boundary.total || material.flags & Material::FRESNEL != 0 { self.boundary.reflectance } else { 0.0 }
    }
}

fn index_of_refraction(material: &Material) -> f32 {
    if material.ior > 0.0 && material.ior.is_finite() { material.ior } else { 1.0 }
}

/// Whether a ray of this weight is worth tracing.
fn carries(scene: &Scene<'_>, weight: [f32; 3]) -> bool {
    weight.iter().any(|&w| w > 0.0 && w >= scene.weight_cutoff)
}

fn mirrored(scene: &Scene<'_>, material: &Material, facing: &Facing, weight: [f32; 3], cursor: u32) -> Child {
    let share = if material.transmits() { Crossing::new(scene, material, facing).mirrored(material) } else { 0.0 };
    let weight = channels(|c| weight[c] * (material.mirror[c] + material.transmission[c] * share));
    if !carries(scene, weight) {
        return Child::None;
    }
    let (normal, _) = facing.towards_viewer();
    let direction = lift(normalize(optics::mirror(facing.incoming, normal)), facing.geometric);
    Child::Mirror {
        origin: offset_origin(facing.position, facing.error, facing.geometric, facing.geometric),
        direction,
        weight,
        medium: facing.medium,
        branch: cursor.saturating_add(1),
    }
}

fn refracted(scene: &Scene<'_>, material: &Material, facing: &Facing, weight: [f32; 3], cursor: u32) -> Child {
    let crossing = Crossing::new(scene, material, facing);
    let share = 1.0 - crossing.mirrored(material);
    let weight = channels(|c| weight[c] * (material.transmission[c] * share));
    if crossing.boundary.total || !carries(scene, weight) {
        return Child::None;
    }
    let Crossing { normal, cos_in, eta, boundary, medium } = crossing;
    let direction = normalize(optics::refract(facing.incoming, normal, eta, cos_in, boundary.cos_out));
    let beyond = -facing.geometric;
    Child::Refract {
        origin: offset_origin(facing.position, facing.error, beyond, beyond),
        direction: lift(direction, beyond),
        weight,
        medium,
        branch: cursor.saturating_add(1),
    }
}

#[cfg(test)]
mod tests;
