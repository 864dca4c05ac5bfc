//! What pictures must be: traced pixel by pixel, without tiles, bundles or nodes.

use crate::toy::Toy;
use hybray_bintree::walk::Stack;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray};
use hybray_scheduler::{Fixed, Step};
use hybray_shading::{Filter, id};
use hybray_tracer::{HitRecord, Lane, Origin, Scene, Sink, Together, Walker};
use hybray_wire::{Counts, Frame, Optics, RayRecord, TileMap};
use std::sync::OnceLock;

/// A picture, its sums and its cost.
pub struct Picture {
    pub frame: Frame,
    pub scene: Scene<'static>,
    pub map: TileMap,
    pub sums: Vec<[u64; 3]>,
    pub counts: Counts,
    /// Rays of each tile.
    pub costs: Vec<u64>,
}

struct Pixel {
    step: Step,
    sum: [u64; 3],
    rays: u64,
}

impl Sink for Pixel {
    fn contribute(&mut self, _: &Origin, radiance: [f32; 3]) {
        for (sum, c) in self.sum.iter_mut().zip(radiance) {
            if let Fixed::Whole(steps) = self.step.fix(c) {
                *sum += steps;
            }
        }
    }
    fn ended(&mut self, _: &Origin, _: u64) {
        self.rays += 1;
    }
}

impl Picture {
    fn new(scene: Scene<'static>, frame: Frame) -> Self {
        let map = TileMap::new(frame.width, frame.height).unwrap();
        let camera = hybray_scheduler::camera(&frame).unwrap();
        let filter = Filter::from_u32(u32::from(frame.filter)).unwrap();
        let (mut stack, mut together) = (Stack::new(), Together::new());
        let mut records = vec![HitRecord::EMPTY; 64];
        let mut walker = Walker::new(Kernels::Portable, &mut stack, &mut together);
        let mut counts = Counts::default();
        let mut sums = Vec::new();
        let mut rays = Vec::new();
        for pixel in 0..frame.width * frame.height {
            let (x, y) = (pixel % frame.width, pixel / frame.width);
            let mut sink = Pixel { step: Step::new(frame.step_log2), sum: [0; 3], rays: 0 };
            for sample in 0..u32::from(frame.samples) {
                let seen = camera.sample(filter, frame.seed, [x, y], sample, u32::from(frame.samples));
                let ray =
                    Ray { origin: seen.origin, direction: seen.direction, t_min: seen.t_min, t_max: f32::INFINITY };
                let record = RayRecord {
                    origin: ray.origin.to_array(),
                    direction: ray.direction.to_array(),
                    t_min: ray.t_min,
                    t_max: ray.t_max,
                    id: id::primary_id(frame.seed, pixel, sample),
                    primitive: Candidate::NOTHING,
                    weight: [1.0; 3],
                    depth: 1,
                    page: RayRecord::FROM_ROOT,
                    ..bytemuck::Zeroable::zeroed()
                };
                counts.primary += 1;
                let mut lane = Lane::new(&mut records);
                assert_eq!(lane.take(&scene, &mut walker, record, &mut sink, &mut counts), None);
                while !lane.is_empty() {
                    assert_eq!(lane.step(&scene, &mut walker, &mut sink, &mut counts), None);
                }
            }
            sums.push(sink.sum);
            rays.push(sink.rays);
        }
        let costs = (0..map.len())
            .map(|number| {
                let tile = map.tile(number);
                let rows = (tile.y..tile.y + tile.height).map(|y| (y * frame.width + tile.x) as usize);
                rows.map(|first| rays[first..first + tile.width as usize].iter().sum::<u64>()).sum()
            })
            .collect();
        Self { frame, scene, map, sums, counts, costs }
    }

    /// Sums of one tile.
    pub fn tile<'s>(&'s self, sums: &'s [[u64; 3]], number: u32) -> Vec<[u64; 3]> {
        let tile = self.map.tile(number);
        let rows = (tile.y..tile.y + tile.height).map(|y| (y * self.frame.width + tile.x) as usize);
        rows.flat_map(|first| sums[first..first + tile.width as usize].to_vec()).collect()
    }
}

/// Five small pictures of the toy, with whole squares, strips of one tile, and tiles that are cut off, through all
/// kinds of cameras.
pub fn toys() -> &'static [Picture; 5] {
    static TOYS: OnceLock<[Picture; 5]> = OnceLock::new();
    TOYS.get_or_init(|| {
        let toy: &'static Toy = Box::leak(Box::new(Toy::new()));
        let pages = Box::leak(Box::new(toy.open()));
        let pinhole = Optics::PINHOLE;
        let lens = Optics { radius: 0.2, focus: 4.0, blades: 6, rotation_degrees: 15.0, ..pinhole };
        let parallel = Optics { projection: 1, height: 2.0, ..pinhole };
        let around = Optics { projection: 2, ..pinhole };
        let sizes =
            [(1, 1, 3, pinhole), (16, 16, 2, lens), (39, 17, 1, around), (64, 44, 1, pinhole), (100, 8, 1, parallel)];
        sizes.map(|(width, height, samples, optics)| {
            Picture::new(toy.scene(pages), Frame { optics, ..Toy::frame(width, height, samples) })
        })
    })
}

/// An empty scene, whose tiles cost next to nothing to trace, so that large farms can be played with costs made up.
pub fn void() -> Scene<'static> {
    let mut scene = toys()[0].scene;
    scene.resident.directory.nodes = &[];
    scene.resident.directory.entries = &[];
    scene.resident.pages = &[];
    scene.transmits = false;
    scene
}
