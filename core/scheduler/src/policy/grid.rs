//! Where does a ray go next, if it goes from voxel to neighbouring voxel? The 1995 report's chapter 3 and section D.3.
//!
//! The report's processes know their neighbours and nothing else: a ray that leaves a voxel goes to the process of the
//! next one, whether that has anything for it or not, until it hits something or leaves the grid. Nodes know the
//! directory, and send a ray to the owner of the next page that it meets; with a [`Grid`] in their settings they do as
//! in the report.

use hybray_geometry::Vec3;
use hybray_link::Peer;

/// The scene's grid of voxels: voxel `n`, in the order of the tree of planes that cuts the scene, belongs to node `n +
/// 1`. It says which way rays take and nothing else: any grid gives the same picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The scene's box: its lower corner.
    pub lo: [f32; 3],
    /// Its upper corner.
    pub hi: [f32; 3],
    /// Voxels along each axis.
    pub sides: [u32; 3],
}

impl Grid {
    /// The plane below voxel `at` of an axis.
    fn plane(&self, axis: usize, at: u32) -> f32 {
        let (lo, hi) = (f64::from(self.lo[axis]), f64::from(self.hi[axis]));
        (lo + (hi - lo) * (f64::from(at) / f64::from(self.sides[axis]))) as f32
    }

    /// The node of a voxel. The tree halves the axis with the most voxels left, and counts what is below a plane first.
    fn node(&self, cell: [u32; 3]) -> Peer {
        let (mut from, mut to) = ([0; 3], self.sides);
        let mut before = 0;
        loop {
            let left: [u32; 3] = core::array::from_fn(|axis| to[axis] - from[axis]);
            let axis = (0..3).rev().max_by_key(|&axis| left[axis]).unwrap_or(0);
            if left[axis] <= 1 {
                return Peer::try_from(before + 1).unwrap_or(Peer::MAX);
            }
            let half = left[axis].div_ceil(2);
            if cell[axis] < from[axis] + half {
                to[axis] = from[axis] + half;
            } else {
                before += left.iter().product::<u32>() / left[axis] * half;
                from[axis] += half;
            }
        }
    }

    /// The nodes whose voxels a ray goes through, in order, from the one that it starts in to where it leaves the
    /// scene's box. The outermost voxels reach to infinity, as those of the tree of planes do: a ray that starts
    /// outside of the box, as one from the camera may, starts in one of them. Bounded: the voxels along all three axes.
    pub fn way(&self, origin: Vec3, direction: Vec3) -> impl Iterator<Item = Peer> + '_ {
        let mut inside = (0.0f32, f32::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            let [a, b] = [(self.lo[axis] - o) / d, (self.hi[axis] - o) / d];
            if d != 0.0 {
                inside = (inside.0.max(a.min(b)), inside.1.min(a.max(b)));
            } else if o < self.lo[axis] || o > self.hi[axis] {
                inside.1 = f32::NEG_INFINITY;
            }
        }
        // Past the box it meets nothing, and goes no further.
        let end = if inside.0 <= inside.1 { inside.1 } else { f32::NEG_INFINITY };
        let mut cell: [u32; 3] = core::array::from_fn(|axis| {
            (1..self.sides[axis]).take_while(|&at| self.plane(axis, at) <= origin[axis]).count() as u32
        });
        let mut ends = false;
        core::iter::from_fn(move || {
            if ends {
                return None;
            }
            let here = self.node(cell);
            let mut next = None;
            for axis in 0..3 {
                let up = direction[axis] > 0.0;
                let on = if up { cell[axis] + 1 < self.sides[axis] } else { direction[axis] < 0.0 && cell[axis] > 0 };
                let t = (self.plane(axis, cell[axis] + u32::from(up)) - origin[axis]) / direction[axis];
                if on && t <= end && next.is_none_or(|(best, _, _)| t < best) {
                    next = Some((t, axis, up));
                }
            }
            match next {
                Some((_, axis, true)) => cell[axis] += 1,
                Some((_, axis, false)) => cell[axis] -= 1,
                None => ends = true,
            }
            Some(here)
        })
    }

    /// Where node `me` sends a ray that is to come to node `to`: to the next voxel on its way there, or straight on if
    /// that is not on the rest of its way. Each step is one further along the way, so that no ray goes in a circle.
    #[must_use]
    pub fn next(&self, origin: Vec3, direction: Vec3, me: Peer, to: Peer) -> Peer {
        let mut rest = self.way(origin, direction);
        if !rest.by_ref().any(|node| node == me) {
            rest = self.way(origin, direction);
        }
        match rest.next() {
            Some(next) if next == to || rest.any(|node| node == to) => next,
            _ => to,
        }
    }
}
