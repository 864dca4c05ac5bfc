//! `.hyb` files: a scene as pages, with everything that rendering needs beside them. `docs/HYB.md` has the format.
//!
//! A file is written front to back while the scene is built, so that its pages need not be in memory together, and appears
//! whole or not at all. When it is opened every byte of it is checked before it is used: whatever a file holds, the
//! result is a scene or an error that names the file and what is wrong with it.

mod header;
mod read;
mod tables;
mod write;

pub use read::{HybError, Packing, open};
pub use write::{Written, pack};

use std::path::Path;

/// Whether `source` is to be read as a packed scene.
#[must_use]
pub fn is_packed(source: &str) -> bool {
    Path::new(source).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("hyb"))
}
