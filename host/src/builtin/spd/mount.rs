//! `mount`: Carpenter's fractal mountain on a square grid, with four glass spheres in front of it.
//!
//! The published hash of a grid point is a poor one, and its repetitions can be seen; it is kept because it is the
//! scene's.

use super::super::vector::{Affine, V, Z, add, narrow, unit};
use super::{View, scene, surface};
use crate::model::{Mesh, Model, Sphere};
use core::f64::consts::{PI, SQRT_2};

/// Between 2 (smooth) and 3.
const FRACTAL_DIMENSION: f64 = 2.2;
const MOUNTAIN: u32 = 21;

const VIEW: View =
    View { eye: [-1.6, 1.6, 1.7], target: [0.0; 3], up: [0.0, 0.0, 1.0], fov_degrees: 45.0, hither: 0.01 };

/// 2 x 4^size triangles and four spheres.
pub fn mount(size: u32) -> Model {
    let mut model = scene(&VIEW, &[[-100.0, -100.0, 100.0]]);
    let glass = model.add_material("glass", surface([1.0; 3], 0.1, 0.1, 6.7, 0.9, 1.5));
    model.spheres.extend(pyramid([-0.8, 0.8, 1.0], 0.17, glass));
    let material = model.add_material("mountain", surface([0.5, 0.45, 0.35], 1.0, 0.0, 0.0, 0.0, 0.0));
    let mesh = Mesh { name: "mountain".to_owned(), material, ..mountain(size) };
    model.objects.polygons = mesh.triangles.len() as u64;
    model.objects.spheres = model.spheres.len() as u64;
    model.meshes.push(mesh);
    model
}

/// Four spheres of one radius that touch one another, around `centre`.
fn pyramid(centre: V, radius: f64, material: u16) -> [Sphere; 4] {
    let top = [0.0, 0.0, radius * 1.5_f64.sqrt()];
    // From one corner of a tetrahedron to the next, about its middle, the angle's cosine is -1/3.
    let tip = Affine::turn(unit([1.0, 1.0, 0.0]), -1.0 / 3.0, 8.0_f64.sqrt() / 3.0);
    let low = tip.apply(top);
    core::array::from_fn(|i| {
        let offset = if i == 0 { top } else { Affine::turn_by(Z, (i - 1) as f64 * 2.0 * PI / 3.0).apply(low) };
        Sphere { centre: narrow(add(centre, offset)), radius: radius as f32, material }
    })
}

fn mountain(size: u32) -> Mesh {
    let cells = 1_usize << size;
    let heights = heights(size);
    let place = |i: usize| -1.0 + 2.0 * i as f64 / cells as f64;
    let point = |i: usize| narrow([place(i % (cells + 1)), place(i / (cells + 1)), heights[i]]);
    let positions = (0..heights.len()).map(point).collect();
    let mut triangles = Vec::with_capacity(2 * cells * cells);
    for y in 0..cells {
        for x in 0..cells {
            let low = (y * (cells + 1) + x) as u32;
            let high = low + cells as u32 + 1;
            triangles.push([low, low + 1, high + 1]);
            triangles.push([high + 1, high, low]);
        }
    }
    Mesh { positions, triangles, ..Mesh::default() }
}

/// Heights of the grid's points, row by row. The published program recurses over squares; going level by level over
/// the whole grid gives each point the same height, since a midpoint is hashed by where it is.
fn heights(size: u32) -> Vec<f64> {
    let cells = 1_usize << size;
    let row = cells + 1;
    let mut z = vec![0.0; row * row];
    let ratio = 2.0 / libm::exp(libm::log(2.0) / (FRACTAL_DIMENSION - 1.0));
    let roughness = (ratio * ratio - 1.0).sqrt();
    let mut width = cells;
    while width > 1 {
        let half = width / 2;
        let rise = half as f64 * 2.0 / cells as f64 * roughness;
        let offset = |x: usize, y: usize| rise * gauss(MOUNTAIN + hash(x as u32, y as u32, size));
        for y in (0..cells).step_by(width) {
            for x in (0..cells).step_by(width) {
                let [ll, lr] = [z[y * row + x], z[y * row + x + width]];
                let [ul, ur] = [z[(y + width) * row + x], z[(y + width) * row + x + width]];
                z[y * row + x + half] = (ll + lr) / 2.0 + offset(x + half, y);
                z[(y + half) * row + x + width] = (lr + ur) / 2.0 + offset(x + width, y + half);
                z[(y + width) * row + x + half] = (ur + ul) / 2.0 + offset(x + half, y + width);
                z[(y + half) * row + x] = (ul + ll) / 2.0 + offset(x, y + half);
                let middle = SQRT_2 * offset(x + half, y + half);
                z[(y + half) * row + x + half] = (ll + lr + ur + ul) / 4.0 + middle;
            }
        }
        width = half;
    }
    z
}

/// The published hash, 16 bits. It shifts so that a point has the same hash at every size; its last shift is to the
/// left by `7 - size`, which is a shift to the right above size 7 (where the published program is not defined).
fn hash(x: u32, y: u32, size: u32) -> u32 {
    let last = if size <= 7 { x << (7 - size) } else { x >> (size - 7) };
    (x << (23 - size)).wrapping_add(y << (15 - size)).wrapping_add(last) & 0xFFFF
}

/// A normally distributed number from a seed below 134,456, by the polar method over a small linear congruential
/// generator (*Numerical Recipes*, `gasdev` and `ran1`).
///
/// Ends: the generator has full period, so it comes to a pair within the unit circle. Never 0 / 0: the radius is 0 only
/// if two successive states are both 67,228, and that state's successor is another.
fn gauss(seed: u32) -> f64 {
    const M: u32 = 134_456;
    let step = |s: u32| (28_411 + s * 8_121) % M;
    let centred = |s: u32| f64::from(s) * 2.0 / f64::from(M) - 1.0;
    let mut state = seed;
    loop {
        let first = step(state);
        state = step(first);
        let (v, w) = (centred(first), centred(state));
        let r = v * v + w * w;
        if r < 1.0 {
            return v * (-2.0 * libm::log(r) / r).sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;
    use crate::builtin::vector::{length, sub};

    #[test]
    fn spheres_touch_one_another() {
        let spheres = pyramid([-0.8, 0.8, 1.0], 0.17, 0);
        for (i, a) in spheres.iter().enumerate() {
            for b in &spheres[..i] {
                let distance = length(sub(a.centre.map(f64::from), b.centre.map(f64::from)));
                assert!((distance - 0.34).abs() < 1e-6, "{distance}");
            }
        }
    }

    /// The published program's recursion, written as it is described, over `f64` corners.
    fn recurse(size: u32, width: usize, at: (usize, usize), c: [f64; 4], out: &mut Vec<((usize, usize), f64)>) {
        let (x, y) = at;
        out.extend([((x, y), c[0]), ((x + width, y), c[1]), ((x + width, y + width), c[2]), ((x, y + width), c[3])]);
        if width == 1 {
            return;
        }
        let h = width / 2;
        let ratio = 2.0_f64 / 2.0_f64.powf(1.0 / 1.2);
        let rise = h as f64 * 2.0 / (1 << size) as f64 * (ratio * ratio - 1.0).sqrt();
        let bump = |x: usize, y: usize| rise * gauss(21 + hash(x as u32, y as u32, size));
        let lower = (c[0] + c[1]) / 2.0 + bump(x + h, y);
        let right = (c[1] + c[2]) / 2.0 + bump(x + width, y + h);
        let upper = (c[2] + c[3]) / 2.0 + bump(x + h, y + width);
        let left = (c[3] + c[0]) / 2.0 + bump(x, y + h);
        let middle = (c[0] + c[1] + c[2] + c[3]) / 4.0 + 2.0_f64.sqrt() * bump(x + h, y + h);
        recurse(size, h, at, [c[0], lower, middle, left], out);
        recurse(size, h, (x + h, y), [lower, c[1], right, middle], out);
        recurse(size, h, (x + h, y + h), [middle, right, c[2], upper], out);
        recurse(size, h, (x, y + h), [left, middle, upper, c[3]], out);
    }

    #[test]
    fn levels_agree_with_recursion() {
        let size = 5;
        let grid = heights(size);
        let mut visits = Vec::new();
        recurse(size, 1 << size, (0, 0), [0.0; 4], &mut visits);
        for ((x, y), z) in visits {
            assert!((grid[y * 33 + x] - z).abs() < 1e-6, "{x} {y}");
        }
    }

    #[test]
    fn hash_by_hand() {
        // Size 6: x << 17, y << 9, x << 1, the low 16 bits.
        assert_eq!(hash(3, 5, 6), 5 * 512 + 6);
        assert_eq!(hash(64, 64, 6), (64 * 512 + 128) & 0xFFFF);
        // The same point at other sizes.
        assert_eq!(hash(6, 10, 7), hash(3, 5, 6));
        assert_eq!(hash(3 << 5, 5 << 5, 11), hash(3, 5, 6));
    }

    /// The variance of all seeds is 1 and the mean 0.
    #[test]
    fn gauss_is_normal() {
        let values: Vec<f64> = (0..65_536).map(gauss).collect();
        let mean = values.iter().sum::<f64>() / 65_536.0;
        let variance = values.iter().map(|v| v * v).sum::<f64>() / 65_536.0;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
    }

    #[test]
    fn mountain_is_one_sheet() {
        assert_eq!(checks::open_edges(&mountain(4)), 4 * 16);
    }
}
