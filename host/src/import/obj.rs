//! OBJ through `tobj`, behind a guard.
//!
//! `tobj` reads geometry; the [`Guard`] is the reader that it reads from. Every line passes through the guard once,
//! as the file streams by, and what `tobj` would panic on or silently misread never reaches it: indices of 0, out of
//! range or with too many parts, numbers that are not finite, lines (`l` with three points would become a triangle),
//! faces that have normals at some corners only (its normals would shift), keywords with a tab or a blank before them.
//! Such a line is an error that names file and line, or a warning where a viewer would draw the rest.
//!
//! The guard also keeps `tobj` small. `tobj` holds 104 bytes for each face of the object it is reading and a hash map
//! of its vertices; so the guard lets no object grow beyond [`PIECE_FACES`] faces: it cuts the file into *pieces* of
//! one material, with or without normals and texture coordinates, and names each by its number. Texture coordinates pass
//! where the material has pictures: `tobj` splits vertices at their seams. Vertex colours do not pass. Pieces become meshes one by one, and
//! small ones of one material are joined.
//!
//! What `tobj` can do to the process is bounded too: it runs under `catch_unwind`.
//!
//! A zero `vn` stands for "no idea": its corner takes the mean normal of the triangles around it. Faces of more than
//! three corners go through [`Polygons`]; faces without area are dropped and counted.

use super::error::{ImportError, Warnings, quote};
use super::lines::{Lines, without_comment};
use super::meshes::Meshes;
use super::mtl_maps::{Known, Library, MaterialFile, read_materials};
use super::polygon::{CORNERS_MAX, Polygons, has_area, unit};
use super::{COORDINATE_MAX, guarded, mtl, open};
use crate::model::{Mesh, Model, NamedMaterial};
use hybray_shading::Map;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufRead, Read, Write as _};
use std::path::Path;

/// Faces after which `tobj` is told of a new object: 27 MB of its records, and few enough borders between pieces that
/// the vertices they share, kept twice, do not count (about 1 in 250 in a mesh that is stored in strips).
const PIECE_FACES: u32 = 1 << 18;

/// A piece of fewer triangles than a fourth of this is joined with others of its material.
const JOINED_TRIANGLES: usize = 1 << 18;

/// Vertices, normals or texture coordinates that a file may have: `u32` counts them.
const VERTICES_MAX: i64 = u32::MAX as i64;

/// Different `mtllib` lines that a file may have.
const LIBRARIES_MAX: usize = 1_000;

/// Reads an OBJ file and the material files that it names.
pub(crate) fn load(path: &Path) -> Result<Model, ImportError> {
    let file = path.display().to_string();
    let reader = open(path).map_err(|e| e.into_error(&file))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read(reader, &file, |name| read_materials(folder, name))
}

/// The same from any reader; `library` finds what a `mtllib` line names.
pub(super) fn read<R: BufRead>(reader: R, file: &str, library: impl Fn(&str) -> Library) -> Result<Model, ImportError> {
    let mut guard = Guard::new(Lines::new(reader, file, true), &library);
    let options = tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };
    // The guard handles materials itself, so `tobj` is never told of a material file.
    let parsed = guarded(|| tobj::load_obj_buf(&mut guard, &options, |_| Err(tobj::LoadError::OpenFileFailed)));
    if let Some(error) = guard.error {
        return Err(error);
    }
    let pieces = match parsed {
        Some(Ok((pieces, _))) => pieces,
        Some(Err(error)) => {
            return Err(guard.lines.error(format!("the OBJ parser refuses this ({error})"), "export the file again"));
        }
        None => return Err(guard.lines.error("the OBJ parser failed here", "export the file again")),
    };
    if guard.faces == 0 {
        return Err(ImportError::new(file, "holds no faces", "check that it is an OBJ file with `f` lines"));
    }

    let mut model = Model { warnings: guard.notes, ..guard.model };
    model.objects.polygons = guard.faces;
    let (mut meshes, mut polygons, mut dropped) = (Meshes::default(), Polygons::new(), 0);
    for piece in pieces {
        let Some(about) = piece.name.parse::<usize>().ok().and_then(|i| guard.pieces.get(i)) else { continue };
        let mesh = to_mesh(piece.mesh, about, &mut polygons, &mut dropped);
        meshes.append(mesh, JOINED_TRIANGLES);
    }
    model.meshes = meshes.finish();
    model.warnings.extend(guard.warnings.lines(file));
    if dropped > 0 {
        model.warnings.push(format!("{file}: {dropped} of {} faces have no area and are left out", guard.faces));
    }
    Ok(model)
}

/// One piece of `tobj`'s as a mesh, its faces cut into triangles.
fn to_mesh(piece: tobj::Mesh, about: &Piece, polygons: &mut Polygons, dropped: &mut u64) -> Mesh {
    let points = |flat: Vec<f32>| -> Vec<[f32; 3]> { flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect() };
    let (arities, indices) = (piece.face_arities, piece.indices);
    let positions = points(piece.positions);
    let normals = points(piece.normals);
    let coordinates: Vec<[f32; 2]> = piece.texcoords.chunks_exact(2).map(|c| [c[0], c[1]]).collect();
    let mut triangles = Vec::with_capacity(if arities.is_empty() { indices.len() / 3 } else { 0 });
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut from = 0;
    let faces = if arities.is_empty() { indices.len() / 3 } else { arities.len() };
    for face in 0..faces {
        let arity = arities.get(face).map_or(3, |&a| a as usize);
        let face = &indices[from..from + arity];
        from += arity;
        let before = triangles.len();
        if let &[a, b, c] = face {
            if has_area(positions[a as usize], positions[b as usize], positions[c as usize]) {
                triangles.push([a, b, c]);
            }
        } else {
            corners.clear();
            corners.extend(face.iter().map(|&i| positions[i as usize]));
            triangles.extend(polygons.triangulate(&corners).iter().map(|t| t.map(|i| face[i as usize])));
        }
        *dropped += u64::from(triangles.len() == before);
    }
    let normals = if normals.len() == positions.len() { units(normals, &positions, &triangles) } else { Vec::new() };
    let coordinates = if coordinates.len() == positions.len() { coordinates } else { Vec::new() };
    let (name, material) = (about.name.clone(), about.material);
    Mesh { name, positions, normals, coordinates, triangles, material, ..Mesh::default() }
}

/// Normals at length 1; those without a length become the mean of the triangles around.
pub(super) fn units(mut normals: Vec<[f32; 3]>, positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut around: BTreeMap<u32, [f64; 3]> = BTreeMap::new();
    for (i, normal) in normals.iter_mut().enumerate() {
        match unit(normal.map(f64::from)) {
            Some(unit) => *normal = unit.map(|c| c as f32),
            None => drop(around.insert(i as u32, [0.0; 3])),
        }
    }
    if around.is_empty() {
        return normals;
    }
    for triangle in triangles {
        let own = super::polygon::newell(&triangle.map(|i| positions[i as usize]));
        for corner in triangle {
            if let Some(sum) = around.get_mut(corner) {
                *sum = [0, 1, 2].map(|k| sum[k] + own[k]);
            }
        }
    }
    for (corner, sum) in around {
        normals[corner as usize] = unit(sum).unwrap_or([0.0, 0.0, 1.0]).map(|c| c as f32);
    }
    normals
}

/// Faces that follow each other with one material, all with normals or all without, and with texture coordinates or without.
struct Piece {
    name: String,
    material: u16,
    normals: bool,
    coordinates: bool,
    faces: u32,
    corners: u32,
}

/// The reader that `tobj` reads from: see the module's page.
struct Guard<'a, R> {
    lines: Lines<R>,
    library: &'a dyn Fn(&str) -> Library,
    /// What `tobj` has not taken yet begins at `at`.
    out: Vec<u8>,
    at: usize,
    /// Why the file ends early for `tobj`.
    error: Option<ImportError>,
    vertices: i64,
    textures: i64,
    normals: i64,
    vertices_max: i64,
    faces: u64,
    pieces: Vec<Piece>,
    piece_faces: u32,
    /// Name of the object or group that the file is in.
    name: String,
    /// Material that the file has chosen, and its index once a face has it.
    chosen: Option<String>,
    chosen_index: Option<u16>,
    known: BTreeMap<String, Known>,
    /// What stood in the `mtllib` lines so far.
    loaded: BTreeSet<String>,
    indices: BTreeMap<String, u16>,
    /// Its materials, textures and their uses.
    model: Model,
    corners: Vec<[i64; 3]>,
    warnings: Warnings,
    /// Warnings about material files.
    notes: Vec<String>,
}

impl<'a, R: BufRead> Guard<'a, R> {
    fn new(lines: Lines<R>, library: &'a dyn Fn(&str) -> Library) -> Self {
        Self {
            lines,
            library,
            out: Vec::new(),
            at: 0,
            error: None,
            vertices: 0,
            textures: 0,
            normals: 0,
            vertices_max: VERTICES_MAX,
            faces: 0,
            pieces: Vec::new(),
            piece_faces: PIECE_FACES,
            name: String::new(),
            chosen: None,
            chosen_index: None,
            known: BTreeMap::new(),
            loaded: BTreeSet::new(),
            indices: BTreeMap::new(),
            model: Model::default(),
            corners: Vec::new(),
            warnings: Warnings::default(),
            notes: Vec::new(),
        }
    }

    /// Checks lines until there are some kilobytes for `tobj`, or the file ends.
    fn refill(&mut self) -> Result<(), ImportError> {
        self.out.clear();
        self.at = 0;
        while self.out.len() < 1 << 14 {
            let Some(line) = self.lines.next()? else { return Ok(()) };
            let line = line.trim_start();
            let key_end = line.find(char::is_whitespace).unwrap_or(line.len());
            let (key, rest) = line.split_at(key_end);
            match key {
                "v" | "vn" | "vt" => {
                    let is_vertex = key == "v";
                    let what = ["v", "vn", "vt"][usize::from(key == "vn") + 2 * usize::from(key == "vt")];
                    let written = write_numbers(&mut self.out, key, rest);
                    let count = match key {
                        "v" => &mut self.vertices,
                        "vn" => &mut self.normals,
                        _ => &mut self.textures,
                    };
                    *count += 1;
                    let (count, limit) = (*count, self.vertices_max);
                    match written {
                        Ok(extra) if extra && is_vertex => {
                            self.warnings.add(self.lines.number(), "colours of vertices are not used");
                        }
                        Ok(_) => {}
                        Err((problem, remedy)) => return Err(self.lines.error(problem, remedy)),
                    }
                    if count > limit {
                        let problem = format!("more than {limit} of `{what}`");
                        return Err(self.lines.error(problem, "cut the model into several files"));
                    }
                }
                "f" => self.face()?,
                "l" | "p" => self.warnings.add(self.lines.number(), "lines and points are not drawn"),
                "o" | "g" => {
                    let name = rest.trim();
                    self.name.clear();
                    self.name.extend(name.chars().take(128));
                }
                "s" => {}
                "usemtl" => {
                    let name = without_comment(rest).trim().to_owned();
                    if name.is_empty() {
                        return Err(self
                            .lines
                            .error("`usemtl` without a name", "name a material of the `mtllib` file"));
                    }
                    if self.chosen.as_deref() != Some(&name) {
                        self.chosen = Some(name);
                        self.chosen_index = None;
                    }
                }
                "mtllib" => {
                    let names = without_comment(rest).trim().to_owned();
                    self.material_files(&names)?;
                }
                "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim" | "hole"
                | "scrv" | "sp" | "end" | "con" => {
                    self.warnings.add(self.lines.number(), "free-form curves and surfaces are not drawn");
                }
                _ => {
                    let text = format!("the statement {} is not known here and not used", quote(key));
                    self.warnings.add(self.lines.number(), &text);
                }
            }
        }
        Ok(())
    }

    /// The material of the faces that follow, as an index into `materials`.
    fn material(&mut self) -> Result<u16, ImportError> {
        if let Some(index) = self.chosen_index {
            return Ok(index);
        }
        let known = self.chosen.as_ref().and_then(|name| Some((name.clone(), self.known.get(name)?.clone())));
        if let (Some(name), None) = (&self.chosen, &known) {
            let text = format!("the material {} is not in any material file, the default is used", quote(name));
            self.warnings.add(self.lines.number(), &text);
        }
        let (name, known) = known.unwrap_or_else(|| ("default".to_owned(), Known::plain(mtl::DEFAULT)));
        let Known { material, mut maps, pictures } = known;
        for (which, picture) in pictures.iter().enumerate() {
            if let Some((texture, map)) = picture {
                let texture = self.model.add_texture(texture.clone());
                maps.maps[which] = self.model.add_use(Map { texture, ..*map });
            }
        }
        let is_same = |m: &NamedMaterial| (m.material, m.maps) == (material, maps);
        let index = match self.indices.get(&name) {
            Some(&index) if self.model.materials.get(usize::from(index)).is_some_and(is_same) => index,
            _ => {
                let next = u16::try_from(self.model.materials.len()).unwrap_or(u16::MAX);
                if next == u16::MAX {
                    return Err(self.lines.error("more than 65,535 materials", "use fewer materials"));
                }
                self.model.materials.push(NamedMaterial { name: name.clone(), material, maps });
                self.indices.insert(name, next);
                next
            }
        };
        self.chosen_index = Some(index);
        Ok(index)
    }

    fn material_files(&mut self, names: &str) -> Result<(), ImportError> {
        // Some programs name the file before each object.
        if !self.loaded.insert(names.to_owned()) {
            return Ok(());
        }
        if self.loaded.len() > LIBRARIES_MAX {
            let problem = format!("more than {LIBRARIES_MAX} material files");
            return Err(self.lines.error(problem, "gather the materials in one"));
        }
        let at = self.lines.number();
        // A blank may be part of a name or stand between two: the name that is there decides.
        let one = [names];
        let several: Vec<&str> = names.split_whitespace().collect();
        let mut missing = Vec::new();
        for attempt in [&one[..], &several[..]] {
            missing.clear();
            for name in attempt {
                match (self.library)(name) {
                    Ok((materials, notes)) => {
                        self.known.extend(materials);
                        self.notes.extend(notes);
                    }
                    Err(MaterialFile::Broken(error)) => return Err(error),
                    Err(MaterialFile::Missing) => missing.push(*name),
                }
            }
            if missing.is_empty() {
                break;
            }
        }
        // The name that was chosen may mean another material now.
        self.chosen_index = None;
        for name in missing {
            let text = format!("the material file {} is not there, its materials are the default grey", quote(name));
            self.warnings.add(at, &text);
        }
        Ok(())
    }

    fn face(&mut self) -> Result<(), ImportError> {
        // The corners leave `self` while the line, which `lines` lends, is read.
        let mut corners = std::mem::take(&mut self.corners);
        corners.clear();
        let counts = [self.vertices, self.textures, self.normals];
        let line = self.lines.current();
        let result = read_corners(without_comment(line), counts, &mut corners);
        let result = match result {
            Err((problem, remedy)) => Err(self.lines.error(problem, remedy)),
            Ok(()) if corners.len() < 3 => {
                self.warnings.add(self.lines.number(), "faces with fewer than 3 corners are not drawn");
                Ok(())
            }
            Ok(()) => self.write_face(&corners),
        };
        self.corners = corners;
        result
    }

    fn write_face(&mut self, corners: &[[i64; 3]]) -> Result<(), ImportError> {
        let with_normals = corners.iter().filter(|c| c[2] > 0).count();
        if with_normals > 0 && with_normals < corners.len() {
            let text = "faces with normals at some corners only are drawn without";
            self.warnings.add(self.lines.number(), text);
        }
        let normals = with_normals == corners.len();
        let material = self.material()?;
        // Who has no pictures needs no coordinates, and `tobj` would split vertices at their seams.
        let pictured = self.model.materials.get(usize::from(material)).is_some_and(|m| m.maps.count() > 0);
        let coordinates = pictured && corners.iter().all(|c| c[1] > 0);
        if pictured && !coordinates {
            self.warnings.add(self.lines.number(), "faces of a material with pictures have no texture coordinates");
        }
        let fits = self.pieces.last().is_some_and(|p| {
            (p.material, p.normals, p.coordinates) == (material, normals, coordinates)
                && p.faces < self.piece_faces
                && p.corners < 4 * PIECE_FACES
        });
        if !fits {
            let _ = writeln!(self.out, "g {}", self.pieces.len());
            self.pieces.push(Piece { name: self.name.clone(), material, normals, coordinates, faces: 0, corners: 0 });
        }
        if let Some(piece) = self.pieces.last_mut() {
            piece.faces += 1;
            piece.corners += corners.len() as u32;
        }
        self.faces += 1;
        self.out.push(b'f');
        for &[v, t, n] in corners {
            let _ = match (coordinates, normals) {
                (true, true) => write!(self.out, " {v}/{t}/{n}"),
                (true, false) => write!(self.out, " {v}/{t}"),
                (false, true) => write!(self.out, " {v}//{n}"),
                (false, false) => write!(self.out, " {v}"),
            };
        }
        self.out.push(b'\n');
        Ok(())
    }
}

/// What is wrong with a line, and what to do.
type Complaint = (String, &'static str);

/// Writes `v`, `vn` or `vt` for `tobj`; true if there were colours, which are left out.
fn write_numbers(out: &mut Vec<u8>, key: &str, rest: &str) -> Result<bool, Complaint> {
    let mut words = [""; 7];
    let mut count = 0;
    for word in without_comment(rest).split_whitespace() {
        if count == words.len() {
            break;
        }
        words[count] = word;
        count += 1;
    }
    let allowed = match key {
        "v" => matches!(count, 3 | 4 | 6),
        "vt" => matches!(count, 1..=3),
        _ => count == 3,
    };
    if !allowed {
        let found = if count == words.len() { "too many".to_owned() } else { count.to_string() };
        let remedy = match key {
            "v" => "give `v x y z`, `v x y z w` or `v x y z r g b`",
            "vt" => "give `vt u v`",
            _ => "give `vn x y z`",
        };
        return Err((format!("`{key}` with {found} numbers"), remedy));
    }
    let kept = match key {
        "vt" => count.min(2),
        _ if count == 4 => 4,
        _ => 3,
    };
    let mut values = [0.0f32; 4];
    for (value, word) in values.iter_mut().zip(&words[..kept]) {
        *value = match word.parse::<f32>() {
            Ok(value) if value.abs() <= COORDINATE_MAX => value,
            Ok(_) => return Err((format!("{} is too large or no number", quote(word)), "keep within 2^100")),
            Err(_) => return Err((format!("{} is not a number", quote(word)), "give a decimal number")),
        };
    }
    if kept == 4 {
        let w = values[3];
        if w == 0.0 || values[..3].iter().any(|c| !((c / w).abs() <= COORDINATE_MAX)) {
            return Err((format!("weight {} puts the vertex out of range", quote(words[3])), "give a `w` like 1"));
        }
    }
    out.extend_from_slice(key.as_bytes());
    for word in &words[..kept] {
        out.push(b' ');
        out.extend_from_slice(word.as_bytes());
    }
    if key == "vt" && kept == 1 {
        out.extend_from_slice(b" 0");
    }
    out.push(b'\n');
    Ok(count == 6)
}

/// The corners of an `f` line as indices from 1, 0 where a part is left out; all in range of what stands before.
fn read_corners(line: &str, counts: [i64; 3], corners: &mut Vec<[i64; 3]>) -> Result<(), Complaint> {
    for word in line.split_whitespace().skip(1) {
        if corners.len() == CORNERS_MAX {
            return Err((format!("a face of more than {CORNERS_MAX} corners"), "cut it up in the program it is from"));
        }
        let mut corner = [0; 3];
        for (i, part) in word.split('/').enumerate() {
            let Some(slot) = corner.get_mut(i) else {
                return Err((format!("corner {} has more than 3 parts", quote(word)), "give `v`, `v/vt` or `v/vt/vn`"));
            };
            if part.is_empty() && i > 0 {
                continue;
            }
            let Ok(index) = part.parse::<i64>() else {
                let problem = format!("corner {} is not of whole numbers", quote(word));
                return Err((problem, "give `v`, `v/vt` or `v/vt/vn`"));
            };
            let count = counts[i];
            let what = ["vertices", "texture coordinates", "normals"][i];
            *slot = match index {
                0 => return Err(("index 0".to_owned(), "count from 1, or back from -1")),
                1.. if index <= count => index,
                ..0 if index >= -count => count + 1 + index,
                _ => {
                    let problem = format!("index {index} in {}: only {count} {what} stand before it", quote(word));
                    return Err((problem, "correct the index, or move the face behind them"));
                }
            };
        }
        corners.push(corner);
    }
    Ok(())
}

impl<R: BufRead> Read for Guard<'_, R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let ready = self.fill_buf()?;
        let count = ready.len().min(into.len());
        into[..count].copy_from_slice(&ready[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Guard<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at >= self.out.len()
            && let Err(error) = self.refill()
        {
            self.error = Some(error);
            return Err(io::Error::other("refused by the guard"));
        }
        Ok(&self.out[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MTL: &str = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n";

    fn import(text: &[u8]) -> Result<Model, String> {
        let library = |name: &str| match name {
            "a.mtl" | "b c.mtl" => {
                let mut warnings = Warnings::default();
                let found = mtl::read(MTL.as_bytes(), name, &mut warnings).map_err(MaterialFile::Broken)?;
                let found = Known::all(Path::new(""), found, &mut warnings);
                Ok((found, Vec::new()))
            }
            "bad.mtl" => Err(MaterialFile::Broken(ImportError::at("bad.mtl", 7, "broken", "mend it"))),
            _ => Err(MaterialFile::Missing),
        };
        let model = read(text, "t.obj", library).map_err(|e| e.to_string())?;
        assert_eq!(super::super::validate(&model), Ok(()));
        Ok(model)
    }

    /// Corners of every triangle with its material's name, in order.
    fn soup(model: &Model) -> Vec<(String, [[f32; 3]; 3])> {
        let mut out = Vec::new();
        for mesh in &model.meshes {
            for t in &mesh.triangles {
                let name = model.materials[usize::from(mesh.material)].name.clone();
                out.push((name, t.map(|i| mesh.positions[i as usize])));
            }
        }
        out
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    const A: [f32; 3] = [0.0; 3];
    const B: [f32; 3] = [1.0, 0.0, 0.0];
    const C: [f32; 3] = [1.0, 1.0, 0.0];
    const D: [f32; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn faces_in_every_form() {
        let check = |text: &str, expected: &[[[f32; 3]; 3]]| {
            for text in [text.to_owned(), text.replace('\n', "\r\n"), text.trim_end().to_owned()] {
                let model = import(format!("{SQUARE}{text}").as_bytes()).expect(&text);
                let found: Vec<_> = soup(&model).into_iter().map(|(_, t)| t).collect();
                assert_eq!(found, expected, "{text:?}");
                assert!(model.warnings.is_empty(), "{:?}", model.warnings);
            }
        };
        check("f 1 2 3\n", &[[A, B, C]]);
        check("f -4 -3 -2\n", &[[A, B, C]]);
        check("f 1 2 3 4\n", &[[A, B, C], [A, C, D]]);
        check("  f\t1  2 3 # a triangle\n", &[[A, B, C]]);
        check("f 1 \\\n2 \\\n3\nf 2 3 4\n", &[[A, B, C], [B, C, D]]);
        check("vt 0 0\nf 1/1 2/1 3/-1\n", &[[A, B, C]]);
        check("vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/-1\n", &[[A, B, C]]);
        check("vn 0 0 1\nf 1//1 2//1 3//1\nf 2 3 4\n", &[[A, B, C], [B, C, D]]);
        check("o a\n  g b c\ns off\ng\nf 1 2 3\n", &[[A, B, C]]);
        check("v 2 2 0 2\nf 1 2 5\n", &[[A, B, C]]);
        check("v -1e0 +1. .5\nf 1 2 5\n", &[[A, B, [-1.0, 1.0, 0.5]]]);
        // A dart, of which a fan from its first corner would cover the outside.
        let model = import(b"v 0 0 0\nv 1 1 0\nv 0 4 0\nv -1 1 0\nv 0 2 0\nf 2 3 4 5\n").expect("a dart");
        assert_eq!(model.primitives(), 2);
    }

    #[test]
    fn normals_are_unit_and_go_with_their_corners() {
        let text = format!("{SQUARE}vn 0 0 5\nvn 0 3 4\nvn 0 0 0\nf 1//1 2//2 3//1\nf 1//3 3//2 4//1\n");
        let model = import(text.as_bytes()).expect("reads");
        let mesh = &model.meshes[0];
        let at = |t: usize, k: usize| mesh.normals[mesh.triangles[t][k] as usize];
        assert_eq!([at(0, 0), at(0, 1), at(0, 2)], [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]]);
        // The zero normal takes that of its own triangle.
        assert_eq!([at(1, 0), at(1, 1), at(1, 2)], [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]]);
        assert_eq!((model.meshes.len(), mesh.positions.len()), (1, 6));
    }

    #[test]
    fn faces_with_and_without_normals_are_apart() {
        let text = format!("{SQUARE}vn 0 0 1\nf 1 2 3\nf 1//1 2//1 3//1\nf 1//1 2 3\n");
        let model = import(text.as_bytes()).expect("reads");
        let found: Vec<_> = model.meshes.iter().map(|m| (m.triangles.len(), m.normals.len())).collect();
        assert_eq!(found, [(2, 0), (1, 3)]);
        assert_eq!(model.warnings, ["t.obj:8: faces with normals at some corners only are drawn without"]);
    }

    #[test]
    fn materials() {
        let check = |text: &str, names: &[&str], warnings: &[&str]| {
            let model = import(format!("{SQUARE}{text}").as_bytes()).expect(text);
            let found: Vec<String> = soup(&model).into_iter().map(|(name, _)| name).collect();
            assert_eq!(found, names, "{text}");
            assert_eq!(model.warnings, warnings, "{text}");
            for m in &model.materials {
                let expected = match m.name.as_str() {
                    "red" => [1.0, 0.0, 0.0],
                    "blue" => [0.0, 0.0, 1.0],
                    _ => [0.75; 3],
                };
                assert_eq!(m.material.diffuse, expected);
            }
        };
        check("f 1 2 3\n", &["default"], &[]);
        check("mtllib a.mtl\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 2 3\n", &["red", "blue"], &[]);
        check("mtllib b c.mtl\n\tusemtl\tred \nf 1 2 3\n", &["red"], &[]);
        check(
            "mtllib  a.mtl  b c.mtl\nusemtl red\nf 1 2 3\n",
            &["red"],
            &[
                "t.obj:5: the material file `b` is not there, its materials are the default grey",
                "t.obj:5: the material file `c.mtl` is not there, its materials are the default grey",
            ],
        );
        check(
            "mtllib no.mtl\nusemtl red\nf 1 2 3\n",
            &["default"],
            &[
                "t.obj:5: the material file `no.mtl` is not there, its materials are the default grey",
                "t.obj:7: the material `red` is not in any material file, the default is used",
            ],
        );
        // Runs of one material are joined, whatever stands between them.
        let text = format!("{SQUARE}mtllib a.mtl\n{}", "usemtl red\nf 1 2 3\nusemtl blue\nf 2 3 4\n".repeat(50));
        let model = import(text.as_bytes()).expect("reads");
        assert_eq!(model.meshes.iter().map(|m| m.triangles.len()).collect::<Vec<_>>(), [50, 50]);
        let error = import(format!("{SQUARE}mtllib bad.mtl\nf 1 2 3").as_bytes()).expect_err("refused");
        assert_eq!(error, "bad.mtl:7: broken; mend it");
    }

    #[test]
    fn what_is_not_drawn_is_warned_of() {
        let check = |text: &str, expected: &[&str]| {
            let model = import(format!("{SQUARE}f 1 2 3\n{text}").as_bytes()).expect(text);
            assert_eq!(model.primitives(), 1, "{text}");
            assert_eq!(model.warnings, expected, "{text}");
        };
        check("l 1 2\nl 1 2 3\np 1\n", &["t.obj:6: lines and points are not drawn (3 times, here first)"]);
        check("f 1 2\nf\nf 1\n", &["t.obj:6: faces with fewer than 3 corners are not drawn (3 times, here first)"]);
        check("v 0 0 0 1 1 1\n", &["t.obj:6: colours of vertices are not used"]);
        check("curv 0 1 2\n", &["t.obj:6: free-form curves and surfaces are not drawn"]);
        check("bogus 1\n", &["t.obj:6: the statement `bogus` is not known here and not used"]);
        check("f 1 1 2\nf 1 2 1 2\n", &["t.obj: 2 of 3 faces have no area and are left out"]);
        check("v 2 0 0\nf 1 2 5\n", &["t.obj: 1 of 2 faces have no area and are left out"]);
    }

    #[test]
    fn bad_lines_are_errors_that_name_them() {
        let check = |text: &str, expected: &str| {
            let error = import(format!("{SQUARE}{text}\nf 1 2 3\n").as_bytes()).expect_err(text);
            assert!(error.starts_with(&format!("t.obj:5: {expected}")), "{text}: {error}");
        };
        check("f 1 2 0", "index 0; count from 1");
        check("f 1 2 5", "index 5 in `5`: only 4 vertices stand before it");
        check("f 1 2 -5", "index -5 in `-5`: only 4 vertices");
        check("f 1/1 2 3", "index 1 in `1/1`: only 0 texture coordinates");
        check("f 1//1 2 3", "index 1 in `1//1`: only 0 normals");
        check("f 1//0 2 3", "index 0");
        check("f 1///1 2 3", "corner `1///1` has more than 3 parts");
        check("f 1 2 x", "corner `x` is not of whole numbers");
        check("f 1 2 1.5", "corner `1.5`");
        check("f 1 2 //1", "corner `//1`");
        check("f 1 2 99999999999999999999", "corner `99999999999999999999`");
        check("f 1 2 9223372036854775807", "index 9223372036854775807");
        check("f 1 2 -9223372036854775808", "index -9223372036854775808");
        check("v 1 2", "`v` with 2 numbers");
        check("v", "`v` with 0 numbers");
        check("v 1 2 3 4 5", "`v` with 5 numbers");
        check("v 1 2 3 4 5 6 7 8", "`v` with too many numbers");
        check("v 1 2 x", "`x` is not a number");
        check("v 1 2 nan", "`nan` is too large or no number");
        check("v 1 2 -inf", "`-inf` is too large or no number");
        check("v 1 2 1e39", "`1e39` is too large or no number");
        check("v 1 2 1e31", "`1e31` is too large or no number");
        check("v 1 2 3 0", "weight `0`");
        check("v 1 2 3 1e-40", "weight `1e-40`");
        check("vn 1 2", "`vn` with 2 numbers");
        check("vn 1 2 nan", "`nan`");
        check("usemtl", "`usemtl` without a name");
        check(&format!("f{}", " 1".repeat(CORNERS_MAX + 1)), "a face of more than 10000 corners");
        check(&"x".repeat(2 << 20), "a line of more than");
        let error = |bytes: &[u8]| import(bytes).expect_err("refused");
        assert!(error(b"v 0 0 0\nv \xff").starts_with("t.obj:2: not UTF-8"));
        assert!(error(b"# nothing\n\n").starts_with("t.obj: holds no faces"));
        assert!(error(b"v 1 2 3\nl 1 1 1\n").starts_with("t.obj: holds no faces"));
    }

    #[test]
    fn too_many_vertices() {
        let library = |_: &str| Err(MaterialFile::Missing);
        let mut guard = Guard::new(Lines::new(SQUARE.as_bytes(), "t.obj", true), &library);
        guard.vertices_max = 3;
        let error = guard.refill().expect_err("one too many");
        assert_eq!(error.to_string(), "t.obj:4: more than 3 of `v`; cut the model into several files");
    }

    #[test]
    fn pieces_do_not_change_the_triangles() {
        let mut text = String::new();
        for i in 0..40 {
            text += &format!("v {i} 0 0\nv {i} 1 0\n");
        }
        for i in 1..39 {
            text += &format!("f {} {} {}\n", 2 * i - 1, 2 * i + 1, 2 * i);
        }
        let library = |_: &str| Err(MaterialFile::Missing);
        let pieces = |faces| {
            let mut guard = Guard::new(Lines::new(text.as_bytes(), "t.obj", true), &library);
            guard.piece_faces = faces;
            let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
            let (found, _) =
                tobj::load_obj_buf(&mut guard, &options, |_| Err(tobj::LoadError::ReadError)).expect("reads");
            let corners: Vec<[f32; 3]> = found
                .iter()
                .flat_map(|m| m.mesh.indices.iter().map(|&i| [0, 1, 2].map(|k| m.mesh.positions[3 * i as usize + k])))
                .collect();
            (found.len(), corners)
        };
        let (one, whole) = pieces(100);
        let (many, parts) = pieces(7);
        assert_eq!((one, many), (1, 6));
        assert_eq!(whole, parts);
    }

    #[test]
    fn a_panic_in_the_parser_is_caught() {
        assert_eq!(guarded(|| tobj::load_mtl_buf(&mut &b"newmtl a\nKd 1"[..]).is_ok()), None);
        assert_eq!(guarded(|| 5), Some(5));
    }
}
