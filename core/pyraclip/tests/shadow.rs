//! Bundles of shadow rays against brute force: from points, to points, to and from patches, side by side, and what is none.

#[path = "../../bintree/tests/common/mod.rs"]
mod common;

use common::scenes::{mixed, table};
use common::{Random, Rule, Shapes, build, build_compact};
use hybray_bintree::walk::{Counts, Hit, Resident, Stack, Walk, Walked, occluded};
use hybray_bintree::{midpoint, sah};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Ray, Vec3};
use hybray_pyraclip::shadow::{self, RAYS_MAX};
use hybray_pyraclip::wide::Scratch;
use hybray_scene::{PageView, Pages, parents};

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

/// End of a shadow ray just before its light, as shading has it.
const JUST_SHORT: f32 = 1.0 - 8.0 / 16_777_216.0;

/// Rays from around one place to around another, in a scene as large as `size` around `middle`.
fn rays(random: &mut Random, middle: Vec3, size: f32) -> Vec<Ray> {
    let spreads = [0.0, 1e-4, 0.03, 0.3, 1.5];
    let (from, to) = (spreads[random.below(5)], spreads[random.below(5)]);
    // A light in the scene, around it, or far from it; and now and then one that stands where the hits are.
    let far = [0.8, 0.8, 3.0, 40.0, 3e4][random.below(5)];
    let origin = random.vec() * 0.9;
    let light = if random.below(12) == 0 { origin } else { random.vec() * far };
    let count = [1, 7, 8, 9, 16, 40, RAYS_MAX][random.below(7)];
    let parallel = random.below(6) == 0;
    let place = |random: &mut Random, of: Vec3, spread: f32| middle + (of + random.vec() * spread) * size;
    (0..count)
        .map(|_| {
            let origin = place(random, origin, from);
            if parallel {
                return Ray { origin, direction: light + Vec3::X * 1e-3, t_min: 0.0, t_max: f32::INFINITY };
            }
            let path = place(random, light, to) - origin;
            // A ray has a direction: shading sends none from where the light is.
            Ray {
                origin,
                direction: if path == Vec3::ZERO { Vec3::Z * size } else { path },
                t_min: 0.0,
                t_max: JUST_SHORT,
            }
        })
        .collect()
}

#[derive(Default, Debug)]
struct Totals {
    blocked: usize,
    free: usize,
    unknown: usize,
    /// Blocked by a page at hand, though others are missing.
    all_the_same: usize,
}

/// What is found among the pages that are `here`, with each way of asking.
fn check(what: &str, shapes: &Shapes, scene: &Resident<'_, Share<'_>>, rays: &[Ray], totals: &mut Totals) {
    let (mut scratch, mut stack, mut counts) = (Scratch::new(), Stack::new(), Counts::default());
    let complete = scene.pages.here.iter().all(|&here| here);
    for kernels in Kernels::available() {
        for any in [true, false] {
            // What stands there before must not matter.
            let mut walked = [Walked { best: Hit::none(-1.0), needs: Some(3) }; RAYS_MAX];
            let (w, s, t, c) = (&mut walked, &mut scratch, &mut stack, &mut counts);
            if any {
                shadow::trace::<true, _>(kernels, scene, rays, w, s, t, c);
            } else {
                shadow::trace::<false, _>(kernels, scene, rays, w, s, t, c);
            }
            for (ray, walked) in rays.iter().zip(walked) {
                let expected = shapes.brute_force(ray);
                let found = walked.best.candidate;
                if let Some(page) = walked.needs {
                    assert!(!scene.pages.here[page as usize], "{what} {any} {ray:?}: page {page} is here");
                    let (stack, counts) = (&mut stack, &mut counts);
                    let all = Walk::<true, _> { past: true, ..Walk::new(scene, ray, stack, counts) };
                    assert!(!any || !kernels.run(all).best.candidate.is_hit(), "{what} {ray:?}: it is blocked here");
                    totals.unknown += 1;
                } else if any {
                    assert_eq!(found.is_hit(), expected.is_hit(), "{what} {kernels:?} {ray:?} {found:?} {expected:?}");
                    let by = if found.is_hit() { &mut totals.blocked } else { &mut totals.free };
                    *by += 1;
                    totals.all_the_same += usize::from(found.is_hit() && !complete);
                } else {
                    assert_eq!(found, expected, "{what} {kernels:?} {ray:?}");
                }
            }
        }
    }
}

fn check_shapes(name: &str, shapes: &Shapes, seed: u64, rounds: usize, totals: &mut Totals) {
    let mut random = Random(seed);
    for rule in [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 16)] {
        let cut = [build, build_compact][seed as usize / 2 % 2];
        let Ok(built) = cut(shapes, rule, [1024, 4096][seed as usize % 2]) else { continue };
        let views = built.views();
        let resident = built.resident(&views);
        let bounds = built.nodes.first().map(|node| node.bounds());
        let (middle, size) =
            bounds.map_or((Vec3::ZERO, 1.0), |b| ((b.lo + b.hi) * 0.5, (b.hi - b.lo).max_element() * 0.5));
        let mut hang = vec![0; built.nodes.len() + views.len()];
        parents(&built.nodes, &mut hang);
        for round in 0..rounds {
            let of = 2 + random.below(12);
            let here: Vec<bool> = views.iter().map(|_| round % 2 == 0 || random.below(of) > 0).collect();
            let complete = here.iter().all(|&here| here);
            let share = Share { all: &views, here, parents: &hang };
            let scene = Resident { directory: resident.directory, pages: &share };
            let before = totals.unknown;
            let what = format!("{name} {rule:?} round {round}");
            check(&what, shapes, &scene, &rays(&mut random, middle, size), totals);
            assert!(!complete || totals.unknown == before, "{what}: everything is here");
        }
    }
}

#[test]
fn what_bundles_find_is_what_brute_force_finds() {
    let mut totals = Totals::default();
    for seed in 0..10 {
        let shapes = mixed(100 + 90 * seed as usize, seed);
        for scale in [1.0, 1e-12, 3e9] {
            let shapes = Shapes::new(shapes.iter().map(|shape| shape.scaled(scale)).collect());
            check_shapes(&format!("seed {seed} scale {scale}"), &shapes, seed, 24, &mut totals);
        }
    }
    println!("{totals:?}");
    let Totals { blocked, free, unknown, all_the_same } = totals;
    assert!(blocked > 1000 && free > 1000 && unknown > 1000 && all_the_same > 100);
}

#[test]
fn awkward_scenes_too() {
    let mut totals = Totals::default();
    for (seed, (name, shapes)) in (0..).zip(table()) {
        check_shapes(name, &shapes, seed, 8, &mut totals);
    }
    println!("{totals:?}");
    assert!(totals.blocked > 1000 && totals.free > 1000);
}

/// Nodes that single walks and a bundle look at, for 64 hits in a square of this side on a floor below many small things, and
/// a lamp above them; or the other way round, one hit and the samples of a lamp of this side.
fn nodes(side: f32, from_hits: bool) -> (u64, u64) {
    let shapes = Shapes::new(mixed(800, 5));
    let built = build(&shapes, Rule::Sah(sah::Settings::default()), 4096).unwrap();
    let views = built.views();
    let scene = built.resident(&views);
    let rays: Vec<Ray> = (0..64)
        .map(|i| {
            let wide = Vec3::new((i % 8) as f32 / 7.0 - 0.5, 0.0, (i / 8) as f32 / 7.0 - 0.5) * side;
            let (low, high) = (Vec3::new(0.1, -1.5, 0.2), Vec3::new(-0.3, 2.0, 0.1));
            let (origin, end) = if from_hits { (low + wide, high) } else { (low, high + wide) };
            Ray { origin, direction: end - origin, t_min: 0.0, t_max: JUST_SHORT }
        })
        .collect();
    let (mut scratch, mut stack) = (Scratch::new(), Stack::new());
    let (mut single, mut together) = (Counts::default(), Counts::default());
    for ray in &rays {
        let _ = occluded(Kernels::Portable, &scene, ray, &mut stack, &mut single);
    }
    let mut walked = [Walked { best: Hit::none(0.0), needs: None }; RAYS_MAX];
    let (scratch, stack) = (&mut scratch, &mut stack);
    shadow::trace::<true, _>(Kernels::Portable, &scene, &rays, &mut walked, scratch, stack, &mut together);
    (single.nodes, together.nodes)
}

/// A pyramid narrows towards its light, and towards its hit; were it made from the wide end, it would widen.
#[test]
fn neighbours_share_their_way_through_the_tree() {
    for from_hits in [true, false] {
        for side in [0.05, 0.2, 0.4] {
            let (single, together) = nodes(side, from_hits);
            println!("{side} {from_hits}: {single} nodes singly, {together} together");
            assert!(together * 5 < single, "{side} {from_hits}: {together} of {single}");
        }
    }
}
