//! From two children to eight: the wide nodes of a page or of the directory.

use crate::BINARY_DEPTH_MAX;
use hybray_geometry::Aabb;
use hybray_scene::{Child, DEPTH_MAX, Node, WIDTH};

/// A binary tree to be collapsed.
pub(crate) trait Binary {
    /// A subtree.
    type Part: Copy;
    /// Its box; [`Aabb::EMPTY`] to leave it out.
    fn aabb(&self, part: Self::Part) -> Aabb;
    /// Its children, if it has any.
    fn children(&self, part: Self::Part) -> Option<[Self::Part; 2]>;
    /// Puts a part without children where it belongs, and says where that is; `None` if there is no room.
    fn leaf(&mut self, part: Self::Part) -> Option<Child>;
}

/// Why a tree does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Full;

/// Collapses `root` into wide nodes in `out`, parents first; returns how many. Bounded by the size of the tree.
///
/// Both children of a part are opened before any other, so that a wide level takes at least two binary ones; the
/// slots left over open the largest boxes.
pub(crate) fn collapse<T: Binary>(tree: &mut T, root: T::Part, out: &mut [Node]) -> Result<usize, Full> {
    let mut used = 0;
    // Depth first: at most seven siblings wait on each level.
    let mut stack = [(root, u32::MAX, 0u32); DEPTH_MAX * (WIDTH - 1) + 1];
    let mut waiting = 1;
    while waiting > 0 {
        waiting -= 1;
        let (part, parent, slot) = stack[waiting];
        let here = used;
        *out.get_mut(here).ok_or(Full)? = Node::EMPTY;
        used += 1;
        if parent != u32::MAX {
            out[parent as usize].child[slot as usize] = Child::Inner(here as u32).pack();
        }
        let mut slots = [part; WIDTH];
        let count = open(tree, part, &mut slots);
        for (slot, &part) in slots[..count].iter().enumerate() {
            let inner = tree.children(part).is_some();
            let child = if inner { Child::Inner(0) } else { tree.leaf(part).ok_or(Full)? };
            out[here].set(slot, &tree.aabb(part), child);
        }
        for (slot, &part) in slots[..count].iter().enumerate().rev() {
            if tree.children(part).is_some() {
                *stack.get_mut(waiting).ok_or(Full)? = (part, here as u32, slot as u32);
                waiting += 1;
            }
        }
    }
    Ok(used)
}

/// Fills up to eight slots with parts below `root`; returns how many.
fn open<T: Binary>(tree: &T, root: T::Part, slots: &mut [T::Part; WIDTH]) -> usize {
    let mut count = 0;
    let mut push = |slots: &mut [T::Part; WIDTH], part| {
        if !tree.aabb(part).is_empty() {
            slots[count] = part;
            count += 1;
        }
    };
    for half in tree.children(root).map_or([Some(root), None], |c| c.map(Some)).into_iter().flatten() {
        match tree.children(half) {
            // The root itself, if it is a leaf, must not be opened again.
            Some(quarters) if tree.children(root).is_some() => quarters.into_iter().for_each(|q| push(slots, q)),
            _ => push(slots, half),
        }
    }
    while count < WIDTH {
        let area = |slot: &usize| tree.aabb(slots[*slot]).half_area();
        let widest = (0..count)
            .filter(|&slot| tree.children(slots[slot]).is_some())
            .reduce(|a, b| if area(&b) > area(&a) { b } else { a });
        let Some(widest) = widest else { break };
        let Some([first, second]) = tree.children(slots[widest]) else { break };
        match (tree.aabb(first).is_empty(), tree.aabb(second).is_empty()) {
            (true, _) => slots[widest] = second,
            (_, true) => slots[widest] = first,
            _ => {
                // Keeps the order of the tree, and with it that of the leaves.
                slots.copy_within(widest + 1..count, widest + 2);
                slots[widest] = first;
                slots[widest + 1] = second;
                count += 1;
            }
        }
    }
    count
}

const _: () = assert!(BINARY_DEPTH_MAX as usize / 2 < DEPTH_MAX);
