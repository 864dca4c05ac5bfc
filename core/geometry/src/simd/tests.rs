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
struct Everything([f32; 8], [f32; 8]);

impl Kernel for Everything {
    type Output = [[u32; 8]; 16];
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let (a, b) = (simd.load8(&self.0), simd.load8(&self.1));
        let float = |x: S::F8| x.to_array().map(|x| if x.is_nan() { 1 } else { x.to_bits() });
        let truth = |m: <S::F8 as Lanes>::Mask| core::array::from_fn(|i| m.bits() >> i & 1);
        [
            float(a + b),
            float(a - b),
            float(a * b),
            float(a / b),
            float(-a),
            float(a.abs()),
            float(a.abs().sqrt()),
            float(a.or_greater(b)),
            float(a.or_less(b)),
            truth(a.lt(b)),
            truth(a.le(b)),
            truth(a.equal(b)),
            truth(a.sign()),
            truth(!(a.lt(b) | a.equal(b)) & a.le(b)),
            float(a.select(a.lt(b), b)),
            float(a.select(a.sign(), b)),
        ]
    }
}

#[cfg(feature = "std")]
#[test]
fn every_implementation_gives_the_portable_bits() {
    for i in 0..16 {
        for j in 0..16 {
            let a = core::array::from_fn(|k| AWKWARD[(i + k) % 16]);
            let b = core::array::from_fn(|k| AWKWARD[(j + 3 * k) % 16]);
            assert_eq!(Kernels::detect().run(Everything(a, b)), Kernels::Portable.run(Everything(a, b)), "{a:?} {b:?}");
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
