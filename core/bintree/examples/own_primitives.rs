//! A tree over one's own primitives: a garden of balls on a floor, kept in plain `Vec`s, cut into pages, and one ray.
//!
//! `cargo run -p hybray-bintree --features alloc --example own_primitives`

use hybray_bintree::cut::{self, Cut, Primitives};
use hybray_bintree::reinsert::{Link, reinsert};
use hybray_bintree::walk::{self, Counts, Resident, Stack};
use hybray_bintree::{BinaryNode, Forest, Item, sah, top};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Cone, Ray, Sphere, Triangle, Vec3};
use hybray_scene::{Directory, Kind, Node, PageEntry, PageView, Tables};

/// The caller's own data. Ids: the triangles first, then the balls.
struct Garden {
    floor: Vec<[Vec3; 3]>,
    balls: Vec<(Vec3, f32)>,
}

impl Primitives for Garden {
    fn triangle(&self, id: u32) -> Triangle {
        Triangle { v: self.floor[id as usize] }
    }
    fn sphere(&self, id: u32) -> Sphere {
        let (centre, radius) = self.balls[id as usize - self.floor.len()];
        Sphere { centre, radius }
    }
    fn cone(&self, _: u32) -> Cone {
        unreachable!("no item of this garden is a cone")
    }
    fn material(&self, id: u32) -> u16 {
        u16::from(id as usize >= self.floor.len())
    }
    fn normals(&self, _: u32) -> Option<[u32; 3]> {
        None
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let (a, b, c, d) = (corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0));
    // Two square roots, multiplied: a cheap sequence that fills a square evenly.
    let ball = |i: u32| {
        let place = |root: f32| 2.0 * (root * i as f32).fract() - 1.0;
        (Vec3::new(place(0.414_213_56), 0.01, place(0.732_050_8)), 0.01)
    };
    let garden = Garden { floor: vec![[a, b, c], [a, c, d]], balls: (0..5_000).map(ball).collect() };

    // 1. An item for each primitive.
    let triangles = garden.floor.len() as u32;
    let mut items: Vec<Item> = (0..triangles)
        .map(|id| Item::new(&garden.triangle(id).aabb(), Kind::Triangle, id))
        .chain(
            (triangles..triangles + garden.balls.len() as u32)
                .map(|id| Item::new(&garden.sphere(id).aabb(), Kind::Sphere, id)),
        )
        .collect();

    // 2. A binary tree over them.
    let mut binary = vec![BinaryNode::EMPTY; sah::nodes_for(items.len())];
    let used = sah::build(&mut items, &mut binary, &sah::Settings::default());
    reinsert(&mut binary[..used], &mut vec![Link::EMPTY; used], 0);

    // 3. Pages of at most 16 KiB, and the directory above them.
    let (mut pages, mut entries, mut above) = (Vec::new(), Vec::new(), top::Builder::new());
    let mut scratch = Box::<cut::Scratch>::default();
    let mut forests = vec![Forest::EMPTY; used];
    cut::pages(
        &binary[..used],
        &items,
        &garden,
        16 * 1024,
        &mut forests,
        &mut scratch,
        None,
        &mut |aabb, cut| match cut {
            Cut::Above => above.above(aabb),
            Cut::Page(lines) => {
                above.page(aabb, pages.len() as u32);
                entries.push(PageEntry { bytes: 64 * lines.len() as u32, owner: 0, kind: 0 });
                pages.push(lines.to_vec());
            }
        },
    )?;
    let mut nodes = vec![Node::EMPTY; top::nodes_for(pages.len())];
    let above = above.finish();
    forests.resize(above.len(), Forest::EMPTY);
    let used = top::directory(&above, &mut forests, &mut nodes).ok_or("no builder makes a tree so deep")?;

    // 4. Whoever receives a page validates it, once, and reads it where it is.
    let tables = Tables { materials: 2 };
    let views = pages.iter().map(|lines| PageView::parse(lines, tables)).collect::<Result<Vec<_>, _>>()?;
    let directory = Directory::parse(&nodes[..used], &entries, &mut vec![0; used + entries.len()])?;
    let scene = Resident { directory, pages: &views[..] };

    // 5. A ray.
    let ray = Ray {
        origin: Vec3::new(-1.5, 0.4, 0.1),
        direction: Vec3::new(1.0, -0.25, 0.0),
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let mut counts = Counts::default();
    let hit = walk::nearest(Kernels::Portable, &scene, &ray, &mut Stack::new(), &mut counts);
    println!("{} primitives in {} pages and {used} directory nodes", items.len(), pages.len());
    println!("{hit:?}, of material {}", views[hit.page as usize].material(hit.slot));
    println!("{counts:?}");
    Ok(())
}
