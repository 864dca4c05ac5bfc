//! `cargo xtask soak`: the random schedules of `tests/tests/soak.rs`, thousands of them, in a release build.

use std::process::{Command, ExitCode};

use clap::Args;

/// Which seeds.
#[derive(Args)]
pub struct Soak {
    /// How many
    #[arg(long, default_value_t = 10_000)]
    seeds: u64,
    /// The first of them
    #[arg(long, default_value_t = 0)]
    first: u64,
}

/// Runs them on all cores.
pub fn run(soak: &Soak) -> anyhow::Result<ExitCode> {
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["test", "--release", "-p", "hybray-tests", "--test", "soak", "--", "--nocapture"])
        .env("HYBRAY_SEEDS", soak.seeds.to_string())
        .env("HYBRAY_FIRST", soak.first.to_string())
        .status()?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
