//! Carve and seal: all memory of a node, cut once from one loan.

use crate::carve::{Line, fill, lines_of};
use crate::sum::{LINE_BYTES, bytes_of};
use core::mem::MaybeUninit;
use core::{error, fmt};

/// A loan of memory that is cut into slices from its beginning on, and never takes one back.
///
/// A slice lives as long as the loan, not as long as the arena: it stays when the arena is sealed. Nothing in it is ever
/// dropped.
///
/// Sealing is the end of the arena, so that to take after it does not compile:
///
/// ```compile_fail,E0382
/// # use hybray_arena::Arena;
/// let mut arena = Arena::new(&mut []);
/// let used = arena.seal();
/// let late = arena.take("late", 1, 0u8);
/// ```
///
/// Nor does a value that would have to be dropped:
///
/// ```compile_fail,E0080
/// # use hybray_arena::Arena;
/// let mut arena = Arena::new(&mut []);
/// let names = arena.take_with("names", 1, |_| String::new());
/// ```
///
/// Nor does a slice that outlives its memory:
///
/// ```compile_fail,E0597
/// # use hybray_arena::Arena;
/// let numbers = {
///     let mut memory = Box::new_uninit_slice(1024);
///     Arena::new(&mut memory).take("numbers", 10, 0u32).unwrap()
/// };
/// numbers[0] = 1;
/// ```
pub struct Arena<'m> {
    left: &'m mut [Line],
    used_lines: usize,
}

impl<'m> Arena<'m> {
    /// An arena of the whole lines of `memory`, wherever it begins.
    ///
    /// [`Sum::total_bytes`](crate::Sum::total_bytes) bytes suffice for a sum if they begin at a multiple of
    /// [`LINE_BYTES`], and 63 more wherever they begin.
    #[must_use]
    pub fn new(memory: &'m mut [MaybeUninit<u8>]) -> Self {
        Self { left: lines_of(memory), used_lines: 0 }
    }

    /// A slice of `count` times `value`, beginning at a multiple of [`LINE_BYTES`]. `term` is its name in an error.
    ///
    /// # Errors
    /// When it does not fit. The arena is as it was, and something smaller may fit.
    pub fn take<T: Copy>(&mut self, term: &'static str, count: usize, value: T) -> Result<&'m mut [T], Short> {
        self.take_with(term, count, |_| value)
    }

    /// As [`take`](Self::take), with `value(i)` in place `i`. A `T` that needs to be dropped, or is aligned to more than
    /// [`LINE_BYTES`], does not compile.
    ///
    /// # Errors
    /// As [`take`](Self::take); then `value` has not been called.
    pub fn take_with<T>(
        &mut self,
        term: &'static str,
        count: usize,
        value: impl FnMut(usize) -> T,
    ) -> Result<&'m mut [T], Short> {
        let needed_bytes = bytes_of::<T>(count);
        let lines = usize::try_from(needed_bytes / LINE_BYTES as u64).ok();
        let Some(lines) = lines.and_then(|lines| self.left.split_off_mut(..lines)) else {
            return Err(Short { term, needed_bytes, left_bytes: self.left() as u64 });
        };
        self.used_lines += lines.len();
        Ok(fill(lines, count, value))
    }

    /// Bytes that can still be taken.
    #[must_use]
    pub fn left(&self) -> usize {
        self.left.len() * LINE_BYTES
    }

    /// Bytes that have been taken.
    #[must_use]
    pub fn used(&self) -> usize {
        self.used_lines * LINE_BYTES
    }

    /// Ends the carving: nothing can be taken any more. The bytes that were.
    #[must_use = "an arena that is only dropped is sealed too, and its sum is not seen"]
    pub fn seal(self) -> usize {
        self.used()
    }
}

impl fmt::Debug for Arena<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Arena").field("used", &self.used()).field("left", &self.left()).finish()
    }
}

/// A term for which too little memory is left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Short {
    /// What it is for.
    pub term: &'static str,
    /// Bytes that it takes; `u64::MAX` if that is not a number of bytes.
    pub needed_bytes: u64,
    /// Bytes that are left.
    pub left_bytes: u64,
}

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { term, needed_bytes, left_bytes } = self;
        write!(f, "too little memory: {term} needs {needed_bytes} bytes, and {left_bytes} are left")
    }
}

impl error::Error for Short {}
