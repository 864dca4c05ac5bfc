//! Opening a `.hyb` file.
//!
//! The order is chosen so that no room is asked for that is not covered by checked bytes: the header against the length
//! of the file; the table of pages, which says how long each is; then the rest, in pieces.

use super::header::FileHeader;
use super::tables::Rest;
use crate::build::{Index, Packed, geometry_pages, hash_bytes, hash_page, primitives_in};
use crate::import;
use crate::model::{Model, NamedMaterial};
use bytemuck::Pod;
use hybray_scene::{Directory, Line, PAGE_BYTES_MAX, PageEntry, PageView, Tables, Texels, lines_for, texel_page_bytes};
use hybray_shading::{Cell, Cut, Environment, Light, Map, MapTables, Maps, Material, Sky, Texture};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Why a packed scene cannot be used, as one line for a person.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {problem}; {remedy}")]
pub struct HybError {
    file: String,
    problem: String,
    remedy: &'static str,
}

/// What a packed scene holds.
pub struct Packing {
    /// Pages and directory.
    pub packed: Packed,
    /// Everything else: a model without primitives, whose materials have no names.
    pub model: Model,
    /// Triangles, spheres and cones.
    pub primitives: [u64; 3],
    /// Triangles with vertex normals.
    pub smooth: u64,
    /// The scene's box, file units.
    pub extent: [[f32; 3]; 2],
}

/// Opens and checks a packed scene.
///
/// # Errors
/// One line that names the file, what is wrong with it, and what to do.
pub fn open(path: &Path) -> Result<Packing, HybError> {
    let error = |(problem, remedy)| HybError { file: path.display().to_string(), problem, remedy };
    read(path).map_err(error)
}

/// What is wrong, and what to do.
type Complaint = (String, &'static str);

const AGAIN: &str = "make it again with `hybray pack`";

fn broken(problem: impl Into<String>) -> Complaint {
    (problem.into(), AGAIN)
}

fn unreadable(error: &io::Error) -> Complaint {
    (format!("it cannot be read ({error})"), "check the file and its disk")
}

fn read(path: &Path) -> Result<Packing, Complaint> {
    let about = match std::fs::metadata(path) {
        Ok(about) => about,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            return Err(("there is no such file".into(), "check the path"));
        }
        Err(e) => return Err((format!("it cannot be looked up ({e})"), "check the path")),
    };
    if !about.is_file() {
        return Err(("it is no regular file".to_owned(), "name a file that `hybray pack` has made"));
    }
    let file = File::open(path).map_err(|e| (format!("it cannot be opened ({e})"), "check its permissions"))?;
    read_from(file, about.len())
}

pub(super) fn read_from(file: impl Read + Seek, length: u64) -> Result<Packing, Complaint> {
    let mut sections = Sections { file };
    if length < size_of::<FileHeader>() as u64 {
        return Err(broken("this is no packed scene, or the beginning of one"));
    }
    let header: FileHeader = sections.read(0, 1)?[0];
    header.check(length).map_err(broken)?;
    let layout = header.layout();

    let entries: Vec<PageEntry> = sections.read_checked(layout.entries, header.pages, |entry: &PageEntry| {
        let known = entry.kind == PageEntry::GEOMETRY || entry.kind == PageEntry::TEXELS;
        let fits = (1..=PAGE_BYTES_MAX as u32).contains(&entry.bytes) && known && entry.owner == 0;
        if fits { Ok(()) } else { Err(broken("its table of pages has an entry that makes no sense")) }
    })?;
    let lines: u64 = entries.iter().map(|entry| lines_for(entry.bytes as usize) as u64).sum();
    if lines != header.page_lines {
        return Err(broken("its table of pages does not make their length"));
    }
    let (mut before, mut left) = (0, geometry_pages(&entries));
    let voxels: Vec<u32> = sections.read_checked(layout.voxels, header.pages, |&voxel: &u32| {
        // Those of texels are shared out among the voxels.
        let follows = (voxel >= before || left == 0) && voxel < header.voxels;
        (before, left) = (voxel, left.saturating_sub(1));
        if follows { Ok(()) } else { Err(broken("a page is in no voxel, or out of order")) }
    })?;
    let nodes = sections.read(layout.nodes, header.nodes as usize)?;
    let materials: Vec<Material> = sections.read(layout.materials, header.materials as usize)?;
    let lights: Vec<Light> = sections.read(layout.lights, header.lights as usize)?;
    let maps: Vec<Maps> = sections.read(layout.maps, header.maps as usize)?;
    let uses: Vec<Map> = sections.read(layout.uses, header.uses as usize)?;
    let textures: Vec<Texture> = sections.read(layout.textures, header.textures as usize)?;
    let skies: Vec<Sky> = sections.read(layout.skies, header.skies as usize)?;
    let cells: Vec<Cell> = sections.read(layout.cells, header.cells as usize)?;
    let cuts: Vec<Cut> = sections.read(layout.cuts, header.cuts as usize)?;
    let rest_bytes: Vec<u8> = sections.read(layout.rest, header.rest_bytes as usize)?;
    let scratch = &mut vec![0; nodes.len() + entries.len()];
    Directory::parse(&nodes, &entries, scratch).map_err(|e| broken(e.to_string()))?;

    let mut index =
        Index { nodes, entries, voxels, voxel_count: header.voxels, primitives: Vec::new(), hash: Index::HASH_START };
    let chunks = read_pages(&mut sections, layout.pages, &mut index, materials.len())?;
    let tables: [&[u8]; 10] = [
        bytemuck::cast_slice(&index.voxels),
        bytemuck::cast_slice(&materials),
        bytemuck::cast_slice(&lights),
        bytemuck::cast_slice(&maps),
        bytemuck::cast_slice(&uses),
        bytemuck::cast_slice(&textures),
        bytemuck::cast_slice(&skies),
        bytemuck::cast_slice(&cells),
        bytemuck::cast_slice(&cuts),
        &rest_bytes,
    ];
    if header.sealed(tables.into_iter().fold(index.hash(), hash_bytes)) != header {
        return Err(broken("its bytes are not those that were written (the hash differs)"));
    }
    let sky = skies.first().copied().unwrap_or_default();
    let environment = Environment { sky, cells: &cells, cuts: &cuts };
    let tables = MapTables { maps: &maps, uses: &uses, textures: &textures, environment };
    let geometry = geometry_pages(&index.entries);
    let texels = index.entries.len() as u32 - geometry;
    // Their pages follow one another, each as large as its texture says, until there are none left.
    let mut next = geometry;
    let mut fits = tables.are_sound(materials.len(), index.entries.len() as u32);
    for texture in &textures {
        fits = fits
            && texture.first == next
            && (0..texture.levels).all(|level| {
                let [columns, rows] = texture.squares(level);
                let [width, height] = texture.level_size(level);
                let tile = u32::from(texture.tile);
                (0..columns * rows).all(|square| {
                    let (x, y) = (square % columns * tile, square / columns * tile);
                    let bytes = texel_page_bytes((width - x).min(tile) as u16, (height - y).min(tile) as u16);
                    next += 1;
                    index.entries.get(next as usize - 1).is_some_and(|entry| entry.bytes as usize == bytes)
                })
            });
    }
    if !fits || next != geometry + texels {
        return Err(broken("its textures do not fit its pages"));
    }
    for (start, bytes) in layout.paddings(&header) {
        if sections.read::<u8>(start, bytes)?.iter().any(|&byte| byte != 0) {
            return Err(broken("there is something between its parts"));
        }
    }

    let (rest, left): (Rest, _) =
        postcard::take_from_bytes(&rest_bytes).map_err(|_| broken("its tables cannot be read"))?;
    if !left.is_empty() {
        return Err(broken("its tables have a rest that is not known here"));
    }
    let extent = rest.extent;
    let model = Model {
        materials: materials
            .into_iter()
            .zip(maps.into_iter().chain(std::iter::repeat(Maps::EMPTY)))
            .map(|(material, maps)| NamedMaterial { material, maps, ..Default::default() })
            .collect(),
        uses,
        lights,
        sky,
        cells,
        cuts,
        ..rest.into_model().ok_or_else(|| broken("a camera has a projection that is not known here"))?
    };
    import::validate(&model).map_err(|e| broken(e.to_string()))?;
    if model.cameras.is_empty() {
        return Err(broken("it has no camera"));
    }
    let packed = Packed::new(index, chunks, header.scale_log2, model.materials.len(), textures);
    Ok(Packing { packed, model, primitives: header.primitives, smooth: header.smooth, extent })
}

/// Lines of a piece of the pages: 4 MiB, and up to a page more.
const PIECE_LINES: usize = 1 << 16;

/// Reads the pages piece by piece, each of whole pages, and checks each page before the next piece is read.
fn read_pages(
    sections: &mut Sections<impl Read + Seek>,
    start: u64,
    index: &mut Index,
    materials: usize,
) -> Result<Vec<Vec<Line>>, Complaint> {
    let tables = Tables { materials };
    let mut chunks = Vec::new();
    let mut at = start;
    let mut first = 0;
    while first < index.entries.len() {
        let (mut end, mut lines) = (first, 0);
        while end < index.entries.len() && lines < PIECE_LINES {
            lines += lines_for(index.entries[end].bytes as usize);
            end += 1;
        }
        let piece: Vec<Line> = sections.read(at, lines)?;
        let mut line = 0;
        for page in first..end {
            let bytes = index.entries[page].bytes;
            let own = &piece[line..][..lines_for(bytes as usize)];
            line += own.len();
            let refused = |e| broken(format!("page {page}: {e}"));
            let (length, primitives) = if index.entries[page].kind == PageEntry::TEXELS {
                (Texels::parse(bytemuck::cast_slice(own)).map_err(refused)?.bytes(), 0)
            } else {
                let view = PageView::parse(own, tables).map_err(refused)?;
                (view.header.bytes as usize, primitives_in(&view))
            };
            if length != bytes as usize {
                return Err(broken(format!("page {page} is not as long as the table says")));
            }
            index.add_page(primitives, hash_page(own));
        }
        at += 64 * lines as u64;
        first = end;
        chunks.push(piece);
    }
    Ok(chunks)
}

/// A file, read section by section.
struct Sections<F> {
    file: F,
}

/// Bytes that are read at once, so that room grows with what there is to read.
const STEP: usize = 1 << 22;

impl<F: Read + Seek> Sections<F> {
    fn read<T: Pod>(&mut self, start: u64, count: usize) -> Result<Vec<T>, Complaint> {
        self.file.seek(SeekFrom::Start(start)).map_err(|e| unreadable(&e))?;
        let mut all: Vec<T> = Vec::new();
        let step = (STEP / size_of::<T>()).max(1);
        while all.len() < count {
            let from = all.len();
            let next = step.min(count - from);
            all.try_reserve(next).map_err(|_| ("there is no memory for it".to_owned(), "free some"))?;
            all.resize(from + next, T::zeroed());
            let bytes = bytemuck::cast_slice_mut(&mut all[from..]);
            self.file.read_exact(bytes).map_err(|e| unreadable(&e))?;
        }
        Ok(all)
    }

    /// The same, checked item by item before more room is asked for.
    fn read_checked<T: Pod>(
        &mut self,
        start: u64,
        count: u32,
        mut check: impl FnMut(&T) -> Result<(), Complaint>,
    ) -> Result<Vec<T>, Complaint> {
        let mut all: Vec<T> = Vec::new();
        let step = STEP / size_of::<T>();
        while all.len() < count as usize {
            let from = all.len();
            let next = step.min(count as usize - from);
            let piece = self.read::<T>(start + (from * size_of::<T>()) as u64, next)?;
            piece.iter().try_for_each(&mut check)?;
            all.extend(piece);
        }
        Ok(all)
    }
}
