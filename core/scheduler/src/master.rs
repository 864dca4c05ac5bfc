//! The master: begins a picture, keeps its film, and sees to it that every tile is finished.

use crate::film::Film;
use crate::send;
use hybray_link::{HOST, Link, Peer};
use hybray_wire::{Counts, Frame, Message, VERSION, View};

/// In place of a tile to be traced again: these were all.
pub(crate) const NO_MORE: u32 = u32::MAX;

/// How far a picture is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Tiles finished.
    pub finished: u32,
    /// Tiles of the picture.
    pub tiles: u32,
    /// Rays that have ended.
    pub rays: u64,
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every tile is finished.
    Finished,
    /// Somebody asked to stop; some tiles may be finished.
    Stopped,
    /// This tile's ledger did not come to zero, twice.
    Unbalanced {
        /// Its number.
        tile: u32,
    },
    /// A node has another version of the program, or another scene.
    Stranger {
        /// Who.
        peer: Peer,
    },
    /// Every node is lost.
    Abandoned,
    /// The node that had this page is lost, and the host does not have it.
    Missing {
        /// Its number.
        page: u32,
    },
}

/// What a node did, in its own words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NodeReport {
    /// It has reported since the last round began.
    reported: bool,
    greeted: bool,
    lost: bool,
    /// Rays.
    pub counts: Counts,
    /// Tiles that it traced.
    pub tiles: u32,
    /// Runs that it was given.
    pub runs: u32,
    /// Time spent tracing, nanoseconds.
    pub busy_nanoseconds: u64,
}

impl NodeReport {
    /// Whether the node was ever heard of: a picture that is whole does not wait for one that was not, and does not know
    /// what it did for others.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.greeted
    }
}

/// The machine. `nodes` has one entry for each peer, the host's (unused) included.
pub struct Master<'m> {
    /// Which picture of the run it is; and whether nodes are to wait for another.
    number: u16,
    last: bool,
    frame: Frame,
    film: Film<'m>,
    nodes: &'m mut [NodeReport],
    scene_hash: u64,
    dispatcher: Peer,
    /// Peers up to this one have been told to begin.
    begun: usize,
    /// The dispatcher has heard which tiles up to this one are finished already.
    kept: u32,
    /// Peers up to this one have been told to stop; and whether to.
    stopping: Option<usize>,
    outcome: Option<Outcome>,
    /// Tiles from this one on are still to be asked for again in this round; [`NO_MORE`] has still to be said.
    looking: Option<u32>,
    asked_again: bool,
    refused_frames: u64,
    rays: u64,
}

impl<'m> Master<'m> {
    /// Begins `frame` on `film`, the only picture; tiles are given out by `dispatcher`.
    pub fn new(frame: Frame, film: Film<'m>, nodes: &'m mut [NodeReport], scene_hash: u64, dispatcher: Peer) -> Self {
        Self::of_run(0, true, frame, film, nodes, scene_hash, dispatcher)
    }

    /// Begins picture `number` of a run of several, from 0 on, when the one before is [`Outcome::Finished`]. `nodes` are as it
    /// left them: who is lost stays so. After the `last` one the nodes end, and after one that is not finished.
    pub fn of_run(
        number: u16,
        last: bool,
        frame: Frame,
        film: Film<'m>,
        nodes: &'m mut [NodeReport],
        scene_hash: u64,
        dispatcher: Peer,
    ) -> Self {
        for node in nodes.iter_mut() {
            let before = if number == 0 { NodeReport::default() } else { *node };
            *node = NodeReport { greeted: before.greeted, lost: before.lost, ..NodeReport::default() };
        }
        let mut master = Self {
            number,
            last,
            frame,
            film,
            nodes,
            scene_hash,
            dispatcher,
            begun: 0,
            kept: 0,
            stopping: None,
            outcome: None,
            looking: None,
            asked_again: false,
            refused_frames: 0,
            rays: 0,
        };
        master.look_who_is_left();
        master
    }

    /// The film.
    #[must_use]
    pub fn film(&self) -> &Film<'m> {
        &self.film
    }

    /// The film, to put in what is finished already, before the first [`Master::poll`].
    #[must_use]
    pub fn film_mut(&mut self) -> &mut Film<'m> {
        &mut self.film
    }

    /// Gives up what is known of the nodes, for the master of the next picture.
    #[must_use]
    pub fn release(&mut self) -> &'m mut [NodeReport] {
        core::mem::take(&mut self.nodes)
    }

    /// What each peer reported; the host's is empty.
    #[must_use]
    pub fn reports(&self) -> &[NodeReport] {
        self.nodes
    }

    /// Frames that were no messages, or made no sense.
    #[must_use]
    pub fn refused_frames(&self) -> u64 {
        self.refused_frames
    }

    /// How far it is.
    #[must_use]
    pub fn progress(&self) -> Progress {
        Progress { finished: self.film.finished(), tiles: self.film.map().len(), rays: self.rays }
    }

    /// How it ended, once everybody has been told.
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        let outcome = self.outcome.filter(|_| self.stopping == Some(self.nodes.len()))?;
        // A node that is stopped still says what it did: in its work, or for others after its first report.
        let tell = matches!(outcome, Outcome::Stopped | Outcome::Finished);
        if tell && self.nodes.iter().any(|n| n.greeted && !n.reported && !n.lost) {
            return None;
        }
        // What was on its way when the last of them was lost may have been all that was missing.
        Some(if outcome == Outcome::Abandoned && self.film.is_finished() { Outcome::Finished } else { outcome })
    }

    /// Ends the picture as it is.
    pub fn stop(&mut self) {
        self.end(Outcome::Stopped);
    }

    /// A page was asked for at the host, which does not have it: some rays can never end.
    pub fn missing(&mut self, page: u32) {
        self.end(Outcome::Missing { page });
    }

    fn end(&mut self, outcome: Outcome) {
        if self.outcome.is_none() {
            self.nodes.iter_mut().for_each(|node| node.reported = false);
            self.outcome = Some(outcome);
            self.stopping = Some(1);
        }
    }

    /// A frame that is no message arrived.
    pub fn refuse(&mut self) {
        self.refused_frames += 1;
    }

    /// Takes in a message; those for other machines are passed over.
    pub fn handle(&mut self, from: Peer, view: &View<'_>) {
        let Some(node) = self.nodes.get_mut(usize::from(from)) else { return };
        if view.picture != self.number {
            return;
        }
        match view.message {
            Message::Hello { version, scene } => {
                node.greeted = true;
                if version != VERSION || scene != self.scene_hash {
                    self.end(Outcome::Stranger { peer: from });
                }
            }
            Message::Contributions { tile, epoch, width, height, rays, entry } => {
                self.rays = self.rays.saturating_add(u64::from(rays));
                if self.film.add(tile, epoch, (width, height), entry, view.body).is_err() {
                    self.refused_frames += 1;
                }
            }
            Message::Report { counts, tiles, runs, busy_nanoseconds } => {
                *node = NodeReport { reported: true, counts, tiles, runs, busy_nanoseconds, ..*node };
                self.look();
            }
            _ => {}
        }
    }

    /// A peer is gone. Its tiles are given out again by the dispatcher, under a new epoch.
    pub fn lost(&mut self, peer: Peer) {
        if let Some(node) = self.nodes.get_mut(usize::from(peer)) {
            node.lost = true;
        }
        // What is missing from now on may be missing for this reason: it is no second fault of the ledger.
        self.asked_again = false;
        self.look_who_is_left();
        self.look();
    }

    /// Without nodes, or without who gives out tiles, nothing is drawn.
    fn look_who_is_left(&mut self) {
        let all = self.nodes.iter().skip(1).all(|n| n.lost);
        let dispatcher =
            self.dispatcher != HOST && self.nodes.get(usize::from(self.dispatcher)).is_some_and(|n| n.lost);
        if all || dispatcher {
            self.end(Outcome::Abandoned);
        }
    }

    /// When every node that is left has reported, nothing is on the way any more: a report comes after all
    /// contributions of its sender. A node whose first word has not arrived is waited for if something is missing: the
    /// dispatcher may have heard of it long ago; and if another picture comes, so that nobody is ever two behind.
    fn look(&mut self) {
        let whole = self.film.is_finished();
        let all = self.nodes.iter().skip(1).all(|n| n.reported || n.lost || (whole && self.last && !n.greeted));
        if !all || self.outcome.is_some() || self.looking.is_some() {
            return;
        }
        if whole {
            self.end(Outcome::Finished);
            return;
        }
        self.nodes.iter_mut().for_each(|n| n.reported = false);
        let unfinished = (0..self.film.map().len()).find(|&tile| !self.film.tile_is_finished(tile));
        match unfinished {
            Some(tile) if self.asked_again => self.end(Outcome::Unbalanced { tile }),
            first => {
                self.asked_again = true;
                self.looking = first;
            }
        }
    }

    /// Tells the dispatcher, run by run, which tiles are finished before the picture begins; false if there is no room
    /// for more now. Bounded: the tiles of the picture, once.
    fn tell_kept(&mut self, link: &mut dyn Link) -> bool {
        let tiles = if self.film.finished() > 0 { self.film.map().len() } else { 0 };
        while let Some(first) = (self.kept..tiles).find(|&tile| self.film.tile_is_finished(tile)) {
            let count = (first..tiles).take_while(|&tile| self.film.tile_is_finished(tile)).count() as u32;
            if !send(link, self.dispatcher, self.number, &Message::Kept { first, count }) {
                return false;
            }
            self.kept = first + count;
        }
        true
    }

    /// Sends what has to be said. Bounded: one message a peer, one a run of tiles that are there already, and 16 tiles to
    /// be traced again.
    pub fn poll(&mut self, link: &mut dyn Link) {
        while self.begun < self.nodes.len() {
            // The host comes last: a dispatcher there must not give out what nodes do not know.
            let peer = if self.begun + 1 < self.nodes.len() { self.begun + 1 } else { 0 };
            if !self.nodes[peer].lost {
                // Who gives out tiles hears which of them are not wanted before it hears of the picture.
                let ready = peer != usize::from(self.dispatcher) || self.tell_kept(link);
                if !(ready && send(link, peer as Peer, self.number, &Message::Begin(self.frame))) {
                    break;
                }
            }
            self.begun += 1;
        }
        for _ in 0..16 {
            let Some(tile) = self.looking else { break };
            let epoch = self.film.epoch(tile).saturating_add(1);
            if !send(link, self.dispatcher, self.number, &Message::Again { tile, epoch }) {
                break;
            }
            let unfinished = |next: &u32| !self.film.tile_is_finished(*next);
            self.looking = match tile {
                NO_MORE => None,
                _ => Some((tile + 1..self.film.map().len()).find(unfinished).unwrap_or(NO_MORE)),
            };
        }
        if let Some(from) = self.stopping {
            let goes_on = self.outcome == Some(Outcome::Finished) && !self.last;
            let message = if goes_on { Message::End } else { Message::Stop };
            let mut next = from;
            while next < self.nodes.len() {
                if !self.nodes[next].lost && !send(link, next as Peer, self.number, &message) {
                    break;
                }
                next += 1;
            }
            self.stopping = Some(next);
        }
    }
}

#[cfg(test)]
mod tests;
