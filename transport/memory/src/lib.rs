//! The link between threads of one process: crossbeam channels.
//!
//! Each participant has one inbox. A sender may have [`ROOM`] frames in each inbox, so that a slow reader holds back
//! those who write to it and nobody else; inboxes are never full, and no send ever waits. Who found no room is woken
//! when there is some again: asleep, it would leave its processor idle while there is work to be sent for.
#![forbid(unsafe_code)]

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, TryRecvError, unbounded};
use hybray_link::{Event, Link, Peer};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

/// Frames that one sender may have in one inbox.
pub const ROOM: u32 = 64;

/// What travels from a participant to another.
enum Parcel {
    Frame(Box<[u8]>),
    /// There is room again.
    Room,
    /// The sender is gone.
    Gone,
}

/// What all participants share.
struct Shared {
    inboxes: Vec<Sender<(Peer, Parcel)>>,
    /// Frames in flight: `from * peers + to`.
    flying: Vec<AtomicU32>,
    /// Who found no room where: `from * peers + to`.
    refused: Vec<AtomicBool>,
    gone: Vec<AtomicBool>,
}

/// One participant's end.
pub struct MemoryLink {
    me: Peer,
    shared: Arc<Shared>,
    inbox: Receiver<(Peer, Parcel)>,
    /// Taken from the inbox while waiting.
    next: Option<(Peer, Parcel)>,
    scratch: Vec<u8>,
}

/// The ends of `peers` participants, by number.
#[must_use]
pub fn links(peers: Peer) -> Vec<MemoryLink> {
    let count = usize::from(peers);
    let (inboxes, receivers): (Vec<_>, Vec<_>) = (0..count).map(|_| unbounded()).unzip();
    let shared = Arc::new(Shared {
        inboxes,
        flying: (0..count * count).map(|_| AtomicU32::new(0)).collect(),
        refused: (0..count * count).map(|_| AtomicBool::new(false)).collect(),
        gone: (0..count).map(|_| AtomicBool::new(false)).collect(),
    });
    (0..peers)
        .zip(receivers)
        .map(|(me, inbox)| MemoryLink { me, shared: Arc::clone(&shared), inbox, next: None, scratch: Vec::new() })
        .collect()
}

impl MemoryLink {
    fn flying(&self, from: Peer, to: Peer) -> &AtomicU32 {
        &self.shared.flying[usize::from(from) * self.shared.inboxes.len() + usize::from(to)]
    }

    fn refused(&self, from: Peer, to: Peer) -> &AtomicBool {
        &self.shared.refused[usize::from(from) * self.shared.inboxes.len() + usize::from(to)]
    }

    /// Whether there is room at `to`. Only this end adds to the counter, so what is free now stays free. If there is
    /// none, it is looked at once more after saying so: the reader frees first and looks then, so one of the two sees
    /// the other.
    fn has_room(&self, to: Peer) -> bool {
        let free = || self.flying(self.me, to).load(Ordering::SeqCst) < ROOM;
        if free() {
            return true;
        }
        self.refused(self.me, to).store(true, Ordering::SeqCst);
        free()
    }
}

impl Link for MemoryLink {
    fn me(&self) -> Peer {
        self.me
    }

    fn peers(&self) -> Peer {
        self.shared.inboxes.len() as Peer
    }

    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let Some(inbox) = self.shared.inboxes.get(usize::from(to)) else { return false };
        if self.shared.gone[usize::from(to)].load(Ordering::Acquire) || !self.has_room(to) {
            return false;
        }
        let mut room = std::mem::take(&mut self.scratch);
        room.resize(bytes_max.max(room.len()), 0);
        let used = write(&mut room[..bytes_max]);
        let frame = Parcel::Frame(Box::from(&room[..used.min(bytes_max)]));
        self.scratch = room;
        self.flying(self.me, to).fetch_add(1, Ordering::SeqCst);
        inbox.send((self.me, frame)).is_ok()
    }

    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool {
        loop {
            let (from, parcel) = match self.next.take() {
                Some(parcel) => parcel,
                None => match self.inbox.try_recv() {
                    Ok(parcel) => parcel,
                    Err(TryRecvError::Empty | TryRecvError::Disconnected) => return false,
                },
            };
            match parcel {
                Parcel::Frame(bytes) => {
                    self.flying(from, self.me).fetch_sub(1, Ordering::SeqCst);
                    if self.refused(from, self.me).swap(false, Ordering::SeqCst) {
                        // Who has gone meanwhile wants no room.
                        let _ = self.shared.inboxes[usize::from(from)].send((self.me, Parcel::Room));
                    }
                    read(Event::Frame { from, bytes: &bytes });
                }
                Parcel::Gone => read(Event::Lost { peer: from }),
                // It was to end a wait, and there was none. One for each refusal at most, so this ends.
                Parcel::Room => continue,
            }
            return true;
        }
    }

    fn wait(&mut self, nanoseconds: u64) {
        if self.next.is_none() {
            match self.inbox.recv_timeout(Duration::from_nanos(nanoseconds)) {
                Ok(parcel) => self.next = Some(parcel),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
            }
        }
    }
}

/// A thread that ends, or panics, is lost to the others.
impl Drop for MemoryLink {
    fn drop(&mut self) {
        self.shared.gone[usize::from(self.me)].store(true, Ordering::Release);
        for (peer, inbox) in self.shared.inboxes.iter().enumerate() {
            if peer != usize::from(self.me) {
                // An inbox whose owner is gone too has nobody left to tell.
                let _ = inbox.send((self.me, Parcel::Gone));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn send(link: &mut MemoryLink, to: Peer, text: &str) -> bool {
        link.send(to, 64, &mut |room| {
            room[..text.len()].copy_from_slice(text.as_bytes());
            text.len()
        })
    }

    fn receive(link: &mut MemoryLink) -> Option<String> {
        let mut got = None;
        link.receive(&mut |event| {
            got = Some(match event {
                Event::Frame { from, bytes } => format!("{from}: {}", String::from_utf8_lossy(bytes)),
                Event::Lost { peer } => format!("{peer} is lost"),
            });
        });
        got
    }

    #[test]
    fn frames_arrive_whole_and_in_order() {
        let mut all = links(3);
        let (mut c, mut b, mut a) = (all.pop().unwrap(), all.pop().unwrap(), all.pop().unwrap());
        assert!(send(&mut a, 2, "one") && send(&mut b, 2, "two") && send(&mut a, 2, "three") && send(&mut c, 2, "me"));
        let got: Vec<_> = std::iter::from_fn(|| receive(&mut c)).collect();
        assert_eq!(got, ["0: one", "1: two", "0: three", "2: me"]);
    }

    #[test]
    fn a_full_inbox_refuses_one_sender_only_until_it_is_read() {
        let mut all = links(3);
        let (mut c, mut b, mut a) = (all.pop().unwrap(), all.pop().unwrap(), all.pop().unwrap());
        let sent = (0..100).filter(|_| send(&mut a, 2, "x")).count();
        assert_eq!(sent, ROOM as usize);
        assert!(send(&mut b, 2, "y"));
        assert!(receive(&mut c).is_some());
        assert!(send(&mut a, 2, "x") && !send(&mut a, 2, "x"));
    }

    #[test]
    fn a_dropped_end_is_lost_after_its_last_frame() {
        let mut all = links(2);
        let (mut b, mut a) = (all.pop().unwrap(), all.pop().unwrap());
        assert!(send(&mut a, 1, "last"));
        drop(a);
        assert_eq!(receive(&mut b).unwrap(), "0: last");
        assert_eq!(receive(&mut b).unwrap(), "0 is lost");
        assert!(!send(&mut b, 0, "too late"));
        assert!(!send(&mut b, 9, "nobody"));
    }
}
