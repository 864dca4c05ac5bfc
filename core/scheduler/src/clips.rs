//! Cliplists for those who ask for them: a node that is a subhost has one, and the host where there are none (the 1995
//! report, chapter 4). What waits is one bundle for each peer, the last that it asked for.

use crate::node::{Picture, clip};
use hybray_arena::Ring;
use hybray_bintree::walk::Counts;
use hybray_geometry::simd::Kernels;
use hybray_link::{HOST, Link, Peer};
use hybray_pyraclip::wide;
use hybray_tracer::Scene;
use hybray_wire::{CLIPLIST_MAX, HEAD_BYTES_MAX, Message, TileMap, View, encode};

/// Pages that a bundle meets, the nearest first, as far as there is room.
pub(crate) type Cliplist = heapless::Vec<u32, CLIPLIST_MAX>;

/// The bundle that a peer wants clipped.
#[derive(Clone, Copy, Debug)]
pub struct Unclipped {
    first: u32,
    /// Tiles; 0 if it wants nothing.
    count: u8,
    /// It stands in the queue.
    queued: bool,
}

const _: () = assert!(size_of::<Unclipped>() == 8);

impl Unclipped {
    /// Nothing.
    pub const NONE: Self = Self { first: 0, count: 0, queued: false };
}

/// Who wants what clipped, and whose turn it is.
pub(crate) struct Clips<'m> {
    wanted: &'m mut [Unclipped],
    /// Peers that wait: each is in it once.
    turns: Ring<'m, Peer>,
}

impl<'m> Clips<'m> {
    /// Nobody has asked. `wanted` and `turns` have one entry for each peer.
    pub fn new(wanted: &'m mut [Unclipped], turns: Ring<'m, Peer>) -> Self {
        wanted.fill(Unclipped::NONE);
        Self { wanted, turns }
    }

    /// `peer` wants these tiles clipped, and what it wanted before no more.
    pub fn ask(&mut self, peer: Peer, first: u32, count: u8) {
        let Some(wanted) = self.wanted.get_mut(usize::from(peer)) else { return };
        (wanted.first, wanted.count) = (first, count);
        if !core::mem::replace(&mut wanted.queued, true) {
            let _ = self.turns.push_back(peer);
        }
    }

    /// A peer is gone.
    pub fn lost(&mut self, peer: Peer) {
        if let Some(wanted) = self.wanted.get_mut(usize::from(peer)) {
            wanted.count = 0;
        }
    }

    /// Another picture comes: nobody wants what it has asked for.
    pub fn clear(&mut self) {
        self.wanted.iter_mut().for_each(|wanted| wanted.count = 0);
    }

    /// Clips and answers, where the link has room; what is no bundle of the picture is not answered. Returns whether anything
    /// was sent. Bounded: a bundle for each peer.
    pub fn serve(
        &mut self,
        link: &mut dyn Link,
        picture: u16,
        map: &TileMap,
        clip: &mut dyn FnMut((u32, u32)) -> Cliplist,
    ) -> bool {
        let mut sent = false;
        for _ in 0..self.turns.len() {
            let Some(peer) = self.turns.pop_front() else { break };
            let wanted = &mut self.wanted[usize::from(peer)];
            wanted.queued = false;
            let (first, count) = (wanted.first, u32::from(wanted.count));
            let is_bundle = (1..=4).contains(&count) && first.checked_add(count).is_some_and(|end| end <= map.len());
            if !is_bundle {
                continue;
            }
            let went = link.send(peer, HEAD_BYTES_MAX + 4 * CLIPLIST_MAX, &mut |room| {
                let pages = clip((first, count));
                let message = Message::Cliplist { first, pages: pages.len() as u8 };
                encode(picture, &message, room, |body| {
                    body.chunks_exact_mut(4).zip(&pages).for_each(|(bytes, page)| {
                        bytes.copy_from_slice(&page.to_le_bytes());
                    });
                })
                .expect("the room for a message is enough for any")
            });
            sent |= went;
            if !went {
                wanted.queued = true;
                let _ = self.turns.push_back(peer);
            }
        }
        sent
    }
}

/// A host that clips for all nodes.
pub struct Clipper<'m, 's> {
    scene: Scene<'s>,
    kernels: Kernels,
    picture: Option<Picture>,
    /// Which picture of the run that is, or is to be.
    number: u16,
    scratch: wide::Scratch,
    clips: Clips<'m>,
    counts: Counts,
}

impl<'m, 's> Clipper<'m, 's> {
    /// Waits for a picture. `wanted` and `turns` have one entry for each peer. Of `scene` the directory is looked at.
    #[must_use]
    pub fn new(scene: Scene<'s>, kernels: Kernels, wanted: &'m mut [Unclipped], turns: &'m mut [Peer]) -> Self {
        let clips = Clips::new(wanted, Ring::new(turns));
        Self {
            scene,
            kernels,
            picture: None,
            number: 0,
            scratch: wide::Scratch::new(),
            clips,
            counts: Counts::default(),
        }
    }

    /// Another picture comes: what was asked for before is not answered.
    pub fn next(&mut self, number: u16) {
        (self.picture, self.number) = (None, number);
        self.clips.clear();
    }

    /// Takes in a message; those for other machines, and of other pictures, are passed over.
    pub fn handle(&mut self, from: Peer, view: &View<'_>) {
        if view.picture != self.number {
            return;
        }
        match view.message {
            Message::Begin(frame) if from == HOST => self.picture = Picture::new(frame),
            Message::Clip { first, count } => self.clips.ask(from, first, count),
            _ => {}
        }
    }

    /// A peer is gone.
    pub fn lost(&mut self, peer: Peer) {
        self.clips.lost(peer);
    }

    /// Sends cliplists. Returns whether there was any to send.
    pub fn serve(&mut self, link: &mut dyn Link) -> bool {
        let Self { scene, kernels, picture, number, scratch, clips, counts } = self;
        let Some(picture) = picture else { return false };
        clips.serve(link, *number, &picture.map, &mut |tiles| clip(picture, scene, *kernels, tiles, scratch, counts))
    }

    /// What clipping has met so far.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use hybray_link::Event;
    use hybray_wire::decode;
    use std::vec::Vec;

    /// Keeps the answers: to whom, first tile, pages. Has room for `room` more.
    struct Wire {
        sent: Vec<(Peer, u32, Vec<u32>)>,
        room: usize,
    }

    impl Link for Wire {
        fn me(&self) -> Peer {
            HOST
        }
        fn peers(&self) -> Peer {
            4
        }
        fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
            if self.room == 0 {
                return false;
            }
            self.room -= 1;
            let mut bytes = std::vec![0; bytes_max];
            let used = write(&mut bytes);
            let view = decode(&bytes[..used]).unwrap();
            let Message::Cliplist { first, .. } = view.message else { panic!("{view:?}") };
            let pages = view.body.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
            self.sent.push((to, first, pages));
            true
        }
        fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
            false
        }
        fn wait(&mut self, _: u64) {}
    }

    #[test]
    fn each_is_answered_once_and_what_is_no_bundle_never() {
        let map = TileMap::new(80, 8).unwrap();
        let (mut wanted, mut turns) = ([Unclipped::NONE; 4], [0; 4]);
        let mut clips = Clips::new(&mut wanted, Ring::new(&mut turns));
        let mut wire = Wire { sent: Vec::new(), room: 1 };
        let mut clipped = Vec::new();
        // Node 1 changes its mind; node 2 asks twice; node 3 is lost; nobody has number 4.
        [(1, 4, 4), (2, 6, 4), (1, 0, 1), (2, 6, 4), (3, 0, 4), (4, 0, 4)]
            .iter()
            .for_each(|&(p, f, c)| clips.ask(p, f, c));
        clips.lost(3);
        let mut serve = |clips: &mut Clips<'_>, wire: &mut Wire| {
            clips.serve(wire, 0, &map, &mut |(first, count)| {
                clipped.push((first, count));
                (0..count).map(|at| 100 * first + at).collect()
            })
        };
        assert!(serve(&mut clips, &mut wire));
        assert_eq!(wire.sent, [(1, 0, std::vec![0])]);
        assert!(!serve(&mut clips, &mut wire), "no room");
        wire.room = 9;
        assert!(serve(&mut clips, &mut wire));
        assert_eq!(wire.sent[1..], [(2, 6, std::vec![600, 601, 602, 603])]);
        for (first, count) in [(0, 0), (0, 5), (7, 4), (10, 1), (u32::MAX, 1), (0, 255)] {
            clips.ask(1, first, count);
            assert!(!serve(&mut clips, &mut wire), "{first} {count}");
        }
        assert_eq!(clipped, [(0, 1), (6, 4)], "clipped where there is room, and once");
    }
}
