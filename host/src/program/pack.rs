//! `hybray pack`.

use super::args::PackArgs;
use super::render::interrupts;
use super::report::{ReportFile, peak_bytes};
use super::{End, load, surround};
use crate::build::BuildError;
use crate::builtin;
use crate::model::Model;
use crate::pack::pack;
use anyhow::{Context, Result};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// The JSON report: `docs/REPORT.md` describes it.
#[derive(Debug, Serialize)]
struct Report<'a> {
    scene: &'a str,
    output: String,
    file_bytes: u64,
    page_bytes: u64,
    pages: u32,
    voxels: u32,
    triangles: u64,
    spheres: u64,
    cones: u64,
    seconds: f64,
    /// Most that this process held at once, as far as the system tells.
    peak_bytes: Option<u64>,
    warnings: &'a [String],
}

pub(super) fn run(args: &PackArgs) -> Result<End> {
    let start = Instant::now();
    let interrupted = interrupts()?;
    let scene = args.scene.scene.as_str();
    let path = args.output.clone().unwrap_or_else(|| default_output(scene));
    let json = args.json.as_deref().map(ReportFile::create).transpose()?;
    let (settings, voxels) = (args.tree.settings(), args.tree.voxels);
    let (about, written) = if let Some((mut about, objects)) = builtin::streamed(scene) {
        surround(&mut about, &args.scene)?;
        let written = pack(objects, &about, &settings, voxels, &path, &interrupted);
        (about, written)
    } else {
        let (mut about, _) = load(&args.scene, None)?;
        let objects = Model {
            meshes: std::mem::take(&mut about.meshes),
            spheres: std::mem::take(&mut about.spheres),
            cones: std::mem::take(&mut about.cones),
            ..Model::default()
        };
        let written = pack(objects, &about, &settings, voxels, &path, &interrupted);
        (about, written)
    };
    if let Err(BuildError::Interrupted) = written {
        if !args.quiet {
            eprintln!("interrupted: nothing is written");
        }
        return Ok(End::Interrupted);
    }
    let written = written.with_context(|| path.display().to_string())?;
    let [triangles, spheres, cones] = written.primitives;
    let report = Report {
        scene,
        output: path.display().to_string(),
        file_bytes: written.file_bytes,
        page_bytes: written.page_bytes,
        pages: written.pages,
        voxels: written.voxels,
        triangles,
        spheres,
        cones,
        seconds: start.elapsed().as_secs_f64(),
        peak_bytes: peak_bytes(),
        warnings: &about.warnings,
    };
    if let Some(json) = json {
        json.write(&report)?;
    }
    if !args.quiet {
        say(&report);
    }
    Ok(End::Done)
}

fn say(report: &Report<'_>) {
    report.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let primitives = report.triangles + report.spheres + report.cones;
    eprintln!(
        "{primitives} primitives in {} pages of {} voxel{}: {} bytes, {:.1} a primitive, in {:.2} s",
        report.pages,
        report.voxels,
        if report.voxels == 1 { "" } else { "s" },
        report.page_bytes,
        report.page_bytes as f64 / primitives.max(1) as f64,
        report.seconds
    );
    if let Some(peak) = report.peak_bytes {
        eprintln!("peak {peak} bytes: {:.1} a primitive", peak as f64 / primitives.max(1) as f64);
    }
    eprintln!("{}", report.output);
}

/// `spd:balls:4` becomes `spd-balls-4.hyb`, `models/cow.obj` becomes `cow.hyb`, in this folder.
fn default_output(scene: &str) -> PathBuf {
    let stem = Path::new(scene).file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{}.hyb", stem.replace(':', "-")))
}
