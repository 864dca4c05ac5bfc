//! What goes wrong in a farm: nodes lost, frames lost or doubled, strangers, nonsense, and people who stop.

use crate::common::Rng;
use crate::net::Lie;
use crate::pictures::{Picture, toys, void};
use crate::toy::{SCENE_HASH, Toy};
use crate::world::{Plan, Report, play};
use crate::{any_plan, each_seed, same_picture};
use hybray_link::{HOST, Peer};
use hybray_scheduler::Outcome;
use hybray_wire::{MESSAGE_BYTES_MAX, Message, TileMap, VERSION, encode};
use std::cell::Cell;
use std::collections::BTreeMap;

fn honest(_: Peer, _: Peer, _: &Message) -> Lie {
    Lie::No
}

/// A picture with several tiles, and a farm of at least `nodes`.
fn plan(rng: &mut Rng, nodes: usize) -> (&'static Picture, Plan<'static>) {
    let picture = &toys()[rng.between(1, 4) as usize];
    let mut plan = any_plan(rng, picture);
    while plan.speeds.len() < nodes {
        plan.speeds.push(plan.speeds[0]);
    }
    (picture, plan)
}

fn expect(outcome: Outcome, report: &Report) -> Result<(), String> {
    if report.outcome == outcome { Ok(()) } else { Err(format!("{:?} instead of {outcome:?}", report.outcome)) }
}

/// However it ended: a tile that is finished is right.
fn finished_tiles_are_right(picture: &Picture, report: &Report) -> Result<(), String> {
    let wrong = (0..picture.map.len()).find(|&tile| {
        report.finished[tile as usize] && picture.tile(&report.sums, tile) != picture.tile(&picture.sums, tile)
    });
    wrong.map_or(Ok(()), |tile| Err(format!("tile {tile} is finished and wrong")))
}

#[test]
fn nodes_that_are_lost_take_nothing_with_them() {
    each_seed(200, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 2);
        let mut mortal: Vec<Peer> = (1..=plan.speeds.len() as Peer).filter(|&node| node != plan.dispatcher).collect();
        rng.shuffle(&mut mortal);
        let left = u64::from(plan.dispatcher == HOST);
        mortal.truncate(rng.between(1, mortal.len() as u64 - left) as usize);
        plan.deaths = mortal.into_iter().map(|node| (rng.below(u64::from(picture.map.len())) as u32, node)).collect();
        let report = play(&plan, &mut honest)?;
        same_picture(picture, &report)
    });
}

/// Two losses that are both noticed by the film alone: the runs were told as done, and their sums never came.
#[test]
fn a_second_loss_is_no_second_fault() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 4);
        let tiles = picture.map.len();
        plan.dispatcher = 1;
        plan.manner.far_host = true;
        plan.manner.delay_max = 50_000_000;
        plan.deaths = (2..=plan.speeds.len() as Peer)
            .map(|node| (rng.between(0, 3).min(u64::from(tiles - 1)) as u32, node))
            .collect();
        same_picture(picture, &play(&plan, &mut honest)?)
    });
}

#[test]
fn without_nodes_a_picture_is_abandoned() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 1);
        let last = u64::from(picture.map.len()) / 2;
        plan.deaths = (1..=plan.speeds.len() as Peer).map(|node| (rng.below(last) as u32, node)).collect();
        let report = play(&plan, &mut honest)?;
        finished_tiles_are_right(picture, &report)?;
        // What was on its way may have been all that was missing.
        let whole = report.finished.iter().all(|&f| f);
        expect(if whole { Outcome::Finished } else { Outcome::Abandoned }, &report)
    });
}

#[test]
fn a_lost_dispatcher_ends_the_picture() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 1);
        plan.dispatcher = 1;
        plan.deaths = vec![(rng.below(u64::from(picture.map.len())) as u32, 1)];
        let report = play(&plan, &mut honest)?;
        finished_tiles_are_right(picture, &report)?;
        let whole = report.finished.iter().all(|&f| f);
        expect(if whole { Outcome::Finished } else { Outcome::Abandoned }, &report)
    });
}

/// Drops the first `times[tile]` contributions of each tile.
fn dropper(mut times: BTreeMap<u32, u32>) -> impl FnMut(Peer, Peer, &Message) -> Lie {
    move |_, _, message| match message {
        Message::Contributions { tile, .. } => match times.get_mut(tile) {
            Some(left) if *left > 0 => {
                *left -= 1;
                Lie::Drop
            }
            _ => Lie::No,
        },
        _ => Lie::No,
    }
}

#[test]
fn a_lost_contribution_is_traced_again_once() {
    each_seed(120, |seed| {
        let mut rng = Rng(seed);
        let (picture, plan) = plan(&mut rng, 1);
        let tiles = u64::from(picture.map.len());
        let dropped: BTreeMap<u32, u32> = (0..rng.between(1, tiles)).map(|_| (rng.below(tiles) as u32, 1)).collect();
        let report = play(&plan, &mut dropper(dropped.clone()))?;
        same_picture(picture, &report)?;
        let epochs = (0..tiles as u32).map(|tile| u16::from(dropped.contains_key(&tile)));
        if epochs.eq(report.epochs.iter().copied()) { Ok(()) } else { Err(format!("epochs {:?}", report.epochs)) }
    });
}

#[test]
fn a_contribution_that_is_lost_twice_is_named() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, plan) = plan(&mut rng, 1);
        let tiles = u64::from(picture.map.len());
        let dropped: BTreeMap<u32, u32> =
            (0..rng.between(1, 5)).map(|_| (rng.below(tiles) as u32, rng.between(1, 2) as u32)).collect();
        let report = play(&plan, &mut dropper(dropped.clone()))?;
        finished_tiles_are_right(picture, &report)?;
        match dropped.iter().find(|(_, times)| **times == 2) {
            Some((&tile, _)) => expect(Outcome::Unbalanced { tile }, &report),
            None => same_picture(picture, &report),
        }
    });
}

#[test]
fn a_doubled_contribution_adds_nothing() {
    each_seed(40, |seed| {
        let mut rng = Rng(seed);
        let (picture, plan) = plan(&mut rng, 1);
        let report = play(&plan, &mut |_, _, message| match message {
            Message::Contributions { .. } if rng.below(3) == 0 => Lie::Double,
            _ => Lie::No,
        })?;
        same_picture(picture, &report)
    });
}

/// More holes than a dispatcher can keep, far apart, told through a link with room for one frame.
#[test]
fn hundreds_of_scattered_holes_are_filled() {
    for (room, every) in [(1, 2), (64, 2), (1, 3), (3, 7)] {
        for dispatcher in [HOST, 1] {
            let mut rng = Rng(room as u64);
            let (_, mut plan) = plan(&mut rng, 5);
            plan.frame = Toy::frame(320, 240, 1);
            plan.scene = void();
            let costs = vec![64; TileMap::new(320, 240).unwrap().len() as usize];
            plan.costs = &costs;
            plan.dispatcher = dispatcher;
            plan.manner.room = room;
            plan.manner.delay_max = 1_000_000;
            let dropped = (0..costs.len() as u32).filter(|tile| tile % every == 0).map(|tile| (tile, 1)).collect();
            let report = play(&plan, &mut dropper(dropped)).unwrap();
            assert_eq!(report.outcome, Outcome::Finished, "room {room}, every {every}th, dispatcher {dispatcher}");
        }
    }
}

/// A node's first words may reach the host after all others have said their last.
#[test]
fn a_node_that_the_host_has_not_heard_of_is_waited_for() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 2);
        plan.dispatcher = 1;
        plan.manner.delay_max = 1_000;
        plan.manner.held_up = Some((2, 500_000_000));
        let report = play(&plan, &mut honest)?;
        same_picture(picture, &report)?;
        let traced: u32 = report.nodes.iter().map(|node| node.tiles).sum();
        // If it was not needed, it need not report.
        if traced > picture.map.len() { Err(format!("{traced} tiles traced")) } else { Ok(()) }
    });
}

#[test]
fn a_stranger_ends_the_picture() {
    each_seed(40, |seed| {
        let mut rng = Rng(seed);
        let (_, mut plan) = plan(&mut rng, 1);
        let peer = rng.between(1, plan.speeds.len() as u64) as Peer;
        if rng.below(2) == 0 {
            plan.stranger = Some(peer);
        } else {
            plan.injected = vec![(0, peer, HOST, frame(&Message::Hello { version: VERSION + 1, scene: SCENE_HASH }))];
        }
        let report = play(&plan, &mut honest)?;
        // A picture may be done before the stranger's first word is there.
        if report.outcome == Outcome::Finished && plan.manner.delay_max > 0 {
            return Ok(());
        }
        expect(Outcome::Stranger { peer }, &report)
    });
}

#[test]
fn what_is_finished_stays_when_somebody_stops() {
    each_seed(60, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 1);
        let tiles = rng.below(u64::from(picture.map.len())) as u32;
        plan.stop_after = Some(tiles);
        let report = play(&plan, &mut honest)?;
        finished_tiles_are_right(picture, &report)?;
        // Nobody stops what has come to its end.
        let whole = report.outcome == Outcome::Finished && report.finished.iter().all(|&f| f);
        expect(if whole { Outcome::Finished } else { Outcome::Stopped }, &report)?;
        let finished = report.finished.iter().filter(|&&f| f).count() as u32;
        if finished >= tiles { Ok(()) } else { Err(format!("{finished} tiles of {tiles}")) }
    });
}

fn frame(message: &Message) -> Vec<u8> {
    let mut room = [0; MESSAGE_BYTES_MAX];
    let used = encode(0, message, &mut room, |body| body.fill(3)).unwrap();
    room[..used].to_vec()
}

/// Bytes that are no message are refused; messages that make no sense are too, or are not heard.
#[test]
fn nonsense_changes_nothing() {
    let refused = Cell::new(0);
    each_seed(120, |seed| {
        let mut rng = Rng(seed);
        let (picture, mut plan) = plan(&mut rng, 2);
        let peers = plan.speeds.len() as u64;
        let tiles = picture.map.len();
        let mut refusals = 0;
        for _ in 0..30 {
            let node = rng.between(1, peers) as Peer;
            let large = rng.pick(&[tiles, tiles + 1, u32::MAX - 1, u32::MAX]);
            let to_host = [
                Message::Contributions { tile: large, epoch: 0, width: 8, height: 8, rays: 0, entry: 5 },
                Message::Contributions { tile: 0, epoch: 9, width: 1, height: 8, rays: 0, entry: 5 },
            ];
            let to_dispatcher = [
                Message::Done { first: large, count: 1, nanoseconds: 0 },
                Message::Done { first: 0, count: 0, nanoseconds: u64::MAX },
                Message::Again { tile: large, epoch: 3 },
                Message::Again { tile: 0, epoch: u16::MAX },
                Message::Begin(Toy::frame(800, 600, 1)),
            ];
            let to_node = [
                Message::Tiles { first: large, count: 1, epoch: 0 },
                Message::Tiles { first: 0, count: 0, epoch: 0 },
                Message::Tiles { first: 1, count: u32::MAX, epoch: 0 },
                Message::Finished { tile: 0 },
            ];
            let noise: Vec<u8> = std::iter::once(200).chain((0..rng.below(90)).map(|_| rng.next() as u8)).collect();
            let other = rng.between(0, peers) as Peer;
            let (from, to, bytes) = match rng.below(5) {
                0 => (node, HOST, frame(&rng.pick(&to_host))),
                // A node is believed what it says to its own dispatcher of others' work: it is not there.
                1 if node != plan.dispatcher => (node, plan.dispatcher, frame(&rng.pick(&to_dispatcher))),
                2 => (other, node, frame(&rng.pick(&to_node))),
                3 => (node, HOST, noise),
                _ => (other, node, noise),
            };
            refusals += u64::from(to == HOST && (bytes[0] == 200 || bytes.len() > 40));
            if let Ok(Message::Begin(_)) = hybray_wire::decode(&bytes).map(|view| view.message)
                && to != HOST
            {
                // A node takes a picture from whoever sends it: it cannot tell.
                continue;
            }
            plan.injected.push((rng.below(u64::from(tiles)) as u32, from, to, bytes));
        }
        let report = play(&plan, &mut honest)?;
        same_picture(picture, &report)?;
        // What comes after the end is not even refused.
        refused.set(refused.get() + report.refused_frames);
        if report.refused_frames > refusals {
            return Err(format!("{} of {refusals} refused", report.refused_frames));
        }
        Ok(())
    });
    assert!(refused.get() > 0);
}
