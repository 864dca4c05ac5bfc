//! A farm in one process from one seed: the real master, dispatcher and nodes over a link on a virtual clock.
//!
//! A failure names its seed; `HYBRAY_SEED=<seed>` plays that one alone, and `HYBRAY_SEEDS=<count>` more of them.

#[path = "../common/mod.rs"]
mod common;
mod faults;
mod net;
mod pictures;
mod resumed;
mod shares;
#[path = "../../examples/toy/mod.rs"]
mod toy;
mod world;

use common::Rng;
use hybray_link::HOST;
use hybray_scheduler::policy::Tiles;
use hybray_scheduler::{Options, Outcome};
use hybray_wire::Counts;
use net::{Lie, Manner};
use pictures::{Picture, toys};
use world::{Plan, Report, play};

/// Plays `one` for each seed, or for that in `HYBRAY_SEED`.
fn each_seed(count: u64, one: impl Fn(u64) -> Result<(), String>) {
    let number = |name| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
    let seeds = number("HYBRAY_SEED").map_or(0..number("HYBRAY_SEEDS").unwrap_or(count), |seed| seed..seed + 1);
    for seed in seeds {
        let _named = Named(seed);
        if let Err(what) = one(seed) {
            panic!("{what}");
        }
    }
}

/// Names the seed of a failure, whether the test found it or the world.
struct Named(u64);

impl Drop for Named {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("HYBRAY_SEED={} plays it again", self.0);
        }
    }
}

/// A farm of any kind, without faults, for one of the pictures.
fn any_plan(rng: &mut Rng, picture: &'static Picture) -> Plan<'static> {
    let nodes = if rng.below(8) == 0 { rng.between(1, 64) } else { rng.between(1, 9) };
    let base = rng.pick(&[100, 1_000, 20_000]);
    // What a tile takes, against what a message takes: from no delay to a hundred times as long.
    let delay_max = rng.pick(&[0, 1_000, 100_000, 10_000_000, 200_000_000]);
    let spread = rng.pick(&[None, None, Some(1.0), Some(2.0), Some(2.5), Some(8.0), Some(f32::INFINITY)]);
    let atomic = rng.pick(&[None, None, Some(1), Some(3), Some(4), Some(16), Some(u32::MAX)]);
    let count = Tiles::PixelCount { pixels: rng.pick(&[0, 64, 200, 1_000, u32::MAX]) };
    let tiles = rng.pick(&[Tiles::Dynamic, Tiles::Dynamic, Tiles::Static, count]);
    let some = rng.below(3) == 0;
    Plan {
        seed: rng.next(),
        frame: picture.frame,
        scene: picture.scene,
        dispatcher: if rng.below(2) == 0 { HOST } else { 1 },
        options: Options { spread, atomic, tiles, take_over: rng.below(3) > 0 },
        barred: (0..=nodes).map(|_| some && rng.below(2) == 0).collect(),
        manner: Manner {
            room: rng.pick(&[1, 1, 2, 3, 16, 64]),
            delay_max,
            far_host: rng.below(3) == 0,
            held_up: None,
            refuses: rng.pick(&[0, 0, 0, 2, 5]),
            wakes_for_room: rng.below(4) != 0,
        },
        costs: &picture.costs,
        speeds: (0..nodes).map(|_| base * rng.pick(&[1, 1, 1, 2, 4, 10])).collect(),
        frames_a_turn: rng.pick(&[1, 4, 64]),
        deaths: Vec::new(),
        stop_after: None,
        injected: Vec::new(),
        stranger: None,
        kept: Vec::new(),
        biased: false,
        forgetful: false,
    }
}

/// The same picture, all of it, and nothing refused.
fn same_picture(picture: &Picture, report: &Report) -> Result<(), String> {
    if report.outcome != Outcome::Finished {
        return Err(format!("{:?}", report.outcome));
    }
    // The film's hash, written down once more.
    let bytes = picture.sums.iter().flatten().flat_map(|sum| sum.to_le_bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325, |h: u64, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
    if report.sums != picture.sums || report.hash != hash {
        return Err("another picture".into());
    }
    if !report.finished.iter().all(|&f| f) {
        return Err("finished with tiles that are not".into());
    }
    Ok(())
}

#[test]
fn every_farm_draws_the_same_picture() {
    each_seed(360, |seed| {
        let mut rng = Rng(seed);
        let picture = rng.pick(&toys().each_ref());
        let plan = any_plan(&mut rng, picture);
        let report = play(&plan, &mut |_, _, _| Lie::No)?;
        same_picture(picture, &report)?;
        let mut counts = Counts::default();
        report.nodes.iter().for_each(|node| counts += node.counts);
        // Nodes that nobody waited for do not report.
        if report.refused_frames > 0 {
            return Err(format!("{} messages refused", report.refused_frames));
        }
        if report.epochs.iter().any(|&epoch| epoch != 0) {
            return Err("a tile was traced twice".into());
        }
        let has_open = plan.barred[1..].contains(&false);
        for (node, barred) in report.nodes.iter().zip(&plan.barred[1..]) {
            if has_open && *barred && node.runs > 0 {
                return Err("a node that is barred was given tiles".into());
            }
            if plan.options.tiles == Tiles::Static && node.runs > 1 {
                return Err(format!("static, and {} runs", node.runs));
            }
        }
        let reported: u32 = report.nodes.iter().map(|node| node.tiles).sum();
        if reported == picture.map.len() {
            let (a, b) = (counts, picture.counts);
            let same = (a.primary, a.secondary, a.shadow, a.hits) == (b.primary, b.secondary, b.shadow, b.hits);
            return if same { Ok(()) } else { Err(format!("other counts: {a:?}")) };
        }
        Err(format!("{reported} of {} tiles reported", picture.map.len()))
    });
}

/// One seed is one history.
#[test]
fn a_seed_replays_itself() {
    for seed in [3, 14, 15] {
        let plan = || any_plan(&mut Rng(seed), &toys()[3]);
        let [a, b] = [plan(), plan()].map(|plan| play(&plan, &mut |_, _, _| Lie::No).unwrap());
        assert_eq!((a.time, a.frames, a.bytes, a.runs, a.gaps), (b.time, b.frames, b.bytes, b.runs, b.gaps));
    }
}
