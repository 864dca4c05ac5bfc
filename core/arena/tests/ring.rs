//! A ring against a `VecDeque`.

mod common;

use common::{Rng, Seed};
use hybray_arena::Ring;
use std::collections::VecDeque;

/// Random operations, pushes `lean` times of 8.
fn check(seed: u64, capacity: usize, lean: usize, operations: usize) {
    let _seed = Seed(seed);
    let mut rng = Rng(seed);
    let mut items: Vec<u64> = (0..capacity).map(|_| rng.next()).collect();
    let mut ring = Ring::new(&mut items);
    let mut model = VecDeque::new();
    let (mut most, mut refused, mut passed) = (0, 0, 0);
    for at in 0..operations {
        if rng.below(8) < lean {
            let item = rng.next();
            if model.len() == capacity {
                assert_eq!(ring.push_back(item), Err(item), "operation {at}");
                refused += 1;
            } else {
                assert_eq!(ring.push_back(item), Ok(()), "operation {at}");
                model.push_back(item);
                most = most.max(model.len());
            }
        } else {
            let expected = model.pop_front();
            assert_eq!(ring.pop_front(), expected, "operation {at}");
            passed += usize::from(expected.is_some());
        }
        assert!(ring.iter().eq(&model), "operation {at}");
        assert_eq!(ring.front(), model.front(), "operation {at}");
        assert_eq!((ring.len(), ring.is_empty()), (model.len(), model.is_empty()), "operation {at}");
        assert_eq!((ring.is_full(), ring.high_water()), (model.len() == capacity, most), "operation {at}");
    }
    assert_eq!(ring.capacity(), capacity);
    assert!(lean < 5 || refused > 0, "the ring was never full");
    assert!(passed >= 2 * capacity, "the ring never went round");
}

#[test]
fn a_ring_is_a_queue_with_a_limit() {
    for seed in 0..20 {
        check(seed, 32, 4, 4000);
        check(seed + 100, 13, 6, 4000);
        check(seed + 200, 13, 2, 4000);
    }
}

#[test]
fn rings_of_one_place_and_of_none() {
    for seed in 300..310 {
        check(seed, 1, 5, 1000);
        check(seed, 2, 5, 1000);
        check(seed, 0, 5, 100);
    }
}

#[test]
fn a_ring_shows_its_items() {
    let mut items = [0; 3];
    let mut ring = Ring::new(&mut items);
    (1..=3).for_each(|item| ring.push_back(item).unwrap());
    ring.pop_front();
    ring.push_back(4).unwrap();
    assert_eq!(format!("{ring:?}"), "[2, 3, 4]");
}
