//! The uniform grid that appendix A compares with, for this comparison only.
//!
//! `2 + N^(1/3)` voxels a side, as the appendix found best. Planes are kept, and a ray's distances to them computed, not
//! added up: then a voxel's interval is a slab interval, and the hits are those of testing every object.

use hybray_geometry::{Aabb, Candidate, RayKernel, SLAB_WIDEN};

/// Objects by voxel.
pub struct Grid {
    /// One more than voxels along each axis, ascending.
    planes: [Vec<f32>; 3],
    /// Where each voxel's objects begin in `ids`, and one more.
    first: Vec<u32>,
    ids: Vec<u32>,
}

impl Grid {
    /// Puts each box into every voxel that it overlaps, closed faces included.
    pub fn new(boxes: &[Aabb]) -> Self {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |b, aabb| b.union(aabb));
        let side = 2 + (boxes.len() as f64).cbrt().round() as usize;
        let planes = [0, 1, 2].map(|axis| {
            let (lo, hi) = (bounds.lo[axis], bounds.hi[axis]);
            let inner = (1..side).map(|i| lo + (hi - lo) * (i as f32 / side as f32)).filter(|&p| lo < p && p < hi);
            let mut planes: Vec<f32> = std::iter::once(lo).chain(inner).collect();
            planes.dedup();
            planes.push(hi);
            planes
        });
        let mut grid = Self { planes, first: Vec::new(), ids: Vec::new() };
        let mut count = vec![0u32; grid.len() + 1];
        boxes.iter().for_each(|aabb| grid.overlapped(aabb, |voxel| count[voxel] += 1));
        let mut sum = 0;
        for count in &mut count {
            sum += std::mem::replace(count, sum);
        }
        let mut ids = vec![0; sum as usize];
        let mut next = count.clone();
        for (id, aabb) in (0..).zip(boxes) {
            grid.overlapped(aabb, |voxel| {
                ids[next[voxel] as usize] = id;
                next[voxel] += 1;
            });
        }
        (grid.first, grid.ids) = (count, ids);
        grid
    }

    /// Voxels.
    pub fn len(&self) -> usize {
        self.planes.iter().map(|planes| planes.len() - 1).product()
    }

    /// The planes between voxels.
    fn inner(&self, axis: usize) -> &[f32] {
        let planes = &self.planes[axis];
        &planes[1..planes.len() - 1]
    }

    fn voxel(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * (self.planes[1].len() - 1) + y) * (self.planes[0].len() - 1) + x
    }

    fn overlapped(&self, aabb: &Aabb, mut visit: impl FnMut(usize)) {
        let range = |axis: usize| {
            let inner = self.inner(axis);
            inner.partition_point(|&p| p < aabb.lo[axis])..=inner.partition_point(|&p| p <= aabb.hi[axis])
        };
        for z in range(2) {
            for y in range(1) {
                range(0).for_each(|x| visit(self.voxel([x, y, z])));
            }
        }
    }

    /// The nearest hit; `test` tests an object. Counts voxels in `steps`.
    ///
    /// Voxel by voxel along the nearest plane, to the end of the first that ends behind the best hit. Planes that are within
    /// rounding of the nearest may be crossed in another order by an object's own interval: then the voxels on the
    /// other ways are looked at too.
    pub fn walk(
        &self,
        ray: &RayKernel,
        mut best: Candidate,
        steps: &mut u64,
        mut test: impl FnMut(u32, &mut Candidate),
    ) -> Candidate {
        let t = |axis: usize, plane: f32| (plane - ray.origin[axis]) * ray.inverse[axis];
        let downward = ray.inverse.map(f32::is_sign_negative);
        let end = |axis: usize, last: bool| {
            let planes = &self.planes[axis];
            planes[if last { planes.len() - 1 } else { 0 }]
        };
        let (mut entry, mut exit) = (ray.t_min, f32::INFINITY);
        for axis in 0..3 {
            // A plane that the ray lies in is not a number, and bounds nothing.
            entry = entry.max(t(axis, end(axis, downward[axis])));
            exit = exit.min(t(axis, end(axis, !downward[axis])));
        }
        if entry > exit * SLAB_WIDEN {
            return best;
        }
        // Where the ray is a little earlier, so that no voxel behind it is in doubt.
        let from = entry / SLAB_WIDEN / SLAB_WIDEN;
        let mut at = [0, 1, 2].map(|axis| {
            let passed = |&plane: &f32| t(axis, plane) <= from;
            let inner = self.inner(axis);
            if downward[axis] { inner.partition_point(|p| !passed(p)) } else { inner.partition_point(passed) }
        });
        loop {
            let next = [0, 1, 2].map(|axis| {
                let t = t(axis, self.planes[axis][at[axis] + usize::from(!downward[axis])]);
                if t.is_nan() { f32::INFINITY } else { t }
            });
            let crossed = (0..3).fold(0, |least, axis| if next[axis] < next[least] { axis } else { least });
            let doubtful = (0..3).filter(|&axis| next[axis] <= next[crossed] * SLAB_WIDEN);
            let doubtful: usize = doubtful.map(|axis| 1 << axis).sum();
            for across in 0..8usize {
                // The voxel across the nearest plane alone is the next one.
                if across & !doubtful != 0 || across == 1 << crossed {
                    continue;
                }
                let Some(voxel) = self.across(at, across, downward) else { continue };
                *steps += 1;
                for &id in &self.ids[self.first[voxel] as usize..self.first[voxel + 1] as usize] {
                    test(id, &mut best);
                }
            }
            if best.t < next[crossed] {
                return best;
            }
            match self.stepped(at, crossed, downward) {
                Some(there) => at = there,
                None => return best,
            }
        }
    }

    /// The voxel across one plane of each axis in the set.
    fn across(&self, at: [usize; 3], axes: usize, downward: [bool; 3]) -> Option<usize> {
        let moved = (0..3).filter(|axis| axes >> axis & 1 != 0);
        let there = moved.into_iter().try_fold(at, |at, axis| self.stepped(at, axis, downward))?;
        Some(self.voxel(there))
    }

    fn stepped(&self, mut at: [usize; 3], axis: usize, downward: [bool; 3]) -> Option<[usize; 3]> {
        at[axis] = if downward[axis] { at[axis].checked_sub(1)? } else { at[axis] + 1 };
        (at[axis] < self.planes[axis].len() - 1).then_some(at)
    }
}
