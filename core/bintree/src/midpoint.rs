//! The 1995 report's tree: cells split in the middle, each axis in turn, until few objects are left or a depth is
//! reached (appendix A, section A.4). An object stands in every cell that its box overlaps.
//!
//! Overlap is of closed boxes, and cells share their planes, so that the nearest hit is that of brute force
//! (`docs/NUMERICS.md`): a hit's distance lies in the slab interval of its primitive's box, hence, axis by axis, in that
//! of one of the cells that the box overlaps.

use crate::BINARY_DEPTH_MAX;
use crate::binary::{BinaryNode, Item, Pending, bounds};
use hybray_geometry::{Aabb, Vec3};

/// The paper's limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Levels of splits at most: the paper has 18 for small models, 24 for large ones. At most 48.
    pub depth_max: u32,
    /// A cell with this many objects or fewer is not split: the paper has 12.
    pub objects_max: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { depth_max: 18, objects_max: 12 }
    }
}

/// A midpoint tree in borrowed room.
#[derive(Clone, Copy, Debug)]
pub struct Tree<'a> {
    /// Cells, the root first.
    pub nodes: &'a [BinaryNode],
    /// Objects leaf by leaf; one that several cells hold stands in each, with the part of its box in that cell.
    pub items: &'a [Item],
}

/// Where a cell is split.
#[must_use]
pub fn middle(lo: f32, hi: f32) -> f32 {
    0.5 * (lo + hi)
}

/// Builds a tree over the first `count` of `items`.
///
/// `items` is both input and scratch, and `leaves` receives the result: where either, or `nodes`, has no room for
/// another split, the cell stays a leaf with more objects than asked for, so that any room from `count` on will do.
/// Bounded by the room times the depth.
///
/// # Panics
/// If `items` or `leaves` is shorter than `count`, or `nodes` is empty.
pub fn build<'a>(
    items: &mut [Item],
    count: usize,
    leaves: &'a mut [Item],
    nodes: &'a mut [BinaryNode],
    settings: &Settings,
) -> Tree<'a> {
    if count == 0 {
        return Tree { nodes: &[], items: &[] };
    }
    let root = bounds(&items[..count]);
    let depth_max = settings.depth_max.min(48);
    let mut stack = [Pending::NONE; BINARY_DEPTH_MAX as usize + 1];
    let mut cells = [root; BINARY_DEPTH_MAX as usize + 1];
    stack[0] = Pending { first: 0, count: count as u32, depth: 0, parent: u32::MAX };
    let (mut waiting, mut used, mut done) = (1, 0, 0);
    // Objects of waiting cells stand on a stack in `items`, the next cell's on top.
    let mut top = count;
    while waiting > 0 {
        waiting -= 1;
        let part = stack[waiting];
        let cell = cells[waiting];
        let (from, n) = (part.first as usize, part.count as usize);
        debug_assert_eq!(from + n, top);
        if part.parent != u32::MAX && nodes[part.parent as usize].second == u32::MAX {
            nodes[part.parent as usize].second = used as u32;
        }
        let here = used;
        used += 1;
        nodes[here] = BinaryNode { aabb: cell, first: done as u32, count: part.count, second: 0 };

        let axis = longest_or_turn(&cell, part.depth);
        let plane = middle(cell.lo[axis], cell.hi[axis]);
        let strictly_inside = cell.lo[axis] < plane && plane < cell.hi[axis];
        let wanted = part.count > settings.objects_max && part.depth < depth_max && strictly_inside;
        if wanted {
            let range = &mut items[from..top];
            let above = three_ways(range, |item| (item.lo[axis] <= plane, item.hi[axis] >= plane));
            let (second_only, both) = above;
            let room = top + both <= items.len()
                && done + top + both <= leaves.len()
                && used + 2 * (waiting + 1) + 2 <= nodes.len();
            if room {
                // [second only | both | first only | both again]: the first child is on top.
                items.copy_within(from + second_only..from + second_only + both, top);
                top += both;
                let mut lower = cell;
                lower.hi[axis] = plane;
                let mut upper = cell;
                upper.lo[axis] = plane;
                nodes[here].second = u32::MAX;
                let second_count = second_only + both;
                stack[waiting] = Pending {
                    first: from as u32,
                    count: second_count as u32,
                    depth: part.depth + 1,
                    parent: here as u32,
                };
                cells[waiting] = upper;
                stack[waiting + 1] = Pending {
                    first: (from + second_count) as u32,
                    count: (top - from - second_count) as u32,
                    depth: part.depth + 1,
                    parent: u32::MAX,
                };
                cells[waiting + 1] = lower;
                waiting += 2;
                continue;
            }
        }
        for item in &items[from..top] {
            let inside = item.aabb().intersection(&cell);
            leaves[done] = Item { lo: inside.lo, hi: inside.hi, ..*item };
            done += 1;
        }
        leaves[done - n..done].sort_unstable_by_key(|item| (item.kind, item.id));
        top = from;
    }
    // Inner nodes cover what their leaves hold: from their own first item to the end of their last leaf.
    for i in (0..used).rev() {
        if nodes[i].second != 0 {
            let last = nodes[nodes[i].second as usize];
            nodes[i].count = last.first + last.count - nodes[i].first;
        }
    }
    Tree { nodes: &nodes[..used], items: &leaves[..done] }
}

/// Axes take turns, as in the paper; an axis along which the cell is flat is passed over.
fn longest_or_turn(cell: &Aabb, depth: u32) -> usize {
    let extent: Vec3 = cell.hi - cell.lo;
    (0..3).map(|i| (depth as usize + i) % 3).find(|&axis| extent[axis] > 0.0).unwrap_or(0)
}

/// Orders `items` as those in the second part only, those in both, those in the first part only; returns how many the
/// first two are.
fn three_ways(items: &mut [Item], parts: impl Fn(&Item) -> (bool, bool)) -> (usize, usize) {
    let (mut second, mut at, mut end) = (0, 0, items.len());
    while at < end {
        match parts(&items[at]) {
            (false, _) => {
                items.swap(second, at);
                second += 1;
                at += 1;
            }
            (true, true) => at += 1,
            (true, false) => {
                end -= 1;
                items.swap(at, end);
            }
        }
    }
    (second, end - second)
}

/// Replaces cells by the boxes around what their leaves hold: what wide nodes are made from.
pub fn tighten(nodes: &mut [BinaryNode], items: &[Item]) {
    for i in (0..nodes.len()).rev() {
        let node = nodes[i];
        nodes[i].aabb = if node.is_leaf() {
            bounds(&items[node.first as usize..][..node.count as usize])
        } else {
            nodes[i + 1].aabb.union(&nodes[node.second as usize].aabb)
        };
    }
}
