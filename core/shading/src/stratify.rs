//! Point sets for any number of samples: each point in its own column, and the rows as even as base 2 allows.

use crate::id::{random, unit};

/// Point `index` of the set of `count` points in the unit square that `key` names; both numbers in `0.0..1.0`.
///
/// A Hammersley set, jittered along x and scrambled along y: x of point `i` is uniform in the column `i / count ..
/// (i + 1) / count`, and y is the base-2 radical inverse of `i` under Owen's nested scrambling, exactly. So each point
/// is uniform where it may lie, each column holds one point, each of 2^k rows holds `count / 2^k` points rounded down
/// or up, and where `count` is a power of two every box of area `1 / count` with dyadic sides holds one.
/// Sources: Owen, *Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences*, 1995; Pharr, Jakob, Humphreys, *Physically
/// Based Rendering* 4th ed., sections 8.6.1 and 8.6.2.
///
/// Columns are exact but for the rounding of x down to a multiple of 2^-24. `index` must be below `count`; if it is
/// not, the point is the last column's.
pub(crate) fn stratified(key: u64, index: u32, count: u32) -> [f32; 2] {
    let count = count.max(1);
    let index = index.min(count - 1);
    let noise = random(key, index);
    let x = (u64::from(index) << 32 | noise >> 32) / u64::from(count);
    // Digits that tell the points apart; those below are random, which is what Owen's scrambling makes of them.
    let digits = u32::BITS - (count - 1).leading_zeros();
    let mut y = 0u64;
    for digit in 0..digits {
        // A node of the binary tree over y, numbered from 1: its bit says whether its halves change places. One word
        // holds the bits of the first six levels.
        let node = 1 << digit | index & ((1 << digit) - 1);
        let swap = random(!key, node >> 6) >> (node & 63) & 1;
        y = y << 1 | (u64::from(index >> digit) & 1) ^ swap;
    }
    let y = (y << 32 | noise & 0xffff_ffff) >> digits;
    [unit(x as u32), unit(y as u32)]
}

/// The place of `index` in a permutation of `0..count` that `key` names, for points of two sets to be paired at random.
/// `index` must be below `count`; if it is not, it is taken for the last.
///
/// A hash of as many bits as `count` needs is a bijection of these; what it takes beyond `count` is hashed again until it
/// is not, on average less than once. Source: Kensler, *Correlated Multi-Jittered Sampling*, 2013, section 5.
pub(crate) fn permuted(index: u32, count: u32, key: u64) -> u32 {
    let last = count.max(1) - 1;
    let mask = u32::MAX.checked_shr(last.leading_zeros()).unwrap_or(0);
    let p = (key >> 32) as u32 ^ key as u32;
    let mut i = index.min(last);
    loop {
        i = (i ^ p).wrapping_mul(0xe170_893d);
        i ^= p >> 16;
        i ^= (i & mask) >> 4;
        i = (i ^ p >> 8).wrapping_mul(0x0929_eb3f);
        i ^= p >> 23;
        i ^= (i & mask) >> 1;
        i = i.wrapping_mul(1 | p >> 27).wrapping_mul(0x6935_fa69);
        i ^= (i & mask) >> 11;
        i = i.wrapping_mul(0x74dc_b303);
        i ^= (i & mask) >> 2;
        i = i.wrapping_mul(0x9e50_1cc3);
        i ^= (i & mask) >> 2;
        i = i.wrapping_mul(0xc860_a3df) & mask;
        i ^= i >> 5;
        if i <= last {
            return ((u64::from(i) + u64::from(p)) % (u64::from(last) + 1)) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{vec, vec::Vec};

    fn check(count: u32) {
        for key in 0..20 {
            let points: Vec<[f32; 2]> = (0..count).map(|i| stratified(key, i, count)).collect();
            for (i, p) in points.iter().enumerate() {
                let column = f64::from(p[0]) * f64::from(count);
                assert!(column > i as f64 - 1e-3 && column < i as f64 + 1.0, "{count}: column {i} has {column}");
            }
            for level in 0..=count.ilog2() {
                let mut rows = vec![0u32; 1 << level];
                points.iter().for_each(|p| rows[(p[1] * (1 << level) as f32) as usize] += 1);
                let (least, most) = (count >> level, count.div_ceil(1 << level));
                assert!(rows.iter().all(|n| (least..=most).contains(n)), "{count}: {rows:?}");
            }
            if count.is_power_of_two() {
                for level in 0..=count.ilog2() {
                    let columns = count >> level;
                    let mut boxes = vec![0u32; count as usize];
                    for p in &points {
                        let (x, y) = ((p[0] * columns as f32) as u32, (p[1] * (1 << level) as f32) as u32);
                        boxes[(y * columns + x) as usize] += 1;
                    }
                    assert!(boxes.iter().all(|&n| n == 1), "{count}, level {level}: {boxes:?}");
                }
            }
        }
    }

    #[test]
    fn every_count_is_stratified() {
        (1..=40).for_each(check);
        [64, 100, 127, 128, 129, 256, 1000, 1024].into_iter().for_each(check);
    }

    #[test]
    fn each_point_is_uniform_over_keys() {
        for count in [1, 3, 4, 9] {
            for index in 0..count {
                let mut bins = [0u32; 64];
                for key in 0..64_000 {
                    let [x, y] = stratified(crate::id::primary_id(9, key, 0), index, count);
                    let within = x * count as f32 - index as f32;
                    bins[((within * 8.0) as usize).min(7) * 8 + (y * 8.0) as usize] += 1;
                }
                let chi: f64 = bins.iter().map(|&n| (f64::from(n) - 1000.0).powi(2) / 1000.0).sum();
                // 63 degrees of freedom, deviation 11.2.
                assert!((20.0..125.0).contains(&chi), "{count}, {index}: {chi}");
            }
        }
    }

    /// Owen's scrambling flips the second digit on each side of the first by its own coin; one coin for both would
    /// tie points together.
    #[test]
    fn scrambling_is_nested() {
        let second = |key, index| (stratified(key, index, 4)[1] * 4.0) as u32 & 1;
        let alike = (0..10_000).filter(|&key| second(key, 0) == second(key, 1)).count();
        assert!((4700..5300).contains(&alike), "{alike}");
    }

    #[test]
    fn huge_counts_and_stray_indices_stay_inside() {
        for (index, count) in [(0, 0), (5, 0), (9, 3), (u32::MAX, u32::MAX), (u32::MAX - 1, u32::MAX), (0, u32::MAX)] {
            let p = stratified(1, index, count);
            assert!(p.iter().all(|u| (0.0..1.0).contains(u)), "{index} of {count}: {p:?}");
        }
    }

    #[test]
    fn permutations_are_permutations_and_differ() {
        for count in [1u32, 2, 3, 5, 8, 9, 16, 100, 1000, 65_535] {
            let mut firsts = vec![0u32; count as usize];
            for key in 0..50 {
                let key = crate::id::primary_id(4, key, 0);
                let mut places: Vec<u32> = (0..count).map(|i| permuted(i, count, key)).collect();
                firsts[places[0] as usize] += 1;
                assert_eq!(permuted(count, count, key), places[count as usize - 1], "beyond the last");
                places.sort_unstable();
                assert!(places.iter().zip(0..).all(|(a, b)| *a == b), "{count}");
            }
            assert!(count < 2 || firsts.iter().all(|&n| n < 40), "{count}: the same place for most keys");
        }
        // Every place of a few goes everywhere as often.
        for index in 0..5 {
            let mut bins = [0u32; 5];
            for key in 0..50_000 {
                bins[permuted(index, 5, crate::id::primary_id(4, key, 0)) as usize] += 1;
            }
            // Five deviations of 89.
            assert!(bins.iter().all(|n| n.abs_diff(10_000) < 450), "{index}: {bins:?}");
        }
    }
}
