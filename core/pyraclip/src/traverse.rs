//! One ray along a cliplist, by exit points (A.3).

use crate::ClipCell;
use hybray_geometry::{Aabb, Candidate, RayKernel, SLAB_WIDEN};

/// What traversing did. Counts are added up over calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraverseCounts {
    /// Cells whose exit was computed.
    pub exits: u64,
    /// Cells whose entry was computed too.
    pub entries: u64,
    /// Cells whose objects were tested.
    pub visits: u64,
}

/// Takes `ray` along `cells`, the cliplist of a pyramid that holds it, and returns the nearest hit before `best`.
///
/// `visit` tests the objects of one cell: it puts into `best` whatever precedes it ([`Candidate::precedes`]), as
/// `Sphere::hit` and `Triangle::hit` do. Begin with [`Candidate::none`] of the ray's `t_max`. Each cell is looked at
/// once at most.
///
/// # Why the result is that of testing every object
///
/// Write T(x) for `(x - origin) * inverse` in `f32`, which is monotone in the plane x; E for a cell's exit, the least T
/// of its three back faces; I for its slab interval, from the greatest T of its front faces to E, widened. A hit's
/// distance t lies in the I of the object's own box by definition, is finite, and is 0 or more.
///
/// *An object is in a leaf whose I holds t.* For the root this holds: it contains the box. Cut a cell for which it
/// holds at the plane q. If the box touches one half only, T(q) bounds that half no tighter than the box itself is
/// bounded: t is in the I of that half. If it touches both, t is on one side of T(q) or the other. If T(q) is not a
/// number, the ray lies in q, which bounds neither half: t is in the I of both, and the object is in both, for a box
/// that the ray meets then touches q.
///
/// *Let L be the first such leaf in the list: t is at least the E of every leaf before it.* Such a leaf is in the near
/// half of some cell, and L in the far half. If T(q) is not a number, the near half has such a leaf too, and L is not
/// the first. If the ray goes away from the far half, t can be in L's I only if t is 0 and the apex in q; then the
/// object's box holds the apex, and the object is in the first leaf of all, which holds the apex too. If the ray goes
/// towards it, E is at most T(q), and L's I begins at T(q) or later.
///
/// So nothing that precedes `best` is missed if the walk ends where `best.t < E`, and if it skips a cell whose widened
/// exit is less than an earlier E, whose I is empty, or whose I begins after `best.t`. (The clipping's margins see to
/// it that L is in the list.) `(x - origin) * inverse` must not underflow: with directions of about length 1,
/// coordinates are equal or more than 2^-100 apart.
///
/// The paper compares exits alone, without widening. That would miss a hit clamped to the widened end of its own box;
/// and it would visit a cell beside the ray where the cells before it are not in the list.
pub fn traverse<C>(
    cells: &[ClipCell<C>],
    ray: &RayKernel,
    mut best: Candidate,
    counts: &mut TraverseCounts,
    mut visit: impl FnMut(&ClipCell<C>, &mut Candidate),
) -> Candidate {
    let exits = Exits::of(ray);
    let mut reached = ray.t_min;
    for cell in cells {
        counts.exits += 1;
        let exit = exits.exit(&cell.aabb);
        if exit * SLAB_WIDEN >= reached {
            counts.entries += 1;
            let (entry, widened) = ray.slab(&cell.aabb);
            if entry <= widened && entry <= best.t {
                counts.visits += 1;
                visit(cell, &mut best);
            }
        }
        if best.t < exit {
            break;
        }
        if exit > reached {
            reached = exit;
        }
    }
    best
}

/// A ray and which faces it leaves a box by.
struct Exits<'a> {
    ray: &'a RayKernel,
    downward: [bool; 3],
}

impl<'a> Exits<'a> {
    fn of(ray: &'a RayKernel) -> Self {
        Self { ray, downward: ray.inverse.map(f32::is_sign_negative) }
    }

    /// The far end of [`RayKernel::slab`] before it is widened: a plane that the ray lies in gives NaN, and bounds
    /// nothing.
    fn exit(&self, aabb: &Aabb) -> f32 {
        let mut exit = f32::INFINITY;
        for axis in 0..3 {
            let plane = if self.downward[axis] { aabb.lo[axis] } else { aabb.hi[axis] };
            let t = (plane - self.ray.origin[axis]) * self.ray.inverse[axis];
            if t < exit {
                exit = t;
            }
        }
        exit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_geometry::{Ray, Vec3};
    use std::vec::Vec;

    #[test]
    fn exits_are_those_of_the_slab_test() {
        let values = [-2.0, -0.3, -0.0, 0.0, 1e-3, 0.1, 0.7, 1.0];
        for i in 0..8usize.pow(4) {
            let pick = |n: u32| values[i / 8usize.pow(n) % 8];
            let direction = Vec3::new(pick(0), pick(1), pick(2));
            if direction == Vec3::ZERO {
                continue;
            }
            let origin = Vec3::new(pick(3), pick(1), pick(2));
            let ray = RayKernel::new(&Ray { origin, direction, t_min: 0.0, t_max: 1.0 });
            let aabb = Aabb { lo: Vec3::new(-0.3, 0.0, 0.1), hi: Vec3::new(0.7, 1.0, pick(3).max(0.7)) };
            assert_eq!(ray.slab(&aabb).1.to_bits(), (Exits::of(&ray).exit(&aabb) * SLAB_WIDEN).to_bits(), "{ray:?}");
        }
    }

    /// Cells (x and y, from least to greatest; 2 wide in z), with the `t` of what is in them: which are visited, and of
    /// how many the entry is computed.
    fn check(origin: [f32; 2], direction: [f32; 2], cells: &[([f32; 4], Option<f32>)], visits: &[usize], entries: u64) {
        let ray = RayKernel::new(&Ray {
            origin: Vec3::new(origin[0], origin[1], 0.0),
            direction: Vec3::new(direction[0], direction[1], 0.0),
            t_min: 0.0,
            t_max: f32::INFINITY,
        });
        let cell = |(i, &([x0, x1, y0, y1], _)): (usize, &([f32; 4], Option<f32>))| ClipCell {
            cell: i,
            aabb: Aabb { lo: Vec3::new(x0, y0, -1.0), hi: Vec3::new(x1, y1, 1.0) },
            inside: false,
        };
        let list: Vec<_> = cells.iter().enumerate().map(cell).collect();
        let (mut visited, mut counts) = (Vec::new(), TraverseCounts::default());
        traverse(&list, &ray, Candidate::none(f32::INFINITY), &mut counts, |cell, best| {
            visited.push(cell.cell);
            let found = cells[cell.cell].1.map(|t| Candidate { t, id: cell.cell as u32 });
            *best = found.filter(|f| f.precedes(best)).unwrap_or(*best);
        });
        assert_eq!((&visited[..], counts.entries), (visits, entries), "{cells:?}");
    }

    /// Cells side by side along x.
    fn row(planes: &[f32], hits: &[Option<f32>], visits: &[usize], entries: u64) {
        let cells: Vec<_> = planes.windows(2).zip(hits).map(|(x, &hit)| ([x[0], x[1], -1.0, 1.0], hit)).collect();
        check([0.0; 2], [1.0, 0.0], &cells, visits, entries);
    }

    #[test]
    fn the_walk_ends_strictly_before_an_exit() {
        row(&[1.0, 2.0, 3.0], &[None, None], &[0, 1], 2);
        row(&[1.0, 2.0, 3.0], &[Some(1.5), None], &[0], 1);
        // Another object may be hit at the same distance, in the next cell only.
        row(&[1.0, 2.0, 3.0], &[Some(2.0), None], &[0, 1], 2);
        // Not yet: what was found lies beyond this cell. Then it is nearer than the third, whose entry ends it.
        row(&[1.0, 2.0, 3.0, 4.0], &[Some(2.5), None, None], &[0, 1], 2);
        // Behind the origin.
        row(&[-2.0, -1.0, 3.0], &[Some(9.0), None], &[1], 1);
    }

    #[test]
    fn cells_beside_the_ray_are_skipped() {
        let diagonal = |cells: &[([f32; 4], Option<f32>)], visits: &[usize], entries| {
            check([0.0, 0.0], [1.0, 0.5], cells, visits, entries);
        };
        let near = ([0.0, 2.0, 0.0, 2.0], None);
        // Its exit is before what has been reached.
        diagonal(&[near, ([0.0, 1.0, 2.0, 4.0], None)], &[0], 1);
        // Its exit is not, but its entry is after it.
        diagonal(&[near, ([2.0, 4.0, -2.0, 0.0], None), ([0.0, 4.0, 3.0, 4.0], None)], &[0], 2);
    }

    /// A ray past the edge in which four cells meet, one unit in the last place to the side of the fourth, B: its slab
    /// interval there, and that of an object in B's corner, is empty but for the widening. So the object counts as hit,
    /// and B has to be visited, although its exit is before that of the cell before it.
    #[test]
    fn what_is_hit_by_the_widening_alone_is_found() {
        let origin = [1000.0f32.next_up(), 1000.0].map(|x| -x);
        let (a, above, b) = ([-1.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 1.0], [0.0, 1.0, -1.0, 0.0]);
        check(origin, [1.0, 1.0], &[(a, None), (above, None), (b, None)], &[0, 1, 2], 3);
    }
}
