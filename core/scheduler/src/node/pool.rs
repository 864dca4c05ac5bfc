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
    /// Where it stands among the wanted pages.
    wanted_at: u32,
    /// How often rays came to need it: halved now and then.
    pub uses: u16,
    /// It was asked for, and is on its way.
    pub asked: bool,
    /// It is queued as ready.
    ready: bool,
}

impl PageState {
    /// A page that nobody waits for.
    pub const NEW: Self = Self { rays: List::EMPTY, wanted_at: NOWHERE, uses: 0, asked: false, ready: false };
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
    /// Pages that rays wait for and that are not at hand: the first `wanted_len`.
    wanted: &'m mut [u32],
    wanted_len: usize,
    /// Pages at hand that rays wait for.
    ready: Ring<'m, u32>,
    /// Rays that wait for pages that are queued as ready.
    ready_rays: usize,
    /// Rays that came in since uses were halved.
    pushed: usize,
}

impl<'m> Pool<'m> {
    /// An empty pool. `pages`, `wanted` and `ready` have one entry for each page of the scene.
    pub fn new(
        slab: Slab<'m, RayRecord>,
        pages: &'m mut [PageState],
        wanted: &'m mut [u32],
        ready: Ring<'m, u32>,
    ) -> Self {
        Self { slab, pages, wanted, wanted_len: 0, ready, ready_rays: 0, pushed: 0 }
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

    /// Pages that rays wait for and that are not at hand.
    pub fn wanted(&self) -> &[u32] {
        &self.wanted[..self.wanted_len]
    }

    /// Queues a ray for the page that it names; `at_hand` says whether that is here.
    ///
    /// # Errors
    /// If the pool is full: the ray comes back.
    pub fn push(&mut self, ray: RayRecord, at_hand: bool) -> Result<(), RayRecord> {
        let page = ray.page;
        self.slab.push_back(&mut self.pages[page as usize].rays, ray)?;
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
        let state = &mut self.pages[page as usize];
        if state.wanted_at == NOWHERE {
            state.wanted_at = self.wanted_len as u32;
            self.wanted[self.wanted_len] = page;
            self.wanted_len += 1;
        }
    }

    fn unwant(&mut self, page: u32) {
        let at = core::mem::replace(&mut self.pages[page as usize].wanted_at, NOWHERE);
        if at != NOWHERE {
            self.wanted_len -= 1;
            let last = self.wanted[self.wanted_len];
            self.wanted[at as usize] = last;
            if last != page {
                self.pages[last as usize].wanted_at = at;
            }
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
    /// for a node that has nothing to do. Few are not worth a page. Returns how many. Bounded: the ready pages, and the
    /// rays of one.
    pub fn give(&mut self, list: &mut List, most: usize) -> usize {
        let Some(&page) = self.ready.iter().max_by_key(|&&page| self.waiting(page)) else { return 0 };
        let count = (self.waiting(page) / 2).min(most);
        if count < GIVEN_MIN {
            return 0;
        }
        let mut given = self.slab.split_front(&mut self.pages[page as usize].rays, count);
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
