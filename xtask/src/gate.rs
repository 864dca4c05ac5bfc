//! The steps that `ci` and `test` share, and the one runner of both.

use std::fmt;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use crate::tools::{Counts, Tools};
use crate::workspace::Workspace;
use crate::{nostd, tidy};

/// In what two verbs differ that run the same steps.
#[derive(Clone, Copy)]
pub struct Manner {
    /// A missing rustfmt or clippy fails the gate; otherwise the step is skipped.
    pub missing_tool_fails: bool,
    /// The first failure is the last step.
    pub stop_at_first_failure: bool,
}

/// What a step came to. The texts are for people: one line each, and never empty where something went wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It passed; the note says what is worth a word, or nothing.
    Ok(String),
    /// It could not run here, and why; the code is not to blame.
    Skipped(String),
    /// It did not pass, and how.
    Failed(String),
}

impl Outcome {
    /// Passed or failed by a command's exit status.
    pub fn of(passed: bool, complaint: &str) -> Self {
        if passed { Self::Ok(String::new()) } else { Self::Failed(complaint.to_owned()) }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok(note) if note.is_empty() => f.write_str("ok"),
            Self::Ok(note) => write!(f, "ok ({note})"),
            Self::Skipped(why) => write!(f, "skipped: {why}"),
            Self::Failed(how) => write!(f, "FAILED: {how}"),
        }
    }
}

/// What a step may look at, and the one thing that steps add up.
struct Gate<'a> {
    tools: &'a Tools,
    workspace: &'a Workspace,
    manner: Manner,
    tests: Counts,
}

type Step = (&'static str, fn(&mut Gate<'_>) -> anyhow::Result<Outcome>);

/// Cheap checks first, so that a slip in the format is told in a second; the bare build last, since it may be skipped.
const STEPS: [Step; 7] = [
    ("format", format),
    ("tidy", |gate| tidy::outcome(gate.workspace)),
    ("clippy", clippy),
    ("tests", tests),
    ("tests, release, portable kernels", portable_tests),
    ("documentation", documentation),
    ("no_std", |gate| nostd::outcome(gate.tools, gate.workspace)),
];

/// Runs the steps in order, in the given manner. Prints a summary, the number of tests and, last, the verdict.
pub fn run(manner: Manner) -> anyhow::Result<ExitCode> {
    let tools = Tools::find();
    let workspace = Workspace::load(&tools)?;
    let mut gate = Gate { tools: &tools, workspace: &workspace, manner, tests: Counts::default() };
    let mut results = Vec::new();
    for (name, step) in STEPS {
        println!("\n== {name}");
        let start = Instant::now();
        let outcome = step(&mut gate).unwrap_or_else(|error| Outcome::Failed(format!("{error:#}")));
        let time = start.elapsed();
        println!("== {name}: {outcome}, {:.1} s", time.as_secs_f32());
        let failed = matches!(outcome, Outcome::Failed(_));
        results.push((name, outcome, time));
        if failed && manner.stop_at_first_failure {
            break;
        }
    }
    println!("\n{}", summary(&results));
    println!("{}", gate.tests);
    let (verdict, passed) = verdict(&results);
    println!("{verdict}");
    Ok(if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// One line for each step that ran: name, seconds, outcome.
fn summary(results: &[(&str, Outcome, Duration)]) -> String {
    let width = results.iter().map(|(name, ..)| name.len()).max().unwrap_or(0);
    let line = |(name, outcome, time): &(&str, Outcome, Duration)| {
        format!("{name:width$} {:8.1} s  {outcome}", time.as_secs_f32())
    };
    results.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// The last line, and whether the gate passed. A skipped step is named in it: a pass must not look fuller than it was.
fn verdict(results: &[(&str, Outcome, Duration)]) -> (String, bool) {
    let names = |wanted: fn(&Outcome) -> bool| {
        let named: Vec<_> = results.iter().filter(|(_, outcome, _)| wanted(outcome)).map(|(name, ..)| *name).collect();
        (!named.is_empty()).then(|| named.join("; "))
    };
    if let Some(failed) = names(|outcome| matches!(outcome, Outcome::Failed(_))) {
        return (format!("gate: FAILED at {failed}"), false);
    }
    match names(|outcome| matches!(outcome, Outcome::Skipped(_))) {
        Some(skipped) => (format!("gate: passed, without {skipped}"), true),
        None => ("gate: passed".to_owned(), true),
    }
}

fn format(gate: &mut Gate<'_>) -> anyhow::Result<Outcome> {
    if !gate.tools.has("fmt") {
        return Ok(missing("rustfmt", gate.manner));
    }
    let passed = gate.tools.run(&["fmt", "--all", "--check"], &[])?;
    Ok(Outcome::of(passed, "cargo fmt --all"))
}

fn clippy(gate: &mut Gate<'_>) -> anyhow::Result<Outcome> {
    if !gate.tools.has("clippy") {
        return Ok(missing("clippy", gate.manner));
    }
    let passed = gate.tools.run(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"], &[])?;
    Ok(Outcome::of(passed, "cargo clippy --workspace --all-targets -- -D warnings"))
}

fn tests(gate: &mut Gate<'_>) -> anyhow::Result<Outcome> {
    count(gate, &["test", "--workspace", "--no-fail-fast"], &[])
}

/// The whole system once more as it is shipped, and by the walk that every processor has: the picture must be the same.
fn portable_tests(gate: &mut Gate<'_>) -> anyhow::Result<Outcome> {
    let portable = [("HYBRAY_KERNELS", "portable")];
    count(gate, &["test", "--release", "--package", "hybray-tests", "--no-fail-fast"], &portable)
}

fn documentation(gate: &mut Gate<'_>) -> anyhow::Result<Outcome> {
    let passed = gate.tools.run(&["doc", "--workspace", "--no-deps"], &[("RUSTDOCFLAGS", "-D warnings")])?;
    Ok(Outcome::of(passed, "RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps"))
}

fn count(gate: &mut Gate<'_>, arguments: &[&str], env: &[(&str, &str)]) -> anyhow::Result<Outcome> {
    let (passed, counts) = gate.tools.run_tests(arguments, env)?;
    gate.tests += counts;
    Ok(judge_tests(passed, counts))
}

/// A run that passes because it holds no test has checked nothing.
fn judge_tests(passed: bool, counts: Counts) -> Outcome {
    match (passed, counts.passed) {
        (true, 0) => Outcome::Failed("no test ran".to_owned()),
        (true, n) => Outcome::Ok(format!("{n} passed")),
        (false, _) if counts.failed == 0 => Outcome::Failed("it does not build, or a test run broke off".to_owned()),
        (false, _) => Outcome::Failed(format!("{} tests failed", counts.failed)),
    }
}

fn missing(tool: &str, manner: Manner) -> Outcome {
    if manner.missing_tool_fails {
        Outcome::Failed(format!("no {tool}; get it with: rustup component add {tool}"))
    } else {
        Outcome::Skipped(format!("no {tool}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn results(outcomes: &[Outcome]) -> Vec<(&'static str, Outcome, Duration)> {
        let names = ["format", "tidy", "clippy", "tests"];
        names.into_iter().zip(outcomes).map(|(name, outcome)| (name, outcome.clone(), Duration::from_secs(1))).collect()
    }

    fn check_verdict(outcomes: &[Outcome], expected: (&str, bool)) {
        let (line, passed) = verdict(&results(outcomes));
        assert_eq!((line.as_str(), passed), expected);
    }

    fn ok() -> Outcome {
        Outcome::Ok(String::new())
    }

    fn skipped() -> Outcome {
        Outcome::Skipped("no clippy".to_owned())
    }

    fn failed() -> Outcome {
        Outcome::Failed("3 tests failed".to_owned())
    }

    #[test]
    fn the_last_line_names_what_failed_or_was_left_out() {
        check_verdict(&[ok(), ok()], ("gate: passed", true));
        check_verdict(&[ok(), ok(), skipped(), ok()], ("gate: passed, without clippy", true));
        check_verdict(&[ok(), failed()], ("gate: FAILED at tidy", false));
        check_verdict(&[failed(), ok(), skipped(), failed()], ("gate: FAILED at format; tests", false));
    }

    #[test]
    fn the_summary_has_a_line_for_each_step() {
        let text = summary(&results(&[ok(), Outcome::Ok("8 checks".to_owned()), skipped(), failed()]));
        let expected = [
            "format      1.0 s  ok",
            "tidy        1.0 s  ok (8 checks)",
            "clippy      1.0 s  skipped: no clippy",
            "tests       1.0 s  FAILED: 3 tests failed",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_run_without_tests_does_not_pass() {
        let counts = |passed, failed| Counts { passed, failed, ignored: 1 };
        assert_eq!(judge_tests(true, counts(0, 0)), Outcome::Failed("no test ran".to_owned()));
        assert_eq!(judge_tests(true, counts(5, 0)), Outcome::Ok("5 passed".to_owned()));
        assert_eq!(judge_tests(false, counts(5, 2)), Outcome::Failed("2 tests failed".to_owned()));
        assert!(matches!(judge_tests(false, counts(5, 0)), Outcome::Failed(how) if how.contains("build")));
    }

    #[test]
    fn a_missing_tool_fails_the_gate_and_is_skipped_in_the_test() {
        let manner = |missing_tool_fails| Manner { missing_tool_fails, stop_at_first_failure: false };
        assert!(matches!(missing("clippy", manner(true)), Outcome::Failed(_)));
        assert_eq!(missing("clippy", manner(false)), Outcome::Skipped("no clippy".to_owned()));
    }
}
