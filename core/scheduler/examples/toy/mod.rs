//! A scene small enough to read: nine spheres on a large one, one of them a mirror and one of glass, and two lights.

use hybray_bintree::{BinaryNode, Forest, Item, cut, sah, top};
use hybray_geometry::{Aabb, Cone, Sphere, Triangle, Vec3};
use hybray_scene::{Directory, Kind, Line, Node, PageEntry, PageView, Tables};
use hybray_shading::{Highlight, Light, LightKind, Material, spawn};
use hybray_tracer::{Layer, Scene};
use hybray_wire::Frame;

/// Names the scene to those who trace it. It is made in this file, so any number does.
pub const SCENE_HASH: u64 = 0x70_79_5f_73_63_65_6e_65;

const GROUND: u16 = 0;
const MIRROR: u16 = 1;
const GLASS: u16 = 2;
const RED: u16 = 3;

/// What a [`Scene`] borrows.
pub struct Toy {
    page: Vec<Line>,
    nodes: Vec<Node>,
    entries: Vec<PageEntry>,
    materials: Vec<Material>,
    lights: Vec<Light>,
}

struct Spheres(Vec<(Sphere, u16)>);

impl Spheres {
    fn new() -> Self {
        let sphere = |x, y, z, radius, material| (Sphere { centre: Vec3::new(x, y, z), radius }, material);
        let mut all = vec![
            sphere(0.0, -50.0, 0.0, 50.0, GROUND),
            sphere(-0.3, 0.6, 0.3, 0.6, MIRROR),
            sphere(0.8, 0.4, -0.6, 0.4, GLASS),
        ];
        for i in 0..7 {
            let i = i as f32;
            all.push(sphere(1.6 - 0.5 * i, 0.15, -1.2 + 0.05 * i * i, 0.15, RED));
        }
        Self(all)
    }

    fn items(&self) -> Vec<Item> {
        (0..).zip(&self.0).map(|(id, (sphere, _))| Item::new(&sphere.aabb(), Kind::Sphere, id)).collect()
    }
}

impl cut::Primitives for Spheres {
    fn triangle(&self, _: u32) -> Triangle {
        unreachable!("there are spheres only")
    }
    fn sphere(&self, id: u32) -> Sphere {
        self.0[id as usize].0
    }
    fn cone(&self, _: u32) -> Cone {
        unreachable!("there are spheres only")
    }
    fn material(&self, id: u32) -> u16 {
        self.0[id as usize].1
    }
    fn normals(&self, _: u32) -> Option<[u32; 3]> {
        None
    }
}

impl Toy {
    /// Builds the tree, which is one page.
    pub fn new() -> Self {
        let spheres = Spheres::new();
        let mut items = spheres.items();
        let mut tree = vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
        let used = sah::build(&mut items, &mut tree, &sah::Settings::default());
        let (mut page, mut aabb) = (Vec::new(), Aabb::EMPTY);
        let mut forests = vec![Forest::EMPTY; used];
        cut::pages(
            &tree[..used],
            &items,
            &spheres,
            4096,
            &mut forests,
            &mut Box::default(),
            None,
            &mut |around, cut| {
                if let cut::Cut::Page(lines) = cut {
                    aabb = *around;
                    page.extend_from_slice(lines);
                }
            },
        )
        .expect("ten spheres fit a page");
        let mut nodes = vec![Node::EMPTY; top::nodes_for(1)];
        let used =
            top::directory(&[top::TopNode { aabb, second: 0, page: 0 }], &mut forests, &mut nodes).expect("one page");
        nodes.truncate(used);
        let entries = vec![PageEntry { bytes: 64 * page.len() as u32, owner: 0, kind: 0 }];
        let matt = |diffuse| Material { diffuse, ambient: diffuse, ..Material::MATT };
        let shiny =
            Material { specular: [0.6; 3], exponent: 40.0, highlight: Highlight::Phong as u32, ..matt([0.1; 3]) };
        let materials = vec![
            matt([0.5, 0.55, 0.4]),
            Material { mirror: [0.8, 0.8, 0.85], ..shiny },
            Material { transmission: [0.9; 3], ior: 1.5, flags: Material::FRESNEL, ..shiny },
            matt([0.8, 0.15, 0.1]),
        ];
        let light = |position, colour| Light { position, colour, kind: LightKind::Point as u32, ..Light::default() };
        let lights = vec![light([3.0, 5.0, -4.0], [0.7; 3]), light([-4.0, 3.0, -2.0], [0.2, 0.2, 0.4])];
        Self { page, nodes, entries, materials, lights }
    }

    /// The page, validated.
    pub fn open(&self) -> [PageView<'_>; 1] {
        [PageView::parse(&self.page, Tables { materials: self.materials.len() }).expect("a page that was just made")]
    }

    /// What nodes need.
    pub fn scene<'a>(&'a self, pages: &'a [PageView<'a>; 1]) -> Scene<'a> {
        let directory = Directory { nodes: &self.nodes, entries: &self.entries };
        Scene {
            resident: hybray_bintree::walk::Resident { directory, pages },
            shading: hybray_shading::Scene {
                materials: &self.materials,
                lights: &self.lights,
                ambient: [0.15; 3],
                ray_depth_max: 5,
                weight_cutoff: 0.01,
                distance_scale: 1.0,
                shadow_rays: spawn::shadow_rays(&self.lights),
                maps: hybray_shading::MapTables::default(),
            },
            background: [0.02, 0.03, 0.06],
            magnitude: 100.0,
            transmits: true,
            texels: &[],
            layer: Layer::Light,
            eye: [0.0; 3],
        }
    }

    /// A picture of it.
    pub fn frame(width: u32, height: u32, samples: u16) -> Frame {
        Frame {
            width,
            height,
            samples,
            depth_max: 5,
            filter: 2,
            seed: 7,
            weight_cutoff: 0.01,
            step_log2: hybray_scheduler::Step::log2_for(1.0),
            eye: [0.0, 1.5, -4.5],
            target: [0.0, 0.5, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y_degrees: 26.0,
            hither: 0.0,
            layer: 0,
            half: 0,
            optics: hybray_wire::Optics::PINHOLE,
        }
    }
}
