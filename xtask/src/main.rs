//! Builds, images, benchmarks and the one gate: one verb of `cargo xtask`, one file.
#![forbid(unsafe_code)]

mod bench;
mod ci;
mod gate;
mod nostd;
mod papers;
mod soak;
mod test;
mod tidy;
mod tools;
mod workspace;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// The gate: every check, every tool required, stops at the first failure
    Ci,
    /// The same checks for anybody: a missing tool is skipped by name, and a failure does not hide the next
    Test,
    /// What the compiler does not check: arrows between crates, unsafe code, links, sizes, the pinned wire page
    Tidy,
    /// Build the core crates for a machine without an operating system
    Nostd,
    /// Random schedules on the simulated farm, thousands of them; a seed that fails is printed
    Soak(soak::Soak),
    /// The papers' experiments on the simulator: writes the tables of docs/PAPERS.md
    Papers(papers::Papers),
    /// Measure again what the project says of its speed and size
    #[command(subcommand)]
    Bench(bench::Bench),
}

fn main() -> anyhow::Result<ExitCode> {
    match Cli::parse().verb {
        Verb::Ci => ci::run(),
        Verb::Test => test::run(),
        Verb::Tidy => tidy::run(),
        Verb::Nostd => nostd::run(),
        Verb::Soak(soak) => soak::run(&soak),
        Verb::Papers(papers) => papers::run(&papers),
        Verb::Bench(bench) => bench::run(&bench),
    }
}
