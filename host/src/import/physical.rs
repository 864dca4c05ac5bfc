//! Metallic-roughness materials in Whitted's model.

use hybray_shading::{Highlight, Material};

/// Exponents of highlights end here: of a surface smoother than this, who sees one sees a point.
const EXPONENT_MAX: f32 = 10_000.0;

/// A material as glTF and the newer MTL say it; all but `ior` and `emission` are 0 to 1.
pub(super) struct Physical {
    /// Linear.
    pub base: [f32; 3],
    pub metal: f32,
    pub rough: f32,
    /// Share of what is no metal that light is refracted by.
    pub through: f32,
    pub ior: f32,
    /// The rest is not there: light goes straight on.
    pub seen: f32,
    pub emission: [f32; 3],
}

impl Physical {
    /// What is no metal as diffuse with a highlight of Fresnel's reflectance at normal incidence; metal as a mirror as far as it is
    /// smooth, and as diffuse as far as it is rough; transmission as refraction.
    pub(super) fn material(&self) -> Material {
        let Self { base, metal, rough, through, ior, seen, emission } = *self;
        let smooth = (1.0 - rough) * (1.0 - rough);
        let through = through * (1.0 - metal);
        let normal_incidence = ((ior - 1.0) / (ior + 1.0)) * ((ior - 1.0) / (ior + 1.0));
        let diffuse = base.map(|c| c * seen * ((1.0 - metal) - through + metal * (1.0 - smooth)));
        // Blinn's exponent for a width of roughness squared, and the height that keeps the highlight's light the same (Blinn's normal
        // distribution, normalised: Akenine-Moller, Haines and Hoffman, *Real-Time Rendering*).
        let width = rough * rough;
        let exponent = (2.0 / (width * width).max(1e-9) - 2.0).min(EXPONENT_MAX);
        let height = (exponent + 8.0) / 8.0;
        let specular = base.map(|c| seen * height * (normal_incidence * (1.0 - metal) + c * metal));
        let shines = exponent > 0.0 && specular.iter().any(|&c| c > 0.0);
        let glass = through > 0.0;
        Material {
            diffuse,
            ambient: diffuse,
            emission: emission.map(|c| c * seen),
            specular: if shines { specular } else { [0.0; 3] },
            mirror: base.map(|c| c * seen * metal * smooth),
            transmission: base.map(|c| if glass { c * through * seen } else { 1.0 - seen }),
            exponent: if shines { exponent } else { 0.0 },
            ior: if glass { ior.max(1.0) } else { 1.0 },
            highlight: if shines { Highlight::Blinn } else { Highlight::None } as u32,
            flags: if glass { Material::FRESNEL } else { 0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MATT: Physical =
        Physical { base: [0.5; 3], metal: 0.0, rough: 1.0, through: 0.0, ior: 1.5, seen: 1.0, emission: [0.0; 3] };

    #[test]
    fn the_ends_are_those_of_the_old_model() {
        let matt = MATT.material();
        assert_eq!((matt.diffuse, matt.mirror, matt.transmission), ([0.5; 3], [0.0; 3], [0.0; 3]));
        assert_eq!(matt.highlight(), Highlight::None);
        let mirror = Physical { metal: 1.0, rough: 0.0, ..MATT }.material();
        assert_eq!((mirror.diffuse, mirror.mirror), ([0.0; 3], [0.5; 3]));
        let glass = Physical { through: 1.0, rough: 0.0, ..MATT }.material();
        assert_eq!((glass.diffuse, glass.transmission, glass.ior), ([0.0; 3], [0.5; 3], 1.5));
        assert_eq!(glass.flags, Material::FRESNEL);
        let half = Physical { seen: 0.5, ..MATT }.material();
        assert_eq!((half.diffuse, half.transmission, half.ior), ([0.25; 3], [0.5; 3], 1.0));
    }

    #[test]
    fn no_light_is_made() {
        for i in 0..11u32.pow(3) {
            let at = |power: u32| (i / 11u32.pow(power) % 11) as f32 / 10.0;
            let physical = Physical { base: [1.0; 3], metal: at(0), rough: at(1), through: at(2), ..MATT };
            let material = physical.material();
            let sum = material.diffuse[0] + material.mirror[0] + material.transmission[0];
            assert!((sum - 1.0).abs() < 1e-5, "{sum} of metal {} rough {} through {}", at(0), at(1), at(2));
        }
    }

    /// The highlight sends on as much of a light from the front as its reflectance says, whatever the roughness: integrated over the
    /// half-sphere of views.
    #[test]
    fn highlights_keep_their_light() {
        for rough in [0.2, 0.3, 0.5] {
            let material = Physical { rough, ..MATT }.material();
            let steps = 20_000;
            let sum: f64 = (0..steps)
                .map(|i| {
                    // The view at an angle from the normal, along which the light comes: half that for the half vector.
                    let angle = (f64::from(i) + 0.5) / f64::from(steps) * std::f64::consts::FRAC_PI_2;
                    let shown =
                        f64::from(material.specular[0]) * libm::pow(libm::cos(angle / 2.0), material.exponent.into());
                    // Over pi, as a light's colour has it; times the cosine, over the ring of that angle.
                    shown / std::f64::consts::PI * libm::cos(angle) * libm::sin(angle)
                })
                .sum();
            let total = sum * std::f64::consts::FRAC_PI_2 / f64::from(steps) * 2.0 * std::f64::consts::PI;
            assert!((total - 0.04).abs() < 0.006, "{rough} {total}");
        }
    }
}
