//! `cargo xtask papers`: the papers' experiments on the simulator, which write the tables of `docs/PAPERS.md`.
//!
//! The experiments are `tests/examples/papers`: calls of the library, since a process for every run would build its scene
//! again.

use std::process::ExitCode;

use clap::Args;

use crate::tools::Tools;

/// Which tables.
#[derive(Args)]
pub struct Papers {
    /// Print these tables instead of writing the page, such as 6.4,reach
    #[arg(long, value_name = "NAME,..")]
    only: Option<String>,
    /// Run what takes long, too: 1,024 nodes
    #[arg(long)]
    full: bool,
}

/// Runs them in a release build.
pub fn run(papers: &Papers) -> anyhow::Result<ExitCode> {
    let mut arguments = vec!["run", "--release", "--package", "hybray-tests", "--example", "papers", "--"];
    if let Some(only) = &papers.only {
        arguments.extend(["--only", only]);
    }
    if papers.full {
        arguments.push("--full");
    }
    Ok(if Tools::find().run(&arguments, &[])? { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
