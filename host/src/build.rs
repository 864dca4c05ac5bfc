//! From a [`Model`] to pages and a directory: the host's part of the work, done once.
//!
//! Peak memory, beside the model: 32 bytes an item, and the pages themselves. Trees are built and cut a chunk at a time, in
//! parallel, so that binary nodes and unfinished pages exist only for the chunks in work.

use crate::model::Model;
use bytemuck::allocation::zeroed_box;
use hybray_bintree::cut::{self, Cut, CutError, FLAT, Primitives};
use hybray_bintree::walk::Resident;
use hybray_bintree::{BinaryNode, Item, midpoint, sah, top};
use hybray_geometry::{Aabb, Cone, Sphere, Triangle, Vec3};
use hybray_scene::{
    Directory, DirectoryError, Kind, Line, Node, PAGE_BYTES_MAX, PageEntry, PageError, PageView, Tables,
};
use hybray_shading::pack_normal;
use rayon::prelude::*;

/// How cells are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Surface-area heuristic: the default.
    SurfaceArea,
    /// The 1995 report's midpoints.
    Midpoint(midpoint::Settings),
}

/// What may be chosen about a build. None of it changes a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How cells are split.
    pub rule: Rule,
    /// Most bytes of a page.
    pub page_bytes: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { rule: Rule::SurfaceArea, page_bytes: PAGE_BYTES_MAX }
    }
}

/// Why a model could not be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// Pages too small.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// A page that its own reader refuses: a bug of the builder.
    #[error("the builder made a page that is none: {0}")]
    Page(#[from] PageError),
    /// A directory that its own reader refuses: a bug of the builder.
    #[error("the builder made a directory that is none: {0}")]
    Directory(#[from] DirectoryError),
    /// More than ids can number.
    #[error("{0} primitives are more than the 2,147,483,647 that ids can number")]
    TooMany(usize),
}

/// Pages and directory of a scene, in the internal unit (file units times `2^scale_log2`).
pub struct Packed {
    /// Pages chunk by chunk, each at a line.
    chunks: Vec<Vec<Line>>,
    /// Chunk, first line and lines of each page.
    places: Vec<(u32, u32, u32)>,
    nodes: Vec<Node>,
    entries: Vec<PageEntry>,
    /// File units times 2 to this power are internal units: exact.
    pub scale_log2: i32,
    /// Greatest absolute coordinate, internal units.
    pub magnitude: f32,
    /// Materials that pages may refer to.
    pub materials: usize,
}

const HASH_START: u64 = 0xcbf2_9ce4_8422_2325;

/// Adds `bytes` and their number to a hash, eight at a time (FNV-1a over little-endian words, the last one filled up with
/// zeros).
#[must_use]
pub fn hash_bytes(hash: u64, bytes: &[u8]) -> u64 {
    let length = (bytes.len() as u64).to_le_bytes();
    bytes.chunks(8).chain([&length[..]]).fold(hash, |h, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        // The rotation brings what multiplication moves up back down.
        (h ^ u64::from_le_bytes(word)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29)
    })
}

/// Validated pages, which [`Pages::resident`] lends.
pub struct Pages<'a> {
    packed: &'a Packed,
    views: Vec<PageView<'a>>,
}

impl Packed {
    /// Bytes of all pages.
    #[must_use]
    pub fn page_bytes(&self) -> u64 {
        self.entries.iter().map(|e| u64::from(e.bytes)).sum()
    }

    /// Bytes of the directory.
    #[must_use]
    pub fn directory_bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + size_of_val(&self.entries[..])) as u64
    }

    /// Hash of directory and pages: equal for equal pages in equal order.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let pages = self.places.par_iter().map(|&(chunk, first, lines)| {
            let lines = &self.chunks[chunk as usize][first as usize..][..lines as usize];
            hash_bytes(HASH_START, bytemuck::cast_slice(lines))
        });
        let hash = pages.collect::<Vec<_>>().iter().fold(HASH_START, |h, page| hash_bytes(h, &page.to_le_bytes()));
        hash_bytes(hash_bytes(hash, bytemuck::cast_slice(&self.nodes)), bytemuck::cast_slice(&self.entries))
    }

    /// How many pages there are.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.entries.len()
    }

    /// Validates every page, as each node does with what it receives.
    ///
    /// # Errors
    /// If the builder, or memory, is broken.
    pub fn open(&self) -> Result<Pages<'_>, BuildError> {
        let tables = Tables { materials: self.materials };
        let views = self
            .places
            .par_iter()
            .map(|&(chunk, first, lines)| {
                PageView::parse(&self.chunks[chunk as usize][first as usize..][..lines as usize], tables)
            })
            .collect::<Result<Vec<_>, _>>()?;
        Directory::parse(&self.nodes, &self.entries, &mut vec![0; self.nodes.len()])?;
        Ok(Pages { packed: self, views })
    }
}

impl<'a> Pages<'a> {
    /// What a walk needs.
    #[must_use]
    pub fn resident(&'a self) -> Resident<'a> {
        let directory = Directory { nodes: &self.packed.nodes, entries: &self.packed.entries };
        Resident { directory, pages: &self.views }
    }
}

/// A model's primitives by id, in internal units.
pub struct Source<'m> {
    model: &'m Model,
    /// First id of each mesh, then of the spheres, then of the cones, then the end.
    starts: Vec<u32>,
    scale: f32,
}

impl<'m> Source<'m> {
    /// Numbers the primitives of `model`, and chooses a power of two that brings coordinates near 1.
    ///
    /// # Errors
    /// If there are too many.
    pub fn new(model: &'m Model) -> Result<(Self, i32), BuildError> {
        let primitives = model.primitives();
        if primitives > i32::MAX as usize {
            return Err(BuildError::TooMany(primitives));
        }
        let mut starts = vec![0u32];
        let lengths = model.meshes.iter().map(|m| m.triangles.len()).chain([model.spheres.len(), model.cones.len()]);
        for n in lengths {
            starts.push(starts[starts.len() - 1] + n as u32);
        }
        let unscaled = Self { model, starts, scale: 1.0 };
        let magnitude = (0..unscaled.len())
            .into_par_iter()
            .map(|id| unscaled.aabb(id).1.magnitude())
            .reduce(|| 0.0, |a, b| if a > b { a } else { b });
        // Coordinates that f32 can only just hold are brought as far as a power of two can bring them.
        let scale_log2 = if magnitude > 0.0 { (-exponent(magnitude)).clamp(-126, 126) } else { 0 };
        Ok((Self { scale: libm::ldexpf(1.0, scale_log2), ..unscaled }, scale_log2))
    }

    /// How many primitives there are.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.starts[self.starts.len() - 1]
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn point(&self, p: [f32; 3]) -> Vec3 {
        Vec3::from_array(p) * self.scale
    }

    /// Which mesh (or spheres, or cones) an id falls into, and its number there.
    fn place(&self, id: u32) -> (usize, usize) {
        let part = self.starts.partition_point(|&start| start <= id) - 1;
        (part, (id - self.starts[part]) as usize)
    }

    /// Kind and box of a primitive.
    #[must_use]
    pub fn aabb(&self, id: u32) -> (Kind, Aabb) {
        let meshes = self.model.meshes.len();
        match self.place(id).0 {
            part if part < meshes => (Kind::Triangle, self.triangle(id).aabb()),
            part if part == meshes => (Kind::Sphere, self.sphere(id).aabb()),
            _ => (Kind::Cone, self.cone(id).aabb()),
        }
    }
}

/// `e` with `x` in `2^(e-1)..2^e`.
fn exponent(x: f32) -> i32 {
    libm::frexpf(x).1
}

impl Primitives for Source<'_> {
    fn triangle(&self, id: u32) -> Triangle {
        let (part, number) = self.place(id);
        let mesh = &self.model.meshes[part];
        Triangle { v: mesh.triangles[number].map(|v| self.point(mesh.positions[v as usize])) }
    }

    fn sphere(&self, id: u32) -> Sphere {
        let s = &self.model.spheres[self.place(id).1];
        Sphere { centre: self.point(s.centre), radius: s.radius * self.scale }
    }

    fn cone(&self, id: u32) -> Cone {
        let c = &self.model.cones[self.place(id).1];
        Cone {
            base: self.point(c.base),
            base_radius: c.base_radius * self.scale,
            apex: self.point(c.apex),
            apex_radius: c.apex_radius * self.scale,
        }
    }

    fn material(&self, id: u32) -> u16 {
        let meshes = self.model.meshes.len();
        match self.place(id) {
            (part, _) if part < meshes => self.model.meshes[part].material,
            (part, number) if part == meshes => self.model.spheres[number].material,
            (_, number) => self.model.cones[number].material,
        }
    }

    fn normals(&self, id: u32) -> Option<[u32; 3]> {
        let (part, number) = self.place(id);
        let mesh = self.model.meshes.get(part)?;
        (!mesh.normals.is_empty()).then(|| {
            mesh.triangles[number].map(|v| {
                let n = Vec3::from_array(mesh.normals[v as usize]);
                if n.length_squared() > 0.0 { pack_normal(n / n.length()) } else { FLAT }
            })
        })
    }
}

/// Items of a chunk: small enough for its scratch to stay in the cache, large enough to keep every core busy.
const CHUNK: u32 = 1 << 15;

/// What became of a chunk: its pages, and the tree above them as events in preorder.
struct Chunk {
    lines: Vec<Line>,
    events: Vec<(Aabb, Option<u32>)>,
}

/// Builds the tree and cuts it.
///
/// # Errors
/// See [`BuildError`].
pub fn build(model: &Model, settings: &Settings) -> Result<Packed, BuildError> {
    let (source, scale_log2) = Source::new(model)?;
    let mut items: Vec<Item> = (0..source.len())
        .into_par_iter()
        .map(|id| {
            let (kind, aabb) = source.aabb(id);
            Item::new(&aabb, kind, id)
        })
        .collect();
    let (tops, chunks) = match settings.rule {
        Rule::SurfaceArea => surface_area(&mut items, &source, settings.page_bytes)?,
        Rule::Midpoint(rule) => midpoints(items, &source, rule, settings.page_bytes)?,
    };
    let mut packed = assemble(&tops, chunks);
    packed.scale_log2 = scale_log2;
    packed.materials = model.materials.len();
    Ok(packed)
}

fn surface_area(
    items: &mut [Item],
    source: &Source<'_>,
    page_bytes: usize,
) -> Result<(Vec<BinaryNode>, Vec<Chunk>), CutError> {
    let stop_at = sah::Settings { stop_at: CHUNK, ..sah::Settings::default() };
    // Splits may cut off little at a time: where this room ends, a chunk is larger, and nothing else changes.
    let mut tops = vec![BinaryNode::EMPTY; 4096 + 64 * (items.len() / CHUNK as usize)];
    let used = sah::build(items, &mut tops, &stop_at);
    tops.truncate(used);

    let mut rest = items;
    let mut parts = Vec::new();
    for leaf in tops.iter().filter(|n| n.is_leaf()) {
        let (part, after) = rest.split_at_mut(leaf.count as usize);
        parts.push(part);
        rest = after;
    }
    let depth = depth_of(&tops);
    let chunks = parts
        .into_par_iter()
        .map_init(
            || (Vec::new(), zeroed_box::<cut::Scratch>()),
            |(nodes, scratch), part| {
                nodes.resize(sah::nodes_for(part.len()).max(nodes.len()), BinaryNode::EMPTY);
                let used = sah::build(part, nodes, &sah::Settings { depth, ..sah::Settings::default() });
                cut_chunk(&nodes[..used], part, source, page_bytes, scratch)
            },
        )
        .collect::<Result<_, _>>()?;
    Ok((tops, chunks))
}

fn midpoints(
    mut items: Vec<Item>,
    source: &Source<'_>,
    rule: midpoint::Settings,
    page_bytes: usize,
) -> Result<(Vec<BinaryNode>, Vec<Chunk>), CutError> {
    let count = items.len();
    let Some(&first) = items.first() else { return Ok((Vec::new(), Vec::new())) };
    items.resize(4 * count + 1024, first);
    let mut leaves = items.clone();
    let mut nodes = vec![BinaryNode::EMPTY; 2 * items.len()];
    let tree = midpoint::build(&mut items, count, &mut leaves, &mut nodes, &rule);
    let (used, held) = (tree.nodes.len(), tree.items.len());
    midpoint::tighten(&mut nodes[..used], &leaves[..held]);
    let chunk = cut_chunk(&nodes[..used], &leaves[..held], source, page_bytes, &mut zeroed_box())?;
    let root = BinaryNode { second: 0, ..nodes[0] };
    Ok((vec![root], vec![chunk]))
}

fn depth_of(nodes: &[BinaryNode]) -> u32 {
    let mut levels = vec![0u32; nodes.len()];
    for (i, node) in nodes.iter().enumerate().filter(|(_, n)| !n.is_leaf()) {
        for child in [i + 1, node.second as usize] {
            levels[child] = levels[i] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

fn cut_chunk(
    nodes: &[BinaryNode],
    items: &[Item],
    source: &Source<'_>,
    page_bytes: usize,
    scratch: &mut cut::Scratch,
) -> Result<Chunk, CutError> {
    let mut chunk = Chunk { lines: Vec::new(), events: Vec::new() };
    cut::pages(nodes, items, source, page_bytes, scratch, &mut |aabb, cut| match cut {
        Cut::Above => chunk.events.push((*aabb, None)),
        Cut::Page(lines) => {
            chunk.events.push((*aabb, Some(lines.len() as u32)));
            chunk.lines.extend_from_slice(lines);
        }
    })?;
    Ok(chunk)
}

/// Puts the trees of all chunks below the top one, and the directory above their pages.
fn assemble(tops: &[BinaryNode], chunks: Vec<Chunk>) -> Packed {
    let mut top = top::Builder::new();
    let mut places = Vec::new();
    let mut entries = Vec::new();
    let mut next_chunk = 0;
    for node in tops {
        if !node.is_leaf() {
            top.above(&node.aabb);
            continue;
        }
        let chunk: &Chunk = &chunks[next_chunk];
        let mut line = 0;
        for (aabb, page) in &chunk.events {
            let Some(lines) = *page else {
                top.above(aabb);
                continue;
            };
            top.page(aabb, places.len() as u32);
            let header: &hybray_scene::Header = bytemuck::from_bytes(&chunk.lines[line as usize].0);
            entries.push(PageEntry { bytes: header.bytes, owner: 0, kind: 0 });
            places.push((next_chunk as u32, line, lines));
            line += lines;
        }
        next_chunk += 1;
    }
    let top = top.finish();
    let mut nodes = vec![Node::EMPTY; top::nodes_for(places.len())];
    let used = top::directory(&top, &mut nodes).expect("builders bound the depth, and there is a node for each page");
    nodes.truncate(used);
    let magnitude = nodes.first().map_or(0.0, |n| n.bounds().magnitude());
    Packed {
        chunks: chunks.into_iter().map(|c| c.lines).collect(),
        places,
        nodes,
        entries,
        scale_log2: 0,
        magnitude,
        materials: 0,
    }
}
