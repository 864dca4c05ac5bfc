//! Bundles where some pages are missing: what a ray still needs leads to the hit that it has where nothing is missing.

#[path = "../../bintree/tests/common/mod.rs"]
mod common;

use common::scenes::mixed;
use common::{Random, Rule, Shapes, build, build_compact};
use hybray_bintree::walk::{Counts, Hit, Resident, Stack, Walk, Walked, nearest};
use hybray_bintree::{midpoint, sah};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Ray, Vec3};
use hybray_pyraclip::wide::{self, RAYS_MAX, Scratch};
use hybray_scene::{Child, PageView, Pages, parents};

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

/// Rays from one point into a narrow cone.
fn bundle(random: &mut Random, count: usize) -> Vec<Ray> {
    let (origin, target) = (random.vec() * 2.0, random.vec() * 0.7);
    let spread = [0.01, 0.1, 0.4][random.below(3)];
    let direction = |random: &mut Random| match target + random.vec() * spread - origin {
        Vec3::ZERO => Vec3::X,
        other => other,
    };
    (0..count).map(|_| Ray { origin, direction: direction(random), t_min: 0.0, t_max: f32::INFINITY }).collect()
}

#[test]
fn rays_of_a_bundle_go_on_where_their_pages_are() {
    let (mut scratch, mut stack, mut counts) = (Scratch::new(), Stack::new(), Counts::default());
    let (mut needed, mut whole, mut hits, mut cut_short) = (0, 0, 0, 0);
    for seed in 0..10 {
        let mut random = Random(seed);
        let shapes = Shapes::new(mixed(200 + 150 * seed as usize, seed));
        for rule in [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 4)] {
            let cut = [build, build_compact][seed as usize / 2 % 2];
            let built = cut(&shapes, rule, [1024, 4096][seed as usize % 2]).unwrap();
            let views = built.views();
            let resident = built.resident(&views);
            let mut hang = vec![0; built.nodes.len() + views.len()];
            parents(&built.nodes, &mut hang);
            for round in 0..12 {
                let of = 2 + random.below(12);
                let here: Vec<bool> = views.iter().map(|_| round == 0 || random.below(of) > 0).collect();
                let rest = Share { all: &views, here: here.iter().map(|here| !here).collect(), parents: &hang };
                let store = Share { all: &views, here, parents: &hang };
                let count = [1, 7, 8, 64, 200, RAYS_MAX][random.below(6)];
                let rays = bundle(&mut random, count);
                let available: Vec<_> = Kernels::available().collect();
                let kernels = available[random.below(available.len())];
                let scene = Resident { directory: resident.directory, pages: &store };
                let elsewhere = Resident { directory: resident.directory, pages: &rest };
                let what = format!("seed {seed} {rule:?} round {round} {kernels:?}");
                // What stands there before must not matter.
                let stale = Walked { best: Hit::none(-1.0), needs: Some(3) };
                let mut walked = vec![stale; rays.len()];
                wide::nearest(kernels, &scene, &rays, &mut walked, &mut scratch, &mut stack, &mut counts);
                for (ray, mut walked) in rays.iter().zip(walked) {
                    if walked.needs.is_some() {
                        needed += 1
                    } else {
                        whole += 1
                    }
                    assert!(round > 0 || walked.needs.is_none(), "{what}: everything is here");
                    let mut there = false;
                    let mut hops = 0;
                    while let Some(from) = walked.needs {
                        let at = if there { &rest } else { &store };
                        assert!(!at.here[from as usize], "{what}: page {from} is here");
                        there = !there;
                        let scene = if there { &elsewhere } else { &scene };
                        let (best, stack, counts) = (walked.best, &mut stack, &mut counts);
                        walked = kernels.run(Walk::<false, Share<'_>> {
                            scene,
                            ray,
                            best,
                            from,
                            past: false,
                            stack,
                            counts,
                        });
                        hops += 1;
                        assert!(hops <= views.len(), "{what}: on and on");
                    }
                    let expected = nearest(kernels, &resident, ray, &mut stack, &mut Counts::default());
                    assert_eq!(walked.best.candidate, expected.candidate, "{what} {ray:?}");
                    assert_eq!(walked.best.candidate, shapes.brute_force(ray), "{what} {ray:?}");
                    hits += usize::from(expected.candidate.is_hit());
                }
                {
                    // A list has every leaf that is met, or the page that it is in, unless it is full.
                    let all: Vec<_> =
                        scratch.clip(kernels, &resident, &rays, &mut counts).into_iter().flatten().collect();
                    let some: Vec<_> =
                        scratch.clip(kernels, &scene, &rays, &mut counts).into_iter().flatten().collect();
                    let is_page = |entry: &wide::Entry| matches!(Child::unpack(entry.child), Child::Page(_));
                    let page = |entry: &wide::Entry| match Child::unpack(entry.child) {
                        Child::Page(page) => page,
                        _ => entry.page,
                    };
                    let is_whole = |list: &[wide::Entry]| {
                        list.iter().all(|entry| match Child::unpack(entry.child) {
                            Child::Page(page) => !store.here[page as usize],
                            child => matches!(child, Child::Leaf { .. }),
                        })
                    };
                    if is_whole(&all) && is_whole(&some) {
                        let missing: Vec<u32> = some.iter().filter(|leaf| is_page(leaf)).map(page).collect();
                        assert!(missing.iter().all(|&page| !store.here[page as usize]), "{what}");
                        let (gone, kept): (Vec<_>, Vec<_>) = all.iter().partition(|leaf| missing.contains(&leaf.page));
                        let listed: Vec<_> = some.iter().filter(|leaf| !is_page(leaf)).collect();
                        assert_eq!(listed.len(), kept.len(), "{what}");
                        assert!(kept.iter().all(|leaf| listed.contains(leaf)), "{what}");
                        assert!(gone.iter().all(|leaf| !store.here[leaf.page as usize]), "{what}");
                        cut_short += usize::from(!missing.is_empty());
                    }
                }
            }
        }
    }
    println!("{needed} rays needed more, {whole} did not, {hits} hits; {cut_short} lists with pages");
    assert!(needed > 1000 && whole > 1000 && hits > 1000 && cut_short > 5, "{needed} {whole} {hits} {cut_short}");
}
