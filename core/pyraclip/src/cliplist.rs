//! The walk down the tree, and the ordered cliplist that comes of it (A.2).

use crate::classify::{Verdict, verdict};
use crate::distances::Distances;
use crate::{Bintree, ClipPyramid};
use core::ops::ControlFlow;
use hybray_geometry::Aabb;

/// Levels below the root that a tree may have.
pub const MAX_DEPTH: usize = 64;

/// Bytes of [`clip`]'s stack for cells of four bytes: one entry for each level, of 128 bytes of distances, 16 of
/// margins, 24 of planes, 4 of cell and 2 of flags.
pub const STACK_BYTES: usize = MAX_DEPTH * size_of::<Entry<u32>>();

const _: () = assert!(STACK_BYTES <= MAX_DEPTH * 176);

/// A leaf in the cliplist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipCell<C> {
    /// The caller's name for it.
    pub cell: C,
    /// Its six planes, for the rays.
    pub aabb: Aabb,
    /// Whether it lies wholly inside the pyramid.
    pub inside: bool,
}

/// What clipping did. Counts are added up over calls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClipCounts {
    /// Cells classified; each is in one of the next three, or in `second`.
    pub classified: u64,
    /// First test: outside.
    pub first_outside: u64,
    /// First test: overlaps in part (or holds the apex, which is not tested).
    pub first_partly: u64,
    /// First test: inside.
    pub first_inside: u64,
    /// First test without a conclusion: edges tested.
    pub second: u64,
    /// Second test: outside.
    pub second_outside: u64,
    /// Second test: surrounds the pyramid, none of its edges meeting it.
    pub surrounded: u64,
    /// Edges looked at.
    pub edges: u64,
    /// Evaluations of equation A.1.
    pub evaluations: u64,
    /// Cells not tested, because a cell around them is inside.
    pub untested: u64,
    /// Cells in the cliplist.
    pub listed: u64,
}

/// Why a tree could not be clipped to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipError {
    /// It goes deeper than [`MAX_DEPTH`].
    TooDeep,
    /// A plane does not lie strictly between those of its cell, or its axis is not 0, 1 or 2.
    BadSplit,
    /// [`clip_into`] ran out of room; what it was given is full of the first cells, in order.
    Full,
}

impl core::fmt::Display for ClipError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::TooDeep => "the tree has more than 64 levels",
            Self::BadSplit => "a splitting plane is not inside its cell",
            Self::Full => "the cliplist is full",
        })
    }
}

impl core::error::Error for ClipError {}

/// A cell yet to be classified.
#[derive(Clone, Copy)]
struct Entry<C> {
    cell: C,
    aabb: Aabb,
    distances: Distances,
    level: u8,
    inside: bool,
}

/// Gives `visit` every leaf that a ray of `pyramid` may touch, front to back, until it breaks off.
///
/// Front to back: a ray that passes through the insides of two leaves leaves the earlier one no later than it enters
/// the other. So one order is good for all rays from the apex. Empty leaves are left out.
///
/// Bounded by the tree: a cell is looked at once, and none below [`MAX_DEPTH`]. The walk keeps [`STACK_BYTES`] on the
/// caller's stack.
///
/// # Errors
/// [`ClipError::TooDeep`] and [`ClipError::BadSplit`]; some leaves may have been visited then.
pub fn clip<T: Bintree>(
    tree: &T,
    pyramid: &ClipPyramid,
    counts: &mut ClipCounts,
    mut visit: impl FnMut(ClipCell<T::Cell>) -> ControlFlow<()>,
) -> Result<ControlFlow<()>, ClipError> {
    let (cell, aabb) = tree.root();
    let root = Entry { cell, aabb, distances: Distances::of_root(pyramid, &aabb), level: 0, inside: false };
    // On each level at most one half is put aside.
    let mut stack = [root; MAX_DEPTH];
    let mut held = 0;
    let mut at = root;
    loop {
        match step(tree, pyramid, counts, at)? {
            Step::Halves { near, far } => {
                *stack.get_mut(held).ok_or(ClipError::TooDeep)? = far;
                held += 1;
                at = near;
                continue;
            }
            Step::Leaf(leaf) => {
                counts.listed += 1;
                if visit(leaf).is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            }
            Step::Nothing => {}
        }
        if held == 0 {
            return Ok(ControlFlow::Continue(()));
        }
        held -= 1;
        at = stack[held];
    }
}

/// What comes of a cell. The halves are as large as they are: nothing here can be boxed, and they live for one call.
#[allow(clippy::large_enum_variant)]
enum Step<C> {
    Nothing,
    Leaf(ClipCell<C>),
    Halves { near: Entry<C>, far: Entry<C> },
}

fn step<T: Bintree>(
    tree: &T,
    pyramid: &ClipPyramid,
    counts: &mut ClipCounts,
    mut at: Entry<T::Cell>,
) -> Result<Step<T::Cell>, ClipError> {
    if at.inside {
        counts.untested += 1;
    } else {
        match verdict(pyramid, &at.distances, &at.aabb, counts) {
            Verdict::Outside => return Ok(Step::Nothing),
            Verdict::Partly => {}
            Verdict::Inside => at.inside = true,
        }
    }
    let Some(split) = tree.split(at.cell) else {
        let leaf = ClipCell { cell: at.cell, aabb: at.aabb, inside: at.inside };
        return Ok(if tree.is_empty(at.cell) { Step::Nothing } else { Step::Leaf(leaf) });
    };
    let (axis, plane) = (split.axis, split.plane);
    if axis > 2 || !(at.aabb.lo[axis] < plane && plane < at.aabb.hi[axis]) {
        return Err(ClipError::BadSplit);
    }
    if usize::from(at.level) == MAX_DEPTH {
        return Err(ClipError::TooDeep);
    }
    let level = at.level + 1;
    let (mut lower, mut upper) = (Entry { cell: split.lower, level, ..at }, Entry { cell: split.upper, level, ..at });
    lower.aabb.hi[axis] = plane;
    upper.aabb.lo[axis] = plane;
    if !at.inside {
        (lower.distances, upper.distances) = at.distances.halves(pyramid, &at.aabb, axis, plane);
    }
    let (near, far) = if pyramid.apex[axis] <= plane { (lower, upper) } else { (upper, lower) };
    Ok(Step::Halves { near, far })
}

/// [`clip`] into the caller's room; the number of cells listed.
///
/// # Errors
/// Those of [`clip`], and [`ClipError::Full`]: then `cells` holds as many of the first leaves as it has room for, and a
/// ray that ends among them needs no more.
pub fn clip_into<T: Bintree>(
    tree: &T,
    pyramid: &ClipPyramid,
    counts: &mut ClipCounts,
    cells: &mut [ClipCell<T::Cell>],
) -> Result<usize, ClipError> {
    let mut listed = 0;
    let flow = clip(tree, pyramid, counts, |cell| match cells.get_mut(listed) {
        Some(free) => {
            *free = cell;
            listed += 1;
            ControlFlow::Continue(())
        }
        None => ControlFlow::Break(()),
    })?;
    match flow {
        ControlFlow::Continue(()) => Ok(listed),
        ControlFlow::Break(()) => Err(ClipError::Full),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Split, midpoint};
    use hybray_geometry::{Pyramid, Vec3};
    use std::vec::Vec;

    /// A cube cut across x, y and z in turn down to `levels`; with `wrong`, in a way that no tree may be.
    struct Cuts {
        levels: u8,
        wrong: Option<(usize, f32)>,
    }

    /// Level and box.
    type Cut = (u8, Aabb);

    impl Bintree for Cuts {
        type Cell = Cut;
        fn root(&self) -> (Cut, Aabb) {
            let aabb = Aabb { lo: Vec3::splat(-1.0), hi: Vec3::splat(1.0) };
            ((0, aabb), aabb)
        }
        fn split(&self, (level, aabb): Cut) -> Option<Split<Cut>> {
            let axis = usize::from(level) % 3;
            let plane = midpoint(aabb.lo[axis], aabb.hi[axis]);
            let (mut lower, mut upper) = (aabb, aabb);
            lower.hi[axis] = plane;
            upper.lo[axis] = plane;
            let (axis, plane) = self.wrong.unwrap_or((axis, plane));
            let level = level.saturating_add(1);
            (level <= self.levels).then_some(Split { axis, plane, lower: (level, lower), upper: (level, upper) })
        }
        fn is_empty(&self, (_, aabb): Cut) -> bool {
            aabb.lo.x > 0.7
        }
    }

    /// Its lower half is cut for ever, at 2 to minus the level.
    struct Comb;

    impl Bintree for Comb {
        type Cell = Option<u8>;
        fn root(&self) -> (Option<u8>, Aabb) {
            (Some(0), Aabb { lo: Vec3::new(0.0, -1.0, -1.0), hi: Vec3::ONE })
        }
        fn split(&self, cell: Option<u8>) -> Option<Split<Option<u8>>> {
            let level = cell?.saturating_add(1);
            let plane = f32::from_bits((127 - u32::from(level.min(126))) << 23);
            Some(Split { axis: 0, plane, lower: Some(level), upper: None })
        }
        fn is_empty(&self, _: Option<u8>) -> bool {
            false
        }
    }

    #[test]
    fn a_comb_is_too_deep_though_one_entry_is_enough_for_it() {
        let mut teeth = 0;
        let flow = clip(&Comb, &along(Vec3::NEG_X, 0.1), &mut ClipCounts::default(), |_| {
            teeth += 1;
            ControlFlow::Continue(())
        });
        assert_eq!((flow, teeth), (Err(ClipError::TooDeep), MAX_DEPTH));
    }

    fn along(direction: Vec3, width: f32) -> ClipPyramid {
        let (u, v) = direction.any_orthonormal_pair();
        let corner = |x: f32, y: f32| direction + (u * x + v * y) * width;
        let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        ClipPyramid::new(&Pyramid::through(direction * -3.0, corners).unwrap()).unwrap()
    }

    fn list(tree: &Cuts, pyramid: &ClipPyramid, room: usize) -> (Result<usize, ClipError>, Vec<ClipCell<Cut>>) {
        let nothing = ClipCell { cell: (0, Aabb::EMPTY), aabb: Aabb::EMPTY, inside: false };
        let mut cells = std::vec![nothing; room];
        let listed = clip_into(tree, pyramid, &mut ClipCounts::default(), &mut cells);
        cells.truncate(listed.unwrap_or(room));
        (listed, cells)
    }

    #[test]
    fn a_full_list_holds_the_first_cells() {
        let (tree, pyramid) = (Cuts { levels: 9, wrong: None }, along(Vec3::new(0.6, 0.64, 0.48), 0.2));
        let (listed, all) = list(&tree, &pyramid, 1000);
        assert_eq!(listed, Ok(all.len()));
        assert!(all.len() > 50);
        for room in [0, 1, all.len() / 2, all.len() - 1] {
            let (listed, some) = list(&tree, &pyramid, room);
            assert_eq!(listed, Err(ClipError::Full));
            assert_eq!(some, all[..room]);
        }
        assert_eq!(list(&tree, &pyramid, all.len()).1, all);
    }

    #[test]
    fn empty_leaves_are_left_out_and_names_go_with_their_boxes() {
        let (_, all) = list(&Cuts { levels: 9, wrong: None }, &along(Vec3::X, 0.4), 1000);
        assert!(all.iter().all(|c| c.aabb.lo.x <= 0.7 && c.cell.1 == c.aabb && c.cell.0 == 9));
        assert!(all.iter().any(|c| c.inside) && all.iter().any(|c| !c.inside));
    }

    #[test]
    fn counts_add_up() {
        let (tree, pyramid) = (Cuts { levels: 15, wrong: None }, along(Vec3::new(0.6, 0.64, 0.48), 0.3));
        let mut n = ClipCounts::default();
        let mut leaves = 0;
        let flow = clip(&tree, &pyramid, &mut n, |_| {
            leaves += 1;
            ControlFlow::Continue(())
        });
        assert_eq!(flow, Ok(ControlFlow::Continue(())));
        assert_eq!(n.listed, leaves);
        assert_eq!(n.classified, n.first_outside + n.first_partly + n.first_inside + n.second);
        assert!(n.edges <= 12 * n.second && n.untested > 0 && n.second_outside > 0);
    }

    #[test]
    fn trees_that_are_none_end_in_an_error() {
        let pyramid = along(Vec3::X, 0.01);
        let end = |levels, wrong| list(&Cuts { levels, wrong }, &pyramid, 0).0;
        assert_eq!(end(u8::MAX, None), Err(ClipError::TooDeep));
        assert_eq!(end(3, Some((3, 0.0))), Err(ClipError::BadSplit));
        assert_eq!(end(3, Some((0, 1.0))), Err(ClipError::BadSplit));
        assert_eq!(end(3, Some((0, -1.5))), Err(ClipError::BadSplit));
        assert_eq!(end(3, Some((0, f32::NAN))), Err(ClipError::BadSplit));
    }
}
