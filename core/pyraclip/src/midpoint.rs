//! The midpoint tree of `hybray-bintree` as appendix A clips it.

use crate::{Bintree, Split};
use hybray_bintree::midpoint::Tree;
use hybray_geometry::Aabb;

/// Cells are indices of the tree's nodes; a leaf's objects are the items from its node's `first` on.
impl Bintree for Tree<'_> {
    type Cell = u32;

    fn root(&self) -> (u32, Aabb) {
        (
            0,
            self.nodes
                .first()
                .map_or(Aabb { lo: hybray_geometry::Vec3::ZERO, hi: hybray_geometry::Vec3::ZERO }, |n| n.aabb),
        )
    }

    fn split(&self, cell: u32) -> Option<Split<u32>> {
        let node = self.nodes.get(cell as usize).filter(|n| !n.is_leaf())?;
        let lower = &self.nodes[cell as usize + 1].aabb;
        // The lower half ends at the plane, and elsewhere where its cell ends.
        let axis = (0..3).find(|&axis| lower.hi[axis] != node.aabb.hi[axis])?;
        Some(Split { axis, plane: lower.hi[axis], lower: cell + 1, upper: node.second })
    }

    fn is_empty(&self, cell: u32) -> bool {
        self.nodes.get(cell as usize).is_none_or(|n| n.count == 0)
    }
}
