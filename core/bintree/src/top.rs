//! The directory: wide nodes above the pages.

use crate::collapse::{Binary, Forest, above, apiece, collapse};
use hybray_geometry::Aabb;
use hybray_scene::{Child, Node};

/// A node of the binary tree above the pages, in preorder: the first child of an inner node follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TopNode {
    /// The box of everything below.
    pub aabb: Aabb,
    /// Index of the second child; 0 if this is a page.
    pub second: u32,
    /// Number of the page.
    pub page: u32,
}

/// Makes [`TopNode`]s of a tree that is told in preorder, as [`crate::cut::pages`] tells it: each node above pages, then its
/// two children. For programs that can allocate.
#[cfg(feature = "alloc")]
#[derive(Clone, Debug, Default)]
pub struct Builder {
    nodes: alloc::vec::Vec<TopNode>,
    /// Nodes whose second child is still to come, the deepest last.
    open: alloc::vec::Vec<usize>,
    /// Whether the next node is a second child.
    closed: bool,
}

#[cfg(feature = "alloc")]
impl Builder {
    /// No nodes.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn push(&mut self, aabb: &Aabb, page: u32) {
        let here = self.nodes.len();
        if self.closed
            && let Some(parent) = self.open.pop()
        {
            self.nodes[parent].second = here as u32;
        }
        self.nodes.push(TopNode { aabb: *aabb, second: 0, page });
    }

    /// A node above pages.
    pub fn above(&mut self, aabb: &Aabb) {
        self.push(aabb, 0);
        self.open.push(self.nodes.len() - 1);
        self.closed = false;
    }

    /// A page.
    pub fn page(&mut self, aabb: &Aabb, page: u32) {
        self.push(aabb, page);
        self.closed = true;
    }

    /// All nodes.
    #[must_use]
    pub fn finish(self) -> alloc::vec::Vec<TopNode> {
        self.nodes
    }
}

/// Directory nodes that `pages` pages need at most.
#[must_use]
pub const fn nodes_for(pages: usize) -> usize {
    if pages == 0 { 0 } else { pages }
}

struct Top<'a> {
    nodes: &'a [TopNode],
    /// Their costs.
    forests: &'a [Forest],
}

impl Binary for Top<'_> {
    type Part = u32;
    fn aabb(&self, part: u32) -> Aabb {
        self.nodes[part as usize].aabb
    }
    fn children(&self, part: u32) -> Option<[u32; 2]> {
        let second = self.nodes[part as usize].second;
        (second != 0).then_some([part + 1, second])
    }
    fn forest(&self, part: u32) -> Forest {
        self.forests[part as usize]
    }
    fn leaf(&mut self, part: u32) -> Option<Child> {
        Some(Child::Page(self.nodes[part as usize].page))
    }
}

/// Collapses the tree above the pages into the directory's nodes; returns how many. `None` if `out` is shorter than
/// [`nodes_for`], `forests` (scratch) than `top`, or the tree deeper than any builder's.
pub fn directory(top: &[TopNode], forests: &mut [Forest], out: &mut [Node]) -> Option<usize> {
    let forests = forests.get_mut(..top.len())?;
    if top.is_empty() {
        return Some(0);
    }
    let apiece = apiece(top.iter().filter(|n| n.second == 0).map(|n| &n.aabb));
    for (here, node) in top.iter().enumerate().rev() {
        forests[here] = if node.second == 0 {
            Forest::LEAF
        } else {
            let below = [here + 1, node.second as usize].map(|child| (&top[child].aabb, &forests[child]));
            above(below, node.aabb.half_area() + apiece)
        };
    }
    collapse(&mut Top { nodes: top, forests }, 0, out).ok()
}
