//! Items and binary nodes: what builders work on.

use hybray_geometry::{Aabb, Vec3};
use hybray_scene::Kind;

/// A primitive as a builder sees it: 32 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// Least corner of its box.
    pub lo: Vec3,
    /// The caller's number for it.
    pub id: u32,
    /// Greatest corner of its box.
    pub hi: Vec3,
    /// What it is: leaves hold one kind.
    pub kind: Kind,
}

const _: () = assert!(core::mem::size_of::<Item>() == 32);

impl Item {
    /// An item; the box must be finite and not empty.
    #[must_use]
    pub fn new(aabb: &Aabb, kind: Kind, id: u32) -> Self {
        Self { lo: aabb.lo, id, hi: aabb.hi, kind }
    }

    /// Its box.
    #[must_use]
    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb { lo: self.lo, hi: self.hi }
    }
}

/// The box around `items`.
#[must_use]
pub fn bounds(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.aabb()))
}

/// A node of a binary tree in preorder: the first child of an inner node follows it. 36 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinaryNode {
    /// By surface area: the box around its items. By midpoint: its cell.
    pub aabb: Aabb,
    /// First of its items. Those of its subtree stand together until it is reinserted: then only a leaf's do.
    pub first: u32,
    /// How many.
    pub count: u32,
    /// Index of the second child; 0 for a leaf.
    pub second: u32,
}

impl BinaryNode {
    /// What fills unused room.
    pub const EMPTY: Self = Self { aabb: Aabb::EMPTY, first: 0, count: 0, second: 0 };

    /// Whether it has no children.
    #[must_use]
    pub const fn is_leaf(&self) -> bool {
        self.second == 0
    }
}

/// A part of the tree that a builder has yet to do: a range of items, and the node whose second child it will be.
#[derive(Clone, Copy)]
pub(crate) struct Pending {
    pub first: u32,
    pub count: u32,
    pub depth: u32,
    /// Node to patch; `u32::MAX` if none.
    pub parent: u32,
}

impl Pending {
    pub const NONE: Self = Self { first: 0, count: 0, depth: 0, parent: u32::MAX };
}
