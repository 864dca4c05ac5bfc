//! A page: header, nodes, primitives, and what shading needs of them.

use crate::{
    BLOCK, Body, Child, Compact, CompactNode, CompactTriangles, ConeRecord, DEPTH_MAX, Full, Kind, Node, PageForm,
    Slot, SphereBlock, TriangleBlock, WIDTH,
};
use bytemuck::{Pod, Zeroable};

/// Most bytes of a page.
pub const PAGE_BYTES_MAX: usize = 64 * 1024;
/// Bytes of a [`Header`].
pub const HEADER_BYTES: usize = core::mem::size_of::<Header>();

/// Storage for pages: a page starts at a line, so that everything in it is aligned.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Line(pub [u8; 64]);

/// Lines that `bytes` take.
#[must_use]
pub const fn lines_for(bytes: usize) -> usize {
    bytes.div_ceil(64)
}

/// First 64 bytes of a page. The arrays follow without gaps: in the full form nodes, triangles, spheres, cones, normals,
/// texture coordinates, colours, materials; in the compact one nodes, spheres, triangles, cones, vertices, normals, texture
/// coordinates, colours, materials.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// [`Header::MAGIC`], or [`Header::MAGIC_COMPACT`].
    pub magic: u32,
    /// Bytes of the whole page, this header included.
    pub bytes: u32,
    /// [`Node`]s, or [`CompactNode`]s; the first is the root.
    pub nodes: u32,
    /// [`TriangleBlock`]s, or [`CompactTriangles`].
    pub triangle_blocks: u32,
    /// [`SphereBlock`]s.
    pub sphere_blocks: u32,
    /// [`ConeRecord`]s.
    pub cones: u32,
    /// Vertex normals: three packed ones for each triangle lane, or one for each vertex of a compact page, or none at all.
    pub normals: u32,
    /// Materials: a `u16` for each lane and cone in slot order, or one for all.
    pub materials: u32,
    /// Least corner of everything in the page.
    pub lo: [f32; 3],
    /// Greatest corner.
    pub hi: [f32; 3],
    /// Vertices of a compact page.
    pub vertices: u32,
    /// What else stands with each triangle lane: [`Header::COORDINATES`], [`Header::COLOURS`].
    pub attributes: u32,
}

const _: () = assert!(core::mem::size_of::<Header>() == 64);

impl Header {
    /// "hyP" and the version of the format: a page in full form.
    pub const MAGIC: u32 = u32::from_le_bytes(*b"hyP\x01");
    /// "hyC" and the version of the format: a compact page.
    pub const MAGIC_COMPACT: u32 = u32::from_le_bytes(*b"hyC\x01");
    /// Texture coordinates of the three corners of each triangle lane.
    pub const COORDINATES: u32 = 1;
    /// Colours of the three corners of each triangle lane.
    pub const COLOURS: u32 = 2;

    /// The form that the magic tells.
    #[must_use]
    #[inline(always)]
    pub const fn form(&self) -> PageForm {
        if self.magic == Self::MAGIC_COMPACT { PageForm::Compact } else { PageForm::Full }
    }

    /// Triangle lanes if these attributes stand with each, else 0.
    #[must_use]
    const fn lanes_with(&self, attribute: u32) -> u32 {
        if self.attributes & attribute == 0 { 0 } else { self.triangle_blocks * BLOCK as u32 }
    }

    /// Bytes of a page with these counts.
    #[must_use]
    pub const fn bytes_for(&self) -> u64 {
        let (node, triangles, normal, vertices) = match self.form() {
            PageForm::Full => (size_of::<Node>(), size_of::<TriangleBlock>(), 12, 0),
            PageForm::Compact => (size_of::<CompactNode>(), size_of::<CompactTriangles>(), 4, self.vertices as u64),
        };
        HEADER_BYTES as u64
            + self.nodes as u64 * node as u64
            + self.triangle_blocks as u64 * triangles as u64
            + self.sphere_blocks as u64 * size_of::<SphereBlock>() as u64
            + self.cones as u64 * size_of::<ConeRecord>() as u64
            + vertices * 12
            + self.normals as u64 * normal
            + self.lanes_with(Self::COORDINATES) as u64 * size_of::<Coordinates>() as u64
            + self.lanes_with(Self::COLOURS) as u64 * size_of::<Colours>() as u64
            + self.materials as u64 * 2
    }

    /// Materials of a page whose primitives do not all have the same.
    #[must_use]
    pub const fn material_slots(&self) -> u32 {
        (self.triangle_blocks + self.sphere_blocks) * BLOCK as u32 + self.cones
    }
}

/// Texture coordinates of a triangle's corners: u, and v from the top of the picture down.
pub type Coordinates = [[f32; 2]; 3];
/// Colours of a triangle's corners: red, green and blue encoded as sRGB, and coverage.
pub type Colours = [[u8; 4]; 3];

/// Lengths of the tables that pages refer to, for validation.
#[derive(Clone, Copy, Debug)]
pub struct Tables {
    /// Materials of the scene.
    pub materials: usize,
}

/// Why a block is no page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PageError {
    /// Shorter than its header says, or than any header.
    #[error("a page of {bytes} bytes is cut short: it needs {needed}")]
    Short {
        /// Bytes at hand.
        bytes: usize,
        /// Bytes that it needs.
        needed: u64,
    },
    /// Not a page of this version.
    #[error("this is no page of this version of Hybray (magic {0:#010x})")]
    Magic(u32),
    /// Counts that do not add up, or exceed [`PAGE_BYTES_MAX`].
    #[error("a page's header contradicts itself: {0}")]
    Header(&'static str),
    /// A node that leads nowhere, backwards or too deep.
    #[error("node {node} of a page is broken: {what}")]
    Node {
        /// Its index.
        node: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A triangle of a compact page that has a vertex beyond the last one.
    #[error("block {block} of a page's triangles is broken: a vertex beyond the last one")]
    Vertex {
        /// Its index.
        block: usize,
    },
    /// A material beyond the scene's table.
    #[error("a page refers to material {0}, which the scene does not have")]
    Material(u16),
}

/// A validated page, read in place.
#[derive(Clone, Copy, Debug)]
pub struct PageView<'a> {
    /// Its header.
    pub header: &'a Header,
    /// Nodes and triangles.
    pub body: Body<'a>,
    /// Spheres.
    pub spheres: &'a [SphereBlock],
    /// Cones.
    pub cones: &'a [ConeRecord],
    /// What stands behind: texture coordinates, colours, materials. Hits ask for them; walks need not know where they are.
    rest: &'a [u8],
}

impl<'a> PageView<'a> {
    /// Validates a page, in one pass over its nodes: whatever the bytes, a walk of the result ends and stays inside.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn parse(lines: &'a [Line], tables: Tables) -> Result<Self, PageError> {
        let all: &[u8] = bytemuck::cast_slice(lines);
        let short = |needed| PageError::Short { bytes: all.len(), needed };
        if all.len() < HEADER_BYTES {
            return Err(short(HEADER_BYTES as u64));
        }
        let header: &Header = bytemuck::from_bytes(&all[..HEADER_BYTES]);
        if header.magic != Header::MAGIC && header.magic != Header::MAGIC_COMPACT {
            return Err(PageError::Magic(header.magic));
        }
        let counts = [
            header.nodes,
            header.triangle_blocks,
            header.sphere_blocks,
            header.cones,
            header.normals,
            header.materials,
            header.vertices,
        ];
        if counts.iter().any(|&n| n as usize > PAGE_BYTES_MAX) {
            return Err(PageError::Header("more of something than a page can hold"));
        }
        let needed = header.bytes_for();
        if needed != u64::from(header.bytes) || needed > PAGE_BYTES_MAX as u64 {
            return Err(PageError::Header("its counts do not make its bytes, or exceed 64 KiB"));
        }
        if needed > all.len() as u64 {
            return Err(short(needed));
        }
        if header.attributes & !(Header::COORDINATES | Header::COLOURS) != 0 {
            return Err(PageError::Header("attributes that are not known here"));
        }
        if header.nodes == 0 {
            return Err(PageError::Header("no root"));
        }
        if header.materials != 1 && header.materials != header.material_slots() {
            return Err(PageError::Header("neither one material nor one for each slot"));
        }
        let (smooth, what) = match header.form() {
            PageForm::Full if header.vertices != 0 => {
                return Err(PageError::Header("vertices that triangles do not share"));
            }
            PageForm::Full => (header.triangle_blocks * BLOCK as u32, "neither no normals nor three for each triangle"),
            PageForm::Compact => (header.vertices, "neither no normals nor one for each vertex"),
        };
        if header.normals != 0 && header.normals != smooth {
            return Err(PageError::Header(what));
        }

        let view = Self::of_valid(lines);
        let leaf = |child| match child {
            Child::Leaf { kind, start, count } => {
                let have = match kind {
                    Kind::Triangle => header.triangle_blocks as usize,
                    Kind::Sphere => view.spheres.len(),
                    Kind::Cone => view.cones.len(),
                };
                if (start + count) as usize <= have { Ok(()) } else { Err("a leaf beyond the page's primitives") }
            }
            Child::Page(_) => Err("a page inside a page"),
            Child::Inner(_) | Child::Unused => Ok(()),
        };
        let level = &mut [0; PAGE_BYTES_MAX / size_of::<CompactNode>()];
        match &view.body {
            Body::Full(page) => check_nodes(page.nodes.iter().map(|node| node.child), level, leaf),
            Body::Compact(page) => check_nodes(page.nodes.iter().map(CompactNode::packed_children), level, leaf),
        }
        .map_err(|(node, what)| PageError::Node { node, what })?;
        if let Body::Compact(page) = &view.body {
            let beyond = |block: &CompactTriangles| {
                block.v.as_flattened().iter().any(|&vertex| usize::from(vertex) >= page.vertices.len())
            };
            if let Some(block) = page.triangles.iter().position(beyond) {
                return Err(PageError::Vertex { block });
            }
        }
        if let Some(&material) = view.materials().iter().find(|&&m| usize::from(m) >= tables.materials) {
            return Err(PageError::Material(material));
        }
        Ok(view)
    }

    /// A page whose lines [`PageView::parse`] has accepted since they were last written.
    ///
    /// # Panics
    /// If it has not, and the counts do not fit: nothing worse can come of it.
    #[must_use]
    #[inline(always)]
    pub fn of_valid(lines: &'a [Line]) -> Self {
        let all: &[u8] = bytemuck::cast_slice(lines);
        let header: &Header = bytemuck::from_bytes(&all[..HEADER_BYTES]);
        let mut rest = &all[HEADER_BYTES..];
        let mut take = |count: u32, each: usize| {
            let (these, others) = rest.split_at(count as usize * each);
            rest = others;
            these
        };
        let (sphere_bytes, cone_bytes) = (size_of::<SphereBlock>(), size_of::<ConeRecord>());
        let (body, spheres, cones) = match header.form() {
            PageForm::Full => {
                let nodes = take(header.nodes, size_of::<Node>());
                let triangles = take(header.triangle_blocks, size_of::<TriangleBlock>());
                let (spheres, cones) = (take(header.sphere_blocks, sphere_bytes), take(header.cones, cone_bytes));
                let full = Full {
                    nodes: bytemuck::cast_slice(nodes),
                    triangles: bytemuck::cast_slice(triangles),
                    normals: bytemuck::cast_slice(take(header.normals, 12)),
                };
                (Body::Full(full), spheres, cones)
            }
            PageForm::Compact => {
                let nodes = take(header.nodes, size_of::<CompactNode>());
                // What is aligned to sixteen bytes comes first.
                let spheres = take(header.sphere_blocks, sphere_bytes);
                let triangles = take(header.triangle_blocks, size_of::<CompactTriangles>());
                let cones = take(header.cones, cone_bytes);
                let compact = Compact {
                    nodes: bytemuck::cast_slice(nodes),
                    triangles: bytemuck::cast_slice(triangles),
                    vertices: bytemuck::cast_slice(take(header.vertices, 12)),
                    normals: bytemuck::cast_slice(take(header.normals, 4)),
                };
                (Body::Compact(compact), spheres, cones)
            }
        };
        Self { header, body, spheres: bytemuck::cast_slice(spheres), cones: bytemuck::cast_slice(cones), rest }
    }

    /// Bytes of texture coordinates and of colours.
    fn attribute_bytes(&self) -> [usize; 2] {
        let lanes = |attribute| self.header.lanes_with(attribute) as usize;
        [lanes(Header::COORDINATES) * size_of::<Coordinates>(), lanes(Header::COLOURS) * size_of::<Colours>()]
    }

    /// Texture coordinates of each triangle lane; or empty.
    #[must_use]
    pub fn coordinates(&self) -> &'a [Coordinates] {
        bytemuck::cast_slice(&self.rest[..self.attribute_bytes()[0]])
    }

    /// Colours of each triangle lane; or empty.
    #[must_use]
    pub fn colours(&self) -> &'a [Colours] {
        let [before, bytes] = self.attribute_bytes();
        bytemuck::cast_slice(&self.rest[before..][..bytes])
    }

    /// One for all, or one for each slot.
    #[must_use]
    pub fn materials(&self) -> &'a [u16] {
        let before = if self.header.attributes == 0 { 0 } else { self.attribute_bytes().iter().sum() };
        bytemuck::cast_slice(&self.rest[before..][..2 * self.header.materials as usize])
    }

    /// The material of the primitive in `slot`.
    #[must_use]
    pub fn material(&self, slot: Slot) -> u16 {
        let materials = self.materials();
        if let [one] = materials {
            return *one;
        }
        let before = match slot.kind() {
            Kind::Triangle => 0,
            Kind::Sphere => self.body.triangle_lanes(),
            Kind::Cone => self.body.triangle_lanes() + self.spheres.len() * BLOCK,
        };
        materials[before + slot.number()]
    }
}

/// Checks that children come after their parents, that each has one parent, that none is below [`DEPTH_MAX`], and
/// `leaf` of what is no inner node. `nodes` are their packed children; `level` is scratch, one byte a node.
pub(crate) fn check_nodes(
    nodes: impl ExactSizeIterator<Item = [u32; WIDTH]>,
    level: &mut [u8],
    mut leaf: impl FnMut(Child) -> Result<(), &'static str>,
) -> Result<(), (usize, &'static str)> {
    let count = nodes.len();
    let Some(level) = level.get_mut(..count) else {
        return Err((level.len(), "more nodes than there is scratch for"));
    };
    level.fill(0);
    for (index, children) in nodes.enumerate() {
        for packed in children {
            let child = Child::unpack(packed);
            if packed != child.pack() {
                return Err((index, "an unknown kind of child"));
            }
            match child {
                Child::Inner(next) => {
                    let next = next as usize;
                    if next <= index || next >= count {
                        return Err((index, "a child that does not come after it"));
                    }
                    if level[next] != 0 {
                        return Err((index, "a child that has another parent"));
                    }
                    level[next] = level[index] + 1;
                    if usize::from(level[next]) >= DEPTH_MAX {
                        return Err((index, "too deep"));
                    }
                }
                Child::Unused => {}
                other => leaf(other).map_err(|what| (index, what))?,
            }
        }
    }
    Ok(())
}
