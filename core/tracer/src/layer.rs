//! Layers: pictures of the same view that show not light but what is seen first, for compositors and denoisers.
//!
//! A layer's primary rays are those of the picture, sample by sample. Where one hits, what the layer shows is added to the
//! pixel in place of light, and the ray ends. Films add what is not negative, so a layer's values are brought there and
//! brought back by who reads the film.

use hybray_geometry::Vec3;
use hybray_shading::{Material, Surface};

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Layer {
    /// Light: the picture itself.
    #[default]
    Light = 0,
    /// What of the light from everywhere comes back from the surface, 0 to 1 a channel: its diffuse, mirrored and refracted
    /// share. 0 where nothing is hit.
    Albedo = 1,
    /// (n + 1) / 2 of the unit normal n that is shaded with, on the side of the viewer. 1/2 where nothing is hit.
    Normal = 2,
    /// Distance from the eye, internal units, in red; 1 in green where something is hit.
    Depth = 3,
    /// Number of the material plus 1 in red. 0 where nothing is hit.
    Id = 4,
}

impl Layer {
    /// The layer whose number (`as u8`) this is.
    #[must_use]
    pub const fn from_u8(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::Light),
            1 => Some(Self::Albedo),
            2 => Some(Self::Normal),
            3 => Some(Self::Depth),
            4 => Some(Self::Id),
            _ => None,
        }
    }

    /// What is added where a ray hits nothing.
    #[must_use]
    pub fn of_nothing(self) -> [f32; 3] {
        if self == Self::Normal { [0.5; 3] } else { [0.0; 3] }
    }

    /// What is added where a ray hits `surface`, whose material is as textures show it there.
    #[must_use]
    pub fn of(self, surface: &Surface, material: Option<&Material>, eye: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Light => [0.0; 3],
            Self::Albedo => material.map_or([0.0; 3], albedo),
            Self::Normal => ((normal(surface) + Vec3::ONE) * 0.5).to_array(),
            Self::Depth => [distance(surface.position, eye.into()), 1.0, 0.0],
            Self::Id => [f32::from(surface.material) + 1.0, 0.0, 0.0],
        }
    }
}

/// In double precision: a square of small coordinates may vanish.
fn distance(a: Vec3, b: Vec3) -> f32 {
    let way = a.to_array().into_iter().zip(b.to_array()).map(|(a, b)| f64::from(a) - f64::from(b));
    libm::sqrt(way.map(|x| x * x).sum()) as f32
}

/// Diffuse, mirrored and refracted share, at most 1: what Open Image Denoise's documentation asks for, where mirrors and glass
/// are white. Of metallic-roughness materials it is the base colour.
fn albedo(material: &Material) -> [f32; 3] {
    let is_physical = material.flags & Material::PHYSICAL != 0;
    core::array::from_fn(|c| {
        let more = if is_physical { 0.0 } else { material.mirror[c] + material.transmission[c] };
        let sum = material.diffuse[c] + more;
        if sum < 1.0 { sum } else { 1.0 }
    })
}

/// The shading normal, on the side of the surface that the viewer sees.
fn normal(surface: &Surface) -> Vec3 {
    let Surface { geometric_normal: geometric, shading_normal: shading, incoming, .. } = *surface;
    let seen = if geometric.dot(incoming) > 0.0 { -geometric } else { geometric };
    if shading.dot(seen) < 0.0 { -shading } else { shading }
}
