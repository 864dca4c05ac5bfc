//! From two children to eight: the wide nodes of a page or of the directory.
//!
//! Which parts become a node's children is chosen by cost (Ylitie, Karras and Laine, *Efficient incoherent ray traversal
//! on GPUs through compressed wide BVHs*, 2017, section 3.1): from the leaves up, the least cost of each subtree as one to
//! seven children of a wide node; from the root down, the parts that make it.

use crate::BINARY_DEPTH_MAX;
use hybray_geometry::Aabb;
use hybray_scene::{Child, DEPTH_MAX, Node, WIDTH};

/// What a subtree costs as children of a wide node: scratch, 32 bytes for each node of a binary tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forest {
    /// As one child: a leaf, or a wide node of its own.
    one: f32,
    /// As 2 to 7 children at most.
    more: [f32; WIDTH - 2],
    /// Children that it must be at least where it must be opened: 1 for a leaf, else 2.
    least: u32,
}

impl Forest {
    /// What fills unused room.
    pub const EMPTY: Self = Self::LEAF;

    /// A leaf: however the tree is collapsed, the same leaves are there, so that they need not be counted.
    pub(crate) const LEAF: Self = Self { one: 0.0, more: [0.0; WIDTH - 2], least: 1 };

    /// Several leaves, or a wide node above them that costs `node`.
    pub(crate) const fn leaves(node: f32) -> Self {
        Self { one: node, more: [0.0; WIDTH - 2], least: 2 }
    }

    /// Two parts below a wide node that costs `node`, or side by side.
    pub(crate) fn inner(parts: [&Self; 2], node: f32) -> Self {
        let more = core::array::from_fn(|i| Self::shared(parts, i + 2, [1; 2]).1);
        let (_, opened) = Self::shared(parts, WIDTH, parts.map(|part| part.least as usize));
        Self { one: node + opened, more, least: 2 }
    }

    /// How many of `slots` slots the first of two parts gets, each at least so many, and what both cost then. A part that
    /// gets two slots or more because it must be opened is opened.
    fn shared([a, b]: [&Self; 2], slots: usize, least: [usize; 2]) -> (usize, f32) {
        let mut best = (least[0], f32::INFINITY);
        for first in least[0]..=slots - least[1] {
            let sum = a.cost(first, least[0]) + b.cost(slots - first, least[1]);
            if sum < best.1 {
                best = (first, sum);
            }
        }
        best
    }

    fn cost(&self, slots: usize, least: usize) -> f32 {
        match (slots, least) {
            (1, _) => self.one,
            (_, 1) => self.one.min(self.more[slots - 2]),
            _ => self.more[slots - 2],
        }
    }
}

/// A binary tree to be collapsed.
pub(crate) trait Binary {
    /// A subtree.
    type Part: Copy;
    /// Its box; [`Aabb::EMPTY`] to leave it out.
    fn aabb(&self, part: Self::Part) -> Aabb;
    /// Its children, if it has any.
    fn children(&self, part: Self::Part) -> Option<[Self::Part; 2]>;
    /// What it costs.
    fn forest(&self, part: Self::Part) -> Forest;
    /// Puts a part without children where it belongs, and says where that is; `None` if there is no room.
    fn leaf(&mut self, part: Self::Part) -> Option<Child>;
}

/// What a wide node costs beside the area of its box, which is how likely a ray meets it: bytes. Twice the mean area of
/// the leaves' boxes costs next to no speed, and saves up to one node in five.
pub(crate) fn apiece<'a>(leaves: impl Iterator<Item = &'a Aabb>) -> f32 {
    let held = leaves.filter(|aabb| !aabb.is_empty());
    let (sum, count) = held.fold((0.0, 0.0), |(sum, count), aabb| (sum + aabb.half_area(), count + 1.0));
    if count > 0.0 { 2.0 * sum / count } else { 0.0 }
}

/// The cost of a part with a wide node of its own at `node` above these children, of which one may be empty.
pub(crate) fn above(children: [(&Aabb, &Forest); 2], node: f32) -> Forest {
    match children.map(|(aabb, _)| aabb.is_empty()) {
        [false, false] => Forest::inner(children.map(|(_, forest)| forest), node),
        [first_empty, _] => *children[usize::from(first_empty)].1,
    }
}

/// Why a tree does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Full;

/// Collapses `root` into wide nodes in `out`, parents first; returns how many. Bounded by the size of the tree.
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
        let mut slots = [Slot { part, slots: WIDTH, least: 2 }; WIDTH];
        let count = open(tree, &mut slots);
        for (slot, &Slot { part, .. }) in slots[..count].iter().enumerate() {
            let inner = tree.children(part).is_some();
            let child = if inner { Child::Inner(0) } else { tree.leaf(part).ok_or(Full)? };
            out[here].set(slot, &tree.aabb(part), child);
        }
        for (slot, &Slot { part, .. }) in slots[..count].iter().enumerate().rev() {
            if tree.children(part).is_some() {
                *stack.get_mut(waiting).ok_or(Full)? = (part, here as u32, slot as u32);
                waiting += 1;
            }
        }
    }
    Ok(used)
}

/// A part below a wide node, and how many slots it may take. It is opened where they are `least` or more, or where that
/// costs less.
#[derive(Clone, Copy)]
struct Slot<P> {
    part: P,
    slots: usize,
    least: usize,
}

/// Opens the root in the first slot: both children of it are opened before any other part, so that a wide level takes at
/// least two binary ones. Keeps the order of the tree, and with it that of the leaves. Returns how many slots it took.
fn open<T: Binary>(tree: &T, slots: &mut [Slot<T::Part>; WIDTH]) -> usize {
    let (mut count, mut at) = (1, 0);
    while at < count {
        let slot = slots[at];
        let forest = tree.forest(slot.part);
        let opens = slot.slots >= 2 && (slot.least >= 2 || forest.more[slot.slots - 2] < forest.one);
        let Some(parts) = opens.then(|| tree.children(slot.part)).flatten() else {
            at += 1;
            continue;
        };
        let empty = parts.map(|part| tree.aabb(part).is_empty());
        if empty[0] || empty[1] {
            slots[at].part = parts[usize::from(empty[0])];
            continue;
        }
        let forests = parts.map(|part| tree.forest(part));
        let root = slot.slots == WIDTH;
        let least = forests.map(|forest| if root { forest.least as usize } else { 1 });
        let (first, _) = Forest::shared([&forests[0], &forests[1]], slot.slots, least);
        slots.copy_within(at + 1..count, at + 2);
        slots[at] = Slot { part: parts[0], slots: first, least: least[0] };
        slots[at + 1] = Slot { part: parts[1], slots: slot.slots - first, least: least[1] };
        count += 1;
    }
    count
}

const _: () = assert!(BINARY_DEPTH_MAX as usize / 2 < DEPTH_MAX);
