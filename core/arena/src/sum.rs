//! What a set of slices takes, term by term, before there is any memory.

use core::mem::size_of;

/// Every slice begins at a multiple of this, and takes a multiple of it: a cache line.
pub const LINE_BYTES: usize = 64;

/// Terms in a sum, at most.
pub const TERMS_MAX: usize = 32;

/// One slice of a sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term {
    /// What it is for.
    pub name: &'static str,
    /// What [`Arena::take`](crate::Arena::take) uses for it: whole lines. `u64::MAX` if that is not a number of bytes.
    pub bytes: u64,
    /// Values in it.
    pub count: u64,
    /// Bytes of one value.
    pub bytes_each: u64,
}

/// The terms that an [`Arena`](crate::Arena) is going to be asked for.
///
/// ```
/// # use hybray_arena::Sum;
/// let mut sum = Sum::new();
/// sum.add::<[f32; 3]>("points", 100);
/// assert_eq!(sum.terms()[0].bytes, 1216); // 1,200 in whole lines
/// ```
#[derive(Clone, Debug)]
pub struct Sum {
    terms: [Term; TERMS_MAX],
    len: usize,
}

impl Sum {
    /// A sum of nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { terms: [Term { name: "", bytes: 0, count: 0, bytes_each: 0 }; TERMS_MAX], len: 0 }
    }

    /// Adds a slice of `count` values.
    ///
    /// # Panics
    /// If there are [`TERMS_MAX`] terms already: how many there are is a matter of code, not of input.
    pub fn add<T>(&mut self, term: &'static str, count: usize) {
        assert!(self.len < TERMS_MAX, "a sum has at most {TERMS_MAX} terms: no room for {term}");
        self.terms[self.len] =
            Term { name: term, bytes: bytes_of::<T>(count), count: count as u64, bytes_each: size_of::<T>() as u64 };
        self.len += 1;
    }

    /// The terms, in the order in which they were added.
    #[must_use]
    pub fn terms(&self) -> &[Term] {
        &self.terms[..self.len]
    }

    /// The bytes of all terms; `u64::MAX` if that is not a number of bytes.
    #[must_use]
    pub fn total_bytes(&self) -> u64 {
        self.terms().iter().fold(0, |total: u64, term| total.saturating_add(term.bytes))
    }
}

impl Default for Sum {
    fn default() -> Self {
        Self::new()
    }
}

/// The whole lines that hold `count` values, in bytes; `u64::MAX` on overflow, which no memory is large enough for.
pub(crate) fn bytes_of<T>(count: usize) -> u64 {
    let bytes = (count as u64).checked_mul(size_of::<T>() as u64);
    bytes.and_then(|bytes| bytes.checked_next_multiple_of(LINE_BYTES as u64)).unwrap_or(u64::MAX)
}
