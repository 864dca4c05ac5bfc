//! What cargo knows about the workspace: its crates, where they stand, what they use.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Deserialize;

use crate::tools::Tools;

/// The workspace as `cargo metadata` tells it; all paths of crates and files are relative to the root, with `/`.
pub struct Workspace {
    /// The folder of the top manifest.
    pub root: PathBuf,
    /// Where cargo builds.
    pub target: PathBuf,
    /// Every member.
    pub crates: Vec<Member>,
}

/// One crate of ours.
#[derive(Clone, Debug, Default)]
pub struct Member {
    /// Its package name.
    pub name: String,
    /// Its folder, such as `core/wire`.
    pub folder: String,
    /// What its manifest says of it, or nothing.
    pub description: String,
    /// The first file of its library and of each of its programs.
    pub roots: Vec<String>,
    /// The other members that it uses.
    pub uses: Vec<Use>,
}

/// An arrow from one crate to another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Use {
    /// Package name of the crate that is used.
    pub name: String,
    /// Only its tests, examples and benchmarks use it.
    pub dev_only: bool,
}

impl Member {
    /// Whether the crate must run without an operating system: the core, the transport trait and the nodes' loop.
    pub fn is_bare(&self) -> bool {
        self.folder.starts_with("core/") || ["transport/link", "nodes/runner"].contains(&self.folder.as_str())
    }
}

impl Workspace {
    /// Asks cargo, in the current folder.
    ///
    /// # Errors
    /// When cargo does not start or refuses a manifest (its own words are passed on), or answers in another form.
    pub fn load(tools: &Tools) -> anyhow::Result<Self> {
        let mut ask = tools.cargo(&["metadata", "--no-deps", "--format-version", "1"]);
        let answer = ask.output().context("cargo does not start")?;
        let complaint = String::from_utf8_lossy(&answer.stderr);
        anyhow::ensure!(answer.status.success(), "cargo metadata: {}", complaint.trim());
        Self::parse(&answer.stdout)
    }

    /// Reads the output of `cargo metadata --no-deps --format-version 1`.
    fn parse(json: &[u8]) -> anyhow::Result<Self> {
        let raw: Metadata = serde_json::from_slice(json).context("cargo metadata answered in an unknown form")?;
        let names: Vec<_> = raw.packages.iter().map(|package| package.name.clone()).collect();
        let crates = raw.packages.into_iter().map(|package| package.into_member(&raw.workspace_root, &names)).collect();
        Ok(Self { root: raw.workspace_root, target: raw.target_directory, crates })
    }
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    workspace_root: PathBuf,
    target_directory: PathBuf,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    description: Option<String>,
    manifest_path: PathBuf,
    dependencies: Vec<Dependency>,
    targets: Vec<Target>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    kind: Option<String>,
    path: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
    src_path: PathBuf,
}

impl Package {
    fn into_member(self, root: &Path, members: &[String]) -> Member {
        let is_root = |target: &&Target| target.kind.iter().any(|kind| kind == "bin" || kind.ends_with("lib"));
        let roots = self.targets.iter().filter(|target| is_root(target) || target.kind == ["proc-macro"]);
        // A crate of the same name from the registry would have no path.
        let ours = self.dependencies.into_iter().filter(|used| used.path.is_some() && members.contains(&used.name));
        Member {
            folder: self.manifest_path.parent().map(|folder| relative(folder, root)).unwrap_or_default(),
            description: self.description.unwrap_or_default(),
            roots: roots.map(|target| relative(&target.src_path, root)).collect(),
            uses: ours.map(|used| Use { dev_only: used.kind.as_deref() == Some("dev"), name: used.name }).collect(),
            name: self.name,
        }
    }
}

/// A path below `root`, with `/` on every system.
pub fn relative(path: &Path, root: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANSWER: &str = r#"{
        "workspace_root": "/house", "target_directory": "/house/target", "version": 1,
        "packages": [
            { "name": "wire", "description": "Messages", "manifest_path": "/house/core/wire/Cargo.toml",
              "dependencies": [
                { "name": "geometry", "kind": null, "path": "/house/core/geometry" },
                { "name": "serde", "kind": null },
                { "name": "checks", "kind": "dev", "path": "/house/checks" },
                { "name": "elsewhere", "kind": null, "path": "/elsewhere" } ],
              "targets": [
                { "kind": ["lib"], "src_path": "/house/core/wire/src/lib.rs" },
                { "kind": ["example"], "src_path": "/house/core/wire/examples/show.rs" },
                { "kind": ["bin"], "src_path": "/house/core/wire/src/main.rs" } ] },
            { "name": "geometry", "description": null, "manifest_path": "/house/core/geometry/Cargo.toml",
              "dependencies": [], "targets": [] },
            { "name": "checks", "description": "", "manifest_path": "/house/checks/Cargo.toml",
              "dependencies": [], "targets": [] } ] }"#;

    #[test]
    fn cargos_answer_is_read() {
        let workspace = Workspace::parse(ANSWER.as_bytes()).unwrap();
        assert_eq!(workspace.target, Path::new("/house/target"));
        let wire = &workspace.crates[0];
        assert_eq!((wire.folder.as_str(), wire.description.as_str()), ("core/wire", "Messages"));
        assert_eq!(wire.roots, ["core/wire/src/lib.rs", "core/wire/src/main.rs"]);
        let uses = |name: &str, dev_only| Use { name: name.to_owned(), dev_only };
        assert_eq!(wire.uses, [uses("geometry", false), uses("checks", true)]);
        assert_eq!(workspace.crates[1].description, "");
    }

    #[test]
    fn another_form_is_an_error() {
        assert!(Workspace::parse(b"{}").is_err());
        assert!(Workspace::parse(b"error: no manifest").is_err());
    }

    #[test]
    fn the_bare_crates_are_the_core_the_trait_and_the_loop() {
        let bare = |folder: &str| Member { folder: folder.to_owned(), ..Member::default() }.is_bare();
        assert!(bare("core/wire") && bare("transport/link") && bare("nodes/runner"));
        assert!(!bare("transport/memory") && !bare("nodes/native") && !bare("host") && !bare("xtask"));
    }
}
