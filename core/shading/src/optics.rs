//! Mirrors and glass: reflection, Snell's law and Fresnel's equations.
//!
//! Unit vectors throughout. `eta` is the index of refraction on the side where the light comes from over that on the
//! other side; `cos_in` the cosine between the normal and the reversed direction of the incoming ray, more than 0.

use glam::Vec3;

/// How light leaves a smooth boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Cosine between the reversed normal and the refracted ray; 0 at total reflection.
    pub cos_out: f32,
    /// Share of the light that is mirrored, for light of no polarisation: 0 to 1, and 1 at total reflection.
    pub reflectance: f32,
    /// No light passes.
    pub total: bool,
}

/// Snell's law and Fresnel's equations for a dielectric.
///
/// The squared cosine of the refracted ray is `1 - eta^2 (1 - cos_in^2)`; as `(eta cos_in)^2 + (1 - eta)(1 + eta)` it
/// loses no digits except at the critical angle itself. Source: Born and Wolf, *Principles of Optics*, section 1.5.2.
#[must_use]
pub fn boundary(eta: f32, cos_in: f32) -> Boundary {
    let a = eta * cos_in;
    let square = a * a + (1.0 - eta) * (1.0 + eta);
    if !(square > 0.0 && cos_in > 0.0) {
        return Boundary { cos_out: 0.0, reflectance: 1.0, total: true };
    }
    let cos_out = libm::sqrtf(square);
    let perpendicular = (a - cos_out) / (a + cos_out);
    let b = eta * cos_out;
    let parallel = (cos_in - b) / (cos_in + b);
    let reflectance = 0.5 * (perpendicular * perpendicular + parallel * parallel);
    Boundary { cos_out, reflectance, total: false }
}

/// The direction `incoming` mirrored at a surface of unit normal `normal` (either side); of unit length but for
/// rounding.
#[must_use]
pub fn mirror(incoming: Vec3, normal: Vec3) -> Vec3 {
    incoming - normal * (2.0 * normal.dot(incoming))
}

/// The direction of the refracted ray; `normal` points against `incoming`, and `cos_out` is [`Boundary::cos_out`].
///
/// The usual `eta d + (eta cos_in - cos_out) n`, with the difference rationalised to `(eta^2 - 1) / (eta cos_in +
/// cos_out)`: where the indices are nearly equal, it would cancel.
#[must_use]
pub fn refract(incoming: Vec3, normal: Vec3, eta: f32, cos_in: f32, cos_out: f32) -> Vec3 {
    incoming * eta + normal * ((eta - 1.0) * (eta + 1.0) / (eta * cos_in + cos_out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::normalize;

    /// Angles in and out by the law itself, in f64.
    fn check_snell(eta: f32, degrees: f64) {
        let angle = degrees.to_radians();
        let incoming = Vec3::new(libm::sin(angle) as f32, 0.0, -libm::cos(angle) as f32);
        let cos_in = -incoming.z;
        let exact_sine = f64::from(eta) * f64::from(incoming.x);
        let found = boundary(eta, cos_in);
        if exact_sine > 1.0 + 1e-6 {
            assert!(found.total && found.reflectance == 1.0, "{eta} {degrees}");
            return;
        }
        let out = refract(incoming, Vec3::Z, eta, cos_in, found.cos_out);
        assert!((f64::from(out.x) - exact_sine).abs() < 2e-7, "{eta} {degrees}: {out} {exact_sine}");
        let exact_cosine = (1.0 - exact_sine * exact_sine).max(0.0).sqrt();
        // Near the critical angle the cosine is the root of a small difference of f32 numbers.
        let slack = 3e-7 * (1.5 + f64::from(eta) / exact_cosine.max(1e-4));
        assert!((f64::from(-out.z) - exact_cosine).abs() < slack, "{eta} {degrees}: {out} {exact_cosine}");
        // Fresnel by the sine and tangent formulas, which share nothing with those above.
        let other = exact_sine.asin();
        let (sum, difference) = (angle + other, angle - other);
        if degrees > 1.0 && difference.abs() > 1e-3 && exact_cosine > 0.01 {
            let s = libm::sin(difference) / libm::sin(sum);
            let p = libm::tan(difference) / libm::tan(sum);
            let expected = 0.5 * (s * s + p * p);
            assert!(
                (f64::from(found.reflectance) - expected).abs() < 4.0 * slack,
                "{eta} {degrees}: {found:?} {expected}"
            );
        }
    }

    #[test]
    fn snell_and_fresnel_against_f64() {
        for eta in [1.0 / 1.5, 1.5, 1.33, 1.0 / 1.33, 2.42, 1.0 / 2.42, 1.000_1, 0.999_9, 1.0] {
            for tenth in 0..900 {
                check_snell(eta, f64::from(tenth) / 10.0);
            }
        }
    }

    #[test]
    fn fresnel_at_known_angles() {
        let at = |eta: f64, degrees: f64| boundary(eta as f32, libm::cos(degrees.to_radians()) as f32).reflectance;
        assert!((at(1.0 / 1.5, 0.0) - 0.04).abs() < 1e-7);
        assert!((at(1.5, 0.0) - 0.04).abs() < 1e-7);
        assert!((at(1.0 / 1.33, 0.0) - 0.020_059_31).abs() < 1e-7);
        assert!(at(1.0 / 1.5, 89.999) > 0.999);
        assert_eq!(boundary(1.0 / 1.5, 0.0).reflectance, 1.0);
        // At Brewster's angle only the perpendicular part is left: ((1 - n^2) / (1 + n^2))^2 / 2.
        let brewster = libm::atan(1.5).to_degrees();
        assert!((f64::from(at(1.0 / 1.5, brewster)) - 0.5 * (1.25f64 / 3.25).powi(2)).abs() < 1e-6);
        assert_eq!(at(1.0, 60.0), 0.0);
    }

    #[test]
    fn reflectance_is_the_same_both_ways() {
        for tenth in 1..890 {
            let cos_in = libm::cos((f64::from(tenth) / 10.0).to_radians()) as f32;
            let there = boundary(1.0 / 1.5, cos_in);
            let back = boundary(1.5, there.cos_out);
            assert!((there.reflectance - back.reflectance).abs() < 1e-6 / cos_in, "{tenth}: {there:?} {back:?}");
            assert!((back.cos_out - cos_in).abs() < 1e-6 / cos_in);
        }
    }

    #[test]
    fn total_reflection_begins_at_the_critical_angle() {
        for ior in [1.1f64, 1.33, 1.5, 2.42] {
            let critical = libm::asin(1.0 / ior).to_degrees();
            let total = |degrees: f64| boundary(ior as f32, libm::cos(degrees.to_radians()) as f32).total;
            assert!(!total(critical - 1e-3) && total(critical + 1e-3), "{ior}");
        }
    }

    #[test]
    fn equal_indices_bend_nothing() {
        let incoming = normalize(Vec3::new(0.3, -0.2, -0.7));
        let found = boundary(1.0, -incoming.z);
        assert_eq!(refract(incoming, Vec3::Z, 1.0, -incoming.z, found.cos_out), incoming);
    }

    #[test]
    fn mirror_keeps_the_plane_and_turns_the_rest() {
        assert_eq!(mirror(Vec3::new(0.6, 0.0, -0.8), Vec3::Z), Vec3::new(0.6, 0.0, 0.8));
        assert_eq!(mirror(Vec3::new(0.6, 0.0, -0.8), Vec3::NEG_Z), Vec3::new(0.6, 0.0, 0.8));
    }

    #[test]
    fn nothing_is_nan() {
        for eta in [1e-3, 0.5, 1.0, 2.0, 1e3] {
            for cos_in in [0.0, f32::MIN_POSITIVE, 1e-8, 1e-3, 1.0, 1.000_000_1] {
                let found = boundary(eta, cos_in);
                assert!(
                    (0.0..=1.0).contains(&found.reflectance) && found.cos_out.is_finite(),
                    "{eta} {cos_in} {found:?}"
                );
            }
        }
    }
}
