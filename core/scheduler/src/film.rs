//! The film: 64-bit fixed-point sums, so that the order of contributions cannot matter (DESIGN section 8).

use crate::ledger::Balance;
use hybray_shading::id;
use hybray_wire::{Frame, Tile, TileMap};

/// The unit of the film: 2 to a power. A contribution is at most 2^24 units of radiance times the exposure that the
/// step is chosen for; sums that would pass 2^64 steps stay there, in any order, since nothing is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    scale: f64,
    unit: f64,
}

/// What became of a contribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fixed {
    /// Rounded to the nearest step.
    Whole(u64),
    /// Cut to the greatest.
    Clamped(u64),
    /// Negative or not a number: left out.
    Refused,
}

/// Greatest contribution in steps.
const GREATEST: u64 = 1 << 56;

impl Step {
    /// For pictures that are multiplied by `exposure`: steps of about 2^-32 over it.
    #[must_use]
    pub fn log2_for(exposure: f32) -> i8 {
        let exponent = if exposure > 0.0 && exposure.is_finite() { libm::ilogbf(exposure) } else { 0 };
        (-32 - exponent).clamp(-96, 32) as i8
    }

    /// Steps of 2 to the power of `log2`.
    #[must_use]
    pub fn new(log2: i8) -> Self {
        Self { scale: libm::ldexp(1.0, -i32::from(log2)), unit: libm::ldexp(1.0, i32::from(log2)) }
    }

    /// One channel of a contribution in steps. Exact but for the rounding: the scale is a power of two.
    #[must_use]
    #[inline]
    pub fn fix(&self, radiance: f32) -> Fixed {
        if !(0.0..f32::INFINITY).contains(&radiance) {
            return Fixed::Refused;
        }
        let steps = f64::from(radiance) * self.scale + 0.5;
        if steps >= GREATEST as f64 { Fixed::Clamped(GREATEST) } else { Fixed::Whole(steps as u64) }
    }

    /// All channels, if [`Step::fix`] takes each whole: nearly always, and in fewer branches.
    #[must_use]
    #[inline]
    pub fn fix_whole(&self, radiance: [f32; 3]) -> Option<[u64; 3]> {
        let steps = radiance.map(|c| f64::from(c) * self.scale + 0.5);
        let whole = radiance.iter().all(|&c| c >= 0.0) && steps.iter().all(|&s| s < GREATEST as f64);
        whole.then(|| steps.map(|s| s as i64 as u64))
    }

    /// Radiance of a sum of `samples` samples.
    #[must_use]
    pub fn mean(&self, sum: u64, samples: u16) -> f32 {
        (sum as f64 * self.unit / f64::from(samples.max(1))) as f32
    }
}

/// What the film knows of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TileState {
    balance: Balance,
    epoch: u16,
    /// Its primaries have been debited.
    open: bool,
    finished: bool,
}

/// Why the film could not take something in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FilmError {
    /// A tile that the picture does not have, or of another shape.
    #[error("a contribution is for tile {0}, which this picture does not have in that shape")]
    Tile(u32),
}

/// A picture that is coming together, in borrowed memory.
pub struct Film<'m> {
    map: TileMap,
    frame: Frame,
    step: Step,
    sums: &'m mut [[u64; 3]],
    tiles: &'m mut [TileState],
    finished: u32,
}

impl<'m> Film<'m> {
    /// An empty film for `frame`; `None` if the picture has no pixels, or the memory does not fit it: `sums` one a
    /// pixel, `tiles` one a tile.
    #[must_use]
    pub fn new(frame: &Frame, sums: &'m mut [[u64; 3]], tiles: &'m mut [TileState]) -> Option<Self> {
        let map = TileMap::new(frame.width, frame.height).filter(|_| frame.drawn_samples() > 0)?;
        if sums.len() != frame.width as usize * frame.height as usize || tiles.len() != map.len() as usize {
            return None;
        }
        sums.fill([0; 3]);
        tiles.fill(TileState::default());
        let step = Step::new(frame.step_log2);
        Some(Self { map, frame: *frame, step, sums, tiles, finished: 0 })
    }

    /// Where its tiles are.
    #[must_use]
    pub fn map(&self) -> &TileMap {
        &self.map
    }

    /// How many tiles are finished.
    #[must_use]
    pub fn finished(&self) -> u32 {
        self.finished
    }

    /// Whether all are.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.finished == self.map.len()
    }

    /// Whether this one is.
    #[must_use]
    pub fn tile_is_finished(&self, tile: u32) -> bool {
        self.tiles.get(tile as usize).is_some_and(|t| t.finished)
    }

    /// The tile's epoch.
    #[must_use]
    pub fn epoch(&self, tile: u32) -> u16 {
        self.tiles.get(tile as usize).map_or(0, |t| t.epoch)
    }

    fn pixels(&self, tile: u32) -> impl Iterator<Item = u32> + use<> {
        let (t, width) = (self.map.tile(tile), self.map.width());
        (t.y..t.y + t.height).flat_map(move |y| (t.x..t.x + t.width).map(move |x| y * width + x))
    }

    /// Adds `values` (red, green and blue of each pixel, little-endian steps) and a ledger entry to a tile; returns
    /// whether that finished it. What comes under an old epoch, or for a finished tile, is dropped; a new epoch empties
    /// the tile first. Bounded: one tile.
    ///
    /// # Errors
    /// If there is no such tile: nothing is changed.
    pub fn add(
        &mut self,
        tile: u32,
        epoch: u16,
        shape: (u8, u8),
        entry: u64,
        values: &[u8],
    ) -> Result<bool, FilmError> {
        let place = self.place(tile, values)?;
        if (u32::from(shape.0), u32::from(shape.1)) != (place.width, place.height) {
            return Err(FilmError::Tile(tile));
        }
        let state = self.tiles[tile as usize];
        if state.finished || epoch < state.epoch {
            return Ok(false);
        }
        if epoch > state.epoch || !state.open {
            self.open(tile, epoch);
        }
        self.add_values(tile, values);
        let state = &mut self.tiles[tile as usize];
        state.balance.add(entry);
        state.finished = state.balance.is_zero();
        self.finished += u32::from(state.finished);
        Ok(state.finished)
    }

    /// Puts in a tile that was finished before, in another film of the same picture: `values` as [`Film::tile_sums`] gave
    /// them there, each in 8 bytes, little-endian. A tile that is finished here stays as it is.
    ///
    /// # Errors
    /// If there is no such tile: nothing is changed.
    pub fn keep(&mut self, tile: u32, values: &[u8]) -> Result<(), FilmError> {
        self.place(tile, values)?;
        if !self.tile_is_finished(tile) {
            self.empty(tile);
            self.add_values(tile, values);
            self.tiles[tile as usize] = TileState { balance: Balance::ZERO, epoch: 0, open: true, finished: true };
            self.finished += 1;
        }
        Ok(())
    }

    /// Where a tile is, if there is one and `values` are as many as its pixels take.
    fn place(&self, tile: u32, values: &[u8]) -> Result<Tile, FilmError> {
        let place = (tile < self.map.len()).then(|| self.map.tile(tile));
        place.filter(|place| values.len() == place.pixels() * 24).ok_or(FilmError::Tile(tile))
    }

    fn add_values(&mut self, tile: u32, values: &[u8]) {
        for (pixel, value) in self.pixels(tile).zip(values.chunks_exact(24)) {
            for (sum, bytes) in self.sums[pixel as usize].iter_mut().zip(value.chunks_exact(8)) {
                let mut steps = [0; 8];
                steps.copy_from_slice(bytes);
                *sum = sum.saturating_add(u64::from_le_bytes(steps));
            }
        }
    }

    fn empty(&mut self, tile: u32) {
        for pixel in self.pixels(tile) {
            self.sums[pixel as usize] = [0; 3];
        }
    }

    /// Empties a tile and debits its primaries, under `epoch`. A finished tile, or none of this picture's, stays as it
    /// is.
    pub fn open(&mut self, tile: u32, epoch: u16) {
        if self.tiles.get(tile as usize).is_none_or(|t| t.finished) {
            return;
        }
        let (seed, samples) = (self.frame.seed, self.frame.drawn());
        let of_pixel = |pixel| samples.clone().map(move |s| id::primary_id(seed, pixel, u32::from(s)));
        let ids = self.pixels(tile).flat_map(of_pixel);
        let balance = Balance::debit(ids);
        self.empty(tile);
        self.tiles[tile as usize] = TileState { balance, epoch, open: true, finished: false };
    }

    /// Sums of a tile's pixels, row by row. Those of a finished tile do not change any more. `tile` is one of the
    /// picture's.
    pub fn tile_sums(&self, tile: u32) -> impl Iterator<Item = [u64; 3]> + '_ {
        self.pixels(tile).map(|pixel| self.sums[pixel as usize])
    }

    /// Sums of all pixels, row by row from the top. Pixels of tiles that are not finished are what has arrived.
    #[must_use]
    pub fn sums(&self) -> &[[u64; 3]] {
        self.sums
    }

    /// Mean radiance of a pixel.
    #[must_use]
    pub fn radiance(&self, pixel: usize) -> [f32; 3] {
        self.sums[pixel].map(|sum| self.step.mean(sum, self.frame.drawn_samples()))
    }

    /// Hash of the accumulated picture, before anything is made of it: equal for equal pictures (FNV-1a over the sums,
    /// little-endian, row by row).
    #[must_use]
    pub fn hash(&self) -> u64 {
        hash_sums(self.sums)
    }
}

/// [`Film::hash`] of these sums: of those of two halves added up it is that of the whole.
#[must_use]
pub fn hash_sums(sums: &[[u64; 3]]) -> u64 {
    let bytes = sums.iter().flatten().flat_map(|sum| sum.to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contribution_is_rounded_clamped_or_refused() {
        let step = Step::new(Step::log2_for(1.0));
        assert_eq!(step.fix(1.0), Fixed::Whole(1 << 32));
        assert_eq!(step.fix(0.0), Fixed::Whole(0));
        assert_eq!(step.fix(-0.0), Fixed::Whole(0));
        assert_eq!(step.fix(1e-10), Fixed::Whole(0));
        assert_eq!(step.fix(2e-10), Fixed::Whole(1));
        assert_eq!(step.fix(16_777_215.0), Fixed::Whole(16_777_215 << 32));
        assert_eq!(step.fix(16_777_216.0), Fixed::Clamped(GREATEST));
        assert_eq!(step.fix(f32::MAX), Fixed::Clamped(GREATEST));
        for refused in [-1e-30, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(step.fix(refused), Fixed::Refused);
        }
        assert_eq!(step.mean(3 << 32, 2), 1.5);
        // Three at once are what each is.
        let odd = [0.0, -0.0, 1.0, 1e-10, 3e-10, 16_777_215.0, 16_777_216.0, f32::MAX, -1e-30, f32::NAN, f32::INFINITY];
        for c in
            (0..odd.len().pow(3)).map(|i| [i, i / odd.len(), i / odd.len() / odd.len()].map(|i| odd[i % odd.len()]))
        {
            let each = c.map(|c| step.fix(c));
            let whole = each.iter().all(|fixed| matches!(fixed, Fixed::Whole(_)));
            assert_eq!(step.fix_whole(c).map(|steps| steps.map(Fixed::Whole)), whole.then_some(each), "{c:?}");
        }
    }

    #[test]
    fn a_tile_that_is_kept_is_finished_and_takes_no_more() {
        // Two tiles, the second of two columns.
        let frame = Frame {
            width: 10,
            height: 8,
            samples: 1,
            depth_max: 1,
            filter: 0,
            seed: 0,
            weight_cutoff: 0.0,
            step_log2: 0,
            eye: [0.0; 3],
            target: [0.0; 3],
            up: [0.0; 3],
            fov_y_degrees: 1.0,
            hither: 0.0,
            layer: 0,
            half: 0,
            optics: hybray_wire::Optics::PINHOLE,
        };
        let (mut sums, mut tiles) = ([[0; 3]; 80], [TileState::default(); 2]);
        let mut film = Film::new(&frame, &mut sums, &mut tiles).unwrap();
        let mut values = [0u8; 16 * 24];
        values.iter_mut().zip(1..=16u8).for_each(|(byte, value)| *byte = value);
        // Something has arrived of it: that is not added to.
        assert_eq!(film.add(1, 0, (2, 8), 1, &values), Ok(false));
        for (tile, bytes) in [(0, &values[..]), (1, &values[1..]), (2, &values), (u32::MAX, &values), (1, &[])] {
            assert_eq!(film.keep(tile, bytes), Err(FilmError::Tile(tile)));
        }
        assert_eq!(film.finished(), 0);
        for values in [&values, &[9; 16 * 24]] {
            assert_eq!(film.keep(1, values), Ok(()));
        }
        film.open(1, 3);
        assert_eq!(film.add(1, 4, (2, 8), 1, &values), Ok(false));
        assert!(film.tile_is_finished(1) && film.finished() == 1 && !film.is_finished());
        assert_eq!(
            film.tile_sums(1).flatten().take(3).collect::<heapless::Vec<_, 3>>(),
            [0x0807_0605_0403_0201, 0x100f_0e0d_0c0b_0a09, 0]
        );
        assert_eq!(film.sums()[8], [0x0807_0605_0403_0201, 0x100f_0e0d_0c0b_0a09, 0]);
        assert_eq!(film.sums()[18], [0; 3]);
    }

    #[test]
    fn the_step_follows_the_exposure() {
        assert_eq!(Step::log2_for(1.0), -32);
        assert_eq!(Step::log2_for(1000.0), -41);
        assert_eq!(Step::log2_for(0.25), -30);
        assert_eq!(Step::log2_for(f32::NAN), -32);
        assert_eq!(Step::log2_for(f32::MIN_POSITIVE), 32);
    }
}
