//! One scene seen through the pixels of a square picture, by every way that appendix A compares.
//!
//! Primary rays alone, one thread. The first round counts and keeps the hits, the rounds after it are timed, each way in turn.

use std::ops::ControlFlow;
use std::time::Instant;

use hybray::build::{Settings as Build, Source, build};
use hybray_bintree::cut::Primitives as _;
use hybray_bintree::midpoint::{self, Tree};
use hybray_bintree::walk::{Counts, Hit, Resident, Stack, Walked, nearest};
use hybray_bintree::{BinaryNode, Item};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Aabb, Candidate, Cone, Pyramid, Ray, RayKernel, Sphere, Triangle};
use hybray_pyraclip::{ClipCell, ClipCounts, ClipPyramid, TraverseCounts, clip, traverse, wide};
use hybray_scene::Kind;
use hybray_tests::{camera_rays, kernels, scene};

use super::bintree::{self, Waiting};
use super::grid::Grid;

/// A way to the nearest hits. Pyramids are told by how many of them lie side by side in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// One ray after the other, recursively, in the midpoint tree.
    Single,
    /// The appendix's form on the midpoint tree.
    PyraClip(u32),
    /// Voxel by voxel.
    Grid,
    /// One ray after the other in the tree of eight-wide nodes by surface area.
    WideSingle,
    /// Bundles in that tree.
    WideBundles(u32),
}

/// What is wanted of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// A built-in scene.
    pub scene: String,
    /// Columns and rows of the picture, a power of two.
    pub side: u32,
    /// The ways, each once.
    pub ways: Vec<Way>,
    /// How often each is timed.
    pub rounds: usize,
}

impl Job {
    /// The same on a model of a few objects, in a picture that has a pixel for each pyramid.
    pub fn small(&self) -> Self {
        let scene = self.scene.rsplit_once(':').map_or("", |(model, _)| model).to_owned() + ":2";
        let side = |way: &Way| if let Way::PyraClip(side) | Way::WideBundles(side) = *way { side } else { 1 };
        Self { scene, side: self.ways.iter().map(side).fold(1, u32::max), ..self.clone() }
    }
}

/// What a way did, all rays together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// To make cliplists: cells of the midpoint tree, or eight-wide nodes.
    pub clipped: u64,
    /// Leaves on cliplists.
    pub listed: u64,
    /// Bundles that got no list, because it would be too long or they are not coherent.
    pub without_list: u64,
    /// Along the rays: cells of a tree or a list, voxels, eight-wide nodes.
    pub steps: u64,
    /// Tests of one ray against one object; of blocks of four in the wide tree, there by eight rays in a bundle.
    pub tests: u64,
}

/// What a way came to.
#[derive(Clone, Debug)]
pub struct Taken {
    pub way: Way,
    pub tally: Tally,
    /// Seconds in each round, those for cliplists included.
    pub seconds: Vec<f64>,
    /// Those for cliplists.
    pub clip_seconds: Vec<f64>,
}

/// What a scene came to.
#[derive(Clone, Debug)]
pub struct Measured {
    pub primitives: u64,
    pub rays: u64,
    /// Rays that hit something.
    pub hits: u64,
    /// As the job has them.
    pub ways: Vec<Taken>,
}

/// The appendix's limits of its tree: 18 levels for small models, 24 for large ones.
fn limits(primitives: usize) -> midpoint::Settings {
    midpoint::Settings { depth_max: if primitives > 10_000 { 24 } else { 18 }, objects_max: 12 }
}

/// Makes every way see the scene.
///
/// # Errors
/// What went wrong; a ray that two ways take to different hits is an error.
pub fn measure(job: &Job) -> Result<Measured, String> {
    let model = scene(&job.scene);
    let (source, scale_log2) = Source::new(&model).map_err(|e| e.to_string())?;
    let rays = camera_rays(&model, 2f32.powi(scale_log2), job.side);
    let mut objects = Objects::new(&source);
    let has = |of: fn(&Way) -> bool| job.ways.iter().any(of);

    let mut room =
        Room::new(if has(|way| matches!(way, Way::Single | Way::PyraClip(_))) { &objects.boxes } else { &[] });
    let tree = room.tree()?;
    let boxes: Vec<Aabb> = objects.boxes.iter().map(Item::aabb).collect();
    let grid = has(|way| *way == Way::Grid).then(|| Grid::new(&boxes));
    let packed = build(&model, &Build::default()).map_err(|e| e.to_string())?;
    let pages = packed.open().map_err(|e| e.to_string())?;
    let resident = pages.resident();

    let mut fast = Fast { kernels: kernels(), scene: &resident, ..Fast::new(&resident) };
    let mut listing = Listing::default();
    let mut walk = |way: Way, hits: &mut [Candidate]| match way {
        Way::Single => single(&tree, &rays, &mut objects, &mut listing, hits),
        Way::PyraClip(side) => pyraclip(&tree, &rays, per_pyramid(&rays, side), &mut objects, &mut listing, hits),
        Way::Grid => grid.as_ref().map_or_else(Default::default, |grid| in_grid(grid, &rays, &mut objects, hits)),
        Way::WideSingle => fast.single(&rays, hits),
        Way::WideBundles(side) => fast.bundles(&rays, per_pyramid(&rays, side), hits),
    };

    let mut expected: Vec<Candidate> = Vec::new();
    let mut found = vec![Candidate::none(0.0); rays.len()];
    let mut ways = Vec::new();
    for &way in &job.ways {
        let (tally, _) = walk(way, &mut found);
        if expected.is_empty() {
            expected.clone_from(&found);
        }
        if let Some(ray) = (0..rays.len()).find(|&ray| found[ray] != expected[ray]) {
            let (first, here, there) = (job.ways[0], expected[ray], found[ray]);
            return Err(format!("ray {ray}: {here:?} by {first:?}, {there:?} by {way:?}"));
        }
        ways.push(Taken { way, tally, seconds: Vec::new(), clip_seconds: Vec::new() });
    }
    for _ in 0..job.rounds {
        for taken in &mut ways {
            let start = Instant::now();
            let (_, clip_seconds) = walk(taken.way, &mut found);
            taken.seconds.push(start.elapsed().as_secs_f64());
            taken.clip_seconds.push(clip_seconds);
        }
    }
    // Cliplists of bundles are made by themselves, once: where a bundle goes along its list, nobody can watch.
    for taken in &mut ways {
        if let Way::WideBundles(side) = taken.way {
            fast.lists(&rays, per_pyramid(&rays, side), &mut taken.tally);
        }
    }
    let hits = expected.iter().filter(|hit| hit.is_hit()).count() as u64;
    Ok(Measured { primitives: u64::from(source.len()), rays: rays.len() as u64, hits, ways })
}

/// Rays of a pyramid, of `side` times `side` in the picture.
fn per_pyramid(rays: &[Ray], side: u32) -> usize {
    rays.len() / (side * side) as usize
}

enum Primitive {
    Triangle(Triangle),
    Sphere(Sphere),
    Cone(Cone),
}

/// What the ways of 1995 test. An object that stands in several cells is tested once for each ray, as Rayshade has it.
struct Objects {
    boxes: Vec<Item>,
    primitives: Vec<Primitive>,
    /// The last ray that each was tested against.
    tested: Vec<u32>,
    ray: u32,
    tests: u64,
}

impl Objects {
    fn new(source: &Source<'_>) -> Self {
        let items = (0..source.len()).map(|id| {
            let (kind, aabb) = source.aabb(id);
            Item::new(&aabb, kind, id)
        });
        let boxes: Vec<Item> = items.collect();
        let primitive = |item: &Item| match item.kind {
            Kind::Triangle => Primitive::Triangle(source.triangle(item.id)),
            Kind::Sphere => Primitive::Sphere(source.sphere(item.id)),
            Kind::Cone => Primitive::Cone(source.cone(item.id)),
        };
        let primitives = boxes.iter().map(primitive).collect();
        Self { tested: vec![0; boxes.len()], boxes, primitives, ray: 0, tests: 0 }
    }

    fn next_ray(&mut self) {
        self.ray = self.ray.wrapping_add(1);
        if self.ray == 0 {
            self.tested.fill(0);
            self.ray = 1;
        }
    }

    #[inline]
    fn test(&mut self, ray: &RayKernel, id: u32, best: &mut Candidate) {
        let tested = &mut self.tested[id as usize];
        if *tested == self.ray {
            return;
        }
        *tested = self.ray;
        self.tests += 1;
        let hit = match &self.primitives[id as usize] {
            Primitive::Triangle(triangle) => triangle.hit(ray, id, best),
            Primitive::Sphere(sphere) => sphere.hit(ray, id, best),
            Primitive::Cone(cone) => cone.hit(ray, id, best),
        };
        if let Some(hit) = hit {
            *best = hit;
        }
    }
}

/// What a midpoint tree stands in.
struct Room {
    count: usize,
    items: Vec<Item>,
    leaves: Vec<Item>,
    nodes: Vec<BinaryNode>,
}

impl Room {
    /// Objects of the appendix's models stand in fewer than 6 cells on average.
    fn new(boxes: &[Item]) -> Self {
        let count = boxes.len();
        let most = 8 * count + 4096;
        let mut items = boxes.to_vec();
        if let Some(&first) = boxes.first() {
            items.resize(most, first);
        }
        Self { count, leaves: items.clone(), items, nodes: vec![BinaryNode::EMPTY; most] }
    }

    fn tree(&mut self) -> Result<Tree<'_>, String> {
        let most = self.nodes.len();
        let tree = midpoint::build(&mut self.items, self.count, &mut self.leaves, &mut self.nodes, &limits(self.count));
        // A tree that has no room stops splitting: it would be another tree.
        if tree.items.len().max(tree.nodes.len()) > most - most / 8 {
            return Err(format!("no room for a midpoint tree of {} objects", self.count));
        }
        Ok(tree)
    }
}

/// Room for walks of the tree.
#[derive(Default)]
struct Listing {
    cells: Vec<ClipCell<u32>>,
    waiting: Vec<Waiting>,
}

/// What it did, and seconds for cliplists.
type Done = (Tally, f64);

fn single(tree: &Tree<'_>, rays: &[Ray], objects: &mut Objects, listing: &mut Listing, hits: &mut [Candidate]) -> Done {
    let mut tally = Tally::default();
    objects.tests = 0;
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = alone(tree, ray, objects, listing, &mut tally);
    }
    (Tally { tests: objects.tests, ..tally }, 0.0)
}

fn alone(tree: &Tree<'_>, ray: &Ray, objects: &mut Objects, listing: &mut Listing, tally: &mut Tally) -> Candidate {
    objects.next_ray();
    let (kernel, best) = (RayKernel::new(ray), Candidate::none(ray.t_max));
    bintree::walk(tree, &kernel, best, &mut listing.waiting, &mut tally.steps, |id, best| {
        objects.test(&kernel, id, best);
    })
}

/// The pyramid around a square of rays that stand in Morton's order.
fn pyramid(rays: &[Ray]) -> Option<ClipPyramid> {
    let last = rays.len() - 1;
    let corners = [0, last & 0x5555_5555, last, last & 0xaaaa_aaaa].map(|ray| rays[ray].direction);
    ClipPyramid::new(&Pyramid::through(rays[0].origin, corners)?)
}

fn pyraclip(
    tree: &Tree<'_>,
    rays: &[Ray],
    per_pyramid: usize,
    objects: &mut Objects,
    listing: &mut Listing,
    hits: &mut [Candidate],
) -> Done {
    let (mut tally, mut clips, mut walks) = (Tally::default(), ClipCounts::default(), TraverseCounts::default());
    let mut clip_seconds = 0.0;
    objects.tests = 0;
    for (rays, hits) in rays.chunks(per_pyramid).zip(hits.chunks_mut(per_pyramid)) {
        let start = Instant::now();
        listing.cells.clear();
        let pyramid = pyramid(rays).filter(|pyramid| {
            let list = clip(tree, pyramid, &mut clips, |cell| {
                listing.cells.push(cell);
                ControlFlow::Continue(())
            });
            list.is_ok()
        });
        clip_seconds += start.elapsed().as_secs_f64();
        tally.without_list += u64::from(pyramid.is_none());
        for (ray, hit) in rays.iter().zip(hits) {
            if !pyramid.is_some_and(|pyramid| pyramid.holds(ray)) {
                *hit = alone(tree, ray, objects, listing, &mut tally);
                continue;
            }
            objects.next_ray();
            let (kernel, best) = (RayKernel::new(ray), Candidate::none(ray.t_max));
            *hit = traverse(&listing.cells, &kernel, best, &mut walks, |cell, best| {
                let node = &tree.nodes[cell.cell as usize];
                for item in &tree.items[node.first as usize..][..node.count as usize] {
                    objects.test(&kernel, item.id, best);
                }
            });
        }
    }
    tally.clipped = clips.classified + clips.untested;
    tally.listed = clips.listed;
    tally.steps += walks.exits;
    (Tally { tests: objects.tests, ..tally }, clip_seconds)
}

fn in_grid(grid: &Grid, rays: &[Ray], objects: &mut Objects, hits: &mut [Candidate]) -> Done {
    let mut tally = Tally::default();
    objects.tests = 0;
    for (ray, hit) in rays.iter().zip(hits) {
        objects.next_ray();
        let (kernel, best) = (RayKernel::new(ray), Candidate::none(ray.t_max));
        *hit = grid.walk(&kernel, best, &mut tally.steps, |id, best| objects.test(&kernel, id, best));
    }
    (Tally { tests: objects.tests, ..tally }, 0.0)
}

/// The product's own kernels.
struct Fast<'s> {
    kernels: Kernels,
    scene: &'s Resident<'s>,
    stack: Stack,
    scratch: wide::Scratch,
    walked: Vec<Walked>,
}

impl<'s> Fast<'s> {
    fn new(scene: &'s Resident<'s>) -> Self {
        let walked = vec![Walked { best: Hit::none(0.0), needs: None }; wide::RAYS_MAX];
        let (stack, scratch) = (Stack::new(), wide::Scratch::new());
        Self { kernels: Kernels::Portable, scene, stack, scratch, walked }
    }

    fn single(&mut self, rays: &[Ray], hits: &mut [Candidate]) -> Done {
        let mut counts = Counts::default();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = nearest(self.kernels, self.scene, ray, &mut self.stack, &mut counts).candidate;
        }
        (Tally { steps: counts.nodes, tests: counts.blocks, ..Tally::default() }, 0.0)
    }

    fn bundles(&mut self, rays: &[Ray], per_bundle: usize, hits: &mut [Candidate]) -> Done {
        let mut counts = Counts::default();
        let Self { kernels, scene, stack, scratch, walked } = self;
        for (rays, hits) in rays.chunks(per_bundle).zip(hits.chunks_mut(per_bundle)) {
            wide::nearest(*kernels, scene, rays, walked, scratch, stack, &mut counts);
            for (hit, walked) in hits.iter_mut().zip(&*walked) {
                *hit = walked.best.candidate;
            }
        }
        (Tally { steps: counts.nodes, tests: counts.blocks, ..Tally::default() }, 0.0)
    }

    fn lists(&mut self, rays: &[Ray], per_bundle: usize, tally: &mut Tally) {
        let mut counts = Counts::default();
        for rays in rays.chunks(per_bundle) {
            let list = self.scratch.clip(self.kernels, self.scene, rays, &mut counts).map(Iterator::count);
            tally.without_list += u64::from(list.is_none());
            tally.listed += list.unwrap_or(0) as u64;
        }
        tally.clipped = counts.nodes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_tests::brute_force;

    /// Every way finds what testing every object finds, at every size of pyramids, and does some of what it is counted for.
    fn check(scene_name: &str, side: u32) {
        let sizes = (1..side.ilog2()).map(|power| 1 << power);
        let mut ways = vec![Way::WideSingle, Way::Single, Way::Grid];
        ways.extend(sizes.clone().map(Way::PyraClip));
        ways.extend(sizes.filter(|size| (side / size).pow(2) <= wide::RAYS_MAX as u32).map(Way::WideBundles));
        let found = measure(&Job { scene: scene_name.into(), side, ways, rounds: 1 });
        let found = found.unwrap_or_else(|e| panic!("{scene_name}: {e}"));

        let model = scene(scene_name);
        let (source, scale_log2) = Source::new(&model).unwrap();
        let rays = camera_rays(&model, 2f32.powi(scale_log2), side);
        let expected: Vec<Candidate> = rays.iter().map(|ray| brute_force(&source, ray)).collect();
        let (resident, kernels) = (build(&model, &Build::default()).unwrap(), kernels());
        let pages = resident.open().unwrap();
        let mut hits = vec![Candidate::none(0.0); rays.len()];
        Fast { kernels, ..Fast::new(&pages.resident()) }.single(&rays, &mut hits);
        assert_eq!(hits, expected, "{scene_name}");
        assert_eq!(found.hits, expected.iter().filter(|hit| hit.is_hit()).count() as u64);
        assert!(found.hits * 5 > found.rays, "{scene_name}: {} hits", found.hits);

        let tally = |way| found.ways.iter().find(|taken| taken.way == way).unwrap().tally;
        for taken in &found.ways {
            let Tally { clipped, listed, without_list, steps, tests } = taken.tally;
            let all = found.rays * found.primitives;
            assert!(tests >= found.hits / 8 && tests < all && steps > 0, "{taken:?}");
            // Fewer than eight rays have no list.
            let by_list = match taken.way {
                Way::PyraClip(_) => true,
                Way::WideBundles(size) => (side / size).pow(2) >= 8,
                _ => false,
            };
            assert_eq!((clipped > 0, listed > 0), (by_list, by_list), "{taken:?}");
            if let Way::PyraClip(_) = taken.way {
                assert_eq!(without_list, 0, "{taken:?}");
            }
            assert_eq!(taken.seconds.len(), 1);
        }
        // More pyramids: more clipping, and no ray that goes along a longer list.
        for size in (1..side.ilog2() - 1).map(|power| 1 << power) {
            let (large, small) = (tally(Way::PyraClip(size)), tally(Way::PyraClip(2 * size)));
            assert!(large.clipped < small.clipped && large.steps > small.steps, "{size}: {large:?} {small:?}");
            assert!(small.tests <= large.tests, "{size}: {large:?} {small:?}");
        }
    }

    #[test]
    fn balls_by_every_way() {
        check("spd:balls:2", 64);
    }

    #[test]
    fn a_teapot_by_every_way() {
        check("spd:teapot:4", 64);
    }
}
