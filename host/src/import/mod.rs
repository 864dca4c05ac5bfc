//! Import of scenes: OBJ with MTL, glTF, PLY, NFF, and Hybray's own scene files, which bring those together.
//!
//! An importer reads one file into a [`Model`] and is done: no tree, no page, nothing of the renderer. It holds the
//! file's triangles once (measured: see `tests::ten_million_triangles`), refuses what it cannot read with one line
//! that names the place, and lists what it cannot honour in [`Model::warnings`].

mod environment;
mod error;
mod gltf;
mod lines;
mod meshes;
mod mtl;
mod mtl_maps;
mod nff;
mod obj;
mod physical;
mod ply;
mod polygon;
mod scene_toml;
mod toml_values;
mod transform;
mod validate;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use environment::{SAMPLES as ENVIRONMENT_SAMPLES, Surroundings};
pub use error::ImportError;
pub use validate::{PRIMITIVES_MAX, SIZE_MAX, validate};

pub(crate) use polygon::unit;
pub(crate) use scene_toml::load_cameras;
pub(crate) use validate::{camera as validate_camera, cone_bounds};

use crate::builtin;
use crate::model::Model;
use error::{did_you_mean, near, quote};
use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Once;

/// Magnitude that no coordinate may exceed: see [`validate()`].
pub const COORDINATE_MAX: f32 = (1u128 << 100) as f32;

/// Entries of a folder that are looked at for a name like the one that is not there.
const ENTRIES_MAX: usize = 10_000;

/// Reads a scene: a built-in one by its name, else a file by its extension (`.obj`, `.gltf`, `.glb`, `.ply`, `.nff`, `.toml`).
///
/// The model that it returns passes [`validate()`] and has at least one primitive. It may have no camera and no light:
/// [`crate::framing::complete`] gives it some.
///
/// # Errors
/// One line that says what is wrong, in which file and line, and what to do.
pub fn load(source: &str) -> Result<Model, ImportError> {
    let model = match builtin_model(source)? {
        Some(model) => model,
        None => {
            let path = Path::new(source);
            match Format::of(path) {
                Some(Format::Toml) => scene_toml::load(path)?,
                Some(Format::Model(read)) => read(path)?,
                None => return Err(unknown_format(path)),
            }
        }
    };
    if model.primitives() == 0 {
        return Err(ImportError::new(source, "the scene holds no primitives", "give it something to draw"));
    }
    validate(&model)?;
    Ok(model)
}

/// The axis that is up in a source of this name where it has no camera of its own: +Z in NFF, as its examples have
/// it, and +Y in everything else.
#[must_use]
pub fn up_axis(source: &str) -> [f32; 3] {
    let is_nff = Path::new(source).extension().is_some_and(|e| e.eq_ignore_ascii_case("nff"));
    if is_nff { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] }
}

/// The scene that is built in under this name, if there is one.
fn builtin_model(name: &str) -> Result<Option<Model>, ImportError> {
    match builtin::builtin(name) {
        None => Ok(None),
        Some(Ok(model)) => Ok(Some(model)),
        Some(Err(error)) => Err(ImportError::new(name, error.to_string(), "name one of the built-in scenes")),
    }
}

/// How a file is read.
#[derive(Clone, Copy)]
enum Format {
    Model(fn(&Path) -> Result<Model, ImportError>),
    /// Which brings files together.
    Toml,
}

/// The extensions of [`Format::Model`], for messages.
const MODELS: &str = ".obj, .gltf, .glb, .ply or .nff";

impl Format {
    fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Model(obj::load)),
            "gltf" | "glb" => Some(Self::Model(gltf::load)),
            "ply" => Some(Self::Model(ply::load)),
            "nff" => Some(Self::Model(nff::load)),
            "toml" => Some(Self::Toml),
            _ => None,
        }
    }
}

/// Why a file cannot be opened for reading.
#[derive(Debug)]
enum Opened {
    /// It is not there; what its name may be a slip of.
    Missing(String),
    /// It is of zero bytes.
    Empty,
    /// What it is instead, and what to do.
    Other(String, &'static str),
}

impl Opened {
    fn into_error(self, file: &str) -> ImportError {
        let (problem, remedy) = self.complaint();
        ImportError::new(file, problem, remedy)
    }

    /// What is wrong, and what to do.
    fn complaint(self) -> (String, String) {
        match self {
            Self::Missing(remedy) => ("there is no such file".to_owned(), remedy),
            Self::Empty => ("the file is empty".to_owned(), "export or copy it again".to_owned()),
            Self::Other(problem, remedy) => (problem, remedy.to_owned()),
        }
    }
}

/// Opens a regular file that is not empty. Pipes and devices are refused: opening one may wait for ever.
fn open(path: &Path) -> Result<BufReader<File>, Opened> {
    let about = match std::fs::metadata(path) {
        Ok(about) => about,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(Opened::Missing(like(path))),
        Err(error) => return Err(Opened::Other(format!("cannot be looked up ({error})"), "check the path")),
    };
    if about.is_dir() {
        return Err(Opened::Other("a folder, not a file".to_owned(), "name a file in it"));
    }
    if !about.is_file() {
        return Err(Opened::Other("not a regular file".to_owned(), "copy what it gives into a file"));
    }
    if about.len() == 0 {
        return Err(Opened::Empty);
    }
    match File::open(path) {
        Ok(file) => Ok(BufReader::with_capacity(1 << 16, file)),
        Err(error) => Err(Opened::Other(format!("cannot be opened ({error})"), "check its permissions")),
    }
}

/// A question that offers the names nearest to that of a file that is not there.
fn like(path: &Path) -> String {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let Ok(entries) = std::fs::read_dir(folder) else {
        return format!("there is no folder {} either: check the path", quote(&folder.display().to_string()));
    };
    let mut names: Vec<String> = entries
        .take(ENTRIES_MAX)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| Format::of(Path::new(name)).is_some())
        .collect();
    let is_bare = path.parent().is_some_and(|p| p.as_os_str().is_empty());
    if is_bare {
        names.extend(builtin::names().iter().map(|scene| scene.name.to_owned()));
    }
    let wanted = path.file_name().unwrap_or_default().to_string_lossy();
    // `spd:bals:4` is a slip of `spd:balls`.
    let sized = wanted.rsplit_once(':').filter(|(_, size)| size.bytes().all(|b| b.is_ascii_digit()));
    let found = near(sized.map_or(&*wanted, |(name, _)| name), names.iter().map(String::as_str));
    did_you_mean(&found, "check the path")
}

fn unknown_format(path: &Path) -> ImportError {
    let file = path.display().to_string();
    let known = "use .obj, .gltf, .glb, .ply, .nff or .toml";
    let Err(error) = std::fs::metadata(path) else {
        let (problem, remedy) = match open(path) {
            Err(other) => other.complaint(),
            Ok(_) => match path.extension() {
                Some(e) => {
                    (format!("{} is no format that can be read", quote(&format!(".{}", e.display()))), known.into())
                }
                None => ("the file has no extension to tell its format by".to_owned(), known.into()),
            },
        };
        return ImportError::new(&file, problem, remedy);
    };
    if error.kind() != io::ErrorKind::NotFound {
        return ImportError::new(&file, format!("cannot be looked up ({error})"), "check the path");
    }
    let otherwise = format!("name a built-in scene or a file: {known}");
    let near_by = like(path);
    let remedy = if near_by.starts_with("did") { near_by } else { otherwise };
    ImportError::new(&file, "neither a file nor a built-in scene", remedy)
}

thread_local! {
    /// Whether a panic on this thread is expected, and caught, and nobody needs to read of it.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs another's code that may panic on strange input; `None` if it did. Nothing is printed.
fn guarded<T>(run: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    // The hook is the process's: it stands before whatever hook there is and silences this thread only.
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                before(info);
            }
        }));
    });
    QUIET.set(true);
    // What `run` leaves half done is dropped by the callers: they return an error.
    let result = catch_unwind(AssertUnwindSafe(run));
    QUIET.set(false);
    result.ok()
}
