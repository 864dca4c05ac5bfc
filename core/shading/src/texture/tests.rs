use super::*;
use crate::id::unit_pair;
use hybray_scene::{PageView, TexelHeader};
use std::vec::Vec;

/// A picture in pages of several sizes, and every value of it.
pub(crate) struct Picture {
    pub texture: Texture,
    levels: Vec<(usize, usize, Vec<[u8; 4]>)>,
    pages: Vec<Vec<u8>>,
}

impl Pages for Picture {
    fn page(&self, _: u32) -> Option<PageView<'_>> {
        None
    }
    fn texels(&self, number: u32) -> Option<Texels<'_>> {
        self.pages.get((number - self.texture.first) as usize).map(|page| Texels::parse(page).unwrap())
    }
}

impl Picture {
    pub fn new(width: u16, height: u16, tile: u16, wrap: Wrap, sampling: Sampling, format: Format) -> Self {
        let mut levels = Vec::new();
        let (mut w, mut h) = (usize::from(width), usize::from(height));
        let byte = |n: u32, c: u32| (unit_pair(77 + u64::from(c), n)[0] * 256.0) as u8;
        loop {
            let texels = (0..w * h).map(|i| [0, 1, 2, 3].map(|c| byte(i as u32 + 1000 * levels.len() as u32, c)));
            levels.push((w, h, texels.collect::<Vec<_>>()));
            if w == 1 && h == 1 {
                break;
            }
            (w, h) = ((w / 2).max(1), (h / 2).max(1));
        }
        let mut texture = Texture {
            first: 5,
            width,
            height,
            tile,
            levels: levels.len() as u8,
            format: format as u8,
            wrap: [wrap as u8; 2],
            sampling: sampling as u8,
            ..Texture::default()
        };
        let mut pages = Vec::new();
        for (level, (w, h, texels)) in (0..).zip(&levels) {
            let [columns, rows] = texture.squares(level);
            for square in 0..columns * rows {
                let (left, top) =
                    ((square % columns) as usize * usize::from(tile), (square / columns) as usize * usize::from(tile));
                let (across, down) = ((w - left).min(tile.into()), (h - top).min(tile.into()));
                let mut page = bytemuck::bytes_of(&TexelHeader::new(across as u16, down as u16)).to_vec();
                for y in -1..=down as i64 {
                    for x in -1..=across as i64 {
                        let [x, y] =
                            [(x + left as i64, *w), (y + top as i64, *h)].map(|(at, n)| wrap.texel(at, n as i64));
                        page.extend(texels[y as usize * w + x as usize]);
                    }
                }
                pages.push(page);
            }
        }
        texture.pages = pages.len() as u32;
        assert!(texture.is_sound(texture.first + texture.pages));
        assert!(!texture.is_sound(texture.first + texture.pages - 1));
        Self { texture, levels, pages }
    }

    /// A texel of the first level.
    pub fn texel(&self, x: usize, y: usize) -> [u8; 4] {
        self.levels[0].2[y * self.levels[0].0 + x]
    }

    /// The value between the four texels around a place, in f64 and from the whole level, with the wrapping of each texel by itself.
    fn expected(&self, uv: [f32; 2], level: usize, wrap: Wrap) -> [f64; 4] {
        let (w, h, texels) = &self.levels[level];
        let index = |at: i64, n: usize| -> usize {
            let n = n as i64;
            (match wrap {
                Wrap::Repeat => at.rem_euclid(n),
                Wrap::Clamp => at.clamp(0, n - 1),
                Wrap::Mirror => {
                    let at = at.rem_euclid(2 * n);
                    if at < n { at } else { 2 * n - 1 - at }
                }
            }) as usize
        };
        let (x, y) = (f64::from(uv[0]) * *w as f64 - 0.5, f64::from(uv[1]) * *h as f64 - 0.5);
        let (s, t) = (x - libm::floor(x), y - libm::floor(y));
        let mut sum = [0.0; 4];
        for (dx, dy, share) in
            [(0, 0, (1.0 - s) * (1.0 - t)), (1, 0, s * (1.0 - t)), (0, 1, (1.0 - s) * t), (1, 1, s * t)]
        {
            let texel = texels[index(libm::floor(y) as i64 + dy, *h) * w + index(libm::floor(x) as i64 + dx, *w)];
            for c in 0..4 {
                let value = f64::from(texel[c]) / 255.0;
                let colour = self.texture.format == Format::Srgb as u8 && c < 3;
                sum[c] += share * if colour { srgb(value) } else { value };
            }
        }
        sum
    }
}

fn srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

#[test]
fn srgb_is_the_standards() {
    for (step, &value) in SRGB.iter().enumerate() {
        let exact = srgb(step as f64 / 255.0);
        assert!((f64::from(value) - exact).abs() <= exact * 6e-8, "{step}: {value} {exact}");
    }
    assert_eq!((SRGB[0], SRGB[255]), (0.0, 1.0));
}

/// Against f64 and texels that are wrapped one by one; the same to the bit for squares of every size.
#[test]
fn values_do_not_depend_on_the_squares() {
    let mut looked = 0;
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        for (width, height) in [(16, 16), (13, 6), (1, 9), (1, 1), (33, 2)] {
            let format = if width == 16 { Format::Srgb } else { Format::Linear };
            let of = |tile| Picture::new(width, height, tile, wrap, Sampling::Trilinear, format);
            let pictures = [1, 3, 8, 125].map(of);
            for i in 0..600 {
                let uv = unit_pair(3, i).map(|u| (u - 0.4) * 3.5);
                let footprint = unit_pair(4, i)[0] * unit_pair(4, i)[1];
                let mut count = 0;
                let found = pictures[0].texture.look_up(&pictures[0], uv, footprint, &mut count).unwrap();
                looked += count;
                for picture in &pictures[1..] {
                    assert_eq!(picture.texture.look_up(picture, uv, footprint, &mut count), Ok(found), "{uv:?}");
                }
                let level = libm::log2(f64::from(footprint) * libm::sqrt(f64::from(width) * f64::from(height)));
                let level = level.clamp(0.0, pictures[0].levels.len() as f64 - 1.0);
                let below = libm::floor(level);
                let of = |l: f64| pictures[0].expected(uv, (l as usize).min(pictures[0].levels.len() - 1), wrap);
                let (a, b) = (of(below), of(below + 1.0));
                for c in 0..4 {
                    let expected = a[c] + (b[c] - a[c]) * (level - below);
                    // The place is off by what f32 loses of a coordinate times the texels of a row.
                    let slack = 1e-5 + 3.0 * 4.0 * f64::from(f32::EPSILON) * f64::from(width.max(height));
                    assert!(
                        (f64::from(found[c]) - expected).abs() < slack,
                        "{wrap:?} {width} {height} {uv:?}: {found:?}"
                    );
                }
            }
        }
    }
    assert!(looked > 9000 + 3000, "many of them between two levels: {looked}");
}

#[test]
fn nearest_takes_the_texel_that_the_place_is_in() {
    let picture = Picture::new(8, 4, 3, Wrap::Clamp, Sampling::Nearest, Format::Linear);
    for i in 0..2000 {
        let [u, v] = unit_pair(9, i);
        let found = picture.texture.look_up(&picture, [u, v], 0.0, &mut 0).unwrap();
        let texel = picture.levels[0].2[(v * 4.0) as usize * 8 + (u * 8.0) as usize];
        assert_eq!(found, texel.map(|c| f32::from(c) / 255.0));
    }
    // The end of the last texel belongs to it.
    let last = picture.texture.look_up(&picture, [1.0, 7.0], 0.0, &mut 0).unwrap();
    assert_eq!(last, picture.levels[0].2[31].map(|c| f32::from(c) / 255.0));
}

#[test]
fn what_is_not_at_hand_is_named() {
    let mut picture = Picture::new(16, 16, 4, Wrap::Repeat, Sampling::Bilinear, Format::Srgb);
    let all = core::mem::take(&mut picture.pages);
    // The first level has 16 squares, the second four: the lower right ones are their last.
    assert_eq!(picture.texture.look_up(&picture, [0.99, 0.99], 0.0, &mut 0), Err(5 + 15));
    assert_eq!(picture.texture.look_up(&picture, [0.9, 0.9], 2.0 / 16.0, &mut 0), Err(5 + 19));
    assert_eq!(picture.texture.look_up(&picture, [f32::NAN, f32::INFINITY], f32::NAN, &mut 0), Err(5));
    picture.pages = all;
    assert!(picture.texture.look_up(&picture, [f32::NAN, -1e30], f32::INFINITY, &mut 0).is_ok());
}

#[test]
fn shared_exponents_keep_nine_bits() {
    for i in 0..100_000 {
        let [a, b] = unit_pair(21, i);
        let scale = libm::ldexpf(1.0, (i % 34) as i32 - 18);
        let colour = [a, b, a * b].map(|c| c * scale);
        let most = colour.into_iter().fold(0.0, f32::max);
        let found = from_shared_exponent(to_shared_exponent(colour));
        for c in 0..3 {
            let slack = if most < SHARED_MAX { most / 511.9 + 1e-7 } else { f32::INFINITY };
            assert!((found[c] - colour[c]).abs() <= slack, "{colour:?} {found:?}");
        }
    }
    let odd = [f32::NAN, f32::INFINITY, -1.0];
    assert_eq!(from_shared_exponent(to_shared_exponent(odd)), [0.0, SHARED_MAX, 0.0]);
    assert_eq!(from_shared_exponent(to_shared_exponent([1.0, 0.5, 0.0])), [1.0, 0.5, 0.0]);
    assert_eq!(to_shared_exponent([0.0; 3]), 0);
}
