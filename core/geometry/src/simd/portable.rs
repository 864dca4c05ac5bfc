//! Lanes as arrays: what every other implementation must agree with.

use super::{Kernel, Lanes, Mask, Simd};
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Any processor. The compiler makes vectors of it where it can.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

/// `N` lanes in an array.
#[derive(Clone, Copy, Debug)]
pub struct Array<const N: usize>(pub(super) [f32; N]);

/// One lane.
pub type OneLane = Array<1>;

/// `N` truth values in an array.
#[derive(Clone, Copy, Debug)]
pub struct Truths<const N: usize>([bool; N]);

impl Simd for Portable {
    type F4 = Array<4>;
    type F8 = Array<8>;
    type Packet = Array<8>;
    #[inline(always)]
    fn splat4(self, x: f32) -> Array<4> {
        Array([x; 4])
    }
    #[inline(always)]
    fn splat8(self, x: f32) -> Array<8> {
        Array([x; 8])
    }
    #[inline(always)]
    fn splat_packet(self, x: f32) -> Array<8> {
        Array([x; 8])
    }
    #[inline]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }
}

impl<const N: usize> Array<N> {
    #[inline(always)]
    fn zip(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(core::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
    #[inline(always)]
    fn compare(self, b: Self, f: impl Fn(f32, f32) -> bool) -> Truths<N> {
        Truths(core::array::from_fn(|i| f(self.0[i], b.0[i])))
    }
}

macro_rules! operator {
    ($trait:ident $method:ident $op:tt) => {
        impl<const N: usize> $trait for Array<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, b: Self) -> Self {
                self.zip(b, |a, b| a $op b)
            }
        }
    };
}
operator!(Add add +);
operator!(Sub sub -);
operator!(Mul mul *);
operator!(Div div /);

impl<const N: usize> Neg for Array<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl<const N: usize> Lanes for Array<N> {
    type Mask = Truths<N>;
    type Array = [f32; N];
    const LANES: usize = N;
    #[inline(always)]
    fn splat_like(self, x: f32) -> Self {
        Self([x; N])
    }
    #[inline(always)]
    fn to_array(self) -> [f32; N] {
        self.0
    }
    #[inline(always)]
    fn load_like(self, array: &[f32; N]) -> Self {
        Self(*array)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(libm::sqrtf))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f32::abs))
    }
    #[inline(always)]
    fn or_greater(self, b: Self) -> Self {
        self.zip(b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn or_less(self, b: Self) -> Self {
        self.zip(b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Truths<N> {
        self.compare(b, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, b: Self) -> Truths<N> {
        self.compare(b, |a, b| a <= b)
    }
    #[inline(always)]
    fn equal(self, b: Self) -> Truths<N> {
        self.compare(b, |a, b| a == b)
    }
    #[inline(always)]
    fn sign(self) -> Truths<N> {
        Truths(self.0.map(f32::is_sign_negative))
    }
    #[inline(always)]
    fn select(self, mask: Truths<N>, b: Self) -> Self {
        Self(core::array::from_fn(|i| if mask.0[i] { self.0[i] } else { b.0[i] }))
    }
}

impl<const N: usize> Mask for Truths<N> {
    #[inline(always)]
    fn bits(self) -> u32 {
        let mut bits = 0;
        for i in 0..N {
            bits |= u32::from(self.0[i]) << i;
        }
        bits
    }
}
impl<const N: usize> BitAnd for Truths<N> {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i] & b.0[i]))
    }
}
impl<const N: usize> BitOr for Truths<N> {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(core::array::from_fn(|i| self.0[i] | b.0[i]))
    }
}
impl<const N: usize> Not for Truths<N> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.map(|b| !b))
    }
}
