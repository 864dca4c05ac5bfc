//! Our kernels beside those of the crate `obvhs` and of Embree: one scene, one pinned thread, the same rays for all.
//!
//! It prints JSON, which `cargo xtask bench kernels` makes tables of. What is timed goes round: each engine in turn
//! traces all rays of a kind, again and again, each round begun by another, so that a machine that others use slows
//! all. Answers are compared with those of our single walk, which are brute force's to the bit
//! (`tests/tests/nearest.rs`).
#![deny(unsafe_code)]

mod clustered;
mod compare;
#[cfg(has_embree)]
mod embree;
mod engine;
mod ours;
mod rays;

use std::time::Instant;

use anyhow::{Context as _, ensure};
use clap::Parser;
use hybray::build::{self, Source};
use hybray::prepare::Prepared;
use hybray_geometry::Ray;
use hybray_scene::PageForm;
use serde::Serialize;

use clustered::{Form, MEDIUM, PRESETS};
use compare::{Comparison, Differences};
use engine::{Answer, Built, Counts, Engine, Kind};
use ours::{Bundles, Single};

/// Traces the same rays by every engine and prints what it took, as JSON
#[derive(Parser)]
#[command(name = "kernels")]
struct Args {
    /// A built-in scene, or a file
    scene: String,
    /// Columns and rows of the picture whose primary rays are taken: a power of two
    #[arg(long, value_name = "N", default_value_t = 1024)]
    side: u32,
    /// How often each engine traces each set of rays
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// How often each engine's tree is built
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    builds: u32,
    /// Only rays of these kinds: for a profiler
    #[arg(long, value_name = "KIND,..", value_delimiter = ',')]
    kinds: Vec<Kind>,
    /// Leave out the other engines
    #[arg(long)]
    alone: bool,
}

/// What one scene came to.
#[derive(Serialize)]
struct Report {
    scene: String,
    primitives: u32,
    triangles: u64,
    pages: usize,
    /// Of our pages and their directory: what a node holds. What the host's allocator gave for them is in `builds`.
    page_bytes: u64,
    /// The same of compact pages.
    compact_bytes: u64,
    kernels: &'static str,
    /// As 31305 is 3.13.5.
    embree: Option<u32>,
    builds: Vec<Built>,
    /// Our pages' validation, which a node does with what it receives.
    validation_seconds: f64,
    sets: Vec<Set>,
}

/// Rays of a kind.
#[derive(Serialize)]
struct Set {
    kind: Kind,
    rays: usize,
    hits: usize,
    engines: Vec<Traced>,
}

/// What an engine did with them.
#[derive(Serialize)]
struct Traced {
    name: &'static str,
    /// One a round.
    seconds: Vec<f64>,
    counts: Option<Counts>,
    differences: Differences,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    // The builders' work is done by this thread too.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let core = core_affinity::get_core_ids().and_then(|cores| cores.last().copied());
    let is_pinned = core.is_some_and(core_affinity::set_for_current);
    if !is_pinned {
        eprintln!("note: the thread could not be pinned to a processor");
    }
    println!("{}", serde_json::to_string(&report(&args)?)?);
    Ok(())
}

/// Builds `what` again, for its time.
fn again<T>(built: &mut Built, times: u32, mut build: impl FnMut() -> (T, Built)) {
    // What takes long is steady enough.
    for _ in 1..if built.seconds[0] > 5.0 { 1 } else { times } {
        let (_, another) = build();
        built.seconds.extend(another.seconds);
    }
}

fn report(args: &Args) -> anyhow::Result<Report> {
    ensure!(args.side.is_power_of_two() && args.side <= 4096, "--side {}: a power of two up to 4096", args.side);
    let model = hybray_tests::scene(&args.scene);
    ensure!(model.cones.is_empty(), "{}: cones, which the other engines do not have", args.scene);
    let (source, scale_log2) = Source::new(&model)?;
    let primary = hybray_tests::camera_rays(&model, 2f32.powi(scale_log2), args.side);
    let settings = build::Settings::default();

    let compactly = build::Settings { pages: PageForm::Compact, ..settings };
    let mut builds = Vec::new();
    for (name, settings) in [("hybray", &settings), ("hybray compact", &compactly)] {
        let pack = || Built::of(name, || build::build(&model, settings));
        let (packed, mut built) = pack();
        // What the system mapped is no allocator's. Pages are copied there when all else is gone, hardly one chunk twice.
        built.kept_bytes += packed?.mapped_bytes();
        built.peak_bytes = built.peak_bytes.max(built.kept_bytes);
        again(&mut built, args.builds, pack);
        builds.push(built);
    }

    let prepared = Prepared::new(model.clone(), &settings)?;
    let compact = build::build(&model, &compactly)?;
    let compact_pages = compact.open()?;
    let start = Instant::now();
    let pages = prepared.packed.open()?;
    let validation_seconds = start.elapsed().as_secs_f64();
    let scene = prepared.scene(&pages);
    let sets = rays::sets(&prepared, &scene, primary);

    let mut engines: Vec<Box<dyn Engine + '_>> = vec![
        Box::new(Single::new("hybray single", pages.resident())),
        Box::new(Single::new("hybray compact", compact_pages.resident())),
        Box::new(Bundles::new(pages.resident())),
    ];
    let given = clustered::Given::new(&source);
    for form in [Form::Compressed, Form::Binary].into_iter().filter(|_| !args.alone) {
        let (engine, built) = clustered_best(&given, form, &sets, args.builds);
        engines.push(engine);
        builds.extend(built);
    }
    let mut version = None;
    #[cfg(has_embree)]
    if !args.alone {
        let given = std::rc::Rc::new(embree::Given::new(&source));
        let build = || embree::build(&given).context("Embree has no device");
        let (forms, mut built) = build()?;
        for _ in 1..args.builds {
            built.seconds.extend(build()?.1.seconds);
        }
        engines.extend(forms);
        builds.push(built);
        version = Some(embree::version());
    }

    let comparison = Comparison { source: &source, magnitude: prepared.packed.magnitude };
    let wanted = sets.iter().filter(|(kind, _)| args.kinds.is_empty() || args.kinds.contains(kind));
    let sets = wanted.map(|(kind, rays)| traced(*kind, rays, &mut engines, &comparison, args.rounds)).collect();
    Ok(Report {
        scene: args.scene.clone(),
        primitives: source.len(),
        triangles: prepared.primitives[0],
        pages: prepared.packed.pages(),
        page_bytes: prepared.packed.page_bytes() + prepared.packed.directory_bytes(),
        compact_bytes: compact.page_bytes() + compact.directory_bytes(),
        kernels: hybray_tests::kernels().name(),
        embree: version,
        builds,
        validation_seconds,
        sets,
    })
}

/// Primitives up to which every preset is tried: the slowest takes minutes for four million.
const ALL_PRESETS_MOST: usize = 2_000_000;

/// The tree that traces fastest, of those that the crate's presets make, and what each build took.
fn clustered_best(
    given: &clustered::Given,
    form: Form,
    sets: &[(Kind, Vec<Ray>)],
    times: u32,
) -> (Box<dyn Engine>, Vec<Built>) {
    let mut best: Option<(f64, Box<dyn Engine>)> = None;
    let mut builds = Vec::new();
    for (preset, params) in PRESETS.into_iter().take(if given.len() <= ALL_PRESETS_MOST { PRESETS.len() } else { 2 }) {
        let build = || clustered::build(given, form, (preset, params));
        let (mut engine, mut built) = build();
        if preset == MEDIUM {
            again(&mut built, times, build);
        }
        builds.push(built);
        let seconds = clustered::quality(&mut *engine, sets);
        if best.as_ref().is_none_or(|(least, _)| seconds < *least) {
            best = Some((seconds, engine));
        }
    }
    (best.expect("there are presets").1, builds)
}

/// Rounds in which each engine traces all rays, and what their answers are beside those of the first.
fn traced(
    kind: Kind,
    rays: &[Ray],
    engines: &mut [Box<dyn Engine + '_>],
    comparison: &Comparison<'_>,
    rounds: u32,
) -> Set {
    let mut out = vec![Answer::MISS; rays.len()];
    let answers: Vec<Option<Vec<Answer>>> =
        engines.iter_mut().map(|engine| engine.trace(kind, rays, &mut out).then(|| out.clone())).collect();
    let mut seconds = vec![Vec::new(); engines.len()];
    for round in 0..rounds as usize {
        for i in 0..engines.len() {
            let at = (i + round) % engines.len();
            if answers[at].is_some() {
                let start = Instant::now();
                engines[at].trace(kind, rays, &mut out);
                seconds[at].push(start.elapsed().as_secs_f64());
            }
        }
    }
    let (first, others) = engines.split_first_mut().expect("there are engines");
    let ours = answers[0].as_deref().expect("single rays are of any kind");
    let hits = ours.iter().filter(|answer| answer.is_hit()).count();
    let name = first.name();
    let counts = first.counts(kind, rays);
    let mut engines =
        vec![Traced { name, seconds: std::mem::take(&mut seconds[0]), counts, differences: Differences::default() }];
    for ((engine, answers), seconds) in others.iter_mut().zip(&answers[1..]).zip(seconds.drain(1..)) {
        let Some(theirs) = answers else { continue };
        let name = engine.name();
        let counts = engine.counts(kind, rays);
        let differences = comparison.differences(kind, rays, [ours, theirs], [&mut **first, &mut **engine]);
        engines.push(Traced { name, seconds, counts, differences });
    }
    Set { kind, rays: rays.len(), hits, engines }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture so small that it takes a moment: whether everything runs and agrees, not how long it takes.
    fn check(scene: &str) -> Report {
        let args = Args { scene: scene.to_owned(), side: 32, rounds: 1, builds: 1, kinds: Vec::new(), alone: false };
        let report = report(&args).unwrap();
        let kinds: Vec<_> = report.sets.iter().map(|set| set.kind).collect();
        assert_eq!(kinds, [Kind::Primary, Kind::Shadow, Kind::Bounce]);
        for set in &report.sets {
            let what = format!("{scene} {:?}", set.kind);
            assert!(set.hits > 0 && set.rays > 100, "{what}: {} of {} hit", set.hits, set.rays);
            for engine in &set.engines {
                let (name, found) = (engine.name, &engine.differences);
                assert_eq!(found.unexplained, 0, "{what} {name}: {found:?}");
                let all = found.tie + found.edge + found.end + found.lost;
                assert!(20 * all <= set.rays as u64 && found.apart < 1e-3, "{what} {name}: {found:?}");
                assert!(!name.starts_with("hybray") || (all, found.apart) == (0, 0.0), "{what} {name}: {found:?}");
                assert_eq!(engine.seconds.len(), 1, "{what} {name}");
            }
        }
        for built in &report.builds {
            assert!(0 < built.kept_bytes && built.kept_bytes <= built.peak_bytes, "{built:?}");
        }
        report
    }

    fn names(report: &Report, set: usize) -> Vec<&str> {
        report.sets[set].engines.iter().map(|engine| engine.name).collect()
    }

    #[test]
    fn triangles() {
        let report = check("spd:teapot:3");
        let expected = ["hybray single", "hybray compact", "hybray bundles", "obvhs CWBVH", "obvhs BVH2"];
        assert_eq!(names(&report, 0)[..5], expected);
        assert!(report.compact_bytes * 100 < report.page_bytes * 60, "{} {}", report.compact_bytes, report.page_bytes);
        if report.embree.is_none() {
            eprintln!("skipped: Embree, which is not installed");
            return;
        }
        assert_eq!(names(&report, 0)[5..], ["embree single", "embree packets", "embree streams"]);
    }

    #[test]
    fn spheres_and_triangles() {
        check("spd:balls:2");
    }

    #[test]
    fn an_interior() {
        check("cornell");
    }

    /// An engine whose every answer is the same.
    struct Fixed(Answer);

    impl Engine for Fixed {
        fn name(&self) -> &'static str {
            "fixed"
        }
        fn trace(&mut self, _: Kind, _: &[Ray], out: &mut [Answer]) -> bool {
            out.fill(self.0);
            true
        }
        fn counts(&mut self, _: Kind, _: &[Ray]) -> Option<Counts> {
            None
        }
    }

    /// What a ray from (`x`, `y`, 1) straight down to the unit triangle, which is there twice, is found to differ in,
    /// if answers are `a` and `b`.
    fn why(x: f32, y: f32, [a, b]: [Answer; 2]) -> Differences {
        let mesh = hybray::model::Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 1]],
            ..Default::default()
        };
        let model = hybray::model::Model { meshes: vec![mesh], ..Default::default() };
        // Coordinates are halved, so that they are below 1.
        let (source, scale_log2) = Source::new(&model).unwrap();
        assert_eq!(scale_log2, -1);
        let comparison = Comparison { source: &source, magnitude: 0.5 };
        let origin = hybray_geometry::Vec3::new(x, y, 1.0) * 0.5;
        let ray = Ray { origin, direction: -hybray_geometry::Vec3::Z, t_min: 0.0, t_max: f32::INFINITY };
        let engines: [&mut dyn Engine; 2] = [&mut Fixed(a), &mut Fixed(b)];
        comparison.differences(Kind::Primary, &[ray], [&[a], &[b]], engines)
    }

    #[test]
    fn differences_are_explained() {
        let hit = Answer { t: 0.5, id: 0 };
        let counts = |d: Differences| [d.tie, d.edge, d.end, d.lost, d.unexplained];
        assert_eq!(counts(why(0.25, 0.25, [hit, hit])), [0; 5]);
        assert_eq!(counts(why(0.25, 0.25, [hit, Answer { t: 0.500_001, id: 1 }])), [1, 0, 0, 0, 0]);
        assert_eq!(counts(why(0.25, 1e-6, [hit, Answer::MISS])), [0, 1, 0, 0, 0]);
        assert_eq!(counts(why(0.25, 0.25, [Answer { t: 1e-7, id: 0 }, Answer::MISS])), [0, 0, 1, 0, 0]);
        assert_eq!(counts(why(0.25, 0.25, [hit, Answer::MISS])), [0, 0, 0, 1, 0]);
        assert_eq!(counts(why(0.25, 0.25, [Answer::MISS, hit])), [0, 0, 0, 0, 1]);
        assert_eq!(counts(why(0.25, 0.25, [Answer { t: 0.75, id: 0 }, Answer { id: 1, ..hit }])), [0, 0, 0, 0, 1]);
        assert_eq!(counts(why(0.75, 0.75, [hit, Answer::MISS])), [0, 0, 0, 0, 1]);
        assert_eq!(why(0.25, 0.25, [hit, Answer { t: 0.75, id: 0 }]).apart, 0.5);
    }
}
