//! What the farm's tests (`tests/farm`) would show only by chance.

use super::*;
extern crate std;
use crate::film::TileState;
use hybray_link::Event;
use hybray_wire::decode;
use std::vec;
use std::vec::Vec;

/// Keeps what is sent, and has room for so much.
struct Wire(Vec<(Peer, Message)>, usize);

impl Link for Wire {
    fn me(&self) -> Peer {
        HOST
    }
    fn peers(&self) -> Peer {
        4
    }
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        if self.0.len() == self.1 {
            return false;
        }
        let mut bytes = vec![0; bytes_max];
        let used = write(&mut bytes);
        self.0.push((to, decode(&bytes[..used]).unwrap().message));
        true
    }
    fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
        false
    }
    fn wait(&mut self, _: u64) {}
}

/// A picture of two tiles.
const FRAME: Frame = Frame {
    width: 16,
    height: 8,
    samples: 1,
    depth_max: 1,
    filter: 0,
    seed: 0,
    weight_cutoff: 0.0,
    step_log2: 0,
    eye: [0.0; 3],
    target: [0.0; 3],
    up: [0.0; 3],
    fov_y_degrees: 1.0,
    hither: 0.0,
    layer: 0,
    half: 0,
    optics: hybray_wire::Optics::PINHOLE,
};

fn say(master: &mut Master<'_>, from: Peer, message: Message) {
    master.handle(from, &message.into());
}

fn report(master: &mut Master<'_>, from: Peer) {
    say(master, from, Message::Report { counts: Counts::default(), tiles: 0, runs: 0, busy_nanoseconds: 0 });
}

/// What the dispatcher, at node 1, is asked for again.
fn asked(master: &mut Master<'_>) -> Vec<(u32, u16)> {
    let mut wire = Wire(Vec::new(), usize::MAX);
    master.poll(&mut wire);
    let again = |(to, message): &(Peer, Message)| match message {
        Message::Again { tile, epoch } => {
            assert_eq!(*to, 1);
            Some((*tile, *epoch))
        }
        _ => None,
    };
    wire.0.iter().filter_map(again).collect()
}

fn with_master(test: impl FnOnce(&mut Master<'_>)) {
    let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
    let mut nodes = vec![NodeReport::default(); 4];
    let film = Film::new(&FRAME, &mut sums, &mut tiles).unwrap();
    let mut master = Master::new(FRAME, film, &mut nodes, 9, 1);
    (1..4).for_each(|node| say(&mut master, node, Message::Hello { version: VERSION, scene: 9 }));
    assert!(asked(&mut master).is_empty());
    test(&mut master);
}

#[test]
fn the_dispatcher_hears_what_is_there_before_it_hears_of_the_picture() {
    // Tiles 1, 2 and 5 of seven.
    let frame = Frame { width: 56, ..FRAME };
    let expected: Vec<_> = [Message::Kept { first: 1, count: 2 }, Message::Kept { first: 5, count: 1 }].into();
    for (dispatcher, room) in [HOST, 1].into_iter().flat_map(|peer| (1..8).map(move |room| (peer, room))) {
        let (mut sums, mut tiles) = ([[0; 3]; 448], [TileState::default(); 7]);
        let mut nodes = vec![NodeReport::default(); 3];
        let film = Film::new(&frame, &mut sums, &mut tiles).unwrap();
        let mut master = Master::new(frame, film, &mut nodes, 9, dispatcher);
        for tile in [1, 2, 5] {
            master.film_mut().keep(tile, &[1; 64 * 24]).unwrap();
        }
        let mut wire = Wire(Vec::new(), 0);
        for _ in 0..8 {
            wire.1 += room;
            master.poll(&mut wire);
        }
        let begin = |peer| (peer, Message::Begin(frame));
        let kept: Vec<_> = expected.iter().map(|&message| (dispatcher, message)).collect();
        let mut all = vec![begin(1), begin(2), begin(HOST)];
        let at = all.iter().position(|&(peer, _)| peer == dispatcher).unwrap();
        all.splice(at..at, kept);
        assert_eq!(wire.0, all, "the dispatcher is {dispatcher}, room for {room}");
    }
}

const ALL: [(u32, u16); 3] = [(0, 1), (1, 1), (NO_MORE, 1)];

#[test]
fn what_is_missing_is_asked_for_once_and_then_named() {
    with_master(|master| {
        [1, 2].iter().for_each(|&node| report(master, node));
        assert!(asked(master).is_empty(), "node 3 may have sent something");
        report(master, 3);
        assert_eq!(asked(master), ALL);
        [3, 1].iter().for_each(|&node| report(master, node));
        assert_eq!((asked(master), master.outcome()), (vec![], None));
        report(master, 2);
        assert!(asked(master).is_empty());
        assert_eq!(master.outcome(), Some(Outcome::Unbalanced { tile: 0 }));
    });
}

#[test]
fn what_a_second_lost_node_took_with_it_is_no_fault() {
    with_master(|master| {
        [1, 3].iter().for_each(|&node| report(master, node));
        master.lost(2);
        assert_eq!(asked(master), ALL);
        report(master, 1);
        master.lost(3);
        assert_eq!(asked(master), ALL);
        report(master, 1);
        asked(master);
        assert_eq!(master.outcome(), Some(Outcome::Unbalanced { tile: 0 }));
    });
}

#[test]
fn the_first_outcome_stays() {
    with_master(|master| {
        master.stop();
        say(master, 2, Message::Hello { version: VERSION, scene: 8 });
        master.lost(1);
        assert_eq!(master.outcome(), None, "nobody has been told");
        asked(master);
        report(master, 3);
        assert_eq!(master.outcome(), None, "node 2 still has to say what it did");
        report(master, 2);
        assert_eq!(master.outcome(), Some(Outcome::Stopped));
    });
    with_master(|master| {
        say(master, 2, Message::Hello { version: VERSION, scene: 8 });
        master.stop();
        asked(master);
        assert_eq!(master.outcome(), Some(Outcome::Stranger { peer: 2 }));
    });
}

/// The first of two pictures ends for a node when it has reported twice, and who was lost in it is lost in the second.
#[test]
fn another_picture_follows_when_all_have_ended_the_one_before() {
    let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
    let mut nodes = vec![NodeReport::default(); 4];
    let mut film = Film::new(&FRAME, &mut sums, &mut tiles).unwrap();
    [0, 1].iter().for_each(|&tile| film.keep(tile, &[1; 64 * 24]).unwrap());
    let mut master = Master::of_run(0, false, FRAME, film, &mut nodes, 9, HOST);
    let hello = Message::Hello { version: VERSION, scene: 9 };
    // Node 2 says nothing for long: the last picture would not wait for it.
    [1, 3].iter().for_each(|&node| say(&mut master, node, hello));
    [1, 3].iter().for_each(|&node| report(&mut master, node));
    assert_eq!((master.outcome(), master.stopping), (None, None));
    say(&mut master, 2, hello);
    report(&mut master, 2);
    let mut wire = Wire(Vec::new(), usize::MAX);
    master.poll(&mut wire);
    let ends: Vec<_> = wire.0.iter().filter(|sent| sent.1 == Message::End).map(|sent| sent.0).collect();
    assert_eq!(ends, [1, 2, 3]);
    assert!(!wire.0.iter().any(|sent| sent.1 == Message::Stop));
    [1, 2].iter().for_each(|&node| report(&mut master, node));
    assert_eq!(master.outcome(), None, "node 3 may still be at it");
    master.lost(3);
    assert_eq!(master.outcome(), Some(Outcome::Finished));

    let nodes = master.release();
    let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
    let film = Film::new(&FRAME, &mut sums, &mut tiles).unwrap();
    let mut master = Master::of_run(1, true, FRAME, film, nodes, 9, HOST);
    let mut wire = Wire(Vec::new(), usize::MAX);
    master.poll(&mut wire);
    assert_eq!(wire.0.iter().map(|sent| sent.0).collect::<Vec<_>>(), [1, 2, HOST]);
    // A tile of the picture before is none of this one, nor is a report; and neither is an error.
    let contributions = Message::Contributions { tile: 0, epoch: 0, width: 8, height: 8, rays: 1, entry: 1 };
    for (picture, opened) in [(0, false), (2, false), (1, true)] {
        let counts = Counts { primary: 7, ..Counts::default() };
        let told = Message::Report { counts, tiles: 0, runs: 0, busy_nanoseconds: 0 };
        master.handle(1, &View { picture, message: contributions, body: &[1; 64 * 24] });
        master.handle(1, &View { picture, message: told, body: &[] });
        assert_eq!(master.film().sums()[0] != [0; 3], opened, "{picture}");
        assert_eq!(master.reports()[1].counts.primary == 7, opened, "{picture}");
    }
    assert_eq!(master.refused_frames(), 0);
}

/// A run whose dispatcher, or last node, is lost with the last tile of a picture has no more pictures.
#[test]
fn nobody_is_left_for_another_picture() {
    for (dispatcher, lost) in [(HOST, &[1, 2][..]), (1, &[1])] {
        let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
        let mut nodes = vec![NodeReport::default(); 3];
        let film = Film::new(&FRAME, &mut sums, &mut tiles).unwrap();
        let mut master = Master::of_run(0, false, FRAME, film, &mut nodes, 9, dispatcher);
        lost.iter().for_each(|&node| master.lost(node));
        let nodes = master.release();
        let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
        let film = Film::new(&FRAME, &mut sums, &mut tiles).unwrap();
        let mut master = Master::of_run(1, false, FRAME, film, nodes, 9, dispatcher);
        master.poll(&mut Wire(Vec::new(), usize::MAX));
        assert_eq!(master.outcome(), Some(Outcome::Abandoned));
    }
}
