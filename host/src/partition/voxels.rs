//! The scene cut into voxels by planes (report, chapter 3: a grid of bintrees).
//!
//! A regular grid and voxels of equal work are both binary trees of planes, so there is one rule for who is where, and
//! voxels are numbered in the order of that tree's leaves: neighbours in number are neighbours in space, as along a
//! Morton curve.
//!
//! A primitive stands in every voxel that the inside of its box reaches into, with the part of its box in there. That
//! is the midpoint tree's rule, and so is the proof that no hit is missed (`docs/NUMERICS.md`, spatial splits):
//! wherever the planes lie, one of the voxels holds the primitive with a part whose slab interval has the hit. The tree
//! of that voxel may therefore be built of the parts, and the outermost voxels reach to infinity: no bound of the scene
//! decides anything.

use hybray_bintree::Item;
use hybray_geometry::{Aabb, Vec3};
use hybray_scheduler::policy::Grid;
use hybray_tracer::Scene;

/// Most voxels of a scene.
pub const VOXELS_MAX: u32 = 65_536;

/// How the scene is cut. None of it changes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Voxels {
    /// Not at all.
    #[default]
    One,
    /// Equal boxes along each axis of the scene's box: the paper's.
    Grid([u32; 3]),
    /// So many, of equal work: see [`Plan::new`].
    Adaptive(u32),
}

impl Voxels {
    /// How many there are.
    #[must_use]
    pub fn count(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Grid(sides) => sides.iter().product(),
            Self::Adaptive(n) => n,
        }
    }

    /// The grid that rays go through from voxel to voxel, where the scene was cut into one.
    #[must_use]
    pub fn grid(self, scene: &Scene<'_>) -> Option<Grid> {
        let Self::Grid(sides) = self else { return None };
        let nodes = scene.resident.directory.nodes;
        let boxes = nodes.first().into_iter().flat_map(|root| root.children().map(|(slot, _)| root.aabb(slot)));
        let bounds = boxes.fold(Aabb::EMPTY, |all, aabb| all.union(&aabb));
        let corner = |at: Vec3| at.to_array();
        (!bounds.is_empty()).then(|| Grid { lo: corner(bounds.lo), hi: corner(bounds.hi), sides })
    }
}

impl std::str::FromStr for Voxels {
    type Err = String;

    /// `4x8x1` is a grid, `32` so many of equal work.
    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<u32> = text.split(['x', 'X']).map(|n| n.parse().unwrap_or(0)).collect();
        let count = numbers.iter().try_fold(1u32, |product, &n| product.checked_mul(n));
        let voxels = match numbers[..] {
            [1] => Self::One,
            [n] => Self::Adaptive(n),
            [x, y, z] => Self::Grid([x, y, z]),
            _ => return Err("give voxels along x, y and z, such as 4x8x1, or how many, such as 32".to_owned()),
        };
        match count {
            Some(1..=VOXELS_MAX) => Ok(voxels),
            Some(0) => Err(format!("give 1 to {VOXELS_MAX} of equal work, such as 32, or a grid, such as 4x8x1")),
            _ => Err(format!("there can be {VOXELS_MAX} voxels at most: give fewer, such as 64x64x16")),
        }
    }
}

/// A node of the tree of planes, in preorder: the first child of an inner node follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cut {
    axis: u32,
    plane: f32,
    /// Index of the second child, which lies above the plane; 0 for a voxel.
    second: u32,
    /// Number of the voxel.
    voxel: u32,
}

/// What stands above voxels, in preorder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// A node with two children, and the box of what is below.
    Above(Aabb),
    /// A voxel that is not empty.
    Voxel(u32),
}

/// The planes between voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    cuts: Vec<Cut>,
    voxels: u32,
    depth: u32,
}

/// Levels of planes at most: 16 halvings of [`VOXELS_MAX`], and one for each axis whose count is no power of two.
const LEVELS: usize = 20;

/// Parts of the scene's box along an axis in which work is summed up to find a plane.
const BINS: usize = 256;

impl Plan {
    /// Cuts the scene of `bounds`, of which `sample` tells what is where.
    ///
    /// Voxels of equal work are found top down: the longest axis is cut where the shares of work on both sides are
    /// those of the voxels that they will become. The **work** of a primitive is estimated as one half its share of the
    /// number of primitives, and one half its share of their boxes' surface. A ray meets a box with a probability that
    /// goes as its surface, so that counting alone would give a floor of two triangles, which half the rays meet, to
    /// one of many voxels; surface alone would put all the small things, which take the memory, into a few. The work of
    /// a primitive is spread evenly over its box.
    #[must_use]
    pub fn new(voxels: Voxels, bounds: &Aabb, sample: &[Item]) -> Self {
        match voxels {
            Voxels::One => Self::grid([1; 3], bounds),
            Voxels::Grid(sides) => Self::grid(sides, bounds),
            Voxels::Adaptive(n) => Self::adaptive(n, sample),
        }
    }

    fn empty() -> Self {
        Self { cuts: Vec::new(), voxels: 0, depth: 0 }
    }

    fn push(&mut self, axis: usize, plane: f32, is_voxel: bool, parent: Option<usize>, depth: u32) -> usize {
        let here = self.cuts.len();
        if let Some(parent) = parent {
            self.cuts[parent].second = here as u32;
        }
        self.cuts.push(Cut { axis: axis as u32, plane, second: 0, voxel: self.voxels });
        self.voxels += u32::from(is_voxel);
        self.depth = self.depth.max(depth);
        here
    }

    /// Halves the axis with the most voxels left.
    fn grid(sides: [u32; 3], bounds: &Aabb) -> Self {
        let mut plan = Self::empty();
        let mut waiting = vec![([0; 3], sides, None, 0)];
        while let Some((from, to, parent, depth)) = waiting.pop() {
            let left: [u32; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
            let axis = (0..3).rev().max_by_key(|&axis| left[axis]).unwrap_or(0);
            if left[axis] <= 1 {
                plan.push(0, 0.0, true, parent, depth);
                continue;
            }
            let middle = from[axis] + left[axis].div_ceil(2);
            let (lo, hi) = (f64::from(bounds.lo[axis]), f64::from(bounds.hi[axis]));
            let plane = lo + (hi - lo) * (f64::from(middle) / f64::from(sides[axis]));
            let here = plan.push(axis, plane as f32, false, parent, depth);
            let (mut end, mut begin) = (to, from);
            end[axis] = middle;
            begin[axis] = middle;
            waiting.push((begin, to, Some(here), depth + 1));
            waiting.push((from, end, None, depth + 1));
        }
        plan
    }

    fn adaptive(voxels: u32, sample: &[Item]) -> Self {
        let area: f64 = sample.iter().map(|item| half_area(&item.aabb())).sum();
        let per_area = if area > 0.0 { sample.len() as f64 / area } else { 0.0 };
        let work = |part: &Aabb| 1.0 + half_area(part) * per_area;
        let mut plan = Self::empty();
        let parts: Vec<Aabb> = sample.iter().map(Item::aabb).collect();
        let mut waiting = vec![(parts, voxels, None, 0)];
        while let Some((parts, n, parent, depth)) = waiting.pop() {
            if n <= 1 {
                plan.push(0, 0.0, true, parent, depth);
                continue;
            }
            let bounds = parts.iter().fold(Aabb::EMPTY, |b, part| b.union(part));
            let extent = bounds.hi - bounds.lo;
            let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
            let first = n.div_ceil(2);
            let share = f64::from(first) / f64::from(n);
            let plane = plane(&parts, axis, [bounds.lo[axis], bounds.hi[axis]], share, work);
            let here = plan.push(axis, plane, false, parent, depth);
            let [mut below, mut above] = [Vec::new(), Vec::new()];
            for part in parts {
                let (low, high) = divide(&part, axis, plane);
                below.extend(low);
                above.extend(high);
            }
            waiting.push((above, n - first, Some(here), depth + 1));
            waiting.push((below, first, None, depth + 1));
        }
        plan
    }

    /// How many voxels there are, empty ones included.
    #[must_use]
    pub fn voxels(&self) -> u32 {
        self.voxels
    }

    /// Levels of planes above the deepest voxel.
    #[must_use]
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Tells each voxel that holds a primitive of this box, in order, with the part of the box in there. At least one.
    pub fn place(&self, aabb: &Aabb, mut tell: impl FnMut(u32, &Aabb)) {
        let mut waiting = [(0, *aabb); LEVELS + 1];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let (index, part) = waiting[top];
            let cut = &self.cuts[index as usize];
            if cut.second == 0 {
                tell(cut.voxel, &part);
                continue;
            }
            let (below, above) = divide(&part, cut.axis as usize, cut.plane);
            for (child, part) in [(cut.second, above), (index + 1, below)] {
                if let Some(part) = part {
                    waiting[top] = (child, part);
                    top += 1;
                }
            }
        }
    }

    /// The tree above the voxels that are not empty, given the box of what each holds.
    #[must_use]
    pub fn above(&self, held: &[Aabb]) -> Vec<Step> {
        let mut boxes = vec![Aabb::EMPTY; self.cuts.len()];
        for (index, cut) in self.cuts.iter().enumerate().rev() {
            boxes[index] = match cut.second {
                0 => held[cut.voxel as usize],
                second => boxes[index + 1].union(&boxes[second as usize]),
            };
        }
        let steps = self.cuts.iter().zip(&boxes).enumerate().filter_map(|(index, (cut, aabb))| match cut.second {
            0 => (!aabb.is_empty()).then_some(Step::Voxel(cut.voxel)),
            second => {
                let both = !boxes[index + 1].is_empty() && !boxes[second as usize].is_empty();
                both.then_some(Step::Above(*aabb))
            }
        });
        steps.collect()
    }
}

/// The parts of a box below and above a plane. A box that only touches the plane is on one side.
fn divide(part: &Aabb, axis: usize, plane: f32) -> (Option<Aabb>, Option<Aabb>) {
    if part.hi[axis] <= plane {
        return (Some(*part), None);
    }
    if part.lo[axis] >= plane {
        return (None, Some(*part));
    }
    let (mut below, mut above) = (*part, *part);
    below.hi[axis] = plane;
    above.lo[axis] = plane;
    (Some(below), Some(above))
}

fn half_area(aabb: &Aabb) -> f64 {
    f64::from(aabb.half_area())
}

/// Where `share` of the work lies below.
fn plane(parts: &[Aabb], axis: usize, [lo, hi]: [f32; 2], share: f64, work: impl Fn(&Aabb) -> f64) -> f32 {
    let (lo, hi) = (f64::from(lo), f64::from(hi));
    if !(hi > lo) {
        return if lo.is_finite() { lo as f32 } else { 0.0 };
    }
    let bins_per_length = BINS as f64 / (hi - lo);
    let mut bins = [0.0; BINS];
    // What is added to each bin from this one on: a part that covers many costs no more than one that covers few.
    let mut from_here_on = [0.0; BINS + 1];
    let mut total = 0.0;
    for part in parts {
        let w = work(part);
        total += w;
        let [a, b] = [part.lo[axis], part.hi[axis]].map(|x| (f64::from(x) - lo) * bins_per_length);
        let [first, last] = [a, b].map(|x| (x as usize).min(BINS - 1));
        if first == last {
            bins[first] += w;
            continue;
        }
        let per_bin = w / (b - a);
        bins[first] += (first as f64 + 1.0 - a) * per_bin;
        bins[last] += (b - last as f64) * per_bin;
        from_here_on[first + 1] += per_bin;
        from_here_on[last] -= per_bin;
    }
    let (mut below, mut covered) = (0.0, 0.0);
    for bin in 0..BINS {
        covered += from_here_on[bin];
        let here = bins[bin] + covered;
        if below + here >= share * total && here > 0.0 {
            let at = bin as f64 + ((share * total - below) / here).clamp(0.0, 1.0);
            return (lo + at / bins_per_length) as f32;
        }
        below += here;
    }
    (0.5 * (lo + hi)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_scene::Kind;

    fn random(seed: &mut u64) -> f32 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 40) as f32 / (1 << 24) as f32
    }

    fn items(count: u32, seed: u64, side: f32) -> Vec<Item> {
        let seed = &mut seed.clone();
        (0..count)
            .map(|id| {
                // Crowded at one corner.
                let [x, y, z] = [(); 3].map(|()| random(seed).powi(3));
                let lo = Vec3::new(x, y, z);
                let hi = lo + side * Vec3::new(random(seed), random(seed), random(seed));
                Item::new(&Aabb { lo, hi }, Kind::Triangle, id)
            })
            .collect()
    }

    fn bounds(items: &[Item]) -> Aabb {
        items.iter().fold(Aabb::EMPTY, |b, item| b.union(&item.aabb()))
    }

    #[test]
    fn words() {
        let check = |text: &str, expected| assert_eq!(text.parse(), expected, "{text}");
        check("1", Ok(Voxels::One));
        check("32", Ok(Voxels::Adaptive(32)));
        check("4x8x1", Ok(Voxels::Grid([4, 8, 1])));
        check("4X8X1", Ok(Voxels::Grid([4, 8, 1])));
        check("65536", Ok(Voxels::Adaptive(65_536)));
        for bad in ["0", "", "x", "4x8", "4x8x1x1", "-3", "4x0x1", "65537", "257x256x1", "99999x99999x99999", "1.5"] {
            let error = bad.parse::<Voxels>().unwrap_err();
            // What it says would do, does.
            let hint = error.rsplit("such as ").next().unwrap();
            assert!(hint.parse::<Voxels>().is_ok(), "{bad}: {error}");
        }
    }

    #[test]
    fn grids_number_their_voxels_along_a_curve() {
        let unit = Aabb { lo: Vec3::ZERO, hi: Vec3::ONE };
        for sides in [[1, 1, 1], [2, 2, 1], [4, 8, 1], [3, 3, 3], [1, 1, 7], [65_536, 1, 1], [5, 1, 13_107]] {
            let plan = Plan::new(Voxels::Grid(sides), &unit, &[]);
            assert_eq!(plan.voxels(), sides.iter().product::<u32>());
            assert!(plan.depth() as usize <= LEVELS, "{sides:?}: {}", plan.depth());
        }
        // The middle of each cell is in one voxel, and each voxel has one.
        let plan = Plan::new(Voxels::Grid([4, 8, 2]), &unit, &[]);
        let mut seen = [false; 64];
        for i in 0..64 {
            let centre = Vec3::new((i % 4) as f32 / 4.0, (i / 4 % 8) as f32 / 8.0, (i / 32) as f32 / 2.0)
                + Vec3::new(0.125, 0.0625, 0.25);
            plan.place(&Aabb { lo: centre, hi: centre }, |voxel, _| {
                assert!(!std::mem::replace(&mut seen[voxel as usize], true));
            });
        }
        assert!(seen.iter().all(|&s| s));
    }

    /// Against a test of every voxel's own box: a primitive is where the inside of its box reaches, and the parts make
    /// up the box.
    #[test]
    fn parts_make_up_the_box() {
        for (seed, voxels) in [(1, Voxels::One), (2, Voxels::Grid([4, 3, 2])), (3, Voxels::Adaptive(7))] {
            let items = items(500, seed, 0.3);
            let plan = Plan::new(voxels, &bounds(&items), &items);
            let everything = Aabb { lo: Vec3::splat(f32::NEG_INFINITY), hi: Vec3::splat(f32::INFINITY) };
            let mut cells = Vec::new();
            plan.place(&everything, |voxel, cell| {
                assert_eq!(voxel as usize, cells.len());
                cells.push(*cell);
            });
            assert_eq!(cells.len(), voxels.count() as usize);
            for item in &items {
                let mut found = vec![None; cells.len()];
                plan.place(&item.aabb(), |voxel, part| found[voxel as usize] = Some(*part));
                for (cell, part) in cells.iter().zip(&found) {
                    let inside = (0..3).all(|i| item.lo[i] < cell.hi[i] && cell.lo[i] < item.hi[i]);
                    assert_eq!(part.is_some(), inside, "seed {seed}: {item:?} in {cell:?}");
                    if let Some(part) = part {
                        assert_eq!(*part, item.aabb().intersection(cell), "seed {seed}");
                    }
                }
            }
        }
    }

    #[test]
    fn adaptive_voxels_have_equal_work() {
        for (seed, n) in [(4, 2), (5, 7), (6, 32), (7, 100)] {
            let items = items(20_000, seed, 0.001);
            let plan = Plan::new(Voxels::Adaptive(n), &bounds(&items), &items);
            assert_eq!(plan.voxels(), n);
            let area: f64 = items.iter().map(|item| half_area(&item.aabb())).sum();
            let mut work = vec![0.0; n as usize];
            for item in &items {
                plan.place(&item.aabb(), |voxel, part| {
                    work[voxel as usize] += 0.5 / 20_000.0 + 0.5 * half_area(part) / area;
                });
            }
            let fair = 1.0 / f64::from(n);
            for (voxel, w) in work.iter().enumerate() {
                assert!((0.7..1.4).contains(&(w / fair)), "seed {seed}, {n} voxels: voxel {voxel} has {}", w / fair);
            }
        }
    }

    #[test]
    fn the_tree_above_leaves_out_what_is_empty() {
        let unit = Aabb { lo: Vec3::ZERO, hi: Vec3::ONE };
        let plan = Plan::new(Voxels::Grid([4, 1, 1]), &unit, &[]);
        let held = |voxels: &[usize]| {
            let mut held = [Aabb::EMPTY; 4];
            voxels.iter().for_each(|&v| held[v] = unit);
            plan.above(&held)
        };
        let (above, voxel) = (Step::Above(unit), Step::Voxel);
        assert_eq!(held(&[]), []);
        assert_eq!(held(&[2]), [voxel(2)]);
        assert_eq!(held(&[0, 3]), [above, voxel(0), voxel(3)]);
        assert_eq!(held(&[0, 1, 3]), [above, above, voxel(0), voxel(1), voxel(3)]);
    }

    #[test]
    fn awkward_samples() {
        let point = Item::new(&Aabb { lo: Vec3::ONE, hi: Vec3::ONE }, Kind::Sphere, 0);
        for sample in [vec![], vec![point], vec![point; 100]] {
            let plan = Plan::new(Voxels::Adaptive(9), &bounds(&sample), &sample);
            let mut found = 0;
            plan.place(&point.aabb(), |_, part| {
                found += 1;
                assert_eq!(*part, point.aabb());
            });
            assert_eq!((plan.voxels(), found), (9, 1));
        }
    }

    /// The voxels that a ray goes through, by brute force: all planes cut it, up to where it leaves the box, and the
    /// middle of each piece lies in one. `None` if a piece is so short that rounding decides.
    fn crossed(plan: &Plan, grid: &Grid, origin: Vec3, direction: Vec3) -> Option<Vec<u16>> {
        let (o, d) = (origin.to_array().map(f64::from), direction.to_array().map(f64::from));
        let at = |axis: usize, at: u32| {
            let (lo, hi) = (f64::from(grid.lo[axis]), f64::from(grid.hi[axis]));
            (lo + (hi - lo) * f64::from(at) / f64::from(grid.sides[axis]) - o[axis]) / d[axis]
        };
        let ends = [0, 1, 2].map(|axis| [at(axis, 0), at(axis, grid.sides[axis])]);
        let enters = ends.iter().fold(0.0f64, |t, [a, b]| t.max(a.min(*b)));
        let leaves = ends.iter().fold(f64::INFINITY, |t, [a, b]| t.min(a.max(*b)));
        if (leaves - enters).abs() < 1e-4 {
            return None;
        }
        let mut cuts = vec![0.0];
        if enters < leaves {
            cuts.extend(
                (0..3).flat_map(|axis| (1..grid.sides[axis]).map(move |n| (axis, n))).map(|(axis, n)| at(axis, n)),
            );
            cuts.push(leaves);
            cuts.retain(|&t| t >= 0.0 && t <= leaves);
        } else {
            cuts.push(2e-4);
        }
        cuts.sort_by(f64::total_cmp);
        let mut nodes = Vec::new();
        for piece in cuts.windows(2) {
            if piece[1] - piece[0] < 1e-4 {
                return None;
            }
            let middle = std::array::from_fn(|axis| (o[axis] + d[axis] * (piece[0] + piece[1]) / 2.0) as f32);
            let middle = Vec3::from_array(middle);
            plan.place(&Aabb { lo: middle, hi: middle }, |voxel, _| nodes.push(voxel as u16 + 1));
        }
        Some(nodes)
    }

    /// Rays from within a grid and from without meet its voxels in the order in which they cross its planes; and
    /// whoever passes them on, each step is one along that way, or straight to a node that is not on the rest of it.
    #[test]
    fn rays_go_from_voxel_to_voxel() {
        let seed = &mut 7;
        let mut compared = 0;
        for _ in 0..4000 {
            let sides = [(); 3].map(|()| 1 + (random(seed) * 6.0) as u32);
            let [lo, size, origin, direction] = [(); 4].map(|()| [(); 3].map(|()| random(seed))).map(Vec3::from_array);
            let hi = lo + size + Vec3::splat(0.1);
            let grid = Grid { lo: lo.to_array(), hi: hi.to_array(), sides };
            let plan = Plan::new(Voxels::Grid(sides), &Aabb { lo, hi }, &[]);
            let origin = origin * 3.0 - Vec3::ONE;
            // Most go through the box, some past it.
            let direction = lo + (hi - lo) * (1.4 * direction[0]) + (direction - Vec3::splat(0.5)) * 0.3 - origin;
            let way: Vec<u16> = grid.way(origin, direction).collect();
            if let Some(crossed) = crossed(&plan, &grid, origin, direction) {
                assert_eq!(way, crossed, "{grid:?} {origin:?} {direction:?}");
                compared += usize::from(crossed.len() > 1);
            }
            let voxels = plan.voxels() as u16;
            let [from, to] = [(); 2].map(|()| 1 + (random(seed) * f32::from(voxels)) as u16);
            let (mut at, mut hops) = (from, Vec::new());
            while at != to {
                at = grid.next(origin, direction, at, to);
                hops.push(at);
                assert!(hops.len() <= way.len() + 1, "{grid:?} {origin:?} {direction:?}: {hops:?}");
            }
            let place = |node| way.iter().position(|&on| on == node);
            let expected = match (place(from), place(to)) {
                _ if from == to => Vec::new(),
                (Some(first), Some(last)) if first < last => way[first + 1..=last].to_vec(),
                (None, Some(last)) => way[..=last].to_vec(),
                _ => vec![to],
            };
            assert_eq!(hops, expected, "{grid:?} {origin:?} {direction:?} from {from}");
        }
        assert!(compared > 1000, "{compared} rays");
    }

    /// Whatever comes in a record, a way ends.
    #[test]
    fn ways_of_no_rays_end() {
        let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1.0, f32::MIN_POSITIVE, f32::MAX];
        let grid = Grid { lo: [0.0; 3], hi: [1.0; 3], sides: [4, 3, 2] };
        for (o, d) in values.iter().flat_map(|&o| values.iter().map(move |&d| (o, d))) {
            for rest in [-1.0, 0.5, f32::NAN] {
                let steps = grid.way(Vec3::new(o, 0.5, rest), Vec3::new(d, rest, d)).count();
                assert!(steps <= 9, "{o} {d}: {steps}");
            }
        }
    }
}
