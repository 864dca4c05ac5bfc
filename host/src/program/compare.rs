//! `hybray compare`: figures for how far one picture is from another, and a map of where it is seen.

use super::End;
use super::args::CompareArgs;
use crate::picture::{Format, Output, Picture, decode_srgb, difference, flip, read};
use anyhow::{Context, Result, bail};
use serde::Serialize;
use std::io::Write;
use std::path::Path;

#[derive(Serialize)]
struct Report {
    width: u32,
    height: u32,
    rmse: f64,
    relative_mse: f64,
    worst_pixel: [u32; 2],
    worst_by: f64,
    channels_that_differ: u64,
    channels_not_finite: u64,
    flip: f64,
    pixels_per_degree: f32,
}

pub(super) fn run(args: &CompareArgs) -> Result<End> {
    let open = |path: &Path| read(path).with_context(|| format!("cannot read picture `{}`", path.display()));
    let (reference, test) = (open(&args.reference)?, open(&args.test)?);
    let [a, b] = [&reference, &test].map(|p| [p.width, p.height]);
    if a != b {
        bail!(
            "`{}` has {} x {} pixels and `{}` {} x {}; compare pictures of one size",
            args.reference.display(),
            a[0],
            a[1],
            args.test.display(),
            b[0],
            b[1]
        );
    }
    let output = match &args.map {
        Some(path) => Some(Output::create(path, Format::of(path, false)?)?),
        None => None,
    };
    let found = difference(&reference, &test);
    let seen = flip(&reference, &test, args.pixels_per_degree);
    let mean = seen.iter().map(|&x| f64::from(x)).sum::<f64>() / seen.len() as f64;
    let report = Report {
        width: a[0],
        height: a[1],
        rmse: found.rmse,
        relative_mse: found.relative_mse,
        worst_pixel: found.worst,
        worst_by: found.worst_by,
        channels_that_differ: found.differing,
        channels_not_finite: found.not_finite,
        flip: mean,
        pixels_per_degree: args.pixels_per_degree,
    };
    if let Some(output) = output {
        // As grey steps that look even.
        let rgb = seen.iter().flat_map(|&x| [decode_srgb(f64::from(x)); 3]).collect();
        output.write(&Picture { width: a[0], height: a[1], rgb }, 1.0)?;
    }
    let mut out = std::io::stdout().lock();
    match args.json.as_deref() {
        Some(path) if path == Path::new("-") => {
            serde_json::to_writer_pretty(&mut out, &report)?;
            writeln!(out)?;
            return Ok(End::Done);
        }
        Some(path) => {
            let text = serde_json::to_string_pretty(&report)? + "\n";
            std::fs::write(path, text).with_context(|| format!("cannot write `{}`", path.display()))?;
        }
        None => {}
    }
    let [column, row] = report.worst_pixel;
    writeln!(out, "RMSE         {:.6}", report.rmse)?;
    writeln!(out, "relMSE       {:.6}", report.relative_mse)?;
    writeln!(out, "worst pixel  {:.6} at column {column}, row {row}", report.worst_by)?;
    writeln!(out, "differing    {} of {} channels", report.channels_that_differ, 3 * seen.len())?;
    if report.channels_not_finite > 0 {
        writeln!(out, "not finite   {} channels, taken as 0", report.channels_not_finite)?;
    }
    writeln!(out, "FLIP         {:.6} at {} pixels a degree", report.flip, report.pixels_per_degree)?;
    Ok(End::Done)
}
