//! Wide nodes cost the least that any choice of children costs: compared with all choices there are.

mod common;

use common::Random;
use hybray_bintree::Forest;
use hybray_bintree::top::{TopNode, directory};
use hybray_geometry::Aabb;
use hybray_scene::{Child, Node, WIDTH};

/// A random tree over so many pages in preorder; `lean` splits off one page at a time.
fn random_tree(random: &mut Random, pages: usize, lean: bool) -> Vec<TopNode> {
    let mut nodes = vec![];
    grow(random, pages, lean, &mut nodes);
    for (page, node) in nodes.iter_mut().filter(|n| n.second == 0).enumerate() {
        node.page = page as u32;
    }
    nodes
}

fn grow(random: &mut Random, pages: usize, lean: bool, nodes: &mut Vec<TopNode>) -> Aabb {
    let here = nodes.len();
    let (a, b) = (random.vec(), random.vec() * 0.1);
    nodes.push(TopNode { aabb: Aabb { lo: a.min(a + b), hi: a.max(a + b) }, second: 0, page: 0 });
    if pages > 1 {
        let first = if lean { 1 } else { 1 + random.below(pages - 1) };
        let left = grow(random, first, lean, nodes);
        nodes[here].second = nodes.len() as u32;
        nodes[here].aabb = left.union(&grow(random, pages - first, lean, nodes));
    }
    nodes[here].aabb
}

fn children(nodes: &[TopNode], at: usize) -> Option<[usize; 2]> {
    (nodes[at].second != 0).then_some([at + 1, nodes[at].second as usize])
}

/// Every way to stand for the subtree at `at` by parts side by side; it is one of them unless it must be opened.
fn fronts(nodes: &[TopNode], at: usize, must: bool) -> Vec<Vec<usize>> {
    let Some([a, b]) = children(nodes, at) else { return vec![vec![at]] };
    let mut all = if must { vec![] } else { vec![vec![at]] };
    for left in fronts(nodes, a, false) {
        all.extend(fronts(nodes, b, false).into_iter().map(|right| [&left[..], &right[..]].concat()));
    }
    all
}

/// The least cost of wide nodes from `at` down.
fn least(nodes: &[TopNode], at: usize, apiece: f64) -> f64 {
    let Some([a, b]) = children(nodes, at) else { return 0.0 };
    let mut best = f64::INFINITY;
    for left in fronts(nodes, a, true) {
        for right in fronts(nodes, b, true).into_iter().filter(|right| left.len() + right.len() <= WIDTH) {
            let below: f64 = left.iter().chain(&right).map(|&part| least(nodes, part, apiece)).sum();
            best = best.min(below);
        }
    }
    best + apiece + f64::from(nodes[at].aabb.half_area())
}

fn collapsed(nodes: &[TopNode]) -> Vec<Node> {
    let mut out = vec![Node::EMPTY; nodes.len()];
    let used = directory(nodes, &mut vec![Forest::EMPTY; nodes.len()], &mut out).expect("room for all");
    out.truncate(used);
    out
}

#[test]
fn costs_the_least() {
    let mut random = Random(5);
    for round in 0..120 {
        let pages = 2 + round % 12;
        let nodes = random_tree(&mut random, pages, round % 5 == 0);
        let areas = nodes.iter().filter(|n| n.second == 0).map(|n| f64::from(n.aabb.half_area()));
        let apiece = 2.0 * areas.sum::<f64>() / pages as f64;
        let out = collapsed(&nodes);
        let cost: f64 = out.iter().map(|n| f64::from(n.bounds().half_area()) + apiece).sum();
        let expected = least(&nodes, 0, apiece);
        assert!((cost - expected).abs() <= 1e-5 * expected, "{round}: {cost}, not {expected}");
        // Every page once, in the order of the tree.
        let mut found = vec![];
        let mut stack = vec![0];
        while let Some(at) = stack.pop() {
            let node: &Node = &out[at as usize];
            for (_, child) in node.children() {
                match child {
                    Child::Inner(next) => stack.push(next),
                    Child::Page(page) => found.push(page),
                    other => panic!("{other:?}"),
                }
            }
        }
        found.sort_unstable();
        assert!(found.into_iter().eq(0..pages as u32));
    }
}

/// Each wide level takes two binary ones, however lean the tree and however wild its boxes.
#[test]
fn half_as_deep() {
    let mut random = Random(6);
    for scale in [0.0, 1.0, 1e-30, 1e30] {
        let mut nodes = random_tree(&mut random, 79, true);
        for node in &mut nodes {
            (node.aabb.lo, node.aabb.hi) = (node.aabb.lo * scale, node.aabb.hi * scale);
        }
        let out = collapsed(&nodes);
        let mut level = vec![0; out.len()];
        for (at, node) in out.iter().enumerate() {
            for (_, child) in node.children() {
                if let Child::Inner(next) = child {
                    level[next as usize] = level[at] + 1;
                }
            }
        }
        assert!(level.iter().all(|&level| level < 39), "{scale}: {level:?}");
    }
}

#[test]
fn too_little_room_is_none() {
    let nodes = random_tree(&mut Random(7), 30, false);
    let used = collapsed(&nodes).len();
    let mut out = vec![Node::EMPTY; used];
    let mut forests = vec![Forest::EMPTY; nodes.len()];
    assert_eq!(directory(&nodes, &mut forests, &mut out), Some(used));
    assert_eq!(directory(&nodes, &mut forests, &mut out[1..]), None);
    assert_eq!(directory(&nodes, &mut forests[1..], &mut out), None);
    assert_eq!(directory(&[], &mut [], &mut []), Some(0));
}
