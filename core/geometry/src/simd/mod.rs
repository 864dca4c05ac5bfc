//! Lanes of `f32`: the one place where the instruction set matters, and where it may not matter to a single bit.
//!
//! A kernel is written once over [`Simd`] and run by [`Kernels::run`], which picks the widest set that the processor
//! has. Every operation here is the IEEE one, lane by lane, with the selection rules that [`Lanes`] states, so all
//! implementations give the same bits (tested lane by lane, NaN and signed zeros included).

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

pub use portable::{OneLane, Portable};
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

/// Some lanes of `f32`. `a` is `self`; comparisons with NaN are false.
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + core::fmt::Debug
{
    /// One truth value a lane.
    type Mask: Mask;
    /// `[f32; LANES]`.
    type Array: Copy + AsRef<[f32]> + AsMut<[f32]> + core::fmt::Debug;
    /// How many.
    const LANES: usize;
    /// `x` in every lane. A value at hand shows that the processor has these lanes.
    #[must_use]
    fn splat_like(self, x: f32) -> Self;
    /// The lanes in memory order.
    #[must_use]
    fn to_array(self) -> Self::Array;
    /// From memory.
    #[must_use]
    fn load_like(self, array: &Self::Array) -> Self;
    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Without the sign.
    #[must_use]
    fn abs(self) -> Self;
    /// `if a > b { a } else { b }`: a NaN in `a` is dropped, one in `b` stays.
    #[must_use]
    fn or_greater(self, b: Self) -> Self;
    /// `if a < b { a } else { b }`: a NaN in `a` is dropped, one in `b` stays.
    #[must_use]
    fn or_less(self, b: Self) -> Self;
    /// `a < b`
    #[must_use]
    fn lt(self, b: Self) -> Self::Mask;
    /// `a <= b`
    #[must_use]
    fn le(self, b: Self) -> Self::Mask;
    /// `a == b`
    #[must_use]
    fn equal(self, b: Self) -> Self::Mask;
    /// Lanes whose sign bit is set (-0 and negative NaN included).
    #[must_use]
    fn sign(self) -> Self::Mask;
    /// `if mask { a } else { b }`
    #[must_use]
    fn select(self, mask: Self::Mask, b: Self) -> Self;
}

/// One truth value a lane.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Bit `i` is lane `i`; higher bits are 0.
    #[must_use]
    fn bits(self) -> u32;
}

/// An instruction set, and the proof that the processor has it.
pub trait Simd: Copy {
    /// Four lanes: a block of primitives.
    type F4: Lanes<Array = [f32; 4]>;
    /// Eight lanes: a wide node's boxes.
    type F8: Lanes<Array = [f32; 8]>;
    /// Rays side by side: eight lanes or sixteen.
    type Packet: Lanes;
    /// `x` in four lanes.
    fn splat4(self, x: f32) -> Self::F4;
    /// `x` in eight lanes.
    fn splat8(self, x: f32) -> Self::F8;
    /// `x` in every lane of a packet.
    fn splat_packet(self, x: f32) -> Self::Packet;
    /// Says that `at` will be read soon: where the instruction set has a hint for that.
    #[inline(always)]
    fn fetch<T>(self, at: &T) {
        let _ = at;
    }
    /// Runs `kernel` compiled for this instruction set.
    fn run<K: Kernel>(self, kernel: K) -> K::Output;
    /// Four lanes from memory.
    #[inline(always)]
    fn load4(self, a: &[f32; 4]) -> Self::F4 {
        self.splat4(0.0).load_like(a)
    }
    /// Eight lanes from memory.
    #[inline(always)]
    fn load8(self, a: &[f32; 8]) -> Self::F8 {
        self.splat8(0.0).load_like(a)
    }
    // Closures, such as those that `map` takes, are not always inlined into code for the instruction set, and then each
    // load is a call: these spell the three axes out.
    /// Three axes of four lanes from memory.
    #[inline(always)]
    fn load4_axes(self, a: &[[f32; 4]; 3]) -> [Self::F4; 3] {
        [self.load4(&a[0]), self.load4(&a[1]), self.load4(&a[2])]
    }
    /// A point in every one of eight lanes.
    #[inline(always)]
    fn splat8_axes(self, a: [f32; 3]) -> [Self::F8; 3] {
        [self.splat8(a[0]), self.splat8(a[1]), self.splat8(a[2])]
    }
}

/// A computation written over any [`Simd`]. Mark `run`, and what it calls, `#[inline(always)]`.
pub trait Kernel {
    /// What it computes.
    type Output;
    /// Computes it with `simd`.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Which kernels to run: chosen by the program, since the core knows no processor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernels {
    /// Plain arrays: any processor.
    #[default]
    Portable,
    /// AVX2: x86-64 since about 2013.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// AVX-512: packets of 16 rays.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
}

impl Kernels {
    /// The best that this processor has.
    #[cfg(feature = "std")]
    #[must_use]
    pub fn detect() -> Self {
        Self::available().last().unwrap_or_default()
    }

    /// All that this processor has, the best last.
    #[cfg(feature = "std")]
    pub fn available() -> impl Iterator<Item = Self> {
        let portable = core::iter::once(Self::Portable);
        #[cfg(target_arch = "x86_64")]
        let portable = portable.chain(Avx2::detect().map(Self::Avx2)).chain(Avx512::detect().map(Self::Avx512));
        portable
    }

    /// `portable`, `avx2`, `avx512`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
        }
    }

    /// Runs `kernel` with these.
    #[inline(always)]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Portable => Portable.run(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(avx2) => avx2.run(kernel),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(avx512) => avx512.run(kernel),
        }
    }
}

/// The lane that scalar calls run in.
pub const ONE_LANE: OneLane = portable::Array([0.0]);

#[cfg(test)]
mod tests;
