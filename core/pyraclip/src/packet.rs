//! Rays side by side along a cliplist, and through the subtrees that stand on it, the nearest first.

use crate::span::Span;
use crate::wide::{DIRECTORY, Entry, List};
use hybray_bintree::walk::{Counts, Hit, Resident, STACK};
use hybray_geometry::simd::{Lanes, Mask, Simd};
use hybray_geometry::{Aabb, Candidate, LaneRay, Ray, RayKernel, sphere_lanes, triangle_lanes};
use hybray_scene::{BLOCK, Body, Child, Form, Kind, Node, PageView, Pages, Slot, TriangleBlock, WIDTH};

/// Lanes of a packet at most.
pub(crate) const LANES_MAX: usize = 16;
/// Rays that meet a leaf of triangles or spheres are tested one by one, four primitives at a time, if they are this many or fewer.
const ALONE_MAX: u32 = 6;

/// A subtree that waits: no ray meets it before this distance; its parent's index times 8 plus its slot there; their page.
pub(crate) type Waiting = (f32, u32, u32);

/// Rays side by side, and what they have met.
pub(crate) struct Packet<'r, S: Simd, const ANY: bool> {
    simd: S,
    rays: &'r [Ray],
    lanes: LaneRay<S::Packet>,
    span: Span,
    pub best: [Hit; LANES_MAX],
    /// Best distances; with `ANY`, less than all of those that are done.
    farthest: S::Packet,
    /// The greatest of them.
    stop: f32,
    /// Where each ray first enters a page that is not at hand, and which: no number if it does not.
    pub missing: [(f32, u32); LANES_MAX],
    /// What was hit last.
    pub last: Option<Entry>,
    pub counts: Counts,
}

impl<'r, S: Simd, const ANY: bool> Packet<'r, S, ANY> {
    /// `None` where rays do not keep together: they are to go singly.
    #[inline(always)]
    pub fn new(simd: S, rays: &'r [Ray]) -> Option<Self> {
        let span = Span::around(simd, rays);
        if !span.narrow {
            return None;
        }
        let lanes = LaneRay::side_by_side(simd.splat_packet(0.0), rays)?;
        let mut best = [Hit::none(rays[rays.len() - 1].t_max); LANES_MAX];
        for (best, ray) in best.iter_mut().zip(rays) {
            best.candidate.t = ray.t_max;
        }
        let (missing, stop) = ([(f32::NAN, 0); LANES_MAX], span.t_max);
        let farthest = lanes.t_min;
        let mut packet =
            Self { simd, rays, lanes, span, best, farthest, stop, missing, last: None, counts: Counts::default() };
        packet.shorten();
        Some(packet)
    }

    /// Distances after hits.
    #[inline(always)]
    fn shorten(&mut self) {
        let mut array = self.farthest.to_array();
        let mut stop = f32::NEG_INFINITY;
        for (lane, (t, best)) in array.as_mut().iter_mut().zip(&self.best).enumerate() {
            let done = lane >= self.rays.len() || (ANY && best.candidate.is_hit());
            *t = if done { f32::NEG_INFINITY } else { best.candidate.t };
            stop = if *t > stop { *t } else { stop };
        }
        self.farthest = self.farthest.load_like(&array);
        self.stop = stop;
    }

    /// Along the list.
    #[inline(always)]
    pub fn trace<P: Pages + ?Sized>(&mut self, scene: &Resident<'_, P>, list: &List, waiting: &mut [Waiting; STACK]) {
        if ANY
            && let Some(last) = self.last
            && let Some(view) = at_hand(scene, last.page)
            && let Child::Leaf { kind, start, count } = Child::unpack(last.child)
        {
            let met = self.meets(last.lo, last.hi).0;
            if met != 0 && self.leaf(&view, (last.page, kind, start as usize, count as usize), met) {
                self.shorten();
            }
        }
        for (boxes, (nears, pages)) in
            list.boxes[..list.length.div_ceil(WIDTH)].iter().zip(list.nears.iter().zip(&list.pages))
        {
            // What any hit will do for goes from the far end on.
            if if ANY { self.stop < 0.0 } else { nears[0] > self.stop } {
                break;
            }
            self.counts.nodes += 1;
            let (mut met, near) = self.span.meets(self.simd, &boxes.lo, &boxes.hi, self.stop);
            while met != 0 {
                let slot = met.trailing_zeros() as usize & (WIDTH - 1);
                met &= met - 1;
                if nears[slot] <= self.stop && near[slot] <= self.stop {
                    self.enter(scene, boxes, slot, pages[slot], waiting);
                }
            }
        }
    }

    /// What is below a child of a node of a page.
    #[inline(always)]
    fn enter<P: Pages + ?Sized>(
        &mut self,
        scene: &Resident<'_, P>,
        node: &Node,
        slot: usize,
        page: u32,
        waiting: &mut [Waiting; STACK],
    ) {
        let (mut node, mut slot, mut page) = (node, slot, page);
        // Where nodes of compact pages are put: the one in work, and the one that is opened.
        let (mut room, mut below_room) = (Node::EMPTY, Node::EMPTY);
        // The page in work: its nodes are done with before those of another.
        let mut view = at_hand(scene, page);
        let mut top = 0;
        loop {
            let Aabb { lo, hi } = node.aabb(slot);
            let (lo, hi) = (lo.to_array(), hi.to_array());
            // The packet as a whole may have met what none of its rays meets, or only beyond what it has hit since.
            let (met, near) = self.meets(lo, hi);
            if met != 0 {
                match (Child::unpack(node.child[slot]), &view) {
                    (Child::Inner(index), _) if page == DIRECTORY => {
                        top = self.open(None, &scene.directory.nodes[index as usize], index, page, waiting, top);
                    }
                    (Child::Inner(index), Some(view)) => {
                        let node = view.body.node(index as usize, &mut below_room);
                        top = self.open(Some(&view.body), node, index, page, waiting, top);
                    }
                    (Child::Leaf { kind, start, count }, Some(view)) => {
                        let place = (page, kind, start as usize, count as usize);
                        if self.leaf(view, place, met) {
                            self.last = Some(Entry { near: 0.0, page, child: node.child[slot], lo, hi });
                            self.shorten();
                        }
                    }
                    (Child::Page(below), _) => {
                        if let Some(found) = scene.pages.page(below) {
                            self.counts.pages += 1;
                            top = self.open(
                                Some(&found.body),
                                found.body.node(0, &mut below_room),
                                0,
                                below,
                                waiting,
                                top,
                            );
                            (page, view) = (below, Some(found));
                        } else {
                            self.miss(below, met, near);
                        }
                    }
                    (Child::Leaf { .. } | Child::Inner(_) | Child::Unused, _) => {}
                }
            }
            // Packets go past what lies beyond all that they have hit.
            let (at, of) = loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (near, at, of) = waiting[top];
                if near <= self.stop {
                    break (at as usize, of);
                }
            };
            if of != page {
                (page, view) = (of, at_hand(scene, of));
            }
            slot = at % WIDTH;
            node = match &view {
                Some(view) => view.body.node(at / WIDTH, &mut room),
                None => &scene.directory.nodes[at / WIDTH],
            };
        }
    }

    /// Puts the children of a node, of a page unless of the directory, that the packet may meet on the stack, the first last; returns
    /// the new top. What they lead to is on its way into the cache meanwhile: among millions of triangles, a walk waits for memory.
    #[inline(always)]
    fn open(
        &mut self,
        body: Option<&Body<'_>>,
        node: &Node,
        index: u32,
        page: u32,
        waiting: &mut [Waiting; STACK],
        top: usize,
    ) -> usize {
        self.counts.nodes += 1;
        let (mut met, near) = self.span.meets(self.simd, &node.lo, &node.hi, self.stop);
        let mut end = top;
        while met != 0 {
            let slot = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            if let Some(body) = body {
                body.fetch(self.simd, Child::unpack(node.child[slot]));
            }
            let entry = (near[slot], index * WIDTH as u32 + slot as u32, page);
            let mut at = end;
            while at > top && if ANY { waiting[at - 1].0 > entry.0 } else { waiting[at - 1].0 < entry.0 } {
                waiting[at] = waiting[at - 1];
                at -= 1;
            }
            waiting[at] = entry;
            end += 1;
        }
        end
    }

    /// Which rays meet a box before what they have hit, and where.
    #[inline(always)]
    fn meets(&self, lo: [f32; 3], hi: [f32; 3]) -> (u32, S::Packet) {
        let like = self.lanes.t_min;
        let lo = [like.splat_like(lo[0]), like.splat_like(lo[1]), like.splat_like(lo[2])];
        let hi = [like.splat_like(hi[0]), like.splat_like(hi[1]), like.splat_like(hi[2])];
        let (near, far) = self.lanes.own_slab(&lo, &hi);
        let near = near.or_greater(self.lanes.t_min);
        ((near.le(far) & near.le(self.farthest)).bits(), near)
    }

    /// Rays enter a page that is not at hand.
    #[inline(never)]
    fn miss(&mut self, page: u32, met: u32, near: S::Packet) {
        for (lane, &near) in near.to_array().as_ref().iter().enumerate().filter(|(lane, _)| met >> lane & 1 != 0) {
            let missing = &mut self.missing[lane];
            *missing = if missing.0 <= near { *missing } else { (near, page) };
        }
    }

    /// Tests the rays in `met` against every primitive of a leaf; whether any best hit changed.
    #[inline(always)]
    fn leaf(&mut self, view: &PageView<'_>, place: (u32, Kind, usize, usize), met: u32) -> bool {
        let (_, kind, start, count) = place;
        self.counts.blocks += count as u64;
        let mut changed = false;
        if kind == Kind::Cone {
            for lane in (0..self.rays.len()).filter(|lane| met >> lane & 1 != 0) {
                let kernel = RayKernel::new(&self.rays[lane]);
                for (i, cone) in view.cones[start..start + count].iter().enumerate() {
                    if let Some(candidate) = cone.get().hit(&kernel, cone.id, &self.best[lane].candidate) {
                        self.best[lane] = Hit { candidate, page: place.0, slot: Slot::new(kind, start + i) };
                        changed = true;
                    }
                }
            }
            return changed;
        }
        if met.count_ones() <= ALONE_MAX {
            let mut met = met;
            while met != 0 {
                let lane = met.trailing_zeros() as usize & (LANES_MAX - 1);
                met &= met - 1;
                changed |= self.alone(view, place, lane);
            }
            return changed;
        }
        let like = self.lanes.t_min;
        let lanes = self.lanes;
        if kind == Kind::Triangle {
            let [x, y, z] = lanes.axes;
            let mut room = TriangleBlock::EMPTY;
            for i in 0..count {
                let block = view.body.triangles(start + i, &mut room);
                for lane in 0..BLOCK {
                    if lane > 0 && block.id[lane] == block.id[lane - 1] {
                        break;
                    }
                    let row = |i: usize| [&block.v[i][x], &block.v[i][y], &block.v[i][z]];
                    let v = [splat(like, row(0), lane), splat(like, row(1), lane), splat(like, row(2), lane)];
                    let (t, hit) = triangle_lanes(&lanes, &v);
                    changed |= self.keep(t, hit & met, block.id[lane], place, (start + i) * BLOCK + lane);
                }
            }
        } else {
            for (i, block) in view.spheres[start..start + count].iter().enumerate() {
                for lane in 0..BLOCK {
                    if lane > 0 && block.id[lane] == block.id[lane - 1] {
                        break;
                    }
                    let centre = splat(like, block.centre.each_ref(), lane);
                    let (t, hit) = sphere_lanes(&lanes, &centre, like.splat_like(block.radius[lane]));
                    changed |= self.keep(t, hit & met, block.id[lane], place, (start + i) * BLOCK + lane);
                }
            }
        }
        changed
    }

    /// Keeps what each ray in `hit` meets of one primitive, if that goes before its best.
    #[inline(always)]
    fn keep(&mut self, t: S::Packet, hit: u32, id: u32, place: (u32, Kind, usize, usize), number: usize) -> bool {
        if hit == 0 {
            return false;
        }
        let mut hit = hit & (self.lanes.t_min.le(t) & t.le(self.farthest)).bits();
        let mut changed = false;
        let t = t.to_array();
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize & (LANES_MAX - 1);
            hit &= hit - 1;
            let candidate = Candidate { t: t.as_ref()[lane], id };
            if candidate.precedes(&self.best[lane].candidate) {
                self.best[lane] = Hit { candidate, page: place.0, slot: Slot::new(place.1, number) };
                changed = true;
            }
        }
        changed
    }

    /// Tests one ray against a leaf, four primitives at a time.
    #[inline(always)]
    fn alone(&mut self, view: &PageView<'_>, place: (u32, Kind, usize, usize), lane: usize) -> bool {
        let (page, kind, start, count) = place;
        let simd = self.simd;
        let kernel = RayKernel::new(&self.rays[lane.min(self.rays.len() - 1)]);
        let ray = kernel.splat(simd.splat4(0.0));
        let [x, y, z] = ray.axes;
        let mut best = self.best[lane];
        let mut changed = false;
        let mut room = TriangleBlock::EMPTY;
        for block in start..start + count {
            let (t, hit, ids) = if kind == Kind::Triangle {
                let block = view.body.triangles(block, &mut room);
                let row = |i: usize| [&block.v[i][x], &block.v[i][y], &block.v[i][z]];
                let (a, b, c) = (row(0), row(1), row(2));
                let v = [
                    [simd.load4(a[0]), simd.load4(a[1]), simd.load4(a[2])],
                    [simd.load4(b[0]), simd.load4(b[1]), simd.load4(b[2])],
                    [simd.load4(c[0]), simd.load4(c[1]), simd.load4(c[2])],
                ];
                let (t, hit) = triangle_lanes(&ray, &v);
                (t, hit, &block.id)
            } else {
                let block = &view.spheres[block];
                let (t, hit) = sphere_lanes(&ray, &simd.load4_axes(&block.centre), simd.load4(&block.radius));
                (t, hit, &block.id)
            };
            if hit == 0 {
                continue;
            }
            let mut hit = hit & (ray.t_min.le(t) & t.le(simd.splat4(best.candidate.t))).bits();
            let t = t.to_array();
            while hit != 0 {
                let at = hit.trailing_zeros() as usize & (BLOCK - 1);
                hit &= hit - 1;
                let candidate = Candidate { t: t[at], id: ids[at] };
                if candidate.precedes(&best.candidate) {
                    best = Hit { candidate, page, slot: Slot::new(kind, block * BLOCK + at) };
                    changed = true;
                }
            }
        }
        self.best[lane] = best;
        changed
    }
}

/// A page; nothing for the directory.
#[inline(always)]
fn at_hand<'a, P: Pages + ?Sized>(scene: &Resident<'a, P>, page: u32) -> Option<PageView<'a>> {
    if page == DIRECTORY { None } else { scene.pages.page(page) }
}

/// One of several points, in every lane.
#[inline(always)]
fn splat<F: Lanes, const N: usize>(like: F, points: [&[f32; N]; 3], at: usize) -> [F; 3] {
    [like.splat_like(points[0][at]), like.splat_like(points[1][at]), like.splat_like(points[2][at])]
}
