//! What a picture will need of its scene: a few of its rays, traced before it begins (importance: report, chapter 8).
//!
//! Up to four rays in each tile, and all that they cause, stand for the tile: what they cost says how the picture is best
//! divided, and which pages they open says where pages are best kept. No picture depends on it, only the time that it takes.
//! All processors of the host work at it; what is found does not depend on how many they are.

use bytemuck::Zeroable;
use hybray_bintree::walk::{self, FROM_ROOT, Stack};
use hybray_geometry::Candidate;
use hybray_geometry::simd::Kernels;
use hybray_scene::{PageView, Pages};
use hybray_scheduler::DEPTH_MAX;
use hybray_scheduler::policy::Policy;
use hybray_shading::{Camera, id};
use hybray_tracer::{HitRecord, Lane, Origin, Scene, Sink, Together, Walker};
use hybray_wire::{Counts, Frame, RayKind, RayRecord, TileMap};
use std::cell::RefCell;
use std::num::NonZero;
use std::ops::Range;

/// Rays of the picture that are traced at most if nobody says, those that they cause not counted.
pub const PILOT_RAYS: u32 = 16_384;
/// Where in a tile, in quarters of its side: the middle if it is only one.
const PLACES: [[u32; 2]; 4] = [[1, 1], [3, 3], [3, 1], [1, 3]];
/// What a ray and a hit cost beside their walk, in nodes and blocks.
const RAY_COST: u64 = 4;

/// What rays of one tile, or of some that follow each other, found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Look {
    /// Nodes, blocks, rays and hits, weighted: never 0.
    cost: u64,
    /// Pages that they opened, as often as they did.
    pages: Vec<u32>,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pilot {
    tiles: u32,
    /// Tiles that one look stands for.
    step: u32,
    looks: Vec<Look>,
    /// What walks did for it.
    pub walks: walk::Counts,
    /// Rays and hits.
    pub counts: Counts,
}

/// A division of the picture among nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// The first tile of each node's part, node 1's first, and after these the number of tiles.
    pub bounds: Vec<u32>,
    /// For each node, pages that its part opened, in ascending order, and how often.
    pub uses: Vec<Vec<(u32, u32)>>,
}

/// Pages that are at hand, and which of them were opened.
struct Watched<'a> {
    pages: &'a [PageView<'a>],
    opened: RefCell<Vec<u32>>,
}

impl Pages for Watched<'_> {
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.opened.borrow_mut().push(number);
        self.pages.get(number as usize).copied()
    }
}

/// What rays bring is not of interest.
struct Nowhere;

impl Sink for Nowhere {
    fn contribute(&mut self, _: &Origin, _: [f32; 3]) {}
    fn ended(&mut self, _: &Origin, _: u64) {}
}

/// What is looked at ahead of a picture.
struct Ahead<'a> {
    scene: &'a Scene<'a>,
    frame: &'a Frame,
    camera: Camera,
    map: TileMap,
    step: u32,
    places: &'a [[u32; 2]],
}

impl Ahead<'_> {
    /// Takes the looks of these numbers: one every `step` tiles.
    fn look(&self, looks: Range<u32>) -> Pilot {
        let Self { frame, map, .. } = self;
        let depth_max = usize::from(frame.depth_max).min(DEPTH_MAX);
        let mut scene = *self.scene;
        scene.shading.ray_depth_max = depth_max as u32;
        scene.shading.weight_cutoff = frame.weight_cutoff;
        let watched = Watched { pages: scene.resident.pages, opened: RefCell::default() };
        let scene = scene.at_hand(&watched);
        let (mut stack, mut together) = (Stack::new(), Together::new());
        let mut records = vec![HitRecord::EMPTY; depth_max + 1];
        let mut walker = Walker::new(Kernels::Portable, &mut stack, &mut together);
        let mut counts = Counts::default();
        let cost = |walker: &Walker<'_>, counts: &Counts| {
            let rays = counts.primary + counts.secondary + counts.shadow;
            walker.counts.nodes + walker.counts.blocks + RAY_COST * (rays + counts.hits)
        };
        let mut found = Vec::new();
        for tile in looks.map(|look| look * self.step) {
            let (before, shape) = (cost(&walker, &counts), map.tile(tile));
            for [right, down] in self.places.iter().map(|&place| if self.places.len() == 1 { [2, 2] } else { place }) {
                let (x, y) = (shape.x + shape.width * right / 4, shape.y + shape.height * down / 4);
                let seen = self.camera.ray(x, y, [0.5; 2]);
                let ray = RayRecord {
                    origin: seen.origin.to_array(),
                    direction: seen.direction.to_array(),
                    t_min: seen.t_min,
                    t_max: f32::INFINITY,
                    id: id::primary_id(frame.seed, y * frame.width + x, 0),
                    primitive: Candidate::NOTHING,
                    weight: [1.0; 3],
                    page: FROM_ROOT,
                    kind: RayKind::Primary as u8,
                    depth: 1,
                    ..RayRecord::zeroed()
                };
                counts.primary += 1;
                // No ray comes back: every page is at hand.
                let mut lane = Lane::new(&mut records);
                let _ = lane.take(&scene, &mut walker, ray, &mut Nowhere, &mut counts);
                while !lane.is_empty() {
                    let _ = lane.step(&scene, &mut walker, &mut Nowhere, &mut counts);
                }
            }
            found.push(Look { cost: cost(&walker, &counts) - before, pages: watched.opened.take() });
        }
        Pilot { looks: found, walks: walker.counts, counts, ..Pilot::default() }
    }
}

impl Pilot {
    /// What goes ahead of `frame` under `policy`, of at most so many rays: the others than `hybrid` place pages as published.
    #[must_use]
    pub fn of_policy(policy: Policy, scene: &Scene<'_>, frame: &Frame, rays_max: u32) -> Option<Self> {
        (policy == Policy::Hybrid).then(|| Self::trace(scene, frame, rays_max)).flatten()
    }

    /// Traces at most `rays_max` rays of `frame`, and what they cause, with every page at hand. `None` if it is none, or the
    /// picture cannot be drawn.
    ///
    /// The portable kernels count the same on every processor, so that what is decided by it is the same, too.
    #[must_use]
    pub fn trace(scene: &Scene<'_>, frame: &Frame, rays_max: u32) -> Option<Self> {
        let threads = std::thread::available_parallelism().map_or(1, NonZero::get);
        Self::trace_with(scene, frame, rays_max, threads)
    }

    fn trace_with(scene: &Scene<'_>, frame: &Frame, rays_max: u32, threads: usize) -> Option<Self> {
        let Frame { width, height, .. } = *frame;
        let camera = hybray_scheduler::camera(frame).ok()?;
        let map = TileMap::new(width, height)?;
        let tiles = map.len();
        if rays_max == 0 || tiles == 0 {
            return None;
        }
        let step = tiles.div_ceil(rays_max);
        let places = &PLACES[..((rays_max / tiles).clamp(1, 4)) as usize];
        let ahead = Ahead { scene, frame, camera, map, step, places };
        // Each thread has tiles that follow each other: pages are opened again while they are warm.
        let looks = tiles.div_ceil(step);
        let share = looks.div_ceil(threads.clamp(1, looks as usize) as u32);
        let parts: Vec<Self> = std::thread::scope(|scope| {
            let spawn = |first: u32| {
                scope.spawn({
                    let ahead = &ahead;
                    move || ahead.look(first..(first + share).min(looks))
                })
            };
            let threads: Vec<_> = (0..looks).step_by(share as usize).map(spawn).collect();
            threads.into_iter().map(|thread| thread.join().expect("looking ahead does not panic")).collect()
        });
        let mut all = Self { tiles, step, ..Self::default() };
        for part in parts {
            all.looks.extend(part.looks);
            all.walks += part.walks;
            all.counts += part.counts;
        }
        Some(all)
    }

    /// Divides the picture among `nodes` into pieces that follow each other and cost as much; the first node's is `first`
    /// times as large as others' (less than 1 if it has other things to do). Pieces begin at squares of four tiles.
    #[must_use]
    pub fn parts(&self, nodes: u16, first: f64) -> Parts {
        let total: u64 = self.looks.iter().map(|look| look.cost).sum();
        let shares = f64::from(nodes) - 1.0 + first;
        let part = |middle: f64| {
            let at = middle / (total as f64).max(1.0) * shares;
            if at < first { 0 } else { ((at - first) as usize + 1).min(usize::from(nodes) - 1) }
        };
        let mut bounds = vec![0; usize::from(nodes) + 1];
        let mut opened = vec![Vec::new(); usize::from(nodes)];
        let mut before = 0;
        for (tile, look) in (0..).step_by(self.step.max(1) as usize).zip(&self.looks) {
            let part = part(before as f64 + look.cost as f64 / 2.0);
            before += look.cost;
            opened[part].extend_from_slice(&look.pages);
            let end: u32 = tile + self.step;
            bounds[part + 1..].fill(end.next_multiple_of(4).min(self.tiles));
        }
        let uses = opened.into_iter().map(|mut pages| {
            pages.sort_unstable();
            pages.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u32)).collect()
        });
        if let Some(last) = bounds.last_mut() {
            *last = self.tiles;
        }
        Parts { bounds, uses: uses.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::owners::tests::Random;
    use super::*;
    use crate::model::Settings;
    use crate::prepare::Prepared;
    use crate::{build, import};

    /// Any number of threads finds the same, and no more rays are traced than were asked for but for one a tile.
    #[test]
    fn threads_do_not_matter() {
        let model = import::load("spd:balls:2").unwrap();
        let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
        let pages = prepared.packed.open().unwrap();
        let scene = prepared.scene(&pages);
        let size = Settings { size: Some([200, 90]), ..Settings::default() };
        let frame = prepared.frame(&prepared.cameras[0], &size);
        // 25 x 12 tiles.
        for (rays_max, looks, places) in
            [(1, 1, 1), (7, 7, 1), (100, 100, 1), (300, 300, 1), (899, 300, 2), (5000, 300, 4)]
        {
            let alone = Pilot::trace_with(&scene, &frame, rays_max, 1).unwrap();
            assert_eq!((alone.tiles, alone.looks.len(), alone.counts.primary), (300, looks, looks as u64 * places));
            assert!(alone.looks.iter().any(|look| !look.pages.is_empty()) && alone.walks.nodes > 0);
            for threads in [2, 3, 7, 64, 1000] {
                assert_eq!(Pilot::trace_with(&scene, &frame, rays_max, threads).as_ref(), Some(&alone), "{threads}");
            }
        }
        assert_eq!(Pilot::trace(&scene, &frame, 0), None);
    }

    /// Parts cost as much as each other, to within what can be had: a square of tiles more or less.
    #[test]
    fn parts_are_of_equal_cost() {
        for seed in 0..300 {
            let random = &mut Random(seed);
            let (nodes, tiles, step) =
                (1 + random.below(40) as u16, 1 + random.below(900) as u32, 1 + random.below(3) as u32);
            let most = [1, 10, 1000][random.below(3) as usize];
            // The second half costs much more: parts of equal numbers of tiles would be far off.
            let look = |tile: u32, random: &mut Random| Look {
                cost: 1 + if tile < tiles / 2 { 0 } else { random.below(most) },
                pages: (0..random.below(4)).map(|_| random.below(9) as u32).collect(),
            };
            let looks = (0..tiles).step_by(step as usize).map(|tile| look(tile, random)).collect();
            let pilot = Pilot { tiles, step, looks, ..Pilot::default() };
            let first = if seed % 2 == 0 { 1.0 } else { random.below(100) as f64 / 100.0 };
            let Parts { bounds, uses } = pilot.parts(nodes, first);
            assert_eq!((bounds.len(), bounds[0], bounds[usize::from(nodes)]), (usize::from(nodes) + 1, 0, tiles));
            assert!(bounds.is_sorted());
            assert!(bounds[..usize::from(nodes)].iter().all(|b| b % 4 == 0 || *b == tiles), "{bounds:?}");
            let total: u64 = pilot.looks.iter().map(|look| look.cost).sum();
            // What a square costs at most, and a look that lies across its edge.
            let slack = (4 + 2 * step) as f64 / step as f64 * most as f64 + most as f64;
            for (node, ends) in bounds.windows(2).enumerate() {
                let tile_cost = |tile: u32| pilot.looks[(tile / step) as usize].cost as f64 / f64::from(step);
                let cost: f64 = (ends[0]..ends[1]).map(tile_cost).sum();
                let share = total as f64 / (f64::from(nodes) - 1.0 + first) * if node == 0 { first } else { 1.0 };
                assert!((cost - share).abs() <= 2.0 * slack, "seed {seed}, node {node}: {cost} of {share}");
            }
            // Every page that was opened is counted once.
            let mut counted = [0; 9];
            uses.iter().flatten().for_each(|&(page, count)| counted[page as usize] += count);
            let mut opened = [0; 9];
            pilot.looks.iter().flat_map(|look| &look.pages).for_each(|&page| opened[page as usize] += 1);
            assert_eq!(counted, opened, "seed {seed}");
        }
    }
}
