//! Rays that wait: one pool, queued by the page that they need, and by the peer that they are to go to.
//!
//! A record is in exactly one list at a time, and a list is never longer than the pool, so moving records about needs no
//! room. Only a new record does, and a full pool hands it back.

use hybray_arena::{List, Ring, Slab};
use hybray_wire::RayRecord;

/// What is known of a page at a node.
#[derive(Clone, Copy, Debug)]
pub struct PageState {
    /// Rays that need it.
    rays: List,
    /// Its neighbours in the queue of wanted pages, if it is in it.
    before: u32,
    after: u32,
    /// How often rays came to need it: halved now and then.
    pub uses: u16,
    /// It was asked for, and is on its way.
    pub asked: bool,
    /// It is queued as ready.
    ready: bool,
    /// It is queued as wanted.
    wanted: bool,
}

impl PageState {
    /// A page that nobody waits for.
    pub const NEW: Self =
        Self { rays: List::EMPTY, before: NOWHERE, after: NOWHERE, uses: 0, asked: false, ready: false, wanted: false };
}

const NOWHERE: u32 = u32::MAX;
/// Fewer rays than this are not given away.
const GIVEN_MIN: usize = 8;
/// Uses are halved when so many rays have come in: about as many as a page stays in a small cache for.
const AGE_RAYS: usize = 256;

/// The pool.
pub struct Pool<'m> {
    slab: Slab<'m, RayRecord>,
    pages: &'m mut [PageState],
    /// First and last of the pages that rays wait for, that are not at hand and were not asked for: in the order in which
    /// they came to be wanted.
    first_wanted: u32,
    last_wanted: u32,
    /// Pages at hand that rays wait for.
    ready: Ring<'m, u32>,
    /// Rays that wait for pages that are queued as ready.
    ready_rays: usize,
    /// Rays that came in since uses were halved.
    pushed: usize,
}

impl<'m> Pool<'m> {
    /// An empty pool. `pages` and `ready` have one entry for each page of the scene.
    pub fn new(slab: Slab<'m, RayRecord>, pages: &'m mut [PageState], ready: Ring<'m, u32>) -> Self {
        Self { slab, pages, first_wanted: NOWHERE, last_wanted: NOWHERE, ready, ready_rays: 0, pushed: 0 }
    }

    /// No ray waits any more; pages that were asked for still come. Lists elsewhere must be given up. Bounded: the rays and
    /// pages, once.
    pub fn clear(&mut self) {
        self.slab.clear();
        for page in self.pages.iter_mut() {
            *page = PageState { uses: page.uses, asked: page.asked, ..PageState::NEW };
        }
        (self.first_wanted, self.last_wanted) = (NOWHERE, NOWHERE);
        while self.ready.pop_front().is_some() {}
        self.ready_rays = 0;
    }

    /// Records that are free.
    pub fn free(&self) -> usize {
        self.slab.free()
    }

    /// Records in all.
    pub fn capacity(&self) -> usize {
        self.slab.capacity()
    }

    /// Most records ever in use.
    pub fn high_water(&self) -> usize {
        self.slab.high_water()
    }

    /// Records in use.
    pub fn len(&self) -> usize {
        self.slab.capacity() - self.slab.free()
    }

    /// Rays whose pages are at hand.
    pub fn ready_rays(&self) -> usize {
        self.ready_rays
    }

    /// What is known of a page.
    pub fn page(&mut self, page: u32) -> &mut PageState {
        &mut self.pages[page as usize]
    }

    /// Rays that wait for a page.
    pub fn waiting(&self, page: u32) -> usize {
        self.pages[page as usize].rays.len()
    }

    /// The oldest ray that waits for a page.
    pub fn oldest(&self, page: u32) -> Option<&RayRecord> {
        self.slab.iter(&self.pages[page as usize].rays).next()
    }

    /// The page that has been wanted for longest: rays wait for it, it is not at hand and was not asked for.
    pub fn first_wanted(&self) -> Option<u32> {
        (self.first_wanted != NOWHERE).then_some(self.first_wanted)
    }

    /// Whether a page is wanted.
    pub fn is_wanted(&self, page: u32) -> bool {
        self.pages.get(page as usize).is_some_and(|page| page.wanted)
    }

    /// The page that came to be wanted next after `page`.
    pub fn wanted_after(&self, page: u32) -> Option<u32> {
        Some(self.pages[page as usize].after).filter(|&after| after != NOWHERE)
    }

    /// Queues a ray for the page that it names; `at_hand` says whether that is here.
    ///
    /// # Errors
    /// If the pool is full: the ray comes back.
    pub fn push(&mut self, ray: RayRecord, at_hand: bool) -> Result<(), RayRecord> {
        let page = ray.page;
        let rays = &mut self.pages[page as usize].rays;
        // Those that have to stay stand first: while there are any, the others stay with them.
        if ray.moved == 1 {
            self.slab.push_front(rays, ray)?
        } else {
            self.slab.push_back(rays, ray)?
        }
        self.age();
        let state = &mut self.pages[page as usize];
        state.uses = state.uses.saturating_add(1);
        if state.ready {
            self.ready_rays += 1;
        } else if at_hand {
            self.make_ready(page);
        } else {
            self.want(page);
        }
        Ok(())
    }

    fn want(&mut self, page: u32) {
        let before = self.last_wanted;
        let state = &mut self.pages[page as usize];
        if state.wanted || state.asked {
            return;
        }
        (state.wanted, state.before, state.after) = (true, before, NOWHERE);
        self.last_wanted = page;
        match self.pages.get_mut(before as usize) {
            Some(last) => last.after = page,
            None => self.first_wanted = page,
        }
    }

    fn unwant(&mut self, page: u32) {
        let state = &mut self.pages[page as usize];
        if !core::mem::take(&mut state.wanted) {
            return;
        }
        let (before, after) = (state.before, state.after);
        match self.pages.get_mut(before as usize) {
            Some(state) => state.after = after,
            None => self.first_wanted = after,
        }
        match self.pages.get_mut(after as usize) {
            Some(state) => state.before = before,
            None => self.last_wanted = before,
        }
    }

    /// A page is to be asked for: nothing is left to be decided about it.
    pub fn ask(&mut self, page: u32) {
        self.pages[page as usize].asked = true;
        self.unwant(page);
    }

    /// A page that was asked for does not come: the rays that wait for it want it again.
    pub fn comes_not(&mut self, page: u32) {
        self.pages[page as usize].asked = false;
        if self.waiting(page) > 0 && !self.pages[page as usize].ready {
            self.want(page);
        }
    }

    fn make_ready(&mut self, page: u32) {
        let state = &mut self.pages[page as usize];
        if !state.ready && !state.rays.is_empty() {
            state.ready = true;
            self.ready_rays += state.rays.len();
            // One entry for each page, and each page is in it once.
            let _ = self.ready.push_back(page);
        }
    }

    /// A page has come to hand.
    pub fn landed(&mut self, page: u32) {
        self.pages[page as usize].asked = false;
        self.unwant(page);
        self.make_ready(page);
    }

    /// A page that is at hand and that rays wait for: the one that has been ready for longest.
    pub fn ready_page(&self) -> Option<u32> {
        self.ready.front().copied()
    }

    /// The oldest ray of the page that is ready for longest.
    pub fn pop_ready(&mut self) -> Option<RayRecord> {
        let page = self.ready_page()?;
        let state = &mut self.pages[page as usize];
        let ray = self.slab.pop_front(&mut state.rays);
        if state.rays.is_empty() {
            state.ready = false;
            self.ready.pop_front();
        }
        self.ready_rays -= usize::from(ray.is_some());
        ray
    }

    /// Moves half of the rays of the page at hand that most of them wait for, and at most `most`, to the end of `list`:
    /// for a node that has nothing to do. Few are not worth a page, and those that have moved since their last page stay.
    /// Returns how many. Bounded: the ready pages, and the rays of one.
    pub fn give(&mut self, list: &mut List, most: usize) -> usize {
        let Some(&page) = self.ready.iter().max_by_key(|&&page| self.waiting(page)) else { return 0 };
        let rays = &mut self.pages[page as usize].rays;
        let stay = self.slab.iter(rays).take_while(|ray| ray.moved == 1).count();
        let count = (rays.len() / 2).min(rays.len() - stay).min(most);
        if count < GIVEN_MIN {
            return 0;
        }
        let mut stay = self.slab.split_front(rays, stay);
        let mut given = self.slab.split_front(rays, count);
        self.slab.append(&mut stay, rays);
        *rays = stay;
        self.ready_rays -= count;
        for _ in 0..count {
            let Some(ray) = self.slab.pop_front(&mut given) else { break };
            // Its place was free this moment.
            let _ = self.slab.push_back(list, RayRecord { moved: 1, ..ray });
        }
        count
    }

    /// The page that was ready for longest is no longer at hand: its rays wait for it again.
    pub fn not_ready(&mut self) {
        let Some(page) = self.ready.pop_front() else { return };
        self.pages[page as usize].ready = false;
        let waiting = self.waiting(page);
        self.ready_rays -= waiting;
        if waiting > 0 {
            self.want(page);
        }
    }

    /// Moves all rays that wait for `page` to the end of `list`.
    pub fn move_to(&mut self, page: u32, list: &mut List) {
        self.slab.append(list, &mut self.pages[page as usize].rays);
        self.unwant(page);
    }

    /// Takes the first `count` records of a list, as a list.
    pub fn split_front(&mut self, list: &mut List, count: usize) -> List {
        self.slab.split_front(list, count)
    }

    /// Puts `front` back before what is in `list`.
    pub fn put_back(&mut self, list: &mut List, mut front: List) {
        self.slab.append(&mut front, list);
        *list = front;
    }

    /// The records of a list.
    pub fn iter(&self, list: &List) -> impl Iterator<Item = &RayRecord> {
        self.slab.iter(list)
    }

    /// Takes the first record out of a list.
    pub fn pop(&mut self, list: &mut List) -> Option<RayRecord> {
        self.slab.pop_front(list)
    }

    /// Puts a record into a list.
    ///
    /// # Errors
    /// If the pool is full: the ray comes back.
    pub fn push_to(&mut self, list: &mut List, ray: RayRecord) -> Result<(), RayRecord> {
        self.slab.push_back(list, ray)
    }

    /// Halves how often pages were used, every so many rays: what was wanted long ago says little.
    fn age(&mut self) {
        self.pushed += 1;
        if self.pushed >= AGE_RAYS {
            self.pushed = 0;
            self.pages.iter_mut().for_each(|page| page.uses /= 2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    const PAGES: u32 = 6;
    const RAYS: usize = 64;

    fn ray(page: u32, moved: u8) -> RayRecord {
        RayRecord { page, moved, ..bytemuck::Zeroable::zeroed() }
    }

    /// Runs `test` with an empty pool.
    fn with_pool(test: impl FnOnce(&mut Pool<'_>)) {
        let (mut rays, mut next) = ([ray(0, 0); RAYS], [0; RAYS]);
        let (mut pages, mut ready) = ([PageState::NEW; PAGES as usize], [0; PAGES as usize]);
        test(&mut Pool::new(Slab::new(&mut rays, &mut next), &mut pages, Ring::new(&mut ready)));
    }

    fn wanted(pool: &Pool<'_>) -> Vec<u32> {
        std::iter::successors(pool.first_wanted(), |&page| pool.wanted_after(page)).collect()
    }

    /// Against a plain list: whatever comes, lands, goes and does not come, the order is that of coming.
    #[test]
    fn pages_are_wanted_in_the_order_in_which_they_came_to_be() {
        with_pool(|pool| {
            let (mut expected, mut asked) = (Vec::new(), Vec::new());
            let (mut seed, mut list) = (1u32, List::EMPTY);
            for _ in 0..5000 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let page = (seed >> 8) % PAGES;
                let (is_wanted, is_asked) = (expected.contains(&page), asked.contains(&page));
                match seed >> 29 {
                    0..4 if pool.push(ray(page, 0), false).is_ok() && !is_wanted && !is_asked => expected.push(page),
                    4 if is_wanted => {
                        pool.ask(page);
                        asked.push(page);
                    }
                    5 if is_wanted => pool.move_to(page, &mut list),
                    6 if is_asked => {
                        pool.landed(page);
                        while pool.pop_ready().is_some() {}
                    }
                    7 if is_asked => {
                        pool.comes_not(page);
                        expected.push(page);
                    }
                    _ => continue,
                }
                match seed >> 29 {
                    4 | 5 => expected.retain(|&other| other != page),
                    6 | 7 => asked.retain(|&other| other != page),
                    _ => {}
                }
                while pool.pop(&mut list).is_some() {}
                assert_eq!(wanted(pool), expected);
                assert!((0..PAGES).all(|page| pool.is_wanted(page) == expected.contains(&page)));
            }
        });
    }

    #[test]
    fn rays_that_have_moved_stay_and_stand_first() {
        with_pool(|pool| {
            let moved = |pool: &mut Pool<'_>| pool.oldest(1).map(|ray| ray.moved);
            for at in 0..40 {
                pool.push(ray(1, u8::from(at % 4 == 3)), true).unwrap();
                assert_eq!(moved(pool), Some(u8::from(at >= 3)));
            }
            let mut given = List::EMPTY;
            assert_eq!(pool.give(&mut given, 100), 20, "half of them");
            assert_eq!((pool.ready_rays(), pool.waiting(1)), (20, 20));
            assert_eq!(pool.give(&mut given, 100), 10);
            assert_eq!(pool.give(&mut given, 100), 0, "the others have moved");
            assert!(pool.iter(&given).all(|ray| ray.moved == 1));
            let left: Vec<u8> = std::iter::from_fn(|| pool.pop_ready().map(|ray| ray.moved)).collect();
            assert_eq!(left, [1; 10], "those that had moved before");
        });
    }
}
