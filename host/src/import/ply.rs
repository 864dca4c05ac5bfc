//! PLY through `ply-rs-bw`: ASCII, and binary both ways.
//!
//! Elements are read one at a time into the mesh that becomes of them; a list that is longer than a polygon may be, or than the
//! rest of the file, is an error before it is kept. Vertices (`x`, `y`, `z`, and `nx`, `ny`, `nz`), faces (`vertex_indices` or
//! `vertex_index`) and triangle strips (`tristrips`, an index of -1 begins another) are used, and so are colours of vertices; other elements and properties
//! are read over.

use super::error::{ImportError, quote};
use super::mtl;
use super::obj::units;
use super::polygon::{CORNERS_MAX, Polygons, has_area};
use super::{guarded, open};
use crate::model::{Mesh, Model};
use hybray_shading::Material;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufRead, Read};
use std::path::Path;

/// A line of an ASCII file may be this long.
const LINE_MAX: u64 = 1 << 24;
/// The header may be this long.
const HEADER_MAX: u64 = 1 << 20;

/// What is used of an element.
#[derive(Default)]
struct Item {
    /// Position and normal of a vertex.
    values: [f32; 6],
    /// Red, green, blue and coverage: sRGB as bytes, or as numbers from 0 to 1.
    colour: Option<[u8; 4]>,
    /// Corners of a face or a strip; -1 where an index is none.
    list: Vec<i64>,
}

const VALUES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const LISTS: [&str; 3] = ["vertex_indices", "vertex_index", "tristrips"];
const COLOURS: [&str; 4] = ["red", "green", "blue", "alpha"];

impl PropertyAccess for Item {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let Some(at) = VALUES.iter().position(|known| *known == name) {
            match property.to_f32_lossy() {
                Some(value) => self.values[at] = value,
                None => return PropertyAccessResult::Ignored,
            }
            return PropertyAccessResult::Set;
        }
        if let Some(at) = COLOURS.iter().position(|known| *known == name) {
            let value = match property {
                Property::UChar(value) => value,
                Property::UShort(value) => (value >> 8) as u8,
                // A cast keeps within what the type holds.
                Property::Float(value) => (value * 255.0 + 0.5) as u8,
                Property::Double(value) => (value * 255.0 + 0.5) as u8,
                _ => return PropertyAccessResult::Ignored,
            };
            self.colour.get_or_insert([u8::MAX; 4])[at] = value;
            return PropertyAccessResult::Set;
        }
        // The first list of these is the one that counts: a file has one of them.
        if !self.list.is_empty() || !LISTS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        fn wide<T: Into<i64>>(list: Vec<T>) -> Vec<i64> {
            list.into_iter().map(Into::into).collect()
        }
        self.list = match property {
            Property::ListChar(list) => wide(list),
            Property::ListUChar(list) => wide(list),
            Property::ListShort(list) => wide(list),
            Property::ListUShort(list) => wide(list),
            Property::ListInt(list) => wide(list),
            Property::ListUInt(list) => wide(list),
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

/// Reads a PLY file.
pub(crate) fn load(path: &Path) -> Result<Model, ImportError> {
    let file = path.display().to_string();
    let reader = open(path).map_err(|e| e.into_error(&file))?;
    read(reader, &file)
}

/// The same from any reader.
pub(super) fn read<R: BufRead>(reader: R, file: &str) -> Result<Model, ImportError> {
    let mut source = Source { reader: Reader::new(reader.take(HEADER_MAX)), parser: Parser::new(), line: 0, file };
    let Some(header) = guarded(|| source.parser.read_header(&mut source.reader)) else {
        return Err(ImportError::new(file, "the PLY parser fails on the header", "export the file again"));
    };
    let header = header.map_err(|error| {
        let problem = format!("no PLY header ({error})");
        match error.line() {
            Some(line) => ImportError::at(file, line as u64, problem, "export the file again"),
            None => ImportError::new(file, problem, "export the file again"),
        }
    })?;
    // The reader stands at the line after the header.
    source.line = if header.encoding == Encoding::Ascii { source.reader.line() as u64 - 1 } else { 0 };
    source.reader.get_mut().set_limit(u64::MAX);

    let mut scene = Scene::default();
    let model = Model::default();
    let is_faces = |element: &ElementDef| matches!(&*element.name, "face" | "tristrips") && element.count > 0;
    if !header.elements.values().any(is_faces) {
        let remedy = "points alone are not drawn: export a mesh";
        return Err(ImportError::new(file, "holds no faces and no triangle strips", remedy));
    }
    for element in header.elements.values() {
        let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
        let is_vertex = element.name == "vertex";
        if is_vertex && !has(&VALUES[..3]) {
            let problem = "vertices without x, y and z";
            return Err(ImportError::new(file, problem, "export positions too"));
        }
        scene.has_normals |= is_vertex && has(&VALUES[3..]);
        scene.has_colours |= is_vertex && has(&COLOURS[..3]);
        let is_strip = element.name == "tristrips";
        // Of nothing there may be any number.
        if element.properties.is_empty() {
            continue;
        }
        for number in 0..element.count {
            let item = source.next(header.encoding, element, number)?;
            match element.name.as_str() {
                "vertex" => scene.vertex(item.values, item.colour),
                "face" | "tristrips" => {
                    let added = if is_strip { scene.strip(&item.list) } else { scene.face(&item.list) };
                    added.map_err(|(problem, remedy)| source.error(element, number, problem, &remedy))?;
                }
                _ => {}
            }
        }
    }
    Ok(scene.into_model(model, file))
}

/// Where elements come from.
struct Source<'f, R: BufRead> {
    reader: Reader<std::io::Take<R>>,
    parser: Parser<Item>,
    /// The last line that was read.
    line: u64,
    file: &'f str,
}

impl<R: BufRead> Source<'_, R> {
    fn next(&mut self, encoding: Encoding, element: &ElementDef, number: usize) -> Result<Item, ImportError> {
        let short = "copy or export the file again";
        let mut text = String::new();
        if encoding == Encoding::Ascii {
            while text.trim().is_empty() {
                text.clear();
                self.line += 1;
                let read = self.reader.get_mut().by_ref().take(LINE_MAX).read_line(&mut text);
                match read {
                    Ok(0) => {
                        let problem = format!("the file ends after {number} of {}", element.count);
                        return Err(self.error(element, number, problem, short));
                    }
                    Ok(read) if read as u64 == LINE_MAX => {
                        return Err(self.error(element, number, "a line of more than 16 MiB", short));
                    }
                    Ok(_) => {}
                    Err(error) => return Err(self.error(element, number, format!("no text ({error})"), short)),
                }
            }
        }
        let (parser, reader) = (&self.parser, self.reader.get_mut());
        let item = guarded(|| match encoding {
            Encoding::Ascii => parser.read_ascii_element(text.trim_end_matches(['\r', '\n']), element),
            Encoding::BinaryBigEndian => parser.read_big_endian_element(reader, element),
            Encoding::BinaryLittleEndian => parser.read_little_endian_element(reader, element),
        });
        match item {
            Some(Ok(item)) => Ok(item),
            Some(Err(error)) => Err(self.error(element, number, format!("{error}"), short)),
            None => Err(self.error(element, number, "the PLY parser fails here", short)),
        }
    }

    fn error(&self, element: &ElementDef, number: usize, problem: impl AsRef<str>, remedy: &str) -> ImportError {
        let problem = format!("{} {}: {}", quote(&element.name), number + 1, problem.as_ref());
        if self.line > 0 {
            ImportError::at(self.file, self.line, problem, remedy)
        } else {
            ImportError::new(self.file, problem, remedy)
        }
    }
}

type Complaint = (String, String);

/// What has been read.
#[derive(Default)]
struct Scene {
    mesh: Mesh,
    has_normals: bool,
    has_colours: bool,
    corners: Vec<[f32; 3]>,
    polygons: Option<Polygons>,
    faces: u64,
    dropped: u64,
}

impl Scene {
    fn vertex(&mut self, [x, y, z, nx, ny, nz]: [f32; 6], colour: Option<[u8; 4]>) {
        self.mesh.positions.push([x, y, z]);
        if self.has_normals {
            self.mesh.normals.push([nx, ny, nz]);
        }
        if self.has_colours {
            self.mesh.colours.push(colour.unwrap_or([u8::MAX; 4]));
        }
    }

    /// The vertex that an index stands for.
    fn corner(&self, index: i64) -> Result<u32, Complaint> {
        let count = self.mesh.positions.len();
        match u32::try_from(index) {
            Ok(corner) if (corner as usize) < count => Ok(corner),
            _ if count == 0 => {
                Err(("it stands before the vertices".to_owned(), "write vertices before faces".to_owned()))
            }
            _ => Err((format!("vertex {index} of {count}"), "count vertices from 0, and export again".to_owned())),
        }
    }

    fn face(&mut self, list: &[i64]) -> Result<(), Complaint> {
        if list.len() > CORNERS_MAX {
            let problem = format!("a face of {} corners", list.len());
            return Err((problem, format!("cut faces into ones of {CORNERS_MAX} corners at most")));
        }
        self.faces += 1;
        let before = self.mesh.triangles.len();
        if let &[a, b, c] = list {
            self.triangle([self.corner(a)?, self.corner(b)?, self.corner(c)?]);
        } else {
            let face: Vec<u32> = list.iter().map(|&i| self.corner(i)).collect::<Result<_, _>>()?;
            self.corners.clear();
            self.corners.extend(face.iter().map(|&i| self.mesh.positions[i as usize]));
            let triangles = self.polygons.get_or_insert_with(Polygons::new).triangulate(&self.corners);
            self.mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| face[i as usize])));
        }
        self.dropped += u64::from(self.mesh.triangles.len() == before);
        Ok(())
    }

    fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|i| self.mesh.positions[i as usize]);
        if has_area(a, b, c) {
            self.mesh.triangles.push(corners);
        }
    }

    /// Triangles of which each has two corners of the last, turned alternately.
    fn strip(&mut self, list: &[i64]) -> Result<(), Complaint> {
        for strip in list.split(|&index| index == -1) {
            for (i, corners) in strip.windows(3).enumerate() {
                let [a, b, c] = [self.corner(corners[0])?, self.corner(corners[1])?, self.corner(corners[2])?];
                self.faces += 1;
                let before = self.mesh.triangles.len();
                self.triangle(if i % 2 == 0 { [a, b, c] } else { [b, a, c] });
                self.dropped += u64::from(self.mesh.triangles.len() == before);
            }
        }
        Ok(())
    }

    fn into_model(mut self, mut model: Model, file: &str) -> Model {
        if self.dropped > 0 {
            model
                .warnings
                .push(format!("{file}: {} of {} faces have no area and are left out", self.dropped, self.faces));
        }
        let mesh = &mut self.mesh;
        mesh.normals = units(std::mem::take(&mut mesh.normals), &mesh.positions, &mesh.triangles);
        mesh.name = "faces".to_owned();
        let mut material = mtl::DEFAULT;
        if !mesh.colours.is_empty() {
            // Its vertices say how light it is.
            (material.diffuse, material.ambient) = ([1.0; 3], [1.0; 3]);
            let through = mesh.colours.iter().any(|colour| colour[3] < u8::MAX);
            material.flags |= Material::DETAIL | if through { Material::BLEND } else { 0 };
        }
        mesh.material = model.add_material("default", material);
        model.objects.polygons = self.faces;
        model.meshes.push(self.mesh);
        model
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::Choices;
    use super::*;

    fn parse(bytes: &[u8]) -> Result<Model, String> {
        read(bytes, "a.ply").map_err(|e| e.to_string())
    }

    const HEAD: &str = "comment a pyramid\nelement vertex 5\nproperty float x\nproperty double y\nproperty float z\n\
        property uchar quality\nelement face 2\nproperty uchar sides\nproperty list uchar int vertex_indices\n\
        property list uchar float weights\nend_header\n";
    const CORNERS: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.25, 2.0]];
    const FACES: [&[i32]; 2] = [&[0, 1, 2, 3], &[0, 1, 4]];

    /// The pyramid, in each encoding.
    fn pyramid(big_endian: Option<bool>) -> Vec<u8> {
        let encoding = match big_endian {
            None => "ascii",
            Some(true) => "binary_big_endian",
            Some(false) => "binary_little_endian",
        };
        let mut out = format!("ply\nformat {encoding} 1.0\n{HEAD}").into_bytes();
        let Some(big) = big_endian else {
            for [x, y, z] in CORNERS {
                out.extend_from_slice(format!("{x} {y} {z} 7\n").as_bytes());
            }
            out.extend_from_slice(b"4 4 0 1 2 3 1 0.5\n3 3 0 1 4 0\n");
            return out;
        };
        let mut put = |bytes: &mut [u8]| {
            if big {
                bytes.reverse();
            }
            out.extend_from_slice(bytes);
        };
        for [x, y, z] in CORNERS {
            put(&mut x.to_le_bytes());
            put(&mut f64::from(y).to_le_bytes());
            put(&mut z.to_le_bytes());
            put(&mut [7]);
        }
        for face in FACES {
            put(&mut [face.len() as u8]);
            put(&mut [face.len() as u8]);
            face.iter().for_each(|i| put(&mut i.to_le_bytes()));
            put(&mut [1]);
            put(&mut 0.5f32.to_le_bytes());
        }
        out
    }

    #[test]
    fn every_encoding_gives_the_same_mesh() {
        for encoding in [None, Some(true), Some(false)] {
            let model = parse(&pyramid(encoding)).expect("reads");
            let mesh = &model.meshes[0];
            assert_eq!(mesh.positions, CORNERS, "{encoding:?}");
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 4]], "{encoding:?}");
            assert!(mesh.normals.is_empty() && model.warnings.is_empty(), "{:?}", model.warnings);
            assert_eq!(model.objects.polygons, 2);
        }
    }

    #[test]
    fn strips_turn_alternately_and_begin_again() {
        let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n\
            property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
            element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
            0 0 0 0 0 2 1 2 3\n1 0 0 0 0 0 1 2 3\n0 1 0 0 0 2 1 2 3\n1 1 0 0 0 2 1 2 3\n9 9 9 0 0 1 0 0 0\n\
            8 0 1 2 3 -1 2 1 3\n";
        let model = parse(text.as_bytes()).expect("reads");
        let mesh = &model.meshes[0];
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 1, 3]]);
        // All look up: the normal that is none is the mean of those around.
        assert_eq!(mesh.normals[..4], [[0.0, 0.0, 1.0]; 4]);
        assert_eq!(mesh.colours, [[1, 2, 3, 255], [1, 2, 3, 255], [1, 2, 3, 255], [1, 2, 3, 255], [0, 0, 0, 255]]);
        assert_eq!(model.materials[0].material.flags, Material::DETAIL);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let head = |rest: &str| format!("ply\nformat ascii 1.0\n{rest}");
        let vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
        let faces = "element face 1\nproperty list uchar int vertex_index\nend_header\n";
        let corners = "0 0 0\n1 0 0\n0 1 0\n";
        let check = |text: String, expected: &str| {
            let error = parse(text.as_bytes()).expect_err(expected);
            assert!(error.starts_with(expected), "{error}");
        };
        check("plywood".into(), "a.ply:1: no PLY header");
        check(head(&format!("{vertices}end_header\n{corners}")), "a.ply: holds no faces");
        check(head(&format!("{vertices}{faces}{corners}3 0 1 3\n")), "a.ply:13: `face` 1: vertex 3 of 3;");
        check(head(&format!("{vertices}{faces}{corners}3 0 1 -2\n")), "a.ply:13: `face` 1: vertex -2 of 3;");
        check(head(&format!("{vertices}{faces}{corners}")), "a.ply:13: `face` 1: the file ends after 0 of 1;");
        check(head(&format!("{vertices}{faces}0 0 0\n1 x 0\n")), "a.ply:11: `vertex` 2:");
        check(head(&vertices.replace(" z", " w")) + faces, "a.ply: vertices without x, y and z;");
        let early =
            format!("element face 1\nproperty list uchar int vertex_index\n{vertices}end_header\n3 0 1 2\n{corners}");
        check(head(&early), "a.ply:10: `face` 1: it stands before the vertices;");
    }

    #[test]
    fn broken_files_end_in_an_error_or_a_mesh() {
        let mut choices = Choices(5);
        let (mut read, mut refused) = (0, 0);
        for round in 0..3000 {
            let mut bytes = pyramid([None, Some(true), Some(false)][round % 3]);
            for _ in 0..1 + choices.below(3) {
                let at = choices.below(bytes.len());
                match choices.below(4) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = b"0123456789 -e\n"[choices.below(14)],
                    _ => bytes[at] ^= 1 << choices.below(8),
                }
            }
            match parse(&bytes) {
                Ok(model) => {
                    let mesh = &model.meshes[0];
                    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
                    read += 1;
                }
                Err(error) => {
                    assert!(error.starts_with("a.ply") && error.lines().count() == 1, "{error}");
                    refused += 1;
                }
            }
        }
        assert!(read > 100 && refused > 1000, "{read} {refused}");
    }
}
