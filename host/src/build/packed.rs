//! What a build makes: pages, and the directory above them.

use super::BuildError;
use super::area::Area;
use super::tree::VoxelTree;
use crate::partition::{PlacedPage, Plan};
use hybray_bintree::cut::FLAT;
use hybray_bintree::walk::Resident;
use hybray_bintree::{Forest, top};
use hybray_geometry::Aabb;
use hybray_scene::{
    BLOCK, Coordinates, Directory, Header, Kind, Line, Node, PageEntry, PageForm, PageView, Slot, Tables, Texels,
    lines_for,
};
use hybray_shading::Texture;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// The directory and what else is known of each page, without the pages.
pub(crate) struct Index {
    pub nodes: Vec<Node>,
    pub entries: Vec<PageEntry>,
    /// The voxel of each page.
    pub voxels: Vec<u32>,
    /// How many voxels there are, empty ones included.
    pub voxel_count: u32,
    /// Different primitives in each page.
    pub primitives: Vec<u32>,
    /// Hash of the pages in their order.
    pub hash: u64,
}

/// Pages and directory of a scene, in the internal unit (file units times `2^scale_log2`).
pub struct Packed {
    index: Index,
    /// Pages, each at a line.
    area: Area,
    /// First line of each page.
    places: Vec<u32>,
    /// File units times 2 to this power are internal units: exact.
    pub scale_log2: i32,
    /// Greatest absolute coordinate, internal units.
    pub magnitude: f32,
    /// Materials that pages may refer to.
    pub materials: usize,
    /// Textures, whose pages come behind the others.
    pub textures: Vec<Texture>,
}

const HASH_START: u64 = 0xcbf2_9ce4_8422_2325;

/// Adds `bytes` and their number to a hash, eight at a time (FNV-1a over little-endian words, the last one filled up with
/// zeros).
#[must_use]
pub fn hash_bytes(hash: u64, bytes: &[u8]) -> u64 {
    // The rotation brings what multiplication moves up back down.
    let add =
        |h: u64, word: &[u8; 8]| (h ^ u64::from_le_bytes(*word)).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29);
    let (words, rest) = bytes.as_chunks();
    let mut hash = words.iter().fold(hash, add);
    if !rest.is_empty() {
        let mut word = [0; 8];
        word[..rest.len()].copy_from_slice(rest);
        hash = add(hash, &word);
    }
    add(hash, &(bytes.len() as u64).to_le_bytes())
}

/// The hash of a page.
pub(crate) fn hash_page(lines: &[Line]) -> u64 {
    hash_bytes(HASH_START, bytemuck::cast_slice(lines))
}

/// Different primitives in a page: one may stand in several leaves, and lanes are filled up by repetition.
pub(crate) fn primitives_in(page: &PageView<'_>) -> u32 {
    let triangles = (0..page.body.triangle_lanes()).map(|number| page.body.triangle_id(number));
    let spheres = page.spheres.iter().flat_map(|block| block.id);
    let mut ids: Vec<u32> = triangles.chain(spheres).chain(page.cones.iter().map(|cone| cone.id)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids.len() as u32
}

/// Validated pages, which [`Pages::resident`] lends.
pub struct Pages<'a> {
    packed: &'a Packed,
    views: Vec<PageView<'a>>,
    texels: Vec<Texels<'a>>,
}

impl Packed {
    /// Puts pages, chunk by chunk, under their directory. The pages follow each other as the index has them.
    ///
    /// # Panics
    /// If there are 256 GiB of them.
    pub(crate) fn new(
        index: Index,
        chunks: Vec<Vec<Line>>,
        scale_log2: i32,
        materials: usize,
        textures: Vec<Texture>,
    ) -> Self {
        let area = Area::new(chunks);
        let mut line = 0;
        let places = index.entries.iter().map(|entry| {
            let place = u32::try_from(line).expect("pages have less than 256 GiB");
            line += lines_for(entry.bytes as usize);
            place
        });
        let places = places.collect();
        let magnitude = index.nodes.first().map_or(0.0, |n| n.bounds().magnitude());
        Self { index, area, places, scale_log2, magnitude, materials, textures }
    }

    /// Bytes of all pages.
    #[must_use]
    pub fn page_bytes(&self) -> u64 {
        self.index.entries.iter().map(|e| u64::from(e.bytes)).sum()
    }

    /// Bytes of pages in memory that the system mapped, and no allocator knows of.
    #[must_use]
    pub fn mapped_bytes(&self) -> u64 {
        self.area.mapped_bytes()
    }

    /// Bytes of the directory.
    #[must_use]
    pub fn directory_bytes(&self) -> u64 {
        (size_of_val(&self.index.nodes[..]) + size_of_val(&self.index.entries[..])) as u64
    }

    /// Hash of directory and pages: equal for equal pages in equal order.
    #[must_use]
    pub fn hash(&self) -> u64 {
        self.index.hash()
    }

    /// How many pages there are.
    #[must_use]
    pub fn pages(&self) -> usize {
        self.index.entries.len()
    }

    /// How many of them are in compact form: all or none, but for those whose boxes need the full one.
    #[must_use]
    pub fn compact_pages(&self) -> usize {
        let header = |page| -> &Header { bytemuck::from_bytes(&self.page(page)[0].0) };
        (0..self.geometry_pages()).filter(|&page| header(page).form() == PageForm::Compact).count()
    }

    /// How many pages have nodes and primitives: they come before those of texels.
    #[must_use]
    pub fn geometry_pages(&self) -> u32 {
        geometry_pages(&self.index.entries)
    }

    /// Bytes of pages of texels.
    #[must_use]
    pub fn texel_bytes(&self) -> u64 {
        self.index.entries[self.geometry_pages() as usize..].iter().map(|e| u64::from(e.bytes)).sum()
    }

    /// The bytes of a page, padded to whole lines.
    #[must_use]
    pub fn page(&self, page: u32) -> &[Line] {
        let first = self.places[page as usize] as usize;
        let lines = lines_for(self.index.entries[page as usize].bytes as usize);
        &self.area.lines()[first..][..lines]
    }

    /// The bytes of each page.
    #[must_use]
    pub fn page_slices(&self) -> Vec<&[u8]> {
        let slice = |(page, entry): (u32, &PageEntry)| {
            let bytes: &[u8] = bytemuck::cast_slice(self.page(page));
            &bytes[..entry.bytes as usize]
        };
        (0..).zip(&self.index.entries).map(slice).collect()
    }

    /// The directory's nodes and entries.
    #[must_use]
    pub fn directory(&self) -> Directory<'_> {
        Directory { nodes: &self.index.nodes, entries: &self.index.entries }
    }

    /// The voxel that a page belongs to.
    #[must_use]
    pub fn voxel_of(&self, page: u32) -> u32 {
        self.index.voxels[page as usize]
    }

    /// How many voxels there are, empty ones included.
    #[must_use]
    pub fn voxels(&self) -> u32 {
        self.index.voxel_count
    }

    /// Different primitives in a page.
    #[must_use]
    pub fn primitives_of(&self, page: u32) -> u32 {
        self.index.primitives[page as usize]
    }

    /// Primitives in the pages of each of so many nodes, by the pages' `owners`: node 1's first.
    #[must_use]
    pub fn objects_of(&self, owners: &[u16], nodes: u16) -> Vec<u64> {
        let mut objects = vec![0; usize::from(nodes)];
        for (&owner, &primitives) in owners.iter().zip(&self.index.primitives) {
            objects[usize::from(owner) - 1] += u64::from(primitives);
        }
        objects
    }

    /// What [`crate::partition::owners`] needs to know: pages of whole lines, as they lie in memory.
    #[must_use]
    pub fn placed_pages(&self) -> Vec<PlacedPage> {
        let bytes = |entry: &PageEntry| entry.bytes.next_multiple_of(size_of::<Line>() as u32);
        let pages = self.index.entries.iter().zip(&self.index.voxels);
        pages.map(|(entry, &voxel)| PlacedPage { bytes: bytes(entry), voxel }).collect()
    }

    /// Validates every page, as each node does with what it receives.
    ///
    /// # Errors
    /// If the builder, or memory, is broken.
    pub fn open(&self) -> Result<Pages<'_>, BuildError> {
        let tables = Tables { materials: self.materials };
        let geometry = self.geometry_pages();
        let views = (0..geometry)
            .into_par_iter()
            .map(|page| PageView::parse(self.page(page), tables))
            .collect::<Result<Vec<_>, _>>()?;
        let texels = (geometry..self.pages() as u32)
            .into_par_iter()
            .map(|page| Texels::parse(bytemuck::cast_slice(self.page(page))))
            .collect::<Result<Vec<_>, _>>()?;
        let Index { nodes, entries, .. } = &self.index;
        Directory::parse(nodes, entries, &mut vec![0; nodes.len() + entries.len()])?;
        Ok(Pages { packed: self, views, texels })
    }
}

impl<'a> Pages<'a> {
    /// What a walk needs.
    #[must_use]
    pub fn resident(&'a self) -> Resident<'a> {
        Resident { directory: self.packed.directory(), pages: &self.views }
    }

    /// Pages of texels, in their order behind the others.
    #[must_use]
    pub fn texels(&'a self) -> &'a [Texels<'a>] {
        &self.texels
    }

    /// Adds to a hash what textures show: the same however they are cut into pages.
    #[must_use]
    pub fn hash_textures(&self, hash: u64) -> u64 {
        let first = self.packed.geometry_pages();
        self.packed.textures.iter().fold(hash, |hash, texture| {
            let hash = hash_bytes(hash, bytemuck::bytes_of(&Texture { first: 0, tile: 0, pages: 0, ..*texture }));
            let [width, height] = texture.level_size(0);
            let (tile, columns) = (u32::from(texture.tile), texture.squares(0)[0]);
            (0..height).fold(hash, |hash, y| {
                let row: Vec<[u8; 4]> = (0..width)
                    .map(|x| {
                        let page = texture.first - first + y / tile * columns + x / tile;
                        self.texels[page as usize].get((x % tile) as i32, (y % tile) as i32)
                    })
                    .collect();
                hash_bytes(hash, row.as_flattened())
            })
        })
    }

    /// Hash of the primitives, each counted once: equal for equal ones, however they are cut into pages.
    #[must_use]
    pub fn hash_primitives(&self) -> u64 {
        // Ids count from 0, so this is room for all. What a broken file has beyond is counted where it stands.
        let places: u64 = self.packed.index.primitives.iter().map(|&n| u64::from(n)).sum();
        let seen: Vec<AtomicU64> = (0..places.div_ceil(64)).map(|_| AtomicU64::new(0)).collect();
        let is_new = |id: u32| {
            let bit = 1 << (id % 64);
            seen.get(id as usize / 64).is_none_or(|word| word.fetch_or(bit, Ordering::Relaxed) & bit == 0)
        };
        let of_page = |page: &PageView<'_>| {
            let mut sum = 0u64;
            let mut add = |kind: Kind, number: usize, id: u32, shape: &[f32], normals: &[u32]| {
                if is_new(id) {
                    let of_triangle = kind == Kind::Triangle;
                    let coordinates = page.coordinates().get(number).filter(|_| of_triangle);
                    let colours = page.colours().get(number).filter(|_| of_triangle);
                    let about = [id, kind as u32, page.material(Slot::new(kind, number)).into()];
                    let parts: [&[u8]; 3] =
                        [bytemuck::cast_slice(&about), bytemuck::cast_slice(shape), bytemuck::cast_slice(normals)];
                    // What stands in a page only because others of it have it counts as what it means: nothing.
                    let more = [
                        coordinates.filter(|c| **c != Coordinates::default()).map(bytemuck::bytes_of),
                        colours.filter(|c| **c != [[u8::MAX; 4]; 3]).map(bytemuck::bytes_of),
                    ];
                    // A sum: it is the same in any order.
                    let hash = parts.into_iter().chain(more.into_iter().flatten()).fold(HASH_START, hash_bytes);
                    sum = sum.wrapping_add(hash);
                }
            };
            for number in 0..page.body.triangle_lanes() {
                let corners = page.body.triangle(number).v.map(|v| v.to_array());
                let normals = page.body.normals(number).unwrap_or([FLAT; 3]);
                add(Kind::Triangle, number, page.body.triangle_id(number), corners.as_flattened(), &normals);
            }
            for number in 0..page.spheres.len() * BLOCK {
                let (block, lane) = (&page.spheres[number / BLOCK], number % BLOCK);
                let sphere = block.get(lane);
                let [x, y, z] = sphere.centre.to_array();
                add(Kind::Sphere, number, block.id[lane], &[x, y, z, sphere.radius], &[]);
            }
            for (number, cone) in page.cones.iter().enumerate() {
                let ([a, b, c], [d, e, f]) = (cone.base, cone.apex);
                add(Kind::Cone, number, cone.id, &[a, b, c, cone.base_radius, d, e, f, cone.apex_radius], &[]);
            }
            sum
        };
        self.views.par_iter().map(of_page).reduce(|| 0, u64::wrapping_add)
    }
}

impl Index {
    /// What the hash of pages starts from.
    pub const HASH_START: u64 = HASH_START;

    /// Adds textures' pages behind the others, shared out among the voxels; returns their table.
    pub fn add_textures(
        &mut self,
        textures: &[crate::texture::Texture],
        page_bytes: usize,
    ) -> (Vec<Texture>, Vec<Vec<Line>>) {
        let (records, pages) = crate::texture::pages(textures, page_bytes, self.entries.len() as u32);
        for (number, lines) in (0u32..).zip(&pages) {
            let bytes = Texels::parse(bytemuck::cast_slice(lines)).map_or(0, |texels| texels.bytes() as u32);
            self.entries.push(PageEntry { bytes, owner: 0, kind: PageEntry::TEXELS });
            self.voxels.push(number % self.voxel_count.max(1));
            self.add_page(0, hash_page(lines));
        }
        (records, pages)
    }

    /// Adds what is known of the next page.
    pub fn add_page(&mut self, primitives: u32, hash: u64) {
        self.primitives.push(primitives);
        self.hash = hash_bytes(self.hash, &hash.to_le_bytes());
    }

    /// Hash of directory and pages.
    pub fn hash(&self) -> u64 {
        hash_bytes(hash_bytes(self.hash, bytemuck::cast_slice(&self.nodes)), bytemuck::cast_slice(&self.entries))
    }
}

/// How many of the pages, the first ones, have nodes and primitives.
pub(crate) fn geometry_pages(entries: &[PageEntry]) -> u32 {
    entries.partition_point(|entry| entry.kind == PageEntry::GEOMETRY) as u32
}

/// Puts the trees of voxels below the planes between them, and the directory above their pages. Told in preorder.
pub(crate) struct Assembler {
    top: top::Builder,
    index: Index,
}

impl Assembler {
    /// Nothing yet.
    pub fn new(plan: &Plan) -> Self {
        let index = Index {
            nodes: Vec::new(),
            entries: Vec::new(),
            voxels: Vec::new(),
            voxel_count: plan.voxels(),
            primitives: Vec::new(),
            hash: HASH_START,
        };
        Self { top: top::Builder::new(), index }
    }

    /// A node above voxels.
    pub fn above(&mut self, aabb: &Aabb) {
        self.top.above(aabb);
    }

    /// A voxel; returns its pages.
    pub fn voxel(&mut self, voxel: u32, tree: VoxelTree) -> impl Iterator<Item = Vec<Line>> + use<> {
        let mut chunks = tree.chunks.iter();
        for node in &tree.tops {
            if !node.is_leaf() {
                self.top.above(&node.aabb);
                continue;
            }
            for (aabb, about) in chunks.by_ref().take(1).flat_map(|chunk| &chunk.events) {
                let Some(about) = about else {
                    self.top.above(aabb);
                    continue;
                };
                self.top.page(aabb, self.index.entries.len() as u32);
                self.index.entries.push(PageEntry { bytes: about.bytes, owner: 0, kind: 0 });
                self.index.voxels.push(voxel);
                self.index.add_page(about.primitives, about.hash);
            }
        }
        tree.chunks.into_iter().flat_map(|chunk| chunk.pages)
    }

    /// The directory.
    pub fn finish(mut self) -> Index {
        let top = self.top.finish();
        let mut nodes = vec![Node::EMPTY; top::nodes_for(self.index.entries.len())];
        let forests = &mut vec![Forest::EMPTY; top.len()];
        let used = top::directory(&top, forests, &mut nodes)
            .expect("builders bound the depth, and there is a node for each page");
        nodes.truncate(used);
        self.index.nodes = nodes;
        self.index
    }
}
