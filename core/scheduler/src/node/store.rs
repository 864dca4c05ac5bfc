//! Where a node keeps pages: those that it owns, and a cache of others.
//!
//! A page lands in a place that was reserved for it before it was asked for. A page that rays wait for is not given up;
//! among the others the one that was not used for longest goes (second chance). The last places are kept aside for the
//! lane: as many as one hit needs pages, so that one ray can always be finished on the spot (DESIGN section 2, law 3). They
//! are given out in turn, so that what the lane asked for stays until it has asked for as many others.

use crate::rules::{self, PlaceState};
use core::cell::Cell;
use hybray_scene::{Line, PageEntry, PageView, Pages, Tables, Texels, lines_for};

/// Pages at hand, and room for more.
pub trait Store: Pages {
    /// The bytes of a page that is at hand, to be sent to others.
    fn bytes(&self, page: u32) -> Option<&[u8]>;

    /// Whether rays that wait for `page` can go on.
    fn is_at_hand(&self, page: u32) -> bool {
        self.nearest(page).is_some() || self.texels(page).is_some()
    }

    /// Reserves a place for `page`; false if there is none now. `keep` says which pages must stay. The lane may take the
    /// place that is kept for it.
    fn reserve(&mut self, page: u32, for_lane: bool, keep: &dyn Fn(u32) -> bool) -> bool;

    /// Lets all rays have a page that was here for shadow rays alone; false if it is none.
    fn open(&mut self, page: u32) -> bool;

    /// Puts a part of `page` into its place.
    fn land(&mut self, page: u32, offset: usize, part: &[u8]) -> Landed;

    /// Bytes of pages that have a place here.
    fn bytes_held(&self) -> u64;
}

/// What became of a part of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Landed {
    /// More is to come.
    Part,
    /// The page is at hand.
    Whole,
    /// It is no page, or nobody asked for it: its place is free again.
    Refused,
}

/// Every page of a scene, shared: those of texels behind the others.
#[derive(Clone, Copy)]
pub struct All<'a>(pub &'a [PageView<'a>], pub &'a [Texels<'a>]);

impl Pages for All<'_> {
    const ALL: bool = true;

    #[inline(always)]
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.0.get(number as usize).copied()
    }

    fn texels(&self, number: u32) -> Option<Texels<'_>> {
        (number as usize).checked_sub(self.0.len()).and_then(|number| self.1.get(number)).copied()
    }
}

impl Store for All<'_> {
    fn bytes(&self, _: u32) -> Option<&[u8]> {
        None
    }
    fn reserve(&mut self, _: u32, _: bool, _: &dyn Fn(u32) -> bool) -> bool {
        false
    }
    fn open(&mut self, _: u32) -> bool {
        false
    }
    fn land(&mut self, _: u32, _: usize, _: &[u8]) -> Landed {
        Landed::Refused
    }
    fn bytes_held(&self) -> u64 {
        0
    }
}

/// Where the bytes of pages are.
pub trait Backing {
    /// The page whose first line is `line`.
    fn view(&self, page: u32, line: usize) -> PageView<'_>;
    /// The same, if it is one of texels.
    fn texels(&self, page: u32, line: usize) -> Texels<'_> {
        Texels::of_valid(self.bytes(page, line))
    }
    /// Its bytes.
    fn bytes(&self, page: u32, line: usize) -> &[u8];
    /// Writes a part of it; false if it does not belong there.
    fn write(&mut self, page: u32, line: usize, offset: usize, part: &[u8]) -> bool;
    /// Whether what was written is a page of this kind.
    fn is_page(&self, page: u32, line: usize, kind: u16) -> bool;
}

/// Pages in memory of one's own, validated as they land.
pub struct Own<'m> {
    /// Carved for it.
    pub lines: &'m mut [Line],
    /// What pages may refer to.
    pub tables: Tables,
}

impl Backing for Own<'_> {
    #[inline(always)]
    fn view(&self, _: u32, line: usize) -> PageView<'_> {
        PageView::of_valid(&self.lines[line..])
    }
    fn bytes(&self, _: u32, line: usize) -> &[u8] {
        // The second word of a page of either kind.
        let bytes: &[u8] = bytemuck::cast_slice(&self.lines[line..]);
        &bytes[..bytemuck::pod_read_unaligned::<u32>(&bytes[4..8]) as usize]
    }
    fn write(&mut self, _: u32, line: usize, offset: usize, part: &[u8]) -> bool {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut self.lines[line..]);
        let room = offset.checked_add(part.len()).and_then(|end| bytes.get_mut(offset..end));
        room.map(|room| room.copy_from_slice(part)).is_some()
    }
    fn is_page(&self, _: u32, line: usize, kind: u16) -> bool {
        let lines = &self.lines[line..];
        if kind == PageEntry::TEXELS {
            Texels::parse(bytemuck::cast_slice(lines)).is_ok()
        } else {
            PageView::parse(lines, self.tables).is_ok()
        }
    }
}

/// Pages that are charged their bytes but refer to the one copy that the process has: for thousands of simulated nodes.
pub struct Charged<'a>(pub &'a [PageView<'a>], pub &'a [&'a [u8]]);

impl Backing for Charged<'_> {
    #[inline(always)]
    fn view(&self, page: u32, _: usize) -> PageView<'_> {
        self.0[page as usize]
    }
    fn bytes(&self, page: u32, _: usize) -> &[u8] {
        self.1[page as usize]
    }
    fn write(&mut self, page: u32, _: usize, offset: usize, part: &[u8]) -> bool {
        let all = self.1[page as usize];
        let there = offset.checked_add(part.len()).and_then(|end| all.get(offset..end));
        debug_assert!(there.is_none_or(|there| there == part), "page {page} came changed");
        there.is_some()
    }
    fn is_page(&self, _: u32, _: usize, _: u16) -> bool {
        true
    }
}

/// A place in the cache.
#[derive(Clone, Debug)]
pub struct Place {
    /// The page in it; [`NOWHERE`] if it is free.
    page: u32,
    /// Bytes that have landed; [`WHOLE`] when the page is at hand.
    landed: u32,
    /// It was used since the hand passed.
    used: Cell<bool>,
}

impl Place {
    /// A place without a page.
    #[must_use]
    pub const fn free() -> Self {
        Self { page: NOWHERE, landed: 0, used: Cell::new(false) }
    }

    fn state(&self) -> PlaceState {
        match (self.page, self.landed) {
            (NOWHERE, _) => PlaceState::Free,
            (_, WHOLE) => PlaceState::Whole,
            _ => PlaceState::Landing,
        }
    }
}

const NOWHERE: u32 = u32::MAX;
const WHOLE: u32 = u32::MAX;
/// Tag of pages in the cache: the rest is the number of the place. Of others, the rest is their first line.
const CACHED: u32 = 1 << 31;
/// Tag of pages that shadow rays alone may have.
const SHADOWS: u32 = 1 << 30;
/// Tag of pages of texels; [`NOWHERE`] has it, too.
const TEXELS: u32 = 1 << 29;

/// Pages that a node owns (or was given in advance), packed one behind the other, and behind them a cache of places of
/// equal size.
pub struct Cache<'m, B> {
    backing: B,
    /// Bytes of each page of the scene.
    sizes: &'m [PageEntry],
    /// Of the directory.
    parents: &'m [u32],
    /// For each page of the scene: where it is.
    at: &'m mut [u32],
    places: &'m mut [Place],
    place_lines: usize,
    /// The last so many places are the lane's, and the next of them that it is given.
    lanes: usize,
    lane_hand: usize,
    /// Lines in use by pages that stay.
    fixed: usize,
    hand: usize,
    held: u64,
}

impl<'m, B: Backing> Cache<'m, B> {
    /// An empty store. `at` has one entry for each page of the scene; the cache's `places` of `place_bytes` each come
    /// behind the first `fixed_lines` lines. The last `lanes` places are the lane's.
    pub fn new(
        backing: B,
        sizes: &'m [PageEntry],
        parents: &'m [u32],
        at: &'m mut [u32],
        places: &'m mut [Place],
        place_bytes: usize,
        lanes: usize,
    ) -> Self {
        at.fill(NOWHERE);
        places.fill_with(Place::free);
        let place_lines = lines_for(place_bytes);
        Self { backing, sizes, parents, at, places, place_lines, lanes, lane_hand: 0, fixed: 0, hand: 0, held: 0 }
    }

    /// [`TEXELS`], if it has them.
    fn tag(&self, page: u32) -> u32 {
        if self.sizes[page as usize].kind == PageEntry::TEXELS { TEXELS } else { 0 }
    }

    /// Gives a page its place for good, before the start.
    fn keep(&mut self, page: u32, bytes: usize) {
        self.at[page as usize] = (self.places.len() * self.place_lines + self.fixed) as u32 | self.tag(page);
        self.fixed += lines_for(bytes);
        self.held += bytes as u64;
    }

    fn line(&self, place: usize) -> usize {
        place * self.place_lines
    }

    /// The first line of a page that is at hand, if it is one of texels or if it is not.
    #[inline(always)]
    fn line_of<const TEXEL: bool>(&self, page: u32) -> Option<usize> {
        let at = *self.at.get(page as usize)?;
        if if TEXEL { at == NOWHERE || at & TEXELS == 0 } else { at & TEXELS != 0 } {
            return None;
        }
        if at & CACHED == 0 {
            return Some((at & !(SHADOWS | TEXELS)) as usize);
        }
        let place = (at & !(CACHED | TEXELS)) as usize;
        self.places[place].used.set(true);
        (self.places[place].landed == WHOLE).then(|| self.line(place))
    }

    /// Keeps a page that was put here for shadow rays alone: other rays go where it is owned.
    pub fn for_shadows(&mut self, page: u32) {
        self.at[page as usize] |= SHADOWS;
    }

    fn is_for_shadows(&self, page: u32) -> bool {
        self.at.get(page as usize).is_some_and(|at| at & (CACHED | SHADOWS) == SHADOWS)
    }

    fn free(&mut self, place: usize) {
        let page = core::mem::replace(&mut self.places[place], Place::free()).page;
        if page != NOWHERE {
            self.at[page as usize] = NOWHERE;
            self.held -= u64::from(self.sizes[page as usize].bytes);
        }
    }
}

impl Cache<'_, Own<'_>> {
    /// Puts a page here for good, before the start; false if it is no page, or there is no room for it behind the cache.
    pub fn put(&mut self, page: u32, bytes: &[u8]) -> bool {
        let line = self.places.len() * self.place_lines + self.fixed;
        let fits = line + lines_for(bytes.len()) <= self.backing.lines.len();
        let kind = self.sizes[page as usize].kind;
        if !fits || !self.backing.write(page, line, 0, bytes) || !self.backing.is_page(page, line, kind) {
            return false;
        }
        self.keep(page, bytes.len());
        true
    }
}

impl Cache<'_, Charged<'_>> {
    /// Charges for a page that stays.
    pub fn put(&mut self, page: u32, bytes: usize) {
        self.keep(page, bytes);
    }
}

impl<B: Backing> Pages for Cache<'_, B> {
    #[inline(always)]
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.line_of::<false>(number).map(|line| self.backing.view(number, line))
    }

    fn texels(&self, number: u32) -> Option<Texels<'_>> {
        self.line_of::<true>(number).map(|line| self.backing.texels(number, line))
    }

    #[inline(always)]
    fn nearest(&self, number: u32) -> Option<PageView<'_>> {
        if self.is_for_shadows(number) { None } else { self.page(number) }
    }

    fn parents(&self) -> &[u32] {
        self.parents
    }
}

impl<B: Backing> Store for Cache<'_, B> {
    fn bytes(&self, page: u32) -> Option<&[u8]> {
        let line = self.line_of::<false>(page).or_else(|| self.line_of::<true>(page));
        line.map(|line| self.backing.bytes(page, line))
    }

    fn reserve(&mut self, page: u32, for_lane: bool, keep: &dyn Fn(u32) -> bool) -> bool {
        let size = self.sizes[page as usize].bytes;
        if self.at[page as usize] != NOWHERE || lines_for(size as usize) > self.place_lines {
            return false;
        }
        let places = self.places.len();
        let Some(common) = places.checked_sub(self.lanes) else { return false };
        let can_go = |place: &Place| rules::can_go(place.state(), place.page != NOWHERE && keep(place.page));
        // Second chance: the hand goes round twice at most.
        let mut found = None;
        // Where a hit needs several pages at once, the lane keeps to its own places.
        let tries = if for_lane && self.lanes > 1 { 0 } else { 2 * common };
        for _ in 0..tries {
            let at = self.hand;
            self.hand = (self.hand + 1) % common;
            let place = &self.places[at];
            if !can_go(place) {
                continue;
            }
            if place.page == NOWHERE || !place.used.replace(false) {
                found = Some(at);
                break;
            }
        }
        let lanes = common + self.lane_hand;
        let lane_can = || for_lane && rules::lane_can_have(self.places[lanes].state());
        let found = found.or_else(|| lane_can().then_some(lanes));
        let Some(place) = found else { return false };
        if place == lanes {
            self.lane_hand = (self.lane_hand + 1) % self.lanes;
        }
        self.free(place);
        self.places[place] = Place { page, landed: 0, used: Cell::new(true) };
        self.at[page as usize] = CACHED | place as u32 | self.tag(page);
        self.held += u64::from(size);
        true
    }

    fn open(&mut self, page: u32) -> bool {
        let opens = self.is_for_shadows(page);
        if opens {
            self.at[page as usize] &= !SHADOWS;
        }
        opens
    }

    fn land(&mut self, page: u32, offset: usize, part: &[u8]) -> Landed {
        let at = self.at.get(page as usize).copied().unwrap_or(NOWHERE);
        if at == NOWHERE || at & CACHED == 0 {
            return Landed::Refused;
        }
        let place = (at & !(CACHED | TEXELS)) as usize;
        if self.places[place].landed == WHOLE {
            return Landed::Refused;
        }
        let size = self.sizes[page as usize].bytes as usize;
        let line = self.line(place);
        // From the start again if its sender was lost, and its home sends it.
        let goes_on = offset == 0 || offset == self.places[place].landed as usize;
        let in_order = goes_on && !part.is_empty() && offset + part.len() <= size;
        if !in_order || !self.backing.write(page, line, offset, part) {
            self.free(place);
            return Landed::Refused;
        }
        self.places[place].landed = (offset + part.len()) as u32;
        if offset + part.len() < size {
            return Landed::Part;
        }
        if !self.backing.is_page(page, line, self.sizes[page as usize].kind)
            || self.backing.bytes(page, line).len() != size
        {
            self.free(place);
            return Landed::Refused;
        }
        self.places[place].landed = WHOLE;
        Landed::Whole
    }

    fn bytes_held(&self) -> u64 {
        self.held
    }
}
