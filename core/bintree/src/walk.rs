//! The walk of one ray: nearest hit and any hit.

use hybray_geometry::simd::{Kernel, Kernels, Lanes, Mask, Simd};
use hybray_geometry::{Candidate, LaneRay, Ray, RayKernel, slab, sphere_lanes, triangle_lanes};
use hybray_scene::{BLOCK, Child, DEPTH_MAX, Directory, Kind, NO_PARENT, Node, PageView, Pages, Slot, WIDTH};

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
}

impl core::ops::AddAssign for Counts {
    fn add_assign(&mut self, b: Self) {
        self.nodes += b.nodes;
        self.blocks += b.blocks;
        self.pages += b.pages;
    }
}

/// Subtrees that wait in a walk at most: seven siblings on each level of the directory and of a page.
pub const STACK: usize = 2 * DEPTH_MAX * (WIDTH - 1) + 2;

/// What a walk keeps while it goes: lent by the caller, since clearing it for each ray would cost as much as a short
/// walk. 4.5 KB.
#[derive(Clone, Debug)]
pub struct Stack {
    waiting: [(f32, u32); STACK],
}

impl Stack {
    /// An empty stack.
    #[must_use]
    pub const fn new() -> Self {
        Self { waiting: [(0.0, 0); STACK] }
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
/// The order in which a walk meets pages is a function of the ray and the directory alone: a walk that goes on from page P
/// looks at P and at what comes after it, and never at what came before. So a ray that is handed from node to node, each
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
        let mut walker = Walker::<S> {
            simd,
            boxes: BoxRay::new(simd, &kernel),
            lanes: kernel.splat(simd.splat4(0.0)),
            kernel,
            best: self.best,
            counts: Counts::default(),
        };
        let needs = walker.directory::<ANY, P>(self.scene, self.from, self.past, self.stack);
        *self.counts += walker.counts;
        Walked { best: walker.best, needs }
    }
}

/// What a ray needs to meet eight boxes.
struct BoxRay<S: Simd> {
    origin: [S::F8; 3],
    inverse: [S::F8; 3],
    negative: [bool; 3],
    t_min: S::F8,
}

impl<S: Simd> BoxRay<S> {
    #[inline(always)]
    fn new(simd: S, ray: &RayKernel) -> Self {
        Self {
            origin: simd.splat8_axes(ray.origin),
            inverse: simd.splat8_axes(ray.inverse),
            negative: ray.inverse.map(f32::is_sign_negative),
            t_min: simd.splat8(ray.t_min),
        }
    }
}

struct Walker<S: Simd> {
    simd: S,
    boxes: BoxRay<S>,
    lanes: LaneRay<S::F4>,
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
    ) -> Option<u32> {
        let waiting = &mut stack.waiting;
        if scene.directory.nodes.is_empty() {
            return None;
        }
        let (mut needs, mut last) = (None, f32::NEG_INFINITY);
        waiting[0] = (self.kernel.t_min, Child::Inner(0).pack());
        let mut top = if from == FROM_ROOT { 1 } else { self.descend(scene, from, waiting) };
        while top > 0 {
            top -= 1;
            let (near, packed) = waiting[top];
            if near > self.best.candidate.t {
                continue;
            }
            match Child::unpack(packed) {
                Child::Inner(index) => top = self.node(&scene.directory.nodes[index as usize], waiting, top),
                Child::Page(page) => {
                    let view = if ANY { scene.pages.page(page) } else { scene.pages.nearest(page) };
                    let Some(view) = view else {
                        if !ANY || !past || from != FROM_ROOT {
                            return Some(page);
                        }
                        needs = needs.or(Some(page));
                        let exit = self.exit(scene, page);
                        last = if exit > last { exit } else { last };
                        continue;
                    };
                    self.counts.pages += 1;
                    self.page::<ANY>(page, &view, waiting, top);
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

    /// Where the ray leaves the box of a page that is not at hand, rounded as in every slab: no hit in the page lies beyond.
    /// Infinity where nobody says where the page hangs.
    #[inline(never)]
    fn exit<P: Pages + ?Sized>(&mut self, scene: &Resident<'_, P>, page: u32) -> f32 {
        let nodes = scene.directory.nodes;
        let parent = scene.pages.parents().get(nodes.len().saturating_add(page as usize));
        let Some(&parent) = parent.filter(|&&parent| parent != NO_PARENT) else { return f32::INFINITY };
        self.counts.nodes += 1;
        self.kernel.slab(&nodes[parent as usize / WIDTH].aabb(parent as usize % WIDTH)).1
    }

    /// The stack as it was when the walk came to `page`, which is on top of it; returns its length. Along the way from the
    /// root, what a node's walk would have met before the child that leads to the page is left out, and the rest waits.
    /// Bounded: the directory's depth.
    #[inline(never)]
    fn descend<P: Pages + ?Sized>(
        &mut self,
        scene: &Resident<'_, P>,
        page: u32,
        waiting: &mut [(f32, u32); STACK],
    ) -> usize {
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
            let end = self.node(node, waiting, top);
            // If the child is not among those met, the best hit lies before it, and before all that come after it.
            let Some(at) = (top..end).find(|&at| waiting[at].1 == child) else { return top };
            top = at;
        }
        // The child that the last step found is the page itself.
        top + usize::from(levels > 0)
    }

    /// Through one page, on the part of the stack above `base`.
    #[inline(always)]
    fn page<const ANY: bool>(
        &mut self,
        number: u32,
        page: &PageView<'_>,
        waiting: &mut [(f32, u32); STACK],
        base: usize,
    ) {
        waiting[base] = (self.kernel.t_min, Child::Inner(0).pack());
        let mut top = base + 1;
        while top > base {
            top -= 1;
            let (near, packed) = waiting[top];
            if near > self.best.candidate.t {
                continue;
            }
            match Child::unpack(packed) {
                Child::Inner(index) => top = self.node(&page.nodes[index as usize], waiting, top),
                Child::Leaf { kind, start, count } => {
                    self.leaf(number, page, kind, start as usize, count as usize);
                    if ANY && self.best.candidate.is_hit() {
                        return;
                    }
                }
                Child::Page(_) | Child::Unused => {}
            }
        }
    }

    /// Pushes the children of a node that the ray enters before its best hit, the nearest last; returns the new top.
    #[inline(always)]
    fn node(&mut self, node: &Node, waiting: &mut [(f32, u32); STACK], top: usize) -> usize {
        self.counts.nodes += 1;
        let b = &self.boxes;
        let planes = |axis: usize| {
            let (lo, hi) = (&node.lo[axis], &node.hi[axis]);
            if b.negative[axis] { (hi, lo) } else { (lo, hi) }
        };
        let ((x0, x1), (y0, y1), (z0, z1)) = (planes(0), planes(1), planes(2));
        let simd = self.simd;
        let (near, far) = slab(
            &b.origin,
            &b.inverse,
            &[simd.load8(x0), simd.load8(y0), simd.load8(z0)],
            &[simd.load8(x1), simd.load8(y1), simd.load8(z1)],
            b.t_min,
        );
        let best = simd.splat8(self.best.candidate.t);
        let mut met = (near.le(far) & near.le(best)).bits();
        let near = near.to_array();
        let mut end = top;
        while met != 0 {
            let slot = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            let entry = (near[slot], node.child[slot]);
            // Insertion: most nodes are left with one to three children.
            let mut at = end;
            while at > top && waiting[at - 1].0 < entry.0 {
                waiting[at] = waiting[at - 1];
                at -= 1;
            }
            waiting[at] = entry;
            end += 1;
        }
        end
    }

    #[inline(always)]
    fn leaf(&mut self, number: u32, page: &PageView<'_>, kind: Kind, start: usize, count: usize) {
        self.counts.blocks += count as u64;
        match kind {
            Kind::Triangle => {
                for (i, block) in page.triangles[start..start + count].iter().enumerate() {
                    let simd = self.simd;
                    let v = [simd.load4_axes(&block.v[0]), simd.load4_axes(&block.v[1]), simd.load4_axes(&block.v[2])];
                    let (t, hit) = triangle_lanes(&self.lanes, &v);
                    self.keep(t, hit, &block.id, number, kind, start + i);
                }
            }
            Kind::Sphere => {
                for (i, block) in page.spheres[start..start + count].iter().enumerate() {
                    let centre = self.simd.load4_axes(&block.centre);
                    let (t, hit) = sphere_lanes(&self.lanes, &centre, self.simd.load4(&block.radius));
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
        let inside = self.lanes.t_min.le(t) & t.le(self.simd.splat4(self.best.candidate.t));
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
