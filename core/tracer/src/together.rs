//! Rays traced as a bundle: shadow rays of several hits to one light, or of one hit to the samples of an area light, and
//! what several hits mirror.
//!
//! Each is the ray that its hit would send in its turn, and brings the same. A ray whose answer the pages at hand do not
//! give is left to its turn, and is walked singly then.

use crate::hit::HitRecord;
use crate::lane::{Sink, Spawned, Walker, add, begin};
use crate::scene::Scene;
use core::ops::Range;
use hybray_bintree::walk::{Hit, Walked};
use hybray_geometry::Ray;
use hybray_pyraclip::{shadow, wide};
use hybray_scene::Pages;
use hybray_shading::spawn;
use hybray_wire::{Counts, RayKind};

/// Shadow rays that are traced together at most.
pub const TOGETHER: usize = shadow::RAYS_MAX;
/// An area light with so many shadow rays from each hit gets a bundle from each hit; with fewer, its first ray of several hits
/// goes with the first of the others, and so on.
const SAMPLES_MIN: u32 = 8;

/// What a bundle of shadow rays needs: lent by the caller. About 14 KB.
#[derive(Clone, Debug)]
pub struct Together {
    rays: [Ray; TOGETHER],
    walked: [Walked; TOGETHER],
    sent: [Sent; TOGETHER],
    /// Free to use between calls.
    pub scratch: wide::Scratch,
}

/// Whose ray it is.
#[derive(Clone, Copy, Debug)]
struct Sent {
    record: u16,
    spawned: Spawned,
}

impl Together {
    /// Empty scratch.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            rays: [Spawned::EMPTY.ray; TOGETHER],
            walked: [Walked { best: Hit::none(0.0), needs: None }; TOGETHER],
            sent: [Sent { record: 0, spawned: Spawned::EMPTY }; TOGETHER],
            scratch: wide::Scratch::new(),
        }
    }
}

impl Default for Together {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether the shadow rays at `cursor` of hits that stand together go together: those to a point, and the single samples of
/// small sets.
#[must_use]
pub fn goes_together<P: Pages + ?Sized>(scene: &Scene<'_, P>, cursor: u32) -> bool {
    cursor < 64 && (1..SAMPLES_MIN).contains(&(spawn::of_one_light(&scene.shading, cursor).len() as u32))
}

/// The next samples of the area light that it is the turn of, from one hit, as far as they have not been tried. Returns
/// whether there were any.
pub(crate) fn samples<S: Sink, P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    walker: &mut Walker<'_>,
    record: &mut HitRecord,
    sink: &mut S,
    counts: &mut Counts,
) -> bool {
    let shading = &scene.shading;
    if record.cursor < record.tried || shading.shadow_rays as usize == shading.lights.len() {
        return false;
    }
    let light = spawn::of_one_light(shading, record.cursor);
    let end = light.end.min((record.cursor | 63).saturating_add(1));
    record.tried = end.max(record.cursor + 1);
    if (light.len() as u32) < SAMPLES_MIN {
        return false;
    }
    let children = record.cursor..end;
    trace(scene, walker, core::slice::from_mut(record), children, sink, counts);
    true
}

impl Walker<'_> {
    /// The shadow ray at `cursor` of each of `records`, as far as pages at hand tell what it brings.
    ///
    /// # Panics
    /// If there are more than [`TOGETHER`].
    pub fn shadows<S: Sink, P: Pages + ?Sized>(
        &mut self,
        scene: &Scene<'_, P>,
        records: &mut [HitRecord],
        cursor: u32,
        sink: &mut S,
        counts: &mut Counts,
    ) {
        trace(scene, self, records, cursor..cursor + 1, sink, counts);
    }

    /// The last ray of each of `records` that has only one left to spawn, as far as pages at hand tell what it hits: that
    /// hit's record takes its parent's place. Returns how many records are left as they were, which come first then, and
    /// how many there are with the new ones behind them.
    ///
    /// # Panics
    /// If there are more than [`TOGETHER`].
    pub fn follow<S: Sink, P: Pages + ?Sized>(
        &mut self,
        scene: &Scene<'_, P>,
        records: &mut [HitRecord],
        sink: &mut S,
        counts: &mut Counts,
    ) -> (usize, usize) {
        let mut count = 0;
        let Together { rays, sent, .. } = &mut *self.together;
        for (at, record) in records.iter_mut().enumerate() {
            record.pass_over_done();
            let left = record.end.saturating_sub(record.cursor);
            if left > 1 {
                continue;
            }
            let last = (left == 1).then(|| record.child(&scene.shading, record.cursor));
            match last.and_then(|child| Spawned::of(&child)) {
                // Its turn has not come: its light is behind glass, or behind a page that is not at hand.
                Some(spawned) if spawned.kind == RayKind::Shadow => {}
                Some(spawned) => {
                    rays[count] = spawned.ray;
                    sent[count] = Sent { record: at as u16, spawned };
                    count += 1;
                }
                None => {
                    sink.ended(&record.origin, record.entry());
                    *record = HitRecord::EMPTY;
                }
            }
        }
        let Together { rays, walked, sent, scratch } = &mut *self.together;
        let (kernels, resident) = (self.kernels, &scene.resident);
        wide::nearest(kernels, resident, &rays[..count], walked, scratch, self.stack, &mut self.counts);
        self.ahead += count as u64;
        let mut new = [false; TOGETHER];
        for (sent, walked) in sent[..count].iter().zip(walked) {
            let at = usize::from(sent.record);
            let record = &mut records[at];
            if walked.needs.is_some() {
                continue;
            }
            let ray = sent.spawned.record(record, scene);
            // What wants a page of texels, or passes what it hit, is traced in its turn.
            let Ok(next) = begin(scene, &ray, &walked.best, sink, counts, &mut self.counts) else { continue };
            record.adopt(ray.id);
            counts.secondary += 1;
            sink.ended(&record.origin, record.entry());
            *record = next.unwrap_or(HitRecord::EMPTY);
            new[at] = true;
        }
        let (mut stay, mut all) = (0, 0);
        for at in 0..records.len() {
            let record = records[at];
            if record.depth == HitRecord::EMPTY.depth {
                continue;
            }
            let mut to = all;
            if !new[at] {
                records.copy_within(stay..all, stay + 1);
                to = stay;
                stay += 1;
            }
            records[to] = record;
            all += 1;
        }
        (stay, all)
    }
}

/// Shadow rays at `cursors`, all within the same 64, of each of `records`.
fn trace<S: Sink, P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    walker: &mut Walker<'_>,
    records: &mut [HitRecord],
    cursors: Range<u32>,
    sink: &mut S,
    counts: &mut Counts,
) {
    let Together { rays, walked, sent, scratch } = &mut *walker.together;
    let mut count = 0;
    for (at, record) in records.iter_mut().enumerate() {
        for cursor in cursors.clone() {
            match Spawned::of(&record.child(&scene.shading, cursor)) {
                Some(spawned) if spawned.kind == RayKind::Shadow => {
                    rays[count] = spawned.ray;
                    sent[count] = Sent { record: at as u16, spawned };
                    count += 1;
                }
                _ => record.done |= 1 << (cursor % 64),
            }
        }
    }
    let rays = &rays[..count];
    let (kernels, resident) = (walker.kernels, &scene.resident);
    let (stack, walks) = (&mut *walker.stack, &mut walker.counts);
    // Behind glass it matters what is met first.
    if scene.transmits {
        shadow::trace::<false, P>(kernels, resident, rays, walked, scratch, stack, walks);
    } else {
        shadow::trace::<true, P>(kernels, resident, rays, walked, scratch, stack, walks);
    }
    walker.ahead += count as u64;
    for (sent, walked) in sent[..count].iter().zip(walked) {
        let hit = walked.best;
        let arrived = if walked.needs.is_some() {
            continue;
        } else if !hit.candidate.is_hit() {
            sent.spawned.weight
        } else if scene.transmits {
            let Some(page) = resident.pages.page(hit.page) else { continue };
            if spawn::let_through(&scene.shading, page.material(hit.slot), 0.0, sent.spawned.weight).is_some() {
                continue;
            }
            [0.0; 3]
        } else {
            [0.0; 3]
        };
        let record = &mut records[usize::from(sent.record)];
        let branch = sent.spawned.branch;
        record.done |= 1 << ((branch - 1) % 64);
        let id = record.child_id(branch);
        record.adopt(id);
        counts.shadow += 1;
        add(sink, &record.origin, arrived);
        sink.ended(&record.origin, id.wrapping_neg());
    }
}
