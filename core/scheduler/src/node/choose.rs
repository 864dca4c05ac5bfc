//! What goes where: rays to the nodes that have their pages, pages to the nodes that have the rays, and some of the work to
//! a node that has none.

use super::memory::Bundle;
use super::way::Way;
use super::{Back, DECISIONS, Node, PeerState, REQUESTS_MAX, Request, Stage, Store, at_hand, primary};
use crate::policy::{Choice, Situation, decide};
use crate::rules;
use hybray_arena::List;
use hybray_bintree::walk::FROM_ROOT;
use hybray_link::{HOST, Peer};
use hybray_scene::PageEntry;
use hybray_wire::RayRecord;

impl<P: Store> Node<'_, '_, P> {
    /// Gives half of the bundle's rays that are still to be shaded, and that hit something, to a node that has nothing
    /// to do; or lets it know that there are none.
    pub(super) fn share(&mut self, with: Peer) {
        if with == self.me || with == HOST || self.memory.peers.get(with).is_none_or(|p| p.lost) {
            return;
        }
        if self.give_tiles(with) {
            return;
        }
        let Some(picture) = &self.picture else { return };
        let Bundle { rays, walked, places, .. } = &mut *self.memory.bundle;
        let outbox = self.memory.peers.send(with, 0);
        let mut given = 0;
        if let Stage::Shading { sample, next, mut end } = self.stage {
            let most = (end - next).div_ceil(2).min(usize::from(self.settings.granularity));
            for at in (next..end).rev() {
                if given == most {
                    break;
                }
                let best = walked[at].best;
                if walked[at].needs.is_some() || !best.candidate.is_hit() {
                    continue;
                }
                let tile = self.in_work.tiles[usize::from(places[at].tile)];
                let ray =
                    primary(picture, self.scene.has_textures(), &rays[at], &places[at], &best, sample, tile, self.me);
                if self.memory.pool.push_to(outbox, RayRecord { settled: 1, page: best.page, ..ray }).is_err() {
                    break;
                }
                given += 1;
                end -= 1;
                rays.swap(at, end);
                walked.swap(at, end);
                places.swap(at, end);
            }
            self.stage = Stage::Shading { sample, next, end };
        }
        if given == 0 {
            // Rays for pages that are here: they take the page with them.
            given = self.memory.pool.give(self.memory.peers.send(with, 0), usize::from(self.settings.granularity));
        }
        if let Some(peer) = self.memory.peers.get(with) {
            peer.none_to_share = given == 0;
        }
    }

    /// Gives half of the tiles that are not begun back to the dispatcher, for a node that has nothing to do.
    fn give_tiles(&mut self, with: Peer) -> bool {
        let begun = if self.stage != Stage::Idle && self.in_work.of_run { self.in_work.count as u32 } else { 0 };
        let left = self.runs.iter().map(|run| run.count - run.done).sum::<u32>() - begun;
        let several = self.runs.len() > 1;
        let Some(last) = self.runs.back_mut().filter(|run| run.epoch == 0 && self.back.is_none()) else { return false };
        let lasts = if several { last.count } else { left };
        // A run of which something is done must be ended by its own tiles.
        let half = if several || begun > 0 { left.div_ceil(2) } else { left / 2 };
        let count = half.min(lasts);
        if count == 0 {
            return false;
        }
        last.count -= count;
        self.back = Some(Back { with, first: last.first + last.count, count });
        if last.count == 0 {
            self.runs.pop_back();
        }
        true
    }

    /// Looks at wanted pages, and has their rays go there or the pages come here. Those that have been wanted for longest
    /// come first: while there is no place for one, nobody behind it is given one. But the rays of those behind may go.
    pub(super) fn decide(&mut self, now: u64) {
        // The lane first: nothing else must take its turn.
        if let Some(ray) = self.aside.filter(|ray| !at_hand(&self.scene.at_hand(&self.store), ray.page)) {
            self.request(ray.page, true);
        }
        let load = u32::from(self.load());
        let (mut next, mut has_room) = (self.memory.pool.first_wanted(), true);
        for _ in 0..DECISIONS {
            let Some(page) = next else { break };
            next = self.memory.pool.wanted_after(page);
            let stays = !self.settle(page, has_room, load, now);
            if stays && core::mem::take(&mut has_room) && self.memory.pool.is_wanted(self.looked_at) {
                next = Some(self.looked_at);
            }
        }
        if !has_room {
            self.looked_at = next.unwrap_or(FROM_ROOT);
        }
        // The next bundle's pages once, when no ray is left that waits for one that was not asked for.
        if !self.ahead.tried && self.settings.grid.is_none() && self.memory.pool.first_wanted().is_none() {
            self.ahead.tried = true;
            for at in 0..self.ahead.pages().len() {
                let page = self.ahead.pages()[at];
                if self.store.page(page).is_none() {
                    self.request(page, false);
                }
            }
        }
    }

    /// Decides about a wanted page; false if it stays wanted. It can only be asked for if the cache `has_room`.
    fn settle(&mut self, page: u32, has_room: bool, load: u32, now: u64) -> bool {
        let entry = self.scene.resident.directory.entries[page as usize];
        let uses = u32::from(self.memory.pool.page(page).uses);
        let Some(oldest) = self.memory.pool.oldest(page).copied() else { return false };
        let (kind, moved) = (oldest.ray_kind(), oldest.moved == 1);
        let to = self.toward(&oldest, entry.owner);
        let owner = self.memory.peers.get(to).copied().unwrap_or(PeerState::LOST);
        let situation = Situation {
            rays: self.memory.pool.waiting(page) as u32,
            kind,
            page_bytes: entry.bytes,
            uses,
            owner_is_full: owner.full,
            owner_traces: !owner.lost && to != HOST && to != self.me,
            outbox: owner.outbox.len() as u32,
            owner_load: u32::from(owner.load),
            load,
            granularity: u32::from(self.settings.granularity),
            ray_ns: self.settings.ray_ns,
            link: self.settings.link,
        };
        // Rays that were given to this node, or came back to it, go nowhere before their page has come. Texels come where the hit is,
        // which needs the page that it is in beside them.
        let texels = entry.kind == PageEntry::TEXELS;
        let choice = if moved || texels { Choice::Fetch } else { decide(self.settings.policy, &situation) };
        if choice == Choice::Fetch && has_room && self.request(page, false) {
            return true;
        }
        // No place for the page: if its owner had no room either, it is asked once more.
        let goes = choice == Choice::Forward
            || (self.settings.grid.is_none()
                && !texels
                && rules::goes_again(moved, owner.full, situation.owner_traces));
        if goes && self.settings.grid.is_some() {
            self.disperse(page, entry.owner, now);
        } else if goes {
            let outbox = self.memory.peers.send(to, now);
            self.memory.pool.move_to(page, outbox);
        }
        goes
    }

    /// Who `ray` is sent to, on its way to a page of `owner`: from voxel to voxel, as far as they are there.
    fn toward(&mut self, ray: &RayRecord, owner: Peer) -> Peer {
        let Some(grid) = self.settings.grid else { return owner };
        let next = Way { grid, me: self.me, entries: &[] }.next(ray, owner);
        if next == HOST || self.memory.peers.get(next).is_none_or(|peer| peer.lost) { owner } else { next }
    }

    /// Sends each of the rays that wait for a page of `owner` on its own way. Those that would go to a full node stay:
    /// at least the oldest goes.
    fn disperse(&mut self, page: u32, owner: Peer, now: u64) {
        let mut rays = List::EMPTY;
        self.memory.pool.move_to(page, &mut rays);
        while let Some(ray) = self.memory.pool.pop(&mut rays) {
            let to = self.toward(&ray, owner);
            let goes = self.memory.peers.get(to).is_some_and(|peer| !peer.full && !peer.lost);
            // Its place was free this moment.
            let _ = if goes {
                let outbox = self.memory.peers.send(to, now);
                self.memory.pool.push_to(outbox, ray)
            } else {
                self.memory.pool.push(ray, false)
            };
        }
    }

    /// Has rays that were to go elsewhere wait here again; `moved` if they were there, and have had their move. Their places
    /// were free this moment, so there is room.
    pub(super) fn wait_again(&mut self, mut list: List, moved: bool) {
        while let Some(ray) = self.memory.pool.pop(&mut list) {
            let here = self.store.is_at_hand(ray.page);
            let _ = self.memory.pool.push(RayRecord { moved: ray.moved | u8::from(moved), ..ray }, here);
        }
    }

    /// Reserves a place for `page`, and has it asked for.
    fn request(&mut self, page: u32, for_lane: bool) -> bool {
        if let Some(at) = self.requests.iter().position(|r| r.page == page) {
            self.requests[..=at].rotate_right(usize::from(for_lane));
            return true;
        }
        if self.store.open(page) {
            self.memory.pool.landed(page);
            return true;
        }
        let requests = usize::from(self.settings.requests).clamp(1, REQUESTS_MAX);
        if !rules::may_request(self.requests.len(), requests, REQUESTS_MAX, for_lane) {
            return false;
        }
        let owner = self.scene.resident.directory.entries[page as usize].owner;
        let lost = owner == self.me || self.memory.peers.get(owner).is_none_or(|p| p.lost);
        let from = if lost { HOST } else { owner };
        let pool = &self.memory.pool;
        if !self.store.reserve(page, for_lane, &|p| pool.waiting(p) > 0) {
            return false;
        }
        self.memory.pool.ask(page);
        // There is room: the limit was looked at. They are asked for in this order.
        let _ = self.requests.push(Request { page, from, sent: false });
        self.requests.rotate_right(usize::from(for_lane));
        self.high_water.requests = (self.high_water.requests.0.max(self.requests.len()), REQUESTS_MAX + 1);
        self.high_water.page_bytes = self.high_water.page_bytes.max(self.store.bytes_held());
        true
    }
}
