//! Shadow rays as bundles: a pyramid from a light towards a group of hits, or from a hit towards an area light (the 1995
//! report, chapter 4; DESIGN section 14).
//!
//! The planes of a bundle only leave out boxes. What is tested are the rays that each hit sends, from their own origins, so
//! that the answer is that of a single walk, whatever goes along in the bundle.

use crate::wide::{GROUP, Leaf, Scratch, clip, leaf};
use hybray_bintree::walk::{Counts, Hit, Resident, Stack, Walk, Walked};
use hybray_geometry::simd::{Kernel, Kernels, Lanes, Mask, Simd};
use hybray_geometry::{Bundle, Ray, RayKernel, Vec3, ray_lanes};
use hybray_scene::Pages;

/// Rays of a bundle at most.
pub const RAYS_MAX: usize = 64;
/// A bundle of fewer rays than this is not clipped: its rays go singly.
const BUNDLE_MIN: usize = 8;
/// A light further away than so many times the scene is looked at from the hits: seen from it, nothing could be told apart.
const FAR: f32 = 4.0;

/// What lies between the ends of each of `rays`, into the first of `walked`: with `ANY` any hit, else the nearest, to the
/// bit that of a single walk. Where a ray needs a page that is not at hand, `needs` names one of those, not always the first;
/// the ray is to be walked singly from the beginning then. With `ANY`, what is hit in a page at hand needs none.
///
/// Rays that stand together in the slice should be neighbours: it is divided into halves where a bundle does not pay.
/// `magnitude` bounds all coordinates of the scene. Bounded by the single walks of all rays, and as many clips.
///
/// # Panics
/// If there are more rays than [`RAYS_MAX`], or fewer places than rays.
pub fn trace<const ANY: bool, P: Pages + ?Sized>(
    kernels: Kernels,
    scene: &Resident<'_, P>,
    magnitude: f32,
    rays: &[Ray],
    walked: &mut [Walked],
    scratch: &mut Scratch,
    stack: &mut Stack,
    counts: &mut Counts,
) {
    assert!(rays.len() <= RAYS_MAX && rays.len() <= walked.len());
    kernels.run(Shadows::<ANY, P> { scene, magnitude, rays, walked, scratch, stack, counts });
}

struct Shadows<'w, 'a, const ANY: bool, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
    magnitude: f32,
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
        let Self { scene, magnitude, rays, walked, scratch, stack, counts } = self;
        let mut parts = [(0, 0); 8];
        parts[0] = (0, rays.len());
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (first, count) = parts[waiting];
            let part = &rays[first..first + count];
            let walked = &mut walked[first..first + count];
            let length = if count < BUNDLE_MIN {
                None
            } else {
                around(part, magnitude).and_then(|bundle| clip(simd, scene, &bundle, scratch, counts))
            };
            if let Some(length) = length {
                let list = &mut scratch.list[..length];
                for (rays, walked) in part.chunks(GROUP).zip(walked.chunks_mut(GROUP)) {
                    group::<ANY, S, P>(simd, scene, rays, walked, list, stack, counts);
                }
            } else if count >= 2 * BUNDLE_MIN {
                let half = (count / 2).next_multiple_of(GROUP);
                parts[waiting] = (first + half, count - half);
                parts[waiting + 1] = (first, half);
                waiting += 2;
            } else {
                singly::<ANY, S, P>(simd, scene, part, walked, stack, counts);
            }
        }
    }
}

/// The bundle around `rays` from where they are closest together: their origins, or their ends.
fn around(rays: &[Ray], magnitude: f32) -> Option<Bundle> {
    let end = |ray: &Ray| ray.origin + ray.direction * ray.t_max;
    let t_last = rays.iter().fold(0.0, |t, ray| if ray.t_max > t { ray.t_max } else { t });
    let from_light = {
        let apart = |of: &dyn Fn(&Ray) -> Vec3| {
            let (mut lo, mut hi) = (of(&rays[0]), of(&rays[0]));
            for ray in rays {
                (lo, hi) = (lo.min(of(ray)), hi.max(of(ray)));
            }
            (hi - lo).length_squared()
        };
        // What is infinite is not less, and what is no number neither.
        end(&rays[0]).abs().max_element() <= FAR * magnitude && apart(&end) < apart(&|ray| ray.origin)
    };
    if from_light {
        let back = |ray: &Ray| Ray { origin: end(ray), direction: -ray.direction, ..*ray };
        Bundle::around(rays.iter().map(back), magnitude).map(|bundle| bundle.until(t_last))
    } else {
        Bundle::around(rays.iter(), magnitude).map(|bundle| bundle.until(t_last))
    }
}

#[inline(always)]
fn singly<const ANY: bool, S: Simd, P: Pages + ?Sized>(
    simd: S,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    stack: &mut Stack,
    counts: &mut Counts,
) {
    for (ray, walked) in rays.iter().zip(walked) {
        *walked = Walk::<ANY, P> { past: ANY, ..Walk::new(scene, ray, stack, counts) }.run(simd);
    }
}

/// Up to eight rays along a cliplist in any order.
#[inline(always)]
fn group<const ANY: bool, S: Simd, P: Pages + ?Sized>(
    simd: S,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    list: &mut [Leaf],
    stack: &mut Stack,
    counts: &mut Counts,
) {
    // Lanes without a ray repeat the last one.
    let kernels: [RayKernel; GROUP] = core::array::from_fn(|i| RayKernel::new(&rays[i.min(rays.len() - 1)]));
    let Some(lanes) = ray_lanes(simd.splat8(0.0), &kernels) else {
        singly::<ANY, S, P>(simd, scene, rays, walked, stack, counts);
        return;
    };
    let mut best: [Hit; GROUP] = core::array::from_fn(|i| Hit::none(rays[i.min(rays.len() - 1)].t_max));
    // Where each ray first enters a page that is not at hand, and which: no number if it does not.
    let mut missing = [(f32::NAN, 0); GROUP];
    let mut farthest = simd.load8(&best.map(|hit| hit.candidate.t));
    let mut open = 0xff;
    for at in 0..list.len() {
        let leaf = list[at];
        let (near, far) = lanes.own_slab(&simd.splat8_axes(leaf.lo), &simd.splat8_axes(leaf.hi));
        let near = near.or_greater(lanes.t_min);
        let met = (near.le(far) & near.le(farthest)).bits() & open;
        if met == 0 {
            continue;
        }
        let Some(page) = scene.pages.page(leaf.page) else {
            for (lane, near) in near.to_array().into_iter().enumerate().filter(|(lane, _)| met >> lane & 1 != 0) {
                missing[lane] = if missing[lane].0 <= near { missing[lane] } else { (near, leaf.page) };
            }
            continue;
        };
        if self::leaf(simd, &lanes, &kernels, &page, &leaf, met, &mut best, counts) {
            if ANY {
                for (lane, hit) in best.iter().enumerate() {
                    open &= !(u32::from(hit.candidate.is_hit()) << lane);
                }
                // What hides the light from these rays is likely to hide it from the next.
                list.swap(0, at);
                if open == 0 {
                    break;
                }
            } else {
                farthest = simd.load8(&best.map(|hit| hit.candidate.t));
            }
        }
    }
    for (lane, walked) in walked.iter_mut().enumerate() {
        let (best, (near, page)) = (best[lane], missing[lane]);
        let needs = near <= best.candidate.t && !(ANY && best.candidate.is_hit());
        *walked = Walked { best, needs: needs.then_some(page) };
    }
}
