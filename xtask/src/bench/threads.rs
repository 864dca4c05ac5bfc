//! `cargo xtask bench threads`: one node against two.
//!
//! The picture has to be the same, and is checked; the time of two nodes ought to be no more than [`GOAL`] of that of
//! one.

use clap::Args;

use super::hybray::Report;
use super::pairs::{Spread, alternate};
use super::table::{Figures, Table};
use super::{Bed, Common, Found};

/// Time of two nodes over that of one; half is perfect.
const GOAL: f64 = 0.53;

/// `cargo xtask bench threads`.
#[derive(Args)]
pub struct Options {
    /// How often each scene is drawn by one node and by two
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    #[command(flatten)]
    pub common: Common,
}

/// Times each scene.
pub fn run(bed: &Bed, options: &Options) -> anyhow::Result<Found> {
    let mut found = Found { table: Table::default(), wrong: Vec::new() };
    let (scenes, side): (&[(&str, &str)], u32) = if options.common.small {
        (&[("spd:balls:2", "1")], 64)
    } else {
        (&[("spd:balls:5", "1"), ("organic", "4")], 1024)
    };
    for &(scene, samples) in scenes {
        let picture = bed.folder.join("threads.png");
        let draw =
            |nodes: &str| bed.hybray.render(scene, [side; 2], &["--spp", samples, "--nodes", nodes], &picture, None);
        let pairs = alternate(scene, options.runs, || draw("1"), || draw("2"))?;
        if pairs.iter().any(|(one, two)| one.film != two.film) {
            found.wrong.push(format!("{scene}: two nodes draw another picture than one"));
        }
        found.table.add(figures(scene, samples, side, &pairs));
    }
    Ok(found)
}

fn figures(scene: &str, samples: &str, side: u32, pairs: &[(Report, Report)]) -> Figures {
    let spread = |of: &dyn Fn(&Report, &Report) -> f64| Spread::of(pairs.iter().map(|(one, two)| of(one, two)));
    let busy = |report: &Report, node: usize| report.nodes.get(node).map_or(f64::NAN, |node| node.busy_seconds);
    let ratio = spread(&|one, two| two.seconds.trace / one.seconds.trace);
    let verdict = if ratio.median <= GOAL { "kept" } else { "missed" };
    vec![
        ("scene", scene.to_owned().into()),
        ("picture", format!("{side} x {side}, {samples} a pixel").into()),
        ("rays", pairs.first().map_or(0, |(one, _)| one.rays.sum()).into()),
        ("one node, trace s", spread(&|one, _| one.seconds.trace).into()),
        ("one node, busy s", spread(&|one, _| busy(one, 0)).into()),
        ("one node, busy / total", spread(&|one, _| one.busy_share()).into()),
        ("two nodes, trace s", spread(&|_, two| two.seconds.trace).into()),
        ("two nodes, busy s of the first", spread(&|_, two| busy(two, 0)).into()),
        ("two nodes, busy s of the second", spread(&|_, two| busy(two, 1)).into()),
        ("two nodes, busy / total", spread(&|_, two| two.busy_share()).into()),
        ("two / one", ratio.into()),
        ("goal", format!("{GOAL} {verdict}").into()),
    ]
}
