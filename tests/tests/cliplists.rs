//! A bundle's cliplist holds every leaf that any of its rays meets, or a subtree that it is in, in the order of near bounds that
//! no ray beats.
//!
//! The other way to know which leaves a ray meets is a loop over all leaves of all pages, with the slab interval of each.

use hybray::build::{Rule, Settings, Source, build};
use hybray::framing::bounds;
use hybray::model::Model;
use hybray_bintree::midpoint;
use hybray_bintree::walk::{Counts, Resident};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Aabb, Ray, RayKernel, Vec3};
use hybray_pyraclip::wide::{DIRECTORY, Entry, LIST_MAX, Scratch};
use hybray_scene::{Child, Kind};
use hybray_shading::Projection;
use hybray_tests::{Random, camera_rays, close_rays, scene, soup, walls};

/// Every leaf of every page: page, packed child, box.
fn leaves(scene: &Resident<'_>) -> Vec<(u32, u32, Aabb)> {
    let nodes = (0..).zip(scene.pages).flat_map(|(page, view)| view.body.nodes().map(move |node| (page, node)));
    nodes
        .flat_map(|(page, node)| {
            let children: Vec<_> = node.children().map(|(slot, child)| (page, child, node.aabb(slot))).collect();
            children
        })
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

/// Every leaf in a subtree: page and packed child.
fn below(scene: &Resident<'_>, entry: &Entry) -> Vec<(u32, u32)> {
    let node = |page: u32, index: u32| scene.pages[page as usize].body.nodes().nth(index as usize).unwrap();
    let (mut found, mut waiting) = (Vec::new(), vec![(entry.page, entry.child)]);
    while let Some((page, child)) = waiting.pop() {
        let (node, page) = match Child::unpack(child) {
            Child::Leaf { .. } => {
                found.push((page, child));
                continue;
            }
            Child::Inner(index) if page == DIRECTORY => (scene.directory.nodes[index as usize], page),
            Child::Inner(index) => (node(page, index), page),
            Child::Page(page) => (node(page, 0), page),
            Child::Unused => continue,
        };
        waiting.extend(node.children().map(|(_, child)| (page, child.pack())));
    }
    found
}

/// What became of the bundles of a scene.
#[derive(Debug, Default)]
struct Tally {
    incoherent: usize,
    /// Lists, and those of leaves alone.
    lists: usize,
    whole: usize,
    empty: usize,
    /// Leaves that rays meet, and leaves on lists or below: how tight they are.
    met: usize,
    listed: usize,
}

fn check_bundle(
    what: &str,
    kernels: Kernels,
    scene: &Resident<'_>,
    leaves: &[(u32, u32, Aabb)],
    rays: &[Ray],
    tally: &mut Tally,
) {
    let mut scratch = Scratch::new();
    let mut counts = Counts::default();
    let Some(list) = scratch.clip(kernels, scene, rays, &mut counts) else {
        tally.incoherent += 1;
        return;
    };
    let list: Vec<Entry> = list.collect();
    assert!(list.len() <= LIST_MAX, "{what}");
    assert!(list.is_sorted_by(|a, b| a.near <= b.near), "{what}: not in order");
    let mut keys: Vec<_> = list
        .iter()
        .enumerate()
        .flat_map(|(i, entry)| below(scene, entry).into_iter().map(move |key| (key, i)))
        .collect();
    keys.sort_unstable();
    assert!(keys.is_sorted_by(|a, b| a.0 < b.0), "{what}: a leaf twice");
    let kernels: Vec<RayKernel> = rays.iter().map(RayKernel::new).collect();
    for leaf in leaves {
        // The nearest entry of any ray into a leaf that one meets.
        let entries = rays.iter().zip(&kernels).filter_map(|(ray, kernel)| entry(ray, kernel, &leaf.2));
        let Some(nearest) = entries.reduce(f32::min) else { continue };
        let found = keys.binary_search_by_key(&(leaf.0, leaf.1), |key| key.0);
        let found = found.unwrap_or_else(|_| panic!("{what}: {leaf:?} is met at {nearest}, and not on the list"));
        let found = &list[keys[found].1];
        assert!(found.near <= nearest, "{what}: {found:?} is met at {nearest}");
        if matches!(Child::unpack(found.child), Child::Leaf { .. }) {
            assert_eq!((found.lo, found.hi), (leaf.2.lo.to_array(), leaf.2.hi.to_array()), "{what}");
        }
        tally.met += 1;
    }
    tally.lists += 1;
    tally.whole += usize::from(keys.len() == list.len());
    tally.empty += usize::from(list.is_empty());
    tally.listed += keys.len();
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
                check_bundle(&what, kernels, &scene, &leaves, &rays, &mut tally);
            }
        }
    }
    // A soup's lists are never of leaves alone, and those of rays that diverge from a lens, or all around, seldom.
    let close = camera && model.cameras[0].aperture == 0.0 && model.cameras[0].projection == Projection::Perspective;
    let is_mixed = tally.lists > tally.whole && tally.whole > tally.empty;
    assert!(
        tally.lists > 0 && (is_mixed || !close) && tally.met > 0 && tally.met <= tally.listed,
        "{name}: nothing was tested: {tally:?}"
    );
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

#[test]
fn cameras_without_an_apex() {
    check("organic:6000, lens", &scene("organic:6000@lens"), true);
    check("spd:balls:3, wide open", &scene("spd:balls:3@blades"), true);
    check("organic:6000, parallel", &scene("organic:6000@orthographic"), true);
    check("organic:6000, all around", &scene("organic:6000@spherical"), true);
}
