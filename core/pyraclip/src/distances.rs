//! Distances of a cell's vertices from the pyramid's planes, averaged on the way down (figure A.5), and their margin.

use crate::ClipPyramid;
use crate::tree::midpoint;
use hybray_geometry::{Aabb, Vec3, gamma};

/// The 32 distances of a cell: positive inside.
///
/// # The margin
///
/// `margin[i]` bounds, for plane `i` with leaned normal `n`, the sum of two things:
///
/// 1. *What a distance is off by*: `|of[i][v] - n . (vertex v - apex)|`, for the vertex whose coordinates are the
///    cell's `f32` planes.
/// 2. *What the slab test is off by*: a ray is taken to be in a cell at any `t` of its `f32` slab interval, whose ends
///    are off by gamma(3) (difference, reciprocal, product) and gamma(5) more at the far side, which is widened. At
///    such a `t` the ray is within gamma(8) |plane - apex| of the cell on each axis; that changes its distance from
///    plane `i` by gamma(8) S, where S is the sum over the axes of |n| times the root's greatest |plane - apex|. (A
///    component of a direction whose reciprocal overflows moves the ray by less than 2^-28 of that way:
///    [`ClipPyramid::holds`].)
///
/// At the root the distances are three products of differences, summed: off by gamma(4) S. So the margin starts at
/// gamma(12) S, and the other eight of the gamma(20) below pay for the rounding of S and of the margin itself.
///
/// A midpoint's distance is the average of two: no further off than they are, plus the rounding of their sum, which is
/// u times the result, plus `|n_axis|` times what the plane is off the true midpoint, which is half the rounding error
/// of `lo + hi` (exactly known: Knuth's two-sum). Both are added on each level, twice over. Near a plane, where margins
/// matter, the distances halve with the cells, so the sum over all levels stays near that of the first few; its bound
/// is levels x ulp x the largest distance.
///
/// A distance computed anew is off by gamma(4) S again, which every margin already holds.
///
/// `f32::MIN_POSITIVE` stands for all underflow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Distances {
    /// `of[plane][vertex]`: bit 0, 1, 2 of a vertex's number is set if it is at the upper x, y, z.
    pub of: [[f32; 8]; 4],
    /// See above.
    pub margin: [f32; 4],
}

impl Distances {
    /// Those of the root's vertices.
    pub fn of_root(pyramid: &ClipPyramid, aabb: &Aabb) -> Self {
        let reach = (aabb.lo - pyramid.apex).abs().max((aabb.hi - pyramid.apex).abs());
        Self {
            of: pyramid.normals.map(|n| core::array::from_fn(|v| distance(n, vertex(aabb, v), pyramid.apex))),
            margin: pyramid.normals.map(|n| gamma(20) * n.abs().dot(reach) + f32::MIN_POSITIVE),
        }
    }

    /// Those of the halves of the cell `aabb`, cut across `axis` (0..3) at `plane`: 4 new vertices, 8 old ones.
    pub fn halves(&self, pyramid: &ClipPyramid, aabb: &Aabb, axis: usize, plane: f32) -> (Self, Self) {
        let (lo, hi) = (aabb.lo[axis], aabb.hi[axis]);
        let upper_bit = 1 << axis;
        let (mut lower, mut upper) = (*self, *self);
        let averaged = plane == midpoint(lo, hi);
        let off = two_sum_error(lo, hi).abs();
        for i in 0..4 {
            let n = pyramid.normals[i];
            let mut most = 0.0f32;
            for v in (0..8).filter(|v| v & upper_bit == 0) {
                let new = if averaged {
                    0.5 * (self.of[i][v] + self.of[i][v | upper_bit])
                } else {
                    let mut at = vertex(aabb, v);
                    at[axis] = plane;
                    distance(n, at, pyramid.apex)
                };
                lower.of[i][v | upper_bit] = new;
                upper.of[i][v] = new;
                if new.abs() > most {
                    most = new.abs();
                }
            }
            if averaged {
                let margin = self.margin[i] + f32::EPSILON * most + n[axis].abs() * off;
                lower.margin[i] = margin;
                upper.margin[i] = margin;
            }
        }
        (lower, upper)
    }
}

fn vertex(aabb: &Aabb, v: usize) -> Vec3 {
    let pick = |axis: usize| if v >> axis & 1 == 0 { aabb.lo[axis] } else { aabb.hi[axis] };
    Vec3::new(pick(0), pick(1), pick(2))
}

fn distance(n: Vec3, p: Vec3, apex: Vec3) -> f32 {
    let d = p - apex;
    n.x * d.x + n.y * d.y + n.z * d.z
}

/// `(a + b) - fl(a + b)`, exactly, unless that overflows.
fn two_sum_error(a: f32, b: f32) -> f32 {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (a - a_part) + (b - b_part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_geometry::Pyramid;

    /// A pyramid askew, and a root whose planes no midpoint meets exactly.
    fn askew() -> (ClipPyramid, Aabb) {
        let corner = |x: f32, y: f32| Vec3::new(0.7 + 0.1 * x, 0.31 * y - 0.2 * x, 0.6 + 0.07 * y);
        let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        let pyramid = Pyramid::through(Vec3::new(-3.3, 0.123, -2.7), corners).unwrap();
        let root = Aabb { lo: Vec3::new(-1.0 / 3.0, 0.1, 0.7), hi: Vec3::new(0.9, 1.0 / 7.0 + 1.0, 2.9) };
        (ClipPyramid::new(&pyramid).unwrap(), root)
    }

    fn worst_share_of_margin(levels: usize, fraction: Option<f32>) -> f64 {
        let (pyramid, root) = askew();
        let mut worst = 0.0f64;
        for path in 0..64u64 {
            let (mut cell, mut distances) = (root, Distances::of_root(&pyramid, &root));
            for level in 0..levels {
                for (i, n) in pyramid.normals.into_iter().enumerate() {
                    for v in 0..8 {
                        let exact: f64 = (0..3)
                            .map(|k| {
                                let away = f64::from(vertex(&cell, v)[k]) - f64::from(pyramid.apex[k]);
                                f64::from(n[k]) * away
                            })
                            .sum();
                        let off = (f64::from(distances.of[i][v]) - exact).abs();
                        worst = worst.max(off / f64::from(distances.margin[i]));
                    }
                }
                let axis = level % 3;
                let (lo, hi) = (cell.lo[axis], cell.hi[axis]);
                let plane = fraction.map_or(midpoint(lo, hi), |f| lo + (hi - lo) * f);
                if !(lo < plane && plane < hi) {
                    break;
                }
                let (lower, upper) = distances.halves(&pyramid, &cell, axis, plane);
                // A bit pattern that differs between paths on every level.
                if (path.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (level % 60)) & 1 == 0 {
                    (cell.hi[axis], distances) = (plane, lower);
                } else {
                    (cell.lo[axis], distances) = (plane, upper);
                }
            }
        }
        worst
    }

    #[test]
    fn averaged_distances_stay_within_their_margin() {
        // Eight of twenty units of the root's margin are the distances' own, the rest the slab test's and slack.
        let worst = worst_share_of_margin(60, None);
        assert!(worst < 0.5, "{worst}");
        assert!(worst > 0.02, "the margin is far too wide: {worst}");
    }

    #[test]
    fn distances_computed_anew_stay_within_their_margin() {
        assert!(worst_share_of_margin(60, Some(0.4)) < 0.5);
    }

    #[test]
    fn margins_grow_little() {
        let (pyramid, root) = askew();
        let first = Distances::of_root(&pyramid, &root);
        let (mut cell, mut at) = (root, first);
        for level in 0..48 {
            let axis = level % 3;
            let plane = midpoint(cell.lo[axis], cell.hi[axis]);
            at = at.halves(&pyramid, &cell, axis, plane).0;
            cell.hi[axis] = plane;
        }
        for i in 0..4 {
            assert!(at.margin[i] > first.margin[i]);
            assert!(at.margin[i] < 8.0 * first.margin[i], "{:?} {:?}", at.margin, first.margin);
        }
    }

    #[test]
    fn two_sum_is_exact() {
        for (a, b) in [(1.0, 1e-9), (0.1, 0.2), (-0.7, 1e8), (3.0, 5.0), (1e-40, 1.0)] {
            let sum: f32 = a + b;
            assert_eq!(f64::from(a) + f64::from(b), f64::from(sum) + f64::from(two_sum_error(a, b)));
        }
    }
}
