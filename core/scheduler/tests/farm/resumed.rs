//! A picture that ended early and goes on: on another farm, and more than once.

use crate::common::Rng;
use crate::net::Lie;
use crate::pictures::{Picture, toys};
use crate::world::{Report, play};
use crate::{any_plan, each_seed, same_picture};
use hybray_link::Peer;
use hybray_scheduler::Outcome;
use hybray_wire::Message;

/// The finished tiles of a film, as bytes.
fn kept(picture: &Picture, report: &Report) -> Vec<(u32, Vec<u8>)> {
    let finished = (0..picture.map.len()).filter(|&tile| report.finished[tile as usize]);
    let bytes = |tile| picture.tile(&report.sums, tile).iter().flatten().flat_map(|sum| sum.to_le_bytes()).collect();
    finished.map(|tile| (tile, bytes(tile))).collect()
}

/// Notes each tile that is given out, unless it comes back to be given to another.
fn note<'n>(given: &'n mut Vec<u32>) -> impl FnMut(Peer, Peer, &Message) -> Lie + 'n {
    |_, _, message| {
        match *message {
            Message::Tiles { first, count, .. } => given.extend(first..first + count),
            Message::Back { first, count, .. } => given.retain(|tile| !(first..first + count).contains(tile)),
            _ => {}
        }
        Lie::No
    }
}

/// What is missing, and nothing else, is given out.
fn only_missing(picture: &Picture, kept: &[(u32, Vec<u8>)], mut given: Vec<u32>) -> Result<(), String> {
    given.sort_unstable();
    let missing = (0..picture.map.len()).filter(|tile| kept.iter().all(|(there, _)| there != tile));
    if given.iter().copied().eq(missing) { Ok(()) } else { Err(format!("given out: {given:?}")) }
}

#[test]
fn a_picture_that_was_stopped_goes_on_elsewhere() {
    each_seed(200, |seed| {
        let mut rng = Rng(seed);
        let picture = &toys()[rng.between(1, 4) as usize];
        let mut there = Vec::new();
        for stops in [true, true, false] {
            let mut plan = any_plan(&mut rng, picture);
            plan.stop_after = stops.then(|| rng.below(u64::from(picture.map.len()) + 1) as u32);
            plan.kept.clone_from(&there);
            let mut given = Vec::new();
            let report = play(&plan, &mut note(&mut given))?;
            if stops && report.outcome == Outcome::Stopped {
                if there.iter().any(|(tile, _)| given.contains(tile)) {
                    return Err(format!("given out though finished: {given:?}"));
                }
                there = kept(picture, &report);
                continue;
            }
            same_picture(picture, &report)?;
            only_missing(picture, &there, given)?;
            if report.epochs.iter().any(|&epoch| epoch != 0) || report.refused_frames > 0 {
                return Err("a tile was traced twice, or a message refused".into());
            }
            return Ok(());
        }
        Err("it does not end".into())
    });
}

/// Tiles that are there in any pattern, none and all of them too.
#[test]
fn any_tiles_may_be_there() {
    each_seed(200, |seed| {
        let mut rng = Rng(seed);
        let picture = &toys()[rng.between(0, 4) as usize];
        let whole = play(&any_plan(&mut rng, picture), &mut |_, _, _| Lie::No)?;
        let mut there = kept(picture, &whole);
        let chance = rng.pick(&[0, 1, 5, 9, 10]);
        there.retain(|_| rng.below(10) < chance);
        rng.shuffle(&mut there);
        let mut plan = any_plan(&mut rng, picture);
        plan.kept.clone_from(&there);
        plan.biased = rng.below(2) == 0;
        let mut given = Vec::new();
        let report = play(&plan, &mut note(&mut given))?;
        same_picture(picture, &report)?;
        only_missing(picture, &there, given)
    });
}

/// A dispatcher without room for the bits of all tiles, and a node that is lost: more is traced, and the picture is the
/// same.
#[test]
fn what_the_dispatcher_cannot_remember_is_traced_for_nothing() {
    each_seed(100, |seed| {
        let mut rng = Rng(seed);
        let picture = &toys()[rng.between(1, 4) as usize];
        let mut there = kept(picture, &play(&any_plan(&mut rng, picture), &mut |_, _, _| Lie::No)?);
        there.retain(|_| rng.below(2) == 0);
        let mut plan = any_plan(&mut rng, picture);
        let node = plan.speeds.len() as Peer + 1;
        plan.speeds.push(plan.speeds[0]);
        plan.forgetful = rng.below(2) == 0;
        plan.deaths = vec![(rng.below(u64::from(picture.map.len())) as u32, node)];
        plan.kept = there;
        same_picture(picture, &play(&plan, &mut |_, _, _| Lie::No)?)
    });
}
