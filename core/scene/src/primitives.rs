//! Primitives as a page holds them.

use bytemuck::{Pod, Zeroable};
use hybray_geometry::{Cone, Sphere, Triangle, Vec3};

/// Primitives of a block, side by side for the lanes. The last ones of a leaf that does not fill its block repeat the
/// one before: to test a primitive twice is harmless, and needs no mask.
pub const BLOCK: usize = 4;

/// What a leaf holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Kind {
    /// [`TriangleBlock`]s.
    Triangle = 0,
    /// [`SphereBlock`]s.
    Sphere = 1,
    /// [`ConeRecord`]s.
    Cone = 2,
}

/// Four triangles: 160 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct TriangleBlock {
    /// `[vertex][axis][lane]`.
    pub v: [[[f32; BLOCK]; 3]; 3],
    /// Global primitive ids.
    pub id: [u32; BLOCK],
}

/// Four spheres: 80 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct SphereBlock {
    /// `[axis][lane]`.
    pub centre: [[f32; BLOCK]; 3],
    /// Radii.
    pub radius: [f32; BLOCK],
    /// Global primitive ids.
    pub id: [u32; BLOCK],
}

/// One cone: 36 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ConeRecord {
    /// Centre of the first circle.
    pub base: [f32; 3],
    /// Its radius.
    pub base_radius: f32,
    /// Centre of the second circle.
    pub apex: [f32; 3],
    /// Its radius.
    pub apex_radius: f32,
    /// Global primitive id.
    pub id: u32,
}

const _: () = assert!(core::mem::size_of::<TriangleBlock>() == 160);
const _: () = assert!(core::mem::size_of::<SphereBlock>() == 80);
const _: () = assert!(core::mem::size_of::<ConeRecord>() == 36);

impl TriangleBlock {
    /// What is there before triangles are.
    pub const EMPTY: Self = Self { v: [[[0.0; BLOCK]; 3]; 3], id: [0; BLOCK] };

    /// The triangle in `lane`.
    #[must_use]
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Triangle {
        Triangle { v: self.v.map(|p| Vec3::new(p[0][lane], p[1][lane], p[2][lane])) }
    }

    /// Puts a triangle into `lane`.
    pub fn set(&mut self, lane: usize, triangle: &Triangle, id: u32) {
        for (to, from) in self.v.iter_mut().zip(&triangle.v) {
            for (axis, x) in from.to_array().into_iter().enumerate() {
                to[axis][lane] = x;
            }
        }
        self.id[lane] = id;
    }
}

impl SphereBlock {
    /// The sphere in `lane`.
    #[must_use]
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Sphere {
        let c = &self.centre;
        Sphere { centre: Vec3::new(c[0][lane], c[1][lane], c[2][lane]), radius: self.radius[lane] }
    }

    /// Puts a sphere into `lane`.
    pub fn set(&mut self, lane: usize, sphere: &Sphere, id: u32) {
        for (axis, x) in sphere.centre.to_array().into_iter().enumerate() {
            self.centre[axis][lane] = x;
        }
        self.radius[lane] = sphere.radius;
        self.id[lane] = id;
    }
}

impl ConeRecord {
    /// As a page holds it.
    #[must_use]
    pub fn new(cone: &Cone, id: u32) -> Self {
        Self {
            base: cone.base.to_array(),
            base_radius: cone.base_radius,
            apex: cone.apex.to_array(),
            apex_radius: cone.apex_radius,
            id,
        }
    }

    /// The cone.
    #[must_use]
    pub fn get(&self) -> Cone {
        Cone {
            base: self.base.into(),
            base_radius: self.base_radius,
            apex: self.apex.into(),
            apex_radius: self.apex_radius,
        }
    }
}

/// A primitive's place in its page: two bits of kind, then its number (a block's number times four, plus the lane).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Slot(pub u16);

impl Slot {
    /// The slot of primitive `number` among those of `kind`. A page of 64 KiB has fewer than 2^14 of any kind.
    #[must_use]
    #[inline(always)]
    pub const fn new(kind: Kind, number: usize) -> Self {
        Self((kind as u16) << 14 | number as u16 & 0x3fff)
    }

    /// What is there.
    #[must_use]
    pub const fn kind(self) -> Kind {
        match self.0 >> 14 {
            0 => Kind::Triangle,
            1 => Kind::Sphere,
            _ => Kind::Cone,
        }
    }

    /// Its number among those of its kind.
    #[must_use]
    pub const fn number(self) -> usize {
        (self.0 & 0x3fff) as usize
    }
}
