//! Film files: the finished tiles of a picture that is not finished, so that it can go on later.
//!
//! [`Save`] writes one while the picture is drawn, [`Kept`] reads it. `docs/FILM.md` is the format.

mod header;
mod read;
mod save;
#[cfg(test)]
mod tests;

pub use header::Subject;
pub use read::{FilmFileError, Kept};
pub use save::Save;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Where the film of the picture at `picture` is kept: beside it, with `.film` after its name. None for standard output,
/// pipes and devices.
#[must_use]
pub fn path_for(picture: &Path) -> Option<PathBuf> {
    let file = picture != Path::new("-") && std::fs::metadata(picture).map_or(true, |about| about.is_file());
    file.then(|| {
        let mut name = OsString::from(picture);
        name.push(".film");
        name.into()
    })
}

/// The same for one of several pictures that go into one file: `a.exr.albedo.film`.
#[must_use]
pub fn path_for_part(picture: &Path, part: &str) -> Option<PathBuf> {
    path_for(picture)?;
    let mut name = OsString::from(picture);
    name.push(format!(".{part}.film"));
    Some(name.into())
}

/// Words of 64 bits that a bit for each tile takes.
fn words_for(tiles: u32) -> usize {
    tiles.div_ceil(64) as usize
}

/// The tiles whose bit is set, in order.
fn tiles_of(bits: &[u64]) -> impl Iterator<Item = u32> + '_ {
    (0..)
        .zip(bits)
        .flat_map(|(word, &bits)| (0..64).filter(move |bit| bits >> bit & 1 == 1).map(move |bit| 64 * word + bit))
}

/// Bytes of a pixel: three sums.
const PIXEL_BYTES: usize = 24;
/// Bytes of the hash at the end.
const HASH_BYTES: usize = 8;
