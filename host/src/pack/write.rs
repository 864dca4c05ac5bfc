//! Writing a `.hyb` file while the scene is built.

use super::header::{FileHeader, MAGIC, VERSION};
use super::tables::Rest;
use crate::build::{BuildError, Index, Objects, Settings, build_in_two_passes, hash_bytes, voxels_for};
use crate::model::Model;
use crate::partition::Voxels;
use crate::picture::pending::Pending;
use bytemuck::Zeroable;
use hybray_scene::Line;
use hybray_shading::{Light, Material, Sky, Texture};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of all pages.
    pub page_bytes: u64,
    /// How many.
    pub pages: u32,
    /// How many voxels, empty ones included.
    pub voxels: u32,
    /// Triangles, spheres and cones.
    pub primitives: [u64; 3],
}

/// Builds `objects` and writes them with `about`, the model without its primitives, to `path`, in two passes: see
/// [`crate::build`]. Where `voxels` is not said, it is one for each 131,072 primitives. It ends with an error soon after
/// `stop` is true.
///
/// # Errors
/// See [`BuildError`]; nothing is then at `path` that was not there before.
pub fn pack(
    objects: impl Objects,
    about: &Model,
    settings: &Settings,
    voxels: Option<Voxels>,
    path: &Path,
    stop: &AtomicBool,
) -> Result<Written, BuildError> {
    let settings = Settings { voxels: voxels.unwrap_or_else(|| voxels_for(objects.len())), ..*settings };
    let mut pending = Pending::create(path).map_err(BuildError::Write)?;
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let file = pending.file().map_err(BuildError::Write)?;
    file.write_all(bytemuck::bytes_of(&FileHeader::zeroed())).map_err(BuildError::Write)?;
    let mut page_lines = 0;
    let (index, survey) = build_in_two_passes(objects, &settings, folder, stop, &mut |lines: &[Line]| {
        page_lines += lines.len() as u64;
        file.write_all(bytemuck::cast_slice(lines)).map_err(BuildError::Write)
    })?;
    let (mut index, survey) = (index, survey);
    let (textures, pages) = index.add_textures(&about.textures, settings.page_bytes);
    for lines in &pages {
        page_lines += lines.len() as u64;
        file.write_all(bytemuck::cast_slice(lines)).map_err(BuildError::Write)?;
    }
    let header = FileHeader {
        page_lines,
        primitives: survey.primitives,
        smooth: survey.smooth,
        scale_log2: survey.scale_log2,
        ..FileHeader::zeroed()
    };
    let extent = [survey.bounds.lo, survey.bounds.hi].map(|corner| corner.to_array());
    let header = finish(file, header, &index, about, &textures, extent).map_err(BuildError::Write)?;
    pending.commit().map_err(BuildError::Write)?;
    Ok(Written {
        file_bytes: header.file_bytes,
        page_bytes: index.entries.iter().map(|entry| u64::from(entry.bytes)).sum(),
        pages: header.pages,
        voxels: header.voxels,
        primitives: header.primitives,
    })
}

/// Writes what comes after the pages, and then the header in its place.
fn finish(
    file: &mut (impl Write + Seek),
    header: FileHeader,
    index: &Index,
    about: &Model,
    textures: &[Texture],
    extent: [[f32; 3]; 2],
) -> io::Result<FileHeader> {
    let materials: Vec<Material> = about.materials.iter().map(|m| m.material).collect();
    let lights: &[Light] = &about.lights;
    let maps = about.maps();
    let sky = if about.sky == Sky::EMPTY { &[][..] } else { std::slice::from_ref(&about.sky) };
    let rest = postcard::to_allocvec(&Rest::of(about, extent)).map_err(io::Error::other)?;
    let count = |n: usize| u32::try_from(n).map_err(io::Error::other);
    let mut header = FileHeader {
        magic: MAGIC,
        version: VERSION,
        header_bytes: size_of::<FileHeader>() as u32,
        rest_bytes: rest.len() as u64,
        pages: count(index.entries.len())?,
        nodes: count(index.nodes.len())?,
        materials: count(materials.len())?,
        lights: count(lights.len())?,
        maps: count(maps.len())?,
        uses: count(about.uses.len())?,
        textures: count(textures.len())?,
        skies: count(sky.len())?,
        cells: count(about.cells.len())?,
        cuts: count(about.cuts.len())?,
        voxels: index.voxel_count,
        ..header
    };
    header.file_bytes = header.layout().end;
    let tables: [&[u8]; 10] = [
        bytemuck::cast_slice(&index.voxels),
        bytemuck::cast_slice(&materials),
        bytemuck::cast_slice(lights),
        bytemuck::cast_slice(&maps),
        bytemuck::cast_slice(&about.uses),
        bytemuck::cast_slice(textures),
        bytemuck::cast_slice(sky),
        bytemuck::cast_slice(&about.cells),
        bytemuck::cast_slice(&about.cuts),
        &rest,
    ];
    let sections = [bytemuck::cast_slice(&index.nodes), bytemuck::cast_slice(&index.entries)];
    for section in sections.into_iter().chain(tables) {
        file.write_all(section)?;
        file.write_all(&[0; 64][..section.len().next_multiple_of(64) - section.len()])?;
    }
    let header = header.sealed(tables.into_iter().fold(index.hash(), hash_bytes));
    if let Err(problem) = header.check(header.file_bytes) {
        return Err(io::Error::other(format!("the scene does not fit the format: {problem}")));
    }
    file.seek(SeekFrom::Start(0))?;
    file.write_all(bytemuck::bytes_of(&header))?;
    Ok(header)
}
