//! `gallery`: everything that textures, colours and glossy materials do, in one room.
//!
//! A tiled floor with normals and roughness of its own, a cloth of holes (cut-out), a pane that is half there, a block of green glass,
//! balls of rough metal, a sheet whose corners have colours, seen from behind nothing, a lamp that is seen, and a sky with a sun
//! around it all. The size is the
//! side of the floor's pictures, texels.

use super::noise;
use crate::import::Surroundings;
use crate::model::{CameraSpec, Mesh, Model, Settings};
use crate::texture::{Image, Texture};
use hybray_shading::{Format, Light, LightKind, Map, Maps, Material, Sampling, Wrap, to_shared_exponent};
use std::sync::Arc;

const IDENTITY: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

const fn physical(base: [f32; 3], metal: f32, rough: f32) -> Material {
    let flags = Material::PHYSICAL;
    Material { diffuse: base, mirror: [metal; 3], exponent: rough, ior: 1.5, flags, ..Material::MATT }
}

/// A rectangle of two triangles: a corner and two sides. The picture's first texel is at the end of the second side.
fn rectangle(name: &str, corner: [f32; 3], u: [f32; 3], v: [f32; 3], material: u16) -> Mesh {
    let at = |s: f32, t: f32| [0, 1, 2].map(|i| corner[i] + s * u[i] + t * v[i]);
    Mesh {
        name: name.to_owned(),
        positions: vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
        coordinates: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Mesh::default()
    }
}

/// A ball of triangles with normals, coordinates around it and from pole to pole.
fn ball(name: &str, centre: [f32; 3], radius: f32, material: u16) -> Mesh {
    const ACROSS: u32 = 48;
    const DOWN: u32 = 24;
    let mut mesh = Mesh { name: name.to_owned(), material, ..Mesh::default() };
    for row in 0..=DOWN {
        for column in 0..=ACROSS {
            let (u, v) = (column as f32 / ACROSS as f32, row as f32 / DOWN as f32);
            let (sin, cos) = libm::sincosf(core::f32::consts::TAU * u);
            let (down, up) = libm::sincosf(core::f32::consts::PI * v);
            let normal = [down * cos, up, -down * sin];
            mesh.positions.push([0, 1, 2].map(|i| centre[i] + radius * normal[i]));
            mesh.normals.push(normal);
            mesh.coordinates.push([u, v]);
        }
    }
    for row in 0..DOWN {
        for column in 0..ACROSS {
            let a = row * (ACROSS + 1) + column;
            let b = a + ACROSS + 1;
            if row > 0 {
                mesh.triangles.push([a, b, a + 1]);
            }
            if row + 1 < DOWN {
                mesh.triangles.push([a + 1, b, b + 1]);
            }
        }
    }
    mesh
}

/// A closed box, seen from outside.
fn block(name: &str, lo: [f32; 3], hi: [f32; 3], material: u16) -> Mesh {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] });
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        name: name.to_owned(),
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        material,
        ..Mesh::default()
    }
}

struct Painter {
    model: Model,
}

impl Painter {
    /// A use of a picture.
    fn picture(&mut self, image: Image, format: Format, wrap: Wrap, transform: [f32; 6], strength: f32) -> u16 {
        self.sampled(image, format, wrap, transform, strength, Sampling::Trilinear)
    }

    fn sampled(
        &mut self,
        image: Image,
        format: Format,
        wrap: Wrap,
        transform: [f32; 6],
        strength: f32,
        sampling: Sampling,
    ) -> u16 {
        let name = format!("picture {}", self.model.textures.len());
        let texture =
            self.model.add_texture(Texture { name, image: Arc::new(image), format, wrap: [wrap; 2], sampling });
        self.model.add_use(Map { texture, transform, strength })
    }

    fn material(&mut self, name: &str, material: Material, maps: Maps) -> u16 {
        let detail = if maps == Maps::EMPTY { 0 } else { Material::DETAIL };
        self.model.add_mapped_material(name, Material { flags: material.flags | detail, ..material }, maps)
    }
}

/// The room, with floor pictures of `side` texels.
pub fn gallery(side: u32) -> Model {
    let mut painter = Painter { model: Model::default() };
    let side = side as u16;
    let at = |x: usize, n: f64| (x as f64 + 0.5) / f64::from(side) * n;
    let step = |v: f64| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    // Tiles: dark and light, with a joint between; each a little different.
    let joint = |x: f64, y: f64| {
        let near = |v: f64| (v - libm::floor(v) - 0.5).abs();
        near(x) > 0.47 || near(y) > 0.47
    };
    let floor = Image::from_fn(side, side, |x, y| {
        let (u, v) = (at(x, 8.0), at(y, 8.0));
        if joint(u, v) {
            return [60, 55, 50, 255];
        }
        let dark = (u as u32 + v as u32).is_multiple_of(2);
        let grain = 0.5 + 0.5 * noise::value(6.0 * u, 40.0 * v, 3);
        let shade = if dark { 0.25 + 0.2 * grain } else { 0.6 + 0.25 * grain };
        [step(shade), step(0.8 * shade), step(0.6 * shade), 255]
    });
    let slopes = Image::from_fn(side, side, |x, y| {
        let (u, v) = (at(x, 8.0), at(y, 8.0));
        if joint(u, v) {
            [128, 128, 200, 255]
        } else {
            let tilt = |o| 128.0 + 12.0 * noise::value(10.0 * u, 10.0 * v, o);
            [tilt(5) as u8, tilt(6) as u8, 254, 255]
        }
    });
    let surface = Image::from_fn(side, side, |x, y| {
        let (u, v) = (at(x, 8.0), at(y, 8.0));
        let rough = if joint(u, v) { 1.0 } else { 0.15 + 0.3 * (0.5 + 0.5 * noise::value(2.0 * u, 2.0 * v, 9)) };
        [0, step(rough), 0, 255]
    });
    let mut maps = Maps::EMPTY;
    maps.maps[Maps::BASE] = painter.picture(floor, Format::Srgb, Wrap::Repeat, IDENTITY, 1.0);
    maps.maps[Maps::NORMAL] = painter.picture(slopes, Format::Linear, Wrap::Mirror, IDENTITY, 1.0);
    maps.maps[Maps::SURFACE] = painter.picture(surface, Format::Linear, Wrap::Clamp, IDENTITY, 1.0);
    let single = Material { flags: Material::PHYSICAL | Material::SINGLE_SIDED, ..physical([1.0; 3], 0.0, 1.0) };
    let tiles = painter.material("tiles", single, maps);

    // Holes, by a picture that is repeated turned.
    let holes = Image::from_fn(64, 64, |x, y| {
        let far = |v: usize| (v as f64 - 31.5) * (v as f64 - 31.5);
        [200, (40 + 2 * x) as u8, (40 + y) as u8, if far(x) + far(y) < 450.0 { 0 } else { 255 }]
    });
    let mut maps = Maps::EMPTY;
    maps.maps[Maps::BASE] = painter.picture(holes, Format::Srgb, Wrap::Repeat, [4.0, 2.0, 0.25, -2.0, 4.0, 0.0], 1.0);
    let cut = Material { flags: Material::PHYSICAL | Material::CUTOUT, ..physical([1.0; 3], 0.0, 0.8) };
    let cloth = painter.material("cloth", cut, maps);

    // A pane: how much of it is there rises from below, in steps that are seen.
    let fade = Image::from_fn(4, 8, |x, y| [40, 60 + 40 * x as u8, 220, 30 * (7 - y as u8)]);
    let mut maps = Maps::EMPTY;
    maps.maps[Maps::BASE] = painter.sampled(fade, Format::Srgb, Wrap::Clamp, IDENTITY, 1.0, Sampling::Nearest);
    let blend = Material { flags: Material::PHYSICAL | Material::BLEND, ..physical([1.0; 3], 0.0, 0.2) };
    let pane = painter.material("pane", blend, maps);

    // Heights of a hammered plate, as slopes.
    let height = |x: usize, y: usize| noise::value(x as f64 / 9.0, y as f64 / 9.0, 11);
    let hammered = Image::from_fn(128, 128, |x, y| {
        let slope = |a: f64, b: f64| (128.0 + (a - b) * 60.0).clamp(0.0, 255.0) as u8;
        [slope(height(x + 1, y), height(x, y)), slope(height(x, y + 1), height(x, y)), 0, 255]
    });
    let mut maps = Maps::EMPTY;
    maps.maps[Maps::NORMAL] = painter.picture(hammered, Format::Linear, Wrap::Repeat, IDENTITY, 0.05);
    let bumped = Material { flags: Material::PHYSICAL | Material::BUMP, ..physical([0.9, 0.6, 0.3], 1.0, 0.25) };
    let copper = painter.material("copper", bumped, maps);
    let steel = painter.material("steel", physical([0.7, 0.7, 0.75], 1.0, 0.08), Maps::EMPTY);

    let glow = Image::from_fn(2, 2, |x, y| if (x + y) % 2 == 0 { [255, 200, 120, 255] } else { [60, 20, 5, 255] });
    let mut maps = Maps::EMPTY;
    maps.maps[Maps::EMISSION] =
        painter.sampled(glow, Format::Srgb, Wrap::Mirror, [3.0, 0.0, 0.0, 0.0, 3.0, 0.0], 1.0, Sampling::Bilinear);
    let lamp = painter.material("lamp", Material { emission: [2.0; 3], ..physical([0.1; 3], 0.0, 1.0) }, maps);
    let glass = Material { transmission: [1.0; 3], ambient: [1.5, 0.15, 0.9], ..physical([1.0; 3], 0.0, 0.0) };
    let glass = painter.material("glass", glass, Maps::EMPTY);
    let coloured = Material { flags: Material::PHYSICAL | Material::DETAIL, ..physical([1.0; 3], 0.0, 0.6) };
    let sheet = painter.material("sheet", coloured, Maps::EMPTY);

    let mut model = painter.model;
    model.meshes = vec![
        rectangle("floor", [-4.0, 0.0, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], tiles),
        rectangle("cloth", [-3.2, 0.0, -1.0], [2.4, 0.0, -0.8], [0.0, 2.4, 0.3], cloth),
        rectangle("pane", [0.3, 0.0, 1.2], [1.5, 0.0, 0.3], [0.0, 1.4, 0.0], pane),
        ball("copper", [-1.2, 0.8, 0.6], 0.8, copper),
        ball("steel", [1.1, 0.7, -0.6], 0.7, steel),
        block("glass", [2.0, 0.0, -0.2], [2.7, 1.3, 0.5], glass),
        rectangle("lamp", [-0.6, 2.2, -2.5], [1.2, 0.0, 0.0], [0.0, 0.5, 0.0], lamp),
        Mesh {
            colours: vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 0, 255]],
            coordinates: Vec::new(),
            ..rectangle("sheet", [1.2, 0.0, -3.0], [2.0, 0.0, 0.6], [0.0, 2.0, 0.0], sheet)
        },
        // Seen from behind: not at all.
        rectangle("behind", [-4.0, 0.0, 3.0], [8.0, 0.0, 0.0], [0.0, 4.0, 0.0], tiles),
    ];
    model.meshes[8].triangles = vec![[0, 2, 1], [0, 3, 2]];
    model.objects.polygons = model.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum();
    let lux = |colour: f32| [colour; 3];
    model.lights = vec![
        Light { position: [-3.0, 5.0, 4.0], colour: lux(60.0), flags: Light::FALLOFF, ..Light::default() },
        Light {
            position: [1.0, 4.0, 1.0],
            u: [0.0, 0.0, 1.0],
            v: [1.0, 0.0, 0.0],
            kind: LightKind::Rectangle as u32,
            colour: lux(20.0),
            samples: 2,
            flags: Light::FALLOFF,
            ..Light::default()
        },
    ];
    // A sky that is lighter towards the horizon, with a sun behind the visitor's left shoulder, and a dull ground.
    let sky = Image::from_fn(128, 64, |x, y| {
        let (turn, down) = ((x as f64 + 0.5) / 128.0, (y as f64 + 0.5) / 64.0);
        let sun = (turn - 0.62).abs() < 0.01 && (down - 0.25).abs() < 0.02;
        let haze = 0.5 + down as f32;
        to_shared_exponent(match (sun, down < 0.5) {
            (true, _) => [400.0, 360.0, 280.0],
            (_, true) => [0.25 * haze, 0.3 * haze, 0.4],
            _ => [0.12, 0.11, 0.1],
        })
        .to_le_bytes()
    });
    let surroundings = Surroundings { samples: 3, cells: 96, rotation_degrees: 20.0, ..Surroundings::default() };
    surroundings.give_picture(&mut model, "sky".to_owned(), sky, Format::SharedExponent);
    model.ambient = [0.08; 3];
    model.cameras.push(CameraSpec {
        name: "visitor".to_owned(),
        eye: [0.4, 2.1, 6.0],
        target: [0.0, 0.8, 0.0],
        up: [0.0, 1.0, 0.0],
        fov_y_degrees: 40.0,
        size: Some([640, 480]),
        ..CameraSpec::default()
    });
    model.settings = Settings { spp: Some(16), ..Settings::default() };
    model
}
