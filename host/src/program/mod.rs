//! The `hybray` program: arguments, then one match.
//!
//! Results go to standard output, talk to standard error. Exit codes: 0 done, 1 an error (one line says what to do), 2 wrong
//! arguments, 130 interrupted.

mod args;
mod budget;
mod compare;
mod convert;
mod info;
mod keep;
mod layers;
mod pack;
mod plan;
mod render;
mod report;
mod show;
mod simulate;
mod trace;
mod views;

use anyhow::{Context, Result, anyhow, bail};
use args::{CameraArgs, Cli, SceneArgs, TreeArgs, Verb};
use clap::{CommandFactory, Parser};
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use crate::import::Surroundings;
use crate::model::{CameraSpec, Model};
use crate::pack::is_packed;
use crate::prepare::Prepared;
use crate::{build, framing, import};
use hybray_shading::Projection;

/// How a command ended well.
enum End {
    Done,
    Interrupted,
}

/// Runs the program with this process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let end = match cli.verb {
        Verb::Render(args) => render::run(&args),
        Verb::Plan(args) => plan::run(&args),
        Verb::Simulate(args) => simulate::run(&args),
        Verb::Info(args) => info::run(&args),
        Verb::Pack(args) => pack::run(&args),
        Verb::Trace(args) => trace::run(&args),
        Verb::Convert(args) => convert::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::Scenes => info::list_builtin(),
        Verb::Completions { shell } => completions(shell),
        Verb::Man => man(),
    };
    match end {
        Ok(End::Done) => ExitCode::SUCCESS,
        Ok(End::Interrupted) => ExitCode::from(130),
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hybray: {}", one_line(&error));
            ExitCode::FAILURE
        }
    }
}

/// An error and its causes, each said once, whatever errors from below think; and what to do about those of the system.
fn one_line(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let cause = cause.to_string();
        if !text.ends_with(&cause) {
            let colon = if text.is_empty() { "" } else { ": " };
            text = text + colon + &cause;
        }
    }
    let remedy = match error.chain().find_map(|cause| cause.downcast_ref::<std::io::Error>()).map(std::io::Error::kind)
    {
        Some(ErrorKind::NotFound) => "; make the folder, or name another",
        Some(ErrorKind::IsADirectory) => "; name a file in it",
        Some(ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem) => "; name a place that you may write to",
        Some(ErrorKind::StorageFull) => "; make room, or name another place",
        _ => "",
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ") + remedy
}

/// `hybray ... | head` is no error.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| cause.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe))
}

/// In memory first: the generator panics where it cannot write.
fn completions(shell: clap_complete::Shell) -> Result<End> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "hybray", &mut script);
    std::io::stdout().write_all(&script)?;
    Ok(End::Done)
}

/// The program's page, and after it one for each verb, as `man` shows them one below the other.
fn man() -> Result<End> {
    let mut command = Cli::command();
    command.build();
    let out = &mut std::io::stdout().lock();
    clap_mangen::Man::new(command.clone()).render(out)?;
    for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
        clap_mangen::Man::new(verb.clone()).render(out)?;
    }
    Ok(End::Done)
}

/// Reads a scene, and gives it a camera and lights if it has none.
fn load(args: &SceneArgs, size: Option<[u32; 2]>) -> Result<(Model, Duration)> {
    let start = Instant::now();
    if is_packed(&args.scene) {
        bail!("{}: a packed scene keeps pages, not objects; name the scene that it was packed from", args.scene);
    }
    let mut model = import::load(&args.scene)?;
    surround(&mut model, args)?;
    if size.is_some() {
        model.settings.size = size;
    }
    framing::complete_with_up(&mut model, import::up_axis(&args.scene));
    Ok((model, start.elapsed()))
}

/// Gives a model what the arguments want to be all around it.
fn surround(model: &mut Model, args: &SceneArgs) -> Result<()> {
    let Some(path) = &args.environment else { return Ok(()) };
    if !args.environment_rotation.is_finite() {
        bail!("--environment-rotation {}: give degrees", args.environment_rotation);
    }
    let surroundings = Surroundings {
        colour: [args.environment_strength; 3],
        rotation_degrees: args.environment_rotation,
        up: import::up_axis(&args.scene).map(f64::from),
        samples: args.environment_samples,
        ..Surroundings::default()
    };
    Ok(surroundings.give(model, path)?)
}

/// Reads a scene and builds it, or opens it if it is packed; and how long the reading took. `size` is that of the picture,
/// if it is known; pages have `page_bytes` at most unless the arguments say otherwise.
fn prepare(args: &SceneArgs, tree: &TreeArgs, size: Option<[u32; 2]>, page_bytes: u32) -> Result<(Prepared, Duration)> {
    if !is_packed(&args.scene) {
        let (model, import_time) = load(args, size)?;
        return Ok((Prepared::new(model, &tree.settings_with(page_bytes))?, import_time));
    }
    let start = Instant::now();
    if args.environment.is_some() {
        bail!("{}: a packed scene keeps what is around it; pack it with --environment", args.scene);
    }
    let mut prepared = Prepared::open(Path::new(&args.scene))?;
    if tree.settings() != build::Settings::default() {
        prepared.warnings.push(format!("{} is packed already: settings of the tree are not used", args.scene));
    }
    Ok((prepared, start.elapsed()))
}

/// The camera that was asked for by name, or the first, with what else was asked of it.
fn camera(cameras: &[CameraSpec], args: &CameraArgs) -> Result<CameraSpec> {
    let mut camera = match &args.camera {
        None => cameras.first().context("the scene has nothing that a camera could look at")?,
        Some(name) => cameras.iter().find(|camera| camera.name == *name).ok_or_else(|| {
            let names: Vec<_> = cameras.iter().map(|camera| format!("`{}`", camera.name)).collect();
            anyhow!("the scene has no camera `{name}`; it has {}", names.join(", "))
        })?,
    }
    .clone();
    if let Some(projection) = args.projection.as_deref().and_then(Projection::parse)
        && projection != camera.projection
    {
        // A lens and a picture's shape belong to the projection that they were given for.
        camera = CameraSpec { projection, aperture: 0.0, size: None, ..camera };
    }
    camera.height = args.height.or(camera.height);
    camera.aperture = args.aperture.unwrap_or(camera.aperture);
    camera.focus = args.focus.or(camera.focus);
    camera.blades = args.blades.unwrap_or(camera.blades);
    let means_nothing = |option: &str, only: Projection| {
        anyhow!(
            "{option} means nothing for a camera that is {}: give --projection {}",
            camera.projection.name(),
            only.name()
        )
    };
    let (flat, perspective) = (Projection::Orthographic, Projection::Perspective);
    if args.height.is_some() && camera.projection != flat {
        return Err(means_nothing("--height", flat));
    }
    for (option, is_given) in [
        ("--aperture", args.aperture.is_some()),
        ("--focus", args.focus.is_some()),
        ("--blades", args.blades.is_some()),
    ] {
        if is_given && camera.projection != perspective {
            return Err(means_nothing(option, perspective));
        }
    }
    if camera.aperture == 0.0 && (args.focus.is_some() || args.blades.is_some()) {
        bail!("--focus and --blades mean nothing without a lens: give --aperture, such as --aperture {}", {
            camera.focus_distance() / 64.0
        });
    }
    import::validate_camera(&camera).map_err(|(problem, remedy)| anyhow!("{problem}: {remedy}"))?;
    Ok(camera)
}
