//! Subtrees move to where they make the boxes above them least (Bittner, Hapala and Havran, *Fast insertion-based
//! optimization of bounding volume hierarchies*, 2013; the search is that of Meister and Bittner, *Parallel reinsertion for
//! bounding volume hierarchy optimization*, 2018, section 3).
//!
//! Splitting from the top down looks one split ahead. That costs most where a few large primitives lie among many small ones,
//! as walls and tables do in a room: there a quarter of the area of all boxes goes away.

use crate::BINARY_DEPTH_MAX;
use crate::binary::BinaryNode;
use hybray_geometry::Aabb;

/// What a node knows while others move: scratch, 12 bytes for each node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Its first child; the second is [`BinaryNode::second`].
    first: u32,
    parent: u32,
    /// Levels below.
    height: u32,
}

impl Link {
    /// What fills unused room.
    pub const EMPTY: Self = Self { first: 0, parent: ROOT, height: 0 };
}

const ROOT: u32 = u32::MAX;
/// Passes over the nodes at most: the later ones find little.
const ROUNDS: u32 = 4;
/// Nodes that move: those with more than this of the mean area.
const LEAST: f32 = 0.25;
/// Places that are looked at for one node at most: it bounds the work where all boxes overlap.
const PLACES: u32 = 1024;

/// Moves the largest subtrees of a tree in preorder whose root is `depth` levels down, until that gains less than one part in
/// a hundred, and puts it in preorder again. Items stay where they are: from now on only those of
/// a leaf stand together.
///
/// The same tree gives the same result. Bounded by a constant for each node.
///
/// # Panics
/// If there are fewer `links` than `nodes`.
pub fn reinsert(nodes: &mut [BinaryNode], links: &mut [Link], depth: u32) {
    let links = &mut links[..nodes.len()];
    if nodes.len() < 5 {
        return;
    }
    links[0] = Link::EMPTY;
    for here in 0..nodes.len() {
        let second = nodes[here].second as usize;
        if second != 0 {
            links[here].first = here as u32 + 1;
            for child in [here + 1, second] {
                links[child] = Link { parent: here as u32, ..Link::EMPTY };
            }
        }
    }
    let mut tree = Tree { nodes, links, root: 0, depth_max: BINARY_DEPTH_MAX.saturating_sub(depth + 1) };
    for here in (0..tree.nodes.len() as u32).rev() {
        tree.measure(here);
    }
    for _ in 0..ROUNDS {
        if !tree.round() {
            break;
        }
    }
    tree.put_in_order();
}

struct Tree<'a> {
    nodes: &'a mut [BinaryNode],
    links: &'a mut [Link],
    root: u32,
    depth_max: u32,
}

impl Tree<'_> {
    fn aabb(&self, node: u32) -> Aabb {
        self.nodes[node as usize].aabb
    }

    fn area(&self, node: u32) -> f32 {
        self.aabb(node).half_area()
    }

    fn parent(&self, node: u32) -> u32 {
        self.links[node as usize].parent
    }

    fn children(&self, node: u32) -> Option<[u32; 2]> {
        let second = self.nodes[node as usize].second;
        (second != 0).then_some([self.links[node as usize].first, second])
    }

    fn sibling(&self, node: u32) -> u32 {
        let parent = self.parent(node) as usize;
        let first = self.links[parent].first;
        if first == node { self.nodes[parent].second } else { first }
    }

    /// One pass: each node that is larger than most. Whether another is worth it.
    fn round(&mut self) -> bool {
        let sum: f32 = (0..self.nodes.len() as u32).map(|node| self.area(node)).sum();
        let mean = sum / self.nodes.len() as f32;
        let mut gained = 0.0;
        for node in 0..self.nodes.len() as u32 {
            if node != self.root
                && self.area(node) > LEAST * mean
                && let Some((gain, to)) = self.place(node)
            {
                gained += gain;
                self.move_to(node, to);
            }
        }
        gained > 0.01 * sum
    }

    /// The best place for a node, and how much less all boxes are then. It is looked for from near to far: up from the node,
    /// and down into each sibling on the way, as long as that can gain more.
    fn place(&self, node: u32) -> Option<(f32, u32)> {
        let parent = self.parent(node);
        let (own, sibling) = (self.aabb(node), self.sibling(node));
        let area = own.half_area();
        let height = self.links[node as usize].height;
        let mut best = None;
        let mut least = 0.0;
        // What is gained above the place, the place, and its depth as seen from the root.
        let mut stack = [(0.0, 0u32, 0u32); BINARY_DEPTH_MAX as usize + 2];
        let (mut above, mut aside, mut pivot) = (self.area(parent), sibling, parent);
        let mut without = self.aabb(sibling);
        let mut level = self.depth(parent);
        let mut left = PLACES;
        loop {
            // The sibling of what was taken out goes up by one level.
            stack[0] = (above, aside, if pivot == parent { level } else { level + 1 });
            let mut waiting = 1;
            while waiting > 0 && left > 0 {
                waiting -= 1;
                left -= 1;
                let (above, at, depth) = stack[waiting];
                if above - area <= least {
                    continue;
                }
                let there = self.aabb(at);
                let gain = above - there.union(&own).half_area();
                let deepest = depth + 1 + height.max(self.links[at as usize].height);
                if gain > least && at != sibling && deepest <= self.depth_max {
                    (least, best) = (gain, Some((gain, at)));
                }
                if let Some([first, second]) = self.children(at) {
                    let above = gain + there.half_area();
                    stack[waiting] = (above, second, depth + 1);
                    stack[waiting + 1] = (above, first, depth + 1);
                    waiting += 2;
                }
            }
            if pivot != parent {
                without = without.union(&self.aabb(aside));
                above += self.area(pivot) - without.half_area();
            }
            let up = self.parent(pivot);
            if up == ROOT || left == 0 {
                return best;
            }
            (aside, pivot, level) = (self.sibling(pivot), up, level - 1);
        }
    }

    fn depth(&self, node: u32) -> u32 {
        let mut at = node;
        let mut depth = 0;
        while self.parent(at) != ROOT {
            at = self.parent(at);
            depth += 1;
        }
        depth
    }

    /// Takes a node with its parent out, and puts the parent above it and `to`.
    fn move_to(&mut self, node: u32, to: u32) {
        let (parent, sibling) = (self.parent(node), self.sibling(node));
        let above = self.parent(parent);
        self.replace(above, parent, sibling);
        self.replace(self.parent(to), to, parent);
        self.adopt(parent, [to, node]);
        self.refit(above);
        self.refit(parent);
    }

    /// Puts `new` where `old` is below `parent`.
    fn replace(&mut self, parent: u32, old: u32, new: u32) {
        if parent == ROOT {
            self.root = new;
            self.links[new as usize].parent = ROOT;
        } else if let Some(children) = self.children(parent) {
            self.adopt(parent, children.map(|child| if child == old { new } else { child }));
        }
    }

    fn adopt(&mut self, parent: u32, [a, b]: [u32; 2]) {
        // Node 0, which was the root, is no second child: that would make a leaf of its parent.
        let (first, second) = if b == 0 { (b, a) } else { (a, b) };
        self.links[parent as usize].first = first;
        self.nodes[parent as usize].second = second;
        for child in [first, second] {
            self.links[child as usize].parent = parent;
        }
    }

    /// Boxes and heights from `node` up.
    fn refit(&mut self, mut node: u32) {
        while node != ROOT {
            self.measure(node);
            node = self.parent(node);
        }
    }

    fn measure(&mut self, node: u32) {
        if let Some(children) = self.children(node) {
            let [a, b] = children.map(|child| self.nodes[child as usize]);
            let [ha, hb] = children.map(|child| self.links[child as usize].height);
            let here = &mut self.nodes[node as usize];
            here.aabb = a.aabb.union(&b.aabb);
            (here.first, here.count) = (a.first, a.count + b.count);
            self.links[node as usize].height = 1 + ha.max(hb);
        }
    }

    /// Preorder.
    fn put_in_order(&mut self) {
        // Where each node goes, instead of its height.
        let mut stack = [self.root; BINARY_DEPTH_MAX as usize + 1];
        let (mut waiting, mut place) = (1, 0);
        while waiting > 0 {
            waiting -= 1;
            let node = stack[waiting];
            self.links[node as usize].height = place;
            place += 1;
            if let Some([first, second]) = self.children(node) {
                stack[waiting] = second;
                stack[waiting + 1] = first;
                waiting += 2;
            }
        }
        for node in self.nodes.iter_mut().filter(|node| !node.is_leaf()) {
            node.second = self.links[node.second as usize].height;
        }
        for here in 0..self.nodes.len() {
            loop {
                let there = self.links[here].height as usize;
                if there == here {
                    break;
                }
                self.nodes.swap(here, there);
                (self.links[here].height, self.links[there].height) = (self.links[there].height, there as u32);
            }
        }
    }
}
