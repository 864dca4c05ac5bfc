use super::*;
use crate::material::Highlight;
use std::{vec, vec::Vec};

const WHITE: [f32; 3] = [1.0; 3];

/// A flat surface at the origin, seen from straight above.
fn child(scene: &Scene<'_>, surface: &Surface, weight: [f32; 3], depth: u32, id: u64, cursor: u32) -> Child {
    super::child(scene, &Facing::new(surface, Look::PLAIN), weight, depth, id, cursor)
}

fn floor() -> Surface {
    Surface {
        position: Vec3::ZERO,
        error: Vec3::splat(1e-6),
        geometric_normal: Vec3::Z,
        shading_normal: Vec3::Z,
        shadow_offset: Vec3::ZERO,
        incoming: Vec3::NEG_Z,
        material: 0,
        medium: 0,
    }
}

/// The floor, seen at an angle from its normal.
fn seen_at(degrees: f64) -> Surface {
    Surface { incoming: -at(degrees), ..floor() }
}

/// A direction in the plane of x and z, by its angle from z.
fn at(degrees: f64) -> Vec3 {
    Vec3::new(libm::sin(degrees.to_radians()) as f32, 0.0, libm::cos(degrees.to_radians()) as f32)
}

fn lamp(position: Vec3) -> Light {
    Light { position: position.into(), colour: [2.0, 1.0, 0.5], samples: 1, ..Light::default() }
}

fn scene<'a>(materials: &'a [Material], lights: &'a [Light]) -> Scene<'a> {
    Scene {
        materials,
        lights,
        ambient: [0.5, 0.25, 0.125],
        ray_depth_max: 5,
        weight_cutoff: 0.01,
        distance_scale: 1.0,
        shadow_rays: shadow_rays(lights),
        maps: MapTables::default(),
    }
}

fn all(scene: &Scene<'_>, surface: &Surface) -> Vec<Child> {
    (0..children(scene, surface)).map(|cursor| child(scene, surface, WHITE, 1, 7, cursor)).collect()
}

fn contribution(child: Child) -> [f32; 3] {
    match child {
        Child::Shadow { contribution, .. } => contribution,
        Child::None => [0.0; 3],
        other => panic!("{other:?} is no shadow ray"),
    }
}

/// Weight, direction, origin and medium of a mirrored or refracted ray; weight 0 if there is none.
fn ray(child: Child) -> (f32, Vec3, Vec3, u16) {
    match child {
        Child::Mirror { origin, direction, weight, medium, .. }
        | Child::Refract { origin, direction, weight, medium, .. } => (weight[0], direction, origin, medium),
        _ => (0.0, Vec3::ZERO, Vec3::ZERO, 0),
    }
}

fn close(found: f32, expected: f64, slack: f64) {
    assert!((f64::from(found) - expected).abs() <= slack, "{found}, expected {expected}");
}

const GLASS: Material = Material {
    diffuse: [0.0; 3],
    mirror: [0.125; 3],
    transmission: [0.75; 3],
    ior: 1.5,
    flags: Material::FRESNEL,
    ..Material::MATT
};

#[test]
fn emission_and_ambient_light() {
    let material = Material { emission: [3.0, 0.0, 1.0], ambient: [0.5, 1.0, 2.0], ..Material::MATT };
    let materials = [material];
    let scene = scene(&materials, &[]);
    let shine = |surface: &Surface, weight| local(&scene, &Facing::new(surface, Look::PLAIN), WHITE, weight);
    assert_eq!(shine(&floor(), [1.0, 2.0, 4.0]), [3.25, 0.5, 5.0]);
    assert_eq!(shine(&Surface { material: 9, ..floor() }, WHITE), [0.0; 3]);
}

#[test]
fn one_diffuse_light() {
    let materials = [Material { diffuse: [0.5, 0.25, 1.0], ..Material::MATT }];
    let lights = [lamp(at(60.0) * 10.0)];
    let scene = scene(&materials, &lights);
    let found = all(&scene, &seen_at(30.0));
    assert_eq!(found.len(), 1);
    let Child::Shadow { origin, direction, t_max, contribution, branch } = found[0] else { panic!("{found:?}") };
    (0..3).for_each(|c| close(contribution[c], 0.5 * f64::from(lights[0].colour[c] * materials[0].diffuse[c]), 1e-6));
    assert_eq!(branch, 1);
    assert!(t_max < 1.0 && t_max > 0.999_999);
    assert!(origin.z > 1e-6 && origin.z < 1e-5 && origin.x == 0.0);
    assert_eq!(origin + direction, at(60.0) * 10.0);
    // The weight is carried, channel by channel.
    let Child::Shadow { contribution: weighted, .. } = child(&scene, &seen_at(30.0), [0.5, 0.0, 2.0], 1, 7, 0) else {
        panic!()
    };
    assert_eq!(weighted, [contribution[0] * 0.5, 0.0, contribution[2] * 2.0]);
    // The last depth still has its shadow rays.
    assert_eq!(child(&scene, &seen_at(30.0), WHITE, 5, 7, 0), found[0]);
}

fn check_highlight(highlight: Highlight, exponent: f32, view: f64, light: f64, angle: f64) {
    let materials = [Material {
        diffuse: [0.0; 3],
        specular: [1.0, 0.5, 0.0],
        highlight: highlight as u32,
        exponent,
        ..Material::MATT
    }];
    let lights = [Light { axis: (-at(light)).into(), kind: LightKind::Directional as u32, ..lamp(Vec3::ZERO) }];
    let found = contribution(child(&scene(&materials, &lights), &seen_at(view), WHITE, 1, 7, 0));
    let expected = libm::pow(libm::cos(angle.to_radians()).max(0.0), f64::from(exponent));
    close(found[0], 2.0 * expected, 1e-6 * f64::from(1.0 + exponent));
    close(found[1], 0.5 * expected, 1e-6 * f64::from(1.0 + exponent));
    assert_eq!(found[2], 0.0);
}

#[test]
fn highlights() {
    check_highlight(Highlight::Phong, 10.0, 30.0, -30.0, 0.0);
    check_highlight(Highlight::Phong, 10.0, 30.0, -10.0, 20.0);
    check_highlight(Highlight::Phong, 2.5, 50.0, 45.0, 95.0);
    check_highlight(Highlight::Blinn, 10.0, 30.0, -10.0, 10.0);
    check_highlight(Highlight::Blinn, 33.3, 60.0, 20.0, 40.0);
    // A light below the horizon has none.
    check_highlight(Highlight::Phong, 1.0, 80.0, -91.0, 90.0);
    check_highlight(Highlight::None, 1.0, 0.0, 0.0, 90.0);
}

#[test]
fn both_sides_are_seen_and_lit_from_the_viewers_side() {
    let materials = [Material::MATT];
    let lights = [lamp(Vec3::Z * 3.0), lamp(Vec3::Z * -3.0)];
    let scene = scene(&materials, &lights);
    let above = all(&scene, &floor());
    assert!(contribution(above[0])[0] > 0.0 && above[1] == Child::None);
    let below = all(&scene, &Surface { incoming: Vec3::Z, ..floor() });
    assert!(below[0] == Child::None && contribution(below[1])[0] > 0.0);
    let Child::Shadow { origin, .. } = below[1] else { panic!() };
    assert!(origin.z < -1e-6);
    // Normals on the wrong side of the primitive are turned round.
    assert_eq!(above, all(&scene, &Surface { shading_normal: Vec3::NEG_Z, ..floor() }));
}

#[test]
fn light_from_behind_the_surface_is_shut_out() {
    let materials = [Material::MATT];
    let lights = [lamp(at(95.0) * 10.0)];
    let scene = scene(&materials, &lights);
    let leaning = Surface { shading_normal: at(20.0), ..floor() };
    assert_eq!(all(&scene, &leaning), [Child::None]);
    // A lifted point sends its ray, from above the surface, and leaves the shadow to it.
    let lifted = Surface { shadow_offset: Vec3::Z * 0.25, ..leaning };
    let Child::Shadow { origin, contribution, .. } = all(&scene, &lifted)[0] else { panic!() };
    assert!(origin.z > 0.25 && origin.z < 0.251 && contribution[0] > 0.0);
    // An offset that does not lift is not used.
    assert_eq!(all(&scene, &Surface { shadow_offset: Vec3::Z * -0.25, ..leaning }), [Child::None]);
    assert_eq!(all(&scene, &Surface { shading_normal: at(-20.0), ..lifted }), [Child::None]);
}

#[test]
fn dark_lights_and_dead_materials_send_nothing() {
    let spot =
        Light { kind: LightKind::Spot as u32, axis: [1.0, 0.0, 0.0], cos_inner: 0.9, cos_outer: 0.8, ..lamp(Vec3::Z) };
    let back = Light { kind: 4, u: [1.0, 0.0, 0.0], v: [0.0, 1.0, 0.0], ..lamp(Vec3::Z) };
    let black = Light { colour: [0.0; 3], ..lamp(Vec3::Z) };
    let lights = [spot, back, black, lamp(Vec3::Z)];
    let materials = [Material::MATT, Material { diffuse: [0.0; 3], ..Material::MATT }];
    let scene = scene(&materials, &lights);
    let found = all(&scene, &floor());
    assert_eq!(found[..3], [Child::None; 3]);
    assert!(matches!(found[3], Child::Shadow { branch: 4, .. }));
    assert_eq!(all(&scene, &Surface { material: 1, ..floor() }), [Child::None; 4]);
}

#[test]
fn cursors_walk_lights_then_mirror_then_refraction() {
    let area = Light { kind: 3, radius: 0.5, samples: 5, ..lamp(Vec3::Z * 4.0) };
    let lights = [lamp(Vec3::Z), area, Light { samples: 9, ..lamp(Vec3::Z * 2.0) }, Light { samples: 2, ..area }];
    let mixed = Material { diffuse: WHITE, ..GLASS };
    let materials = [mixed, Material { mirror: WHITE, ..Material::MATT }, Material::MATT];
    let scene = scene(&materials, &lights);
    assert_eq!(scene.shadow_rays, 9);
    let counts = [0, 1, 2].map(|material| children(&scene, &Surface { material, ..floor() }));
    assert_eq!(counts, [11, 10, 9]);
    let found = all(&scene, &floor());
    let branches: Vec<u32> = found
        .iter()
        .map(|child| match *child {
            Child::Shadow { branch, .. } | Child::Mirror { branch, .. } | Child::Refract { branch, .. } => branch,
            Child::None => 0,
        })
        .collect();
    assert_eq!(branches, (1..=11).collect::<Vec<_>>());
    assert!(matches!(found[9], Child::Mirror { .. }) && matches!(found[10], Child::Refract { .. }));
    let reach = |child: Child| {
        if let Child::Shadow { direction, .. } = child { direction.z } else { 0.0 }
    };
    assert!(reach(found[0]) < 1.01 && reach(found[3]) > 3.4 && reach(found[6]) < 2.01 && reach(found[7]) > 3.4);
    assert_eq!(child(&scene, &floor(), WHITE, 1, 7, 11), Child::None);
    assert_eq!(child(&scene, &floor(), WHITE, 1, 7, u32::MAX), Child::None);
}

#[test]
fn area_lights_converge_to_a_point_light() {
    let materials = [Material::MATT];
    let centre = Vec3::new(1.0, 0.5, 2.0);
    let point = Light { flags: Light::FALLOFF, ..lamp(centre) };
    let sphere = Light { kind: 3, radius: 0.75, samples: 16, ..point };
    let exact = contribution(child(&scene(&materials, &[point]), &floor(), WHITE, 1, 0, 0));
    let lights = [sphere];
    let scene = scene(&materials, &lights);
    let mut sum = [0.0f64; 3];
    let mut seen = vec![];
    for id in 0..2000 {
        for cursor in 0..children(&scene, &floor()) {
            let found = child(&scene, &floor(), WHITE, 1, id, cursor);
            let Child::Shadow { direction, contribution, .. } = found else { panic!("{found:?}") };
            seen.push(direction.to_array().map(f32::to_bits));
            (0..3).for_each(|c| sum[c] += f64::from(contribution[c]) / 2000.0);
            assert_eq!(found, child(&scene, &floor(), WHITE, 4, id, cursor), "depth changes nothing");
        }
    }
    (0..3).for_each(|c| assert!((sum[c] / f64::from(exact[c]) - 1.0).abs() < 2e-3, "{sum:?} {exact:?}"));
    seen.sort_unstable();
    seen.dedup();
    assert!(seen.len() > 31_900, "every ray has its own sample: {}", seen.len());
}

#[test]
fn falloff_is_in_file_units() {
    let materials = [Material::MATT];
    let lights = [Light { flags: Light::FALLOFF, ..lamp(Vec3::Z * 2.0) }];
    for (distance_scale, expected) in [(1.0, 0.375), (4.0, 0.375 / 16.0)] {
        let scene = Scene { distance_scale, ..scene(&materials, &lights) };
        close(contribution(child(&scene, &floor(), WHITE, 1, 0, 0))[0], expected, 1e-6);
    }
}

#[test]
fn mirrors_reflect_in_the_shading_normal_and_stay_above() {
    let materials = [Material { mirror: [0.5; 3], ..Material::MATT }];
    let scene = scene(&materials, &[]);
    let (weight, direction, origin, medium) = ray(all(&scene, &seen_at(35.0))[0]);
    assert_eq!((weight, medium), (0.5, 0));
    assert!((direction - at(-35.0)).abs().max_element() < 1e-6 && origin.z > 1e-6);
    let tilted = Surface { shading_normal: at(-5.0), ..seen_at(30.0) };
    assert!((ray(all(&scene, &tilted)[0]).1 - at(-40.0)).abs().max_element() < 1e-6);
    for (view, tilt) in [(80.0, -20.0), (89.9999, 0.0), (90.0, 0.0), (60.0, -40.0), (-60.0, 40.0), (100.0, 15.0)] {
        let surface = Surface { shading_normal: at(tilt), ..seen_at(view) };
        let direction = ray(all(&scene, &surface)[0]).1;
        let side = if view > 90.0 { -1.0 } else { 1.0 };
        assert!(
            direction.z * side > 0.0 && (direction.dot(direction) - 1.0).abs() < 1e-6,
            "{view} {tilt}: {direction}"
        );
    }
}

/// The two rays of a hit on glass: their weights, and the refracted one's angle.
fn check_glass(medium: u16, view: f64, flags: u32) {
    let materials = [Material::MATT, Material { flags, ..GLASS }];
    let scene = scene(&materials, &[]);
    let surface = Surface { material: 1, medium, ..seen_at(view) };
    let found = all(&scene, &surface);
    let ((mirror, up, _, stays), (refract, down, below, beyond)) = (ray(found[0]), ray(found[1]));
    close(mirror + refract, 0.875, 2e-7);
    let eta = if medium == 2 { 1.5 } else { 1.0 / 1.5 };
    let sine = eta * libm::sin(view.to_radians());
    if sine >= 1.0 {
        assert_eq!((mirror, found[1], stays), (0.875, Child::None, medium));
        assert!((up - at(-view)).abs().max_element() < 1e-6);
        return;
    }
    assert_eq!(beyond, if medium == 2 { 0 } else { 2 });
    assert!(below.z < -1e-6 && (down.dot(down) - 1.0).abs() < 4e-7);
    close(down.x, -sine, 3e-7);
    close(down.z, -(1.0 - sine * sine).sqrt(), 1e-5);
    let (cos_in, cos_out) = (libm::cos(view.to_radians()), (1.0 - sine * sine).sqrt());
    let (s, p) =
        ((eta * cos_in - cos_out) / (eta * cos_in + cos_out), (cos_in - eta * cos_out) / (cos_in + eta * cos_out));
    let fresnel = if flags == 0 { 0.0 } else { 0.5 * (s * s + p * p) };
    close(refract, 0.75 * (1.0 - fresnel), 1e-4 / cos_out.max(1e-2) * 1e-2);
}

#[test]
fn glass_splits_what_it_transmits() {
    for flags in [0, Material::FRESNEL] {
        for medium in [0, 2] {
            for view in [0.0, 5.0, 20.0, 41.0, 41.8, 41.82, 45.0, 60.0, 80.0, 89.0] {
                check_glass(medium, view, flags);
            }
        }
    }
    // Clear glass without Fresnel's equations has no mirrored ray until reflection is total.
    let materials = [Material { mirror: [0.0; 3], flags: 0, ..GLASS }];
    let scene = scene(&materials, &[]);
    assert!(matches!(all(&scene, &seen_at(30.0))[..], [Child::None, Child::Refract { medium: 1, .. }]));
    let inside = Surface { medium: 1, ..seen_at(50.0) };
    assert!(matches!(all(&scene, &inside)[..], [Child::Mirror { medium: 1, .. }, Child::None]));
}

#[test]
fn media_may_touch() {
    // From water (material 1) into glass (material 0), and glass of the same index: straight on.
    let materials = [GLASS, Material { ior: 1.33, ..GLASS }, GLASS];
    let scene = scene(&materials, &[]);
    let sine = libm::sin(40f64.to_radians());
    let (_, direction, _, medium) = ray(all(&scene, &Surface { medium: 2, ..seen_at(40.0) })[1]);
    close(direction.x, -sine * 1.33 / 1.5, 3e-7);
    assert_eq!(medium, 1);
    let (_, direction, _, medium) = ray(all(&scene, &Surface { medium: 3, ..seen_at(40.0) })[1]);
    close(direction.x, -sine, 1e-7);
    assert_eq!(medium, 1);
}

#[test]
fn refraction_stays_below_whatever_the_shading_normal() {
    let materials = [GLASS];
    let scene = Scene { weight_cutoff: 0.0, ..scene(&materials, &[]) };
    for medium in [0, 1] {
        for view in [0.0, 30.0, 60.0, 85.0, 89.99, 90.0] {
            for tilt in [-80.0, -40.0, 0.0, 40.0, 80.0] {
                let surface = Surface { shading_normal: at(tilt), medium, ..seen_at(view) };
                let found = all(&scene, &surface);
                let ((mirror, up, ..), (refract, down, ..)) = (ray(found[0]), ray(found[1]));
                close(mirror + refract, 0.875, 1e-6);
                assert!(up.z > 0.0, "{medium} {view} {tilt}: {up}");
                assert!(refract == 0.0 || down.z < 0.0, "{medium} {view} {tilt}: {down}");
            }
        }
    }
}

#[test]
fn depth_and_cutoff_end_the_tree() {
    let materials = [GLASS];
    let scene = scene(&materials, &[]);
    let spawned =
        |weight: [f32; 3], depth| [0, 1].map(|cursor| child(&scene, &floor(), weight, depth, 7, cursor) != Child::None);
    assert_eq!(spawned(WHITE, 1), [true, true]);
    assert_eq!(spawned(WHITE, 4), [true, true]);
    assert_eq!(spawned(WHITE, 5), [false, false]);
    assert_eq!(spawned(WHITE, u32::MAX), [false, false]);
    // At normal incidence 0.155 is mirrored and 0.72 refracted; the cut-off is 0.01.
    assert_eq!(spawned([0.0, 0.0, 0.065], 1), [true, true]);
    assert_eq!(spawned([0.06, 0.06, 0.06], 1), [false, true]);
    assert_eq!(spawned([0.013; 3], 1), [false, false]);
    assert_eq!(spawned([0.0; 3], 1), [false, false]);
    let endless = Scene { weight_cutoff: 0.0, ..scene };
    assert_eq!(child(&endless, &floor(), [0.0; 3], 1, 7, 1), Child::None);
    assert!(child(&endless, &floor(), [1e-30; 3], 1, 7, 1) != Child::None);
}

#[test]
fn shadow_rays_pass_through_glass() {
    let materials = [Material { transmission: [0.5, 0.25, 0.0], ..GLASS }, Material::MATT];
    let scene = scene(&materials, &[]);
    let (origin, left) = pass_through(&scene, &floor(), 1.0, [1.0, 2.0, 3.0]).unwrap();
    assert_eq!(left, [0.5, 0.5, 0.0]);
    assert!(origin.z < -1e-6);
    let (origin, _) = pass_through(&scene, &Surface { incoming: Vec3::Z, ..floor() }, 1.0, WHITE).unwrap();
    assert!(origin.z > 1e-6);
    assert_eq!(pass_through(&scene, &Surface { material: 1, ..floor() }, 1.0, WHITE), None);
    assert_eq!(pass_through(&scene, &floor(), 1.0, [0.0, 0.0, 1.0]), None);
}

#[test]
fn hostile_tables_do_no_harm() {
    let wild = Material { ior: f32::NAN, exponent: -1.0, highlight: 77, flags: u32::MAX, ..GLASS };
    let light = Light { kind: 99, samples: 0, ..lamp(Vec3::Z) };
    let rectangle = Light { kind: 4, samples: u16::MAX, u: [f32::INFINITY; 3], ..light };
    let (materials, lights) = ([wild], vec![light, rectangle, Light { kind: 3, radius: f32::NAN, ..light }]);
    let scene = Scene { ray_depth_max: u32::MAX, ..scene(&materials, &lights) };
    for medium in [0, 1, 7, u16::MAX] {
        for material in [0, 5, u16::MAX] {
            let surface = Surface { medium, material, ..seen_at(33.0) };
            for cursor in [0, 1, 65_535, 65_536, 65_537, 65_538, 65_539, u32::MAX] {
                let _ = child(&scene, &surface, WHITE, 1, 7, cursor);
            }
        }
    }
    let lost = Surface { geometric_normal: Vec3::NAN, ..floor() };
    for cursor in 0..4 {
        let _ = child(&scene, &lost, WHITE, 1, 7, cursor);
    }
}

/// Contributions that are not finite are the film's to count, so they must reach it.
#[test]
fn infinities_reach_the_film() {
    let materials = [Material::MATT];
    let lights = [Light { colour: [f32::INFINITY, f32::NAN, 1.0], ..lamp(Vec3::Z) }];
    assert!(contribution(child(&scene(&materials, &lights), &floor(), WHITE, 1, 0, 0))[1].is_nan());
}

/// Every bit of many children, folded: the same on every processor and at every optimisation level, or one picture is
/// not one picture. Change the constant only with a change that is meant to change pictures.
#[test]
fn bits_are_pinned() {
    let materials = [
        Material { specular: [0.5, 0.25, 0.125], highlight: 1, exponent: 21.0, mirror: [0.25; 3], ..Material::MATT },
        Material { specular: WHITE, highlight: 2, exponent: 7.3, ior: 1.31, diffuse: [0.1; 3], ..GLASS },
    ];
    let base = Light { flags: Light::FALLOFF, samples: 3, axis: at(165.0).into(), ..lamp(Vec3::new(1.0, 2.0, 5.0)) };
    let lights = [
        base,
        Light { kind: 1, ..base },
        Light { kind: 2, cos_inner: 0.95, cos_outer: 0.3, ..base },
        Light { kind: 3, radius: 0.75, ..base },
        Light { kind: 4, u: [0.1, 1.0, 0.2], v: [1.0, 0.0, -0.1], ..base },
    ];
    let scene = Scene { weight_cutoff: 0.0, ..scene(&materials, &lights) };
    let camera = crate::Camera::look(Vec3::new(0.3, -4.0, 3.0), Vec3::X, Vec3::Z, 50.0, 0.1, 32, 24).unwrap();
    let mut bits = vec![];
    for pixel in 0..32 * 24 {
        let key = id::pixel_id(1, pixel);
        let filter = crate::Filter::from_u32(pixel % 3).unwrap();
        let eye = camera.ray(pixel % 32, pixel / 32, crate::sample_offset(filter, key, pixel % 5, 5));
        bits.extend([eye.direction.x, eye.direction.y, eye.direction.z, eye.t_min, eye.spread]);
        let [u, v] = id::unit_pair(key, 0);
        let corners = [Vec3::new(-1.0, -1.0, 0.1), Vec3::new(1.2, -0.9, -0.2), Vec3::new(0.1, 1.4, 0.0)];
        let b = [1.0 - u * 0.5 - v * 0.5, u * 0.5, v * 0.5];
        let surface = Surface {
            position: corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2],
            incoming: eye.direction,
            material: (pixel % 2) as u16,
            medium: (pixel / 2 % 3) as u16,
            ..floor()
        };
        let normals = [at(-20.0), at(25.0), at(5.0)].map(|n| crate::unpack_normal(crate::pack_normal(n)));
        let surface = surface.smooth(corners, normals, b);
        for cursor in 0..children(&scene, &surface) {
            match child(&scene, &surface, [0.5, 1.0, 0.7], 1, key, cursor) {
                Child::Shadow { origin, direction, t_max, contribution, .. } => {
                    bits.extend(origin.to_array().into_iter().chain(direction.to_array()).chain(contribution));
                    bits.push(t_max);
                }
                Child::Mirror { origin, direction, weight, .. } | Child::Refract { origin, direction, weight, .. } => {
                    bits.extend(origin.to_array().into_iter().chain(direction.to_array()).chain(weight));
                }
                Child::None => bits.push(-1.0),
            }
        }
    }
    let digest = bits.iter().fold(0u64, |digest, x| id::child_id(digest, x.to_bits()));
    assert!(!bits.iter().any(|x| x.is_nan()));
    assert_eq!((bits.len(), digest), (82_688, 502_928_926_510_915_918));
}
