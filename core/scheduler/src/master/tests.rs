//! What the farm's tests (`tests/farm`) would show only by chance.

use super::*;
extern crate std;
use crate::film::TileState;
use hybray_link::Event;
use hybray_wire::decode;
use std::vec;
use std::vec::Vec;

/// Keeps what is sent.
struct Wire(Vec<(Peer, Message)>);

impl Link for Wire {
    fn me(&self) -> Peer {
        HOST
    }
    fn peers(&self) -> Peer {
        4
    }
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
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
};

fn say(master: &mut Master<'_>, from: Peer, message: Message) {
    master.handle(from, &View { message, body: &[] });
}

fn report(master: &mut Master<'_>, from: Peer) {
    say(master, from, Message::Report { counts: Counts::default(), tiles: 0, runs: 0, busy_nanoseconds: 0 });
}

/// What the dispatcher, at node 1, is asked for again.
fn asked(master: &mut Master<'_>) -> Vec<(u32, u16)> {
    let mut wire = Wire(Vec::new());
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
