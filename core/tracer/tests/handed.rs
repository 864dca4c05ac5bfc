//! Rays that go from store to store, each with some of the pages, bring what they bring where every page is at hand.

mod world;

use hybray_bintree::walk::Stack;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Vec3};
use hybray_scene::{PageView, Pages, parents};
use hybray_shading::id;
use hybray_tracer::{HitRecord, Lane, Origin, Scene, Sink, Together, Walker};
use hybray_wire::{Counts, RayKind, RayRecord, ShadowRecord};
use std::collections::BTreeMap;
use world::{World, full_hall};

/// Splitmix64.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % n as u64) as usize
    }
}

/// Some of a scene's pages.
struct Share<'a> {
    all: &'a [PageView<'a>],
    here: Vec<bool>,
    parents: &'a [u32],
}

impl Pages for Share<'_> {
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.here[number as usize].then(|| self.all[number as usize])
    }
    fn parents(&self) -> &[u32] {
        self.parents
    }
}

const TILE: u32 = 5;
const HOME: u16 = 3;

/// A film of one tile: fixed-point sums and all contributions by pixel, and the ledger.
#[derive(Default, Debug, PartialEq)]
struct Film {
    sums: BTreeMap<u8, [i128; 3]>,
    contributions: BTreeMap<u8, Vec<[u32; 3]>>,
    entries: u64,
    ended: u64,
}

impl Sink for Film {
    fn contribute(&mut self, origin: &Origin, radiance: [f32; 3]) {
        assert_eq!((origin.tile, origin.epoch, origin.home), (TILE, 2, HOME));
        let sum = self.sums.entry(origin.pixel).or_default();
        (0..3).for_each(|c| sum[c] += (f64::from(radiance[c]) * 2f64.powi(40)).round() as i128);
        self.contributions.entry(origin.pixel).or_default().push(radiance.map(f32::to_bits));
    }
    fn ended(&mut self, origin: &Origin, entry: u64) {
        assert_eq!((origin.tile, origin.epoch, origin.home), (TILE, 2, HOME));
        self.entries = self.entries.wrapping_add(entry);
        self.ended += 1;
    }
}

impl Film {
    fn sorted(mut self) -> Self {
        self.contributions.values_mut().for_each(|of_pixel| of_pixel.sort_unstable());
        self
    }
}

fn primaries(count: u32) -> Vec<RayRecord> {
    let ray = |i: u32| {
        let [u, v] = id::unit_pair(7, i);
        let eye = Vec3::new(0.2, 0.6, 2.0);
        let direction = Vec3::new(2.4 * u - 1.2, 0.9 * v, 0.0) - eye;
        RayRecord {
            origin: eye.to_array(),
            direction: (direction / direction.length()).to_array(),
            t_max: f32::INFINITY,
            id: id::primary_id(1, i, 0),
            primitive: Candidate::NOTHING,
            weight: [1.0; 3],
            pixel: (i % 64) as u8,
            tile: TILE,
            epoch: 2,
            home: HOME,
            page: RayRecord::FROM_ROOT,
            kind: RayKind::Primary as u8,
            depth: 1,
            ..bytemuck::Zeroable::zeroed()
        }
    };
    (0..count).map(ray).collect()
}

/// How rays travelled.
#[derive(Default, Debug)]
struct Journeys {
    carried: u64,
    nearest: u64,
    shadows: u64,
    settled: u64,
    behind_glass: u64,
    /// Shadow rays of which a part was found free.
    cut: u64,
}

/// Takes a ray on at a store, with all that it causes there; what needs another store comes back.
fn trace<P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    kernels: Kernels,
    ray: RayRecord,
    film: &mut Film,
    counts: &mut Counts,
    back: &mut Vec<RayRecord>,
    bundles: bool,
) {
    let (mut stack, mut together, mut room) = (Stack::new(), Together::new(), [HitRecord::EMPTY; 5]);
    let mut walker = Walker { past: true, bundles, ..Walker::new(kernels, &mut stack, &mut together) };
    let mut lane = Lane::new(&mut room);
    back.extend(lane.take(scene, &mut walker, ray, film, counts));
    while !lane.is_empty() {
        back.extend(lane.step(scene, &mut walker, film, counts));
    }
}

fn check(seed: u64, scene: &Scene<'_>, journeys: &mut Journeys) {
    let mut random = Random(seed);
    let primaries = primaries(400);
    let kernels: Vec<_> = Kernels::available().collect();

    let (mut expected, mut expected_counts, mut back) = (Film::default(), Counts::default(), Vec::new());
    for &ray in &primaries {
        trace(scene, Kernels::Portable, ray, &mut expected, &mut expected_counts, &mut back, false);
    }
    assert_eq!(back, [], "seed {seed}: every page is at hand");
    let owed = primaries.iter().fold(0u64, |sum, ray| sum.wrapping_sub(ray.id));
    assert_eq!(expected.entries, owed, "seed {seed}");

    let all = scene.resident.pages;
    let nodes = scene.resident.directory.nodes;
    let mut hang = vec![0; nodes.len() + all.len()];
    parents(nodes, &mut hang);
    let held = 1 + random.below(4);
    let mut stores: Vec<Share<'_>> = (0..2 + random.below(5))
        .map(|_| Share { all, here: all.iter().map(|_| random.below(4) < held - 1).collect(), parents: &hang })
        .collect();
    for page in 0..all.len() {
        let owner = random.below(stores.len());
        stores[owner].here[page] = true;
    }

    let (mut film, mut counts) = (Film::default(), Counts::default());
    let mut waiting = primaries;
    while !waiting.is_empty() {
        let ray = waiting.swap_remove(random.below(waiting.len()));
        let with: Vec<&Share<'_>> = match ray.page {
            RayRecord::FROM_ROOT => stores.iter().collect(),
            page => stores.iter().filter(|store| store.here[page as usize]).collect(),
        };
        let store = with[random.below(with.len())];
        let kernels = kernels[random.below(kernels.len())];
        let mut back = Vec::new();
        trace(&scene.at_hand(store), kernels, ray, &mut film, &mut counts, &mut back, random.below(2) == 0);
        for ray in back {
            assert!(!store.here[ray.page as usize], "seed {seed}: the page is at hand: {ray:?}");
            journeys.carried += 1;
            journeys.settled += u64::from(ray.settled);
            journeys.behind_glass += u64::from(ray.passed > 0);
            let is_shadow = ray.ray_kind() == RayKind::Shadow;
            journeys.shadows += u64::from(is_shadow);
            journeys.nearest += u64::from(!is_shadow);
            journeys.cut += u64::from(is_shadow && ray.t_max < ray.t_end);
            // Over the wire, in the record that it has there.
            let compact = is_shadow && !scene.transmits;
            waiting.push(if compact { RayRecord::from(&ShadowRecord::from(&ray)) } else { ray });
        }
        assert!(journeys.carried < 50_000_000, "seed {seed}: rays come to an end");
    }
    assert_eq!(counts, expected_counts, "seed {seed}");
    assert_eq!(film.sorted(), expected.sorted(), "seed {seed}");
}

fn check_world(world: &World, seeds: u64, transmits: bool) {
    let mut journeys = Journeys::default();
    for seed in 0..seeds {
        let page_bytes = [640, 1024, 2048][seed as usize % 3];
        world.with_pages(page_bytes, |scene| {
            assert_eq!(scene.transmits, transmits);
            assert!(scene.resident.pages.len() > 5, "{} pages", scene.resident.pages.len());
            check(seed, scene, &mut journeys);
        });
    }
    println!("{journeys:?}");
    assert!(journeys.nearest > 1000 && journeys.shadows > 1000 && journeys.settled > 4 * seeds, "{journeys:?}");
    assert_eq!(journeys.behind_glass > 100, transmits, "{journeys:?}");
    assert!(transmits || journeys.cut > 100, "{journeys:?}");
}

#[test]
fn carried_rays_bring_the_same_through_glass() {
    check_world(&full_hall(), 24, true);
    check_world(&full_hall().softly_lit(), 3, true);
}

#[test]
fn carried_rays_bring_the_same_without_glass() {
    check_world(&full_hall().opaque(), 24, false);
    check_world(&full_hall().softly_lit().opaque(), 3, false);
}
