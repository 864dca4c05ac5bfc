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
                    // Only rays that go up come in from below, and only those that go down from above.
                    let (up, down) = ((lo - greatest) * small, (hi - least) * large);
                    entry = up.or_greater(down).or_greater(entry);
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
