//! The pyramid of appendix A: rays from one apex, between four planes.

use crate::Vec3;

/// All points from which `normals[i] . (p - apex)` is 0 or more for each of four planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pyramid {
    /// Where all rays start.
    pub apex: Vec3,
    /// Inward normals of a length near 1: left, right, bottom, top, so that 0 and 1, 2 and 3 face each other.
    pub normals: [Vec3; 4],
}

impl Pyramid {
    /// The pyramid through four corner directions in order around it (either way).
    ///
    /// `None` if they do not span a convex pyramid of less than half a space (a plane has no inside).
    #[must_use]
    pub fn through(apex: Vec3, corners: [Vec3; 4]) -> Option<Self> {
        // In f64: the cross product of two directions that hardly differ keeps few digits in f32.
        let wide = corners.map(Vec3::as_dvec3);
        let [a, b, c, d] = wide;
        let middle = a + b + c + d;
        let mut normals = [a.cross(d), c.cross(b), b.cross(a), d.cross(c)];
        if normals[0].dot(middle) < 0.0 {
            normals = normals.map(|n| -n);
        }
        let convex = normals.iter().all(|n| {
            n.is_finite() && n.dot(middle) > 0.0 && wide.iter().all(|&p| n.dot(p) >= -1e-5 * n.length() * p.length())
        });
        // Products of short directions would underflow in f32; a power of two brings them near 1 and rounds nothing.
        let normals = normals.map(|n| {
            let largest = n.abs().max_element();
            let exponent = if largest > 0.0 { libm::ilogb(largest) } else { 0 };
            (n * libm::ldexp(1.0, -exponent)).as_vec3()
        });
        convex.then_some(Self { apex, normals })
    }
}
