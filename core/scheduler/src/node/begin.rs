//! Bundles of primary rays: which tiles come next, and the rays of their pixels.

use super::picture::Picture;
use super::tiles::{OpenTile, Stage, TILE_PIXELS};
use super::{BUNDLE, RUNS, Run, TILES};

use hybray_bintree::walk::{FROM_ROOT, Hit, Walked};
use hybray_geometry::Ray;
use hybray_link::Peer;
use hybray_pyraclip::wide;
use hybray_scene::Pages;
use hybray_shading::id;
use hybray_tracer::{Scene, Walker};
use hybray_wire::{RayKind, RayRecord, TILE};

/// Where a ray of the bundle belongs.
#[derive(Clone, Copy, Default)]
pub(super) struct Place {
    pub x: u32,
    pub y: u32,
    /// Tile of the bundle.
    pub tile: u8,
    /// Pixel of the tile.
    pub pixel: u8,
}

/// The bundle in work.
#[derive(Clone, Copy)]
pub(super) struct InWork {
    /// Tiles and their epochs.
    pub tiles: [(u32, u16); TILES],
    pub count: usize,
    pub rays: usize,
    /// Whether it was begun for the oldest run; else a tile is traced again.
    pub of_run: bool,
}

/// The primary rays of one sample.
pub(super) fn start_sample(picture: &Picture, sample: u16, places: &[Place], rays: &mut [Ray]) {
    let (seed, samples) = (picture.frame.seed, u32::from(picture.frame.samples));
    for (place, ray) in places.iter().zip(rays) {
        let seen = picture.camera.sample(picture.filter, seed, [place.x, place.y], u32::from(sample), samples);
        *ray = Ray { origin: seen.origin, direction: seen.direction, t_min: seen.t_min, t_max: f32::INFINITY };
    }
}

pub(super) fn trace_bundle<P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    walker: &mut Walker<'_>,
) {
    let kernels = walker.kernels;
    let scratch = &mut walker.together.scratch;
    wide::nearest(kernels, &scene.resident, rays, walked, scratch, walker.stack, &mut walker.counts);
}

#[inline]
/// `textured` says whether it tells how much it stands for: a pixel's part of its samples, so that the samples together see what
/// the pixel does.
pub(super) fn primary(
    picture: &Picture,
    textured: bool,
    ray: &Ray,
    place: &Place,
    best: &Hit,
    sample: u16,
    (tile, epoch): (u32, u16),
    home: Peer,
) -> RayRecord {
    let Picture { frame, camera, .. } = picture;
    let t_end = if textured {
        let [width, spread] = camera.footprint(ray.direction);
        let share = 1.0 / libm::sqrtf(f32::from(frame.samples));
        RayRecord::packed_footprint([width * share, spread * share])
    } else {
        0.0
    };
    RayRecord {
        origin: ray.origin.to_array(),
        direction: ray.direction.to_array(),
        t_min: ray.t_min,
        t_max: best.candidate.t,
        t_end,
        id: id::primary_id(frame.seed, place.y * frame.width + place.x, u32::from(sample)),
        primitive: best.candidate.id,
        hit_page: best.page,
        slot: best.slot.0,
        weight: [1.0; 3],
        pixel: place.pixel,
        tile,
        page: FROM_ROOT,
        epoch,
        home,
        kind: RayKind::Primary as u8,
        depth: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Opens the tiles of the next bundle: one that is to be traced again, or the next of the oldest run. `None` if there is
/// none, or no place for them.
pub(super) fn begin(
    picture: &Picture,
    runs: &heapless::Deque<Run, RUNS>,
    tiles: &mut [OpenTile],
    square_from: u32,
) -> Option<InWork> {
    let mut work = InWork { tiles: [(0, 0); TILES], count: 0, rays: 0, of_run: false };
    if let Some(tile) = tiles.iter_mut().find(|t| t.stage == Stage::Again) {
        let (number, epoch) = (tile.tile, tile.epoch);
        tile.open(&picture.frame, &picture.map, number, epoch);
        work.tiles[0] = (number, epoch);
        work.count = 1;
        return Some(work);
    }
    let run = runs.front()?;
    let first = run.first + run.done;
    let count = bundle_of(picture, first, run.count - run.done, square_from) as usize;
    if tiles.iter().filter(|t| t.stage == Stage::Free).count() < count {
        return None;
    }
    work.count = count;
    work.of_run = true;
    for (tile, work) in (first..).zip(&mut work.tiles[..count]) {
        *work = (tile, run.epoch);
        if let Some(place) = tiles.iter_mut().find(|t| t.stage == Stage::Free) {
            place.open(&picture.frame, &picture.map, tile, run.epoch);
        }
    }
    Some(work)
}

/// First tile and number of tiles of the bundle that comes next, after one that is begun if there is one.
pub(super) fn next_bundle(
    picture: &Picture,
    runs: &heapless::Deque<Run, RUNS>,
    begun: Option<&InWork>,
    square_from: u32,
) -> Option<(u32, u32)> {
    let after = begun.filter(|work| work.of_run).map_or(0, |work| work.count as u32);
    let mut runs = runs.iter();
    let run = runs.next()?;
    let (first, left) = match run.count - run.done - after {
        0 => runs.next().map(|run| (run.first, run.count))?,
        left => (run.first + run.done + after, left),
    };
    Some((first, bundle_of(picture, first, left, square_from)))
}

/// Tiles of the bundle that begins with tile `first`, of a run that has `left` tiles: a square if that is enough of them.
fn bundle_of(picture: &Picture, first: u32, left: u32, square_from: u32) -> u32 {
    if left >= square_from { picture.map.square(first, left) } else { 1 }
}

impl InWork {
    /// Fills in where the bundle's rays belong; returns how many they are.
    pub(super) fn place(&self, picture: &Picture, places: &mut [Place; BUNDLE]) -> usize {
        let first = picture.map.tile(self.tiles[0].0);
        let mut rays = 0;
        if self.count == TILES {
            // A square along Morton's curve: halves of it, and of these, are compact.
            let (right, below) = (picture.map.tile(self.tiles[1].0), picture.map.tile(self.tiles[2].0));
            let (width, height) = (TILE + right.width, TILE + below.height);
            for code in 0..BUNDLE as u32 {
                let (x, y) = (even_bits(code), even_bits(code >> 1));
                if x < width && y < height {
                    let tile = (y / TILE) * 2 + x / TILE;
                    let columns = if tile & 1 == 1 { right.width } else { TILE };
                    let pixel = (y % TILE) * columns + x % TILE;
                    places[rays] = Place { x: first.x + x, y: first.y + y, tile: tile as u8, pixel: pixel as u8 };
                    rays += 1;
                }
            }
        } else {
            for code in 0..TILE_PIXELS as u32 {
                let (x, y) = (even_bits(code), even_bits(code >> 1));
                if x < first.width && y < first.height {
                    let pixel = (y * first.width + x) as u8;
                    places[rays] = Place { x: first.x + x, y: first.y + y, tile: 0, pixel };
                    rays += 1;
                }
            }
        }
        rays
    }
}

/// Every other bit, from the lowest.
const fn even_bits(code: u32) -> u32 {
    code & 1 | (code >> 1) & 2 | (code >> 2) & 4 | (code >> 3) & 8
}
