//! The network: frames on their way, and those that wait to be read.

use crate::model::NetworkModel;
use crate::route::{Place, Routes};
use hybray_link::{Event, Link, Peer};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

/// A frame on its way or unread. Its buffer is used again when it has been read.
#[derive(Default)]
struct Frame {
    from: Peer,
    to: Peer,
    at: Place,
    kind: Kind,
    bytes: Vec<u8>,
}

/// What stands in the queue of events.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Kind {
    #[default]
    Frame,
    /// The news that `from` is lost.
    Loss,
    /// The end of `from`, of which the others learn so much later.
    End { notice_ns: u64 },
}

/// What is known of one participant's frames to another, from the first one on.
#[derive(Default)]
struct Pair {
    /// Frames on the way or unread.
    unread: u32,
    /// When the last frame entered the network: the next does not do so before.
    entered_ns: u64,
    /// A frame was refused since room was last made: the sender waits for some.
    refused: bool,
    /// Nothing goes from one to the other any more.
    closed: bool,
}

/// A directed link at work.
#[derive(Default)]
struct LinkState {
    free_at_ns: u64,
    /// When frames that wait will begin to cross.
    starts: VecDeque<u64>,
    counts: LinkCounts,
}

/// What a physical link did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkCounts {
    /// Frames that crossed it, or are crossing.
    pub frames: u64,
    /// Their bytes.
    pub bytes: u64,
    /// How long it was busy.
    pub busy_ns: u64,
    /// Most frames that waited for it at a time.
    pub waiting_most: usize,
}

/// What a participant sent and received; frames to oneself are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Frames sent.
    pub sent_frames: u64,
    /// Their bytes.
    pub sent_bytes: u64,
    /// Frames read.
    pub received_frames: u64,
    /// Their bytes.
    pub received_bytes: u64,
    /// Most frames that waited to be read at a time.
    pub unread_most: usize,
}

/// One participant's side.
#[derive(Default)]
struct Side {
    /// Frames that have arrived, in that order.
    inbox: VecDeque<u32>,
    /// Pairs that it is the sender of.
    pairs: BTreeMap<Peer, Pair>,
    traffic: Traffic,
    gone: bool,
}

/// Frames are delayed by up to so much, by chance.
struct Delays {
    seed: u64,
    delay_ns_max: u64,
}

/// All links and what is on them.
///
/// Frames move when [`Network::advance`] is called: a caller that keeps several participants turns whichever is first,
/// the network ([`Network::next_event`]) or one of them, and asks [`Network::pop_news`] who has something to look at.
pub struct Network {
    routes: Routes,
    room_frames: u32,
    links: Vec<LinkState>,
    sides: Vec<Side>,
    frames: Vec<Frame>,
    free: Vec<u32>,
    /// Time, number and frame: what happens first, and of things at the same time what was set going first.
    events: BinaryHeap<Reverse<(u64, u64, u32)>>,
    set_going: u64,
    news: VecDeque<Peer>,
    scratch: Vec<u8>,
    log: u64,
    delivered: u64,
    delays: Option<Delays>,
    /// From when, and until.
    cuts: BTreeMap<(Peer, Peer), (u64, u64)>,
}

impl Network {
    /// A quiet network between `peers` participants, at time 0.
    #[must_use]
    pub fn new(model: &NetworkModel, peers: Peer) -> Self {
        let routes = Routes::new(model, peers);
        Self {
            links: (0..routes.links()).map(|_| LinkState::default()).collect(),
            routes,
            room_frames: model.room_frames.max(1),
            sides: (0..peers).map(|_| Side::default()).collect(),
            frames: Vec::new(),
            free: Vec::new(),
            events: BinaryHeap::new(),
            set_going: 0,
            news: VecDeque::new(),
            scratch: Vec::new(),
            log: 0xcbf2_9ce4_8422_2325,
            delivered: 0,
            delays: None,
            cuts: BTreeMap::new(),
        }
    }

    /// What participant `me` has of it at `now_ns`. What arrives until then has arrived. A participant's own times must
    /// not fall from one call to the next.
    pub fn end(&mut self, me: Peer, now_ns: u64) -> End<'_> {
        self.advance(now_ns);
        End { network: self, me, now_ns }
    }

    /// How many participants there are.
    #[must_use]
    pub fn peers(&self) -> Peer {
        self.sides.len() as Peer
    }

    /// When a frame next moves.
    #[must_use]
    pub fn next_event(&self) -> Option<u64> {
        self.events.peek().map(|Reverse((time, _, _))| *time)
    }

    /// Moves frames until `to_ns`, inclusive.
    pub fn advance(&mut self, to_ns: u64) {
        while let Some(&Reverse((time, _, frame))) = self.events.peek()
            && time <= to_ns
        {
            self.events.pop();
            self.move_on(time, frame);
        }
    }

    /// A participant for whom a frame has arrived, or room was made that it had been refused. Each is named once for
    /// each reason.
    pub fn pop_news(&mut self) -> Option<Peer> {
        self.news.pop_front()
    }

    /// Hash (FNV-1a, 64 bits) of all deliveries so far: time, sender, receiver, length. Equal for equal histories.
    #[must_use]
    pub fn log_hash(&self) -> u64 {
        self.log
    }

    /// Frames delivered so far, those to oneself included.
    #[must_use]
    pub fn delivered(&self) -> u64 {
        self.delivered
    }

    /// What each participant sent and received.
    pub fn traffic(&self, peer: Peer) -> Traffic {
        self.sides[usize::from(peer)].traffic
    }

    /// What each directed physical link did.
    pub fn links(&self) -> impl Iterator<Item = LinkCounts> + '_ {
        self.links.iter().map(|link| link.counts)
    }

    /// Frames from one participant to another that are on the way or unread.
    #[must_use]
    pub fn unread(&self, from: Peer, to: Peer) -> u32 {
        self.sides[usize::from(from)].pairs.get(&to).map_or(0, |pair| pair.unread)
    }

    /// Every frame sent from now on enters the network up to `delay_ns_max` later, by chance from `seed`, and not
    /// before those that its sender sent to the same peer.
    pub fn delay(&mut self, seed: u64, delay_ns_max: u64) {
        self.delays = Some(Delays { seed, delay_ns_max });
    }

    /// Frames that `a` sends to `b`, or `b` to `a`, from `from_ns` on wait until `until_ns`; those on the way go on. The
    /// last cut between two counts.
    pub fn cut(&mut self, a: Peer, b: Peer, from_ns: u64, until_ns: u64) {
        for pair in [(a, b), (b, a)] {
            self.cuts.insert(pair, (from_ns, until_ns));
        }
    }

    /// `peer` is no more from `at_ns` on, which may be to come. What it sent arrives until the others learn that it is
    /// lost, `notice_ns` later; its router works on.
    pub fn lose(&mut self, peer: Peer, at_ns: u64, notice_ns: u64) {
        let end = self.new_frame(peer, peer);
        self.frames[end as usize].kind = Kind::End { notice_ns };
        self.set_going(at_ns, end);
    }

    /// The most that a frame is delayed by chance, nanoseconds.
    #[must_use]
    pub fn delay_ns_max(&self) -> u64 {
        self.delays.as_ref().map_or(0, |delays| delays.delay_ns_max)
    }

    /// Whether a participant is no more.
    #[must_use]
    pub fn is_gone(&self, peer: Peer) -> bool {
        self.sides[usize::from(peer)].gone
    }

    /// The others will hear of it, each at the same time.
    fn end_side(&mut self, peer: Peer, news_ns: u64) {
        if std::mem::replace(&mut self.sides[usize::from(peer)].gone, true) {
            return;
        }
        for to in (0..self.peers()).filter(|&to| to != peer) {
            let frame = self.new_frame(peer, to);
            self.frames[frame as usize].kind = Kind::Loss;
            self.frames[frame as usize].at = self.routes.place(to);
            self.set_going(news_ns, frame);
        }
    }

    /// Sends a frame as [`Link::send`] does, but `write` also says when it is ready to enter the network: a sender that
    /// takes a while to write it says so here.
    pub fn send(
        &mut self,
        from: Peer,
        to: Peer,
        now_ns: u64,
        bytes_max: usize,
        write: &mut dyn FnMut(&mut [u8]) -> (usize, u64),
    ) -> bool {
        let room_frames = self.room_frames;
        if usize::from(to) >= self.sides.len() || self.sides[usize::from(from)].gone {
            return false;
        }
        let pair = self.sides[usize::from(from)].pairs.entry(to).or_default();
        if pair.closed {
            return false;
        }
        if pair.unread >= room_frames {
            pair.refused = true;
            return false;
        }
        pair.unread += 1;
        let mut entered_ns = pair.entered_ns;

        if self.scratch.len() < bytes_max {
            self.scratch.resize(bytes_max, 0);
        }
        let (used, ready_ns) = write(&mut self.scratch[..bytes_max]);
        let used = used.min(bytes_max);
        let frame = self.new_frame(from, to);
        self.frames[frame as usize].bytes.extend_from_slice(&self.scratch[..used]);

        let chance = match &self.delays {
            Some(Delays { seed, delay_ns_max }) => mix(seed ^ mix(self.set_going)) % delay_ns_max.saturating_add(1),
            None => 0,
        };
        entered_ns = entered_ns.max(ready_ns.max(now_ns).saturating_add(chance));
        if let Some(&(cut_ns, until_ns)) = self.cuts.get(&(from, to))
            && entered_ns >= cut_ns
        {
            entered_ns = entered_ns.max(until_ns);
        }
        let side = &mut self.sides[usize::from(from)];
        if let Some(pair) = side.pairs.get_mut(&to) {
            pair.entered_ns = entered_ns;
        }
        if from != to {
            side.traffic.sent_frames += 1;
            side.traffic.sent_bytes += used as u64;
        }
        self.set_going(entered_ns, frame);
        true
    }

    /// Hands the oldest frame that has arrived for `me` to `read`, as [`Link::receive`] does.
    pub fn receive(&mut self, me: Peer, read: &mut dyn FnMut(Event<'_>)) -> bool {
        let Some(number) = self.sides[usize::from(me)].inbox.pop_front() else { return false };
        let frame = std::mem::take(&mut self.frames[number as usize]);
        let from = frame.from;
        if frame.kind == Kind::Loss {
            self.sides[usize::from(me)].pairs.entry(from).or_default().closed = true;
            read(Event::Lost { peer: from });
        } else {
            if let Some(pair) = self.sides[usize::from(from)].pairs.get_mut(&me) {
                pair.unread -= 1;
                if std::mem::take(&mut pair.refused) {
                    self.news.push_back(from);
                }
            }
            if from != me {
                let traffic = &mut self.sides[usize::from(me)].traffic;
                traffic.received_frames += 1;
                traffic.received_bytes += frame.bytes.len() as u64;
            }
            read(Event::Frame { from, bytes: &frame.bytes });
        }
        self.let_go(number, frame);
        true
    }

    fn new_frame(&mut self, from: Peer, to: Peer) -> u32 {
        let number = self.free.pop().unwrap_or_else(|| {
            self.frames.push(Frame::default());
            self.frames.len() as u32 - 1
        });
        let frame = &mut self.frames[number as usize];
        (frame.from, frame.to, frame.at, frame.kind) = (from, to, self.routes.place(from), Kind::Frame);
        frame.bytes.clear();
        number
    }

    fn let_go(&mut self, number: u32, frame: Frame) {
        self.frames[number as usize] = frame;
        self.free.push(number);
    }

    fn set_going(&mut self, time: u64, frame: u32) {
        self.events.push(Reverse((time, self.set_going, frame)));
        self.set_going += 1;
    }

    /// `number` is whole where it is: it asks for its next link, or has arrived.
    fn move_on(&mut self, now: u64, number: u32) {
        let frame = &mut self.frames[number as usize];
        if let Kind::End { notice_ns } = frame.kind {
            let (peer, frame) = (frame.from, std::mem::take(frame));
            self.let_go(number, frame);
            self.end_side(peer, now.saturating_add(notice_ns));
            return;
        }
        let Some((link, place)) = self.routes.next(frame.at, frame.to) else {
            self.arrive(now, number);
            return;
        };
        frame.at = place;
        let bytes = frame.bytes.len() as u32;
        let model = self.routes.link(link);
        let crossing = model.crossing_ns(bytes);
        let LinkState { free_at_ns, starts, counts } = &mut self.links[link];
        let start = now.max(*free_at_ns);
        *free_at_ns = start.saturating_add(crossing);
        while starts.front().is_some_and(|&start| start <= now) {
            starts.pop_front();
        }
        if start > now {
            starts.push_back(start);
        }
        counts.frames += 1;
        counts.bytes += u64::from(bytes);
        counts.busy_ns += crossing;
        counts.waiting_most = counts.waiting_most.max(starts.len());
        let there = free_at_ns.saturating_add(model.latency_ns);
        self.set_going(there, number);
    }

    fn arrive(&mut self, now: u64, number: u32) {
        let Frame { from, to, kind, ref bytes, .. } = self.frames[number as usize];
        let is_loss = kind == Kind::Loss;
        let gone = self.sides[usize::from(to)].gone;
        let pair = self.sides[usize::from(from)].pairs.entry(to).or_default();
        if pair.closed || gone {
            let frame = std::mem::take(&mut self.frames[number as usize]);
            self.let_go(number, frame);
            return;
        }
        pair.closed = is_loss;
        let mut log = |value: u64, count: usize| {
            for byte in &value.to_le_bytes()[..count] {
                self.log = (self.log ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
            }
        };
        log(now, 8);
        log(u64::from(from), 2);
        log(u64::from(to), 2);
        log(bytes.len() as u64, 4);
        self.delivered += u64::from(!is_loss);
        let Side { inbox, traffic, .. } = &mut self.sides[usize::from(to)];
        inbox.push_back(number);
        traffic.unread_most = traffic.unread_most.max(inbox.len());
        self.news.push_back(to);
    }
}

/// Numbers that depend on nothing but the seed (splitmix64's finish).
fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// What one participant has of the network at one moment.
pub struct End<'n> {
    network: &'n mut Network,
    me: Peer,
    now_ns: u64,
}

impl Link for End<'_> {
    fn me(&self) -> Peer {
        self.me
    }

    fn peers(&self) -> Peer {
        self.network.peers()
    }

    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let now_ns = self.now_ns;
        self.network.send(self.me, to, now_ns, bytes_max, &mut |room| (write(room), now_ns))
    }

    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool {
        self.network.receive(self.me, read)
    }

    /// Returns at once: whoever keeps the clock knows when to go on.
    fn wait(&mut self, _: u64) {}
}
