//! `hybray info` and `hybray scenes`.

use super::args::InfoArgs;
use super::report::peak_bytes;
use super::{End, prepare};
use crate::builtin;
use anyhow::Result;
use hybray_scene::PAGE_BYTES_MAX;
use hybray_shading::Environment;
use std::io::Write;

pub(super) fn run(args: &InfoArgs) -> Result<End> {
    let (prepared, import_time) = prepare(&args.scene, &args.tree, None, PAGE_BYTES_MAX as u32)?;
    let pages = prepared.packed.open()?;
    let scene = prepared.scene(&pages);
    let nodes = scene.resident.pages.iter().map(|p| p.body.nodes().len()).sum::<usize>();
    let out = &mut std::io::stdout().lock();
    let o = &prepared.objects;
    let [triangles, spheres, cones] = prepared.primitives;
    let primitives = (triangles + spheres + cones).max(1);
    let [lights, materials] = prepared.tables();
    writeln!(out, "scene        {}", args.scene.scene)?;
    writeln!(
        out,
        "objects      {} polygons, {} spheres, {} cones, {} cylinders",
        o.polygons, o.spheres, o.cones, o.cylinders
    )?;
    writeln!(
        out,
        "primitives   {triangles} triangles ({} with vertex normals), {spheres} spheres, {cones} cones",
        prepared.smooth
    )?;
    writeln!(out, "tables       {lights} lights, {materials} materials")?;
    let cameras: Vec<_> = prepared.cameras.iter().map(|c| format!("`{}`", c.name)).collect();
    writeln!(out, "cameras      {}", cameras.join(", "))?;
    let [lo, hi] = prepared.extent;
    writeln!(out, "extent       {lo:?} to {hi:?}")?;
    writeln!(out, "requires     {}", prepared.requires().join(", "))?;
    let bytes = prepared.packed.page_bytes();
    writeln!(
        out,
        "pages        {} in {bytes} bytes, {} form: {:.1} bytes a primitive, {nodes} nodes",
        prepared.packed.pages(),
        if prepared.packed.compact_pages() > 0 { "compact" } else { "full" },
        bytes as f64 / primitives as f64
    )?;
    if !prepared.packed.textures.is_empty() {
        let texels: u64 = prepared.packed.textures.iter().map(|t| u64::from(t.width) * u64::from(t.height)).sum();
        writeln!(
            out,
            "textures     {} of {texels} texels, in {} pages of {} bytes",
            prepared.packed.textures.len(),
            prepared.packed.pages() as u32 - prepared.packed.geometry_pages(),
            prepared.packed.texel_bytes()
        )?;
    }
    let Environment { sky, cells, cuts } = prepared.environment();
    if let Some(map) = prepared.packed.textures.get(sky.texture as usize) {
        let (width, height, samples) = (map.width, map.height, sky.samples);
        let bytes = size_of_val(cells) + size_of_val(cuts);
        writeln!(
            out,
            "environment  {width} x {height} texels; {} cells of {bytes} bytes light, {samples} rays a hit",
            cells.len()
        )?;
    }
    writeln!(out, "voxels       {}", prepared.packed.voxels())?;
    writeln!(
        out,
        "every node   {} bytes of directory, {} bytes of tables",
        prepared.packed.directory_bytes(),
        prepared.table_bytes()
    )?;
    writeln!(
        out,
        "time         import {:.3} s, build {:.3} s",
        import_time.as_secs_f64(),
        prepared.build_time.as_secs_f64()
    )?;
    if let Some(peak) = peak_bytes() {
        writeln!(out, "peak         {peak} bytes: {:.1} bytes a primitive", peak as f64 / primitives as f64)?;
    }
    for warning in &prepared.warnings {
        writeln!(out, "warning      {warning}")?;
    }
    Ok(End::Done)
}

pub(super) fn list_builtin() -> Result<End> {
    let out = &mut std::io::stdout().lock();
    for scene in builtin::names() {
        let name = scene.name;
        match &scene.size {
            Some(size) => {
                let full = format!("{name}[:{}]", size.default);
                let range = format!("{} from {} to {}", size.counts, size.smallest, size.largest);
                writeln!(out, "{full:28} {} ({range})", scene.about)?;
            }
            None => writeln!(out, "{name:28} {}", scene.about)?,
        }
    }
    Ok(End::Done)
}
