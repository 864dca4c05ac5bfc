//! Limits: room for nodes and items, page sizes, depth. Little room makes larger leaves, never a panic.

mod common;

use common::scenes::mixed;
use common::{Rule, Shape, Shapes, Tree, build, cut_tree, depth, rays, tree, verify};
use hybray_bintree::cut::CutError;
use hybray_bintree::{BINARY_DEPTH_MAX, BinaryNode, midpoint, sah};
use hybray_geometry::{Sphere, Vec3};
use hybray_scene::BLOCK;

fn scene() -> Shapes {
    Shapes::new(mixed(300, 1))
}

fn verified(name: &str, shapes: &Shapes, tree: &Tree) {
    let built = cut_tree(shapes, tree, 4096).unwrap();
    verify(name, &built, shapes.all.len(), &rays(shapes, 30, 3));
}

#[test]
fn little_room_for_nodes() {
    let shapes = scene();
    let settings = sah::Settings { leaf_max: 1, ..sah::Settings::default() };
    let whole = tree(&shapes, Rule::Sah(settings)).nodes.len();
    let mut last = 0;
    for room in (1..40).chain([100, whole, whole + 1, sah::nodes_for(300), 5000]) {
        let mut items = shapes.items();
        let mut nodes = vec![BinaryNode::EMPTY; room];
        let used = sah::build(&mut items, &mut nodes, &settings);
        assert!(used <= room && used >= last, "{used} of {room}");
        assert!(used + 1 >= room || used == whole, "room is used: {used} of {room}");
        last = used;
        nodes.truncate(used);
        verified(&format!("{room} nodes"), &shapes, &Tree { nodes, items });
    }
    assert_eq!(last, whole);
}

#[test]
fn little_room_for_midpoint_trees() {
    let shapes = scene();
    let count = shapes.all.len();
    let settings = midpoint::Settings { depth_max: 20, objects_max: 2 };
    for (item_room, leaf_room, node_room) in [
        (count, count, 1),
        (count, count, 2),
        (count, count, 3),
        (count, count, 7),
        (count, count, 10_000),
        (count + 1, count, 10_000),
        (count, count + 1, 10_000),
        (count + 30, count + 30, 100),
        (2 * count, 10 * count, 10_000),
        (10 * count, 2 * count, 10_000),
        (10 * count, 10 * count, 50),
        (20 * count, 20 * count, 100_000),
    ] {
        let mut items = shapes.items();
        items.resize(item_room, items[0]);
        let mut leaves = vec![items[0]; leaf_room];
        let mut nodes = vec![BinaryNode::EMPTY; node_room];
        let built = midpoint::build(&mut items, count, &mut leaves, &mut nodes, &settings);
        let (used, held) = (built.nodes.len(), built.items.len());
        assert!(used <= node_room && held <= leaf_room && held >= count);
        nodes.truncate(used);
        leaves.truncate(held);
        midpoint::tighten(&mut nodes, &leaves);
        verified(&format!("{item_room} {leaf_room} {node_room}"), &shapes, &Tree { nodes, items: leaves });
    }
}

#[test]
fn pages_keep_their_size() {
    let shapes = Shapes { all: mixed(3000, 2), materials: 4, smooth: true };
    let rays = rays(&shapes, 40, 5);
    for rule in [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 4)] {
        let tree = tree(&shapes, rule);
        let mut last = usize::MAX;
        for page_bytes in [4096, 5000, 8192, 12_345, 16_384, 32_768, 65_535, 65_536, 1 << 20] {
            let built = cut_tree(&shapes, &tree, page_bytes).unwrap();
            let most = built.entries.iter().map(|e| e.bytes).max().unwrap() as usize;
            assert!(most <= page_bytes.min(65_536), "{most} of {page_bytes}");
            assert!(most * 2 > page_bytes.min(65_536), "pages are filled: {most} of {page_bytes}");
            assert!(built.pages.iter().zip(&built.entries).all(|(p, e)| p.len() == (e.bytes as usize).div_ceil(64)));
            assert!(built.pages.len() <= last, "larger pages are fewer");
            last = built.pages.len();
            verify(&format!("{page_bytes}"), &built, shapes.all.len(), &rays);
        }
    }
}

#[test]
fn pages_too_small_are_an_error() {
    let sah = Rule::Sah(sah::Settings::default());
    for smooth in [false, true] {
        for first in 0..3 {
            // One kind only: a leaf of 16 triangles or spheres, or of 4 cones, must fit.
            let all = mixed(600, 3).into_iter().skip(first).step_by(3).collect();
            let shapes = Shapes { all, materials: 2, smooth };
            let tree = tree(&shapes, sah);
            let mut fits = false;
            for page_bytes in [0, 1, 64, 287, 288, 400, 512, 1024, 1200, 2048, 4095, 4096] {
                match cut_tree(&shapes, &tree, page_bytes) {
                    Ok(built) => {
                        fits = true;
                        verify("small pages", &built, shapes.all.len(), &rays(&shapes, 10, 1));
                    }
                    Err(CutError::PageTooSmall { bytes_max }) => {
                        assert_eq!(bytes_max, page_bytes);
                        assert!(!fits, "what fits in less fits: {page_bytes}");
                    }
                }
            }
            assert!(fits, "4096 bytes hold a leaf of any kind");
        }
    }
}

/// Spheres that get smaller as fast as `f32` lets them: splits that cut off little at a time.
fn vanishing(count: usize) -> Shapes {
    let at = |i: usize, octaves: usize| (0.5f64.powi((i % octaves) as i32)) as f32;
    let sphere = |i: usize| {
        let s = at(i / 3, 126);
        let mut centre = Vec3::ZERO;
        centre[i % 3] = s;
        Shape::Sphere(Sphere { centre, radius: (0.1 * s).max(f32::MIN_POSITIVE) })
    };
    Shapes::new((0..count).map(sphere).collect())
}

#[test]
fn depth_is_bounded() {
    for count in [50, 378, 2000] {
        let shapes = vanishing(count);
        let leaves_of_one = sah::Settings { leaf_max: 1, node_cost: 0.0, ..sah::Settings::default() };
        for start in [0, 30, 60, 70] {
            let settings = sah::Settings { depth: start, ..leaves_of_one };
            for rule in [Rule::Sah(settings), Rule::Moved(settings)] {
                let tree = tree(&shapes, rule);
                let reached = start + depth(&tree.nodes);
                let least = 32 - (count as u32).leading_zeros();
                assert!(reached <= BINARY_DEPTH_MAX.max(start + least), "{count} from {start}: {reached}");
                verified(&format!("{count} from {start}"), &shapes, &tree);
            }
        }
        for depth_max in [1, 24, 48, u32::MAX] {
            let rule = Rule::Midpoint(midpoint::Settings { depth_max, objects_max: 1 }, 8);
            let tree = tree(&shapes, rule);
            assert!(depth(&tree.nodes) <= depth_max.min(48));
            verified(&format!("{count} {depth_max}"), &shapes, &tree);
        }
    }
}

/// Parts may be built apart: the top by one call, what it leaves by others, as a host does in parallel.
#[test]
fn stopped_builds_leave_whole_parts() {
    let shapes = scene();
    for stop_at in [1, 2, 7, 64, 299, 300, 10_000] {
        let built = tree(&shapes, Rule::Sah(sah::Settings { stop_at, leaf_max: 1, ..sah::Settings::default() }));
        let leaves: Vec<&BinaryNode> = built.nodes.iter().filter(|n| n.is_leaf()).collect();
        assert!(leaves.iter().all(|n| n.count <= stop_at.max(BLOCK as u32)), "{stop_at}");
        assert_eq!(leaves.iter().map(|n| n.count).sum::<u32>(), 300);
        verified(&format!("stopped at {stop_at}"), &shapes, &built);
    }
}

#[test]
fn one_page_needs_one_directory_node() {
    let built = build(&Shapes::new(mixed(3, 1)), Rule::Sah(sah::Settings::default()), 4096).unwrap();
    assert_eq!((built.pages.len(), built.nodes.len()), (1, 1));
}
