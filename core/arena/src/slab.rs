//! Many queues in one pool: each item is in one list, and a list takes no room but that of its items.
//!
//! The pool is two slices of the same length, items and links. Places that were never used stand behind those that were,
//! and a place that became free is used again before one of them: so making a pool touches no memory, and how far the used
//! places reach is the most that were ever in use.

use core::fmt;
use core::mem::size_of;

/// The link of the last item, and of no item.
const NONE: u32 = u32::MAX;

/// A queue of items in a [`Slab`]: 12 bytes, to be kept wherever the queue belongs.
///
/// It belongs to the slab that it was first pushed to, and is of no use with another. It is plain data, so that it can be
/// in a table that is itself a slice of an arena; but of two copies only one may go on being used. A list that is
/// forgotten keeps its items' places for ever. A slab that is given a wrong list may answer with wrong items or panic; it
/// never touches other memory, and every method still ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct List {
    head: u32,
    tail: u32,
    len: u32,
}

const _: () = assert!(size_of::<List>() == 12);

impl List {
    /// A list of nothing, of any slab.
    pub const EMPTY: Self = Self { head: NONE, tail: NONE, len: 0 };

    /// Items in the list.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Whether there is no item.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl Default for List {
    fn default() -> Self {
        Self::EMPTY
    }
}

/// A pool of items in any number of [`List`]s. Every method takes the same time however many there are, but for
/// [`split_front`](Self::split_front).
pub struct Slab<'m, T: Copy> {
    items: &'m mut [T],
    /// For each place the next one of its list, or of those that are free again.
    next: &'m mut [u32],
    /// The places that are free again, last freed first.
    freed: List,
    /// Places that have ever been used: the first so many.
    touched: u32,
}

impl<'m, T: Copy> Slab<'m, T> {
    /// A pool without items. What the slices hold is not looked at.
    ///
    /// # Panics
    /// If the slices differ in length, or have more than `u32::MAX` elements.
    #[must_use]
    pub fn new(items: &'m mut [T], next: &'m mut [u32]) -> Self {
        assert_eq!(items.len(), next.len(), "a slab has one link for each item");
        assert!(u32::try_from(items.len()).is_ok(), "a slab has at most {} items", u32::MAX);
        Self { items, next, freed: List::EMPTY, touched: 0 }
    }

    /// Appends an item to a list.
    ///
    /// # Errors
    /// The item, if no place is free.
    pub fn push_back(&mut self, list: &mut List, item: T) -> Result<(), T> {
        let mut one = self.place(item)?;
        self.append(list, &mut one);
        Ok(())
    }

    /// Puts an item before all others of a list.
    ///
    /// # Errors
    /// The item, if no place is free.
    pub fn push_front(&mut self, list: &mut List, item: T) -> Result<(), T> {
        let mut one = self.place(item)?;
        self.append(&mut one, list);
        *list = one;
        Ok(())
    }

    /// Takes the first item of a list out, and frees its place.
    pub fn pop_front(&mut self, list: &mut List) -> Option<T> {
        let mut one = cut_first(self.next, list)?;
        let item = self.items[one.head as usize];
        join(self.next, &mut one, &mut self.freed);
        self.freed = one;
        Some(item)
    }

    /// Takes all items out, whatever lists they are in: these are of no use any more, and must be given up for empty ones. It
    /// takes time for each place that was ever used.
    pub fn clear(&mut self) {
        let links = self.next.iter_mut().zip(1..).take(self.touched as usize);
        links.for_each(|(link, next)| *link = if next == self.touched { NONE } else { next });
        if self.touched > 0 {
            self.freed = List { head: 0, tail: self.touched - 1, len: self.touched };
        }
    }

    /// The last item of a list.
    pub fn back_mut(&mut self, list: &List) -> Option<&mut T> {
        if list.is_empty() { None } else { Some(&mut self.items[list.tail as usize]) }
    }

    /// Moves all items of `from`, in their order, to the end of `to`.
    pub fn append(&mut self, to: &mut List, from: &mut List) {
        join(self.next, to, from);
    }

    /// Cuts the first `count` items off as a list of their own, or all if there are fewer. It takes time for each of them.
    #[must_use = "the items that were cut off are in no other list"]
    pub fn split_front(&mut self, list: &mut List, count: usize) -> List {
        if count >= list.len() {
            return core::mem::take(list);
        }
        if count == 0 {
            return List::EMPTY;
        }
        let tail = (1..count).fold(list.head, |at, _| self.next[at as usize]);
        let front = List { head: list.head, tail, len: count as u32 };
        *list = List { head: self.next[tail as usize], tail: list.tail, len: list.len - front.len };
        self.next[tail as usize] = NONE;
        front
    }

    /// The items of a list, first to last.
    pub fn iter(&self, list: &List) -> impl Iterator<Item = &T> {
        let mut at = list.head as usize;
        (0..list.len).map(move |_| {
            let item = &self.items[at];
            at = self.next[at] as usize;
            item
        })
    }

    /// Items that can still be pushed.
    #[must_use]
    pub fn free(&self) -> usize {
        self.capacity() - self.touched as usize + self.freed.len()
    }

    /// Items that fit.
    #[must_use]
    pub fn capacity(&self) -> usize {
        self.items.len()
    }

    /// The most items that were ever in the pool at once.
    #[must_use]
    pub fn high_water(&self) -> usize {
        self.touched as usize
    }

    /// A list of one item, in a place that was free.
    fn place(&mut self, item: T) -> Result<List, T> {
        let one = match cut_first(self.next, &mut self.freed) {
            Some(one) => one,
            None if self.high_water() == self.capacity() => return Err(item),
            None => {
                self.touched += 1;
                List { head: self.touched - 1, tail: self.touched - 1, len: 1 }
            }
        };
        self.items[one.head as usize] = item;
        self.next[one.head as usize] = NONE;
        Ok(one)
    }
}

impl<T: Copy> fmt::Debug for Slab<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (free, capacity, high_water) = (self.free(), self.capacity(), self.high_water());
        write!(f, "Slab {{ free: {free}, capacity: {capacity}, high_water: {high_water} }}")
    }
}

/// The first place of a list as a list of its own.
fn cut_first(next: &mut [u32], list: &mut List) -> Option<List> {
    if list.is_empty() {
        return None;
    }
    let first = List { head: list.head, tail: list.head, len: 1 };
    let rest = core::mem::replace(&mut next[first.head as usize], NONE);
    *list = if list.len == 1 { List::EMPTY } else { List { head: rest, tail: list.tail, len: list.len - 1 } };
    Some(first)
}

/// All of `from` behind `to`.
fn join(next: &mut [u32], to: &mut List, from: &mut List) {
    let from = core::mem::take(from);
    if to.is_empty() {
        *to = from;
    } else if !from.is_empty() {
        next[to.tail as usize] = from.head;
        *to = List { head: to.head, tail: from.tail, len: to.len + from.len };
    }
}
