//! The difference that a person sees who flips between two pictures.
//!
//! Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild, *FLIP: A Difference Evaluator for Alternating Images*, HPG 2020;
//! sections and equations of that paper.

use super::Picture;
use rayon::prelude::*;

/// Pixels in a degree of what is seen: 0.7 m from a screen of 3,840 pixels in 0.7 m (section 3).
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// One value of each kind for every pixel, row by row.
type Plane = Vec<f32>;
type Colour = [f32; 3];

/// Exponent and break of how colour differences are spread (section 5.1.4).
const COLOUR_EXPONENT: f32 = 0.7;
const BREAK: f32 = 0.4;
const AT_BREAK: f32 = 0.95;
/// Exponent of feature differences, and the width of a feature in degrees (section 5.2).
const FEATURE_EXPONENT: f32 = 0.5;
const FEATURE_WIDTH: f32 = 0.082;

/// What stands for white.
const WHITE: Colour = xyz([1.0; 3]);

/// Linear Rec. 709 to CIE XYZ.
const fn xyz([r, g, b]: Colour) -> Colour {
    [
        (10_135_552.0 * r + 8_788_810.0 * g + 4_435_075.0 * b) / 24_577_794.0,
        (2_613_072.0 * r + 8_788_810.0 * g + 887_015.0 * b) / 12_288_897.0,
        (1_425_312.0 * r + 8_788_810.0 * g + 70_074_185.0 * b) / 73_733_382.0,
    ]
}

fn linear([x, y, z]: Colour) -> Colour {
    [
        3.241_003_4 * x - 1.537_398_9 * y - 0.498_615_9 * z,
        -0.969_224_3 * x + 1.875_93 * y + 0.041_554_227 * z,
        0.055_639_42 * x - 0.204_011_2 * y + 1.057_149 * z,
    ]
}

/// Opponent colours that a linear filter may act on (section 5.1.1).
fn opponent(rgb: Colour) -> Colour {
    let [x, y, z] = relative(xyz(rgb));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn of_opponent([y, cx, cz]: Colour) -> Colour {
    let y = (y + 16.0) / 116.0;
    linear([(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]])
}

fn relative(xyz: Colour) -> Colour {
    [0, 1, 2].map(|i| xyz[i] / WHITE[i])
}

/// CIE L*a*b* with the adjustment for how colourful what is bright looks (section 5.1.3).
fn lab(rgb: Colour) -> Colour {
    let delta = 6.0 / 29.0_f32;
    let [x, y, z] = relative(xyz(rgb))
        .map(|t| if t > delta * delta * delta { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// The distance for large colour differences (section 5.1.3).
fn distance(a: Colour, b: Colour) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Of each pixel, from 0 for none to 1: a difference seen by who looks at `pixels_per_degree` of `test` and `reference`. Values are
/// clamped to 0..=1 before.
#[must_use]
pub fn flip(reference: &Picture, test: &Picture, pixels_per_degree: f32) -> Vec<f32> {
    let size = [reference.width as usize, reference.height as usize];
    let [a, b] = [reference, test].map(|picture| Seen::new(picture, size, pixels_per_degree));
    let farthest = distance(lab([0.0, 1.0, 0.0]), lab([0.0, 0.0, 1.0])).powf(COLOUR_EXPONENT);
    (0..size[0] * size[1])
        .into_par_iter()
        .map(|i| {
            let colour = distance(a.colour[i], b.colour[i]).powf(COLOUR_EXPONENT);
            let breaks = BREAK * farthest;
            let colour = if colour < breaks {
                AT_BREAK * colour / breaks
            } else {
                AT_BREAK + (colour - breaks) / (farthest - breaks) * (1.0 - AT_BREAK)
            };
            let feature = (a.edge[i] - b.edge[i]).abs().max((a.point[i] - b.point[i]).abs());
            colour.powf(1.0 - (feature / 2.0_f32.sqrt()).powf(FEATURE_EXPONENT))
        })
        .collect()
}

/// A picture as it is seen.
struct Seen {
    colour: Vec<Colour>,
    /// How strong an edge, and a point, are around each pixel.
    edge: Plane,
    point: Plane,
}

impl Seen {
    fn new(picture: &Picture, size: [usize; 2], pixels_per_degree: f32) -> Self {
        let opponents: Vec<Colour> = picture
            .rgb
            .par_chunks_exact(3)
            // What is no number is black.
            .map(|p| opponent([p[0], p[1], p[2]].map(|c| if c > 0.0 { c.min(1.0) } else { 0.0 })))
            .collect();
        let plane = |channel: usize| -> Plane { opponents.iter().map(|c| c[channel]).collect() };
        // Contrast sensitivity as sums of Gaussians of these weights and widths (table 1).
        let sensitive = |channel: usize, gaussians: &[[f32; 2]]| -> Plane {
            let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
            let kernels: Vec<(f32, Vec<f32>)> = gaussians
                .iter()
                .map(|[weight, width]| {
                    let at = |x: f32| (-PI * PI * (x / pixels_per_degree) * (x / pixels_per_degree) / width).exp();
                    // The factor of one dimension, as the authors' program has it.
                    (weight * (PI / width).sqrt(), kernel(radius, at))
                })
                .collect();
            let total: f32 = kernels.iter().map(|(weight, kernel)| weight * square(kernel.iter().sum())).sum();
            let from = plane(channel);
            let parts = kernels.iter().map(|(weight, kernel)| {
                let mut part = filter(&from, size, kernel, kernel);
                part.iter_mut().for_each(|x| *x *= weight / total);
                part
            });
            parts.reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect()).unwrap_or_default()
        };
        let [y, cx, cz] = [
            sensitive(0, &[[1.0, 0.0047]]),
            sensitive(1, &[[1.0, 0.0053]]),
            sensitive(2, &[[34.1, 0.04], [13.5, 0.025]]),
        ];
        let colour = (0..y.len())
            .into_par_iter()
            .map(|i| lab(of_opponent([y[i], cx[i], cz[i]]).map(|c| c.clamp(0.0, 1.0))))
            .collect();

        let grey: Plane = opponents.iter().map(|c| (c[0] + 16.0) / 116.0).collect();
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as usize;
        let bell = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        let flat = kernel(radius, bell);
        let strength = |at: &dyn Fn(f32) -> f32| -> Plane {
            let mut along = kernel(radius, |x| at(x) * bell(x));
            // What is above zero adds up to 1, what is below to -1, over both axes together.
            let rest: f32 = flat.iter().sum();
            let [above, below] =
                [1.0, -1.0].map(|sign: f32| along.iter().map(|k| (sign * k).max(0.0)).sum::<f32>() * rest);
            along.iter_mut().for_each(|k| *k /= if *k > 0.0 { above } else { below });
            let (x, y) = (filter(&grey, size, &along, &flat), filter(&grey, size, &flat, &along));
            x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
        };
        let edge = strength(&|x| -x);
        let point = strength(&|x| x * x / (deviation * deviation) - 1.0);
        Self { colour, edge, point }
    }
}

const PI: f32 = std::f32::consts::PI;

fn square(x: f32) -> f32 {
    x * x
}

fn kernel(radius: usize, at: impl Fn(f32) -> f32) -> Vec<f32> {
    (0..=2 * radius).map(|i| at(i as f32 - radius as f32)).collect()
}

/// `from` under a kernel for rows and one for columns; beyond the borders all is as at the borders.
fn filter(from: &[f32], [width, height]: [usize; 2], across: &[f32], down: &[f32]) -> Plane {
    let pass = |from: &[f32], kernel: &[f32], of: &(dyn Fn(usize, usize, isize) -> usize + Sync)| -> Plane {
        let radius = (kernel.len() / 2) as isize;
        let at = |i: usize| {
            let (x, y) = (i % width, i / width);
            let values = kernel.iter().zip(-radius..).map(|(k, d)| k * from[of(x, y, d)]);
            values.sum()
        };
        (0..width * height).into_par_iter().map(at).collect()
    };
    let shift = |x: usize, d: isize, side: usize| (x as isize + d).clamp(0, side as isize - 1) as usize;
    let rows = pass(from, across, &|x, y, d| y * width + shift(x, d, width));
    pass(&rows, down, &|x, y, d| shift(y, d, height) * width + x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [64, 48];

    /// Stripes, noise of a kind, and a chequerboard; and the same brighter, darker in a band, and turned round below.
    fn pictures() -> [Picture; 2] {
        let [width, height] = SIZE;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let first = |(x, y): (u32, u32)| {
            [((7 * x + 3 * y) % 32) as f32 / 31.0, ((x * x + 5 * y) % 64) as f32 / 63.0, ((x / 8 + y / 8) % 2) as f32]
        };
        let second = |(x, y): (u32, u32)| {
            let [r, g, b] = first((x, y));
            let g = if (21..40).contains(&x) { 0.5 * g } else { g };
            [(0.9 * r + 0.05).clamp(0.0, 1.0), g, if y > 30 { 1.0 - b } else { b }]
        };
        [pixels.clone().flat_map(first).collect(), pixels.flat_map(second).collect()].map(|rgb| Picture {
            width,
            height,
            rgb,
        })
    }

    /// Against the authors' own program, `flip-evaluator` 1.7 of PyPI: `evaluate(.., "LDR", inputsRGB=False)`.
    #[test]
    fn the_authors_program_says_the_same() {
        let [reference, test] = pictures();
        let at = [(0, 0), (30, 10), (50, 24), (31, 31), (63, 47)];
        let expected = [
            (67.0, 0.42059, [0.18388, 0.85325, 0.02934, 0.72773, 0.96414]),
            (20.0, 0.50831, [0.36021, 0.94039, 0.09380, 0.87084, 0.96761]),
        ];
        for (pixels_per_degree, mean, values) in expected {
            let found = flip(&reference, &test, pixels_per_degree);
            let found_mean = found.iter().sum::<f32>() / found.len() as f32;
            assert!((found_mean - mean).abs() < 2e-4, "{found_mean} {mean}");
            for ((x, y), value) in at.into_iter().zip(values) {
                let found = found[y * SIZE[0] as usize + x];
                assert!((found - value).abs() < 1e-3, "{x} {y}: {found} {value}");
            }
        }
    }

    #[test]
    fn a_picture_is_as_it_is() {
        let [picture, _] = pictures();
        assert!(flip(&picture, &picture, PIXELS_PER_DEGREE).iter().all(|&x| x == 0.0));
        let [black, white] = [0.0, 1.0].map(|x| Picture { width: 9, height: 9, rgb: vec![x; 243] });
        let found = flip(&black, &white, PIXELS_PER_DEGREE);
        assert!(found.iter().all(|&x| (0.9..=1.0).contains(&x)), "{found:?}");
        let nonsense = Picture { width: 9, height: 9, rgb: vec![f32::NAN; 243] };
        assert!(flip(&black, &nonsense, PIXELS_PER_DEGREE).iter().all(|&x| x == 0.0));
    }
}
