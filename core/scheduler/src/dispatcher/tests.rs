//! What the farm's tests (`tests/farm`) would show only by chance, one decision at a time.

use super::*;
extern crate std;
use hybray_link::Event;
use hybray_wire::{Frame, decode};
use std::vec;
use std::vec::Vec;

/// Keeps what is sent: to whom, first tile, count, epoch. Has room for `room` more frames.
struct Wire {
    sent: Vec<(Peer, u32, u32, u16)>,
    told: Vec<Peer>,
    room: usize,
    /// Who was told to share, and with whom.
    shared: Vec<(Peer, Peer)>,
}

impl Wire {
    fn new() -> Self {
        Self { sent: Vec::new(), told: Vec::new(), room: usize::MAX, shared: Vec::new() }
    }

    fn take(&mut self) -> Vec<(Peer, u32, u32, u16)> {
        core::mem::take(&mut self.sent)
    }
}

impl Link for Wire {
    fn me(&self) -> Peer {
        HOST
    }
    fn peers(&self) -> Peer {
        4
    }
    fn send(&mut self, to: Peer, bytes_max: usize, write: &mut dyn FnMut(&mut [u8]) -> usize) -> bool {
        if self.room == 0 {
            return false;
        }
        self.room -= 1;
        let mut bytes = vec![0; bytes_max];
        let used = write(&mut bytes);
        match decode(&bytes[..used]).unwrap().message {
            Message::Tiles { first, count, epoch } => self.sent.push((to, first, count, epoch)),
            Message::Finished { .. } => self.told.push(to),
            Message::Share { with } => {
                // Room is counted for runs.
                self.room += 1;
                self.shared.push((to, with));
            }
            other => panic!("a dispatcher does not say {other:?}"),
        }
        true
    }
    fn receive(&mut self, _: &mut dyn FnMut(Event<'_>)) -> bool {
        false
    }
    fn wait(&mut self, _: u64) {}
}

const FIXED: Options = Options { spread: Some(1.0), atomic: Some(4), tiles: Tiles::Dynamic, take_over: true };
const HELLO: Message = Message::Hello { version: 1, scene: 1 };

/// A picture of `tiles` tiles in one row.
fn begin(tiles: u32) -> Message {
    Message::Begin(Frame {
        width: 8 * tiles,
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
    })
}

/// A dispatcher of `nodes` nodes that have all said hello.
fn dispatcher(states: &mut [NodeState], tiles: u32, options: Options) -> Dispatcher<'_> {
    let nodes = states.len() as Peer;
    let mut d = Dispatcher::new(states, options);
    d.handle(HOST, &begin(tiles).into(), 0);
    (1..nodes).for_each(|node| d.handle(node, &HELLO.into(), 0));
    d
}

fn states(nodes: usize) -> Vec<NodeState> {
    vec![NodeState::default(); nodes + 1]
}

fn done(d: &mut Dispatcher<'_>, node: Peer, nanoseconds: u64, now: u64) {
    let run = *d.nodes[usize::from(node)].runs.front().unwrap();
    d.handle(node, &Message::Done { first: run.first, count: run.count, nanoseconds }.into(), now);
}

#[test]
fn tiles_that_are_kept_are_not_given_out() {
    let (mut states, mut bits, mut wire) = (states(1), [u64::MAX; 2], Wire::new());
    let mut d = Dispatcher::new(&mut states, FIXED).keeping(&mut bits);
    let keep = |first, count| Message::Kept { first, count };
    // Nobody but the host knows, and what lies beyond the bits is not remembered.
    d.handle(1, &keep(0, 100).into(), 0);
    [keep(0, 2), keep(10, 1), keep(60, 10), keep(126, u32::MAX), keep(u32::MAX, 1)].iter().for_each(|message| {
        d.handle(HOST, &(*message).into(), 0);
    });
    d.handle(HOST, &begin(130).into(), 0);
    d.handle(HOST, &keep(30, 10).into(), 0);
    d.handle(1, &HELLO.into(), 0);
    assert_eq!(d.left(), 130 - 2 - 1 - 10 - 2);
    // A run that there was no room for comes back, and is sent later.
    let mut given = Vec::new();
    let mut round = 0;
    while !d.is_idle() {
        round += 1;
        assert!(round < 200, "it does not end");
        wire.room = round % 2;
        d.poll(&mut wire, 0);
        for (_, first, count, _) in wire.take() {
            given.extend(first..first + count);
        }
        if round % 5 == 0 {
            done(&mut d, 1, 1, 1);
        }
    }
    let missing = [2..10, 11..60, 70..126, 128..130].into_iter().flatten();
    assert_eq!(given, missing.collect::<Vec<u32>>());
}

#[test]
fn where_every_tile_is_kept_nodes_hear_the_end_at_once() {
    let (mut states, mut bits, mut wire) = (states(2), [0; 1], Wire::new());
    let mut d = Dispatcher::new(&mut states, FIXED).biased(true).keeping(&mut bits);
    d.handle(HOST, &Message::Kept { first: 0, count: 9 }.into(), 0);
    d.handle(2, &HELLO.into(), 0);
    d.poll(&mut wire, 0);
    assert!(wire.told.is_empty(), "there is no picture yet");
    d.handle(HOST, &begin(9).into(), 0);
    d.poll(&mut wire, 0);
    d.handle(1, &HELLO.into(), 0);
    d.poll(&mut wire, 0);
    assert_eq!((wire.take(), wire.told), (vec![], vec![2, 1]));
}

#[test]
fn each_node_gets_one_run_before_any_gets_two() {
    let (mut states, mut wire) = (states(3), Wire::new());
    let mut d = dispatcher(&mut states, 16, FIXED);
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (2, 4, 4, 0), (3, 8, 4, 0)], "the last four are for who is through first");
    done(&mut d, 2, 10, 10);
    d.poll(&mut wire, 10);
    assert_eq!(wire.take(), [(2, 12, 4, 0)]);
    for node in [1, 2, 3] {
        assert!(!d.is_idle() && wire.told.is_empty());
        done(&mut d, node, 10, 20);
        d.poll(&mut wire, 20);
    }
    assert!(d.is_idle());
    assert_eq!(wire.told, [1, 2, 3]);
    d.poll(&mut wire, 21);
    assert_eq!(wire.told, [1, 2, 3], "once is enough");
}

#[test]
fn what_there_is_no_room_for_is_given_later_and_once() {
    for rooms in [[0, 1, 9], [1, 0, 9], [1, 1, 1], [2, 1, 9]] {
        let (mut states, mut wire) = (states(3), Wire::new());
        let mut d = dispatcher(&mut states, 64, FIXED);
        let mut seen = vec![0; 64];
        for round in 0..200 {
            wire.room = *rooms.get(round).unwrap_or(&(round % 3));
            d.poll(&mut wire, 0);
            for (node, first, count, epoch) in wire.take() {
                assert_eq!(epoch, 0);
                (first..first + count).for_each(|tile| seen[tile as usize] += 1);
                // Node 3 holds on to what it has until it is lost.
                if node != 3 {
                    done(&mut d, node, 1, 1);
                }
            }
        }
        let kept: u32 = d.nodes[3].in_hand();
        d.lost(3);
        for round in 0..200 {
            wire.room = round % 2;
            d.poll(&mut wire, 0);
            for (node, first, count, epoch) in wire.take() {
                assert_eq!(epoch, 1, "what was lost has a new epoch");
                (first..first + count).for_each(|tile| seen[tile as usize] += 1);
                done(&mut d, node, 1, 1);
            }
        }
        assert!(d.is_idle());
        assert_eq!(seen.iter().sum::<i32>() as u32, 64 + kept, "{rooms:?}");
        assert!(seen.iter().all(|&n| n == 1 || n == 2), "{rooms:?}: {seen:?}");
    }
}

#[test]
fn what_a_lost_node_had_is_shared_by_the_others() {
    let (mut states, mut wire) = (states(3), Wire::new());
    let mut d = dispatcher(&mut states, 96, Options { spread: Some(1.0), atomic: Some(24), ..Options::default() });
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 24, 0), (2, 24, 24, 0), (3, 48, 24, 0)]);
    d.lost(1);
    d.lost(1);
    d.options.atomic = Some(4);
    [2, 3].iter().for_each(|&node| done(&mut d, node, 24, 24));
    d.poll(&mut wire, 24);
    // Half to each, then half of what is left, and so on; a run that was lost twice is older still.
    assert_eq!(wire.take()[..2], [(2, 0, 12, 2), (3, 12, 6, 2)]);
    d.handle(1, &HELLO.into(), 30);
    d.poll(&mut wire, 30);
    assert!(wire.take().iter().all(|sent| sent.0 != 1), "who is lost does not come back");
}

fn again(d: &mut Dispatcher<'_>, tile: u32, epoch: u16) {
    d.handle(HOST, &Message::Again { tile, epoch }.into(), 0);
}

/// Runs that wait to be given out again: first, count, epoch.
fn waiting(d: &Dispatcher<'_>) -> Vec<(u32, u32, u16)> {
    d.again.iter().map(|run| (run.first, run.count, run.epoch)).collect()
}

#[test]
fn tiles_that_are_wanted_again_make_runs() {
    let mut states = states(1);
    let mut d = dispatcher(&mut states, 1000, FIXED);
    for (tile, epoch) in [(3, 1), (4, 1), (5, 1), (7, 1), (8, 2), (9, 2)] {
        again(&mut d, tile, epoch);
    }
    assert_eq!(waiting(&d), [(3, 3, 1), (7, 1, 1), (8, 2, 2)]);
    // Nobody but the host may ask, and for no tile that is not there.
    d.handle(1, &Message::Again { tile: 20, epoch: 1 }.into(), 0);
    again(&mut d, 1000, 1);
    again(&mut d, NO_MORE - 1, 1);
    assert_eq!(waiting(&d).len(), 3);
}

#[test]
fn more_holes_than_there_is_room_for_are_all_covered() {
    let mut states = states(1);
    let mut d = dispatcher(&mut states, 1000, FIXED);
    (0..500).for_each(|hole| again(&mut d, 2 * hole, 1 + (hole / 100) as u16));
    let runs = waiting(&d);
    assert_eq!(runs.len(), AGAIN_MAX);
    for hole in 0..500 {
        let covers = |&&(first, count, _): &&(u32, u32, u16)| (first..first + count).contains(&(2 * hole));
        let run = runs.iter().find(covers).unwrap();
        assert!(run.2 > (hole / 100) as u16, "an epoch that the film would drop");
    }
}

#[test]
fn nobody_is_told_the_end_while_the_host_asks_for_more() {
    let (mut states, mut wire) = (states(1), Wire::new());
    let mut d = dispatcher(&mut states, 4, FIXED);
    d.poll(&mut wire, 0);
    done(&mut d, 1, 1, 1);
    d.poll(&mut wire, 1);
    assert_eq!(core::mem::take(&mut wire.told), [1]);
    for tile in [0, 2] {
        again(&mut d, tile, 1);
        d.poll(&mut wire, 2);
        done(&mut d, 1, 1, 3);
        d.poll(&mut wire, 3);
        assert!(wire.told.is_empty() && !d.is_idle());
    }
    again(&mut d, NO_MORE, 0);
    d.poll(&mut wire, 4);
    assert_eq!(wire.told, [1]);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (1, 0, 1, 1), (1, 2, 1, 1)]);
}

/// The overhead is learned from a first run at time 0 too: a clock may start there.
#[test]
fn the_least_run_is_worth_its_messages() {
    // Tiles, cost of a tile, time of the messages: the least run.
    for (tiles, cost, overhead, expected) in [
        (3200, 1_000, 0, 1),
        (3200, 1_000, 1_000, 2),
        (3200, 1_000, 1_600, 3),
        (3200, 1_000, 5_000, 12), // 10, made of squares
        (3200, 1_000, 40_000, 80),
        (3200, 1_000, 900_000, 100), // 16 for each of two nodes
        (3200, 0, 1_000, 100),
        (16, 1_000, 900_000, 1),
    ] {
        let (mut states, mut wire) = (states(2), Wire::new());
        let mut d = dispatcher(&mut states, tiles, Options::default());
        assert_eq!(d.atomic(), 4.min(tiles / 32).max(1), "before anything is known");
        d.poll(&mut wire, 0);
        let time = u64::from(wire.sent[0].2) * cost;
        done(&mut d, 1, time, time + overhead);
        assert_eq!(d.atomic(), expected, "{tiles} tiles of {cost} ns, messages of {overhead} ns");
    }
    let mut states = states(2);
    assert_eq!(
        dispatcher(&mut states, 100, Options { atomic: Some(0), spread: None, ..Options::default() }).atomic(),
        1
    );
}

#[test]
fn the_spread_is_learned_within_bounds() {
    for (cheap, dear, expected) in [(100, 100, 2.5), (100, 400, 4.0), (100, 900_000, 16.0), (0, 100, 2.5)] {
        let (mut states, mut wire) = (states(2), Wire::new());
        let mut d = dispatcher(&mut states, 3200, Options { spread: None, atomic: Some(4), ..Options::default() });
        for cost in [cheap, cheap, dear, dear] {
            assert_eq!(d.spread(), 2.5, "less than two runs a node are too few to learn from");
            d.poll(&mut wire, 0);
            let count = d.nodes[1].runs.front().unwrap().count;
            done(&mut d, 1, cost * u64::from(count), 1);
        }
        assert_eq!(d.spread(), expected, "{cheap} to {dear}");
        d.options.spread = Some(1.5);
        assert_eq!(d.spread(), 1.5);
    }
}

/// A node whose rate is a tenth of the others' is left out at the end, unless nobody else is at work.
#[test]
fn the_last_tiles_are_not_for_a_slow_node() {
    let (mut states, mut wire) = (states(3), Wire::new());
    let mut d = dispatcher(&mut states, 64, Options { spread: Some(8.0), atomic: Some(4), ..Options::default() });
    d.poll(&mut wire, 0);
    [(1, 100), (2, 100), (3, 1_000)].iter().for_each(|&(node, cost)| done(&mut d, node, 4 * cost, 4_000));
    d.nodes[0].next = 56;
    d.nodes.iter_mut().for_each(|node| node.runs.clear());
    let crew = d.crew();
    assert!((crew.rate(&d.nodes[3]) / crew.rate(&d.nodes[1]) - 0.1).abs() < 1e-6);
    assert!(!d.ends_too_late(3, &crew, 1), "nobody else is at work");
    wire.take();
    d.poll(&mut wire, 4_000);
    assert_eq!(wire.take(), [(1, 56, 4, 0), (2, 60, 4, 0)]);

    d.nodes[0].next = 60;
    d.nodes[1].runs.clear();
    let crew = d.crew();
    assert!(d.ends_too_late(3, &crew, 1), "one tile takes it as long as ten take another");
    assert!(!d.ends_too_late(1, &crew, 4), "who is not slow and has nothing waits for nobody");
    assert!(!d.ends_too_late(2, &crew, 4), "who alone is at work does not wait for others");
}

#[test]
fn a_node_proves_itself_before_it_gets_much() {
    let (mut states, mut wire) = (states(2), Wire::new());
    let mut d = dispatcher(&mut states, 3200, FIXED);
    let mut counts = Vec::new();
    for round in 0..8 {
        d.poll(&mut wire, round);
        counts.extend(wire.take().iter().filter(|sent| sent.0 == 1).map(|sent| sent.2));
        done(&mut d, 1, 1_000, round);
    }
    // 4 and 4 at first; then no more than twice what it has done, and a short one behind each long one.
    assert_eq!(counts, [4, 4, 8, 4, 32, 4, 104, 4, 320]);
    // Alone, there is nobody to share with.
    let mut states = super::tests::states(1);
    let mut d = dispatcher(&mut states, 3200, FIXED);
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 3200, 0)]);
}

#[test]
fn only_the_host_begins_and_only_the_oldest_run_is_done() {
    let (mut states, mut wire) = (states(1), Wire::new());
    let mut d = dispatcher(&mut states, 64, Options { spread: Some(8.0), atomic: Some(4), ..Options::default() });
    d.handle(1, &begin(2).into(), 0);
    assert_eq!(d.tiles, 64);
    d.poll(&mut wire, 0);
    let before = d.nodes[1].runs.clone();
    for (from, first, count) in [(1, 1, 4), (1, 0, 3), (0, 0, 4), (9, 0, 4), (Peer::MAX, 0, 64), (1, u32::MAX, 0)] {
        d.handle(from, &Message::Done { first, count, nanoseconds: 1 }.into(), 1);
    }
    d.handle(77, &HELLO.into(), 0);
    d.lost(77);
    assert_eq!(d.nodes[1].runs, before);
}

/// Node 3 has nothing to do at the end: one of those who have is told to share, and not again before it is through.
#[test]
fn who_has_nothing_is_shared_with_once_at_a_time() {
    let mut nodes = vec![NodeState::default(); 4];
    let mut dispatcher = Dispatcher::new(&mut nodes, FIXED);
    let mut wire = Wire::new();
    dispatcher.handle(HOST, &begin(8).into(), 0);
    [1, 2, 3].into_iter().for_each(|peer| dispatcher.handle(peer, &HELLO.into(), 0));
    dispatcher.poll(&mut wire, 0);
    let with_runs: Vec<Peer> = wire.sent.iter().map(|run| run.0).collect();
    assert_eq!(with_runs, [1, 2]);
    assert_eq!(wire.shared, [(1, 3)]);
    dispatcher.poll(&mut wire, 1);
    assert_eq!(wire.shared.len(), 1);
    dispatcher.handle(3, &Message::Idle { given: true }.into(), 2);
    dispatcher.poll(&mut wire, 2);
    assert_eq!(wire.shared[1..], [(2, 3)]);
    // Who has no run any more may still have rays; but not who is being helped.
    dispatcher.handle(3, &Message::Idle { given: true }.into(), 3);
    for (peer, first, count, _) in wire.sent.clone() {
        dispatcher.handle(peer, &Message::Done { first, count, nanoseconds: 5 }.into(), 3);
    }
    dispatcher.poll(&mut wire, 4);
    assert_eq!(wire.shared[2..], [(3, 1), (3, 2)]);
    dispatcher.poll(&mut wire, 5);
    assert_eq!(wire.shared.len(), 4);
    assert_eq!(wire.told, [1, 2, 3]);
}

/// Two of the tiles that node 1 has not begun go to node 3, and the run ends so much shorter. What is not the end of a run
/// is passed over.
#[test]
fn what_is_not_begun_goes_to_who_has_nothing() {
    let mut nodes = vec![NodeState::default(); 4];
    let mut dispatcher = Dispatcher::new(&mut nodes, FIXED);
    let mut wire = Wire::new();
    dispatcher.handle(HOST, &begin(8).into(), 0);
    [1, 2, 3].into_iter().for_each(|peer| dispatcher.handle(peer, &HELLO.into(), 0));
    dispatcher.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (2, 4, 4, 0)]);
    assert_eq!(wire.shared, [(1, 3)]);
    for (from, first, count) in [(1, 2, 1), (1, 0, 5), (1, 4, 0), (1, 6, 2), (2, 2, 2), (3, 2, 2), (9, 2, 2)] {
        dispatcher.handle(from, &Message::Back { with: 3, first, count }.into(), 1);
        dispatcher.poll(&mut wire, 1);
        assert_eq!(wire.take(), [], "{from}: {first}, {count}");
    }
    dispatcher.handle(1, &Message::Back { with: 3, first: 2, count: 2 }.into(), 2);
    dispatcher.poll(&mut wire, 2);
    assert_eq!(wire.take(), [(3, 2, 2, 0)]);
    // Whoever is through with them can be helped again.
    dispatcher.handle(3, &Message::Done { first: 2, count: 2, nanoseconds: 5 }.into(), 3);
    dispatcher.poll(&mut wire, 3);
    assert_eq!((wire.shared.len(), wire.shared[1].1), (2, 3));
    for (peer, first, count) in [(1, 0, 4), (1, 0, 2), (2, 4, 4)] {
        assert!(!dispatcher.is_idle());
        dispatcher.handle(peer, &Message::Done { first, count, nanoseconds: 5 }.into(), 3);
    }
    assert!(dispatcher.is_idle());
}

/// Who had nothing to share is not told to again before it has ended a run, or a while has passed, longer each time.
#[test]
fn who_had_nothing_to_share_is_left_alone() {
    let mut nodes = vec![NodeState::default(); 3];
    let mut dispatcher = Dispatcher::new(&mut nodes, FIXED);
    let mut wire = Wire::new();
    dispatcher.handle(HOST, &begin(8).into(), 0);
    dispatcher.handle(1, &HELLO.into(), 0);
    dispatcher.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (1, 4, 4, 0)]);
    dispatcher.handle(2, &HELLO.into(), 0);
    dispatcher.poll(&mut wire, 0);
    assert_eq!(wire.shared, [(1, 2)]);
    dispatcher.handle(2, &Message::Idle { given: false }.into(), 1);
    dispatcher.poll(&mut wire, 1);
    assert_eq!(wire.shared, [(1, 2)]);
    let mut last = 1;
    for (times, wait) in [(2, 2 * WORD), (3, 4 * WORD), (4, 8 * WORD)] {
        dispatcher.poll(&mut wire, last + wait - 1);
        assert_eq!(wire.shared.len(), times - 1);
        last += wait;
        dispatcher.poll(&mut wire, last);
        assert_eq!(wire.shared.len(), times);
        dispatcher.handle(2, &Message::Idle { given: false }.into(), last);
    }
    wire.shared.clear();
    dispatcher.handle(1, &Message::Done { first: 0, count: 4, nanoseconds: 5 }.into(), last);
    dispatcher.poll(&mut wire, last);
    assert_eq!(wire.shared, [(1, 2)]);
}

/// Parts that are thought to be equal: each node has half of its own first; who gives tiles out has only its own.
#[test]
fn parts_are_given_out_by_halves() {
    let mut nodes = vec![NodeState::default(); 4];
    let mut dispatcher =
        Dispatcher::new(&mut nodes, Options { atomic: Some(1), ..FIXED }).on(1).with_parts(&[0, 4, 20, 32]);
    let mut wire = Wire::new();
    dispatcher.handle(HOST, &begin(32).into(), 0);
    [1, 2, 3].into_iter().for_each(|peer| dispatcher.handle(peer, &HELLO.into(), 0));
    dispatcher.poll(&mut wire, 0);
    let given = wire.take();
    assert_eq!(given[..3], [(1, 0, 2, 0), (2, 4, 8, 0), (3, 20, 8, 0)]);
    assert_eq!(given[3..], [(1, 2, 1, 0), (2, 12, 1, 0), (3, 28, 1, 0)]);
    // All that is left after its own last tile is others'.
    for (first, count) in [(0, 2), (2, 1), (3, 1)] {
        dispatcher.handle(1, &Message::Done { first, count, nanoseconds: 5 }.into(), 1);
        dispatcher.poll(&mut wire, 1);
    }
    assert_eq!(wire.take(), [(1, 3, 1, 0)]);
    assert!(dispatcher.left() > 0);
}

/// What comes back is known by its tiles: another run may have been sent there since.
#[test]
fn what_comes_back_may_be_of_the_run_before() {
    for (first, count, ends) in [(2, 2, &[(0, 2), (4, 4)][..]), (0, 4, &[(4, 4)])] {
        let mut nodes = vec![NodeState::default(); 3];
        let mut dispatcher = Dispatcher::new(&mut nodes, FIXED);
        let mut wire = Wire::new();
        dispatcher.handle(HOST, &begin(8).into(), 0);
        dispatcher.handle(1, &HELLO.into(), 0);
        dispatcher.poll(&mut wire, 0);
        assert_eq!(wire.take(), [(1, 0, 4, 0), (1, 4, 4, 0)]);
        dispatcher.handle(1, &Message::Back { with: 2, first, count }.into(), 1);
        dispatcher.handle(2, &HELLO.into(), 1);
        dispatcher.poll(&mut wire, 1);
        assert_eq!(wire.take()[0], (2, first, count, 0));
        dispatcher.handle(2, &Message::Done { first, count, nanoseconds: 5 }.into(), 2);
        for &(first, count) in ends {
            assert!(!dispatcher.is_idle());
            dispatcher.handle(1, &Message::Done { first, count, nanoseconds: 5 }.into(), 2);
        }
        assert!(dispatcher.is_idle());
    }
}

/// A tile of a node comes back to the film.
fn comes_back(d: &mut Dispatcher<'_>, node: Peer, tile: u32) {
    let message = Message::Contributions { tile, epoch: 0, width: 8, height: 8, rays: 1, entry: 1 };
    d.handle(node, &message.into(), 5);
}

#[test]
fn pixels_are_counted_and_words_are_not_heard() {
    let (mut states, mut wire) = (states(2), Wire::new());
    // 300 pixels are five tiles: runs of four, and one more where less than five have not come back.
    let tiles = Tiles::PixelCount { pixels: 300 };
    let mut d = dispatcher(&mut states, 64, Options { tiles, ..FIXED });
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 8, 0), (2, 8, 8, 0)]);
    let (first, second) = (Message::Done { first: 0, count: 8, nanoseconds: 1 }, [7, 1, 4]);
    d.handle(1, &first.into(), 1);
    d.poll(&mut wire, 1);
    assert_eq!(wire.take(), [], "a run that is done is no reason for another");
    second.into_iter().for_each(|tile| comes_back(&mut d, 1, tile));
    // The other's tiles, and none at all, are not this node's.
    [9, 63, u32::MAX].into_iter().for_each(|tile| comes_back(&mut d, 1, tile));
    d.poll(&mut wire, 2);
    assert_eq!(wire.take(), [], "five are still there");
    comes_back(&mut d, 1, 0);
    d.poll(&mut wire, 3);
    assert_eq!(wire.take(), [(1, 16, 4, 0)]);
    assert_eq!((d.nodes[1].in_hand(), d.nodes[2].in_hand()), (8, 8));
    // All of the second run come back before the last of the first.
    (16..20).for_each(|tile| comes_back(&mut d, 1, tile));
    d.handle(1, &Message::Done { first: 16, count: 4, nanoseconds: 1 }.into(), 4);
    assert_eq!((d.nodes[1].runs.len(), d.nodes[1].in_hand()), (1, 4));
    // Who is lost leaves everything that it had, under a new epoch.
    d.lost(1);
    d.poll(&mut wire, 5);
    assert_eq!(wire.take(), [], "the other has enough");
    (8..16).for_each(|tile| comes_back(&mut d, 2, tile));
    d.poll(&mut wire, 6);
    assert_eq!(wire.take()[0], (2, 0, 8, 1));
}

/// Frames that are lost hold nothing up for ever, whether tiles are left or the film asks again.
#[test]
fn tiles_that_never_come_back_are_given_up() {
    let (mut states, mut wire) = (states(2), Wire::new());
    let mut d = dispatcher(&mut states, 16, Options { tiles: Tiles::PixelCount { pixels: 1 }, ..FIXED });
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (2, 4, 4, 0)]);
    d.poll(&mut wire, 2 * SILENCE);
    assert_eq!(wire.take(), [], "who is at work is not silent");
    d.handle(1, &Message::Done { first: 0, count: 4, nanoseconds: 1 }.into(), SILENCE);
    d.poll(&mut wire, 2 * SILENCE);
    assert_eq!(wire.take(), []);
    d.poll(&mut wire, 2 * SILENCE + 1);
    assert_eq!(wire.take(), [(1, 8, 4, 0)]);
    (8..12).for_each(|tile| comes_back(&mut d, 1, tile));
    d.poll(&mut wire, 2 * SILENCE + 2);
    assert_eq!(wire.take(), [(1, 12, 4, 0)]);
    for (node, first) in [(1, 8), (1, 12), (2, 4)] {
        assert!(!d.is_idle());
        d.handle(node, &Message::Done { first, count: 4, nanoseconds: 1 }.into(), 2 * SILENCE + 3);
    }
    assert!(d.is_idle(), "all is done, though not all has come back");
    again(&mut d, 5, 1);
    again(&mut d, NO_MORE, 0);
    d.poll(&mut wire, 2 * SILENCE + 4);
    assert_eq!(wire.take(), [(1, 5, 1, 1)]);
}

#[test]
fn a_static_picture_is_divided_once() {
    let (mut states, mut wire) = (states(3), Wire::new());
    let mut d = Dispatcher::new(&mut states, Options { tiles: Tiles::Static, ..FIXED });
    d.handle(HOST, &begin(64).into(), 0);
    d.handle(2, &HELLO.into(), 0);
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(2, 20, 20, 0)]);
    done(&mut d, 2, 10, 10);
    // There is no room at first: nobody else may have what is given back.
    wire.room = 0;
    [1, 3].iter().for_each(|&node| d.handle(node, &HELLO.into(), 0));
    d.poll(&mut wire, 11);
    wire.room = 9;
    d.poll(&mut wire, 12);
    assert_eq!(wire.take(), [(1, 0, 20, 0), (3, 40, 24, 0)]);
    done(&mut d, 3, 10, 13);
    d.poll(&mut wire, 13);
    assert_eq!(wire.take(), [], "that is that");
    d.lost(1);
    d.poll(&mut wire, 14);
    assert_eq!(wire.take()[..2], [(2, 0, 10, 1), (3, 10, 5, 1)]);

    // Who is lost before it had its part had it to give all the same.
    let mut states = super::tests::states(2);
    let mut d = Dispatcher::new(&mut states, Options { tiles: Tiles::Static, ..FIXED });
    d.handle(HOST, &begin(16).into(), 0);
    d.lost(1);
    d.handle(2, &HELLO.into(), 0);
    d.poll(&mut wire, 0);
    let mut tiles: Vec<u32> = wire.take().iter().flat_map(|run| run.1..run.1 + run.2).collect();
    tiles.sort_unstable();
    assert_eq!(tiles, (0..16).collect::<Vec<_>>());
}

#[test]
fn who_is_barred_is_given_tiles_only_when_nobody_else_is_left() {
    for tiles in [Tiles::Dynamic, Tiles::Static, Tiles::PixelCount { pixels: 256 }] {
        for biased in [false, true] {
            let (mut states, mut wire) = (states(3), Wire::new());
            let mut d = Dispatcher::new(&mut states, Options { tiles, take_over: false, ..FIXED }).biased(biased);
            d = d.barring(&[false, true, false, true]);
            d.handle(HOST, &begin(32).into(), 0);
            [1, 2, 3].iter().for_each(|&node| d.handle(node, &HELLO.into(), 0));
            d.poll(&mut wire, 0);
            let runs = wire.take();
            assert!(!runs.is_empty() && runs.iter().all(|run| run.0 == 2), "{tiles:?}: {runs:?}");
            assert_eq!(runs.iter().map(|run| run.2).sum::<u32>(), 32, "alone it need not share: {tiles:?}");
            d.lost(2);
            d.poll(&mut wire, 1);
            let mut nodes: Vec<Peer> = wire.take().iter().map(|run| run.0).collect();
            nodes.dedup();
            assert_eq!(nodes[..2], [1, 3], "{tiles:?}");
            assert!(wire.shared.is_empty());
        }
    }
    // Nobody at all would be nobody's picture.
    let mut states = states(2);
    let d = Dispatcher::new(&mut states, FIXED).barring(&[false, true, true]);
    assert!(d.nodes.iter().all(|node| !node.barred));
}

#[test]
fn nobody_shares_if_that_is_off() {
    for take_over in [true, false] {
        let (mut states, mut wire) = (states(3), Wire::new());
        let mut d = dispatcher(&mut states, 8, Options { take_over, ..FIXED });
        d.poll(&mut wire, 0);
        assert_eq!(wire.shared.len(), usize::from(take_over));
    }
}

#[test]
fn each_picture_is_given_out_as_if_it_were_the_first() {
    let (mut states, mut bits, mut wire) = (states(3), [0; 1], Wire::new());
    let mut d = Dispatcher::new(&mut states, FIXED).keeping(&mut bits);
    let hear =
        |d: &mut Dispatcher<'_>, from, picture, message| d.handle(from, &View { picture, message, body: &[] }, 0);
    hear(&mut d, HOST, 0, Message::Kept { first: 0, count: 4 });
    hear(&mut d, HOST, 0, begin(12));
    (1..4).for_each(|node| hear(&mut d, node, 0, HELLO));
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 4, 4, 0), (2, 8, 4, 0)]);
    d.lost(2);
    // Only the host ends a picture, and only this one.
    [(1, 0), (HOST, 1)].iter().for_each(|&(from, picture)| hear(&mut d, from, picture, Message::End));
    assert_eq!(d.picture, 0);
    hear(&mut d, HOST, 0, Message::End);
    // What is late: a node that is here no more, runs that nobody has, tiles that are kept of another picture.
    let late = [HELLO, Message::Done { first: 4, count: 4, nanoseconds: 1 }, Message::Idle { given: false }];
    late.iter().for_each(|&message| hear(&mut d, 1, 0, message));
    hear(&mut d, HOST, 0, Message::Kept { first: 0, count: 12 });
    hear(&mut d, HOST, 1, Message::Kept { first: 8, count: 1 });
    hear(&mut d, HOST, 1, begin(12));
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [], "nobody has begun it");
    [1, 2, 3].iter().for_each(|&node| hear(&mut d, node, 1, HELLO));
    d.poll(&mut wire, 0);
    assert_eq!(wire.take(), [(1, 0, 4, 0), (3, 4, 4, 0), (1, 9, 3, 0)], "node 2 stays lost");
}
