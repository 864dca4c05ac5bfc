//! A farm over a transport of one's own: four threads, channels of the standard library, and a loop for each side.
//!
//! The machines know no thread, clock or channel. What a caller brings is a [`Link`], the loop that turns them, and
//! nanoseconds.
//!
//! `cargo run -p hybray-scheduler --example own_transport`

mod toy;

use hybray_arena::{Arena, LINE_BYTES};
use hybray_geometry::simd::Kernels;
use hybray_link::{Event, HOST, Link, Peer};
use hybray_scheduler::{
    All, Dispatcher, Film, Limits, Master, Node, NodeMemory, NodeReport, NodeState, Options, Outcome, Settings, Store,
    TileState,
};
use hybray_wire::{TileMap, decode};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};
use toy::{SCENE_HASH, Toy};

const NODES: Peer = 4;

/// What a channel carries: who sent it, and the frame; nothing, if they are gone.
type Parcel = (Peer, Option<Vec<u8>>);

/// One participant's end. Channels keep the order of each sender, and have room for everything: the least that a link
/// must promise, and the most that it may.
struct Channels {
    me: Peer,
    inbox: Receiver<Parcel>,
    outboxes: Vec<Sender<Parcel>>,
    next: Option<Parcel>,
}

impl Channels {
    fn all(peers: Peer) -> Vec<Self> {
        let (outboxes, inboxes): (Vec<_>, Vec<_>) = (0..peers).map(|_| channel()).unzip();
        let end = |(me, inbox)| Self { me, inbox, outboxes: outboxes.clone(), next: None };
        (0..peers).zip(inboxes).map(end).collect()
    }
}

impl Link for Channels {
    fn me(&self) -> Peer {
        self.me
    }

    fn peers(&self) -> Peer {
        self.outboxes.len() as Peer
    }

    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let Some(outbox) = self.outboxes.get(usize::from(to)) else { return false };
        let mut frame = vec![0; bytes_max];
        let used = write(&mut frame);
        frame.truncate(used);
        outbox.send((self.me, Some(frame))).is_ok()
    }

    fn receive(&mut self, read: &mut dyn FnMut(Event<'_>)) -> bool {
        match self.next.take().or_else(|| self.inbox.try_recv().ok()) {
            Some((from, Some(frame))) => read(Event::Frame { from, bytes: &frame }),
            Some((peer, None)) => read(Event::Lost { peer }),
            None => return false,
        }
        true
    }

    fn wait(&mut self, nanoseconds: u64) {
        if self.next.is_none() {
            self.next = self.inbox.recv_timeout(Duration::from_nanos(nanoseconds)).ok();
        }
    }
}

impl Drop for Channels {
    fn drop(&mut self) {
        for outbox in &self.outboxes {
            // Who is gone already need not hear of it.
            let _ = outbox.send((self.me, None));
        }
    }
}

/// Turns a node until it is told to stop, or the host is gone: receive, step, send, wait.
fn work<P: Store>(node: &mut Node<'_, '_, P>, link: &mut Channels, clock: &mut dyn FnMut() -> u64) {
    let mut host_is_here = true;
    while host_is_here && !node.is_stopped() {
        let received = link.receive(&mut |event| match event {
            Event::Frame { from, bytes } => {
                if let Ok(view) = decode(bytes) {
                    node.handle(from, &view);
                }
            }
            Event::Lost { peer } => {
                host_is_here &= peer != HOST;
                node.lost(peer);
            }
        });
        let stepped = node.step(clock);
        let sent = node.poll(link, clock());
        if !(received || stepped || sent) {
            link.wait(20_000_000);
        }
    }
}

/// Turns the film's master, and the dispatcher beside it, until the picture has ended.
fn lead(
    master: &mut Master<'_>,
    dispatcher: &mut Dispatcher<'_>,
    link: &mut Channels,
    clock: &mut dyn FnMut() -> u64,
) -> Outcome {
    loop {
        let now = clock();
        let received = link.receive(&mut |event| match event {
            Event::Frame { from, bytes } => match decode(bytes) {
                Ok(view) => {
                    dispatcher.handle(from, &view, now);
                    master.handle(from, &view);
                }
                Err(_) => master.refuse(),
            },
            Event::Lost { peer } => {
                dispatcher.lost(peer);
                master.lost(peer);
            }
        });
        master.poll(link);
        dispatcher.poll(link, clock());
        if let Some(outcome) = master.outcome() {
            return outcome;
        }
        if !received {
            link.wait(20_000_000);
        }
    }
}

fn main() {
    let toy = Toy::new();
    let pages = toy.open();
    let scene = toy.scene(&pages);
    let frame = Toy::frame(96, 48, 4);

    let Some(map) = TileMap::new(frame.width, frame.height) else { return };
    let mut sums = vec![[0; 3]; (frame.width * frame.height) as usize];
    let mut tiles = vec![TileState::default(); map.len() as usize];
    let Some(film) = Film::new(&frame, &mut sums, &mut tiles) else { return };
    let mut reports = vec![NodeReport::default(); usize::from(NODES) + 1];
    let mut states = vec![NodeState::default(); usize::from(NODES) + 1];
    let mut master = Master::new(frame, film, &mut reports, SCENE_HASH, HOST);
    let mut dispatcher = Dispatcher::new(&mut states, Options::default());

    // Each node has every page, so what it works in is small. It is carved from bytes that are lent to it.
    let limits = Limits::all_at_hand();
    let bytes = NodeMemory::sum(&limits).total_bytes() as usize + LINE_BYTES - 1;

    let start = Instant::now();
    let clock = || start.elapsed().as_nanos() as u64;
    let mut ends = Channels::all(NODES + 1);
    let nodes = ends.split_off(1);
    let outcome = std::thread::scope(|threads| {
        for mut link in nodes {
            threads.spawn(move || {
                let mut lent = Box::new_uninit_slice(bytes);
                let memory = NodeMemory::carve(&mut Arena::new(&mut lent), &limits).expect("the sum of its terms");
                let (store, settings) = (All(scene.resident.pages, &[]), Settings::default());
                let mut node =
                    Node::new(scene, store, SCENE_HASH, Kernels::Portable, link.me(), HOST, settings, memory);
                work(&mut node, &mut link, &mut { clock });
            });
        }
        lead(&mut master, &mut dispatcher, &mut ends[0], &mut { clock })
    });

    let shade = |[r, g, b]: [f32; 3]| {
        let light = (0.2 * r + 0.7 * g + 0.1 * b).clamp(0.0, 0.99);
        char::from(b" .:-=+*#%@"[(light * 10.0) as usize])
    };
    let film = master.film();
    for row in (0..frame.height).step_by(2) {
        let line: String = (0..frame.width).map(|x| shade(film.radiance((row * frame.width + x) as usize))).collect();
        println!("{}", line.trim_end());
    }
    println!("{outcome:?}: {:?}, hash {:016x}", master.progress(), film.hash());
    for (node, report) in master.reports().iter().enumerate().skip(1) {
        println!("node {node}: {} tiles in {} runs, {} primary rays", report.tiles, report.runs, report.counts.primary);
    }
}
