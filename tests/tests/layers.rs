//! Layers against spheres and a floor that are hit by hand, in double precision.

use hybray::build;
use hybray::model::{CameraSpec, Mesh, Model, NamedMaterial, Settings as Wanted, Sphere};
use hybray::prepare::Prepared;
use hybray_native::{DispatcherAt, Farm, Traced, trace};
use hybray_scheduler::Options;
use hybray_shading::Material;
use hybray_tests::kernels;
use hybray_tracer::Layer;
use hybray_wire::Frame;

const SIZE: [u32; 2] = [96, 64];
/// Centre, radius, material.
const SPHERES: [([f32; 3], f32, u16); 4] =
    [([0.0, 1.0, 0.0], 1.0, 1), ([1.5, 0.5, 1.0], 0.5, 2), ([-1.7, 0.7, -0.5], 0.7, 3), ([0.3, 0.3, 2.2], 0.3, 1)];
const EYE: [f32; 3] = [0.5, 2.0, 6.0];
const TARGET: [f32; 3] = [0.0, 0.8, 0.0];
const FOV: f32 = 40.0;
/// Half the floor's side; it is at y = 0, of material 0.
const FLOOR: f32 = 4.0;

fn materials() -> [Material; 4] {
    let none = Material { diffuse: [0.0; 3], ..Material::MATT };
    [
        Material { diffuse: [0.5, 0.4, 0.3], ..none },
        Material { diffuse: [0.25; 3], mirror: [0.5, 0.25, 0.0], ..none },
        Material { transmission: [0.75; 3], mirror: [0.5; 3], ior: 1.5, ..none },
        Material { diffuse: [0.1, 0.2, 0.3], ..none },
    ]
}

fn model() -> Model {
    let corner = |x, z| [x * FLOOR, 0.0, z * FLOOR];
    let floor = Mesh {
        positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    Model {
        meshes: vec![floor],
        spheres: SPHERES.iter().map(|&(centre, radius, material)| Sphere { centre, radius, material }).collect(),
        materials: materials()
            .map(|material| NamedMaterial { name: String::new(), material, ..NamedMaterial::default() })
            .to_vec(),
        cameras: vec![CameraSpec {
            name: "one".into(),
            eye: EYE,
            target: TARGET,
            up: [0.0, 1.0, 0.0],
            fov_y_degrees: FOV,
            size: Some(SIZE),
            ..CameraSpec::default()
        }],
        ..Model::default()
    }
}

type V = [f64; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn scaled(a: V, f: f64) -> V {
    a.map(|x| x * f)
}
fn sum(a: V, b: V) -> V {
    [0, 1, 2].map(|i| a[i] + b[i])
}
fn unit(a: V) -> V {
    scaled(a, 1.0 / dot(a, a).sqrt())
}

/// Distance, normal towards the eye and material of what the ray through the middle of a pixel hits.
fn seen(x: u32, y: u32) -> Option<(f64, V, u16)> {
    let eye = EYE.map(f64::from);
    let forward = unit(sum(TARGET.map(f64::from), scaled(eye, -1.0)));
    let right = unit(cross(forward, [0.0, 1.0, 0.0]));
    let up = cross(right, forward);
    let slope = 2.0 * (f64::from(FOV).to_radians() / 2.0).tan() / f64::from(SIZE[1]);
    let [across, down] =
        [(x, SIZE[0]), (y, SIZE[1])].map(|(p, side)| (f64::from(p) + 0.5 - f64::from(side) / 2.0) * slope);
    let direction = unit(sum(forward, sum(scaled(right, across), scaled(up, -down))));
    let mut best: Option<(f64, V, u16)> = None;
    let mut take = |t: f64, normal: V, material| {
        if t > 0.0 && best.is_none_or(|(least, ..)| t < least) {
            let towards = if dot(normal, direction) > 0.0 { -1.0 } else { 1.0 };
            best = Some((t, scaled(normal, towards), material));
        }
    };
    for (centre, radius, material) in SPHERES {
        let (centre, radius) = (centre.map(f64::from), f64::from(radius));
        let to = sum(centre, scaled(eye, -1.0));
        let (b, c) = (dot(to, direction), dot(to, to) - radius * radius);
        if b * b > c {
            let t = b - (b * b - c).sqrt();
            let point = sum(eye, scaled(direction, t));
            take(t, unit(sum(point, scaled(centre, -1.0))), material);
        }
    }
    let t = -eye[1] / direction[1];
    let point = sum(eye, scaled(direction, t));
    if point[0].abs() < f64::from(FLOOR) && point[2].abs() < f64::from(FLOOR) {
        take(t, [0.0, 1.0, 0.0], 0);
    }
    best
}

fn drawn(prepared: &Prepared, frame: &Frame) -> Traced {
    let pages = prepared.packed.open().expect("pages");
    let farm = Farm {
        nodes: 2,
        kernels: kernels(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
    trace(&prepared.scene(&pages), prepared.hash, frame, &farm, &mut |_| true).expect("a picture")
}

#[test]
fn layers_show_what_rays_hit() {
    let prepared = Prepared::new(model(), &build::Settings::default()).expect("a scene");
    let wanted = Wanted { spp: Some(1), ..Wanted::default() };
    let light = prepared.frame(&prepared.cameras[0], &wanted);
    let layer = |layer: Layer| drawn(&prepared, &Frame { layer: layer as u8, ..light });
    let [albedo, normal, depth, id] = [Layer::Albedo, Layer::Normal, Layer::Depth, Layer::Id].map(layer);
    let unit = f64::from(prepared.unit());
    let (mut edges, mut kinds, mut nothing) = (0, [0; 4], 0);
    for (pixel, (x, y)) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).enumerate() {
        let what = || format!("column {x}, row {y}");
        let number = id.radiance[pixel][0];
        let expected = seen(x, y);
        if number != expected.map_or(0.0, |(.., material)| f32::from(material) + 1.0) {
            // Where the ray grazes something, rounding decides.
            edges += 1;
            continue;
        }
        let Some((t, n, material)) = expected else {
            nothing += 1;
            assert_eq!((albedo.radiance[pixel], normal.radiance[pixel]), ([0.0; 3], [0.5; 3]), "{}", what());
            assert_eq!(depth.radiance[pixel], [0.0; 3], "{}", what());
            continue;
        };
        kinds[usize::from(material)] += 1;
        let m = materials()[usize::from(material)];
        for c in 0..3 {
            let share = (m.diffuse[c] + m.mirror[c] + m.transmission[c]).min(1.0);
            assert!((albedo.radiance[pixel][c] - share).abs() < 1e-6, "{}", what());
            let found = f64::from(2.0 * normal.radiance[pixel][c] - 1.0);
            // Near the rim of a ball the hit point moves fast.
            assert!((found - n[c]).abs() < 1e-3, "{} {found} {n:?}", what());
        }
        assert_eq!(depth.radiance[pixel][1], 1.0, "{}", what());
        let found = f64::from(depth.radiance[pixel][0]) * unit;
        assert!((found - t).abs() < 1e-3 * t, "{} {found} {t}", what());
    }
    assert!(edges < 6 && nothing > 100 && kinds.iter().all(|&pixels| pixels > 50), "{edges} {nothing} {kinds:?}");
    // Rays that cause no others.
    let counts = |traced: &Traced| {
        traced.nodes.iter().fold((0, 0, 0), |(a, b, c), node| {
            let n = node.counts;
            (a + n.primary, b + n.secondary + n.shadow, c + n.hits)
        })
    };
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    for traced in [&albedo, &normal, &depth, &id] {
        assert_eq!(counts(traced), (pixels, 0, counts(&id).2));
    }
}

/// Even and odd samples are all samples, to the bit; and either half alone is nothing.
#[test]
fn halves_are_the_whole() {
    let prepared = Prepared::new(hybray_tests::scene("cornell:mirror"), &build::Settings::default()).expect("a scene");
    for samples in [2, 3, 8] {
        let wanted = Wanted { size: Some([40, 24]), spp: Some(samples), depth: Some(3), ..Wanted::default() };
        let frame = prepared.frame(&prepared.cameras[0], &wanted);
        let [whole, even, odd] = [0, 1, 2].map(|half| drawn(&prepared, &Frame { half, ..frame }));
        let counts = |traced: &Traced| {
            let mut counts = hybray_wire::Counts::default();
            traced.nodes.iter().for_each(|node| counts += node.counts);
            counts
        };
        let mut both = counts(&even);
        both += counts(&odd);
        assert_eq!(both, counts(&whole), "{samples}");
        let [a, b] = [1, 2].map(|half| f32::from(Frame { half, ..frame }.drawn_samples()));
        let pixels = whole.radiance.iter().zip(even.radiance.iter().zip(&odd.radiance));
        for (all, (even, odd)) in pixels {
            for c in 0..3 {
                let mean = (even[c] * a + odd[c] * b) / (a + b);
                assert!((mean - all[c]).abs() <= 1e-5 * all[c].max(1.0), "{samples} samples: {all:?}");
            }
        }
        assert!(even.film != odd.film && even.film != whole.film);
    }
    let wanted = Wanted { size: Some([8, 8]), spp: Some(1), ..Wanted::default() };
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    assert!(hybray_scheduler::can_draw(&Frame { half: 1, ..frame }));
    for bad in [Frame { half: 2, ..frame }, Frame { half: 3, ..frame }, Frame { layer: 5, ..frame }] {
        assert!(!hybray_scheduler::can_draw(&bad), "{bad:?}");
    }
}
