use super::*;

const AWKWARD: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MIN_POSITIVE,
    1e-45,
    -1e-45,
    3.402_823_5e38,
    0.1,
    1.000_000_1,
    -7.5,
    1e-20,
    -1e20,
];

/// All that the lanes can do to two numbers, as bits; NaNs are made alike, since their payload is no result.
struct Everything([f32; 16], [f32; 16]);

impl Kernel for Everything {
    type Output = [[u32; 16]; 16];
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let packets = lane_by_lane(&self, simd.splat_packet(0.0));
        assert_eq!(packets, lane_by_lane(&self, simd.splat8(0.0)));
        assert_eq!(packets, lane_by_lane(&self, simd.splat4(0.0)));
        packets
    }
}

/// As many lanes at a time as there are.
#[inline(always)]
fn lane_by_lane<F: Lanes>(Everything(a, b): &Everything, like: F) -> [[u32; 16]; 16] {
    let mut all = [[0; 16]; 16];
    for first in (0..16).step_by(F::LANES) {
        let load = |from: &[f32; 16]| {
            let mut array = like.to_array();
            array.as_mut().copy_from_slice(&from[first..first + F::LANES]);
            like.load_like(&array)
        };
        let (a, b) = (load(a), load(b));
        let floats = [
            a + b,
            a - b,
            a * b,
            a / b,
            -a,
            a.abs(),
            a.abs().sqrt(),
            a.or_greater(b),
            a.or_less(b),
            a.select(a.lt(b), b),
            a.select(a.sign(), b),
        ];
        let masks = [a.lt(b), a.le(b), a.equal(b), a.sign(), !(a.lt(b) | a.equal(b)) & a.le(b)];
        for (i, x) in floats.into_iter().enumerate() {
            for (lane, x) in x.to_array().as_ref().iter().enumerate() {
                all[i][first + lane] = if x.is_nan() { 1 } else { x.to_bits() };
            }
        }
        for (i, mask) in masks.into_iter().enumerate() {
            assert_eq!(mask.bits() >> F::LANES, 0);
            for lane in 0..F::LANES {
                all[floats.len() + i][first + lane] = mask.bits() >> lane & 1;
            }
        }
    }
    all
}

#[cfg(feature = "std")]
#[test]
fn every_implementation_gives_the_portable_bits() {
    for i in 0..16 {
        for j in 0..16 {
            let a = core::array::from_fn(|k| AWKWARD[(i + k) % 16]);
            let b = core::array::from_fn(|k| AWKWARD[(j + 3 * k) % 16]);
            let portable = Kernels::Portable.run(Everything(a, b));
            for kernels in Kernels::available() {
                assert_eq!(kernels.run(Everything(a, b)), portable, "{} {a:?} {b:?}", kernels.name());
            }
        }
    }
}

#[test]
fn a_nan_in_front_is_dropped() {
    let simd = Portable;
    let (nan, one) = (simd.splat4(f32::NAN), simd.splat4(1.0));
    assert_eq!(nan.or_greater(one).to_array(), [1.0; 4]);
    assert_eq!(nan.or_less(one).to_array(), [1.0; 4]);
}
