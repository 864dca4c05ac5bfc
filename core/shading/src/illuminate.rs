//! What a light sends to a point, along one ray.
//!
//! A rectangle shines evenly, as a surface of constant radiance: `pi colour / area`, so that from far away on its axis
//! it is a point light of that colour. A sphere has radiance `colour / radius^2`, and lights a surface that has all of
//! it above its horizon exactly as a point light at its centre does.

use glam::Vec3;

use crate::light::{Light, LightKind};
use crate::surface::offset_origin;
use crate::vector::{basis, normalize};

/// Light that arrives at a point along one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arrival {
    /// From the point to the light. Not of unit length, except from a directional light.
    pub(crate) path: Vec3,
    /// `path` at length 1.
    pub(crate) direction: Vec3,
    /// The light lies at this many times `path`.
    pub(crate) t_max: f32,
    /// Irradiance over pi on a surface that faces `direction`. The light's colour is yet to be multiplied by it; a
    /// factor, because only strength and colour set the lights of one shape apart.
    pub(crate) strength: f32,
}

/// End of a shadow ray on its way to a light at 1: eight units in the last place before it.
const JUST_SHORT: f32 = 1.0 - 8.0 / 16_777_216.0;

/// What `light` sends to `point`, by the light's sample `u` (uniform in the unit square; only area lights use it).
/// `None` if nothing: the point lies behind the light, outside of its cone, or in it. What an environment sends, its cells say.
///
/// `distance_scale` is the length of an internal unit in file units. Averaged over `u`, the strength times a surface's
/// cosine is the irradiance over pi, without bias.
#[inline(always)]
pub(crate) fn arrival(light: &Light, point: Vec3, distance_scale: f32, u: [f32; 2]) -> Option<Arrival> {
    match light.kind() {
        LightKind::Point => to_end(light, point, Vec3::from(light.position), distance_scale),
        LightKind::Directional => {
            let direction = -Vec3::from(light.axis);
            Some(Arrival { path: direction, direction, t_max: f32::INFINITY, strength: 1.0 })
        }
        LightKind::Spot => {
            let found = to_end(light, point, Vec3::from(light.position), distance_scale)?;
            let share = spot(light, -found.direction.dot(Vec3::from(light.axis)));
            (share > 0.0).then_some(Arrival { strength: found.strength * share, ..found })
        }
        LightKind::Rectangle => rectangle(light, point, distance_scale, u),
        LightKind::Sphere => sphere(light, point, distance_scale, u),
        LightKind::Environment => None,
    }
}

/// A ray to `end`, with the strength of a point light there.
#[inline(always)]
fn to_end(light: &Light, point: Vec3, end: Vec3, distance_scale: f32) -> Option<Arrival> {
    let path = end - point;
    let square = path.dot(path);
    if !(square > 0.0) {
        return None;
    }
    let length = libm::sqrtf(square);
    Some(Arrival {
        path,
        direction: path / length,
        t_max: JUST_SHORT,
        strength: falloff(light, length, distance_scale),
    })
}

fn falloff(light: &Light, distance: f32, distance_scale: f32) -> f32 {
    if light.flags & Light::FALLOFF == 0 {
        return 1.0;
    }
    let file_distance = distance * distance_scale;
    1.0 / (file_distance * file_distance)
}

/// Share of its strength that a spot sends where the angle from its axis has this cosine: 0 outside, 1 inside, and the
/// cubic `s^2 (3 - 2 s)` of the cosine between, which has no edges.
fn spot(light: &Light, cosine: f32) -> f32 {
    if cosine >= light.cos_inner {
        1.0
    } else if cosine > light.cos_outer {
        let s = (cosine - light.cos_outer) / (light.cos_inner - light.cos_outer);
        s * s * (3.0 - 2.0 * s)
    } else {
        0.0
    }
}

/// Rays end just off the light, as they start just off the surface: a lamp that is modelled where its light is must not
/// hide it. `size` bounds the magnitudes from which `end` was computed.
fn off_light(end: Vec3, size: Vec3, normal: Vec3) -> Vec3 {
    offset_origin(end, size * (1.0 / 1_048_576.0), normal, normal)
}

/// Uniform over the area.
fn rectangle(light: &Light, point: Vec3, distance_scale: f32, u: [f32; 2]) -> Option<Arrival> {
    let (corner, side_u, side_v) = (Vec3::from(light.position), Vec3::from(light.u), Vec3::from(light.v));
    let normal = side_u.cross(side_v);
    if normal == Vec3::ZERO {
        return None;
    }
    let normal = normalize(normal);
    let end = corner + side_u * u[0] + side_v * u[1];
    let end = off_light(end, corner.abs() + side_u.abs() + side_v.abs(), normal);
    let found = to_end(light, point, end, distance_scale)?;
    let cosine = -found.direction.dot(normal);
    (cosine > 0.0).then_some(Arrival { strength: found.strength * cosine, ..found })
}

/// Uniform over the solid angle in which the sphere is seen. Source: Pharr, Jakob, Humphreys, *Physically Based
/// Rendering* 4th ed., section 6.2.4, with `1 - cos` in place of `cos`, so that small and distant spheres keep their
/// digits.
fn sphere(light: &Light, point: Vec3, distance_scale: f32, u: [f32; 2]) -> Option<Arrival> {
    let centre = Vec3::from(light.position);
    let to_centre = centre - point;
    let square = to_centre.dot(to_centre);
    let radius_square = light.radius * light.radius;
    if !(square > radius_square) {
        return None;
    }
    let distance = libm::sqrtf(square);
    // Sine squared and cosine of the angle between the centre and the rim.
    let sine_square = radius_square / square;
    let cosine = libm::sqrtf((square - radius_square) / square);
    let versine = u[0] * (sine_square / (1.0 + cosine));
    let off_square = versine * (2.0 - versine);
    let (sin, cos) = libm::sincosf(core::f32::consts::TAU * u[1]);
    let axis = to_centre / distance;
    let (a, b) = basis(axis);
    let direction = axis * (1.0 - versine) + (a * cos + b * sin) * libm::sqrtf(off_square);
    // Where that direction meets the sphere: from there on everything is computed from the sphere.
    let inside = radius_square - square * off_square;
    let near = distance * (1.0 - versine) - libm::sqrtf(if inside > 0.0 { inside } else { 0.0 });
    let outward = direction * near - to_centre;
    let normal = if outward.dot(outward) > 0.0 { normalize(outward) } else { -axis };
    let end = centre + normal * light.radius;
    let end = off_light(end, centre.abs() + Vec3::splat(light.radius), normal);
    let found = to_end(light, point, end, distance_scale)?;
    // Radiance times solid angle over pi. `falloff` is asked for the centre's distance: it is the centre's light.
    Some(Arrival { strength: falloff(light, distance, distance_scale) * (2.0 / (1.0 + cosine)), ..found })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::child_id;
    use crate::stratify::stratified;

    fn light(kind: LightKind) -> Light {
        Light { kind: kind as u32, colour: [1.0; 3], axis: [0.0, 0.0, -1.0], flags: Light::FALLOFF, ..Light::default() }
    }

    #[test]
    fn point_lights_fall_off_with_the_file_distance() {
        let lamp = Light { position: [0.0, 0.0, 4.0], ..light(LightKind::Point) };
        for (scale, expected) in [(1.0, 1.0 / 16.0), (0.25, 1.0), (2.0, 1.0 / 64.0)] {
            let found = arrival(&lamp, Vec3::ZERO, scale, [0.0; 2]).unwrap();
            assert_eq!(found.strength, expected);
            assert_eq!((found.path, found.direction), (Vec3::Z * 4.0, Vec3::Z));
            assert!(found.t_max < 1.0 && found.t_max > 1.0 - 1e-6);
        }
        let steady = Light { flags: 0, ..lamp };
        assert_eq!(arrival(&steady, Vec3::ZERO, 1.0, [0.0; 2]).unwrap().strength, 1.0);
        assert_eq!(arrival(&lamp, Vec3::Z * 4.0, 1.0, [0.0; 2]), None);
    }

    #[test]
    fn directional_lights_come_from_infinity() {
        let found = arrival(&light(LightKind::Directional), Vec3::splat(1e6), 1.0, [0.0; 2]).unwrap();
        assert_eq!(found, Arrival { path: Vec3::Z, direction: Vec3::Z, t_max: f32::INFINITY, strength: 1.0 });
    }

    fn check_spot(degrees: f64, expected: f64) {
        let cosine = |degrees: f64| libm::cos(degrees.to_radians()) as f32;
        let lamp = Light { cos_inner: cosine(20.0), cos_outer: cosine(30.0), flags: 0, ..light(LightKind::Spot) };
        let angle = degrees.to_radians();
        let point = Vec3::new(libm::sin(angle) as f32, 0.0, -libm::cos(angle) as f32) * 5.0;
        let found = arrival(&lamp, point, 1.0, [0.0; 2]).map_or(0.0, |a| f64::from(a.strength));
        assert!((found - expected).abs() < 1e-5, "{degrees}: {found} {expected}");
    }

    #[test]
    fn spots_have_soft_edges() {
        check_spot(0.0, 1.0);
        check_spot(19.99, 1.0);
        check_spot(30.01, 0.0);
        check_spot(179.0, 0.0);
        let (inner, outer) = (f64::cos(20f64.to_radians()), f64::cos(30f64.to_radians()));
        check_spot(libm::acos((inner + outer) / 2.0).to_degrees(), 0.5);
        check_spot(libm::acos(0.25 * inner + 0.75 * outer).to_degrees(), 0.15625);
        let hard = Light { cos_inner: 0.5, cos_outer: 0.5, ..light(LightKind::Spot) };
        assert_eq!((spot(&hard, 0.501), spot(&hard, 0.5), spot(&hard, 0.499)), (1.0, 1.0, 0.0));
    }

    /// Irradiance over pi at `point` facing `normal`, by `samples` rays.
    fn irradiance(light: &Light, point: Vec3, normal: Vec3, samples: u32) -> f64 {
        let sum: f64 = (0..samples)
            .filter_map(|i| arrival(light, point, 1.0, stratified(child_id(3, 0), i, samples)))
            .map(|a| f64::from(a.strength * a.direction.dot(normal).max(0.0)))
            .sum();
        sum / f64::from(samples)
    }

    /// Lambert's formula for a polygon of radiance 1, over pi: half the sum of the edges' angles, each along the normal
    /// of its plane through the point (Baum et al. 1989; all in front of the surface).
    fn lambert(corners: [Vec3; 4], point: Vec3, normal: Vec3) -> f64 {
        let wide = |v: Vec3| v.to_array().map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let rays = corners.map(|c| {
            let [c, p] = [wide(c), wide(point)];
            let v = [c[0] - p[0], c[1] - p[1], c[2] - p[2]];
            v.map(|x| x / dot(v, v).sqrt())
        });
        let mut sum = 0.0;
        for i in 0..4 {
            let (a, b) = (rays[i], rays[(i + 1) % 4]);
            let c = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            sum += libm::acos(dot(a, b)) * dot(c, wide(normal)) / dot(c, c).sqrt();
        }
        sum.abs() / (2.0 * core::f64::consts::PI)
    }

    fn check_rectangle(point: Vec3, normal: Vec3) {
        let (corner, u, v) = (Vec3::new(-1.0, -0.5, 2.0), Vec3::new(0.2, 1.5, 0.1), Vec3::new(2.0, -0.3, 0.0));
        let lamp = Light { position: corner.into(), u: u.into(), v: v.into(), ..light(LightKind::Rectangle) };
        let area = f64::from(u.cross(v).length());
        let exact =
            lambert([corner, corner + u, corner + u + v, corner + v], point, normal) * core::f64::consts::PI / area;
        let found = irradiance(&lamp, point, normal, 65_536);
        assert!((found / exact - 1.0).abs() < 2e-3, "{point}: {found} {exact}");
        // Few samples, averaged over many points' ids, agree as well: no bias.
        let mut sum = 0.0;
        for key in 0..20_000 {
            for i in 0..3 {
                let found = arrival(&lamp, point, 1.0, stratified(child_id(key, 1), i, 3)).unwrap();
                sum += f64::from(found.strength * found.direction.dot(normal)) / 60_000.0;
            }
        }
        assert!((sum / exact - 1.0).abs() < 1e-2, "{point}: {sum} {exact}");
    }

    #[test]
    fn rectangles_against_lamberts_formula() {
        check_rectangle(Vec3::ZERO, Vec3::Z);
        check_rectangle(Vec3::new(1.5, -2.0, 0.5), normalize(Vec3::new(-0.3, 0.4, 1.0)));
        check_rectangle(Vec3::new(0.0, 0.3, 1.5), Vec3::Z);
        check_rectangle(Vec3::new(-6.0, 0.0, -3.0), normalize(Vec3::new(1.0, 0.0, 0.5)));
    }

    #[test]
    fn rectangles_have_a_dark_side() {
        let lamp = Light { u: [0.0, 1.0, 0.0], v: [1.0, 0.0, 0.0], ..light(LightKind::Rectangle) };
        assert!(arrival(&lamp, Vec3::new(0.3, 0.3, -1.0), 1.0, [0.5; 2]).is_some());
        assert_eq!(arrival(&lamp, Vec3::new(0.3, 0.3, 1.0), 1.0, [0.5; 2]), None);
        let flat = Light { v: [0.0, 3.0, 0.0], ..lamp };
        assert_eq!(arrival(&flat, Vec3::NEG_Z, 1.0, [0.5; 2]), None);
    }

    fn check_sphere(radius: f32, point: Vec3, normal: Vec3, samples: u32, slack: f64) {
        let centre = Vec3::new(0.5, -0.25, 3.0);
        let lamp = Light { position: centre.into(), radius, ..light(LightKind::Sphere) };
        // A sphere that is wholly above the horizon gives what a point at its centre gives, at every distance.
        let to_centre = centre - point;
        let square = f64::from(to_centre.dot(to_centre));
        assert!(to_centre.dot(normal) > radius);
        let exact = f64::from(to_centre.dot(normal)) / square.sqrt() / square;
        let found = irradiance(&lamp, point, normal, samples);
        assert!((found / exact - 1.0).abs() < slack, "{radius} {point}: {found} {exact}");
    }

    #[test]
    fn spheres_against_their_exact_irradiance() {
        let slanted = normalize(Vec3::new(0.4, 0.3, 1.0));
        for radius in [1e-6, 1e-3, 0.1, 1.0, 1.9] {
            check_sphere(radius, Vec3::ZERO, Vec3::Z, 65_536, 1e-3);
            check_sphere(radius, Vec3::ZERO, slanted, 65_536, 1e-3);
            check_sphere(radius, Vec3::new(300.0, 20.0, -200.0), normalize(Vec3::new(-1.0, 0.0, 0.5)), 4096, 1e-3);
        }
        check_sphere(2.99, Vec3::new(0.5, -0.25, 0.0), Vec3::Z, 65_536, 2e-3);
    }

    /// A sphere half below the horizon: the formula for a sphere cut by the horizon (Snyder 1996) at 90 degrees, over
    /// pi: (1 / pi) (asin s - s sqrt(1 - s^2)), s the sine of its angular radius. Radiance is colour / r^2.
    #[test]
    fn half_sunk_spheres_against_their_exact_irradiance() {
        for radius in [0.3f64, 1.0, 2.5] {
            let lamp = Light { position: [3.0, 0.0, 0.0], radius: radius as f32, ..light(LightKind::Sphere) };
            let s = radius / 3.0;
            let exact = (libm::asin(s) - s * (1.0 - s * s).sqrt()) / core::f64::consts::PI / (radius * radius);
            let found = irradiance(&lamp, Vec3::ZERO, Vec3::Z, 65_536);
            assert!((found / exact - 1.0).abs() < 2e-3, "{radius}: {found} {exact}");
        }
    }

    #[test]
    fn far_away_all_kinds_agree() {
        let point = Vec3::new(0.0, 0.0, -1000.0);
        for flags in [0, Light::FALLOFF] {
            let expected = irradiance(&Light { flags, ..light(LightKind::Point) }, point, Vec3::Z, 1);
            for kind in [LightKind::Spot, LightKind::Sphere, LightKind::Rectangle] {
                let lamp = Light {
                    u: [0.0, 1.0, 0.0],
                    v: [1.0, 0.0, 0.0],
                    radius: 0.5,
                    cos_inner: 0.9,
                    cos_outer: 0.8,
                    flags,
                    ..light(kind)
                };
                let found = irradiance(&lamp, point, Vec3::Z, 64);
                assert!((found / expected - 1.0).abs() < 1e-5, "{kind:?} {flags}: {found} {expected}");
            }
        }
    }

    #[test]
    fn rays_end_just_off_the_light() {
        for i in 0..20_000u32 {
            let u = crate::id::unit_pair(4, i);
            let [x, y] = crate::id::unit_pair(5, i);
            let centre = Vec3::new(x * 100.0, 40.0, y - 0.5);
            let lamp = Light { position: centre.into(), radius: 0.25, ..light(LightKind::Sphere) };
            let point = Vec3::new(y * 100.0, -20.0, x);
            let found = arrival(&lamp, point, 1.0, u).unwrap();
            let wide = |v: Vec3| v.to_array().map(f64::from);
            let (p, d, c) = (wide(point), wide(found.path), wide(centre));
            let mut gap = 0.0;
            (0..3).for_each(|a| gap += (p[a] + f64::from(found.t_max) * d[a] - c[a]).powi(2));
            let gap = gap.sqrt() - 0.25;
            assert!(gap > 0.0 && gap < 1e-3, "{centre} {point} {u:?}: {gap}");
        }
    }

    #[test]
    fn points_inside_a_sphere_get_nothing() {
        let lamp = Light { radius: 2.0, ..light(LightKind::Sphere) };
        assert_eq!(arrival(&lamp, Vec3::X, 1.0, [0.5; 2]), None);
        assert_eq!(arrival(&lamp, Vec3::ZERO, 1.0, [0.5; 2]), None);
        assert_eq!(arrival(&lamp, Vec3::X * 2.0, 1.0, [0.5; 2]), None);
    }
}
