//! `hybray plan`: what each node's memory would be spent on, before anything is drawn.

use super::args::PlanArgs;
use super::budget::{Farm, Least, size};
use super::report::{PlanReport, ReportFile};
use super::{End, prepare};
use crate::model::Settings;
use crate::pack::is_packed;
use crate::partition::{Fit, Pilot, page_bytes_for};
use crate::simulate::runs::{name_of, seconds};
use anyhow::Result;
use hybray_scheduler::Sizes;
use hybray_simulated::{Bound, NODES_MAX};
use serde::Serialize;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

/// The JSON report: `docs/REPORT.md` describes it.
#[derive(Debug, Serialize)]
struct Report<'a> {
    scene: &'a str,
    nodes: u16,
    memory: u64,
    scheduler: &'static str,
    pages: usize,
    /// Of which so many are in compact form.
    compact_pages: usize,
    page_bytes: u64,
    page_bytes_max: usize,
    voxels: u32,
    #[serde(flatten)]
    plan: PlanReport,
    least_memory: Option<u64>,
    least_nodes: Option<u16>,
    progress: Option<Progress>,
    warnings: &'a [String],
}

/// How long it is at most until a ray ends on a machine, for the scene's own picture: docs/PROGRESS.md.
struct Bounds {
    machine: &'static str,
    bound: Bound,
}

/// The same, in seconds.
#[derive(Debug, Serialize)]
struct Progress {
    machine: &'static str,
    walk_seconds: f64,
    turn_seconds: f64,
    way_seconds: f64,
    round_seconds: f64,
    quiet_round_seconds: f64,
    wait_seconds: f64,
    rays: u128,
    steps: u128,
    rounds: u128,
    tracing_seconds: f64,
    gap_seconds: f64,
}

impl Bounds {
    fn report(&self) -> Progress {
        let b = &self.bound;
        Progress {
            machine: self.machine,
            walk_seconds: seconds(b.walk_ns),
            turn_seconds: seconds(b.turn_ns),
            way_seconds: seconds(b.way_ns),
            round_seconds: seconds(b.round_ns),
            quiet_round_seconds: seconds(b.quiet_round_ns),
            wait_seconds: seconds(b.wait_ns),
            rays: b.rays,
            steps: b.steps,
            rounds: b.rounds,
            tracing_seconds: seconds(b.tracing_ns),
            gap_seconds: seconds(b.gap_ns),
        }
    }

    fn table(&self) -> String {
        let p = self.report();
        let mut text = format!("\nat most, on {}\n", p.machine);
        let rows = [
            (p.walk_seconds, "a walk: every node and block of the scene"),
            (p.turn_seconds, "a turn of a node: it takes in, traces and sends"),
            (p.way_seconds, "a frame's way, until it is read"),
            (p.round_seconds, "from asking for a page, or sending rays, to the answer"),
            (p.quiet_round_seconds, "the same while nobody traces"),
            (p.wait_seconds, "nobody traces"),
            (p.tracing_seconds, "all that can be traced before a ray ends"),
            (p.gap_seconds, "from the end of a ray to the next, anywhere"),
        ];
        for (seconds, what) in rows {
            text += &format!("{seconds:>16.6} s  {what}\n");
        }
        text + &format!(
            "{:>16}    rays under way at most; one comes on {} times, and waits for {} answers, before it ends\n",
            p.rays, p.steps, p.rounds
        )
    }
}

pub(super) fn run(args: &PlanArgs) -> Result<End> {
    let json = args.json.as_deref().map(ReportFile::create).transpose()?;
    let page_bytes = page_bytes_for(args.memory, args.nodes);
    let (prepared, _) = prepare(&args.scene, &args.tree, None, page_bytes)?;
    let page_memory = |pages_bytes| args.page_memory.map(|page_memory| page_memory.bytes(pages_bytes));
    let farm = Farm {
        nodes: args.nodes,
        memory: args.memory,
        page_memory: page_memory(prepared.packed.page_bytes()),
        policy: args.scheduler,
        light_cache: args.copies.light_cache,
        pilot: None,
        first_dispatches: false,
        nodes_most: NODES_MAX,
        tree: &args.tree,
        packed: is_packed(&args.scene.scene),
    };
    let prepared = farm.choose_form(prepared, |tree| Ok(prepare(&args.scene, tree, None, page_bytes)?.0))?;
    let pages = prepared.packed.open()?;
    let scene = prepared.scene(&pages);
    let sizes = Sizes::of(&scene);
    let frame = prepared.frame(&prepared.cameras[0], &Settings::default());
    let pilot = Pilot::of_policy(args.scheduler, &scene, &frame, args.copies.pilot).filter(|_| args.nodes > 1);
    let farm = Farm { page_memory: page_memory(sizes.pages_bytes), pilot: pilot.as_ref(), ..farm };
    let fit = farm.fit(&prepared, &scene)?;
    let least = farm.least(&scene);
    let progress = args.machine.map(|machine| {
        let settings = fit.plan.settings(machine.settings(args.scheduler));
        Bounds {
            machine: machine.name,
            bound: Bound::new(&scene, &fit.plan, &settings, machine, args.nodes, &frame, 0),
        }
    });
    let report = Report {
        scene: &args.scene.scene,
        nodes: args.nodes,
        memory: args.memory,
        scheduler: name_of(args.scheduler),
        pages: sizes.pages,
        compact_pages: prepared.packed.compact_pages(),
        page_bytes: sizes.pages_bytes,
        page_bytes_max: sizes.page_bytes_max,
        voxels: prepared.packed.voxels(),
        plan: PlanReport::of(&fit, sizes.lights),
        least_memory: least.memory,
        least_nodes: least.nodes,
        progress: progress.as_ref().map(Bounds::report),
        warnings: &prepared.warnings,
    };
    if args.json.as_deref() != Some(Path::new("-")) {
        prepared.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        std::io::stdout().lock().write_all(
            (table(&report, &fit, &farm, least) + &progress.map_or_else(String::new, |p| p.table())).as_bytes(),
        )?;
    }
    if let Some(json) = json {
        json.write(&report)?;
    }
    Ok(End::Done)
}

fn table(report: &Report<'_>, fit: &Fit, farm: &Farm<'_>, least: Least) -> String {
    let mut text = String::new();
    let mut line = |arguments: std::fmt::Arguments<'_>| {
        // A string takes everything.
        let _ = writeln!(text, "{arguments}");
    };
    let names = report.plan.terms.iter().map(|term| term.name.len()).max().unwrap_or(0);
    let s = |count: u64| if count == 1 { "" } else { "s" };
    line(format_args!("{:<names$} {:>9} {:>9} {:>13}", "each node has", "count", "each", "bytes"));
    for term in &report.plan.terms {
        line(format_args!("{:<names$} {:>9} {:>9} {:>13}", term.name, term.count, term.bytes_each, term.bytes));
    }
    line(format_args!("{:<names$} {:>33}", "in all", report.plan.total_bytes));
    line(format_args!(
        "{:<names$} {:>33}",
        format!("not needed of {}", size(report.memory)),
        report.memory - report.plan.total_bytes
    ));
    line(format_args!(""));
    line(format_args!(
        "scene      {}: {} {}page{} of {} bytes at most, {} bytes in all, in {} voxel{}",
        report.scene,
        report.pages,
        if report.compact_pages > 0 { "compact " } else { "" },
        s(report.pages as u64),
        report.page_bytes_max,
        report.page_bytes,
        report.voxels,
        s(u64::from(report.voxels))
    ));
    line(format_args!("scheduler  {}", report.scheduler));
    let [least_owned, most_owned] = [report.plan.owned_bytes_least, report.plan.owned_bytes_most];
    let holds = if fit.plan.holds_all {
        "has room for all others, too".to_owned()
    } else {
        let places = report.plan.cache_places;
        format!("has a cache of {places} place{} for others", s(places as u64))
    };
    line(format_args!("each node  owns {least_owned} to {most_owned} bytes of pages, and {holds}"));
    let (least_copies, most_copies) = (report.plan.copies_least, report.plan.copies_most);
    if most_copies > 0 {
        let s = s(most_copies as u64);
        line(format_args!(
            "           and copies of {least_copies} to {most_copies} page{s} of others from the beginning"
        ));
    }
    let light_caches = &report.plan.light_caches;
    if light_caches.bytes > 0 {
        let lights = light_caches.lights;
        let (least, most) = (light_caches.pages_least, light_caches.pages_most);
        line(format_args!("           of which {least} to {most} lie towards {lights} light{}", s(lights as u64)));
    }
    let [memory, nodes] = farm.arguments(least);
    let unless = |text: Option<String>| text.unwrap_or_else(|| "nothing".to_owned());
    line(format_args!(
        "enough     {} for {} node{}; {} with {} each",
        unless(memory),
        report.nodes,
        s(u64::from(report.nodes)),
        unless(nodes),
        size(report.memory)
    ));
    text
}
