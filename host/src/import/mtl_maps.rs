//! MTL's pictures: what its `map_` statements say, and the textures that become of them.
//!
//! `map_Kd`, `map_Ks`, `map_Ke`, `map_d`, `map_Pr`, `map_Pm`, `bump` (`map_Bump`) and `norm` are used, with `-o`, `-s`, `-bm`, `-clamp` and
//! `-imfchan`; other options are read over. Coverage comes into the fourth channel of the colours' picture, roughness and
//! metalness into one of their own; a height becomes the slopes to the next texels. Two pictures in one are as large as the larger.

use super::error::{ImportError, Warnings, quote};
use super::gltf::picture_file;
use super::{Opened, mtl, open};
use crate::picture::encode_srgb8;
use crate::texture::{Image, Texture};
use hybray_shading::{Format, Map, Maps, Material, Sampling, Wrap, from_shared_exponent};
use std::path::Path;
use std::sync::Arc;

/// What a picture is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Of {
    Diffuse,
    Specular,
    Emission,
    Coverage,
    Roughness,
    Metalness,
    Bump,
    Normal,
}

impl Of {
    fn parse(key: &str) -> Option<Self> {
        Some(match key.to_ascii_lowercase().as_str() {
            "map_kd" => Self::Diffuse,
            "map_ks" => Self::Specular,
            "map_ke" => Self::Emission,
            "map_d" => Self::Coverage,
            "map_pr" => Self::Roughness,
            "map_pm" => Self::Metalness,
            "bump" | "map_bump" => Self::Bump,
            "norm" | "map_kn" => Self::Normal,
            _ => return None,
        })
    }
}

/// A picture that a material names.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Named {
    pub of: Of,
    pub file: String,
    offset: [f32; 2],
    scale: [f32; 2],
    clamp: bool,
    strength: f32,
    channel: char,
}

impl Named {
    /// What a statement says; `None` if it is of no picture that is used. The error is for a person.
    pub fn parse(key: &str, rest: &str) -> Option<Result<Self, String>> {
        Some(Self::parse_options(Of::parse(key)?, rest).map_err(|what| format!("{}: {what}", quote(key))))
    }

    fn parse_options(of: Of, rest: &str) -> Result<Self, String> {
        let mut named = Self {
            of,
            file: String::new(),
            offset: [0.0; 2],
            scale: [1.0; 2],
            clamp: false,
            strength: 1.0,
            channel: 'l',
        };
        let mut left = rest.trim();
        while let Some(option) = left.strip_prefix('-') {
            let (option, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
            left = after.trim_start();
            let mut word = || {
                let (word, after) = left.split_once(char::is_whitespace).unwrap_or((left, ""));
                left = after.trim_start();
                word
            };
            match option {
                "clamp" => named.clamp = word() == "on",
                "blendu" | "blendv" | "cc" | "texres" | "boost" | "type" => {
                    word();
                }
                "imfchan" => named.channel = word().chars().next().unwrap_or('l'),
                "bm" => {
                    let number = word();
                    named.strength = number_of(number).ok_or_else(|| format!("-bm {} is no number", quote(number)))?;
                }
                "mm" => {
                    word();
                    word();
                }
                "o" | "s" | "t" => {
                    // One to three numbers: the file's name is what is none.
                    let mut numbers = Vec::new();
                    while numbers.len() < 3 {
                        let (word, after) = left.split_once(char::is_whitespace).unwrap_or((left, ""));
                        let Some(number) = number_of(word).filter(|_| !after.is_empty()) else { break };
                        numbers.push(number);
                        left = after.trim_start();
                    }
                    let into = if option == "o" { &mut named.offset } else { &mut named.scale };
                    if option != "t" {
                        into.iter_mut().zip(numbers).for_each(|(to, from)| *to = from);
                    }
                }
                other => return Err(format!("the option -{other} is not known")),
            }
        }
        if left.is_empty() {
            return Err("no file is named".to_owned());
        }
        named.file = left.to_owned();
        Ok(named)
    }

    /// The file's coordinates run up, the picture's rows down.
    fn transform(&self) -> [f32; 6] {
        let ([s, t], [o, p]) = (self.scale, self.offset);
        [s, 0.0, o, 0.0, t, 1.0 - t - p]
    }
}

fn number_of(word: &str) -> Option<f32> {
    word.parse::<f32>().ok().filter(|n| n.is_finite() && n.abs() <= super::COORDINATE_MAX)
}

/// Textures of a material, in the order of [`Maps`].
pub(crate) type Pictures = [Option<(Texture, Map)>; 4];

/// Reads the pictures of a material, and says in its flags what becomes of them. What cannot be read is warned of.
pub(crate) fn read(folder: &Path, named: &[Named], material: &mut Material, warnings: &mut Warnings) -> Pictures {
    let mut found: Vec<(&Named, Image)> = Vec::new();
    for named in named {
        let path = folder.join(named.file.replace('\\', "/"));
        match picture_file(&path) {
            Ok((image, Format::SharedExponent)) => {
                let texels = image.texels.iter().map(|&t| faded(t)).collect();
                found.push((named, Image { texels, ..image }));
            }
            Ok((image, _)) => found.push((named, image)),
            Err(problem) => warnings.add(0, &format!("a picture is not used: {problem}")),
        }
    }
    let get = |of: Of| found.iter().rev().find(|(named, _)| named.of == of);
    let texture = |name: &Named, image: Image, format: Format| {
        let wrap = [if name.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let texture =
            Texture { name: name.file.clone(), image: Arc::new(image), format, wrap, sampling: Sampling::Trilinear };
        Some((texture, Map { texture: 0, transform: name.transform(), strength: name.strength }))
    };
    let mut pictures: Pictures = [const { None }; 4];
    let (diffuse, coverage) = (get(Of::Diffuse), get(Of::Coverage));
    pictures[Maps::BASE] = match (diffuse, coverage) {
        (None, None) => None,
        (Some((name, image)), None) => texture(name, image.clone(), Format::Srgb),
        (diffuse, Some((name, cover))) => {
            // A picture of its own says it by how light it is.
            let by_alpha = name.channel == 'm' || cover.texels.iter().any(|texel| texel[3] < u8::MAX);
            let joined = joined(diffuse.map(|(_, image)| image), Some(cover), |colour, cover| {
                let [r, g, b, _] = colour.unwrap_or([u8::MAX; 4]);
                [r, g, b, cover.map_or(u8::MAX, |texel| if by_alpha { texel[3] } else { grey(texel) })]
            });
            let partly = joined.texels.iter().filter(|texel| !matches!(texel[3], 0..16 | 240..)).count();
            // Where it is there or not, it is cut out; else light goes through.
            let cut = 50 * partly <= joined.texels.len();
            material.flags |= if cut { Material::CUTOUT } else { Material::BLEND };
            texture(diffuse.map_or(name, |(name, _)| name), joined, Format::Srgb)
        }
    };
    if material.flags & Material::PHYSICAL == 0 {
        pictures[Maps::SURFACE] =
            get(Of::Specular).and_then(|(name, image)| texture(name, image.clone(), Format::Srgb));
    } else if let Some((name, _)) = get(Of::Roughness).or(get(Of::Metalness)) {
        let value = |texel: Option<[u8; 4]>| texel.map_or(u8::MAX, grey);
        let (rough, metal) = (get(Of::Roughness), get(Of::Metalness));
        let image =
            joined(rough.map(|(_, i)| i), metal.map(|(_, i)| i), |rough, metal| [0, value(rough), value(metal), 255]);
        // The numbers beside them are of surfaces without pictures.
        material.exponent = if rough.is_some() { 1.0 } else { material.exponent };
        material.mirror = if metal.is_some() { [1.0; 3] } else { material.mirror };
        pictures[Maps::SURFACE] = texture(name, image, Format::Linear);
    }
    pictures[Maps::EMISSION] = get(Of::Emission).and_then(|(name, image)| texture(name, image.clone(), Format::Srgb));
    if pictures[Maps::EMISSION].is_some() && material.emission == [0.0; 3] {
        material.emission = [1.0; 3];
    }
    pictures[Maps::NORMAL] = match (get(Of::Normal), get(Of::Bump)) {
        (Some((name, image)), _) => texture(name, image.clone(), Format::Linear),
        (None, Some((name, image))) => {
            material.flags |= Material::BUMP;
            texture(name, slopes(image, name), Format::Linear)
        }
        (None, None) => None,
    };
    if pictures.iter().any(Option::is_some) {
        material.flags |= Material::DETAIL;
    }
    pictures
}

/// What a `mtllib` line brought.
pub(super) type Library = Result<(Vec<(String, Known)>, Vec<String>), MaterialFile>;

/// A material of a material file: it may have pictures.
#[derive(Clone)]
pub(super) struct Known {
    pub material: Material,
    pub maps: Maps,
    pub pictures: Arc<Pictures>,
}

impl Known {
    /// Without pictures.
    pub fn plain(material: Material) -> Self {
        Self { material, maps: Maps::EMPTY, pictures: Arc::default() }
    }

    /// Reads what stands in `folder`.
    pub fn all(folder: &Path, described: Vec<mtl::Described>, warnings: &mut Warnings) -> Vec<(String, Self)> {
        let known = described.into_iter().map(|(name, (mut material, maps), named)| {
            let pictures = Arc::new(read(folder, &named, &mut material, warnings));
            (name, Self { material, maps, pictures })
        });
        known.collect()
    }
}

/// Why it brought nothing.
pub(super) enum MaterialFile {
    Missing,
    Broken(ImportError),
}

pub(super) fn read_materials(folder: &Path, name: &str) -> Library {
    // Names are often written by a program for another system.
    let candidates = [name.to_owned(), name.replace('\\', "/")];
    for candidate in candidates {
        let path = folder.join(candidate);
        let file = path.display().to_string();
        match open(&path) {
            Ok(reader) => {
                let mut warnings = Warnings::default();
                let materials = mtl::read(reader, &file, &mut warnings).map_err(MaterialFile::Broken)?;
                let materials = Known::all(path.parent().unwrap_or(Path::new("")), materials, &mut warnings);
                return Ok((materials, warnings.lines(&file).collect()));
            }
            Err(Opened::Missing(_)) => {}
            Err(Opened::Empty) => return Ok((Vec::new(), vec![format!("{file}: the material file is empty")])),
            Err(other) => return Err(MaterialFile::Broken(other.into_error(&file))),
        }
    }
    Err(MaterialFile::Missing)
}

/// The mean of red, green and blue, encoded as they are.
fn grey([r, g, b, _]: [u8; 4]) -> u8 {
    ((u16::from(r) + u16::from(g) + u16::from(b) + 1) / 3) as u8
}

/// Light as a colour: what is brighter than white is white.
fn faded(texel: [u8; 4]) -> [u8; 4] {
    let [r, g, b] = from_shared_exponent(u32::from_le_bytes(texel)).map(encode_srgb8);
    [r, g, b, u8::MAX]
}

/// Two pictures as one, as large as the larger of them on each side.
fn joined(
    a: Option<&Image>,
    b: Option<&Image>,
    texel: impl Fn(Option<[u8; 4]>, Option<[u8; 4]>) -> [u8; 4] + Sync,
) -> Image {
    let side = |of: fn(&Image) -> u16| [a, b].into_iter().flatten().map(of).max().unwrap_or(1);
    let (width, height) = (side(|i| i.width), side(|i| i.height));
    let at = |image: Option<&Image>, x: usize, y: usize| {
        let there = |at: usize, own: u16, all: u16| at * usize::from(own) / usize::from(all);
        image.map(|i| i.get(there(x, i.width, width), there(y, i.height, height)))
    };
    Image::from_fn(width, height, |x, y| texel(at(a, x, y), at(b, x, y)))
}

/// Heights as [`Maps::NORMAL`] has them with [`Material::BUMP`]: half the difference of the texels around, along a row and down.
fn slopes(heights: &Image, named: &Named) -> Image {
    let (width, height) = (i64::from(heights.width), i64::from(heights.height));
    let wrap = if named.clamp { Wrap::Clamp } else { Wrap::Repeat };
    Image::from_fn(heights.width, heights.height, |x, y| {
        let at = |dx: i64, dy: i64| {
            let (x, y) = (wrap.texel(x as i64 + dx, width), wrap.texel(y as i64 + dy, height));
            i16::from(grey(heights.get(x as usize, y as usize)))
        };
        let slope = |ahead: i16, behind: i16| (128 + (ahead - behind) / 2).clamp(0, 255) as u8;
        [slope(at(1, 0), at(-1, 0)), slope(at(0, 1), at(0, -1)), 0, u8::MAX]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_stand_before_the_file() {
        let parse = |key: &str, rest: &str| Named::parse(key, rest).expect("of a picture");
        let named = parse("map_Kd", "-s 2 3 1 -o 0.5 0.25 -clamp on -blendu off a file.png").expect("is right");
        assert_eq!((named.of, named.file.as_str(), named.clamp), (Of::Diffuse, "a file.png", true));
        // At the lower left of the file's picture u and v are 0, and the last row is there.
        assert_eq!(named.transform(), [2.0, 0.0, 0.5, 0.0, 3.0, 1.0 - 3.0 - 0.25]);
        let bump = parse("map_Bump", "-bm 0.3 -imfchan l 2.png").expect("is right");
        assert_eq!((bump.of, bump.file.as_str(), bump.strength), (Of::Bump, "2.png", 0.3));
        assert_eq!(parse("bump", "-o 1 2 3 4.png").expect("is right").file, "4.png");
        assert_eq!(parse("norm", "").expect_err("no file"), "`norm`: no file is named");
        assert_eq!(parse("norm", "-x 1 a.png").expect_err("no option"), "`norm`: the option -x is not known");
        assert!(Named::parse("map_Ka", "a.png").is_none());
    }

    #[test]
    fn slopes_are_half_differences() {
        let ramp = Image::from_fn(8, 4, |x, _| [(x * 10) as u8; 4]);
        let named = Named::parse("bump", "-clamp on a").expect("of a picture").expect("is right");
        let slopes = slopes(&ramp, &named);
        assert_eq!(slopes.get(3, 2), [138, 128, 0, 255]);
        assert_eq!(slopes.get(0, 0), [133, 128, 0, 255]);
    }

    #[test]
    fn pictures_of_two_sizes_become_one() {
        let wide = Image::from_fn(4, 2, |x, y| [x as u8, y as u8, 0, 255]);
        let high = Image::from_fn(2, 4, |x, y| [0, 0, (x + 10 * y) as u8, 255]);
        let one = joined(Some(&wide), Some(&high), |a, b| [a.unwrap()[0], a.unwrap()[1], b.unwrap()[2], 0]);
        assert_eq!((one.width, one.height, one.get(3, 3), one.get(1, 2)), (4, 4, [3, 1, 31, 0], [1, 1, 20, 0]));
    }
}
