//! `cargo xtask ci`: the one gate before anything lands.
//!
//! A formatter or linter that is missing is a failure here, because a gate that checks less than it says is worse than
//! none. The build for a bare machine alone may be skipped, by name: no toolchain brings one without being asked.

use std::process::ExitCode;

use crate::gate::{self, Manner};

/// Runs the gate; prints each step with its time, and last the verdict.
pub fn run() -> anyhow::Result<ExitCode> {
    gate::run(Manner { missing_tool_fails: true, stop_at_first_failure: true })
}
