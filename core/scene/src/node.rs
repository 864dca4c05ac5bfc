//! Wide nodes: eight boxes and where each leads.

use crate::primitives::Kind;
use bytemuck::{Pod, Zeroable};
use hybray_geometry::Aabb;

/// Children of a wide node.
pub const WIDTH: usize = 8;

/// Eight child boxes by axis, and eight references. Slots without a child have [`Aabb::UNUSED`] and come last.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Node {
    /// Least corners: `[axis][child]`.
    pub lo: [[f32; WIDTH]; 3],
    /// Greatest corners: `[axis][child]`.
    pub hi: [[f32; WIDTH]; 3],
    /// [`Child`]ren as numbers.
    pub child: [u32; WIDTH],
}

const _: () = assert!(core::mem::size_of::<Node>() == 224);

/// A side and an axis of a node's boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Row {
    /// Least x.
    LoX,
    /// Least y.
    LoY,
    /// Least z.
    LoZ,
    /// Greatest x.
    HiX,
    /// Greatest y.
    HiY,
    /// Greatest z.
    HiZ,
}

/// Where a child slot leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Another node of the same page, or of the directory: always a later one, so that no walk goes in circles.
    Inner(u32),
    /// Primitives of one kind: `count` blocks (triangles, spheres) or records (cones) from `start` on.
    Leaf {
        /// What they are.
        kind: Kind,
        /// First block or record.
        start: u32,
        /// How many, 1 to 16.
        count: u32,
    },
    /// A page, by its number (in the directory only).
    Page(u32),
    /// Nothing.
    Unused,
}

pub(crate) const TAG_LEAF: u32 = 1 << 30;
const TAG_PAGE: u32 = 2 << 30;
pub(crate) const TAG_UNUSED: u32 = 3 << 30;
pub(crate) const START_BITS: u32 = 24;

impl Child {
    /// Inner nodes and pages are numbered below this.
    pub const INDEX_MAX: u32 = TAG_LEAF;
    /// Most blocks or records of a leaf.
    pub const COUNT_MAX: u32 = 16;

    /// As a node holds it: two bits of tag, then an index, or kind (2), count less one (4) and start (24).
    #[must_use]
    #[inline]
    pub const fn pack(self) -> u32 {
        match self {
            Self::Inner(index) => index,
            Self::Leaf { kind, start, count } => {
                TAG_LEAF | (kind as u32) << (START_BITS + 4) | (count - 1) << START_BITS | start
            }
            Self::Page(page) => TAG_PAGE | page,
            Self::Unused => TAG_UNUSED,
        }
    }

    /// What a packed number means: the inverse of [`Child::pack`] for everything that validation lets through.
    #[must_use]
    #[inline(always)]
    pub const fn unpack(packed: u32) -> Self {
        match packed >> 30 {
            0 => Self::Inner(packed),
            1 => {
                let kind = match packed >> (START_BITS + 4) & 3 {
                    0 => Kind::Triangle,
                    1 => Kind::Sphere,
                    _ => Kind::Cone,
                };
                Self::Leaf { kind, start: packed & ((1 << START_BITS) - 1), count: (packed >> START_BITS & 15) + 1 }
            }
            2 => Self::Page(packed & (TAG_LEAF - 1)),
            _ => Self::Unused,
        }
    }
}

impl Node {
    /// A node without children.
    pub const EMPTY: Self = Self { lo: [[f32::MAX; WIDTH]; 3], hi: [[f32::MIN; WIDTH]; 3], child: [TAG_UNUSED; WIDTH] };

    /// Puts a child into `slot`.
    pub fn set(&mut self, slot: usize, aabb: &Aabb, child: Child) {
        let (lo, hi) = (aabb.lo.to_array(), aabb.hi.to_array());
        for axis in 0..3 {
            self.lo[axis][slot] = lo[axis];
            self.hi[axis][slot] = hi[axis];
        }
        self.child[slot] = child.pack();
    }

    /// All rows of eight: a side and an axis of the boxes each, by [`Row`]; the last one is the children.
    #[must_use]
    #[inline(always)]
    pub fn rows(&self) -> &[[f32; WIDTH]; 7] {
        bytemuck::cast_ref(self)
    }

    /// The box of `slot`.
    #[must_use]
    pub fn aabb(&self, slot: usize) -> Aabb {
        let corner = |c: &[[f32; WIDTH]; 3]| [c[0][slot], c[1][slot], c[2][slot]].into();
        Aabb { lo: corner(&self.lo), hi: corner(&self.hi) }
    }

    /// The children in use, with their slots.
    pub fn children(&self) -> impl Iterator<Item = (usize, Child)> + '_ {
        self.child
            .iter()
            .enumerate()
            .map(|(slot, &packed)| (slot, Child::unpack(packed)))
            .filter(|&(_, child)| child != Child::Unused)
    }

    /// The box around all children.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.children().fold(Aabb::EMPTY, |b, (slot, _)| b.union(&self.aabb(slot)))
    }
}
