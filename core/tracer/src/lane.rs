//! A lane: rays finished on the spot, depth first, in bounded memory.

use crate::hit::{HitRecord, Origin, surface};
use crate::scene::Scene;
use bytemuck::Zeroable;
use hybray_bintree::walk::{self, Hit, Stack};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_shading::{Child, id, spawn};
use hybray_wire::{Counts, RayKind, RayRecord};

/// Where results go.
pub trait Sink {
    /// Adds `radiance` to a pixel. Returns whether it was added whole, cut, or refused.
    fn contribute(&mut self, origin: &Origin, radiance: [f32; 3]);
    /// A ray has ended: `entry` is minus its id plus the sum of its children's (DESIGN section 7).
    fn ended(&mut self, origin: &Origin, entry: u64);
}

/// What walks need: kernels, a stack, and counters.
pub struct Walker<'s> {
    /// Which kernels the processor can run.
    pub kernels: Kernels,
    /// Scratch of walks.
    pub stack: &'s mut Stack,
    /// Nodes, blocks and pages.
    pub counts: walk::Counts,
}

impl Walker<'_> {
    /// The nearest hit.
    #[must_use]
    pub fn nearest(&mut self, scene: &Scene<'_>, ray: &Ray) -> Hit {
        walk::nearest(self.kernels, &scene.resident, ray, self.stack, &mut self.counts)
    }

    /// What of a shadow ray's `contribution` arrives: all, nothing, or what transparent things in between let through.
    ///
    /// Behind transparent things it is a chain of nearest hits in order along the ray, each with its material's
    /// transmission, so that the product does not depend on the order of pages. A ray that meets more than
    /// [`SHADOW_CHAIN_MAX`] of them is taken to be blocked.
    #[must_use]
    pub fn arriving(&mut self, scene: &Scene<'_>, ray: &Ray, mut contribution: [f32; 3]) -> [f32; 3] {
        if !scene.transmits {
            let blocked = walk::occluded(self.kernels, &scene.resident, ray, self.stack, &mut self.counts);
            return if blocked { [0.0; 3] } else { contribution };
        }
        let (mut ray, end) = (*ray, ray.origin + ray.direction * ray.t_max);
        for _ in 0..=SHADOW_CHAIN_MAX {
            let hit = self.nearest(scene, &ray);
            if !hit.candidate.is_hit() {
                return contribution;
            }
            let record = RayRecord {
                origin: ray.origin.to_array(),
                direction: ray.direction.to_array(),
                t_min: ray.t_min,
                ..RayRecord::zeroed()
            };
            let place = surface(&scene.resident.pages[hit.page as usize], &record, &hit);
            match spawn::pass_through(&scene.shading, &place, contribution) {
                Some((origin, rest)) => {
                    contribution = rest;
                    // The end of the ray stays where it is, just before the light, though its start was moved off the surface.
                    if ray.t_max < f32::INFINITY {
                        ray.direction = (end - origin) / ray.t_max;
                    }
                    ray.origin = origin;
                }
                None => return [0.0; 3],
            }
        }
        [0.0; 3]
    }
}

/// Transparent surfaces that a shadow ray may pass.
pub const SHADOW_CHAIN_MAX: u32 = 256;

/// Records for one ray and all that it causes: one for each level of depth.
pub struct Lane<'r> {
    records: &'r mut [HitRecord],
    depth: usize,
}

impl<'r> Lane<'r> {
    /// A lane that needs `records.len()` to be at least the greatest depth.
    #[must_use]
    pub fn new(records: &'r mut [HitRecord]) -> Self {
        Self { records, depth: 0 }
    }

    /// A lane that goes on with the first `depth` of `records`, as [`Lane::depth`] said when it was put aside.
    #[must_use]
    pub fn resume(records: &'r mut [HitRecord], depth: usize) -> Self {
        Self { depth: depth.min(records.len()), records }
    }

    /// Records in use.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Whether nothing is left to do.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.depth == 0
    }

    /// Takes in a ray whose nearest hit is known: it becomes a record, or it ends here.
    ///
    /// # Panics
    /// If the ray is deeper than the lane.
    pub fn start<S: Sink>(&mut self, scene: &Scene<'_>, ray: &RayRecord, hit: &Hit, sink: &mut S, counts: &mut Counts) {
        let origin = Origin { pixel: ray.pixel, tile: ray.tile, epoch: ray.epoch, sample: ray.sample };
        if !hit.candidate.is_hit() {
            let seen: [f32; 3] = core::array::from_fn(|c| ray.weight[c] * scene.background[c]);
            add(sink, &origin, seen);
            sink.ended(&origin, ray.id.wrapping_neg());
            return;
        }
        counts.hits += 1;
        let surface = surface(&scene.resident.pages[hit.page as usize], ray, hit);
        add(sink, &origin, spawn::local(&scene.shading, &surface, ray.weight));
        self.records[self.depth] = HitRecord {
            surface,
            weight: ray.weight,
            id: ray.id,
            children: 0,
            cursor: 0,
            end: spawn::children(&scene.shading, &surface),
            origin,
            depth: ray.depth,
        };
        self.depth += 1;
    }

    /// Traces the next child of the deepest record, or ends it. Bounded: one walk, or one chain of a shadow ray.
    pub fn step<S: Sink>(&mut self, scene: &Scene<'_>, walker: &mut Walker<'_>, sink: &mut S, counts: &mut Counts) {
        let Some(top) = self.depth.checked_sub(1) else { return };
        let record = &mut self.records[top];
        if record.cursor == record.end {
            sink.ended(&record.origin, record.children.wrapping_sub(record.id));
            self.depth = top;
            return;
        }
        let cursor = record.cursor;
        record.cursor += 1;
        let depth = u32::from(record.depth);
        let child = spawn::child(&scene.shading, &record.surface, record.weight, depth, record.id, cursor);
        let origin = record.origin;
        let mut name = |branch: u32| {
            let id = id::child_id(record.id, branch);
            record.children = record.children.wrapping_add(id);
            id
        };
        let (kind, start, direction, weight, medium, id) = match child {
            Child::None => return,
            Child::Shadow { origin: start, direction, t_max, contribution, branch } => {
                let id = name(branch);
                counts.shadow += 1;
                let ray = Ray { origin: start, direction, t_min: 0.0, t_max };
                add(sink, &origin, walker.arriving(scene, &ray, contribution));
                sink.ended(&origin, id.wrapping_neg());
                return;
            }
            Child::Mirror { origin, direction, weight, medium, branch } => {
                (RayKind::Mirror, origin, direction, weight, medium, name(branch))
            }
            Child::Refract { origin, direction, weight, medium, branch } => {
                (RayKind::Refract, origin, direction, weight, medium, name(branch))
            }
        };
        counts.secondary += 1;
        let ray = RayRecord {
            origin: start.to_array(),
            direction: direction.to_array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
            id,
            primitive: Candidate::NOTHING,
            weight,
            pixel: origin.pixel,
            tile: origin.tile,
            epoch: origin.epoch,
            sample: origin.sample,
            medium,
            kind: kind as u8,
            depth: record.depth + 1,
            ..RayRecord::zeroed()
        };
        let hit =
            walker.nearest(scene, &Ray { origin: start, direction: Vec3::from_array(ray.direction), ..ray.ray() });
        self.start(scene, &ray, &hit, sink, counts);
    }
}

/// Zero adds nothing, and is not sent.
fn add<S: Sink>(sink: &mut S, origin: &Origin, radiance: [f32; 3]) {
    if radiance != [0.0; 3] {
        sink.contribute(origin, radiance);
    }
}
