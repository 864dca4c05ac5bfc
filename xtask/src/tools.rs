//! The commands that the verbs call, and how: no standard input, their output left as it is.

use std::env;
use std::ffi::OsString;
use std::fmt;
use std::io::{self, BufRead, BufReader, Write};
use std::ops::AddAssign;
use std::process::{Command, Stdio};

use anyhow::Context as _;

/// The cargo that started us, so that every step uses one toolchain.
pub struct Tools {
    cargo: OsString,
}

impl Tools {
    /// `CARGO` is set by `cargo run`; the plain name serves when the program is started by hand.
    pub fn find() -> Self {
        Self { cargo: env::var_os("CARGO").unwrap_or_else(|| "cargo".into()) }
    }

    /// A cargo command that reads nothing from the user.
    pub fn cargo(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.cargo);
        command.args(arguments).stdin(Stdio::null());
        command
    }

    /// Whether `cargo VERB` is installed: rustup's stand-ins exist even where the component does not, so it is asked.
    pub fn has(&self, verb: &str) -> bool {
        let mut ask = self.cargo(&[verb, "--version"]);
        ask.stdout(Stdio::null()).stderr(Stdio::null());
        ask.status().is_ok_and(|status| status.success())
    }

    /// Runs cargo, with its output where ours goes; says whether it succeeded.
    ///
    /// # Errors
    /// When cargo cannot be started.
    pub fn run(&self, arguments: &[&str], env: &[(&str, &str)]) -> anyhow::Result<bool> {
        announce(arguments, env);
        let status = self.cargo(arguments).envs(env.iter().copied()).status();
        Ok(status.context("cargo does not start")?.success())
    }

    /// Runs `cargo test`, passes on every line as it comes, and adds up the lines `test result`.
    ///
    /// # Errors
    /// When cargo cannot be started, or its output cannot be read or passed on.
    pub fn run_tests(&self, arguments: &[&str], env: &[(&str, &str)]) -> anyhow::Result<(bool, Counts)> {
        announce(arguments, env);
        let mut command = self.cargo(arguments);
        let mut child = command.envs(env.iter().copied()).stdout(Stdio::piped()).spawn()?;
        let mut counts = Counts::default();
        if let Some(output) = child.stdout.take() {
            // Bytes, because a test may print what is not UTF-8.
            for line in BufReader::new(output).split(b'\n') {
                let line = line?;
                let mut out = io::stdout().lock();
                out.write_all(&line)?;
                out.write_all(b"\n")?;
                out.flush()?;
                counts += Counts::of_line(&String::from_utf8_lossy(&line)).unwrap_or_default();
            }
        }
        Ok((child.wait()?.success(), counts))
    }
}

/// Shows a command as it could be typed.
fn announce(arguments: &[&str], env: &[(&str, &str)]) {
    let settings: String = env.iter().map(|(name, value)| format!("{name}='{value}' ")).collect();
    println!("$ {settings}cargo {}", arguments.join(" "));
}

/// Numbers of tests, over any number of test programs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Tests that passed.
    pub passed: u64,
    /// Tests that failed.
    pub failed: u64,
    /// Tests marked `#[ignore]`.
    pub ignored: u64,
}

impl Counts {
    /// Reads cargo's `test result: ok. 3 passed; 0 failed; 1 ignored; ...`; any other line is `None`.
    fn of_line(line: &str) -> Option<Self> {
        let fields = line.trim().strip_prefix("test result: ")?.split_once(". ")?.1;
        let field = |name: &str| fields.split("; ").find_map(|field| field.strip_suffix(name)?.trim().parse().ok());
        Some(Self { passed: field("passed")?, failed: field("failed")?, ignored: field("ignored")? })
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.ignored += other.ignored;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tests: {} passed, {} failed, {} skipped", self.passed, self.failed, self.ignored)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(line: &str, expected: Option<(u64, u64, u64)>) {
        let expected = expected.map(|(passed, failed, ignored)| Counts { passed, failed, ignored });
        assert_eq!(Counts::of_line(line), expected, "{line}");
    }

    #[test]
    fn result_lines_are_read() {
        check(
            "test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 7 filtered out; finished in 0.01s",
            Some((3, 0, 1)),
        );
        check(
            "test result: FAILED. 12 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 1.00s",
            Some((12, 2, 0)),
        );
        check("test result: ok. many passed; 0 failed; 0 ignored", None);
        check("test tools::tests::result ... ok", None);
        check("running 3 tests", None);
        check("", None);
    }

    #[test]
    fn counts_add_up_and_read_as_one_line() {
        let mut sum = Counts { passed: 1, failed: 2, ignored: 3 };
        sum += Counts { passed: 10, failed: 20, ignored: 30 };
        assert_eq!(sum.to_string(), "tests: 11 passed, 22 failed, 33 skipped");
    }
}
