//! The tree of one voxel, cut into pages: a chunk at a time, in parallel.

use super::packed::{hash_page, primitives_in};
use super::{Rule, Settings};
use bytemuck::allocation::zeroed_box;
use hybray_bintree::cut::{self, Cut, CutError, Primitives};
use hybray_bintree::reinsert::Link;
use hybray_bintree::sah::{Binning, Bins, Extents};
use hybray_bintree::{BinaryNode, Forest, Item, midpoint, reinsert, sah};
use hybray_geometry::Aabb;
use hybray_scene::{Line, PageForm, PageView};
use rayon::prelude::*;

/// Items of a chunk: small enough for its scratch to stay in the cache, large enough to keep every core busy.
const CHUNK: u32 = 1 << 15;

/// What became of a chunk: its pages, and the tree above them as events in preorder.
pub(super) struct Chunk {
    pub pages: Vec<Vec<Line>>,
    pub events: Vec<(Aabb, Option<PageAbout>)>,
}

/// What is kept of a page beside its lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct PageAbout {
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
            Rule::SurfaceArea => surface_area(&mut items, source, settings, depth),
            Rule::Midpoint(rule) => {
                let rule = midpoint::Settings { depth_max: rule.depth_max.min(48 - depth), ..rule };
                midpoints(items, source, rule, settings)
            }
        }
    }
}

/// Room for a page under construction.
struct Scratch {
    page: Box<cut::Scratch>,
    compact: Option<Box<cut::CompactScratch>>,
}

impl Scratch {
    fn new(form: PageForm) -> Self {
        Self { page: zeroed_box(), compact: (form == PageForm::Compact).then(zeroed_box) }
    }
}

fn surface_area<P: Primitives + Sync>(
    items: &mut [Item],
    source: &P,
    settings: &Settings,
    depth: u32,
) -> Result<VoxelTree, CutError> {
    let stop_at = sah::Settings { stop_at: CHUNK, depth, ..sah::Settings::default() };
    // Splits may cut off little at a time: where this room ends, a chunk is larger, and nothing else changes.
    let chunks = items.len() / CHUNK as usize;
    let mut tops = vec![BinaryNode::EMPTY; if chunks == 0 { 1 } else { 4096 + 64 * chunks }];
    let used = sah::build_with(items, &mut tops, &stop_at, &ByThreads);
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
            || (Vec::new(), Vec::new(), Scratch::new(settings.pages)),
            |(nodes, forests, scratch), part| {
                let used = built(part, nodes, &sah::Settings { depth, ..sah::Settings::default() });
                reinsert::reinsert(&mut nodes[..used], &mut vec![Link::EMPTY; used], depth);
                cut_chunk(&nodes[..used], part, source, settings, forests, scratch)
            },
        )
        .collect::<Result<_, _>>()?;
    Ok(VoxelTree { tops, chunks })
}

/// Items that are worth the way to another thread.
const SHARE: usize = 1 << 14;

/// All threads look through a range together, a share each. Boxes are least and greatest of what is there, and counts are
/// sums: joined in order, they are the same whatever the shares.
struct ByThreads;

impl sah::Scan for ByThreads {
    fn extents(&self, items: &[Item]) -> Extents {
        let parts = items.par_chunks(SHARE).map(Extents::of);
        parts.reduce_with(|a, b| a.and(&b)).unwrap_or_else(|| Extents::of(&[]))
    }

    fn bins(&self, items: &[Item], binning: &Binning) -> Bins {
        let parts = items.par_chunks(SHARE).map(|part| Bins::of(part, binning));
        parts.reduce_with(|a, b| a.and(&b)).unwrap_or_else(|| Bins::of(&[], binning))
    }
}

/// A whole tree over `items` in `nodes`, and how many it took. Leaves are mostly full, so that half a node an item is nearly
/// always room enough; where it is not, the tree is built again in all that there can be.
fn built(items: &mut [Item], nodes: &mut Vec<BinaryNode>, settings: &sah::Settings) -> usize {
    let all = sah::nodes_for(items.len());
    for room in [(items.len() * 5 / 8 + 64).min(all), all] {
        nodes.resize(room.max(nodes.len()), BinaryNode::EMPTY);
        let used = sah::build(items, &mut nodes[..room], settings);
        // Where a split found no room, one node is left over at most.
        if used + 1 < room || room == all {
            return used;
        }
    }
    0
}

fn midpoints<P: Primitives>(
    mut items: Vec<Item>,
    source: &P,
    rule: midpoint::Settings,
    settings: &Settings,
) -> Result<VoxelTree, CutError> {
    let count = items.len();
    let Some(&first) = items.first() else { return Ok(VoxelTree { tops: Vec::new(), chunks: Vec::new() }) };
    items.resize(4 * count + 1024, first);
    let mut leaves = items.clone();
    let mut nodes = vec![BinaryNode::EMPTY; 2 * items.len()];
    let tree = midpoint::build(&mut items, count, &mut leaves, &mut nodes, &rule);
    let (used, held) = (tree.nodes.len(), tree.items.len());
    midpoint::tighten(&mut nodes[..used], &leaves[..held]);
    let chunk = cut_chunk(
        &nodes[..used],
        &leaves[..held],
        source,
        settings,
        &mut Vec::new(),
        &mut Scratch::new(settings.pages),
    )?;
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
    settings: &Settings,
    forests: &mut Vec<Forest>,
    scratch: &mut Scratch,
) -> Result<Chunk, CutError> {
    let mut chunk = Chunk { pages: Vec::new(), events: Vec::new() };
    forests.resize(nodes.len().max(forests.len()), Forest::EMPTY);
    cut::pages(
        nodes,
        items,
        source,
        settings.page_bytes,
        forests,
        &mut scratch.page,
        scratch.compact.as_deref_mut(),
        &mut |aabb, cut| match cut {
            Cut::Above => chunk.events.push((*aabb, None)),
            Cut::Page(lines) => {
                let page = PageView::of_valid(lines);
                let about =
                    PageAbout { bytes: page.header.bytes, primitives: primitives_in(&page), hash: hash_page(lines) };
                chunk.events.push((*aabb, Some(about)));
                chunk.pages.push(lines.to_vec());
            }
        },
    )?;
    Ok(chunk)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::{Source, build};
    use crate::import;

    fn items(name: &str) -> Vec<Item> {
        let model = import::load(name).unwrap();
        let (source, _) = Source::new(&model).unwrap();
        let item = |id| {
            let (kind, aabb) = source.aabb(id);
            Item::new(&aabb, kind, id)
        };
        (0..source.len()).map(item).collect()
    }

    #[test]
    fn the_same_pages_whatever_the_threads() {
        for name in ["terrain:150000", "spd:balls:5", "spd:teapot:30"] {
            let model = import::load(name).unwrap();
            let built = [1, 2, 3, 8].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| build(&model, &Settings::default()).unwrap())
            });
            let [one, others @ ..] = &built;
            assert!(one.pages() > 10, "{name}: {}", one.pages());
            for other in others {
                assert!(one.page_slices() == other.page_slices() && one.hash() == other.hash(), "{name}");
            }
        }
    }

    #[test]
    fn shares_find_what_one_thread_finds() {
        let mut all = items("terrain:150000");
        // Zeros of both signs are equal, and must not take turns.
        for (i, item) in all.iter_mut().enumerate() {
            item.lo.x = if i % 3 == 0 { -0.0 } else { 0.0 };
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let settings = sah::Settings { stop_at: 1000, ..sah::Settings::default() };
        let nodes = vec![BinaryNode::EMPTY; sah::nodes_for(all.len())];
        let [mut a, mut b] = [(all.clone(), nodes.clone()), (all, nodes)];
        let used = sah::build(&mut a.0, &mut a.1, &settings);
        assert_eq!(pool.install(|| sah::build_with(&mut b.0, &mut b.1, &settings, &ByThreads)), used);
        let bits = |(items, nodes): &(Vec<Item>, Vec<BinaryNode>)| {
            let corners = nodes[..used].iter().flat_map(|n| [n.aabb.lo, n.aabb.hi]);
            let corners: Vec<_> = corners.flat_map(|c| c.to_array().map(f32::to_bits)).collect();
            let ids: Vec<_> = items.iter().map(|item| item.id).collect();
            (corners, ids, nodes[..used].iter().map(|n| (n.first, n.count, n.second)).collect::<Vec<_>>())
        };
        assert!(bits(&a) == bits(&b));
    }
}
