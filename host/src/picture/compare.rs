//! How far one picture is from another.

use super::Picture;

/// Beneath this, a reference is taken as this dark, so that black does not divide by nothing (relMSE as Rousselle, Knaus and
/// Zwicker have it, *Adaptive Sampling and Reconstruction using Greedy Error Minimization*, 2011).
const DARKEST_SQUARE: f64 = 0.01;

/// What [`difference`] finds, of linear values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Root of the mean square difference, over all channels.
    pub rmse: f64,
    /// Mean of square differences, each divided by the reference's square plus 0.01.
    pub relative_mse: f64,
    /// The pixel with the greatest difference in a channel: column and row, from 0.
    pub worst: [u32; 2],
    /// That difference.
    pub worst_by: f64,
    /// Channels that differ at all.
    pub differing: u64,
    /// Channels that are no finite number in one of the pictures; they count as 0.
    pub not_finite: u64,
}

/// How far `test` is from `reference`, which is of the same size.
///
/// # Panics
/// If it is not.
#[must_use]
pub fn difference(reference: &Picture, test: &Picture) -> Difference {
    assert_eq!([reference.width, reference.height], [test.width, test.height]);
    let mut found =
        Difference { rmse: 0.0, relative_mse: 0.0, worst: [0; 2], worst_by: 0.0, differing: 0, not_finite: 0 };
    for (i, (&a, &b)) in reference.rgb.iter().zip(&test.rgb).enumerate() {
        found.differing += u64::from(a != b);
        found.not_finite += u64::from(!(a.is_finite() && b.is_finite()));
        let [a, b] = [a, b].map(|x| if x.is_finite() { f64::from(x) } else { 0.0 });
        let by = (a - b).abs();
        found.rmse += by * by;
        found.relative_mse += by * by / (a * a + DARKEST_SQUARE);
        if by > found.worst_by {
            let pixel = (i / 3) as u32;
            (found.worst, found.worst_by) = ([pixel % reference.width, pixel / reference.width], by);
        }
    }
    let count = reference.rgb.len().max(1) as f64;
    found.rmse = (found.rmse / count).sqrt();
    found.relative_mse /= count;
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_by_hand() {
        let picture = |rgb: [f32; 6]| Picture { width: 2, height: 1, rgb: rgb.to_vec() };
        let a = picture([0.0, 0.5, 1.0, 0.0, 0.0, 3.0]);
        let none = difference(&a, &a);
        assert_eq!((none.rmse, none.relative_mse, none.worst_by, none.differing), (0.0, 0.0, 0.0, 0));
        let b = picture([0.0, 0.5, 0.0, 0.0, 0.5, 5.0]);
        let found = difference(&a, &b);
        assert!((found.rmse - (5.25f64 / 6.0).sqrt()).abs() < 1e-12);
        assert!((found.relative_mse - (1.0 / 1.01 + 0.25 / 0.01 + 4.0 / 9.01) / 6.0).abs() < 1e-12);
        assert_eq!((found.worst, found.worst_by, found.differing, found.not_finite), ([1, 0], 2.0, 3, 0));
        let c = picture([f32::NAN, 0.5, 1.0, f32::INFINITY, 0.0, 3.0]);
        let found = difference(&a, &c);
        assert_eq!((found.rmse, found.differing, found.not_finite), (0.0, 2, 2));
    }
}
