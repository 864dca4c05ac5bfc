//! `cornell`: the Cornell box as measured, in millimetres, with its two blocks or with two spheres.
//!
//! Source: *Cornell Box Data*, Cornell University Program of Computer Graphics (camera, geometry). The spectra measured
//! there stand here as linear sRGB triples that are in common use for them. Light that bounces between the walls is not
//! traced; a little ambient light stands in for it, and lights the ceiling, which would be black.

use super::vector::{cross, length};
use crate::model::{CameraSpec, Mesh, Model, Objects, Settings, Sphere};
use core::f32::consts::PI;
use hybray_shading::{Light, LightKind, Material};

type P = [f32; 3];

const WHITE: P = [0.725, 0.71, 0.68];
const RED: P = [0.63, 0.065, 0.05];
const GREEN: P = [0.14, 0.45, 0.091];

const CEILING: f32 = 548.8;
/// The lamp, an opening in the ceiling: least and greatest x and z.
const LAMP_X: [f32; 2] = [213.0, 343.0];
const LAMP_Z: [f32; 2] = [227.0, 332.0];
/// The lamp's colour against its strongest channel (of the measured emission).
const LAMP_TINT: P = [1.0, 0.76, 0.37];
/// What a white matt surface on the floor right below the lamp shows in the strongest channel. With it the middle
/// of the tall block's top, the brightest white in the picture, comes out at about 1.
const EXPOSURE: f32 = 0.35;
/// How far below the lit panel the light's rectangle lies. In the panel's own plane, a shadow ray's end would lie on
/// the panel, and rounding would decide whether the panel shadows its own light.
const CLEARANCE: f32 = 0.5;

/// The box with its two white blocks.
pub fn blocks() -> Model {
    let mut model = room();
    let white = model.add_material("white", matt(WHITE));
    // Corners of the tops, counterclockwise seen from above.
    let short = [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]];
    let tall = [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]];
    for (name, footprint, height) in [("short-block", short, 165.0), ("tall-block", tall, 330.0)] {
        model.meshes.push(Mesh { name: name.to_owned(), material: white, ..block(footprint, height) });
        model.objects.polygons += 5;
    }
    model
}

/// The box with a mirroring and a glass sphere in the blocks' places.
pub fn spheres() -> Model {
    let mut model = room();
    let mirror = Material { diffuse: [0.0; 3], mirror: [0.95; 3], ..Material::MATT };
    let glass =
        Material { diffuse: [0.0; 3], transmission: [1.0; 3], ior: 1.5, flags: Material::FRESNEL, ..Material::MATT };
    for (name, material, centre) in [("mirror", mirror, [390.0, 100.0, 370.0]), ("glass", glass, [175.0, 100.0, 190.0])]
    {
        let material = model.add_material(name, material);
        model.spheres.push(Sphere { centre, radius: 100.0, material });
    }
    model.objects.spheres = 2;
    model
}

/// Walls, lamp and camera.
fn room() -> Model {
    let mut model = Model {
        lights: vec![lamp()],
        cameras: vec![CameraSpec {
            name: "cornell".to_owned(),
            eye: [278.0, 273.0, -800.0],
            target: [278.0, 273.0, 0.0],
            up: [0.0, 1.0, 0.0],
            // 2 atan(12.5 / 35): a focal length of 35 mm and a picture of 25 mm.
            fov_y_degrees: 39.307_65,
            hither: 0.0,
            size: Some([512, 512]),
            ..CameraSpec::default()
        }],
        ambient: [0.10, 0.085, 0.06],
        // A ray goes into the glass, out of it, to the mirror and on.
        settings: Settings { depth: Some(8), ..Settings::default() },
        objects: Objects { polygons: 6, ..Objects::default() },
        ..Model::default()
    };
    let floor = quad([[552.8, 0.0, 0.0], [0.0; 3], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]);
    let back = [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, CEILING, 559.2], [556.0, CEILING, 559.2]];
    let right = [[0.0, 0.0, 559.2], [0.0; 3], [0.0, CEILING, 0.0], [0.0, CEILING, 559.2]];
    let left = [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, CEILING, 559.2], [556.0, CEILING, 0.0]];
    let [x0, x1] = LAMP_X;
    let [z0, z1] = LAMP_Z;
    let panel = [[x1, CEILING, z0], [x1, CEILING, z1], [x0, CEILING, z1], [x0, CEILING, z0]];
    let lit = Material { diffuse: [0.0; 3], emission: radiance(), ..Material::MATT };
    for (name, mesh, material) in [
        ("floor", floor, matt(WHITE)),
        ("ceiling", ceiling(panel), matt(WHITE)),
        ("back-wall", quad(back), matt(WHITE)),
        ("right-wall", quad(right), matt(GREEN)),
        ("left-wall", quad(left), matt(RED)),
        ("lamp", quad(panel), lit),
    ] {
        let colour = match name {
            "right-wall" => "green",
            "left-wall" => "red",
            "lamp" => "lamp",
            _ => "white",
        };
        let material = model.add_material(colour, material);
        model.meshes.push(Mesh { name: name.to_owned(), material, ..mesh });
    }
    model
}

/// Matt, and in the ambient light of the same colour.
fn matt(colour: P) -> Material {
    Material { diffuse: colour, ambient: colour, ..Material::MATT }
}

/// Distance from the light to the floor.
const DROP: f32 = CEILING - CLEARANCE;

fn lamp() -> Light {
    Light {
        position: [LAMP_X[0], DROP, LAMP_Z[0]],
        u: [LAMP_X[1] - LAMP_X[0], 0.0, 0.0],
        v: [0.0, 0.0, LAMP_Z[1] - LAMP_Z[0]],
        axis: [0.0, -1.0, 0.0],
        kind: LightKind::Rectangle as u32,
        // At distance 1, as lights that fall off state it.
        colour: LAMP_TINT.map(|c| c * EXPOSURE * DROP * DROP),
        samples: 16,
        flags: Light::FALLOFF,
        ..Light::default()
    }
}

/// What the panel shows, so that it is the source of the light's light: a small panel of radiance L and area A gives,
/// at distance d before it, the irradiance L A / d^2, and the light's colour is irradiance over pi at distance 1.
fn radiance() -> P {
    let light = lamp();
    let area = length(cross(light.u.map(f64::from), light.v.map(f64::from))) as f32;
    light.colour.map(|c| c * PI / area)
}

fn quad(corners: [P; 4]) -> Mesh {
    Mesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() }
}

/// The ceiling around the opening for the lamp, four quadrilaterals without vertices on edges.
fn ceiling(opening: [P; 4]) -> Mesh {
    let outer = [[556.0, CEILING, 0.0], [556.0, CEILING, 559.2], [0.0, CEILING, 559.2], [0.0, CEILING, 0.0]];
    let sides = (0..4).flat_map(|i| {
        let next = (i + 1) % 4;
        [[i, next, next + 4], [i, next + 4, i + 4]]
    });
    let triangles = sides.collect();
    Mesh { positions: [outer, opening].concat(), triangles, ..Mesh::default() }
}

/// A block without a bottom, which would lie in the floor.
fn block(footprint: [[f32; 2]; 4], height: f32) -> Mesh {
    let corners = |y: f32| footprint.map(|[x, z]| [x, y, z]);
    let mut triangles = vec![[0, 1, 2], [0, 2, 3]];
    for i in 0..4 {
        let next = (i + 1) % 4;
        triangles.extend([[next, i, i + 4], [next, i + 4, next + 4]]);
    }
    Mesh { positions: [corners(height), corners(0.0)].concat(), triangles, ..Mesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;
    use crate::builtin::vector::{V, dot, scale, sub, unit};

    #[test]
    fn both_are_sound_and_seen() {
        for model in [blocks(), spheres()] {
            checks::sound(&model);
            // Walls, ceiling and floor reach a little beyond the published view's edge at the front.
            assert!(checks::share_in_view(&model) > 0.4);
        }
        // Published: floor, lamp, ceiling, three walls, two blocks of five faces.
        assert_eq!(blocks().objects.polygons, 16);
        assert_eq!(blocks().primitives(), 5 * 2 + 8 + 2 * 10);
        assert_eq!((spheres().objects.polygons, spheres().objects.spheres), (6, 2));
    }

    /// Every wall faces the middle of the room; every face of a block faces away from the block's middle.
    #[test]
    fn faces_the_right_way() {
        let model = blocks();
        for (i, mesh) in model.meshes.iter().enumerate() {
            let count = mesh.positions.len() as f64;
            let sum = mesh.positions.iter().fold([0.0; 3], |s, p| [0, 1, 2].map(|k| s[k] + f64::from(p[k])));
            let middle = if i < 6 { [278.0, 274.0, 280.0] } else { scale(sum, 1.0 / count) };
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
                let inward = dot(cross(sub(b, a), sub(c, a)), sub(middle, a)) > 0.0;
                assert_eq!(inward, i < 6, "{} {t:?}", mesh.name);
            }
        }
        assert_eq!(checks::open_edges(&model.meshes[6]), 4);
        // The ceiling's rim of four edges and the opening's four.
        assert_eq!(checks::open_edges(&model.meshes[1]), 8);
    }

    /// The view angle from the camera's published focal length and picture size.
    #[test]
    fn view_angle() {
        let degrees = 2.0 * libm::atan(0.0125 / 0.035) * 180.0 / core::f64::consts::PI;
        assert!((f64::from(room().cameras[0].fov_y_degrees) - degrees).abs() < 1e-5);
    }

    /// What a surface of reflectance 1 shows, by adding up the panel's radiance over small pieces.
    fn shown(at: V, normal: V) -> f64 {
        let light = lamp();
        let [corner, u, v] = [light.position, light.u, light.v].map(|p| p.map(f64::from));
        let radiance = f64::from(radiance()[0]);
        let (n, mut sum) = (50, 0.0);
        for i in 0..n {
            for j in 0..n {
                let [s, t] = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n));
                let point = [0, 1, 2].map(|k| corner[k] + s * u[k] + t * v[k]);
                let way = sub(point, at);
                let d = unit(way);
                let area = length(cross(u, v)) / f64::from(n * n);
                sum += radiance * dot(d, normal).max(0.0) * d[1].max(0.0) * area / dot(way, way);
            }
        }
        sum / core::f64::consts::PI
    }

    #[test]
    fn well_exposed() {
        let up = [0.0, 1.0, 0.0];
        let floor = shown([278.0, 0.0, 279.5], up);
        assert!((floor / f64::from(EXPOSURE) - 1.0).abs() < 0.05, "{floor}");
        // The middle of the tall block's top, and the wall beside the lamp.
        let block = shown([368.5, 330.0, 351.3], up) * f64::from(WHITE[0]);
        assert!((0.9..1.1).contains(&block), "{block}");
        let wall = shown([0.0, 400.0, 279.5], [1.0, 0.0, 0.0]);
        assert!((0.1..1.0).contains(&wall), "{wall}");
    }

    /// No way from anywhere below to the light meets the panel, and the light shines down.
    #[test]
    fn light_hangs_free_of_the_panel() {
        let light = lamp();
        let model = room();
        let panel = model.meshes.iter().find(|m| m.name == "lamp").expect("a lamp");
        assert!(panel.positions.iter().all(|p| p[1] > light.position[1]));
        let shines = cross(light.u.map(f64::from), light.v.map(f64::from));
        assert!(shines[1] < 0.0 && shines[0] == 0.0 && shines[2] == 0.0);
    }
}
