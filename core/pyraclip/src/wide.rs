//! The fast form: a bundle of rays against a tree of wide nodes.
//!
//! A bundle is clipped against eight boxes at once, down through the directory and its pages, into a cliplist in the order
//! of near bounds: of leaves, and of subtrees where those would not fit. Then packets of eight or sixteen rays go along
//! it, and each through what it meets of the subtrees, so that a long list is divided with its bundle. Rays that do not
//! keep together go singly. Each way finds the same hits to the bit, because each only leaves out boxes that a ray does not
//! meet before its best hit, and the tests are those of `hybray-geometry`.

use crate::packet::{Packet, Waiting};
use crate::span::Span;
use hybray_bintree::walk::{Counts, Resident, STACK, Stack, Walk, Walked};
use hybray_geometry::simd::{Kernel, Kernels, Lanes, Simd};
use hybray_geometry::{Aabb, Bundle, Ray};
use hybray_scene::{Child, Directory, Form, Node, Pages, WIDTH};

/// Rays of a bundle at most.
pub const RAYS_MAX: usize = 256;
/// Entries of a cliplist at most.
pub const LIST_MAX: usize = 32;
/// A bundle's cliplist has one entry at most for so many rays: a longer one costs more than it saves.
const RAYS_PER_ENTRY: usize = 4;

/// A leaf or a subtree on a cliplist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// No ray of the bundle meets it before this distance.
    pub near: f32,
    /// The page that it is in; [`DIRECTORY`] if it is above the pages.
    pub page: u32,
    /// [`Child`], packed: a leaf; a page that is not at hand; or whatever was not opened because the list was full.
    pub child: u32,
    /// Least corner of its box.
    pub lo: [f32; 3],
    /// Greatest corner of its box.
    pub hi: [f32; 3],
}

/// The directory counts as a page of this number.
pub const DIRECTORY: u32 = u32::MAX;

/// A cliplist in order, eight boxes side by side.
#[derive(Clone, Debug)]
pub(crate) struct List {
    pub length: usize,
    pub boxes: [Node; LIST_MAX / WIDTH],
    pub nears: [[f32; WIDTH]; LIST_MAX / WIDTH],
    pub pages: [[u32; WIDTH]; LIST_MAX / WIDTH],
}

/// What tracing a bundle needs: lent by the caller. About 9 KB.
#[derive(Clone, Debug)]
pub struct Scratch {
    entries: [Entry; LIST_MAX],
    pub(crate) list: List,
    pub(crate) waiting: [Waiting; STACK],
}

impl Scratch {
    /// Empty scratch.
    #[must_use]
    pub const fn new() -> Self {
        const NOTHING: Entry = Entry { near: 0.0, page: 0, child: 0, lo: [0.0; 3], hi: [0.0; 3] };
        const N: usize = LIST_MAX / WIDTH;
        let list = List { length: 0, boxes: [Node::EMPTY; N], nears: [[0.0; WIDTH]; N], pages: [[0; WIDTH]; N] };
        Self { entries: [NOTHING; LIST_MAX], list, waiting: [(0.0, 0, 0); STACK] }
    }

    /// The cliplist of `rays`, in order: every leaf that one of them may meet is on it, or in a subtree that is. `None` for rays
    /// that do not keep together, or too few: there is none for those.
    pub fn clip<P: Pages + ?Sized>(
        &mut self,
        kernels: Kernels,
        scene: &Resident<'_, P>,
        rays: &[Ray],
        counts: &mut Counts,
    ) -> Option<impl Iterator<Item = Entry>> {
        let is_list = kernels.run(Clip { scene, rays, scratch: self, counts });
        is_list.then(|| self.list.entries())
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
        waiting[0] = (0.0, 0, DIRECTORY);
        let (mut top, mut found) = (1, 0);
        while top > 0 {
            top -= 1;
            let node = &directory.nodes[waiting[top].1 as usize];
            counts.nodes += 1;
            let (mut met, near) = bundle.meets(simd, &node.lo, &node.hi);
            while met != 0 {
                let slot = met.trailing_zeros() as usize & (WIDTH - 1);
                met &= met - 1;
                match Child::unpack(node.child[slot]) {
                    Child::Inner(index) => {
                        waiting[top] = (0.0, index, DIRECTORY);
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

impl List {
    /// In order.
    pub fn entries(&self) -> impl Iterator<Item = Entry> {
        (0..self.length).map(|i| {
            let (boxes, slot) = (&self.boxes[i / WIDTH], i % WIDTH);
            let Aabb { lo, hi } = boxes.aabb(slot);
            let (near, page) = (self.nears[i / WIDTH][slot], self.pages[i / WIDTH][slot]);
            Entry { near, page, child: boxes.child[slot], lo: lo.to_array(), hi: hi.to_array() }
        })
    }

    /// Takes in `entries`, which it orders by their near bounds, and by their places where those are the same; with `ANY` the
    /// other way round.
    #[inline(always)]
    fn fill<const ANY: bool>(&mut self, entries: &[Entry]) {
        // Near bounds are 0 or more: their bits are in their order.
        let mut order = [0; LIST_MAX];
        let order = &mut order[..entries.len()];
        for (i, (key, entry)) in order.iter_mut().zip(entries).enumerate() {
            *key = u64::from(entry.near.to_bits()) << 32 | i as u64;
        }
        order.sort_unstable();
        if ANY {
            order.reverse();
        }
        self.length = entries.len();
        for (i, key) in order.iter().enumerate() {
            let entry = &entries[*key as usize & (LIST_MAX - 1)];
            let (at, slot) = (i / WIDTH, i % WIDTH);
            for axis in 0..3 {
                self.boxes[at].lo[axis][slot] = entry.lo[axis];
                self.boxes[at].hi[axis][slot] = entry.hi[axis];
            }
            self.boxes[at].child[slot] = entry.child;
            self.nears[at][slot] = entry.near;
            self.pages[at][slot] = entry.page;
        }
        // What is left of the last eight.
        for i in entries.len()..entries.len().next_multiple_of(WIDTH) {
            let (at, slot) = (i / WIDTH, i % WIDTH);
            self.boxes[at].set(slot, &Aabb::UNUSED, Child::Unused);
            self.nears[at][slot] = f32::INFINITY;
        }
    }
}

/// How far each of `rays` comes, into the first of `walked`: its nearest hit, to the bit that of a single walk, unless it
/// needs a page that is not at hand.
///
/// Rays that stand together in the slice should be neighbours. Bounded by the single walks of all rays, and one clip.
///
/// # Panics
/// If there are more rays than [`RAYS_MAX`], or fewer hits than rays.
pub fn nearest<P: Pages + ?Sized>(
    kernels: Kernels,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    walked: &mut [Walked],
    scratch: &mut Scratch,
    stack: &mut Stack,
    counts: &mut Counts,
) {
    assert!(rays.len() <= RAYS_MAX && rays.len() <= walked.len());
    kernels.run(Nearest { scene, rays, walked, scratch, stack, counts });
}

struct Nearest<'w, 'a, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
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
        let Self { scene, rays, walked, scratch, stack, counts } = self;
        clip::<false, S, P>(simd, scene, rays, scratch, counts);
        let size = S::Packet::LANES;
        for (rays, walked) in rays.chunks(size).zip(walked.chunks_mut(size)) {
            let Some(mut packet) = Packet::<S, false>::new(simd, rays) else {
                for (ray, walked) in rays.iter().zip(walked) {
                    *walked = Walk::<false, P>::new(scene, ray, stack, counts).run(simd);
                }
                continue;
            };
            packet.trace(scene, &scratch.list, &mut scratch.waiting);
            *counts += packet.counts;
            for (lane, (ray, walked)) in rays.iter().zip(walked).enumerate() {
                let (best, missing) = (packet.best[lane], packet.missing[lane].0);
                *walked = if missing <= best.candidate.t {
                    // It finds for itself which page it needs first.
                    Walk::<false, P> { best, ..Walk::new(scene, ray, stack, counts) }.run(simd)
                } else {
                    Walked { best, needs: None }
                };
            }
        }
    }
}

struct Clip<'w, 'a, P: Pages + ?Sized> {
    scene: &'w Resident<'a, P>,
    rays: &'w [Ray],
    scratch: &'w mut Scratch,
    counts: &'w mut Counts,
}

impl<P: Pages + ?Sized> Kernel for Clip<'_, '_, P> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        clip::<false, S, P>(simd, self.scene, self.rays, self.scratch, self.counts)
    }
}

/// The cliplist of `rays` into the scratch's list, the farthest first if any hit will do for them: a ray begins on a surface,
/// much of which is near, and seldom blocks it. Returns whether it is more than the root.
#[inline(always)]
pub(crate) fn clip<const ANY: bool, S: Simd, P: Pages + ?Sized>(
    simd: S,
    scene: &Resident<'_, P>,
    rays: &[Ray],
    scratch: &mut Scratch,
    counts: &mut Counts,
) -> bool {
    let Scratch { entries, list, .. } = scratch;
    if rays.is_empty() || scene.directory.nodes.is_empty() {
        list.fill::<ANY>(&[]);
        return true;
    }
    let (lo, hi) = ([f32::MIN; 3], [f32::MAX; 3]);
    entries[0] = Entry { near: 0.0, page: DIRECTORY, child: Child::Inner(0).pack(), lo, hi };
    let mut length = 1;
    let span = Span::around(simd, rays);
    let most = LIST_MAX.min(rays.len() / RAYS_PER_ENTRY);
    // What meets nearly everything is not worth a list. Level by level, so that what is left unopened is as far down everywhere.
    let is_list = span.narrow && most > 1;
    let mut is_open = is_list;
    let mut room = Node::EMPTY;
    'levels: while is_open {
        is_open = false;
        // What takes the place of an opened entry has had its turn, or is of the next level.
        for at in (0..length).rev() {
            let entry = entries[at];
            let opened = match Child::unpack(entry.child) {
                Child::Inner(index) if entry.page == DIRECTORY => {
                    Some((&scene.directory.nodes[index as usize], DIRECTORY))
                }
                Child::Inner(index) => {
                    let view = scene.pages.page(entry.page);
                    view.map(|view| (view.body.node(index as usize, &mut room), entry.page))
                }
                Child::Page(page) => {
                    let view = scene.pages.page(page);
                    counts.pages += u64::from(view.is_some());
                    view.map(|view| (view.body.node(0, &mut room), page))
                }
                Child::Leaf { .. } | Child::Unused => None,
            };
            let Some((node, page)) = opened else { continue };
            counts.nodes += 1;
            let (mut met, near) = span.meets(simd, &node.lo, &node.hi, span.t_max);
            if length + met.count_ones() as usize > most {
                break 'levels;
            }
            is_open = true;
            length -= 1;
            entries[at] = entries[length];
            while met != 0 {
                let slot = met.trailing_zeros() as usize & (WIDTH - 1);
                met &= met - 1;
                let corner = |c: &[[f32; WIDTH]; 3]| [c[0][slot], c[1][slot], c[2][slot]];
                entries[length] = Entry {
                    near: near[slot],
                    page,
                    child: node.child[slot],
                    lo: corner(&node.lo),
                    hi: corner(&node.hi),
                };
                length += 1;
            }
        }
    }
    list.fill::<ANY>(&entries[..length]);
    is_list
}
