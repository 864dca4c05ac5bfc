//! A farm in one thread, turn by turn, whose post is prepared beforehand: nothing is allocated while it runs.

use hybray_link::{Event, HOST, Link, Peer};
use hybray_scheduler::{Cache, Dispatcher, Master, Node, Outcome, Own, PageServer};
use hybray_wire::{MESSAGE_BYTES_MAX, Message, decode};

/// Frames that one participant may have at another.
const ROOM: usize = 3;
/// Turns after which a farm is taken never to end.
const TURNS: u64 = 3_000_000;
/// What a turn takes, nanoseconds.
const TURN_NS: u64 = 10_000;

/// Frames from one to another.
struct Letters {
    frames: Vec<Box<[u8]>>,
    bytes: [usize; ROOM],
    head: usize,
    count: usize,
}

/// The frames of all pairs.
pub struct Post {
    peers: usize,
    letters: Vec<Letters>,
}

impl Post {
    /// Room for frames between so many.
    #[must_use]
    pub fn new(peers: usize) -> Self {
        let frames = || (0..ROOM).map(|_| vec![0; MESSAGE_BYTES_MAX].into_boxed_slice()).collect();
        let letters = |_| Letters { frames: frames(), bytes: [0; ROOM], head: 0, count: 0 };
        Self { peers, letters: (0..peers * peers).map(letters).collect() }
    }

    /// Sends as [`Link::send`] does.
    pub fn send(&mut self, from: Peer, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        if usize::from(to) >= self.peers {
            return false;
        }
        let letters = &mut self.letters[usize::from(from) * self.peers + usize::from(to)];
        if letters.count == ROOM {
            return false;
        }
        let at = (letters.head + letters.count) % ROOM;
        letters.bytes[at] = write(&mut letters.frames[at][..bytes_max]);
        letters.count += 1;
        true
    }

    /// Hands the oldest frame from each to `read`; returns whether there was one.
    fn receive(&mut self, me: usize, read: &mut dyn FnMut(Peer, &[u8])) -> bool {
        let mut any = false;
        for from in 0..self.peers {
            let letters = &mut self.letters[from * self.peers + me];
            if letters.count > 0 {
                read(from as Peer, &letters.frames[letters.head][..letters.bytes[letters.head]]);
                letters.head = (letters.head + 1) % ROOM;
                letters.count -= 1;
                any = true;
            }
        }
        any
    }
}

struct End<'a> {
    post: &'a mut Post,
    me: Peer,
}

impl Link for End<'_> {
    fn me(&self) -> Peer {
        self.me
    }
    fn peers(&self) -> Peer {
        self.post.peers as Peer
    }
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        self.post.send(self.me, to, bytes_max, write)
    }
    fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
        false
    }
    fn wait(&mut self, _: u64) {}
}

/// What somebody does who is no node: the last participant. What it is sent is thrown away.
pub type Stranger<'a> = &'a mut dyn FnMut(&mut Post);

/// Runs nodes 1, 2, ... and the host with its dispatcher, in turn, until the picture has ended; `None` if it does not.
pub fn turns(
    master: &mut Master<'_>,
    dispatcher: &mut Dispatcher<'_>,
    server: &mut PageServer<'_>,
    pages: &[&[u8]],
    nodes: &mut [Node<'_, '_, Cache<'_, Own<'_>>>],
    post: &mut Post,
    mut stranger: Option<Stranger<'_>>,
) -> Option<Outcome> {
    for turn in 0..TURNS {
        let now = turn * TURN_NS;
        post.receive(usize::from(HOST), &mut |from, bytes| match decode(bytes) {
            Ok(view) => {
                dispatcher.handle(from, &view, now);
                if let Message::Fetch { page } = view.message {
                    server.fetch(from, page);
                }
                master.handle(from, &view);
            }
            Err(_) => master.refuse(),
        });
        let link = &mut End { post, me: HOST };
        server.serve(link, &|page| pages.get(page as usize).copied());
        master.poll(link);
        dispatcher.poll(link, now);
        for (me, node) in (1..).zip(nodes.iter_mut()) {
            post.receive(me, &mut |from, bytes| {
                if let Ok(view) = decode(bytes) {
                    node.handle(from, &view);
                }
            });
            node.step(&mut || now);
            node.poll(&mut End { post, me: me as Peer }, now);
        }
        if let Some(stranger) = &mut stranger {
            post.receive(nodes.len() + 1, &mut |_, _| {});
            stranger(post);
        }
        if let Some(outcome) = master.outcome() {
            return Some(outcome);
        }
    }
    None
}
