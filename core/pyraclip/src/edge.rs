//! The second test of A.2: the twelve edges of a cell against the pyramid, by equation A.1 without its divisions.

use crate::classify::Outcodes;
use crate::distances::Distances;
use crate::pyramid::ADJACENT;
use crate::{ClipCounts, ClipPyramid};
use hybray_geometry::{Aabb, UNIT_ROUNDOFF};

/// Eight roundings: more than two products of sums have.
const ROUNDED: f32 = 1.0 + 8.0 * UNIT_ROUNDOFF;

/// Whether a ray of the pyramid may touch the cell, of whose vertices each is surely outside some plane and not all
/// outside the same.
///
/// An edge meets the pyramid unless it leaves through one plane before it comes in through another. If none meets it,
/// the pyramid misses the cell, or passes through the inside of a face, all of it; then each corner of its section with
/// that face's plane has part of the face's border in the opposite subspace (A, C, F or H). So if the edges are never
/// seen in one of those four, the cell is outside. If they are seen in all, and the cell is ahead of the apex, its
/// projection contains P; if it is not, the axis decides, since all rays pass through or none.
pub(crate) fn may_overlap(
    pyramid: &ClipPyramid,
    distances: &Distances,
    codes: &Outcodes,
    aabb: &Aabb,
    counts: &mut ClipCounts,
) -> bool {
    // One bit for each of ADJACENT: the subspaces A, C, F and H, in some order.
    let mut corners = 0u8;
    for (bit, (i, j)) in ADJACENT.into_iter().enumerate() {
        corners |= u8::from(codes.maybe[i] & codes.maybe[j] != 0) << bit;
    }
    for upper_bit in [1, 2, 4] {
        for v in (0..8).filter(|v| v & upper_bit == 0) {
            let edge = Edge::new(distances, codes, v, v | upper_bit);
            counts.edges += 1;
            if !edge.misses(counts) {
                return true;
            }
            for (bit, (i, j)) in ADJACENT.into_iter().enumerate() {
                if corners >> bit & 1 == 0 && edge.may_leave_both(i, j) {
                    corners |= 1 << bit;
                }
            }
        }
    }
    if corners != 0b1111 {
        return false;
    }
    let surrounds = codes.ahead() || !axis_misses(pyramid, aabb);
    counts.surrounded += u64::from(surrounds);
    surrounds
}

/// A pair of vertices: what the paper calls a and b.
struct Edge<'a> {
    distances: &'a Distances,
    ends: [usize; 2],
    /// Outcodes of both ends, one bit a plane.
    sure: [u8; 2],
    maybe: [u8; 2],
}

impl<'a> Edge<'a> {
    fn new(distances: &'a Distances, codes: &Outcodes, v: usize, w: usize) -> Self {
        let of = |planes: &[u8; 5], vertex: usize| {
            planes.iter().enumerate().fold(0u8, |code, (plane, mask)| code | (mask >> vertex & 1) << plane)
        };
        Self {
            distances,
            ends: [v, w],
            sure: [of(&codes.sure, v), of(&codes.sure, w)],
            maybe: [of(&codes.maybe, v), of(&codes.maybe, w)],
        }
    }

    /// Whether no point of the edge is in the pyramid widened by the margin.
    ///
    /// Ends in neighbouring sides (D and B) take one evaluation of A.1; ends in opposite corners (A and H), one for
    /// each of the two corners that the edge can pass beyond. Planes that face each other take none: two of the normals
    /// add up, with positive weights, to what the other two add up to, so what is outside two facing planes is outside
    /// a third as well, ahead of the apex or behind, and an edge that goes there fails for a pair of neighbours.
    fn misses(&self, counts: &mut ClipCounts) -> bool {
        if self.sure[0] & self.sure[1] != 0 {
            return true;
        }
        for (i, j) in ADJACENT {
            for (v, w) in [(0, 1), (1, 0)] {
                if self.sure[v] >> i & 1 != 0 && self.sure[w] >> j & 1 != 0 {
                    counts.evaluations += 1;
                    let (lhs, rhs) = self.products(i, j, v, w, 1.0);
                    if lhs > rhs * ROUNDED + f32::MIN_POSITIVE {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Whether, between ends that are each inside one of planes `i` and `j`, some point may be outside both, when all
    /// is taken to be further out by the margin.
    fn may_leave_both(&self, i: usize, j: usize) -> bool {
        [(0, 1), (1, 0)].into_iter().any(|(v, w)| {
            self.maybe[v] >> i & 1 != 0 && self.maybe[w] >> j & 1 != 0 && {
                let (lhs, rhs) = self.products(i, j, v, w, -1.0);
                !(lhs * ROUNDED + f32::MIN_POSITIVE < rhs)
            }
        })
    }

    /// Both sides of A.1 multiplied by its denominators, with the margin added `sign` times to each distance: for `v`
    /// outside plane `i` alone and `w` outside `j` alone, there are points outside both if the first is greater.
    fn products(&self, i: usize, j: usize, v: usize, w: usize, sign: f32) -> (f32, f32) {
        let at =
            |plane: usize, end: usize| self.distances.of[plane][self.ends[end]] + sign * self.distances.margin[plane];
        (at(i, v) * at(j, w), at(j, v) * at(i, w))
    }
}

/// Whether the ray down the middle surely misses the cell, and what slab arithmetic takes for it.
fn axis_misses(pyramid: &ClipPyramid, aabb: &Aabb) -> bool {
    const WIDER: f32 = 1.0 + 32.0 * UNIT_ROUNDOFF;
    let (entry, exit) = pyramid.axis.slab(aabb);
    exit < 0.0 || entry > exit * WIDER * WIDER
}

#[cfg(test)]
mod tests {
    use crate::{ClipCounts, ClipPyramid, Verdict, classify};
    use hybray_geometry::{Aabb, Pyramid, Vec3};

    /// The pyramid from the origin along z whose section at z = 1 has these corners, left bottom first, clockwise.
    fn pyramid(corners: [[f32; 2]; 4]) -> ClipPyramid {
        let corners = corners.map(|[x, y]| Vec3::new(x, y, 1.0));
        ClipPyramid::new(&Pyramid::through(Vec3::ZERO, corners).unwrap()).unwrap()
    }

    /// A square on its point: the planes are at 45 degrees to the cells.
    fn diamond() -> ClipPyramid {
        pyramid([[-0.5, 0.0], [0.0, 0.5], [0.5, 0.0], [0.0, -0.5]])
    }

    fn check(pyramid: &ClipPyramid, lo: [f32; 3], hi: [f32; 3], expected: Verdict) -> ClipCounts {
        let mut counts = ClipCounts::default();
        let aabb = Aabb { lo: Vec3::from_array(lo), hi: Vec3::from_array(hi) };
        assert_eq!(classify(pyramid, &aabb, &mut counts), expected, "{aabb:?}");
        assert_eq!(counts.second, 1, "the first test was meant to leave it open");
        counts
    }

    /// Bars at z = 1 beyond one point of the diamond, from one corner subspace to the one opposite: which of the two
    /// evaluations tells is different for bars on opposite sides.
    #[test]
    fn ends_in_opposite_corners_take_both_evaluations() {
        let d = diamond();
        check(&d, [-2.0, 0.6, 1.0], [2.0, 0.7, 1.01], Verdict::Outside);
        check(&d, [-2.0, -0.7, 1.0], [2.0, -0.6, 1.01], Verdict::Outside);
        check(&d, [0.6, -2.0, 1.0], [0.7, 2.0, 1.01], Verdict::Outside);
        check(&d, [-0.7, -2.0, 1.0], [-0.6, 2.0, 1.01], Verdict::Outside);
        check(&d, [-2.0, 0.4, 1.0], [2.0, 0.7, 1.01], Verdict::Partly);
        check(&d, [-2.0, -0.7, 1.0], [2.0, -0.4, 1.01], Verdict::Partly);
        check(&d, [0.4, -2.0, 1.0], [0.7, 2.0, 1.01], Verdict::Partly);
        check(&d, [-0.7, -2.0, 1.0], [-0.4, 2.0, 1.01], Verdict::Partly);
    }

    /// Ends in neighbouring sides (D and B): one evaluation.
    #[test]
    fn ends_in_neighbouring_sides_take_one() {
        let turned = pyramid([[-0.5, -0.3], [-0.3, 0.5], [0.5, 0.3], [0.3, -0.5]]);
        let counts = check(&turned, [-1.0, 0.55, 1.0], [0.2, 0.65, 1.01], Verdict::Outside);
        // Four edges along x, and no other with ends in two subspaces.
        assert_eq!(counts.evaluations, 4);
        check(&turned, [-1.0, 0.4, 1.0], [0.2, 0.65, 1.01], Verdict::Partly);
    }

    /// No edge meets the pyramid, and the vertices are neither in A, C, F and H all, nor on facing sides.
    #[test]
    fn a_cell_can_surround_the_pyramid() {
        let turned = pyramid([[-0.02, -0.01], [-0.01, 0.02], [0.02, 0.01], [0.01, -0.02]]);
        let counts = check(&turned, [-0.1, -0.04, 1.1], [0.036, 0.064, 1.6], Verdict::Partly);
        assert_eq!((counts.surrounded, counts.edges), (1, 12));
    }

    /// The same where the cell reaches behind the apex, so that its projection tells nothing: the edges are seen in A,
    /// C, F and H whether the rays pass through the cell or away from it.
    #[test]
    fn the_axis_decides_for_a_cell_beside_the_apex() {
        let oblique = pyramid([[0.6, -0.5], [0.55, 0.1], [1.3, 0.3], [1.2, -0.6]]);
        let counts = check(&oblique, [0.1, -0.8, -0.3], [0.2, 0.1, 0.4], Verdict::Partly);
        assert_eq!((counts.surrounded, counts.edges), (1, 12));
        let counts = check(&oblique, [-1.0, -0.1, -0.4], [-0.2, 0.2, 0.8], Verdict::Outside);
        assert_eq!((counts.surrounded, counts.edges), (0, 12));
    }

    /// Four planes alone take a wall behind the apex for one that surrounds the pyramid.
    #[test]
    fn behind_the_apex() {
        let narrow = pyramid([[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.1, -0.1]]);
        let first = |lo: [f32; 3], hi: [f32; 3], expected: Verdict| {
            let mut counts = ClipCounts::default();
            let aabb = Aabb { lo: Vec3::from_array(lo), hi: Vec3::from_array(hi) };
            assert_eq!(classify(&narrow, &aabb, &mut counts), expected, "{aabb:?}");
            assert_eq!(counts.second, 0, "the first test was meant to tell");
        };
        first([-10.0, -10.0, -2.0], [10.0, 10.0, -1.0], Verdict::Outside);
        first([-10.0, -10.0, 1e-2], [10.0, 10.0, 1.0], Verdict::Partly);
        first([-10.0, -10.0, -1.0], [10.0, -0.2, 1.0], Verdict::Outside);
        // The apex inside, in a face ahead and behind, at a vertex.
        first([-10.0, -10.0, -2.0], [10.0, 10.0, 1.0], Verdict::Partly);
        first([-10.0, -10.0, 0.0], [10.0, 10.0, 1.0], Verdict::Partly);
        first([-10.0, -10.0, -1.0], [10.0, 10.0, 0.0], Verdict::Partly);
        first([0.0, 0.0, -1.0], [1.0, 1.0, 0.0], Verdict::Partly);
    }
}
