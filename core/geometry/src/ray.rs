//! Rays, and what is computed once for each before its tests.

use crate::simd::Lanes;
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

/// Rays side by side, one a lane. `None` if their `axes` differ: such rays share no shear, and are traced singly.
#[must_use]
#[inline(always)]
pub fn ray_lanes<F: Lanes>(like: F, rays: &[RayKernel]) -> Option<LaneRay<F>> {
    let first = rays.first()?;
    if rays.len() != F::LANES || rays.iter().any(|r| r.axes != first.axes) {
        return None;
    }
    let axes = first.axes;
    let origin = three(like, rays, |r| &r.origin);
    let inverse = three(like, rays, |r| &r.inverse);
    Some(LaneRay {
        origin,
        direction: three(like, rays, |r| &r.direction),
        inverse,
        axes,
        turned_origin: turn(origin, axes),
        turned_inverse: turn(inverse, axes),
        shear: three(like, rays, |r| &r.shear),
        t_min: gather(like, rays, |r| r.t_min),
    })
}

#[inline(always)]
fn gather<F: Lanes>(like: F, rays: &[RayKernel], get: impl Fn(&RayKernel) -> f32) -> F {
    let mut array = like.to_array();
    for (lane, ray) in array.as_mut().iter_mut().zip(rays) {
        *lane = get(ray);
    }
    like.load_like(&array)
}

#[inline(always)]
fn three<F: Lanes>(like: F, rays: &[RayKernel], get: impl Fn(&RayKernel) -> &[f32; 3]) -> [F; 3] {
    [gather(like, rays, |r| get(r)[0]), gather(like, rays, |r| get(r)[1]), gather(like, rays, |r| get(r)[2])]
}

impl<F: Lanes> LaneRay<F> {
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
