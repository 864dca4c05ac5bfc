//! What a node knows of its peers: rays that are to go to each, and those on their way.

use hybray_arena::{List, Ring};
use hybray_link::Peer;

/// One peer.
#[derive(Clone, Copy, Debug)]
pub struct PeerState {
    /// Rays that are to go there.
    pub outbox: List,
    /// Rays that were sent there, until it says that it has taken them.
    pub flight: List,
    /// When the first of the outbox came in, nanoseconds.
    pub since: u64,
    /// Rays that wait there, as it said last.
    pub load: u16,
    /// It had no room for rays the last time.
    pub full: bool,
    /// It is gone.
    pub lost: bool,
    /// It was to be given a share, and there was none: to be told.
    pub none_to_share: bool,
    /// Whether its last rays were taken: to be told.
    pub answer: Option<bool>,
    sending: bool,
}

impl PeerState {
    /// A peer that nothing is known of.
    pub const NEW: Self = Self {
        outbox: List::EMPTY,
        flight: List::EMPTY,
        since: 0,
        load: 0,
        full: false,
        lost: false,
        none_to_share: false,
        answer: None,
        sending: false,
    };
    /// One that is gone.
    pub const LOST: Self = Self { lost: true, ..Self::NEW };
}

/// All peers, and who of them is waiting for something. Each stands in each queue once.
pub struct Peers<'m> {
    all: &'m mut [PeerState],
    answers: Ring<'m, Peer>,
    sends: Ring<'m, Peer>,
}

impl<'m> Peers<'m> {
    /// Peers of whom nothing is known. The rings have room for one entry each.
    pub fn new(all: &'m mut [PeerState], answers: Ring<'m, Peer>, sends: Ring<'m, Peer>) -> Self {
        Self { all, answers, sends }
    }

    /// Nothing is for anybody any more, or on its way; who is lost stays so. Lists are given up, and not emptied.
    pub fn clear(&mut self) {
        self.all.iter_mut().for_each(|peer| *peer = PeerState { lost: peer.lost, ..PeerState::NEW });
        while self.answers.pop_front().is_some() {}
        while self.sends.pop_front().is_some() {}
    }

    /// How many there are, the host included.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// What is known of a peer.
    pub fn get(&mut self, peer: Peer) -> Option<&mut PeerState> {
        self.all.get_mut(usize::from(peer))
    }

    /// Rays came from `peer`: it is to be told whether they were taken.
    pub fn answer(&mut self, peer: Peer, taken: bool) {
        if let Some(state) = self.all.get_mut(usize::from(peer))
            && state.answer.replace(taken).is_none()
        {
            let _ = self.answers.push_back(peer);
        }
    }

    /// The next peer to be answered, and the answer.
    pub fn next_answer(&self) -> Option<(Peer, bool)> {
        let peer = *self.answers.front()?;
        Some((peer, self.all[usize::from(peer)].answer?))
    }

    /// It was answered, or is put off.
    pub fn answered(&mut self, told: bool) {
        if let Some(peer) = self.answers.pop_front() {
            if told {
                self.all[usize::from(peer)].answer = None;
            } else {
                let _ = self.answers.push_back(peer);
            }
        }
    }

    /// How many are to be answered.
    pub fn answers(&self) -> usize {
        self.answers.len()
    }

    /// Rays are to go to `peer`; its outbox is returned, to put them in.
    pub fn send(&mut self, peer: Peer, now: u64) -> &mut List {
        let state = &mut self.all[usize::from(peer)];
        if !core::mem::replace(&mut state.sending, true) {
            state.since = now;
            let _ = self.sends.push_back(peer);
        }
        &mut state.outbox
    }

    /// How many peers rays are to go to.
    pub fn sends(&self) -> usize {
        self.sends.len()
    }

    /// The next of them, whose turn is over then unless [`Peers::send_on`] puts it at the end again.
    pub fn next_send(&mut self) -> Option<Peer> {
        let peer = self.sends.pop_front()?;
        self.all[usize::from(peer)].sending = false;
        Some(peer)
    }

    /// There are more rays for `peer`, since `since`.
    pub fn send_on(&mut self, peer: Peer, since: u64) {
        self.send(peer, since);
        self.all[usize::from(peer)].since = since;
    }
}
