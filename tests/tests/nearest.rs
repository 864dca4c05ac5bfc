//! Law 5: the nearest hit is that of brute force, whatever the tree, the page size and the kernels.

use hybray::build::{Rule, Settings, Source, build};
use hybray::model::Model;
use hybray_bintree::check::{Coverage, check};
use hybray_bintree::midpoint;
use hybray_bintree::walk::{Counts, Stack, nearest, occluded};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_tests::{Random, brute_force, degenerate, random_ray, soup, walls};

fn trees() -> Vec<Settings> {
    let midpoints = |depth_max, objects_max| Rule::Midpoint(midpoint::Settings { depth_max, objects_max });
    [Rule::SurfaceArea, midpoints(18, 12), midpoints(9, 3)]
        .into_iter()
        .flat_map(|rule| [4096, 16 * 1024, 64 * 1024].map(|page_bytes| Settings { rule, page_bytes }))
        .collect()
}

/// Every tree of `model` is sound, and agrees with brute force on `rays` random rays.
fn check_model(name: &str, model: &Model, rays: usize) {
    let (source, scale) = Source::new(model).unwrap();
    let mut random = Random(name.len() as u64 * 7919);
    let rays: Vec<(Ray, Candidate)> = (0..rays)
        .map(|_| {
            let mut ray = random_ray(&mut random);
            ray.origin *= 2f32.powi(scale) * 1.0;
            let expected = brute_force(&source, &ray);
            (ray, expected)
        })
        .collect();
    for settings in trees() {
        let packed = build(model, &settings).unwrap();
        let pages = packed.open().unwrap();
        let scene = pages.resident();
        let mut coverage = vec![Coverage::NONE; source.len() as usize];
        check(&scene, &mut coverage, &mut vec![0; packed.pages()])
            .unwrap_or_else(|e| panic!("{name} {settings:?}: {e}"));
        let (mut stack, mut counts) = (Stack::new(), Counts::default());
        for kernels in [Kernels::Portable, Kernels::detect()] {
            for (ray, expected) in &rays {
                let found = nearest(kernels, &scene, ray, &mut stack, &mut counts).candidate;
                assert_eq!(found, *expected, "{name} {settings:?} {kernels:?} {ray:?}");
                assert_eq!(found.is_hit(), occluded(kernels, &scene, ray, &mut stack, &mut counts));
            }
        }
        assert!(counts.pages > 0 || source.len() < 10);
    }
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
}
