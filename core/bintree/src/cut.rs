//! Cuts a binary tree into pages: the largest subtrees that fit.

use crate::BINARY_DEPTH_MAX;
use crate::binary::{BinaryNode, Item, bounds};
use crate::collapse::{Binary, Forest, Full, above, apiece, collapse};
use bytemuck::{Pod, Zeroable};
use hybray_geometry::{Aabb, Cone, Sphere, Triangle};
use hybray_scene::{
    BLOCK, Child, Colours, CompactNode, CompactTriangles, ConeRecord, Coordinates, Header, Kind, Line, Node,
    PAGE_BYTES_MAX, PageForm, SphereBlock, TriangleBlock, WIDTH, lines_for,
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
    /// The texture coordinates of the corners of triangle `id`, if it has them.
    fn coordinates(&self, _id: u32) -> Option<Coordinates> {
        None
    }
    /// The colours of the corners of triangle `id`, if it has them.
    fn colours(&self, _id: u32) -> Option<Colours> {
        None
    }
    /// What a triangle has besides corners, normals and a material, as [`Header::attributes`] says it.
    fn attributes(&self, id: u32) -> u32 {
        let coordinates = if self.coordinates(id).is_some() { Header::COORDINATES } else { 0 };
        coordinates | if self.colours(id).is_some() { Header::COLOURS } else { 0 }
    }
}

/// Leaves that a page may hold: the least is a block of compact triangles.
const LEAVES_MAX: usize = PAGE_BYTES_MAX / size_of::<CompactTriangles>();
/// Nodes of a compact page: each has one leaf at least on average, for it has two children or more. (That cells of the
/// midpoint rule are empty may leave one; such pages are smaller where that is too many.)
const COMPACT_NODES_MAX: usize = PAGE_BYTES_MAX / (size_of::<CompactNode>() + size_of::<CompactTriangles>());
const VERTICES_MAX: usize = PAGE_BYTES_MAX / size_of::<[f32; 3]>();
/// Places for vertices to be found again: enough for few to collide.
const FOUND_MAX: usize = 2 * VERTICES_MAX.next_power_of_two();
/// Blocks of primitives in a leaf at most: longer ones are halved.
const LEAF_BLOCKS: u32 = 4;
/// Least bytes that a primitive takes in a page: a sphere in a block, a compact triangle whose vertices others have, too.
const fn primitive_bytes_min(form: PageForm) -> usize {
    match form {
        PageForm::Full => size_of::<SphereBlock>() / BLOCK,
        PageForm::Compact => size_of::<CompactTriangles>() / BLOCK,
    }
}

/// A page under construction: 79 KB of scratch, so keep one and use it again. All zeros is a good beginning
/// ([`bytemuck::Zeroable`]): too large for a stack, it is best zeroed where it lies.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
pub struct Scratch {
    page: [Line; PAGE_BYTES_MAX / 64],
    /// In the order of the nodes.
    leaves: [Leaf; LEAVES_MAX],
}

impl Default for Scratch {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// What compact pages need beside that: 177 KB.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
pub struct CompactScratch {
    nodes: [Node; COMPACT_NODES_MAX],
    /// Normals of the vertices so far.
    normals: [u32; VERTICES_MAX],
    /// Numbers of vertices, plus one, by hash; 0 is none. A vertex lies at the first free place from its hash on.
    found: [u16; FOUND_MAX],
}

impl Default for CompactScratch {
    fn default() -> Self {
        Self::zeroed()
    }
}

const _: () = assert!(size_of::<Scratch>() == 78_656 && size_of::<CompactScratch>() == 176_928);

/// Items of one kind.
#[derive(Clone, Copy, Zeroable)]
#[repr(C)]
struct Leaf {
    first: u32,
    count: u32,
}

/// Vertices that triangles share, with their normals.
struct Vertices<'a> {
    /// Room for them.
    vertices: &'a mut [[f32; 3]],
    normals: &'a mut [u32; VERTICES_MAX],
    found: &'a mut [u16; FOUND_MAX],
    count: u32,
}

impl Vertices<'_> {
    /// The number of a vertex with this normal, which is put after the others if it is new; `None` if there is no room.
    fn number(&mut self, vertex: [f32; 3], normal: u32) -> Option<u16> {
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
        let number = self.count as u16;
        *self.vertices.get_mut(usize::from(number))? = vertex;
        self.normals[usize::from(number)] = normal;
        self.found[at] = number + 1;
        self.count += 1;
        Some(number)
    }
}

const _: () = assert!(FOUND_MAX > VERTICES_MAX && VERTICES_MAX < u16::MAX as usize);

/// A subtree: a node, or a range of a leaf's items that is cut further.
#[derive(Clone, Copy, Debug)]
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

/// A page whose nodes are made, while its leaves are only counted.
struct Filling<'a, P> {
    subject: &'a Subject<'a>,
    source: &'a P,
    leaves: &'a mut [Leaf; LEAVES_MAX],
    used: usize,
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
        *self.leaves.get_mut(self.used)? = Leaf { first: part.first, count: part.count };
        self.used += 1;
        let (so_far, count) = match kind {
            Kind::Triangle => {
                self.smooth = self.smooth || items.iter().any(|item| self.source.normals(item.id).is_some());
                for item in items {
                    self.counts.attributes |= self.source.attributes(item.id);
                }
                (&mut self.counts.triangle_blocks, items.len().div_ceil(BLOCK) as u32)
            }
            Kind::Sphere => (&mut self.counts.sphere_blocks, items.len().div_ceil(BLOCK) as u32),
            Kind::Cone => (&mut self.counts.cones, items.len() as u32),
        };
        let start = *so_far;
        *so_far += count;
        if self.smooth && self.counts.form() == PageForm::Full {
            self.counts.normals = self.counts.triangle_blocks * BLOCK as u32;
        }
        (self.counts.bytes_for() as usize <= self.bytes_max).then_some(Child::Leaf { kind, start, count })
    }
}

/// Packed vertex normals of a triangle that has none.
pub const FLAT: u32 = u32::MAX;

/// The primitives in the slots of a kind. Lanes beyond the last one of a leaf repeat it.
fn slots<'a>(subject: &Subject<'a>, leaves: &'a [Leaf], kind: Kind) -> impl Iterator<Item = u32> + 'a {
    let items = subject.items;
    let leaves = leaves.iter().map(move |leaf| &items[leaf.first as usize..][..leaf.count as usize]);
    leaves.filter(move |items| items[0].kind == kind).flat_map(move |items| {
        let slots = if kind == Kind::Cone { items.len() } else { items.len().next_multiple_of(BLOCK) };
        (0..slots).map(move |slot| items[slot.min(items.len() - 1)].id)
    })
}

/// Takes `count` values off the front of `bytes`.
fn take<'a, T: Pod>(bytes: &mut &'a mut [u8], count: u32) -> &'a mut [T] {
    let (these, rest) = core::mem::take(bytes).split_at_mut(count as usize * size_of::<T>());
    *bytes = rest;
    bytemuck::cast_slice_mut(these)
}

/// Makes one page of `part`, or finds that it does not fit: in compact form if there is scratch for that.
fn fill<P: Primitives>(
    subject: &Subject<'_>,
    part: &Part,
    source: &P,
    bytes_max: usize,
    scratch: &mut Scratch,
    mut compact: Option<&mut CompactScratch>,
) -> Result<usize, Full> {
    let form = if compact.is_some() { PageForm::Compact } else { PageForm::Full };
    if part.count as usize * primitive_bytes_min(form) > bytes_max
        || least_bytes(subject, part, source, form) > bytes_max
    {
        return Err(Full);
    }
    let Scratch { page, leaves } = scratch;
    let magic = magic(form);
    let counts =
        Header { magic, materials: 1, lo: part.aabb.lo.to_array(), hi: part.aabb.hi.to_array(), ..Zeroable::zeroed() };
    let (first, rest) = page.split_at_mut(1);
    let mut rest: &mut [u8] = bytemuck::cast_slice_mut(rest);
    let room = rest.len() / size_of::<Node>() * size_of::<Node>();
    let nodes = match &mut compact {
        None => bytemuck::cast_slice_mut(&mut rest[..room]),
        Some(compact) => &mut compact.nodes[..],
    };
    let mut filling = Filling { subject, source, leaves, used: 0, counts, smooth: false, bytes_max };
    let nodes = collapse(&mut filling, *part, nodes)? as u32;
    let Filling { used, counts: mut header, smooth, .. } = filling;
    let leaves = &leaves[..used];
    header.nodes = nodes;
    let of_kind = |kind| slots(subject, leaves, kind);
    let materials = || {
        let all = of_kind(Kind::Triangle).chain(of_kind(Kind::Sphere)).chain(of_kind(Kind::Cone));
        all.map(|id| source.material(id))
    };
    let one = materials().next();
    if materials().any(|material| Some(material) != one) {
        header.materials = header.material_slots();
    }
    if header.bytes_for() as usize > bytes_max {
        return Err(Full);
    }

    let rest = &mut rest;
    match &mut compact {
        None => {
            take::<Node>(rest, nodes);
            let blocks = take::<TriangleBlock>(rest, header.triangle_blocks);
            for (slot, id) in of_kind(Kind::Triangle).enumerate() {
                blocks[slot / BLOCK].set(slot % BLOCK, &source.triangle(id), source.id(id));
            }
            put_spheres(take(rest, header.sphere_blocks), of_kind(Kind::Sphere), source);
            put_cones(take(rest, header.cones), of_kind(Kind::Cone), source);
            for (to, id) in take::<[u32; 3]>(rest, header.normals).iter_mut().zip(of_kind(Kind::Triangle)) {
                *to = source.normals(id).unwrap_or([FLAT; 3]);
            }
        }
        Some(CompactScratch { nodes: full, normals, found }) => {
            for (to, node) in take::<CompactNode>(rest, nodes).iter_mut().zip(full) {
                let Some(compact) = CompactNode::new(node) else {
                    // No steps hold these boxes: this page is a full one.
                    return fill(subject, part, source, bytes_max, scratch, None);
                };
                *to = compact;
            }
            put_spheres(take(rest, header.sphere_blocks), of_kind(Kind::Sphere), source);
            let blocks = take::<CompactTriangles>(rest, header.triangle_blocks);
            put_cones(take(rest, header.cones), of_kind(Kind::Cone), source);
            let room = (bytes_max - header.bytes_for() as usize) / size_of::<[f32; 3]>();
            let (room, _) = rest.split_at_mut(room * size_of::<[f32; 3]>());
            found.fill(0);
            let mut shared = Vertices { vertices: bytemuck::cast_slice_mut(room), normals, found, count: 0 };
            for (slot, id) in of_kind(Kind::Triangle).enumerate() {
                let (triangle, normals) = (source.triangle(id), source.normals(id).unwrap_or([FLAT; 3]));
                let block = &mut blocks[slot / BLOCK];
                for (i, vertex) in triangle.v.into_iter().enumerate() {
                    block.v[i][slot % BLOCK] = shared.number(vertex.to_array(), normals[i]).ok_or(Full)?;
                }
                block.id[slot % BLOCK] = source.id(id);
            }
            header.vertices = shared.count;
            header.normals = if smooth { header.vertices } else { 0 };
            if header.bytes_for() as usize > bytes_max {
                return Err(Full);
            }
            take::<[f32; 3]>(rest, header.vertices);
            take(rest, header.normals).copy_from_slice(&normals[..header.normals as usize]);
        }
    }
    if header.attributes & Header::COORDINATES != 0 {
        let all = take::<Coordinates>(rest, header.triangle_blocks * BLOCK as u32);
        for (to, id) in all.iter_mut().zip(of_kind(Kind::Triangle)) {
            *to = source.coordinates(id).unwrap_or_default();
        }
    }
    if header.attributes & Header::COLOURS != 0 {
        let all = take::<Colours>(rest, header.triangle_blocks * BLOCK as u32);
        for (to, id) in all.iter_mut().zip(of_kind(Kind::Triangle)) {
            *to = source.colours(id).unwrap_or([[u8::MAX; 4]; 3]);
        }
    }
    for (to, material) in take(rest, header.materials).iter_mut().zip(materials()) {
        *to = material;
    }
    let bytes = header.bytes_for() as usize;
    header.bytes = bytes as u32;
    first[0] = bytemuck::cast(header);
    rest[..bytes.next_multiple_of(64) - bytes].fill(0);
    Ok(bytes)
}

/// Bytes that a page of `part` takes at least: those of its leaves, and of as many nodes as these need. It spares most of
/// the pages that turn out not to fit.
fn least_bytes<P: Primitives>(subject: &Subject<'_>, part: &Part, source: &P, form: PageForm) -> usize {
    if part.node == RANGE {
        return 0;
    }
    let mut least = Header { magic: magic(form), ..Zeroable::zeroed() };
    let (mut leaves, mut smooth, mut left) = (0u32, false, 1);
    for node in &subject.nodes[part.node as usize..] {
        // A subtree in preorder ends with its last leaf.
        if !node.is_leaf() {
            left += 1;
            continue;
        }
        for items in subject.items[node.first as usize..][..node.count as usize].chunk_by(|a, b| a.kind == b.kind) {
            let blocks = items.len().div_ceil(BLOCK) as u32;
            match items[0].kind {
                Kind::Triangle => {
                    // One of a kind is enough: where a triangle has normals, all have room for them.
                    smooth = smooth || least.triangle_blocks == 0 && source.normals(items[0].id).is_some();
                    if least.triangle_blocks == 0 {
                        least.attributes = source.attributes(items[0].id);
                    }
                    least.triangle_blocks += blocks;
                }
                Kind::Sphere => least.sphere_blocks += blocks,
                Kind::Cone => least.cones += items.len() as u32,
            }
            leaves += 1;
        }
        left -= 1;
        if left == 0 {
            break;
        }
    }
    least.nodes = leaves.saturating_sub(1).div_ceil(WIDTH as u32 - 1);
    if smooth && form == PageForm::Full {
        least.normals = least.triangle_blocks * BLOCK as u32;
    }
    least.bytes_for() as usize
}

const fn magic(form: PageForm) -> u32 {
    match form {
        PageForm::Full => Header::MAGIC,
        PageForm::Compact => Header::MAGIC_COMPACT,
    }
}

fn put_spheres<P: Primitives>(blocks: &mut [SphereBlock], ids: impl Iterator<Item = u32>, source: &P) {
    for (slot, id) in ids.enumerate() {
        blocks[slot / BLOCK].set(slot % BLOCK, &source.sphere(id), source.id(id));
    }
}

fn put_cones<P: Primitives>(cones: &mut [ConeRecord], ids: impl Iterator<Item = u32>, source: &P) {
    for (to, id) in cones.iter_mut().zip(ids) {
        *to = ConeRecord::new(&source.cone(id), source.id(id));
    }
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
/// page, or lies above pages. `emit` gets both with their boxes; [`crate::top::TopNode`]s are made of them. With scratch for
/// them, pages are compact, but for those whose boxes cannot be held in steps.
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
    forests: &mut [Forest],
    scratch: &mut Scratch,
    mut compact: Option<&mut CompactScratch>,
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
        if let Ok(bytes) = fill(&subject, &part, source, bytes_max, scratch, compact.as_deref_mut()) {
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

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::sah;
    use hybray_geometry::Vec3;
    use std::boxed::Box;
    use std::vec::Vec;

    /// A strip of triangles; beyond it spheres, then cones.
    struct Strip {
        smooth: bool,
        materials: u16,
    }

    const EACH: u32 = 700;

    fn corner(id: u32) -> Vec3 {
        Vec3::new(id as f32 * 0.01, (id % 2) as f32 * 0.01, (id * 7 % 5) as f32 * 0.001)
    }

    impl Strip {
        fn item(&self, id: u32) -> Item {
            let (kind, aabb) = match id / EACH {
                0 => (Kind::Triangle, self.triangle(id).aabb()),
                1 => (Kind::Sphere, self.sphere(id).aabb()),
                _ => (Kind::Cone, self.cone(id).aabb()),
            };
            Item::new(&aabb, kind, id)
        }
    }

    impl Primitives for Strip {
        fn triangle(&self, id: u32) -> Triangle {
            Triangle { v: [id, id + 1, id + 2].map(corner) }
        }
        fn sphere(&self, id: u32) -> Sphere {
            Sphere { centre: corner(id), radius: 0.004 }
        }
        fn cone(&self, id: u32) -> Cone {
            Cone { base: corner(id), base_radius: 0.004, apex: corner(id + 1), apex_radius: 0.002 }
        }
        fn material(&self, id: u32) -> u16 {
            (id % u32::from(self.materials)) as u16
        }
        fn normals(&self, _: u32) -> Option<[u32; 3]> {
            self.smooth.then_some([1, 2, 3])
        }
    }

    #[test]
    fn no_page_is_smaller_than_what_it_takes_at_least() {
        let mut pages = 0;
        for (smooth, materials) in [(false, 1), (true, 1), (true, 3)] {
            let source = Strip { smooth, materials };
            let mut items: Vec<Item> = (0..3 * EACH).map(|id| source.item(id)).collect();
            let mut nodes = std::vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
            let used = sah::build(&mut items, &mut nodes, &sah::Settings::default());
            let (nodes, mut forests) = (&nodes[..used], std::vec![Forest::EMPTY; used]);
            measure(nodes, &items, &mut forests);
            let subject = Subject { nodes, items: &items, forests: &forests };
            let (mut scratch, mut compact) = (Box::<Scratch>::default(), Box::<CompactScratch>::default());
            for node in 0..used as u32 {
                let part = subject.node(node);
                for form in [PageForm::Full, PageForm::Compact] {
                    let compact = (form == PageForm::Compact).then_some(&mut *compact);
                    let Ok(bytes) = fill(&subject, &part, &source, PAGE_BYTES_MAX, &mut scratch, compact) else {
                        continue;
                    };
                    let least = least_bytes(&subject, &part, &source, form);
                    assert!(least <= bytes, "{least} {bytes} {form:?} {part:?}");
                    // A bound that spares nothing is none.
                    let is_near = form == PageForm::Compact || part.count < 100 || 5 * least > 4 * bytes;
                    assert!(is_near, "{least} {bytes} {part:?}");
                    pages += 1;
                }
            }
        }
        assert!(pages > 1000, "{pages}");
    }
}
