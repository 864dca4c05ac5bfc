//! Law 1 for voxels: however the scene is cut, the picture is the same to the bit, and every page knows its voxel.

use hybray::build::{Rule, Settings};
use hybray::model;
use hybray::partition::{Voxels, owners};
use hybray::prepare::Prepared;
use hybray_bintree::midpoint;
use hybray_native::{DispatcherAt, Farm};
use hybray_scheduler::Options;
use hybray_tests::{drawn, kernels, scene};

fn check(name: &str) {
    let model = scene(name);
    let size = Some([56, 42]);
    let wanted = model::Settings { size, spp: Some(1), depth: Some(4), ..model::Settings::default() };
    let options = Options { spread: None, atomic: Some(4), ..Options::default() };
    let farm = Farm { nodes: 2, kernels: kernels(), dispatcher: DispatcherAt::Host, shadow_bundles: true, options };
    let expected = {
        let prepared = Prepared::new(model.clone(), &Settings::default()).unwrap();
        assert_eq!(prepared.packed.voxels(), 1);
        assert!((0..prepared.packed.pages() as u32).all(|page| prepared.packed.voxel_of(page) == 0));
        drawn(&prepared, &wanted, &farm, name)
    };
    assert!(expected.counts.hits > 0 && expected.counts.shadow > 0, "{name}: {expected:?}");

    let grids = [[1, 1, 1], [2, 2, 1], [4, 8, 1], [3, 3, 3]].map(Voxels::Grid);
    let cuts = grids.into_iter().chain([1, 7, 32].map(Voxels::Adaptive));
    for voxels in cuts {
        for rule in [Rule::SurfaceArea, Rule::Midpoint(midpoint::Settings::default())] {
            let what = format!("{name} {voxels:?} {rule:?}");
            let settings = Settings { rule, page_bytes: 16 * 1024, voxels, ..Settings::default() };
            let prepared = Prepared::new(model.clone(), &settings).unwrap_or_else(|e| panic!("{what}: {e}"));
            let packed = &prepared.packed;
            assert_eq!(packed.voxels(), voxels.count(), "{what}");
            let of_pages: Vec<u32> = (0..packed.pages() as u32).map(|page| packed.voxel_of(page)).collect();
            assert!(of_pages.is_sorted() && of_pages.iter().all(|&v| v < voxels.count()), "{what}: {of_pages:?}");
            if voxels.count() > 1 {
                assert!(of_pages[0] < of_pages[of_pages.len() - 1], "{what}: everything is in one voxel");
            }
            let primitives: u64 = (0..packed.pages() as u32).map(|page| u64::from(packed.primitives_of(page))).sum();
            assert!(primitives >= prepared.primitives.iter().sum(), "{what}: {primitives}");
            assert!(owners(&packed.placed_pages(), packed.voxels(), 7, u64::MAX).is_ok(), "{what}");
            assert_eq!(drawn(&prepared, &wanted, &farm, &what), expected, "{what}");
        }
    }
}

#[test]
fn balls() {
    check("spd:balls:2");
}

#[test]
fn teapot() {
    check("spd:teapot:6");
}

#[test]
fn mirrors() {
    check("cornell:mirror");
}

#[test]
fn organic() {
    check("organic:2000");
}
