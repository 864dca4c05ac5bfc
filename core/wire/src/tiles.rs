//! Tiles: 8 x 8 pixels, numbered so that runs of them are compact.
//!
//! The picture is cut into strips of 16 rows, each strip into squares of 16 pixels, each square into four tiles. So a run
//! of tile numbers is a piece of a strip, and four tiles from a multiple of four on are mostly a square: a bundle of 256
//! primary rays.

/// Side of a tile in pixels. What is given out is a run of tiles; what the ledger closes is one tile.
pub const TILE: u32 = 8;

/// Numbers and places of a picture's tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileMap {
    width: u32,
    height: u32,
    columns: u32,
    rows: u32,
}

/// A tile's pixels: `x..x + width`, `y..y + height`, at most 8 x 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Tile {
    /// How many.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        (self.width * self.height) as usize
    }
}

impl TileMap {
    /// Widest and highest picture, pixels.
    pub const SIDE_MAX: u32 = 32_768;

    /// Most pixels of a picture: its sums take 24 bytes each.
    pub const PIXELS_MAX: u64 = 1 << 28;

    /// The tiles of a picture of `width` x `height` pixels; `None` if it has none, or too many.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Option<Self> {
        let fits = |side: u32| (1..=Self::SIDE_MAX).contains(&side);
        let few = u64::from(width) * u64::from(height) <= Self::PIXELS_MAX;
        (fits(width) && fits(height) && few).then(|| Self {
            width,
            height,
            columns: width.div_ceil(TILE),
            rows: height.div_ceil(TILE),
        })
    }

    /// Columns of the picture, pixels.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Rows of the picture, pixels.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// How many tiles there are.
    #[must_use]
    pub const fn len(&self) -> u32 {
        self.columns * self.rows
    }

    /// Never: a picture has pixels.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        false
    }

    /// The tile with `number`, which is below [`TileMap::len`].
    #[must_use]
    pub const fn tile(&self, number: u32) -> Tile {
        let strip = number / (2 * self.columns);
        let within = number % (2 * self.columns);
        let (column, row) = if 2 * strip + 1 == self.rows {
            (within, 0)
        } else {
            let square = within / 4;
            if 2 * square + 1 < self.columns {
                (2 * square + within % 2, within % 4 / 2)
            } else {
                (2 * square, within % 4)
            }
        };
        let (x, y) = (column * TILE, (2 * strip + row) * TILE);
        let left = self.width - x;
        let below = self.height - y;
        Tile { x, y, width: if left < TILE { left } else { TILE }, height: if below < TILE { below } else { TILE } }
    }

    /// How many tiles from `number` on, of the next `count`, make one square of 16 pixels (4), or stand alone (1).
    #[must_use]
    pub fn square(&self, number: u32, count: u32) -> u32 {
        let (strip, within) = (number / (2 * self.columns), number % (2 * self.columns));
        let whole = within.is_multiple_of(4) && 2 * strip + 1 < self.rows && within / 2 + 1 < self.columns;
        if whole && count >= 4 { 4 } else { 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec;

    #[test]
    fn tiles_are_the_picture_once() {
        for (width, height) in [(1, 1), (8, 8), (9, 17), (16, 16), (40, 24), (64, 65), (100, 31), (641, 479)] {
            let map = TileMap::new(width, height).unwrap();
            let mut seen = vec![0u32; (width * height) as usize];
            for number in 0..map.len() {
                let tile = map.tile(number);
                assert!(tile.width >= 1 && tile.height >= 1 && tile.width <= TILE && tile.height <= TILE);
                for y in tile.y..tile.y + tile.height {
                    for x in tile.x..tile.x + tile.width {
                        seen[(y * width + x) as usize] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{width} x {height}");
        }
    }

    #[test]
    fn a_square_is_16_pixels_wide_and_high() {
        let map = TileMap::new(100, 72).unwrap();
        let mut squares = 0;
        for number in 0..map.len() {
            if map.square(number, 4) == 4 {
                squares += 1;
                let corners = [0, 1, 2, 3].map(|i| map.tile(number + i));
                let Tile { x, y, .. } = corners[0];
                assert_eq!(corners.map(|t| (t.x - x, t.y - y)), [(0, 0), (8, 0), (0, 8), (8, 8)]);
            }
        }
        assert_eq!(squares, 6 * 4);
        assert_eq!(TileMap::new(0, 4), None);
        assert_eq!(TileMap::new(4, 1 << 20), None);
    }
}
