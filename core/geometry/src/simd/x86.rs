//! Lanes as AVX registers. The crate's only unsafe code: intrinsics, which are sound where the processor has them.
#![allow(unsafe_code)]

use super::{Kernel, Lanes, Mask, Simd};
use core::arch::x86_64::*;
use core::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// AVX2, and the proof that the processor has it: only [`Avx2::detect`] makes one safely, and every value of the lane
/// types below comes from one, or from another value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

impl Avx2 {
    /// One if this processor, and its operating system, have AVX2.
    #[cfg(feature = "std")]
    #[must_use]
    pub fn detect() -> Option<Self> {
        std::is_x86_feature_detected!("avx2").then_some(Self(()))
    }
}

#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(avx2: Avx2, kernel: K) -> K::Output {
    kernel.run(avx2)
}

impl Simd for Avx2 {
    type F4 = X4;
    type F8 = X8;
    type Packet = X8;
    #[inline(always)]
    fn splat4(self, x: f32) -> X4 {
        // SAFETY: `self` shows that the processor has AVX.
        X4(unsafe { _mm_set1_ps(x) })
    }
    #[inline(always)]
    fn splat8(self, x: f32) -> X8 {
        // SAFETY: `self` shows that the processor has AVX.
        X8(unsafe { _mm256_set1_ps(x) })
    }
    #[inline(always)]
    fn fetch<T>(self, at: &T) {
        let at: *const T = at;
        for line in 0..size_of::<T>().div_ceil(64) {
            // SAFETY: a hint reads nothing.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast::<i8>().wrapping_add(64 * line)) }
        }
    }
    #[inline(always)]
    fn splat_packet(self, x: f32) -> X8 {
        self.splat8(x)
    }
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: `self` shows that the processor has AVX2.
        unsafe { with_avx2(self, kernel) }
    }
}

/// AVX-512 (F, VL, BW and DQ: x86-64 servers since 2017, Zen 4): as AVX2, but 16 rays go side by side. Other lanes stay as
/// they are: eight boxes fill no wider register, and single rays gain nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512(Avx2);

impl Avx512 {
    /// One if this processor, and its operating system, have AVX-512.
    #[cfg(feature = "std")]
    #[must_use]
    pub fn detect() -> Option<Self> {
        let has = std::is_x86_feature_detected!("avx512f")
            && std::is_x86_feature_detected!("avx512vl")
            && std::is_x86_feature_detected!("avx512bw")
            && std::is_x86_feature_detected!("avx512dq");
        Avx2::detect().filter(|_| has).map(Self)
    }
}

#[target_feature(enable = "avx2,avx512f,avx512vl,avx512bw,avx512dq")]
fn with_avx512<K: Kernel>(avx512: Avx512, kernel: K) -> K::Output {
    kernel.run(avx512)
}

impl Simd for Avx512 {
    type F4 = X4;
    type F8 = X8;
    type Packet = X16;
    #[inline(always)]
    fn splat4(self, x: f32) -> X4 {
        self.0.splat4(x)
    }
    #[inline(always)]
    fn splat8(self, x: f32) -> X8 {
        self.0.splat8(x)
    }
    #[inline(always)]
    fn fetch<T>(self, at: &T) {
        self.0.fetch(at);
    }
    #[inline(always)]
    fn splat_packet(self, x: f32) -> X16 {
        // SAFETY: `self` shows that the processor has AVX-512.
        X16(unsafe { _mm512_set1_ps(x) })
    }
    #[inline(always)]
    fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: `self` shows that the processor has all of these.
        unsafe { with_avx512(self, kernel) }
    }
}

/// What a register does alike in every width.
macro_rules! arithmetic {
    ($name:ident $register:ident $set1:ident $add:ident $sub:ident $mul:ident $div:ident $xor:ident) => {
        /// Lanes in one register.
        #[derive(Clone, Copy, Debug)]
        pub struct $name($register);

        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $add(self.0, b.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $sub(self.0, b.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $mul(self.0, b.0) })
            }
        }
        impl Div for $name {
            type Output = Self;
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $div(self.0, b.0) })
            }
        }
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $xor(self.0, $set1(-0.0)) })
            }
        }
    };
}

/// The rest of what `Lanes` asks for, but for masks.
macro_rules! lanes {
    ($n:literal $mask:ident
     $set1:ident $load:ident $store:ident $sqrt:ident $max:ident $min:ident $andnot:ident) => {
        type Mask = $mask;
        type Array = [f32; $n];
        const LANES: usize = $n;
        #[inline(always)]
        fn splat_like(self, x: f32) -> Self {
            // SAFETY: a value of this type shows that the processor has AVX.
            Self(unsafe { $set1(x) })
        }
        #[inline(always)]
        fn to_array(self) -> [f32; $n] {
            let mut array = [0.0; $n];
            // SAFETY: as above, and the array has room for all lanes.
            unsafe { $store(array.as_mut_ptr(), self.0) };
            array
        }
        #[inline(always)]
        fn load_like(self, array: &[f32; $n]) -> Self {
            // SAFETY: as above, and the array has all lanes.
            Self(unsafe { $load(array.as_ptr()) })
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: a value of this type shows that the processor has AVX.
            Self(unsafe { $sqrt(self.0) })
        }
        #[inline(always)]
        fn abs(self) -> Self {
            // SAFETY: a value of this type shows that the processor has AVX.
            Self(unsafe { $andnot($set1(-0.0), self.0) })
        }
        #[inline(always)]
        fn or_greater(self, b: Self) -> Self {
            // MAXPS is `a > b ? a : b`, its second operand where either is NaN.
            // SAFETY: a value of this type shows that the processor has AVX.
            Self(unsafe { $max(self.0, b.0) })
        }
        #[inline(always)]
        fn or_less(self, b: Self) -> Self {
            // SAFETY: a value of this type shows that the processor has AVX.
            Self(unsafe { $min(self.0, b.0) })
        }
    };
}

/// Masks as registers: all ones or all zeros in each lane.
macro_rules! masked {
    ($name:ident $mask:ident $register:ident $n:literal $set1:ident $load:ident $store:ident $sqrt:ident $max:ident $min:ident
     $cmp:ident $and:ident $or:ident $xor:ident $andnot:ident $blend:ident $movemask:ident) => {
        /// All ones or all zeros in each lane of a register.
        #[derive(Clone, Copy, Debug)]
        pub struct $mask($register);

        impl Lanes for $name {
            lanes!($n $mask $set1 $load $store $sqrt $max $min $andnot);
            #[inline(always)]
            fn lt(self, b: Self) -> $mask {
                // SAFETY: a value of this type shows that the processor has AVX.
                $mask(unsafe { $cmp::<_CMP_LT_OQ>(self.0, b.0) })
            }
            #[inline(always)]
            fn le(self, b: Self) -> $mask {
                // SAFETY: a value of this type shows that the processor has AVX.
                $mask(unsafe { $cmp::<_CMP_LE_OQ>(self.0, b.0) })
            }
            #[inline(always)]
            fn equal(self, b: Self) -> $mask {
                // SAFETY: a value of this type shows that the processor has AVX.
                $mask(unsafe { $cmp::<_CMP_EQ_OQ>(self.0, b.0) })
            }
            #[inline(always)]
            fn sign(self) -> $mask {
                // Blends and MOVMSKPS look at sign bits alone.
                $mask(self.0)
            }
            #[inline(always)]
            fn select(self, mask: $mask, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $blend(b.0, self.0, mask.0) })
            }
        }

        impl Mask for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                // SAFETY: a value of this type shows that the processor has AVX.
                unsafe { $movemask(self.0) as u32 }
            }
        }
        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $and(self.0, b.0) })
            }
        }
        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, b: Self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $or(self.0, b.0) })
            }
        }
        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: a value of this type shows that the processor has AVX.
                Self(unsafe { $xor(self.0, $set1(f32::from_bits(u32::MAX))) })
            }
        }
    };
}

arithmetic!(X4 __m128 _mm_set1_ps _mm_add_ps _mm_sub_ps _mm_mul_ps _mm_div_ps _mm_xor_ps);
arithmetic!(X8 __m256 _mm256_set1_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_xor_ps);
arithmetic!(X16 __m512 _mm512_set1_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_xor_ps);
masked!(X4 M4 __m128 4 _mm_set1_ps _mm_loadu_ps _mm_storeu_ps _mm_sqrt_ps _mm_max_ps _mm_min_ps
    _mm_cmp_ps _mm_and_ps _mm_or_ps _mm_xor_ps _mm_andnot_ps _mm_blendv_ps _mm_movemask_ps);
masked!(X8 M8 __m256 8 _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_sqrt_ps _mm256_max_ps _mm256_min_ps
    _mm256_cmp_ps _mm256_and_ps _mm256_or_ps _mm256_xor_ps _mm256_andnot_ps _mm256_blendv_ps _mm256_movemask_ps);

/// A bit for each of 16 lanes.
#[derive(Clone, Copy, Debug)]
pub struct M16(__mmask16);

impl Lanes for X16 {
    lanes!(16 M16 _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_sqrt_ps _mm512_max_ps _mm512_min_ps _mm512_andnot_ps);
    #[inline(always)]
    fn lt(self, b: Self) -> M16 {
        // SAFETY: a value of this type shows that the processor has AVX-512.
        M16(unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn le(self, b: Self) -> M16 {
        // SAFETY: a value of this type shows that the processor has AVX-512.
        M16(unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn equal(self, b: Self) -> M16 {
        // SAFETY: a value of this type shows that the processor has AVX-512.
        M16(unsafe { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, b.0) })
    }
    #[inline(always)]
    fn sign(self) -> M16 {
        // SAFETY: a value of this type shows that the processor has AVX-512, DQ included.
        M16(unsafe { _mm512_movepi32_mask(_mm512_castps_si512(self.0)) })
    }
    #[inline(always)]
    fn select(self, mask: M16, b: Self) -> Self {
        // SAFETY: a value of this type shows that the processor has AVX-512.
        Self(unsafe { _mm512_mask_blend_ps(mask.0, b.0, self.0) })
    }
}

impl Mask for M16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}
impl BitAnd for M16 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(self.0 & b.0)
    }
}
impl BitOr for M16 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(self.0 | b.0)
    }
}
impl Not for M16 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}
