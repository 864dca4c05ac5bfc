//! Scenes of any size and anywhere: powers of two change nothing, and what is closed has no holes.

use hybray::build;
use hybray::model::{CameraSpec, Mesh, Model, NamedMaterial, Settings};
use hybray::prepare::Prepared;
use hybray_bintree::walk::{Counts, Stack, nearest};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Ray, Vec3};
use hybray_native::{DispatcherAt, Farm};
use hybray_scheduler::Options;
use hybray_shading::{Camera, Light};
use hybray_tests::{Picture, camera_rays, kernels, scene};

/// All lengths of `model` times 2 to the power `log2`. Light that falls with the square of the distance is made as much
/// stronger, so that it arrives as before.
fn scaled(mut model: Model, log2: i32) -> Model {
    let by = 2f32.powi(log2);
    let three = |v: &mut [f32; 3]| *v = v.map(|x| x * by);
    model.meshes.iter_mut().for_each(|mesh| mesh.positions.iter_mut().for_each(three));
    for sphere in &mut model.spheres {
        three(&mut sphere.centre);
        sphere.radius *= by;
    }
    for cone in &mut model.cones {
        three(&mut cone.base);
        three(&mut cone.apex);
        cone.base_radius *= by;
        cone.apex_radius *= by;
    }
    for light in &mut model.lights {
        [&mut light.position, &mut light.u, &mut light.v].into_iter().for_each(three);
        light.radius *= by;
        if light.flags & Light::FALLOFF != 0 {
            light.colour = light.colour.map(|c| c * by * by);
        }
    }
    for camera in &mut model.cameras {
        [&mut camera.eye, &mut camera.target].into_iter().for_each(three);
        camera.hither *= by;
    }
    model
}

fn check_scaled(name: &str, powers: &[i32]) {
    let wanted = Settings { size: Some([64, 48]), spp: Some(2), depth: Some(5), ..Settings::default() };
    let farm = Farm {
        nodes: 2,
        kernels: kernels(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
    let draw = |model| Picture::of(model, &build::Settings::default(), &wanted, &farm, name);
    let expected = draw(scene(name));
    for &log2 in powers {
        assert_eq!(draw(scaled(scene(name), log2)), expected, "{name} times 2^{log2}");
    }
}

#[test]
fn powers_of_two_change_nothing() {
    // 2^40 is 1.1e12. The last ones come near 2^100, beyond which no coordinate may be, and near where squares vanish.
    let powers = [1, -1, 40, -40, 85, -85];
    for name in ["spd:balls:2", "spd:tree:5", "spd:gears:1", "spd:mount:3", "organic:1000", "terrain:1000"] {
        check_scaled(name, &powers);
    }
    // Light that falls with the distance has strengths that grow with the square: 2^170 is no `f32`.
    check_scaled("cornell", &powers[..4]);
    check_scaled("cornell:mirror", &powers[..4]);
}

/// What a ray is compared with: the mesh in `f64`, where its coordinates and their differences are exact, with edge
/// functions that two triangles compute alike for the edge that they share. What those decide may be wrong by a rounding,
/// but never leaves a gap between two triangles.
struct Exact {
    /// Corners as seen from the origin of all rays.
    corners: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
}

impl Exact {
    /// The mesh, vertices that are the same point being one.
    fn new(mesh: &Mesh, origin: [f64; 3]) -> Self {
        let mut order: Vec<usize> = (0..mesh.positions.len()).collect();
        let bits = |i: usize| mesh.positions[i].map(|x| (x + 0.0).to_bits());
        order.sort_by_key(|&i| bits(i));
        let mut names = vec![0; order.len()];
        for pair in order.windows(2) {
            names[pair[1]] = names[pair[0]] + usize::from(bits(pair[0]) != bits(pair[1]));
        }
        let mut corners = vec![[0.0; 3]; mesh.positions.len()];
        let relative = |p: [f32; 3]| [0, 1, 2].map(|axis| f64::from(p[axis]) - origin[axis]);
        (0..order.len()).for_each(|i| corners[names[i]] = relative(mesh.positions[i]));
        Self { corners, triangles: mesh.triangles.iter().map(|t| t.map(|v| names[v as usize])).collect() }
    }

    /// Every edge belongs to as many triangles that run along it as against it.
    fn is_closed(&self) -> bool {
        let mut edges: Vec<_> = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| (a.min(b), a.max(b), if a < b { 1 } else { -1 }))
            .collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).all(|same| same.iter().map(|e| e.2).sum::<i32>() == 0)
    }

    /// How far along `direction` the surface is, in lengths of `direction`.
    fn distance(&self, direction: [f64; 3]) -> Option<f64> {
        let corners = &self.corners;
        let edge = |a: usize, b: usize| {
            if a < b { triple(direction, corners[a], corners[b]) } else { -triple(direction, corners[b], corners[a]) }
        };
        let hit = |&[a, b, c]: &[usize; 3]| {
            let weights = [edge(b, c), edge(c, a), edge(a, b)];
            let sum: f64 = weights.iter().sum();
            let inside = weights.iter().all(|&w| w >= 0.0) || weights.iter().all(|&w| w <= 0.0);
            let along = |corner: usize| dot(direction, corners[corner]) / dot(direction, direction);
            let distance = (weights[0] * along(a) + weights[1] * along(b) + weights[2] * along(c)) / sum;
            (inside && sum != 0.0 && distance > 0.0).then_some(distance)
        };
        self.triangles.iter().filter_map(hit).reduce(f64::min)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The parallelepiped's volume.
fn triple(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

fn shifted(mut model: Model, by: Vec3) -> Model {
    let three = |v: &mut [f32; 3]| *v = (Vec3::from(*v) + by).to_array();
    model.meshes.iter_mut().for_each(|mesh| mesh.positions.iter_mut().for_each(three));
    for camera in &mut model.cameras {
        [&mut camera.eye, &mut camera.target].into_iter().for_each(three);
    }
    model
}

/// No primary ray, and no ray at a vertex or an edge's middle, passes through the surface where there is surface all
/// around.
fn check_closed(what: &str, model: Model) {
    let exact = Exact::new(&model.meshes[0], model.cameras[0].eye.map(f64::from));
    assert!(exact.is_closed(), "{what}");
    let aims: Vec<Vec3> = {
        let mesh = &model.meshes[0];
        let corner = |v: u32| Vec3::from(mesh.positions[v as usize]);
        let edges = mesh.triangles.iter().map(|t| (corner(t[0]) + corner(t[1])) * 0.5);
        mesh.positions.iter().map(|&p| p.into()).chain(edges).collect()
    };
    let prepared = Prepared::new(model.clone(), &build::Settings::default()).unwrap();
    let pages = prepared.packed.open().unwrap();
    let unit = 2f32.powi(prepared.packed.scale_log2);
    let eye = Vec3::from(model.cameras[0].eye) * unit;
    let mut rays = camera_rays(&model, unit, 64);
    rays.extend(aims.iter().map(|&aim| Ray {
        origin: eye,
        direction: aim * unit - eye,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }));
    // A hundredth of a pixel, seen from the eye.
    let spread = 0.01 * 2.0 * (0.5 * f64::from(model.cameras[0].fov_y_degrees).to_radians()).tan() / 64.0;
    let wide = |v: Vec3, by: f64| v.to_array().map(|x| f64::from(x) * by);
    let (mut inside, mut counts, mut stack) = (0, Counts::default(), Stack::new());
    for ray in &rays {
        let middle = wide(ray.direction, 1.0 / f64::from(ray.direction.length()));
        // How far the surface is at most around here; nothing where it is not all around.
        let reach = (0..27).try_fold(0.0, |farthest: f64, i| {
            let aside = [i % 3, i / 3 % 3, i / 9].map(|step| f64::from(step - 1) * spread);
            exact.distance([0, 1, 2].map(|axis| middle[axis] + aside[axis])).map(|d| farthest.max(d))
        });
        let Some(reach) = reach else { continue };
        inside += 1;
        for kernels in Kernels::available() {
            let hit = nearest(kernels, &pages.resident(), ray, &mut stack, &mut counts).candidate;
            let distance = f64::from(hit.t) * f64::from(ray.direction.length()) / f64::from(unit);
            assert!(hit.is_hit() && distance < reach * 1.001, "{what}: a hole at {ray:?}: {distance} for {reach}");
        }
    }
    println!("{what}: {inside} of {} rays inside", rays.len());
    assert!(inside * 10 > rays.len(), "{what}: only {inside} of {} rays inside", rays.len());
}

/// A ball of triangles around the origin, of radius 1.
fn ball(rings: u32, segments: u32) -> Model {
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * core::f64::consts::PI;
    let mut positions = vec![[0.0, 1.0, 0.0]];
    for ring in 1..rings {
        let (sine, cosine) = turn(ring, rings).sin_cos();
        positions.extend((0..segments).map(|segment| {
            let (x, z) = turn(2 * segment, segments).sin_cos();
            [sine * x, cosine, sine * z].map(|c| c as f32)
        }));
    }
    positions.push([0.0, -1.0, 0.0]);
    let last = positions.len() as u32 - 1;
    let at = |ring: u32, segment: u32| match ring {
        0 => 0,
        ring if ring == rings => last,
        _ => 1 + (ring - 1) * segments + segment % segments,
    };
    let quads = (0..rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment)));
    let triangles = quads
        .flat_map(|(r, s)| [[at(r, s), at(r + 1, s), at(r + 1, s + 1)], [at(r, s), at(r + 1, s + 1), at(r, s + 1)]])
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    Model {
        meshes: vec![Mesh { positions, triangles, ..Mesh::default() }],
        materials: vec![NamedMaterial::default()],
        cameras: vec![CameraSpec {
            name: "ball".to_owned(),
            eye: [1.0, 1.5, 3.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            fov_y_degrees: 40.0,
            hither: 0.0,
            size: None,
            ..CameraSpec::default()
        }],
        ..Model::default()
    }
}

#[test]
fn closed_meshes_have_no_holes_anywhere() {
    // At 16,384 sizes from the origin a coordinate has nine bits left for the mesh: vertices fall together.
    for distance in [0.0, 3.0, 1000.0, 16_384.0] {
        let by = Vec3::new(1.0, -0.7, 0.3) * distance;
        check_closed(&format!("ball at {by}"), shifted(ball(24, 40), by));
        check_closed(&format!("organic at {by}"), shifted(scene("organic:1000"), by));
    }
}

/// From within, every ray hits, whichever way it goes.
#[test]
fn a_closed_mesh_is_closed_from_within() {
    for distance in [0.0, 1000.0] {
        let by = Vec3::new(-1.0, 0.6, 0.9) * distance;
        let model = shifted(ball(24, 40), by);
        let prepared = Prepared::new(model.clone(), &build::Settings::default()).unwrap();
        let pages = prepared.packed.open().unwrap();
        let unit = 2f32.powi(prepared.packed.scale_log2);
        let (mut counts, mut stack) = (Counts::default(), Stack::new());
        let eye = (by + Vec3::new(0.25, 0.125, -0.25)) * unit;
        let mut directions: Vec<Vec3> = model.meshes[0].positions.iter().map(|&p| Vec3::from(p) * unit - eye).collect();
        for target in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let up = if target.y == 0.0 { Vec3::Y } else { Vec3::X };
            let camera = Camera::look(Vec3::ZERO, target, up, 90.0, 0.0, 64, 64).unwrap();
            directions.extend((0..64 * 64).map(|i| camera.ray(i % 64, i / 64, [0.5, 0.5]).direction));
        }
        for direction in directions {
            let ray = Ray { origin: eye, direction, t_min: 0.0, t_max: f32::INFINITY };
            for kernels in Kernels::available() {
                let hit = nearest(kernels, &pages.resident(), &ray, &mut stack, &mut counts);
                assert!(hit.candidate.is_hit(), "at {by}: a hole at {ray:?}");
            }
        }
    }
}
