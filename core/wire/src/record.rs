//! Ray records: what a ray is when it waits or travels. Little-endian, no pointers, no padding.

use bytemuck::{Pod, Zeroable};
use hybray_geometry::{Candidate, Ray, Vec3};

/// What a ray is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum RayKind {
    /// From the camera.
    Primary = 0,
    /// Mirrored.
    Mirror = 1,
    /// Refracted.
    Refract = 2,
    /// Towards a light.
    Shadow = 3,
}

/// A nearest-hit ray: 88 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayRecord {
    /// Where it starts, internal units.
    pub origin: [f32; 3],
    /// Unit vector.
    pub direction: [f32; 3],
    /// Start of the interval.
    pub t_min: f32,
    /// End of the interval: the distance of the best hit so far.
    pub t_max: f32,
    /// Names the ray in the ledger, and seeds its random choices.
    pub id: u64,
    /// Best hit so far: its primitive, or [`Candidate::NOTHING`].
    pub primitive: u32,
    /// The page that holds it.
    pub hit_page: u32,
    /// What it adds to the film is multiplied by this.
    pub weight: [f32; 3],
    /// `y * width + x`.
    pub pixel: u32,
    /// Number of the tile.
    pub tile: u32,
    /// The page that it needs next.
    pub page: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// Sample of the pixel.
    pub sample: u16,
    /// Place of the best hit in its page.
    pub slot: u16,
    /// What it travels in: 0 outside, else a material's number plus 1.
    pub medium: u16,
    /// [`RayKind`] as a number.
    pub kind: u8,
    /// 1 for primary rays.
    pub depth: u8,
    /// Zero.
    pub reserved: u16,
    /// Radius of its footprint at the origin.
    pub footprint: f32,
}

/// A shadow ray: 64 bytes. It starts outside all error bounds, so its interval starts at 0.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ShadowRecord {
    /// Where it starts, internal units.
    pub origin: [f32; 3],
    /// Towards the light: the whole way, not of unit length, for lights at a place.
    pub direction: [f32; 3],
    /// End of the interval, just before the light.
    pub t_max: f32,
    /// `y * width + x`.
    pub pixel: u32,
    /// Names the ray in the ledger.
    pub id: u64,
    /// What it adds to the film if nothing is in the way.
    pub contribution: [f32; 3],
    /// Number of the tile.
    pub tile: u32,
    /// The page that it needs next. Its tile's epoch goes with the frame.
    pub page: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// Depth of the hit that sent it.
    pub depth: u8,
    /// Zero.
    pub reserved: u8,
}

const _: () = assert!(size_of::<RayRecord>() == 88 && align_of::<RayRecord>() == 8);
const _: () = assert!(size_of::<ShadowRecord>() == 64 && align_of::<ShadowRecord>() == 8);

impl RayRecord {
    /// The ray, up to its best hit.
    #[must_use]
    pub fn ray(&self) -> Ray {
        Ray {
            origin: Vec3::from_array(self.origin),
            direction: Vec3::from_array(self.direction),
            t_min: self.t_min,
            t_max: self.t_max,
        }
    }

    /// The best hit so far.
    #[must_use]
    pub fn candidate(&self) -> Candidate {
        Candidate { t: self.t_max, id: self.primitive }
    }
}

impl ShadowRecord {
    /// The ray.
    #[must_use]
    pub fn ray(&self) -> Ray {
        Ray {
            origin: Vec3::from_array(self.origin),
            direction: Vec3::from_array(self.direction),
            t_min: 0.0,
            t_max: self.t_max,
        }
    }
}
