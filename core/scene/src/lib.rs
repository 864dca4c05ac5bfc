//! The page format, the directory, and what a scene requires.
//!
//! A **page** is a position-independent little-endian block of at most 64 KiB: a subtree of wide nodes and its
//! primitives, or a rectangle of texels. It is read in place where it lands; [`PageView::parse`] or [`Texels::parse`] validates
//! it, once, on arrival. The **directory** is the top of the tree: wide nodes of the same form, whose leaves are pages.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(not(target_endian = "little"))]
compile_error!("pages are little-endian blocks that are read in place");

mod directory;
mod form;
mod node;
mod page;
mod primitives;
mod texels;

pub use directory::{Directory, DirectoryError, NO_PARENT, PageEntry, Pages, parents};
pub use form::{Body, Compact, CompactNode, CompactTriangles, Form, Full, PageForm};
pub use node::{Child, Node, Row, WIDTH};
pub use page::{
    Colours, Coordinates, HEADER_BYTES, Header, Line, PAGE_BYTES_MAX, PageError, PageView, Tables, lines_for,
};
pub use primitives::{BLOCK, ConeRecord, Kind, Slot, SphereBlock, TriangleBlock};
pub use texels::{TexelHeader, Texels, texel_page_bytes, texel_square};

/// Levels of wide nodes in a page, and in a directory, at most: what bounds every walk's stack.
pub const DEPTH_MAX: usize = 40;
