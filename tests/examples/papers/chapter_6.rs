//! Chapter 6 of the 1995 report.

use anyhow::{Context as _, Result};
use hybray_scheduler::policy::{Criterion, Policy, Tiles};

use crate::bench::{Bench, Job};
use crate::published::{Published, Row};
use crate::table::{Table, megabytes, per_cent};

/// What is said of a simulated run, six columns.
const RUN: [&str; 6] = ["s", "speed-up", "eff. %", "busy %", "messages", "MB"];

/// The cells of `job`, as [`RUN`] has them.
fn run(bench: &Bench, job: &Job) -> Vec<String> {
    match bench.compared(job) {
        Ok(found) => vec![
            format!("{:.2}", found.run.seconds),
            format!("{:.2}", found.speedup),
            per_cent(found.efficiency),
            per_cent(found.run.busy),
            found.run.messages.to_string(),
            megabytes(found.run.bytes),
        ],
        Err(without) => cells(&without.cell()),
    }
}

/// A group of cells of which the first says why the others are empty.
fn cells(first: &str) -> Vec<String> {
    let mut cells = vec![String::new(); RUN.len()];
    first.clone_into(&mut cells[0]);
    cells
}

/// The head of a table: first columns, then a group for each of `groups`.
fn table(first: &[&str], groups: &[&str]) -> Table {
    let mut names: Vec<String> = first.iter().map(|&name| name.to_owned()).collect();
    for group in groups {
        names.push(format!("{group}: {}", RUN[0]));
        names.extend(RUN[1..].iter().map(|&name| name.to_owned()));
    }
    Table::new(&names.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Table 6.2: which nodes are given tiles, and when. The report has no take-over at the end of a picture.
pub fn criteria(bench: &Bench, published: &Published) -> Result<String> {
    let first = ["criterion", "nodes with tiles", "pixel count: s", "busy %", "dynamic: s", "busy %", "ours: nodes"];
    let names = ["pixel count", "dynamic", "static", "dynamic and take-over"];
    let mut columns_of: Vec<String> = first.map(str::to_owned).to_vec();
    columns_of.extend(names.iter().flat_map(|name| [format!("{name}: s"), "eff. %".to_owned(), "busy %".to_owned()]));
    let mut table = Table::new(&columns_of.iter().map(String::as_str).collect::<Vec<_>>());
    for row in published.table("t6_2_scheduling_criteria")? {
        let mut line = columns(
            row,
            &["criterion", "demand_driven_processes", "pixel_count_s", "pixel_count_eff", "dynamic_s", "dynamic_eff"],
        )?;
        let job = Job::of_1995("paper:balls", 16).in_1995(Policy::Hybrid1995, "4x4");
        let criterion = criterion(row.text("criterion")?)?;
        let pixels = job.in_system.unwrap_or_default();
        let ways = [
            (Tiles::PixelCount { pixels }, false),
            (Tiles::Dynamic, false),
            (Tiles::Static, false),
            (Tiles::Dynamic, true),
        ];
        let runs = ways.map(|(tiles, take_over)| Job { tiles, take_over, criterion, ..job.clone() });
        let nodes = bench.figures(&runs[0]).map_or_else(|without| without.cell(), |run| run.with_tiles.to_string());
        line.push(nodes);
        for job in &runs {
            line.extend(match bench.compared(job) {
                Ok(found) => {
                    [format!("{:.2}", found.run.seconds), per_cent(found.efficiency), per_cent(found.run.busy)]
                }
                Err(without) => [without.cell(), String::new(), String::new()],
            });
        }
        table.row(line);
    }
    Ok(table.finish())
}

/// The criterion that the report calls so.
fn criterion(name: &str) -> Result<Criterion> {
    Ok(match name {
        "all processes" => Criterion::All,
        "all but host" => Criterion::AllButHost,
        "location" => Criterion::Location,
        _ => Criterion::Objects(name.trim_start_matches("objects <= ").parse().with_context(|| name.to_owned())?),
    })
}

/// Table 6.3: subhosts and the size of a pyramid. As many subhosts as nodes: every node clips for itself.
pub fn subhosts(bench: &Bench, published: &Published) -> Result<String> {
    let first = ["model", "subhosts", "8 x 8: s", "busy %", "16 x 16: s", "busy %"];
    let groups = ["`hybrid-1995`, 8 x 8", "`hybrid-1995`, 16 x 16", "`hybrid`, 8 x 8", "`hybrid`, 16 x 16"];
    let clipping = ["`hybrid-1995`, clipping at the host, 8 x 8: s", "16 x 16: s"];
    let mut table = table(&[&first[..], &clipping].concat(), &groups);
    for row in published.table("t6_3_subhosts")? {
        let mut line = columns(row, &["model", "subhosts", "s_8x8", "eff_8x8", "s_16x16", "eff_16x16"])?;
        let job = Job::of_1995(&format!("paper:{}", row.text("model")?), 16);
        let subhosts = Some(row.number("subhosts")?).filter(|&subhosts| subhosts < job.nodes);
        let published = job.clone().in_1995(Policy::Hybrid1995, "4x4");
        let of = |job: &Job, tiles| Job { bundle_tiles: Some(tiles), subhosts, ..job.clone() };
        let jobs = [of(&published, 1), of(&published, 4), of(&job, 1), of(&job, 4)];
        for job in &jobs[..2] {
            let seconds = bench.figures(job).map(|run| format!("{:.3}", run.clipping_seconds));
            line.push(seconds.unwrap_or_else(|without| without.cell()));
        }
        jobs.iter().for_each(|job| line.extend(run(bench, job)));
        table.row(line);
    }
    Ok(table.finish())
}

/// Table 6.4: balls.
pub fn balls(bench: &Bench, published: &Published) -> Result<String> {
    scaling(bench, published, "t6_4_balls", "paper:balls")
}

/// Table 6.5: teapot.
pub fn teapot(bench: &Bench, published: &Published) -> Result<String> {
    scaling(bench, published, "t6_5_teapot", "paper:teapot")
}

fn scaling(bench: &Bench, published: &Published, name: &str, scene: &str) -> Result<String> {
    let first = ["nodes", "no subhosts: s", "busy %", "subhosts: s", "busy %"];
    let mut table = table(&first, &["`hybrid-1995`", "`hybrid`"]);
    for row in published.table(name)? {
        let mut line = columns(row, &["processors", "no_subhosts_s", "no_subhosts_eff", "subhosts_s", "subhosts_eff"])?;
        line.extend(both(bench, &Job::of_1995(scene, row.number("processors")?), Policy::Hybrid1995, row)?);
        table.row(line);
    }
    Ok(table.finish())
}

/// `policy` as published, and `hybrid`.
fn both(bench: &Bench, job: &Job, policy: Policy, row: &Row) -> Result<Vec<String>> {
    let mut cells = run(bench, &job.clone().in_1995(policy, row.text("grid")?));
    cells.extend(run(bench, job));
    Ok(cells)
}

/// Table 6.6: light caches.
pub fn light_cache(bench: &Bench, published: &Published) -> Result<String> {
    let first = ["model", "nodes", "with: s", "busy %", "without: s", "busy %"];
    let mut table = table(&first, &["`hybrid-1995`, with", "`hybrid-1995`, without", "`hybrid`"]);
    for row in published.table("t6_6_light_cache")? {
        let mut line = columns(
            row,
            &["model", "processors", "with_cache_s", "with_cache_eff", "without_cache_s", "without_cache_eff"],
        )?;
        let job = Job::of_1995(&format!("paper:{}", row.text("model")?), row.number("processors")?);
        let with = job.clone().in_1995(Policy::Hybrid1995, row.text("grid")?);
        for job in [with.clone(), Job { light_cache: Some(0), ..with }, job] {
            line.extend(run(bench, &job));
        }
        table.row(line);
    }
    Ok(table.finish())
}

/// Table 6.7: data parallel alone.
pub fn data_parallel(bench: &Bench, published: &Published) -> Result<String> {
    let groups = [
        "`data-parallel` from voxel to voxel, 1 ray a message",
        "the same, 100 rays a message",
        "`data-parallel`, 1 ray a message",
        "`data-parallel`, 100 rays a message",
        "`hybrid`",
    ];
    let mut table = table(&["nodes", "paper: s", "busy %"], &groups);
    for row in published.table("t6_7_data_parallel")? {
        let mut line = columns(row, &["processors", "s", "eff"])?;
        let job = Job::of_1995("paper:balls", row.number("processors")?);
        let direct = job.clone().in_1995(Policy::DataParallel, row.text("grid")?);
        for published in [direct.clone().walking(), direct] {
            line.extend(run(bench, &Job { granularity: Some(1), ..published.clone() }));
            line.extend(run(bench, &published));
        }
        line.extend(run(bench, &job));
        table.row(line);
    }
    Ok(table.finish())
}

/// Table 6.8: how much of the balls reflects.
pub fn reflectivity(bench: &Bench, published: &Published) -> Result<String> {
    let first = ["level", "hybrid of 1995: s", "busy %", "data parallel: s", "busy %"];
    let mut table = table(
        &first,
        &["`hybrid-1995`", "`data-parallel` from voxel to voxel, 1 ray a message", "`data-parallel`", "`hybrid`"],
    );
    for row in published.table("t6_8_reflectivity")? {
        let mut line = columns(row, &["level", "hybrid_s", "hybrid_eff", "data_parallel_s", "data_parallel_eff"])?;
        let job = Job::of_1995(&format!("paper:balls:{}", row.text("level")?), 16);
        let direct = job.clone().in_1995(Policy::DataParallel, "4x4");
        let walks = Job { granularity: Some(1), ..direct.clone().walking() };
        for job in [job.clone().in_1995(Policy::Hybrid1995, "4x4"), walks, direct, job] {
            line.extend(run(bench, &job));
        }
        table.row(line);
    }
    Ok(table.finish())
}

/// Table 6.9, balls with 66,430 spheres.
pub fn balls5(bench: &Bench, published: &Published) -> Result<String> {
    large(bench, published, "balls5", "paper:balls5", 16)
}

/// Table 6.9, the conference room with 8 and 30 lights.
pub fn conference(bench: &Bench, published: &Published) -> Result<String> {
    let eight = large(bench, published, "conference8", "paper:conference", 4)?;
    let thirty = large(bench, published, "conference30", "paper:conference:30", 4)?;
    Ok(format!("8 lights:\n\n{eight}\n30 lights:\n\n{thirty}"))
}

fn large(bench: &Bench, published: &Published, name: &str, scene: &str, share: u64) -> Result<String> {
    let first = ["nodes", "data parallel: s", "hybrid of 1995: s"];
    let mut table = table(&first, &["`data-parallel`", "`hybrid-1995`", "`hybrid`"]);
    let columns_of = [format!("{name}_dp_s"), format!("{name}_hybrid_s")];
    for row in published.table("t6_9_large_models")? {
        let nodes = row.number("processors")?;
        if nodes == 1 {
            continue;
        }
        let mut line = columns(row, &["processors", &columns_of[0], &columns_of[1]])?;
        let job = Job::of_1995(scene, nodes).with_share(share);
        for policy in [Policy::DataParallel, Policy::Hybrid1995] {
            line.extend(run(bench, &job.clone().in_1995(policy, grid(nodes))));
        }
        line.extend(run(bench, &job));
        table.row(line);
    }
    Ok(table.finish())
}

/// The grids of the other tables; the report does not say what that of 24 processors was.
fn grid(nodes: u16) -> &'static str {
    match nodes {
        2 => "1x2",
        4 => "2x2",
        8 => "2x4",
        16 => "4x4",
        24 => "4x6",
        _ => "4x8",
    }
}

fn columns(row: &Row, names: &[&str]) -> Result<Vec<String>> {
    names.iter().map(|name| row.cell(name)).collect()
}
