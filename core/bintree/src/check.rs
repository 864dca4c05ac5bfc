//! Proves that a tree is what the walk needs, or says what is wrong with it.

use crate::walk::Resident;
use hybray_geometry::Aabb;
use hybray_scene::{BLOCK, Child, CompactNode, Form, Kind, Node, PAGE_BYTES_MAX, PageForm, PageView};

/// What a whole tree holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Wide nodes, those of the directory included.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Primitive slots: more than primitives, where leaves do not fill their blocks, or several leaves hold one.
    pub slots: u64,
    /// Bytes of all pages.
    pub bytes: u64,
}

/// What is wrong with a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A child's box is not inside its parent's.
    #[error("page {page:?}, node {node}: the box of child {slot} is not around what is below it")]
    Box {
        /// `None` in the directory.
        page: Option<u32>,
        /// Index of the node.
        node: usize,
        /// Which of its children.
        slot: usize,
    },
    /// A page that the directory does not lead to exactly once.
    #[error("page {page} is led to {times} times")]
    Page {
        /// Its number.
        page: u32,
        /// How often it is found.
        times: u32,
    },
    /// A primitive that no leaf's boxes hold together.
    #[error("primitive {id} is not held by the leaves' boxes, or not at all")]
    Primitive {
        /// Its id.
        id: u32,
    },
    /// The scratch for the check is too short.
    #[error("the check needs scratch for {needed} pages and primitives")]
    Scratch {
        /// Entries needed.
        needed: usize,
    },
}

/// Checks `scene` whole: each child's box contains what is below it; the directory leads to each page once; each of the
/// `primitives` ids below `found.len()` stands in some leaf, and the leaves that hold it cover its own box (volume by
/// volume, since spatial splits share a primitive out over cells). `found` is scratch, one `f64` pair an id.
///
/// # Errors
/// The first [`Fault`].
pub fn check(scene: &Resident<'_>, found: &mut [Coverage], seen: &mut [u32]) -> Result<Census, Fault> {
    if seen.len() < scene.pages.len() {
        return Err(Fault::Scratch { needed: scene.pages.len() });
    }
    found.fill(Coverage::NONE);
    seen.fill(0);
    let mut census = Census { nodes: scene.directory.nodes.len() as u64, ..Census::default() };
    for (index, node) in scene.directory.nodes.iter().enumerate() {
        for (slot, child) in node.children() {
            let inside = match child {
                Child::Inner(next) => scene.directory.nodes[next as usize].bounds(),
                Child::Page(page) => {
                    let view = scene.pages.get(page as usize).ok_or(Fault::Page { page, times: 0 })?;
                    seen[page as usize] += 1;
                    match view.body.form() {
                        PageForm::Full => view.body.node(0, &mut { Node::EMPTY }).bounds(),
                        PageForm::Compact => Aabb { lo: view.header.lo.into(), hi: view.header.hi.into() },
                    }
                }
                Child::Leaf { .. } | Child::Unused => Aabb::EMPTY,
            };
            if !node.aabb(slot).contains(&inside) {
                return Err(Fault::Box { page: None, node: index, slot });
            }
        }
    }
    for (page, view) in scene.pages.iter().enumerate() {
        if seen[page] != 1 {
            return Err(Fault::Page { page: page as u32, times: seen[page] });
        }
        check_page(page as u32, view, found, &mut census)?;
    }
    match found.iter().position(|c| !c.whole()) {
        Some(id) => Err(Fault::Primitive { id: id as u32 }),
        None => Ok(census),
    }
}

fn check_page(page: u32, view: &PageView<'_>, found: &mut [Coverage], census: &mut Census) -> Result<(), Fault> {
    census.nodes += view.body.nodes().len() as u64;
    census.bytes += u64::from(view.header.bytes);
    let compact = view.body.form() == PageForm::Compact;
    // A compact node's boxes are larger than what they were made of, and may reach out of their parent's: what counts is what
    // all boxes on the way to a leaf have in common.
    let mut common = [Aabb { lo: view.header.lo.into(), hi: view.header.hi.into() }; NODES_MAX];
    let mut room = Node::EMPTY;
    for (index, node) in view.body.nodes().enumerate() {
        for (slot, child) in node.children() {
            let own = node.aabb(slot);
            let aabb = if compact { own.intersection(&common[index]) } else { own };
            let fault = Fault::Box { page: Some(page), node: index, slot };
            match child {
                Child::Inner(next) => {
                    common[next as usize] = aabb;
                    if !compact && !own.contains(&view.body.node(next as usize, &mut room).bounds()) {
                        return Err(fault);
                    }
                }
                Child::Leaf { kind, start, count } => {
                    census.leaves += 1;
                    for (id, own) in leaf_primitives(view, kind, start as usize, count as usize) {
                        census.slots += 1;
                        if !aabb.overlaps(&own) {
                            return Err(fault);
                        }
                        if let Some(coverage) = found.get_mut(id as usize) {
                            coverage.add(&own, &own.intersection(&aabb), (page, index, slot));
                        }
                    }
                }
                Child::Page(_) | Child::Unused => {}
            }
        }
    }
    Ok(())
}

/// Nodes of a page at most.
const NODES_MAX: usize = PAGE_BYTES_MAX / size_of::<CompactNode>();

/// The primitives of a leaf with their ids and boxes.
pub fn leaf_primitives<'a>(
    view: &'a PageView<'a>,
    kind: Kind,
    start: usize,
    count: usize,
) -> impl Iterator<Item = (u32, Aabb)> + 'a {
    let lanes = if kind == Kind::Cone { 1 } else { BLOCK };
    (start * lanes..(start + count) * lanes).map(move |i| match kind {
        Kind::Triangle => (view.body.triangle_id(i), view.body.triangle(i).aabb()),
        Kind::Sphere => {
            let block = &view.spheres[i / BLOCK];
            (block.id[i % BLOCK], block.get(i % BLOCK).aabb())
        }
        Kind::Cone => (view.cones[i].id, view.cones[i].get().aabb()),
    })
}

/// How much of a primitive's box its leaves hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Some leaf holds the whole box.
    whole: bool,
    /// Size of the box, and of the parts in disjoint leaves: volume, or area, or length of a flat one.
    size: f64,
    held: f64,
    last: (u32, usize, usize),
}

impl Coverage {
    /// Nothing found yet.
    pub const NONE: Self = Self { whole: false, size: 0.0, held: 0.0, last: (u32::MAX, 0, 0) };

    fn add(&mut self, own: &Aabb, part: &Aabb, leaf: (u32, usize, usize)) {
        // Padding repeats a primitive within its leaf.
        if self.last == leaf {
            return;
        }
        self.last = leaf;
        self.whole |= part == own;
        let flat = |i: usize| own.hi[i] == own.lo[i];
        let size = |b: &Aabb| -> f64 {
            (0..3).filter(|&i| !flat(i)).map(|i| f64::from(b.hi[i]) - f64::from(b.lo[i])).product()
        };
        self.size = size(own);
        self.held += size(part);
    }

    fn whole(&self) -> bool {
        self.whole || (self.last.0 != u32::MAX && self.held >= self.size * (1.0 - 1e-6))
    }
}
