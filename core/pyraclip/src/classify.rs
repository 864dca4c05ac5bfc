//! A cell against a pyramid: outcodes and the first test of A.2, bit operations only.

use crate::distances::Distances;
use crate::{ClipCounts, ClipPyramid, edge};
use hybray_geometry::Aabb;

/// How a cell lies to a pyramid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// No ray of the pyramid touches it.
    Outside,
    /// A ray may touch it.
    Partly,
    /// It lies in the pyramid, and so does every part of it.
    Inside,
}

/// Classifies one box by both tests. [`crate::clip`] does the same, with distances that it has averaged.
#[must_use]
pub fn classify(pyramid: &ClipPyramid, aabb: &Aabb, counts: &mut ClipCounts) -> Verdict {
    verdict(pyramid, &Distances::of_root(pyramid, aabb), aabb, counts)
}

pub(crate) fn verdict(pyramid: &ClipPyramid, distances: &Distances, aabb: &Aabb, counts: &mut ClipCounts) -> Verdict {
    counts.classified += 1;
    if aabb.contains(&Aabb { lo: pyramid.apex, hi: pyramid.apex }) {
        counts.first_partly += 1;
        return Verdict::Partly;
    }
    let codes = Outcodes::of(distances);
    match codes.first_test() {
        First::Outside => {
            counts.first_outside += 1;
            Verdict::Outside
        }
        First::Inside => {
            counts.first_inside += 1;
            Verdict::Inside
        }
        First::Partly => {
            counts.first_partly += 1;
            Verdict::Partly
        }
        First::Unsure => {
            counts.second += 1;
            if edge::may_overlap(pyramid, distances, &codes, aabb, counts) {
                Verdict::Partly
            } else {
                counts.second_outside += 1;
                Verdict::Outside
            }
        }
    }
}

/// Cohen and Sutherland's outcodes of the eight vertices, turned about: for each plane a byte with one bit a vertex, so
/// that one AND or OR treats all eight.
///
/// Planes 0 to 3 are the pyramid's. Plane 4 is their sum, which every point of the pyramid but the apex is inside: what
/// is outside it is behind the apex. Its distance is the sum of the four.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcodes {
    /// Vertices outside by more than the margin.
    pub sure: [u8; 5],
    /// Vertices not inside by at least the margin.
    pub maybe: [u8; 5],
}

/// What the first test says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum First {
    Outside,
    Partly,
    Inside,
    /// The edges have to tell.
    Unsure,
}

const ALL: u8 = 0xff;

impl Outcodes {
    /// Outcodes by distances and margins.
    pub fn of(d: &Distances) -> Self {
        let mut codes = Self { sure: [0; 5], maybe: [0; 5] };
        let mut mark = |plane: usize, v: usize, distance: f32, margin: f32| {
            // A distance that is not a number is in doubt: not surely outside, not surely inside.
            codes.sure[plane] |= u8::from(distance < -margin) << v;
            codes.maybe[plane] |= u8::from(!(distance >= margin)) << v;
        };
        // Half as much again pays for the three sums: gamma(3) of distances whose margins are gamma(20) each.
        let margin = 1.5 * ((d.margin[0] + d.margin[1]) + (d.margin[2] + d.margin[3]));
        for v in 0..8 {
            for plane in 0..4 {
                mark(plane, v, d.of[plane][v], d.margin[plane]);
            }
            mark(4, v, (d.of[0][v] + d.of[1][v]) + (d.of[2][v] + d.of[3][v]), margin);
        }
        codes
    }

    /// Whether every vertex is surely ahead of the apex. Only then can a cell be looked at as the paper does, by its
    /// central projection upon a plane in which the pyramid is a convex quadrilateral P.
    pub fn ahead(&self) -> bool {
        self.maybe[4] == 0
    }

    /// The cases of A.2, with its subspaces (figure A.2, the top at the top):
    ///
    /// ```text
    ///   A | B | C
    ///  ---+---+---
    ///   D | P | E
    ///  ---+---+---
    ///   F | G | H
    /// ```
    pub fn first_test(&self) -> First {
        let [left, right, bottom, top, _] = self.sure;
        if self.sure.contains(&ALL) {
            return First::Outside;
        }
        if self.maybe[..4] == [0; 4] {
            return First::Inside;
        }
        if left | right | bottom | top != ALL {
            // A vertex in P, or not surely elsewhere.
            return First::Partly;
        }
        // A vertex in each of B and G, or D and E: what lies between them is never outside the planes that it passes
        // between, so it crosses P from side to side.
        let b = top & !(left | right | bottom);
        let g = bottom & !(left | right | top);
        let d = left & !(bottom | top | right);
        let e = right & !(bottom | top | left);
        if (b != 0 && g != 0) || (d != 0 && e != 0) {
            return First::Partly;
        }
        // Whatever convex shape ahead of the apex reaches into A, C, F and H contains P: a line that held it off P
        // would have P's corner nearest to it on the wrong side of what is in that corner's subspace.
        let corners = [left & top, right & top, left & bottom, right & bottom];
        if self.ahead() && corners.iter().all(|&m| m != 0) {
            return First::Partly;
        }
        First::Unsure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Vertices in these subspaces, all surely ahead: what the first test says.
    fn check(vertices: [&str; 8], expected: First) {
        assert_eq!(codes(vertices).first_test(), expected, "{vertices:?}");
    }

    fn codes(vertices: [&str; 8]) -> Outcodes {
        let mut codes = Outcodes { sure: [0; 5], maybe: [0; 5] };
        for (v, sector) in vertices.into_iter().enumerate() {
            let planes: &[usize] = match sector {
                "A" => &[0, 3],
                "B" => &[3],
                "C" => &[1, 3],
                "D" => &[0],
                "E" => &[1],
                "F" => &[0, 2],
                "G" => &[2],
                "H" => &[1, 2],
                _ => &[],
            };
            for &plane in planes {
                codes.sure[plane] |= 1 << v;
                codes.maybe[plane] |= 1 << v;
            }
        }
        codes
    }

    #[test]
    fn corners_tell_only_of_cells_ahead() {
        let mut around = codes(["A", "C", "F", "H", "H", "F", "C", "A"]);
        around.maybe[4] = 1;
        assert_eq!(around.first_test(), First::Unsure);
        around.maybe[4] = ALL;
        around.sure[4] = ALL;
        assert_eq!(around.first_test(), First::Outside);
    }

    #[test]
    fn the_cases_of_a_2() {
        check(["P", "P", "P", "P", "P", "P", "P", "P"], First::Inside);
        check(["A", "B", "C", "A", "B", "C", "A", "B"], First::Outside);
        check(["C", "E", "H", "C", "E", "H", "C", "E"], First::Outside);
        check(["A", "D", "F", "A", "D", "F", "A", "D"], First::Outside);
        check(["F", "G", "H", "F", "G", "H", "F", "G"], First::Outside);
        check(["A", "B", "C", "A", "B", "C", "A", "P"], First::Partly);
        check(["P", "P", "P", "P", "P", "P", "P", "A"], First::Partly);
        check(["B", "B", "B", "B", "B", "B", "B", "G"], First::Partly);
        check(["D", "D", "D", "D", "D", "D", "D", "E"], First::Partly);
        check(["A", "C", "F", "H", "H", "F", "C", "A"], First::Partly);
        check(["A", "C", "F", "F", "F", "F", "C", "A"], First::Unsure);
        check(["D", "D", "D", "D", "C", "C", "C", "C"], First::Unsure);
        check(["A", "A", "A", "A", "H", "H", "H", "H"], First::Unsure);
        check(["D", "D", "D", "D", "B", "B", "B", "B"], First::Unsure);
    }
}
