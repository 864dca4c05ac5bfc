//! The directory: wide nodes over all pages, small enough for every node.

use crate::page::check_nodes;
use crate::{Child, Node, PAGE_BYTES_MAX, PageView, Texels, WIDTH};
use bytemuck::{Pod, Zeroable};

/// What is known of a page everywhere. Its box stands in the directory's nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PageEntry {
    /// Bytes of the page.
    pub bytes: u32,
    /// The node that keeps it.
    pub owner: u16,
    /// [`PageEntry::GEOMETRY`] or [`PageEntry::TEXELS`].
    pub kind: u16,
}

impl PageEntry {
    /// Nodes and primitives: a node of the directory leads to it. These pages come first.
    pub const GEOMETRY: u16 = 0;
    /// Texels: textures' tables lead to it.
    pub const TEXELS: u16 = 1;
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
    /// A page that not exactly one node leads to.
    #[error("page {page} of the directory: {what}")]
    Page {
        /// Its number.
        page: usize,
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
    /// Whether every page is always at hand.
    const ALL: bool = false;

    /// The page, if it is at hand.
    fn page(&self, number: u32) -> Option<PageView<'_>>;

    /// The same for rays that look for their nearest hit: some pages may be there for shadow rays alone.
    #[inline(always)]
    fn nearest(&self, number: u32) -> Option<PageView<'_>> {
        self.page(number)
    }

    /// The page, if it is one of texels and at hand.
    fn texels(&self, _number: u32) -> Option<Texels<'_>> {
        None
    }

    /// [`parents`] of the directory: what a walk needs to go on from a page. May be empty where every page is at hand.
    fn parents(&self) -> &[u32] {
        &[]
    }
}

impl Pages for [PageView<'_>] {
    const ALL: bool = true;

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
    /// Validates a directory: whatever the bytes, a walk of it ends, names only its pages, and finds its way back from a
    /// page by the one place that leads there. `scratch` is one byte for each node and page.
    ///
    /// # Errors
    /// See [`DirectoryError`].
    pub fn parse(nodes: &'a [Node], entries: &'a [PageEntry], scratch: &mut [u8]) -> Result<Self, DirectoryError> {
        let bytes = scratch.len();
        let Some((level, led_to)) = scratch
            .split_at_mut_checked(nodes.len())
            .and_then(|(level, rest)| Some((level, rest.get_mut(..entries.len())?)))
        else {
            return Err(DirectoryError::Node { node: bytes, what: "more nodes and pages than there is scratch for" });
        };
        led_to.fill(0);
        let mut twice = None;
        check_nodes(nodes.iter().map(|node| node.child), level, |child| match child {
            Child::Page(page) => {
                let times = led_to.get_mut(page as usize).ok_or("a page that is not in the directory")?;
                if core::mem::replace(times, 1) != 0 {
                    twice = twice.or(Some(page as usize));
                }
                Ok(())
            }
            _ => Err("primitives outside a page"),
        })
        .map_err(|(node, what)| DirectoryError::Node { node, what })?;
        if let Some(page) = entries.iter().position(|e| e.bytes == 0 || e.bytes as usize > PAGE_BYTES_MAX) {
            return Err(DirectoryError::Size { page, bytes: entries[page].bytes });
        }
        if let Some(page) = twice {
            return Err(DirectoryError::Page { page, what: "it is led to more than once" });
        }
        let mut last = PageEntry::GEOMETRY;
        for (page, (entry, times)) in entries.iter().zip(led_to).enumerate() {
            let before = core::mem::replace(&mut last, entry.kind);
            let what = match (entry.kind, times) {
                (PageEntry::GEOMETRY, 1) if before == PageEntry::TEXELS => "it comes after one with texels",
                (PageEntry::GEOMETRY, 1) | (PageEntry::TEXELS, 0) => continue,
                (PageEntry::GEOMETRY, _) => "no node leads to it",
                (PageEntry::TEXELS, _) => "a node leads to it, and it has texels",
                _ => "it is of a kind that is not known here",
            };
            return Err(DirectoryError::Page { page, what });
        }
        Ok(Self { nodes, entries })
    }
}
