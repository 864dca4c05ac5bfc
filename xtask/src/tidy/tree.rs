//! The files that belong to the project.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::Context as _;

use crate::workspace::relative;

/// Every file by its path from the root, with its text; a file that is not text has none.
pub struct Tree {
    files: BTreeMap<String, Option<String>>,
}

/// Left out where git cannot be asked, as in an unpacked source archive.
const NOT_OURS: [&str; 2] = ["target", ".git"];

impl Tree {
    /// Reads the files that git tracks or would track: a new file is checked before it is added.
    ///
    /// # Errors
    /// When a file that is there cannot be read.
    pub fn read(root: &Path) -> anyhow::Result<Self> {
        let names = match git_files(root) {
            Some(names) => names,
            None => walk(root)?,
        };
        let mut files = BTreeMap::new();
        for name in names {
            let path = root.join(&name);
            // A tracked file may be deleted, and a link may lead anywhere: neither is text of ours.
            if fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_file()) {
                let bytes = fs::read(&path).with_context(|| format!("reading {name}"))?;
                files.insert(name, text(bytes));
            }
        }
        Ok(Self { files })
    }

    /// A made-up tree.
    #[cfg(test)]
    pub fn of(files: &[(&str, &str)]) -> Self {
        let text_of = |&(path, text): &(&str, &str)| (path.to_owned(), Some(text.to_owned()));
        Self { files: files.iter().map(text_of).collect() }
    }

    /// The number of files.
    pub fn len(&self) -> usize {
        self.files.len()
    }

    /// The text files, in the order of their paths.
    pub fn texts(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().filter_map(|(path, text)| Some((path.as_str(), text.as_deref()?)))
    }

    /// The Rust files.
    pub fn rust(&self) -> impl Iterator<Item = (&str, &str)> {
        self.texts().filter(|(path, _)| path.ends_with(".rs"))
    }

    /// The Rust files of libraries and programs, not of their tests, examples and benchmarks.
    pub fn rust_sources(&self) -> impl Iterator<Item = (&str, &str)> {
        self.rust().filter(|(path, _)| path.contains("/src/"))
    }

    /// The text of one file.
    pub fn text(&self, path: &str) -> Option<&str> {
        self.files.get(path)?.as_deref()
    }

    /// Whether there is such a file, or a folder that holds one.
    pub fn has(&self, path: &str) -> bool {
        let folder = if path.is_empty() { String::new() } else { format!("{path}/") };
        self.files.contains_key(path)
            || self.files.range(folder.clone()..).next().is_some_and(|(file, _)| file.starts_with(&folder))
    }
}

/// A zero byte near the beginning marks what is not text; so does what is not UTF-8.
fn text(bytes: Vec<u8>) -> Option<String> {
    let is_binary = bytes.iter().take(8192).any(|&byte| byte == 0);
    if is_binary { None } else { String::from_utf8(bytes).ok() }
}

/// What git lists below the root, unless there is no git, no repository, or it refuses (a clone of another user's).
fn git_files(root: &Path) -> Option<Vec<String>> {
    let mut git = Command::new("git");
    git.args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]).current_dir(root).stdin(Stdio::null());
    let answer = git.output().ok().filter(|answer| answer.status.success())?;
    let list = String::from_utf8_lossy(&answer.stdout).into_owned();
    let names: Vec<_> = list.split('\0').filter(|name| !name.is_empty()).map(str::to_owned).collect();
    // An archive unpacked inside somebody else's repository that ignores it.
    (!names.is_empty()).then_some(names)
}

fn walk(root: &Path) -> anyhow::Result<Vec<String>> {
    let mut names = Vec::new();
    let mut folders: Vec<PathBuf> = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).with_context(|| format!("listing {}", folder.display()))? {
            let entry = entry?;
            let kind = entry.file_type()?;
            if kind.is_dir() && !NOT_OURS.iter().any(|name| entry.file_name() == *name) {
                folders.push(entry.path());
            } else if kind.is_file() {
                names.push(relative(&entry.path(), root));
            }
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_folders_are_found() {
        let tree = Tree::of(&[("docs/WIRE.md", ""), ("docs-old/x", ""), ("README.md", "")]);
        for path in ["docs", "docs/WIRE.md", "docs-old", "README.md", ""] {
            assert!(tree.has(path), "{path}");
        }
        for path in ["doc", "docs/WIRE", "docs/WIRE.md/x", "READ", "docs/x"] {
            assert!(!tree.has(path), "{path}");
        }
    }

    #[test]
    fn pictures_have_no_text() {
        assert_eq!(text(b"P6\n\0\0".to_vec()), None);
        assert_eq!(text(vec![0xff, 0xfe, b'a']), None);
        assert_eq!(text(b"plain".to_vec()), Some("plain".to_owned()));
    }

    #[test]
    fn git_and_the_walk_see_this_file() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let this = "src/tidy/tree.rs";
        assert!(walk(root).unwrap().iter().any(|name| name == this));
        assert!(Tree::read(root).unwrap().text(this).is_some_and(|text| text.contains("git_and_the_walk")));
    }

    #[test]
    fn sources_are_below_src() {
        let tree = Tree::of(&[("a/src/lib.rs", ""), ("a/tests/t.rs", ""), ("a/src/note.md", "")]);
        assert_eq!(tree.rust_sources().map(|(path, _)| path).collect::<Vec<_>>(), ["a/src/lib.rs"]);
        assert_eq!(tree.rust().count(), 2);
    }
}
