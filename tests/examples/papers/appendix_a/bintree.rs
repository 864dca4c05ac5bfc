//! The recursive walk of one ray through the midpoint tree, which appendix A compares with (its references 13 and 14).
//!
//! A cell's interval is its slab interval, cut by one plane at each level. Why its hits are those of testing every object is
//! told at [`hybray_pyraclip::traverse`].

use hybray_bintree::midpoint::Tree;
use hybray_geometry::{Candidate, RayKernel, SLAB_WIDEN};
use hybray_pyraclip::Bintree as _;

/// A cell, and the distances at which the ray enters and leaves it.
pub type Waiting = (u32, f32, f32);

/// The nearest hit; `test` tests an object. Counts cells in `steps`.
pub fn walk(
    tree: &Tree<'_>,
    ray: &RayKernel,
    mut best: Candidate,
    waiting: &mut Vec<Waiting>,
    steps: &mut u64,
    mut test: impl FnMut(u32, &mut Candidate),
) -> Candidate {
    let t = |axis: usize, plane: f32| (plane - ray.origin[axis]) * ray.inverse[axis];
    let downward = ray.inverse.map(f32::is_sign_negative);
    let (root, aabb) = tree.root();
    let (mut entry, mut exit) = (ray.t_min, f32::INFINITY);
    for axis in 0..3 {
        let (near, far) = (aabb.lo[axis], aabb.hi[axis]);
        let (near, far) = if downward[axis] { (far, near) } else { (near, far) };
        // A plane that the ray lies in is not a number, and bounds nothing.
        entry = entry.max(t(axis, near));
        exit = exit.min(t(axis, far));
    }
    waiting.clear();
    waiting.push((root, entry, exit));
    while let Some((cell, entry, exit)) = waiting.pop() {
        if !(entry <= exit * SLAB_WIDEN && entry <= best.t) {
            continue;
        }
        *steps += 1;
        if let Some(split) = tree.split(cell) {
            let at = t(split.axis, split.plane);
            let (near, far) =
                if downward[split.axis] { (split.upper, split.lower) } else { (split.lower, split.upper) };
            waiting.push((far, entry.max(at), exit));
            waiting.push((near, entry, exit.min(at)));
        } else {
            let node = &tree.nodes[cell as usize];
            for item in &tree.items[node.first as usize..][..node.count as usize] {
                test(item.id, &mut best);
            }
        }
    }
    best
}
