//! Pixel filters, sampled in proportion to their value.
//!
//! A sample adds to its own pixel only, with weight 1, wherever the filter puts it (Ernst, Stamminger, Greiner, *Filter
//! Importance Sampling*, RT 2006): a tile's accumulators are then its own. All three filters are products of one
//! function of x and one of y.

use crate::stratify::stratified;

/// A pixel filter. Distances are in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Filter {
    /// Even over the pixel's own square: radius 0.5.
    #[default]
    Box = 0,
    /// Falls linearly to 0 at the next pixel's centre: radius 1.
    Tent = 1,
    /// Normal distribution of deviation 0.5, cut off at three deviations: radius 1.5.
    Gaussian = 2,
}

impl Filter {
    /// The filter called `box`, `tent` or `gaussian`.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        [Self::Box, Self::Tent, Self::Gaussian].into_iter().find(|filter| filter.name() == name)
    }

    /// What [`Filter::parse`] reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Tent => "tent",
            Self::Gaussian => "gaussian",
        }
    }

    /// The filter whose number (`as u32`) this is.
    #[must_use]
    pub const fn from_u32(number: u32) -> Option<Self> {
        match number {
            0 => Some(Self::Box),
            1 => Some(Self::Tent),
            2 => Some(Self::Gaussian),
            _ => None,
        }
    }

    /// No offset is larger than this along either axis, pixels.
    #[must_use]
    pub const fn radius(self) -> f32 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian => 1.5,
        }
    }

    /// Offset from the pixel's centre, pixels, distributed as the filter's value if `u` is uniform in `0.0..1.0`.
    #[must_use]
    pub fn offset(self, u: [f32; 2]) -> [f32; 2] {
        u.map(|u| {
            let offset = match self {
                Self::Box => u - 0.5,
                Self::Tent => tent(u),
                Self::Gaussian => 0.5 * normal_quantile((u - 0.5) * WITHIN_THREE_DEVIATIONS),
            };
            offset.clamp(-self.radius(), self.radius())
        })
    }
}

/// Where sample `sample` of the `spp` samples of a pixel goes: offset from the pixel's centre, pixels.
///
/// `pixel_id` is the same for all samples of the pixel ([`id::pixel_id`](crate::id::pixel_id)). One sample goes through
/// the centre; more are stratified, for every `spp`.
#[must_use]
pub fn sample_offset(filter: Filter, pixel_id: u64, sample: u32, spp: u32) -> [f32; 2] {
    if spp <= 1 { [0.0; 2] } else { filter.offset(stratified(pixel_id, sample, spp)) }
}

fn tent(u: f32) -> f32 {
    if u < 0.5 { libm::sqrtf(2.0 * u) - 1.0 } else { 1.0 - libm::sqrtf(2.0 * (1.0 - u)) }
}

/// Share of a normal distribution within three deviations.
const WITHIN_THREE_DEVIATIONS: f32 = 0.997_300_2;

/// Inverse of the normal distribution at probability `q + 0.5`, for `|q|` up to 0.4999.
///
/// Source: Wichura, *Algorithm AS 241: The Percentage Points of the Normal Distribution*, Applied Statistics 37, 1988,
/// PPND7 (accurate to about 1 in 10^7), without its branch for probabilities below e^-25.
fn normal_quantile(q: f32) -> f32 {
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        let above = ((59.109_375 * r + 159.291_13) * r + 50.434_27) * r + 3.387_132_7;
        let below = ((67.187_56 * r + 78.757_76) * r + 17.895_17) * r + 1.0;
        return q * above / below;
    }
    let r = libm::sqrtf(-libm::logf(0.5 - q.abs())) - 1.6;
    let above = ((0.170_238_21 * r + 1.306_728_5) * r + 2.756_815_4) * r + 1.423_437_3;
    let below = (0.120_211_33 * r + 0.737_001_64) * r + 1.0;
    (above / below).copysign(q)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of the filter's value left of `x`, by formulas of its own.
    fn cumulative(filter: Filter, x: f64) -> f64 {
        match filter {
            Filter::Box => x + 0.5,
            Filter::Tent if x < 0.0 => (1.0 + x) * (1.0 + x) / 2.0,
            Filter::Tent => 1.0 - (1.0 - x) * (1.0 - x) / 2.0,
            Filter::Gaussian => {
                let normal = |z: f64| libm::erf(z / core::f64::consts::SQRT_2);
                0.5 + 0.5 * normal(x / 0.5) / normal(3.0)
            }
        }
    }

    const ALL: [Filter; 3] = [Filter::Box, Filter::Tent, Filter::Gaussian];

    #[test]
    fn offset_inverts_the_cumulative_distribution() {
        for filter in ALL {
            for i in 0..100_000u32 {
                let u = i as f32 / 100_000.0;
                let [x, y] = filter.offset([u, 1.0 - u]);
                assert!(x.abs() <= filter.radius() && y.abs() <= filter.radius());
                let back = cumulative(filter, f64::from(x));
                assert!((back - f64::from(u)).abs() < 3e-7, "{filter:?}: {u} gives {x}, which gives {back}");
            }
            let end = 1.0 - 1.0 / 16_777_216.0;
            let [low, high] = filter.offset([0.0, end]);
            assert!(low >= -filter.radius() && low < -0.999 * filter.radius(), "{filter:?} {low}");
            assert!(high <= filter.radius() && high > 0.999 * filter.radius(), "{filter:?} {high}");
        }
    }

    fn check_moments(filter: Filter, spp: u32, variance: f64) {
        let (mut sum, mut square, mut cross, mut bins) = ([0.0; 2], [0.0; 2], 0.0, [[0u32; 16]; 2]);
        let pixels = 40_000 / spp;
        for pixel in 0..pixels {
            for sample in 0..spp {
                let offset = sample_offset(filter, crate::id::pixel_id(1, pixel), sample, spp).map(f64::from);
                for axis in 0..2 {
                    sum[axis] += offset[axis];
                    square[axis] += offset[axis] * offset[axis];
                    bins[axis][(cumulative(filter, offset[axis]) * 16.0).clamp(0.0, 15.0) as usize] += 1;
                }
                cross += offset[0] * offset[1];
            }
        }
        let n = f64::from(pixels * spp);
        for axis in 0..2 {
            // Stratification only narrows these: bounds of four deviations of independent samples.
            assert!((sum[axis] / n).abs() < 4.0 * (variance / n).sqrt(), "{filter:?} {spp}: mean {}", sum[axis] / n);
            assert!((square[axis] / n / variance - 1.0).abs() < 0.04, "{filter:?} {spp}: {}", square[axis] / n);
            for count in bins[axis] {
                let expected = n / 16.0;
                assert!((f64::from(count) - expected).abs() < 5.0 * expected.sqrt(), "{filter:?} {spp}: {bins:?}");
            }
        }
        assert!((cross / n).abs() < 5.0 * variance / n.sqrt(), "{filter:?} {spp}: covariance {}", cross / n);
    }

    #[test]
    fn samples_have_the_filters_moments_and_histogram() {
        // A normal distribution cut at three deviations keeps 1 - 6 phi(3) / (2 Phi(3) - 1) of its variance.
        let gaussian = 0.25 * (1.0 - 6.0 * 0.004_431_848_411_938 / 0.997_300_203_936_740);
        for spp in [2, 3, 4, 7, 16, 64] {
            check_moments(Filter::Box, spp, 1.0 / 12.0);
            check_moments(Filter::Tent, spp, 1.0 / 6.0);
            check_moments(Filter::Gaussian, spp, gaussian);
        }
    }

    #[test]
    fn one_sample_is_the_centre() {
        for filter in ALL {
            assert_eq!(sample_offset(filter, 1234, 0, 1), [0.0; 2]);
            assert_eq!(sample_offset(filter, 1234, 0, 0), [0.0; 2]);
        }
    }

    #[test]
    fn names_and_numbers_round_trip() {
        for filter in ALL {
            assert_eq!(Filter::parse(filter.name()), Some(filter));
            assert_eq!(Filter::from_u32(filter as u32), Some(filter));
        }
        assert_eq!(Filter::parse("sinc"), None);
        assert_eq!(Filter::from_u32(3), None);
    }
}
