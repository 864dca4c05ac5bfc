//! What the clipping asks of a tree.

use hybray_geometry::Aabb;

/// A binary tree of boxes, each cut in two by a plane across one axis.
///
/// For [`crate::traverse`] to be exact, an object must be stored in every leaf whose closed box its own closed `f32`
/// box overlaps, and the root's box must contain the boxes of all objects.
pub trait Bintree {
    /// Names a cell: an index, an offset, a reference.
    type Cell: Copy;

    /// The root and its box: finite, and not empty on any axis.
    fn root(&self) -> (Self::Cell, Aabb);

    /// How `cell` is cut; `None` for a leaf.
    fn split(&self, cell: Self::Cell) -> Option<Split<Self::Cell>>;

    /// Whether a leaf has no objects, and so may be left out of the cliplist. Asked of leaves alone.
    fn is_empty(&self, cell: Self::Cell) -> bool;
}

/// The plane that cuts a cell, and its halves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split<C> {
    /// 0, 1 or 2 for x, y or z.
    pub axis: usize,
    /// Coordinate of the plane, strictly between the cell's own. At [`midpoint`], distances are averaged down; anywhere
    /// else they are computed anew.
    pub plane: f32,
    /// The half below the plane.
    pub lower: C,
    /// The half above it.
    pub upper: C,
}

/// `0.5 * (lo + hi)`: the coordinate, to the bit, at which a split counts as a midpoint.
///
/// Of the formulas in use this is the one whose only rounding is that of a sum, whose error is itself an `f32` that can
/// be computed. Coordinates are below 2^126, so that it does not overflow.
#[must_use]
#[inline]
pub fn midpoint(lo: f32, hi: f32) -> f32 {
    0.5 * (lo + hi)
}
