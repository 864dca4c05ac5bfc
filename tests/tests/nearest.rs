//! Law 5: the nearest hit is that of brute force to the bit, whatever the tree, the page size and the kernels; of rays
//! that go singly and of rays that go in bundles.

use hybray::build::{Rule, Settings, Source, build};
use hybray::framing::bounds;
use hybray::model::Model;
use hybray::partition::Voxels;
use hybray_bintree::check::{Coverage, check};
use hybray_bintree::midpoint;
use hybray_bintree::walk::{Counts, Hit, Resident, Stack, Walked, nearest, occluded};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_pyraclip::wide;
use hybray_scene::PageForm;
use hybray_tests::{Random, brute_force, camera_rays, close_rays, degenerate, random_ray, rays_at, scene, soup, walls};

fn trees() -> Vec<Settings> {
    let midpoints = |depth_max, objects_max| Rule::Midpoint(midpoint::Settings { depth_max, objects_max });
    let whole = [Rule::SurfaceArea, midpoints(18, 12), midpoints(9, 3)].into_iter().flat_map(|rule| {
        [4096, 16 * 1024, 64 * 1024].map(|page_bytes| Settings { rule, page_bytes, ..Settings::default() })
    });
    let cut = [Rule::SurfaceArea, midpoints(9, 3)].into_iter().flat_map(|rule| {
        [Voxels::Grid([3, 2, 2]), Voxels::Adaptive(7)].map(|voxels| Settings {
            rule,
            page_bytes: 16 * 1024,
            voxels,
            ..Settings::default()
        })
    });
    let compact = [(Rule::SurfaceArea, 64 * 1024), (Rule::SurfaceArea, 4096), (midpoints(9, 3), 16 * 1024)];
    let compact = compact.map(|(rule, page_bytes)| Settings {
        rule,
        page_bytes,
        pages: PageForm::Compact,
        ..Settings::default()
    });
    whole.chain(cut).chain(compact).collect()
}

/// Rays of a bundle: all lengths that differ in what becomes of them, halves and single rays included.
const BUNDLES: [usize; 5] = [256, 64, 16, 9, 1];

/// Every tree of `model` is sound, and agrees with brute force on `rays` (internal units).
fn check_rays(name: &str, model: &Model, rays: &[Ray]) {
    let (source, _) = Source::new(model).unwrap();
    let expected: Vec<Candidate> = rays.iter().map(|ray| brute_force(&source, ray)).collect();
    let hits = expected.iter().filter(|c| c.is_hit()).count();
    assert!(source.len() < 10 || hits * 20 > rays.len(), "{name}: only {hits} of {} rays hit", rays.len());
    let mut bundles = BUNDLES.iter().cycle();
    for settings in trees() {
        let packed = build(model, &settings).unwrap();
        let pages = packed.open().unwrap();
        let scene = pages.resident();
        let mut coverage = vec![Coverage::NONE; source.len() as usize];
        check(&scene, &mut coverage, &mut vec![0; packed.pages()])
            .unwrap_or_else(|e| panic!("{name} {settings:?}: {e}"));
        for kernels in Kernels::available() {
            let what = format!("{name} {settings:?} {kernels:?}");
            check_single(&what, kernels, &scene, rays, &expected);
            let bundle = *bundles.next().unwrap();
            check_bundles(&format!("{what} {bundle}"), kernels, &scene, rays, &expected, bundle);
        }
    }
}

fn check_single(what: &str, kernels: Kernels, scene: &Resident<'_>, rays: &[Ray], expected: &[Candidate]) {
    let (mut stack, mut counts) = (Stack::new(), Counts::default());
    for (ray, expected) in rays.iter().zip(expected) {
        let found = nearest(kernels, scene, ray, &mut stack, &mut counts).candidate;
        assert_eq!(found, *expected, "{what} {ray:?}");
        assert_eq!(found.is_hit(), occluded(kernels, scene, ray, &mut stack, &mut counts), "{what} {ray:?}");
    }
    assert!(counts.pages > 0 || expected.iter().all(|c| !c.is_hit()), "{what}");
}

fn check_bundles(
    what: &str,
    kernels: Kernels,
    scene: &Resident<'_>,
    rays: &[Ray],
    expected: &[Candidate],
    bundle: usize,
) {
    let (mut scratch, mut stack, mut counts) = (wide::Scratch::new(), Stack::new(), Counts::default());
    let mut walked = [Walked { best: Hit::none(0.0), needs: Some(0) }; wide::RAYS_MAX];
    for (rays, expected) in rays.chunks(bundle).zip(expected.chunks(bundle)) {
        wide::nearest(kernels, scene, rays, &mut walked, &mut scratch, &mut stack, &mut counts);
        for ((walked, expected), ray) in walked.iter().zip(expected).zip(rays) {
            assert_eq!((walked.best.candidate, walked.needs), (*expected, None), "{what} {ray:?}");
        }
    }
}

fn check_model(name: &str, model: &Model, rays: usize) {
    let (_, scale) = Source::new(model).unwrap();
    let mut random = Random(name.len() as u64 * 7919);
    let unit = 2f32.powi(scale);
    let mut all: Vec<Ray> = (0..rays)
        .map(|_| {
            let ray = random_ray(&mut random);
            Ray { origin: ray.origin * unit, ..ray }
        })
        .collect();
    all.extend((0..8).flat_map(|_| close_rays(&mut random, [Vec3::splat(-unit), Vec3::splat(unit)], 64)));
    check_rays(name, model, &all);
}

/// 10,000 random rays, 1,024 in close bundles, and those of a picture of 64 x 64.
fn check_scene(name: &str) {
    let model = scene(name);
    let (_, scale) = Source::new(&model).unwrap();
    let unit = 2f32.powi(scale);
    let (lo, hi) = bounds(&model).unwrap();
    let extent = [lo, hi].map(|corner| Vec3::from(corner) * unit);
    let mut random = Random(name.len() as u64 * 104_729);
    let mut rays = camera_rays(&model, unit, 64);
    rays.extend((0..16).flat_map(|_| close_rays(&mut random, extent, 64)));
    rays.extend(rays_at(&mut random, extent, 10_000));
    check_rays(name, &model, &rays);
}

#[test]
fn soups() {
    for seed in 0..4 {
        check_model("soup", &soup(seed, 1500), 2_500);
    }
}

#[test]
fn coplanar_overlapping_walls() {
    for seed in 0..4 {
        check_model("walls", &walls(seed, 400), 2_500);
    }
}

#[test]
fn degenerate_input_terminates() {
    check_model("degenerate", &degenerate(3000), 1_000);
    check_model("one", &soup(1, 1), 500);
    check_model("a few", &soup(2, 5), 500);
}

#[test]
fn nothing_is_a_scene_too() {
    let packed = build(&Model::default(), &Settings::default()).unwrap();
    let pages = packed.open().unwrap();
    let ray = Ray { origin: Vec3::ZERO, direction: Vec3::X, t_min: 0.0, t_max: 1.0 };
    let hit = nearest(Kernels::detect(), &pages.resident(), &ray, &mut Stack::new(), &mut Counts::default());
    assert!(!hit.candidate.is_hit());
    let what = "nothing, in bundles";
    check_bundles(what, Kernels::detect(), &pages.resident(), &[ray; 256], &[Candidate::none(1.0); 256], 256);
}

/// One test a scene: they run side by side, and a failure names its scene.
macro_rules! scenes {
    ($($test:ident: $name:literal;)*) => {
        $(#[test] fn $test() { check_scene($name); })*
    };
}

scenes! {
    balls: "spd:balls:3";
    balls_noground: "spd:balls-noground:2";
    gears: "spd:gears:1";
    lattice: "spd:lattice:3";
    mount: "spd:mount:4";
    rings: "spd:rings:2";
    sombrero: "spd:sombrero:1";
    teapot: "spd:teapot:4";
    tetra: "spd:tetra:5";
    tree: "spd:tree:8";
    cornell: "cornell";
    cornell_mirror: "cornell:mirror";
    organic: "organic:6000";
    terrain: "terrain:2000";
}
