//! Any terms, from exactly their sum of memory: aligned, apart, filled, and one byte less is too little.

use core::mem::MaybeUninit;
use core::ops::Range;
use hybray_arena::{Arena, LINE_BYTES, Short, Sum, TERMS_MAX, Term};
use proptest::prelude::*;

/// A value of which each bit comes from a number.
trait Value: Copy + PartialEq + 'static {
    fn of(number: u64) -> Self;
}

impl Value for u8 {
    fn of(number: u64) -> Self {
        number as u8
    }
}

impl Value for [u16; 3] {
    fn of(number: u64) -> Self {
        [number as u16, (number >> 16) as u16, (number >> 32) as u16]
    }
}

impl Value for u64 {
    fn of(number: u64) -> Self {
        number
    }
}

impl Value for [u32; 27] {
    fn of(number: u64) -> Self {
        core::array::from_fn(|i| (number >> i) as u32)
    }
}

/// Three bytes of padding, and a `bool`, which not every byte is.
#[derive(Clone, Copy, PartialEq)]
#[repr(C)]
struct Padded(bool, u32);

impl Value for Padded {
    fn of(number: u64) -> Self {
        Self(number.is_multiple_of(2), number as u32)
    }
}

#[derive(Clone, Copy, PartialEq)]
#[repr(C, align(64))]
struct Aligned(u64);

impl Value for Aligned {
    fn of(number: u64) -> Self {
        Self(number)
    }
}

impl Value for () {
    fn of(_: u64) -> Self {}
}

/// A slice, whatever it is of.
trait Slice {
    fn addresses(&self) -> Range<usize>;
    /// Whether place `i` holds the value of `seed + step * i`, in each place.
    fn holds(&self, seed: u64, step: u64) -> bool;
    fn fill(&mut self, seed: u64, step: u64);
}

/// What an arena gave.
type Took<'m> = Result<Box<dyn Slice + 'm>, Short>;

fn number(seed: u64, step: u64, i: usize) -> u64 {
    seed.wrapping_add(step.wrapping_mul(i as u64))
}

impl<T: Value> Slice for &mut [T] {
    fn addresses(&self) -> Range<usize> {
        let range = self.as_ptr_range();
        range.start as usize..range.end as usize
    }

    fn holds(&self, seed: u64, step: u64) -> bool {
        self.iter().enumerate().all(|(i, value)| *value == T::of(number(seed, step, i)))
    }

    fn fill(&mut self, seed: u64, step: u64) {
        self.iter_mut().enumerate().for_each(|(i, value)| *value = T::of(number(seed, step, i)));
    }
}

/// What a term can be of: its size, and how to ask for it. With a step of 0 by `take`, else by `take_with`.
struct Kind {
    bytes: usize,
    add: fn(&mut Sum, &'static str, usize),
    take: for<'m> fn(&mut Arena<'m>, &'static str, usize, u64, u64) -> Took<'m>,
}

fn take<'m, T: Value>(arena: &mut Arena<'m>, term: &'static str, count: usize, seed: u64, step: u64) -> Took<'m> {
    Ok(Box::new(if step == 0 {
        arena.take(term, count, T::of(seed))?
    } else {
        arena.take_with(term, count, |i| T::of(number(seed, step, i)))?
    }))
}

const KINDS: [Kind; 7] = [
    Kind { bytes: 1, add: Sum::add::<u8>, take: take::<u8> },
    Kind { bytes: 6, add: Sum::add::<[u16; 3]>, take: take::<[u16; 3]> },
    Kind { bytes: 8, add: Sum::add::<u64>, take: take::<u64> },
    Kind { bytes: 108, add: Sum::add::<[u32; 27]>, take: take::<[u32; 27]> },
    Kind { bytes: 8, add: Sum::add::<Padded>, take: take::<Padded> },
    Kind { bytes: 64, add: Sum::add::<Aligned>, take: take::<Aligned> },
    Kind { bytes: 0, add: Sum::add::<()>, take: take::<()> },
];

const NAMES: [&str; 8] = ["pages", "cache", "rays", "links", "bundles", "requests", "film", "lane"];

#[derive(Clone, Debug)]
struct Asked {
    kind: usize,
    count: usize,
    seed: u64,
    step: u64,
}

fn asked() -> impl Strategy<Value = Asked> {
    let count = prop_oneof![1 => Just(0usize), 2 => 1usize..4, 4 => 1usize..200];
    (0..KINDS.len(), count, any::<u64>(), prop_oneof![Just(0), any::<u64>()])
        .prop_map(|(kind, count, seed, step)| Asked { kind, count, seed, step })
}

/// What a term takes, counted line by line.
fn bytes_by_hand(asked: &Asked) -> usize {
    (0..asked.count * KINDS[asked.kind].bytes).step_by(64).count() * 64
}

/// `bytes` bytes of memory that begin `start` bytes behind a multiple of 64.
fn loan(buffer: &mut Vec<MaybeUninit<u8>>, start: usize, bytes: usize) -> &mut [MaybeUninit<u8>] {
    buffer.clear();
    buffer.resize(bytes + 2 * 64, MaybeUninit::uninit());
    let first = (buffer.as_ptr() as usize).wrapping_neg() % 64 + start;
    &mut buffer[first..first + bytes]
}

/// Takes each term of `terms` from `memory`: what came of it.
fn carve<'m>(terms: &[Asked], memory: &'m mut [MaybeUninit<u8>]) -> (Vec<Took<'m>>, usize, usize) {
    let mut arena = Arena::new(memory);
    let took = terms.iter().zip(NAMES.iter().cycle());
    let took =
        took.map(|(asked, name)| (KINDS[asked.kind].take)(&mut arena, name, asked.count, asked.seed, asked.step));
    let took = took.collect();
    let left = arena.left();
    (took, left, arena.seal())
}

fn check_suffices(terms: &[Asked], total: usize, start: usize, bytes: usize) {
    let mut buffer = Vec::new();
    let memory = loan(&mut buffer, start, bytes);
    let loaned = memory.as_ptr() as usize..memory.as_ptr() as usize + bytes;
    let (took, _, used) = carve(terms, memory);
    let mut took: Vec<_> = took.into_iter().map(|slice| slice.unwrap_or_else(|short| panic!("{short}"))).collect();
    assert_eq!(used, total);

    let mut ranges: Vec<_> = took.iter().map(|slice| slice.addresses()).collect();
    for (range, asked) in ranges.iter().zip(terms) {
        assert_eq!(range.start % 64, 0);
        assert_eq!(range.len(), asked.count * KINDS[asked.kind].bytes);
    }
    ranges.retain(|range| !range.is_empty());
    ranges.sort_by_key(|range| range.start);
    assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start), "slices overlap: {ranges:?}");
    assert!(ranges.iter().all(|range| loaned.start <= range.start && range.end <= loaned.end), "outside the loan");

    // All filled as asked, after all were filled; and again with other values, written through the slices.
    assert!(took.iter().zip(terms).all(|(slice, asked)| slice.holds(asked.seed, asked.step)));
    took.iter_mut().zip(terms).for_each(|(slice, asked)| slice.fill(!asked.seed, 3));
    assert!(took.iter().zip(terms).all(|(slice, asked)| slice.holds(!asked.seed, 3)));
}

/// Takes from `bytes` bytes at a multiple of 64: each term that fits what is left is there, and each other one an error.
fn check_short(terms: &[Asked], bytes: usize) -> usize {
    let mut buffer = Vec::new();
    let (took, arena_left, used) = carve(terms, loan(&mut buffer, 0, bytes));
    let mut left = bytes / 64 * 64;
    let mut refused = 0;
    for ((asked, name), took) in terms.iter().zip(NAMES.iter().cycle()).zip(took) {
        let needed = bytes_by_hand(asked);
        if needed <= left {
            left -= needed;
            assert!(took.is_ok_and(|slice| slice.holds(asked.seed, asked.step)));
        } else {
            refused += 1;
            let expected = Short { term: name, needed_bytes: needed as u64, left_bytes: left as u64 };
            assert_eq!(took.err(), Some(expected));
        }
    }
    assert_eq!((arena_left, used), (left, bytes / 64 * 64 - left));
    refused
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn exactly_the_sum_suffices_and_a_byte_less_does_not(
        terms in prop::collection::vec(asked(), 0..12),
        start in 0usize..64,
        share in 0usize..100,
    ) {
        let mut sum = Sum::new();
        for (asked, name) in terms.iter().zip(NAMES.iter().cycle()) {
            (KINDS[asked.kind].add)(&mut sum, name, asked.count);
        }
        let total = sum.total_bytes() as usize;
        prop_assert_eq!(total, terms.iter().map(bytes_by_hand).sum::<usize>());
        for ((asked, name), term) in terms.iter().zip(NAMES.iter().cycle()).zip(sum.terms()) {
            let (bytes, count) = (bytes_by_hand(asked) as u64, asked.count as u64);
            let expected = Term { name, bytes, count, bytes_each: KINDS[asked.kind].bytes as u64 };
            prop_assert_eq!(*term, expected);
        }
        check_suffices(&terms, total, 0, total);
        check_suffices(&terms, total, start, total + 63);
        if total > 0 {
            // All terms before the last one that takes anything fit: that one does not.
            prop_assert_eq!(check_short(&terms, total - 1), 1);
        }
        check_short(&terms, total * share / 100);
    }
}

#[test]
fn every_start_costs_less_than_a_line() {
    let mut buffer = Vec::new();
    for start in 0..64 {
        for bytes in 0..300usize {
            let arena = Arena::new(loan(&mut buffer, start, bytes));
            let lost = (64 - start) % 64;
            assert_eq!((arena.left(), arena.used()), (bytes.saturating_sub(lost) / 64 * 64, 0), "{start} {bytes}");
        }
    }
}

#[test]
fn what_is_no_number_of_bytes_is_an_error() {
    let mut buffer = Vec::new();
    let mut arena = Arena::new(loan(&mut buffer, 0, 1024));
    for count in [usize::MAX, usize::MAX / 8 + 1, usize::MAX / 8] {
        let short = Short { term: "rays", needed_bytes: u64::MAX, left_bytes: 1024 };
        assert_eq!(arena.take("rays", count, 0u64), Err(short));
        let mut sum = Sum::new();
        sum.add::<u64>("rays", count);
        assert_eq!((sum.terms()[0].bytes, sum.total_bytes()), (u64::MAX, u64::MAX));
        sum.add::<u64>("more", 1);
        assert_eq!(sum.total_bytes(), u64::MAX);
    }
    let short = arena.take_with("bytes", isize::MAX as usize, |_| -> u8 { panic!("called") }).unwrap_err();
    assert_eq!(short.needed_bytes, 1 << 63);
    assert_eq!(short.to_string(), "too little memory: bytes needs 9223372036854775808 bytes, and 1024 are left");
    assert_eq!((arena.left(), arena.seal()), (1024, 0));
}

#[test]
fn slices_stay_when_the_arena_is_sealed() {
    let mut buffer = Vec::new();
    let mut arena = Arena::new(loan(&mut buffer, 1, 3 * LINE_BYTES));
    let a = arena.take("a", 4, 1u32).unwrap();
    let b = arena.take_with("b", 4, |i| i).unwrap();
    assert_eq!(format!("{arena:?}"), "Arena { used: 128, left: 0 }");
    assert_eq!(arena.seal(), 2 * LINE_BYTES);
    a[3] = 7;
    b[0] = 9;
    assert_eq!((&*a, &*b), (&[1, 1, 1, 7][..], &[9, 1, 2, 3][..]));
}

#[test]
#[should_panic(expected = "no room for one too many")]
fn a_sum_has_a_limit_of_terms() {
    let mut sum = Sum::default();
    (0..TERMS_MAX).for_each(|_| sum.add::<u8>("term", 1));
    assert_eq!((sum.terms().len(), sum.total_bytes()), (32, 32 * 64));
    sum.add::<u8>("one too many", 1);
}
