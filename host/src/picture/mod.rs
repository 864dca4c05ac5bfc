//! Pictures: linear radiance in memory, and the files that it is written to.
//!
//! [`Output::create`] is called before any rendering, so that a wrong path costs nobody an hour; [`Output::write`] puts
//! the finished file in place in one step. What is written is sRGB in PNG and PPM, and the radiance itself in EXR.

mod compare;
mod encode;
mod flip;
mod layers;
mod output;
pub(crate) mod pending;
mod read;
mod srgb;

use std::io;
use std::path::{Path, PathBuf};

pub use compare::{Difference, difference};
pub use flip::{PIXELS_PER_DEGREE, flip};
pub use layers::{Channel, Values};
pub use output::Output;
pub use read::read;
pub use srgb::{decode_srgb, encode_srgb8, encode_srgb16};

/// A rendered picture: linear radiance, red, green and blue of Rec. 709.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `3 * width * height` values: red, green and blue of each pixel, row after row from the top, left to right.
    pub rgb: Vec<f32>,
}

impl Picture {
    /// Whether both sides are at least 1 and `rgb` has the length that they ask for.
    ///
    /// # Errors
    /// [`PictureError::Size`] if not.
    pub fn check(&self) -> Result<(), PictureError> {
        let values = u64::from(self.width) * u64::from(self.height);
        // 64 bits hold the product of two 32-bit sides, but not always three times that.
        let fits = values > 0 && values.checked_mul(3) == Some(self.rgb.len() as u64);
        if fits {
            Ok(())
        } else {
            Err(PictureError::Size { width: self.width, height: self.height, values: self.rgb.len() })
        }
    }
}

/// How a picture is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// PNG, sRGB, 8 bits a channel.
    Png8,
    /// PNG, sRGB, 16 bits a channel.
    Png16,
    /// OpenEXR: linear radiance as 32-bit floats, ZIP compression, without loss.
    Exr,
    /// Binary portable pixmap (`P6`), sRGB, 8 bits a channel.
    Ppm,
}

impl Format {
    /// The format that a file name asks for: `.png`, `.exr` or `.ppm` in upper or lower case, and PNG for `-`, which
    /// is standard output. `sixteen_bit` chooses between the two depths of PNG and changes nothing for the others.
    ///
    /// # Errors
    /// [`PictureError::Extension`] for any other name.
    pub fn of(path: &Path, sixteen_bit: bool) -> Result<Self, PictureError> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let png = if sixteen_bit { Self::Png16 } else { Self::Png8 };
        match extension.to_ascii_lowercase().as_str() {
            "png" => Ok(png),
            "exr" => Ok(Self::Exr),
            "ppm" => Ok(Self::Ppm),
            _ if path == Path::new("-") => Ok(png),
            _ => Err(PictureError::Extension { path: path.to_owned() }),
        }
    }
}

/// Why a picture cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The file name does not say which format is wanted.
    #[error("cannot tell the format of picture `{}` by its name: .png, .exr and .ppm work", path.display())]
    Extension {
        /// The path given.
        path: PathBuf,
    },
    /// The file cannot be created.
    #[error("cannot write picture `{}`: {source}", path.display())]
    Create {
        /// The path given.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Writing failed half-way; nothing was left at the path.
    #[error("picture `{}` could not be written: {source}", path.display())]
    Write {
        /// The path given.
        path: PathBuf,
        /// What the system or the encoder says.
        source: io::Error,
    },
    /// The picture is empty, or its values do not match its sides.
    #[error("a picture of {width} x {height} pixels with {values} values cannot be written")]
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Length of [`Picture::rgb`].
        values: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_by_name() {
        fn check(name: &str, sixteen_bit: bool, expected: Option<Format>) {
            let got = Format::of(Path::new(name), sixteen_bit);
            assert_eq!(got.as_ref().ok().copied(), expected, "{name}");
            if let Err(error) = got {
                let text = error.to_string();
                assert!([".png", ".exr", ".ppm", name].iter().all(|part| text.contains(part)), "{text}");
            }
        }
        check("a.png", false, Some(Format::Png8));
        check("a.png", true, Some(Format::Png16));
        check("A.PNG", false, Some(Format::Png8));
        check("a.b/c.exr", true, Some(Format::Exr));
        check("a.png.ppm", true, Some(Format::Ppm));
        check("-", false, Some(Format::Png8));
        check("-", true, Some(Format::Png16));
        check("a.jpg", false, None);
        check("png", false, None);
        check(".png", false, None);
        check("a.png/b", false, None);
        check("", false, None);
    }

    #[test]
    fn sizes() {
        fn check(width: u32, height: u32, values: usize, expected: bool) {
            let picture = Picture { width, height, rgb: vec![0.0; values] };
            assert_eq!(picture.check().is_ok(), expected, "{width} x {height}: {values}");
        }
        check(1, 1, 3, true);
        check(2, 3, 18, true);
        check(0, 0, 0, false);
        check(0, 5, 0, false);
        check(5, 0, 0, false);
        check(2, 3, 17, false);
        check(2, 3, 19, false);
        // 3 * 2^31 * 2^31 is more than 2^63; 3 * (2^32 - 1)^2 is more than 2^64.
        check(1 << 31, 1 << 31, 0, false);
        check(u32::MAX, u32::MAX, 3, false);
    }
}
