//! Vectors and affine maps in `f64`, for scenes that are computed in `f64` and rounded to `f32` once, at the end.

/// Point, vector or colour.
pub type V = [f64; 3];

pub fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: V, s: f64) -> V {
    a.map(|x| x * s)
}

pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn length(a: V) -> f64 {
    dot(a, a).sqrt()
}

/// `a` with length 1; a zero vector stays zero.
pub fn unit(a: V) -> V {
    let l = length(a);
    if l > 0.0 { scale(a, 1.0 / l) } else { a }
}

/// Rounds to the nearest `f32`.
pub fn narrow(a: V) -> [f32; 3] {
    a.map(|x| x as f32)
}

/// `x -> m x + t`, `m` by rows.
#[derive(Clone, Copy)]
pub struct Affine {
    pub m: [V; 3],
    pub t: V,
}

impl Affine {
    pub const IDENTITY: Self = Self { m: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], t: [0.0; 3] };

    /// Turns by the angle whose cosine and sine are given, counterclockwise seen from the tip of the unit vector
    /// `axis` (Rodrigues' formula).
    pub fn turn(axis: V, cos: f64, sin: f64) -> Self {
        let [x, y, z] = axis;
        let k = 1.0 - cos;
        let m = [
            [x * x * k + cos, x * y * k - z * sin, x * z * k + y * sin],
            [x * y * k + z * sin, y * y * k + cos, y * z * k - x * sin],
            [x * z * k - y * sin, y * z * k + x * sin, z * z * k + cos],
        ];
        Self { m, t: [0.0; 3] }
    }

    /// [`Affine::turn`] by an angle in radians.
    pub fn turn_by(axis: V, angle: f64) -> Self {
        Self::turn(axis, libm::cos(angle), libm::sin(angle))
    }

    pub fn apply(&self, v: V) -> V {
        add([dot(self.m[0], v), dot(self.m[1], v), dot(self.m[2], v)], self.t)
    }

    /// First `other`, then `self`.
    pub fn after(&self, other: &Self) -> Self {
        let column = |j: usize| [other.m[0][j], other.m[1][j], other.m[2][j]];
        let row = |i: usize| [0, 1, 2].map(|j| dot(self.m[i], column(j)));
        Self { m: [row(0), row(1), row(2)], t: self.apply(other.t) }
    }
}

pub const X: V = [1.0, 0.0, 0.0];
pub const Y: V = [0.0, 1.0, 0.0];
pub const Z: V = [0.0, 0.0, 1.0];

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::FRAC_PI_2;

    fn near(a: V, b: V) {
        assert!(length(sub(a, b)) < 1e-15, "{a:?} {b:?}");
    }

    #[test]
    fn quarter_turns() {
        near(Affine::turn_by(Z, FRAC_PI_2).apply(X), Y);
        near(Affine::turn_by(X, FRAC_PI_2).apply(Y), Z);
        near(Affine::turn_by(Y, FRAC_PI_2).apply(Z), X);
        // A third of a turn about the diagonal moves each axis to the next.
        let third = Affine::turn(unit([1.0; 3]), -0.5, 0.75_f64.sqrt());
        near(third.apply(X), Y);
    }

    #[test]
    fn maps_follow_one_another() {
        let lift = Affine { t: [0.0, 0.0, 1.0], ..Affine::IDENTITY };
        let turn = Affine::turn_by(X, FRAC_PI_2);
        near(turn.after(&lift).apply([0.0; 3]), scale(Y, -1.0));
        near(lift.after(&turn).apply([0.0; 3]), Z);
        near(lift.after(&turn).apply(Y), [0.0, 0.0, 2.0]);
    }
}
