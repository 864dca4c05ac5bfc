//! The dispatcher: hands out runs of tiles (POV||Ray, section 2).
//!
//! It needs to know nothing but how many tiles there are, and which of them are finished already, so it can run on a node near the workers (section 2.2). Each
//! node has its next run before it ends the last; T, the nodes' rates and the least useful run are learned on the way.
//!
//! The rule bounds the imbalance only if no run takes more than T times as long as another, and if nobody holds back
//! what others could do. So what a node has in hand is kept short: at most twice what it has proven to be able to, a
//! short run behind a long one, and none behind another where others would be through with it first.
//!
//! All this is dynamic scheduling. The 1995 report's others are beside it ([`Tiles`]): by a count of the pixels that come
//! back to the host, where no word of a node is heard; and static, where each node's run is its part of the picture.

use crate::chunk::{Shares, chunk};
use crate::master::NO_MORE;
use crate::policy::{Hand, Tiles, gives, missing};
use crate::send;
use hybray_link::{HOST, Link, Peer};
use hybray_wire::{Message, View};

/// Runs that a node has at a time: one in work, and the next.
const AHEAD: usize = 2;
/// Runs that a node has at a time at most, where pixels are counted.
pub(crate) const RUNS_MAX: usize = 8;
/// A node that is done with its runs, but some of whose tiles have not come back for so long, nanoseconds, is given
/// others all the same: a frame that is lost must not keep it waiting for ever.
const SILENCE: u64 = 10_000_000_000;
/// Runs that wait to be given out again.
const AGAIN_MAX: usize = 64;
/// T before anything is known, and the least that is learned (Pandzic and Magnenat-Thalmann, by way of POV||Ray's
/// conclusions): what was even so far may not be so further down.
const SPREAD_START: f32 = 2.5;
/// What a learned T may be.
const SPREAD_RANGE: (f32, f32) = (2.5, 16.0);
/// A node with less of the mean rate than this is slow.
const SLOW: f32 = 0.5;
/// Nodes that one node shares with at a time: each takes half of what is left, and each word costs it time.
const HELPERS: u32 = 2;
/// What a word and its answer are taken to need before it is known, nanoseconds.
const WORD: u64 = 100_000;
/// Who had nothing to share is asked again after the time of two words, then four, up to 2 to this power.
const DRY_MAX: u32 = 10;
/// A run should take this many times as long as its messages.
const OVERHEAD_FACTOR: u64 = 2;

/// What may be chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// T; learned if `None`.
    pub spread: Option<f32>,
    /// Least tiles of a run; learned if `None`.
    pub atomic: Option<u32>,
    /// When a node is given tiles. Pixels come back to the host: for a dispatcher elsewhere a count of them is
    /// [`Tiles::Dynamic`].
    pub tiles: Tiles,
    /// At the end of a picture, nodes that have nothing to do are given some of the others' rays and tiles: never where
    /// tiles are divided once for all.
    pub take_over: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { spread: None, atomic: None, tiles: Tiles::Dynamic, take_over: true }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    first: u32,
    count: u32,
    epoch: u16,
    /// Tiles of it that have come back, if pixels are counted; and whether its node has said that it is done.
    back: u32,
    done: bool,
}

impl Run {
    const fn new(first: u32, count: u32, epoch: u16) -> Self {
        Self { first, count, epoch, back: 0, done: false }
    }

    /// Something of it is still to be heard.
    const fn stays(&self) -> bool {
        self.back < self.count || !self.done
    }
}

type Runs = heapless::Deque<Run, RUNS_MAX>;

/// What the dispatcher knows of a node: one for each peer is lent to it.
#[derive(Clone, Debug, Default)]
pub struct NodeState {
    here: bool,
    lost: bool,
    /// It is given no tiles.
    barred: bool,
    /// Has been told that nothing is left.
    told: bool,
    /// What is left of its part of the picture.
    next: u32,
    end: u32,
    /// Tiles of it that were finished before.
    kept: u32,
    /// Runs in its hands, the oldest first.
    runs: Runs,
    /// It has nothing to do, and this peer was told to share with it.
    helping: Option<Peer>,
    /// When it ended its last run, and how often it was told to share since.
    since: u64,
    asked: u32,
    /// Nodes that it was told to share with, and that are not through with it.
    helpers: u32,
    /// How often it had nothing to share, since it last had something or ended a run; and when it may be asked again.
    dry: u32,
    dry_until: u64,
    tiles_done: u64,
    nanoseconds: u64,
    /// When its first run was sent, to learn what a message costs.
    first_sent_at: Option<u64>,
    measured: bool,
}

impl NodeState {
    fn in_hand(&self) -> u32 {
        self.runs.iter().map(|run| run.count - run.back).sum()
    }

    /// Drops the runs that `stays` does not hold for.
    fn keep(&mut self, stays: impl Fn(&Run) -> bool) {
        for _ in 0..self.runs.len() {
            if let Some(run) = self.runs.pop_front().filter(&stays) {
                let _ = self.runs.push_back(run);
            }
        }
    }

    /// It can be given tiles.
    fn is_open(&self) -> bool {
        self.here && !self.barred
    }

    /// Tiles of its part that were never given out.
    fn left(&self) -> u32 {
        self.end - self.next - self.kept
    }
}

/// A bit for each tile.
struct TileSet<'m>(&'m mut [u64]);

impl TileSet<'_> {
    fn has(&self, tile: u32) -> bool {
        self.0.get(tile as usize / 64).is_some_and(|word| word >> (tile % 64) & 1 == 1)
    }

    /// Puts in a run of tiles, as far as there is room.
    fn put(&mut self, first: u32, count: u32) {
        let end = (u64::from(first) + u64::from(count)).min(64 * self.0.len() as u64);
        (u64::from(first)..end).for_each(|tile| self.0[tile as usize / 64] |= 1 << (tile % 64));
    }
}

/// What all nodes together are at, at one moment.
struct Crew {
    /// Tiles a nanosecond; 0 if nothing is known.
    mean_rate: f32,
    /// Nodes that are here and may be given tiles.
    here: u32,
    /// Tiles in their hands.
    in_hand: u32,
    /// Rates of those who have some, over the mean.
    rates: f32,
    /// Whether a lost node has left runs.
    orphans: bool,
}

impl Crew {
    /// A node's rate over the mean: 1 if it is not known. It is measured on the tiles that the node had, so it tells
    /// quick nodes from cheap tiles in the long run only.
    fn rate(&self, node: &NodeState) -> f32 {
        let known = node.tiles_done > 0 && node.nanoseconds > 0 && self.mean_rate > 0.0;
        if known { node.tiles_done as f32 / node.nanoseconds as f32 / self.mean_rate } else { 1.0 }
    }
}

/// The machine. Memory is lent: `nodes` has one entry for each peer of the link, the host's (unused) included.
pub struct Dispatcher<'m> {
    nodes: &'m mut [NodeState],
    options: Options,
    /// Which picture of the run it is, or is to be.
    picture: u16,
    /// Tiles of the picture; 0 until it begins.
    tiles: u32,
    /// Tiles to be given out: all, but for those that are kept.
    wanted: u32,
    /// Tiles that were finished before.
    kept: TileSet<'m>,
    /// Each node begins in its own part of the picture.
    biased: bool,
    /// Where these parts begin, and where the last ends, if they are not of equal numbers of tiles.
    bounds: &'m [u32],
    /// The node that the dispatcher is on; [`HOST`] if it is on none.
    me: Peer,
    again: heapless::Deque<Run, AGAIN_MAX>,
    /// More tiles to be given out again are on their way here.
    gathering: bool,
    /// Least and greatest cost of a tile in any run, nanoseconds.
    cheapest: u64,
    dearest: u64,
    runs_done: u32,
    /// Least time that a run's messages were seen to take.
    overhead: u64,
}

impl<'m> Dispatcher<'m> {
    /// Waits for a picture and for nodes.
    #[must_use]
    pub fn new(nodes: &'m mut [NodeState], options: Options) -> Self {
        nodes.fill(NodeState::default());
        Self {
            nodes,
            options,
            picture: 0,
            tiles: 0,
            wanted: 0,
            kept: TileSet(&mut []),
            biased: false,
            bounds: &[],
            me: HOST,
            again: heapless::Deque::new(),
            gathering: false,
            cheapest: u64::MAX,
            dearest: 0,
            runs_done: 0,
            overhead: u64::MAX,
        }
    }

    /// Whether each node begins in a part of the picture of its own: of use where it must ask for pages that it has not.
    #[must_use]
    pub fn biased(self, biased: bool) -> Self {
        Self { biased, ..self }
    }

    /// Where each node's part of the picture begins, in tiles, and after these where the last one ends: parts that are
    /// thought to take as long as each other. Bounds that do not rise, or are not one more than nodes, are passed over.
    #[must_use]
    pub fn with_parts(self, bounds: &'m [u32]) -> Self {
        let sound = bounds.len() == self.nodes.len() && bounds.first() == Some(&0) && bounds.is_sorted();
        if sound { Self { bounds, biased: true, ..self } } else { self }
    }

    /// On a node: it has less time for tiles than others, and takes none from their parts where parts are given.
    #[must_use]
    pub fn on(self, me: Peer) -> Self {
        Self { me, ..self }
    }

    /// For pictures of which some tiles may be finished already: a bit of `kept` for each tile that it is to know of so.
    /// Others of these are traced for nothing: the film has them and takes no more.
    #[must_use]
    pub fn keeping(self, kept: &'m mut [u64]) -> Self {
        kept.fill(0);
        Self { kept: TileSet(kept), ..self }
    }

    /// Nodes that are to be given no tiles, while any other is left: entry 0 is the host's.
    #[must_use]
    pub fn barring(mut self, barred: &[bool]) -> Self {
        self.nodes.iter_mut().zip(barred).for_each(|(node, &barred)| node.barred = barred);
        self.open_if_none();
        self
    }

    /// Waits for another picture, and for nodes to begin it: each picture is given out as if it were the first. Who is lost
    /// stays so.
    pub fn next(&mut self, picture: u16) {
        for node in self.nodes.iter_mut() {
            *node = NodeState { lost: node.lost, barred: node.barred, ..NodeState::default() };
        }
        self.kept.0.fill(0);
        self.again.clear();
        (self.picture, self.tiles, self.wanted, self.gathering) = (picture, 0, 0, false);
        (self.cheapest, self.dearest, self.runs_done, self.overhead) = (u64::MAX, 0, 0, u64::MAX);
    }

    /// Takes in a message; those for other machines are passed over, and so are those about other pictures, and what only the
    /// host may say.
    pub fn handle(&mut self, from: Peer, view: &View<'_>, now: u64) {
        if view.picture != self.picture {
            return;
        }
        match view.message {
            Message::End if from == HOST => self.next(self.picture.saturating_add(1)),
            Message::Begin(frame) if from == HOST => {
                self.tiles = hybray_wire::TileMap::new(frame.width, frame.height).map_or(0, |map| map.len());
                self.divide();
                self.wanted = self.left();
            }
            Message::Kept { first, count } if from == HOST && self.tiles == 0 => self.kept.put(first, count),
            Message::Hello { .. } => {
                if let Some(node) = self.nodes.get_mut(usize::from(from)) {
                    node.here = !node.lost;
                }
            }
            Message::Done { first, count, .. } if self.counts_pixels() => self.ended(from, first, count, now),
            Message::Done { first, count, nanoseconds } => self.done(from, first, count, nanoseconds, now),
            Message::Contributions { tile, .. } if self.counts_pixels() => self.came_back(from, tile, now),
            Message::Again { tile, epoch } if from == HOST => self.again(tile, epoch),
            Message::Back { with, first, count } => self.back(from, with, first, count),
            Message::Idle { given } => {
                let word = if self.overhead == u64::MAX { WORD } else { self.overhead };
                let helped = self.nodes.get_mut(usize::from(from)).and_then(|node| node.helping.take());
                if let Some(helped) = helped.and_then(|helped| self.nodes.get_mut(usize::from(helped))) {
                    helped.helpers = helped.helpers.saturating_sub(1);
                    // Rays may still come to it from others, but who asks too often takes the time to trace them.
                    helped.dry = if given { 0 } else { (helped.dry + 1).min(DRY_MAX) };
                    helped.dry_until = if given { 0 } else { now.saturating_add(word.saturating_mul(1 << helped.dry)) };
                }
            }
            _ => {}
        }
    }

    /// A peer is gone: what it had is given to others, under a new epoch.
    pub fn lost(&mut self, peer: Peer) {
        let is_static = self.options.tiles == Tiles::Static;
        if let Some(node) = self.nodes.get_mut(usize::from(peer)) {
            node.here = false;
            node.lost = true;
            // Its part of the picture was for nobody else.
            if is_static && node.left() > 0 && node.runs.push_back(Run::new(node.next, node.end - node.next, 0)).is_ok()
            {
                (node.next, node.kept) = (node.end, 0);
            }
            for run in node.runs.iter_mut() {
                *run = Run::new(run.first, run.count, run.epoch.saturating_add(1));
            }
        }
        self.open_if_none();
    }

    /// Somebody must draw the picture, whatever was to be.
    fn open_if_none(&mut self) {
        if self.nodes.iter().skip(1).all(|node| node.lost || node.barred) {
            self.nodes.iter_mut().for_each(|node| node.barred = false);
        }
    }

    fn is_divided(&self) -> bool {
        self.biased || self.options.tiles == Tiles::Static
    }

    fn counts_pixels(&self) -> bool {
        matches!(self.options.tiles, Tiles::PixelCount { .. })
    }

    /// Where pixels are counted, the end of a run is heard so that the picture ends, and a node's queue does not overflow.
    fn ended(&mut self, from: Peer, first: u32, count: u32, now: u64) {
        let Some(node) = self.nodes.get_mut(usize::from(from)) else { return };
        let is = |run: &&mut Run| !run.done && (run.first, run.count) == (first, count);
        if let Some(run) = node.runs.iter_mut().find(is) {
            run.done = true;
            node.since = now;
            node.keep(Run::stays);
        }
    }

    /// A tile of a node has come back.
    fn came_back(&mut self, from: Peer, tile: u32, now: u64) {
        let Some(node) = self.nodes.get_mut(usize::from(from)).filter(|node| node.here) else { return };
        let is = |run: &&mut Run| tile.wrapping_sub(run.first) < run.count && run.back < run.count;
        let Some(run) = node.runs.iter_mut().find(is) else { return };
        run.back += 1;
        (node.since, node.asked) = (now, 0);
        // Runs do not end in their order: some tile's rays may be long under way.
        node.keep(Run::stays);
    }

    /// A tile that the film wants again, or the end of their list. The picture is not idle in between: each node would
    /// report before all is done, and nobody could tell that report from the next.
    fn again(&mut self, tile: u32, epoch: u16) {
        for node in self.nodes.iter_mut() {
            node.told = false;
            // Everything has come back that ever will.
            node.keep(|run| !run.done);
        }
        if tile == NO_MORE {
            self.gathering = false;
        }
        if tile >= self.tiles {
            return;
        }
        self.gathering = true;
        let adjacent = |run: &Run| run.first + run.count == tile && run.epoch == epoch;
        if let Some(run) = self.again.back_mut().filter(|run| adjacent(run)) {
            run.count += 1;
        } else if self.again.push_back(Run::new(tile, 1, epoch)).is_err()
            && let Some(run) = self.again.back_mut()
        {
            // Where there is no room, the tiles in between are traced for nothing: the film has them and takes no more.
            let end = (run.first + run.count).max(tile + 1);
            run.first = run.first.min(tile);
            run.count = end - run.first;
            run.epoch = run.epoch.max(epoch);
        }
    }

    /// Tiles that a node has not begun, for one that has nothing to do: they are that node's part of the picture now.
    fn back(&mut self, from: Peer, with: Peer, first: u32, count: u32) {
        let Some(node) = self.nodes.get_mut(usize::from(from)) else { return };
        // Its last run then: another may be on its way there since.
        let is_tail = |run: &&mut Run| {
            count > 0 && count <= run.count && run.epoch == 0 && first == run.first + (run.count - count)
        };
        let Some(run) = node.runs.iter_mut().find(is_tail) else { return };
        run.count -= count;
        node.keep(|run| run.count > 0);
        if let Some(helped) = self.nodes.get_mut(usize::from(with)).filter(|node| node.helping == Some(from)) {
            helped.helping = None;
            self.nodes[usize::from(from)].helpers -= 1;
        }
        // Nobody is told to share before all parts are empty, and each who is helped is given back to once: its own is empty.
        let is_free = |to: &usize| self.nodes[*to].left() == 0;
        let with = usize::from(with).min(self.nodes.len() - 1);
        match [with].into_iter().chain(0..self.nodes.len()).find(is_free) {
            Some(to) => {
                let part = &mut self.nodes[to];
                (part.next, part.end, part.kept) = (first, first + count, 0);
            }
            None => drop(self.again.push_back(Run::new(first, count, 0))),
        }
    }

    fn done(&mut self, from: Peer, first: u32, count: u32, nanoseconds: u64, now: u64) {
        let Some(node) = self.nodes.get_mut(usize::from(from)) else { return };
        let Some(&run) = node.runs.front() else { return };
        if (run.first, run.count) != (first, count) {
            return;
        }
        node.runs.pop_front();
        node.tiles_done += u64::from(count);
        (node.since, node.asked, node.dry, node.dry_until) = (now, 0, 0, 0);
        node.nanoseconds = node.nanoseconds.saturating_add(nanoseconds);
        if !node.measured {
            node.measured = true;
            let round_trip = now.saturating_sub(node.first_sent_at.unwrap_or(now));
            self.overhead = self.overhead.min(round_trip.saturating_sub(nanoseconds));
        }
        self.runs_done += 1;
        let cost = nanoseconds / u64::from(count.max(1));
        self.cheapest = self.cheapest.min(cost);
        self.dearest = self.dearest.max(cost);
    }

    /// How many nodes share the picture: also those that have not been heard of yet, or the first would be given all.
    fn sharing(&self) -> u32 {
        (self.nodes.iter().skip(1).filter(|n| !n.lost && !n.barred).count() as u32).max(1)
    }

    /// T as it is now.
    #[must_use]
    pub fn spread(&self) -> f32 {
        let nodes = self.sharing();
        self.options.spread.unwrap_or(if self.runs_done < 2 * nodes || self.cheapest == 0 {
            SPREAD_START
        } else {
            (self.dearest as f32 / self.cheapest as f32).clamp(SPREAD_RANGE.0, SPREAD_RANGE.1)
        })
    }

    /// Least tiles of a run as it is now: as many as take twice the time of their messages, but few
    /// enough that each node could have several.
    #[must_use]
    pub fn atomic(&self) -> u32 {
        if let Some(atomic) = self.options.atomic {
            return atomic.max(1);
        }
        let (tiles, nanoseconds) = self
            .nodes
            .iter()
            .fold((0, 0), |(t, n), node| (t + node.tiles_done, u64::saturating_add(n, node.nanoseconds)));
        let nodes = self.sharing();
        let most = (self.wanted / (16 * nodes)).max(1);
        if tiles == 0 || self.overhead == u64::MAX {
            return most.min(4);
        }
        let cost = (nanoseconds / tiles).max(1);
        let wanted = (self.overhead.saturating_mul(OVERHEAD_FACTOR) / cost).min(u64::from(most)) as u32;
        // Four tiles from a multiple of four on are a square, and a square is a bundle.
        wanted.max(1).next_multiple_of(if wanted >= 4 { 4 } else { 1 })
    }

    /// Whether every tile was given out and every run is done.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.tiles > 0
            && self.left() == 0
            && self.again.is_empty()
            && !self.gathering
            && self.nodes.iter().flat_map(|node| node.runs.iter()).all(|run| run.done)
    }

    /// What is at work now. Bounded: all nodes, once.
    fn crew(&self) -> Crew {
        let rate = |n: &NodeState| n.tiles_done as f32 / n.nanoseconds as f32;
        let known = |n: &&NodeState| n.here && n.tiles_done > 0 && n.nanoseconds > 0;
        let (sum, count) =
            self.nodes.iter().filter(known).fold((0.0, 0.0), |(sum, count), n| (sum + rate(n), count + 1.0));
        let mut crew = Crew {
            mean_rate: if count > 0.0 { sum / count } else { 0.0 },
            here: self.nodes.iter().filter(|n| n.is_open()).count() as u32,
            in_hand: 0,
            rates: 0.0,
            orphans: self.nodes.iter().any(|n| n.lost && !n.runs.is_empty()),
        };
        for node in self.nodes.iter().filter(|n| n.here && !n.runs.is_empty()) {
            crew.in_hand += node.in_hand();
            crew.rates += crew.rate(node);
        }
        crew
    }

    /// Whether what is left is better left to others: this node has work, or is slow, and those who are at work would
    /// be through with it first.
    fn ends_too_late(&self, peer: usize, crew: &Crew, atomic: u32) -> bool {
        let (node, rate) = (&self.nodes[peer], crew.rate(&self.nodes[peer]));
        let left = self.left();
        let mine = (node.in_hand() + atomic.min(left)) as f32 / rate;
        let others = (left + crew.in_hand - node.in_hand()) as f32;
        let others_rates = crew.rates - if node.runs.is_empty() { 0.0 } else { rate };
        let others_at_work = crew.in_hand > node.in_hand();
        others_at_work && (rate < SLOW || !node.runs.is_empty()) && mine * others_rates > others
    }

    /// The next run for a node: what others lost or the film asks for again first.
    fn next_run(&mut self, peer: usize, crew: &Crew) -> Option<Run> {
        let rate = crew.rate(&self.nodes[peer]);
        // What is least worth a message is a time: a slow node needs fewer tiles for it.
        let atomic = if rate < SLOW { ((self.atomic() as f32 * rate) as u32).max(1) } else { self.atomic() };
        if let Some(run) = self.second_hand(crew, atomic) {
            return Some(run);
        }
        let left = self.left();
        if left == 0 {
            return None;
        }
        let count = match self.options.tiles {
            // Its part, once: what is left otherwise is for nodes that are not here yet.
            Tiles::Static => {
                let node = &self.nodes[peer];
                (node.left() > 0).then_some(node.end - node.next)?
            }
            // Nobody to share with: there is nothing to wait for.
            Tiles::PixelCount { .. } if self.sharing() == 1 => left,
            Tiles::PixelCount { .. } => missing(self.options.tiles, &self.hand(peer, AHEAD)).max(atomic),
            Tiles::Dynamic => self.dynamic(peer, crew, rate, atomic)?,
        };
        Some(self.cut(peer, count))
    }

    /// How many tiles come next where nodes say that they are done; none if others had better have them.
    fn dynamic(&self, peer: usize, crew: &Crew, rate: f32, atomic: u32) -> Option<u32> {
        if self.ends_too_late(peer, crew, atomic) {
            return None;
        }
        let (node, left) = (&self.nodes[peer], self.left());
        if node.runs.front().is_some_and(|run| run.count > atomic) {
            // It has enough to do. What comes behind need only last until the message after it is there: whatever it
            // has in hand, nobody else can take.
            return Some(atomic.min(left));
        }
        let shares = Shares {
            tiles: left,
            nodes: self.sharing(),
            spread: self.spread(),
            // A node that seems quick may have had the sky: none gets more than its part for that.
            relative_rate: rate.min(1.0),
            atomic,
        };
        // What a node can do is not known before it has done something, and only as far as it has.
        let proven = u32::try_from(node.tiles_done.saturating_mul(2)).unwrap_or(u32::MAX).max(atomic);
        // Half of a part that is thought to take as long as all others at a time: what is not begun comes back if others
        // have nothing to do before.
        let half = node.left() / 2;
        Some(if shares.nodes == 1 {
            left
        } else if !self.bounds.is_empty() && half > atomic {
            half
        } else {
            chunk(&shares).min(proven)
        })
    }

    /// What is known of a node that is meant to have so many runs now.
    fn hand(&self, peer: usize, wanted: usize) -> Hand {
        let node = &self.nodes[peer];
        Hand { runs: node.runs.len(), tiles: node.in_hand(), wanted }
    }

    /// Tiles that were never given out.
    fn left(&self) -> u32 {
        self.nodes.iter().map(NodeState::left).sum()
    }

    /// Parts of the picture that tiles are given out from: one for all, which the host's entry holds, or one for each node
    /// that may be given tiles, so that it draws on the same pages for long (biased scheduling, the 1995 report's chapter
    /// 8), or is given no other ones (static scheduling, chapter 3).
    fn divide(&mut self) {
        let is_divided = self.is_divided();
        let (parts, tiles) = (self.sharing(), self.tiles);
        let bounds = if self.bounds.len() == parts as usize + 1 { self.bounds } else { &[] };
        let even = |part: u32| (u64::from(tiles) * u64::from(part) / u64::from(parts)) as u32 / 4 * 4;
        let bound = |part: u32| bounds.get(part as usize).map_or_else(|| even(part), |&bound| bound.min(tiles));
        let mut part = 0;
        for (peer, node) in self.nodes.iter_mut().enumerate() {
            let has_part = peer > 0 && !node.lost && !node.barred;
            (node.next, node.end) = match (is_divided, peer) {
                (false, 0) => (0, tiles),
                (true, _) if has_part => {
                    part += 1;
                    (bound(part - 1), if part == parts { tiles } else { bound(part) })
                }
                _ => (0, 0),
            };
            node.kept = (node.next..node.end).filter(|&tile| self.kept.has(tile)).count() as u32;
        }
    }

    /// A run of `count` tiles, or fewer up to a tile that is kept or where its part ends: from the node's own part or, where that is empty, the end of
    /// the one that has most left.
    fn cut(&mut self, peer: usize, count: u32) -> Run {
        let own = if self.is_divided() { peer } else { 0 };
        let others = self.nodes[own].left() == 0;
        let part =
            if others { (0..self.nodes.len()).rev().max_by_key(|&p| self.nodes[p].left()).unwrap_or(own) } else { own };
        let part = &mut self.nodes[part];
        let kept = &self.kept;
        while part.kept > 0 && kept.has(if others { part.end - 1 } else { part.next }) {
            part.kept -= 1;
            if others { part.end -= 1 } else { part.next += 1 }
        }
        let mut count = count.min(part.end - part.next);
        // What is left begins at a square, unless it would be nothing.
        if others {
            if count >= 4 {
                count = part.end - ((part.end - count) / 4 * 4).max(part.next);
            }
            if part.kept > 0 {
                count = (part.end - count..part.end).rev().take_while(|&tile| !kept.has(tile)).count() as u32;
            }
            part.end -= count;
            return Run::new(part.end, count, 0);
        }
        if count >= 4 {
            count = (part.next + count).next_multiple_of(4).min(part.end) - part.next;
        }
        if part.kept > 0 {
            count = (part.next..part.next + count).take_while(|&tile| !kept.has(tile)).count() as u32;
        }
        part.next += count;
        Run::new(part.next - count, count, 0)
    }

    /// A part of what the film asks for again, or of what a lost node left: all of it could be too much for one at the
    /// end of a picture.
    fn second_hand(&mut self, crew: &Crew, atomic: u32) -> Option<Run> {
        let cut = |run: &mut Run| {
            let count = run.count.div_ceil(crew.here.max(1)).max(atomic).min(run.count);
            let part = Run::new(run.first, count, run.epoch);
            *run = Run::new(run.first + count, run.count - count, run.epoch);
            part
        };
        if let Some(run) = self.again.front_mut() {
            let part = cut(run);
            if run.count == 0 {
                self.again.pop_front();
            }
            return Some(part);
        }
        let orphans = if crew.orphans { &mut self.nodes[..] } else { &mut [] };
        let runs = &mut orphans.iter_mut().find(|n| n.lost && !n.runs.is_empty())?.runs;
        let run = runs.front_mut()?;
        let part = cut(run);
        if run.count == 0 {
            runs.pop_front();
        }
        Some(part)
    }

    /// At the end of a picture, those who have nothing to do are given rays by those who have. Bounded: all nodes, once.
    fn share(&mut self, link: &mut dyn Link, now: u64) {
        let count = self.nodes.len();
        for idle in 1..count {
            let node = &self.nodes[idle];
            // Some of what is shared are tiles: who is barred would have them given to others again, for ever.
            if !node.is_open() || node.helping.is_some() || !node.runs.is_empty() {
                continue;
            }
            // Whoever has been at a run for longest; each in turn if several ask. Who has no run any more may still have
            // rays that wait.
            let key = |peer: &usize| {
                let node = &self.nodes[*peer];
                (node.runs.is_empty(), node.asked, node.since)
            };
            let may_be = |peer: &usize| {
                let node = &self.nodes[*peer];
                *peer != idle && node.here && node.helping.is_none() && node.helpers < HELPERS && node.dry_until <= now
            };
            let Some(peer) = (1..count).filter(may_be).min_by_key(key) else { return };
            if send(link, peer as Peer, self.picture, &Message::Share { with: idle as Peer }) {
                self.nodes[idle].helping = Some(peer as Peer);
                let helped = &mut self.nodes[peer];
                (helped.asked, helped.helpers) = (helped.asked + 1, helped.helpers + 1);
            }
        }
    }

    /// Puts a run back where it came from, the node's own part before others': there is room for it there, or the rest of
    /// it.
    fn give_back(&mut self, run: Run, peer: usize) {
        let end = run.first + run.count;
        let was_cut = |node: &NodeState| run.epoch == 0 && (node.next == end || node.end == run.first);
        let own = core::iter::once(if self.is_divided() { peer } else { 0 });
        if let Some(part) = own.chain(0..self.nodes.len()).find(|&part| was_cut(&self.nodes[part])) {
            let part = &mut self.nodes[part];
            if part.next == end {
                part.next = run.first;
            } else {
                part.end = end;
            }
            return;
        }
        let lost = self.nodes.iter_mut().filter(|n| n.lost).map(|n| &mut n.runs);
        let rest = self.again.front_mut().into_iter().chain(lost.filter_map(|runs| runs.front_mut()));
        if let Some(rest) = rest.into_iter().find(|rest| rest.first == end && rest.epoch == run.epoch) {
            *rest = Run::new(run.first, rest.count + run.count, run.epoch);
        } else if self.again.push_front(run).is_err()
            && let Some(node) = self.nodes.iter_mut().find(|n| n.lost && !n.runs.is_full())
        {
            let _ = node.runs.push_front(run);
        }
    }

    /// Sends runs to nodes that have fewer than two, and tells all when nothing is left. Bounded: two frames a node.
    pub fn poll(&mut self, link: &mut dyn Link, now: u64) {
        if self.tiles == 0 {
            return;
        }
        if self.counts_pixels() && link.me() != HOST {
            self.options.tiles = Tiles::Dynamic;
        }
        let mut crew = self.crew();
        let all_here = crew.here == self.sharing();
        // First one each, then the second: a node's next run is no reason for another to have none.
        for wanted in 1..=AHEAD {
            for peer in 0..self.nodes.len() {
                let node = &mut self.nodes[peer];
                if now.saturating_sub(node.since) > SILENCE {
                    node.keep(|run| !run.done);
                }
                // The first run is what a node waits for. Where the dispatcher is near, the second can wait until all have one.
                let first = wanted == 1 || all_here || node.tiles_done > 0 || self.me == HOST;
                let only_own = !self.bounds.is_empty() && self.me != HOST && peer == usize::from(self.me);
                let has_no_part = only_own && node.left() == 0;
                let may = node.is_open() && !node.runs.is_full() && first && !(has_no_part && crew.here > 1);
                if !may || !gives(self.options.tiles, &self.hand(peer, wanted)) {
                    continue;
                }
                let Some(run) = self.next_run(peer, &crew) else { continue };
                let message = Message::Tiles { first: run.first, count: run.count, epoch: run.epoch };
                if send(link, peer as Peer, self.picture, &message) {
                    let node = &mut self.nodes[peer];
                    crew.in_hand += run.count;
                    crew.rates += if node.runs.is_empty() { crew.rate(node) } else { 0.0 };
                    node.first_sent_at.get_or_insert(now);
                    let _ = node.runs.push_back(run);
                } else {
                    self.give_back(run, peer);
                }
            }
        }
        if self.is_idle() {
            for peer in 0..self.nodes.len() {
                if self.nodes[peer].here && !self.nodes[peer].told {
                    self.nodes[peer].told =
                        send(link, peer as Peer, self.picture, &Message::Finished { tile: u32::MAX });
                }
            }
        }
        // Who is to hear that nothing is left hears it first: what is shared must not take the room for it for ever.
        let told = !self.is_idle() || self.nodes.iter().all(|node| !node.here || node.told);
        let takes_over = self.options.take_over && self.options.tiles != Tiles::Static;
        if takes_over && told && self.left() == 0 && self.again.is_empty() && !self.gathering {
            self.share(link, now);
        }
    }
}

#[cfg(test)]
mod tests;
