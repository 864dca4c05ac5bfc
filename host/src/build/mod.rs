//! From a [`Model`] to pages and a directory: the host's part of the work, done once.
//!
//! The scene is cut into voxels ([`crate::partition`]); each has a tree and pages of its own, and the directory stands
//! above them all. Peak memory, beside the model: 32 bytes an item, and the pages themselves. Trees are built and cut a
//! chunk at a time, in parallel, so that binary nodes and unfinished pages exist only for the chunks in work.

mod area;
mod objects;
mod packed;
mod source;
mod spill;
mod tree;
mod two_pass;

pub use objects::{Object, Objects};
pub use packed::{Packed, Pages, hash_bytes};
pub use source::Source;

pub(crate) use packed::{Index, geometry_pages, hash_page, primitives_in};
pub(crate) use two_pass::{build_in_two_passes, voxels_for};

use crate::model::Model;
use crate::partition::{Plan, Step, Voxels};
use hybray_bintree::cut::CutError;
use hybray_bintree::{Item, midpoint};
use hybray_geometry::Aabb;
use hybray_scene::{DirectoryError, Line, PAGE_BYTES_MAX, PageError, PageForm};
use packed::Assembler;
use rayon::prelude::*;
use tree::VoxelTree;

/// How cells are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Surface-area heuristic: the default.
    SurfaceArea,
    /// The 1995 report's midpoints. Levels of voxels count as levels of the tree: together they are 48 at most.
    Midpoint(midpoint::Settings),
}

/// What may be chosen about a build. None of it changes a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How cells are split.
    pub rule: Rule,
    /// Most bytes of a page.
    pub page_bytes: usize,
    /// In which form pages are.
    pub pages: PageForm,
    /// How the scene is cut.
    pub voxels: Voxels,
}

impl Default for Settings {
    fn default() -> Self {
        Self { rule: Rule::SurfaceArea, page_bytes: PAGE_BYTES_MAX, pages: PageForm::Full, voxels: Voxels::One }
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
    #[error(transparent)]
    TooMany(#[from] TooMany),
    /// The file between the two passes.
    #[error("the objects cannot be put aside in a file: {0}")]
    Spill(#[source] std::io::Error),
    /// Somebody wished it to stop.
    #[error("interrupted")]
    Interrupted,
    /// Where the pages go.
    #[error("the pages cannot be written: {0}")]
    Write(#[source] std::io::Error),
}

/// More primitives than ids can number.
#[derive(Debug, thiserror::Error)]
#[error("{0} primitives are more than the 2,147,483,647 that ids can number; leave some out")]
pub struct TooMany(pub usize);

/// Primitives that tell where work is, at most.
const SAMPLE_MAX: usize = 1 << 18;

/// Builds the tree and cuts it.
///
/// # Errors
/// See [`BuildError`].
pub fn build(model: &Model, settings: &Settings) -> Result<Packed, BuildError> {
    let (source, scale_log2) = Source::new(model)?;
    let items: Vec<Item> = (0..source.len())
        .into_par_iter()
        .map(|id| {
            let (kind, aabb) = source.aabb(id);
            Item::new(&aabb, kind, id)
        })
        .collect();
    let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.aabb()));
    let plan = {
        let stride = items.len().div_ceil(SAMPLE_MAX).max(1);
        let is_wanted = matches!(settings.voxels, Voxels::Adaptive(_));
        let sample: Vec<Item> = items.iter().step_by(stride).filter(|_| is_wanted).copied().collect();
        Plan::new(settings.voxels, &bounds, &sample)
    };
    let (mut voxels, held) = distribute(items, &plan);

    let mut assembler = Assembler::new(&plan);
    let mut pages: Vec<Vec<Line>> = Vec::new();
    // As many voxels at once as keep the processor busy; each is dropped when it is built.
    let steps = plan.above(&held);
    for steps in steps.chunks(4 * rayon::current_num_threads()) {
        let mut parts = Vec::new();
        for step in steps {
            if let Step::Voxel(voxel) = step {
                parts.push(std::mem::take(&mut voxels[*voxel as usize]));
            }
        }
        let trees = parts
            .into_par_iter()
            .map(|items| VoxelTree::build(items, &source, settings, plan.depth()))
            .collect::<Result<Vec<_>, _>>()?;
        let mut trees = trees.into_iter();
        for step in steps {
            match step {
                Step::Above(aabb) => assembler.above(aabb),
                Step::Voxel(voxel) => {
                    for tree in trees.by_ref().take(1) {
                        pages.extend(assembler.voxel(*voxel, tree));
                    }
                }
            }
        }
    }
    let mut index = assembler.finish();
    let (textures, texels) = index.add_textures(&model.textures, settings.page_bytes);
    pages.extend(texels);
    Ok(Packed::new(index, pages, scale_log2, model.materials.len(), textures))
}

/// The items of each voxel, each with the part of its box in there, and the boxes around those.
fn distribute(items: Vec<Item>, plan: &Plan) -> (Vec<Vec<Item>>, Vec<Aabb>) {
    let mut voxels = vec![Vec::new(); plan.voxels() as usize];
    let mut held = vec![Aabb::EMPTY; plan.voxels() as usize];
    if let [only] = &mut voxels[..] {
        held[0] = items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.aabb()));
        *only = items;
        return (voxels, held);
    }
    for item in items {
        plan.place(&item.aabb(), |voxel, part| {
            voxels[voxel as usize].push(Item { lo: part.lo, hi: part.hi, ..item });
            held[voxel as usize] = held[voxel as usize].union(part);
        });
    }
    (voxels, held)
}
