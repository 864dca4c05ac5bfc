//! Polygons into triangles: a fan where the polygon is convex, ear clipping (the `earcut` crate) where it is not.
//!
//! Every triangle keeps the polygon's turn. Vertices that lie on a straight edge stay vertices of the triangles: the
//! neighbouring polygon has them too, and a mesh that loses them is no longer closed. What has no area (by the sign
//! of f64 arithmetic on the f32 coordinates, no tolerance) is left out.

use earcut::Earcut;

/// Corners that one polygon may have. Ear clipping can take time in their square, and files are not to be trusted.
pub(crate) const CORNERS_MAX: usize = 10_000;

/// First corners that are tried for a fan before ear clipping has to do it.
const FANS_TRIED: usize = 8;

/// Scratch memory for polygons in turn.
pub(crate) struct Polygons {
    earcut: Earcut<f64>,
    ring: Vec<u32>,
    flat: Vec<[f64; 2]>,
    ears: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl Polygons {
    pub(crate) fn new() -> Self {
        let (ring, flat, ears, triangles) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { earcut: Earcut::new(), ring, flat, ears, triangles }
    }

    /// The triangles of a polygon as indices into `corners`; none if it has no area.
    pub(crate) fn triangulate(&mut self, corners: &[[f32; 3]]) -> &[[u32; 3]] {
        self.triangles.clear();
        if let &[a, b, c] = corners {
            if has_area(a, b, c) {
                self.triangles.push([0, 1, 2]);
            }
            return &self.triangles;
        }
        self.ring.clear();
        for i in 0..corners.len() {
            let next = (i + 1) % corners.len();
            if corners[i] != corners[next] {
                self.ring.push(i as u32);
            }
        }
        let normal = newell(corners);
        if self.ring.len() < 3 || normal == [0.0; 3] {
            return &self.triangles;
        }
        self.flatten(corners, normal);
        if !(self.is_convex() && self.fan(corners)) {
            self.clip_ears(corners);
        }
        &self.triangles
    }

    /// Drops the coordinate along which the normal is longest, so that the polygon turns counterclockwise.
    fn flatten(&mut self, corners: &[[f32; 3]], normal: [f64; 3]) {
        let mut along = 0;
        for axis in 1..3 {
            if normal[axis].abs() > normal[along].abs() {
                along = axis;
            }
        }
        let (mut u, mut v) = ((along + 1) % 3, (along + 2) % 3);
        if normal[along] < 0.0 {
            (u, v) = (v, u);
        }
        self.flat.clear();
        self.flat.extend(self.ring.iter().map(|&i| {
            let p = corners[i as usize];
            [f64::from(p[u]), f64::from(p[v])]
        }));
    }

    /// Turns left or goes straight on at every corner, and goes round once.
    fn is_convex(&self) -> bool {
        let n = self.flat.len();
        let mut reversals = [0; 2];
        let mut last = [0.0; 2];
        // One edge more than there are, so that the reversal at the first corner counts. The first non-zero component
        // of each axis has nothing to differ from.
        for i in 0..=n {
            let (a, b, c) = (self.flat[i % n], self.flat[(i + 1) % n], self.flat[(i + 2) % n]);
            if turn(a, b, c) < 0.0 {
                return false;
            }
            for axis in 0..2 {
                let step = b[axis] - a[axis];
                if step != 0.0 {
                    reversals[axis] += usize::from(last[axis] * step.signum() < 0.0);
                    last[axis] = step.signum();
                }
            }
        }
        reversals.iter().all(|&r| r <= 2)
    }

    /// The fan around the first corner from which every triangle has area; false if the first few corners have none.
    fn fan(&mut self, corners: &[[f32; 3]]) -> bool {
        let n = self.ring.len();
        for apex in 0..n.min(FANS_TRIED) {
            self.triangles.clear();
            for i in 1..n - 1 {
                let triangle = [apex, (apex + i) % n, (apex + i + 1) % n].map(|i| self.ring[i]);
                let [a, b, c] = triangle.map(|i| corners[i as usize]);
                if !has_area(a, b, c) {
                    break;
                }
                self.triangles.push(triangle);
            }
            if self.triangles.len() == n - 2 {
                return true;
            }
        }
        false
    }

    fn clip_ears(&mut self, corners: &[[f32; 3]]) {
        self.triangles.clear();
        self.earcut.earcut_slice(&self.flat, &[] as &[u32], &mut self.ears);
        // `earcut` promises no order; three corners of a polygon in the order of its ring turn as the polygon does.
        for ear in self.ears.chunks_exact(3) {
            let mut ear = [ear[0], ear[1], ear[2]];
            ear.sort_unstable();
            let [a, b, c] = ear.map(|i| corners[self.ring[i as usize] as usize]);
            if has_area(a, b, c) {
                self.triangles.push(ear);
            }
        }
        for triangle in &mut self.triangles {
            *triangle = triangle.map(|i| self.ring[i as usize]);
        }
    }
}

/// Twice the signed area of a triangle in the plane.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether three points span a triangle.
pub(crate) fn has_area(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
    let (ab, ac) = ([0, 1, 2].map(|i| b[i] - a[i]), [0, 1, 2].map(|i| c[i] - a[i]));
    // Products are compared, not subtracted: a difference that underflows would pass for none.
    (0..3).any(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        ab[j] * ac[k] != ab[k] * ac[j]
    })
}

/// Newell's normal of a polygon: its length is twice the area; `[0; 3]` if there is none.
pub(crate) fn newell(corners: &[[f32; 3]]) -> [f64; 3] {
    let mut normal = [0.0; 3];
    let Some(origin) = corners.first().map(|p| p.map(f64::from)) else { return normal };
    for (i, b) in corners.iter().enumerate() {
        let a = corners[if i == 0 { corners.len() - 1 } else { i - 1 }];
        let [a, b] = [a, *b].map(|p| [0, 1, 2].map(|k| f64::from(p[k]) - origin[k]));
        for k in 0..3 {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            normal[k] += a[u] * b[v] - a[v] * b[u];
        }
    }
    normal
}

/// `v` at length 1; `None` if it has no length.
pub(crate) fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    // By the longest component first, so that no square over- or underflows.
    let longest = v.iter().fold(0.0, |m: f64, c| if c.abs() > m { c.abs() } else { m });
    if longest == 0.0 || !longest.is_finite() {
        return None;
    }
    let v = v.map(|c| c / longest);
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    Some(v.map(|c| c / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lift(flat: &[[i32; 2]]) -> Vec<[f32; 3]> {
        flat.iter().map(|p| [p[0] as f32, p[1] as f32, (p[0] + 2 * p[1]) as f32]).collect()
    }

    /// The shoelace sum in integers, which no code under test computes.
    fn shoelace(flat: &[[i32; 2]]) -> i64 {
        (0..flat.len())
            .map(|i| {
                let (a, b) = (flat[i], flat[(i + 1) % flat.len()]);
                i64::from(a[0]) * i64::from(b[1]) - i64::from(a[1]) * i64::from(b[0])
            })
            .sum()
    }

    /// Each triangle turns as the polygon, their areas add up to its area, and every boundary edge is one triangle's.
    fn check(flat: &[[i32; 2]], triangles: usize) {
        for turned in 0..flat.len() {
            for mirrored in [false, true] {
                let mut flat = flat.to_vec();
                flat.rotate_left(turned);
                if mirrored {
                    flat.reverse();
                }
                let area = shoelace(&flat);
                let mut polygons = Polygons::new();
                let found = polygons.triangulate(&lift(&flat)).to_vec();
                assert_eq!(found.len(), triangles, "{flat:?} {found:?}");
                let mut sum = 0;
                for t in &found {
                    let part = shoelace(&t.map(|i| flat[i as usize]));
                    assert!(part.signum() == area.signum(), "{flat:?}: {t:?} turns the wrong way");
                    sum += part;
                }
                assert_eq!(sum, area, "{flat:?} {found:?}");
                if triangles == flat.len() - 2 {
                    for i in 0..flat.len() {
                        let edge = [i as u32, ((i + 1) % flat.len()) as u32];
                        let sides = found.iter().filter(|t| edge.iter().all(|e| t.contains(e))).count();
                        assert_eq!(sides, 1, "{flat:?} {found:?} {edge:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn polygons_keep_their_area_turn_and_edges() {
        check(&[[0, 0], [4, 0], [0, 3]], 1);
        check(&[[0, 0], [4, 0], [4, 3], [0, 3]], 2);
        // A dart: the fan from the wrong corner would cover what is outside.
        check(&[[0, 0], [4, 0], [1, 1], [0, 4]], 2);
        // L, U and a comb.
        check(&[[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]], 4);
        check(&[[0, 0], [6, 0], [6, 4], [4, 4], [4, 2], [2, 2], [2, 4], [0, 4]], 6);
        // Corners on straight edges, of a convex polygon and of a concave one.
        check(&[[0, 0], [2, 0], [4, 0], [4, 4], [0, 4]], 3);
        check(&[[0, 0], [2, 0], [4, 0], [4, 2], [4, 4], [2, 4], [0, 4], [0, 2]], 6);
        check(&[[0, 0], [1, 0], [2, 0], [3, 0]].iter().chain(&[[3, 3]]).copied().collect::<Vec<_>>(), 3);
        check(&[[0, 0], [2, 0], [4, 0], [4, 2], [3, 2], [2, 2], [2, 3], [2, 4], [0, 4], [0, 2]], 8);
        // A corner that is given twice.
        check(&[[0, 0], [4, 0], [4, 0], [4, 3], [0, 3]], 2);
    }

    #[test]
    fn many_corners() {
        // A comb of 200 teeth is concave at half of its corners and long enough for earcut's hashed walk.
        let mut comb = vec![[0, 0], [400, 0]];
        for i in (0..200).rev() {
            comb.extend([[2 * i + 2, 10], [2 * i + 1, 2]]);
        }
        let mut polygons = Polygons::new();
        let found = polygons.triangulate(&lift(&comb)).to_vec();
        assert_eq!(found.len(), comb.len() - 2);
        assert_eq!(found.iter().map(|t| shoelace(&t.map(|i| comb[i as usize]))).sum::<i64>(), shoelace(&comb));
    }

    /// Skylines with a corner at every step, so that most corners lie on straight edges: all stay corners of triangles.
    #[test]
    fn corners_on_straight_edges_stay() {
        let mut choices = super::super::testing::Choices(12_345);
        for _ in 0..2_000 {
            let heights: Vec<i32> = (0..2 + choices.below(5)).map(|_| 1 + choices.below(4) as i32).collect();
            let mut ring: Vec<[i32; 2]> = (0..heights.len() as i32).map(|x| [x, 0]).collect();
            let mut y = 0;
            for (i, &height) in heights.iter().enumerate().rev() {
                while y != height {
                    ring.push([i as i32 + 1, y]);
                    y += (height - y).signum();
                }
                ring.push([i as i32 + 1, y]);
            }
            ring.extend((1..=y).rev().map(|y| [0, y]));
            let start = choices.below(ring.len());
            ring.rotate_left(start);
            let mut polygons = Polygons::new();
            let found = polygons.triangulate(&lift(&ring));
            assert_eq!(found.len(), ring.len() - 2, "{ring:?}");
            assert_eq!(found.iter().map(|t| shoelace(&t.map(|i| ring[i as usize]))).sum::<i64>(), shoelace(&ring));
        }
    }

    #[test]
    fn no_area_no_triangle() {
        let check = |corners: &[[f32; 3]]| assert!(Polygons::new().triangulate(corners).is_empty(), "{corners:?}");
        check(&[]);
        check(&[[1.0; 3]]);
        check(&[[1.0; 3]; 3]);
        check(&[[1.0; 3]; 5]);
        check(&[[0.0; 3], [1.0; 3], [2.0; 3]]);
        check(&[[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]]);
        check(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    }

    #[test]
    fn area_without_tolerance() {
        let tiny = f32::from_bits(1);
        assert!(has_area([0.0; 3], [tiny, 0.0, 0.0], [0.0, tiny, 0.0]));
        assert!(has_area([1.0, 0.0, 0.0], [1.0 + f32::EPSILON, 0.0, 0.0], [1.0, f32::EPSILON, 0.0]));
        assert!(!has_area([0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [1.0, 2.0, 4.0]));
    }

    #[test]
    fn a_star_that_winds_twice_is_not_convex() {
        // Pentagram: every corner turns left. A fan would count its middle twice with the wrong outline.
        let star = lift(&[[0, 3], [-2, -3], [3, 1], [-3, 1], [2, -3]]);
        let mut polygons = Polygons::new();
        polygons.triangulate(&star);
        assert!(!polygons.is_convex());
    }

    #[test]
    fn unit_of_extremes() {
        assert_eq!(unit([0.0; 3]), None);
        assert_eq!(unit([3e-300, 0.0, 4e-300]), Some([0.6, 0.0, 0.8]));
        assert_eq!(unit([3e300, 0.0, 4e300]), Some([0.6, 0.0, 0.8]));
    }
}
