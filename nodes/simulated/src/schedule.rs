//! Whose turn it is.

use hybray_link::Peer;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The first sleep of a participant that has nothing to do, as in `nodes/runner`. Each further one is twice as long:
/// only what waits for a time of its own needs them, and thousands of nodes may sleep for hours.
const NAP_NS: u64 = 20_000_000;

/// What a participant does when its time comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Takes in what has arrived, and works.
    Take,
    /// Sends, after a turn in which something was done or not.
    Send {
        /// It took something in, or worked.
        busy: bool,
    },
    /// Nothing, until something happens: it then begins with [`Phase::Take`].
    Asleep,
    /// Nothing any more.
    Gone,
}

/// When each participant's next turn is. Of turns at the same time the lower number comes first.
pub(crate) struct Schedule {
    turns: BinaryHeap<Reverse<(u64, Peer)>>,
    next: Vec<(u64, Phase)>,
    naps_ns: Vec<u64>,
}

impl Schedule {
    /// Everybody begins at 0.
    pub fn new(peers: Peer) -> Self {
        Self {
            turns: (0..peers).map(|peer| Reverse((0, peer))).collect(),
            next: vec![(0, Phase::Take); usize::from(peers)],
            naps_ns: vec![NAP_NS; usize::from(peers)],
        }
    }

    /// The next turn, and whose. Turns that were brought forward are passed over.
    pub fn first(&mut self) -> Option<(u64, Peer)> {
        while let Some(&Reverse((time, peer))) = self.turns.peek() {
            let (at, phase) = self.next[usize::from(peer)];
            if at == time && phase != Phase::Gone {
                return Some((time, peer));
            }
            self.turns.pop();
        }
        None
    }

    /// Takes the turn that [`Self::first`] found.
    pub fn begin(&mut self, peer: Peer) -> Phase {
        self.turns.pop();
        match self.next[usize::from(peer)].1 {
            Phase::Asleep => Phase::Take,
            phase => phase,
        }
    }

    pub fn phase(&self, peer: Peer) -> Phase {
        self.next[usize::from(peer)].1
    }

    fn set(&mut self, peer: Peer, time: u64, phase: Phase) {
        self.next[usize::from(peer)] = (time, phase);
        self.turns.push(Reverse((time, peer)));
    }

    /// It is busy until `time`, and then begins `phase`.
    pub fn busy(&mut self, peer: Peer, time: u64, phase: Phase) {
        self.naps_ns[usize::from(peer)] = NAP_NS;
        self.set(peer, time, phase);
    }

    pub fn sleep(&mut self, peer: Peer, now: u64) {
        let nap = &mut self.naps_ns[usize::from(peer)];
        let until = now.saturating_add(*nap);
        *nap = nap.saturating_mul(2);
        self.set(peer, until, Phase::Asleep);
    }

    /// Something happened that it may have to do with; whoever is at work hears of it later.
    pub fn wake(&mut self, peer: Peer, now: u64) {
        if self.phase(peer) == Phase::Asleep {
            self.set(peer, now, Phase::Take);
        }
    }

    pub fn leave(&mut self, peer: Peer) {
        self.next[usize::from(peer)].1 = Phase::Gone;
    }
}
