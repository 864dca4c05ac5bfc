//! The ledger and the film over random ray trees: entries in any order, in any frames, from any nodes. Never finished
//! early, always finished; one entry too few, too many or wrong is always noticed.

mod common;

use common::Rng;
use hybray_scheduler::{Film, FilmError, TileState};
use hybray_shading::id;
use hybray_wire::{Frame, TileMap};
use proptest::prelude::*;

const SEED: u64 = 99;

/// A ray that ended: its ledger entry, and what it brought to which pixel of the tile.
#[derive(Clone, Copy, Debug)]
struct Ended {
    entry: u64,
    /// Number in the tile, row by row.
    pixel: usize,
    steps: [u64; 3],
}

/// What a node sends of one tile at a time.
#[derive(Clone, Debug)]
struct Batch {
    entry: u64,
    values: Vec<u8>,
}

struct Picture {
    frame: Frame,
    map: TileMap,
    sums: Vec<[u64; 3]>,
    tiles: Vec<TileState>,
}

impl Picture {
    fn new(width: u32, height: u32, samples: u16) -> Self {
        let map = TileMap::new(width, height).unwrap();
        let frame = Frame {
            width,
            height,
            samples,
            depth_max: 5,
            filter: 0,
            seed: SEED,
            weight_cutoff: 0.0,
            step_log2: -32,
            eye: [0.0; 3],
            target: [0.0; 3],
            up: [0.0; 3],
            fov_y_degrees: 45.0,
            hither: 0.0,
            layer: 0,
            half: 0,
            optics: hybray_wire::Optics::PINHOLE,
        };
        let sums = vec![[5; 3]; (width * height) as usize];
        Self { frame, map, sums, tiles: vec![TileState::default(); map.len() as usize] }
    }

    fn film(&mut self) -> Film<'_> {
        Film::new(&self.frame, &mut self.sums, &mut self.tiles).unwrap()
    }
}

/// Every ray of a tile: for each primary a random tree, in the order of a walk through it.
fn rays(map: &TileMap, tile: u32, samples: u16, rng: &mut Rng) -> Vec<Ended> {
    let place = map.tile(tile);
    let mut all = Vec::new();
    for number in 0..place.pixels() {
        let (x, y) = (place.x + number as u32 % place.width, place.y + number as u32 / place.width);
        let pixel = y * map.width() + x;
        let mut open: Vec<(u64, u32)> = (0..u32::from(samples)).map(|s| (id::primary_id(SEED, pixel, s), 1)).collect();
        while let Some((ray, depth)) = open.pop() {
            let children = if depth < 6 { rng.pick(&[0, 0, 0, 0, 1, 2, 3]) } else { 0 };
            let mut entry = ray.wrapping_neg();
            for branch in 1..=children {
                let child = id::child_id(ray, branch);
                entry = entry.wrapping_add(child);
                open.push((child, depth + 1));
            }
            all.push(Ended { entry, pixel: number, steps: [rng.below(1 << 40), rng.below(9), rng.below(2)] });
        }
    }
    all
}

/// Shuffles rays and puts about `mean` of them into each frame, as if any number of nodes had shared them.
fn batches(mut rays: Vec<Ended>, pixels: usize, mean: u64, rng: &mut Rng) -> Vec<Batch> {
    rng.shuffle(&mut rays);
    let mut frames = Vec::new();
    let mut rest = &rays[..];
    while !rest.is_empty() {
        let (now, later) = rest.split_at((rng.between(1, 2 * mean) as usize).min(rest.len()));
        let mut steps = vec![[0u64; 3]; pixels];
        for ray in now {
            (0..3).for_each(|c| steps[ray.pixel][c] += ray.steps[c]);
        }
        let entry = now.iter().fold(0u64, |sum, ray| sum.wrapping_add(ray.entry));
        frames.push(Batch { entry, values: steps.as_flattened().iter().flat_map(|s| s.to_le_bytes()).collect() });
        rest = later;
    }
    frames
}

/// What the tile must hold in the end, by another way: wide integers, ray by ray.
fn expected(rays: &[Ended], pixels: usize) -> Vec<[u128; 3]> {
    let mut sums = vec![[0u128; 3]; pixels];
    for ray in rays {
        (0..3).for_each(|c| sums[ray.pixel][c] += u128::from(ray.steps[c]));
    }
    sums
}

fn held(film: &Film<'_>, tile: u32) -> Vec<[u128; 3]> {
    let place = film.map().tile(tile);
    let pixels = (place.y..place.y + place.height).flat_map(|y| (place.x..place.x + place.width).map(move |x| (x, y)));
    let width = film.map().width();
    pixels.map(|(x, y)| film.sums()[(y * width + x) as usize].map(u128::from)).collect()
}

fn shape(map: &TileMap, tile: u32) -> (u8, u8) {
    (map.tile(tile).width as u8, map.tile(tile).height as u8)
}

/// One case: a tile of a picture, and its frames.
struct Case {
    picture: Picture,
    tile: u32,
    rays: Vec<Ended>,
    mean: u64,
    rng: Rng,
}

/// What a person needs to see of a failure; the rest follows from it.
impl std::fmt::Debug for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (w, h) = (self.picture.map.width(), self.picture.map.height());
        write!(f, "{w} x {h}, tile {}, {} rays, {} a frame", self.tile, self.rays.len(), self.mean)
    }
}

impl Case {
    fn pixels(&self) -> usize {
        self.picture.map.tile(self.tile).pixels()
    }

    fn frames(&mut self) -> Vec<Batch> {
        batches(self.rays.clone(), self.pixels(), self.mean, &mut self.rng)
    }
}

fn cases() -> impl Strategy<Value = Case> {
    let size = (1u32..20, 1u32..20, 1u16..4);
    (size, any::<u64>(), prop_oneof![Just(1u64), 2u64..40, Just(100_000)]).prop_map(|((w, h, samples), seed, mean)| {
        let mut rng = Rng(seed);
        let picture = Picture::new(w, h, samples);
        let tile = rng.below(u64::from(picture.map.len())) as u32;
        let rays = rays(&picture.map, tile, samples, &mut rng);
        Case { picture, tile, rays, mean, rng }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_tile_is_finished_by_its_last_entry_and_no_other(mut case in cases()) {
        let frames = case.frames();
        let again = case.frames();
        let (tile, shape) = (case.tile, shape(&case.picture.map, case.tile));
        let mut hashes = Vec::new();
        for frames in [frames, again] {
            let mut film = case.picture.film();
            for (i, frame) in frames.iter().enumerate() {
                let done = film.add(tile, 0, shape, frame.entry, &frame.values).unwrap();
                prop_assert_eq!(done, i + 1 == frames.len(), "frame {} of {}", i + 1, frames.len());
                prop_assert_eq!(film.tile_is_finished(tile), done);
                prop_assert_eq!(film.finished(), u32::from(done));
            }
            hashes.push(film.hash());
            prop_assert_eq!(held(&film, tile), expected(&case.rays, shape.0 as usize * shape.1 as usize));
            // A finished tile takes nothing more, whatever the epoch.
            for epoch in [0, 1, u16::MAX] {
                prop_assert_eq!(film.add(tile, epoch, shape, frames[0].entry, &frames[0].values), Ok(false));
            }
            film.open(tile, 3);
            prop_assert!(film.tile_is_finished(tile) && film.finished() == 1);
            prop_assert_eq!(film.hash(), *hashes.last().unwrap());
        }
        prop_assert_eq!(hashes[0], hashes[1], "the order shows");
    }

    #[test]
    fn an_entry_too_few_too_many_or_wrong_is_noticed(mut case in cases()) {
        let (tile, shape) = (case.tile, shape(&case.picture.map, case.tile));
        let frames = case.frames();
        let victim = case.rng.below(frames.len() as u64) as usize;
        let flipped = 1 << case.rng.below(64);
        for fault in 0..3 {
            let mut frames = frames.clone();
            let mut last = false;
            match fault {
                0 => drop(frames.remove(victim)),
                1 => {
                    let at = case.rng.between(victim as u64 + 1, frames.len() as u64) as usize;
                    last = at == frames.len();
                    frames.insert(at, frames[victim].clone());
                }
                _ => frames[victim].entry ^= flipped,
            }
            let mut film = case.picture.film();
            for frame in &frames {
                film.add(tile, 0, shape, frame.entry, &frame.values).unwrap();
            }
            // What comes twice after the end finds a finished tile, and is dropped.
            prop_assert_eq!(film.tile_is_finished(tile), last, "fault {}", fault);
            if last {
                prop_assert_eq!(held(&film, tile), expected(&case.rays, shape.0 as usize * shape.1 as usize));
            }
        }
    }

    /// Frames of three epochs in one stream, each epoch's in its own order: the last epoch's frames alone count, from
    /// the first of them on.
    #[test]
    fn a_new_epoch_begins_with_an_empty_tile_and_ends_the_old_ones(mut case in cases()) {
        let (tile, shape) = (case.tile, shape(&case.picture.map, case.tile));
        let mut queues = Vec::new();
        for epoch in [2u16, 3, 7] {
            let mut frames = case.frames();
            if epoch < 7 {
                // Whole epochs would finish the tile: a lost frame is why there is a next one.
                frames.remove(case.rng.below(frames.len() as u64) as usize);
            }
            queues.push((epoch, std::collections::VecDeque::from(frames)));
        }
        let mut film = case.picture.film();
        let mut newest = 0;
        while queues.iter().any(|(_, frames)| !frames.is_empty()) {
            let (epoch, frames) = &mut queues[case.rng.below(3) as usize];
            let Some(frame) = frames.pop_front() else { continue };
            let before = held(&film, tile);
            let done = film.add(tile, *epoch, shape, frame.entry, &frame.values).unwrap();
            prop_assert_eq!(done, *epoch == 7 && frames.is_empty());
            if *epoch < newest {
                prop_assert_eq!(held(&film, tile), before, "a frame of epoch {} after one of {}", epoch, newest);
            }
            newest = newest.max(*epoch);
            prop_assert_eq!(film.epoch(tile), newest);
        }
        prop_assert!(film.tile_is_finished(tile));
        prop_assert_eq!(held(&film, tile), expected(&case.rays, shape.0 as usize * shape.1 as usize));
    }

    #[test]
    fn frames_of_other_shapes_change_nothing(mut case in cases()) {
        let (tile, (width, height)) = (case.tile, shape(&case.picture.map, case.tile));
        let frame = case.frames().remove(0);
        let tiles = case.picture.map.len();
        let mut film = case.picture.film();
        let before = film.hash();
        prop_assert_eq!(film.add(tiles, 0, (width, height), 1, &frame.values), Err(FilmError::Tile(tiles)));
        prop_assert_eq!(film.add(u32::MAX, 0, (width, height), 1, &frame.values), Err(FilmError::Tile(u32::MAX)));
        for wrong in [(width + 1, height), (width, height - 1), (0, 0)] {
            prop_assert_eq!(film.add(tile, 9, wrong, 1, &frame.values), Err(FilmError::Tile(tile)));
        }
        prop_assert!(film.add(tile, 9, (width, height), 1, &frame.values[1..]).is_err());
        prop_assert_eq!((film.hash(), film.epoch(tile)), (before, 0));
    }
}

#[test]
fn sums_stay_at_the_greatest_in_any_order() {
    let mut picture = Picture::new(1, 1, 1);
    for order in [[u64::MAX - 3, 5, 9], [5, u64::MAX - 3, 9], [9, 5, u64::MAX - 3]] {
        let mut film = picture.film();
        for steps in order {
            film.add(0, 0, (1, 1), 1, &[steps.to_le_bytes(); 3].concat()).unwrap();
        }
        assert_eq!(film.sums(), [[u64::MAX; 3]]);
    }
}

#[test]
fn a_film_wants_memory_that_fits() {
    let frame = Picture::new(9, 9, 1).frame;
    let mut sums = [[0; 3]; 81];
    assert!(Film::new(&frame, &mut sums, &mut [TileState::default(); 4]).is_some());
    assert!(Film::new(&frame, &mut sums, &mut [TileState::default(); 3]).is_none());
    assert!(Film::new(&frame, &mut sums[1..], &mut [TileState::default(); 4]).is_none());
    assert!(Film::new(&Frame { width: 0, ..frame }, &mut [], &mut []).is_none());
}
