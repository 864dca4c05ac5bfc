//! From bytes to lines, and from lines to a slice of values: the two casts that an arena is made of, and nothing else.
//!
//! Memory comes as `MaybeUninit`: a value may have padding, which nobody may read as bytes, and a lender of plain `u8`
//! would read it when the loan is over.
#![allow(unsafe_code)]

use crate::LINE_BYTES;
use core::mem::{MaybeUninit, align_of, needs_drop, size_of, size_of_val};
use core::slice;

/// What every slice begins with.
#[repr(C, align(64))]
pub struct Line([MaybeUninit<u8>; LINE_BYTES]);

const _: () = assert!(size_of::<Line>() == LINE_BYTES && align_of::<Line>() == LINE_BYTES);

/// The whole lines in `memory`.
pub fn lines_of(memory: &mut [MaybeUninit<u8>]) -> &mut [Line] {
    // SAFETY: a line is an array of bytes that need not be initialized, so that any 64 bytes at a multiple of 64 are one,
    // and whatever is written to a line leaves bytes that need not be initialized.
    let (_, lines, _) = unsafe { memory.align_to_mut::<Line>() };
    lines
}

/// The first `count` values' room in `lines`, filled with `value(0)`, `value(1)` and so on.
///
/// # Panics
/// If they do not fit.
pub fn fill<T>(lines: &mut [Line], count: usize, mut value: impl FnMut(usize) -> T) -> &mut [T] {
    const {
        assert!(!needs_drop::<T>(), "an arena drops nothing: its values must not need it");
        assert!(align_of::<T>() <= align_of::<Line>(), "a value in an arena is aligned to a line at most");
    }
    let bytes = count.checked_mul(size_of::<T>());
    assert!(bytes.is_some_and(|bytes| bytes <= size_of_val(lines)), "the values do not fit");
    let start = lines.as_mut_ptr();
    // SAFETY: `start` comes from a slice borrowed for as long as the result, mutably and by nobody else, and is aligned to
    // a line, which is enough for a `T`; `count` values fit in that slice; a `MaybeUninit<T>` need not be initialized.
    let room = unsafe { slice::from_raw_parts_mut(start.cast::<MaybeUninit<T>>(), count) };
    for (at, slot) in room.iter_mut().enumerate() {
        slot.write(value(at));
    }
    // SAFETY: the same memory, borrowed through `room` and no longer used through it; each of its `count` values was just
    // written (had `value` panicked, this would not be reached, and a `T` that was written needs no drop).
    unsafe { slice::from_raw_parts_mut(room.as_mut_ptr().cast::<T>(), count) }
}
