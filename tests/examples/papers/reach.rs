//! What the project set out to reach, and what each mechanism is worth.

use anyhow::Result;
use hybray_scheduler::policy::Policy;

use crate::bench::{Bench, Job, Without};
use crate::pov;
use crate::published::{Published, Row};
use crate::table::{Table, megabytes, per_cent};

/// What is to be reached.
enum Floor {
    /// Speed-up over nodes, 0 to 1, and virtual seconds at most.
    Efficiency(f64, Option<f64>),
    /// Speed-up.
    Times(f64),
}

impl Floor {
    fn text(&self) -> String {
        match self {
            Self::Efficiency(share, None) => format!("{:.0} %", 100.0 * share),
            Self::Efficiency(share, Some(seconds)) => format!("{:.0} %, {seconds} s", 100.0 * share),
            Self::Times(times) => format!("{times} times"),
        }
    }
}

struct Goal {
    case: String,
    published: String,
    floor: Floor,
    job: Job,
    command: String,
}

/// The rows of the task, but for the one that takes long.
pub fn goals(bench: &Bench, published: &Published) -> Result<String> {
    let names = ["case", "published", "to reach", "dispatcher", "s", "speed-up", "eff. %", "busy %"];
    let more = ["pilot, s", "loading, s", "gathering, s", "memory of a node, KiB", "reached", "command"];
    let mut table = Table::new(&[&names[..], &more].concat());
    for goal in goals_of(published)? {
        for is_dispatched_by_node in [false, true] {
            let dispatcher = if is_dispatched_by_node { "node" } else { "host" };
            let job = Job { is_dispatched_by_node, ..goal.job.clone() };
            let mut line = vec![goal.case.clone(), goal.published.clone(), goal.floor.text(), dispatcher.to_owned()];
            line.extend(figures(bench, &job, &goal.floor));
            let option = if is_dispatched_by_node { " --dispatcher node" } else { "" };
            line.push(format!("`{}{option}`", goal.command));
            table.row(line);
        }
    }
    Ok(format!("{}\n{}", table.finish(), flat(bench, published)?))
}

/// The row of the data-parallel times: a shape, not a floor.
fn flat(bench: &Bench, published: &Published) -> Result<String> {
    let rows = published.table("t6_7_data_parallel")?;
    let mut names = vec!["`data-parallel`, balls: s on so many nodes".to_owned()];
    let ways = ["from voxel to voxel, 1 ray a message", "the same, 100 rays a message"]
        .into_iter()
        .chain(["straight to the page, 1 ray a message", "the same, 100 rays a message"]);
    let mut lines: Vec<_> = std::iter::once("published").chain(ways).map(|name| vec![name.to_owned()]).collect();
    for row in rows {
        names.push(row.cell("processors")?);
        lines[0].push(row.cell("s")?);
        let job = Job::of_1995("paper:balls", row.number("processors")?);
        let direct = job.in_1995(Policy::DataParallel, row.text("grid")?);
        let jobs = [direct.clone().walking(), direct];
        let jobs = jobs.iter().flat_map(|job| [1, 100].map(|most| Job { granularity: Some(most), ..job.clone() }));
        for (line, job) in lines[1..].iter_mut().zip(jobs) {
            let found = bench.figures(&job);
            line.push(found.map_or_else(|without| without.cell(), |run| format!("{:.2}", run.seconds)));
        }
    }
    let mut table = Table::new(&names.iter().map(String::as_str).collect::<Vec<_>>());
    lines.into_iter().for_each(|line| table.row(line));
    Ok(table.finish())
}

fn figures(bench: &Bench, job: &Job, floor: &Floor) -> Vec<String> {
    let found = match bench.compared(job) {
        Ok(found) => found,
        Err(without) => {
            let mut cells = vec![String::new(); 9];
            cells[0] = without.cell();
            return cells;
        }
    };
    let run = &found.run;
    let is_reached = match *floor {
        Floor::Efficiency(share, seconds) => {
            found.efficiency >= share && seconds.is_none_or(|seconds| run.seconds <= seconds)
        }
        Floor::Times(times) => found.speedup >= times,
    };
    vec![
        format!("{:.3}", run.seconds),
        format!("{:.2}", found.speedup),
        per_cent(found.efficiency),
        per_cent(run.busy),
        format!("{:.2}", run.pilot_seconds),
        format!("{:.2}", run.loading_seconds),
        format!("{:.2}", run.gathering_seconds),
        (run.memory_high_water >> 10).to_string(),
        if is_reached { "yes" } else { "no" }.to_owned(),
    ]
}

fn goals_of(published: &Published) -> Result<Vec<Goal>> {
    let row = |table: &str, column: &str, value: &str| -> Result<&Row> {
        let found = published.table(table)?.iter().find(|row| row.text(column).is_ok_and(|text| text == value));
        found.ok_or_else(|| anyhow::anyhow!("{table} has no {column} {value}"))
    };
    let seconds = |row: &Row, column: &str| Ok::<_, anyhow::Error>(format!("{} s", row.cell(column)?));
    let balls = row("t6_4_balls", "processors", "32")?;
    let large = row("t6_9_large_models", "processors", "32")?;
    let simulate = |scene: &str, nodes: u16| {
        format!("hybray simulate {scene} --machine powerxplorer --nodes {nodes} --memory 32MiB --spp 1")
    };
    // With memory for all pages, nodes share the rays of the last tiles; without a budget a tile is the least that is given.
    let pov = |case: &str, scene: &str, published: String, least: f64, memory_mib: Option<u64>| {
        let (with, option) = memory_mib
            .map_or_else(Default::default, |mib| (format!(", {mib} MiB a node"), format!(" --memory {mib}MiB")));
        Goal {
            case: format!("POV||Ray's farm, 38 workers, {case}{with}"),
            published,
            floor: Floor::Times(least),
            job: Job { memory_mib, ..pov::job(scene, 38) },
            command: format!("hybray simulate {scene} --machine cc48 --nodes 38{option} --spp 1"),
        }
    };
    let part = |scene: &str, share: u64| {
        let pages = format!("--page-memory 1/{share} --page-bytes 4096");
        format!("hybray simulate {scene} --machine powerxplorer --nodes 32 --memory 32MiB {pages} --spp 1")
    };
    let level = |level: &'static str, case: &str| -> Result<Goal> {
        let scene = format!("paper:balls:{level}");
        Ok(Goal {
            case: case.to_owned(),
            published: seconds(row("t6_8_reflectivity", "level", level)?, "hybrid_s")?,
            floor: Floor::Efficiency(0.85, None),
            job: Job::of_1995(&scene, 16),
            command: simulate(&scene, 16),
        })
    };
    let workers = |name: &str, t: &str| -> Result<String> {
        let rows = published.table("pov_speedup")?;
        let of =
            |row: &&Row| row.text("scene").is_ok_and(|s| s == name) && row.text("workers").is_ok_and(|w| w == "38");
        let row = rows.iter().find(of).ok_or_else(|| anyhow::anyhow!("no 38 workers for {name}"))?;
        Ok(format!("{} times", row.cell(t)?))
    };
    Ok(vec![
        Goal {
            case: "balls, 32 nodes".to_owned(),
            published: format!("{} s, busy {} %", balls.cell("subhosts_s")?, balls.cell("subhosts_eff")?),
            floor: Floor::Efficiency(0.8, Some(2.4)),
            job: Job::of_1995("paper:balls", 32),
            command: simulate("paper:balls", 32),
        },
        level("1", "balls, every sphere reflective, 16 nodes")?,
        level("6", "balls, no sphere reflective, 16 nodes")?,
        Goal {
            case: "balls of 66,430 spheres, page memory a sixteenth of the scene, 32 nodes".to_owned(),
            published: seconds(large, "balls5_hybrid_s")?,
            floor: Floor::Efficiency(0.7, None),
            job: Job::of_1995("paper:balls5", 32).with_share(16),
            command: part("paper:balls5", 16),
        },
        Goal {
            case: "conference room, 30 lights, page memory a quarter of the scene, 32 nodes".to_owned(),
            published: seconds(large, "conference30_hybrid_s")?,
            floor: Floor::Efficiency(0.7, None),
            job: Job::of_1995("paper:conference:30", 32).with_share(4),
            command: part("paper:conference:30", 4),
        },
        pov("courtyard", "paper:hof", workers("rosenthalerhof", "t2_speedup")?, 37.0, None),
        pov("courtyard", "paper:hof", workers("rosenthalerhof", "t2_speedup")?, 37.0, Some(64)),
        pov("vase", "paper:vase", workers("skyvase", "t3_speedup")?, 34.0, None),
        pov("vase", "paper:vase", workers("skyvase", "t3_speedup")?, 34.0, Some(64)),
    ])
}

/// A machine of 1,024 small boards, at more and more samples.
pub fn thousand(bench: &Bench, _: &Published) -> Result<String> {
    let names = [
        "picture",
        "nodes",
        "s",
        "speed-up",
        "eff. %",
        "busy %",
        "pilot, s",
        "loading, s",
        "gathering, s",
        "memory of a node, KiB",
        "70 %",
    ];
    let mut table = Table::new(&names);
    for (side, samples) in [(1024, 1), (1024, 4), (1024, 16)] {
        let job = Job { machine: "gigabit", size: [side, side], samples, ..Job::of_1995("terrain:2000000", 1024) };
        let mut line = vec![format!("{side} x {side}, {samples} samples"), job.nodes.to_string()];
        line.extend(figures(bench, &job, &Floor::Efficiency(0.7, None)));
        table.row(line);
    }
    Ok(table.finish())
}

/// With and without each mechanism.
pub fn mechanisms(bench: &Bench, _: &Published) -> Result<String> {
    let large = Job::of_1995("paper:balls5", 32);
    let small = Job::of_1995("paper:balls", 32);
    let with_large = mechanism_rows(bench, &large.clone().with_share(16), &Job { page_bytes: 4096, ..large }, true);
    let with_small = mechanism_rows(bench, &small.clone().with_share(16), &Job { page_bytes: 4096, ..small }, false);
    Ok(format!(
        "Balls of 66,430 spheres, page memory a sixteenth of the scene, 32 nodes:\n\n{with_large}\n\
         Balls of 7,381 spheres, the same:\n\n{with_small}"
    ))
}

/// One after the other changed in `job`; `roomy` is the same with room for copies of every page.
fn mechanism_rows(bench: &Bench, job: &Job, roomy: &Job, light_caches_fit: bool) -> String {
    let names = ["", "s", "eff. %", "messages", "MB", "rays forwarded", "pages fetched"];
    let mut table = Table::new(&names);
    let changed = |change: &dyn Fn(&mut Job)| {
        let mut job = job.clone();
        change(&mut job);
        job
    };
    let rows = [
        ("all", job.clone()),
        ("a message for every ray: granularity 1 instead of 100", changed(&|job| job.granularity = Some(1))),
        ("nothing fetched: `data-parallel`", changed(&|job| job.policy = Policy::DataParallel)),
        ("nothing forwarded: `demand-driven`", changed(&|job| job.policy = Policy::DemandDriven)),
        ("pyramids of 8 x 8 pixels instead of 16 x 16", changed(&|job| job.bundle_tiles = Some(1))),
        ("shadow rays one by one: no bundles from lights and from hits", changed(&|job| job.shadow_bundles = false)),
        ("tiles given out by a node instead of the host", changed(&|job| job.is_dispatched_by_node = true)),
        ("no pilot: owners by space, equal numbers of tiles, no copies", changed(&|job| job.pilot = 0)),
        ("a pilot of 1,024 rays, one a tile, instead of four", changed(&|job| job.pilot = 1024)),
        ("a pilot of 256 rays, one in four tiles", changed(&|job| job.pilot = 256)),
        ("no subhosts: the host clips for all", changed(&|job| job.subhosts = Some(0))),
        ("no take-over at the end of the picture", changed(&|job| job.take_over = false)),
        (
            "a run is one tile, always (no `W / (1 + T (N - 1))`)",
            changed(&|job| {
                job.spread = Some(255);
                job.atomic = Some(1);
            }),
        ),
        ("room for copies of every page on every node", roomy.clone()),
    ];
    let with_light = changed(&|job| job.light_cache = Some(16 << 10));
    let with_light = light_caches_fit.then_some(("light caches of 16 KiB (`hybrid` has none by default)", with_light));
    for (name, job) in rows.into_iter().chain(with_light) {
        let mut line = vec![name.to_owned()];
        line.extend(match bench.compared(&job) {
            Ok(found) => vec![
                format!("{:.2}", found.run.seconds),
                per_cent(found.efficiency),
                found.run.messages.to_string(),
                megabytes(found.run.bytes),
                found.run.forwarded.to_string(),
                found.run.fetched.to_string(),
            ],
            Err(without) => only(&without),
        });
        table.row(line);
    }
    for (name, job) in [
        ("delayed shading, **priced**, not run: `hybrid` and its replies", job.clone()),
        (
            "delayed shading, **priced**, not run: `data-parallel` and its replies",
            changed(&|job| job.policy = Policy::DataParallel),
        ),
    ] {
        let mut line = vec![name.to_owned()];
        line.extend(match bench.figures(&job) {
            Ok(run) => {
                let (messages, bytes) = replies(run.forwarded, run.ray_messages);
                let dash = "–".to_owned();
                let (messages, bytes) = (run.messages + messages, megabytes(run.bytes + bytes));
                vec![
                    dash.clone(),
                    dash,
                    messages.to_string(),
                    bytes,
                    run.forwarded.to_string(),
                    run.fetched.to_string(),
                ]
            }
            Err(without) => only(&without),
        });
        table.row(line);
    }
    table.finish()
}

fn only(without: &Without) -> Vec<String> {
    let mut cells = vec![String::new(); 6];
    cells[0] = without.cell();
    cells
}

/// Bytes of a reply: the id of the ray that waits, and three colours as numbers of four bytes, and their place.
const REPLY_BYTES: u64 = 24;
/// Bytes of a message before its records, about as many as one with rays has.
const HEAD_BYTES: u64 = 12;

/// Messages and bytes of the replies that delayed shading would send: every ray that was forwarded has its colour sent
/// back over every step of its way, in as many messages as rays went in.
fn replies(forwarded: u64, ray_messages: u64) -> (u64, u64) {
    (ray_messages, forwarded * REPLY_BYTES + ray_messages * HEAD_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: 200 rays in 3 messages.
    #[test]
    fn replies_are_priced_by_counts() {
        assert_eq!(replies(200, 3), (3, 4800 + 3 * HEAD_BYTES));
        assert_eq!(replies(0, 0), (0, 0));
    }
}
