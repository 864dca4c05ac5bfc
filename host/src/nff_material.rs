//! NFF's `f` line as a [`Material`].
//!
//! Source: the description of NFF in Eric Haines' Standard Procedural Databases, v3.x, and the renderer notes there:
//! no ambient light, highlights with a white colour, mirror and highlight share `Ks`.

use hybray_shading::{Highlight, Material};

/// What `f r g b Kd Ks Shine T ior` means.
///
/// `rgb` is the surface's colour, `kd`, `ks` and `t` are the shares of diffuse, mirrored and transmitted light, `shine`
/// is Phong's exponent and `ior` the index of refraction. Only the diffuse part takes the surface's colour: highlight,
/// mirror and transmission are white. Values that make no sense (negative, not finite, an index of 0) become the
/// nearest that does, so that whatever a file holds, the material is a valid one.
#[must_use]
pub fn nff_material(rgb: [f32; 3], kd: f32, ks: f32, shine: f32, t: f32, ior: f32) -> Material {
    let kd = share(kd);
    let ks = share(ks);
    let shine = share(shine);
    let highlight = if ks > 0.0 && shine > 0.0 { Highlight::Phong } else { Highlight::None };
    Material {
        diffuse: rgb.map(|c| share(kd * share(c))),
        ambient: [0.0; 3],
        emission: [0.0; 3],
        specular: [ks; 3],
        mirror: [ks; 3],
        transmission: [share(t); 3],
        exponent: shine,
        ior: if ior.is_finite() && ior > 0.0 { ior } else { 1.0 },
        highlight: highlight as u32,
        flags: 0,
    }
}

/// 0 or more, and finite.
fn share(value: f32) -> f32 {
    if value.is_finite() && value > 0.0 { value } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_sphere() {
        let m = nff_material([1.0, 0.9, 0.7], 0.5, 0.5, 3.0827, 0.0, 1.0);
        assert_eq!(m.diffuse, [0.5, 0.45, 0.35]);
        assert_eq!((m.specular, m.mirror, m.transmission), ([0.5; 3], [0.5; 3], [0.0; 3]));
        assert_eq!((m.exponent, m.ior, m.highlight, m.flags), (3.0827, 1.0, Highlight::Phong as u32, 0));
        assert_eq!((m.ambient, m.emission), ([0.0; 3], [0.0; 3]));
    }

    #[test]
    fn a_highlight_wants_both_strength_and_exponent() {
        for (ks, shine, expected) in
            [(0.5, 3.0, Highlight::Phong), (0.0, 3.0, Highlight::None), (0.5, 0.0, Highlight::None)]
        {
            let m = nff_material([1.0; 3], 1.0, ks, shine, 0.0, 1.0);
            assert_eq!(m.highlight, expected as u32, "Ks {ks}, Shine {shine}");
            assert_eq!(m.mirrors(), ks > 0.0);
        }
    }

    #[test]
    fn glass() {
        let m = nff_material([1.0; 3], 0.2, 0.3, 20.0, 0.5, 1.5);
        assert!(m.transmits() && m.mirrors());
        assert_eq!((m.transmission, m.ior), ([0.5; 3], 1.5));
    }

    #[test]
    fn nonsense_is_tamed() {
        let m = nff_material([f32::NAN, -1.0, f32::INFINITY], 1.0, -0.5, f32::NAN, f32::NEG_INFINITY, 0.0);
        assert_eq!(m.diffuse, [0.0; 3]);
        assert_eq!((m.specular, m.mirror, m.transmission), ([0.0; 3], [0.0; 3], [0.0; 3]));
        assert_eq!((m.exponent, m.ior), (0.0, 1.0));
        let m = nff_material([f32::MAX; 3], f32::MAX, 1.0, 1.0, 0.0, 1.0);
        assert!(m.diffuse.iter().all(|c| c.is_finite()));
    }
}
