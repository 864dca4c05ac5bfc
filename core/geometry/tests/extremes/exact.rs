//! Arithmetic with about 106 bits (Dekker, 1971): what `f32` results are measured against.

use hybray_geometry::Vec3;
use std::ops::{Add, Div, Mul, Sub};

/// The sum of two `f64`, the second less than an ulp of the first.
#[derive(Clone, Copy, Debug)]
pub struct Wide(f64, f64);

fn two_sum(a: f64, b: f64) -> Wide {
    let s = a + b;
    let t = s - a;
    Wide(s, (a - (s - t)) + (b - t))
}

impl From<f32> for Wide {
    fn from(x: f32) -> Self {
        Self(f64::from(x), 0.0)
    }
}

impl From<Wide> for f64 {
    fn from(x: Wide) -> Self {
        x.0 + x.1
    }
}

impl Add for Wide {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        let (high, low) = (two_sum(self.0, b.0), two_sum(self.1, b.1));
        let s = two_sum(high.0, high.1 + low.0);
        two_sum(s.0, s.1 + low.1)
    }
}

impl Sub for Wide {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + Self(-b.0, -b.1)
    }
}

impl Mul for Wide {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let p = self.0 * b.0;
        two_sum(p, self.0.mul_add(b.0, -p) + (self.0 * b.1 + self.1 * b.0))
    }
}

impl Div for Wide {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let mut rest = self;
        let mut sum = Self(0.0, 0.0);
        for _ in 0..3 {
            let q = Self(rest.0 / b.0, 0.0);
            sum = sum + q;
            rest = rest - b * q;
        }
        sum
    }
}

impl Wide {
    pub const ZERO: Self = Self(0.0, 0.0);

    /// Of 0 or more.
    pub fn sqrt(self) -> Self {
        if self.0 <= 0.0 {
            return Self::ZERO;
        }
        let x = Self(self.0.sqrt(), 0.0);
        x + (self - x * x) / (x + x)
    }
}

/// A vector of them.
#[derive(Clone, Copy, Debug)]
pub struct Wide3([Wide; 3]);

impl From<Vec3> for Wide3 {
    fn from(v: Vec3) -> Self {
        Self(v.to_array().map(Wide::from))
    }
}

impl Add for Wide3 {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + b.0[i]))
    }
}

impl Sub for Wide3 {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - b.0[i]))
    }
}

impl Wide3 {
    pub fn dot(self, b: Self) -> Wide {
        self.0[0] * b.0[0] + self.0[1] * b.0[1] + self.0[2] * b.0[2]
    }

    pub fn cross(self, b: Self) -> Self {
        let at = |i: usize, j: usize| self.0[i] * b.0[j] - self.0[j] * b.0[i];
        Self([at(1, 2), at(2, 0), at(0, 1)])
    }

    pub fn times(self, s: Wide) -> Self {
        Self(self.0.map(|x| x * s))
    }

    pub fn abs(self) -> [f64; 3] {
        self.0.map(|x| f64::from(x).abs())
    }
}

#[test]
fn a_third_has_100_bits() {
    let third = Wide::from(1.0) / Wide::from(3.0);
    let off = third * Wide::from(3.0) - Wide::from(1.0);
    assert!(f64::from(off).abs() < 1e-30, "{off:?}");
    let root = Wide::from(2.0).sqrt();
    assert!(f64::from(root * root - Wide::from(2.0)).abs() < 1e-30);
    assert!(third.1 != 0.0 && root.1 != 0.0);
}
