//! A node: traces runs of tiles and sends what it finds to the film.
//!
//! It works on a bundle at a time: four tiles that make a square, or one. Primary rays are traced as a bundle; each
//! hit's rays are finished depth first in a lane. Sums go out tile by tile, with the ledger entries of all rays that
//! ended; until the link has taken them, no new bundle begins.

use crate::film::{Fixed, Step};
use crate::send;
use hybray_bintree::walk::{Hit, Stack};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_link::{HOST, Link, Peer};
use hybray_pyraclip::wide;
use hybray_shading::{Camera, Filter, id, sample_offset};
use hybray_tracer::{HitRecord, Lane, Origin, Scene, Sink, Walker};
use hybray_wire::{Counts, Frame, MESSAGE_BYTES_MAX, Message, RayKind, RayRecord, TILE, TileMap, encode};

/// Tiles of a bundle.
const TILES: usize = 4;
/// Pixels of a tile.
const TILE_PIXELS: usize = (TILE * TILE) as usize;
/// Primary rays of a bundle.
const BUNDLE: usize = TILES * TILE_PIXELS;
/// Runs that wait.
const RUNS: usize = 4;
/// Lane steps in one [`Node::step`].
const STEPS: usize = 4096;

/// Everything that a node works in, carved before it starts: 43 KB, a record for each level of depth included (term by
/// term in docs/MEMORY.md).
pub struct NodeMemory {
    rays: [Ray; BUNDLE],
    hits: [Hit; BUNDLE],
    places: [Place; BUNDLE],
    sums: [[u64; 3]; BUNDLE],
    entries: [Entry; TILES],
    lane: [HitRecord; DEPTH_MAX],
    stack: Stack,
    bundle: wide::Scratch,
}

const _: () = assert!(size_of::<NodeMemory>() <= 43_360);

/// Depth of a picture at most.
pub const DEPTH_MAX: usize = 64;

impl NodeMemory {
    /// Zeroed.
    #[must_use]
    pub fn new() -> Self {
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 0.0 };
        Self {
            rays: [ray; BUNDLE],
            hits: [Hit::none(0.0); BUNDLE],
            places: [Place::default(); BUNDLE],
            sums: [[0; 3]; BUNDLE],
            entries: [Entry::default(); TILES],
            lane: [HitRecord::EMPTY; DEPTH_MAX],
            stack: Stack::new(),
            bundle: wide::Scratch::new(),
        }
    }
}

impl Default for NodeMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// Ledger entries of a tile.
#[derive(Clone, Copy, Default)]
struct Entry {
    sum: u64,
    rays: u32,
}

/// Where a ray of the bundle belongs.
#[derive(Clone, Copy, Default)]
struct Place {
    x: u32,
    y: u32,
    /// Tile of the bundle, times 64, plus the pixel's number in it: where its sum is.
    sum: u16,
}

#[derive(Clone, Copy)]
struct Run {
    first: u32,
    count: u32,
    epoch: u16,
    done: u32,
    nanoseconds: u64,
}

/// A picture that is being traced.
struct Picture {
    frame: Frame,
    map: TileMap,
    camera: Camera,
    filter: Filter,
    step: Step,
}

impl Picture {
    fn new(frame: Frame) -> Option<Self> {
        let camera = Camera::look(
            frame.eye.into(),
            frame.target.into(),
            frame.up.into(),
            frame.fov_y_degrees,
            frame.hither,
            frame.width,
            frame.height,
        );
        let sound = frame.samples > 0 && (1..=DEPTH_MAX as u8).contains(&frame.depth_max);
        Some(Self {
            frame,
            map: TileMap::new(frame.width, frame.height).filter(|_| sound)?,
            camera: camera.ok()?,
            filter: Filter::from_u32(u32::from(frame.filter))?,
            step: Step::new(frame.step_log2),
        })
    }
}

/// Whether nodes can draw this picture: it has pixels, samples, a depth of 1 to 64, a filter, and a camera that looks
/// somewhere. Ask before it begins: a node passes over what it cannot draw, and its tiles would be waited for.
#[must_use]
pub fn can_draw(frame: &Frame) -> bool {
    Picture::new(*frame).is_some()
}

/// What is in work.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Nothing: the next bundle may begin.
    Idle,
    /// Sample `sample` of the bundle; rays from `next` on are still to be shaded, and of the one before, `depth` records of
    /// the lane are in use.
    Shading { sample: u16, next: usize, depth: usize },
    /// Tiles from `tile` on are still to be sent.
    Sending { tile: usize },
}

/// The machine.
pub struct Node<'m, 's> {
    scene: Scene<'s>,
    memory: &'m mut NodeMemory,
    kernels: Kernels,
    dispatcher: Peer,
    scene_hash: u64,
    picture: Option<Picture>,
    runs: heapless::Deque<Run, RUNS>,
    /// First tile and number of tiles of the bundle in work, and its rays.
    bundle: (u32, usize, usize),
    stage: Stage,
    /// Runs that are done and not yet told.
    done: heapless::Deque<Run, RUNS>,
    greeted: [bool; 2],
    report: bool,
    stopped: bool,
    counts: Counts,
    walk_counts: hybray_bintree::walk::Counts,
    tiles: u32,
    runs_given: u32,
    busy: u64,
}

impl<'m, 's> Node<'m, 's> {
    /// A node with all of `scene`, that takes its tiles from `dispatcher`.
    pub fn new(
        scene: Scene<'s>,
        scene_hash: u64,
        kernels: Kernels,
        dispatcher: Peer,
        memory: &'m mut NodeMemory,
    ) -> Self {
        Self {
            scene,
            memory,
            kernels,
            dispatcher,
            scene_hash,
            picture: None,
            runs: heapless::Deque::new(),
            bundle: (0, 0, 0),
            stage: Stage::Idle,
            done: heapless::Deque::new(),
            greeted: [false; 2],
            report: false,
            stopped: false,
            counts: Counts::default(),
            walk_counts: hybray_bintree::walk::Counts::default(),
            tiles: 0,
            runs_given: 0,
            busy: 0,
        }
    }

    /// Whether it was told to end, and has said what it did.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped && !self.report
    }

    /// Boxes, blocks and pages of all walks so far.
    #[must_use]
    pub fn walk_counts(&self) -> hybray_bintree::walk::Counts {
        self.walk_counts
    }

    /// Takes in a message; those for other machines, and those from peers that have no right to them, are passed over.
    /// A node draws one picture.
    pub fn handle(&mut self, from: Peer, message: &Message) {
        match *message {
            Message::Begin(frame) if from == HOST && self.picture.is_none() => self.begin(frame),
            Message::Tiles { first, count, epoch } if from == self.dispatcher => {
                let fits = self
                    .picture
                    .as_ref()
                    .is_some_and(|p| count > 0 && first.checked_add(count).is_some_and(|end| end <= p.map.len()));
                // A dispatcher never has more than two runs at a node; one that does is not heard.
                if fits && self.runs.push_back(Run { first, count, epoch, done: 0, nanoseconds: 0 }).is_ok() {
                    self.runs_given += 1;
                }
            }
            Message::Finished { tile: u32::MAX } if from == self.dispatcher => self.report = true,
            Message::Stop if from == HOST => {
                // What is in work is lost; what was done is still told.
                self.runs.clear();
                self.done.clear();
                self.stage = Stage::Idle;
                self.stopped = true;
                self.report = true;
            }
            _ => {}
        }
    }

    fn begin(&mut self, frame: Frame) {
        self.picture = Picture::new(frame);
        if let Some(Picture { frame, .. }) = &self.picture {
            self.scene.shading.ray_depth_max = u32::from(frame.depth_max);
            self.scene.shading.weight_cutoff = frame.weight_cutoff;
        }
    }

    /// Traces for a while: at most one bundle of primary rays and some thousand rays of their hits. Returns whether
    /// there was anything to do. `clock` is asked before and after.
    pub fn step(&mut self, clock: &mut dyn FnMut() -> u64) -> bool {
        let before = clock();
        let worked = match self.stage {
            Stage::Idle => self.start_bundle(),
            Stage::Shading { sample, next, depth } => {
                self.shade(sample, next, depth);
                true
            }
            Stage::Sending { .. } => false,
        };
        if worked {
            let spent = clock().saturating_sub(before);
            self.busy += spent;
            if let Some(run) = self.runs.front_mut() {
                run.nanoseconds += spent;
            }
        }
        worked
    }

    fn start_bundle(&mut self) -> bool {
        let Some(picture) = &self.picture else { return false };
        let Some(run) = self.runs.front() else { return false };
        let first = run.first + run.done;
        let tiles = picture.map.square(first, run.count - run.done) as usize;
        let m = &mut *self.memory;
        let mut rays = 0;
        if tiles == TILES {
            // A square along Morton's curve: halves of it, and of these, are compact.
            let corner = picture.map.tile(first);
            let (right, below) = (picture.map.tile(first + 1), picture.map.tile(first + 2));
            let (width, height) = (8 + right.width, 8 + below.height);
            for code in 0..BUNDLE as u32 {
                let (x, y) = (even_bits(code), even_bits(code >> 1));
                if x < width && y < height {
                    let tile = (y / TILE) * 2 + x / TILE;
                    let columns = if tile & 1 == 1 { right.width } else { TILE };
                    let pixel = (y % TILE) * columns + x % TILE;
                    let sum = (tile * TILE_PIXELS as u32 + pixel) as u16;
                    m.places[rays] = Place { x: corner.x + x, y: corner.y + y, sum };
                    rays += 1;
                }
            }
        } else {
            let tile = picture.map.tile(first);
            for code in 0..TILE_PIXELS as u32 {
                let (x, y) = (even_bits(code), even_bits(code >> 1));
                if x < tile.width && y < tile.height {
                    m.places[rays] = Place { x: tile.x + x, y: tile.y + y, sum: (y * tile.width + x) as u16 };
                    rays += 1;
                }
            }
        }
        m.sums[..tiles * TILE_PIXELS].fill([0; 3]);
        m.entries[..tiles].fill(Entry::default());
        self.bundle = (first, tiles, rays);
        self.start_sample(0);
        true
    }

    /// Traces the bundle's primary rays of one sample.
    fn start_sample(&mut self, sample: u16) {
        let Some(Picture { frame, camera, filter, .. }) = &self.picture else { return };
        let rays = self.bundle.2;
        let m = &mut *self.memory;
        for (place, ray) in m.places[..rays].iter().zip(&mut m.rays) {
            let pixel = place.y * frame.width + place.x;
            let pixel_id = id::pixel_id(frame.seed, pixel);
            let offset = sample_offset(*filter, pixel_id, u32::from(sample), u32::from(frame.samples));
            let seen = camera.ray(place.x, place.y, offset);
            *ray = Ray { origin: seen.origin, direction: seen.direction, t_min: seen.t_min, t_max: f32::INFINITY };
        }
        wide::nearest(
            self.kernels,
            &self.scene.resident,
            self.scene.magnitude,
            &m.rays[..rays],
            &mut m.hits[..rays],
            &mut m.bundle,
            &mut m.stack,
            &mut self.walk_counts,
        );
        self.counts.primary += rays as u64;
        self.stage = Stage::Shading { sample, next: 0, depth: 0 };
    }

    /// Shades hits from `next` on, after what is left of the one before, until enough was done.
    fn shade(&mut self, sample: u16, mut next: usize, depth: usize) {
        let Some(picture) = &self.picture else { return };
        let (first, tiles, rays) = self.bundle;
        let epoch = self.runs.front().map_or(0, |run| run.epoch);
        let (samples, width) = (picture.frame.samples, picture.frame.width);
        let m = &mut *self.memory;
        let mut sums =
            Sums { step: picture.step, sums: &mut m.sums, entries: &mut m.entries, at: 0, counts: Counts::default() };
        let mut walker = Walker { kernels: self.kernels, stack: &mut m.stack, counts: Default::default() };
        let mut lane = Lane::resume(&mut m.lane, depth);
        let mut counts = Counts::default();
        sums.at = next.checked_sub(1).map_or(0, |ray| usize::from(m.places[ray].sum));
        for _ in 0..STEPS {
            if !lane.is_empty() {
                lane.step(&self.scene, &mut walker, &mut sums, &mut counts);
                continue;
            }
            if next == rays {
                break;
            }
            let (place, ray) = (&m.places[next], &m.rays[next]);
            sums.at = usize::from(place.sum);
            let pixel = place.y * width + place.x;
            let record = RayRecord {
                origin: ray.origin.to_array(),
                direction: ray.direction.to_array(),
                t_min: ray.t_min,
                t_max: ray.t_max,
                id: id::primary_id(picture.frame.seed, pixel, u32::from(sample)),
                primitive: Candidate::NOTHING,
                hit_page: 0,
                weight: [1.0; 3],
                pixel,
                tile: first + u32::from(place.sum) / TILE_PIXELS as u32,
                page: 0,
                epoch,
                sample,
                slot: 0,
                medium: 0,
                kind: RayKind::Primary as u8,
                depth: 1,
                reserved: 0,
                footprint: 0.0,
            };
            lane.start(&self.scene, &record, &m.hits[next], &mut sums, &mut counts);
            next += 1;
        }
        let depth = lane.depth();
        self.walk_counts += walker.counts;
        counts += sums.counts;
        self.counts += counts;
        if next < rays || depth > 0 {
            self.stage = Stage::Shading { sample, next, depth };
        } else if sample + 1 < samples {
            self.start_sample(sample + 1);
        } else {
            self.tiles += tiles as u32;
            self.stage = Stage::Sending { tile: 0 };
        }
    }

    /// Sends what is finished, and what has to be said. Returns whether anything was sent. Bounded: four tiles and a
    /// few short messages.
    pub fn poll(&mut self, link: &mut dyn Link) -> bool {
        let mut sent = false;
        for (i, peer) in [HOST, self.dispatcher].into_iter().enumerate() {
            // A dispatcher elsewhere may be quicker than the host: it hears of this node once the picture has begun.
            let ready = peer == HOST || self.picture.is_some();
            if !self.greeted[i] && ready {
                let twice = i == 1 && peer == HOST;
                let hello = Message::Hello { version: hybray_wire::VERSION, scene: self.scene_hash };
                self.greeted[i] = twice || send(link, peer, &hello);
                sent |= self.greeted[i];
            }
        }
        // The host hears who it is before it hears anything else: a stranger's contributions must not come first.
        if !self.greeted[0] {
            return sent;
        }
        sent |= self.send_tiles(link);
        while let Some(run) = self.done.front() {
            let done = Message::Done { first: run.first, count: run.count, nanoseconds: run.nanoseconds };
            if !send(link, self.dispatcher, &done) {
                break;
            }
            self.done.pop_front();
            sent = true;
        }
        if self.report && self.runs.is_empty() && self.done.is_empty() && self.stage == Stage::Idle {
            let report = Message::Report {
                counts: self.counts,
                tiles: self.tiles,
                runs: self.runs_given,
                busy_nanoseconds: self.busy,
            };
            self.report = !send(link, HOST, &report);
            sent |= !self.report;
        }
        sent
    }

    fn send_tiles(&mut self, link: &mut dyn Link) -> bool {
        let Stage::Sending { mut tile } = self.stage else { return false };
        let (Some(picture), Some(&run)) = (&self.picture, self.runs.front()) else { return false };
        let (first, tiles, _) = self.bundle;
        let m = &*self.memory;
        let before = tile;
        while tile < tiles {
            let number = first + tile as u32;
            let shape = picture.map.tile(number);
            let message = Message::Contributions {
                tile: number,
                epoch: run.epoch,
                width: shape.width as u8,
                height: shape.height as u8,
                rays: m.entries[tile].rays,
                entry: m.entries[tile].sum,
            };
            let sums = &m.sums[tile * TILE_PIXELS..][..shape.pixels()];
            let sent = link.send(HOST, MESSAGE_BYTES_MAX, &mut |room| {
                encode(&message, room, |body| {
                    for (bytes, sum) in body.chunks_exact_mut(8).zip(sums.as_flattened()) {
                        bytes.copy_from_slice(&sum.to_le_bytes());
                    }
                })
                .expect("the room for a message is enough for any")
            });
            if !sent {
                break;
            }
            tile += 1;
        }
        self.stage = if tile < tiles { Stage::Sending { tile } } else { Stage::Idle };
        if tile == tiles
            && let Some(run) = self.runs.front_mut()
        {
            run.done += tiles as u32;
            if run.done == run.count
                && let Some(run) = self.runs.pop_front()
            {
                // There is room: no more runs are taken in than this queue holds, and each is told before the next
                // ends.
                let _ = self.done.push_back(run);
            }
        }
        tile > before
    }
}

/// Every other bit, from the lowest.
const fn even_bits(code: u32) -> u32 {
    code & 1 | (code >> 1) & 2 | (code >> 2) & 4 | (code >> 3) & 8
}

/// The bundle's part of the film.
struct Sums<'a> {
    step: Step,
    sums: &'a mut [[u64; 3]; BUNDLE],
    entries: &'a mut [Entry; TILES],
    /// The pixel that is being traced.
    at: usize,
    counts: Counts,
}

impl Sink for Sums<'_> {
    fn contribute(&mut self, _: &Origin, radiance: [f32; 3]) {
        self.counts.contributions += 1;
        let fixed = radiance.map(|c| self.step.fix(c));
        if fixed.contains(&Fixed::Refused) {
            self.counts.refused += 1;
            return;
        }
        self.counts.clamped += u64::from(fixed.iter().any(|f| matches!(f, Fixed::Clamped(_))));
        for (sum, fixed) in self.sums[self.at].iter_mut().zip(fixed) {
            if let Fixed::Whole(steps) | Fixed::Clamped(steps) = fixed {
                *sum = sum.saturating_add(steps);
            }
        }
    }

    fn ended(&mut self, _: &Origin, entry: u64) {
        let tile = &mut self.entries[self.at / TILE_PIXELS];
        tile.sum = tile.sum.wrapping_add(entry);
        tile.rays = tile.rays.saturating_add(1);
    }
}
