//! Shadow rays that go to one place, or come from one, traced as a bundle: those of several hits to one light, or those of
//! one hit to the samples of an area light.
//!
//! Each is the ray that its hit would send in its turn, and brings the same. A ray whose answer the pages at hand do not
//! give is left to its turn, and is walked singly then.

use crate::hit::HitRecord;
use crate::lane::{Sink, Walker, add};
use crate::scene::Scene;
use core::ops::Range;
use hybray_bintree::walk::{Hit, Walked};
use hybray_geometry::{Ray, Vec3};
use hybray_pyraclip::{shadow, wide};
use hybray_scene::Pages;
use hybray_shading::{Child, spawn};
use hybray_wire::Counts;

/// Shadow rays that are traced together at most.
pub const TOGETHER: usize = shadow::RAYS_MAX;
/// An area light with so many shadow rays from each hit gets a bundle from each hit; with fewer, its first ray of several hits
/// goes with the first of the others, and so on.
const SAMPLES_MIN: u32 = 8;

/// What a bundle of shadow rays needs: lent by the caller. About 15 KB.
#[derive(Clone, Debug)]
pub struct Together {
    rays: [Ray; TOGETHER],
    walked: [Walked; TOGETHER],
    sent: [Sent; TOGETHER],
    /// Free to use between calls.
    pub scratch: wide::Scratch,
}

/// Whose shadow ray it is, and what it brings.
#[derive(Clone, Copy, Debug)]
struct Sent {
    contribution: [f32; 3],
    record: u16,
    branch: u32,
}

impl Together {
    /// Empty scratch.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            rays: [Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 0.0 }; TOGETHER],
            walked: [Walked { best: Hit::none(0.0), needs: None }; TOGETHER],
            sent: [Sent { contribution: [0.0; 3], record: 0, branch: 0 }; TOGETHER],
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
        let depth = u32::from(record.depth);
        for cursor in cursors.clone() {
            match spawn::child(&scene.shading, &record.surface, record.weight, depth, record.id, cursor) {
                Child::Shadow { origin, direction, t_max, contribution, branch } => {
                    rays[count] = Ray { origin, direction, t_min: 0.0, t_max };
                    sent[count] = Sent { contribution, record: at as u16, branch };
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
            sent.contribution
        } else if scene.transmits {
            let Some(page) = resident.pages.page(hit.page) else { continue };
            if spawn::let_through(&scene.shading, page.material(hit.slot), sent.contribution).is_some() {
                continue;
            }
            [0.0; 3]
        } else {
            [0.0; 3]
        };
        let record = &mut records[usize::from(sent.record)];
        record.done |= 1 << ((sent.branch - 1) % 64);
        let id = record.adopt(sent.branch);
        counts.shadow += 1;
        add(sink, &record.origin, arrived);
        sink.ended(&record.origin, id.wrapping_neg());
    }
}
