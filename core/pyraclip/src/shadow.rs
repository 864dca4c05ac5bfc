//! Shadow rays as bundles: those of a group of hits towards a light, or of a hit towards an area light (the 1995 report,
//! chapter 4; DESIGN section 14).
//!
//! A bundle only leaves out boxes. What is tested are the rays that each hit sends, from their own origins, so that the
//! answer is that of a single walk, whatever goes along in the bundle. What blocked one packet is tried first for the next.

use crate::packet::Packet;
use crate::wide::{Scratch, clip};
use hybray_bintree::walk::{Counts, Resident, Stack, Walk, Walked};
use hybray_geometry::Ray;
use hybray_geometry::simd::{Kernel, Kernels, Lanes, Simd};
use hybray_scene::Pages;

/// Rays of a bundle at most.
pub const RAYS_MAX: usize = 64;

/// What lies between the ends of each of `rays`, into the first of `walked`: with `ANY` any hit, else the nearest, to the
/// bit that of a single walk. Where a ray needs a page that is not at hand, `needs` names one of those, not always the first;
/// the ray is to be walked singly from the beginning then. With `ANY`, what is hit in a page at hand needs none.
///
/// Rays that stand together in the slice should be neighbours. Bounded by the single walks of all rays, and one clip.
///
/// # Panics
/// If there are more rays than [`RAYS_MAX`], or fewer places than rays.
pub fn trace<const ANY: bool, P: Pages + ?Sized>(
    kernels: Kernels,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    scratch: &mut Scratch,
    stack: &mut Stack,
    counts: &mut Counts,
) {
    assert!(rays.len() <= RAYS_MAX && rays.len() <= walked.len());
    kernels.run(Shadows::<ANY, P> { scene, rays, walked, scratch, stack, counts });
}

struct Shadows<'w, 'a, const ANY: bool, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
    rays: &'w [Ray],
    walked: &'w mut [Walked],
    scratch: &'w mut Scratch,
    stack: &'w mut Stack,
    counts: &'w mut Counts,
}

impl<const ANY: bool, P: Pages + ?Sized> Kernel for Shadows<'_, '_, ANY, P> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { scene, rays, walked, scratch, stack, counts } = self;
        clip::<ANY, S, P>(simd, scene, rays, scratch, counts);
        let size = S::Packet::LANES;
        let mut last = None;
        for (rays, walked) in rays.chunks(size).zip(walked.chunks_mut(size)) {
            let Some(mut packet) = Packet::<S, ANY>::new(simd, rays) else {
                for (ray, walked) in rays.iter().zip(walked) {
                    *walked = Walk::<ANY, P> { past: ANY, ..Walk::new(scene, ray, stack, counts) }.run(simd);
                }
                continue;
            };
            packet.last = last;
            packet.trace(scene, &scratch.list, &mut scratch.waiting);
            last = packet.last;
            *counts += packet.counts;
            for (lane, walked) in walked.iter_mut().take(rays.len()).enumerate() {
                let (best, (near, page)) = (packet.best[lane], packet.missing[lane]);
                let needs = near <= best.candidate.t && !(ANY && best.candidate.is_hit());
                *walked = Walked { best, needs: needs.then_some(page) };
            }
        }
    }
}
