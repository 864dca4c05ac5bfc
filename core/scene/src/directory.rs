//! The directory: wide nodes over all pages, small enough for every node.

use crate::page::check_nodes;
use crate::{Child, Node, PAGE_BYTES_MAX, PageView, WIDTH};
use bytemuck::{Pod, Zeroable};

/// What is known of a page everywhere. Its box stands in the directory's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PageEntry {
    /// Bytes of the page.
    pub bytes: u32,
    /// The node that keeps it.
    pub owner: u16,
    /// 0: geometry.
    pub kind: u16,
}

const _: () = assert!(core::mem::size_of::<PageEntry>() == 8);

/// The top of the tree: 40 bytes a page if every node had eight children; 70 to 120 as trees are (docs/MEMORY.md).
#[derive(Clone, Copy, Debug)]
pub struct Directory<'a> {
    /// The root first; children after their parents; leaves are pages. Empty for an empty scene.
    pub nodes: &'a [Node],
    /// One for each page.
    pub entries: &'a [PageEntry],
}

/// Why this is no directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DirectoryError {
    /// A node that leads nowhere, backwards or too deep.
    #[error("node {node} of the directory is broken: {what}")]
    Node {
        /// Its index.
        node: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A page of an impossible size.
    #[error("page {page} of the directory has {bytes} bytes; a page has 1 to 65536")]
    Size {
        /// Its number.
        page: usize,
        /// What the directory says.
        bytes: u32,
    },
}

/// Pages by number: all of a scene's, or those at hand.
pub trait Pages {
    /// The page, if it is at hand.
    fn page(&self, number: u32) -> Option<PageView<'_>>;

    /// [`parents`] of the directory: what a walk needs to go on from a page. May be empty where every page is at hand.
    fn parents(&self) -> &[u32] {
        &[]
    }
}

impl Pages for [PageView<'_>] {
    #[inline(always)]
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.get(number as usize).copied()
    }
}

/// What stands for the parent of the root, and of a page that no node leads to.
pub const NO_PARENT: u32 = u32::MAX;

/// Fills `out`, of one number for each node and then one for each of the pages, with where each hangs: its parent's
/// index times 8, plus its slot there.
pub fn parents(nodes: &[Node], out: &mut [u32]) {
    out.fill(NO_PARENT);
    for (index, node) in nodes.iter().enumerate() {
        for (slot, child) in node.children() {
            let below = match child {
                Child::Inner(next) => next as usize,
                Child::Page(page) => nodes.len() + page as usize,
                Child::Leaf { .. } | Child::Unused => continue,
            };
            if let Some(parent) = out.get_mut(below) {
                *parent = (index * WIDTH + slot) as u32;
            }
        }
    }
}

impl<'a> Directory<'a> {
    /// Validates a directory: whatever the bytes, a walk of it ends and names only its pages. `level` is scratch, one
    /// byte a node.
    ///
    /// # Errors
    /// See [`DirectoryError`].
    pub fn parse(nodes: &'a [Node], entries: &'a [PageEntry], level: &mut [u8]) -> Result<Self, DirectoryError> {
        check_nodes(nodes, level, |child| match child {
            Child::Page(page) if (page as usize) < entries.len() => Ok(()),
            Child::Page(_) => Err("a page that is not in the directory"),
            _ => Err("primitives outside a page"),
        })
        .map_err(|(node, what)| DirectoryError::Node { node, what })?;
        match entries.iter().position(|e| e.bytes == 0 || e.bytes as usize > PAGE_BYTES_MAX) {
            Some(page) => Err(DirectoryError::Size { page, bytes: entries[page].bytes }),
            None => Ok(Self { nodes, entries }),
        }
    }
}
