//! Ridged fractal noise from integer hashing and basic arithmetic alone: the same bits on every machine.
//!
//! Source: Musgrave, Kolb and Mace, *The Synthesis and Rendering of Eroded Fractal Terrains*, SIGGRAPH 1989, and the
//! ridged multifractal that Musgrave made of it, here over value noise.

/// Mixes all bits of a lattice point and an octave.
fn hash(x: i32, y: i32, octave: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1);
    h = (h ^ (h >> 15)).wrapping_add(y as u32).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_add(octave).wrapping_mul(0xC2B2_AE35);
    h = (h ^ (h >> 16)).wrapping_mul(0x27D4_EB2F);
    h ^ (h >> 15)
}

/// Value at a lattice point, -1 to 1.
fn lattice(x: i32, y: i32, octave: u32) -> f64 {
    f64::from(hash(x, y, octave)) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// Value noise, -1 to 1, with continuous first and second derivatives. Coordinates must stay within `i32`.
pub fn value(x: f64, y: f64, octave: u32) -> f64 {
    let (floor_x, floor_y) = (libm::floor(x), libm::floor(y));
    let (ix, iy) = (floor_x as i32, floor_y as i32);
    let ease = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (u, v) = (ease(x - floor_x), ease(y - floor_y));
    let row = |iy: i32| {
        let (a, b) = (lattice(ix, iy, octave), lattice(ix + 1, iy, octave));
        a + (b - a) * u
    };
    let (low, high) = (row(iy), row(iy + 1));
    low + (high - low) * v
}

/// Mountains with ridges and quiet valleys, 0 and up, seldom above 2; `x` and `y` from about -100 to 100.
pub fn ridges(x: f64, y: f64, octaves: u32) -> f64 {
    let (mut x, mut y) = (x, y);
    let (mut sum, mut strength, mut weight) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        let ridge = 1.0 - value(x, y, octave).abs();
        let ridge = ridge * ridge * weight;
        sum += ridge * strength;
        // Detail only where the coarser octaves are high: valleys stay smooth.
        weight = (ridge * 1.8).min(1.0);
        strength *= 0.48;
        // Twice as fine and turned by the angle of a 3-4-5 triangle, so that no lattice direction shows.
        (x, y) = (2.0 * (0.8 * x - 0.6 * y) + 17.0, 2.0 * (0.6 * x + 0.8 * y) - 31.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_lattice_values_and_is_continuous() {
        for (x, y) in [(0, 0), (-3, 7), (1000, -2000)] {
            let (fx, fy) = (f64::from(x), f64::from(y));
            assert_eq!(value(fx, fy, 3), lattice(x, y, 3));
            for (dx, dy) in [(-1e-9, 0.0), (0.0, -1e-9), (1e-9, -1e-9)] {
                assert!((value(fx + dx, fy + dy, 3) - lattice(x, y, 3)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn values_are_spread_evenly() {
        let mut counts = [0_u32; 8];
        for x in 0..100 {
            for y in 0..100 {
                let v = lattice(x, y, 5);
                assert!((-1.0..=1.0).contains(&v));
                counts[((v + 1.0) * 4.0).min(7.0) as usize] += 1;
            }
        }
        // 1,250 expected in each, standard deviation 33.
        assert!(counts.iter().all(|c| (1_100..1_400).contains(c)), "{counts:?}");
    }

    #[test]
    fn ridges_are_bounded() {
        for i in 0..2_000 {
            let (x, y) = (f64::from(i % 50) * 0.137, f64::from(i / 50) * 0.211);
            let h = ridges(x, y, 14);
            // The strengths add up to less than 1 / (1 - 0.48).
            assert!((0.0..1.93).contains(&h), "{h}");
        }
    }
}
