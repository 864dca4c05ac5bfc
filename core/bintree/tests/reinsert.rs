//! Subtrees that move: boxes become less, and hardly any single move is left that would make them less still.

mod common;

use common::scenes::table;
use common::{Random, Rule, Shape, Shapes, Tree, tree};
use hybray_bintree::sah;
use hybray_geometry::{Aabb, Triangle};

/// A tree of its own: a leaf, or two of them.
#[derive(Clone)]
enum Plain {
    Leaf(Aabb),
    Inner(Box<[Plain; 2]>),
}

impl Plain {
    fn of(tree: &Tree, at: usize) -> Self {
        let node = &tree.nodes[at];
        if node.is_leaf() {
            return Self::Leaf(node.aabb);
        }
        Self::Inner(Box::new([Self::of(tree, at + 1), Self::of(tree, node.second as usize)]))
    }

    fn aabb(&self) -> Aabb {
        match self {
            Self::Leaf(aabb) => *aabb,
            Self::Inner(two) => two[0].aabb().union(&two[1].aabb()),
        }
    }

    /// The area of all boxes but leaves'.
    fn area(&self) -> f64 {
        match self {
            Self::Leaf(_) => 0.0,
            Self::Inner(two) => f64::from(self.aabb().half_area()) + two[0].area() + two[1].area(),
        }
    }

    /// Each subtree but the whole, taken out, and what is left.
    fn without_each(&self) -> Vec<(Self, Self)> {
        let Self::Inner(two) = self else { return vec![] };
        let mut all = vec![];
        for (here, other) in [(0, 1), (1, 0)] {
            all.push((two[here].clone(), two[other].clone()));
            for (out, left) in two[here].without_each() {
                let mut new = two.clone();
                new[here] = left;
                all.push((out, Self::Inner(new)));
            }
        }
        all
    }

    /// With `part` beside each subtree.
    fn with(&self, part: &Self) -> Vec<Self> {
        let mut all = vec![Self::Inner(Box::new([self.clone(), part.clone()]))];
        if let Self::Inner(two) = self {
            for here in 0..2 {
                for new in two[here].with(part) {
                    let mut both = two.clone();
                    both[here] = new;
                    all.push(Self::Inner(both));
                }
            }
        }
        all
    }
}

fn area(tree: &Tree) -> f64 {
    tree.nodes.iter().filter(|n| !n.is_leaf()).map(|n| f64::from(n.aabb.half_area())).sum()
}

fn both(shapes: &Shapes) -> [Tree; 2] {
    [Rule::Sah(sah::Settings::default()), Rule::Moved(sah::Settings::default())].map(|rule| tree(shapes, rule))
}

/// Many small triangles, and across them one in so many that is as large as the room.
fn room(count: usize, large: usize, seed: u64) -> Shapes {
    let mut random = Random(seed);
    let mut triangle = |size: f32| {
        let at = random.vec() * (1.0 - size);
        Shape::Triangle(Triangle { v: [0; 3].map(|_| at + random.vec() * size) })
    };
    Shapes::new((0..count).map(|i| triangle(if i % large == 0 { 0.9 } else { 0.02 })).collect())
}

#[test]
fn boxes_become_less() {
    for (name, shapes) in table() {
        let [before, after] = both(&shapes);
        assert!(area(&after) <= area(&before) * (1.0 + 1e-5), "{name}: {} to {}", area(&before), area(&after));
    }
    let [before, after] = both(&room(2000, 40, 7));
    let (before, after) = (area(&before), area(&after));
    eprintln!("a room: {before:.1} to {after:.1}");
    assert!(after < 0.9 * before, "{after} of {before}");
}

#[test]
fn little_is_left_to_gain() {
    let (mut gained, mut missed) = (0.0, 0.0);
    for seed in 0..16 {
        let [before, after] = both(&room(80, 8, seed));
        let (whole, now) = (area(&before), Plain::of(&after, 0));
        assert!((now.area() - area(&after)).abs() <= 1e-4 * whole, "boxes are those around their leaves");
        // What one move would gain at best, of all that there are.
        let moves = now.without_each();
        let moved = moves.iter().flat_map(|(part, left)| left.with(part)).map(|new| new.area());
        let least = moved.fold(f64::INFINITY, f64::min);
        gained += 1.0 - now.area() / whole;
        missed += (now.area() - least) / whole;
    }
    let [gained, missed] = [gained, missed].map(|sum| 100.0 * sum / 16.0);
    eprintln!("{gained:.2} % of the area went; one more move would gain {missed:.3} %");
    assert!(gained > 5.0 && missed < 0.8, "{gained} {missed}");
}

/// Few leaves have all kinds of places to go to, the root's included; none of them is lost there.
#[test]
fn leaves_stay() {
    for seed in 0..2000 {
        let shapes = room(1 + seed as usize % 60, 3, seed);
        let leaves = |tree: &Tree| {
            let leaves = tree.nodes.iter().filter(|n| n.is_leaf());
            leaves.map(|n| (n.first, n.count)).collect::<std::collections::BTreeSet<_>>()
        };
        let [before, after] = both(&shapes);
        assert_eq!(leaves(&before), leaves(&after), "{seed}");
    }
}
