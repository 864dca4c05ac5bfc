//! Some rays as intervals, axis by axis, against eight boxes at once: what the slab test of each of them would say, or more.

use hybray_geometry::simd::{Lanes, Mask, Simd};
use hybray_geometry::{Ray, SLAB_WIDEN};

/// How far rays may be apart (their directions, by the longest component of the shortest) for a tree to be of use to all of them.
const SPREAD_MAX: f32 = 0.25;

/// Origins and reciprocals of the directions of some rays, from the least to the greatest.
///
/// Differences and products round monotonely, so that for each ray the slab interval of a box lies in the interval that is
/// computed here, to the bit: no margins are needed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    axes: [Axis; 3],
    t_min: f32,
    /// No ray ends after this.
    pub t_max: f32,
    /// Whether the rays keep together.
    pub narrow: bool,
}

#[derive(Clone, Copy, Debug)]
struct Axis {
    /// Of the directions: not below zero, not above, or both.
    sign: Sign,
    origin: [f32; 2],
    /// Of the greatest component, then of the least: the reciprocal that is nearer to zero first, unless signs differ.
    inverse: [f32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Sign {
    Up,
    Down,
    Both,
}

#[inline(always)]
fn row<S: Simd>(simd: S, ray: &Ray) -> S::F8 {
    let (o, d) = (ray.origin, ray.direction);
    simd.load8(&[o.x, o.y, o.z, d.x, d.y, d.z, ray.t_min, ray.t_max])
}

impl Span {
    /// Around `rays`, of which there are some.
    #[inline(always)]
    pub fn around<S: Simd>(simd: S, rays: &[Ray]) -> Self {
        let first = row(simd, &rays[0]);
        let (mut lo, mut hi) = (first, first);
        for ray in rays {
            let row = row(simd, ray);
            lo = row.or_less(lo);
            hi = row.or_greater(hi);
        }
        let (lo, hi) = (lo.to_array(), hi.to_array());
        let (mut shortest, mut widest) = (0.0, 0.0);
        let axes = [0, 1, 2].map(|axis| {
            let (least, greatest) = (lo[3 + axis], hi[3 + axis]);
            let wide = greatest - least;
            widest = if wide > widest { wide } else { widest };
            let length = if least > 0.0 { least } else { -greatest };
            shortest = if length > shortest { length } else { shortest };
            // The sign of a zero is that of the others: a ray along the faces of a box meets it or not, by either.
            let (sign, inverse) = if least >= 0.0 {
                (Sign::Up, [1.0 / greatest.abs(), 1.0 / least.abs()])
            } else if greatest <= 0.0 {
                (Sign::Down, [1.0 / least, -1.0 / greatest.abs()])
            } else {
                (Sign::Both, [1.0 / greatest, 1.0 / least])
            };
            Axis { sign, origin: [lo[axis], hi[axis]], inverse }
        });
        Self { axes, t_min: lo[6], t_max: hi[7], narrow: widest <= SPREAD_MAX * shortest }
    }

    /// Which of eight boxes a ray may meet at a distance up to `stop`, and no ray meets before which distance.
    #[inline(always)]
    pub fn meets<S: Simd>(&self, simd: S, lo: &[[f32; 8]; 3], hi: &[[f32; 8]; 3], stop: f32) -> (u32, [f32; 8]) {
        let mut entry = simd.splat8(self.t_min);
        let mut exit = simd.splat8(f32::INFINITY);
        for (i, axis) in self.axes.iter().enumerate() {
            let (least, greatest) = (simd.splat8(axis.origin[0]), simd.splat8(axis.origin[1]));
            let (small, large) = (simd.splat8(axis.inverse[0]), simd.splat8(axis.inverse[1]));
            let (lo, hi) = (simd.load8(&lo[i]), simd.load8(&hi[i]));
            let (near, far) = match axis.sign {
                Sign::Up => (lo - greatest, hi - least),
                Sign::Down => (hi - least, lo - greatest),
                Sign::Both => {
                    // Only rays that go up come in from below, and only those that go down from above: the others leave the
                    // box before they begin, unless that is so near to 0 that it is 0.
                    let (below, above, zero) = (lo - greatest, hi - least, simd.splat8(0.0));
                    let up = (below * small).select((below * large).lt(zero), zero);
                    let down = (above * large).select((above * small).lt(zero), zero);
                    entry = up.or_greater(entry);
                    entry = down.or_greater(entry);
                    continue;
                }
            };
            // What is infinite stands last: where that gives no number, nothing is bounded.
            entry = (near * small).or_less(near * large).or_greater(entry);
            exit = (far * small).or_greater(far * large).or_less(exit);
        }
        let met = entry.le(exit * simd.splat8(SLAB_WIDEN)) & entry.le(simd.splat8(stop));
        (met.bits(), entry.to_array())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_geometry::simd::Kernels;
    use hybray_geometry::simd::{Kernel, Portable};
    use hybray_geometry::{Aabb, RayKernel, Vec3};
    use std::vec::Vec;

    struct Meets<'a>(&'a [Ray], [[f32; 8]; 3], [[f32; 8]; 3], f32);

    impl Kernel for Meets<'_> {
        type Output = (u32, [f32; 8]);
        fn run<S: Simd>(self, simd: S) -> (u32, [f32; 8]) {
            Span::around(simd, self.0).meets(simd, &self.1, &self.2, self.3)
        }
    }

    /// Coordinates of which many are the same, so that rays lie in faces and along axes, with zeros of either sign.
    fn pick(random: &mut u64) -> f32 {
        *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        [-2.0, -1.0, -0.3, -0.0, 0.0, 1e-40, 1e-3, 0.3, 0.7, 1.0, 3e30, -1e-38][(*random >> 33) as usize % 12]
    }

    #[test]
    fn what_a_ray_meets_its_span_meets() {
        let (mut random, mut met, mut left_out) = (1, 0, 0);
        for round in 0..60_000 {
            let point = |random: &mut u64| Vec3::new(pick(random), pick(random), pick(random));
            let (origin, direction) = (point(&mut random), point(&mut random));
            let (mut lo, mut hi) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
            for axis in 0..3 {
                for slot in 0..8 {
                    let (a, b) = (pick(&mut random), pick(&mut random));
                    (lo[axis][slot], hi[axis][slot]) = if a < b { (a, b) } else { (b, a) };
                }
            }
            // One ray, some from one point, side by side, or anyhow.
            let rays: Vec<Ray> = (0..1 + round % 4)
                .map(|_| Ray {
                    origin: if round % 3 == 0 { point(&mut random) } else { origin },
                    direction: if round % 5 < 2 { direction } else { point(&mut random) },
                    t_min: pick(&mut random).max(0.0),
                    t_max: f32::INFINITY,
                })
                .collect();
            let stop = [f32::INFINITY, 1.0, 0.3][round % 3];
            let expected = Portable.run(Meets(&rays, lo, hi, stop));
            for kernels in Kernels::available() {
                let found = kernels.run(Meets(&rays, lo, hi, stop));
                assert_eq!(found.0, expected.0, "{kernels:?} {rays:?}");
            }
            for slot in 0..8 {
                let corner = |c: &[[f32; 8]; 3]| Vec3::new(c[0][slot], c[1][slot], c[2][slot]);
                let aabb = Aabb { lo: corner(&lo), hi: corner(&hi) };
                let is_met = expected.0 >> slot & 1 != 0;
                left_out += usize::from(!is_met);
                for ray in &rays {
                    let (near, far) = RayKernel::new(ray).slab(&aabb);
                    let near = if near > ray.t_min { near } else { ray.t_min };
                    // A ray beside a box, along it, may enter it at infinity; it hits nothing there.
                    if near <= far && near <= stop && near < f32::INFINITY {
                        assert!(is_met, "{ray:?} of {rays:?} meets {aabb:?} from {near} to {far}");
                        assert!(expected.1[slot] <= near, "{} {near}: {ray:?} of {rays:?}, {aabb:?}", expected.1[slot]);
                        met += 1;
                    }
                }
            }
        }
        assert!(met > 50_000 && left_out > 50_000, "{met} {left_out}");
    }
}
