//! Cuts a binary tree into pages: the largest subtrees that fit.

use crate::BINARY_DEPTH_MAX;
use crate::binary::{BinaryNode, Item, bounds};
use crate::collapse::{Binary, Forest, Full, above, apiece, collapse};
use bytemuck::Zeroable;
use hybray_geometry::{Aabb, Cone, Sphere, Triangle};
use hybray_scene::{
    BLOCK, Child, CompactNode, CompactTriangles, ConeRecord, Header, Kind, Line, Node, PAGE_BYTES_MAX, PageForm,
    SphereBlock, TriangleBlock, lines_for,
};

/// The caller's primitives, by [`Item::id`].
pub trait Primitives {
    /// What pages call the primitive that items call `number`: the same, if this is not said.
    fn id(&self, number: u32) -> u32 {
        number
    }
    /// The triangle `id`; its box is within that of the item.
    fn triangle(&self, id: u32) -> Triangle;
    /// The sphere `id`.
    fn sphere(&self, id: u32) -> Sphere;
    /// The cone `id`.
    fn cone(&self, id: u32) -> Cone;
    /// The material of a primitive.
    fn material(&self, id: u32) -> u16;
    /// The packed vertex normals of triangle `id`, if it has them.
    fn normals(&self, id: u32) -> Option<[u32; 3]>;
}

const NODES_MAX: usize = PAGE_BYTES_MAX / size_of::<CompactNode>();
const TRIANGLES_MAX: usize = PAGE_BYTES_MAX / size_of::<TriangleBlock>();
const COMPACT_MAX: usize = PAGE_BYTES_MAX / size_of::<CompactTriangles>();
const VERTICES_MAX: usize = PAGE_BYTES_MAX / size_of::<[f32; 3]>();
/// Places for vertices to be found again: enough for few to collide.
const FOUND_MAX: usize = 2 * VERTICES_MAX.next_power_of_two();
const SPHERES_MAX: usize = PAGE_BYTES_MAX / size_of::<SphereBlock>();
const CONES_MAX: usize = PAGE_BYTES_MAX / size_of::<ConeRecord>();
/// Blocks of primitives in a leaf at most: longer ones are halved.
const LEAF_BLOCKS: u32 = 4;
/// Least bytes that a primitive takes in a page: a sphere in a block, a compact triangle whose vertices others have, too.
const fn primitive_bytes_min(form: PageForm) -> usize {
    match form {
        PageForm::Full => size_of::<SphereBlock>() / BLOCK,
        PageForm::Compact => size_of::<CompactTriangles>() / BLOCK,
    }
}

/// A page under construction: about 670 KB of scratch, so keep one and use it again. All zeros is a good beginning
/// ([`bytemuck::Zeroable`]): too large for a stack, it is best zeroed where it lies.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
pub struct Scratch {
    nodes: [Node; NODES_MAX],
    contents: Contents,
    page: [Line; PAGE_BYTES_MAX / 64],
}

/// Primitives of a page, by kind.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
struct Contents {
    triangles: [TriangleBlock; TRIANGLES_MAX],
    compact: [CompactTriangles; COMPACT_MAX],
    shared: Vertices,
    spheres: [SphereBlock; SPHERES_MAX],
    cones: [ConeRecord; CONES_MAX],
    normals: [[u32; 3]; TRIANGLES_MAX * BLOCK],
    triangle_materials: [u16; COMPACT_MAX * BLOCK],
    sphere_materials: [u16; SPHERES_MAX * BLOCK],
    cone_materials: [u16; CONES_MAX],
}

/// Vertices that triangles share, with their normals.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
struct Vertices {
    vertices: [[f32; 3]; VERTICES_MAX],
    normals: [u32; VERTICES_MAX],
    /// Numbers of vertices, plus one, by hash; 0 is none. A vertex lies at the first free place from its hash on.
    found: [u16; FOUND_MAX],
}

impl Vertices {
    /// The number of a vertex with this normal among the `count` that there are, after which it is put if it is new;
    /// `None` if there is no room.
    fn number(&mut self, vertex: [f32; 3], normal: u32, count: &mut u32) -> Option<u16> {
        let bits = vertex.map(f32::to_bits);
        // Fibonacci hashing (Knuth, The Art of Computer Programming, volume 3, section 6.4) of each word.
        let hash = bits
            .iter()
            .chain([&normal])
            .fold(0u64, |h, &word| (h ^ u64::from(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23));
        let mut at = hash as usize % FOUND_MAX;
        while let Some(number) = self.found[at].checked_sub(1) {
            let there = usize::from(number);
            if self.vertices[there].map(f32::to_bits) == bits && self.normals[there] == normal {
                return Some(number);
            }
            at = (at + 1) % FOUND_MAX;
        }
        let number = *count as u16;
        *self.vertices.get_mut(usize::from(number))? = vertex;
        self.normals[usize::from(number)] = normal;
        self.found[at] = number + 1;
        *count += 1;
        Some(number)
    }
}

const _: () = assert!(FOUND_MAX > VERTICES_MAX && VERTICES_MAX < u16::MAX as usize);

impl Default for Scratch {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// A subtree: a node, or a range of a leaf's items that is cut further.
#[derive(Clone, Copy)]
struct Part {
    aabb: Aabb,
    first: u32,
    count: u32,
    /// Index of the node, or [`RANGE`].
    node: u32,
}

const RANGE: u32 = u32::MAX;

/// What is cut.
struct Subject<'a> {
    nodes: &'a [BinaryNode],
    items: &'a [Item],
    /// Costs of the nodes.
    forests: &'a [Forest],
}

impl Subject<'_> {
    fn node(&self, index: u32) -> Part {
        let n = &self.nodes[index as usize];
        Part { aabb: n.aabb, first: n.first, count: n.count, node: index }
    }

    fn items(&self, part: &Part) -> &[Item] {
        &self.items[part.first as usize..][..part.count as usize]
    }

    fn children(&self, part: &Part) -> Option<[Part; 2]> {
        if part.node != RANGE && !self.nodes[part.node as usize].is_leaf() {
            return Some([self.node(part.node + 1), self.node(self.nodes[part.node as usize].second)]);
        }
        // A leaf's items are sorted by kind: it is divided where the kind changes, or else in the middle.
        let items = self.items(part);
        let kind = items.first()?.kind;
        let same = items.partition_point(|item| item.kind == kind) as u32;
        let most = match kind {
            Kind::Triangle | Kind::Sphere => LEAF_BLOCKS * BLOCK as u32,
            Kind::Cone => LEAF_BLOCKS,
        };
        let first = if same < part.count {
            same
        } else if part.count > most {
            part.count / 2
        } else {
            return None;
        };
        let half = |first, count| {
            let aabb = bounds(&self.items[first as usize..][..count as usize]);
            Part { aabb, first, count, node: RANGE }
        };
        Some([half(part.first, first), half(part.first + first, part.count - first)])
    }

    /// The cost of what has no nodes below.
    fn range(&self, part: &Part) -> Forest {
        if self.children(part).is_some() { Forest::leaves(part.aabb.half_area()) } else { Forest::LEAF }
    }
}

/// The costs of all nodes, children before their parents.
fn measure(nodes: &[BinaryNode], items: &[Item], forests: &mut [Forest]) {
    let apiece = apiece(nodes.iter().filter(|n| n.is_leaf()).map(|n| &n.aabb));
    for (here, node) in nodes.iter().enumerate().rev() {
        forests[here] = if node.aabb.is_empty() {
            Forest::LEAF
        } else if node.is_leaf() {
            let subject = Subject { nodes, items, forests };
            subject.range(&subject.node(here as u32))
        } else {
            let below = [here + 1, node.second as usize].map(|child| (&nodes[child].aabb, &forests[child]));
            above(below, node.aabb.half_area() + apiece)
        };
    }
}

/// A page being filled.
struct Filling<'a, P> {
    subject: &'a Subject<'a>,
    source: &'a P,
    contents: &'a mut Contents,
    counts: Header,
    smooth: bool,
    bytes_max: usize,
}

impl<P: Primitives> Binary for Filling<'_, P> {
    type Part = Part;

    fn aabb(&self, part: Part) -> Aabb {
        part.aabb
    }

    fn children(&self, part: Part) -> Option<[Part; 2]> {
        self.subject.children(&part)
    }

    fn forest(&self, part: Part) -> Forest {
        if part.node == RANGE { self.subject.range(&part) } else { self.subject.forests[part.node as usize] }
    }

    fn leaf(&mut self, part: Part) -> Option<Child> {
        let items = self.subject.items(&part);
        let kind = items.first()?.kind;
        let c = &mut *self.contents;
        let blocks = items.len().div_ceil(BLOCK);
        // Lanes beyond the last item repeat it.
        let lanes = (0..blocks * BLOCK).map(|i| (i / BLOCK, i % BLOCK, items[i.min(items.len() - 1)].id));
        let (start, count) = match kind {
            Kind::Triangle if self.counts.form() == PageForm::Compact => {
                let start = self.counts.triangle_blocks as usize;
                let room = c.compact.get_mut(start..start + blocks)?;
                for (block, lane, id) in lanes {
                    c.triangle_materials[(start + block) * BLOCK + lane] = self.source.material(id);
                    let normals = self.source.normals(id);
                    self.smooth |= normals.is_some();
                    let (triangle, normals) = (self.source.triangle(id), normals.unwrap_or([FLAT; 3]));
                    for (i, vertex) in triangle.v.into_iter().enumerate() {
                        let number = c.shared.number(vertex.to_array(), normals[i], &mut self.counts.vertices)?;
                        room[block].v[i][lane] = number;
                    }
                    room[block].id[lane] = self.source.id(id);
                }
                self.counts.triangle_blocks += blocks as u32;
                (start, blocks)
            }
            Kind::Triangle => {
                let start = self.counts.triangle_blocks as usize;
                let room = c.triangles.get_mut(start..start + blocks)?;
                for (block, lane, id) in lanes {
                    let slot = (start + block) * BLOCK + lane;
                    room[block].set(lane, &self.source.triangle(id), self.source.id(id));
                    c.triangle_materials[slot] = self.source.material(id);
                    let normals = self.source.normals(id);
                    self.smooth |= normals.is_some();
                    c.normals[slot] = normals.unwrap_or([FLAT; 3]);
                }
                self.counts.triangle_blocks += blocks as u32;
                (start, blocks)
            }
            Kind::Sphere => {
                let start = self.counts.sphere_blocks as usize;
                let room = c.spheres.get_mut(start..start + blocks)?;
                for (block, lane, id) in lanes {
                    room[block].set(lane, &self.source.sphere(id), self.source.id(id));
                    c.sphere_materials[(start + block) * BLOCK + lane] = self.source.material(id);
                }
                self.counts.sphere_blocks += blocks as u32;
                (start, blocks)
            }
            Kind::Cone => {
                let start = self.counts.cones as usize;
                let room = c.cones.get_mut(start..start + items.len())?;
                for (i, item) in items.iter().enumerate() {
                    room[i] = ConeRecord::new(&self.source.cone(item.id), self.source.id(item.id));
                    c.cone_materials[start + i] = self.source.material(item.id);
                }
                self.counts.cones += items.len() as u32;
                (start, items.len())
            }
        };
        (self.counts.bytes_for() as usize <= self.bytes_max).then_some(Child::Leaf {
            kind,
            start: start as u32,
            count: count as u32,
        })
    }
}

/// Packed vertex normals of a triangle that has none.
pub const FLAT: u32 = u32::MAX;

/// Makes one page of `part`, or finds that it does not fit.
fn fill<P: Primitives>(
    subject: &Subject<'_>,
    part: &Part,
    source: &P,
    bytes_max: usize,
    form: PageForm,
    scratch: &mut Scratch,
) -> Result<usize, Full> {
    if part.count as usize * primitive_bytes_min(form) > bytes_max {
        return Err(Full);
    }
    let Scratch { nodes, contents, page } = scratch;
    let magic = match form {
        PageForm::Full => Header::MAGIC,
        PageForm::Compact => Header::MAGIC_COMPACT,
    };
    let mut header =
        Header { magic, materials: 1, lo: part.aabb.lo.to_array(), hi: part.aabb.hi.to_array(), ..Zeroable::zeroed() };
    contents.shared.found.fill(0);
    let mut filling = Filling { subject, source, contents, counts: header, smooth: false, bytes_max };
    header.nodes = collapse(&mut filling, *part, nodes)? as u32;
    let (counts, smooth) = (filling.counts, filling.smooth);
    header.triangle_blocks = counts.triangle_blocks;
    header.sphere_blocks = counts.sphere_blocks;
    header.cones = counts.cones;
    header.vertices = counts.vertices;
    let (nt, ns, nc) = (counts.triangle_blocks as usize, counts.sphere_blocks as usize, counts.cones as usize);
    header.normals = match form {
        _ if !smooth => 0,
        PageForm::Full => (nt * BLOCK) as u32,
        PageForm::Compact => header.vertices,
    };
    let materials = [
        &contents.triangle_materials[..nt * BLOCK],
        &contents.sphere_materials[..ns * BLOCK],
        &contents.cone_materials[..nc],
    ];
    let mut all = materials.iter().flat_map(|m| m.iter());
    let one = all.next().is_none_or(|first| all.all(|m| m == first));
    header.materials = if one { 1 } else { header.material_slots() };
    let bytes = header.bytes_for() as usize;
    if bytes > bytes_max {
        return Err(Full);
    }
    header.bytes = bytes as u32;
    let nodes = &nodes[..header.nodes as usize];

    let page: &mut [u8] = bytemuck::cast_slice_mut(&mut page[..]);
    let mut at = 0;
    let mut put = |bytes: &[u8]| {
        page[at..at + bytes.len()].copy_from_slice(bytes);
        at += bytes.len();
    };
    put(bytemuck::bytes_of(&header));
    match form {
        PageForm::Full => {
            put(bytemuck::cast_slice(nodes));
            put(bytemuck::cast_slice(&contents.triangles[..nt]));
            put(bytemuck::cast_slice(&contents.spheres[..ns]));
            put(bytemuck::cast_slice(&contents.cones[..nc]));
            put(bytemuck::cast_slice(&contents.normals[..header.normals as usize]));
        }
        PageForm::Compact => {
            for node in nodes {
                let Some(compact) = CompactNode::new(node) else {
                    // No steps hold these boxes: this page is a full one.
                    return fill(subject, part, source, bytes_max, PageForm::Full, scratch);
                };
                put(bytemuck::bytes_of(&compact));
            }
            put(bytemuck::cast_slice(&contents.spheres[..ns]));
            put(bytemuck::cast_slice(&contents.compact[..nt]));
            put(bytemuck::cast_slice(&contents.cones[..nc]));
            put(bytemuck::cast_slice(&contents.shared.vertices[..header.vertices as usize]));
            put(bytemuck::cast_slice(&contents.shared.normals[..header.normals as usize]));
        }
    }
    let mut left = header.materials as usize;
    for m in materials {
        let n = m.len().min(left);
        put(bytemuck::cast_slice(&m[..n]));
        left -= n;
    }
    page[at..bytes.next_multiple_of(64)].fill(0);
    Ok(bytes)
}

/// What became of a subtree: told to the caller of [`pages`] in preorder.
pub enum Cut<'a> {
    /// A page, padded to whole lines with zeros.
    Page(&'a [Line]),
    /// A node above pages, whose children follow.
    Above,
}

/// Why a tree could not be cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CutError {
    /// One leaf of primitives is larger than a page.
    #[error("a page of {bytes_max} bytes cannot hold even one leaf of primitives; 4096 bytes can")]
    PageTooSmall {
        /// The size asked for.
        bytes_max: usize,
    },
}

/// Cuts the tree of `nodes` over `items` into pages of at most `bytes_max` bytes: in preorder, each subtree either is a
/// page, or lies above pages. `emit` gets both with their boxes; [`crate::top::TopNode`]s are made of them. A page whose
/// boxes cannot be held in steps is in full form, whatever `form` says.
///
/// Bounded by the size of the tree times the page size over the least page. `forests` is scratch, one for each node.
///
/// # Errors
/// See [`CutError`].
///
/// # Panics
/// If there are fewer `forests` than `nodes`.
pub fn pages<P: Primitives>(
    nodes: &[BinaryNode],
    items: &[Item],
    source: &P,
    bytes_max: usize,
    form: PageForm,
    forests: &mut [Forest],
    scratch: &mut Scratch,
    emit: &mut impl FnMut(&Aabb, Cut<'_>),
) -> Result<(), CutError> {
    let bytes_max = bytes_max.min(PAGE_BYTES_MAX);
    measure(nodes, items, forests);
    let subject = Subject { nodes, items, forests };
    let mut stack = [Part { aabb: Aabb::EMPTY, first: 0, count: 0, node: RANGE }; BINARY_DEPTH_MAX as usize + 40];
    let mut waiting = 0;
    if !nodes.is_empty() && !nodes[0].aabb.is_empty() {
        stack[0] = subject.node(0);
        waiting = 1;
    }
    while waiting > 0 {
        waiting -= 1;
        let part = stack[waiting];
        if part.aabb.is_empty() {
            continue;
        }
        if let Ok(bytes) = fill(&subject, &part, source, bytes_max, form, scratch) {
            emit(&part.aabb, Cut::Page(&scratch.page[..lines_for(bytes)]));
            continue;
        }
        let Some([first, second]) = subject.children(&part) else {
            return Err(CutError::PageTooSmall { bytes_max });
        };
        // An empty child would be an inner node with one child only: the other stands for both.
        if first.aabb.is_empty() || second.aabb.is_empty() {
            stack[waiting] = if first.aabb.is_empty() { second } else { first };
            waiting += 1;
            continue;
        }
        emit(&part.aabb, Cut::Above);
        stack[waiting] = second;
        stack[waiting + 1] = first;
        waiting += 2;
    }
    Ok(())
}
