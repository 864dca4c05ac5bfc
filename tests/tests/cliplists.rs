//! A bundle's cliplist holds every leaf that any of its rays meets, in the order of near bounds that no ray beats.
//!
//! The other way to know which leaves a ray meets is a loop over all leaves of all pages, with the slab interval of each.

use hybray::build::{Rule, Settings, Source, build};
use hybray::framing::bounds;
use hybray::model::Model;
use hybray_bintree::midpoint;
use hybray_bintree::walk::{Counts, Resident};
use hybray_geometry::simd::{Kernels, Portable};
use hybray_geometry::{Aabb, Bundle, Ray, RayKernel, Vec3};
use hybray_pyraclip::wide::Scratch;
use hybray_scene::{Child, Kind};
use hybray_tests::{Random, camera_rays, close_rays, scene, soup, walls};

/// Leaves of a cliplist at most, as `wide` documents it.
const LIST_MAX: usize = 128;

/// Every leaf of every page: page, packed child, box.
fn leaves(scene: &Resident<'_>) -> Vec<(u32, u32, Aabb)> {
    let nodes = (0..).zip(scene.pages).flat_map(|(page, view)| view.nodes.iter().map(move |node| (page, node)));
    nodes
        .flat_map(|(page, node)| node.children().map(move |(slot, child)| (page, child, node.aabb(slot))))
        .filter(|(_, child, _)| matches!(child, Child::Leaf { kind: Kind::Triangle | Kind::Sphere | Kind::Cone, .. }))
        .map(|(page, child, aabb)| (page, child.pack(), aabb))
        .collect()
}

/// Where the ray enters the box within its interval.
fn entry(ray: &Ray, kernel: &RayKernel, aabb: &Aabb) -> Option<f32> {
    let (near, far) = kernel.slab(aabb);
    let near = near.max(ray.t_min);
    (near <= far && near <= ray.t_max).then_some(near)
}

/// What became of the bundles of a scene.
#[derive(Debug, Default)]
struct Tally {
    incoherent: usize,
    too_long: usize,
    lists: usize,
    empty: usize,
    /// Leaves that rays meet, and leaves on lists: how tight they are.
    met: usize,
    listed: usize,
}

fn check_bundle(
    what: &str,
    kernels: Kernels,
    scene: &Resident<'_>,
    leaves: &[(u32, u32, Aabb)],
    magnitude: f32,
    rays: &[Ray],
    tally: &mut Tally,
) {
    let Some(bundle) = Bundle::around(rays.iter(), magnitude) else {
        tally.incoherent += 1;
        return;
    };
    let mut scratch = Scratch::new();
    let list = scratch.clip(kernels, scene, &bundle, &mut Counts::default());
    let kernels: Vec<RayKernel> = rays.iter().map(RayKernel::new).collect();
    // The nearest entry of any ray into each leaf that one meets.
    let met: Vec<_> = leaves
        .iter()
        .filter_map(|leaf| {
            let entries = rays.iter().zip(&kernels).filter_map(|(ray, kernel)| entry(ray, kernel, &leaf.2));
            entries.reduce(f32::min).map(|nearest| (leaf, nearest))
        })
        .collect();
    let Some(list) = list else {
        let all = |corner: Vec3| corner.to_array().map(|x| [x; 8]);
        let passed = leaves.iter().filter(|(.., b)| bundle.meets(Portable, &all(b.lo), &all(b.hi)).0 != 0).count();
        assert!(passed > LIST_MAX, "{what}: no list, though {passed} leaves would fit one");
        tally.too_long += 1;
        return;
    };
    assert!(list.len() <= LIST_MAX, "{what}");
    assert!(list.is_sorted_by(|a, b| a.near <= b.near), "{what}: not in order");
    let mut keys: Vec<_> = list.iter().map(|leaf| (leaf.page, leaf.child)).collect();
    keys.sort_unstable();
    assert!(keys.is_sorted_by(|a, b| a < b), "{what}: a leaf twice");
    for (leaf, nearest) in &met {
        let found = list.iter().find(|on| (on.page, on.child) == (leaf.0, leaf.1));
        let found = found.unwrap_or_else(|| panic!("{what}: {leaf:?} is met at {nearest}, and not on the list"));
        assert!(found.near <= *nearest, "{what}: {found:?} is met at {nearest}");
        assert_eq!((found.lo, found.hi), (leaf.2.lo.to_array(), leaf.2.hi.to_array()), "{what}");
    }
    tally.lists += 1;
    tally.empty += usize::from(list.is_empty());
    tally.met += met.len();
    tally.listed += list.len();
}

/// Rays at corners of leaves' boxes, from one point: outermost rays then only just touch a box.
fn corner_rays(random: &mut Random, leaves: &[(u32, u32, Aabb)], origin: Vec3) -> Vec<Ray> {
    let Aabb { lo, hi } = leaves[random.below(leaves.len())].2;
    (0..16)
        .map(|_| {
            let target = Vec3::from([0, 1, 2].map(|axis| if random.below(2) == 0 { lo[axis] } else { hi[axis] }));
            let direction = if target == origin { Vec3::X } else { target - origin };
            Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
        })
        .collect()
}

fn check(name: &str, model: &Model, camera: bool) {
    let midpoints = Rule::Midpoint(midpoint::Settings { depth_max: 18, objects_max: 12 });
    let (_, scale) = Source::new(model).unwrap();
    let unit = 2f32.powi(scale);
    let (lo, hi) = bounds(model).unwrap();
    let extent = [lo, hi].map(|corner| Vec3::from(corner) * unit);
    let mut random = Random(name.len() as u64 * 65_537);
    let mut bundles: Vec<Vec<Ray>> = (0..60).map(|_| close_rays(&mut random, extent, 32)).collect();
    if camera {
        let rays = camera_rays(model, unit, 128);
        for size in [256, 64, 16, 9] {
            bundles.extend(rays.chunks(size).step_by(1 + 1500 / size).map(<[Ray]>::to_vec));
        }
    }
    let mut tally = Tally::default();
    for settings in [(Rule::SurfaceArea, 65_536), (midpoints, 4096)] {
        let packed =
            build(model, &Settings { rule: settings.0, page_bytes: settings.1, ..Settings::default() }).unwrap();
        let pages = packed.open().unwrap();
        let scene = pages.resident();
        let leaves = leaves(&scene);
        let corners = (0..300).map(|_| {
            let origin = close_rays(&mut random, extent, 1)[0].origin;
            corner_rays(&mut random, &leaves, origin)
        });
        for (i, rays) in bundles.iter().cloned().chain(corners).enumerate() {
            for kernels in Kernels::available() {
                let what = format!("{name} {settings:?} {kernels:?} bundle {i} of {} rays", rays.len());
                check_bundle(&what, kernels, &scene, &leaves, packed.magnitude, &rays, &mut tally);
            }
        }
    }
    assert!(tally.lists > 0 && tally.met > 0 && tally.met <= tally.listed, "{name}: nothing was tested: {tally:?}");
    println!("{name}: {tally:?}");
}

#[test]
fn soups_and_walls() {
    check("soup", &soup(7, 1500), false);
    check("walls", &walls(7, 400), false);
}

#[test]
fn triangles() {
    check("organic:6000", &scene("organic:6000"), true);
    check("terrain:5000", &scene("terrain:5000"), true);
}

#[test]
fn spheres_and_cones() {
    check("spd:balls:3", &scene("spd:balls:3"), true);
    check("spd:tree:8", &scene("spd:tree:8"), true);
}

#[test]
fn rooms() {
    check("cornell", &scene("cornell"), true);
    check("spd:lattice:3", &scene("spd:lattice:3"), true);
}
