//! Tiles whose sums a node keeps: those that it was given, until the last ray that they caused has ended, wherever.

use crate::film::{Fixed, Step};
use crate::ledger::Balance;
use hybray_arena::{List, Ring, Slab};
use hybray_shading::id;
use hybray_tracer::{Origin, Sink};
use hybray_wire::{Counts, Frame, Partial, TILE, TileMap};

/// Pixels of a tile.
pub const TILE_PIXELS: usize = (TILE * TILE) as usize;

/// How far a tile is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// The place is free.
    #[default]
    Free,
    /// Rays of it are under way.
    Open,
    /// Every ray has ended: its sums are to be sent.
    Finished,
    /// It is to be traced again.
    Again,
}

/// A tile and its sums: 1.6 KB.
#[derive(Clone, Copy, Debug)]
pub struct OpenTile {
    /// Its number.
    pub tile: u32,
    /// Its epoch.
    pub epoch: u16,
    /// How far it is.
    pub stage: Stage,
    /// What is still owed.
    balance: Balance,
    /// Sum of the entries so far: what the film is told.
    pub entry: u64,
    /// Rays that have ended, as far as this node knows.
    pub rays: u32,
    /// Red, green and blue of each pixel, steps of the film.
    pub sums: [[u64; 3]; TILE_PIXELS],
}

impl OpenTile {
    /// A place without a tile.
    pub const FREE: Self = Self {
        tile: u32::MAX,
        epoch: 0,
        stage: Stage::Free,
        balance: Balance::ZERO,
        entry: 0,
        rays: 0,
        sums: [[0; 3]; TILE_PIXELS],
    };

    /// Debits a tile's primaries and empties its sums.
    pub fn open(&mut self, frame: &Frame, map: &TileMap, tile: u32, epoch: u16) {
        let (t, samples) = (map.tile(tile), frame.drawn());
        let pixels = (t.y..t.y + t.height).flat_map(|y| (t.x..t.x + t.width).map(move |x| y * frame.width + x));
        let ids =
            pixels.flat_map(|pixel| samples.clone().map(move |s| id::primary_id(frame.seed, pixel, u32::from(s))));
        *self = Self { tile, epoch, stage: Stage::Open, balance: Balance::debit(ids), ..Self::FREE };
    }

    /// Has it traced again under the next epoch: what comes under this one is dropped from now on.
    pub fn again(&mut self) {
        self.epoch = self.epoch.saturating_add(1);
        self.stage = Stage::Again;
    }

    fn add(&mut self, pixel: u8, sums: [u64; 3]) {
        for (sum, steps) in self.sums[usize::from(pixel) % TILE_PIXELS].iter_mut().zip(sums) {
            *sum = sum.saturating_add(steps);
        }
    }

    fn end(&mut self, entry: u64, rays: u32) {
        self.balance.add(entry);
        self.entry = self.entry.wrapping_add(entry);
        self.rays = self.rays.saturating_add(rays);
        if self.balance.is_zero() {
            self.stage = Stage::Finished;
        }
    }

    /// Adds what another node sends, if it is for this tile as it is now.
    pub fn take(&mut self, partial: &Partial) {
        self.add(partial.pixel, partial.sums);
        if partial.entry != 0 {
            self.end(partial.entry, 1);
        }
    }
}

/// The place of the open tile with this number and epoch. `hint` is looked at first.
pub fn place_of(tiles: &[OpenTile], hint: usize, tile: u32, epoch: u16) -> Option<usize> {
    let is = |t: &OpenTile| t.tile == tile && t.stage == Stage::Open && t.epoch == epoch;
    if tiles.get(hint).is_some_and(is) {
        return Some(hint);
    }
    tiles.iter().position(is)
}

/// The node's part of the film: sums of its own tiles, and partial sums for those of others.
pub struct Sums<'a, 'm> {
    /// How contributions are rounded.
    pub step: Step,
    /// This node.
    pub me: u16,
    /// Its tiles.
    pub tiles: &'a mut [OpenTile],
    /// Place of the tile that was last added to.
    pub hint: usize,
    /// What goes to other nodes.
    pub partials: &'a mut Slab<'m, Partial>,
    /// Lists of it, by peer.
    pub lists: &'a mut [List],
    /// Peers whose lists hold something.
    pub owing: &'a mut Ring<'m, u16>,
    /// Contributions.
    pub counts: Counts,
    /// Rays that have ended.
    pub ended: u64,
}

impl Sums<'_, '_> {
    fn add(&mut self, origin: &Origin, sums: [u64; 3], entry: u64) {
        if origin.home == self.me {
            let Some(place) = place_of(self.tiles, self.hint, origin.tile, origin.epoch) else { return };
            self.hint = place;
            let tile = &mut self.tiles[place];
            tile.add(origin.pixel, sums);
            if entry != 0 {
                tile.end(entry, 1);
            }
            return;
        }
        let Some(list) = self.lists.get_mut(usize::from(origin.home)) else { return };
        let new = Partial { sums, entry, tile: origin.tile, epoch: origin.epoch, pixel: origin.pixel, reserved: 0 };
        let same = |p: &&mut Partial| (p.tile, p.epoch, p.pixel) == (new.tile, new.epoch, new.pixel);
        if let Some(last) = self.partials.back_mut(list).filter(same) {
            for (sum, steps) in last.sums.iter_mut().zip(sums) {
                *sum = sum.saturating_add(steps);
            }
            last.entry = last.entry.wrapping_add(entry);
            return;
        }
        // Whoever traces asks for room first: a unit of work adds to one pixel.
        let first = list.is_empty();
        let full = self.partials.push_back(list, new);
        debug_assert!(full.is_ok(), "no room for a partial sum");
        if first && full.is_ok() {
            // One entry for each peer, and each is in it once.
            let _ = self.owing.push_back(origin.home);
        }
    }
}

impl Sink for Sums<'_, '_> {
    fn contribute(&mut self, origin: &Origin, radiance: [f32; 3]) {
        self.counts.contributions += 1;
        if let Some(sums) = self.step.fix_whole(radiance) {
            self.add(origin, sums, 0);
            return;
        }
        let fixed = radiance.map(|c| self.step.fix(c));
        if fixed.contains(&Fixed::Refused) {
            self.counts.refused += 1;
            return;
        }
        self.counts.clamped += u64::from(fixed.iter().any(|f| matches!(f, Fixed::Clamped(_))));
        let sums = fixed.map(|fixed| match fixed {
            Fixed::Whole(steps) | Fixed::Clamped(steps) => steps,
            Fixed::Refused => 0,
        });
        self.add(origin, sums, 0);
    }

    fn ended(&mut self, origin: &Origin, entry: u64) {
        self.ended += 1;
        self.add(origin, [0; 3], entry);
    }
}
