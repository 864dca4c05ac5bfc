//! `cargo xtask tidy`: what the compiler does not check.
//!
//! Each check is a function from the tree and the workspace to a list of problems, knows nothing of the disk, and is
//! tested on a made-up tree that it must refuse. All checks run, and all problems are printed.

mod arrows;
mod links;
mod machine_paths;
mod manifests;
mod rust_text;
mod safety;
mod size;
mod stubs;
mod tree;
mod wire_pin;

use std::fmt;
use std::process::ExitCode;

use crate::gate::Outcome;
use crate::tools::Tools;
use crate::workspace::{Member, Workspace};
use tree::Tree;

/// One thing to mend: where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Problem {
    /// A file or folder, relative to the root.
    path: String,
    /// Counted from one; zero where the whole file is meant.
    line: usize,
    /// What is wrong, and where it helps, what to do.
    what: String,
}

impl Problem {
    fn at(path: &str, line: usize, what: impl Into<String>) -> Self {
        Self { path: path.to_owned(), line, what: what.into() }
    }

    fn of(path: &str, what: impl Into<String>) -> Self {
        Self::at(path, 0, what)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.path, self.what),
            line => write!(f, "{}:{line}: {}", self.path, self.what),
        }
    }
}

type Check = (&'static str, fn(&Tree, &[Member]) -> Vec<Problem>);

const CHECKS: [Check; 8] = [
    ("arrows between crates", arrows::check),
    ("no_std and unsafe code", safety::check),
    ("machine paths", machine_paths::check),
    ("descriptions and first sentences", manifests::check),
    ("size of files", size::check),
    ("the wire page's pin", wire_pin::check),
    ("links", links::check),
    ("unfinished code", stubs::check),
];

/// Prints every problem, and fails when there is one.
pub fn run() -> anyhow::Result<ExitCode> {
    let outcome = outcome(&Workspace::load(&Tools::find())?)?;
    println!("tidy: {outcome}");
    Ok(if matches!(outcome, Outcome::Failed(_)) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Runs every check on the workspace as it stands on the disk; prints the problems under the name of their check.
///
/// # Errors
/// When a file of the tree cannot be read.
pub fn outcome(workspace: &Workspace) -> anyhow::Result<Outcome> {
    let tree = Tree::read(&workspace.root)?;
    let mut count = 0;
    for (name, check) in CHECKS {
        let mut problems = check(&tree, &workspace.crates);
        problems.sort();
        if !problems.is_empty() {
            println!("{name}:");
        }
        for problem in &problems {
            println!("  {problem}");
        }
        count += problems.len();
    }
    Ok(match count {
        0 => Outcome::Ok(format!("{} checks, {} files", CHECKS.len(), tree.len())),
        1 => Outcome::Failed("1 problem".to_owned()),
        n => Outcome::Failed(format!("{n} problems")),
    })
}

/// What the checks' tests share.
#[cfg(test)]
mod testing {
    use super::*;
    use crate::workspace::Use;

    /// A crate that uses the named others; a name after `dev:` is used by its tests only. Its package is named after
    /// the last part of its folder.
    pub fn member(folder: &str, uses: &[&str]) -> Member {
        let arrow = |name: &&str| match name.strip_prefix("dev:") {
            Some(name) => Use { name: name.to_owned(), dev_only: true },
            None => Use { name: (*name).to_owned(), dev_only: false },
        };
        Member {
            name: folder.rsplit('/').next().unwrap().to_owned(),
            folder: folder.to_owned(),
            description: "What it is for".to_owned(),
            roots: vec![format!("{folder}/src/lib.rs")],
            uses: uses.iter().map(arrow).collect(),
        }
    }

    /// The problems as they are printed, in order.
    pub fn lines(mut problems: Vec<Problem>) -> Vec<String> {
        problems.sort();
        problems.iter().map(Problem::to_string).collect()
    }
}
