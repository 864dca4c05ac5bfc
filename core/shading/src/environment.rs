//! Light from all around: a picture of it (latitude and longitude), where rays meet nothing, and cells of it that surfaces are lit by.
//!
//! What is seen is looked up in texel pages, as any texture is. What lights is a table: the picture cut into cells, each of which
//! shines evenly and is chosen as often as it is bright. The host cuts it so that little light is moved, and not far; so a shadow ray
//! needs no texel, and small bright things (a sun) are cells of their own.
//!
//! The picture's middle is towards +X of its [axes](Environment::axes), its right towards +Z, its top +Y.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use hybray_scene::Pages;

use crate::texture::Texture;

/// A part of the surroundings between two meridians and two circles of latitude: 32 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cell {
    /// Left and right edge, in turns from the picture's left edge.
    pub turns: [f32; 2],
    /// Lower and upper edge: sines of latitudes.
    pub heights: [f32; 2],
    /// Irradiance over pi, times nothing but the scene's colour, of all that the cell sends, over the probability that it is chosen.
    pub colour: [f32; 3],
    /// Probability that this cell or one before it is chosen; 1 for the last.
    pub up_to: f32,
}

const _: () = assert!(size_of::<Cell>() == 32);

/// Where cells part: one node of a tree over them, first itself, then what is on its first side, then the other: 8 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Cut {
    /// Where: turns from the picture's left edge; or a sine of latitude, above which is the first side.
    pub at: f32,
    /// [`Cut::LATITUDE`], and the other side's first node, which is further on; or [`Cut::CELL`], and a cell's index, or [`Cut::DARK`].
    pub to: u32,
}

const _: () = assert!(size_of::<Cut>() == 8);

impl Cut {
    /// It is a circle of latitude.
    pub const LATITUDE: u32 = 1 << 31;
    /// It is no cut but a cell.
    pub const CELL: u32 = 1 << 30;
    /// In place of a cell's index: nothing shines there.
    pub const DARK: u32 = Self::CELL - 1;
}

/// What nodes know of the surroundings beside cells: 56 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Sky {
    /// Unit vectors of the scene: the picture's middle, its right, and its top.
    pub axes: [[f32; 3]; 3],
    /// Times the picture.
    pub colour: [f32; 3],
    /// Index of the picture among textures, [`Sky::NONE`] for none.
    pub texture: u32,
    /// Shadow rays that one hit sends there; 0 if the surroundings light nothing.
    pub samples: u16,
    /// [`Sky::HIDDEN`].
    pub flags: u16,
}

const _: () = assert!(size_of::<Sky>() == 56);

impl Sky {
    /// No picture.
    pub const NONE: u32 = u32::MAX;
    /// Seen in mirrors and through glass, but not by the camera itself.
    pub const HIDDEN: u16 = 1;
    /// No surroundings.
    pub const EMPTY: Self = Self {
        axes: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        colour: [0.0; 3],
        texture: Self::NONE,
        samples: 0,
        flags: 0,
    };
}

impl Default for Sky {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// The surroundings, as a node's tables hold them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Environment<'a> {
    /// The picture.
    pub sky: Sky,
    /// What lights: empty if nothing does. At most [`Environment::CELLS_MAX`].
    pub cells: &'a [Cell],
    /// Finds the cell of a direction: empty if nothing lights.
    pub cuts: &'a [Cut],
}

/// How much of what is all around a ray shows that its surface is also lit by: 0 for all, else a power of two to minus so many eighths.
/// The other part comes with shadow rays (Veach's power heuristic). Both sides round alike, so nothing is lost.
#[must_use]
pub(crate) fn share(sampled: f32, lit: f32) -> u8 {
    let ratio = lit / sampled;
    let eighths = libm::log2f(1.0 + ratio * ratio) * 8.0 + 0.5;
    // What is no number is all.
    if eighths < 255.0 {
        eighths as u8
    } else if eighths >= 255.0 {
        255
    } else {
        0
    }
}

/// What a share, an eighth of a power of two, stands for: 0 for all.
#[must_use]
pub fn share_of(eighths: u8) -> f32 {
    if eighths == 0 { 1.0 } else { libm::exp2f(f32::from(eighths) * -0.125) }
}

impl Environment<'_> {
    /// Cells at most.
    pub const CELLS_MAX: usize = 1 << 14;

    /// Whether there is a picture.
    #[must_use]
    pub const fn is_there(&self) -> bool {
        self.sky.texture != Sky::NONE
    }

    /// Radiance from `direction` (of any length), of which `spread` (half an angle, radians) is seen at once. Counts bilinear
    /// look-ups.
    ///
    /// # Errors
    /// The page that it needs, if that is not at hand.
    pub fn radiance<P: Pages + ?Sized>(
        &self,
        textures: &[Texture],
        pages: &P,
        direction: Vec3,
        spread: f32,
        count: &mut u64,
    ) -> Result<[f32; 3], u32> {
        let Some(texture) = textures.get(self.sky.texture as usize) else { return Ok([0.0; 3]) };
        let [x, z, y] = self.sky.axes.map(|axis| direction.dot(Vec3::from(axis)));
        let across = libm::sqrtf(x * x + z * z);
        let turn = libm::atan2f(z, x) * (0.5 * core::f32::consts::FRAC_1_PI) + 0.5;
        let down = libm::atan2f(across, y) * core::f32::consts::FRAC_1_PI;
        // A texel's sides have the mean sqrt(2) pi / sqrt(width height) at the horizon, and towards the top and the bottom they are
        // narrower.
        let narrow = across / libm::sqrtf(across * across + y * y);
        let narrow = if narrow > MARGIN { narrow } else { MARGIN };
        let footprint = spread * (core::f32::consts::SQRT_2 * core::f32::consts::FRAC_1_PI) / libm::sqrtf(narrow);
        let [r, g, b, _] = texture.look_up(pages, [turn, down], footprint, count)?;
        let colour = self.sky.colour;
        Ok([r * colour[0], g * colour[1], b * colour[2]])
    }

    /// A direction (unit) from which light comes, and the cell that it is in. `u` is even in the unit
    /// square; its first number chooses the cell, and cells follow one another where they are neighbours. Averaged over `u`, a cell's
    /// colour times a surface's cosine is what all cells send it, without bias. `None` if nothing shines.
    #[must_use]
    pub(crate) fn arrival(&self, u: [f32; 2]) -> Option<(Vec3, usize)> {
        let index = self.cells.partition_point(|cell| cell.up_to <= u[0]);
        let cell = self.cells.get(index)?;
        let before = index.checked_sub(1).map_or(0.0, |before| self.cells[before].up_to);
        let along = (u[0] - before) / (cell.up_to - before);
        let mix = |[a, b]: [f32; 2], t: f32| a + (b - a) * t;
        let height = mix(cell.heights, u[1]);
        let square = 1.0 - height * height;
        let across = libm::sqrtf(if square > 0.0 { square } else { 0.0 });
        let (sin, cos) = libm::sincosf(core::f32::consts::TAU * (mix(cell.turns, along) - 0.5));
        let [x, z, y] = self.sky.axes.map(Vec3::from);
        Some((x * (cos * across) + z * (sin * across) + y * height, index))
    }

    /// How dense shadow rays of one hit are towards `direction` (of any length): rays for each steradian.
    #[must_use]
    pub(crate) fn density(&self, direction: Vec3) -> f32 {
        let [x, z, y] = self.sky.axes.map(|axis| direction.dot(Vec3::from(axis)));
        let turn = libm::atan2f(z, x) * (0.5 * core::f32::consts::FRAC_1_PI) + 0.5;
        let height = y / libm::sqrtf(x * x + y * y + z * z);
        let mut node = 0;
        // Nodes rise, so it ends; a table that is not sound ends it all the same.
        for _ in 0..self.cuts.len() {
            let Some(Cut { at, to }) = self.cuts.get(node).copied() else { return 0.0 };
            if to & Cut::CELL != 0 {
                return self.density_of((to & Cut::DARK) as usize);
            }
            let first = if to & Cut::LATITUDE != 0 { height >= at } else { turn < at };
            node = if first { node + 1 } else { (to & !Cut::LATITUDE) as usize };
        }
        0.0
    }

    /// The same where the cell is known.
    #[must_use]
    pub(crate) fn density_of(&self, index: usize) -> f32 {
        let Some(cell) = self.cells.get(index) else { return 0.0 };
        let before = index.checked_sub(1).map_or(0.0, |before| self.cells[before].up_to);
        let ([left, right], [low, high]) = (cell.turns, cell.heights);
        let solid = core::f32::consts::TAU * (right - left) * (high - low);
        f32::from(self.sky.samples) * (cell.up_to - before) / solid
    }

    /// Whether it says only what can be, with so many textures.
    #[must_use]
    pub fn is_sound(&self, textures: usize) -> bool {
        let Sky { axes, colour, texture, samples, flags } = self.sky;
        let near = |value: f32, wanted: f32| (value - wanted).abs() < 1e-4;
        let right = (0..3).all(|i| {
            let dot = |j: usize| Vec3::from(axes[i]).dot(Vec3::from(axes[j]));
            (0..3).all(|j| near(dot(j), if i == j { 1.0 } else { 0.0 }))
        });
        let known = texture == Sky::NONE || (texture as usize) < textures;
        let bright = |colour: [f32; 3]| colour.iter().all(|c| (0.0..f32::INFINITY).contains(c));
        let within = |[a, b]: [f32; 2], lo: f32| lo <= a && a <= b && b <= 1.0;
        let mut before = 0.0;
        let rises = self.cells.iter().all(|cell| {
            let rises = before < cell.up_to && cell.up_to <= 1.0;
            before = cell.up_to;
            rises && within(cell.turns, 0.0) && within(cell.heights, -1.0) && bright(cell.colour)
        });
        let cuts = (0..).zip(self.cuts).all(|(node, cut)| {
            let (cell, next) = ((cut.to & Cut::DARK) as usize, cut.to & !Cut::LATITUDE);
            if cut.to & Cut::CELL != 0 {
                cell < self.cells.len() || cell == Cut::DARK as usize
            } else {
                next > node + 1 && (next as usize) < self.cuts.len() && cut.at.is_finite()
            }
        });
        let cuts = cuts && self.cuts.is_empty() == self.cells.is_empty() && self.cuts.len() <= 4 * Self::CELLS_MAX;
        let whole = cuts && (self.cells.is_empty() || before == 1.0);
        let lights = (samples == 0) == self.cells.is_empty() && self.cells.len() <= Self::CELLS_MAX;
        right && known && bright(colour) && flags <= Sky::HIDDEN && rises && whole && lights
    }
}

/// Nearer to the top or the bottom texels are not taken to be narrower.
const MARGIN: f32 = 1.0 / 4096.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::id::unit_pair;
    use crate::texture::tests::Picture;
    use crate::{Format, Sampling, Wrap};
    use std::vec::Vec;

    fn turned() -> Sky {
        // An odd rotation, by two quarter turns and an angle.
        let (s, c) = libm::sincosf(0.7);
        Sky { axes: [[0.0, c, s], [0.0, -s, c], [1.0, 0.0, 0.0]], colour: [2.0; 3], texture: 0, samples: 4, flags: 0 }
    }

    /// Cells of one picture row by row, as bright as `colour` says.
    fn cells(columns: u32, rows: u32, colour: impl Fn(u32, u32) -> f32) -> Vec<Cell> {
        let part = |at: u32, of: u32| at as f32 / of as f32;
        let height = |row: u32| libm::cosf(core::f32::consts::PI * part(row, rows));
        let mut all = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                all.push(Cell {
                    turns: [part(column, columns), part(column + 1, columns)],
                    heights: [height(row + 1), height(row)],
                    colour: [colour(column, row); 3],
                    up_to: part(row * columns + column + 1, rows * columns),
                });
            }
        }
        all
    }

    /// Cuts of cells that stand row by row, two rows of them or four: one after the other.
    fn of_two(cells: &[Cell]) -> Vec<Cut> {
        let columns = cells.iter().take_while(|c| c.heights == cells[0].heights).count().max(1);
        let rows = cells.len() / columns;
        let mut cuts = Vec::new();
        for row in 0..rows {
            if row + 1 < rows {
                let below = (cuts.len() + 2 * columns) as u32;
                cuts.push(Cut { at: cells[row * columns].heights[0], to: Cut::LATITUDE | below });
            }
            for column in 0..columns {
                let cell = row * columns + column;
                if column + 1 < columns {
                    cuts.push(Cut { at: cells[cell].turns[1], to: cuts.len() as u32 + 2 });
                }
                cuts.push(Cut { at: 0.0, to: Cut::CELL | cell as u32 });
            }
        }
        cuts
    }

    #[test]
    fn shares_are_powers_of_two() {
        assert_eq!((share(1.0, 0.0), share_of(0)), (0, 1.0));
        assert_eq!(share_of(share(1.0, 1.0)), 0.5);
        assert_eq!((share(f32::NAN, 1.0), share(0.0, 0.0), share(0.0, 1.0), share(1e-30, 1e30)), (0, 0, 255, 255));
        for i in 0..1000 {
            let [a, b] = unit_pair(4, i);
            let exact = a * a / (a * a + b * b);
            assert!((share_of(share(a, b)) / exact).log2().abs() < 0.0626 || exact < 1e-9, "{a} {b}");
        }
    }

    /// What is seen towards a texel's middle is that texel, wherever the picture is turned to.
    #[test]
    fn directions_meet_their_texels() {
        let picture = Picture::new(16, 8, 125, Wrap::Repeat, Sampling::Nearest, Format::Linear);
        let textures = [picture.texture];
        for sky in [Sky { texture: 0, colour: [1.0; 3], ..Sky::EMPTY }, turned()] {
            let environment = Environment { sky, cells: &[], cuts: &[] };
            assert!(environment.is_sound(1) == (sky.samples == 0));
            for row in 0..8 {
                for column in 0..16 {
                    let turn = core::f32::consts::TAU * ((column as f32 + 0.5) / 16.0 - 0.5);
                    let down = core::f32::consts::PI * (row as f32 + 0.5) / 8.0;
                    let [x, z, y] = sky.axes.map(Vec3::from);
                    let direction = x * (libm::cosf(turn) * libm::sinf(down))
                        + z * (libm::sinf(turn) * libm::sinf(down))
                        + y * libm::cosf(down);
                    let count = &mut 0;
                    let seen = environment.radiance(&textures, &picture, direction * 3.0, 0.0, count).unwrap();
                    let texel = picture.texel(column, row);
                    let wanted = [0, 1, 2].map(|c| f32::from(texel[c]) / 255.0 * sky.colour[0]);
                    assert_eq!((seen, *count), (wanted, 1), "{column} {row}");
                }
            }
            // At the very top and bottom, and of nothing, there is a value.
            for direction in [Vec3::Y, -Vec3::Y, Vec3::X, Vec3::ZERO] {
                let seen = environment.radiance(&textures, &picture, direction, 1e-3, &mut 0).unwrap();
                assert!(seen.iter().all(|c| c.is_finite()));
            }
        }
    }

    /// What is wide is seen in smaller levels: one texel of a level across is that level.
    #[test]
    fn wide_rays_see_small_levels() {
        let picture = Picture::new(64, 32, 125, Wrap::Repeat, Sampling::Bilinear, Format::Linear);
        let environment =
            Environment { sky: Sky { texture: 0, colour: [1.0; 3], ..Sky::EMPTY }, cells: &[], cuts: &[] };
        let textures = [picture.texture];
        let direction = Vec3::new(-0.3, 0.02, 0.5);
        let seen = |spread| environment.radiance(&textures, &picture, direction, spread, &mut 0).unwrap();
        let turn = libm::atan2f(0.5, -0.3) / core::f32::consts::TAU + 0.5;
        let down = libm::acosf(0.02 / direction.length()) / core::f32::consts::PI;
        for level in 0..6u8 {
            let size = picture.texture.level_size(level);
            let texels = f32::exp2(level.into()) / libm::sqrtf(64.0 * 32.0);
            let wanted = picture.texture.look_up(&picture, [turn, down], 1.05 * texels, &mut 0).unwrap();
            let spread = core::f32::consts::PI / size[1] as f32 / 2.0;
            let near = |a: f32, b: f32| (a - b).abs() < 1e-3;
            assert!((0..3).all(|c| near(seen(1.1 * spread)[c], wanted[c])), "{level}");
            assert!(level == 0 || (0..3).any(|c| !near(seen(0.6 * spread)[c], wanted[c])), "{level}");
        }
    }

    /// A uniform sky of radiance 1 lights every surface with 1, and directions are even over the sphere.
    #[test]
    fn an_even_sky_lights_evenly() {
        let (columns, rows) = (8, 4);
        let solid = |row: u32| {
            let height = |row: u32| libm::cos(core::f64::consts::PI * f64::from(row) / f64::from(rows));
            2.0 * core::f64::consts::PI / f64::from(columns) * (height(row) - height(row + 1))
        };
        // Irradiance over pi is the solid angle over pi, and each is chosen one time of 32.
        let cells = cells(columns, rows, |_, row| (32.0 * solid(row) / core::f64::consts::PI) as f32);
        let environment = Environment { sky: turned(), cells: &cells, cuts: &of_two(&cells) };
        assert!(environment.is_sound(1));
        let normal = crate::vector::normalize(Vec3::new(0.2, -0.7, 0.4));
        let (mut lit, mut mean) = (0.0, [0.0f64; 3]);
        let n = 200_000;
        for i in 0..n {
            let (direction, cell) = environment.arrival(unit_pair(3, i)).unwrap();
            let colour = cells[cell].colour;
            assert!((direction.dot(direction) - 1.0).abs() < 1e-5);
            lit += f64::from(direction.dot(normal).max(0.0) * colour[0]) / f64::from(n);
            (0..3).for_each(|c| mean[c] += f64::from(direction[c] * colour[0]) / f64::from(n));
        }
        assert!((lit - 1.0).abs() < 0.01, "{lit}");
        assert!(mean.iter().all(|m| m.abs() < 0.02), "{mean:?}");
    }

    #[test]
    fn cells_are_chosen_as_often_as_they_say() {
        let mut cells = cells(4, 2, |column, row| (column + 4 * row + 1) as f32);
        // One has next to no chance, and what follows the more.
        cells[2].up_to = 0.25 + 1e-7;
        let environment = Environment { sky: Sky { samples: 1, ..Sky::EMPTY }, cells: &cells, cuts: &of_two(&cells) };
        assert!(environment.is_sound(0));
        let mut found = [0; 8];
        for i in 0..80_000 {
            let u = unit_pair(9, i);
            let (direction, index) = environment.arrival(u).unwrap();
            assert_eq!(cells[index].colour[0] as usize, index + 1);
            let part = (cells[index].up_to - index.checked_sub(1).map_or(0.0, |i| cells[i].up_to))
                / (core::f32::consts::TAU / 4.0);
            let density = environment.density(direction * 2.0);
            assert!((density / part - 1.0).abs() < 1e-3, "{index}: {density} {part}");
            found[index] += 1;
            let [lo, hi] = cells[index].heights;
            assert!(lo - 1e-6 <= direction.y && direction.y <= hi + 1e-6);
            let turn = libm::atan2f(direction.z, direction.x) / core::f32::consts::TAU + 0.5;
            let [from, to] = cells[index].turns;
            assert!(from - 1e-5 <= turn && turn <= to + 1e-5, "{turn}");
        }
        for (wanted, found) in [0.125, 0.125, 0.0, 0.25, 0.125, 0.125, 0.125, 0.125].into_iter().zip(found) {
            assert!((f64::from(found) / 80_000.0 - wanted).abs() < 0.01, "{found} {wanted}");
        }
        assert_eq!(Environment::default().arrival([0.5; 2]), None);
    }

    #[test]
    fn nonsense_is_not_sound() {
        let good = cells(2, 2, |_, _| 1.0);
        let sound = |change: &dyn Fn(&mut Sky, &mut Vec<Cell>)| {
            let (mut sky, mut cells) = (turned(), good.clone());
            change(&mut sky, &mut cells);
            Environment { sky, cells: &cells, cuts: &of_two(&cells) }.is_sound(1)
        };
        assert!(sound(&|_, _| {}));
        assert!(!sound(&|sky, _| sky.texture = 1));
        assert!(!sound(&|sky, _| sky.axes[1][0] = 0.5));
        assert!(!sound(&|sky, _| sky.axes[1][0] = f32::NAN));
        assert!(!sound(&|sky, _| sky.colour[1] = -1.0));
        assert!(!sound(&|sky, _| sky.samples = 0));
        assert!(!sound(&|sky, _| sky.flags = 2));
        assert!(!sound(&|_, cells| cells[1].up_to = 0.1));
        assert!(!sound(&|_, cells| cells[3].up_to = 0.9));
        assert!(!sound(&|_, cells| cells[0].colour[2] = f32::INFINITY));
        assert!(!sound(&|_, cells| cells[0].turns[1] = 1.5));
        assert!(!sound(&|_, cells| cells[0].heights[0] = f32::NAN));
        assert!(!sound(&|_, cells| cells.clear()));
        let with = |cuts: &[Cut]| Environment { sky: turned(), cells: &good, cuts }.is_sound(1);
        let cuts = of_two(&good);
        assert!(with(&cuts) && !with(&[]));
        for (node, to) in [(0, 0), (0, 1), (0, 99), (1, Cut::CELL | 4), (2, Cut::LATITUDE | Cut::CELL | 4)] {
            let mut bad = cuts.clone();
            bad[node].to = to;
            assert!(!with(&bad), "{node} {to}");
        }
        // Even those end.
        for to in [0, 1, Cut::LATITUDE, Cut::CELL, Cut::DARK | Cut::CELL, u32::MAX] {
            let _ = Environment { sky: turned(), cells: &good, cuts: &[Cut { at: 0.5, to }; 3] }.density(Vec3::X);
        }
    }
}
