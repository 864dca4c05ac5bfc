//! Compact pages by hand: boxes rounded outwards, and every reason why a block is none.

use bytemuck::{Zeroable, bytes_of, cast_slice, cast_slice_mut};
use hybray_geometry::Aabb;
use hybray_scene::{
    Body, Child, CompactNode, CompactTriangles, ConeRecord, Header, Kind, Line, Node, PAGE_BYTES_MAX, PageError,
    PageView, Slot, SphereBlock, Tables, lines_for,
};

struct Parts {
    nodes: Vec<CompactNode>,
    spheres: Vec<SphereBlock>,
    triangles: Vec<CompactTriangles>,
    cones: Vec<ConeRecord>,
    vertices: Vec<[f32; 3]>,
    normals: Vec<u32>,
    materials: Vec<u16>,
}

const fn leaf(kind: Kind, start: u32, count: u32) -> Child {
    Child::Leaf { kind, start, count }
}

fn branch(children: &[Child]) -> CompactNode {
    let mut node = Node::EMPTY;
    for (slot, &child) in children.iter().enumerate() {
        node.set(slot, &Aabb { lo: [0.0; 3].into(), hi: [1.0; 3].into() }, child);
    }
    CompactNode::new(&node).unwrap()
}

/// Two blocks of triangles over five vertices, one of spheres, three cones, all with normals and materials of their own.
fn sample() -> Parts {
    let corners = [[0, 1, 2, 3], [1, 2, 3, 4], [4, 4, 0, 0]];
    Parts {
        nodes: vec![branch(&[leaf(Kind::Triangle, 0, 2), leaf(Kind::Sphere, 0, 1), leaf(Kind::Cone, 0, 3)])],
        spheres: vec![Zeroable::zeroed(); 1],
        triangles: vec![
            CompactTriangles { id: [7, 8, 9, 10], v: corners },
            CompactTriangles { id: [11; 4], v: [[4; 4], [3; 4], [2; 4]] },
        ],
        cones: vec![Zeroable::zeroed(); 3],
        vertices: (0..5u8).map(|i| [0.1, 0.2, 0.3].map(|x| x * f32::from(i))).collect(),
        normals: (100..105).collect(),
        materials: (0..15).collect(),
    }
}

impl Parts {
    fn lines(&self) -> Vec<Line> {
        let mut header = Header {
            magic: Header::MAGIC_COMPACT,
            nodes: self.nodes.len() as u32,
            triangle_blocks: self.triangles.len() as u32,
            sphere_blocks: self.spheres.len() as u32,
            cones: self.cones.len() as u32,
            vertices: self.vertices.len() as u32,
            normals: self.normals.len() as u32,
            materials: self.materials.len() as u32,
            ..Zeroable::zeroed()
        };
        header.bytes = header.bytes_for() as u32;
        let mut lines = vec![Line([0; 64]); lines_for(header.bytes as usize)];
        let room: &mut [u8] = cast_slice_mut(&mut lines);
        let parts = [
            bytes_of(&header),
            cast_slice(&self.nodes),
            cast_slice(&self.spheres),
            cast_slice(&self.triangles),
            cast_slice(&self.cones),
            cast_slice(&self.vertices),
            cast_slice(&self.normals),
            cast_slice(&self.materials),
        ];
        let mut at = 0;
        for part in parts {
            room[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        lines
    }
}

fn parse(lines: &[Line]) -> Result<PageView<'_>, PageError> {
    PageView::parse(lines, Tables { materials: 15 })
}

fn refused(parts: &Parts) -> PageError {
    parse(&parts.lines()).map(|_| ()).unwrap_err()
}

#[test]
fn a_page_is_read_where_it_lies() {
    let parts = sample();
    let lines = parts.lines();
    let page = parse(&lines).unwrap();
    let Body::Compact(body) = page.body else { panic!("{:?}", page.body.form()) };
    assert_eq!((body.nodes, body.triangles), (&parts.nodes[..], &parts.triangles[..]));
    assert_eq!((body.vertices, body.normals), (&parts.vertices[..], &parts.normals[..]));
    assert_eq!((page.spheres, page.cones), (&parts.spheres[..], &parts.cones[..]));
    assert_eq!(page.materials(), &parts.materials[..]);
    assert_eq!(page.header.bytes, 64 + 80 + 80 + 2 * 40 + 3 * 36 + 5 * 12 + 5 * 4 + 15 * 2);
    assert_eq!(body.nodes.as_ptr().cast::<u8>(), lines[1].0.as_ptr(), "in place");
    let of = |kind, number| page.material(Slot::new(kind, number));
    assert_eq!((of(Kind::Triangle, 7), of(Kind::Sphere, 1), of(Kind::Cone, 2)), (7, 9, 14));
    assert_eq!((page.body.triangle_lanes(), page.body.triangle_id(2), page.body.triangle_id(5)), (8, 9, 11));
    let corners = [2, 3, 0].map(|i| parts.vertices[i]);
    assert_eq!(page.body.triangle(2).v.map(|v| v.to_array()), corners);
    assert_eq!(page.body.normals(2), Some([102, 103, 100]));
    let flat = Parts { normals: vec![], ..sample() }.lines();
    assert_eq!(parse(&flat).unwrap().body.normals(2), None);
}

#[test]
fn what_is_no_compact_page() {
    for block in 0..2 {
        let mut parts = sample();
        parts.triangles[block].v[2][3] = 5;
        assert_eq!(refused(&parts), PageError::Vertex { block });
    }
    let what = "neither no normals nor one for each vertex";
    assert_eq!(refused(&Parts { normals: vec![1; 4], ..sample() }), PageError::Header(what));
    assert_eq!(refused(&Parts { vertices: vec![], ..sample() }), PageError::Header(what));
    assert_eq!(refused(&Parts { nodes: vec![], ..sample() }), PageError::Header("no root"));
    assert_eq!(refused(&Parts { materials: vec![15], ..sample() }), PageError::Material(15));
    let node = |children: &[Child]| match refused(&Parts { nodes: vec![branch(children)], ..sample() }) {
        PageError::Node { node: 0, what } => what,
        other => panic!("{other}"),
    };
    assert_eq!(node(&[Child::Inner(1)]), "a child that does not come after it");
    for (kind, have) in [(Kind::Triangle, 2), (Kind::Sphere, 1), (Kind::Cone, 3)] {
        assert_eq!(node(&[leaf(kind, 0, have + 1)]), "a leaf beyond the page's primitives");
        assert_eq!(node(&[leaf(kind, have, 1)]), "a leaf beyond the page's primitives");
    }
    let many = PageError::Header("more of something than a page can hold");
    let mut lines = sample().lines();
    lines[0].0[56..60].copy_from_slice(&(PAGE_BYTES_MAX as u32 + 1).to_le_bytes());
    assert_eq!(parse(&lines).map(|_| ()), Err(many));
    // A page in full form shares no vertices.
    let mut lines = sample().lines();
    lines[0].0[..4].copy_from_slice(&Header::MAGIC.to_le_bytes());
    assert!(parse(&lines).is_err());
}

#[test]
fn children_come_back() {
    let leaves = [(0, 1), (3, 4), (4095, 2)]
        .map(|(start, count)| [Kind::Triangle, Kind::Sphere, Kind::Cone].map(|kind| leaf(kind, start, count)));
    for child in leaves.into_iter().flatten().chain([Child::Inner(1), Child::Inner((1 << 14) - 1)]) {
        let node = branch(&[child]);
        let mut room = Node::EMPTY;
        node.decode(&mut room);
        assert_eq!((Child::unpack(room.child[0]), room.children().count()), (child, 1));
        assert_eq!(room.child, node.packed_children());
    }
    let mut node = Node::EMPTY;
    for child in
        [leaf(Kind::Cone, 4096, 1), leaf(Kind::Cone, 0, 5), Child::Inner(1 << 14), Child::Inner(0), Child::Page(1)]
    {
        node.child[0] = child.pack();
        assert_eq!(CompactNode::new(&node), None, "{child:?}");
    }
}

/// Whatever the boxes: those that come back are around them, and by two steps at most, or there is no compact node.
#[test]
fn boxes_are_rounded_outwards() {
    let mut state = 5u64;
    let mut bits = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    let (mut held, mut not) = (0, 0);
    for round in 0..200_000u32 {
        // Sizes from denormals to beyond 10^38, at places of other sizes.
        let size = f32::from_bits((bits() % 255) << 23 | bits() & 0x7f_ffff);
        let place = if round % 3 == 0 { 0.0 } else { f32::from_bits(bits() % 0x7e80_0000) };
        let mut node = Node::EMPTY;
        let children = 1 + bits() % 8;
        for slot in 0..children as usize {
            let mut side = || {
                let unit = f64::from(bits()) / f64::from(1u32 << 31) * 2.0 - 1.0;
                (f64::from(place) + f64::from(size) * unit).clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
            };
            let (a, b) = ([side(), side(), side()], [side(), side(), side()]);
            let (a, b): (hybray_geometry::Vec3, hybray_geometry::Vec3) = (a.into(), b.into());
            // Some are flat.
            let b = if bits() % 8 == 0 { a } else { b };
            node.set(slot, &Aabb { lo: a.min(b), hi: a.max(b) }, leaf(Kind::Triangle, slot as u32, 1));
        }
        let Some(compact) = CompactNode::new(&node) else {
            not += 1;
            assert!(node.bounds().magnitude() > 1e36, "{node:?}");
            continue;
        };
        held += 1;
        let mut room = Node::EMPTY;
        compact.decode(&mut room);
        let bounds = node.bounds();
        for slot in 0..children as usize {
            let (tight, loose) = (node.aabb(slot), room.aabb(slot));
            assert!(loose.contains(&tight), "{loose:?} {tight:?} {compact:?}");
            for axis in 0..3 {
                // The extent is at least 127 of its steps.
                let step = ((f64::from(bounds.hi[axis]) - f64::from(bounds.lo[axis])) / 127.0)
                    .max(f64::from(f32::MIN_POSITIVE));
                let slack = step + f64::from(bounds.magnitude()) * f64::from(f32::EPSILON);
                assert!(f64::from(loose.hi[axis]) - f64::from(tight.hi[axis]) <= slack, "{loose:?} {tight:?}");
                assert!(f64::from(tight.lo[axis]) - f64::from(loose.lo[axis]) <= slack, "{loose:?} {tight:?}");
            }
        }
    }
    assert!(held > 150_000 && not > 100, "{held} {not}");
}

/// Any bytes behind a page's first word: an error or a page, never a panic.
#[test]
fn noise_is_refused_calmly() {
    let mut state = 1u64;
    let mut bits = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    };
    let mut taken = 0;
    for round in 0..50_000usize {
        let mut lines = vec![Line([0; 64]); 1 + round % 40];
        let words: &mut [u32] = cast_slice_mut(&mut lines);
        for word in words.iter_mut() {
            let shift = 32 - bits() % 32;
            *word = bits().checked_shr(shift).unwrap_or(0);
        }
        words[0] = Header::MAGIC_COMPACT;
        // Counts that add up, half of the time.
        if round % 2 == 0 {
            let counts = [1 + bits() % 4, bits() % 3, bits() % 3, bits() % 3, 0, 1];
            words[2..8].copy_from_slice(&counts);
            words[14] = 1 << (bits() % 9);
            words[1] = 64 + 80 * counts[0] + 40 * counts[1] + 80 * counts[2] + 36 * counts[3] + 12 * words[14] + 2;
            // Few vertices' numbers are small by chance.
            let first = 16 + 20 * counts[0] + 20 * counts[2];
            for block in 0..counts[1] {
                for word in words.iter_mut().skip((first + 10 * block + 4) as usize).take(6) {
                    *word = if bits() % 64 == 0 { bits() } else { 0 };
                }
            }
        }
        if let Ok(page) = parse(&lines) {
            taken += 1;
            (0..page.body.triangle_lanes()).for_each(|number| _ = page.body.triangle(number));
        }
    }
    eprintln!("{taken} of 50,000 blocks of noise are pages");
}
