//! Scenes as files of other programs: NFF, OBJ with MTL, and POV-Ray.
//!
//! Every coordinate is written in the shortest decimal form that reads back as the same `f32`, without exponent, so
//! that no reader has to know one. A file appears whole or not at all. What a format cannot say is told in warnings.

mod facets;
mod nff;
mod obj;
mod pov;

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::model::{CameraSpec, Mesh, Model};
use crate::picture::pending::Pending;
use hybray_shading::Sky;

/// Ray depth that is written where the model's settings give none.
pub const DEFAULT_DEPTH: u32 = 5;

/// Writes `model`, seen by `camera`, in the format of the extension of `path`: `.nff`, `.obj` (its materials go to the
/// same name with `.mtl`) or `.pov`. Returns what the format could not say, each one line for a person.
///
/// # Errors
/// [`ExportError`]; nothing is left at `path` then, and a file that was there stays.
pub fn export(model: &Model, camera: &CameraSpec, path: &Path) -> Result<Vec<String>, ExportError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let mut notes = Notes::default();
    left_out(model, &mut notes);
    match extension.to_ascii_lowercase().as_str() {
        "nff" => {
            check(model, camera)?;
            to_file(path, |to| nff::write(model, camera, to, &mut notes))?;
        }
        "obj" => {
            check(model, camera)?;
            let library = path.with_extension("mtl");
            let names = obj::material_names(model);
            to_file(&library, |to| obj::write_materials(model, &names, to, &mut notes))?;
            let library = library.file_name().unwrap_or_default().to_string_lossy();
            to_file(path, |to| obj::write(model, &names, &library, to, &mut notes))?;
        }
        "pov" => {
            check(model, camera)?;
            to_file(path, |to| pov::write(model, camera, to, &mut notes))?;
        }
        _ => {
            return Err(ExportError::Extension { path: path.to_owned() });
        }
    }
    Ok(notes.lines())
}

/// Why a scene cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file name does not say which format is wanted.
    #[error("cannot tell the format of `{}` by its name: .nff, .obj and .pov work", path.display())]
    Extension {
        /// The path given.
        path: PathBuf,
    },
    /// The model breaks its own rules: a number that is not finite, an index beyond its table.
    #[error("the scene cannot be exported: {0}")]
    Model(String),
    /// The file cannot be written.
    #[error("cannot write `{}`: {source}", path.display())]
    Write {
        /// The path of the file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Runs a writer on a file that takes its place when the writer is done.
fn to_file(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), ExportError> {
    let run = || {
        let mut pending = Pending::create(path)?;
        let mut writer = BufWriter::with_capacity(1 << 16, pending.file()?);
        write(&mut writer)?;
        writer.flush()?;
        drop(writer);
        pending.commit()
    };
    run().map_err(|source| ExportError::Write { path: path.to_owned(), source })
}

/// What of a model none of the formats has.
fn left_out(model: &Model, notes: &mut Notes) {
    if model.sky != Sky::EMPTY {
        notes.add("what is all around is not written", "the scene");
    }
    if model.materials.iter().any(|named| named.maps.count() > 0) {
        notes.add("textures are not written", "the scene");
    }
}

/// That everything is finite and every index is in its table, so that writers need not look again.
fn check(model: &Model, camera: &CameraSpec) -> Result<(), ExportError> {
    let fail = |what: String| Err(ExportError::Model(what));
    let finite = |values: &[&[f32]]| values.iter().all(|v| v.iter().all(|c| c.is_finite()));
    for (i, mesh) in model.meshes.iter().enumerate() {
        let Mesh { positions, normals, triangles, .. } = mesh;
        if !finite(&[positions.as_flattened(), normals.as_flattened()]) {
            return fail(format!("mesh {i} `{}` has a number that is not finite", mesh.name));
        }
        if !normals.is_empty() && normals.len() != positions.len() {
            return fail(format!(
                "mesh {i} `{}` has {} normals for {} vertices",
                mesh.name,
                normals.len(),
                positions.len()
            ));
        }
        if triangles.as_flattened().iter().any(|&v| v as usize >= positions.len()) {
            return fail(format!("mesh {i} `{}` has a triangle of a vertex that is not there", mesh.name));
        }
    }
    let sphere = |s: &crate::model::Sphere| finite(&[&s.centre, &[s.radius]]);
    if let Some(i) = model.spheres.iter().position(|s| !sphere(s)) {
        return fail(format!("sphere {i} has a number that is not finite"));
    }
    let cone = |c: &crate::model::Cone| finite(&[&c.base, &c.apex, &[c.base_radius, c.apex_radius]]);
    if let Some(i) = model.cones.iter().position(|c| !cone(c)) {
        return fail(format!("cone {i} has a number that is not finite"));
    }
    for (i, named) in model.materials.iter().enumerate() {
        let m = &named.material;
        if !finite(&[
            &m.diffuse,
            &m.ambient,
            &m.emission,
            &m.specular,
            &m.mirror,
            &m.transmission,
            &[m.exponent, m.ior],
        ]) {
            return fail(format!("material {i} `{}` has a number that is not finite", named.name));
        }
    }
    for (i, l) in model.lights.iter().enumerate() {
        if !finite(&[&l.position, &l.axis, &l.u, &l.v, &l.colour, &[l.radius, l.cos_inner, l.cos_outer]]) {
            return fail(format!("light {i} has a number that is not finite"));
        }
    }
    if !finite(&[
        &camera.eye,
        &camera.target,
        &camera.up,
        &[camera.fov_y_degrees, camera.hither, camera.picture_height()],
        &[camera.aperture, camera.focus_distance()],
        &model.background,
        &model.ambient,
    ]) {
        return fail("the camera, background or ambient light is not finite".to_owned());
    }
    let used = model.meshes.iter().map(|m| m.material);
    let used = used.chain(model.spheres.iter().map(|s| s.material));
    let used = used.chain(model.cones.iter().map(|c| c.material));
    if used.max().is_some_and(|m| usize::from(m) >= model.materials.len()) {
        return fail("an object has a material that is not there".to_owned());
    }
    Ok(())
}

/// What could not be said: for each kind of thing the first that it happened to, and how many.
#[derive(Default)]
struct Notes(BTreeMap<&'static str, (String, usize)>);

impl Notes {
    /// Notes `what` (a clause) about `whom`.
    fn add(&mut self, what: &'static str, whom: impl fmt::Display) {
        match self.0.get_mut(what) {
            Some((_, count)) => *count += 1,
            None => {
                self.0.insert(what, (whom.to_string(), 1));
            }
        }
    }

    fn lines(&self) -> Vec<String> {
        let line = |(what, (first, count)): (&&str, &(String, usize))| match count {
            1 => format!("{first}: {what}"),
            2 => format!("{first} and 1 other: {what}"),
            _ => format!("{first} and {} others: {what}", count - 1),
        };
        self.0.iter().map(line).collect()
    }
}

/// What a message calls a material.
fn material_label(model: &Model, index: usize) -> String {
    match model.materials.get(index) {
        Some(named) if !named.name.is_empty() => format!("material `{}`", named.name.escape_debug()),
        _ => format!("material {index}"),
    }
}

/// Three numbers with blanks between.
struct Spaced<T>([T; 3]);

impl<T: fmt::Display> fmt::Display for Spaced<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.0;
        write!(f, "{x} {y} {z}")
    }
}

/// The box around everything: least and greatest corner; both the origin if there is nothing.
fn bounds(model: &Model) -> ([f64; 3], [f64; 3]) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    let mut add = |centre: [f32; 3], radius: f32| {
        for axis in 0..3 {
            let (c, r) = (f64::from(centre[axis]), f64::from(radius));
            low[axis] = low[axis].min(c - r);
            high[axis] = high[axis].max(c + r);
        }
    };
    model.meshes.iter().flat_map(|m| &m.positions).for_each(|&p| add(p, 0.0));
    model.spheres.iter().for_each(|s| add(s.centre, s.radius));
    for c in &model.cones {
        add(c.base, c.base_radius);
        add(c.apex, c.apex_radius);
    }
    if low[0] > high[0] { ([0.0; 3], [0.0; 3]) } else { (low, high) }
}

/// Centre and diagonal of the scene's box; the diagonal is 1 if there is no extent.
fn extent(model: &Model) -> ([f64; 3], f64) {
    let (low, high) = bounds(model);
    let centre = std::array::from_fn(|i| 0.5 * (low[i] + high[i]));
    let square: f64 = (0..3).map(|i| (high[i] - low[i]) * (high[i] - low[i])).sum();
    (centre, if square > 0.0 { square.sqrt() } else { 1.0 })
}

/// Whether the three channels are the same.
fn grey(colour: [f32; 3]) -> bool {
    colour[0] == colour[1] && colour[1] == colour[2]
}

/// The mean of the three channels; exactly the channel where they are the same.
fn mean(colour: [f32; 3]) -> f32 {
    if grey(colour) { colour[0] } else { (colour[0] + colour[1] + colour[2]) / 3.0 }
}

#[cfg(test)]
pub(crate) mod tests;
