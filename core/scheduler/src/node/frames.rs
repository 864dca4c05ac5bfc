//! What travels between nodes: rays, pages, partial sums, and the sums of finished tiles.

use super::tiles::{OpenTile, Stage as TileStage, TILE_PIXELS, place_of};
use super::{Node, Stage, Store};
use crate::node::store::Landed;
use crate::{rules, send};
use bytemuck::{bytes_of, pod_read_unaligned};
use hybray_arena::List;
use hybray_geometry::Candidate;
use hybray_link::{HOST, Link, Peer};
use hybray_scene::PageEntry;
use hybray_wire::{
    BODY_BYTES_MAX, HEAD_BYTES_MAX, Message, Partial, RayKind, RayRecord, ShadowRecord, TileMap, View, encode,
};

/// Partial sums in one frame.
const PARTIALS_MAX: usize = BODY_BYTES_MAX / size_of::<Partial>();
/// Rays in one frame at most, whatever the settings say.
const RAYS_MAX: usize = BODY_BYTES_MAX / size_of::<RayRecord>();

impl<P: Store> Node<'_, '_, P> {
    /// Rays, what became of rays, and partial sums.
    pub(super) fn handle_rays(&mut self, from: Peer, view: &View<'_>) {
        match view.message {
            Message::Rays { rays, shadows, load } => {
                if let Some(peer) = self.memory.peers.get(from) {
                    peer.load = load;
                }
                self.handle_records(from, rays, shadows, view.body);
            }
            Message::Took { taken, load } => {
                let Some(peer) = self.memory.peers.get(from) else { return };
                (peer.load, peer.full) = (load, !taken);
                let mut flight = core::mem::take(&mut peer.flight);
                let count = flight.len() as u64;
                if rules::frees(taken) {
                    self.traffic.forwarded += count;
                    while self.memory.pool.pop(&mut flight).is_some() {}
                    return;
                }
                self.traffic.refused += count;
                self.wait_again(flight, true);
            }
            _ => {
                for bytes in view.body.chunks_exact(size_of::<Partial>()) {
                    let partial: Partial = pod_read_unaligned(bytes);
                    if let Some(place) = place_of(self.memory.tiles, 0, partial.tile, partial.epoch) {
                        self.memory.tiles[place].take(&partial);
                    }
                }
            }
        }
    }

    fn handle_records(&mut self, from: Peer, rays: u16, shadows: u16, body: &[u8]) {
        let (rays, shadows) = (usize::from(rays), usize::from(shadows));
        if rays + shadows == 0 {
            (self.helped, self.given) = (true, false);
            return;
        }
        let pool = &self.memory.pool;
        let taken = self.picture.is_some() && rules::takes(rays + shadows, pool.free(), pool.capacity());
        self.memory.peers.answer(from, taken);
        self.helped |= rules::was_helped(taken, false);
        self.given = true;
        if !taken {
            return;
        }
        let (nearest, any) = body.split_at(rays * size_of::<RayRecord>());
        let nearest = nearest.chunks_exact(size_of::<RayRecord>()).map(pod_read_unaligned::<RayRecord>);
        let any = any.chunks_exact(size_of::<ShadowRecord>()).map(pod_read_unaligned::<ShadowRecord>);
        for ray in nearest.chain(any.map(|shadow| RayRecord::from(&shadow))) {
            if !self.makes_sense(&ray) {
                self.traffic.nonsense += 1;
                continue;
            }
            self.traffic.arrived += 1;
            let shared = ray.moved == 1
                || (ray.settled == 1 && ray.kind == RayKind::Primary as u8 && ray.primitive != Candidate::NOTHING);
            self.helped |= rules::was_helped(true, shared);
            let here = self.store.is_at_hand(ray.page);
            // There is room for all of them.
            let _ = self.memory.pool.push(ray, here);
        }
    }

    /// Whether a ray from elsewhere can be traced without harm.
    fn makes_sense(&self, ray: &RayRecord) -> bool {
        let entries = self.scene.resident.directory.entries;
        let has_nodes = |page: u32| entries.get(page as usize).is_some_and(|entry| entry.kind == PageEntry::GEOMETRY);
        let map: Option<&TileMap> = self.picture.as_ref().map(|p| &p.map);
        (ray.page as usize) < entries.len()
            && (ray.settled == 1 || has_nodes(ray.page))
            && (ray.primitive == Candidate::NOTHING || has_nodes(ray.hit_page))
            && ray.settled <= 1
            && ray.moved <= 1
            && ray.kind <= RayKind::Shadow as u8
            && (1..=super::DEPTH_MAX as u8).contains(&ray.depth)
            && map.is_some_and(|map| ray.tile < map.len() && usize::from(ray.pixel) < map.tile(ray.tile).pixels())
            && ray.home != HOST
            && usize::from(ray.home) < self.memory.owed.len()
    }

    /// A part of a page that was asked for.
    pub(super) fn handle_part(&mut self, from: Peer, page: u32, offset: u32, part: &[u8]) {
        let Some(at) = self.requests.iter().position(|r| r.page == page && r.from == from && r.sent) else { return };
        match self.store.land(page, offset as usize, part) {
            Landed::Part => {}
            Landed::Whole => {
                self.requests.remove(at);
                self.traffic.fetched += 1;
                let entry = self.scene.resident.directory.entries[page as usize];
                if entry.kind == PageEntry::TEXELS {
                    self.traffic.texel_bytes += u64::from(entry.bytes);
                }
                self.memory.pool.landed(page);
            }
            // It will be wanted again, and its home has it.
            Landed::Refused => {
                self.requests.remove(at);
                self.memory.pool.comes_not(page);
            }
        }
    }

    /// Rays that wait here to be traced, those of tiles that are not begun included.
    pub(super) fn load(&self) -> u16 {
        let bundle = match self.stage {
            Stage::Shading { next, end, .. } => end - next,
            Stage::Idle => 0,
        };
        let tiles: u32 = self.runs.iter().map(|run| run.count - run.done).sum();
        let all = self.memory.pool.ready_rays() + bundle + tiles as usize * TILE_PIXELS;
        all.min(usize::from(u16::MAX)) as u16
    }

    /// Tells those who sent rays whether they were taken.
    pub(super) fn answer(&mut self, link: &mut dyn Link) -> bool {
        let mut sent = false;
        for _ in 0..self.memory.peers.answers() {
            let Some((peer, taken)) = self.memory.peers.next_answer() else { break };
            let lost = self.memory.peers.get(peer).is_none_or(|p| p.lost);
            let told = lost || send(link, peer, self.number, &Message::Took { taken, load: self.load() });
            self.memory.peers.answered(told);
            sent |= told;
        }
        sent
    }

    /// Sends partial sums to the nodes that keep the tiles: all that a peer is owed, if there is much of it or nothing
    /// better to do.
    pub(super) fn pay(&mut self, link: &mut dyn Link) -> bool {
        let mut sent = false;
        let number = self.number;
        let (free, capacity) = (self.memory.partials.free(), self.memory.partials.capacity());
        let granularity = usize::from(self.settings.granularity);
        for _ in 0..self.memory.owing.len() {
            let Some(peer) = self.memory.owing.pop_front() else { break };
            let m = &mut self.memory;
            let list = &mut m.owed[usize::from(peer)];
            if m.peers.get(peer).is_none_or(|p| p.lost) {
                while m.partials.pop_front(list).is_some() {}
                continue;
            }
            let count = list.len().min(PARTIALS_MAX);
            if !rules::pays(self.idle, free, capacity, count, granularity) {
                let _ = m.owing.push_back(peer);
                continue;
            }
            let mut front = m.partials.split_front(list, count);
            let message = Message::Partials { count: count as u16 };
            let went = link.send(peer, HEAD_BYTES_MAX + message.body_bytes(), &mut |room| {
                encode(number, &message, room, |body| {
                    for (bytes, partial) in body.chunks_exact_mut(size_of::<Partial>()).zip(m.partials.iter(&front)) {
                        bytes.copy_from_slice(bytes_of(partial));
                    }
                })
                .expect("the room for a message is enough for any")
            });
            if went {
                while m.partials.pop_front(&mut front).is_some() {}
            } else {
                m.partials.append(&mut front, list);
                *list = front;
            }
            sent |= went;
            if !m.owed[usize::from(peer)].is_empty() {
                let _ = m.owing.push_back(peer);
            }
        }
        sent
    }

    /// Asks for pages that have a place.
    pub(super) fn ask(&mut self, link: &mut dyn Link) -> bool {
        let mut sent = false;
        for at in 0..self.requests.len() {
            let request = self.requests[at];
            let asked = self.requests.iter().filter(|r| r.sent && r.from == request.from).count();
            if !request.sent && rules::may_ask(asked) {
                self.requests[at].sent = send(link, request.from, 0, &Message::Fetch { page: request.page });
                sent |= self.requests[at].sent;
            }
        }
        sent
    }

    /// Sends rays to the nodes that have their pages. They stay in the pool until they are taken.
    pub(super) fn forward(&mut self, link: &mut dyn Link, now: u64) -> bool {
        let mut sent = false;
        let (idle, number) = (self.idle, self.number);
        let granularity = usize::from(self.settings.granularity).clamp(1, RAYS_MAX);
        let compact = !self.scene.transmits;
        for _ in 0..self.memory.peers.sends() {
            let Some(peer) = self.memory.peers.next_send() else { break };
            let load = self.load();
            let m = &mut self.memory;
            let Some(state) = m.peers.get(peer) else { continue };
            if state.lost {
                continue;
            }
            let since = state.since;
            let due =
                idle || state.outbox.len() >= granularity || now.saturating_sub(since) >= self.settings.deadline_ns;
            if state.outbox.is_empty() || !due || !rules::may_send(state.flight.len()) {
                // After rays: whoever hears it asks for a share again, and the word would take their room on the link for ever.
                if state.none_to_share {
                    state.none_to_share = !send(link, peer, self.number, &Message::Rays { rays: 0, shadows: 0, load });
                    sent |= !state.none_to_share;
                }
                if state.none_to_share || !state.outbox.is_empty() {
                    m.peers.send_on(peer, since);
                }
                continue;
            }
            let mut outbox = core::mem::take(&mut state.outbox);
            let front: List = m.pool.split_front(&mut outbox, granularity);
            let is_compact = |ray: &&RayRecord| compact && ray.kind == RayKind::Shadow as u8;
            let shadows = m.pool.iter(&front).filter(is_compact).count();
            let message = Message::Rays { rays: (front.len() - shadows) as u16, shadows: shadows as u16, load };
            let went = link.send(peer, HEAD_BYTES_MAX + message.body_bytes(), &mut |room| {
                encode(number, &message, room, |body| {
                    let (mut nearest, mut any) = body.split_at_mut((front.len() - shadows) * size_of::<RayRecord>());
                    for ray in m.pool.iter(&front) {
                        if is_compact(&ray) {
                            let (bytes, rest) = any.split_at_mut(size_of::<ShadowRecord>());
                            bytes.copy_from_slice(bytes_of(&ShadowRecord::from(ray)));
                            any = rest;
                        } else {
                            let (bytes, rest) = nearest.split_at_mut(size_of::<RayRecord>());
                            bytes.copy_from_slice(bytes_of(ray));
                            nearest = rest;
                        }
                    }
                })
                .expect("the room for a message is enough for any")
            });
            let mut flight = List::EMPTY;
            if went {
                flight = front;
            } else {
                m.pool.put_back(&mut outbox, front);
            }
            let mut more = !outbox.is_empty();
            if let Some(state) = m.peers.get(peer) {
                (state.outbox, state.flight) = (outbox, flight);
                more |= state.none_to_share;
            }
            if more {
                m.peers.send_on(peer, if went { now } else { since });
            }
            sent |= went;
        }
        sent
    }

    /// Sends the sums of finished tiles to the film.
    pub(super) fn send_tiles(&mut self, link: &mut dyn Link) -> bool {
        let Some(picture) = &self.picture else { return false };
        let (mut sent, number) = (false, self.number);
        for tile in self.memory.tiles.iter_mut().filter(|t| t.stage == TileStage::Finished) {
            let shape = picture.map.tile(tile.tile);
            let message = Message::Contributions {
                tile: tile.tile,
                epoch: tile.epoch,
                width: shape.width as u8,
                height: shape.height as u8,
                rays: tile.rays,
                entry: tile.entry,
            };
            let sums = &tile.sums[..shape.pixels().min(TILE_PIXELS)];
            let went = link.send(HOST, HEAD_BYTES_MAX + message.body_bytes(), &mut |room| {
                encode(number, &message, room, |body| {
                    for (bytes, sum) in body.chunks_exact_mut(8).zip(sums.as_flattened()) {
                        bytes.copy_from_slice(&sum.to_le_bytes());
                    }
                })
                .expect("the room for a message is enough for any")
            });
            if !went {
                break;
            }
            *tile = OpenTile::FREE;
            self.sent_tiles += 1;
            sent = true;
        }
        sent
    }
}
