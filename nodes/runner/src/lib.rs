//! One loop for every machine: receive, step, send, wait.
//!
//! A participant is a node, a dispatcher, or both (section 2.2 of POV||Ray puts the dispatcher near the workers); the
//! host adds its master. Clocks and links come in from outside.
#![no_std]
#![forbid(unsafe_code)]

use hybray_link::{Event, Link};
use hybray_scheduler::{Clipper, Dispatcher, Film, Master, Node, Outcome, PageServer, Progress, Store};
use hybray_wire::{Message, View, decode};

/// How long a participant that has nothing to do waits for something to arrive, nanoseconds.
const WAIT: u64 = 20_000_000;
/// Frames taken in before the next look at other work.
const FRAMES: usize = 64;

/// Takes in what has arrived, at most [`FRAMES`] frames; returns whether there was anything.
fn receive(link: &mut dyn Link, mut handle: impl FnMut(Arrival<'_>)) -> bool {
    let mut any = false;
    for _ in 0..FRAMES {
        let more = link.receive(&mut |event| match event {
            Event::Frame { from, bytes } => match decode(bytes) {
                Ok(view) => handle(Arrival::Message { from, view }),
                Err(_) => handle(Arrival::Nonsense),
            },
            Event::Lost { peer } => handle(Arrival::Lost { peer }),
        });
        if !more {
            break;
        }
        any = true;
    }
    any
}

enum Arrival<'a> {
    Message { from: u16, view: View<'a> },
    Nonsense,
    Lost { peer: u16 },
}

/// Runs a node, and a dispatcher beside it if it has one, until it is told to stop or the host is lost. `ended` looks at it
/// when it has done its last for a picture, whose number it hears.
pub fn run_node<'m, 's, P: Store>(
    node: &mut Node<'m, 's, P>,
    mut dispatcher: Option<Dispatcher<'_>>,
    link: &mut dyn Link,
    clock: &mut dyn FnMut() -> u64,
    ended: &mut dyn FnMut(u16, &Node<'m, 's, P>),
) {
    let mut picture = node.picture();
    while !node.is_stopped() {
        let now = clock();
        let mut host_lost = false;
        let mut busy = receive(link, |arrival| match arrival {
            Arrival::Message { from, view } => {
                if let Some(dispatcher) = &mut dispatcher {
                    dispatcher.handle(from, &view, now);
                }
                node.handle(from, &view);
            }
            Arrival::Lost { peer } => {
                host_lost |= peer == hybray_link::HOST;
                if let Some(dispatcher) = &mut dispatcher {
                    dispatcher.lost(peer);
                }
                node.lost(peer);
            }
            Arrival::Nonsense => {}
        });
        if host_lost {
            break;
        }
        if node.picture() != picture {
            ended(picture, node);
            picture = node.picture();
        }
        busy |= node.step(clock);
        busy |= node.poll(link, clock());
        if let Some(dispatcher) = &mut dispatcher {
            dispatcher.poll(link, clock());
        }
        if !busy {
            link.wait(WAIT);
        }
    }
    ended(picture, node);
}

/// Who looks on while a picture is drawn, beside the master: of several pictures each begins and ends in turn. A closure that
/// looks at the progress alone is one too.
pub trait Watch {
    /// Before anything is said to nodes: tiles that are finished already may be put into the film ([`Film::keep`]). The
    /// picture ends as it is when it returns false.
    fn begin(&mut self, _film: &mut Film<'_>) -> bool {
        true
    }

    /// Called often: how far it is. The picture ends as it is when it returns false.
    fn look(&mut self, progress: Progress, film: &Film<'_>) -> bool;

    /// How it ended; nothing is added to the film any more.
    fn end(&mut self, _outcome: Outcome, _film: &Film<'_>) {}
}

impl<F: FnMut(Progress) -> bool> Watch for F {
    fn look(&mut self, progress: Progress, _: &Film<'_>) -> bool {
        self(progress)
    }
}

/// Runs the master, and a dispatcher and a clipper beside it if it has them, until the picture has ended. `server` gives out
/// the bytes of `pages` that nodes ask the host for. Before another picture of the run, dispatcher and clipper are to be told
/// of it ([`Dispatcher::next`], [`Clipper::next`]).
pub fn run_master(
    master: &mut Master<'_>,
    mut dispatcher: Option<&mut Dispatcher<'_>>,
    mut clipper: Option<&mut Clipper<'_, '_>>,
    server: &mut PageServer<'_>,
    pages: &[&[u8]],
    link: &mut dyn Link,
    clock: &mut dyn FnMut() -> u64,
    watch: &mut dyn Watch,
) -> Outcome {
    if !watch.begin(master.film_mut()) {
        master.stop();
    }
    loop {
        let now = clock();
        let mut busy = receive(link, |arrival| match arrival {
            Arrival::Message { from, view } => {
                if let Some(dispatcher) = &mut dispatcher {
                    dispatcher.handle(from, &view, now);
                }
                if let Some(clipper) = &mut clipper {
                    clipper.handle(from, &view);
                }
                if let Message::Fetch { page } = view.message {
                    server.fetch(from, page);
                }
                master.handle(from, &view);
            }
            Arrival::Nonsense => master.refuse(),
            Arrival::Lost { peer } => {
                if let Some(dispatcher) = &mut dispatcher {
                    dispatcher.lost(peer);
                }
                if let Some(clipper) = &mut clipper {
                    clipper.lost(peer);
                }
                server.lost(peer);
                master.lost(peer);
            }
        });
        busy |= server.serve(link, &|page| pages.get(page as usize).copied()).0;
        if let Some(clipper) = &mut clipper {
            busy |= clipper.serve(link);
        }
        if let Some(page) = server.missing() {
            master.missing(page);
        }
        if !watch.look(master.progress(), master.film()) {
            master.stop();
        }
        master.poll(link);
        if let Some(dispatcher) = &mut dispatcher {
            dispatcher.poll(link, clock());
        }
        if let Some(outcome) = master.outcome() {
            watch.end(outcome, master.film());
            return outcome;
        }
        if !busy {
            link.wait(WAIT);
        }
    }
}
