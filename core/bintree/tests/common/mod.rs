//! What the tests share: a caller's primitives, both builders as a host uses them, brute force and awkward scenes.
#![allow(dead_code)]

pub mod scenes;

use hybray_bintree::check::{Census, Coverage, Fault, check};
use hybray_bintree::cut::{self, Cut, CutError, Primitives};
use hybray_bintree::reinsert::{Link, reinsert};
use hybray_bintree::walk::{Counts, Resident, Stack, nearest, occluded};
use hybray_bintree::{BinaryNode, Forest, Item, midpoint, sah, top};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Aabb, Candidate, Cone, Ray, RayKernel, Sphere, Triangle, Vec3};
use hybray_scene::{Directory, Header, Kind, Line, Node, PageEntry, PageForm, PageView, Tables};

/// Numbers that depend on nothing but the seed.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    pub fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Triangle(Triangle),
    Sphere(Sphere),
    Cone(Cone),
}

impl Shape {
    pub fn scaled(self, by: f32) -> Self {
        match self {
            Self::Triangle(t) => Self::Triangle(Triangle { v: t.v.map(|v| v * by) }),
            Self::Sphere(s) => Self::Sphere(Sphere { centre: s.centre * by, radius: s.radius * by }),
            Self::Cone(c) => Self::Cone(Cone {
                base: c.base * by,
                base_radius: c.base_radius * by,
                apex: c.apex * by,
                apex_radius: c.apex_radius * by,
            }),
        }
    }
}

/// A caller's primitives: the id is the index.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    pub all: Vec<Shape>,
    /// Materials in turn; 1 for the same everywhere.
    pub materials: u16,
    /// Every other triangle has vertex normals.
    pub smooth: bool,
}

impl Shapes {
    pub fn new(all: Vec<Shape>) -> Self {
        Self { all, materials: 1, smooth: false }
    }

    pub fn items(&self) -> Vec<Item> {
        let item = |(id, shape): (usize, &Shape)| {
            let (aabb, kind) = match shape {
                Shape::Triangle(t) => (t.aabb(), Kind::Triangle),
                Shape::Sphere(s) => (s.aabb(), Kind::Sphere),
                Shape::Cone(c) => (c.aabb(), Kind::Cone),
            };
            Item::new(&aabb, kind, id as u32)
        };
        self.all.iter().enumerate().map(item).collect()
    }

    /// The nearest hit by testing every primitive.
    pub fn brute_force(&self, ray: &Ray) -> Candidate {
        self.brute_force_of(ray, 0..self.all.len() as u32)
    }

    /// The nearest hit by testing these primitives.
    pub fn brute_force_of(&self, ray: &Ray, ids: impl Iterator<Item = u32>) -> Candidate {
        let kernel = RayKernel::new(ray);
        ids.fold(Candidate::none(ray.t_max), |best, id| {
            let hit = match &self.all[id as usize] {
                Shape::Triangle(t) => t.hit(&kernel, id, &best),
                Shape::Sphere(s) => s.hit(&kernel, id, &best),
                Shape::Cone(c) => c.hit(&kernel, id, &best),
            };
            hit.unwrap_or(best)
        })
    }
}

impl Primitives for Shapes {
    fn triangle(&self, id: u32) -> Triangle {
        let Shape::Triangle(t) = self.all[id as usize] else { panic!("{id} is no triangle") };
        t
    }
    fn sphere(&self, id: u32) -> Sphere {
        let Shape::Sphere(s) = self.all[id as usize] else { panic!("{id} is no sphere") };
        s
    }
    fn cone(&self, id: u32) -> Cone {
        let Shape::Cone(c) = self.all[id as usize] else { panic!("{id} is no cone") };
        c
    }
    fn material(&self, id: u32) -> u16 {
        (id % u32::from(self.materials)) as u16
    }
    fn normals(&self, id: u32) -> Option<[u32; 3]> {
        (self.smooth && id.is_multiple_of(2)).then_some([1, 2, 3])
    }
}

/// A builder, its settings, and how much room it gets.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    Sah(sah::Settings),
    /// The same, then reinsertion.
    Moved(sah::Settings),
    /// Room for items: this many times their number, and 64.
    Midpoint(midpoint::Settings, usize),
}

/// A binary tree with its items.
pub struct Tree {
    pub nodes: Vec<BinaryNode>,
    pub items: Vec<Item>,
}

pub fn tree(shapes: &Shapes, rule: Rule) -> Tree {
    match rule {
        Rule::Sah(settings) => {
            let mut items = shapes.items();
            let mut nodes = vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
            let used = sah::build(&mut items, &mut nodes, &settings);
            nodes.truncate(used);
            Tree { nodes, items }
        }
        Rule::Moved(settings) => {
            let mut tree = tree(shapes, Rule::Sah(settings));
            reinsert(&mut tree.nodes, &mut vec![Link::EMPTY; sah::nodes_for(shapes.all.len())], settings.depth);
            tree
        }
        Rule::Midpoint(settings, room) => {
            let mut tree = cells(shapes, settings, room);
            midpoint::tighten(&mut tree.nodes, &tree.items);
            tree
        }
    }
}

/// A midpoint tree whose nodes are still cells.
pub fn cells(shapes: &Shapes, settings: midpoint::Settings, room: usize) -> Tree {
    let mut items = shapes.items();
    let count = items.len();
    let Some(&first) = items.first() else { return Tree { nodes: vec![], items } };
    items.resize(count * room + 64, first);
    let mut leaves = items.clone();
    let mut nodes = vec![BinaryNode::EMPTY; 2 * items.len()];
    let built = midpoint::build(&mut items, count, &mut leaves, &mut nodes, &settings);
    let (used, held) = (built.nodes.len(), built.items.len());
    nodes.truncate(used);
    leaves.truncate(held);
    Tree { nodes, items: leaves }
}

/// Pages and directory.
pub struct Built {
    pub pages: Vec<Vec<Line>>,
    pub nodes: Vec<Node>,
    pub entries: Vec<PageEntry>,
    pub materials: usize,
}

pub fn cut_tree(shapes: &Shapes, tree: &Tree, page_bytes: usize) -> Result<Built, CutError> {
    cut_tree_into(shapes, tree, page_bytes, PageForm::Full)
}

pub fn cut_tree_into(shapes: &Shapes, tree: &Tree, page_bytes: usize, form: PageForm) -> Result<Built, CutError> {
    let mut scratch = Box::<cut::Scratch>::default();
    let mut compact = (form == PageForm::Compact).then(Box::<cut::CompactScratch>::default);
    let mut above = top::Builder::new();
    let (mut pages, mut entries) = (Vec::new(), Vec::new());
    let mut forests = vec![Forest::EMPTY; tree.nodes.len()];
    cut::pages(
        &tree.nodes,
        &tree.items,
        shapes,
        page_bytes,
        &mut forests,
        &mut scratch,
        compact.as_deref_mut(),
        &mut |aabb, cut| match cut {
            Cut::Above => above.above(aabb),
            Cut::Page(lines) => {
                above.page(aabb, pages.len() as u32);
                let header: &Header = bytemuck::from_bytes(&lines[0].0);
                let bytes: &[u8] = bytemuck::cast_slice(lines);
                assert!(bytes[header.bytes as usize..].iter().all(|&b| b == 0), "padded with zeros");
                entries.push(PageEntry { bytes: header.bytes, owner: 0, kind: 0 });
                pages.push(lines.to_vec());
            }
        },
    )?;
    let mut nodes = vec![Node::EMPTY; top::nodes_for(pages.len())];
    let above = above.finish();
    forests.resize(above.len(), Forest::EMPTY);
    let used = top::directory(&above, &mut forests, &mut nodes).expect("there is a node for each page");
    nodes.truncate(used);
    Ok(Built { pages, nodes, entries, materials: shapes.materials.into() })
}

pub fn build(shapes: &Shapes, rule: Rule, page_bytes: usize) -> Result<Built, CutError> {
    cut_tree(shapes, &tree(shapes, rule), page_bytes)
}

/// The same in compact pages.
pub fn build_compact(shapes: &Shapes, rule: Rule, page_bytes: usize) -> Result<Built, CutError> {
    cut_tree_into(shapes, &tree(shapes, rule), page_bytes, PageForm::Compact)
}

impl Built {
    /// The pages as a node takes them in: validated.
    pub fn views(&self) -> Vec<PageView<'_>> {
        let tables = Tables { materials: self.materials };
        self.pages.iter().map(|lines| PageView::parse(lines, tables).expect("a builder's page")).collect()
    }

    pub fn resident<'a>(&'a self, views: &'a [PageView<'a>]) -> Resident<'a> {
        let scratch = &mut vec![0; self.nodes.len() + self.entries.len()];
        let directory = Directory::parse(&self.nodes, &self.entries, scratch);
        Resident { directory: directory.expect("a builder's directory"), pages: views }
    }
}

pub fn checked(scene: &Resident<'_>, primitives: usize) -> Result<Census, Fault> {
    check(scene, &mut vec![Coverage::NONE; primitives], &mut vec![0; scene.pages.len()])
}

/// Checks the tree, and that every ray finds what brute force found, with every kernel.
pub fn verify(name: &str, built: &Built, primitives: usize, rays: &[(Ray, Candidate)]) -> Census {
    let views = built.views();
    let scene = built.resident(&views);
    let census = checked(&scene, primitives).unwrap_or_else(|fault| panic!("{name}: {fault}"));
    let (mut stack, mut counts) = (Stack::new(), Counts::default());
    for kernels in Kernels::available() {
        for (ray, expected) in rays {
            let found = nearest(kernels, &scene, ray, &mut stack, &mut counts);
            assert_eq!(found.candidate, *expected, "{name} {kernels:?} {ray:?}");
            let hit = occluded(kernels, &scene, ray, &mut stack, &mut counts);
            assert_eq!(hit, expected.is_hit(), "{name} {kernels:?} {ray:?}");
        }
    }
    census
}

/// Rays with what brute force finds: through the box around everything, at primitives, on a grid along axes.
pub fn rays(shapes: &Shapes, count: usize, seed: u64) -> Vec<(Ray, Candidate)> {
    let mut random = Random(seed);
    let items = shapes.items();
    let whole = items.iter().fold(Aabb::EMPTY, |b, i| b.union(&i.aabb()));
    let (middle, size) = ((whole.lo + whole.hi) * 0.5, (whole.hi - whole.lo).max_element().max(1e-3));
    (0..count)
        .map(|i| {
            let mut origin = middle + random.vec() * size;
            let aim = items[random.below(items.len())];
            let target = match i % 4 {
                0 => middle + random.vec() * (0.5 * size),
                1 => (aim.lo + aim.hi) * 0.5,
                // A corner of its box: a vertex of a triangle, mostly.
                2 => aim.lo,
                _ => (random.vec() * 4.0).round() * 0.25,
            };
            if i % 4 == 3 {
                origin = (origin * 4.0).round() * 0.25;
            }
            let mut direction = target - origin;
            if i % 8 == 5 {
                direction[i / 8 % 3] = 0.0;
            }
            if direction == Vec3::ZERO {
                direction = Vec3::Z;
            }
            let t_max = if i % 5 == 0 { 1.0 } else { f32::INFINITY };
            let t_min = if i % 7 == 0 { 0.5 } else { 0.0 };
            let ray = Ray { origin, direction, t_min, t_max };
            let found = shapes.brute_force(&ray);
            (ray, found)
        })
        .collect()
}

/// Levels below the root of the deepest node.
pub fn depth(nodes: &[BinaryNode]) -> u32 {
    let mut levels = vec![0u32; nodes.len()];
    for (i, node) in nodes.iter().enumerate().filter(|(_, n)| !n.is_leaf()) {
        for child in [i + 1, node.second as usize] {
            levels[child] = levels[i] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(0)
}
