//! The walk of one ray: nearest hit and any hit.

use hybray_geometry::simd::{Kernel, Kernels, Lanes, Mask, Simd};
use hybray_geometry::{Candidate, Ray, RayKernel, slab, sphere_lanes, triangle_lanes};
use hybray_scene::{
    BLOCK, Body, Child, DEPTH_MAX, Directory, Form, Kind, NO_PARENT, Node, PageView, Pages, Row, Slot, TriangleBlock,
    WIDTH,
};

/// The directory, and the pages at hand: all of them unless `P` says otherwise.
#[derive(Debug)]
pub struct Resident<'a, P: Pages + ?Sized = [PageView<'a>]> {
    /// The top of the tree.
    pub directory: Directory<'a>,
    /// Pages by number.
    pub pages: &'a P,
}

impl<P: Pages + ?Sized> Clone for Resident<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: Pages + ?Sized> Copy for Resident<'_, P> {}

/// A nearest hit and where its primitive is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance and primitive.
    pub candidate: Candidate,
    /// Page that holds it (one of them, if several do).
    pub page: u32,
    /// Its place there.
    pub slot: Slot,
}

impl Hit {
    /// No hit up to `t_max`.
    #[must_use]
    pub const fn none(t_max: f32) -> Self {
        Self { candidate: Candidate::none(t_max), page: 0, slot: Slot(0) }
    }
}

/// What a walk did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Wide nodes whose boxes were tested, and boxes of pages that a ray went past.
    pub nodes: u64,
    /// Blocks of primitives, and cones, that were tested.
    pub blocks: u64,
    /// Pages that were entered.
    pub pages: u64,
    /// Bilinear look-ups in textures, for the hits.
    pub look_ups: u64,
}

impl core::ops::AddAssign for Counts {
    fn add_assign(&mut self, b: Self) {
        self.nodes += b.nodes;
        self.blocks += b.blocks;
        self.pages += b.pages;
        self.look_ups += b.look_ups;
    }
}

impl core::ops::Sub for Counts {
    type Output = Self;

    /// What was counted since `b`, an earlier count.
    fn sub(self, b: Self) -> Self {
        Self {
            nodes: self.nodes.saturating_sub(b.nodes),
            blocks: self.blocks.saturating_sub(b.blocks),
            pages: self.pages.saturating_sub(b.pages),
            look_ups: self.look_ups.saturating_sub(b.look_ups),
        }
    }
}

/// Subtrees that wait in a walk at most: seven siblings on each level of the directory and of a page.
pub const STACK: usize = 2 * DEPTH_MAX * (WIDTH - 1) + 2;

/// What a walk keeps while it goes: lent by the caller, since clearing it for each ray would cost as much as a short
/// walk. 4.5 KB.
#[derive(Clone, Debug)]
pub struct Stack {
    waiting: [Waiting; STACK],
}

/// A subtree that waits: the distance at which the ray enters it, above its packed child. Distances are not negative, so that
/// the nearer is the smaller number; the farther, where that goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Waiting(u64);

impl Waiting {
    #[inline(always)]
    fn new(near: f32, child: u32, far_first: bool) -> Self {
        let key = if far_first { !near.to_bits() } else { near.to_bits() };
        Self(u64::from(key) << 32 | u64::from(child))
    }

    #[inline(always)]
    fn near(self, far_first: bool) -> f32 {
        let key = (self.0 >> 32) as u32;
        f32::from_bits(if far_first { !key } else { key })
    }

    #[inline(always)]
    fn child(self) -> u32 {
        self.0 as u32
    }
}

impl Stack {
    /// An empty stack.
    #[must_use]
    pub const fn new() -> Self {
        Self { waiting: [Waiting(0); STACK] }
    }
}

impl Default for Stack {
    fn default() -> Self {
        Self::new()
    }
}

/// The nearest hit of `ray` in a scene whose pages are all at hand.
#[must_use]
pub fn nearest(kernels: Kernels, scene: &Resident<'_>, ray: &Ray, stack: &mut Stack, counts: &mut Counts) -> Hit {
    kernels.run(Walk::<false, _>::new(scene, ray, stack, counts)).best
}

/// Whether anything is hit in a scene whose pages are all at hand.
#[must_use]
pub fn occluded(kernels: Kernels, scene: &Resident<'_>, ray: &Ray, stack: &mut Stack, counts: &mut Counts) -> bool {
    kernels.run(Walk::<true, _>::new(scene, ray, stack, counts)).best.candidate.is_hit()
}

/// A walk as a kernel: from the root, or on from a page, as far as the pages at hand go.
///
/// The order in which a walk meets pages is a function of the ray and the directory alone, unless it has them all: a walk that goes on
/// from page P looks at P and at what comes after it, and never at what came before. So a ray that is handed from node to node, each
/// of which walks the pages that it has, tests the same pages as one that finds all of them in one place, or fewer.
///
/// A walk ends at the first page that is not at hand. One for any hit (`ANY`) from the root may go `past` such pages: whatever
/// blocks it ends it, and if nothing at hand does, its end is cut to where it leaves the last page that is missing: beyond, all is
/// known to be free. So a shadow ray is tested against a light cache first, and what is left of it is forwarded (DESIGN section 9;
/// the 1995 report's chapter 4). It costs 5 to 10 % of the cells, for what lies beyond a page that would have ended the ray, and up
/// to a quarter fewer rays are forwarded: it pays where pages beyond are known to be there, and not without light caches.
pub struct Walk<'w, 'a, const ANY: bool, P: Pages + ?Sized = [PageView<'a>]> {
    /// Where.
    pub scene: &'w Resident<'a, P>,
    /// What.
    pub ray: &'w Ray,
    /// The best hit so far: [`Hit::none`] of the ray's end to begin with.
    pub best: Hit,
    /// The page to go on from; [`FROM_ROOT`] to begin with.
    pub from: u32,
    /// Whether a walk for any hit goes past pages that are not at hand.
    pub past: bool,
    /// Scratch.
    pub stack: &'w mut Stack,
    /// Added to.
    pub counts: &'w mut Counts,
}

impl<'w, 'a, const ANY: bool, P: Pages + ?Sized> Walk<'w, 'a, ANY, P> {
    /// A walk from the root.
    pub fn new(scene: &'w Resident<'a, P>, ray: &'w Ray, stack: &'w mut Stack, counts: &'w mut Counts) -> Self {
        Self { scene, ray, best: Hit::none(ray.t_max), from: FROM_ROOT, past: false, stack, counts }
    }
}

/// Where a walk goes on that has not begun; and what a walk needs that has ended.
pub const FROM_ROOT: u32 = u32::MAX;

/// How far a walk came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walked {
    /// The best hit so far; if there is none, the distance up to which one is still to be looked for.
    pub best: Hit,
    /// The page that it needs next and that is not at hand: the first of them in the order of the walk.
    pub needs: Option<u32>,
}

impl<const ANY: bool, P: Pages + ?Sized> Kernel for Walk<'_, '_, ANY, P> {
    type Output = Walked;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Walked {
        let kernel = RayKernel::new(self.ray);
        let mut walker =
            Walker::<S> { simd, boxes: BoxRay::new(simd, &kernel), kernel, best: self.best, counts: Counts::default() };
        // A ray to a light begins on a surface, much of which is near, and seldom blocks it: what is far ends it sooner. But
        // where not all pages are at hand, the near ones are, and a walk that goes on keeps the order in which it began.
        let needs = if ANY && P::ALL && self.from == FROM_ROOT {
            walker.directory::<ANY, P>(self.scene, self.from, self.past, self.stack, true)
        } else {
            walker.directory::<ANY, P>(self.scene, self.from, self.past, self.stack, false)
        };
        *self.counts += walker.counts;
        Walked { best: walker.best, needs }
    }
}

/// What a ray needs to meet eight boxes.
#[derive(Clone, Copy)]
struct BoxRay<S: Simd> {
    origin: [S::F8; 3],
    inverse: [S::F8; 3],
    /// Where the ray enters along each axis, and where it leaves.
    near: [Row; 3],
    far: [Row; 3],
    t_min: S::F8,
}

impl<S: Simd> BoxRay<S> {
    #[inline(always)]
    fn new(simd: S, ray: &RayKernel) -> Self {
        let [x, y, z] = ray.inverse.map(f32::is_sign_negative);
        let (near_x, far_x) = if x { (Row::HiX, Row::LoX) } else { (Row::LoX, Row::HiX) };
        let (near_y, far_y) = if y { (Row::HiY, Row::LoY) } else { (Row::LoY, Row::HiY) };
        let (near_z, far_z) = if z { (Row::HiZ, Row::LoZ) } else { (Row::LoZ, Row::HiZ) };
        Self {
            origin: simd.splat8_axes(ray.origin),
            inverse: simd.splat8_axes(ray.inverse),
            near: [near_x, near_y, near_z],
            far: [far_x, far_y, far_z],
            t_min: simd.splat8(ray.t_min),
        }
    }
}

#[derive(Clone, Copy)]
struct Walker<S: Simd> {
    simd: S,
    boxes: BoxRay<S>,
    kernel: RayKernel,
    best: Hit,
    counts: Counts,
}

impl<S: Simd> Walker<S> {
    /// Through the directory, from page to page; the first page that is needed and not at hand.
    #[inline(always)]
    fn directory<const ANY: bool, P: Pages + ?Sized>(
        &mut self,
        scene: &Resident<'_, P>,
        from: u32,
        past: bool,
        stack: &mut Stack,
        far_first: bool,
    ) -> Option<u32> {
        let waiting = &mut stack.waiting;
        if scene.directory.nodes.is_empty() {
            return None;
        }
        let (mut needs, mut last) = (None, f32::NEG_INFINITY);
        waiting[0] = Waiting::new(self.kernel.t_min, Child::Inner(0).pack(), far_first);
        let mut top = 1;
        if from != FROM_ROOT {
            (self.counts.nodes, top) = self.descend(scene, from, waiting, far_first);
        }
        while top > 0 {
            top -= 1;
            let next = waiting[top];
            if next.near(far_first) > self.best.candidate.t {
                continue;
            }
            match Child::unpack(next.child()) {
                Child::Inner(index) => {
                    top = self.node(&scene.directory.nodes[index as usize], waiting, top, far_first);
                }
                Child::Page(page) => {
                    let view = if ANY { scene.pages.page(page) } else { scene.pages.nearest(page) };
                    let Some(view) = view else {
                        if !ANY || !past || from != FROM_ROOT {
                            return Some(page);
                        }
                        needs = needs.or(Some(page));
                        self.counts.nodes += 1;
                        let exit = exit(scene, self.kernel, page);
                        last = if exit > last { exit } else { last };
                        continue;
                    };
                    self.counts.pages += 1;
                    match &view.body {
                        Body::Full(body) => self.page::<ANY>(page, &view, body, waiting, top, far_first),
                        Body::Compact(body) => self.page::<ANY>(page, &view, body, waiting, top, far_first),
                    }
                    if ANY && self.best.candidate.is_hit() {
                        return None;
                    }
                }
                Child::Leaf { .. } | Child::Unused => {}
            }
        }
        if needs.is_some() && last < self.best.candidate.t {
            self.best.candidate.t = last;
        }
        needs
    }

    /// The stack as it was when the walk came to `page`, which is on top of it; returns the count of nodes, and its length. Along the way from the
    /// root, what a node's walk would have met before the child that leads to the page is left out, and the rest waits.
    /// Bounded: the directory's depth. By value, so that the walk can stay in registers.
    #[inline(never)]
    fn descend<P: Pages + ?Sized>(
        mut self,
        scene: &Resident<'_, P>,
        page: u32,
        waiting: &mut [Waiting; STACK],
        far_first: bool,
    ) -> (u64, usize) {
        let (nodes, parents) = (scene.directory.nodes, scene.pages.parents());
        let mut path = [0; DEPTH_MAX];
        let mut levels = 0;
        let mut at = nodes.len().saturating_add(page as usize);
        while let Some(&parent) = parents.get(at).filter(|&&parent| parent != NO_PARENT) {
            path[levels] = parent;
            at = parent as usize / WIDTH;
            levels += 1;
            if levels == DEPTH_MAX {
                break;
            }
        }
        let mut top = 0;
        for &parent in path[..levels].iter().rev() {
            let node = &nodes[parent as usize / WIDTH];
            let child = node.child[parent as usize % WIDTH];
            let end = self.node(node, waiting, top, far_first);
            // If the child is not among those met, the best hit lies before it, and before all that come after it.
            let Some(at) = (top..end).find(|&at| waiting[at].child() == child) else { return (self.counts.nodes, top) };
            top = at;
        }
        // The child that the last step found is the page itself.
        (self.counts.nodes, top + usize::from(levels > 0))
    }

    /// Through one page, on the part of the stack above `base`.
    #[inline(always)]
    fn page<'f, const ANY: bool>(
        &mut self,
        number: u32,
        page: &PageView<'_>,
        body: &impl Form<'f>,
        waiting: &mut [Waiting; STACK],
        base: usize,
        far_first: bool,
    ) {
        let mut room = Node::EMPTY;
        let mut top = base;
        let mut child = Child::Inner(0).pack();
        loop {
            let kind = Child::unpack(child);
            if let Child::Inner(index) = kind {
                if let Some(next) = self.step(body.node(index as usize, &mut room), waiting, &mut top, far_first) {
                    child = next.child();
                    continue;
                }
            } else if let Child::Leaf { kind, start, count } = kind {
                self.leaf(number, page, body, kind, start as usize, count as usize);
                if ANY && self.best.candidate.is_hit() {
                    return;
                }
            }
            loop {
                if top == base {
                    return;
                }
                top -= 1;
                let next = waiting[top];
                if next.near(far_first) <= self.best.candidate.t {
                    child = next.child();
                    break;
                }
            }
        }
    }

    /// Pushes the children of a node that the ray enters before its best hit, the first last; returns the new top.
    #[inline(always)]
    fn node(&mut self, node: &Node, waiting: &mut [Waiting; STACK], mut top: usize, far_first: bool) -> usize {
        if let Some(next) = self.step(node, waiting, &mut top, far_first) {
            waiting[top] = next;
            top += 1;
        }
        top
    }

    /// The first of a node's children that the ray enters before its best hit; the others are pushed, the next last. First is
    /// the nearest, or the farthest.
    #[inline(always)]
    fn step(
        &mut self,
        node: &Node,
        waiting: &mut [Waiting; STACK],
        top: &mut usize,
        far_first: bool,
    ) -> Option<Waiting> {
        self.counts.nodes += 1;
        let (b, simd, rows) = (&self.boxes, self.simd, node.rows());
        let [x0, y0, z0] = b.near;
        let [x1, y1, z1] = b.far;
        let (near, far) = slab(
            &b.origin,
            &b.inverse,
            &[simd.load8(&rows[x0 as usize]), simd.load8(&rows[y0 as usize]), simd.load8(&rows[z0 as usize])],
            &[simd.load8(&rows[x1 as usize]), simd.load8(&rows[y1 as usize]), simd.load8(&rows[z1 as usize])],
            b.t_min,
        );
        let best = simd.splat8(self.best.candidate.t);
        let mut met = (near.le(far) & near.le(best)).bits();
        if met == 0 {
            return None;
        }
        let near = near.to_array();
        let mut take = || {
            let slot = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            (Waiting::new(near[slot], node.child[slot], far_first), met != 0)
        };
        // Most nodes are left with one to three children.
        let (first, more) = take();
        if !more {
            return Some(first);
        }
        let (second, mut more) = take();
        let (mut first, later) = if second < first { (second, first) } else { (first, second) };
        let base = *top;
        let mut end = base;
        waiting[end] = later;
        end += 1;
        while more {
            let mut next;
            (next, more) = take();
            if next < first {
                core::mem::swap(&mut next, &mut first);
            }
            let mut at = end;
            while at > base && waiting[at - 1] < next {
                waiting[at] = waiting[at - 1];
                at -= 1;
            }
            waiting[at] = next;
            end += 1;
        }
        *top = end;
        Some(first)
    }

    #[inline(always)]
    fn leaf<'f>(
        &mut self,
        number: u32,
        page: &PageView<'_>,
        body: &impl Form<'f>,
        kind: Kind,
        start: usize,
        count: usize,
    ) {
        self.counts.blocks += count as u64;
        // A broadcast costs no more than a load of what was broadcast before.
        let lanes = self.kernel.splat(self.simd.splat4(0.0));
        match kind {
            Kind::Triangle => {
                let [x, y, z] = lanes.axes;
                let mut room = TriangleBlock::EMPTY;
                for i in 0..count {
                    let block = body.triangles(start + i, &mut room);
                    let simd = self.simd;
                    let corner = |i: usize| [&block.v[i][x], &block.v[i][y], &block.v[i][z]];
                    let (a, b, c) = (corner(0), corner(1), corner(2));
                    let v = [
                        [simd.load4(a[0]), simd.load4(a[1]), simd.load4(a[2])],
                        [simd.load4(b[0]), simd.load4(b[1]), simd.load4(b[2])],
                        [simd.load4(c[0]), simd.load4(c[1]), simd.load4(c[2])],
                    ];
                    let (t, hit) = triangle_lanes(&lanes, &v);
                    self.keep(t, hit, &block.id, number, kind, start + i);
                }
            }
            Kind::Sphere => {
                for (i, block) in page.spheres[start..start + count].iter().enumerate() {
                    let centre = self.simd.load4_axes(&block.centre);
                    let (t, hit) = sphere_lanes(&lanes, &centre, self.simd.load4(&block.radius));
                    self.keep(t, hit, &block.id, number, kind, start + i);
                }
            }
            Kind::Cone => {
                for (i, cone) in page.cones[start..start + count].iter().enumerate() {
                    if let Some(candidate) = cone.get().hit(&self.kernel, cone.id, &self.best.candidate) {
                        self.best = Hit { candidate, page: number, slot: Slot::new(kind, start + i) };
                    }
                }
            }
        }
    }

    /// Keeps the first of the lanes in `hit`, if it goes before the best.
    #[inline(always)]
    fn keep(&mut self, t: S::F4, hit: u32, ids: &[u32; BLOCK], page: u32, kind: Kind, block: usize) {
        if hit == 0 {
            return;
        }
        let inside = self.simd.splat4(self.kernel.t_min).le(t) & t.le(self.simd.splat4(self.best.candidate.t));
        let mut hit = hit & inside.bits();
        let t = t.to_array();
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize & (BLOCK - 1);
            hit &= hit - 1;
            let candidate = Candidate { t: t[lane], id: ids[lane] };
            if candidate.precedes(&self.best.candidate) {
                self.best = Hit { candidate, page, slot: Slot::new(kind, block * BLOCK + lane) };
            }
        }
    }
}

/// Where the ray leaves the box of a page that is not at hand, rounded as in every slab: no hit in the page lies beyond.
/// Infinity where nobody says where the page hangs.
#[inline(never)]
fn exit<P: Pages + ?Sized>(scene: &Resident<'_, P>, ray: RayKernel, page: u32) -> f32 {
    let nodes = scene.directory.nodes;
    let parent = scene.pages.parents().get(nodes.len().saturating_add(page as usize));
    let Some(&parent) = parent.filter(|&&parent| parent != NO_PARENT) else { return f32::INFINITY };
    ray.slab(&nodes[parent as usize / WIDTH].aabb(parent as usize % WIDTH)).1
}
