//! Textures: where a look-up's texels stand, and what it makes of them.
//!
//! A texture is a pyramid of levels, each half as wide and high as the one before (rounded down, at least 1); each level is cut
//! into squares of `tile` texels, and each square is a page with the texels around it ([`Texels`]). So a bilinear look-up needs one
//! page, a trilinear one two, and what it finds does not depend on the size of the squares.
//! Source of levels: Williams, *Pyramidal Parametrics*, SIGGRAPH 1983.

use bytemuck::{Pod, Zeroable};
use hybray_scene::{Pages, Texels};

/// What four bytes of a texel are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Format {
    /// Red, green and blue encoded as sRGB, and coverage: colours.
    #[default]
    Srgb = 0,
    /// Four numbers in 0..=1: everything else.
    Linear = 1,
    /// Red, green and blue with a common exponent (nine bits each, and five): light.
    SharedExponent = 2,
}

/// What a texture shows beyond its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Wrap {
    /// Itself again.
    #[default]
    Repeat = 0,
    /// Itself mirrored.
    Mirror = 1,
    /// Its edge.
    Clamp = 2,
}

impl Wrap {
    /// The coordinate within `0.0..=1.0`.
    fn within(self, u: f32) -> f32 {
        match self {
            Self::Repeat => u - libm::floorf(u),
            Self::Mirror => {
                let half = 0.5 * u;
                let there = 2.0 * (half - libm::floorf(half));
                if there > 1.0 { 2.0 - there } else { there }
            }
            Self::Clamp => u.clamp(0.0, 1.0),
        }
    }

    /// The texel of `count` that stands at `at`, from one before the first to one behind the last.
    #[must_use]
    pub const fn texel(self, at: i64, count: i64) -> i64 {
        match self {
            Self::Repeat => at.rem_euclid(count),
            Self::Mirror | Self::Clamp => {
                if at < 0 {
                    0
                } else if at >= count {
                    count - 1
                } else {
                    at
                }
            }
        }
    }

    const fn from_u8(wrap: u8) -> Self {
        match wrap {
            1 => Self::Mirror,
            2 => Self::Clamp,
            _ => Self::Repeat,
        }
    }
}

/// How texels become a value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Sampling {
    /// The nearest texel of the nearest level.
    Nearest = 0,
    /// Between four texels of the nearest level.
    Bilinear = 1,
    /// That of two levels, and between them.
    #[default]
    Trilinear = 2,
}

/// A texture as a node's table holds it: 20 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Texture {
    /// Number of its first page: that of the upper left square of the first level. The others follow row by row, and level by
    /// level.
    pub first: u32,
    /// Texels of a row of the first level, 1 and up.
    pub width: u16,
    /// Rows of the first level.
    pub height: u16,
    /// Texels of a row or column of a square, 1 and up.
    pub tile: u16,
    /// Levels, 1 and up.
    pub levels: u8,
    /// [`Format`] as a number.
    pub format: u8,
    /// [`Wrap`] along a row, and along a column, as numbers.
    pub wrap: [u8; 2],
    /// [`Sampling`] as a number.
    pub sampling: u8,
    /// Zero.
    pub reserved: u8,
    /// How many pages it has.
    pub pages: u32,
}

const _: () = assert!(size_of::<Texture>() == 20);

/// Where one bilinear look-up reads: a page, a texel of it, and how far the place is from that texel's middle to the next ones'.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    page: u32,
    at: [i32; 2],
    between: [f32; 2],
}

impl Texture {
    /// Columns and rows of a level.
    #[must_use]
    pub fn level_size(&self, level: u8) -> [u32; 2] {
        [self.width, self.height].map(|n| (u32::from(n) >> level.min(31)).max(1))
    }

    /// Columns and rows of squares of a level.
    #[must_use]
    pub fn squares(&self, level: u8) -> [u32; 2] {
        self.level_size(level).map(|n| n.div_ceil(u32::from(self.tile.max(1))))
    }

    /// Whether it says of itself what can be: how many pages follow from its size, and these are among so many.
    #[must_use]
    pub fn is_sound(&self, pages: u32) -> bool {
        let count: u64 = (0..self.levels).map(|l| self.squares(l).map(u64::from)).map(|[x, y]| x * y).sum();
        let whole = self.width > 0 && self.height > 0 && self.tile > 0 && (1..=16).contains(&self.levels);
        let known = self.format <= 2 && self.wrap.iter().all(|&w| w <= 2) && self.sampling <= 2 && self.reserved == 0;
        whole && known && count == u64::from(self.pages) && u64::from(self.first) + count <= u64::from(pages)
    }

    /// Where a look-up of one level reads. `nearest`: the texel that the place is in, and nothing between.
    fn place(&self, uv: [f32; 2], level: u8, nearest: bool) -> Place {
        let size = self.level_size(level);
        let tile = i32::from(self.tile.max(1));
        let (mut at, mut between, mut square) = ([0; 2], [0.0; 2], [0; 2]);
        for axis in 0..2 {
            let u = if uv[axis].is_finite() { uv[axis] } else { 0.0 };
            let texels = Wrap::from_u8(self.wrap[axis]).within(u) * size[axis] as f32;
            let start = if nearest { texels } else { texels - 0.5 };
            let floor = libm::floorf(start);
            between[axis] = if nearest { 0.0 } else { start - floor };
            let last = size[axis] as i32 - 1;
            let texel = (floor as i32).clamp(if nearest { 0 } else { -1 }, last);
            square[axis] = texel.max(0) / tile;
            at[axis] = texel - square[axis] * tile;
        }
        let before: u32 = (0..level).map(|l| self.squares(l)).map(|[x, y]| x * y).sum();
        let page = self.first + before + square[1] as u32 * self.squares(level)[0] + square[0] as u32;
        Place { page, at, between }
    }

    fn decode(&self, texel: [u8; 4]) -> [f32; 4] {
        match self.format {
            0 => {
                let [r, g, b, a] = texel;
                [SRGB[usize::from(r)], SRGB[usize::from(g)], SRGB[usize::from(b)], f32::from(a) / 255.0]
            }
            1 => texel.map(|c| f32::from(c) / 255.0),
            _ => {
                let [r, g, b] = from_shared_exponent(u32::from_le_bytes(texel));
                [r, g, b, 1.0]
            }
        }
    }

    fn bilinear(&self, texels: &Texels<'_>, place: &Place) -> [f32; 4] {
        let ([x, y], [s, t]) = (place.at, place.between);
        if [s, t] == [0.0; 2] {
            return self.decode(texels.get(x, y));
        }
        let row = |y| {
            let (a, b) = (self.decode(texels.get(x, y)), self.decode(texels.get(x + 1, y)));
            mix(a, b, s)
        };
        mix(row(y), row(y + 1), t)
    }

    /// The value at `uv`, `v` counted from the first row on. `footprint` is the width of what is seen at once, in units of
    /// texture coordinates: one over the width of the first level is one of its texels. Counts bilinear look-ups.
    ///
    /// # Errors
    /// The page that it needs, if that is not at hand.
    pub fn look_up<P: Pages + ?Sized>(
        &self,
        pages: &P,
        uv: [f32; 2],
        footprint: f32,
        count: &mut u64,
    ) -> Result<[f32; 4], u32> {
        let last = f32::from(self.levels.max(1) - 1);
        // The square root of the texels that are seen at once: of a level's edges, the geometric mean.
        let across = footprint * libm::sqrtf(f32::from(self.width) * f32::from(self.height));
        let level = if across > 1.0 { libm::log2f(across) } else { 0.0 };
        let level = if level < last { level } else { last };
        let mut one = |level: f32, nearest| {
            let place = self.place(uv, level as u8, nearest);
            let texels = pages.texels(place.page).ok_or(place.page)?;
            *count += 1;
            Ok(self.bilinear(&texels, &place))
        };
        match self.sampling {
            0 => one(libm::floorf(level + 0.5), true),
            1 => one(libm::floorf(level + 0.5), false),
            _ => {
                let below = libm::floorf(level);
                let finer = one(below, false)?;
                let between = level - below;
                if between > 0.0 { Ok(mix(finer, one(below + 1.0, false)?, between)) } else { Ok(finer) }
            }
        }
    }
}

fn mix<const N: usize>(a: [f32; N], b: [f32; N], t: f32) -> [f32; N] {
    core::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
}

/// Linear values of sRGB's 256 steps.
pub static SRGB: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut step = 0;
    while step < 256 {
        table[step] = linear(step as f64 / 255.0) as f32;
        step += 1;
    }
    table
};

/// IEC 61966-2-1. The power of 12/5 is the fifth root of the twelfth power, by Newton's rule.
const fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 {
        return encoded / 12.92;
    }
    let base = (encoded + 0.055) / 1.055;
    let square = base * base;
    let twelfth = square * square * square * square * square * square;
    // From above, where it comes down without a swing.
    let mut root = 1.0;
    let mut steps = 0;
    while steps < 64 {
        let fourth = root * root * root * root;
        root -= (root * fourth - twelfth) / (5.0 * fourth);
        steps += 1;
    }
    root
}

/// Largest number of [`to_shared_exponent`].
const SHARED_MAX: f32 = 65_408.0;

/// Red, green and blue, 0 and up, in 32 bits: nine bits each, red lowest, and five of a common exponent. What is above 65,408 is cut,
/// what is no number is 0; the error is at most 1/512 of the largest of the three.
/// Source: OpenGL's `EXT_texture_shared_exponent`.
#[must_use]
pub fn to_shared_exponent(colour: [f32; 3]) -> u32 {
    let cut = colour.map(|c| if c > 0.0 { if c < SHARED_MAX { c } else { SHARED_MAX } } else { 0.0 });
    let most = if cut[0] > cut[1] { cut[0] } else { cut[1] };
    let most = if most > cut[2] { most } else { cut[2] };
    // The exponent of the largest, one above: 2^(e-1) <= most < 2^e.
    let mut exponent = (((most.to_bits() >> 23) as i32) - 126).max(-15);
    let unit = |exponent: i32| libm::ldexpf(1.0, 9 - exponent);
    let steps = |c: f32, exponent: i32| libm::floorf(c * unit(exponent) + 0.5) as u32;
    if steps(most, exponent) == 512 {
        exponent += 1;
    }
    let [r, g, b] = cut.map(|c| steps(c, exponent));
    r | g << 9 | b << 18 | ((exponent + 15) as u32) << 27
}

/// What [`to_shared_exponent`] packed.
#[must_use]
pub fn from_shared_exponent(packed: u32) -> [f32; 3] {
    // 2^(e - 15 - 9), which is always a normal number.
    let unit = f32::from_bits(((packed >> 27) + 127 - 24) << 23);
    [packed, packed >> 9, packed >> 18].map(|steps| (steps & 511) as f32 * unit)
}

#[cfg(test)]
pub(crate) mod tests;
