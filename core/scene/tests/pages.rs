//! Pages by hand: what is one, and every reason why a block is none.

mod common;

use common::{Parts, branch, chain, leaf, parse, sample};
use hybray_scene::{
    Body, Child, HEADER_BYTES, Kind, Line, Node, PAGE_BYTES_MAX, PageError, PageView, Slot, Tables, lines_for,
};

/// Parses `parts` after `change` has been at its lines.
fn check(parts: &Parts, change: impl FnOnce(&mut Vec<Line>), expected: Result<(), PageError>) {
    let mut lines = parts.lines();
    change(&mut lines);
    assert_eq!(parse(&lines).map(|_| ()), expected);
}

/// Changes word `index` of the header.
fn header(index: usize, value: u32) -> impl FnOnce(&mut Vec<Line>) {
    move |lines| lines[0].0[4 * index..][..4].copy_from_slice(&value.to_le_bytes())
}

fn node(node: usize, what: &'static str) -> Result<(), PageError> {
    Err(PageError::Node { node, what })
}

fn nodes(all: Vec<Node>) -> Parts {
    Parts { nodes: all, ..sample() }
}

fn child(child: Child) -> Parts {
    nodes(vec![branch(&[child])])
}

const UNTOUCHED: fn(&mut Vec<Line>) = |_| {};

#[test]
fn a_page_is_read_where_it_lies() {
    let parts = sample();
    let lines = parts.lines();
    let page = parse(&lines).unwrap();
    let Body::Full(body) = page.body else { panic!("{:?}", page.body.form()) };
    assert_eq!(
        (body.nodes, body.triangles, page.spheres),
        (&parts.nodes[..], &parts.triangles[..], &parts.spheres[..])
    );
    assert_eq!(
        (page.cones, body.normals, page.materials()),
        (&parts.cones[..], &parts.normals[..], &parts.materials[..])
    );
    assert_eq!(page.header.bytes as usize, HEADER_BYTES + 224 + 2 * 160 + 80 + 3 * 36 + 8 * 12 + 15 * 2);
    assert_eq!(body.nodes.as_ptr().cast::<u8>(), lines[1].0.as_ptr(), "in place");
}

#[test]
fn materials_by_slot() {
    let parts = sample();
    let lines = parts.lines();
    let page = parse(&lines).unwrap();
    let of = |kind, number| page.material(Slot::new(kind, number));
    assert_eq!((of(Kind::Triangle, 0), of(Kind::Triangle, 7)), (0, 7));
    assert_eq!((of(Kind::Sphere, 0), of(Kind::Sphere, 3)), (8, 11));
    assert_eq!((of(Kind::Cone, 0), of(Kind::Cone, 2)), (12, 14));
    let one = Parts { materials: vec![4], ..sample() };
    let lines = one.lines();
    assert_eq!(parse(&lines).unwrap().material(Slot::new(Kind::Cone, 2)), 4);
}

#[test]
fn short_blocks() {
    check(&sample(), |lines| lines.clear(), Err(PageError::Short { bytes: 0, needed: 64 }));
    let needed = u64::from(parse(&sample().lines()).unwrap().header.bytes);
    check(&sample(), |lines| lines.truncate(1), Err(PageError::Short { bytes: 64, needed }));
    let last = lines_for(needed as usize) - 1;
    check(&sample(), |lines| lines.truncate(last), Err(PageError::Short { bytes: 64 * last, needed }));
    check(&sample(), |lines| lines.push(lines[0]), Ok(()));
}

#[test]
fn other_formats() {
    check(&sample(), header(0, 0), Err(PageError::Magic(0)));
    let next = u32::from_le_bytes(*b"hyP\x02");
    check(&sample(), header(0, next), Err(PageError::Magic(next)));
}

#[test]
fn counts_that_contradict() {
    let sum = Err(PageError::Header("its counts do not make its bytes, or exceed 64 KiB"));
    // Of nodes and of blocks of spheres there is one.
    for field in 1..8 {
        check(&sample(), header(field, 0), sum);
        check(&sample(), header(field, if field == 2 || field == 4 { 2 } else { 1 }), sum);
    }
    let many = Err(PageError::Header("more of something than a page can hold"));
    for field in 2..8 {
        check(&sample(), header(field, u32::MAX), many);
        check(&sample(), header(field, PAGE_BYTES_MAX as u32 + 1), many);
        check(&sample(), header(field, PAGE_BYTES_MAX as u32), sum);
    }
    check(&sample(), header(1, u32::MAX), sum);
    check(&Parts { nodes: vec![], ..sample() }, UNTOUCHED, Err(PageError::Header("no root")));
    let slots = Err(PageError::Header("neither one material nor one for each slot"));
    check(&Parts { materials: vec![], ..sample() }, UNTOUCHED, slots);
    check(&Parts { materials: vec![1; 14], ..sample() }, UNTOUCHED, slots);
    check(&Parts { materials: vec![1; 16], ..sample() }, UNTOUCHED, slots);
    let normals = Err(PageError::Header("neither no normals nor three for each triangle"));
    check(&Parts { normals: vec![[0; 3]; 7], ..sample() }, UNTOUCHED, normals);
    check(&Parts { normals: vec![], ..sample() }, UNTOUCHED, Ok(()));
}

/// A page may be full to the byte, and no fuller.
#[test]
fn the_greatest_page() {
    let full = |nodes: usize, materials: usize| Parts {
        nodes: vec![Node::EMPTY; nodes],
        materials: vec![0; materials],
        ..Parts::default()
    };
    assert_eq!(full(292, 1).lines().len(), 1024);
    check(&full(292, 1), UNTOUCHED, Ok(()));
    let sum = PageError::Header("its counts do not make its bytes, or exceed 64 KiB");
    check(&full(293, 1), UNTOUCHED, Err(sum));
}

/// Every number of everything from 0 to 2: no array is ever out of line with its type.
#[test]
fn any_counts_are_aligned() {
    for counts in 0..2 * 3 * 3 * 3 * 2 * 2 {
        let [n, t, s, c] = [counts % 2 + 1, counts / 2 % 3, counts / 6 % 3, counts / 18 % 3];
        let (smooth, several) = (counts / 54 % 2 == 1, counts / 108 == 1);
        let all = sample();
        let parts = Parts {
            nodes: vec![Node::EMPTY; n],
            triangles: vec![all.triangles[0]; t],
            spheres: vec![all.spheres[0]; s],
            cones: vec![all.cones[0]; c],
            normals: vec![[5; 3]; if smooth { 4 * t } else { 0 }],
            materials: vec![3; if several && t + s + c > 0 { 4 * (t + s) + c } else { 1 }],
        };
        check(&parts, UNTOUCHED, Ok(()));
    }
}

#[test]
fn leaves_beyond_the_end() {
    let beyond = || node(0, "a leaf beyond the page's primitives");
    for (kind, have) in [(Kind::Triangle, 2), (Kind::Sphere, 1), (Kind::Cone, 3)] {
        check(&child(leaf(kind, 0, have)), UNTOUCHED, Ok(()));
        check(&child(leaf(kind, have - 1, 1)), UNTOUCHED, Ok(()));
        check(&child(leaf(kind, 0, have + 1)), UNTOUCHED, beyond());
        check(&child(leaf(kind, have, 1)), UNTOUCHED, beyond());
        check(&child(leaf(kind, (1 << 24) - 1, 16)), UNTOUCHED, beyond());
    }
}

#[test]
fn children_that_lead_astray() {
    check(&child(Child::Page(0)), UNTOUCHED, node(0, "a page inside a page"));
    check(&child(Child::Inner(0)), UNTOUCHED, node(0, "a child that does not come after it"));
    check(&child(Child::Inner(1)), UNTOUCHED, node(0, "a child that does not come after it"));
    check(&child(Child::Inner(Child::INDEX_MAX - 1)), UNTOUCHED, node(0, "a child that does not come after it"));
    let circle = nodes(vec![branch(&[Child::Inner(1)]), branch(&[Child::Inner(0)])]);
    check(&circle, UNTOUCHED, node(1, "a child that does not come after it"));
    let shared = |a: u32, b: u32| {
        nodes(vec![branch(&[Child::Inner(1), Child::Inner(a)]), branch(&[Child::Inner(b)]), branch(&[])])
    };
    check(&shared(2, 2), UNTOUCHED, node(1, "a child that has another parent"));
    check(&shared(1, 2), UNTOUCHED, node(0, "a child that has another parent"));
    // Bits that no child has: an index beside "unused", a fourth kind of primitive.
    for packed in [3 << 30 | 1, 1 << 30 | 3 << 28, u32::MAX] {
        let mut odd = branch(&[]);
        odd.child[5] = packed;
        check(&nodes(vec![odd]), UNTOUCHED, node(0, "an unknown kind of child"));
    }
}

#[test]
fn chains_are_bounded() {
    check(&nodes(chain(40)), UNTOUCHED, Ok(()));
    check(&nodes(chain(41)), UNTOUCHED, node(39, "too deep"));
    check(&nodes(chain(200)), UNTOUCHED, node(39, "too deep"));
    // A part that nothing leads to is no deeper for that.
    let mut apart = vec![branch(&[])];
    apart.extend(chain(40).iter().map(|n| match Child::unpack(n.child[0]) {
        Child::Inner(next) => branch(&[Child::Inner(next + 1)]),
        other => branch(&[other]),
    }));
    check(&nodes(apart), UNTOUCHED, Ok(()));
}

#[test]
fn materials_that_are_not_there() {
    let lines = Parts { materials: vec![7], ..sample() }.lines();
    let with = |materials| PageView::parse(&lines, Tables { materials }).map(|_| ());
    assert_eq!(with(8), Ok(()));
    assert_eq!(with(7), Err(PageError::Material(7)));
    assert_eq!(with(0), Err(PageError::Material(7)));
}

#[test]
fn slots_and_children_come_back() {
    for kind in [Kind::Triangle, Kind::Sphere, Kind::Cone] {
        for number in [0, 1, 5, 1000, 6543, 16_383] {
            let slot = Slot::new(kind, number);
            assert_eq!((slot.kind(), slot.number()), (kind, number));
        }
        for (start, count) in [(0, 1), (3, 16), ((1 << 24) - 1, 7)] {
            assert_eq!(Child::unpack(leaf(kind, start, count).pack()), leaf(kind, start, count));
        }
    }
    for child in [Child::Inner(0), Child::Inner(Child::INDEX_MAX - 1), Child::Page(0), Child::Page(77), Child::Unused] {
        assert_eq!(Child::unpack(child.pack()), child);
    }
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
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut lines);
        for word in words.iter_mut() {
            let shift = 32 - bits() % 32;
            *word = bits().checked_shr(shift).unwrap_or(0);
        }
        words[0] = hybray_scene::Header::MAGIC;
        // Counts that add up, half of the time.
        if round % 2 == 0 {
            let counts = [1 + bits() % 4, bits() % 3, bits() % 3, bits() % 3, 0, 1];
            words[2..8].copy_from_slice(&counts);
            words[1] = 64 + 224 * counts[0] + 160 * counts[1] + 80 * counts[2] + 36 * counts[3] + 2;
        }
        taken += usize::from(parse(&lines).is_ok());
    }
    eprintln!("{taken} of 50,000 blocks of noise are pages");
}
