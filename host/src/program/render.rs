//! `hybray render`.

use super::args::{RenderArgs, TreeArgs, When, Where};
use super::budget::{Farm as BudgetFarm, size};
use super::keep::{Keeper, State};
use super::report::{
    Budget, Counts, Exchange, Memory, Node, PlanReport, Rays, Report, ReportFile, Seconds, peak_bytes,
};
use super::show::{Show, rays_per_second};
use super::{End, camera, load, prepare};
use crate::film::{FilmFileError, Kept, Subject, path_for};
use crate::model::Settings;
use crate::pack::is_packed;
use crate::partition::{Fit, Pilot, page_bytes_for};
use crate::picture::{Format, Output, Picture};
use crate::prepare::Prepared;
use crate::simulate::runs::name_of;
use anyhow::{Context, Result, anyhow, bail};
use hybray_native::{DispatcherAt, Farm, NODES_MAX, Traced, Worked, trace, trace_within};
use hybray_scene::PAGE_BYTES_MAX;
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{NodeReport, Outcome, Settings as NodeSettings, Sizes};
use hybray_wire::Frame;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub(super) fn run(args: &RenderArgs) -> Result<End> {
    let start = Instant::now();
    let interrupted = interrupts()?;
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get().min(1024) as u16);
    let nodes = args.nodes.unwrap_or(cores);
    check_budget(args, nodes)?;
    // What could go wrong at the end is tried at the beginning.
    let path = args.output.clone().unwrap_or_else(|| default_output(&args.scene.scene));
    let output = Output::create(&path, Format::of(&path, args.bits == "16")?)?;
    let json = args.json.as_deref().map(ReportFile::create).transpose()?;
    if path == Path::new("-") && args.json.as_deref() == Some(Path::new("-")) {
        bail!("the picture and the report cannot both go to standard output: give one of them a file");
    }

    let film = path_for(&path);
    if args.resume && film.is_none() {
        bail!("--resume goes on with what lies beside a picture's file, and this goes to no file: name one with -o");
    }

    let mut show = Show::new(args.quiet);
    let say = |warnings: &[String], primitives: u64| {
        warnings.iter().for_each(|warning| show.line(&format!("warning: {warning}")));
        show.line(&format!("{}: {primitives} primitives", args.scene.scene));
    };
    let page_bytes = args.memory.map_or(PAGE_BYTES_MAX as u32, |memory| page_bytes_for(memory, nodes));
    let packed = is_packed(&args.scene.scene);
    let (mut prepared, import_time) = if packed {
        let opened = prepare(&args.scene, &args.tree, args.size, page_bytes)?;
        say(&opened.0.warnings, opened.0.primitives.iter().sum());
        opened
    } else {
        let (model, import_time) = load(&args.scene, args.size)?;
        say(&model.warnings, model.primitives() as u64);
        camera(&model.cameras, &args.camera)?;
        if interrupted.load(Ordering::Relaxed) {
            return stopped_early(&show);
        }
        (Prepared::new(model, &args.tree.settings_with(page_bytes))?, import_time)
    };
    let camera = camera(&prepared.cameras, &args.camera)?;
    if interrupted.load(Ordering::Relaxed) {
        return stopped_early(&show);
    }
    let wanted = Settings {
        size: args.size,
        spp: args.spp,
        depth: args.depth,
        cutoff: args.cutoff,
        filter: args.filter.clone(),
        exposure: args.exposure,
        seed: args.seed,
    };
    let frame = prepared.frame(&camera, &wanted);
    check_camera(&frame)?;
    let exposure = prepared.exposure(&wanted);
    let policy = args.scheduler.unwrap_or_default();
    let settings = args.work.settings(NodeSettings { policy, ..NodeSettings::default() });
    let farm = Farm {
        nodes,
        kernels: args.kernels.kernels(),
        dispatcher: match args.dispatcher {
            Where::Host => DispatcherAt::Host,
            Where::Node => DispatcherAt::Node,
        },
        shadow_bundles: settings.shadow_bundles,
        options: args.work.options(args.spread, args.tile, &settings),
    };

    let budget = args.memory.map(|memory| BudgetFarm {
        nodes,
        memory,
        page_memory: None,
        policy,
        light_cache: args.copies.light_cache,
        pilot: None,
        first_dispatches: farm.dispatcher == DispatcherAt::Node,
        nodes_most: NODES_MAX,
        tree: &args.tree,
        packed,
    });
    if let Some(budget) = &budget {
        let again = |tree: &TreeArgs| Ok(prepare(&args.scene, tree, args.size, page_bytes)?.0);
        prepared = budget.choose_form(prepared, again)?;
    }
    let pages = prepared.packed.open()?;
    let scene = prepared.scene(&pages);
    let (mut fit, mut barred, mut grid) = (None, Vec::new(), None);
    if let Some(budget) = budget {
        let pilot = Pilot::of_policy(policy, &scene, &frame, args.copies.pilot).filter(|_| nodes > 1);
        let farm = BudgetFarm { pilot: pilot.as_ref(), ..budget };
        let fit = fit.insert(farm.fit(&prepared, &scene)?);
        barred = farm.barred(args.work.demand_driven, &prepared, fit)?;
        grid = farm.grid(args.work.ways, &scene)?;
        show.line(&budget_line(fit, nodes, budget.memory, policy));
    }
    let subject = || prepared.subject(&pages, &frame);
    let kept = kept(args, film.as_deref(), &subject, &show)?;
    let mut watch = Keeper {
        show: &mut show,
        interrupted: &interrupted,
        path: film.as_deref(),
        subject: &subject,
        every: Duration::from_secs(args.save_every.into()),
        kept,
        state: State::default(),
    };
    let traced = match args.memory.zip(fit.as_ref()) {
        None => trace(&scene, prepared.hash, &frame, &farm, &mut watch),
        Some((memory, fit)) => {
            let pages = prepared.packed.page_slices();
            let budget = hybray_native::Budget {
                memory,
                owners: &fit.owners,
                pages: &pages,
                copies: &fit.copies,
                parts: &fit.parts,
                settings: NodeSettings { grid, ..settings },
                barred: &barred,
            };
            trace_within(&scene, prepared.hash, &frame, &farm, &budget, &mut watch)?
        }
    };
    let mut traced = traced.context("the picture has no pixels, or too many: give --size, such as 640x480")?;
    let trace_time = traced.time;
    let State { there, broken, trouble, in_file, .. } = watch.state;
    if let Some(broken) = broken {
        return Err(broken.into());
    }
    let film = film.filter(|_| in_file.is_some());
    if let (Some(trouble), Some(path)) = (&trouble, path_for(&path)) {
        show.line(&format!("warning: the film could not be kept in {}: {trouble}", path.display()));
    }
    let budget = args.memory.zip(fit.as_ref()).map(|(memory, fit)| {
        let settings = fit.plan.settings(settings);
        Budget {
            memory,
            scheduler: name_of(settings.policy),
            granularity: settings.granularity,
            in_system: settings.in_system,
            pyramid: if settings.bundle_tiles == 1 { 8 } else { 16 },
            tiles: args.work.tiles.unwrap_or(When::Dynamic).name(),
            nodes_with_tiles: usize::from(nodes) - barred.iter().filter(|&&barred| barred).count(),
            subhosts: settings.subhosts.unwrap_or(nodes),
            take_over: farm.options.take_over,
            page_bytes_max: Sizes::of(&scene).page_bytes_max,
            voxels: prepared.packed.voxels(),
            plan: PlanReport::of(fit, scene.shading.lights.len()),
        }
    });
    drop(pages);

    let kept = |film: &PathBuf| format!("; what is finished is kept in {}: --resume goes on", film.display());
    let goes_on = film.as_ref().map(kept).unwrap_or_default();
    match traced.outcome {
        Outcome::Finished | Outcome::Stopped => {}
        Outcome::Unbalanced { tile } => {
            bail!("tile {tile} lost a ray twice: please report this, with the scene{goes_on}")
        }
        Outcome::Stranger { peer } => bail!("node {peer} has another scene or version{goes_on}"),
        Outcome::Missing { page } => bail!("page {page} was lost with the node that had it: render again{goes_on}"),
        Outcome::Abandoned => bail!("every node was lost before the picture was finished{goes_on}"),
    }
    let film_warnings: Vec<_> = film_warnings(&traced).collect();
    prepared.warnings.extend_from_slice(&film_warnings);
    let rays = total_rays(&traced);
    output.write(&picture(&frame, std::mem::take(&mut traced.radiance)), exposure)?;
    let seconds = [import_time, prepared.build_time, trace_time, start.elapsed()];
    if let Some(json) = json {
        let report = report(args, &prepared, &frame, &farm, (&traced, there), seconds);
        json.write(&Report { budget, nodes: nodes_of(&traced, fit.as_ref()), ..report })?;
    }
    film_warnings.iter().for_each(|warning| show.line(&format!("warning: {warning}")));
    show.line(&format!(
        "{} x {}, {} sample{}: {rays} rays in {:.2} s, {}; import {:.2} s, build {:.2} s",
        frame.width,
        frame.height,
        frame.samples,
        if frame.samples == 1 { "" } else { "s" },
        trace_time.as_secs_f64(),
        rays_per_second(rays, trace_time),
        import_time.as_secs_f64(),
        prepared.build_time.as_secs_f64(),
    ));
    if let Some((memory, fit)) = args.memory.zip(fit.as_ref()) {
        show.line(&traffic_line(&traced, fit, memory));
    }
    if traced.outcome == Outcome::Stopped {
        let done = traced.progress;
        let (finished, tiles, path) = (done.finished, done.tiles, path.display());
        show.line(&format!("interrupted: {finished} of {tiles} tiles are in {path}{goes_on}"));
        return Ok(End::Interrupted);
    }
    if let Some(film) = &film {
        remove(film)?;
    }
    show.line(&format!("{}", path.display()));
    Ok(End::Done)
}

/// What there is of the picture, if it is to go on.
fn kept(
    args: &RenderArgs,
    film: Option<&Path>,
    subject: &dyn Fn() -> Subject,
    show: &Show,
) -> Result<Option<Kept>, FilmFileError> {
    let Some(path) = film else { return Ok(None) };
    let name = path.display();
    if !args.resume {
        if path.exists() {
            show.line(&format!("{name} has tiles of a picture that ended early: --resume would go on with it"));
        }
        return Ok(None);
    }
    let kept = Kept::open(path, &subject())?;
    match &kept {
        Some(kept) => show.line(&format!("{name}: {} tiles are there", kept.tiles())),
        None => show.line(&format!("there is no {name}: the picture begins from the start")),
    }
    Ok(kept)
}

/// Removes a film whose picture is written.
fn remove(film: &Path) -> Result<()> {
    match std::fs::remove_file(film) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error)
            .with_context(|| format!("{}: the picture is done, but its film cannot be removed", film.display())),
        _ => Ok(()),
    }
}

/// What is about nodes with a budget wants one.
fn check_budget(args: &RenderArgs, nodes: u16) -> Result<()> {
    let work = &args.work;
    let given = [
        ("--scheduler", args.scheduler.is_some()),
        ("--granularity", work.granularity.is_some()),
        ("--in-system", work.in_system.is_some()),
        ("--pyramid", work.pyramid.is_some()),
        ("--light-cache", args.copies.light_cache.is_some()),
        ("--tiles", work.tiles.is_some()),
        ("--demand-driven", work.demand_driven.is_some()),
        ("--subhosts", work.subhosts.is_some()),
        ("--ways", work.ways.is_some()),
        ("--take-over", work.take_over.is_some()),
    ];
    if let Some((name, _)) = given.iter().find(|(_, given)| *given && args.memory.is_none()) {
        bail!("{name} is about nodes with a budget, and there is none: give --memory, such as --memory 32MiB");
    }
    work.check(args.dispatcher, args.memory, nodes)
}

fn budget_line(fit: &Fit, nodes: u16, memory: u64, policy: Policy) -> String {
    let has = match (fit.plan.holds_all, fit.plan.places) {
        (true, _) => "with room for the whole scene".to_owned(),
        (false, places) => format!("with its own pages and a cache of {places} more"),
    };
    let s = if nodes == 1 { "" } else { "s" };
    format!("{nodes} node{s} of {}, {}, each {has}", size(memory), name_of(policy))
}

fn traffic_line(traced: &Traced, fit: &Fit, memory: u64) -> String {
    let exchanges: Vec<_> =
        traced.worked.iter().zip(&fit.owned_bytes).map(|(node, &owned)| Exchange::of(node, &fit.plan, owned)).collect();
    let rays: u64 = exchanges.iter().map(|node| node.traffic.forwarded).sum();
    let pages: u64 = exchanges.iter().map(|node| node.traffic.fetched).sum();
    let high_water = exchanges.iter().map(|node| node.memory_high_water).max().unwrap_or(0);
    format!("{rays} rays and {pages} pages went from node to node; none used more than {high_water} bytes of {memory}")
}

fn nodes_of(traced: &Traced, fit: Option<&Fit>) -> Vec<Node> {
    let nodes = (1..).zip(traced.nodes.iter().zip(&traced.worked));
    let node = |(node, (n, worked)): (usize, (&NodeReport, &Worked))| Node {
        node,
        tiles: n.tiles,
        runs: n.runs,
        rays: n.counts.primary + n.counts.secondary + n.counts.shadow,
        busy_seconds: n.busy_nanoseconds as f64 * 1e-9,
        exchange: fit.map(|fit| Exchange::of(worked, &fit.plan, fit.owned_bytes[node - 1])),
    };
    nodes.map(node).collect()
}

/// `spd:balls:4` becomes `spd-balls-4.png`, `models/cow.obj` becomes `cow.png`, in this folder.
fn default_output(scene: &str) -> PathBuf {
    let stem = Path::new(scene).file_stem().map_or_else(|| "picture".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{}.png", stem.replace(':', "-")))
}

/// True from the first Ctrl-C on; a second one ends the program at once.
pub(super) fn interrupts() -> Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .context("this system has no way to tell of Ctrl-C")?;
    Ok(flag)
}

/// Nodes pass over a picture whose camera is none, so it is not sent to them: coordinates that are scaled with a tiny scene
/// may leave the range of `f32`.
pub(super) fn check_camera(frame: &Frame) -> Result<()> {
    hybray_scheduler::camera(frame)
        .map_err(|error| anyhow!("{error}, in the scene's own unit: bring it nearer, or make the scene larger"))?;
    Ok(())
}

fn stopped_early(show: &Show) -> Result<End> {
    show.line("interrupted: nothing was drawn yet, and nothing is written");
    Ok(End::Interrupted)
}

fn picture(frame: &Frame, radiance: Vec<[f32; 3]>) -> Picture {
    Picture { width: frame.width, height: frame.height, rgb: radiance.into_flattened() }
}

fn film_warnings(traced: &Traced) -> impl Iterator<Item = String> + use<> {
    let sum = |f: fn(&hybray_wire::Counts) -> u64| traced.nodes.iter().map(|n| f(&n.counts)).sum::<u64>();
    let (refused, clamped) = (sum(|c| c.refused), sum(|c| c.clamped));
    let frames = traced.refused_frames;
    [
        (refused > 0).then(|| format!("{refused} contributions were negative or not finite, and were left out")),
        (clamped > 0).then(|| format!("{clamped} contributions were too bright for the film, and were cut")),
        (frames > 0).then(|| format!("{frames} frames from nodes made no sense, and were left out")),
    ]
    .into_iter()
    .flatten()
}

fn total_rays(traced: &Traced) -> u64 {
    traced.nodes.iter().map(|n| n.counts.primary + n.counts.secondary + n.counts.shadow).sum()
}

fn report(
    args: &RenderArgs,
    prepared: &Prepared,
    frame: &Frame,
    farm: &Farm,
    (traced, tiles_kept): (&Traced, u32),
    [import, build, trace, total]: [Duration; 4],
) -> Report {
    let mut counts = hybray_wire::Counts::default();
    traced.nodes.iter().for_each(|node| counts += node.counts);
    let [triangles, spheres, cones] = prepared.primitives;
    let [lights, materials] = prepared.tables().map(|n| n as u64);
    let peak_bytes = peak_bytes();
    let primitives = (triangles + spheres + cones).max(1);
    Report {
        scene: args.scene.scene.clone(),
        width: frame.width,
        height: frame.height,
        samples: frame.samples,
        film: format!("{:016x}", traced.film),
        finished: traced.outcome == Outcome::Finished,
        seconds: Seconds {
            import: import.as_secs_f64(),
            build: build.as_secs_f64(),
            trace: trace.as_secs_f64(),
            total: total.as_secs_f64(),
        },
        rays: Rays { primary: counts.primary, secondary: counts.secondary, shadow: counts.shadow },
        counts: Counts {
            triangles,
            spheres,
            cones,
            lights,
            materials,
            pages: prepared.packed.pages() as u64,
            tiles: traced.progress.tiles,
            tiles_kept,
            hits: counts.hits,
            contributions: counts.contributions,
            refused: counts.refused,
            clamped: counts.clamped,
            walk_nodes: traced.walks.nodes,
            walk_blocks: traced.walks.blocks,
            walk_pages: traced.walks.pages,
        },
        memory: Memory {
            page_bytes: prepared.packed.page_bytes(),
            directory_bytes: prepared.packed.directory_bytes(),
            table_bytes: prepared.table_bytes(),
            peak_bytes,
            peak_bytes_per_primitive: peak_bytes.map(|peak| peak as f64 / primitives as f64),
        },
        budget: None,
        kernels: farm.kernels.name(),
        nodes: Vec::new(),
        warnings: prepared.warnings.clone(),
    }
}
