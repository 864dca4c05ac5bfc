//! `cargo xtask test`: what the README tells a newcomer to type.
//!
//! It runs the same steps as `cargo xtask ci`, so that what passes here passes there. A distribution's Rust may come
//! without rustfmt or clippy: those steps are then skipped by name. A failure does not end the run, because somebody who
//! is about to mend one thing wants to hear of the others too.

use std::process::ExitCode;

use crate::gate::{self, Manner};

/// Runs every step whose tools are present; prints last what each came to.
pub fn run() -> anyhow::Result<ExitCode> {
    gate::run(Manner { missing_tool_fails: false, stop_at_first_failure: false })
}
