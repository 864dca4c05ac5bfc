//! Triangles between two rows of vertices that need not have the same number of segments.
//!
//! A row of `m` segments and one of `n` give `m + n` triangles, so a surface can have any number of triangles that one
//! likes, without cracks and without vertices on edges.

/// A row of vertices with consecutive indices.
#[derive(Clone, Copy)]
pub struct Row {
    /// Index of its first vertex.
    pub first: u32,
    /// Segments, at least 1 (3 if closed). An open row has one vertex more than segments, a closed one as many.
    pub segments: u32,
}

impl Row {
    fn vertex(self, i: u32, closed: bool) -> u32 {
        if closed && i == self.segments { self.first } else { self.first + i }
    }
}

/// Adds the triangles between `a` and `b`, counterclockwise when `b` lies to the left of somebody who walks along `a`.
///
/// Where both rows could go on, `parity` (even or odd) says which does: neighbouring strips of a grid with alternating
/// parity get diagonals in both directions.
pub fn strip(a: Row, b: Row, closed: bool, parity: u32, out: &mut Vec<[u32; 3]>) {
    let (m, n) = (a.segments, b.segments);
    let (mut i, mut j) = (0, 0);
    while i < m || j < n {
        // The row whose next vertex is less far along goes on: (i + 1) / m against (j + 1) / n.
        let next_a = u64::from(i + 1) * u64::from(n);
        let next_b = u64::from(j + 1) * u64::from(m);
        let tie_to_a = (i ^ parity) & 1 == 0;
        if j == n || (i < m && (next_a < next_b || (next_a == next_b && tie_to_a))) {
            out.push([a.vertex(i, closed), a.vertex(i + 1, closed), b.vertex(j, closed)]);
            i += 1;
        } else {
            out.push([a.vertex(i, closed), b.vertex(j + 1, closed), b.vertex(j, closed)]);
            j += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(m: u32, n: u32, closed: bool) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        let b = Row { first: 100, segments: n };
        strip(Row { first: 0, segments: m }, b, closed, 0, &mut out);
        out
    }

    #[test]
    fn grid_cell() {
        assert_eq!(triangles(1, 1, false), [[0, 1, 100], [1, 101, 100]]);
        assert_eq!(triangles(2, 1, false), [[0, 1, 100], [1, 101, 100], [1, 2, 101]]);
        assert_eq!(triangles(3, 3, true)[5], [0, 100, 102]);
    }

    #[test]
    fn as_many_as_segments() {
        for m in 1..12 {
            for n in 1..12 {
                assert_eq!(triangles(m, n, false).len() as u32, m + n);
            }
        }
    }

    /// Areas of the triangles between y = 0 and y = 1 over 0..=1 are all positive and add up to 1.
    #[test]
    fn covers_the_strip_once() {
        for (m, n) in [(1, 1), (1, 7), (5, 6), (6, 5), (13, 4), (8, 8)] {
            let place = |v: u32| {
                if v < 100 { [f64::from(v) / f64::from(m), 0.0] } else { [f64::from(v - 100) / f64::from(n), 1.0] }
            };
            let area = |t: &[u32; 3]| {
                let [p, q, r] = t.map(place);
                ((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])) / 2.0
            };
            let areas: Vec<f64> = triangles(m, n, false).iter().map(area).collect();
            assert!(areas.iter().all(|&a| a > 0.0), "{m} {n}");
            assert!((areas.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{m} {n}");
        }
    }
}
