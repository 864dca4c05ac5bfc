//! Taking in frames: what each costs, and who hears of it.

use crate::machine::Machine;
use crate::turn::contents_ps;
use hybray_link::{Event, HOST, Peer};
use hybray_sim::Network;
use hybray_wire::{View, decode};

/// Frames taken in before the next look at other work, as in `nodes/runner`.
pub(crate) const FRAMES: usize = 64;

/// What arrived.
pub(crate) enum Arrival<'a> {
    Message { from: Peer, view: View<'a> },
    Nonsense,
    Lost { peer: Peer },
}

/// What taking in came to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Taken {
    /// Time that it took, picoseconds.
    pub spent_ps: u64,
    pub frames: usize,
    pub host_lost: bool,
}

/// Takes in what has arrived for `me`, at most [`FRAMES`] frames. `handle` is told when each has been unpacked.
pub(crate) fn take(
    network: &mut Network,
    machine: &Machine,
    me: Peer,
    now_ns: u64,
    mut handle: impl FnMut(Arrival<'_>, u64),
) -> Taken {
    let mut taken = Taken::default();
    while taken.frames < FRAMES
        && network.receive(me, &mut |event| match event {
            Event::Frame { from, bytes } => {
                let view = decode(bytes);
                if from != me {
                    let message = view.as_ref().ok().map(|view| &view.message);
                    taken.spent_ps += machine.messages.received + contents_ps(machine, message, bytes.len());
                }
                let unpacked_ns = now_ns + taken.spent_ps / 1000;
                match view {
                    Ok(view) => handle(Arrival::Message { from, view }, unpacked_ns),
                    Err(_) => handle(Arrival::Nonsense, unpacked_ns),
                }
            }
            Event::Lost { peer } => {
                taken.host_lost |= peer == HOST;
                handle(Arrival::Lost { peer }, now_ns + taken.spent_ps / 1000);
            }
        })
    {
        taken.frames += 1;
    }
    taken
}
