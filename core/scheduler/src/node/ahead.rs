//! The pages of the next bundle, asked for while this one is traced: the cliplist of the 1995 report (chapter 4), whose
//! objects come to the node before the rays begin.
//!
//! A node makes it itself, since it has the directory; or has its subhost make it, and waits for it before it begins.

use super::picture::Picture;
use crate::clips::Cliplist;
use crate::send;
use hybray_bintree::walk::Counts;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Bundle, Ray};
use hybray_link::{Link, Peer};
use hybray_pyraclip::wide;
use hybray_tracer::Scene;
use hybray_wire::{CLIPLIST_MAX, Message};

/// How far the cliplist is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// It is here.
    #[default]
    Here,
    /// The subhost is to be asked for it.
    Wanted,
    /// It was asked.
    Asked,
}

/// Pages of the next bundle.
pub(super) struct Ahead {
    /// Who clips, if not this node.
    subhost: Option<Peer>,
    /// First tile of the next bundle, and how many there are.
    bundle: Option<(u32, u32)>,
    stage: Stage,
    /// Its pages.
    next: Cliplist,
    /// They have been asked for once, as far as there was room.
    pub tried: bool,
}

impl Ahead {
    /// Nothing yet; `subhost` clips, if not this node.
    pub fn new(subhost: Option<Peer>) -> Self {
        Self { subhost, bundle: None, stage: Stage::Here, next: Cliplist::new(), tried: false }
    }

    /// Pages of the next bundle.
    pub fn pages(&self) -> &[u32] {
        &self.next
    }

    /// Whether a bundle may begin: its cliplist is here.
    pub fn has(&self, bundle: (u32, u32)) -> bool {
        self.bundle == Some(bundle) && self.stage == Stage::Here
    }

    /// The next bundle is begun.
    pub fn begin(&mut self) {
        self.next.clear();
        self.bundle = None;
        self.stage = Stage::Here;
        self.tried = false;
    }

    /// Looks for the pages of a bundle, if that was not done, or has the subhost do so.
    pub fn look(
        &mut self,
        picture: &Picture,
        scene: &Scene<'_>,
        kernels: Kernels,
        bundle: (u32, u32),
        scratch: &mut wide::Scratch,
        counts: &mut Counts,
    ) {
        if self.bundle == Some(bundle) {
            return;
        }
        self.begin();
        self.bundle = Some(bundle);
        if self.subhost.is_some() {
            self.stage = Stage::Wanted;
        } else {
            self.next = clip(picture, scene, kernels, bundle, scratch, counts);
        }
    }

    /// Asks the subhost. Returns whether anything was sent.
    pub fn ask(&mut self, link: &mut dyn Link, picture: u16) -> bool {
        let (Some(subhost), Some((first, count)), Stage::Wanted) = (self.subhost, self.bundle, self.stage) else {
            return false;
        };
        let went = send(link, subhost, picture, &Message::Clip { first, count: count as u8 });
        self.stage = if went { Stage::Asked } else { Stage::Wanted };
        went
    }

    /// The subhost's answer; nothing else is listened to. The scene has so many `pages`: others are left out.
    pub fn come(&mut self, from: Peer, first: u32, body: &[u8], pages: usize) {
        let is_answer = self.subhost == Some(from) && self.stage == Stage::Asked;
        if is_answer && self.bundle.is_some_and(|bundle| bundle.0 == first) {
            let numbers = body.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
            self.next = numbers.filter(|&page| (page as usize) < pages).take(CLIPLIST_MAX).collect();
            self.stage = Stage::Here;
            self.tried = false;
        }
    }

    /// A peer is gone: if it was the subhost, this node clips for itself from now on.
    pub fn lost(&mut self, peer: Peer) {
        if self.subhost == Some(peer) {
            self.subhost = None;
            if self.stage != Stage::Here {
                self.begin();
            }
        }
    }
}

/// Pages that the bundle of `count` tiles from `first` on meets.
pub(crate) fn clip(
    picture: &Picture,
    scene: &Scene<'_>,
    kernels: Kernels,
    (first, count): (u32, u32),
    scratch: &mut wide::Scratch,
    counts: &mut Counts,
) -> Cliplist {
    // Half a pixel more or less, as a filter has it, is a page more or less, and harms nothing.
    let (a, b) = (picture.map.tile(first), picture.map.tile(first + count - 1));
    let rays = picture.camera.outermost([a.x, a.y], [b.x + b.width - 1, b.y + b.height - 1]).map(|seen| Ray {
        origin: seen.origin,
        direction: seen.direction,
        t_min: seen.t_min,
        t_max: f32::INFINITY,
    });
    let Some(bundle) = Bundle::around(rays, scene.magnitude) else { return Cliplist::new() };
    let mut found = [(0.0, 0); CLIPLIST_MAX];
    let used = wide::pages(kernels, &scene.resident.directory, &bundle, &mut found, scratch, counts);
    found[..used].iter().map(|&(_, page)| page).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use hybray_link::Event;
    use hybray_wire::decode;
    use std::vec::Vec;

    /// Keeps what is sent, if there is room.
    struct Wire(Vec<(Peer, Message)>, bool);

    impl Link for Wire {
        fn me(&self) -> Peer {
            1
        }
        fn peers(&self) -> Peer {
            4
        }
        fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
            let mut bytes = std::vec![0; bytes_max];
            if self.1 {
                let used = write(&mut bytes);
                self.0.push((to, decode(&bytes[..used]).unwrap().message));
            }
            self.1
        }
        fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
            false
        }
        fn wait(&mut self, _: u64) {}
    }

    fn body(pages: &[u32]) -> Vec<u8> {
        pages.iter().flat_map(|page| page.to_le_bytes()).collect()
    }

    fn wanted(subhost: Peer) -> Ahead {
        Ahead { bundle: Some((8, 4)), stage: Stage::Wanted, tried: true, ..Ahead::new(Some(subhost)) }
    }

    #[test]
    fn the_subhost_is_asked_once_and_nobody_else_is_listened_to() {
        let mut ahead = wanted(3);
        let mut wire = Wire(Vec::new(), false);
        ahead.come(3, 8, &body(&[1]), 10);
        assert!(!ahead.has((8, 4)), "nobody asked yet");
        assert!(!ahead.ask(&mut wire, 0), "no room");
        wire.1 = true;
        assert!(ahead.ask(&mut wire, 0) && !ahead.ask(&mut wire, 0));
        assert_eq!(wire.0, [(3, Message::Clip { first: 8, count: 4 })]);
        ahead.come(2, 8, &body(&[1]), 10);
        ahead.come(3, 4, &body(&[1]), 10);
        assert!(!ahead.has((8, 4)) && ahead.pages().is_empty());
        ahead.come(3, 8, &body(&[7, 10, 2, u32::MAX]), 10);
        assert!(ahead.has((8, 4)) && !ahead.has((8, 1)) && !ahead.tried);
        assert_eq!(ahead.pages(), [7, 2], "no page beyond the directory");
        ahead.come(3, 8, &body(&[1]), 10);
        assert_eq!(ahead.pages(), [7, 2], "once is enough");
    }

    #[test]
    fn a_node_whose_subhost_is_lost_clips_for_itself() {
        let mut ahead = wanted(3);
        ahead.lost(2);
        assert_eq!((ahead.subhost, ahead.bundle), (Some(3), Some((8, 4))));
        ahead.lost(3);
        assert_eq!((ahead.subhost, ahead.bundle), (None, None), "it is looked for again, here");
        // What has come stays.
        let mut ahead = Ahead { stage: Stage::Here, ..wanted(3) };
        ahead.lost(3);
        assert!(ahead.subhost.is_none() && ahead.has((8, 4)));
    }
}
