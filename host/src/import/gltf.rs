//! glTF 2.0 and GLB through the crate `gltf`: meshes, the node hierarchy, materials, textures, cameras and punctual lights.
//!
//! The crate reads and checks the JSON; what it takes on trust is checked here: the lengths in a GLB's header (it overflows on one
//! that is too short), that every accessor lies within its buffer, that no node is its own ancestor or has two parents, and
//! what extensions the file cannot do without. It runs under `catch_unwind` besides.
//!
//! Every use of a mesh becomes triangles of its own, moved to where the node is: [`Model::warnings`] says how many times the
//! triangles of the file that makes.

use super::error::{ImportError, Warnings, quote};
use super::obj::units;
use super::polygon::{has_area, unit};
use super::{guarded, open};
use crate::model::{CameraSpec, Mesh, Model};
use crate::picture::encode_srgb8;
use crate::texture::Image;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::camera::Projection;
use gltf::khr_lights_punctual::Kind;
use gltf::material::AlphaMode;
use gltf::mesh::Mode;
use hybray_shading::{self as shading, Light, LightKind};
use materials::Placed;

pub(super) use materials::picture_file;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

/// What a file may say that it cannot be read without.
const EXTENSIONS: [&str; 9] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_texture_transform",
];

/// Reads a `.gltf` or `.glb` file and the buffers that it names.
pub(crate) fn load(path: &Path) -> Result<Model, ImportError> {
    let file = path.display().to_string();
    let mut bytes = Vec::new();
    let mut reader = open(path).map_err(|e| e.into_error(&file))?;
    if let Err(error) = reader.read_to_end(&mut bytes) {
        return Err(ImportError::new(&file, format!("cannot be read ({error})"), "check the disk and the file"));
    }
    read(&bytes, &file, path.parent().unwrap_or(Path::new("")))
}

/// The same from bytes; `folder` is where buffers are looked for.
pub(super) fn read(bytes: &[u8], file: &str, folder: &Path) -> Result<Model, ImportError> {
    let again = "export the file again";
    let bytes = whole(bytes).map_err(|problem| ImportError::new(file, problem, "copy or export the file again"))?;
    let mut document = parse(bytes).map_err(|(problem, remedy)| ImportError::new(file, problem, remedy))?;
    let blob = document.blob.take();
    let buffers = buffers(&document, blob, file, folder)?;
    let mut reader = Reader {
        file,
        document: &document,
        buffers: &buffers,
        model: Model::default(),
        warnings: Warnings::default(),
        materials: BTreeMap::new(),
        images: BTreeMap::new(),
        folder,
        used: BTreeSet::new(),
        stored: 0,
        made: 0,
    };
    match guarded(|| reader.scene()) {
        Some(done) => done?,
        None => return Err(ImportError::new(file, "the glTF parser fails on its contents", again)),
    }
    let Reader { mut model, warnings, stored, .. } = reader;
    model.warnings.extend(warnings.lines(file));
    if model.objects.polygons > stored {
        let factor = model.objects.polygons as f64 / stored as f64;
        model.warnings.push(format!(
            "{file}: meshes that are used more than once are stored for each use: {factor:.1} times the triangles"
        ));
    }
    if model.meshes.is_empty() {
        return Err(ImportError::new(file, "its scene holds no triangles", "export meshes too"));
    }
    Ok(model)
}

/// What of a file counts: all of it, and of a GLB as much as its header says.
fn whole(bytes: &[u8]) -> Result<&[u8], String> {
    if !bytes.starts_with(b"glTF") {
        return Ok(bytes);
    }
    let header = bytes.get(8..12).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    match header {
        Some(length) if length < 20 => Err(format!("a GLB that says that it is {length} bytes long")),
        Some(length) => {
            bytes.get(..length).ok_or_else(|| format!("a GLB of {length} bytes, of which {} are there", bytes.len()))
        }
        None => Err("a GLB that ends in its header".to_owned()),
    }
}

/// The document, if it is one that can be read.
fn parse(bytes: &[u8]) -> Result<gltf::Gltf, (String, &'static str)> {
    let again = "export the file again";
    let fails = || ("the glTF parser fails on it".to_owned(), again);
    let document = match guarded(|| gltf::Gltf::from_slice_without_validation(bytes)).ok_or_else(fails)? {
        Ok(document) => document,
        Err(_) if is_first_version(bytes) => {
            return Err(("glTF 1.0, and only 2.0 can be read".to_owned(), "export it as glTF 2.0"));
        }
        Err(error) => return Err((format!("the glTF parser refuses it ({error})"), again)),
    };
    if let Some(unknown) = document.extensions_required().find(|name| !EXTENSIONS.contains(name)) {
        let problem = format!("cannot be read without the extension {}, which is not known here", quote(unknown));
        return Err((problem, "export without it"));
    }
    match guarded(|| gltf::Gltf::from_slice(bytes)).ok_or_else(fails)? {
        Ok(document) => Ok(document),
        Err(gltf::Error::Validation(faults)) => {
            // Bounds are promised, but nothing here needs them.
            let is_bound = |path: &str| path.ends_with(".min") || path.ends_with(".max");
            match faults.iter().find(|(path, _)| !is_bound(path.as_str())) {
                None => Ok(document),
                Some((path, fault)) => Err((format!("{path} is wrong ({fault})"), again)),
            }
        }
        Err(error) => Err((format!("the glTF parser refuses it ({error})"), again)),
    }
}

/// Whether a file that is no glTF 2.0 says that it is 1.0.
fn is_first_version(bytes: &[u8]) -> bool {
    if bytes.starts_with(b"glTF") {
        return bytes.get(4..8) == Some(&[1, 0, 0, 0]);
    }
    let text = serde_json::from_slice::<serde_json::Value>(bytes).ok();
    let version = text.as_ref().and_then(|text| text.get("asset")?.get("version")?.as_str());
    version.is_some_and(|version| version.starts_with('1'))
}

/// The bytes of every buffer.
fn buffers(
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
    file: &str,
    folder: &Path,
) -> Result<Vec<Vec<u8>>, ImportError> {
    document
        .buffers()
        .map(|buffer| {
            let fail = |problem: String, remedy: &str| {
                ImportError::new(file, format!("buffer {}: {problem}", buffer.index()), remedy)
            };
            let length = buffer.length();
            let data = match buffer.source() {
                gltf::buffer::Source::Bin => {
                    blob.take().ok_or_else(|| fail("it is not in the file".into(), "export as GLB again"))?
                }
                gltf::buffer::Source::Uri(uri) if uri.starts_with("data:") => {
                    let broken = |what: String| fail(format!("no data URI ({what})"), "export the file again");
                    let url = data_url::DataUrl::process(uri).map_err(|e| broken(format!("{e:?}")))?;
                    url.decode_to_vec().map_err(|e| broken(format!("{e:?}")))?.0
                }
                gltf::buffer::Source::Uri(uri) => {
                    if uri.contains("://") {
                        return Err(fail(
                            format!("{} is not on this machine", quote(uri)),
                            "fetch it, and name the file",
                        ));
                    }
                    let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
                    let path = folder.join(&*name);
                    let reader = open(&path).map_err(|e| e.into_error(&path.display().to_string()))?;
                    let mut data = Vec::new();
                    let read = reader.take(length as u64).read_to_end(&mut data);
                    read.map_err(|e| fail(format!("{} cannot be read ({e})", quote(&name)), "check the disk"))?;
                    data
                }
            };
            if data.len() < length {
                let problem = format!("it has {} of its {length} bytes", data.len());
                return Err(fail(problem, "copy or export the file again"));
            }
            Ok(data)
        })
        .collect()
}

/// `p -> linear p + shift`, in f64.
#[derive(Clone, Copy)]
struct Place {
    /// Rows.
    linear: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl Place {
    const IDENTITY: Self = Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] };

    fn of(node: &gltf::Node<'_>) -> Self {
        // Columns.
        let m = node.transform().matrix().map(|column| column.map(f64::from));
        Self { linear: [0, 1, 2].map(|row| [m[0][row], m[1][row], m[2][row]]), shift: [m[3][0], m[3][1], m[3][2]] }
    }

    fn direction(&self, v: [f64; 3]) -> [f64; 3] {
        self.linear.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let turned = self.direction(p.map(f64::from));
        [0, 1, 2].map(|i| (turned[i] + self.shift[i]) as f32)
    }

    /// First `self`, then `outer`.
    fn within(&self, outer: &Self) -> Self {
        let column = |i: usize| outer.direction([self.linear[0][i], self.linear[1][i], self.linear[2][i]]);
        let (x, y, z) = (column(0), column(1), column(2));
        let shift = outer.direction(self.shift);
        Self {
            linear: [0, 1, 2].map(|row| [x[row], y[row], z[row]]),
            shift: [0, 1, 2].map(|i| shift[i] + outer.shift[i]),
        }
    }

    /// Where normals go, up to a factor of more than 0, and whether the inside is turned out.
    fn normals(&self) -> (Self, bool) {
        let [a, b, c] = self.linear;
        let cofactors = [cross(b, c), cross(c, a), cross(a, b)];
        let mirrored = dot(a, cofactors[0]) < 0.0;
        let sign = if mirrored { -1.0 } else { 1.0 };
        (Self { linear: cofactors.map(|row| row.map(|x| x * sign)), shift: [0.0; 3] }, mirrored)
    }

    fn unit(&self, v: [f64; 3]) -> [f32; 3] {
        unit(self.direction(v)).unwrap_or(v).map(|c| c as f32)
    }
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

struct Reader<'a> {
    file: &'a str,
    document: &'a gltf::Document,
    buffers: &'a [Vec<u8>],
    model: Model,
    warnings: Warnings,
    /// Of the file's materials, by index, those that were met: where they stand in the model.
    materials: BTreeMap<(Option<usize>, bool), Placed>,
    /// Pictures that were met, and whether each is one of light; `None` if it cannot be used.
    images: BTreeMap<usize, Option<(Arc<Image>, bool)>>,
    /// Where other files are looked for.
    folder: &'a Path,
    /// Meshes that were met.
    used: BTreeSet<usize>,
    /// Triangles of those.
    stored: u64,
    /// Vertices and corners so far, each use counted.
    made: u64,
}

impl Reader<'_> {
    fn error(&self, problem: impl AsRef<str>, remedy: &str) -> ImportError {
        ImportError::new(self.file, problem, remedy)
    }

    fn warn(&mut self, text: &str) {
        self.warnings.add(0, text);
    }

    /// Everything in the scene that the file shows first, or in its only one.
    fn scene(&mut self) -> Result<(), ImportError> {
        let document = self.document;
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let mut waiting: Vec<(gltf::Node<'_>, Place)> = match scene {
            Some(scene) => scene.nodes().map(|node| (node, Place::IDENTITY)).collect(),
            None => {
                let below: BTreeSet<usize> = document.nodes().flat_map(|n| n.children().map(|c| c.index())).collect();
                let roots = document.nodes().filter(|node| !below.contains(&node.index()));
                roots.map(|node| (node, Place::IDENTITY)).collect()
            }
        };
        waiting.reverse();
        let mut met = BTreeSet::new();
        while let Some((node, outer)) = waiting.pop() {
            if !met.insert(node.index()) {
                let problem = format!("node {} has more than one parent, or is its own ancestor", node.index());
                return Err(self.error(problem, "export the file again"));
            }
            let place = Place::of(&node).within(&outer);
            if let Some(mesh) = node.mesh() {
                self.mesh(&node, &mesh, &place)?;
            }
            if let Some(camera) = node.camera() {
                self.camera(&node, &camera, &place);
            }
            if let Some(light) = node.light() {
                self.light(&light, &place);
            }
            let first = waiting.len();
            waiting.extend(node.children().map(|child| (child, place)));
            waiting[first..].reverse();
        }
        if document.animations().len() > 0 {
            self.warn("animations are not played: nodes stand where the file puts them");
        }
        Ok(())
    }

    fn mesh(&mut self, node: &gltf::Node<'_>, mesh: &gltf::Mesh<'_>, place: &Place) -> Result<(), ImportError> {
        if node.skin().is_some() {
            self.warn("skins are not used: meshes stand as they were modelled");
        }
        let is_new = self.used.insert(mesh.index());
        for primitive in mesh.primitives() {
            let name = mesh.name().unwrap_or("mesh");
            let what = format!("mesh {} ({})", mesh.index(), quote(name));
            if primitive.morph_targets().len() > 0 {
                self.warn("morph targets are not used: meshes stand as they were modelled");
            }
            if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
                self.warn("lines and points are not drawn");
                continue;
            }
            let (normals_place, mirrored) = place.normals();
            let Some((positions, normals, triangles)) = self.triangles(&primitive, &what)? else { continue };
            let colours = self.colours(&primitive, positions.len(), &what)?;
            let Some(material) = self.material(&primitive, !colours.is_empty())? else { continue };
            let coordinates = match material.set {
                Some(set) => self.coordinates(&primitive, set, positions.len(), &what)?,
                None => Vec::new(),
            };
            let placed: Vec<[f32; 3]> = positions.iter().map(|&p| place.point(p)).collect();
            let count = triangles.len() as u64;
            let triangles: Vec<[u32; 3]> = triangles
                .into_iter()
                .map(|[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] })
                .filter(|t| has_area(placed[t[0] as usize], placed[t[1] as usize], placed[t[2] as usize]))
                .collect();
            self.stored += if is_new { count } else { 0 };
            self.model.objects.polygons += count;
            if triangles.len() as u64 != count {
                self.warn("triangles without area are left out");
            }
            if triangles.is_empty() {
                continue;
            }
            let normals = normals.iter().map(|n| normals_place.unit(n.map(f64::from))).collect();
            let normals = units(normals, &placed, &triangles);
            let (name, material) = (name.to_owned(), material.index);
            let mesh = Mesh { name, positions: placed, normals, coordinates, colours, triangles, material };
            self.model.meshes.push(mesh);
        }
        Ok(())
    }
}

type Points = Vec<[f32; 3]>;
/// Positions, normals (none, or one for each position), and triangles.
type Corners = (Points, Points, Vec<[u32; 3]>);

impl Reader<'_> {
    /// What a primitive holds; `None` if nothing.
    fn triangles(&mut self, primitive: &gltf::Primitive<'_>, what: &str) -> Result<Option<Corners>, ImportError> {
        let Some(positions) = primitive.get(&gltf::Semantic::Positions) else { return Ok(None) };
        self.check(&positions, &[DataType::F32], Dimensions::Vec3, what)?;
        let count = positions.count();
        let normals = primitive.get(&gltf::Semantic::Normals);
        if let Some(normals) = &normals {
            self.check(normals, &[DataType::F32], Dimensions::Vec3, what)?;
            if normals.count() != count {
                let problem = format!("{what} has {} normals for {count} positions", normals.count());
                return Err(self.error(problem, "export the file again"));
            }
        }
        if let Some(indices) = primitive.indices() {
            self.check(&indices, &[DataType::U8, DataType::U16, DataType::U32], Dimensions::Scalar, what)?;
        }
        // A file may name the same bytes again and again.
        self.made += (count + primitive.indices().map_or(count, |indices| indices.count())) as u64;
        let bytes: usize = self.buffers.iter().map(Vec::len).sum();
        if self.made > MADE_MAX.max(2 * bytes as u64) {
            let problem =
                format!("{what} and what comes before it make more than {MADE_MAX} corners of the same bytes");
            return Err(self.error(problem, "leave some of it out"));
        }
        let reader = primitive.reader(|buffer| Some(&self.buffers[buffer.index()]));
        let unreadable = || self.error(format!("{what} cannot be read"), "export the file again");
        let positions: Points = reader.read_positions().ok_or_else(unreadable)?.collect();
        let normals: Points = match normals {
            Some(_) => reader.read_normals().ok_or_else(unreadable)?.collect(),
            None => Vec::new(),
        };
        let corners: Vec<u32> = match primitive.indices() {
            Some(_) => reader.read_indices().ok_or_else(unreadable)?.into_u32().collect(),
            None => (0..count as u32).collect(),
        };
        if let Some(corner) = corners.iter().find(|&&corner| corner as usize >= count) {
            return Err(self.error(format!("{what} names vertex {corner} of {count}"), "export the file again"));
        }
        let triangles = match primitive.mode() {
            Mode::TriangleStrip => {
                let turned = |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
                corners.windows(3).enumerate().map(turned).collect()
            }
            Mode::TriangleFan => corners.windows(2).skip(1).map(|t| [corners[0], t[0], t[1]]).collect(),
            _ => corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        };
        Ok(Some((positions, normals, triangles)))
    }

    /// Texture coordinates of each vertex, or none.
    fn coordinates(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        set: u32,
        count: usize,
        what: &str,
    ) -> Result<Vec<[f32; 2]>, ImportError> {
        let Some(accessor) = primitive.get(&gltf::Semantic::TexCoords(set)) else {
            self.warn("a mesh whose material has textures has no coordinates for them: it shows one texel");
            return Ok(Vec::new());
        };
        self.check(&accessor, &[DataType::F32, DataType::U8, DataType::U16], Dimensions::Vec2, what)?;
        let reader = primitive.reader(|buffer| Some(&self.buffers[buffer.index()]));
        let coordinates = reader.read_tex_coords(set).map(|c| c.into_f32().collect::<Vec<_>>());
        self.of_each(coordinates, count, what, "texture coordinates")
    }

    /// The colour of each vertex, or none.
    fn colours(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        count: usize,
        what: &str,
    ) -> Result<Vec<[u8; 4]>, ImportError> {
        let Some(accessor) = primitive.get(&gltf::Semantic::Colors(0)) else { return Ok(Vec::new()) };
        let types = [DataType::F32, DataType::U8, DataType::U16];
        let dimensions = if accessor.dimensions() == Dimensions::Vec3 { Dimensions::Vec3 } else { Dimensions::Vec4 };
        self.check(&accessor, &types, dimensions, what)?;
        let reader = primitive.reader(|buffer| Some(&self.buffers[buffer.index()]));
        let encoded = |[r, g, b, a]: [f32; 4]| {
            let [r, g, b] = [r, g, b].map(encode_srgb8);
            [r, g, b, (a.clamp(0.0, 1.0) * 255.0 + 0.5) as u8]
        };
        let colours = reader.read_colors(0).map(|c| c.into_rgba_f32().map(encoded).collect::<Vec<_>>());
        self.of_each(colours, count, what, "colours")
    }

    /// `values`, if there is one for each vertex.
    fn of_each<T>(&self, values: Option<Vec<T>>, count: usize, what: &str, of: &str) -> Result<Vec<T>, ImportError> {
        let values = values.ok_or_else(|| self.error(format!("{what} cannot be read"), "export the file again"))?;
        if values.len() != count {
            let problem = format!("{what} has {} {of} for {count} positions", values.len());
            return Err(self.error(problem, "export the file again"));
        }
        Ok(values)
    }

    /// That an accessor is of the kind that is wanted and lies within its buffer.
    fn check(
        &self,
        accessor: &Accessor<'_>,
        types: &[DataType],
        dimensions: Dimensions,
        what: &str,
    ) -> Result<(), ImportError> {
        let number = accessor.index();
        let fail =
            |problem: String| Err(self.error(format!("{what}, accessor {number}: {problem}"), "export the file again"));
        if !types.contains(&accessor.data_type()) || accessor.dimensions() != dimensions {
            return fail(format!(
                "{:?} of {:?} is not what glTF has here",
                accessor.dimensions(),
                accessor.data_type()
            ));
        }
        let within = |view: &gltf::buffer::View<'_>, offset: usize, count: usize, size: usize| {
            let (view_end, stride) = (view.offset().checked_add(view.length()), view.stride().unwrap_or(size));
            let end =
                count.checked_sub(1).and_then(|last| last.checked_mul(stride)?.checked_add(size)?.checked_add(offset));
            stride >= size
                && end.is_some_and(|end| end <= view.length())
                && view_end.is_some_and(|end| end <= self.buffers[view.buffer().index()].len())
        };
        let (count, size) = (accessor.count(), accessor.size());
        let is_within = match accessor.view() {
            Some(view) => within(&view, accessor.offset(), count, size),
            // All zero, but for what stands in the sparse part.
            None => accessor.sparse().is_some() && (1..=UNSTORED_MAX).contains(&count),
        };
        if !is_within {
            return fail(format!("its {count} values do not lie within their buffer"));
        }
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => 1,
                gltf::accessor::sparse::IndexType::U16 => 2,
                gltf::accessor::sparse::IndexType::U32 => 4,
            };
            let count = sparse.count();
            let are = within(&indices.view(), indices.offset(), count, index_size)
                && within(&values.view(), values.offset(), count, size);
            if !are {
                return fail(format!("its {count} sparse values do not lie within their buffer"));
            }
        }
        Ok(())
    }

    fn camera(&mut self, node: &gltf::Node<'_>, camera: &gltf::Camera<'_>, place: &Place) {
        let name = camera.name().or(node.name()).map_or_else(|| format!("camera {}", camera.index()), str::to_owned);
        let (projection, fov_y_degrees, height) = match camera.projection() {
            Projection::Perspective(camera) => (shading::Projection::Perspective, camera.yfov().to_degrees(), None),
            // Half of what it shows; the width follows from the picture's shape, as it does for a perspective one.
            Projection::Orthographic(camera) => {
                (shading::Projection::Orthographic, 45.0, Some(2.0 * camera.ymag().abs()))
            }
        };
        let eye = place.point([0.0; 3]);
        let ahead = place.unit([0.0, 0.0, -1.0]);
        // Far enough that the target differs from the eye, wherever that is.
        let far = eye.iter().fold(1.0_f32, |far, c| far.max(c.abs()));
        self.model.cameras.push(CameraSpec {
            name,
            eye,
            target: [0, 1, 2].map(|i| eye[i] + ahead[i] * far),
            up: place.unit([0.0, 1.0, 0.0]),
            fov_y_degrees,
            hither: 0.0,
            size: None,
            projection,
            height,
            ..CameraSpec::default()
        });
    }

    /// Candela and lux become what a white, matt surface shows: over pi.
    fn light(&mut self, from: &gltf::khr_lights_punctual::Light<'_>, place: &Place) {
        let colour = from.color().map(|c| c * from.intensity() / std::f32::consts::PI);
        let mut light = Light { position: place.point([0.0; 3]), colour, ..Light::default() };
        let axis = place.unit([0.0, 0.0, -1.0]);
        match from.kind() {
            Kind::Directional => (light.kind, light.axis) = (LightKind::Directional as u32, axis),
            Kind::Point => (light.kind, light.flags) = (LightKind::Point as u32, Light::FALLOFF),
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                (light.kind, light.axis, light.flags) = (LightKind::Spot as u32, axis, Light::FALLOFF);
                light.cos_outer = libm::cosf(outer_cone_angle);
                light.cos_inner = libm::cosf(inner_cone_angle).max(light.cos_outer);
            }
        }
        if !matches!(from.kind(), Kind::Directional) && from.intensity() > 1000.0 {
            self.warn(
                "lights of thousands of candela: if all is white, give --exposure 0.0015 (one watt for 683 lumens)",
            );
        }
        if from.range().is_some() {
            self.warn("lights shine beyond their range, as light does");
        }
        self.model.lights.push(light);
    }
}

/// Vertices and corners that a scene may have, if its buffers have not more bytes than that: a GB or two.
const MADE_MAX: u64 = 1 << 26;

/// Values of an accessor that has no bytes but for its sparse part.
const UNSTORED_MAX: usize = 1 << 20;

mod materials;
#[cfg(test)]
mod tests;
