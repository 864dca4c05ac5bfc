//! Where a ray hit, where the rays that it spawns start, and unit vectors in 32 bits.

use glam::Vec3;

use crate::vector::normalize;

/// A hit as shading sees it. Lengths are in the scene's internal units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The hit point, as exact as the primitive allows.
    pub position: Vec3,
    /// For each axis, at most how far `position` lies from the primitive *as the tracer's intersection test sees it*:
    /// the error of the position plus that of the test.
    pub error: Vec3,
    /// Unit normal of the primitive, on the primitive's own side.
    pub geometric_normal: Vec3,
    /// Unit normal to shade with; `geometric_normal` if the primitive has no normals of its own.
    pub shading_normal: Vec3,
    /// Added to the position where shadow rays start, see [`terminator_shift`]; zero for a flat primitive.
    pub shadow_offset: Vec3,
    /// Unit direction of the ray that hit.
    pub incoming: Vec3,
    /// Index of the primitive's material.
    pub material: u16,
    /// What the ray came through: 0 is outside of everything, n + 1 the inside of material n.
    pub medium: u16,
}

impl Surface {
    /// The same hit on a triangle with vertex normals: sets the shading normal and the shadow offset.
    ///
    /// `points`, `normals` (unit) and `barycentrics` are the triangle's, in the same order. Normals may point to
    /// either side, if all three point to the same; they are turned to the geometric normal's side. Normals that sum to
    /// nothing leave the surface flat.
    #[must_use]
    pub fn smooth(self, points: [Vec3; 3], normals: [Vec3; 3], barycentrics: [f32; 3]) -> Self {
        let sum = normals[0] * barycentrics[0] + normals[1] * barycentrics[1] + normals[2] * barycentrics[2];
        let square = sum.dot(sum);
        if !(square > 1e-12 && square.is_finite()) {
            return self;
        }
        let own_side = if sum.dot(self.geometric_normal) < 0.0 { -1.0 } else { 1.0 };
        // The shift bulges towards the viewer, who sees a hollow surface from inside.
        let viewer_side = if self.incoming.dot(self.geometric_normal) > 0.0 { -own_side } else { own_side };
        Self {
            shading_normal: normalize(sum) * own_side,
            shadow_offset: terminator_shift(self.position, points, normals.map(|n| n * viewer_side), barycentrics),
            ..self
        }
    }
}

/// Where a ray along `direction` leaves a surface: `position`, moved along `normal` to the side of `direction`, just
/// out of the box of half-size `error` around it.
///
/// The plane through the box's farthest corner, across `normal`, has the box on one side and the result on the other,
/// rounding included; so a ray that starts there does not meet the surface again, if `error` holds and the surface is
/// flat or curves away. `normal` must be of unit length within a few units in the last place.
/// Idea: Pharr, Jakob, Humphreys, *Physically Based Rendering* 4th ed., section 6.8.6.
#[inline(always)]
#[must_use]
pub fn offset_origin(position: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    // The margin covers the roundings of this sum, of the products below and of the normal's length.
    let reach =
        (normal.x.abs() * error.x + normal.y.abs() * error.y + normal.z.abs() * error.z) * (1.0 + 1.0 / 131_072.0);
    let away = if normal.dot(direction) < 0.0 { -reach } else { reach };
    Vec3::new(
        away_from(position.x, normal.x * away),
        away_from(position.y, normal.y * away),
        away_from(position.z, normal.z * away),
    )
}

/// `start + step`, rounded up if `step` goes up and down if it goes down.
#[inline(always)]
fn away_from(start: f32, step: f32) -> f32 {
    let sum = start + step;
    if step > 0.0 {
        sum.next_up()
    } else if step < 0.0 {
        sum.next_down()
    } else {
        sum
    }
}

/// From a point of a triangle to the smooth surface that its vertex normals suggest.
///
/// Added to the point where shadow rays start, it hides the polygons where the light grazes: `position` is projected
/// onto each vertex's tangent plane if it lies below it, and the three projections are interpolated. Zero (but for
/// rounding) where the normals are the triangle's own or bend inwards. `normals` are unit vectors on the lit side.
///
/// Source: Hanika, *Hacking the Shadow Terminator*, Ray Tracing Gems II, chapter 4, 2021; the barycentric sum of the
/// differences to the vertices is zero there and is left out here, because in `f32` it is not.
#[must_use]
pub fn terminator_shift(position: Vec3, points: [Vec3; 3], normals: [Vec3; 3], barycentrics: [f32; 3]) -> Vec3 {
    let mut shift = Vec3::ZERO;
    for corner in 0..3 {
        let below = (position - points[corner]).dot(normals[corner]);
        if below < 0.0 {
            shift -= normals[corner] * (below * barycentrics[corner]);
        }
    }
    shift
}

/// A unit vector in 32 bits; [`unpack_normal`] returns it to within 7e-5 rad, and the six axis vectors exactly.
///
/// The vector's octahedral projection (Cigolle et al., *A Survey of Efficient Representations for Independent Unit
/// Vectors*, JCGT 3(2), 2014), each coordinate as a signed 16-bit number: the first in the low half. What is no
/// direction (zero, not finite) becomes 0, which is +z.
#[must_use]
pub fn pack_normal(normal: Vec3) -> u32 {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return 0;
    }
    let (x, y) = (normal.x / sum, normal.y / sum);
    let (x, y) = if normal.z < 0.0 { fold(x, y) } else { (x, y) };
    // Rounded to nearest: the cast cuts towards zero.
    let bits = |v: f32| u32::from(((v * 32767.0 + 0.5f32.copysign(v)) as i16) as u16);
    bits(x) | bits(y) << 16
}

/// The unit vector that [`pack_normal`] packed. Any 32 bits give a unit vector.
#[must_use]
pub fn unpack_normal(packed: u32) -> Vec3 {
    let value = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (value(packed), value(packed >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { fold(x, y) } else { (x, y) };
    normalize(Vec3::new(x, y, z))
}

/// The lower half of the octahedron is folded over the diagonals of the upper half's square; it is its own inverse.
fn fold(x: f32, y: f32) -> (f32, f32) {
    ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::unit_pair;

    fn wide(v: Vec3) -> [f64; 3] {
        v.to_array().map(f64::from)
    }

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }

    fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
    }

    /// An even direction; `n` numbers the draws.
    fn direction(n: u32) -> Vec3 {
        let [u, v] = unit_pair(11, n);
        let z = 2.0 * u - 1.0;
        let r = (1.0 - z * z).max(0.0).sqrt();
        normalize(Vec3::new(r * (v * core::f32::consts::TAU).cos(), r * (v * core::f32::consts::TAU).sin(), z))
    }

    const ULP: f32 = 1.0 / 8_388_608.0;

    #[test]
    fn rays_leave_a_sphere_for_good() {
        for i in 0..200_000 {
            let scale = [1.0, 1e-3, 50.0, 1e4][i as usize % 4];
            let centre = direction(3 * i) * scale * 7.0;
            let radius = scale * (0.01 + unit_pair(5, i)[0]);
            let normal = direction(3 * i + 1);
            let position = centre + normal * radius;
            // Three roundings on the way here, and the normal's length.
            let error = (centre.abs() + position.abs() + Vec3::splat(radius)) * (2.0 * ULP);
            let leaving = direction(3 * i + 2);
            let origin = offset_origin(position, error, normal, leaving);
            let from_centre = minus(wide(origin), wide(centre));
            let square = dot(from_centre, from_centre);
            let exact = f64::from(radius) * f64::from(radius);
            if leaving.dot(normal) >= 0.0 {
                assert!(square > exact, "not outside: {centre} {radius} {normal}");
                // Outside, and not coming nearer. A tangent's sign is within the rounding of the normal.
                if leaving.dot(normal) > 1e-3 {
                    assert!(dot(from_centre, wide(leaving)) > 0.0, "{centre} {radius} {normal} {leaving}");
                }
            } else {
                assert!(square < exact, "not inside: {centre} {radius} {normal}");
            }
        }
    }

    #[test]
    fn rays_leave_a_triangle_for_good() {
        for i in 0..200_000 {
            let centre = direction(9 * i) * [0.0, 1.0, 300.0, 1e4][i as usize % 4];
            let corner = |k| centre + direction(9 * i + k) * (0.1 + unit_pair(6, i)[1]);
            let points = [corner(1), corner(2), corner(3)];
            let [p, q, r] = points.map(wide);
            let (e, f) = (minus(q, p), minus(r, p));
            let exact = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let length = dot(exact, exact).sqrt();
            if length < 1e-2 {
                continue;
            }
            let normal = normalize(Vec3::from(exact.map(|x| (x / length) as f32)));
            let [u, v] = unit_pair(8, i);
            let (b, c) = (u * 0.5, v * 0.5);
            let a = 1.0 - b - c;
            let position = points[0] * a + points[1] * b + points[2] * c;
            let error = (points[0].abs() * a + points[1].abs() * b + points[2].abs() * c) * (3.0 * ULP);
            let leaving = direction(9 * i + 4);
            let origin = offset_origin(position, error, normal, leaving);
            let height = dot(minus(wide(origin), p), exact) / length;
            let side = if leaving.dot(normal) < 0.0 { -1.0 } else { 1.0 };
            assert!(height * side > 0.0, "{points:?} {b} {c} {leaving}: {height}");
            // Outside the box as well, but not far.
            let reach = dot(wide(error), exact.map(f64::abs)) / length;
            let moved = dot(minus(wide(origin), wide(position)), exact) / length * side;
            let ulps = dot(wide(position.abs()), exact.map(f64::abs)) / length * f64::from(ULP);
            assert!(moved >= reach && moved <= reach * 1.01 + 2.0 * ulps + 1e-30, "{moved} {reach}");
        }
    }

    #[test]
    fn offset_moves_only_along_the_normal() {
        let position = Vec3::new(1.0, 2.0, 3.0);
        let up = offset_origin(position, Vec3::splat(1e-6), Vec3::Z, Vec3::new(1.0, 0.0, 0.1));
        assert_eq!((up.x, up.y), (1.0, 2.0));
        assert!(up.z > 3.0 + 1e-6 && up.z < 3.0 + 3e-6);
        let down = offset_origin(position, Vec3::splat(1e-6), Vec3::Z, Vec3::new(1.0, 0.0, -0.1));
        assert!(down.z < 3.0 - 1e-6 && down.z > 3.0 - 3e-6);
        assert_eq!(offset_origin(position, Vec3::ZERO, Vec3::Z, Vec3::Z), position);
    }

    #[test]
    fn flat_normals_shift_nothing() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
        assert_eq!(terminator_shift(Vec3::new(0.25, 0.5, 0.0), points, [Vec3::Z; 3], [0.25, 0.25, 0.5]), Vec3::ZERO);
        for i in 0..10_000 {
            let points = [direction(4 * i), direction(4 * i + 1), direction(4 * i + 2)];
            let cross = (points[1] - points[0]).cross(points[2] - points[0]);
            if cross.dot(cross) < 1e-2 {
                continue;
            }
            let [u, v] = unit_pair(8, i).map(|x| x * 0.5);
            let position = points[0] * (1.0 - u - v) + points[1] * u + points[2] * v;
            let shift = terminator_shift(position, points, [normalize(cross); 3], [1.0 - u - v, u, v]);
            assert!(shift.abs().max_element() < 4e-6, "{points:?}: {shift}");
        }
    }

    #[test]
    fn shift_leads_to_the_tangent_planes() {
        // A flat piece of a unit sphere: the shifted points lie between the triangle and a little above the sphere.
        let points = [direction(1), normalize(direction(1) + Vec3::X * 0.2), normalize(direction(1) + Vec3::Y * 0.2)];
        for i in 0..1000 {
            let [u, v] = unit_pair(8, i).map(|x| x * 0.5);
            let b = [1.0 - u - v, u, v];
            let position = points[0] * b[0] + points[1] * b[1] + points[2] * b[2];
            let shifted = position + terminator_shift(position, points, points, b);
            // Hanika's own form, in f64.
            let mut expected = wide(position);
            for (p, b) in points.iter().map(|&p| wide(p)).zip(b) {
                let mut offset = minus(wide(position), p);
                let below = dot(offset, p).min(0.0);
                (0..3).for_each(|a| offset[a] -= below * p[a]);
                (0..3).for_each(|a| expected[a] += f64::from(b) * offset[a]);
            }
            assert!(minus(wide(shifted), expected).iter().all(|x| x.abs() < 5e-7), "{shifted} {expected:?}");
            assert!(shifted.dot(shifted) > position.dot(position) && shifted.dot(shifted) < 1.02);
            // Seen from inside, the surface is hollow, and nothing moves.
            assert_eq!(terminator_shift(position, points, points.map(|n| -n), b), Vec3::ZERO);
        }
    }

    #[test]
    fn smooth_turns_normals_to_the_triangles_side() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let normals = [Vec3::new(-0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.8)];
        let b = [0.5, 0.25, 0.25];
        let flat = Surface {
            position: Vec3::new(0.25, 0.25, 0.0),
            error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            shading_normal: Vec3::Z,
            shadow_offset: Vec3::ZERO,
            incoming: Vec3::NEG_Z,
            material: 0,
            medium: 0,
        };
        let front = flat.smooth(points, normals, b);
        assert!(front.shading_normal.z > 0.9 && front.shadow_offset.z > 0.01);
        assert_eq!(front, flat.smooth(points, normals.map(|n| -n), b));
        let back = Surface { incoming: Vec3::Z, ..flat }.smooth(points, normals, b);
        assert_eq!((back.shading_normal, back.shadow_offset), (front.shading_normal, Vec3::ZERO));
        // Bent inwards, it is the back that bulges.
        let hollow = normals.map(|n| Vec3::new(-n.x, -n.y, n.z));
        assert_eq!(flat.smooth(points, hollow, b).shadow_offset, Vec3::ZERO);
        assert!(Surface { incoming: Vec3::Z, ..flat }.smooth(points, hollow, b).shadow_offset.z < -0.01);
        assert_eq!(flat.smooth(points, [Vec3::ZERO; 3], b), flat);
        assert_eq!(flat.smooth(points, [Vec3::NAN; 3], b), flat);
    }

    fn check_packing(normal: Vec3) -> f64 {
        let back = wide(unpack_normal(pack_normal(normal)));
        let n = wide(normal);
        let cross = [n[1] * back[2] - n[2] * back[1], n[2] * back[0] - n[0] * back[2], n[0] * back[1] - n[1] * back[0]];
        assert!(dot(n, back) > 0.0, "{normal} {back:?}");
        assert!((dot(back, back) - 1.0).abs() < 3e-7);
        (dot(cross, cross) / dot(n, n)).sqrt()
    }

    #[test]
    fn packed_normals_are_close() {
        let worst = (0..1_000_000).map(|i| check_packing(direction(i))).fold(0.0, f64::max);
        assert!(worst < 7e-5 && worst > 3e-5, "{worst}");
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert_eq!(unpack_normal(pack_normal(axis)), axis);
            assert_eq!(unpack_normal(pack_normal(-axis)), -axis);
        }
        for sign in [-1.0f32, 1.0] {
            for z in [-1e-7f32, -0.0, 0.0, 1e-7, -1.0, 1.0] {
                assert!(check_packing(Vec3::new(sign * 0.5, 0.5, z)) < 7e-5);
                assert!(check_packing(Vec3::new(1e-9, sign * 1e-9, z + 0.1)) < 7e-5);
            }
        }
    }

    #[test]
    fn any_bits_are_a_direction_and_anything_packs() {
        for i in 0..100_000u32 {
            let n = unpack_normal(i.wrapping_mul(0x9e37_79b9));
            assert!((n.dot(n) - 1.0).abs() < 1e-6);
        }
        for bits in [0x8000_8000, 0x8000_0000, 0x0000_8000, 0x7fff_7fff, 0x8001_8001, 0x7fff_8000] {
            let n = unpack_normal(bits);
            assert!((n.dot(n) - 1.0).abs() < 1e-6, "{bits:x} {n}");
        }
        for v in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(f32::MAX)] {
            assert_eq!(unpack_normal(pack_normal(v)), Vec3::Z);
        }
    }
}
