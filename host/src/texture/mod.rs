//! Pictures on surfaces: read, halved level by level, and cut into texel pages.

mod cells;
mod pages;
mod read;

pub use cells::cells;
pub use pages::pages;
pub use read::{Complaint, HDR_EXTENSIONS, LDR_EXTENSIONS, decode};

use hybray_shading::{Format, SRGB, Sampling, Wrap, from_shared_exponent, to_shared_exponent};
use rayon::prelude::*;
use std::sync::Arc;

/// Columns and rows of a picture at most: what a level's number of columns can say.
pub const SIZE_MAX: u32 = u16::MAX as u32;

/// The first level of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Columns, 1 to [`SIZE_MAX`].
    pub width: u16,
    /// Rows.
    pub height: u16,
    /// Row by row from the top.
    pub texels: Vec<[u8; 4]>,
}

impl Image {
    /// A picture of one texel.
    #[must_use]
    pub fn one(texel: [u8; 4]) -> Self {
        Self { width: 1, height: 1, texels: vec![texel] }
    }

    /// The value of each texel, computed from its column and row.
    #[must_use]
    pub fn from_fn(width: u16, height: u16, texel: impl Fn(usize, usize) -> [u8; 4] + Sync) -> Self {
        let columns = usize::from(width);
        let row = |y| (0..columns).map(move |x| (x, y));
        let texels = (0..usize::from(height)).into_par_iter().flat_map_iter(row).map(|(x, y)| texel(x, y)).collect();
        Self { width, height, texels }
    }

    /// The texel in a column and row; those beyond are the nearest.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> [u8; 4] {
        let (x, y) = (x.min(usize::from(self.width) - 1), y.min(usize::from(self.height) - 1));
        self.texels[y * usize::from(self.width) + x]
    }
}

/// A picture as materials use it.
#[derive(Clone, Debug)]
pub struct Texture {
    /// What the file calls it; used in messages.
    pub name: String,
    /// Shared by all that differ in what follows only.
    pub image: Arc<Image>,
    /// What its bytes are.
    pub format: Format,
    /// Beyond its edges: along a row, along a column.
    pub wrap: [Wrap; 2],
    /// Between texels, and between levels.
    pub sampling: Sampling,
}

impl Texture {
    /// Whether two show the same.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        let about = |t: &Self| (t.format, t.wrap, t.sampling);
        about(self) == about(other) && (Arc::ptr_eq(&self.image, &other.image) || self.image == other.image)
    }

    /// All levels, each half as wide and high as the one before.
    fn levels(&self) -> Vec<Image> {
        let mut levels = vec![self.image.as_ref().clone()];
        // The nearest texel of the first level is what who asks for it wants to see.
        loop {
            let last = &levels[levels.len() - 1];
            if (last.width, last.height) == (1, 1) {
                return levels;
            }
            levels.push(half(last, self.format));
        }
    }
}

/// A value that can be averaged.
fn value(texel: [u8; 4], format: Format) -> [f32; 4] {
    match format {
        Format::Srgb => {
            let [r, g, b, a] = texel;
            [SRGB[usize::from(r)], SRGB[usize::from(g)], SRGB[usize::from(b)], f32::from(a) / 255.0]
        }
        Format::Linear => texel.map(|c| f32::from(c) / 255.0),
        Format::SharedExponent => {
            let [r, g, b] = from_shared_exponent(u32::from_le_bytes(texel));
            [r, g, b, 1.0]
        }
    }
}

/// The texel with the nearest value.
fn texel(value: [f32; 4], format: Format) -> [u8; 4] {
    let step = |v: f32| (v * 255.0 + 0.5) as u8;
    match format {
        Format::Srgb => {
            let [r, g, b, a] = value;
            let nearest = |v: f32| {
                let above = SRGB.partition_point(|&s| s < v).min(255);
                let below = above.saturating_sub(1);
                (if v - SRGB[below] < SRGB[above] - v { below } else { above }) as u8
            };
            [nearest(r), nearest(g), nearest(b), step(a)]
        }
        Format::Linear => value.map(step),
        Format::SharedExponent => to_shared_exponent([value[0], value[1], value[2]]).to_le_bytes(),
    }
}

/// The next level: each texel is the mean of what it covers, also where columns or rows are odd.
fn half(image: &Image, format: Format) -> Image {
    let size = |n: u16| (n / 2).max(1);
    let (width, height) = (size(image.width), size(image.height));
    // First column or row that a texel covers, and how much of it and of the next ones.
    let cover = |at: usize, from: u16, to: u16| {
        let (from, to) = (usize::from(from), usize::from(to));
        let (start, end) = (at * from, (at + 1) * from);
        let first = start / to;
        (first..end.div_ceil(to)).map(move |i| (i, ((end.min((i + 1) * to)) - start.max(i * to)) as f32 / from as f32))
    };
    Image::from_fn(width, height, |x, y| {
        let mut sum = [0.0; 4];
        for (row, down) in cover(y, image.height, height) {
            for (column, across) in cover(x, image.width, width) {
                let value = value(image.get(column, row), format);
                (0..4).for_each(|c| sum[c] += value[c] * (across * down));
            }
        }
        texel(sum, format)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_keep_the_mean() {
        for (width, height) in [(8, 8), (7, 5), (1, 9), (3, 1)] {
            let image = Image::from_fn(width, height, |x, y| [(x * 31 + y * 17) as u8, 200, (y * 40) as u8, 255]);
            let mean = |image: &Image| {
                let mut sum = [0.0f64; 4];
                image.texels.iter().for_each(|&t| (0..4).for_each(|c| sum[c] += f64::from(t[c])));
                sum.map(|s| s / image.texels.len() as f64)
            };
            let (before, after) = (mean(&image), mean(&half(&image, Format::Linear)));
            (0..4).for_each(|c| assert!((before[c] - after[c]).abs() < 0.6, "{width} {height}: {before:?} {after:?}"));
        }
    }

    #[test]
    fn colours_are_averaged_as_light() {
        // Half black and half white is a grey of half the light, which sRGB has at 188.
        let checks = Image::from_fn(2, 2, |x, y| [if (x + y) % 2 == 0 { 0 } else { 255 }; 4]);
        assert_eq!(half(&checks, Format::Srgb).texels, [[188, 188, 188, 128]]);
        assert_eq!(half(&checks, Format::Linear).texels, [[128; 4]]);
        for step in 0..=255 {
            assert_eq!(texel(value([step, 0, 255, step], Format::Srgb), Format::Srgb), [step, 0, 255, step]);
        }
    }
}
