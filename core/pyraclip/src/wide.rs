//! The fast form: a bundle of rays against a tree of wide nodes.
//!
//! A [`Bundle`] (four planes and a near bound, common apex or not) is clipped against eight boxes at once, down through the
//! directory and its pages, into a cliplist of leaves in the order of their near bounds. Then eight rays at a time go along
//! it. Bundles with long lists are divided, and rays that are not coherent, or too few, go singly: each way finds the
//! same hits to the bit, because each only leaves out boxes that a ray does not meet before its best hit, and the tests
//! are those of `hybray-geometry`.

use hybray_bintree::walk::{Counts, Hit, Resident, STACK, Stack, Walk, Walked};
use hybray_geometry::simd::{Kernel, Kernels, Lanes, Mask, Simd};
use hybray_geometry::{Bundle, Candidate, LaneRay, Ray, RayKernel, ray_lanes, sphere_lanes, triangle_lanes, turn};
use hybray_scene::{BLOCK, Child, Directory, Kind, Node, PageView, Pages, Slot, WIDTH};

/// Rays of a bundle at most.
pub const RAYS_MAX: usize = 256;
/// Rays that go side by side.
pub(crate) const GROUP: usize = 8;
/// Leaves of a cliplist at most: a bundle with more is divided.
const LIST_MAX: usize = 128;
/// A bundle of this many rays or fewer is not divided: its rays go singly.
const DIVIDE_MIN: usize = 16;

/// A leaf on a cliplist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// No ray of the bundle meets it before this distance.
    pub near: f32,
    /// The page that it is in.
    pub page: u32,
    /// [`Child::Leaf`], packed; [`Child::Page`] if the page is not at hand.
    pub child: u32,
    /// Least corner of its box.
    pub lo: [f32; 3],
    /// Greatest corner of its box.
    pub hi: [f32; 3],
}

/// What tracing a bundle needs: lent by the caller. About 9 KB.
#[derive(Clone, Debug)]
pub struct Scratch {
    pub(crate) list: [Leaf; LIST_MAX],
    waiting: [(u32, u32); STACK],
}

impl Scratch {
    /// Empty scratch.
    #[must_use]
    pub const fn new() -> Self {
        const NOTHING: Leaf = Leaf { near: 0.0, page: 0, child: 0, lo: [0.0; 3], hi: [0.0; 3] };
        Self { list: [NOTHING; LIST_MAX], waiting: [(0, 0); STACK] }
    }

    /// The ordered cliplist of `bundle`: every leaf that a ray of it may meet, and in place of the leaves of a page that is
    /// not at hand the page itself; `None` if there are more than 128.
    pub fn clip<P: Pages + ?Sized>(
        &mut self,
        kernels: Kernels,
        scene: &Resident<'_, P>,
        bundle: &Bundle,
        counts: &mut Counts,
    ) -> Option<&[Leaf]> {
        let length = kernels.run(Clip { scene, bundle, scratch: self, counts })?;
        Some(&self.list[..length])
    }
}

/// Pages that `bundle` meets, the nearest first, as far as `out` has room; returns how many. Only the directory is looked
/// at: this is the cliplist of a node that has no pages yet (the 1995 report, chapter 4).
pub fn pages(
    kernels: Kernels,
    directory: &Directory<'_>,
    bundle: &Bundle,
    out: &mut [(f32, u32)],
    scratch: &mut Scratch,
    counts: &mut Counts,
) -> usize {
    kernels.run(PagesMet { directory, bundle, out, scratch, counts })
}

struct PagesMet<'w, 'a> {
    directory: &'w Directory<'a>,
    bundle: &'w Bundle,
    out: &'w mut [(f32, u32)],
    scratch: &'w mut Scratch,
    counts: &'w mut Counts,
}

impl Kernel for PagesMet<'_, '_> {
    type Output = usize;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> usize {
        let Self { directory, bundle, out, scratch, counts } = self;
        if directory.nodes.is_empty() {
            return 0;
        }
        let waiting = &mut scratch.waiting;
        waiting[0] = (0, DIRECTORY);
        let (mut top, mut found) = (1, 0);
        while top > 0 {
            top -= 1;
            let node = &directory.nodes[waiting[top].0 as usize];
            counts.nodes += 1;
            let (mut met, near) = bundle.meets(simd, &node.lo, &node.hi);
            while met != 0 {
                let slot = met.trailing_zeros() as usize & (WIDTH - 1);
                met &= met - 1;
                match Child::unpack(node.child[slot]) {
                    Child::Inner(index) => {
                        waiting[top] = (index, DIRECTORY);
                        top += 1;
                    }
                    Child::Page(page) => {
                        let mut at = found;
                        found = (found + 1).min(out.len());
                        // The farthest falls off the end.
                        while at > 0 && out[at - 1].0 > near[slot] {
                            if at < out.len() {
                                out[at] = out[at - 1];
                            }
                            at -= 1;
                        }
                        if at < out.len() {
                            out[at] = (near[slot], page);
                        }
                    }
                    Child::Leaf { .. } | Child::Unused => {}
                }
            }
        }
        found
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

/// How far each of `rays` comes, into the first of `walked`: its nearest hit, to the bit that of a single walk, unless it
/// needs a page that is not at hand.
///
/// Rays that stand together in the slice should be neighbours: it is divided into halves where a bundle does not pay.
/// `magnitude` bounds all coordinates of the scene. Bounded by the single walks of all rays, and as many clips.
///
/// # Panics
/// If there are more rays than [`RAYS_MAX`], or fewer hits than rays.
pub fn nearest<P: Pages + ?Sized>(
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
    kernels.run(Nearest { scene, magnitude, rays, walked, scratch, stack, counts });
}

struct Nearest<'w, 'a, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
    magnitude: f32,
    rays: &'w [Ray],
    walked: &'w mut [Walked],
    scratch: &'w mut Scratch,
    stack: &'w mut Stack,
    counts: &'w mut Counts,
}

impl<P: Pages + ?Sized> Kernel for Nearest<'_, '_, P> {
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
            let length = if count < GROUP {
                None
            } else {
                Bundle::around(part.iter(), magnitude).and_then(|bundle| clip(simd, scene, &bundle, scratch, counts))
            };
            if let Some(length) = length {
                let list = &mut scratch.list[..length];
                list.sort_unstable_by(|a, b| a.near.total_cmp(&b.near));
                let walked = &mut walked[first..first + count];
                for (rays, walked) in part.chunks(GROUP).zip(walked.chunks_mut(GROUP)) {
                    group(simd, scene, rays, walked, list, stack, counts);
                }
            } else if count > DIVIDE_MIN {
                // Halves of whole groups.
                let half = (count / 2).next_multiple_of(GROUP);
                parts[waiting] = (first + half, count - half);
                parts[waiting + 1] = (first, half);
                waiting += 2;
            } else {
                for (ray, walked) in part.iter().zip(&mut walked[first..first + count]) {
                    *walked = Walk::<false, P>::new(scene, ray, stack, counts).run(simd);
                }
            }
        }
    }
}

struct Clip<'w, 'a, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
    bundle: &'w Bundle,
    scratch: &'w mut Scratch,
    counts: &'w mut Counts,
}

impl<P: Pages + ?Sized> Kernel for Clip<'_, '_, P> {
    type Output = Option<usize>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<usize> {
        let length = clip(simd, self.scene, self.bundle, self.scratch, self.counts)?;
        self.scratch.list[..length].sort_unstable_by(|a, b| a.near.total_cmp(&b.near));
        Some(length)
    }
}

/// The directory counts as a page of this number.
const DIRECTORY: u32 = u32::MAX;

/// Leaves and missing pages that the bundle meets, in no order; how many, or `None` if they do not fit the list.
#[inline(always)]
pub(crate) fn clip<S: Simd, P: Pages + ?Sized>(
    simd: S,
    scene: &Resident<'_, P>,
    bundle: &Bundle,
    scratch: &mut Scratch,
    counts: &mut Counts,
) -> Option<usize> {
    if scene.directory.nodes.is_empty() {
        return Some(0);
    }
    let Scratch { list, waiting } = scratch;
    let mut length = 0;
    waiting[0] = (Child::Inner(0).pack(), DIRECTORY);
    let mut top = 1;
    // A page's nodes are done with before those of another.
    let mut nodes: &[Node] = &[];
    while top > 0 {
        top -= 1;
        let (packed, page) = waiting[top];
        let (node, page) = match Child::unpack(packed) {
            Child::Inner(index) if page == DIRECTORY => (&scene.directory.nodes[index as usize], page),
            Child::Inner(index) => (&nodes[index as usize], page),
            Child::Page(page) => {
                counts.pages += 1;
                // Those that are not at hand stand on the list instead.
                nodes = scene.pages.page(page)?.nodes;
                (&nodes[0], page)
            }
            Child::Leaf { .. } | Child::Unused => continue,
        };
        counts.nodes += 1;
        let (mut met, near) = bundle.meets(simd, &node.lo, &node.hi);
        while met != 0 {
            let slot = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            let child = node.child[slot];
            let child_kind = Child::unpack(child);
            let missing = matches!(child_kind, Child::Page(page) if scene.pages.page(page).is_none());
            if missing || matches!(child_kind, Child::Leaf { .. }) {
                let corner = |c: &[[f32; WIDTH]; 3]| [c[0][slot], c[1][slot], c[2][slot]];
                let page = if let Child::Page(page) = child_kind { page } else { page };
                *list.get_mut(length)? =
                    Leaf { near: near[slot], page, child, lo: corner(&node.lo), hi: corner(&node.hi) };
                length += 1;
            } else {
                waiting[top] = (child, page);
                top += 1;
            }
        }
    }
    Some(length)
}

/// Up to eight rays along a cliplist.
#[inline(always)]
fn group<S: Simd, P: Pages + ?Sized>(
    simd: S,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    list: &[Leaf],
    stack: &mut Stack,
    counts: &mut Counts,
) {
    // Lanes without a ray repeat the last one.
    let kernels: [RayKernel; GROUP] = core::array::from_fn(|i| RayKernel::new(&rays[i.min(rays.len() - 1)]));
    let Some(lanes) = ray_lanes(simd.splat8(0.0), &kernels) else {
        for (ray, walked) in rays.iter().zip(walked) {
            *walked = Walk::<false, P>::new(scene, ray, stack, counts).run(simd);
        }
        return;
    };
    let mut best: [Hit; GROUP] = core::array::from_fn(|i| Hit::none(rays[i.min(rays.len() - 1)].t_max));
    // Where each ray first enters a page that is not at hand; no number if it does not.
    let mut missing = [f32::NAN; GROUP];
    let mut farthest = simd.load8(&best.map(|hit| hit.candidate.t));
    let mut stop = greatest(&best);
    for leaf in list {
        if leaf.near > stop {
            break;
        }
        let (near, far) = lanes.own_slab(&simd.splat8_axes(leaf.lo), &simd.splat8_axes(leaf.hi));
        let near = near.or_greater(lanes.t_min);
        let met = (near.le(far) & near.le(farthest)).bits();
        if met == 0 {
            continue;
        }
        let Some(page) = scene.pages.page(leaf.page) else {
            for (lane, near) in near.to_array().into_iter().enumerate().filter(|(lane, _)| met >> lane & 1 != 0) {
                missing[lane] = if missing[lane] <= near { missing[lane] } else { near };
            }
            continue;
        };
        if self::leaf(simd, &lanes, &kernels, &page, leaf, met, &mut best, counts) {
            farthest = simd.load8(&best.map(|hit| hit.candidate.t));
            stop = greatest(&best);
        }
    }
    for (lane, (ray, walked)) in rays.iter().zip(walked).enumerate() {
        let best = best[lane];
        *walked = if missing[lane] <= best.candidate.t {
            // It finds for itself which page it needs first.
            Walk::<false, P> { best, ..Walk::new(scene, ray, stack, counts) }.run(simd)
        } else {
            Walked { best, needs: None }
        };
    }
}

fn greatest(hits: &[Hit; GROUP]) -> f32 {
    hits.iter().fold(0.0, |m, hit| if hit.candidate.t > m { hit.candidate.t } else { m })
}

/// Tests the rays in `met` against every primitive of a leaf; whether any best hit changed.
#[inline(always)]
pub(crate) fn leaf<S: Simd>(
    simd: S,
    lanes: &LaneRay<S::F8>,
    kernels: &[RayKernel; GROUP],
    page: &PageView<'_>,
    leaf: &Leaf,
    met: u32,
    best: &mut [Hit; GROUP],
    counts: &mut Counts,
) -> bool {
    let Child::Leaf { kind, start, count } = Child::unpack(leaf.child) else { return false };
    let (start, count) = (start as usize, count as usize);
    counts.blocks += count as u64;
    let mut changed = false;
    let mut keep = |t: S::F8, hit: u32, id: u32, number: usize| {
        let mut hit = hit & met & lanes.t_min.le(t).bits();
        if hit == 0 {
            return;
        }
        let t = t.to_array();
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize & (GROUP - 1);
            hit &= hit - 1;
            let candidate = Candidate { t: t[lane], id };
            if candidate.precedes(&best[lane].candidate) {
                best[lane] = Hit { candidate, page: leaf.page, slot: Slot::new(kind, number) };
                changed = true;
            }
        }
    };
    match kind {
        Kind::Triangle => {
            for (i, block) in page.triangles[start..start + count].iter().enumerate() {
                for lane in 0..BLOCK {
                    if lane > 0 && block.id[lane] == block.id[lane - 1] {
                        break;
                    }
                    let corners = block.get(lane).v;
                    let v = [
                        simd.splat8_axes(turn(corners[0].to_array(), lanes.axes)),
                        simd.splat8_axes(turn(corners[1].to_array(), lanes.axes)),
                        simd.splat8_axes(turn(corners[2].to_array(), lanes.axes)),
                    ];
                    let (t, hit) = triangle_lanes(lanes, &v);
                    keep(t, hit, block.id[lane], (start + i) * BLOCK + lane);
                }
            }
        }
        Kind::Sphere => {
            for (i, block) in page.spheres[start..start + count].iter().enumerate() {
                for lane in 0..BLOCK {
                    if lane > 0 && block.id[lane] == block.id[lane - 1] {
                        break;
                    }
                    let sphere = block.get(lane);
                    let centre = simd.splat8_axes(sphere.centre.to_array());
                    let (t, hit) = sphere_lanes(lanes, &centre, simd.splat8(sphere.radius));
                    keep(t, hit, block.id[lane], (start + i) * BLOCK + lane);
                }
            }
        }
        Kind::Cone => {
            for (i, cone) in page.cones[start..start + count].iter().enumerate() {
                for lane in (0..GROUP).filter(|lane| met >> lane & 1 != 0) {
                    if let Some(candidate) = cone.get().hit(&kernels[lane], cone.id, &best[lane].candidate) {
                        best[lane] = Hit { candidate, page: leaf.page, slot: Slot::new(kind, start + i) };
                        changed = true;
                    }
                }
            }
        }
    }
    changed
}
