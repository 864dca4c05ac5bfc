//! Every preset of both builders over every awkward scene: sound trees, and the hits of brute force.

mod common;

use common::scenes::{mixed, table};
use common::{Rule, Shapes, build, cells, cut_tree_into, depth, rays, tree, verify};
use hybray_bintree::walk::{Counts, Stack, nearest};
use hybray_bintree::{BINARY_DEPTH_MAX, midpoint, sah};
use hybray_geometry::simd::Kernels;
use hybray_scene::{BLOCK, PageForm};

fn presets() -> Vec<Rule> {
    let area = |leaf_max, node_cost| Rule::Sah(sah::Settings { leaf_max, node_cost, ..sah::Settings::default() });
    let halves = |depth_max, objects_max, room| Rule::Midpoint(midpoint::Settings { depth_max, objects_max }, room);
    vec![
        Rule::Sah(sah::Settings::default()),
        area(1, 0.0),
        area(64, 0.0),
        area(64, 100.0),
        Rule::Moved(sah::Settings::default()),
        Rule::Moved(sah::Settings { leaf_max: 1, node_cost: 0.0, ..sah::Settings::default() }),
        halves(18, 12, 4),
        halves(24, 12, 4),
        halves(48, 1, 3),
        halves(9, 3, 8),
        halves(3, 1, 2),
        halves(0, 1, 1),
    ]
}

/// Each item in exactly one leaf, boxes around their children and items, ranges that fit together, limits kept.
fn check_binary(name: &str, shapes: &Shapes, rule: Rule) -> common::Tree {
    let tree = tree(shapes, rule);
    let Some(root) = tree.nodes.first() else {
        assert!(shapes.all.is_empty(), "{name}");
        return tree;
    };
    assert_eq!(root.count as usize, tree.items.len(), "{name} {rule:?}");
    let mut held = vec![0u32; shapes.all.len()];
    for (i, node) in tree.nodes.iter().enumerate() {
        if node.is_leaf() {
            let items = &tree.items[node.first as usize..][..node.count as usize];
            items.iter().for_each(|item| held[item.id as usize] += 1);
            assert!(items.is_sorted_by_key(|item| (item.kind, item.id)), "{name}: leaves are in order");
            assert!(items.iter().all(|item| node.aabb.contains(&item.aabb())), "{name} {rule:?}: node {i}");
            continue;
        }
        let (a, b) = (&tree.nodes[i + 1], &tree.nodes[node.second as usize]);
        assert_eq!((a.first, a.count + b.count), (node.first, node.count));
        assert!(a.first + a.count == b.first || matches!(rule, Rule::Moved(_)), "{name} {rule:?}: node {i}");
        assert!(node.aabb.contains(&a.aabb) && node.aabb.contains(&b.aabb), "{name} {rule:?}: node {i}");
    }
    let leaves = tree.nodes.iter().filter(|n| n.is_leaf());
    match rule {
        Rule::Sah(settings) | Rule::Moved(settings) => {
            assert!(held.iter().all(|&n| n == 1), "{name} {rule:?}");
            assert!(tree.nodes.len() <= sah::nodes_for(shapes.all.len()));
            assert!(depth(&tree.nodes) <= BINARY_DEPTH_MAX, "{name} {rule:?}");
            // Less than a block is not divided.
            let most = settings.leaf_max.max(BLOCK as u32);
            assert!(leaves.into_iter().all(|n| n.count <= most && n.count > 0), "{name} {rule:?}");
        }
        Rule::Midpoint(settings, _) => {
            assert!(held.iter().all(|&n| n >= 1), "{name} {rule:?}");
            assert!(depth(&tree.nodes) <= settings.depth_max, "{name} {rule:?}");
        }
    }
    tree
}

#[test]
fn presets_times_scenes() {
    for (name, shapes) in table() {
        let rays = rays(&shapes, 240, name.len() as u64);
        let hits = rays.iter().filter(|(_, found)| found.is_hit()).count();
        assert!(hits > 0 || name.contains("denormals") || name.contains("points"), "{name}: the rays hit nothing");
        for rule in presets() {
            let tree = check_binary(name, &shapes, rule);
            for (page_bytes, form) in [
                (4096, PageForm::Full),
                (65_536, PageForm::Full),
                (4096, PageForm::Compact),
                (65_536, PageForm::Compact),
            ] {
                let built = cut_tree_into(&shapes, &tree, page_bytes, form).unwrap();
                verify(&format!("{name} {rule:?} {page_bytes} {form:?}"), &built, shapes.all.len(), &rays);
            }
        }
    }
}

/// The rule of the 1995 tree, and PyraClip's contract: an object stands in every cell that its box touches, with the part
/// of its box that is there.
#[test]
fn cells_hold_what_touches_them() {
    for (name, shapes) in table() {
        let items = shapes.items();
        for (depth_max, objects_max) in [(18, 12), (9, 2)] {
            let tree = cells(&shapes, midpoint::Settings { depth_max, objects_max }, 30);
            for cell in tree.nodes.iter().filter(|n| n.is_leaf()) {
                let held = &tree.items[cell.first as usize..][..cell.count as usize];
                let touching = items.iter().filter(|item| item.aabb().overlaps(&cell.aabb)).count();
                assert_eq!(held.len(), touching, "{name}: {:?}", cell.aabb);
                for item in held {
                    let part = items[item.id as usize].aabb().intersection(&cell.aabb);
                    assert_eq!(item.aabb(), part, "{name}");
                }
            }
        }
    }
}

#[test]
fn nothing_makes_no_tree() {
    for rule in presets() {
        let shapes = Shapes::new(vec![]);
        assert!(check_binary("nothing", &shapes, rule).nodes.is_empty());
        let built = build(&shapes, rule, 4096).unwrap();
        assert!(built.pages.is_empty() && built.nodes.is_empty());
    }
}

#[test]
fn the_same_again() {
    let shapes = Shapes { all: mixed(2000, 9), materials: 3, smooth: true };
    for rule in presets() {
        let [a, b] = [0, 1].map(|_| build(&shapes, rule, 8192).unwrap());
        let bytes = |built: &common::Built| -> Vec<u8> {
            built.pages.iter().flat_map(|p| bytemuck::cast_slice(p).to_vec()).collect()
        };
        assert!(bytes(&a) == bytes(&b) && a.nodes == b.nodes && a.entries == b.entries, "{rule:?}");
    }
}

/// What the default builder makes of a plain scene is as good as it was: wide nodes and slots a primitive.
#[test]
fn trees_stay_compact() {
    let shapes = Shapes::new(mixed(30_000, 10).into_iter().step_by(3).collect());
    let built = build(&shapes, Rule::Sah(sah::Settings::default()), 65_536).unwrap();
    let census = verify("compact", &built, shapes.all.len(), &[]);
    let n = shapes.all.len() as f64;
    let (slots, bytes) = (census.slots as f64 / n, census.bytes as f64 / n);
    eprintln!("{:.2} slots, {:.4} wide nodes and {bytes:.1} bytes a triangle", slots, census.nodes as f64 / n);
    assert!(slots < 1.6 && bytes < 100.0, "{census:?}");
    let views = built.views();
    let (mut nodes, mut children) = (0, 0);
    for node in views.iter().flat_map(|page| page.body.nodes()) {
        nodes += 1;
        children += node.children().count();
    }
    let filled = children as f64 / nodes as f64;
    eprintln!("{filled:.2} children a wide node");
    assert!(filled > 5.5, "{filled}");

    // Near things first: far ones are then skipped.
    let mut counts = Counts::default();
    let scene = built.resident(&views);
    let rays = rays(&shapes, 400, 4);
    for (ray, expected) in &rays {
        let found = nearest(Kernels::Portable, &scene, ray, &mut Stack::new(), &mut counts);
        assert_eq!(found.candidate, *expected);
    }
    let a_ray = |n: u64| n as f64 / rays.len() as f64;
    eprintln!(
        "{:.1} wide nodes, {:.1} blocks, {:.1} pages a ray",
        a_ray(counts.nodes),
        a_ray(counts.blocks),
        a_ray(counts.pages)
    );
    assert!(a_ray(counts.nodes) < 25.0, "{counts:?}");
}
