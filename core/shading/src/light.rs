//! Lights: point, directional, spot, sphere, rectangle, and what is all around.

use bytemuck::{Pod, Zeroable};

/// What shape a light has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum LightKind {
    /// A point at `position`.
    #[default]
    Point = 0,
    /// Parallel light travelling along `axis`, from infinitely far.
    Directional = 1,
    /// A point that shines around `axis` between `cos_outer` (dark) and `cos_inner` (full).
    Spot = 2,
    /// A sphere of `radius` around `position`.
    Sphere = 3,
    /// The rectangle `position + s u + t v`, `s` and `t` in 0..=1, that shines to the side of `u x v`.
    Rectangle = 4,
    /// The cells of the scene's [`Environment`](crate::Environment), infinitely far.
    Environment = 5,
}

/// A light as a node's table holds it.
///
/// `colour` is what a white, perfectly diffuse surface facing the light shows: irradiance over pi. With
/// [`Light::FALLOFF`] it is that value at distance 1 (in the file's units) and falls with the distance squared;
/// without, it is the same at every distance, as NFF has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Light {
    /// Position, centre or corner. Not used by a directional light.
    pub position: [f32; 3],
    /// Radius of a sphere light.
    pub radius: f32,
    /// Unit vector along which a directional light or the middle of a spot shines.
    pub axis: [f32; 3],
    /// Cosine of the angle from `axis` up to which a spot has its full strength.
    pub cos_inner: f32,
    /// First edge of a rectangle.
    pub u: [f32; 3],
    /// Cosine of the angle from `axis` beyond which a spot is dark; not above `cos_inner`.
    pub cos_outer: f32,
    /// Second edge of a rectangle.
    pub v: [f32; 3],
    /// [`LightKind`] as a number.
    pub kind: u32,
    /// Linear colour times strength, see above.
    pub colour: [f32; 3],
    /// Shadow rays sent to a sphere, a rectangle or the environment for each hit, at least 1. Ignored by the other kinds.
    pub samples: u16,
    /// [`Light::FALLOFF`].
    pub flags: u16,
}

const _: () = assert!(core::mem::size_of::<Light>() == 80);

impl Light {
    /// Strength falls with the square of the distance.
    pub const FALLOFF: u16 = 1;

    /// What `kind` stands for; a number that stands for nothing is a point.
    #[must_use]
    pub const fn kind(&self) -> LightKind {
        match self.kind {
            1 => LightKind::Directional,
            2 => LightKind::Spot,
            3 => LightKind::Sphere,
            4 => LightKind::Rectangle,
            5 => LightKind::Environment,
            _ => LightKind::Point,
        }
    }

    /// Shadow rays that one hit sends to this light.
    #[must_use]
    pub fn shadow_rays(&self) -> u32 {
        match self.kind() {
            LightKind::Point | LightKind::Directional | LightKind::Spot => 1,
            LightKind::Sphere | LightKind::Rectangle | LightKind::Environment => u32::from(self.samples.max(1)),
        }
    }
}
