//! `check` can fail: trees are broken in every way that it knows, and it says which.

mod common;

use bytemuck::cast_slice_mut;
use common::scenes::mixed;
use common::{Built, Rule, Shapes, build, checked};
use hybray_bintree::check::{Coverage, Fault, check};
use hybray_bintree::walk::Resident;
use hybray_bintree::{midpoint, sah};
use hybray_scene::{Child, Directory, HEADER_BYTES, Header, Line, Node, PageView, Tables};

const COUNT: usize = 400;

fn built(rule: Rule) -> Built {
    let built = build(&Shapes::new(mixed(COUNT, 8)), rule, 4096).unwrap();
    assert!(built.pages.len() > 4 && fault(&built).is_none());
    built
}

fn trees() -> [Built; 2] {
    [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 4)].map(built)
}

fn fault(built: &Built) -> Option<Fault> {
    let views = built.views();
    // As it is: `Directory::parse` refuses some of these, too.
    let directory = Directory { nodes: &built.nodes, entries: &built.entries };
    checked(&Resident { directory, pages: &views[..] }, COUNT).err()
}

fn nodes(page: &mut [Line]) -> &mut [Node] {
    let bytes: &mut [u8] = cast_slice_mut(page);
    let (header, rest) = bytes.split_at_mut(HEADER_BYTES);
    let header: &Header = bytemuck::from_bytes(header);
    cast_slice_mut(&mut rest[..header.nodes as usize * size_of::<Node>()])
}

/// A child of `node` for which `wanted` holds.
fn slot(node: &Node, wanted: impl Fn(Child) -> bool) -> Option<usize> {
    node.children().find(|&(_, child)| wanted(child)).map(|(slot, _)| slot)
}

const fn is_leaf(child: Child) -> bool {
    matches!(child, Child::Leaf { .. })
}

#[test]
fn a_box_that_does_not_hold_its_child() {
    for built in trees() {
        for page in 0..built.pages.len() {
            let mut broken = built.pages.clone();
            let Some((index, at)) = nodes(&mut broken[page])
                .iter()
                .enumerate()
                .find_map(|(i, n)| slot(n, |c| matches!(c, Child::Inner(_))).map(|s| (i, s)))
            else {
                continue;
            };
            let node = &mut nodes(&mut broken[page])[index];
            node.hi[1][at] = node.hi[1][at].next_down();
            let found =
                fault(&Built { pages: broken, nodes: built.nodes.clone(), entries: built.entries.clone(), ..built });
            assert_eq!(found, Some(Fault::Box { page: Some(page as u32), node: index, slot: at }));
        }
    }
}

#[test]
fn a_directory_box_that_does_not_hold_its_page() {
    for mut built in trees() {
        let last = built.nodes.len() - 1;
        built.nodes[last].lo[2][0] = built.nodes[last].lo[2][0].next_up();
        assert_eq!(fault(&built), Some(Fault::Box { page: None, node: last, slot: 0 }));
    }
}

#[test]
fn a_leaf_box_far_from_its_primitives() {
    for mut built in trees() {
        let node = &mut nodes(&mut built.pages[1])[0];
        let at = slot(node, is_leaf).unwrap();
        for axis in 0..3 {
            (node.lo[axis][at], node.hi[axis][at]) = (9.0, 9.5);
        }
        // The directory's boxes are around the old place.
        assert!(matches!(fault(&built), Some(Fault::Box { page: None, .. })));
        for node in &mut built.nodes {
            node.lo = [[-10.0; 8]; 3];
            node.hi = [[10.0; 8]; 3];
        }
        assert_eq!(fault(&built), Some(Fault::Box { page: Some(1), node: 0, slot: at }));
    }
}

#[test]
fn a_leaf_that_is_gone() {
    for mut built in trees() {
        let node = &mut nodes(&mut built.pages[2])[0];
        let at = slot(node, is_leaf).unwrap();
        node.child[at] = Child::Unused.pack();
        assert!(matches!(fault(&built), Some(Fault::Primitive { .. })), "{:?}", fault(&built));
    }
}

/// Less than the whole: one cell of a primitive that several share.
#[test]
fn a_part_of_a_primitive_that_is_gone() {
    let mut built = built(Rule::Sah(sah::Settings::default()));
    let node = &mut nodes(&mut built.pages[0])[0];
    let at = slot(node, is_leaf).unwrap();
    let (lo, hi) = (node.lo[0][at], node.hi[0][at]);
    node.hi[0][at] = lo + (hi - lo) * 0.999;
    let found = fault(&built);
    assert!(matches!(found, Some(Fault::Primitive { .. } | Fault::Box { page: Some(0), .. })), "{found:?}");
}

#[test]
fn a_primitive_that_never_was() {
    let built = built(Rule::Sah(sah::Settings::default()));
    let views = built.views();
    assert_eq!(checked(&built.resident(&views), COUNT + 1), Err(Fault::Primitive { id: COUNT as u32 }));
}

#[test]
fn a_page_twice_or_never() {
    for mut built in trees() {
        let last = built.nodes.len() - 1;
        let pages: Vec<usize> = built.nodes[last]
            .children()
            .filter_map(|(slot, child)| matches!(child, Child::Page(_)).then_some(slot))
            .collect();
        let Child::Page(lost) = Child::unpack(built.nodes[last].child[pages[1]]) else { unreachable!() };
        let mut doubled = built.nodes.clone();
        let whole = doubled[last].aabb(pages[0]).union(&doubled[last].aabb(pages[1]));
        let twice = Child::unpack(doubled[last].child[pages[0]]);
        doubled[last].set(pages[1], &whole, twice);
        let Child::Page(kept) = twice else { unreachable!() };
        let found =
            fault(&Built { pages: built.pages.clone(), nodes: doubled, entries: built.entries.clone(), ..built });
        let (page, times) = if kept < lost { (kept, 2) } else { (lost, 0) };
        assert_eq!(found, Some(Fault::Page { page, times }));

        built.nodes[last].child[pages[1]] = Child::Unused.pack();
        assert_eq!(fault(&built), Some(Fault::Page { page: lost, times: 0 }));
    }
}

#[test]
fn too_little_scratch() {
    let built = built(Rule::Sah(sah::Settings::default()));
    let views = built.views();
    let found = check(&built.resident(&views), &mut [Coverage::NONE; COUNT], &mut [0; 2]);
    assert_eq!(found, Err(Fault::Scratch { needed: views.len() }));
}

/// And the reader refuses what the check need never see.
#[test]
fn a_broken_reference_is_no_page() {
    let mut built = built(Rule::Sah(sah::Settings::default()));
    let node = &mut nodes(&mut built.pages[0])[0];
    let at = slot(node, is_leaf).unwrap();
    node.child[at] = Child::Inner(0).pack();
    assert!(PageView::parse(&built.pages[0], Tables { materials: 1 }).is_err());
}
