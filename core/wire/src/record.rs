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

/// A ray that waits or travels: 88 bytes.
///
/// A shadow ray is one too while it waits, with what it would add to the film for its weight; where nothing lets light
/// through it travels as a [`ShadowRecord`].
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayRecord {
    /// Where it starts, internal units.
    pub origin: [f32; 3],
    /// Unit vector; of a shadow ray, the whole way to a light at a place.
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
    /// Of a shadow ray that looks for what lets light through: its end, just before the light. Of others, where there are textures,
    /// what a pixel sees of the scene ([`RayRecord::footprint`]).
    pub t_end: f32,
    /// Number of the tile.
    pub tile: u32,
    /// The page that it needs next; [`RayRecord::FROM_ROOT`] before it has met any.
    pub page: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// The node that keeps the tile's sums.
    pub home: u16,
    /// Place of the best hit in its page.
    pub slot: u16,
    /// What it travels in: 0 outside, else a material's number plus 1. Of a shadow ray, where there are textures, the upper half of
    /// its footprint's width.
    pub medium: u16,
    /// Surfaces that it has passed.
    pub passed: u8,
    /// How much it shows of what is all around, where it hits nothing: 0 for all of it, else two to the power of minus so many
    /// eighths. The rest was brought by shadow rays.
    pub around: u8,
    /// Number of the pixel in its tile, row by row.
    pub pixel: u8,
    /// [`RayKind`] as a number.
    pub kind: u8,
    /// 1 for primary rays; of a shadow ray, that of the hit that sent it.
    pub depth: u8,
    /// 1: the best hit is the nearest, and `page` is where it is to be shaded. Else 0.
    pub settled: u8,
    /// 1: it was given to a node that had nothing to do, and goes on there. Else 0.
    pub moved: u8,
    /// Times that it was taken up since its hit is known, and a page of texels was missing.
    pub tries: u8,
}

/// A shadow ray that anything ends: 64 bytes. It starts outside all error bounds, so its interval starts at 0.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ShadowRecord {
    /// Where it starts, internal units.
    pub origin: [f32; 3],
    /// Towards the light: the whole way, not of unit length, for lights at a place.
    pub direction: [f32; 3],
    /// End of the interval, just before the light.
    pub t_max: f32,
    /// The node that keeps the tile's sums.
    pub home: u16,
    /// Number of the pixel in its tile, row by row.
    pub pixel: u8,
    /// Depth of the hit that sent it.
    pub depth: u8,
    /// Names the ray in the ledger.
    pub id: u64,
    /// What it adds to the film if nothing is in the way.
    pub contribution: [f32; 3],
    /// Number of the tile.
    pub tile: u32,
    /// The page that it needs next.
    pub page: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// 1: it was given to a node that had nothing to do, and goes on there. Else 0.
    pub moved: u8,
    /// Zero.
    pub reserved: u8,
}

/// What rays added to one pixel of a tile whose sums are at another node: 40 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Partial {
    /// Red, green and blue, steps of the film.
    pub sums: [u64; 3],
    /// Sum of the ledger entries of rays that ended.
    pub entry: u64,
    /// Number of the tile.
    pub tile: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// Number of the pixel in its tile, row by row.
    pub pixel: u8,
    /// Zero.
    pub reserved: u8,
}

const _: () = assert!(size_of::<RayRecord>() == 88 && align_of::<RayRecord>() == 8);
const _: () = assert!(size_of::<ShadowRecord>() == 64 && align_of::<ShadowRecord>() == 8);
const _: () = assert!(size_of::<Partial>() == 40 && align_of::<Partial>() == 8);

impl RayRecord {
    /// The page of a ray that has met none.
    pub const FROM_ROOT: u32 = u32::MAX;

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

    /// What it is for; a number that is none of them counts as a shadow ray.
    #[must_use]
    pub const fn ray_kind(&self) -> RayKind {
        match self.kind {
            0 => RayKind::Primary,
            1 => RayKind::Mirror,
            2 => RayKind::Refract,
            _ => RayKind::Shadow,
        }
    }

    /// Half the width of what it stands for, internal units: where it starts, and what is added with each unit of its way. To
    /// within 1/256 of themselves.
    #[must_use]
    pub const fn footprint(&self) -> [f32; 2] {
        let bits = self.t_end.to_bits();
        [f32::from_bits(bits & 0xffff_0000), f32::from_bits(bits << 16)]
    }

    /// What [`RayRecord::footprint`] is kept as, in [`RayRecord::t_end`]: the upper halves of both. What is negative or no number is
    /// 0.
    #[must_use]
    pub fn packed_footprint(footprint: [f32; 2]) -> f32 {
        // Half a step up, and cut off; large ones stop at the largest number.
        let half = |x: f32| if x > 0.0 { (if x < 3.0e38 { x } else { 3.0e38 }).to_bits() + 0x8000 } else { 0 };
        f32::from_bits(half(footprint[0]) & 0xffff_0000 | half(footprint[1]) >> 16)
    }

    /// The best hit so far.
    #[must_use]
    pub fn candidate(&self) -> Candidate {
        Candidate { t: self.t_max, id: self.primitive }
    }
}

impl From<&RayRecord> for ShadowRecord {
    fn from(ray: &RayRecord) -> Self {
        Self {
            origin: ray.origin,
            direction: ray.direction,
            t_max: ray.t_max,
            home: ray.home,
            pixel: ray.pixel,
            depth: ray.depth,
            id: ray.id,
            contribution: ray.weight,
            tile: ray.tile,
            page: ray.page,
            epoch: ray.epoch,
            moved: ray.moved,
            reserved: 0,
        }
    }
}

impl From<&ShadowRecord> for RayRecord {
    fn from(shadow: &ShadowRecord) -> Self {
        Self {
            origin: shadow.origin,
            direction: shadow.direction,
            t_max: shadow.t_max,
            home: shadow.home,
            pixel: shadow.pixel,
            depth: shadow.depth,
            id: shadow.id,
            weight: shadow.contribution,
            tile: shadow.tile,
            page: shadow.page,
            epoch: shadow.epoch,
            moved: shadow.moved,
            primitive: Candidate::NOTHING,
            kind: RayKind::Shadow as u8,
            ..Self::zeroed()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::offset_of;

    /// The tables of docs/WIRE.md.
    #[test]
    fn fields_stand_where_the_specification_has_them() {
        macro_rules! at {
            ($record:ident: $($field:ident $offset:literal),*) => {
                $(assert_eq!(offset_of!($record, $field), $offset, stringify!($record, $field));)*
            };
        }
        at!(RayRecord: origin 0, direction 12, t_min 24, t_max 28, id 32, primitive 40, hit_page 44, weight 48, t_end 60,
            tile 64, page 68, epoch 72, home 74, slot 76, medium 78, passed 80, around 81, pixel 82, kind 83, depth 84, settled 85,
            moved 86, tries 87);
        at!(ShadowRecord: origin 0, direction 12, t_max 24, home 28, pixel 30, depth 31, id 32, contribution 40, tile 52,
            page 56, epoch 60, moved 62, reserved 63);
        at!(Partial: sums 0, entry 24, tile 32, epoch 36, pixel 38, reserved 39);
    }

    #[test]
    fn footprints_keep_eight_bits() {
        for i in 0..20_000u32 {
            let number = |seed: u32| from_bits(i.wrapping_mul(2_654_435_761).wrapping_add(seed));
            let footprint = [number(1), number(2)];
            let packed = RayRecord::packed_footprint(footprint);
            assert!(packed.is_finite());
            let found = RayRecord { t_end: packed, ..RayRecord::zeroed() }.footprint();
            for (found, wanted) in found.into_iter().zip(footprint) {
                assert!((found - wanted).abs() <= wanted / 256.0, "{found} {wanted}");
            }
        }
        for odd in [-1.0, f32::NAN] {
            assert_eq!(RayRecord::packed_footprint([odd, odd]), 0.0);
        }
        assert!(RayRecord::packed_footprint([f32::INFINITY, f32::INFINITY]).is_finite());
    }

    /// A positive normal number from bits.
    fn from_bits(bits: u32) -> f32 {
        f32::from_bits(0x0100_0000 + bits % 0x7c00_0000)
    }

    /// What a short record leaves out is what every shadow ray has alike where nothing lets light through.
    #[test]
    fn shadow_rays_come_back_from_their_short_record() {
        let short = ShadowRecord {
            origin: [1.0, 2.0, 3.0],
            direction: [4.0, 5.0, 6.0],
            t_max: 0.75,
            home: 7,
            pixel: 8,
            depth: 9,
            id: 10,
            contribution: [11.0, 12.0, 13.0],
            tile: 14,
            page: 15,
            epoch: 16,
            moved: 1,
            reserved: 0,
        };
        let ray = RayRecord::from(&short);
        assert_eq!(ShadowRecord::from(&ray), short);
        assert_eq!((ray.ray_kind(), ray.primitive, ray.t_min), (RayKind::Shadow, Candidate::NOTHING, 0.0));
        assert_eq!((ray.settled, ray.passed, ray.medium, ray.moved, ray.tries), (0, 0, 0, 1, 0));
        assert_eq!((ray.weight, ray.t_max, ray.page), (short.contribution, 0.75, 15));
    }
}
