//! The highlight of a light.

use glam::Vec3;

use crate::material::{Highlight, Material};
use crate::optics::mirror;
use crate::vector::normalize;

/// How strongly a light shows in a surface's highlight, 0 to 1.
///
/// Phong: `max(0, r . l)^n`, r the mirrored view. Blinn: `max(0, n . h)^n`, h halfway between light and view. All are
/// unit vectors; `incoming` goes from the eye to the surface, `light` from the surface to the light.
/// Sources: Phong, *Illumination for Computer Generated Pictures*, CACM 18(6), 1975; Blinn, *Models of Light
/// Reflection for Computer Synthesized Pictures*, SIGGRAPH 1977.
pub(crate) fn strength(material: &Material, incoming: Vec3, normal: Vec3, light: Vec3) -> f32 {
    let cosine = match material.highlight() {
        Highlight::None => return 0.0,
        Highlight::Phong => mirror(incoming, normal).dot(light),
        Highlight::Blinn => {
            let between = light - incoming;
            if between == Vec3::ZERO {
                return 0.0;
            }
            normal.dot(normalize(between))
        }
    };
    power(cosine.clamp(0.0, 1.0), material.exponent)
}

/// Largest exponent that is multiplied out; beyond, the squarings' errors would add up to more than `powf`'s.
const MULTIPLIED_MAX: f32 = 65_536.0;

/// `base^exponent` for a base of 0 to 1; an exponent that is not positive counts as 0, and `0^0` is 1.
///
/// Whole exponents are multiplied out (one squaring for each binary digit, lowest first), which is faster than `powf`
/// and the same on every processor.
fn power(base: f32, exponent: f32) -> f32 {
    if !(exponent > 0.0) {
        return 1.0;
    }
    if base == 0.0 {
        return 0.0;
    }
    let whole = exponent as u32;
    if exponent > MULTIPLIED_MAX || whole as f32 != exponent {
        return libm::powf(base, exponent);
    }
    let (mut result, mut square, mut digits) = (1.0, base, whole);
    loop {
        if digits & 1 == 1 {
            result *= square;
        }
        digits >>= 1;
        if digits == 0 {
            return result;
        }
        square *= square;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_against_f64() {
        for exponent in [0.0, 0.5, 1.0, 2.0, 3.0, 7.0, 8.0, 10.0, 12.5, 60.0, 100.0, 250.0, 1000.0, 65_536.0, 1e6] {
            for i in 0..=1000 {
                let base = i as f32 / 1000.0;
                let expected = libm::pow(f64::from(base), f64::from(exponent));
                let found = f64::from(power(base, exponent));
                let slack = 1.5e-7 * (2.0 + f64::from(exponent).min(65_536.0)) * expected + 1e-37;
                assert!((found - expected).abs() <= slack, "{base}^{exponent}: {found} {expected}");
            }
        }
        assert_eq!(power(0.5, -3.0), 1.0);
        assert_eq!(power(0.5, f32::NAN), 1.0);
        assert_eq!(power(0.5, f32::INFINITY), 0.0);
        assert_eq!(power(0.0, 0.0), 1.0);
        assert_eq!([0.3, 2.0, f32::INFINITY].map(|exponent| power(0.0, exponent).to_bits()), [0; 3]);
    }

    /// Angles in degrees from the normal, all in one plane: the view from `view`, the light at `light`.
    fn check(highlight: Highlight, exponent: f32, view: f64, light: f64) {
        let at = |degrees: f64| {
            let angle = degrees.to_radians();
            Vec3::new(libm::sin(angle) as f32, 0.0, libm::cos(angle) as f32)
        };
        let material = Material { highlight: highlight as u32, exponent, ..Material::MATT };
        let found = strength(&material, -at(view), Vec3::Z, at(light));
        let angle = match highlight {
            Highlight::None => 90.0,
            Highlight::Phong => light + view,
            Highlight::Blinn => (light + view) / 2.0,
        };
        let expected = libm::pow(libm::cos(f64::to_radians(angle)).max(0.0), f64::from(exponent));
        let expected = if highlight == Highlight::None { 0.0 } else { expected };
        assert!((f64::from(found) - expected).abs() < 1e-6 * f64::from(1.0 + exponent), "{found} {expected}");
    }

    #[test]
    fn highlights_against_f64() {
        for exponent in [1.0, 2.0, 4.5, 20.0, 99.0] {
            for (view, light) in [(0.0, 0.0), (30.0, -30.0), (30.0, -20.0), (60.0, 10.0), (80.0, 70.0), (-15.0, 40.0)] {
                check(Highlight::Phong, exponent, view, light);
                check(Highlight::Blinn, exponent, view, light);
                check(Highlight::None, exponent, view, light);
            }
        }
    }
}
