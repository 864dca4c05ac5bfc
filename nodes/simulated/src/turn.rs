//! A participant's turn at sending: what each frame costs, and when it leaves.

use crate::gaps::Gaps;
use crate::machine::Machine;
use crate::worker::{records, timed};
use hybray_link::{Event, Link, Peer};
use hybray_sim::Network;
use hybray_wire::{Message, decode, encode};

/// What was said in a turn.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Said {
    /// Time that it took, picoseconds.
    pub spent_ps: u64,
    /// Frames.
    pub frames: u32,
    /// When the first run of tiles left.
    pub first_tiles_ns: Option<u64>,
    /// Frames and bytes of each kind, to others.
    pub kinds: [(u64, u64); KINDS.len()],
}

/// Kinds of messages, as they are counted.
pub(crate) const KINDS: [&str; 10] = [
    "sums of tiles",
    "rays",
    "taken",
    "partial sums",
    "fetch",
    "pages",
    "runs of tiles",
    "shares",
    "cliplists",
    "others",
];

fn kind(message: Option<&Message>) -> usize {
    match message {
        Some(Message::Contributions { .. }) => 0,
        Some(Message::Rays { .. }) => 1,
        Some(Message::Took { .. }) => 2,
        Some(Message::Partials { .. }) => 3,
        Some(Message::Fetch { .. }) => 4,
        Some(Message::Part { .. }) => 5,
        Some(Message::Tiles { .. } | Message::Done { .. }) => 6,
        Some(Message::Share { .. } | Message::Idle { .. } | Message::Back { .. }) => 7,
        Some(Message::Clip { .. } | Message::Cliplist { .. }) => 8,
        _ => 9,
    }
}

/// The link of a participant that sends: frames leave one after the other, each when it is packed.
pub(crate) struct Turn<'a> {
    pub network: &'a mut Network,
    pub machine: &'a Machine,
    pub me: Peer,
    pub now_ns: u64,
    /// Time spent on the run that ends next, and on everything.
    pub run_ns: &'a mut u64,
    pub computing_ns: u64,
    pub gaps: &'a mut Gaps,
    pub said: Said,
}

/// What a frame costs its sender or its receiver beside the fixed part, picoseconds.
pub(crate) fn contents_ps(machine: &Machine, message: Option<&Message>, bytes: usize) -> u64 {
    machine.messages.byte * bytes as u64 + machine.messages.record * message.map_or(0, records)
}

impl Link for Turn<'_> {
    fn me(&self) -> Peer {
        self.me
    }

    fn peers(&self) -> Peer {
        self.network.peers()
    }

    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let Self { network, machine, me, now_ns, run_ns, computing_ns, gaps, said } = self;
        network.send(*me, to, *now_ns, bytes_max, &mut |room| {
            let mut used = write(room);
            let view = decode(&room[..used]).ok();
            let (picture, message) = (view.map_or(0, |view| view.picture), view.map(|view| view.message));
            if let Some(message @ (Message::Done { .. } | Message::Report { .. })) = message {
                let message = timed(message, run_ns, *computing_ns);
                used = encode(picture, &message, room, |_| {}).expect("the room for a message is enough for any");
            }
            // What one says to oneself is a call.
            if to != *me {
                said.spent_ps += machine.messages.sent + contents_ps(machine, message.as_ref(), used);
                let (frames, bytes) = &mut said.kinds[kind(message.as_ref())];
                *frames += 1;
                *bytes += used as u64;
                message.iter().for_each(|message| gaps.said(*me, to, message, *now_ns));
            }
            said.frames += 1;
            let leaves_ns = *now_ns + said.spent_ps / 1000;
            if let Some(Message::Tiles { .. }) = message {
                said.first_tiles_ns.get_or_insert(leaves_ns);
            }
            (used, leaves_ns)
        })
    }

    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool {
        self.network.receive(self.me, read)
    }

    fn wait(&mut self, _: u64) {}
}
