//! Pictures as bytes: PNG, EXR and PPM.
//!
//! Rows are encoded one after another, so that the only whole copy of a picture is the picture. The bytes depend on
//! nothing but the picture, the exposure and the format.

use std::io::{self, Seek, Write};

use exr::prelude::{
    Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, SpecificChannels, Vec2, WritableImage,
};

use super::{Format, Picture, encode_srgb8, encode_srgb16};

/// Writes `picture`, which has been checked, in a format that needs no seeking.
///
/// # Errors
/// What the writer says, or an encoder.
pub(super) fn stream(picture: &Picture, exposure: f32, format: Format, to: &mut dyn Write) -> io::Result<()> {
    match format {
        Format::Png8 => png(picture, exposure, png::BitDepth::Eight, to),
        Format::Png16 => png(picture, exposure, png::BitDepth::Sixteen, to),
        Format::Ppm => ppm(picture, exposure, to),
        Format::Exr => {
            let mut bytes = io::Cursor::new(Vec::new());
            exr(picture, &mut bytes)?;
            to.write_all(bytes.get_ref())
        }
    }
}

/// Writes `picture` as EXR: the radiance as it is. Exposure is for display, where EXR's viewers have their own, so it
/// is neither applied nor stored.
pub(super) fn exr(picture: &Picture, to: &mut (impl Write + Seek)) -> io::Result<()> {
    let width = picture.width as usize;
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| {
        let pixel = picture.rgb.get(3 * (at.y() * width + at.x())..);
        match pixel {
            Some(&[r, g, b, ..]) => (r, g, b),
            _ => (0.0, 0.0, 0.0),
        }
    });
    let encoding =
        Encoding { compression: Compression::ZIP16, line_order: LineOrder::Increasing, ..Encoding::default() };
    let size = (width, picture.height as usize);
    Image::from_layer(Layer::new(size, LayerAttributes::default(), encoding, channels))
        .write()
        .non_parallel()
        .to_buffered(to)
        .map_err(|error| match error {
            exr::error::Error::Io(error) => error,
            other => io::Error::other(other),
        })
}

/// Keeps a writer's first error: the crate png hands errors on as text, without their kind, and a closed pipe and a full
/// disk are told apart by that.
struct Keep<'a> {
    to: &'a mut dyn Write,
    error: Option<io::Error>,
}

impl Keep<'_> {
    fn keep<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            if kind != io::ErrorKind::Interrupted {
                self.error.get_or_insert(error);
            }
            kind.into()
        })
    }
}

impl Write for Keep<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let result = self.to.write(bytes);
        self.keep(result)
    }

    fn flush(&mut self) -> io::Result<()> {
        let result = self.to.flush();
        self.keep(result)
    }
}

fn png(picture: &Picture, exposure: f32, depth: png::BitDepth, to: &mut dyn Write) -> io::Result<()> {
    let mut keep = Keep { to, error: None };
    png_rows(picture, exposure, depth, &mut keep).map_err(|error| keep.error.take().unwrap_or(error))
}

fn png_rows(picture: &Picture, exposure: f32, depth: png::BitDepth, to: &mut dyn Write) -> io::Result<()> {
    let mut encoder = png::Encoder::new(to, picture.width, picture.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(depth);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    let mut writer = encoder.write_header().map_err(png_error)?;
    let mut rows = writer.stream_writer().map_err(png_error)?;
    let mut bytes = Vec::new();
    for row in picture.rgb.chunks(3 * picture.width as usize) {
        bytes.clear();
        for &value in row {
            match depth {
                png::BitDepth::Sixteen => bytes.extend(encode_srgb16(value * exposure).to_be_bytes()),
                _ => bytes.push(encode_srgb8(value * exposure)),
            }
        }
        rows.write_all(&bytes)?;
    }
    rows.finish().map_err(png_error)?;
    writer.finish().map_err(png_error)
}

fn png_error(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

fn ppm(picture: &Picture, exposure: f32, to: &mut dyn Write) -> io::Result<()> {
    write!(to, "P6\n{} {}\n255\n", picture.width, picture.height)?;
    let mut bytes = Vec::new();
    for row in picture.rgb.chunks(3 * picture.width as usize) {
        bytes.clear();
        bytes.extend(row.iter().map(|&value| encode_srgb8(value * exposure)));
        to.write_all(&bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers};

    /// Values below, in and above the range of display, an odd width and more rows than a ZIP block of EXR.
    fn picture() -> Picture {
        let (width, height) = (7, 37);
        let rgb = (0..3 * width * height).map(|i| (i as f32 - 20.0) / 500.0).collect();
        Picture { width, height, rgb }
    }

    fn bytes(picture: &Picture, exposure: f32, format: Format) -> Vec<u8> {
        let mut bytes = Vec::new();
        stream(picture, exposure, format, &mut bytes).unwrap();
        bytes
    }

    fn decode_png(bytes: &[u8]) -> (png::OutputInfo, Option<png::SrgbRenderingIntent>, Vec<u8>) {
        let mut reader = png::Decoder::new(io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info, reader.info().srgb, pixels)
    }

    #[test]
    fn png_8_bit_comes_back() {
        let picture = picture();
        for exposure in [1.0, 2.5] {
            let (info, srgb, pixels) = decode_png(&bytes(&picture, exposure, Format::Png8));
            assert_eq!((info.width, info.height), (7, 37));
            assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
            assert!(srgb.is_some());
            let expected: Vec<u8> = picture.rgb.iter().map(|&v| encode_srgb8(v * exposure)).collect();
            assert_eq!(pixels, expected);
        }
    }

    #[test]
    fn png_16_bit_comes_back() {
        let picture = picture();
        let (info, srgb, pixels) = decode_png(&bytes(&picture, 1.0, Format::Png16));
        assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Sixteen));
        assert!(srgb.is_some());
        let pixels: Vec<u16> = pixels.chunks(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
        let expected: Vec<u16> = picture.rgb.iter().map(|&v| encode_srgb16(v)).collect();
        assert_eq!(pixels, expected);
    }

    #[test]
    fn exr_comes_back_bit_for_bit_whatever_the_exposure() {
        let mut picture = picture();
        picture.rgb[5] = 1e30;
        picture.rgb[6] = f32::from_bits(1);
        let file = bytes(&picture, 3.0, Format::Exr);
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                |size, _| vec![0.0f32; 3 * size.area()],
                |pixels: &mut Vec<f32>, at, (r, g, b): (f32, f32, f32)| {
                    let i = 3 * (at.y() * 7 + at.x());
                    pixels[i..i + 3].copy_from_slice(&[r, g, b]);
                },
            )
            .first_valid_layer()
            .all_attributes()
            .from_buffered(io::Cursor::new(&file))
            .unwrap();
        let layer = image.layer_data;
        assert_eq!(layer.size, Vec2(7, 37));
        assert_eq!(layer.encoding.compression, Compression::ZIP16);
        assert_eq!(layer.channel_data.pixels, picture.rgb);
        assert_eq!(file, bytes(&picture, 1.0, Format::Exr));
    }

    #[test]
    fn ppm_is_a_header_and_bytes() {
        let picture = Picture { width: 2, height: 1, rgb: vec![0.0, 0.25, 0.5, 1.0, -1.0, f32::NAN] };
        let mut expected = b"P6\n2 1\n255\n".to_vec();
        expected.extend([0, 188, 255, 255, 0, 0]);
        assert_eq!(bytes(&picture, 2.0, Format::Ppm), expected);
    }

    #[test]
    fn one_pixel_of_each() {
        let picture = Picture { width: 1, height: 1, rgb: vec![0.5; 3] };
        for format in [Format::Png8, Format::Png16, Format::Exr, Format::Ppm] {
            assert!(!bytes(&picture, 1.0, format).is_empty());
        }
    }
}
