//! The tree of one voxel, cut into pages: a chunk at a time, in parallel.

use super::packed::{hash_page, primitives_in};
use super::{Rule, Settings};
use bytemuck::allocation::zeroed_box;
use hybray_bintree::cut::{self, Cut, CutError, Primitives};
use hybray_bintree::reinsert::Link;
use hybray_bintree::{BinaryNode, Forest, Item, midpoint, reinsert, sah};
use hybray_geometry::Aabb;
use hybray_scene::{Header, Line, PageView, Tables};
use rayon::prelude::*;

/// Items of a chunk: small enough for its scratch to stay in the cache, large enough to keep every core busy.
const CHUNK: u32 = 1 << 15;

/// What became of a chunk: its pages, and the tree above them as events in preorder.
pub(super) struct Chunk {
    pub lines: Vec<Line>,
    pub events: Vec<(Aabb, Option<PageAbout>)>,
}

/// What is kept of a page beside its lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct PageAbout {
    pub lines: u32,
    pub bytes: u32,
    /// Different primitives in it.
    pub primitives: u32,
    /// Of its lines.
    pub hash: u64,
}

/// The tree of a voxel: binary nodes whose leaves are chunks, in preorder.
pub(super) struct VoxelTree {
    pub tops: Vec<BinaryNode>,
    pub chunks: Vec<Chunk>,
}

impl VoxelTree {
    /// Builds it over `items`, `depth` levels below the root of the directory.
    ///
    /// # Errors
    /// If pages are too small.
    pub fn build<P: Primitives + Sync>(
        mut items: Vec<Item>,
        source: &P,
        settings: &Settings,
        depth: u32,
    ) -> Result<Self, CutError> {
        match settings.rule {
            Rule::SurfaceArea => surface_area(&mut items, source, settings.page_bytes, depth),
            Rule::Midpoint(rule) => {
                let rule = midpoint::Settings { depth_max: rule.depth_max.min(48 - depth), ..rule };
                midpoints(items, source, rule, settings.page_bytes)
            }
        }
    }
}

fn surface_area<P: Primitives + Sync>(
    items: &mut [Item],
    source: &P,
    page_bytes: usize,
    depth: u32,
) -> Result<VoxelTree, CutError> {
    let stop_at = sah::Settings { stop_at: CHUNK, depth, ..sah::Settings::default() };
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
    let depth = depth + depth_of(&tops);
    let chunks = parts
        .into_par_iter()
        .map_init(
            || (Vec::new(), Vec::new(), Vec::new(), zeroed_box::<cut::Scratch>()),
            |(nodes, links, forests, scratch), part| {
                nodes.resize(sah::nodes_for(part.len()).max(nodes.len()), BinaryNode::EMPTY);
                let used = sah::build(part, nodes, &sah::Settings { depth, ..sah::Settings::default() });
                links.resize(used.max(links.len()), Link::EMPTY);
                reinsert::reinsert(&mut nodes[..used], links, depth);
                cut_chunk(&nodes[..used], part, source, page_bytes, forests, scratch)
            },
        )
        .collect::<Result<_, _>>()?;
    Ok(VoxelTree { tops, chunks })
}

fn midpoints<P: Primitives>(
    mut items: Vec<Item>,
    source: &P,
    rule: midpoint::Settings,
    page_bytes: usize,
) -> Result<VoxelTree, CutError> {
    let count = items.len();
    let Some(&first) = items.first() else { return Ok(VoxelTree { tops: Vec::new(), chunks: Vec::new() }) };
    items.resize(4 * count + 1024, first);
    let mut leaves = items.clone();
    let mut nodes = vec![BinaryNode::EMPTY; 2 * items.len()];
    let tree = midpoint::build(&mut items, count, &mut leaves, &mut nodes, &rule);
    let (used, held) = (tree.nodes.len(), tree.items.len());
    midpoint::tighten(&mut nodes[..used], &leaves[..held]);
    let chunk = cut_chunk(&nodes[..used], &leaves[..held], source, page_bytes, &mut Vec::new(), &mut zeroed_box())?;
    let root = BinaryNode { second: 0, ..nodes[0] };
    Ok(VoxelTree { tops: vec![root], chunks: vec![chunk] })
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

fn cut_chunk<P: Primitives>(
    nodes: &[BinaryNode],
    items: &[Item],
    source: &P,
    page_bytes: usize,
    forests: &mut Vec<Forest>,
    scratch: &mut cut::Scratch,
) -> Result<Chunk, CutError> {
    let mut chunk = Chunk { lines: Vec::new(), events: Vec::new() };
    forests.resize(nodes.len().max(forests.len()), Forest::EMPTY);
    cut::pages(nodes, items, source, page_bytes, forests, scratch, &mut |aabb, cut| match cut {
        Cut::Above => chunk.events.push((*aabb, None)),
        Cut::Page(lines) => {
            let header: &Header = bytemuck::from_bytes(&lines[0].0);
            let about =
                PageAbout { lines: lines.len() as u32, bytes: header.bytes, primitives: 0, hash: hash_page(lines) };
            chunk.events.push((*aabb, Some(about)));
            chunk.lines.extend_from_slice(lines);
        }
    })?;
    // They stay: what they grew for and did not need goes back.
    chunk.lines.shrink_to_fit();
    count_primitives(&mut chunk);
    Ok(chunk)
}

fn count_primitives(chunk: &mut Chunk) {
    let mut line = 0;
    for about in chunk.events.iter_mut().filter_map(|(_, about)| about.as_mut()) {
        let lines = &chunk.lines[line..][..about.lines as usize];
        line += lines.len();
        if let Ok(page) = PageView::parse(lines, Tables { materials: usize::MAX }) {
            about.primitives = primitives_in(&page);
        }
    }
}
