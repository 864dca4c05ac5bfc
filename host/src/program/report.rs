//! The JSON report of a picture: `docs/REPORT.md` describes it, and its fields are kept.

use crate::picture::pending::Pending;
use anyhow::{Context, Result};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The whole report.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// What was drawn.
    pub scene: String,
    pub width: u32,
    pub height: u32,
    pub samples: u16,
    /// Hash of the accumulated picture before tone mapping: 16 hexadecimal digits.
    pub film: String,
    /// Whether every tile is finished.
    pub finished: bool,
    pub seconds: Seconds,
    pub rays: Rays,
    pub counts: Counts,
    pub memory: Memory,
    /// Which kernels ran.
    pub kernels: &'static str,
    /// The work of each node.
    pub nodes: Vec<Node>,
    pub warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct Seconds {
    pub import: f64,
    pub build: f64,
    /// From the first tile given out to the last one finished.
    pub trace: f64,
    pub total: f64,
}

#[derive(Debug, Serialize)]
pub(super) struct Rays {
    pub primary: u64,
    pub secondary: u64,
    pub shadow: u64,
}

#[derive(Debug, Serialize)]
pub(super) struct Counts {
    pub triangles: u64,
    pub spheres: u64,
    pub cones: u64,
    pub lights: u64,
    pub materials: u64,
    pub pages: u64,
    pub tiles: u32,
    pub hits: u64,
    pub contributions: u64,
    pub refused: u64,
    pub clamped: u64,
    /// Of all walks. These depend on the kernels and on bundles, and not on the picture alone.
    pub walk_nodes: u64,
    pub walk_blocks: u64,
    pub walk_pages: u64,
}

#[derive(Debug, Serialize)]
pub(super) struct Memory {
    pub page_bytes: u64,
    pub directory_bytes: u64,
    pub table_bytes: u64,
    /// Most that this process held at once, as far as the system tells.
    pub peak_bytes: Option<u64>,
    pub peak_bytes_per_primitive: Option<f64>,
}

#[derive(Debug, Serialize)]
pub(super) struct Node {
    pub node: usize,
    pub tiles: u32,
    pub runs: u32,
    pub rays: u64,
    pub busy_seconds: f64,
}

/// Most bytes that this process held at once; known on Linux only.
pub(super) fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// Where a report goes, opened before there is one.
pub(super) struct ReportFile {
    path: PathBuf,
    /// `None` is standard output.
    pending: Option<Pending>,
}

impl ReportFile {
    /// Opens `path`, `-` being standard output.
    pub fn create(path: &Path) -> Result<Self> {
        let pending = if path == Path::new("-") {
            None
        } else {
            let name = path.display();
            Some(Pending::create(path).with_context(|| format!("{name}: a report cannot be written there"))?)
        };
        Ok(Self { path: path.to_owned(), pending })
    }

    /// Writes the report, whole or not at all.
    pub fn write(self, report: &impl Serialize) -> Result<()> {
        self.write_text(&format!("{}\n", serde_json::to_string_pretty(report)?))
    }

    /// Writes a report of any other form, whole or not at all.
    pub fn write_text(self, text: &str) -> Result<()> {
        let write = || -> std::io::Result<()> {
            match self.pending {
                Some(mut pending) => {
                    pending.file()?.write_all(text.as_bytes())?;
                    pending.commit()
                }
                None => std::io::stdout().write_all(text.as_bytes()),
            }
        };
        write().with_context(|| format!("{}: the report cannot be written", self.path.display()))
    }
}
