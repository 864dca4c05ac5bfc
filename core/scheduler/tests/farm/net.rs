//! A link on a virtual clock: seeded delays, order kept from each peer, room for few frames, peers that are lost.

use crate::common::Rng;
use hybray_link::{Event, HOST, Link, Peer};
use hybray_wire::{Message, decode};
use std::collections::VecDeque;

#[derive(Clone, Debug)]
enum Parcel {
    Frame(Vec<u8>),
    Lost,
}

/// Frames on the way from one participant to another, and those that wait there to be read.
#[derive(Clone, Debug, Default)]
struct Pair {
    /// With the time of arrival, which never falls.
    queue: VecDeque<(u64, Parcel)>,
    /// Frames that have not been read: what room is counted by.
    unread: usize,
    /// Least time on the way, and what chance may add.
    delay: u64,
    delay_max: u64,
    /// Something was sent.
    spoke: bool,
    /// The sender has read that the receiver is lost.
    closed: bool,
}

/// What a lying link does with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lie {
    No,
    Drop,
    Double,
}

/// How a network is.
#[derive(Clone, Copy, Debug)]
pub struct Manner {
    /// Unread frames that each pair may have, 1 or more.
    pub room: usize,
    /// Each pair has a delay of its own up to this, and each frame up to as much again, nanoseconds.
    pub delay_max: u64,
    /// Nodes are a thousand times nearer to each other than to the host (POV||Ray, section 2.2).
    pub far_host: bool,
    /// What this node sends to the host takes so much longer.
    pub held_up: Option<(Peer, u64)>,
    /// Once in so many times there is no room although there should be; never, if 0.
    pub refuses: u64,
    /// A participant that waits is woken by room, not by frames alone.
    pub wakes_for_room: bool,
}

/// All links.
pub struct Net<'l> {
    peers: usize,
    manner: Manner,
    pairs: Vec<Pair>,
    rng: Rng,
    /// Told to whom something was sent, or made room for, and when it is there.
    pub news: Vec<(Peer, u64)>,
    /// Asked about every frame.
    pub lie: &'l mut dyn FnMut(Peer, Peer, &Message) -> Lie,
    pub frames: u64,
    pub bytes: u64,
    /// Messages sent by each peer since the world last asked: what it must know to follow a node.
    pub sent: Vec<Vec<Message>>,
    /// When the first tile was given out.
    pub first_tiles_at: Option<u64>,
}

impl<'l> Net<'l> {
    pub fn new(peers: usize, manner: Manner, seed: u64, lie: &'l mut dyn FnMut(Peer, Peer, &Message) -> Lie) -> Self {
        let mut rng = Rng(seed);
        let pairs = (0..peers * peers)
            .map(|pair| {
                let (from, to) = (pair / peers, pair % peers);
                let near = manner.far_host && from != 0 && to != 0;
                let delay_max = if near { manner.delay_max / 1000 } else { manner.delay_max };
                let delay_max = if from == to { 0 } else { delay_max };
                let held_up =
                    manner.held_up.filter(|&(node, _)| (from, to) == (usize::from(node), 0)).map_or(0, |h| h.1);
                Pair { delay: held_up + rng.between(0, delay_max), delay_max, ..Pair::default() }
            })
            .collect();
        Self {
            peers,
            manner,
            pairs,
            rng,
            news: Vec::new(),
            lie,
            frames: 0,
            bytes: 0,
            sent: vec![Vec::new(); peers],
            first_tiles_at: None,
        }
    }

    fn pair(&mut self, from: Peer, to: Peer) -> &mut Pair {
        &mut self.pairs[usize::from(from) * self.peers + usize::from(to)]
    }

    /// When the next frame for `to` is there.
    pub fn next_arrival(&self, to: Peer) -> Option<u64> {
        (0..self.peers).filter_map(|from| Some(self.pairs[from * self.peers + usize::from(to)].queue.front()?.0)).min()
    }

    /// Unread frames of any pair at most.
    pub fn most_unread(&self) -> usize {
        self.pairs.iter().map(|pair| pair.unread).max().unwrap_or(0)
    }

    /// Puts a frame on the way, whatever room there is.
    pub fn push(&mut self, from: Peer, to: Peer, bytes: Vec<u8>, now: u64) {
        let delay_max = self.pair(from, to).delay_max;
        let jitter = self.rng.between(0, delay_max);
        let pair = self.pair(from, to);
        let last = pair.queue.back().map_or(0, |(at, _)| *at);
        let at = last.max(now + pair.delay + jitter);
        pair.queue.push_back((at, Parcel::Frame(bytes)));
        pair.unread += 1;
        self.news.push((to, at));
    }

    /// `peer` is no more. Of what it sent to each other, a part arrives (all, if it left in peace); then they learn it.
    pub fn leave(&mut self, peer: Peer, in_peace: bool, now: u64) {
        for to in (0..self.peers as Peer).filter(|&to| to != peer) {
            let notice = self.rng.between(0, 20 * self.manner.delay_max + 1);
            let flying = self.pair(peer, to).queue.len();
            let kept = if in_peace { flying } else { self.rng.between(0, flying as u64) as usize };
            let pair = self.pair(peer, to);
            pair.queue.truncate(kept);
            pair.unread = kept;
            let at = pair.queue.back().map_or(0, |(at, _)| *at).max(now + notice);
            pair.queue.push_back((at, Parcel::Lost));
            self.news.push((to, at));
        }
    }

    pub fn end(&mut self, me: Peer, now: u64) -> End<'_, 'l> {
        End { net: self, me, now }
    }
}

/// What one participant has of the network at one moment.
pub struct End<'n, 'l> {
    net: &'n mut Net<'l>,
    me: Peer,
    now: u64,
}

impl Link for End<'_, '_> {
    fn me(&self) -> Peer {
        self.me
    }

    fn peers(&self) -> Peer {
        self.net.peers as Peer
    }

    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let (me, now, room) = (self.me, self.now, self.net.manner.room);
        let refuses = self.net.manner.refuses;
        let refused = refuses > 0 && self.net.rng.below(refuses) == 0;
        let pair = self.net.pair(me, to);
        if pair.closed || pair.unread >= room || refused {
            return false;
        }
        let mut bytes = vec![0xee; bytes_max];
        let used = write(&mut bytes);
        bytes.truncate(used);
        let message = decode(&bytes).expect("machines send messages").message;
        let pair = self.net.pair(me, to);
        if to == HOST && me != HOST && !pair.spoke {
            assert!(matches!(message, Message::Hello { .. }), "node {me} begins with {message:?}");
            pair.spoke = true;
        }
        if matches!(message, Message::Tiles { .. }) {
            self.net.first_tiles_at.get_or_insert(now);
        }
        self.net.sent[usize::from(me)].push(message);
        self.net.frames += u64::from(me != to);
        self.net.bytes += if me == to { 0 } else { bytes.len() as u64 };
        match (self.net.lie)(me, to, &message) {
            Lie::No => self.net.push(me, to, bytes, now),
            Lie::Drop => {}
            Lie::Double => {
                self.net.push(me, to, bytes.clone(), now);
                self.net.push(me, to, bytes, now);
            }
        }
        true
    }

    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool {
        let (me, now) = (self.me, self.now);
        let peers = self.net.peers as Peer;
        let here: Vec<Peer> = (0..peers)
            .filter(|&from| self.net.pair(from, me).queue.front().is_some_and(|(at, _)| *at <= now))
            .collect();
        if here.is_empty() {
            return false;
        }
        let from = self.net.rng.pick(&here);
        let pair = self.net.pair(from, me);
        match pair.queue.pop_front() {
            Some((_, Parcel::Frame(bytes))) => {
                pair.unread -= 1;
                if self.net.manner.wakes_for_room {
                    self.net.news.push((from, now));
                }
                read(Event::Frame { from, bytes: &bytes });
            }
            Some((_, Parcel::Lost)) => {
                self.net.pair(me, from).closed = true;
                read(Event::Lost { peer: from });
            }
            None => {}
        }
        true
    }

    fn wait(&mut self, _: u64) {
        unreachable!("the world knows when to go on; {HOST} too");
    }
}
