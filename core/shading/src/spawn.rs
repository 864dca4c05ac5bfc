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
//!
//! A material of metallic-roughness shows what GGX facets (docs/SHADING.md) make of each light, and one mirrored and one refracted ray,
//! both by the same facet, which is drawn by the ray's id. Where only a share of a surface is there, it shows that share of all
//! this, and the rest of the ray goes straight on.

use core::ops::Range;

use glam::Vec3;

use crate::detail::{Look, MapTables};
use crate::environment::{self, share_of};
use crate::glossy::Glossy;
use crate::highlight;
use crate::id;
use crate::illuminate::{Arrival, arrival};
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
    /// Textures, and what materials take from them.
    pub maps: MapTables<'a>,
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
        /// How much it shows of what is all around, as [`share_of`] has it.
        around: u8,
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
pub fn local(scene: &Scene<'_>, facing: &Facing, emission: [f32; 3], weight: [f32; 3]) -> [f32; 3] {
    let room = &mut None;
    let (material, coverage) = shown(scene, facing, room);
    let physical = material.flags & Material::PHYSICAL != 0;
    let ambient = if physical { Glossy::new(material).diffuse } else { material.ambient };
    channels(|c| weight[c] * (material.emission[c] * emission[c] + ambient[c] * scene.ambient[c]) * coverage)
}

/// The material at a hit, and how much of it is there.
#[inline(always)]
fn shown<'a>(scene: &Scene<'a>, facing: &Facing, room: &'a mut Option<Material>) -> (&'a Material, f32) {
    let material = material(scene, facing.material);
    if material.flags & Material::DETAIL == 0 {
        return (material, 1.0);
    }
    let blends = material.flags & Material::BLEND != 0;
    (room.insert(facing.look.of(material)), if blends { facing.look.coverage() } else { 1.0 })
}

/// What is left of a ray's weight after `distance` (internal units) through its medium.
#[must_use]
pub fn absorbed(scene: &Scene<'_>, medium: u16, distance: f32, weight: [f32; 3]) -> [f32; 3] {
    let Some(material) = medium.checked_sub(1).and_then(|m| scene.materials.get(usize::from(m))) else { return weight };
    if material.flags & Material::PHYSICAL == 0 || material.ambient == [0.0; 3] {
        return weight;
    }
    channels(|c| weight[c] * libm::expf(-material.ambient[c] * (distance * scene.distance_scale)))
}

/// Cursor positions of a hit on this surface: those of the shadow rays, light by light, then one for the mirrored ray
/// and one for the refracted ray, as far as its material has any use for them.
#[must_use]
pub fn children(scene: &Scene<'_>, surface: &Surface) -> u32 {
    let material = material(scene, surface.material);
    let last = if material.refracts() || material.flags & Material::BLEND != 0 {
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
    let room = &mut None;
    let (material, coverage) = shown(scene, facing, room);
    if let Some(past_lights) = cursor.checked_sub(scene.shadow_rays) {
        let deeper = depth < scene.ray_depth_max;
        let straight = past_lights == 1 && material.flags & Material::BLEND != 0 && !material.refracts();
        if straight && deeper {
            return straight_on(scene, facing, channels(|c| weight[c] * (1.0 - coverage)), cursor);
        }
        let weight = channels(|c| weight[c] * coverage);
        return match past_lights {
            0 if deeper && (material.mirrors() || material.refracts()) => {
                mirrored(scene, material, facing, weight, id, cursor)
            }
            1 if deeper && material.refracts() => refracted(scene, material, facing, weight, id, cursor),
            _ => Child::None,
        };
    }
    let weight = channels(|c| weight[c] * coverage);
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

/// What a material lets through of a shadow ray's `contribution` where so much of it is there; `None` if nothing.
#[must_use]
pub fn let_through(scene: &Scene<'_>, index: u16, coverage: f32, contribution: [f32; 3]) -> Option<[f32; 3]> {
    let material = material(scene, index);
    let left = if material.flags & Material::CUTOUT != 0 && coverage < scene.maps.of(index).cutoff {
        contribution
    } else if material.flags & Material::BLEND != 0 {
        channels(|c| contribution[c] * (1.0 - coverage))
    } else if material.flags & Material::PHYSICAL != 0 {
        let through = Glossy::new(material).through;
        channels(|c| contribution[c] * through[c])
    } else {
        channels(|c| contribution[c] * material.transmission[c])
    };
    (left != [0.0; 3]).then_some(left)
}

/// What goes on of a shadow ray that meets this surface: where it starts again, and what is left of its contribution.
/// `None` if the surface is opaque. The direction stays; the new `t_max` is the old one minus the hit's `t`.
#[must_use]
pub fn pass_through(
    scene: &Scene<'_>,
    surface: &Surface,
    coverage: f32,
    contribution: [f32; 3],
) -> Option<(Vec3, [f32; 3])> {
    let left = let_through(scene, surface.material, coverage, contribution)?;
    Some((past(surface), left))
}

/// Where a ray goes on that passes `surface`.
#[must_use]
pub fn past(surface: &Surface) -> Vec3 {
    let ahead = if surface.geometric_normal.dot(surface.incoming) < 0.0 {
        -surface.geometric_normal
    } else {
        surface.geometric_normal
    };
    offset_origin(surface.position, surface.error, ahead, ahead)
}

/// Whether a ray that looks for its nearest hit passes `surface`, of which so much is there.
#[must_use]
pub fn passes(scene: &Scene<'_>, surface: &Surface, coverage: f32) -> bool {
    let material = material(scene, surface.material);
    let behind = surface.geometric_normal.dot(surface.incoming) > 0.0;
    (material.flags & Material::SINGLE_SIDED != 0 && behind && !material.refracts())
        || (material.flags & Material::CUTOUT != 0 && coverage < scene.maps.of(surface.material).cutoff)
}

/// How much of a flat mirror's the rays' openings are that a hit mirrors and refracts: radians to be added to a footprint's.
#[must_use]
pub fn opening(scene: &Scene<'_>, facing: &Facing) -> f32 {
    let room = &mut None;
    let (material, _) = shown(scene, facing, room);
    if material.flags & Material::PHYSICAL == 0 { 0.0 } else { Glossy::new(material).opening() }
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
    look: Look,
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
        look: Look::PLAIN,
    };

    /// The hit on `surface`, whose textures say `look`.
    #[must_use]
    pub fn new(surface: &Surface, look: Look) -> Self {
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
        Self { position, error, incoming, geometric, shading, shadow_origin, lifted, material, medium, look }
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
        LightKind::Sphere | LightKind::Rectangle | LightKind::Environment => {
            stratified(id::random(id, first), cursor - first, rays)
        }
    };
    let origin = facing.shadow_origin;
    let around = light.kind() == LightKind::Environment;
    let environment = &scene.maps.environment;
    let (found, colour, cell) = if around {
        let Some((direction, cell)) = environment.arrival(sample) else {
            return Child::None;
        };
        let found = Arrival { path: direction, direction, t_max: f32::INFINITY, strength: 1.0 };
        let colour = environment.cells[cell].colour;
        (found, channels(|c| light.colour[c] * colour[c]), cell)
    } else {
        let Some(found) = arrival(light, origin, scene.distance_scale, sample) else {
            return Child::None;
        };
        (found, light.colour, 0)
    };
    // Light from behind is shut out here, and spares a ray; but on a lifted point the shading normal alone decides, and
    // the ray finds out: the facets that turn from the light before the smooth surface does are what it was lifted for.
    let behind = facing.geometric.dot(found.direction) <= 0.0;
    let cosine = facing.shading.dot(found.direction);
    if !(cosine > 0.0) || (behind && !facing.lifted) {
        return Child::None;
    }
    let strength = found.strength / rays as f32;
    let shown = if material.flags & Material::PHYSICAL == 0 {
        // What is around is mirrored as it is, and no highlight stands for it beside.
        let glints = !(around && material.mirrors());
        let highlight =
            if glints { highlight::strength(material, facing.incoming, facing.shading, found.direction) } else { 0.0 };
        channels(|c| material.diffuse[c] * cosine + material.specular[c] * highlight)
    } else {
        let (glossy, (normal, _)) = (Glossy::new(material), facing.towards_viewer());
        let glints = if around {
            let sampled = glossy.density(facing.incoming, normal, found.direction);
            1.0 - sampled.map_or(1.0, |sampled| share_of(environment::share(sampled, environment.density_of(cell))))
        } else {
            1.0
        };
        glossy.shown(facing.incoming, normal, found.direction, cosine, glints)
    };
    let contribution = channels(|c| weight[c] * (colour[c] * strength) * shown[c]);
    // What is not finite goes on: the film counts it.
    if contribution == [0.0; 3] {
        return Child::None;
    }
    Child::Shadow { origin, direction: found.path, t_max: found.t_max, contribution, branch: cursor.saturating_add(1) }
}

/// How much of what is all around towards `direction` a mirrored ray of this hit shows: see `environment::share`.
fn seen_share(scene: &Scene<'_>, glossy: &Glossy, facing: &Facing, direction: Vec3) -> u8 {
    let environment = &scene.maps.environment;
    if environment.cells.is_empty() {
        return 0;
    }
    let sampled = glossy.density(facing.incoming, facing.towards_viewer().0, direction);
    sampled.map_or(0, |sampled| environment::share(sampled, environment.density(direction)))
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
        let (normal, cos_in) = facing.towards_viewer();
        Self::at(scene, material, facing, normal, cos_in)
    }

    /// That of a facet.
    fn at(scene: &Scene<'_>, material: &Material, facing: &Facing, normal: Vec3, cos_in: f32) -> Self {
        let inside = facing.material.saturating_add(1);
        let here = match facing.medium.checked_sub(1) {
            None => 1.0,
            Some(around) => scene.materials.get(usize::from(around)).map_or(1.0, index_of_refraction),
        };
        let (there, medium) = if facing.medium == inside { (1.0, 0) } else { (index_of_refraction(material), inside) };
        let eta = here / there;
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

fn mirrored(scene: &Scene<'_>, material: &Material, facing: &Facing, weight: [f32; 3], id: u64, cursor: u32) -> Child {
    if material.flags & Material::PHYSICAL != 0 {
        return glossy_mirrored(scene, material, facing, weight, id, cursor);
    }
    let share = if material.refracts() { Crossing::new(scene, material, facing).mirrored(material) } else { 0.0 };
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
        around: 0,
        branch: cursor.saturating_add(1),
    }
}

/// The choice among facets: a dimension that no light has.
const FACET: u32 = u32::MAX - 1;

/// A facet of the surface as the viewer sees it: the surface, the facet's normal and its cosine with the view, and the normal's.
fn facet(material: &Material, facing: &Facing, id: u64) -> (Glossy, Vec3, f32, f32) {
    let glossy = Glossy::new(material);
    let (normal, view) = facing.towards_viewer();
    let facet = glossy.facet(facing.incoming, normal, id::unit_pair(id, FACET));
    let cosine = -facet.dot(facing.incoming);
    let cosine = if cosine > GRAZING { if cosine < 1.0 { cosine } else { 1.0 } } else { GRAZING };
    (glossy, facet, cosine, view)
}

fn glossy_mirrored(
    scene: &Scene<'_>,
    material: &Material,
    facing: &Facing,
    weight: [f32; 3],
    id: u64,
    cursor: u32,
) -> Child {
    let (glossy, facet, cosine, view) = facet(material, facing, id);
    let (normal, _) = facing.towards_viewer();
    let direction = normalize(optics::mirror(facing.incoming, facet));
    let out = direction.dot(normal);
    if !(out > 0.0) {
        return Child::None;
    }
    let mut share = glossy.fresnel(cosine);
    if glossy.through != [0.0; 3] {
        // Of glass it is Fresnel's own, and more from inside.
        let boundary = Crossing::at(scene, material, facing, facet, cosine).boundary;
        let metal = material.mirror[0];
        share = channels(|c| share[c] * metal + boundary.reflectance * (1.0 - metal));
    }
    let passes = glossy.passes(view, out);
    let weight = channels(|c| weight[c] * share[c] * passes);
    if !carries(scene, weight) {
        return Child::None;
    }
    Child::Mirror {
        origin: offset_origin(facing.position, facing.error, facing.geometric, facing.geometric),
        direction: lift(direction, facing.geometric),
        weight,
        medium: facing.medium,
        around: seen_share(scene, &glossy, facing, direction),
        branch: cursor.saturating_add(1),
    }
}

fn glossy_refracted(
    scene: &Scene<'_>,
    material: &Material,
    facing: &Facing,
    weight: [f32; 3],
    id: u64,
    cursor: u32,
) -> Child {
    let (glossy, facet, cosine, view) = facet(material, facing, id);
    let Crossing { normal, cos_in, eta, boundary, medium } = Crossing::at(scene, material, facing, facet, cosine);
    if boundary.total {
        return Child::None;
    }
    let direction = normalize(optics::refract(facing.incoming, normal, eta, cos_in, boundary.cos_out));
    let out = -direction.dot(facing.towards_viewer().0);
    if !(out > 0.0) {
        return Child::None;
    }
    let passes = glossy.passes(view, out) * (1.0 - boundary.reflectance);
    let weight = channels(|c| weight[c] * glossy.through[c] * passes);
    if !carries(scene, weight) {
        return Child::None;
    }
    let beyond = -facing.geometric;
    Child::Refract {
        origin: offset_origin(facing.position, facing.error, beyond, beyond),
        direction: lift(direction, beyond),
        weight,
        medium,
        branch: cursor.saturating_add(1),
    }
}

/// The rest of a ray where not all of a surface is there.
fn straight_on(scene: &Scene<'_>, facing: &Facing, weight: [f32; 3], cursor: u32) -> Child {
    if !carries(scene, weight) {
        return Child::None;
    }
    let beyond = -facing.geometric;
    Child::Refract {
        origin: offset_origin(facing.position, facing.error, beyond, beyond),
        direction: facing.incoming,
        weight,
        medium: facing.medium,
        branch: cursor.saturating_add(1),
    }
}

fn refracted(scene: &Scene<'_>, material: &Material, facing: &Facing, weight: [f32; 3], id: u64, cursor: u32) -> Child {
    if material.flags & Material::PHYSICAL != 0 {
        return glossy_refracted(scene, material, facing, weight, id, cursor);
    }
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
