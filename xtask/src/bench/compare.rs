//! Two pictures of the same size: how many pixels agree, and a picture of where they do not.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

use anyhow::Context as _;

/// Code values that may lie between two pictures of one thing, of 255.
pub const SLACK: u8 = 2;

/// How many times its size a difference is drawn.
const MAGNIFIED: u8 = 16;

/// A picture of 8 bits for red, green and blue, row after row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<[u8; 3]>,
}

impl Pixels {
    /// Reads a PNG of 8 bits, in RGB.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        Self::decode(path).with_context(|| format!("{}: it cannot be read", path.display()))
    }

    fn decode(path: &Path) -> anyhow::Result<Self> {
        let mut reader = png::Decoder::new(BufReader::new(File::open(path)?)).read_info()?;
        let mut bytes = vec![0; reader.output_buffer_size().context("it is too large")?];
        let info = reader.next_frame(&mut bytes)?;
        let kind = (info.color_type, info.bit_depth);
        anyhow::ensure!(kind == (png::ColorType::Rgb, png::BitDepth::Eight), "{kind:?} is not 8-bit RGB");
        let (rgb, _) = bytes[..info.buffer_size()].as_chunks();
        Ok(Self { width: info.width, height: info.height, rgb: rgb.to_vec() })
    }

    /// The same picture with its linear values encoded by the sRGB curve, as ours are.
    pub fn encoded(mut self) -> Self {
        let curve = |x: f64| if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        let encode = |value: &mut u8| *value = (255.0 * curve(f64::from(*value) / 255.0)).round() as u8;
        self.rgb.as_flattened_mut().iter_mut().for_each(encode);
        self
    }

    /// Writes a PNG of 8 bits.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        self.encode(path).with_context(|| format!("{}: it cannot be written", path.display()))
    }

    fn encode(&self, path: &Path) -> anyhow::Result<()> {
        let mut encoder = png::Encoder::new(BufWriter::new(File::create(path)?), self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.rgb.as_flattened())?;
        Ok(writer.finish()?)
    }
}

/// What two pictures have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Pixels all of whose channels differ by no more than [`SLACK`].
    pub agree: u64,
    /// All pixels.
    pub pixels: u64,
    /// The greatest difference of a channel, and its column and row: the first of equals.
    pub worst: (u8, u32, u32),
    /// The mean difference of a channel.
    pub mean: f64,
    /// Differences, magnified, on black.
    pub difference: Pixels,
}

impl Comparison {
    /// Compares pixel by pixel, channel by channel.
    ///
    /// # Errors
    /// When the sizes are not the same.
    pub fn of(a: &Pixels, b: &Pixels) -> anyhow::Result<Self> {
        let size = |p: &Pixels| format!("{} x {}", p.width, p.height);
        anyhow::ensure!((a.width, a.height) == (b.width, b.height), "{} is not {}", size(a), size(b));
        let (mut agree, mut worst, mut sum) = (0, (0, 0, 0), 0);
        let mut difference = a.clone();
        for (at, (pixel, other)) in (0..).zip(difference.rgb.iter_mut().zip(&b.rgb)) {
            let apart: [u8; 3] = std::array::from_fn(|c| pixel[c].abs_diff(other[c]));
            let most = apart[0].max(apart[1]).max(apart[2]);
            sum += apart.iter().map(|&channel| u64::from(channel)).sum::<u64>();
            agree += u64::from(most <= SLACK);
            if most > worst.0 {
                worst = (most, at % a.width, at / a.width);
            }
            *pixel = apart.map(|c| c.saturating_mul(MAGNIFIED));
        }
        let pixels = a.rgb.len() as u64;
        Ok(Self { agree, pixels, worst, mean: sum as f64 / (3 * pixels) as f64, difference })
    }

    /// Share of the pixels that agree.
    pub fn share(&self) -> f64 {
        self.agree as f64 / self.pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixels(rgb: &[[u8; 3]]) -> Pixels {
        Pixels { width: 2, height: rgb.len() as u32 / 2, rgb: rgb.to_vec() }
    }

    #[test]
    fn pixels_agree_by_their_worst_channel() {
        let a = pixels(&[[10, 20, 30], [0, 0, 0], [255, 0, 7], [1, 2, 3]]);
        let b = pixels(&[[12, 18, 31], [0, 3, 0], [0, 0, 7], [1, 2, 3]]);
        let found = Comparison::of(&a, &b).unwrap();
        assert_eq!((found.agree, found.pixels, found.worst), (2, 4, (255, 0, 1)));
        assert_eq!(found.difference, pixels(&[[32, 32, 16], [0, 48, 0], [255, 0, 0], [0, 0, 0]]));
        assert_eq!(found, Comparison { difference: found.difference.clone(), ..Comparison::of(&b, &a).unwrap() });
        assert_eq!((found.share(), found.mean), (0.5, (2 + 2 + 1 + 3 + 255) as f64 / 12.0));
    }

    #[test]
    fn linear_values_are_encoded() {
        assert_eq!(pixels(&[[0, 1, 55], [128, 254, 255]]).encoded(), pixels(&[[0, 13, 128], [188, 255, 255]]));
    }

    #[test]
    fn other_sizes_are_not_compared() {
        let a = pixels(&[[0; 3]; 4]);
        assert!(Comparison::of(&a, &Pixels { width: 1, height: 4, ..a.clone() }).is_err());
    }

    #[test]
    fn pictures_come_back_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let picture = pixels(&[[1, 2, 3], [250, 0, 9], [0; 3], [255; 3]]);
        picture.write(&path).unwrap();
        assert_eq!(Pixels::read(&path).unwrap(), picture);
        std::fs::write(&path, b"no picture").unwrap();
        assert!(format!("{:#}", Pixels::read(&path).unwrap_err()).contains("a.png"));
    }
}
