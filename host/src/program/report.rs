//! The JSON report of a picture: `docs/REPORT.md` describes it, and its fields are kept.

use crate::partition::Fit;
use crate::picture::pending::Pending;
use crate::simulate::record::QueueRun;
use anyhow::{Context, Result};
use hybray_native::Worked;
use hybray_scene::Line;
use hybray_scheduler::{HighWater, Plan};
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The whole report.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// What was drawn.
    pub scene: String,
    /// Name of its camera, where there are several views.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view: Option<String>,
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
    /// Of nodes with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<Budget>,
    /// Which kernels ran.
    pub kernels: &'static str,
    /// The work of each node.
    pub nodes: Vec<Node>,
    /// Layers that rays were traced for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub layers: Vec<LayerReport>,
    pub warnings: Vec<String>,
}

/// A layer of the view.
#[derive(Debug, Serialize)]
pub(super) struct LayerReport {
    pub layer: &'static str,
    /// Hash of its film.
    pub film: String,
    pub seconds: f64,
    /// Its rays, and those that hit something.
    pub primary: u64,
    pub hits: u64,
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
    /// Of them, those that were finished before.
    pub tiles_kept: u32,
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
    /// Of nodes with a budget.
    #[serde(skip_serializing_if = "Option::is_none", flatten)]
    pub exchange: Option<Exchange>,
}

/// What each node was given, and how it worked.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Budget {
    /// Of each node, bytes.
    pub memory: u64,
    pub scheduler: &'static str,
    pub granularity: u16,
    pub in_system: u32,
    /// Side in pixels.
    pub pyramid: u8,
    pub tiles: &'static str,
    pub nodes_with_tiles: usize,
    pub subhosts: u16,
    pub take_over: bool,
    /// Of the largest page.
    pub page_bytes_max: usize,
    pub voxels: u32,
    pub plan: PlanReport,
}

/// What each node's memory is spent on.
#[derive(Clone, Debug, Serialize)]
pub(super) struct PlanReport {
    pub terms: Vec<Term>,
    pub total_bytes: u64,
    /// Bytes for pages: those that stay, and the cache.
    pub page_memory: u64,
    /// Places of the cache, the lane's included.
    pub cache_places: usize,
    /// Whether every node has room for every page.
    pub holds_all: bool,
    /// Bytes of pages, of the node that owns least.
    pub owned_bytes_least: u64,
    /// Of the one that owns most.
    pub owned_bytes_most: u64,
    /// Pages of others that the node has from the beginning which has fewest of them, those of light caches included; 0 where
    /// every node has all pages.
    pub copies_least: usize,
    /// That the one has which has most.
    pub copies_most: usize,
    pub light_caches: LightCachesReport,
}

/// What nodes have of others' pages towards the lights.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LightCachesReport {
    /// Lights that pages are kept for: all, or 0 if there are no light caches.
    pub lights: usize,
    /// Pages of the node that has fewest.
    pub pages_least: usize,
    /// Of the one that has most.
    pub pages_most: usize,
    /// Bytes of pages, in whole lines, of the node that has most bytes.
    pub bytes: u64,
}

#[derive(Clone, Debug, Serialize)]
pub(super) struct Term {
    pub name: &'static str,
    pub count: u64,
    pub bytes_each: u64,
    /// Rounded up to whole lines of 64.
    pub bytes: u64,
}

impl PlanReport {
    /// The plan of a scene with so many lights.
    pub fn of(fit: &Fit, lights: usize) -> Self {
        let sum = fit.plan.sum();
        let caches = &fit.light_caches;
        let pages = || caches.pages.iter().map(Vec::len);
        let light_caches = LightCachesReport {
            lights: if caches.pages.is_empty() { 0 } else { lights },
            pages_least: pages().min().unwrap_or(0),
            pages_most: pages().max().unwrap_or(0),
            bytes: caches.bytes,
        };
        let terms = sum.terms().iter().map(|term| Term {
            name: term.name,
            count: term.count,
            bytes_each: term.bytes_each,
            bytes: term.bytes,
        });
        Self {
            terms: terms.collect(),
            total_bytes: sum.total_bytes(),
            page_memory: (fit.plan.lines * size_of::<Line>()) as u64,
            cache_places: fit.plan.places,
            holds_all: fit.plan.holds_all,
            owned_bytes_least: fit.owned_bytes.iter().min().copied().unwrap_or(0),
            owned_bytes_most: fit.owned_bytes.iter().max().copied().unwrap_or(0),
            copies_least: fit.copies.iter().map(Vec::len).min().unwrap_or(0),
            copies_most: fit.copies.iter().map(Vec::len).max().unwrap_or(0),
            light_caches,
        }
    }
}

/// What went to and fro at a node with a budget.
#[derive(Debug, Serialize)]
pub(super) struct Exchange {
    /// Bytes of pages that it owns, rounded up to lines.
    pub owned_bytes: u64,
    pub traffic: Traffic,
    /// Bytes in use at the worst moment, of its budget.
    pub memory_high_water: u64,
    /// The same queues in the same order on every node.
    pub queues: Vec<QueueRun>,
}

#[derive(Debug, Serialize)]
pub(super) struct Traffic {
    /// Rays that came from other nodes.
    pub arrived: u64,
    /// Rays that were sent to other nodes and taken.
    pub forwarded: u64,
    /// Rays that came back, since there was no room for them.
    pub refused: u64,
    /// Pages that came here.
    pub fetched: u64,
    /// Bytes of those that were of texels.
    pub texel_bytes: u64,
    /// Bilinear look-ups in textures.
    pub look_ups: u64,
    /// Pages that were sent to others.
    pub served: u64,
}

impl Exchange {
    /// Of a node that worked under `plan`.
    pub fn of(worked: &Worked, plan: &Plan, owned_bytes: u64) -> Self {
        let (t, h) = (&worked.traffic, &worked.high_water);
        let fixed = plan.sum().total_bytes() - (plan.lines * size_of::<Line>()) as u64;
        Self {
            owned_bytes,
            traffic: Traffic {
                arrived: t.arrived,
                forwarded: t.forwarded,
                refused: t.refused,
                fetched: t.fetched,
                texel_bytes: t.texel_bytes,
                look_ups: worked.walks.look_ups,
                served: t.served,
            },
            memory_high_water: fixed + h.page_bytes,
            queues: queues(h),
        }
    }
}

fn queues(h: &HighWater) -> Vec<QueueRun> {
    [("rays", h.rays), ("partial sums", h.partials), ("tiles", h.tiles), ("page requests", h.requests)]
        .map(|(name, (high, limit))| QueueRun { name: name.to_owned(), high_water: high as u64, limit: limit as u64 })
        .into()
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
