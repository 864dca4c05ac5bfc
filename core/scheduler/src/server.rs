//! Pages for those who ask for them: parts, in turn, into the room that the link has.
//!
//! Whoever has pages has one: each node, and the host, where the pages of lost nodes are asked for. It keeps what was
//! asked and how far it is sent, never a page.

use hybray_arena::Ring;
use hybray_link::{Link, Peer};
use hybray_wire::{HEAD_BYTES_MAX, Message, encode};

/// Pages that a peer may have asked for and not been sent: what is beyond is not heard.
pub const FETCHES: usize = 2;
/// Bytes of a page in one frame.
pub const PART_BYTES: usize = 4096;

/// What one peer has asked for.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// The first `count`.
    pages: [u32; FETCHES],
    /// Bytes of the first that have been sent.
    sent: u32,
    count: u8,
    /// It stands in the queue.
    queued: bool,
}

const _: () = assert!(size_of::<Asked>() == 16);

impl Asked {
    /// Nothing.
    pub const NONE: Self = Self { pages: [0; FETCHES], sent: 0, count: 0, queued: false };
}

/// Who has asked for what, and whose turn it is.
pub struct PageServer<'m> {
    asked: &'m mut [Asked],
    /// Peers that wait for pages: each is in it once.
    turns: Ring<'m, Peer>,
    missing: Option<u32>,
}

impl<'m> PageServer<'m> {
    /// Nobody has asked for anything. `asked` and `turns` have one entry for each peer.
    #[must_use]
    pub fn new(asked: &'m mut [Asked], turns: &'m mut [Peer]) -> Self {
        asked.fill(Asked::NONE);
        Self { asked, turns: Ring::new(turns), missing: None }
    }

    /// `peer` asks for a page.
    pub fn fetch(&mut self, peer: Peer, page: u32) {
        let Some(asked) = self.asked.get_mut(usize::from(peer)) else { return };
        if usize::from(asked.count) < FETCHES {
            asked.pages[usize::from(asked.count)] = page;
            asked.count += 1;
            if !core::mem::replace(&mut asked.queued, true) {
                let _ = self.turns.push_back(peer);
            }
        }
    }

    /// A peer is gone: it waits for nothing.
    pub fn lost(&mut self, peer: Peer) {
        if let Some(asked) = self.asked.get_mut(usize::from(peer)) {
            (asked.count, asked.sent) = (0, 0);
        }
    }

    /// The first page that was asked for and is there no more.
    #[must_use]
    pub fn missing(&self) -> Option<u32> {
        self.missing
    }

    /// Sends a part to each who waits for one. `bytes` has those of a page, none of them if they are lost, and nothing for
    /// what is no page; in both cases a part of 0 bytes is sent. Returns whether anything was sent, and how many pages that
    /// ended. Bounded: a frame for each peer.
    pub fn serve<'p>(&mut self, link: &mut dyn Link, bytes: &dyn Fn(u32) -> Option<&'p [u8]>) -> (bool, u64) {
        let (mut sent, mut pages) = (false, 0);
        for _ in 0..self.turns.len() {
            let Some(peer) = self.turns.pop_front() else { break };
            let asked = &mut self.asked[usize::from(peer)];
            if asked.count > 0 {
                let (page, offset) = (asked.pages[0], asked.sent);
                let found = bytes(page);
                let all = found.unwrap_or(&[]);
                if found.is_some_and(<[u8]>::is_empty) {
                    self.missing = self.missing.or(Some(page));
                }
                let part = all.get(offset as usize..).unwrap_or(&[]);
                let part = &part[..part.len().min(PART_BYTES)];
                let message = Message::Part { page, offset, bytes: part.len() as u16 };
                let went = link.send(peer, HEAD_BYTES_MAX + part.len(), &mut |room| {
                    encode(0, &message, room, |body| body.copy_from_slice(part))
                        .expect("the room for a message is enough for any")
                });
                sent |= went;
                asked.sent += if went { part.len() as u32 } else { 0 };
                if went && asked.sent as usize >= all.len() {
                    pages += u64::from(!all.is_empty());
                    asked.sent = 0;
                    asked.count -= 1;
                    asked.pages.rotate_left(1);
                }
            }
            asked.queued = asked.count > 0;
            if asked.queued {
                let _ = self.turns.push_back(peer);
            }
        }
        (sent, pages)
    }
}
