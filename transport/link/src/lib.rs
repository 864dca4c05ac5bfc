//! The transport trait alone: whole frames, once and in order from each peer, or the peer is lost.
//!
//! A machine asks for room before it writes: a frame for which there is no room is not written at all, and the machine
//! keeps what it wanted to send. What arrives is handed out in place.
#![no_std]
#![forbid(unsafe_code)]

/// A participant: the host is 0, nodes count from 1.
pub type Peer = u16;

/// The host's number.
pub const HOST: Peer = 0;

/// What a link has to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// A frame.
    Frame {
        /// Who sent it.
        from: Peer,
        /// All of it.
        bytes: &'a [u8],
    },
    /// This peer will never be heard of again.
    Lost {
        /// Who.
        peer: Peer,
    },
}

/// Frames to and from all peers, oneself included.
pub trait Link {
    /// Who I am.
    fn me(&self) -> Peer;

    /// How many participants there are: they are numbered below this.
    fn peers(&self) -> Peer;

    /// Sends a frame of at most `bytes_max` bytes: `write` puts it into the link's own room and returns its length. If
    /// there is no room now, or the peer is lost, `write` is not called and the result is false.
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool;

    /// Hands out one event, if there is one. Bounded: one call of `read`.
    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool;

    /// Waits until there may be something to receive, or room, or until about `nanoseconds` have passed. May return at
    /// once.
    fn wait(&mut self, nanoseconds: u64);
}
