//! Ray ids: 64 bits that name a ray, seed its random choices and are its entry in the ledger.
//!
//! An id is a hash of what the ray is (seed, pixel, sample, then the branch taken at each hit), never of where or when
//! it is traced. It must look random for a second reason: the ledger adds ids, and a sum must not be zero by chance.
//! Each function costs two or four 64-bit multiplications.
//!
//! The mixer has the shape of MurmurHash3's finaliser with the constants of Stafford's "Mix13", which SplitMix64 also
//! uses (Steele, Lea, Flood, *Fast Splittable Pseudorandom Number Generators*, OOPSLA 2014). It is a bijection, so the
//! primaries of one picture, and the children of one hit, never collide at all.

/// 2^64 over the golden ratio: multiples of it lie far apart.
const BRANCH_STEP: u64 = 0x9e37_79b9_7f4a_7c15;
/// Another odd constant with good spectral figures (Steele and Vigna, 2021): numbers drawn are no children's ids.
const DIMENSION_STEP: u64 = 0xd134_2543_de82_ef95;
const DIMENSION_MASK: u64 = 0x5851_f42d_4c95_7f2d;

#[inline]
const fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Id of a primary ray. `pixel` counts the picture's pixels, `sample` the samples of that pixel.
#[inline]
#[must_use]
pub const fn primary_id(seed: u64, pixel: u32, sample: u32) -> u64 {
    mix((((pixel as u64) << 32) | sample as u64) ^ mix(seed.wrapping_add(BRANCH_STEP)))
}

/// What all samples of a pixel share, for [`sample_offset`](crate::sample_offset). It is no ray's id, because no pixel
/// has 2^32 samples.
#[inline]
#[must_use]
pub const fn pixel_id(seed: u64, pixel: u32) -> u64 {
    primary_id(seed, pixel, u32::MAX)
}

/// Id of the ray that a hit of ray `parent` spawns on `branch`.
#[inline]
#[must_use]
pub const fn child_id(parent: u64, branch: u32) -> u64 {
    mix(parent.wrapping_add((branch as u64 + 1).wrapping_mul(BRANCH_STEP)))
}

/// 64 random bits for the random choice number `dimension` of a ray.
#[inline]
#[must_use]
pub const fn random(id: u64, dimension: u32) -> u64 {
    mix((id ^ DIMENSION_MASK).wrapping_add((dimension as u64 + 1).wrapping_mul(DIMENSION_STEP)))
}

/// Two independent uniform numbers in `0.0..1.0`, multiples of 2^-24, for the choice number `dimension` of a ray.
#[inline]
#[must_use]
pub const fn unit_pair(id: u64, dimension: u32) -> [f32; 2] {
    let bits = random(id, dimension);
    [unit((bits >> 32) as u32), unit(bits as u32)]
}

/// The top 24 bits as a number in `0.0..1.0`: `f32` has no more, and 32 would round up to 1.
#[inline]
pub(crate) const fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Primaries of two seeds over a few pixels, three generations of children: 3.9 million ids.
    fn ray_tree() -> Vec<u64> {
        let mut ids = Vec::new();
        for seed in 0..2 {
            for pixel in (0..1024).chain(u32::MAX - 1024..u32::MAX) {
                for sample in 0..16 {
                    let primary = primary_id(seed, pixel, sample);
                    ids.push(primary);
                    for branch in 1..=5 {
                        let child = child_id(primary, branch);
                        ids.push(child);
                        if branch > 3 {
                            for branch in 1..=5 {
                                let grandchild = child_id(child, branch);
                                ids.push(grandchild);
                                if branch > 3 {
                                    ids.extend((1..=11).map(|b| child_id(grandchild, b)));
                                }
                            }
                        }
                    }
                }
            }
        }
        ids
    }

    #[test]
    fn ids_of_a_ray_tree_are_distinct_and_uniform() {
        let mut ids = ray_tree();
        let count = ids.len();
        assert!(count > 3_000_000);
        for shift in [0, 24, 56] {
            let mut bins = [0u32; 256];
            ids.iter().for_each(|id| bins[(id >> shift) as usize & 255] += 1);
            chi_square(&bins, count);
        }
        let zero_sum = ids.iter().fold(0u64, |sum, id| sum.wrapping_add(*id));
        assert_ne!(zero_sum, 0);
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
    }

    /// 255 degrees of freedom: mean 255, deviation 22.6; the bounds are five deviations away.
    fn chi_square(bins: &[u32; 256], count: usize) {
        let expected = count as f64 / 256.0;
        let chi: f64 = bins.iter().map(|&n| (f64::from(n) - expected) * (f64::from(n) - expected) / expected).sum();
        assert!((142.0..368.0).contains(&chi), "chi-square {chi}");
    }

    #[test]
    fn pairs_are_uniform_and_independent() {
        for ids in [|i: u32| primary_id(0, i, 0), |i: u32| child_id(77, i), |i: u32| u64::from(i)] {
            for dimension in [0, 1, 9] {
                let mut bins = [0u32; 256];
                for i in 0..200_000 {
                    let [u, v] = unit_pair(ids(i), dimension);
                    assert!((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v));
                    bins[(u * 16.0) as usize * 16 + (v * 16.0) as usize] += 1;
                }
                chi_square(&bins, 200_000);
            }
        }
        // The same ray's dimensions against each other.
        let mut bins = [0u32; 256];
        for i in 0..200_000 {
            let id = primary_id(3, i, 0);
            bins[(unit_pair(id, 0)[0] * 16.0) as usize * 16 + (unit_pair(id, 1)[0] * 16.0) as usize] += 1;
        }
        chi_square(&bins, 200_000);
    }

    #[test]
    fn unit_stays_below_one() {
        assert_eq!(unit(u32::MAX), 1.0 - 1.0 / 16_777_216.0);
        assert_eq!(unit(0), 0.0);
    }

    /// Flips each input bit of `f` for many inputs: every output bit must change about half the time.
    fn check_avalanche(bits: u32, f: impl Fn(u64) -> u64) {
        let inputs = 4096;
        for flipped in 0..bits {
            let mut changes = [0u32; 64];
            for i in 0..inputs {
                let difference = f(i) ^ f(i ^ (1 << flipped));
                changes.iter_mut().enumerate().for_each(|(bit, n)| *n += (difference >> bit) as u32 & 1);
            }
            for (bit, &n) in changes.iter().enumerate() {
                let share = f64::from(n) / inputs as f64;
                assert!((0.4..0.6).contains(&share), "input bit {flipped}, output bit {bit}: {share}");
            }
        }
    }

    #[test]
    fn every_input_bit_reaches_every_output_bit() {
        check_avalanche(64, |x| primary_id(x, 5, 0));
        check_avalanche(32, |x| primary_id(1, x as u32, 0));
        check_avalanche(32, |x| primary_id(1, 5, x as u32));
        check_avalanche(64, |x| child_id(x, 2));
        check_avalanche(32, |x| child_id(99, x as u32));
        check_avalanche(64, |x| random(x, 0));
        check_avalanche(32, |x| random(99, x as u32));
    }

    /// SplitMix64's published first outputs for seed 1234567 (Rosetta Code, "Pseudo-random numbers/Splitmix64").
    #[test]
    fn mixer_is_splitmix64() {
        let mut state = 1_234_567u64;
        for expected in [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423] {
            state = state.wrapping_add(BRANCH_STEP);
            assert_eq!(mix(state), expected);
        }
    }

    /// Ids are part of the picture: these must never change.
    #[test]
    fn ids_are_pinned() {
        assert_eq!(child_id(1_234_567, 0), 6_457_827_717_110_365_317);
        assert_eq!(child_id(1_234_567, 1), 3_203_168_211_198_807_973);
        assert_eq!(primary_id(0, 0, 0), mix(mix(BRANCH_STEP)));
        assert_eq!(pixel_id(4, 5), primary_id(4, 5, u32::MAX));
    }
}
