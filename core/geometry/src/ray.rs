//! Rays, and what is computed once for each before its tests.

use crate::simd::{Lanes, Mask};
use crate::{Aabb, Vec3};

/// `origin + t direction` for `t` in `t_min..=t_max`. The direction is not zero, and need not have length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: Vec3,
    /// What one unit of `t` moves along.
    pub direction: Vec3,
    /// Hits before this do not count; 0 or more.
    pub t_min: f32,
    /// Hits after this do not count; may be infinite.
    pub t_max: f32,
}

/// A ray with the reciprocal of its direction, for boxes, and Woop's shear, for triangles.
#[derive(Clone, Copy, Debug)]
pub struct RayKernel {
    /// As in [`Ray`].
    pub origin: [f32; 3],
    /// As in [`Ray`].
    pub direction: [f32; 3],
    /// 1 over each component: infinite, with its sign, where that is 0.
    pub inverse: [f32; 3],
    /// Which axis serves as x, y and z of the sheared space: z is the longest component.
    pub axes: [usize; 3],
    /// Shear of x and y, scale of z.
    pub shear: [f32; 3],
    /// As in [`Ray`].
    pub t_min: f32,
}

impl RayKernel {
    /// Prepares `ray`.
    #[must_use]
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let (ax, ay, az) = (d[0].abs(), d[1].abs(), d[2].abs());
        let z = if ax > ay {
            if ax > az { 0 } else { 2 }
        } else if ay > az {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if d[z] < 0.0 {
            core::mem::swap(&mut x, &mut y);
        }
        Self {
            origin: ray.origin.to_array(),
            direction: d,
            inverse: d.map(|d| 1.0 / d),
            axes: [x, y, z],
            shear: [d[x] / d[z], d[y] / d[z], 1.0 / d[z]],
            t_min: ray.t_min,
        }
    }

    /// This ray in every lane.
    #[must_use]
    #[inline(always)]
    pub fn splat<F: Lanes>(&self, like: F) -> LaneRay<F> {
        let all = |a: [f32; 3]| [like.splat_like(a[0]), like.splat_like(a[1]), like.splat_like(a[2])];
        LaneRay {
            origin: all(self.origin),
            direction: all(self.direction),
            inverse: all(self.inverse),
            axes: self.axes,
            turned_origin: all(turn(self.origin, self.axes)),
            turned_inverse: all(turn(self.inverse, self.axes)),
            shear: all(self.shear),
            t_min: like.splat_like(self.t_min),
        }
    }

    /// The slab interval of `aabb`: empty if the first is greater than the second. See [`crate::slab`].
    #[must_use]
    #[inline]
    pub fn slab(&self, aabb: &Aabb) -> (f32, f32) {
        let ray = self.splat(crate::simd::ONE_LANE);
        let one = |a: Vec3| a.to_array().map(|x| crate::simd::ONE_LANE.splat_like(x));
        let (near, far) = ray.own_slab(&one(aabb.lo), &one(aabb.hi));
        (near.to_array()[0], far.to_array()[0])
    }
}

/// A ray in each lane; all have the same `axes`.
#[derive(Clone, Copy, Debug)]
pub struct LaneRay<F> {
    /// See [`RayKernel`].
    pub origin: [F; 3],
    /// See [`RayKernel`].
    pub direction: [F; 3],
    /// See [`RayKernel`].
    pub inverse: [F; 3],
    /// See [`RayKernel`].
    pub axes: [usize; 3],
    /// The origin in the order of `axes`.
    pub turned_origin: [F; 3],
    /// The inverse in the order of `axes`.
    pub turned_inverse: [F; 3],
    /// See [`RayKernel`].
    pub shear: [F; 3],
    /// See [`RayKernel`].
    pub t_min: F,
}

impl<F: Lanes> LaneRay<F> {
    /// Rays side by side, one a lane, the last in what lanes are left: in each lane what [`RayKernel::new`] makes of its ray.
    /// `None` if there are no rays, or their `axes` differ: such rays share no shear, and are traced singly.
    ///
    /// # Panics
    /// If there are more rays than lanes.
    #[must_use]
    #[inline(always)]
    pub fn side_by_side(like: F, rays: &[Ray]) -> Option<Self> {
        let mut row = [[like.to_array(); 3]; 2];
        let mut start = like.to_array();
        let last = rays.len().checked_sub(1)?;
        assert!(last < F::LANES);
        for lane in 0..F::LANES {
            let ray = &rays[if lane < last { lane } else { last }];
            let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
            for axis in 0..3 {
                row[0][axis].as_mut()[lane] = origin[axis];
                row[1][axis].as_mut()[lane] = direction[axis];
            }
            start.as_mut()[lane] = ray.t_min;
        }
        let [o, d] = &row;
        let origin = [like.load_like(&o[0]), like.load_like(&o[1]), like.load_like(&o[2])];
        let d = [like.load_like(&d[0]), like.load_like(&d[1]), like.load_like(&d[2])];
        let axes = RayKernel::new(&rays[0]).axes;
        let [x, y, z] = axes;
        // The longest component, as in `RayKernel::new`, and its sign: the same in all lanes, or not.
        let (ax, ay, az) = (d[0].abs(), d[1].abs(), d[2].abs());
        let longest = [az.lt(ax) & ay.lt(ax), az.lt(ay) & !ay.lt(ax)];
        let is = match z {
            0 => longest[0],
            1 => longest[1],
            _ => !(longest[0] | longest[1]),
        };
        let zero = like.splat_like(0.0);
        let downward = d[z].lt(zero);
        let same = is & if y == (z + 1) % 3 { downward } else { !downward };
        if same.bits() != (!0 >> (32 - F::LANES)) {
            return None;
        }
        let one = like.splat_like(1.0);
        let inverse = [one / d[0], one / d[1], one / d[2]];
        let shear = [d[x] / d[z], d[y] / d[z], inverse[z]];
        let (turned_origin, turned_inverse) = (turn(origin, axes), turn(inverse, axes));
        let t_min = like.load_like(&start);
        Some(Self { origin, direction: d, inverse, axes, turned_origin, turned_inverse, shear, t_min })
    }

    /// The slab interval of a primitive's own box, from minus infinity on.
    #[must_use]
    #[inline(always)]
    pub fn own_slab(&self, lo: &[F; 3], hi: &[F; 3]) -> (F, F) {
        own_slab(&self.origin, &self.inverse, lo, hi)
    }
}

/// `a` in another order of the axes.
#[must_use]
#[inline(always)]
pub fn turn<T: Copy>(a: [T; 3], axes: [usize; 3]) -> [T; 3] {
    [a[axes[0]], a[axes[1]], a[axes[2]]]
}

/// [`LaneRay::own_slab`], in any order of the axes.
#[inline(always)]
pub(crate) fn own_slab<F: Lanes>(origin: &[F; 3], inverse: &[F; 3], lo: &[F; 3], hi: &[F; 3]) -> (F, F) {
    let planes = |i: usize| {
        let negative = inverse[i].sign();
        (hi[i].select(negative, lo[i]), lo[i].select(negative, hi[i]))
    };
    let ((x0, x1), (y0, y1), (z0, z1)) = (planes(0), planes(1), planes(2));
    crate::slab(origin, inverse, &[x0, y0, z0], &[x1, y1, z1], inverse[0].splat_like(f32::NEG_INFINITY))
}
