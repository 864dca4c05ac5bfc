//! Pictures from the bytes of files, with limits.

use super::{Image, SIZE_MAX};
use hybray_shading::{Format, to_shared_exponent};
use image::{DynamicImage, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Bytes that a picture may take while it is read.
const BYTES_MAX: u64 = 1 << 30;
/// File names of pictures of colours end so.
pub const LDR_EXTENSIONS: [&str; 6] = ["png", "jpg", "jpeg", "tga", "bmp", "webp"];
/// Those of light.
pub const HDR_EXTENSIONS: [&str; 2] = ["hdr", "exr"];

/// Why bytes are no picture.
#[derive(Debug, thiserror::Error)]
pub enum Complaint {
    /// What the decoder says.
    #[error("{0}")]
    Broken(#[from] image::ImageError),
    /// A kind that is not known here.
    #[error("neither PNG, JPEG, TGA, BMP, WebP, Radiance HDR nor OpenEXR; convert it to one of them")]
    Unknown,
    /// Too large, or nothing.
    #[error("{0} x {1} texels; a texture has 1 to 65,535 columns and rows")]
    Size(u32, u32),
}

/// The picture in `bytes`, and whether it is one of light ([`Format::SharedExponent`]) or of colours ([`Format::Srgb`]). TGA has no
/// mark at its beginning: `extension`, that of its file's name, tells it.
///
/// # Errors
/// See [`Complaint`].
pub fn decode(bytes: &[u8], extension: Option<&str>) -> Result<(Image, Format), Complaint> {
    let named = extension.and_then(ImageFormat::from_extension);
    let known = [
        ImageFormat::Png,
        ImageFormat::Jpeg,
        ImageFormat::Tga,
        ImageFormat::Bmp,
        ImageFormat::WebP,
        ImageFormat::Hdr,
        ImageFormat::OpenExr,
    ];
    let format = image::guess_format(bytes).ok().or(named).filter(|f| known.contains(f)).ok_or(Complaint::Unknown)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIZE_MAX);
    limits.max_image_height = Some(SIZE_MAX);
    limits.max_alloc = Some(BYTES_MAX);
    reader.limits(limits);
    let picture = reader.decode()?;
    let (width, height) = (picture.width(), picture.height());
    let side = |n: u32| u16::try_from(n).ok().filter(|&n| n > 0).ok_or(Complaint::Size(width, height));
    let (columns, rows) = (side(width)?, side(height)?);
    Ok(match picture {
        light @ (DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_)) => {
            let light = light.into_rgb32f();
            let texels = light.pixels().map(|p| to_shared_exponent(p.0).to_le_bytes()).collect();
            (Image { width: columns, height: rows, texels }, Format::SharedExponent)
        }
        colours => {
            let colours = colours.into_rgba8();
            (Image { width: columns, height: rows, texels: colours.pixels().map(|p| p.0).collect() }, Format::Srgb)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, Rgba, RgbaImage};

    fn colours() -> RgbaImage {
        RgbaImage::from_fn(5, 3, |x, y| Rgba([x as u8 * 50, y as u8 * 100, 7, 255]))
    }

    #[test]
    fn kinds_by_their_bytes() {
        let wanted: Vec<[u8; 4]> = colours().pixels().map(|p| p.0).collect();
        for (format, extension) in [(ImageFormat::Png, None), (ImageFormat::Tga, Some("tga")), (ImageFormat::Bmp, None)]
        {
            let mut bytes = Cursor::new(Vec::new());
            colours().write_to(&mut bytes, format).unwrap();
            let (image, format) = decode(bytes.get_ref(), extension).unwrap();
            assert_eq!((image.width, image.height, format), (5, 3, Format::Srgb));
            assert_eq!(image.texels, wanted);
            for cut in 0..bytes.get_ref().len() {
                let _ = decode(&bytes.get_ref()[..cut], extension);
            }
        }
        let light = image::ImageBuffer::from_fn(4, 2, |x, y| Rgb([x as f32, y as f32 * 100.0, 0.25]));
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::ImageRgb32F(light).write_to(&mut bytes, ImageFormat::Hdr).unwrap();
        let (image, format) = decode(bytes.get_ref(), None).unwrap();
        assert_eq!((image.width, image.height, format), (4, 2, Format::SharedExponent));
        let [r, g, b] = hybray_shading::from_shared_exponent(u32::from_le_bytes(image.get(3, 1)));
        assert!((r - 3.0).abs() < 0.5 && (g - 100.0).abs() < 0.5 && (b - 0.25).abs() < 0.5, "{r} {g} {b}");
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        assert!(matches!(decode(b"", None), Err(Complaint::Unknown)));
        assert!(matches!(decode(b"solid nonsense", Some("dds")), Err(Complaint::Unknown)));
        assert!(matches!(decode(b"solid nonsense", Some("png")), Err(Complaint::Broken(_))));
        // A header that asks for 4 GiB.
        let mut bytes = Cursor::new(Vec::new());
        colours().write_to(&mut bytes, ImageFormat::Png).unwrap();
        let mut bytes = bytes.into_inner();
        bytes[16..24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
        assert!(decode(&bytes, None).is_err());
    }
}
