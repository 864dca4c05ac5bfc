//! Times by hand, order, room and faults.

use hybray_link::{Event, Link, Peer};
use hybray_sim::{LinkModel, Network, NetworkModel, Topology};

/// 1,000 ns for a frame of 100 bytes, and 70 ns more until it is there.
const LINK: LinkModel = LinkModel { latency_ns: 70, bytes_per_second: 100_000_000 };
/// Half as fast, and 5 ns.
const HOST_LINK: LinkModel = LinkModel { latency_ns: 5, bytes_per_second: 50_000_000 };

fn network(topology: Topology, peers: Peer) -> Network {
    Network::new(&NetworkModel { topology, link: LINK, host_link: HOST_LINK, room_frames: 4 }, peers)
}

/// Puts a frame on the way at `now`, which may be still to come: nothing moves until then.
fn send(network: &mut Network, from: Peer, to: Peer, now: u64, bytes: usize, mark: u8) -> bool {
    network.send(from, to, now, bytes, &mut |room| {
        room.fill(mark);
        (bytes, now)
    })
}

/// Everything that arrives, until nothing moves: time, receiver, sender, length, mark.
fn arrivals(network: &mut Network) -> Vec<(u64, Peer, Peer, usize, u8)> {
    let mut all = Vec::new();
    while let Some(now) = network.next_event() {
        for me in 0..network.peers() {
            let mut end = network.end(me, now);
            while end.receive(&mut |event| {
                all.push(match event {
                    Event::Frame { from, bytes } => {
                        assert!(bytes.iter().all(|b| *b == bytes[0]));
                        (now, me, from, bytes.len(), bytes[0])
                    }
                    Event::Lost { peer } => (now, me, peer, 0, 0),
                });
            }) {}
        }
    }
    all
}

fn check(
    topology: Topology,
    peers: Peer,
    sent: &[(u64, Peer, Peer, usize, u8)],
    expected: &[(u64, Peer, Peer, usize, u8)],
) {
    let mut network = network(topology, peers);
    for &(now, from, to, bytes, mark) in sent {
        assert!(send(&mut network, from, to, now, bytes, mark));
    }
    assert_eq!(arrivals(&mut network), expected, "{topology:?}");
}

#[test]
fn a_crossbar_carries_pairs_side_by_side_and_one_receiver_in_turn() {
    // Up 1000 + 70, down 1000 + 70; the second frame to node 3 waits for the first on node 3's link.
    check(
        Topology::Crossbar,
        6,
        &[(0, 1, 3, 100, 1), (0, 4, 5, 100, 2), (10, 2, 3, 100, 3)],
        &[(2140, 3, 1, 100, 1), (2140, 5, 4, 100, 2), (3140, 3, 2, 100, 3)],
    );
}

#[test]
fn the_hosts_link_is_its_own() {
    // 2000 + 5 up, 1000 + 70 down; and the other way.
    check(Topology::Crossbar, 3, &[(0, 0, 2, 100, 1)], &[(3075, 2, 0, 100, 1)]);
    check(Topology::Crossbar, 3, &[(0, 2, 0, 100, 1)], &[(3075, 0, 2, 100, 1)]);
    check(Topology::Chain, 3, &[(0, 0, 2, 100, 1)], &[(3075, 2, 0, 100, 1)]);
    check(Topology::Mesh2d { columns: 2 }, 5, &[(0, 0, 4, 100, 1)], &[(4145, 4, 0, 100, 1)]);
}

#[test]
fn a_mesh_stores_and_forwards_and_frames_meet_where_routes_do() {
    // Nodes 1 2 3 above 4 5 6. 1 to 6 goes 1 2 3 6; 2 to 3 asks for the link from 2 to 3 at 1070 - 20, and has it for
    // 1000: the other waits from 1070 to 2050.
    check(
        Topology::Mesh2d { columns: 3 },
        7,
        &[(0, 1, 6, 100, 1), (1050, 2, 3, 100, 2)],
        &[(2120, 3, 2, 100, 2), (4190, 6, 1, 100, 1)],
    );
    // One nanosecond after it: it is the other way round.
    check(
        Topology::Mesh2d { columns: 3 },
        7,
        &[(0, 1, 6, 100, 1), (1071, 2, 3, 100, 2)],
        &[(3140, 3, 2, 100, 2), (3210, 6, 1, 100, 1)],
    );
}

#[test]
fn a_frame_that_asks_first_goes_first_whenever_it_was_sent() {
    // 1 sends to 4 first, but 3 asks for the link from 3 to 4 before that frame is there.
    check(
        Topology::Chain,
        5,
        &[(0, 1, 4, 100, 1), (500, 3, 4, 100, 2), (2000, 3, 4, 100, 3)],
        &[(1570, 4, 3, 100, 2), (3070, 4, 3, 100, 3), (4070, 4, 1, 100, 1)],
    );
}

#[test]
fn a_bus_carries_one_frame_at_a_time_and_oneself_is_near() {
    check(
        Topology::Bus,
        4,
        &[(0, 1, 2, 100, 1), (0, 3, 0, 50, 2), (3, 2, 2, 9, 3)],
        &[(3, 2, 2, 9, 3), (1070, 2, 1, 100, 1), (1570, 0, 3, 50, 2)],
    );
}

#[test]
fn room_is_for_each_pair_and_comes_back_when_a_frame_is_read() {
    let mut network = network(Topology::Crossbar, 4);
    let sent = (0..9).filter(|i| send(&mut network, 1, 2, 0, 10, *i)).count();
    assert_eq!((sent, network.unread(1, 2)), (4, 4));
    assert!(send(&mut network, 1, 3, 0, 10, 0) && send(&mut network, 3, 2, 0, 10, 0));
    assert!(!network.end(1, 0).send(2, 10, &mut |_| panic!("there is no room to write into")));
    network.advance(1_000_000);
    let mut news: Vec<_> = std::iter::from_fn(|| network.pop_news()).collect();
    news.sort_unstable();
    assert_eq!(news, [2, 2, 2, 2, 2, 3]);
    assert!(!send(&mut network, 1, 2, 1_000_000, 10, 0), "arrived is not read");
    let mut order = Vec::new();
    while network.end(2, 1_000_000).receive(&mut |event| {
        if let Event::Frame { from: 1, bytes } = event {
            order.push(bytes[0]);
        }
    }) {}
    assert_eq!(order, [0, 1, 2, 3]);
    assert_eq!(network.pop_news(), Some(1), "who was refused is told, once");
    assert_eq!(network.pop_news(), None);
    assert!(send(&mut network, 1, 2, 1_000_000, 10, 0));
    assert!(!send(&mut network, 1, 9, 1_000_000, 10, 0), "nobody");
}

#[test]
fn counters_add_up() {
    let mut network = network(Topology::Chain, 4);
    for i in 0..3 {
        send(&mut network, 1, 3, 0, 100, i);
    }
    send(&mut network, 1, 1, 0, 100, 9);
    assert_eq!(arrivals(&mut network).len(), 4);
    let (sent, received) = (network.traffic(1), network.traffic(3));
    assert_eq!((sent.sent_frames, sent.sent_bytes, sent.received_frames), (3, 300, 0));
    assert_eq!((received.received_frames, received.received_bytes, received.unread_most), (3, 300, 1));
    let used: Vec<_> = network.links().filter(|link| link.frames > 0).collect();
    assert_eq!(used.len(), 2);
    assert!(used.iter().all(|link| (link.frames, link.bytes, link.busy_ns) == (3, 300, 3000)));
    assert_eq!(used.iter().map(|link| link.waiting_most).collect::<Vec<_>>(), [2, 0]);
    assert_eq!(network.delivered(), 4);
}

/// Random traffic with delays: each pair's frames arrive whole, once and in order, and a second time alike.
#[test]
fn order_holds_under_delays_and_everything_repeats() {
    for topology in [Topology::Crossbar, Topology::Mesh2d { columns: 3 }, Topology::Chain, Topology::Bus] {
        let run = |seed: u64| {
            let mut network = network(topology, 9);
            network.delay(seed, 5_000);
            let mut state = seed;
            let mut random = |below: u64| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) % below
            };
            let mut next = [[0u8; 9]; 9];
            let mut expected = [[0u8; 9]; 9];
            let mut got = 0;
            for now in 0..3_000u64 {
                let (from, to) = (random(9) as Peer, random(9) as Peer);
                let bytes = 1 + random(60) as usize;
                let mark = &mut next[usize::from(from)][usize::from(to)];
                if send(&mut network, from, to, 300 * now, bytes, *mark) {
                    *mark = mark.wrapping_add(1);
                }
                let me = random(9) as Peer;
                while network.end(me, 300 * now).receive(&mut |event| {
                    let Event::Frame { from, bytes } = event else { panic!("{event:?}") };
                    let mark = &mut expected[usize::from(from)][usize::from(me)];
                    assert_eq!(bytes[0], *mark, "{topology:?}, seed {seed}: {from} to {me}");
                    *mark = mark.wrapping_add(1);
                    got += 1;
                }) {}
            }
            got += arrivals(&mut network).len();
            assert_eq!(network.delivered(), got as u64);
            assert!(got > 1000, "{topology:?}: {got}");
            network.log_hash()
        };
        assert_eq!(run(7), run(7));
        assert_ne!(run(7), run(8));
    }
}

#[test]
fn a_cut_pair_waits_and_others_do_not() {
    let mut network = network(Topology::Crossbar, 4);
    network.cut(1, 2, 0, 50_000);
    assert!(send(&mut network, 1, 2, 0, 100, 1) && send(&mut network, 2, 1, 10, 100, 2));
    assert!(send(&mut network, 1, 3, 10, 100, 3) && send(&mut network, 1, 2, 60_000, 100, 4));
    let expected = [(2150, 3, 1, 100, 3), (52_140, 1, 2, 100, 2), (52_140, 2, 1, 100, 1), (62_140, 2, 1, 100, 4)];
    assert_eq!(arrivals(&mut network), expected);
}

#[test]
fn the_lost_are_never_heard_of_again() {
    let mut network = network(Topology::Crossbar, 4);
    assert!(send(&mut network, 1, 2, 0, 100, 1) && send(&mut network, 1, 2, 9_000, 100, 2));
    assert!(send(&mut network, 3, 1, 9_000, 100, 3));
    network.lose(1, 9_500, 600);
    network.advance(9_499);
    assert!(!network.is_gone(1));
    network.advance(9_500);
    assert!(network.is_gone(1));
    assert!(!send(&mut network, 1, 3, 9_600, 1, 0));
    assert!(send(&mut network, 2, 1, 9_600, 1, 0), "who does not know yet still sends");
    let expected = [(9_600, 2, 1, 100, 1), (10_100, 0, 1, 0, 0), (10_100, 2, 1, 0, 0), (10_100, 3, 1, 0, 0)];
    assert_eq!(arrivals(&mut network), expected);
    assert!(!send(&mut network, 2, 1, 20_000, 1, 0));
    assert!(send(&mut network, 2, 3, 20_000, 1, 0));
}

#[test]
fn thousands_cost_little_until_they_talk() {
    let mut network = network(Topology::Mesh2d { columns: 64 }, 4097);
    for node in 1..=4096 {
        assert!(send(&mut network, 0, node, 0, 40, 1));
    }
    assert_eq!(arrivals_of(&mut network), 4096);
}

fn arrivals_of(network: &mut Network) -> u64 {
    network.advance(u64::MAX);
    network.delivered()
}
