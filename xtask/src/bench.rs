//! `cargo xtask bench`: what the project says of speed and size, measured again.
//!
//! Every benchmark builds `hybray` as it is shipped, runs it as a process and reads its JSON report, so that what is
//! measured is what a user gets. What is compared is run in pairs, in turn, and the ratio is taken within a pair: a
//! machine that others use slows both. A figure that is a clock's is printed beside what it ought to be and fails
//! nothing; a share of pixels does not depend on the machine, and fails. `docs/BENCHMARKS.md` says what each is for.

mod compare;
mod hybray;
mod kernels;
mod pairs;
mod pictures;
mod plot;
mod povray;
mod scale;
mod table;
mod tachyon;
mod threads;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Args, Subcommand};

use self::hybray::Hybray;
use self::kernels::Kernels;
use self::table::Table;
use crate::tools::Tools;
use crate::workspace::Workspace;

/// One benchmark.
#[derive(Subcommand)]
pub enum Bench {
    /// Hybray against POV-Ray and Tachyon: the same scenes, threads and depth; times, rays, and how far the pictures agree
    Pictures(pictures::Options),
    /// One node against two: time, and how busy each was
    Threads(threads::Options),
    /// A terrain of more and more triangles: times, bytes for each triangle, cost of a primary ray
    Scale(scale::Options),
    /// Our kernels beside those of obvhs and Embree on the same rays: speeds, builds, bytes, counts, and what they
    /// ought to be
    Kernels(kernels::Options),
    /// What a primary ray costs by the number of triangles, and a line through it
    Growth(kernels::GrowthOptions),
}

/// What every benchmark may be told.
#[derive(Args, Default)]
pub struct Common {
    /// Write the figures to this file too, a line for each scene
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// A scene and a picture so small that it takes a second: whether the benchmark works, not what it measures
    #[arg(long)]
    small: bool,
}

/// What a benchmark works with.
struct Bed {
    hybray: Hybray,
    /// Where scenes and pictures go.
    folder: PathBuf,
}

/// What a benchmark found.
struct Found {
    table: Table,
    /// What counts say is wrong, one line each.
    wrong: Vec<String>,
}

/// Builds hybray, runs the benchmark, prints its table and says below it what is wrong.
pub fn run(bench: &Bench) -> anyhow::Result<ExitCode> {
    let (common, skip) = match bench {
        Bench::Pictures(options) => (&options.common, pictures::skip()),
        Bench::Threads(options) => (&options.common, None),
        Bench::Scale(options) => (&options.common, None),
        Bench::Kernels(options) => (&options.common, None),
        Bench::Growth(options) => (&options.common, None),
    };
    if let Some(why) = skip {
        println!("skipped: {why}");
        return Ok(ExitCode::SUCCESS);
    }
    let tools = Tools::find();
    let workspace = Workspace::load(&tools)?;
    if let Some(note) = busy_note() {
        println!("{note}");
    }
    let bed = || -> anyhow::Result<Bed> {
        let bed = Bed { hybray: Hybray::build(&tools, &workspace)?, folder: workspace.target.join("bench") };
        fs::create_dir_all(&bed.folder).with_context(|| format!("{}: no folder can be made", bed.folder.display()))?;
        Ok(bed)
    };
    let found = match bench {
        Bench::Pictures(options) => pictures::run(&bed()?, options)?,
        Bench::Threads(options) => threads::run(&bed()?, options)?,
        Bench::Scale(options) => scale::run(&bed()?, options)?,
        Bench::Kernels(options) => kernels::run(&Kernels::build(&tools, &workspace)?, options)?,
        Bench::Growth(options) => kernels::growth(&Kernels::build(&tools, &workspace)?, options)?,
    };
    println!("{}", found.table);
    if let Some(path) = &common.csv {
        write(path, &found.table.csv())?;
    }
    found.wrong.iter().for_each(|line| println!("WRONG: {line}"));
    Ok(if found.wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Says that others are at work, as far as the system tells: its load average over the last minute. Asked before the
/// build, which would be found here too.
fn busy_note() -> Option<String> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    let load: f64 = text.split_whitespace().next()?.parse().ok()?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let note =
        format!("note: other programs are at work (load {load:.1} on {cores} cores), so clocks will tell little");
    (load > 0.2 * cores as f64).then_some(note)
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    fs::write(path, text).with_context(|| format!("{}: it cannot be written", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program that an earlier build left beside this test, and a folder of its own. Nothing is built here.
    fn bed() -> Option<(Bed, tempfile::TempDir)> {
        let test = std::env::current_exe().unwrap();
        let program = test.parent()?.parent()?.join(format!("hybray{}", std::env::consts::EXE_SUFFIX));
        if !program.is_file() {
            eprintln!("skipped: there is no {}", program.display());
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        Some((Bed { hybray: Hybray::at(program), folder: folder.path().to_owned() }, folder))
    }

    fn check(found: &Found, scenes: &[&str]) {
        assert_eq!(found.wrong, Vec::<String>::new());
        let csv = found.table.csv();
        let first = csv.lines().skip(1).map(|line| line.split(',').next().unwrap());
        assert_eq!(first.collect::<Vec<_>>(), scenes, "{csv}");
    }

    fn small() -> Common {
        Common { csv: None, small: true }
    }

    #[test]
    fn small_pictures() {
        let Some((bed, _folder)) = bed() else { return };
        if pictures::skip().is_some() {
            return;
        }
        let options = pictures::Options { threads: vec![1], runs: 1, pin: false, common: small() };
        check(&pictures::run(&bed, &options).unwrap(), &["spd:balls:2"]);
    }

    #[test]
    fn small_threads() {
        let Some((bed, _folder)) = bed() else { return };
        check(&threads::run(&bed, &threads::Options { runs: 1, common: small() }).unwrap(), &["spd:balls:2"]);
    }

    #[test]
    fn small_scale() {
        let Some((bed, _folder)) = bed() else { return };
        let options = scale::Options { triangles: 10_000, common: small() };
        check(&scale::run(&bed, &options).unwrap(), &["terrain:1000", "terrain:10000"]);
    }
}
