//! A small scene: primitives, tables, and the tree over them.

use hybray_bintree::cut::{self, Cut, Primitives};
use hybray_bintree::walk::Resident;
use hybray_bintree::{BinaryNode, Item, sah, top};
use hybray_geometry::{Cone, Sphere, Triangle};
use hybray_scene::{Directory, Header, Kind, Node, PageEntry, PageView, Tables};
use hybray_shading::{self as shading, Light, Material, spawn};
use hybray_tracer::Scene;

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
        let mut items = self.items();
        let mut binary = vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
        let used = sah::build(&mut items, &mut binary, &sah::Settings::default());
        let (mut pages, mut entries, mut above) = (Vec::new(), Vec::new(), top::Builder::new());
        let mut scratch = Box::<cut::Scratch>::default();
        cut::pages(&binary[..used], &items, self, 4096, &mut scratch, &mut |aabb, cut| match cut {
            Cut::Above => above.above(aabb),
            Cut::Page(lines) => {
                above.page(aabb, pages.len() as u32);
                let header: &Header = bytemuck::from_bytes(&lines[0].0);
                entries.push(PageEntry { bytes: header.bytes, owner: 0, kind: 0 });
                pages.push(lines.to_vec());
            }
        })
        .expect("4096 bytes hold a leaf");
        let mut nodes = vec![Node::EMPTY; top::nodes_for(pages.len())];
        let used = top::directory(&above.finish(), &mut nodes).expect("not deep");
        let tables = Tables { materials: self.materials.len() };
        let views: Vec<PageView<'_>> =
            pages.iter().map(|lines| PageView::parse(lines, tables).expect("a builder's page")).collect();
        let directory = Directory { nodes: &nodes[..used], entries: &entries };
        let magnitude = nodes.first().map_or(0.0, |n| n.bounds().magnitude());
        use_scene(&Scene {
            resident: Resident { directory, pages: &views },
            shading: shading::Scene {
                materials: &self.materials,
                lights: &self.lights,
                ambient: [0.1; 3],
                ray_depth_max: 5,
                weight_cutoff: 1e-3,
                distance_scale: 1.0,
                shadow_rays: spawn::shadow_rays(&self.lights),
            },
            background: [0.25, 0.5, 0.75],
            magnitude,
            transmits: self.shapes.iter().any(|&(_, m)| self.materials[usize::from(m)].transmits()),
        })
    }
}
