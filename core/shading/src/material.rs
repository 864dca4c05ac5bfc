//! Materials: Whitted's model as OBJ/MTL and NFF can say it, and metallic-roughness as glTF does.

use bytemuck::{Pod, Zeroable};

/// How a highlight falls off around the mirror direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Highlight {
    /// No highlight.
    #[default]
    None = 0,
    /// `cos^n` of the angle between the mirrored view and the light (Phong; NFF).
    Phong = 1,
    /// `cos^n` of the angle between the normal and the half vector (Blinn; MTL).
    Blinn = 2,
}

/// A material as a node's table holds it. Colours are linear, 0 and up.
///
/// With [`Material::PHYSICAL`] it is one of metallic-roughness: `diffuse` is the base colour, `exponent` the roughness, `mirror` the
/// metalness (of which the first number counts), `transmission` the share of what is no metal that goes through, times the root of
/// the base colour (a body has two sides), and `ambient` the absorption inside: light that goes as far as a file unit keeps `exp(-ambient)` of itself. Its
/// diffuse part reflects ambient light, and `specular` and `highlight` are not used.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Material {
    /// Diffuse reflectance: what a light of unit irradiance at normal incidence shows.
    pub diffuse: [f32; 3],
    /// Reflectance of the scene's ambient light.
    pub ambient: [f32; 3],
    /// Radiance that the surface sends out by itself.
    pub emission: [f32; 3],
    /// Strength of the highlight of each light.
    pub specular: [f32; 3],
    /// Weight of the mirrored ray.
    pub mirror: [f32; 3],
    /// Weight of the refracted ray; also what a shadow ray keeps when it passes through.
    pub transmission: [f32; 3],
    /// Exponent of the highlight, 0 and up.
    pub exponent: f32,
    /// Index of refraction of the inside, more than 0.
    pub ior: f32,
    /// [`Highlight`] as a number.
    pub highlight: u32,
    /// [`Material::FRESNEL`] and the like.
    pub flags: u32,
}

const _: () = assert!(core::mem::size_of::<Material>() == 88);

impl Material {
    /// Mirror and refracted ray share the light by Fresnel's equations (dielectric): the mirrored ray gains what
    /// the refracted one loses.
    pub const FRESNEL: u32 = 1;
    /// Metallic-roughness, see above.
    pub const PHYSICAL: u32 = 2;
    /// It has [`Maps`](crate::Maps), or its triangles have colours.
    pub const DETAIL: u32 = 4;
    /// It is there where its coverage is at least its cutoff, and nowhere else.
    pub const CUTOUT: u32 = 8;
    /// As much of it is there as its coverage says; the rest of the light goes straight on. Not together with transmission.
    pub const BLEND: u32 = 16;
    /// Rays that look for their nearest hit pass it from behind.
    pub const SINGLE_SIDED: u32 = 32;
    /// Its normal map has the slopes of heights.
    pub const BUMP: u32 = 64;

    /// Matt grey of reflectance 0.75 (without highlight, mirror or transmission).
    pub const MATT: Self = Self {
        diffuse: [0.75; 3],
        ambient: [0.0; 3],
        emission: [0.0; 3],
        specular: [0.0; 3],
        mirror: [0.0; 3],
        transmission: [0.0; 3],
        exponent: 0.0,
        ior: 1.0,
        highlight: Highlight::None as u32,
        flags: 0,
    };

    /// What `highlight` stands for; a number that stands for nothing is none.
    #[must_use]
    pub const fn highlight(&self) -> Highlight {
        match self.highlight {
            1 => Highlight::Phong,
            2 => Highlight::Blinn,
            _ => Highlight::None,
        }
    }

    /// Whether light passes through, here or there.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.refracts() || self.flags & (Self::CUTOUT | Self::BLEND) != 0
    }

    /// Whether it spawns refracted rays.
    #[must_use]
    pub fn refracts(&self) -> bool {
        self.transmission.iter().any(|&c| c > 0.0)
    }

    /// Whether a ray that looks for its nearest hit may pass it.
    #[must_use]
    pub const fn may_be_passed(&self) -> bool {
        self.flags & (Self::CUTOUT | Self::SINGLE_SIDED) != 0
    }

    /// Whether it spawns mirrored rays.
    #[must_use]
    pub fn mirrors(&self) -> bool {
        self.mirror.iter().any(|&c| c > 0.0)
            || self.flags & Self::PHYSICAL != 0
            || (self.flags & Self::FRESNEL != 0 && self.refracts())
    }
}

impl Default for Material {
    fn default() -> Self {
        Self::MATT
    }
}
