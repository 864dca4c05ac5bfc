//! Law 1: the picture, and what was traced for it, is the same on any farm, with any kernels, tree and page size.

use hybray::build::{Rule, Settings};
use hybray::model;
use hybray::prepare::Prepared;
use hybray_bintree::midpoint;
use hybray_geometry::simd::Kernels;
use hybray_native::{DispatcherAt, Farm};
use hybray_scene::PageForm;
use hybray_scheduler::Options;
use hybray_scheduler::policy::Tiles;
use hybray_tests::{Random, drawn, scene};

/// Farms that a picture is drawn on, beside the one that it is compared with.
const DRAWS: usize = 10;

/// Draws `DRAWS` of `values`: every one of them occurs, and in another order for every seed.
fn deck<T: Copy>(random: &mut Random, values: &[T]) -> Vec<T> {
    assert!(values.len() <= DRAWS);
    let repeated = values.iter().copied().cycle().take(DRAWS).collect();
    random.shuffled(repeated)
}

fn check(name: &str, size: [u32; 2], filter: &str) {
    let model = scene(name);
    let wanted = model::Settings {
        size: Some(size),
        spp: Some(2),
        depth: Some(4),
        filter: Some(filter.to_owned()),
        ..model::Settings::default()
    };
    let midpoints = Rule::Midpoint(midpoint::Settings { depth_max: 18, objects_max: 12 });
    let (full, compact) = (PageForm::Full, PageForm::Compact);
    let trees = [
        (Rule::SurfaceArea, 65_536, full),
        (midpoints, 4096, full),
        (Rule::SurfaceArea, 4096, full),
        (midpoints, 65_536, full),
        (Rule::SurfaceArea, 65_536, compact),
        (midpoints, 4096, compact),
    ];
    let prepared = trees.map(|(rule, page_bytes, pages)| {
        let prepared = Prepared::new(model.clone(), &Settings { rule, page_bytes, pages, ..Settings::default() });
        prepared.unwrap_or_else(|e| panic!("{name} {rule:?} {page_bytes} {pages:?}: {e}"))
    });

    let alone = Farm {
        nodes: 1,
        kernels: Kernels::Portable,
        dispatcher: DispatcherAt::Host,
        shadow_bundles: false,
        options: Options { spread: Some(1.0), atomic: Some(1), ..Options::default() },
    };
    let expected = drawn(&prepared[0], &wanted, &alone, name);
    assert!(expected.counts.hits > 0 && expected.counts.shadow > 0, "{name}: {expected:?}");

    let random = &mut Random(name.bytes().fold(1, |seed: u64, byte| seed.wrapping_mul(31) + u64::from(byte)));
    let nodes = deck(random, &[1, 2, 3, 7, 64]);
    let spreads = deck(random, &[Some(1.0), Some(2.0), Some(2.5), Some(8.0), None]);
    let atomics = deck(random, &[Some(1), Some(4), Some(64), None]);
    let dispatchers = deck(random, &[DispatcherAt::Host, DispatcherAt::Node]);
    let kernels = deck(random, &Kernels::available().collect::<Vec<_>>());
    let trees = deck(random, &[0, 1, 2, 3, 4, 5]);
    let tiles = deck(random, &[Tiles::Dynamic, Tiles::Static, Tiles::PixelCount { pixels: 300 }]);
    let together = deck(random, &[true, true, false]);
    for i in 0..DRAWS {
        let options = Options { spread: spreads[i], atomic: atomics[i], tiles: tiles[i], take_over: i % 3 > 0 };
        let (nodes, kernels, dispatcher, shadow_bundles) = (nodes[i], kernels[i], dispatchers[i], together[i]);
        let farm = Farm { nodes, kernels, dispatcher, shadow_bundles, options };
        let tree = &prepared[trees[i]];
        let what = format!("{name} {size:?} {filter}, tree {} of {} pages, {farm:?}", trees[i], tree.packed.pages());
        assert_eq!(drawn(tree, &wanted, &farm, &what), expected, "{what}");
    }
}

/// One test a scene: they run side by side, and a failure names its scene.
macro_rules! same_picture {
    ($($test:ident: $name:literal $size:tt $filter:literal;)*) => {
        $(#[test] fn $test() { check($name, $size, $filter); })*
    };
}

same_picture! {
    balls: "spd:balls:2" [96, 96] "gaussian";
    balls_noground: "spd:balls-noground:2" [96, 96] "box";
    gears: "spd:gears:1" [90, 61] "tent";
    lattice: "spd:lattice:2" [96, 96] "gaussian";
    mount: "spd:mount:4" [96, 96] "box";
    rings: "spd:rings:2" [75, 99] "tent";
    sombrero: "spd:sombrero:1" [96, 96] "gaussian";
    teapot: "spd:teapot:4" [97, 89] "box";
    tetra: "spd:tetra:5" [96, 96] "tent";
    tree: "spd:tree:6" [96, 96] "gaussian";
    cornell: "cornell" [80, 73] "box";
    cornell_mirror: "cornell:mirror" [73, 80] "tent";
    organic: "organic:2000" [96, 96] "gaussian";
    gallery: "gallery:64" [80, 60] "tent";
    terrain: "terrain:5000" [96, 96] "box";
    conference: "paper:conference:9" [72, 72] "box";
    lens: "spd:balls:2@lens" [70, 61] "gaussian";
    blades: "cornell:mirror@blades" [61, 70] "box";
    orthographic: "spd:gears:1@orthographic" [70, 61] "tent";
    spherical: "cornell@spherical" [90, 45] "gaussian";
}
