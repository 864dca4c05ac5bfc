//! A small scene: primitives, tables, and the tree over them.
#![allow(dead_code)]

use hybray_bintree::cut::{self, Cut, Primitives};
use hybray_bintree::walk::Resident;
use hybray_bintree::{BinaryNode, Forest, Item, sah, top};
use hybray_geometry::{Cone, Sphere, Triangle, Vec3};
use hybray_scene::{Directory, Header, Kind, Node, PageEntry, PageView, Tables};
use hybray_shading::{self as shading, Light, Material, spawn};
use hybray_tracer::{Layer, Scene};

#[derive(Clone, Copy, Debug)]
pub enum Shape {
    Triangle(Triangle),
    Sphere(Sphere),
    Cone(Cone),
}

/// Primitives with their materials, and the tables.
pub struct World {
    shapes: Vec<(Shape, u16)>,
    materials: Vec<Material>,
    lights: Vec<Light>,
}

impl Primitives for World {
    fn triangle(&self, id: u32) -> Triangle {
        let Shape::Triangle(t) = self.shapes[id as usize].0 else { panic!("{id} is no triangle") };
        t
    }
    fn sphere(&self, id: u32) -> Sphere {
        let Shape::Sphere(s) = self.shapes[id as usize].0 else { panic!("{id} is no sphere") };
        s
    }
    fn cone(&self, id: u32) -> Cone {
        let Shape::Cone(c) = self.shapes[id as usize].0 else { panic!("{id} is no cone") };
        c
    }
    fn material(&self, id: u32) -> u16 {
        self.shapes[id as usize].1
    }
    fn normals(&self, _: u32) -> Option<[u32; 3]> {
        None
    }
}

impl World {
    pub fn new(shapes: Vec<(Shape, u16)>, materials: Vec<Material>, lights: Vec<Light>) -> Self {
        Self { shapes, materials, lights }
    }

    fn items(&self) -> Vec<Item> {
        let item = |(id, (shape, _)): (usize, &(Shape, u16))| {
            let (aabb, kind) = match shape {
                Shape::Triangle(t) => (t.aabb(), Kind::Triangle),
                Shape::Sphere(s) => (s.aabb(), Kind::Sphere),
                Shape::Cone(c) => (c.aabb(), Kind::Cone),
            };
            Item::new(&aabb, kind, id as u32)
        };
        self.shapes.iter().enumerate().map(item).collect()
    }

    /// Builds the tree, in pages of 4096 bytes, and lends the scene: depth 5, a bluish background, some ambient light.
    pub fn with<R>(&self, use_scene: impl FnOnce(&Scene<'_>) -> R) -> R {
        self.with_pages(4096, use_scene)
    }

    /// The same in pages of so many bytes.
    pub fn with_pages<R>(&self, page_bytes: usize, use_scene: impl FnOnce(&Scene<'_>) -> R) -> R {
        let mut items = self.items();
        let mut binary = vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
        let used = sah::build(&mut items, &mut binary, &sah::Settings::default());
        let (mut pages, mut entries, mut above) = (Vec::new(), Vec::new(), top::Builder::new());
        let mut scratch = Box::<cut::Scratch>::default();
        let mut forests = vec![Forest::EMPTY; used];
        cut::pages(&binary[..used], &items, self, page_bytes, &mut forests, &mut scratch, None, &mut |aabb, cut| {
            match cut {
                Cut::Above => above.above(aabb),
                Cut::Page(lines) => {
                    above.page(aabb, pages.len() as u32);
                    let header: &Header = bytemuck::from_bytes(&lines[0].0);
                    entries.push(PageEntry { bytes: header.bytes, owner: 0, kind: 0 });
                    pages.push(lines.to_vec());
                }
            }
        })
        .expect("a page holds a leaf");
        let mut nodes = vec![Node::EMPTY; top::nodes_for(pages.len())];
        let above = above.finish();
        forests.resize(above.len(), Forest::EMPTY);
        let used = top::directory(&above, &mut forests, &mut nodes).expect("not deep");
        let tables = Tables { materials: self.materials.len() };
        let views: Vec<PageView<'_>> =
            pages.iter().map(|lines| PageView::parse(lines, tables).expect("a builder's page")).collect();
        let directory = Directory { nodes: &nodes[..used], entries: &entries };
        let magnitude = nodes.first().map_or(0.0, |n| n.bounds().magnitude());
        use_scene(&Scene {
            resident: Resident { directory, pages: &views[..] },
            shading: shading::Scene {
                materials: &self.materials,
                lights: &self.lights,
                ambient: [0.1; 3],
                ray_depth_max: 5,
                weight_cutoff: 1e-3,
                distance_scale: 1.0,
                shadow_rays: spawn::shadow_rays(&self.lights),
                maps: hybray_shading::MapTables::default(),
            },
            background: [0.25, 0.5, 0.75],
            magnitude,
            transmits: self.shapes.iter().any(|&(_, m)| self.materials[usize::from(m)].transmits()),
            texels: &[],
            layer: Layer::Light,
            eye: [0.0; 3],
        })
    }
}

/// A floor, a mirror ball, a glass ball around a smaller ball, a cone of tinted glass; a lamp, a sphere light, a far one.
pub fn hall() -> World {
    let glass = Material {
        transmission: [0.9, 0.95, 1.0],
        mirror: [0.05; 3],
        ior: 1.5,
        flags: Material::FRESNEL,
        specular: [0.5; 3],
        highlight: 1,
        exponent: 30.0,
        ..Material::MATT
    };
    let materials = vec![
        Material { ambient: [0.5; 3], ..Material::MATT },
        Material { mirror: [0.8, 0.7, 0.6], diffuse: [0.1; 3], emission: [0.01; 3], ..Material::MATT },
        glass,
        Material { transmission: [0.25, 0.5, 0.75], ior: 1.1, ..Material::MATT },
    ];
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let sphere = |x: f32, y: f32, radius| Shape::Sphere(Sphere { centre: Vec3::new(x, y, 0.0), radius });
    let cone =
        Cone { base: Vec3::new(0.0, 0.3, 0.5), base_radius: 0.2, apex: Vec3::new(0.1, 0.8, 0.6), apex_radius: 0.05 };
    let shapes = vec![
        (Shape::Triangle(Triangle { v: [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)] }), 0),
        (Shape::Triangle(Triangle { v: [corner(-1.0, -1.0), corner(1.0, 1.0), corner(1.0, -1.0)] }), 0),
        (sphere(-0.4, 0.3, 0.28), 1),
        (sphere(0.4, 0.3, 0.28), 2),
        (sphere(0.4, 0.3, 0.1), 1),
        (Shape::Cone(cone), 3),
    ];
    let colour = [1.0, 0.9, 0.8];
    let lights = vec![
        Light { position: [0.0, 2.0, 0.0], colour, ..Light::default() },
        Light { position: [1.0, 1.5, 1.0], colour, kind: 3, radius: 0.2, samples: 3, ..Light::default() },
        Light { axis: [0.6, -0.8, 0.0], colour, kind: 1, ..Light::default() },
    ];
    World::new(shapes, materials, lights)
}

/// The hall with a garland of small balls of all its materials, so that it fills many small pages.
pub fn full_hall() -> World {
    let mut hall = hall();
    for i in 0..240u32 {
        let t = i as f32;
        let place = |root: f32| 2.0 * (root * t).fract() - 1.0;
        let centre = Vec3::new(place(0.414_213_56), 0.05 + 0.45 * (place(0.236_068) + 1.0), place(0.732_050_8));
        hall.shapes.push((Shape::Sphere(Sphere { centre, radius: 0.02 + 0.02 * (0.618 * t).fract() }), (i % 4) as u16));
    }
    hall
}

impl World {
    /// The same under lights with many samples: more than a bundle has room for, a few, and some between.
    pub fn softly_lit(mut self) -> Self {
        let colour = [0.7, 0.8, 0.9];
        let square = Light { position: [-1.0, 1.8, -0.5], u: [0.0, 0.1, 1.0], v: [-1.0, 0.0, 0.0], ..Light::default() };
        let sphere = Light { position: [0.5, 1.4, 1.0], colour, kind: 3, radius: 0.3, ..Light::default() };
        self.lights.insert(1, Light { kind: 4, colour, samples: 100, ..square });
        self.lights.push(Light { samples: 12, ..sphere });
        self.lights.push(Light { samples: 7, ..sphere });
        self
    }

    /// The same with nothing that lets light through.
    pub fn opaque(mut self) -> Self {
        for material in &mut self.materials {
            material.transmission = [0.0; 3];
        }
        self
    }
}
