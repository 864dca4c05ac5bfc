//! Pages put together by hand.
#![allow(dead_code)]

use bytemuck::{Zeroable, bytes_of, cast_slice, cast_slice_mut};
use hybray_geometry::Aabb;
use hybray_scene::{
    Child, ConeRecord, Header, Kind, Line, Node, PageError, PageView, SphereBlock, Tables, TriangleBlock, lines_for,
};

/// What a page is made of; its header is worked out.
#[derive(Clone, Default)]
pub struct Parts {
    pub nodes: Vec<Node>,
    pub triangles: Vec<TriangleBlock>,
    pub spheres: Vec<SphereBlock>,
    pub cones: Vec<ConeRecord>,
    pub normals: Vec<[u32; 3]>,
    pub materials: Vec<u16>,
}

/// Two blocks of triangles, one of spheres, three cones, all with normals and materials of their own.
pub fn sample() -> Parts {
    Parts {
        nodes: vec![branch(&[leaf(Kind::Triangle, 0, 2), leaf(Kind::Sphere, 0, 1), leaf(Kind::Cone, 0, 3)])],
        triangles: vec![Zeroable::zeroed(); 2],
        spheres: vec![Zeroable::zeroed(); 1],
        cones: vec![Zeroable::zeroed(); 3],
        normals: vec![[0; 3]; 8],
        materials: (0..15).collect(),
    }
}

/// A node with these children.
pub fn branch(children: &[Child]) -> Node {
    let mut node = Node::EMPTY;
    for (slot, &child) in children.iter().enumerate() {
        node.set(slot, &Aabb { lo: [0.0; 3].into(), hi: [1.0; 3].into() }, child);
    }
    node
}

/// `levels` nodes, each the child of the one before.
pub fn chain(levels: u32) -> Vec<Node> {
    (1..=levels).map(|next| if next < levels { branch(&[Child::Inner(next)]) } else { branch(&[]) }).collect()
}

pub const fn leaf(kind: Kind, start: u32, count: u32) -> Child {
    Child::Leaf { kind, start, count }
}

impl Parts {
    pub fn lines(&self) -> Vec<Line> {
        let mut header = Header {
            magic: Header::MAGIC,
            nodes: self.nodes.len() as u32,
            triangle_blocks: self.triangles.len() as u32,
            sphere_blocks: self.spheres.len() as u32,
            cones: self.cones.len() as u32,
            normals: self.normals.len() as u32,
            materials: self.materials.len() as u32,
            ..Zeroable::zeroed()
        };
        header.bytes = header.bytes_for() as u32;
        let mut lines = vec![Line([0; 64]); lines_for(header.bytes as usize)];
        let room: &mut [u8] = cast_slice_mut(&mut lines);
        let parts = [
            bytes_of(&header),
            cast_slice(&self.nodes),
            cast_slice(&self.triangles),
            cast_slice(&self.spheres),
            cast_slice(&self.cones),
            cast_slice(&self.normals),
            cast_slice(&self.materials),
        ];
        let mut at = 0;
        for part in parts {
            room[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        lines
    }
}

pub fn parse(lines: &[Line]) -> Result<PageView<'_>, PageError> {
    PageView::parse(lines, Tables { materials: 15 })
}
