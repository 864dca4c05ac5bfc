//! When is a tile finished? (DESIGN section 7)
//!
//! The film debits the ids of a tile's primaries. Each ray, when it ends, adds minus its own id plus the sum of its
//! children's, once, wrapping. The balance is zero when the whole tree has ended, in whatever order the entries came:
//! each id is added once, by the parent or the film, and taken away once, by the ray. Before that it is zero by chance
//! only, with a probability of 2^-64 for each entry; a lost or repeated entry leaves it off zero.

/// What is still owed for a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Balance(u64);

impl Balance {
    /// Nothing is owed.
    pub const ZERO: Self = Self(0);

    /// A tile whose primaries have these ids.
    #[must_use]
    pub fn debit(primaries: impl Iterator<Item = u64>) -> Self {
        Self(primaries.fold(0, u64::wrapping_add))
    }

    /// Adds an entry, or a sum of entries.
    pub fn add(&mut self, entry: u64) {
        self.0 = self.0.wrapping_add(entry);
    }

    /// Whether every ray has ended.
    #[must_use]
    pub const fn is_zero(self) -> bool {
        self.0 == 0
    }
}
