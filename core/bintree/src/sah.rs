//! Top-down binned surface-area heuristic (Wald, *On fast construction of SAH-based bounding volume hierarchies*, 2007).

use crate::BINARY_DEPTH_MAX;
use crate::binary::{BinaryNode, Item, Pending};
use hybray_geometry::{Aabb, Vec3};
use hybray_scene::BLOCK;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Ranges of at most this many items are leaves without more ado: a block or less to build to the end, more to leave
    /// the rest of the work to another thread.
    pub stop_at: u32,
    /// Most items of a leaf that the heuristic may make; at most 64.
    pub leaf_max: u32,
    /// Depth of the root, when this tree goes below another.
    pub depth: u32,
    /// Cost of a wide node's boxes, in tests of a block of primitives.
    pub node_cost: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { stop_at: 1, leaf_max: 16, depth: 0, node_cost: 0.5 }
    }
}

/// Bins on each axis at most.
const BINS: usize = 32;
/// Items up to which there are a quarter and a half as many: these take longer than few items do.
const FEW: u32 = 16;
const MORE: u32 = FEW + 1;
const SOME: u32 = 128;
const STACK: usize = BINARY_DEPTH_MAX as usize + 1;

/// Nodes that `items` items need at most.
#[must_use]
pub const fn nodes_for(items: usize) -> usize {
    if items == 0 { 0 } else { 2 * items - 1 }
}

/// Builds a tree over `items`, which are put in the order of its leaves, into `nodes`; returns how many it used.
///
/// Bounded by the number of items times [`BINARY_DEPTH_MAX`]. Items that no plane separates are split by their order.
/// Where `nodes` has no room for another split, what is left is a leaf: [`nodes_for`] is always enough.
///
/// # Panics
/// If there are items, and `nodes` is empty.
pub fn build(items: &mut [Item], nodes: &mut [BinaryNode], settings: &Settings) -> usize {
    build_with(items, nodes, settings, &OneThread)
}

/// What a split asks of all items of a range. Whoever has several threads gives them parts of the range, and joins what they
/// find in the order of the parts: then the tree is the same however many there are.
pub trait Scan {
    /// [`Extents::of`] the items.
    fn extents(&self, items: &[Item]) -> Extents {
        Extents::of(items)
    }
    /// [`Bins::of`] the items.
    fn bins(&self, items: &[Item], binning: &Binning) -> Bins {
        Bins::of(items, binning)
    }
}

struct OneThread;

impl Scan for OneThread {}

/// [`build`], with somebody else to look through the items.
///
/// # Panics
/// If there are items, and `nodes` is empty.
pub fn build_with(items: &mut [Item], nodes: &mut [BinaryNode], settings: &Settings, scan: &impl Scan) -> usize {
    if items.is_empty() {
        return 0;
    }
    let mut used = 0;
    let mut stack = [Pending::NONE; STACK];
    let mut waiting = 1;
    stack[0] = Pending { first: 0, count: items.len() as u32, depth: settings.depth, parent: u32::MAX };
    while waiting > 0 {
        waiting -= 1;
        let mut part = stack[waiting];
        if part.parent != u32::MAX {
            nodes[part.parent as usize].second = used as u32;
        }
        // Down the first children, leaving the second ones on the stack: one entry a level.
        loop {
            let range = &mut items[part.first as usize..][..part.count as usize];
            let extents = scan.extents(range);
            let here = used;
            nodes[here] = BinaryNode { aabb: extents.boxes.aabb(), first: part.first, count: part.count, second: 0 };
            used += 1;
            // Each part that waits will take a node.
            let room = used + waiting + 2 <= nodes.len();
            let Some(left) = room.then(|| split(range, &extents, part.depth, settings, scan)).flatten() else {
                range.sort_unstable_by_key(|item| (item.kind, item.id));
                break;
            };
            let left = left as u32;
            stack[waiting] = Pending {
                first: part.first + left,
                count: part.count - left,
                depth: part.depth + 1,
                parent: here as u32,
            };
            waiting += 1;
            part = Pending { first: part.first, count: left, depth: part.depth + 1, parent: u32::MAX };
        }
    }
    used
}

/// A box as two quadruples, whose unions the compiler makes of two instructions; the fourth value means nothing.
#[derive(Clone, Copy)]
struct Quad {
    lo: [f32; 4],
    hi: [f32; 4],
}

impl Quad {
    const EMPTY: Self = Self { lo: [f32::INFINITY; 4], hi: [f32::NEG_INFINITY; 4] };

    #[inline(always)]
    fn of(lo: Vec3, hi: Vec3) -> Self {
        Self { lo: [lo.x, lo.y, lo.z, 0.0], hi: [hi.x, hi.y, hi.z, 0.0] }
    }

    #[inline(always)]
    fn union(&self, b: &Self) -> Self {
        Self {
            lo: core::array::from_fn(|i| if b.lo[i] < self.lo[i] { b.lo[i] } else { self.lo[i] }),
            hi: core::array::from_fn(|i| if b.hi[i] > self.hi[i] { b.hi[i] } else { self.hi[i] }),
        }
    }

    fn aabb(&self) -> Aabb {
        let corner = |c: &[f32; 4]| Vec3::new(c[0], c[1], c[2]);
        Aabb { lo: corner(&self.lo), hi: corner(&self.hi) }
    }

    fn half_area(&self) -> f32 {
        self.aabb().half_area()
    }
}

/// The box around items, and the box around their centroids.
#[derive(Clone, Copy)]
pub struct Extents {
    boxes: Quad,
    centroids: Quad,
}

impl Extents {
    /// Those of `items`.
    #[must_use]
    pub fn of(items: &[Item]) -> Self {
        let none = Self { boxes: Quad::EMPTY, centroids: Quad::EMPTY };
        items.iter().fold(none, |all, item| {
            let c = centroid(item);
            all.and(&Self { boxes: Quad::of(item.lo, item.hi), centroids: Quad::of(c, c) })
        })
    }

    /// Those of two parts, of which `after` comes after this one.
    #[must_use]
    #[inline(always)]
    pub fn and(&self, after: &Self) -> Self {
        Self { boxes: self.boxes.union(&after.boxes), centroids: self.centroids.union(&after.centroids) }
    }
}

#[derive(Clone, Copy)]
struct Bin {
    aabb: Quad,
    count: u32,
}

/// Items by their place along each axis: 3.5 KB.
#[derive(Clone)]
pub struct Bins<const N: usize = BINS>([[Bin; N]; 3]);

impl<const N: usize> Bins<N> {
    /// Those of `items`.
    #[must_use]
    pub fn of(items: &[Item], binning: &Binning) -> Self {
        let mut bins = [[EMPTY; N]; 3];
        for item in items {
            let aabb = Quad::of(item.lo, item.hi);
            for (axis, bin) in binning.bins(item).into_iter().enumerate() {
                let bin = &mut bins[axis][bin.min(N - 1)];
                bin.aabb = bin.aabb.union(&aabb);
                bin.count += 1;
            }
        }
        Self(bins)
    }

    /// Those of two parts, of which `after` comes after this one.
    #[must_use]
    pub fn and(mut self, after: &Self) -> Self {
        for (bin, after) in self.0.as_flattened_mut().iter_mut().zip(after.0.as_flattened()) {
            *bin = merged(bin, after);
        }
        self
    }
}

const EMPTY: Bin = Bin { aabb: Quad::EMPTY, count: 0 };

struct Plane {
    axis: usize,
    /// Bins below this go first.
    bin: usize,
    cost: f32,
}

/// Which bin a centroid falls into: monotone, so that a plane between bins is a plane in space.
pub struct Binning {
    lo: Vec3,
    scale: Vec3,
    /// How many there are.
    bins: usize,
}

impl Binning {
    fn new(centroids: &Quad, count: u32) -> Self {
        let bins = match count {
            0..=FEW => BINS / 4,
            MORE..=SOME => BINS / 2,
            _ => BINS,
        };
        let centroids = centroids.aabb();
        let extent = centroids.hi - centroids.lo;
        let scale = |e: f32| {
            let s = bins as f32 * (1.0 - 1e-6) / e;
            if s.is_finite() { s } else { 0.0 }
        };
        Self { lo: centroids.lo, scale: Vec3::new(scale(extent.x), scale(extent.y), scale(extent.z)), bins }
    }

    #[inline(always)]
    fn bins(&self, item: &Item) -> [usize; 3] {
        let at = (centroid(item) - self.lo) * self.scale;
        [at.x, at.y, at.z].map(|x| (x as u32 as usize).min(self.bins - 1))
    }
}

#[inline(always)]
fn centroid(item: &Item) -> Vec3 {
    item.lo * 0.5 + item.hi * 0.5
}

fn blocks(count: u32) -> f32 {
    count.div_ceil(BLOCK as u32) as f32
}

/// Reorders `items` so that the first child's come first, and returns how many those are; `None` for a leaf.
fn split(items: &mut [Item], extents: &Extents, depth: u32, settings: &Settings, scan: &impl Scan) -> Option<usize> {
    let count = items.len() as u32;
    // Fewer than a block cost as much as a block: they are divided only where that would leave most of them out, and
    // then the boxes above them are small already.
    if count <= settings.stop_at.max(BLOCK as u32) {
        return None;
    }
    // Halving ends in time from any depth that leaves as many levels as the count has bits.
    if depth + (32 - count.leading_zeros()) >= BINARY_DEPTH_MAX {
        return Some(items.len() / 2);
    }
    let binning = Binning::new(&extents.centroids, count);
    let plane = match count {
        0..=FEW => best_plane(&Bins::<{ BINS / 4 }>::of(items, &binning), count),
        MORE..=SOME => best_plane(&Bins::<{ BINS / 2 }>::of(items, &binning), count),
        _ => best_plane(&scan.bins(items, &binning), count),
    };
    let leaf_cost = blocks(count);
    let area = extents.boxes.half_area();
    match plane {
        Some(plane) => {
            let cost = settings.node_cost + plane.cost / if area > 0.0 { area } else { f32::MIN_POSITIVE };
            if count <= settings.leaf_max && leaf_cost <= cost {
                return None;
            }
            Some(partition(items, |item| binning.bins(item)[plane.axis] < plane.bin))
        }
        None if count <= settings.leaf_max => None,
        None => Some(items.len() / 2),
    }
}

fn best_plane<const N: usize>(Bins(bins): &Bins<N>, count: u32) -> Option<Plane> {
    let mut best: Option<Plane> = None;
    for (axis, bins) in bins.iter().enumerate() {
        let mut above = [0.0; N];
        let mut sum = EMPTY;
        for bin in (1..N).rev() {
            sum = merged(&sum, &bins[bin]);
            above[bin] = sum.aabb.half_area() * blocks(sum.count);
        }
        let mut sum = EMPTY;
        for bin in 1..N {
            sum = merged(&sum, &bins[bin - 1]);
            let cost = sum.aabb.half_area() * blocks(sum.count) + above[bin];
            let separates = sum.count > 0 && sum.count < count;
            if separates && best.as_ref().is_none_or(|b| cost < b.cost) {
                best = Some(Plane { axis, bin, cost });
            }
        }
    }
    best
}

fn merged(a: &Bin, b: &Bin) -> Bin {
    Bin { aabb: a.aabb.union(&b.aabb), count: a.count + b.count }
}

/// Puts the items for which `first` holds in front; returns how many.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> usize {
    let (mut from, mut to) = (0, items.len());
    loop {
        while from < to && first(&items[from]) {
            from += 1;
        }
        while from < to && !first(&items[to - 1]) {
            to -= 1;
        }
        if from >= to {
            return from;
        }
        items.swap(from, to - 1);
    }
}
