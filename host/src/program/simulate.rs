//! `hybray simulate`.

use super::args::{SimulateArgs, Where};
use super::budget::Farm;
use super::render::{check_camera, interrupts};
use super::report::ReportFile;
use super::show::Show;
use super::{End, camera, prepare};
use crate::model::Settings;
use crate::pack::is_packed;
use crate::partition::{Voxels, page_bytes_for};
use crate::simulate::record::{Report, Run};
use crate::simulate::runs::{Experiment, name_of};
use crate::simulate::{csv, html};
use anyhow::{Result, bail};
use hybray_link::HOST;
use hybray_scene::PAGE_BYTES_MAX;
use hybray_scheduler::Sizes;
use hybray_simulated::NODES_MAX;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

pub(super) fn run(args: &SimulateArgs) -> Result<End> {
    let interrupted = interrupts()?;
    // One node alone clips for nobody.
    let fewest = args.nodes.iter().filter(|&&nodes| nodes > 1).min().unwrap_or(&1);
    args.work.check(args.dispatcher, args.memory, *fewest)?;
    // What could go wrong at the end is tried at the beginning.
    let outputs = [&args.json, &args.csv, &args.html];
    let to_standard_output = |path: &&Option<PathBuf>| path.as_deref() == Some(Path::new("-"));
    if outputs.iter().filter(|path| to_standard_output(path)).count() > 1 {
        bail!("only one of --json, --csv and --html can go to standard output: give the others a file");
    }
    let [json, csv, html] = outputs.map(|path| path.as_deref().map(ReportFile::create).transpose());
    let (json, csv, html) = (json?, csv?, html?);

    let mut show = Show::new(args.quiet);
    // One scene for all runs: its pages are such as the smallest nodes can have.
    let page_sizes = args.memory.iter().flat_map(|&memory| args.nodes.iter().map(move |&n| page_bytes_for(memory, n)));
    let page_bytes = page_sizes.min().unwrap_or(PAGE_BYTES_MAX as u32);
    let (mut prepared, _) = prepare(&args.scene, &args.tree, args.size, page_bytes)?;
    prepared.warnings.iter().for_each(|warning| show.line(&format!("warning: {warning}")));
    show.line(&format!("{}: {} primitives", args.scene.scene, prepared.primitives.iter().sum::<u64>()));
    let camera = camera(&prepared.cameras, &args.camera)?;
    let wanted = Settings { size: args.size, spp: args.spp, depth: args.depth, seed: args.seed, ..Settings::default() };
    let frame = prepared.frame(&camera, &wanted);
    check_camera(&frame)?;
    let farms = args.scheduler.iter().flat_map(|policy| args.nodes.iter().map(move |&nodes| (*policy, nodes)));
    let budgets = args.memory.iter().flat_map(|&m| farms.clone().map(move |farm| (m, farm)));
    let budget = |(memory, (policy, nodes))| Farm {
        nodes,
        memory,
        page_memory: None,
        policy,
        light_cache: args.copies.light_cache,
        pilot: None,
        first_dispatches: matches!(args.dispatcher, Where::Node),
        nodes_most: NODES_MAX,
        tree: &args.tree,
        packed: is_packed(&args.scene.scene),
    };
    // One node alone has the whole scene.
    for farm in budgets.clone().map(budget).filter(|farm| farm.nodes > 1) {
        let page_memory = args.page_memory.map(|page_memory| page_memory.bytes(prepared.packed.page_bytes()));
        let farm = Farm { page_memory, ..farm };
        prepared = farm.choose_form(prepared, |tree| Ok(prepare(&args.scene, tree, args.size, page_bytes)?.0))?;
    }
    let pages = prepared.packed.open()?;
    let scene = prepared.scene(&pages);
    let pages_bytes = Sizes::of(&scene).pages_bytes;
    let page_memory = args.page_memory.map(|page_memory| page_memory.bytes(pages_bytes));
    let mut experiment = Experiment::new(&prepared, &scene, &frame, args.machine);
    experiment.pilot_rays = args.copies.pilot;
    experiment.dispatcher = match args.dispatcher {
        Where::Host => HOST,
        Where::Node => 1,
    };
    let criterion = args.work.demand_driven;
    let (mut voxels, mut grid) = (Voxels::One, None);
    for farm in budgets.map(budget) {
        let (nodes, pilot) = (farm.nodes, experiment.pilot(farm.policy));
        let farm = Farm { page_memory, pilot: pilot.filter(|_| nodes > 1), ..farm };
        if nodes > 1 {
            farm.barred(criterion, &prepared, &farm.fit(&prepared, &scene)?)?;
            grid = farm.grid(args.work.ways, &scene)?;
        }
        voxels = farm.voxels();
    }

    (experiment.criterion, experiment.voxels) = (criterion.unwrap_or_default(), voxels);
    let mut report =
        Report { scene: args.scene.scene.clone(), machine: args.machine.name.to_owned(), ..Report::default() };
    (experiment.memory, experiment.page_memory) = (args.memory, page_memory);
    experiment.light_cache = args.copies.light_cache;
    for (policy, nodes) in farms {
        experiment.settings = args.work.settings(args.machine.settings(policy));
        experiment.settings.grid = grid.filter(|_| nodes > 1);
        experiment.options = args.work.options(args.spread, args.tile, &experiment.settings);
        let s = if nodes == 1 { "" } else { "s" };
        show.line(&format!("{}, {} with {nodes} node{s}", args.machine.name, name_of(policy)));
        show.begin(0, 0);
        let run = experiment.run(nodes, &mut |progress| {
            show.progress(progress);
            !interrupted.load(Ordering::Relaxed)
        })?;
        show.end();
        let Some(run) = run else {
            show.line("interrupted: nothing is written");
            return Ok(End::Interrupted);
        };
        report.runs.push(run);
    }

    if !outputs.iter().any(to_standard_output) {
        std::io::stdout().write_all(table(&report.runs).as_bytes())?;
    }
    if let Some(json) = json {
        json.write_text(&format!("{}\n", report.to_json()))?;
    }
    if let Some(csv) = csv {
        csv.write_text(&csv::runs(&report))?;
    }
    if let Some(html) = html {
        html.write_text(&html::page(&report))?;
    }
    Ok(End::Done)
}

fn table(runs: &[Run]) -> String {
    let mut table = format!(
        "{:<13}  {:>5}  {:>12}  {:>8}  {:>10}  {:>6}  {:>10}  {:>9}  {:<16}\n",
        "scheduler", "nodes", "seconds", "speed-up", "efficiency", "busy", "messages", "MB", "film"
    );
    for run in runs {
        table += &format!(
            "{:<13}  {:>5}  {:>12.6}  {:>8.2}  {:>8.1} %  {:>4.0} %  {:>10}  {:>9.3}  {:<16}\n",
            run.scheduler,
            run.nodes,
            run.seconds,
            run.speedup,
            100.0 * run.efficiency,
            100.0 * run.busy,
            run.messages,
            run.bytes as f64 * 1e-6,
            run.film
        );
    }
    table
}
