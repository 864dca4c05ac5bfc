//! A node: traces runs of tiles, and what other nodes send it.
//!
//! It works on a bundle at a time: four tiles that make a square, or one. Primary rays are traced as a bundle; each
//! hit's rays are finished depth first in a lane, as far as the pages at hand go. A ray that needs another page waits in
//! the pool, until the page comes here or the ray goes to a node that has it (policy). The node keeps the sums of the
//! tiles that it was given until the last ray that they caused has ended, wherever that was; then they go to the film.
//!
//! Nothing waits for room that may never come (DESIGN section 2, law 3): where the pool is full, the ray that the lane has
//! in hand stays there, and its page is fetched into a place that is kept for it.

mod ahead;
mod begin;
mod choose;
mod frames;
mod memory;
mod peers;
mod picture;
mod pool;
mod store;
mod tiles;
mod way;

pub use memory::{Limits, NodeMemory};
pub use picture::{camera, can_draw};
pub use store::{All, Backing, Cache, Charged, Landed, Own, Place as CachePlace, Store};

pub(crate) use ahead::clip;
pub(crate) use peers::{PeerState, Peers};
pub(crate) use picture::Picture;

use crate::policy::{Grid, LinkCost, Policy, subhost};
use crate::{rules, send};
use ahead::Ahead;
use begin::{InWork, Place, begin, next_bundle, primary, start_sample, trace_bundle};
use hybray_arena::List;
use hybray_bintree::walk::FROM_ROOT;
use hybray_geometry::simd::Kernels;
use hybray_link::{HOST, Link, Peer};
use hybray_scene::Pages;
use hybray_tracer::{Beyond, Lane, Scene, Walker, goes_together};
use hybray_wire::{Counts, Frame, Message, RayRecord, View};
use memory::Bundle;
use tiles::{OpenTile, Stage as TileStage, Sums, TILE_PIXELS};
use way::{Nothing, Way};

/// Tiles of a bundle.
const TILES: usize = 4;
/// Primary rays of a bundle at most.
pub const BUNDLE: usize = TILES * TILE_PIXELS;
/// Runs that wait.
const RUNS: usize = crate::dispatcher::RUNS_MAX;
const NO_RUNS: heapless::Deque<Run, RUNS> = heapless::Deque::new();
/// Pages that may be on their way here, the lane's not counted.
pub const REQUESTS_MAX: usize = 16;
/// Wanted pages that are looked at in one call.
const DECISIONS: usize = 32;
/// Depth of a picture at most.
pub const DEPTH_MAX: usize = 64;

/// What may be chosen about a node. None of it changes a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Forward or fetch.
    pub policy: Policy,
    /// What the policy takes a message to cost.
    pub link: LinkCost,
    /// What the policy takes a ray to cost, nanoseconds.
    pub ray_ns: u32,
    /// Rays in one message at most (the report's table 6.1).
    pub granularity: u16,
    /// How long rays wait for a message to fill, nanoseconds.
    pub deadline_ns: u64,
    /// Units of work in one [`Node::step`]: walks, or little more.
    pub steps: u32,
    /// Tiles of a bundle, 1 or 4: 8 x 8 or 16 x 16 pixels a pyramid (table 6.1).
    pub bundle_tiles: u8,
    /// No new tile is begun while so many rays wait (table 6.1's pixels in the system).
    pub in_system: u32,
    /// Pages that may be on their way here, 1 to [`REQUESTS_MAX`].
    pub requests: u8,
    /// Shadow rays are tested against all pages at hand first, and what is left of them is forwarded: with light caches.
    pub lights_first: bool,
    /// Shadow rays of hits that stand together, and those to the samples of an area light, are traced as bundles.
    pub shadow_bundles: bool,
    /// Nodes that clip bundles for themselves and as many others (table 6.3); with none the host does, and every node does
    /// if nothing is said.
    pub subhosts: Option<Peer>,
    /// Rays go from voxel to neighbouring voxel of this grid, and on to its end if they hit nothing, instead of
    /// straight to the next page that they meet: the report's data-parallel network.
    pub grid: Option<Grid>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            policy: Policy::Hybrid,
            link: LinkCost { message_ns: 20_000, byte_ps: 1_000 },
            ray_ns: 2_000,
            granularity: 100,
            deadline_ns: 1_000_000,
            steps: 4096,
            bundle_tiles: 4,
            in_system: 4096,
            requests: 8,
            lights_first: false,
            shadow_bundles: true,
            subhosts: None,
            grid: None,
        }
    }
}

/// What a node did besides tracing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Rays that came from other nodes.
    pub arrived: u64,
    /// Rays that were sent to other nodes and taken.
    pub forwarded: u64,
    /// Rays that came back, since there was no room for them.
    pub refused: u64,
    /// Pages that came here.
    pub fetched: u64,
    /// Bytes of those that were of texels.
    pub texel_bytes: u64,
    /// Pages that were sent to others.
    pub served: u64,
    /// Records that came from peers and made no sense.
    pub nonsense: u64,
}

impl core::ops::AddAssign for Traffic {
    fn add_assign(&mut self, b: Self) {
        self.arrived += b.arrived;
        self.forwarded += b.forwarded;
        self.refused += b.refused;
        self.fetched += b.fetched;
        self.texel_bytes += b.texel_bytes;
        self.served += b.served;
        self.nonsense += b.nonsense;
    }
}

impl core::ops::Sub for Traffic {
    type Output = Self;

    /// What there was since `b`, an earlier count.
    fn sub(self, b: Self) -> Self {
        Self {
            arrived: self.arrived.saturating_sub(b.arrived),
            forwarded: self.forwarded.saturating_sub(b.forwarded),
            refused: self.refused.saturating_sub(b.refused),
            fetched: self.fetched.saturating_sub(b.fetched),
            texel_bytes: self.texel_bytes.saturating_sub(b.texel_bytes),
            served: self.served.saturating_sub(b.served),
            nonsense: self.nonsense.saturating_sub(b.nonsense),
        }
    }
}

/// Most that was ever in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HighWater {
    /// Rays that waited, of how many.
    pub rays: (usize, usize),
    /// Partial sums.
    pub partials: (usize, usize),
    /// Tiles.
    pub tiles: (usize, usize),
    /// Page requests.
    pub requests: (usize, usize),
    /// Bytes of pages held.
    pub page_bytes: u64,
}

#[derive(Clone, Copy)]
struct Run {
    first: u32,
    count: u32,
    epoch: u16,
    done: u32,
    nanoseconds: u64,
}

/// Tiles that go back to the dispatcher.
#[derive(Clone, Copy)]
struct Back {
    with: Peer,
    first: u32,
    count: u32,
}

/// What of the bundle is in work.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Nothing: the next bundle may begin.
    Idle,
    /// Primary rays of sample `sample` from `next` on are still to be shaded, up to `end`: those behind it were given
    /// away.
    Shading { sample: u16, next: usize, end: usize },
}

/// Hits of the bundle whose rays are traced together, and those of their last children in their place, and so on. What can
/// not be traced so goes to the lane, record by record.
#[derive(Clone, Copy, Default)]
struct Lit {
    /// Records.
    count: usize,
    /// Records that are for the lane: the first ones.
    lane: usize,
    /// Records that the lane has taken over.
    taken: usize,
    /// Shadow rays of each of the others that had their turn.
    cursor: u32,
    /// Whether there is no more room, or there are no more.
    full: bool,
}

/// A page that was asked for, or is to be.
#[derive(Clone, Copy)]
struct Request {
    page: u32,
    from: Peer,
    sent: bool,
}

/// The machine.
pub struct Node<'m, 's, P: Store> {
    scene: Scene<'s>,
    store: P,
    memory: NodeMemory<'m>,
    settings: Settings,
    kernels: Kernels,
    me: Peer,
    dispatcher: Peer,
    scene_hash: u64,
    picture: Option<Picture>,
    /// Which picture of the run that is, or is to be.
    number: u16,
    runs: heapless::Deque<Run, RUNS>,
    in_work: InWork,
    stage: Stage,
    lit: Lit,
    /// Records of the lane in use.
    depth: usize,
    /// The ray that the lane has in hand and the pool has no room for.
    aside: Option<RayRecord>,
    ahead: Ahead,
    requests: heapless::Vec<Request, { REQUESTS_MAX + 1 }>,
    /// The wanted page that is looked at next, behind the first.
    looked_at: u32,
    /// Runs that are done and not yet told.
    done: heapless::Deque<Run, RUNS>,
    greeted: [bool; 2],
    /// What it did for this picture is to be told.
    report: Option<u16>,
    stopped: bool,
    counts: Counts,
    walk_counts: hybray_bintree::walk::Counts,
    /// Rays that have ended here.
    ended: u64,
    traffic: Traffic,
    high_water: HighWater,
    /// The last step found nothing to do: what waits for company goes now.
    idle: bool,
    /// Somebody shares with this node: the dispatcher is told when that is done.
    helped: bool,
    /// Tiles that it was given and has not begun, to go back for a node that has nothing to do.
    back: Option<Back>,
    /// The last one who was to share had something.
    given: bool,
    tiles: u32,
    /// Tiles whose sums have gone to the film.
    sent_tiles: u32,
    runs_given: u32,
    busy: u64,
}

impl<'m, 's, P: Store> Node<'m, 's, P> {
    /// Node `me` of `scene`, with the pages of `store` (those of `scene` are not looked at), that takes its tiles from
    /// `dispatcher`.
    pub fn new(
        scene: Scene<'s>,
        store: P,
        scene_hash: u64,
        kernels: Kernels,
        me: Peer,
        dispatcher: Peer,
        settings: Settings,
        memory: NodeMemory<'m>,
    ) -> Self {
        // Where every page is at hand, nothing is clipped for.
        let clips = |nodes: usize| subhost(me, nodes as Peer, settings.subhosts);
        let settings = Settings { grid: settings.grid.filter(|_| memory.pool.capacity() > 0), ..settings };
        let subhost = memory.peers.len().checked_sub(1).map(clips).filter(|&subhost| subhost != me);
        Self {
            scene,
            store,
            memory,
            settings,
            kernels,
            me,
            dispatcher,
            scene_hash,
            picture: None,
            number: 0,
            runs: heapless::Deque::new(),
            in_work: InWork { tiles: [(0, 0); TILES], count: 0, rays: 0, of_run: false },
            stage: Stage::Idle,
            lit: Lit::default(),
            depth: 0,
            aside: None,
            ahead: Ahead::new(subhost),
            requests: heapless::Vec::new(),
            looked_at: FROM_ROOT,
            done: heapless::Deque::new(),
            greeted: [false; 2],
            report: None,
            stopped: false,
            counts: Counts::default(),
            walk_counts: hybray_bintree::walk::Counts::default(),
            ended: 0,
            traffic: Traffic::default(),
            high_water: HighWater::default(),
            idle: true,
            helped: false,
            given: false,
            back: None,
            tiles: 0,
            sent_tiles: 0,
            runs_given: 0,
            busy: 0,
        }
    }

    /// Which picture of the run it draws, or waits for: 0 is the first.
    #[must_use]
    pub fn picture(&self) -> u16 {
        self.number
    }

    /// Whether it was told to end, and has said what it did.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.stopped && self.report.is_none()
    }

    /// Boxes, blocks and pages of all walks so far.
    #[must_use]
    pub fn walk_counts(&self) -> hybray_bintree::walk::Counts {
        self.walk_counts
    }

    /// Tiles of its own that are finished.
    #[must_use]
    pub fn finished_tiles(&self) -> u32 {
        self.sent_tiles + self.memory.tiles.iter().filter(|t| t.stage == TileStage::Finished).count() as u32
    }

    /// Rays and contributions so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Rays that have ended here, whoever started them.
    #[must_use]
    pub fn ended(&self) -> u64 {
        self.ended
    }

    /// What it did besides tracing.
    #[must_use]
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Most that was ever in use.
    #[must_use]
    pub fn high_water(&self) -> HighWater {
        let m = &self.memory;
        HighWater {
            rays: (m.pool.high_water(), m.pool.capacity()),
            partials: (m.partials.high_water(), m.partials.capacity()),
            // Who never asks for a page has what it was given.
            page_bytes: self.high_water.page_bytes.max(self.store.bytes_held()),
            ..self.high_water
        }
    }

    /// Takes in a message; those for other machines, those from peers that have no right to them, and those about other
    /// pictures are passed over. Pages are the same for all pictures.
    pub fn handle(&mut self, from: Peer, view: &View<'_>) {
        match view.message {
            Message::Stop if from == HOST => self.stop(),
            Message::Fetch { page } => self.memory.server.fetch(from, page),
            Message::Part { page, offset, .. } => self.handle_part(from, page, offset, view.body),
            _ if view.picture == self.number => self.handle_now(from, view),
            _ => {}
        }
    }

    /// A message about the picture that is drawn, or is to begin.
    fn handle_now(&mut self, from: Peer, view: &View<'_>) {
        match view.message {
            Message::Begin(frame) if from == HOST && self.picture.is_none() => self.begin(frame),
            Message::End if from == HOST && !self.stopped => self.end(),
            Message::Tiles { first, count, epoch } if from == self.dispatcher && !self.stopped => {
                let fits = self
                    .picture
                    .as_ref()
                    .is_some_and(|p| count > 0 && first.checked_add(count).is_some_and(|end| end <= p.map.len()));
                // A dispatcher never has more runs at a node than that; one that does is not heard.
                if fits && self.runs.push_back(Run { first, count, epoch, done: 0, nanoseconds: 0 }).is_ok() {
                    self.runs_given += 1;
                }
            }
            Message::Finished { tile: u32::MAX } if from == self.dispatcher => self.report = Some(self.number),
            Message::Rays { .. } | Message::Took { .. } | Message::Partials { .. } if !self.stopped => {
                self.handle_rays(from, view);
            }
            Message::Share { with } if from == self.dispatcher && !self.stopped => self.share(with),
            Message::Clip { first, count } => self.memory.clips.ask(from, first, count),
            Message::Cliplist { first, .. } => {
                self.ahead.come(from, first, view.body, self.scene.resident.directory.entries.len());
            }
            _ => {}
        }
    }

    /// Begins a picture, and counts anew.
    fn begin(&mut self, frame: Frame) {
        self.picture = Picture::new(frame);
        if let Some(Picture { frame, layer, .. }) = &self.picture {
            (self.scene.layer, self.scene.eye) = (*layer, frame.eye);
            self.scene.shading.ray_depth_max = u32::from(frame.depth_max);
            self.scene.shading.weight_cutoff = frame.weight_cutoff;
        }
        if self.number > 0 {
            // A dispatcher that has begun hears that this node has begun, too.
            self.greeted = [self.greeted[0] && self.dispatcher != HOST, false];
            self.count_anew();
        }
    }

    fn count_anew(&mut self) {
        self.counts = Counts::default();
        (self.tiles, self.runs_given, self.busy) = (0, 0, 0);
    }

    /// This picture ends and another comes. What is left of this one, such as rays under an old epoch, is lost; what was done
    /// is still told. Pages stay, and those that were asked for still come.
    fn end(&mut self) {
        // The last that there can be is followed by none.
        let Some(next) = self.number.checked_add(1) else { return };
        self.give_up();
        let memory = &mut self.memory;
        memory.pool.clear();
        memory.partials.clear();
        memory.owed.fill(List::EMPTY);
        while memory.owing.pop_front().is_some() {}
        memory.peers.clear();
        memory.clips.clear();
        self.ahead.begin();
        (self.helped, self.given) = (false, false);
        (self.number, self.picture) = (next, None);
    }

    /// The program ends.
    fn stop(&mut self) {
        if self.picture.is_none() {
            self.count_anew();
        }
        self.give_up();
        self.stopped = true;
    }

    /// What is in work is lost; what was done is still told.
    fn give_up(&mut self) {
        self.runs.clear();
        self.done.clear();
        self.back = None;
        self.stage = Stage::Idle;
        self.lit = Lit::default();
        (self.depth, self.aside) = (0, None);
        self.memory.tiles.fill(OpenTile::FREE);
        self.report = Some(self.number);
    }

    /// A peer is gone. Rays that were there are gone with it, and nobody knows whose: the tiles that are open here are
    /// traced again, under a new epoch. Pages come from their home from now on. Rays that were on their way there wait
    /// here again: they may be of such a tile's new epoch, if their node heard of the loss before this one did.
    pub fn lost(&mut self, peer: Peer) {
        let Some(state) = self.memory.peers.get(peer) else { return };
        state.lost = true;
        state.full = false;
        let (outbox, flight) = (core::mem::take(&mut state.outbox), core::mem::take(&mut state.flight));
        self.wait_again(outbox, false);
        self.wait_again(flight, false);
        self.memory.server.lost(peer);
        self.memory.clips.lost(peer);
        self.ahead.lost(peer);
        if let Some(owed) = self.memory.owed.get_mut(usize::from(peer)) {
            let mut owed = core::mem::take(owed);
            while self.memory.partials.pop_front(&mut owed).is_some() {}
        }
        for request in self.requests.iter_mut().filter(|r| r.from == peer) {
            (request.from, request.sent) = (HOST, false);
        }
        if self.memory.pool.capacity() > 0 && peer != HOST {
            for tile in self.memory.tiles.iter_mut().filter(|t| t.stage == TileStage::Open) {
                tile.again();
            }
        }
    }

    /// Traces for a while: at most as many units as the settings say, and one bundle of primary rays. Returns whether
    /// there was anything to do. `clock` is asked before and after.
    pub fn step(&mut self, clock: &mut dyn FnMut() -> u64) -> bool {
        let (before, done) = (clock(), self.done.len());
        let worked = self.work(before);
        self.idle = !worked;
        if worked {
            let spent = clock().saturating_sub(before);
            self.busy += spent;
            let run = if self.done.len() > done { self.done.back_mut() } else { self.runs.front_mut() };
            if let Some(run) = run {
                run.nanoseconds += spent;
            }
        }
        worked
    }

    fn work(&mut self, now: u64) -> bool {
        let Some(picture) = &self.picture else { return false };
        let frame = &picture.frame;
        let first_sample = frame.sample_from(0).unwrap_or(0);
        let NodeMemory { bundle, lane, tiles, pool, partials, owed, owing, peers, .. } = &mut self.memory;
        let Bundle { rays, walked, places, lit, together, stack } = &mut **bundle;
        let scene = self.scene.at_hand(&self.store);
        let Settings { lights_first: past, shadow_bundles: bundles, .. } = self.settings;
        let way = self.settings.grid.map(|grid| Way { grid, me: self.me, entries: scene.resident.directory.entries });
        let beyond = way.as_ref().map(|way| |ray: &RayRecord| way.beyond(ray, &scene));
        let beyond = beyond.as_ref().map(|beyond| beyond as Beyond<'_>);
        let mut walker = Walker { past, bundles, beyond, ..Walker::new(self.kernels, stack, together) };
        // As many as a bundle may have are lit at once; none where nothing would go together.
        let shadows = scene.shading.shadow_rays.min(64);
        let lit = if bundles && (0..shadows).any(|c| goes_together(&scene, c)) { &mut lit[..] } else { &mut [] };
        let mut lane = Lane::resume(lane, self.depth);
        let mut counts = Counts::default();
        let mut sums = Sums {
            step: picture.step,
            me: self.me,
            tiles,
            hint: 0,
            partials,
            lists: owed,
            owing,
            counts: Counts::default(),
            ended: 0,
        };
        // With a budget the end of a run is begun a tile at a time: what is not begun can still be given to others.
        let square_from = match self.settings.bundle_tiles {
            0..4 => u32::MAX,
            _ if pool.capacity() == 0 => 0,
            _ => 2 * TILES as u32,
        };
        let textured = scene.has_textures();
        let mut units = 0;
        let mut bundles = 0;
        while u64::from(units) + walker.ahead < u64::from(self.settings.steps) {
            // A unit adds to one pixel.
            if pool.capacity() > 0 && sums.partials.free() == 0 {
                break;
            }
            units += 1;
            if let Some(ray) = self.aside.take() {
                // What the pool had no room for is finished on the spot.
                let here = at_hand(&scene, ray.page);
                self.aside = if here { lane.take(&scene, &mut walker, ray, &mut sums, &mut counts) } else { Some(ray) };
                if self.aside.is_some_and(|ray| rules::lane_waits(at_hand(&scene, ray.page))) {
                    // Who only waits has nothing to do, and must not keep the processor busy with it.
                    units -= u32::from(!here);
                    break;
                }
                continue;
            }
            if !lane.is_empty() {
                if let Some(ray) = lane.step(&scene, &mut walker, &mut sums, &mut counts) {
                    self.aside = pool.push(ray, false).err();
                }
                continue;
            }
            if let Some(page) = pool.ready_page() {
                if !at_hand(&scene, page) {
                    pool.not_ready();
                } else if let Some(ray) = pool.pop_ready()
                    && let Some(ray) = lane.take(&scene, &mut walker, ray, &mut sums, &mut counts)
                {
                    let here = at_hand(&scene, ray.page);
                    let lanes = rules::goes_to_the_lane(ray.tries, scene.shading.maps.pages_of_a_hit());
                    self.aside = if lanes { Some(ray) } else { pool.push(ray, here).err() };
                }
                continue;
            }
            match self.stage {
                Stage::Shading { next, end, .. }
                    if self.lit.full || self.lit.count > 0 && (next == end || self.lit.count == lit.len()) =>
                {
                    let Lit { count, lane: to_lane, taken, cursor, full } = &mut self.lit;
                    *full = true;
                    if taken < to_lane {
                        lane.push(lit[*taken]);
                        *taken += 1;
                    } else if to_lane == count {
                        self.lit = Lit::default();
                    } else if *cursor < shadows {
                        if goes_together(&scene, *cursor) {
                            walker.shadows(&scene, &mut lit[*to_lane..*count], *cursor, &mut sums, &mut counts);
                        }
                        *cursor += 1;
                    } else if way.is_some() {
                        *to_lane = *count;
                    } else {
                        let (stay, all) = walker.follow(&scene, &mut lit[*to_lane..*count], &mut sums, &mut counts);
                        (*to_lane, *count, *cursor) = (*to_lane + stay, *to_lane + all, 0);
                    }
                }
                Stage::Shading { sample, next, end } if next < end => {
                    let (place, went) = (&places[next], &walked[next]);
                    let tile = self.in_work.tiles[usize::from(place.tile)];
                    let ray = primary(picture, textured, &rays[next], place, &went.best, sample, tile, self.me);
                    // What it needs may have come since the bundle was traced, and what it hit may have gone.
                    let hit = went.best.candidate.is_hit() && !at_hand(&scene, went.best.page);
                    let waits = match went.needs {
                        Some(page) => Some(RayRecord { page, ..ray }),
                        None if hit => Some(RayRecord { page: went.best.page, settled: 1, ..ray }),
                        None if went.best.candidate.is_hit() => None,
                        None => {
                            let last = way.as_ref().and_then(|way| way.last(&ray, &scene));
                            last.map(|page| RayRecord { page, settled: 1, ..ray })
                        }
                    };
                    match waits {
                        Some(ray) if way.as_ref().is_some_and(|way| way.begin(&ray, pool, peers, now)) => {}
                        Some(ray) => self.aside = pool.push(ray, at_hand(&scene, ray.page)).err(),
                        None => {
                            let walks = &mut walker.counts;
                            match hybray_tracer::begin(&scene, &ray, &went.best, &mut sums, &mut counts, walks) {
                                Ok(Some(record)) if lit.is_empty() => lane.push(record),
                                Ok(Some(record)) => {
                                    lit[self.lit.count] = record;
                                    self.lit.count += 1;
                                }
                                Ok(None) => {}
                                // It passed what it hit, or wants texels.
                                Err(on) if at_hand(&scene, on.page) => self.aside = Some(on),
                                Err(on) => self.aside = pool.push(on, false).err(),
                            }
                        }
                    }
                    self.stage = Stage::Shading { sample, next: next + 1, end };
                }
                // Samples of one pixel draw on each other's pages; but one bundle a step is enough.
                Stage::Shading { sample, .. } if frame.sample_from(u32::from(sample) + 1).is_some() => {
                    let sample = frame.sample_from(u32::from(sample) + 1).unwrap_or(sample);
                    if bundles == 1 {
                        break;
                    }
                    bundles += 1;
                    let count = self.in_work.rays;
                    start_sample(picture, sample, &places[..count], &mut rays[..count]);
                    match &way {
                        None => trace_bundle(&scene, &rays[..count], walked, &mut walker),
                        Some(_) => trace_bundle(&scene.at_hand(&Nothing), &rays[..count], walked, &mut walker),
                    }
                    counts.primary += count as u64;
                    self.stage = Stage::Shading { sample, next: 0, end: count };
                }
                Stage::Shading { .. } => {
                    self.stage = Stage::Idle;
                    if self.in_work.of_run
                        && let Some(run) = self.runs.front_mut()
                    {
                        run.done += self.in_work.count as u32;
                        self.tiles += self.in_work.count as u32;
                        if run.done == run.count
                            && let Some(run) = self.runs.pop_front()
                        {
                            // There is room: no more runs are taken in than this queue holds, and each is told before
                            // the next ends.
                            let _ = self.done.push_back(run);
                            // What comes next is another run's time.
                            break;
                        }
                    }
                }
                Stage::Idle if bundles == 1 => break,
                Stage::Idle => {
                    let room = pool.capacity() == 0
                        || rules::may_begin(pool.len(), pool.capacity(), self.settings.in_system as usize);
                    // The next bundle's pages come first, if they can be had.
                    let next = next_bundle(picture, &self.runs, None, square_from).filter(|_| room);
                    if pool.capacity() > 0
                        && let Some(next) = next
                    {
                        let kernels = self.kernels;
                        self.ahead.look(
                            picture,
                            &self.scene,
                            kernels,
                            next,
                            &mut walker.together.scratch,
                            &mut walker.counts,
                        );
                    }
                    // A bundle waits for its cliplist; a tile that is traced again has none.
                    let has_list = pool.capacity() == 0 || next.is_some_and(|next| self.ahead.has(next));
                    let runs = if has_list { &self.runs } else { &NO_RUNS };
                    let begun = if room { begin(picture, runs, sums.tiles, square_from) } else { None };
                    let Some(begun) = begun else {
                        units -= 1;
                        break;
                    };
                    bundles += 1;
                    let count = begun.place(picture, places);
                    self.in_work = InWork { rays: count, ..begun };
                    self.ahead.begin();
                    let next = next_bundle(picture, &self.runs, Some(&begun), square_from);
                    if pool.capacity() > 0
                        && let Some(next) = next
                    {
                        let kernels = self.kernels;
                        self.ahead.look(
                            picture,
                            &self.scene,
                            kernels,
                            next,
                            &mut walker.together.scratch,
                            &mut walker.counts,
                        );
                    }
                    start_sample(picture, first_sample, &places[..count], &mut rays[..count]);
                    match &way {
                        None => trace_bundle(&scene, &rays[..count], walked, &mut walker),
                        Some(_) => trace_bundle(&scene.at_hand(&Nothing), &rays[..count], walked, &mut walker),
                    }
                    counts.primary += count as u64;
                    self.stage = Stage::Shading { sample: first_sample, next: 0, end: count };
                }
            }
        }
        self.depth = lane.depth();
        self.walk_counts += walker.counts;
        counts += sums.counts;
        self.ended += sums.ended;
        self.counts += counts;
        let open = self.memory.tiles.iter().filter(|t| t.stage != TileStage::Free).count();
        self.high_water.tiles = (self.high_water.tiles.0.max(open), self.memory.tiles.len());
        units > 0
    }

    /// Sends what is finished, and what has to be said. Returns whether anything was sent. Bounded: a frame for each peer
    /// that waits for one.
    pub fn poll(&mut self, link: &mut dyn Link, now: u64) -> bool {
        let mut sent = self.greet(link);
        // The host hears who it is before it hears anything else: a stranger's contributions must not come first.
        if !self.greeted[0] {
            return sent;
        }
        if self.memory.pool.capacity() > 0 {
            sent |= self.answer(link);
            sent |= self.pay(link);
            let store = &self.store;
            let (parts, pages) = self.memory.server.serve(link, &|page| store.bytes(page));
            self.traffic.served += pages;
            sent |= parts;
            sent |= self.clip(link);
            sent |= self.ahead.ask(link, self.number);
            self.decide(now);
            sent |= self.ask(link);
            sent |= self.forward(link, now);
        }
        sent |= self.send_tiles(link);
        if let Some(Back { with, first, count }) = self.back
            && send(link, self.dispatcher, self.number, &Message::Back { with, first, count })
        {
            self.back = None;
            sent = true;
        }
        // The dispatcher must know how long a run is before it hears that it is done.
        while let Some(run) = self.done.front().filter(|_| self.back.is_none()) {
            let done = Message::Done { first: run.first, count: run.count, nanoseconds: run.nanoseconds };
            if !send(link, self.dispatcher, self.number, &done) {
                break;
            }
            self.done.pop_front();
            sent = true;
        }
        let open = self.memory.tiles.iter().any(|t| t.stage != TileStage::Free);
        let told = self.done.is_empty() && self.back.is_none();
        if let Some(of) = self.report
            && self.runs.is_empty()
            && told
            && self.stage == Stage::Idle
            && !open
        {
            let report = Message::Report {
                counts: self.counts,
                tiles: self.tiles,
                runs: self.runs_given,
                busy_nanoseconds: self.busy,
            };
            let went = send(link, HOST, of, &report);
            self.report = self.report.filter(|_| !went);
            sent |= went;
        }
        // Last: the words before it must not wait for room behind it for ever.
        if rules::says_idle(self.helped, self.idle, self.memory.pool.len()) {
            self.helped = !send(link, self.dispatcher, self.number, &Message::Idle { given: self.given });
            sent |= !self.helped;
        }
        sent
    }

    /// Makes cliplists for the nodes that this one is the subhost of.
    fn clip(&mut self, link: &mut dyn Link) -> bool {
        let Self { picture, number, scene, kernels, memory, walk_counts, .. } = self;
        let Some(picture) = picture else { return false };
        let scratch = &mut memory.bundle.together.scratch;
        memory.clips.serve(link, *number, &picture.map, &mut |tiles| {
            clip(picture, scene, *kernels, tiles, scratch, walk_counts)
        })
    }

    fn greet(&mut self, link: &mut dyn Link) -> bool {
        let mut sent = false;
        for (i, peer) in [HOST, self.dispatcher].into_iter().enumerate() {
            // A dispatcher elsewhere may be quicker than the host: it hears of this node once the picture has begun.
            let ready = peer == HOST || self.picture.is_some();
            if !self.greeted[i] && ready {
                let twice = i == 1 && peer == HOST;
                let hello = Message::Hello { version: hybray_wire::VERSION, scene: self.scene_hash };
                self.greeted[i] = twice || send(link, peer, self.number, &hello);
                sent |= self.greeted[i];
            }
        }
        sent
    }
}

/// Whether a ray that needs `page` can go on here.
fn at_hand<P: Pages + ?Sized>(scene: &Scene<'_, P>, page: u32) -> bool {
    page == FROM_ROOT || scene.resident.pages.nearest(page).is_some() || scene.resident.pages.texels(page).is_some()
}
