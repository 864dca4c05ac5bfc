//! What glam leaves to the platform's choice, written out.

use glam::Vec3;

pub(crate) use hybray_geometry::normalize;

/// Two unit vectors that make a right-handed orthonormal basis `(a, b, n)` with the unit vector `n`.
///
/// Source: Duff et al., *Building an Orthonormal Basis, Revisited*, JCGT 6(1), 2017.
#[inline]
pub(crate) fn basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_right_handed_and_orthonormal() {
        for i in 0..2000 {
            let [u, v] = crate::id::unit_pair(7, i);
            let n = normalize(Vec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, (i % 21) as f32 / 10.0 - 1.0));
            let (a, b) = basis(n);
            assert!((a.cross(b) - n).abs().max_element() < 1e-6, "{n} {a} {b}");
            assert!(a.dot(b).abs() < 1e-6 && (a.dot(a) - 1.0).abs() < 1e-6 && (b.dot(b) - 1.0).abs() < 1e-6, "{n}");
        }
        let (a, b) = basis(Vec3::NEG_Z);
        assert_eq!(a.cross(b), Vec3::NEG_Z);
    }
}
