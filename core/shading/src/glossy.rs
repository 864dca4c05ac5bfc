//! Metallic-roughness surfaces: Lambert's law below a rough boundary of mirroring facets, and sampled reflection.
//!
//! The facets' normals are distributed by GGX (Walter et al., *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007),
//! with Smith's height-correlated shadowing (Heitz, *Understanding the Masking-Shadowing Function*, JCGT 3(2), 2014) and Schlick's
//! form of Fresnel's equations, as the glTF 2.0 specification, appendix B, has them but for the diffuse part. Facets are drawn as a viewer sees them (Dupuy and
//! Benyoub, *Sampling Visible GGX Normals with Spherical Caps*, 2023).

use crate::material::Material;
use crate::vector::basis;
use glam::Vec3;

/// Widths of the distribution below this mirror without being sampled, and show no highlights of lights: those would be points.
const SMOOTH: f32 = 1.0 / 1024.0;

/// A physical material at a hit.
pub(crate) struct Glossy {
    /// Linear; what is no metal shows diffuse, but for what goes through.
    pub diffuse: [f32; 3],
    /// Reflectance of facets that are seen from the front.
    front: [f32; 3],
    /// Width of the distribution of facets: roughness squared.
    width: f32,
    /// Weight of what goes through facets that do not mirror.
    pub through: [f32; 3],
}

impl Glossy {
    pub fn new(material: &Material) -> Self {
        let [metal, ..] = material.mirror;
        let (base, through) = (material.diffuse, material.transmission[0] * (1.0 - metal));
        let ior = if material.ior > 0.0 && material.ior.is_finite() { material.ior } else { 1.0 };
        let root = (ior - 1.0) / (ior + 1.0);
        let dielectric = root * root * (1.0 - metal);
        Self {
            diffuse: base.map(|c| c * (1.0 - metal - through)),
            front: base.map(|c| dielectric + c * metal),
            width: material.exponent * material.exponent,
            // What goes through a body meets its boundary twice.
            through: base.map(|c| libm::sqrtf(c) * through),
        }
    }

    /// Schlick's form.
    pub fn fresnel(&self, cosine: f32) -> [f32; 3] {
        let fifth = fifth_of_miss(cosine);
        self.front.map(|f| f + (1.0 - f) * fifth)
    }

    /// What the boundary leaves for what lies below, seen at this cosine: rough ones mirror less at the edge (Lagarde's form of
    /// Schlick's). With the half vector's cosine, as glTF's appendix has it, a grazing view would get a quarter more than there is.
    fn below(&self, view: f32) -> [f32; 3] {
        let fifth = fifth_of_miss(view);
        let edge = 1.0 - libm::sqrtf(self.width);
        self.front.map(|f| 1.0 - (f + (if edge > f { edge - f } else { 0.0 }) * fifth))
    }

    /// What of a light from `light` (unit) is seen against `incoming`: for irradiance over pi of 1 at normal incidence. `cosine` is
    /// that of the light and the normal, more than 0. `glints` says how much of it facets mirror.
    pub fn shown(&self, incoming: Vec3, normal: Vec3, light: Vec3, cosine: f32, glints: f32) -> [f32; 3] {
        let glints = if self.width >= SMOOTH { glints } else { 0.0 };
        let between = light - incoming;
        let square = between.dot(between);
        let view = -incoming.dot(normal);
        if !(square > 0.0 && view > 0.0) {
            return self.diffuse.map(|c| c * cosine);
        }
        let half = between / libm::sqrtf(square);
        let fresnel = self.fresnel(half.dot(light));
        let (width, facets) = (self.width, self.facets(half, normal));
        // Pi times distribution times shadowing over 4 n.l n.v; the cosine of the light is multiplied in.
        let shadowing = 0.5 / (cosine * reach(width, view) + view * reach(width, cosine));
        let glint = if glints > 0.0 { facets * shadowing * cosine * glints } else { 0.0 };
        let below = self.below(view);
        core::array::from_fn(|c| self.diffuse[c] * below[c] * cosine + fresnel[c] * glint)
    }

    /// Pi times the distribution of facets whose normal is `half`.
    fn facets(&self, half: Vec3, normal: Vec3) -> f32 {
        let width = self.width;
        let height = half.dot(normal).clamp(0.0, 1.0);
        // 1 - height^2 by the part across, which keeps its digits near the mirror direction.
        let across = half - normal * height;
        let spread = width * width * height * height + across.dot(across);
        if spread > 0.0 { width * width / (spread * spread) } else { 0.0 }
    }

    /// How dense mirrored rays are towards `light`, if one is sent: rays for each steradian. `None` if facets are not sampled.
    pub fn density(&self, incoming: Vec3, normal: Vec3, light: Vec3) -> Option<f32> {
        if self.width < SMOOTH {
            return None;
        }
        let between = light - incoming;
        let (square, view) = (between.dot(between), -incoming.dot(normal));
        if !(square > 0.0 && view > 0.0 && between.dot(normal) > 0.0) {
            return Some(0.0);
        }
        let facets = self.facets(between / libm::sqrtf(square), normal);
        // The share that is seen over its projection, and what mirroring spreads.
        Some(facets * core::f32::consts::FRAC_1_PI * 0.5 / (view + reach(self.width, view)))
    }

    /// A facet that is seen against `incoming`: its normal, on the side of `normal`.
    pub fn facet(&self, incoming: Vec3, normal: Vec3, sample: [f32; 2]) -> Vec3 {
        if self.width < SMOOTH {
            return normal;
        }
        let (a, b) = basis(normal);
        let view = Vec3::new(-incoming.dot(a), -incoming.dot(b), -incoming.dot(normal));
        let stretched = crate::vector::normalize(Vec3::new(view.x * self.width, view.y * self.width, view.z));
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * sample[0]);
        let z = (1.0 - sample[1]) * (1.0 + stretched.z) - stretched.z;
        let square = 1.0 - z * z;
        let r = libm::sqrtf(if square > 0.0 { square } else { 0.0 });
        let cap = Vec3::new(r * cos, r * sin, z) + stretched;
        let facet = Vec3::new(cap.x * self.width, cap.y * self.width, cap.z);
        if !(facet.dot(facet) > 1e-30) {
            return normal;
        }
        let facet = crate::vector::normalize(facet);
        a * facet.x + b * facet.y + normal * facet.z
    }

    /// Share of what such a facet sends towards a direction of cosine `out` that other facets let pass; `view` is the cosine of the
    /// viewer, both with the normal.
    pub fn passes(&self, view: f32, out: f32) -> f32 {
        if self.width < SMOOTH {
            return 1.0;
        }
        let (from, to) = (reach(self.width, view), reach(self.width, out));
        out * (view + from) / (out * from + view * to)
    }

    /// Half the angle, radians, that a mirrored ray stands for beside its own: a small part of what facets spread, so that pictures
    /// in it are blurred by next to nothing more than they are (decision 24 has figures).
    pub fn opening(&self) -> f32 {
        0.0625 * self.width
    }
}

/// `(1 - cosine)^5`
fn fifth_of_miss(cosine: f32) -> f32 {
    let miss = (1.0 - cosine).clamp(0.0, 1.0);
    let square = miss * miss;
    square * square * miss
}

fn reach(width: f32, cosine: f32) -> f32 {
    libm::sqrtf(width * width + (1.0 - width * width) * cosine * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::unit_pair;

    fn glossy(rough: f32, metal: f32, base: f32) -> Glossy {
        let flags = Material::PHYSICAL;
        Glossy::new(&Material {
            diffuse: [base; 3],
            exponent: rough,
            mirror: [metal; 3],
            ior: 1.5,
            flags,
            ..Material::MATT
        })
    }

    fn towards(cosine: f32, turn: f32) -> Vec3 {
        let sine = libm::sqrtf(1.0 - cosine * cosine);
        let (s, c) = libm::sincosf(turn);
        Vec3::new(sine * c, sine * s, cosine)
    }

    /// What sampled reflection sends on is what all lights together would show: two ways to the same integral.
    #[test]
    fn sampled_reflection_is_the_highlights_integral() {
        for (rough, cosine) in [(0.3, 0.9), (0.5, 0.5), (0.8, 0.7), (1.0, 0.3), (0.4, 0.15)] {
            let metal = glossy(rough, 1.0, 0.8);
            let incoming = -towards(cosine, 0.3);
            let rays = 400_000;
            let mut sampled = 0.0;
            for i in 0..rays {
                let facet = metal.facet(incoming, Vec3::Z, unit_pair(5, i));
                assert!((facet.dot(facet) - 1.0).abs() < 1e-5 && facet.dot(-incoming) >= -1e-6, "{facet}");
                let out = crate::optics::mirror(incoming, facet);
                if out.z > 0.0 {
                    let f = metal.fresnel(-incoming.dot(facet))[0];
                    sampled += f64::from(f * metal.passes(cosine, out.z)) / f64::from(rays);
                }
            }
            // Directions even over the half-sphere: irradiance over pi of a sky of radiance 1 is its solid angle over pi.
            let mut lit = 0.0;
            for i in 0..rays {
                let [u, v] = unit_pair(6, i);
                let light = towards(u, v * core::f32::consts::TAU);
                lit += f64::from(metal.shown(incoming, Vec3::Z, light, light.z, 1.0)[0]) * 2.0 / f64::from(rays);
            }
            assert!((sampled / lit - 1.0).abs() < 0.02, "{rough} {cosine}: {sampled} {lit}");
            assert!(sampled < 1.0);
        }
    }

    /// Of many facets, as many mirror into each part of the sphere as the density says.
    #[test]
    fn facets_are_as_dense_as_they_say() {
        for (rough, cosine) in [(0.3, 0.9), (0.6, 0.4), (1.0, 0.7)] {
            let metal = glossy(rough, 1.0, 0.8);
            let incoming = -towards(cosine, 0.3);
            let rays = 200_000;
            // Parts of equal solid angle: four heights (those below the surface too) by eight.
            let part = |v: Vec3| {
                let turn = libm::atan2f(v.y, v.x) / core::f32::consts::TAU + 0.5;
                ((v.z + 1.0) * 4.0).clamp(0.0, 7.0) as usize * 8 + (turn * 8.0).clamp(0.0, 7.0) as usize
            };
            let (mut found, mut wanted) = ([0.0f64; 64], [0.0f64; 64]);
            for i in 0..rays {
                let facet = metal.facet(incoming, Vec3::Z, unit_pair(5, i));
                found[part(crate::optics::mirror(incoming, facet))] += 1.0 / f64::from(rays);
                let [u, v] = unit_pair(6, i);
                let light = crate::vector::normalize({
                    let z = 2.0 * u - 1.0;
                    let (s, c) = libm::sincosf(v * core::f32::consts::TAU);
                    let across = libm::sqrtf(1.0 - z * z);
                    Vec3::new(c * across, s * across, z)
                });
                let density = metal.density(incoming, Vec3::Z, light).unwrap();
                wanted[part(light)] += f64::from(density) * 4.0 * core::f64::consts::PI / f64::from(rays);
            }
            for (part, (found, wanted)) in found.into_iter().zip(wanted).enumerate() {
                assert!((found - wanted).abs() < 0.004 + 0.02 * wanted, "{rough} {cosine} {part}: {found} {wanted}");
            }
        }
        assert_eq!(glossy(0.0, 1.0, 0.8).density(-Vec3::Z, Vec3::Z, Vec3::Z), None);
    }

    #[test]
    fn no_light_is_made() {
        for i in 0..200 {
            let [a, b] = unit_pair(8, i);
            let [c, _] = unit_pair(9, i);
            let any = glossy(0.15 + 0.85 * a, b, 1.0);
            let incoming = -towards(0.05 + 0.95 * c, 1.0);
            let rays = 20_000;
            let sum: f64 = (0..rays)
                .map(|i| {
                    let sample = unit_pair(10, i);
                    let light = towards(sample[0], sample[1] * core::f32::consts::TAU);
                    let diffuse = 2.0 * any.shown(incoming, Vec3::Z, light, light.z, 0.0)[0];
                    let facet = any.facet(incoming, Vec3::Z, sample);
                    let out = crate::optics::mirror(incoming, facet);
                    let share = any.fresnel(-incoming.dot(facet))[0];
                    let mirrored = if out.z > 0.0 { share * any.passes(-incoming.z, out.z) } else { 0.0 };
                    f64::from(diffuse + mirrored) / f64::from(rays)
                })
                .sum();
            assert!(sum < 1.06, "{sum} of rough {a} metal {b} cosine {c}");
        }
    }

    #[test]
    fn the_ends_are_mirror_and_matt() {
        let mirror = glossy(0.0, 1.0, 0.5);
        let incoming = -towards(0.6, 2.0);
        assert_eq!(mirror.facet(incoming, Vec3::Z, [0.3, 0.9]), Vec3::Z);
        assert_eq!((mirror.diffuse, mirror.passes(0.6, 0.6)), ([0.0; 3], 1.0));
        let matt = glossy(1.0, 0.0, 0.5);
        let light = towards(0.8, 0.0);
        let shown = matt.shown(incoming, Vec3::Z, light, 0.8, 0.0)[0];
        assert!((shown - 0.5 * 0.8 * 0.96).abs() < 0.01, "{shown}");
        assert!((matt.front[0] - 0.04).abs() < 1e-6);
    }
}
