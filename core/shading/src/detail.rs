//! What textures and colours make of a material at a hit.

use crate::environment::Environment;
use crate::material::Material;
use crate::spawn::Scene;
use crate::surface::Surface;
use crate::texture::SRGB;
use crate::vector::normalize;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use hybray_scene::Pages;

/// A texture as a material uses it: 32 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Map {
    /// Index of the texture.
    pub texture: u32,
    /// From the hit's texture coordinates to the texture's: `u' = t[0] u + t[1] v + t[2]`, `v' = t[3] u + t[4] v + t[5]`.
    pub transform: [f32; 6],
    /// Of a normal map, times its slopes; with [`Material::BUMP`], the height of white over black, file units.
    pub strength: f32,
}

/// What a material takes from textures: 16 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Maps {
    /// Indices of [`Map`]s, [`Maps::NONE`] for none: [`Maps::BASE`], [`Maps::SURFACE`], [`Maps::NORMAL`], [`Maps::EMISSION`].
    pub maps: [u16; 4],
    /// Coverage, times that of the base map and of colours.
    pub coverage: f32,
    /// With [`Material::CUTOUT`], coverage from which on the surface is there.
    pub cutoff: f32,
}

impl Maps {
    /// No map.
    pub const NONE: u16 = u16::MAX;
    /// Times the diffuse colour; its fourth channel is coverage.
    pub const BASE: usize = 0;
    /// With [`Material::PHYSICAL`], green times the roughness and blue times the metalness (glTF); else times the highlight's colour.
    pub const SURFACE: usize = 1;
    /// Normals around the surface's own; with [`Material::BUMP`], slopes of heights.
    pub const NORMAL: usize = 2;
    /// Times the emission.
    pub const EMISSION: usize = 3;
    /// Nothing.
    pub const EMPTY: Self = Self { maps: [Self::NONE; 4], coverage: 1.0, cutoff: 0.5 };

    /// Maps that it has.
    #[must_use]
    pub fn count(&self) -> usize {
        self.maps.iter().filter(|&&map| map != Self::NONE).count()
    }
}

/// What a hit tells of textures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Texture coordinates.
    pub uv: [f32; 2],
    /// What is seen at once, in units of texture coordinates.
    pub footprint: f32,
    /// How the place moves with each texture coordinate; zero where that is not known.
    pub along: [Vec3; 2],
    /// Colour, linear, and coverage.
    pub colour: [f32; 4],
}

impl Detail {
    /// The colour at `barycentrics` of a triangle.
    #[must_use]
    pub fn colour(corners: &[[u8; 4]; 3], barycentrics: [f32; 3]) -> [f32; 4] {
        let corners = corners.map(|[r, g, b, a]| {
            [SRGB[usize::from(r)], SRGB[usize::from(g)], SRGB[usize::from(b)], f32::from(a) / 255.0]
        });
        let [a, b, c] = barycentrics;
        core::array::from_fn(|i| (corners[0][i] * a + corners[1][i] * b + corners[2][i] * c).clamp(0.0, 1.0))
    }
}

/// What of it a hit keeps for the rays that it spawns: 12 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// Times the diffuse colour, in steps of 1/65535.
    base: [u16; 3],
    /// Coverage, in the same steps.
    coverage: u16,
    /// Values of [`Maps::SURFACE`], in steps of 1/255.
    surface: [u8; 4],
}

impl Look {
    /// That of a material without textures.
    pub const PLAIN: Self = Self { base: [u16::MAX; 3], coverage: u16::MAX, surface: [u8::MAX; 4] };

    /// How much of the surface is there.
    #[must_use]
    pub fn coverage(&self) -> f32 {
        f32::from(self.coverage) / 65_535.0
    }

    /// `material` as it is at the hit.
    #[must_use]
    pub fn of(&self, material: &Material) -> Material {
        let base = self.base.map(|c| f32::from(c) / 65_535.0);
        let [r, g, b, _] = self.surface.map(|c| f32::from(c) / 255.0);
        let times = |colour: [f32; 3], by: [f32; 3]| [colour[0] * by[0], colour[1] * by[1], colour[2] * by[2]];
        let shown = Material { diffuse: times(material.diffuse, base), ..*material };
        if material.flags & Material::PHYSICAL != 0 {
            Material { exponent: material.exponent * g, mirror: material.mirror.map(|metal| metal * b), ..shown }
        } else {
            Material { ambient: times(material.ambient, base), specular: times(material.specular, [r, g, b]), ..shown }
        }
    }
}

/// What textures say at a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// For the rays that it spawns.
    pub look: Look,
    /// Times the material's emission.
    pub emission: [f32; 3],
    /// The normal to shade with.
    pub shading_normal: Vec3,
}

/// How much of the surface of `material` is there at a hit.
///
/// # Errors
/// The page that it needs, if that is not at hand.
pub fn coverage<P: Pages + ?Sized>(
    scene: &Scene<'_>,
    pages: &P,
    material: u16,
    detail: &Detail,
    count: &mut u64,
) -> Result<f32, u32> {
    let maps = scene.maps.of(material);
    let base = scene.maps.look_up(pages, maps, Maps::BASE, detail, count)?;
    Ok(maps.coverage * detail.colour[3] * base[3])
}

/// Looks everything up that a hit on `surface` needs.
///
/// # Errors
/// The first page that it needs and that is not at hand.
pub fn seen<P: Pages + ?Sized>(
    scene: &Scene<'_>,
    pages: &P,
    surface: &Surface,
    detail: &Detail,
    count: &mut u64,
) -> Result<Seen, u32> {
    let maps = scene.maps.of(surface.material);
    let mut look_up = |which| scene.maps.look_up(pages, maps, which, detail, count);
    let base = look_up(Maps::BASE)?;
    let around = look_up(Maps::SURFACE)?;
    let emission = look_up(Maps::EMISSION)?;
    let steps =
        |value: f32, most: f32| if value > 0.0 { if value < 1.0 { value * most + 0.5 } else { most } } else { 0.0 };
    let colour = detail.colour;
    let look = Look {
        base: [0, 1, 2].map(|c| steps(base[c] * colour[c], 65_535.0) as u16),
        coverage: steps(maps.coverage * base[3] * colour[3], 65_535.0) as u16,
        surface: around.map(|c| steps(c, 255.0) as u8),
    };
    let shading_normal = match scene.maps.map(maps, Maps::NORMAL) {
        None => surface.shading_normal,
        Some(map) => {
            let value = look_up(Maps::NORMAL)?;
            let bump =
                scene.materials.get(usize::from(surface.material)).is_some_and(|m| m.flags & Material::BUMP != 0);
            let normal =
                if bump { bumped(scene, map, surface, detail, value) } else { mapped(map, surface, detail, value) };
            normal.unwrap_or(surface.shading_normal)
        }
    };
    let [r, g, b, _] = emission;
    Ok(Seen { look, emission: [r, g, b], shading_normal })
}

/// A normal map's normal: x along u, y against v, which runs down, z along the surface's own. `None` where it has none.
fn mapped(map: &Map, surface: &Surface, detail: &Detail, value: [f32; 4]) -> Option<Vec3> {
    let [x, y, z, _] = value.map(|c| c * 2.0 - 1.0);
    let normal = surface.shading_normal;
    let [u, v] = detail.along;
    let tangent = u - normal * normal.dot(u);
    let side = if normal.cross(tangent).dot(v) > 0.0 { -1.0 } else { 1.0 };
    let tangent = unit(tangent)?;
    let up = normal.cross(tangent) * side;
    unit(tangent * (x * map.strength) + up * (y * map.strength) + normal * z)
}

/// The normal of a surface that is raised by a bump map. Source: Blinn, *Simulation of Wrinkled Surfaces*, SIGGRAPH 1978, with
/// the height's gradient along the surface.
fn bumped(scene: &Scene<'_>, map: &Map, surface: &Surface, detail: &Detail, value: [f32; 4]) -> Option<Vec3> {
    let texture = scene.maps.textures.get(map.texture as usize)?;
    // Heights rise by so much from one texel to the next.
    let [across, down, ..] = value.map(|c| (c * 255.0 - 128.0) / 254.0);
    let height = map.strength / scene.distance_scale;
    let (s, t) = (across * f32::from(texture.width) * height, down * f32::from(texture.height) * height);
    let [a, b, _, c, d, _] = map.transform;
    let (by_u, by_v) = (s * a + t * c, s * b + t * d);
    let normal = surface.shading_normal;
    let [u, v] = detail.along;
    let volume = normal.dot(u.cross(v));
    if !(volume != 0.0) {
        return None;
    }
    unit(normal - (v.cross(normal) * by_u + normal.cross(u) * by_v) / volume)
}

fn unit(v: Vec3) -> Option<Vec3> {
    let square = v.dot(v);
    (square > 1e-30 && square.is_finite()).then(|| normalize(v))
}

/// Textures and how materials use them, as a node's tables hold them: all empty for a scene without.
#[derive(Clone, Copy, Debug, Default)]
pub struct MapTables<'a> {
    /// By material; empty if no material has [`Material::DETAIL`].
    pub maps: &'a [Maps],
    /// Uses of textures.
    pub uses: &'a [Map],
    /// Textures.
    pub textures: &'a [crate::Texture],
    /// What is around the scene.
    pub environment: Environment<'a>,
}

impl<'a> MapTables<'a> {
    pub(crate) fn of(&self, material: u16) -> &'a Maps {
        self.maps.get(usize::from(material)).unwrap_or(&Maps::EMPTY)
    }

    fn map(&self, maps: &Maps, which: usize) -> Option<&'a Map> {
        self.uses.get(usize::from(maps.maps[which]))
    }

    /// Ones where there is no such map.
    fn look_up<P: Pages + ?Sized>(
        &self,
        pages: &P,
        maps: &Maps,
        which: usize,
        detail: &Detail,
        count: &mut u64,
    ) -> Result<[f32; 4], u32> {
        let use_of = |map: &'a Map| Some((map, self.textures.get(map.texture as usize)?));
        let Some((map, texture)) = self.map(maps, which).and_then(use_of) else { return Ok([1.0; 4]) };
        let ([u, v], [a, b, c, d, e, f]) = (detail.uv, map.transform);
        let scale = libm::sqrtf((a * e - b * d).abs());
        texture.look_up(pages, [a * u + b * v + c, d * u + e * v + f], detail.footprint * scale, count)
    }

    /// Texel pages that one hit, or one ray that hits nothing, needs at most.
    #[must_use]
    pub fn pages_of_a_hit(&self) -> usize {
        let of_a_material = self.maps.iter().map(Maps::count).max().unwrap_or(0);
        2 * of_a_material.max(usize::from(self.environment.is_there()))
    }

    /// Whether each says only what can be, with so many pages.
    #[must_use]
    pub fn are_sound(&self, materials: usize, pages: u32) -> bool {
        let finite = |map: &Map| map.strength.is_finite() && map.transform.iter().all(|t| t.is_finite());
        (self.maps.is_empty() || self.maps.len() == materials)
            && self.maps.iter().flat_map(|m| m.maps).all(|m| m == Maps::NONE || usize::from(m) < self.uses.len())
            && self.maps.iter().all(|m| (0.0..=1.0).contains(&m.coverage) && m.cutoff.is_finite())
            && self.uses.iter().all(|map| (map.texture as usize) < self.textures.len() && finite(map))
            && self.textures.iter().all(|texture| texture.is_sound(pages))
            && self.environment.is_sound(self.textures.len())
    }
}
