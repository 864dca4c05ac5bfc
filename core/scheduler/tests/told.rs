//! Whoever was to be given a share is told what became of it, and says when there is nothing to do again: else the
//! dispatcher would never have anybody share with it again (decision 15). And who waits for a cliplist is told it.

#[path = "../examples/toy/mod.rs"]
mod toy;

use hybray_arena::{Arena, LINE_BYTES};
use hybray_geometry::simd::Kernels;
use hybray_link::{Event, HOST, Link, Peer};
use hybray_scheduler::{All, Limits, Node, NodeMemory, Settings};
use hybray_wire::{Message, View, decode};
use toy::{SCENE_HASH, Toy};

/// Messages that were sent.
#[derive(Default)]
struct Sent {
    taken: Vec<(Peer, Message)>,
    /// About which pictures.
    pictures: Vec<u16>,
    /// Times that there is no room for tiles that go back.
    refused: usize,
}

impl Link for Sent {
    fn me(&self) -> Peer {
        1
    }
    fn peers(&self) -> Peer {
        3
    }
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        let mut room = vec![0; bytes_max];
        let bytes = write(&mut room);
        let View { picture, message, .. } = decode(&room[..bytes]).expect("a node makes sense");
        if matches!(message, Message::Back { .. }) && self.refused > 0 {
            self.refused -= 1;
            return false;
        }
        self.taken.push((to, message));
        self.pictures.push(picture);
        true
    }
    fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
        false
    }
    fn wait(&mut self, _: u64) {}
}

/// What node 1 sends after `message` from `from`, besides its greetings.
fn check(from: Peer, message: Message, expected: &[(Peer, Message)]) {
    check_with(1, &[], from, message, expected);
}

/// The same, when it was given `runs` of a picture of so many tiles, and has begun none.
fn check_with(tiles: u32, runs: &[Message], from: Peer, message: Message, expected: &[(Peer, Message)]) {
    let toy = Toy::new();
    let pages = toy.open();
    let limits = Limits { peers: 3, pages: 1, rays: 8, tiles: 4, partials: 4 };
    let mut memory = Box::<[u8]>::new_uninit_slice(NodeMemory::sum(&limits).total_bytes() as usize + LINE_BYTES - 1);
    let memory = NodeMemory::carve(&mut Arena::new(&mut memory), &limits).expect("the sum of its terms");
    let (scene, settings) = (toy.scene(&pages), Settings::default());
    let mut node = Node::new(scene, All(&pages, &[]), SCENE_HASH, Kernels::Portable, 1, HOST, settings, memory);
    // The way to the dispatcher is full for a while.
    let mut link = Sent { refused: 2, ..Sent::default() };
    node.handle(HOST, &View { picture: 0, message: Message::Begin(Toy::frame(8 * tiles, 8, 1)), body: &[] });
    node.poll(&mut link, 0);
    link.taken.clear();
    runs.iter().for_each(|run| node.handle(HOST, &View { picture: 0, message: *run, body: &[] }));
    let body = vec![0; message.body_bytes()];
    node.handle(from, &View { picture: 0, message, body: &body });
    for now in 1..8 {
        node.step(&mut || 0);
        node.poll(&mut link, now);
    }
    let done = |message: Message| match message {
        Message::Done { first, count, .. } => Message::Done { first, count, nanoseconds: 0 },
        Message::Rays { rays, shadows, .. } => Message::Rays { rays, shadows, load: 0 },
        other => other,
    };
    link.taken.retain(|(_, message)| !matches!(message, Message::Contributions { .. }));
    link.taken.iter_mut().for_each(|(_, message)| *message = done(*message));
    assert_eq!(link.taken, expected);
}

#[test]
fn who_refuses_rays_says_when_it_is_idle() {
    let told = [(2, Message::Took { taken: false, load: 0 }), (HOST, Message::Idle { given: true })];
    check(2, Message::Rays { rays: 9, shadows: 0, load: 0 }, &told);
}

#[test]
fn who_has_nothing_to_share_says_so() {
    check(HOST, Message::Share { with: 2 }, &[(2, Message::Rays { rays: 0, shadows: 0, load: 0 })]);
}

#[test]
fn who_is_given_nothing_says_that_it_is_idle() {
    check(2, Message::Rays { rays: 0, shadows: 0, load: 0 }, &[(HOST, Message::Idle { given: false })]);
}

/// Half of the tiles that are not begun, from the end, for node 2; and the run is done so much sooner.
#[test]
fn who_has_tiles_that_are_not_begun_gives_half_of_them_back() {
    let run = |first, count, epoch| Message::Tiles { first, count, epoch };
    let done = |first, count| (HOST, Message::Done { first, count, nanoseconds: 0 });
    let back = |first, count| (HOST, Message::Back { with: 2, first, count });
    let share = Message::Share { with: 2 };
    check_with(5, &[run(0, 5, 0)], HOST, share, &[back(3, 2), done(0, 3)]);
    check_with(5, &[run(0, 2, 0), run(2, 3, 0)], HOST, share, &[back(2, 3), done(0, 2)]);
    check_with(8, &[run(0, 2, 0), run(2, 6, 0)], HOST, share, &[back(4, 4), done(0, 2), done(2, 2)]);
    // One that is traced again stays: others may know of it under another epoch. So does a node's only tile.
    let nothing = (2, Message::Rays { rays: 0, shadows: 0, load: 0 });
    check_with(5, &[run(0, 3, 1)], HOST, share, &[nothing, done(0, 3)]);
    check_with(5, &[run(0, 1, 0)], HOST, share, &[nothing, done(0, 1)]);
}

/// Something that happens to a node.
type Happens<'a> = &'a dyn Fn(&mut Node<'_, '_, All<'_>>);

/// Node 2 of two, whose cliplists its subhost makes: primary rays that it has traced after each of `events`.
fn traced(subhosts: u16, events: &[Happens<'_>]) -> Vec<u64> {
    let toy = Toy::new();
    let pages = toy.open();
    let limits = Limits { peers: 3, pages: 1, rays: 8, tiles: 4, partials: 4 };
    let mut memory = Box::<[u8]>::new_uninit_slice(NodeMemory::sum(&limits).total_bytes() as usize + LINE_BYTES - 1);
    let memory = NodeMemory::carve(&mut Arena::new(&mut memory), &limits).expect("the sum of its terms");
    let settings = Settings { subhosts: Some(subhosts), ..Settings::default() };
    let mut node =
        Node::new(toy.scene(&pages), All(&pages, &[]), SCENE_HASH, Kernels::Portable, 2, HOST, settings, memory);
    // The way to the dispatcher is full for a while.
    let mut link = Sent { refused: 2, ..Sent::default() };
    node.handle(HOST, &View { picture: 0, message: Message::Begin(Toy::frame(8, 8, 1)), body: &[] });
    node.handle(HOST, &View { picture: 0, message: Message::Tiles { first: 0, count: 1, epoch: 0 }, body: &[] });
    let mut turn = |node: &mut Node<'_, '_, All<'_>>| {
        (0..3).for_each(|now| {
            node.step(&mut || 0);
            node.poll(&mut link, now);
        });
        node.counts().primary
    };
    let mut traced = vec![turn(&mut node)];
    for event in events {
        event(&mut node);
        traced.push(turn(&mut node));
    }
    let asked = |peer| link.taken.iter().filter(|sent| **sent == (peer, Message::Clip { first: 0, count: 1 })).count();
    assert_eq!([asked(HOST), asked(1)], [usize::from(subhosts == 0), usize::from(subhosts == 1)]);
    traced
}

/// A bundle is begun when its cliplist has come (the 1995 report, chapter 4), or when there is nobody who would send it.
#[test]
fn a_bundle_waits_for_its_cliplist() {
    let from = |peer| {
        move |node: &mut Node<'_, '_, All<'_>>| {
            node.handle(peer, &View { picture: 0, message: Message::Cliplist { first: 0, pages: 1 }, body: &[0; 4] });
        }
    };
    assert_eq!(traced(2, &[]), [64], "who clips for itself");
    assert_eq!(traced(0, &[&from(1), &from(HOST)]), [0, 0, 64]);
    assert_eq!(traced(1, &[&from(HOST), &from(1)]), [0, 0, 64]);
    assert_eq!(traced(1, &[&|node| node.lost(1)]), [0, 64]);
}

/// What node 1 says when it has ended picture 0 and begun picture 1, and hears `message` about `picture`.
fn said_later(from: Peer, picture: u16, message: Message) -> Vec<(Peer, Message)> {
    let toy = Toy::new();
    let pages = toy.open();
    let limits = Limits { peers: 3, pages: 1, rays: 8, tiles: 4, partials: 4 };
    let mut memory = Box::<[u8]>::new_uninit_slice(NodeMemory::sum(&limits).total_bytes() as usize + LINE_BYTES - 1);
    let memory = NodeMemory::carve(&mut Arena::new(&mut memory), &limits).expect("the sum of its terms");
    let (scene, settings) = (toy.scene(&pages), Settings::default());
    let mut node = Node::new(scene, All(&pages, &[]), SCENE_HASH, Kernels::Portable, 1, HOST, settings, memory);
    let mut link = Sent::default();
    let hear = |node: &mut Node<'_, '_, All<'_>>, from, picture, message: Message| {
        node.handle(from, &View { picture, message, body: &vec![0; message.body_bytes()] });
    };
    let begin = Message::Begin(Toy::frame(16, 8, 1));
    let is_report = |sent: &(Peer, Message)| matches!(sent, (HOST, Message::Report { .. }));
    hear(&mut node, HOST, 0, begin);
    hear(&mut node, HOST, 0, Message::Tiles { first: 0, count: 2, epoch: 0 });
    node.step(&mut || 0);
    // What does not come from the host, or of another picture, ends nothing.
    [(2, 0), (HOST, 1)].iter().for_each(|&(from, picture)| hear(&mut node, from, picture, Message::End));
    assert_eq!(node.picture(), 0);
    hear(&mut node, HOST, 0, Message::End);
    assert_eq!(node.picture(), 1);
    assert!(!node.step(&mut || 0), "nothing is left to do");
    node.poll(&mut link, 1);
    assert!(link.taken.iter().any(is_report) && link.pictures.contains(&0), "{:?}", link.taken);
    assert!(!link.taken.iter().any(|sent| matches!(sent.1, Message::Contributions { .. })), "what it had is given up");
    // Between two pictures there is room for nothing.
    hear(&mut node, 2, 1, Message::Rays { rays: 1, shadows: 0, load: 0 });
    hear(&mut node, HOST, 0, begin);
    assert!(!node.step(&mut || 0));
    (link.taken, link.pictures) = (Vec::new(), Vec::new());
    node.poll(&mut link, 2);
    assert_eq!(link.taken, [(2, Message::Took { taken: false, load: 0 }), (HOST, Message::Idle { given: true })]);
    hear(&mut node, HOST, 1, begin);
    node.poll(&mut link, 3);
    assert!(matches!(link.taken.last(), Some((HOST, Message::Hello { .. }))), "{:?}", link.taken);
    link.taken.clear();
    hear(&mut node, from, picture, message);
    for now in 4..8 {
        node.step(&mut || 0);
        node.poll(&mut link, now);
    }
    assert!(link.pictures.iter().all(|&picture| picture == 1), "{:?}", link.pictures);
    link.taken
}

#[test]
fn what_is_of_another_picture_is_not_heard() {
    let all = [
        (2, Message::Rays { rays: 9, shadows: 0, load: 0 }),
        (2, Message::Rays { rays: 0, shadows: 0, load: 0 }),
        (HOST, Message::Share { with: 2 }),
        (HOST, Message::Tiles { first: 0, count: 2, epoch: 0 }),
        (HOST, Message::Finished { tile: u32::MAX }),
    ];
    for (from, message) in all {
        for picture in [0, 2, u16::MAX] {
            assert_eq!(said_later(from, picture, message), [], "{message:?} of picture {picture}");
        }
        assert_ne!(said_later(from, 1, message), [], "{message:?}");
    }
}
