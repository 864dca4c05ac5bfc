//! `cargo xtask nostd`: the core crates, built for a machine without an operating system.
//!
//! Building is the proof that nothing below reaches for `std` or an allocator. It needs a core library for such a
//! machine, which comes in one of two ways: built, as a rustup target, or as source, as rustup's `rust-src` or as a
//! package of the distribution (Debian's `rustc-web` with `rust-web-src`, or its `rust-src`). Where there is neither, the
//! step is skipped and says how to get one.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::{env, fs};

use anyhow::Context as _;

use crate::gate::Outcome;
use crate::tools::Tools;
use crate::workspace::Workspace;

/// Targets for which a built core library may be installed, in the order in which they are tried: the first board's,
/// a 32-bit one, and one without vectors on a processor that everybody has.
const TARGETS: [&str; 3] = ["riscv64gc-unknown-none-elf", "thumbv7em-none-eabihf", "x86_64-unknown-none"];

/// Where a distribution puts its compiler, beside the one that rustup put first.
const DISTRIBUTIONS_RUSTC: &str = "/usr/bin/rustc";

const HOW_TO_GET_ONE: &str = "get one with: rustup target add \
    riscv64gc-unknown-none-elf (or on Debian: apt-get install rustc-web rust-web-src)";

/// Builds, and prints what it came to.
pub fn run() -> anyhow::Result<ExitCode> {
    let tools = Tools::find();
    let outcome = outcome(&tools, &Workspace::load(&tools)?)?;
    println!("nostd: {outcome}");
    Ok(if matches!(outcome, Outcome::Failed(_)) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Builds every bare crate without its features, in a target folder of its own. Another core library means other builds
/// of everything, so that sharing one would throw away the tests' builds.
///
/// # Errors
/// When cargo cannot be started, or the probe's files cannot be written.
pub fn outcome(tools: &Tools, workspace: &Workspace) -> anyhow::Result<Outcome> {
    let Some(route) = Route::find() else {
        return Ok(Outcome::Skipped(format!("no core library for a bare machine; {HOW_TO_GET_ONE}")));
    };
    println!("{}", route.describe());
    let folder = workspace.target.join("nostd");
    let bare = workspace.crates.iter().filter(|member| member.is_bare()).map(|member| member.name.as_str());
    let mut arguments = vec!["--no-default-features"];
    bare.for_each(|name| arguments.extend(["--package", name]));
    if build(tools, &route, &arguments, &workspace.root.join("Cargo.toml"), &folder)? {
        return Ok(Outcome::Ok(route.target.to_owned()));
    }
    // A compiler and a cargo of different ages may not get on, and source needs its own packages from the registry:
    // an empty crate tells whether it was that.
    println!("it failed; does an empty crate build?");
    let probe = write_probe(&folder.join("probe"))?;
    if build(tools, &route, &[], &probe, &folder.join("probe/target"))? {
        Ok(Outcome::Failed(format!("a core crate does not build for {}", route.target)))
    } else {
        let what = format!("the core library for {} does not build here; {HOW_TO_GET_ONE}", route.target);
        Ok(Outcome::Skipped(what))
    }
}

/// A way to a core library for a bare machine.
#[derive(Debug, PartialEq, Eq)]
struct Route {
    target: &'static str,
    rustc: PathBuf,
    /// The library has to be built too, which a released cargo and compiler do only when told to take themselves for
    /// nightly ones.
    from_source: bool,
}

impl Route {
    /// What is installed, best first: a built library before source, the user's compiler before the distribution's.
    fn find() -> Option<Self> {
        let ours = PathBuf::from(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        let compilers = [ours.clone(), PathBuf::from(DISTRIBUTIONS_RUSTC)];
        let built = TARGETS.into_iter().find(|target| has_built_core(&ours, target));
        let built = built.map(|target| Self { target, rustc: ours, from_source: false });
        built.or_else(|| {
            let rustc = compilers.into_iter().find(|rustc| has_core_source(rustc))?;
            Some(Self { target: TARGETS[0], rustc, from_source: true })
        })
    }

    fn describe(&self) -> String {
        let how = if self.from_source { "from source" } else { "built" };
        format!("core library for {}: {how}, by {}", self.target, self.rustc.display())
    }
}

fn has_built_core(rustc: &Path, target: &str) -> bool {
    ask(rustc, &["--print", "target-libdir", "--target", target]).is_some_and(|folder| holds_core(Path::new(&folder)))
}

fn holds_core(folder: &Path) -> bool {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    files.map(|file| file.file_name()).any(|name| {
        let name = name.to_string_lossy();
        name.starts_with("libcore-") && name.ends_with(".rlib")
    })
}

fn has_core_source(rustc: &Path) -> bool {
    let library = |sysroot| Path::new(&sysroot).join("lib/rustlib/src/rust/library");
    // Without the lock file, a cargo would choose versions that the library was never built with.
    ask(rustc, &["--print", "sysroot"])
        .map(library)
        .is_some_and(|library| ["core/src/lib.rs", "Cargo.lock"].iter().all(|file| library.join(file).is_file()))
}

/// The first line of a compiler's answer.
fn ask(rustc: &Path, arguments: &[&str]) -> Option<String> {
    let answer = Command::new(rustc).args(arguments).stdin(Stdio::null()).output().ok()?;
    let text = String::from_utf8(answer.stdout).ok().filter(|_| answer.status.success())?;
    text.lines().next().map(str::to_owned)
}

fn build(tools: &Tools, route: &Route, arguments: &[&str], manifest: &Path, folder: &Path) -> anyhow::Result<bool> {
    let mut command = tools.cargo(&["build", "--target", route.target]);
    command.args(arguments).arg("--manifest-path").arg(manifest).arg("--target-dir").arg(folder);
    if route.from_source {
        command.arg("-Zbuild-std=core").env("RUSTC_BOOTSTRAP", "1").env("RUSTC", &route.rustc);
    }
    println!("$ cargo {}", command.get_args().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join(" "));
    Ok(command.status().context("cargo does not start")?.success())
}

/// A library with nothing in it, in a workspace of its own; the path of its manifest.
fn write_probe(folder: &Path) -> anyhow::Result<PathBuf> {
    fs::create_dir_all(folder.join("src")).with_context(|| format!("making {}", folder.display()))?;
    fs::write(folder.join("src/lib.rs"), "#![no_std]\n")?;
    let manifest = folder.join("Cargo.toml");
    fs::write(&manifest, "[package]\nname = \"probe\"\nedition = \"2024\"\n\n[workspace]\n")?;
    Ok(manifest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_core_library_is_told_from_an_empty_folder() {
        let rustc = PathBuf::from(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        let host = ask(&rustc, &["--print", "host-tuple"]).expect("the compiler that built this answers");
        assert!(has_built_core(&rustc, &host));
        assert!(!has_built_core(&rustc, "no-such-target"));
        assert!(!has_built_core(Path::new("no-such-rustc"), &host));
        assert!(!holds_core(Path::new(env!("CARGO_MANIFEST_DIR"))));
        assert!(!has_core_source(Path::new("no-such-rustc")));
    }

    #[test]
    fn the_probe_is_a_workspace_of_its_own() {
        let folder = env::temp_dir().join(format!("hybray-probe-{}", std::process::id()));
        let manifest = write_probe(&folder).unwrap();
        let tools = Tools::find();
        let mut metadata = tools.cargo(&["metadata", "--no-deps", "--offline", "--format-version", "1"]);
        let answer = metadata.arg("--manifest-path").arg(&manifest).output().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    }
}
