//! Directories by hand: what is one, and every reason why nodes are none.

mod common;

use common::{branch, chain, leaf};
use hybray_scene::{Child, Directory, DirectoryError, Kind, Node, PageEntry};

const PAGE: PageEntry = PageEntry { bytes: 4096, owner: 3, kind: 0 };

fn check(nodes: &[Node], entries: &[PageEntry], expected: Result<(), DirectoryError>) {
    let mut level = vec![9; nodes.len()];
    assert_eq!(Directory::parse(nodes, entries, &mut level).map(|_| ()), expected);
}

fn node(node: usize, what: &'static str) -> Result<(), DirectoryError> {
    Err(DirectoryError::Node { node, what })
}

#[test]
fn directories() {
    check(&[], &[], Ok(()));
    check(&[branch(&[Child::Page(0)])], &[PAGE], Ok(()));
    check(&[branch(&[Child::Page(1), Child::Inner(1)]), branch(&[Child::Page(0)])], &[PAGE; 2], Ok(()));
    // A page that no node leads to, or two do: a walk ends all the same. `check` of hybray-bintree finds these.
    check(&[branch(&[Child::Page(0), Child::Page(0)])], &[PAGE; 2], Ok(()));
    check(&chain(40), &[], Ok(()));
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
fn scratch_is_one_byte_a_node() {
    let nodes = chain(5);
    let expected = DirectoryError::Node { node: 4, what: "more nodes than there is scratch for" };
    assert_eq!(Directory::parse(&nodes, &[], &mut [0; 4]).map(|_| ()), Err(expected));
    assert!(Directory::parse(&nodes, &[], &mut [0; 60]).is_ok());
}
