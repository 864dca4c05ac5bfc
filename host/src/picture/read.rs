//! Pictures from files: PNG, EXR and PPM, into linear light.

use super::Picture;
use super::srgb::decode_srgb;
use hybray_wire::TileMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Reads a picture: by its extension `.exr` (the first layer with red, green and blue), else what its first bytes say. Alpha is left
/// out.
///
/// # Errors
/// One line that says what is wrong.
pub fn read(path: &Path) -> io::Result<Picture> {
    let mut file = BufReader::new(File::open(path)?);
    let picture = match file.fill_buf()? {
        [0x76, 0x2f, 0x31, 0x01, ..] => exr(path)?,
        [0x89, b'P', b'N', b'G', ..] => png(file)?,
        [b'P', b'6', ..] => ppm(file)?,
        _ => return Err(invalid("neither PNG, EXR nor binary PPM")),
    };
    picture.check().map_err(io::Error::other)?;
    Ok(picture)
}

fn invalid(what: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

/// Sides that a picture may have: looked at before there is room for it.
fn sides(width: usize, height: usize) -> io::Result<(u32, u32)> {
    let sides = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    sides
        .filter(|&(width, height)| TileMap::new(width, height).is_some())
        .ok_or_else(|| invalid(format!("{width} x {height} pixels are none, or more than a picture may have")))
}

fn png(file: impl BufRead + io::Seek) -> io::Result<Picture> {
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(invalid)?;
    let (width, height) = sides(reader.info().width as usize, reader.info().height as usize)?;
    let mut bytes = vec![0; reader.output_buffer_size().ok_or_else(|| invalid("more bytes than there can be"))?];
    let info = reader.next_frame(&mut bytes).map_err(invalid)?;
    let code: &dyn Fn(&[u8]) -> f32 = match info.bit_depth {
        png::BitDepth::Sixteen => &|b| decode_srgb(f64::from(u16::from_be_bytes([b[0], b[1]])) / 65535.0),
        _ => &|b| decode_srgb(f64::from(b[0]) / 255.0),
    };
    let size = if info.bit_depth == png::BitDepth::Sixteen { 2 } else { 1 };
    let samples = info.color_type.samples();
    let rgb = bytes[..info.buffer_size()]
        .chunks_exact(size * samples)
        .flat_map(|pixel| {
            // Grey is all three.
            [0, 1, 2].map(|channel| code(&pixel[if samples < 3 { 0 } else { channel * size }..]))
        })
        .collect();
    Ok(Picture { width, height, rgb })
}

fn ppm(mut file: impl BufRead) -> io::Result<Picture> {
    let mut number = || -> io::Result<usize> {
        let mut value = None;
        loop {
            let mut byte = [0];
            file.read_exact(&mut byte)?;
            match (byte[0], value) {
                (b'0'..=b'9', _) => {
                    let digit = usize::from(byte[0] - b'0');
                    value = Some(value.unwrap_or(0).min(1 << 40) * 10 + digit);
                }
                (b'#', None) => {
                    while byte[0] != b'\n' {
                        file.read_exact(&mut byte)?;
                    }
                }
                (_, Some(value)) => return Ok(value),
                (b'P' | b' ' | b'\t' | b'\r' | b'\n', None) => {}
                _ => return Err(invalid("no PPM header")),
            }
        }
    };
    // The 6 of `P6`, then what counts.
    number()?;
    let (width, height, top) = (number()?, number()?, number()?);
    let (width, height) = sides(width, height)?;
    if top != 255 {
        return Err(invalid(format!("a PPM with {top} for white; 255 can be read")));
    }
    let mut bytes = vec![0; 3 * width as usize * height as usize];
    file.read_exact(&mut bytes)?;
    Ok(Picture { width, height, rgb: bytes.iter().map(|&b| decode_srgb(f64::from(b) / 255.0)).collect() })
}

fn exr(path: &Path) -> io::Result<Picture> {
    let told = |error: exr::error::Error| match error {
        exr::error::Error::Io(error) => error,
        other => invalid(other.to_string()),
    };
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(told)?;
    for header in &meta.headers {
        sides(header.layer_size.width(), header.layer_size.height())?;
    }
    let image = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| Picture { width: size.width() as u32, height: size.height() as u32, rgb: vec![0.0; 3 * size.area()] },
        |picture, at, (r, g, b, _): (f32, f32, f32, f32)| {
            let first = 3 * (at.y() * picture.width as usize + at.x());
            picture.rgb[first..first + 3].copy_from_slice(&[r, g, b]);
        },
    );
    Ok(image.map_err(told)?.layer_data.channel_data.pixels)
}

#[cfg(test)]
mod tests {
    use super::super::{Format, Output};
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        let rgb: Vec<f32> = (0..5 * 3 * 3).map(|i| decode_srgb(f64::from(i * 5) / 255.0)).collect();
        let picture = Picture { width: 5, height: 3, rgb };
        for (name, sixteen_bit, slack) in
            [("a.png", false, 1e-6), ("b.png", true, 1e-6), ("a.ppm", false, 1e-6), ("a.exr", false, 0.0)]
        {
            let path = folder.path().join(name);
            let format = Format::of(&path, sixteen_bit).expect("known");
            Output::create(&path, format).expect("a file").write(&picture, 1.0).expect("written");
            let found = read(&path).expect(name);
            assert_eq!((found.width, found.height), (5, 3), "{name}");
            let worst = found.rgb.iter().zip(&picture.rgb).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= slack, "{name} {worst}");
            let whole = std::fs::read(&path).expect("bytes");
            for length in 0..whole.len() {
                std::fs::write(&path, &whole[..length]).expect("written");
                if let Ok(found) = read(&path) {
                    // A PNG may end early once its pixels are there.
                    assert!(length + 20 > whole.len() && found.rgb.len() == picture.rgb.len(), "{name} {length}");
                }
            }
        }
        let path = folder.path().join("c.ppm");
        std::fs::write(&path, "P6 # white\n99999999999999 99999999999999 255\n").expect("written");
        assert!(read(&path).expect_err("too large").to_string().contains("more than a picture may have"));
    }
}
