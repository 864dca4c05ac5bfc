//! One queue in a slice: first in, first out.

use core::fmt;

/// A queue of as many items as the slice that was lent to it. What the slice held before is not looked at.
pub struct Ring<'m, T: Copy> {
    items: &'m mut [T],
    /// Where the first item is.
    head: usize,
    len: usize,
    high_water: usize,
}

impl<'m, T: Copy> Ring<'m, T> {
    /// An empty queue.
    #[must_use]
    pub fn new(items: &'m mut [T]) -> Self {
        Self { items, head: 0, len: 0, high_water: 0 }
    }

    /// Appends an item.
    ///
    /// # Errors
    /// The item, if the queue is full.
    pub fn push_back(&mut self, item: T) -> Result<(), T> {
        if self.is_full() {
            return Err(item);
        }
        let to_end = self.items.len() - self.head;
        let at = if self.len < to_end { self.head + self.len } else { self.len - to_end };
        self.items[at] = item;
        self.len += 1;
        self.high_water = self.high_water.max(self.len);
        Ok(())
    }

    /// Takes the first item out.
    pub fn pop_front(&mut self) -> Option<T> {
        let item = *self.front()?;
        self.head = if self.head + 1 < self.items.len() { self.head + 1 } else { 0 };
        self.len -= 1;
        Some(item)
    }

    /// The first item.
    #[must_use]
    pub fn front(&self) -> Option<&T> {
        self.iter().next()
    }

    /// The items, first to last.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        let (before, from) = self.items.split_at(self.head);
        let straight = self.len.min(from.len());
        from[..straight].iter().chain(&before[..self.len - straight])
    }

    /// Items in the queue.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no item.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether the next item would be handed back.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.len == self.items.len()
    }

    /// Items that fit.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.items.len()
    }

    /// The most items that were ever in the queue at once.
    #[must_use]
    pub fn high_water(&self) -> usize {
        self.high_water
    }
}

impl<T: Copy + fmt::Debug> fmt::Debug for Ring<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
