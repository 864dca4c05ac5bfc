//! The two forms of a page's nodes and triangles: full, read as they lie, and compact, decoded a node and a block at a time.
//!
//! A compact node has its boxes in steps of a power of two from their least corner, eight bits each (Ylitie, Karras and Laine,
//! *Efficient incoherent ray traversal on GPUs through compressed wide BVHs*, 2017, section 3.2), rounded outwards. Compact
//! triangles share their vertices, which are those of the full form to the bit: so are the hits.

use crate::node::{START_BITS, TAG_LEAF, TAG_UNUSED};
use crate::{BLOCK, Child, Kind, Node, TriangleBlock, WIDTH};
use bytemuck::{Pod, Zeroable};
use hybray_geometry::simd::Simd;
use hybray_geometry::{Triangle, Vec3};

/// Which form a page has. Its hits do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PageForm {
    /// Boxes and triangles as the walk wants them.
    #[default]
    Full,
    /// Boxes of eight bits a side, and shared vertices.
    Compact,
}

/// How a page's nodes and triangles are read, whatever its form. `room` is where they are put if they do not lie as they are
/// wanted.
pub trait Form<'a> {
    /// A node.
    fn node<'n>(&self, index: usize, room: &'n mut Node) -> &'n Node
    where
        'a: 'n;
    /// A block of triangles.
    fn triangles<'n>(&self, index: usize, room: &'n mut TriangleBlock) -> &'n TriangleBlock
    where
        'a: 'n;
    /// Says that a node or a leaf's triangles will be wanted soon.
    fn fetch<S: Simd>(&self, simd: S, child: Child);
}

/// Says that the node, or the triangles, that `child` tells of will be wanted soon.
#[inline(always)]
fn fetch<S: Simd, N, T>(simd: S, child: Child, nodes: &[N], triangles: &[T]) {
    match child {
        Child::Inner(index) => simd.fetch(&nodes[index as usize]),
        Child::Leaf { kind: Kind::Triangle, start, count } => {
            for block in &triangles[start as usize..][..count as usize] {
                simd.fetch(block);
            }
        }
        Child::Leaf { .. } | Child::Page(_) | Child::Unused => {}
    }
}

/// The full form.
#[derive(Clone, Copy, Debug)]
pub struct Full<'a> {
    /// The root first; children after their parents.
    pub nodes: &'a [Node],
    /// Triangles.
    pub triangles: &'a [TriangleBlock],
    /// Packed vertex normals of each triangle lane; or empty.
    pub normals: &'a [[u32; 3]],
}

/// The compact form.
#[derive(Clone, Copy, Debug)]
pub struct Compact<'a> {
    /// The root first; children after their parents.
    pub nodes: &'a [CompactNode],
    /// Triangles, by their vertices.
    pub triangles: &'a [CompactTriangles],
    /// The vertices of all triangles, each once.
    pub vertices: &'a [[f32; 3]],
    /// The packed normal of each vertex; or empty.
    pub normals: &'a [u32],
}

impl<'a> Form<'a> for Full<'a> {
    #[inline(always)]
    fn node<'n>(&self, index: usize, _: &'n mut Node) -> &'n Node
    where
        'a: 'n,
    {
        &self.nodes[index]
    }

    #[inline(always)]
    fn triangles<'n>(&self, index: usize, _: &'n mut TriangleBlock) -> &'n TriangleBlock
    where
        'a: 'n,
    {
        &self.triangles[index]
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, simd: S, child: Child) {
        fetch(simd, child, self.nodes, self.triangles);
    }
}

impl<'a> Form<'a> for Compact<'a> {
    #[inline(always)]
    fn node<'n>(&self, index: usize, room: &'n mut Node) -> &'n Node
    where
        'a: 'n,
    {
        self.nodes[index].decode(room);
        room
    }

    #[inline(always)]
    fn triangles<'n>(&self, index: usize, room: &'n mut TriangleBlock) -> &'n TriangleBlock
    where
        'a: 'n,
    {
        let block = &self.triangles[index];
        room.id = block.id;
        for (to, from) in room.v.iter_mut().zip(&block.v) {
            // Whole rows at once: what is stored by the number is slow to load four at a time.
            let lanes = from.map(|number| self.vertices[usize::from(number)]);
            for axis in 0..3 {
                to[axis] = lanes.map(|vertex| vertex[axis]);
            }
        }
        room
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, simd: S, child: Child) {
        fetch(simd, child, self.nodes, self.triangles);
    }
}

/// Eight child boxes in steps from their least corner, and eight references: 80 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct CompactNode {
    /// The least corner of all children.
    pub origin: [f32; 3],
    /// The step of each axis: the exponent of an `f32`, biased. 0 is no step at all.
    pub step: [u8; 3],
    /// Zero.
    pub reserved: u8,
    /// Least corners in steps: `[axis][child]`.
    pub lo: [[u8; WIDTH]; 3],
    /// Greatest corners in steps: `[axis][child]`.
    pub hi: [[u8; WIDTH]; 3],
    /// Children: two bits of kind, then an inner node's index (14), or a leaf's count less one (2) and start (12).
    /// 0 is none.
    pub child: [u16; WIDTH],
}

const _: () = assert!(size_of::<CompactNode>() == 80);

/// Four triangles by their vertices' numbers: 40 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CompactTriangles {
    /// Global primitive ids.
    pub id: [u32; BLOCK],
    /// `[vertex][lane]`.
    pub v: [[u16; BLOCK]; 3],
}

const _: () = assert!(size_of::<CompactTriangles>() == 40);

const COMPACT_START_BITS: u32 = 12;
const COMPACT_INDEX_BITS: u32 = 14;

/// `origin` and so many steps: what builder and reader agree upon. The product is exact, the sum is rounded.
#[inline(always)]
fn corner(origin: f32, step: f32, steps: u8) -> f32 {
    origin + f32::from(steps) * step
}

/// A step by its exponent.
#[inline(always)]
const fn step(exponent: u8) -> f32 {
    f32::from_bits((exponent as u32) << 23)
}

/// A side of a box as steps, on one axis: at most `lo`, or at least `hi`.
#[derive(Clone, Copy)]
struct Axis {
    origin: f32,
    step: f32,
}

impl Axis {
    /// Steps, before rounding outwards.
    fn steps(self, x: f32) -> u8 {
        // A cast cuts off, and keeps within what the type holds.
        ((f64::from(x) - f64::from(self.origin)) / f64::from(self.step)) as u8
    }

    fn below(self, lo: f32) -> Option<u8> {
        (0..=self.steps(lo)).rev().find(|&steps| corner(self.origin, self.step, steps) <= lo)
    }

    fn above(self, hi: f32) -> Option<u8> {
        let holds = |&steps: &u8| (hi..f32::INFINITY).contains(&corner(self.origin, self.step, steps));
        (self.steps(hi)..=u8::MAX).find(holds)
    }
}

impl CompactNode {
    /// The node with boxes around those of `node`; `None` if there are none, or if it leads where this form cannot.
    #[must_use]
    pub fn new(node: &Node) -> Option<Self> {
        let mut compact = Self { lo: [[u8::MAX; WIDTH]; 3], step: [1; 3], ..Zeroable::zeroed() };
        for (slot, child) in node.children() {
            compact.child[slot] = pack(child)?;
        }
        if compact.child == [0; WIDTH] {
            return Some(compact);
        }
        let bounds = node.bounds();
        for axis in 0..3 {
            let (origin, end) = (bounds.lo[axis], bounds.hi[axis]);
            let least = ((f64::from(end) - f64::from(origin)) / 255.0) as f32;
            // From the power of two below, which is the one wanted if the extent is 255 of its steps.
            let least = (least.to_bits() >> 23 & 0xff) as u8;
            let exponent =
                (least.max(1)..=254).find(|&exponent| Axis { origin, step: step(exponent) }.above(end).is_some())?;
            let by = Axis { origin, step: step(exponent) };
            (compact.origin[axis], compact.step[axis]) = (origin, exponent);
            for (slot, _) in node.children() {
                compact.lo[axis][slot] = by.below(node.lo[axis][slot])?;
                compact.hi[axis][slot] = by.above(node.hi[axis][slot])?;
            }
        }
        Some(compact)
    }

    /// The node as the full form has it, its boxes somewhat larger.
    #[inline(always)]
    pub fn decode(&self, room: &mut Node) {
        for axis in 0..3 {
            let (origin, step) = (self.origin[axis], step(self.step[axis]));
            for slot in 0..WIDTH {
                room.lo[axis][slot] = corner(origin, step, self.lo[axis][slot]);
                room.hi[axis][slot] = corner(origin, step, self.hi[axis][slot]);
            }
        }
        room.child = self.child.map(unpack);
    }
}

/// A child as a compact node holds it, if it can.
fn pack(child: Child) -> Option<u16> {
    let packed = match child {
        Child::Unused => 0,
        Child::Inner(index) if index > 0 && index < 1 << COMPACT_INDEX_BITS => index,
        Child::Leaf { kind, start, count } if count <= 4 && start < 1 << COMPACT_START_BITS => {
            (kind as u32 + 1) << COMPACT_INDEX_BITS | (count - 1) << COMPACT_START_BITS | start
        }
        Child::Inner(_) | Child::Leaf { .. } | Child::Page(_) => return None,
    };
    Some(packed as u16)
}

/// What [`pack`] packed, as [`Child::pack`] would have. Without branches, for eight at once.
#[inline(always)]
const fn unpack(packed: u16) -> u32 {
    let packed = packed as u32;
    let kind = (packed >> COMPACT_INDEX_BITS).wrapping_sub(1) & 3;
    let count = packed >> COMPACT_START_BITS & 3;
    let start = packed & ((1 << COMPACT_START_BITS) - 1);
    let leaf = TAG_LEAF | kind << (START_BITS + 4) | count << START_BITS | start;
    let inner = if packed == 0 { TAG_UNUSED } else { packed };
    if packed >> COMPACT_INDEX_BITS == 0 { inner } else { leaf }
}

impl CompactNode {
    /// The children, each as [`Child::pack`] has it.
    #[must_use]
    pub fn packed_children(&self) -> [u32; WIDTH] {
        self.child.map(unpack)
    }
}

impl Compact<'_> {
    /// The vertices' numbers of the triangle in a lane.
    #[inline(always)]
    fn corners(&self, number: usize) -> [usize; 3] {
        self.triangles[number / BLOCK].v.map(|lanes| usize::from(lanes[number % BLOCK]))
    }
}

/// Nodes and triangles of a page in its form.
#[derive(Clone, Copy, Debug)]
pub enum Body<'a> {
    /// As the walk wants them.
    Full(Full<'a>),
    /// To be decoded.
    Compact(Compact<'a>),
}

impl<'a> Form<'a> for Body<'a> {
    #[inline(always)]
    fn node<'n>(&self, index: usize, room: &'n mut Node) -> &'n Node
    where
        'a: 'n,
    {
        match self {
            Self::Full(page) => page.node(index, room),
            Self::Compact(page) => page.node(index, room),
        }
    }

    #[inline(always)]
    fn triangles<'n>(&self, index: usize, room: &'n mut TriangleBlock) -> &'n TriangleBlock
    where
        'a: 'n,
    {
        match self {
            Self::Full(page) => page.triangles(index, room),
            Self::Compact(page) => page.triangles(index, room),
        }
    }

    #[inline(always)]
    fn fetch<S: Simd>(&self, simd: S, child: Child) {
        match self {
            Self::Full(page) => page.fetch(simd, child),
            Self::Compact(page) => page.fetch(simd, child),
        }
    }
}

impl Body<'_> {
    /// Nothing.
    pub const EMPTY: Self = Self::Full(Full { nodes: &[], triangles: &[], normals: &[] });

    /// Which form it is.
    #[must_use]
    pub const fn form(&self) -> PageForm {
        match self {
            Self::Full(_) => PageForm::Full,
            Self::Compact(_) => PageForm::Compact,
        }
    }

    /// All nodes, as the full form has them.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = Node> + '_ {
        let count = match self {
            Self::Full(page) => page.nodes.len(),
            Self::Compact(page) => page.nodes.len(),
        };
        (0..count).map(|index| *self.node(index, &mut { Node::EMPTY }))
    }

    /// The lanes of all blocks of triangles.
    #[must_use]
    pub const fn triangle_lanes(&self) -> usize {
        BLOCK
            * match self {
                Self::Full(page) => page.triangles.len(),
                Self::Compact(page) => page.triangles.len(),
            }
    }

    /// The triangle in a lane.
    #[must_use]
    #[inline]
    pub fn triangle(&self, number: usize) -> Triangle {
        match self {
            Self::Full(page) => page.triangles[number / BLOCK].get(number % BLOCK),
            Self::Compact(page) => Triangle { v: page.corners(number).map(|vertex| Vec3::from(page.vertices[vertex])) },
        }
    }

    /// The global id of the triangle in a lane.
    #[must_use]
    pub fn triangle_id(&self, number: usize) -> u32 {
        match self {
            Self::Full(page) => page.triangles[number / BLOCK].id[number % BLOCK],
            Self::Compact(page) => page.triangles[number / BLOCK].id[number % BLOCK],
        }
    }

    /// The packed vertex normals of the triangle in a lane, if the page has any.
    #[must_use]
    pub fn normals(&self, number: usize) -> Option<[u32; 3]> {
        match self {
            Self::Full(page) => page.normals.get(number).copied(),
            Self::Compact(page) if page.normals.is_empty() => None,
            Self::Compact(page) => Some(page.corners(number).map(|vertex| page.normals[vertex])),
        }
    }
}
