//! A slab with its lists against a `VecDeque` for each list.

mod common;

use common::{Rng, Seed};
use hybray_arena::{List, Slab};
use std::collections::VecDeque;

/// Random operations on `queues` lists of one slab, each compared with the same on queues that grow. Whoever always
/// pushes more than he pops meets the full slab; `lean` of 8 decides.
fn check(seed: u64, capacity: usize, queues: usize, lean: usize, operations: usize) {
    let _seed = Seed(seed);
    let mut rng = Rng(seed);
    // Nothing may depend on what the slices held.
    let mut items: Vec<u64> = (0..capacity).map(|_| rng.next()).collect();
    let mut links: Vec<u32> = (0..capacity).map(|_| rng.next() as u32).collect();
    let mut slab = Slab::new(&mut items, &mut links);
    let mut lists = vec![List::EMPTY; queues];
    let mut model: Vec<VecDeque<u64>> = vec![VecDeque::new(); queues];
    let (mut in_use, mut most, mut refused) = (0, 0, 0);
    for at in 0..operations {
        let (q, other) = (rng.below(queues), rng.below(queues));
        let item = rng.next();
        let kind = rng.below(16);
        if kind < 12 {
            if rng.below(8) < lean {
                let is_back = rng.below(3) > 0;
                let list = &mut lists[q];
                let answer = if is_back { slab.push_back(list, item) } else { slab.push_front(list, item) };
                if in_use == capacity {
                    assert_eq!(answer, Err(item));
                    refused += 1;
                } else {
                    assert_eq!(answer, Ok(()));
                    if is_back {
                        model[q].push_back(item)
                    } else {
                        model[q].push_front(item)
                    }
                    in_use += 1;
                    most = most.max(in_use);
                }
            } else {
                let expected = model[q].pop_front();
                assert_eq!(slab.pop_front(&mut lists[q]), expected);
                in_use -= usize::from(expected.is_some());
            }
        } else if kind < 14 && q != other {
            let mut from = lists[other];
            slab.append(&mut lists[q], &mut from);
            lists[other] = from;
            let moved = std::mem::take(&mut model[other]);
            model[q].extend(moved);
        } else if q != other {
            // What was cut off goes to the front of another list, by way of `append`.
            let count = rng.below(model[q].len() + 2);
            let mut front = slab.split_front(&mut lists[q], count);
            assert_eq!(front.len(), count.min(model[q].len()));
            let behind = model[q].split_off(front.len());
            let mut cut = std::mem::replace(&mut model[q], behind);
            cut.append(&mut model[other]);
            model[other] = cut;
            slab.append(&mut front, &mut lists[other]);
            lists[other] = front;
        }
        assert_eq!(slab.free(), capacity - in_use, "operation {at}");
        assert_eq!(slab.high_water(), most, "operation {at}");
        for (list, queue) in lists.iter().zip(&model) {
            assert_eq!((list.len(), list.is_empty()), (queue.len(), queue.is_empty()), "operation {at}");
            assert!(slab.iter(list).eq(queue), "operation {at}");
        }
    }
    assert!(lean < 5 || refused > 0, "the slab was never full");
    for (list, queue) in lists.iter_mut().zip(&mut model) {
        while let Some(expected) = queue.pop_front() {
            assert_eq!(slab.pop_front(list), Some(expected));
        }
        assert_eq!((slab.pop_front(list), *list), (None, List::EMPTY));
    }
    assert_eq!(slab.free(), slab.capacity());
}

#[test]
fn several_lists_are_as_many_queues() {
    for seed in 0..20 {
        check(seed, 50, 5, 4, 4000);
        check(seed + 100, 200, 9, 6, 4000);
    }
}

#[test]
fn a_full_slab_hands_the_item_back() {
    for seed in 200..220 {
        check(seed, 7, 3, 6, 4000);
        check(seed + 100, 1, 2, 6, 1000);
        check(seed + 200, 0, 2, 6, 100);
    }
}

#[test]
fn a_place_that_became_free_is_used_before_a_new_one() {
    let (mut items, mut links) = ([0; 8], [0; 8]);
    let mut slab = Slab::new(&mut items, &mut links);
    let (mut a, mut b) = (List::EMPTY, List::EMPTY);
    for round in 0..100 {
        slab.push_back(&mut a, round).unwrap();
        slab.push_front(&mut b, round).unwrap();
        assert_eq!((slab.pop_front(&mut a), slab.pop_front(&mut b)), (Some(round), Some(round)));
    }
    assert_eq!((slab.high_water(), slab.free(), slab.capacity()), (2, 8, 8));
}

#[test]
fn cuts_at_the_ends() {
    let (mut items, mut links) = ([0; 4], [0; 4]);
    let mut slab = Slab::new(&mut items, &mut links);
    let mut list = List::EMPTY;
    assert_eq!(slab.split_front(&mut list, 3), List::EMPTY);
    (0..4).for_each(|i| slab.push_back(&mut list, i).unwrap());
    assert_eq!(slab.split_front(&mut list, 0), List::EMPTY);
    let front = slab.split_front(&mut list, 3);
    assert_eq!((front.len(), list.len()), (3, 1));
    let rest = slab.split_front(&mut list, 1);
    assert_eq!((rest.len(), list), (1, List::default()));
    assert!(slab.iter(&front).eq(&[0, 1, 2]) && slab.iter(&rest).eq(&[3]));
    let mut all = front;
    slab.append(&mut all, &mut { rest });
    let whole = slab.split_front(&mut all, usize::MAX);
    assert!(all.is_empty() && slab.iter(&whole).eq(&[0, 1, 2, 3]));
}

#[test]
#[should_panic(expected = "one link for each item")]
fn a_slab_has_a_link_for_each_item() {
    let _ = Slab::new(&mut [0; 3], &mut [0; 2]);
}

#[test]
fn a_list_of_another_slab_reaches_nothing_outside() {
    let (mut items, mut links) = ([0; 8], [0; 8]);
    let mut large = Slab::new(&mut items, &mut links);
    let mut list = List::EMPTY;
    (0..8).for_each(|i| large.push_back(&mut list, i).unwrap());
    let near = large.split_front(&mut list, 6);
    let count = |list: List| {
        std::panic::catch_unwind(move || {
            let (mut items, mut links) = ([0; 2], [0; 2]);
            Slab::new(&mut items, &mut links).iter(&list).count()
        })
    };
    assert_eq!(count(near).unwrap(), 6, "wrong items, but no more than the list says");
    assert!(count(list).is_err(), "its first place is outside the slab");
}
