//! Directories by hand: what is one, and every reason why nodes are none.

mod common;

use common::{branch, chain, leaf};
use hybray_scene::{Child, Directory, DirectoryError, Kind, Node, PageEntry};

const PAGE: PageEntry = PageEntry { bytes: 4096, owner: 3, kind: 0 };

fn check(nodes: &[Node], entries: &[PageEntry], expected: Result<(), DirectoryError>) {
    let mut scratch = vec![9; nodes.len() + entries.len()];
    assert_eq!(Directory::parse(nodes, entries, &mut scratch).map(|_| ()), expected);
}

fn node(node: usize, what: &'static str) -> Result<(), DirectoryError> {
    Err(DirectoryError::Node { node, what })
}

#[test]
fn directories() {
    check(&[], &[], Ok(()));
    check(&[branch(&[Child::Page(0)])], &[PAGE], Ok(()));
    check(&[branch(&[Child::Page(1), Child::Inner(1)]), branch(&[Child::Page(0)])], &[PAGE; 2], Ok(()));
    check(&chain(40), &[], Ok(()));
}

#[test]
fn one_node_leads_to_each_page() {
    let page = |page, what| Err(DirectoryError::Page { page, what });
    let (twice, never) = ("it is led to more than once", "no node leads to it");
    check(&[branch(&[Child::Page(0), Child::Page(0)])], &[PAGE], page(0, twice));
    let apart = [branch(&[Child::Page(1), Child::Inner(1), Child::Page(0)]), branch(&[Child::Page(1)])];
    check(&apart, &[PAGE; 2], page(1, twice));
    check(&apart, &[PAGE; 3], page(1, twice));
    check(&[branch(&[Child::Page(0), Child::Page(2)])], &[PAGE; 3], page(1, never));
    check(&[], &[PAGE], page(0, never));
}

#[test]
fn nodes_that_lead_astray() {
    check(&[branch(&[Child::Page(1)])], &[PAGE], node(0, "a page that is not in the directory"));
    check(&[branch(&[Child::Page(Child::INDEX_MAX - 1)])], &[PAGE], node(0, "a page that is not in the directory"));
    check(&[branch(&[leaf(Kind::Sphere, 0, 1)])], &[PAGE], node(0, "primitives outside a page"));
    check(&[branch(&[Child::Inner(0)])], &[], node(0, "a child that does not come after it"));
    check(&[branch(&[Child::Inner(7)])], &[], node(0, "a child that does not come after it"));
    let twice = [branch(&[Child::Inner(1), Child::Inner(1)]), branch(&[])];
    check(&twice, &[], node(0, "a child that has another parent"));
    check(&chain(41), &[], node(39, "too deep"));
    let mut odd = branch(&[]);
    odd.child[0] = u32::MAX;
    check(&[odd], &[], node(0, "an unknown kind of child"));
}

#[test]
fn pages_of_impossible_size() {
    for bytes in [0, 65_537, u32::MAX] {
        let entries = [PAGE, PageEntry { bytes, ..PAGE }];
        check(&[branch(&[Child::Page(0)])], &entries, Err(DirectoryError::Size { page: 1, bytes }));
    }
    for bytes in [1, 65_536] {
        check(&[branch(&[Child::Page(0)])], &[PageEntry { bytes, ..PAGE }], Ok(()));
    }
}

#[test]
fn scratch_is_one_byte_for_each_node_and_page() {
    let nodes = chain(5);
    let short = |node| Err(DirectoryError::Node { node, what: "more nodes and pages than there is scratch for" });
    assert_eq!(Directory::parse(&nodes, &[], &mut [0; 4]).map(|_| ()), short(4));
    assert_eq!(Directory::parse(&nodes, &[PAGE], &mut [0; 5]).map(|_| ()), short(5));
    assert!(Directory::parse(&nodes, &[], &mut [0; 60]).is_ok());
}
