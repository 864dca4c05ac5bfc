//! The pyramid of appendix A: rays from one apex, between four planes.

use crate::Vec3;

/// All points from which `normals[i] . (p - apex)` is 0 or more for each of four planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pyramid {
    /// Where all rays start.
    pub apex: Vec3,
    /// Inward normals, not unit: left, right, bottom, top, so that 0 and 1, 2 and 3 face each other.
    pub normals: [Vec3; 4],
}

impl Pyramid {
    /// The pyramid through four corner directions in order around it (either way).
    ///
    /// `None` if they do not span a convex pyramid of less than half a space (a plane has no inside).
    #[must_use]
    pub fn through(apex: Vec3, corners: [Vec3; 4]) -> Option<Self> {
        let [a, b, c, d] = corners;
        let middle = a + b + c + d;
        let mut normals = [a.cross(d), c.cross(b), b.cross(a), d.cross(c)];
        if normals[0].dot(middle) < 0.0 {
            normals = normals.map(|n| -n);
        }
        let convex = normals.iter().all(|n| {
            n.is_finite() && n.dot(middle) > 0.0 && corners.iter().all(|&p| n.dot(p) >= -1e-5 * n.length() * p.length())
        });
        convex.then_some(Self { apex, normals })
    }
}
