//! `hybray render`.

use super::args::{RenderArgs, TreeArgs, When, Where};
use super::budget::{Farm as BudgetFarm, size};
use super::keep::State;
use super::layers::{Drawing, Part};
use super::report::{
    Budget, Counts, Exchange, LayerReport, Memory, Node, PlanReport, Rays, Report, ReportFile, Seconds, peak_bytes,
};
use super::show::{Show, rays_per_second};
use super::views::{Ended, Job, View, Views};
use super::{End, camera, load, prepare};
use crate::film::path_for;
use crate::import::load_cameras;
use crate::model::{CameraSpec, Settings};
use crate::pack::is_packed;
use crate::partition::{Fit, Pilot, page_bytes_for};
use crate::picture::{Format, Output};
use crate::prepare::Prepared;
use crate::simulate::runs::name_of;
use anyhow::{Context, Result, anyhow, bail};
use hybray_native::{DispatcherAt, Farm, NODES_MAX, PICTURES_MAX, Traced, Worked, trace_all, trace_all_within};
use hybray_scene::PAGE_BYTES_MAX;
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{NodeReport, Outcome, Settings as NodeSettings, Sizes};
use hybray_wire::Frame;
use std::cell::OnceCell;
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
    let path = args.output.clone().unwrap_or_else(|| default_output(&args.scene.scene, !args.layers.is_empty()));
    let format = Format::of(&path, args.bits == "16")?;
    check_layers(args, &path, format)?;
    let cameras = args.cameras.as_deref().map(load_cameras).transpose()?;
    if cameras.is_some() && path == Path::new("-") {
        bail!("pictures of several cameras cannot all go to standard output: name a file with -o, such as -o out.png");
    }
    let named = |camera: &CameraSpec| View::named(&path, format, camera.clone());
    let views: Option<Vec<View>> = cameras.map(|cameras| cameras.iter().map(named).collect());
    // What could go wrong at the end is tried at the beginning.
    let output = match &views {
        Some(views) => {
            views.iter().try_for_each(|view| Output::create(&view.path, format).map(drop))?;
            None
        }
        None => Some(Output::create(&path, format)?),
    };
    let json = args.json.as_deref().map(ReportFile::create).transpose()?;
    if path == Path::new("-") && args.json.as_deref() == Some(Path::new("-")) {
        bail!("the picture and the report cannot both go to standard output: give one of them a file");
    }

    if args.resume && path_for(&path).is_none() {
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
        if views.is_none() {
            camera(&model.cameras, &args.camera)?;
        }
        if interrupted.load(Ordering::Relaxed) {
            return stopped_early(&show);
        }
        (Prepared::new(model, &args.tree.settings_with(page_bytes))?, import_time)
    };
    let views = match views {
        Some(views) => views,
        None => vec![View::one(&path, format, &camera(&prepared.cameras, &args.camera)?)],
    };
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
    let parts = Part::of(&args.layers);
    let mut jobs = Vec::with_capacity(views.len() * parts.len());
    for (number, view) in views.iter().enumerate() {
        let frame = prepared.frame(&view.camera, &wanted);
        check_camera(&frame)
            .with_context(|| view.name.as_ref().map_or(String::new(), |name| format!("camera `{name}`")))?;
        check_samples(args, &frame)?;
        jobs.extend(Job::of(number, view, frame, &parts));
    }
    if jobs.len() > PICTURES_MAX {
        bail!("{} pictures are more than the {PICTURES_MAX} of one run: give fewer cameras or layers", jobs.len());
    }
    let frames: Vec<Frame> = jobs.iter().map(|job| job.frame).collect();
    let frame = frames[0];
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
    let hash = OnceCell::new();
    let scene_hash = || *hash.get_or_init(|| prepared.subject(&pages, &frame).scene);
    let mut watch = Views {
        show: &mut show,
        interrupted: &interrupted,
        views: &views,
        output,
        jobs: &jobs,
        scene: &scene_hash,
        every: Duration::from_secs(args.save_every.into()),
        resume: args.resume,
        exposure,
        at: 0,
        state: State::default(),
        kept: None,
        drawing: Drawing::of(&args.layers, prepared.unit()),
        ended: Vec::with_capacity(jobs.len()),
        unwritten: None,
    };
    watch.kept = watch.open(&jobs[0])?;
    if args.resume {
        // What is wrong with any of them is told before anything is drawn.
        jobs[1..].iter().try_for_each(|job| watch.open(job).map(drop))?;
    }
    let traced = match args.memory.zip(fit.as_ref()) {
        None => trace_all(&scene, prepared.hash, &frames, &farm, &mut watch),
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
            trace_all_within(&scene, prepared.hash, &frames, &farm, &budget, &mut watch)?
        }
    };
    let traced = traced.context("the picture has no pixels, or too many: give --size, such as 640x480")?;
    let films: Vec<PathBuf> = watch.films().map(Path::to_owned).collect();
    let Views { mut ended, unwritten, .. } = watch;
    if let Some(broken) = ended.iter_mut().find_map(|ended| ended.broken.take()) {
        return Err(broken.into());
    }
    if let Some(unwritten) = unwritten {
        return Err(unwritten.into());
    }
    for (job, ended) in jobs.iter().zip(&ended) {
        if let (Some(trouble), Some(path)) = (&ended.trouble, &job.film) {
            show.line(&format!("warning: the film could not be kept in {}: {trouble}", path.display()));
        }
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

    let goes_on = match &films[..] {
        [] => String::new(),
        [film] => format!("; what is finished is kept in {}: --resume goes on", film.display()),
        [.., film] => format!("; what is finished is kept in {} and others: --resume goes on", film.display()),
    };
    let outcome = traced.last().map_or(Outcome::Stopped, |last| last.outcome);
    match outcome {
        Outcome::Finished | Outcome::Stopped => {}
        Outcome::Unbalanced { tile } => {
            bail!("tile {tile} lost a ray twice: please report this, with the scene{goes_on}")
        }
        Outcome::Stranger { peer } => bail!("node {peer} has another scene or version{goes_on}"),
        Outcome::Missing { page } => bail!("page {page} was lost with the node that had it: render again{goes_on}"),
        Outcome::Abandoned => bail!("every node was lost before the picture was finished{goes_on}"),
    }
    let drawn = Drawn::of(&jobs, &traced, &ended);
    let trace_time: Duration = traced.iter().map(|one| one.time).sum();
    let seconds = [import_time, prepared.build_time, trace_time, start.elapsed()];
    let mut reports = Vec::with_capacity(drawn.len());
    for view in &drawn {
        let report = report(args, &prepared, &farm, view, seconds);
        let nodes = nodes_of(&view.light, fit.as_ref());
        reports.push(Report { view: views[view.view].name.clone(), budget: budget.clone(), nodes, ..report });
    }
    if let Some(json) = json {
        match &reports[..] {
            [one] if args.cameras.is_none() => json.write(one)?,
            all => json.write(&all)?,
        }
    }
    for warning in traced.iter().flat_map(film_warnings) {
        show.line(&format!("warning: {warning}"));
    }
    let [import, build] = [import_time, prepared.build_time].map(|time| time.as_secs_f64());
    let before = format!("import {import:.2} s, build {build:.2} s");
    for view in &drawn {
        let line = view_line(&views[view.view], view);
        show.line(&if views.len() == 1 { format!("{line}; {before}") } else { line });
    }
    if views.len() > 1 {
        show.line(&before);
    }
    let all = merged(&traced.iter().collect::<Vec<_>>());
    if let Some((memory, fit)) = args.memory.zip(fit.as_ref()) {
        show.line(&traffic_line(&all, fit, memory));
    }
    if outcome == Outcome::Stopped {
        let done = traced.last().map(|last| last.progress).unwrap_or_default();
        let (finished, tiles) = (done.finished, done.tiles);
        let path = views[jobs[traced.len() - 1].view].path.display();
        let left = views.len() - 1 - jobs[traced.len() - 1].view;
        let left = if left == 0 { String::new() } else { format!(", and {left} views were not begun") };
        show.line(&format!("interrupted: {finished} of {tiles} tiles are in {path}{left}{goes_on}"));
        return Ok(End::Interrupted);
    }
    films.iter().try_for_each(|film| remove(film))?;
    if let [view] = &views[..] {
        show.line(&format!("{}", view.path.display()));
    }
    Ok(End::Done)
}

/// What was drawn of a view.
struct Drawn<'a> {
    view: usize,
    frame: Frame,
    /// Its light, in one piece or two.
    light: Traced,
    /// Tiles of it that were there.
    there: u32,
    layers: Vec<(&'static str, &'a Traced)>,
}

impl<'a> Drawn<'a> {
    /// Of all views that were begun.
    fn of(jobs: &[Job], traced: &'a [Traced], ended: &[Ended]) -> Vec<Self> {
        let all: Vec<_> =
            jobs.iter().zip(traced).zip(ended).map(|((job, traced), ended)| (job, traced, ended)).collect();
        let views = all.chunk_by(|a, b| a.0.view == b.0.view);
        let drawn = views.map(|parts| {
            let light: Vec<_> = parts.iter().filter(|part| part.0.part.is_light()).collect();
            let film = light.iter().rev().find_map(|part| part.2.light);
            let mut merged = merged(&light.iter().map(|part| part.1).collect::<Vec<_>>());
            merged.film = film.unwrap_or(merged.film);
            Self {
                view: parts[0].0.view,
                frame: parts[0].0.frame,
                light: merged,
                there: light.iter().map(|part| part.2.there).sum(),
                layers: parts
                    .iter()
                    .filter(|part| !part.0.part.is_light())
                    .filter_map(|part| Some((part.0.part.name()?, part.1)))
                    .collect(),
            }
        });
        drawn.collect()
    }
}

/// Several pictures as one: what was done for them together, and how the last ended.
fn merged(all: &[&Traced]) -> Traced {
    let last = all[all.len() - 1];
    let mut nodes = last.nodes.clone();
    let mut worked = last.worked.clone();
    for one in &all[..all.len() - 1] {
        for (sum, node) in nodes.iter_mut().zip(&one.nodes) {
            sum.counts += node.counts;
            sum.tiles += node.tiles;
            sum.runs += node.runs;
            sum.busy_nanoseconds += node.busy_nanoseconds;
        }
        worked.iter_mut().zip(&one.worked).for_each(|(sum, node)| *sum += *node);
    }
    let mut walks = hybray_bintree::walk::Counts::default();
    all.iter().for_each(|one| walks += one.walks);
    Traced {
        outcome: last.outcome,
        time: all.iter().map(|one| one.time).sum(),
        radiance: Vec::new(),
        film: last.film,
        progress: last.progress,
        nodes,
        walks,
        worked,
        refused_frames: all.iter().map(|one| one.refused_frames).sum(),
    }
}

fn view_line(view: &View, drawn: &Drawn<'_>) -> String {
    let Frame { width, height, samples, .. } = drawn.frame;
    let name = view.name.as_ref().map_or(String::new(), |name| format!("{name}: "));
    let s = if samples == 1 { "" } else { "s" };
    let (rays, time) = (total_rays(&drawn.light), drawn.light.time);
    let layers: Duration = drawn.layers.iter().map(|(_, layer)| layer.time).sum();
    let layers = match drawn.layers.len() {
        0 => String::new(),
        _ => format!("; layers {:.2} s", layers.as_secs_f64()),
    };
    let (seconds, rate) = (time.as_secs_f64(), rays_per_second(rays, time));
    format!("{name}{width} x {height}, {samples} sample{s}: {rays} rays in {seconds:.2} s, {rate}{layers}")
}

/// Layers want a place for them.
fn check_layers(args: &RenderArgs, path: &Path, format: Format) -> Result<()> {
    if !args.layers.is_empty() && format != Format::Exr {
        let path = path.display();
        bail!("`{path}` has no room for layers: name an EXR with -o, such as -o out.exr, or leave --layers out");
    }
    Ok(())
}

/// Variance wants something to vary.
fn check_samples(args: &RenderArgs, frame: &Frame) -> Result<()> {
    if Part::of(&args.layers).contains(&Part::Odd) && frame.samples < 2 {
        bail!("the variance of one sample a pixel is not known: give --spp 2, or more, or name other --layers");
    }
    Ok(())
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
    let sum = |of: fn(&Exchange) -> u64| exchanges.iter().map(of).sum::<u64>();
    let (look_ups, bytes) = (sum(|node| node.traffic.look_ups), sum(|node| node.traffic.texel_bytes));
    let texels = match look_ups {
        0 => String::new(),
        _ => format!(
            "; {look_ups} look-ups in textures, for which {bytes} bytes came: {:.2} bytes each",
            bytes as f64 / look_ups as f64
        ),
    };
    format!(
        "{rays} rays and {pages} pages went from node to node; none used more than {high_water} bytes of {memory}{texels}"
    )
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

/// `spd:balls:4` becomes `spd-balls-4.png`, `models/cow.obj` becomes `cow.png`, in this folder; an .exr if it has layers.
fn default_output(scene: &str, layers: bool) -> PathBuf {
    let extension = if layers { "exr" } else { "png" };
    let stem = Path::new(scene).file_stem().map_or_else(|| "picture".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{}.{extension}", stem.replace(':', "-")))
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
    farm: &Farm,
    drawn: &Drawn<'_>,
    [import, build, trace, total]: [Duration; 4],
) -> Report {
    let Drawn { frame, light: traced, there: tiles_kept, .. } = drawn;
    let trace = if args.cameras.is_some() { traced.time } else { trace };
    let layers = drawn.layers.iter().map(|&(layer, traced)| {
        let sum = |f: fn(&hybray_wire::Counts) -> u64| traced.nodes.iter().map(|node| f(&node.counts)).sum();
        LayerReport {
            layer,
            film: format!("{:016x}", traced.film),
            seconds: traced.time.as_secs_f64(),
            primary: sum(|counts| counts.primary),
            hits: sum(|counts| counts.hits),
        }
    });
    let mut counts = hybray_wire::Counts::default();
    traced.nodes.iter().for_each(|node| counts += node.counts);
    let [triangles, spheres, cones] = prepared.primitives;
    let [lights, materials] = prepared.tables().map(|n| n as u64);
    let peak_bytes = peak_bytes();
    let primitives = (triangles + spheres + cones).max(1);
    let warnings = prepared.warnings.iter().cloned().chain(film_warnings(traced));
    Report {
        view: None,
        layers: layers.collect(),
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
            tiles_kept: *tiles_kept,
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
        warnings: warnings.collect(),
    }
}
