//! The first 128 bytes of a `.hyb` file, and where things lie that they count.

use crate::build::hash_bytes;
use crate::import::PRIMITIVES_MAX;
use crate::partition::VOXELS_MAX;
use bytemuck::{Pod, Zeroable};
use hybray_scene::{Node, PAGE_BYTES_MAX, PageEntry, lines_for};
use hybray_shading::{Cell, Cut, Environment, Light, Map, Maps, Material, Sky, Texture};

/// Bytes that start a file: name, an end of line and an end of text that transfers as text would spoil.
pub(super) const MAGIC: [u8; 8] = *b"hybray\r\x1a";
/// Version of the format, the pages' included.
pub(super) const VERSION: u32 = 3;
/// Most bytes of the postcard tables.
pub(super) const REST_MAX: u64 = 1 << 20;
/// Most lights.
pub(super) const LIGHTS_MAX: u32 = 1 << 20;

/// The header. What it counts follows in the order of the counts, each section at a multiple of 64.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FileHeader {
    pub magic: [u8; 8],
    pub version: u32,
    /// Bytes of this header.
    pub header_bytes: u32,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// See [`FileHeader::sealed`].
    pub hash: u64,
    /// Lines of 64 bytes that the pages take.
    pub page_lines: u64,
    /// Bytes of the postcard tables.
    pub rest_bytes: u64,
    /// Triangles, spheres and cones.
    pub primitives: [u64; 3],
    /// Triangles with vertex normals.
    pub smooth: u64,
    pub pages: u32,
    /// Nodes of the directory.
    pub nodes: u32,
    pub materials: u32,
    pub lights: u32,
    pub voxels: u32,
    /// File units times 2 to this power are internal units.
    pub scale_log2: i32,
    /// What materials take from textures: 0, or as many as materials.
    pub maps: u32,
    /// Uses of textures.
    pub uses: u32,
    pub textures: u32,
    /// 1 if there is something all around, else 0.
    pub skies: u32,
    /// Cells of it.
    pub cells: u32,
    /// Cuts between them.
    pub cuts: u32,
}

const _: () = assert!(size_of::<FileHeader>() == 128);

/// The sections after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub pages: u64,
    pub nodes: u64,
    pub entries: u64,
    pub voxels: u64,
    pub materials: u64,
    pub lights: u64,
    pub maps: u64,
    pub uses: u64,
    pub textures: u64,
    pub skies: u64,
    pub cells: u64,
    pub cuts: u64,
    pub rest: u64,
    /// Bytes of the file.
    pub end: u64,
}

impl Layout {
    /// Where the zeros between sections begin, and how many there are.
    pub fn paddings(&self, header: &FileHeader) -> impl Iterator<Item = (u64, usize)> {
        let sections = [
            (self.nodes, u64::from(header.nodes) * size_of::<Node>() as u64, self.entries),
            (self.entries, u64::from(header.pages) * size_of::<PageEntry>() as u64, self.voxels),
            (self.voxels, u64::from(header.pages) * 4, self.materials),
            (self.materials, u64::from(header.materials) * size_of::<Material>() as u64, self.lights),
            (self.lights, u64::from(header.lights) * size_of::<Light>() as u64, self.maps),
            (self.maps, u64::from(header.maps) * size_of::<Maps>() as u64, self.uses),
            (self.uses, u64::from(header.uses) * size_of::<Map>() as u64, self.textures),
            (self.textures, u64::from(header.textures) * size_of::<Texture>() as u64, self.skies),
            (self.skies, u64::from(header.skies) * size_of::<Sky>() as u64, self.cells),
            (self.cells, u64::from(header.cells) * size_of::<Cell>() as u64, self.cuts),
            (self.cuts, u64::from(header.cuts) * size_of::<Cut>() as u64, self.rest),
            (self.rest, header.rest_bytes, self.end),
        ];
        sections.into_iter().map(|(start, bytes, next)| (start + bytes, (next - start - bytes) as usize))
    }
}

impl FileHeader {
    /// Where sections begin.
    pub fn layout(&self) -> Layout {
        let mut at = size_of::<Self>() as u64;
        let mut next = |bytes: u64| {
            let start = at;
            at = (at + bytes).next_multiple_of(64);
            start
        };
        Layout {
            pages: next(64 * self.page_lines),
            nodes: next(u64::from(self.nodes) * size_of::<Node>() as u64),
            entries: next(u64::from(self.pages) * size_of::<PageEntry>() as u64),
            voxels: next(u64::from(self.pages) * 4),
            materials: next(u64::from(self.materials) * size_of::<Material>() as u64),
            lights: next(u64::from(self.lights) * size_of::<Light>() as u64),
            maps: next(u64::from(self.maps) * size_of::<Maps>() as u64),
            uses: next(u64::from(self.uses) * size_of::<Map>() as u64),
            textures: next(u64::from(self.textures) * size_of::<Texture>() as u64),
            skies: next(u64::from(self.skies) * size_of::<Sky>() as u64),
            cells: next(u64::from(self.cells) * size_of::<Cell>() as u64),
            cuts: next(u64::from(self.cuts) * size_of::<Cut>() as u64),
            rest: next(self.rest_bytes),
            end: next(0),
        }
    }

    /// The header with its hash: of the header without one, then of `content`.
    pub fn sealed(self, content: u64) -> Self {
        let bare = Self { hash: 0, ..self };
        Self { hash: hash_bytes(content, bytemuck::bytes_of(&bare)), ..self }
    }

    /// Checks everything that can be checked against the length of the file alone.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self, length: u64) -> Result<(), String> {
        if self.magic != MAGIC {
            return Err("this is no packed scene".to_owned());
        }
        if self.version != VERSION || self.header_bytes as usize != size_of::<Self>() {
            return Err(format!("its format is version {}, and this program reads version {VERSION}", self.version));
        }
        let within = |what: &str, count: u64, most: u64| {
            if count <= most { Ok(()) } else { Err(format!("{count} {what}, and there can be {most} at most")) }
        };
        within("bytes", self.file_bytes, 1 << 56)?;
        within("lines of pages", self.page_lines, self.file_bytes / 64)?;
        within("pages", self.pages.into(), self.page_lines)?;
        within("lines of pages", self.page_lines, u64::from(self.pages) * lines_for(PAGE_BYTES_MAX) as u64)?;
        within("nodes of the directory", self.nodes.into(), self.pages.into())?;
        within("materials", self.materials.into(), u16::MAX.into())?;
        within("lights", self.lights.into(), LIGHTS_MAX.into())?;
        within("uses of textures", self.uses.into(), u16::MAX.into())?;
        within("textures", self.textures.into(), self.pages.into())?;
        if self.maps != 0 && self.maps != self.materials {
            return Err("what materials take from textures is neither nothing nor told of each".to_owned());
        }
        within("skies", self.skies.into(), 1)?;
        within("cells of the sky", self.cells.into(), u64::from(self.skies) * Environment::CELLS_MAX as u64)?;
        within("cuts of the sky", self.cuts.into(), 4 * u64::from(self.cells))?;
        within("voxels", self.voxels.into(), VOXELS_MAX.into())?;
        within("bytes of tables", self.rest_bytes, REST_MAX)?;
        for count in self.primitives {
            within("primitives", count, PRIMITIVES_MAX)?;
        }
        within("triangles with normals", self.smooth, self.primitives[0])?;
        if !(-126..=126).contains(&self.scale_log2) {
            return Err(format!("a scale of 2^{}", self.scale_log2));
        }
        if self.pages == 0 || self.voxels == 0 {
            return Err("its header makes no sense".to_owned());
        }
        if self.layout().end != self.file_bytes {
            return Err("its header's counts do not make its length".to_owned());
        }
        if self.file_bytes != length {
            return Err(format!("it has {length} bytes, and should have {}", self.file_bytes));
        }
        Ok(())
    }
}
