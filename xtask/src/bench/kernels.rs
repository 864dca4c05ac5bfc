//! `cargo xtask bench kernels`: our kernels beside those of `obvhs` and Embree.
//!
//! The rays are traced by the program `hybray-kernels` (`tests/kernels`), which is run for each scene and whose JSON is
//! read. What it ought to come to stands in [`FLOORS`]; the table says beside each ratio whether it does. Clocks fail
//! nothing; answers that nobody can explain do.

use std::path::PathBuf;
use std::process::Command;

use anyhow::Context as _;
use clap::Args;
use serde::Deserialize;

use super::hybray::output;
use super::pairs::Spread;
use super::plot::{self, Group};
use super::table::{Figure, Table};
use super::{Common, Found};
use crate::tools::Tools;
use crate::workspace::Workspace;

/// `cargo xtask bench kernels`.
#[derive(Args)]
pub struct Options {
    /// How often each engine traces each set of rays
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    /// Only these scenes, of those that the benchmark has
    #[arg(long, value_name = "SCENE,..", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Draw the speeds as bars in this SVG file too
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub common: Common,
}

/// `cargo xtask bench growth`.
#[derive(Args)]
pub struct GrowthOptions {
    /// How often each terrain's rays are traced
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    #[command(flatten)]
    pub common: Common,
}

/// What is to be expected of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// Triangles are larger than pixels.
    Coarse,
    /// Many triangles fall in a pixel.
    Fine,
    /// Nearly nothing but spheres.
    Spheres,
}

const SCENES: [(&str, Class); 8] = [
    ("spd:teapot:12", Class::Coarse),
    ("organic", Class::Coarse),
    ("paper:conference", Class::Coarse),
    ("spd:teapot:64", Class::Fine),
    ("terrain:1000000", Class::Fine),
    ("terrain:4000000", Class::Fine),
    ("spd:balls:4", Class::Spheres),
    ("spd:balls:5", Class::Spheres),
];

const SMALL: [(&str, Class); 2] = [("spd:teapot:3", Class::Coarse), ("spd:balls:2", Class::Spheres)];

const KINDS: [&str; 3] = ["primary", "shadow", "bounce"];
const SINGLE: &str = "hybray single";
const COMPACT: &str = "hybray compact";
const BUNDLES: &str = "hybray bundles";
const EMBREE: &str = "embree single";
const OBVHS: &str = "obvhs CWBVH";
/// Every engine that there may be, in the order of the table.
const ENGINES: [&str; 8] = [BUNDLES, SINGLE, COMPACT, OBVHS, "obvhs BVH2", EMBREE, "embree packets", "embree streams"];
const TREES: [&str; 7] = [
    "hybray",
    "hybray compact",
    "obvhs CWBVH, medium",
    "obvhs CWBVH, slow",
    "obvhs CWBVH, very slow",
    "obvhs BVH2, medium",
    "embree",
];

/// The speed of ours over theirs.
struct Floor {
    kind: &'static str,
    ours: &'static str,
    theirs: &'static str,
    /// What it ought to be at least; `None` where it is but printed.
    least: fn(Class) -> Option<f64>,
}

const FLOORS: [Floor; 10] = [
    Floor { kind: "primary", ours: BUNDLES, theirs: OBVHS, least: |class| by_class(class, [2.5, 1.5]) },
    Floor { kind: "primary", ours: BUNDLES, theirs: EMBREE, least: |class| (class == Class::Coarse).then_some(1.5) },
    Floor { kind: "primary", ours: BUNDLES, theirs: "embree packets", least: |_| None },
    Floor { kind: "primary", ours: BUNDLES, theirs: SINGLE, least: |_| Some(1.0) },
    Floor { kind: "primary", ours: COMPACT, theirs: SINGLE, least: |_| None },
    Floor { kind: "shadow", ours: SINGLE, theirs: EMBREE, least: |class| (class != Class::Spheres).then_some(1.3) },
    Floor { kind: "shadow", ours: BUNDLES, theirs: EMBREE, least: |class| (class != Class::Spheres).then_some(1.3) },
    Floor { kind: "bounce", ours: SINGLE, theirs: OBVHS, least: |class| by_class(class, [1.3, 1.3]) },
    Floor { kind: "bounce", ours: SINGLE, theirs: EMBREE, least: |_| None },
    Floor { kind: "bounce", ours: COMPACT, theirs: SINGLE, least: |_| None },
];

fn by_class(class: Class, [coarse, fine]: [f64; 2]) -> Option<f64> {
    match class {
        Class::Coarse => Some(coarse),
        Class::Fine => Some(fine),
        Class::Spheres => None,
    }
}

/// Time of our build over that of `obvhs`, medium, at most.
const BUILD_MOST: f64 = 2.0;
/// Bytes for each triangle that remain, and at the peak of the build, at most.
const BYTES_MOST: [f64; 2] = [64.0, 150.0];
/// Bytes for each triangle that remain in compact pages, at most.
const COMPACT_MOST: f64 = 44.0;

/// What `hybray-kernels` tells of a scene.
#[derive(Clone, Debug, Deserialize)]
struct Report {
    scene: String,
    primitives: u64,
    triangles: u64,
    pages: u64,
    page_bytes: u64,
    compact_bytes: u64,
    kernels: String,
    embree: Option<u32>,
    builds: Vec<Built>,
    validation_seconds: f64,
    sets: Vec<Set>,
}

#[derive(Clone, Debug, Deserialize)]
struct Built {
    name: String,
    seconds: Vec<f64>,
    kept_bytes: u64,
    peak_bytes: u64,
}

#[derive(Clone, Debug, Deserialize)]
struct Set {
    kind: String,
    rays: u64,
    hits: u64,
    engines: Vec<Traced>,
}

#[derive(Clone, Debug, Deserialize)]
struct Traced {
    name: String,
    seconds: Vec<f64>,
    counts: Option<Counts>,
    differences: Differences,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Counts {
    boxes: Option<u64>,
    tests: u64,
    pages: Option<u64>,
}

#[derive(Clone, Debug, Deserialize)]
struct Differences {
    tie: u64,
    edge: u64,
    end: u64,
    lost: u64,
    unexplained: u64,
    example: Option<String>,
}

impl Report {
    fn traced(&self, kind: &str, engine: &str) -> Option<(&Set, &Traced)> {
        let set = self.sets.iter().find(|set| set.kind == kind)?;
        Some((set, set.engines.iter().find(|traced| traced.name == engine)?))
    }

    fn built(&self, name: &str) -> Option<&Built> {
        self.builds.iter().find(|built| built.name == name)
    }

    /// Speed of one engine over that of another, round by round.
    fn ratio(&self, kind: &str, ours: &str, theirs: &str) -> Option<Spread> {
        let ((_, ours), (_, theirs)) = (self.traced(kind, ours)?, self.traced(kind, theirs)?);
        Some(Spread::of(ours.seconds.iter().zip(&theirs.seconds).map(|(ours, theirs)| theirs / ours)))
    }

    /// Million rays a second.
    fn speed(&self, kind: &str, engine: &str) -> Option<Spread> {
        let (set, traced) = self.traced(kind, engine)?;
        Some(Spread::of(traced.seconds.iter().map(|seconds| set.rays as f64 * 1e-6 / seconds)))
    }
}

/// The program, built as it is measured.
pub struct Kernels {
    program: PathBuf,
}

impl Kernels {
    /// Builds it; its build script finds out whether Embree is there.
    pub fn build(tools: &Tools, workspace: &Workspace) -> anyhow::Result<Self> {
        let built = tools.run(&["build", "--release", "-p", "hybray-kernels"], &[])?;
        anyhow::ensure!(built, "hybray-kernels does not build");
        let name = format!("hybray-kernels{}", std::env::consts::EXE_SUFFIX);
        Ok(Self { program: workspace.target.join("release").join(name) })
    }

    fn measure(&self, scene: &str, side: u32, runs: u32, settings: &[&str]) -> anyhow::Result<Report> {
        eprintln!("{scene}");
        let mut command = Command::new(&self.program);
        command.args([scene, "--side", &side.to_string(), "--rounds", &runs.to_string()]).args(settings);
        parse(&output(command)?)
    }
}

fn parse(json: &[u8]) -> anyhow::Result<Report> {
    serde_json::from_slice(json).context("hybray-kernels tells something that this benchmark does not know")
}

/// Measures each scene.
pub fn run(kernels: &Kernels, options: &Options) -> anyhow::Result<Found> {
    let (scenes, side) = if options.common.small { (&SMALL[..], 64) } else { (&SCENES[..], 1024) };
    let mut found = Found { table: Table::default(), wrong: Vec::new() };
    let mut groups: [Vec<Group>; 3] = Default::default();
    let known = |only: &String| scenes.iter().any(|(scene, _)| scene == only);
    if let Some(other) = options.only.iter().find(|only| !known(only)) {
        let names: Vec<_> = scenes.iter().map(|(scene, _)| *scene).collect();
        anyhow::bail!("--only {other}: this benchmark has {}", names.join(", "));
    }
    for &(scene, class) in scenes.iter().filter(|(s, _)| options.only.is_empty() || options.only.iter().any(|o| o == s))
    {
        let report = kernels.measure(scene, side, options.runs, &[])?;
        found.wrong.extend(wrong(&report));
        found.table.add(figures(&report, class));
        for (groups, kind) in groups.iter_mut().zip(KINDS) {
            let bars = ENGINES.map(|engine| report.speed(kind, engine)).to_vec();
            groups.push(Group { name: scene.to_owned(), bars });
        }
    }
    if let Some(path) = &options.plot {
        let charts =
            KINDS.map(|kind| format!("{kind} rays, million a second")).into_iter().zip(groups).collect::<Vec<_>>();
        plot::bars(path, &charts, &ENGINES)?;
    }
    Ok(found)
}

/// Answers that have no good reason to be others than those of our single walk.
fn wrong(report: &Report) -> Vec<String> {
    let mut wrong = Vec::new();
    for set in &report.sets {
        for Traced { name, differences: found, .. } in &set.engines {
            let all = found.tie + found.edge + found.end + found.lost + found.unexplained;
            let (scene, kind) = (&report.scene, &set.kind);
            if found.unexplained > 0 {
                let example = found.example.as_deref().unwrap_or_default();
                wrong.push(format!("{scene}, {kind}, {name}: {} unexplained; {example}", found.unexplained));
            } else if all > 0 && name.starts_with("hybray") {
                wrong.push(format!("{scene}, {kind}, {name}: {all} rays have not the answers of single rays"));
            }
        }
    }
    wrong
}

/// Every scene has the same rows; where there is nothing to tell, a dash.
fn figures(report: &Report, class: Class) -> Vec<(String, Figure)> {
    let dash = || Figure::Text("-".to_owned());
    let text = |text: Option<String>| text.map_or_else(dash, Figure::Text);
    let spread = |spread: Option<Spread>| Figure::Spread(spread.unwrap_or(Spread::of([])));
    let embree = report.embree.map(|v| format!("{}.{}.{}", v / 10_000, v / 100 % 100, v % 100));
    let mut rows: Vec<(String, Figure)> = vec![
        ("scene".to_owned(), report.scene.clone().into()),
        ("primitives".to_owned(), report.primitives.into()),
        ("pages".to_owned(), report.pages.into()),
        ("kernels".to_owned(), report.kernels.clone().into()),
        ("embree".to_owned(), text(embree)),
    ];
    for kind in KINDS {
        let set = report.sets.iter().find(|set| set.kind == kind);
        rows.push((format!("{kind} rays"), text(set.map(|set| set.rays.to_string()))));
        rows.push((format!("{kind} rays that hit"), text(set.map(|set| set.hits.to_string()))));
        for engine in ENGINES {
            rows.push((format!("{kind}, {engine}, Mrays/s"), spread(report.speed(kind, engine))));
        }
        for floor in FLOORS.iter().filter(|floor| floor.kind == kind) {
            let ratio = report.ratio(kind, floor.ours, floor.theirs);
            let name = format!("{kind}, {} / {}", floor.ours, floor.theirs);
            let verdict = ratio.zip((floor.least)(class)).map(|(ratio, least)| at_least(ratio.median, least));
            rows.push((name.clone(), spread(ratio)));
            rows.push((format!("{name}, floor"), text(verdict)));
        }
        for engine in ENGINES {
            let counts = report.traced(kind, engine).and_then(|(set, traced)| Some((set.rays as f64, traced.counts?)));
            if engine.starts_with("embree") {
                continue;
            }
            let told = counts.map(|(rays, counts)| {
                let each = |count: Option<u64>| count.map_or("-".to_owned(), |n| format!("{:.2}", n as f64 / rays));
                format!("{}, {}, {}", each(counts.boxes), each(Some(counts.tests)), each(counts.pages))
            });
            rows.push((format!("{kind}, {engine}, boxes, tests, pages a ray"), text(told)));
        }
        for engine in ENGINES.into_iter().filter(|engine| *engine != SINGLE) {
            let differences = report.traced(kind, engine).map(|(_, traced)| {
                let Differences { tie, edge, end, lost, unexplained, .. } = &traced.differences;
                format!("{tie}, {edge}, {end}, {lost}, {unexplained}")
            });
            rows.push((format!("{kind}, {engine}, ties, edges, ends, lost, unexplained"), text(differences)));
        }
    }
    for tree in TREES {
        let built = report.built(tree);
        let seconds = built.map(|built| Spread::of(built.seconds.iter().copied()));
        rows.push((format!("build, {tree}, s"), spread(seconds)));
        let bytes = built.map(|built| {
            let each = |bytes: u64| bytes as f64 / report.primitives as f64;
            format!("{:.1}, {:.1}", each(built.kept_bytes), each(built.peak_bytes))
        });
        rows.push((format!("bytes a primitive, {tree}, kept and at the peak"), text(bytes)));
    }
    rows.push(("validation of our pages, s".to_owned(), format!("{:.4}", report.validation_seconds).into()));
    let middle = |name: &str| report.built(name).map(|built| Spread::of(built.seconds.iter().copied()).median);
    let ratio = middle("hybray").zip(middle("obvhs CWBVH, medium")).map(|(ours, theirs)| ours / theirs);
    rows.push(("build, hybray / obvhs CWBVH, medium".to_owned(), text(ratio.map(|ratio| at_most(ratio, BUILD_MOST)))));
    let ours = report.built("hybray").filter(|_| class != Class::Spheres);
    let bytes =
        |bytes: Option<u64>, most: f64| text(bytes.map(|bytes| at_most(bytes as f64 / report.triangles as f64, most)));
    let pages = ours.map(|_| report.page_bytes);
    rows.push(("bytes a triangle in pages and directory".to_owned(), bytes(pages, BYTES_MOST[0])));
    rows.push(("bytes a triangle kept".to_owned(), bytes(ours.map(|built| built.kept_bytes), BYTES_MOST[0])));
    rows.push(("bytes a triangle at the peak".to_owned(), bytes(ours.map(|built| built.peak_bytes), BYTES_MOST[1])));
    let compact = report.built(COMPACT).filter(|_| class != Class::Spheres);
    let pages = compact.map(|_| report.compact_bytes);
    rows.push(("bytes a triangle in compact pages and directory".to_owned(), bytes(pages, COMPACT_MOST)));
    let [kept, peak] = [compact.map(|built| built.kept_bytes), compact.map(|built| built.peak_bytes)];
    rows.push(("bytes a triangle kept, compact".to_owned(), bytes(kept, COMPACT_MOST)));
    rows.push(("bytes a triangle at the peak, compact".to_owned(), bytes(peak, BYTES_MOST[1])));
    rows
}

fn at_least(value: f64, least: f64) -> String {
    let verdict = if value >= least { "reached" } else { "missed" };
    format!("{least}: {verdict}")
}

fn at_most(value: f64, most: f64) -> String {
    let verdict = if value <= most { "kept" } else { "passed" };
    format!("{value:.2} of {most} at most: {verdict}")
}

/// Traces the primary rays of a terrain of more and more triangles, and fits what one costs to `a + b
/// log10(triangles)`.
pub fn growth(kernels: &Kernels, options: &GrowthOptions) -> anyhow::Result<Found> {
    let (sizes, side): (&[u32], u32) = if options.common.small {
        (&[100, 1_000, 10_000], 64)
    } else {
        (&[1_000, 10_000, 100_000, 1_000_000, 10_000_000], 1024)
    };
    let mut points = [Vec::new(), Vec::new()];
    let mut reports = Vec::new();
    for size in sizes {
        let report = kernels.measure(&format!("terrain:{size}"), side, options.runs, &["--alone", "--builds", "1"])?;
        for (points, engine) in points.iter_mut().zip([BUNDLES, SINGLE]) {
            let speed = report.speed("primary", engine).context("no primary rays")?;
            points.push((f64::from(*size).log10(), 1e3 / speed.median));
        }
        reports.push(report);
    }
    let mut found = Found { table: Table::default(), wrong: reports.iter().flat_map(wrong).collect() };
    for (i, report) in reports.iter().enumerate() {
        let mut rows = vec![("scene".to_owned(), Figure::from(report.scene.clone()))];
        for (points, engine) in points.iter().zip([BUNDLES, SINGLE]) {
            let Line { start, slope, .. } = fit(points);
            let speed = report.speed("primary", engine).context("no primary rays")?;
            rows.push((format!("{engine}, Mrays/s"), speed.into()));
            rows.push((format!("{engine}, ns a ray"), format!("{:.1}", points[i].1).into()));
            rows.push((format!("{engine}, ns by the fit"), format!("{:.1}", start + slope * points[i].0).into()));
        }
        found.table.add(rows);
    }
    for (points, engine) in points.iter().zip([BUNDLES, SINGLE]) {
        let Line { start, slope, share } = fit(points);
        println!(
            "{engine}: {start:.1} + {slope:.1} log10(triangles) ns, which explains {:.1} % of the variance",
            100.0 * share
        );
    }
    Ok(found)
}

/// A straight line.
struct Line {
    start: f64,
    slope: f64,
    /// Share of the variance that it explains.
    share: f64,
}

/// Least squares.
fn fit(points: &[(f64, f64)]) -> Line {
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|p| of(p.0 - x, p.1 - y)).sum::<f64>();
    let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
    let slope = xy / xx;
    Line { start: y - slope * x, slope, share: slope * xy / yy }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene with round figures: 100 rays of each kind.
    const RECORDED: &str = r#"{ "scene": "x", "primitives": 10, "triangles": 10, "pages": 1, "page_bytes": 600, "compact_bytes": 300, "kernels": "avx2", "embree": 31305,
        "builds": [
            { "name": "hybray", "seconds": [1.0, 3.0, 2.0], "kept_bytes": 640, "peak_bytes": 1501 },
            { "name": "hybray compact", "seconds": [1.0], "kept_bytes": 441, "peak_bytes": 1000 },
            { "name": "obvhs CWBVH, medium", "seconds": [1.0], "kept_bytes": 1, "peak_bytes": 2 } ],
        "validation_seconds": 0.5,
        "sets": [
            { "kind": "primary", "rays": 100, "hits": 50, "engines": [
                { "name": "hybray single", "seconds": [4e-6, 4e-6], "counts": { "boxes": 800, "tests": 50, "pages": 25 },
                  "differences": { "tie": 0, "edge": 0, "end": 0, "lost": 0, "unexplained": 0, "example": null } },
                { "name": "hybray bundles", "seconds": [2e-6, 1e-6], "counts": null,
                  "differences": { "tie": 0, "edge": 0, "end": 0, "lost": 0, "unexplained": 0, "example": null } },
                { "name": "obvhs CWBVH", "seconds": [4e-6, 4e-6], "counts": { "boxes": 400, "tests": 7, "pages": null },
                  "differences": { "tie": 1, "edge": 2, "end": 3, "lost": 4, "unexplained": 0, "example": null } } ] } ] }"#;

    fn row(rows: &[(String, Figure)], name: &str) -> String {
        rows.iter().find(|(row, _)| row == name).unwrap_or_else(|| panic!("no row {name}")).1.to_string()
    }

    #[test]
    fn figures_of_a_scene() {
        let report = parse(RECORDED.as_bytes()).unwrap();
        let rows = figures(&report, Class::Coarse);
        assert_eq!(row(&rows, "embree"), "3.13.5");
        assert_eq!(row(&rows, "primary, hybray bundles, Mrays/s"), "75.000 (50.000 to 100.000)");
        assert_eq!(row(&rows, "primary, hybray bundles / obvhs CWBVH"), "3.000 (2.000 to 4.000)");
        assert_eq!(row(&rows, "primary, hybray bundles / obvhs CWBVH, floor"), "2.5: reached");
        assert_eq!(row(&rows, "primary, hybray bundles / embree single"), "-");
        assert_eq!(row(&rows, "primary, hybray single, boxes, tests, pages a ray"), "8.00, 0.50, 0.25");
        assert_eq!(row(&rows, "primary, obvhs CWBVH, boxes, tests, pages a ray"), "4.00, 0.07, -");
        assert_eq!(row(&rows, "primary, obvhs CWBVH, ties, edges, ends, lost, unexplained"), "1, 2, 3, 4, 0");
        assert_eq!(row(&rows, "build, hybray / obvhs CWBVH, medium"), "2.00 of 2 at most: kept");
        assert_eq!(row(&rows, "bytes a triangle in pages and directory"), "60.00 of 64 at most: kept");
        assert_eq!(row(&rows, "bytes a triangle kept"), "64.00 of 64 at most: kept");
        assert_eq!(row(&rows, "bytes a triangle at the peak"), "150.10 of 150 at most: passed");
        assert_eq!(row(&rows, "bytes a triangle in compact pages and directory"), "30.00 of 44 at most: kept");
        assert_eq!(row(&rows, "bytes a triangle kept, compact"), "44.10 of 44 at most: passed");
        assert_eq!(row(&rows, "shadow, hybray single, Mrays/s"), "-");
        let spheres = figures(&report, Class::Spheres);
        assert_eq!(row(&spheres, "primary, hybray bundles / obvhs CWBVH, floor"), "-");
        assert_eq!(row(&spheres, "bytes a triangle kept"), "-");
        assert!(wrong(&report).is_empty());
    }

    #[test]
    fn floors_are_missed_by_little() {
        assert_eq!((at_least(1.5, 1.5), at_least(1.499, 1.5)), ("1.5: reached".into(), "1.5: missed".into()));
    }

    fn check_wrong(engine: usize, from: &str, to: &str, expected: &str) {
        let mut report = parse(RECORDED.as_bytes()).unwrap();
        let found = &mut report.sets[0].engines[engine].differences;
        match to {
            "tie" => found.tie = 1,
            _ => found.unexplained = 2,
        }
        found.example = Some(from.to_owned());
        assert_eq!(wrong(&report), [expected]);
    }

    #[test]
    fn other_answers_are_wrong() {
        check_wrong(1, "", "tie", "x, primary, hybray bundles: 1 rays have not the answers of single rays");
        check_wrong(2, "why", "unexplained", "x, primary, obvhs CWBVH: 2 unexplained; why");
    }

    #[test]
    fn lines_are_fitted() {
        let Line { start, slope, share } = fit(&[(3.0, 16.0), (4.0, 18.0), (5.0, 20.0)]);
        assert!((start - 10.0).abs() < 1e-9 && (slope - 2.0).abs() < 1e-9 && (share - 1.0).abs() < 1e-9);
        let Line { slope, share, .. } = fit(&[(0.0, 1.0), (1.0, 0.0), (2.0, 1.0), (3.0, 0.0)]);
        assert!((slope + 0.2).abs() < 1e-9 && (share - 0.2).abs() < 1e-9, "{slope} {share}");
    }
}
