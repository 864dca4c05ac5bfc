//! `cargo xtask bench pictures`: Hybray against POV-Ray 3.7 and Tachyon 0.99, in time and in what the pictures show.
//!
//! Both trace what `hybray convert` and `hybray render` make of one scene: one ray through the middle of each pixel, ray
//! depth 5, no cutoff, shadows. Four pictures are compared:
//!
//! - *whole*: the picture that is timed;
//! - *depth 1*: without mirrors, so that every pixel is one hit and its shadow rays;
//! - *silhouettes*: floor, balls and sky each in a colour that no light changes;
//! - *shadows*: every surface white, the lights red, green and blue and a thousand times too bright, so that a channel
//!   says whether its light arrives.
//!
//! The last two are masks, in which a pixel is either right or wrong; their floor is [`PERCENT_MIN`]. They are POV-Ray's and ours:
//! Tachyon draws the whole picture only, and its highlights are not quite the same.

use std::fs;
use std::time::Instant;

use anyhow::Context as _;
use clap::Args;

use super::compare::{Comparison, Pixels};
use super::hybray::Report;
use super::pairs::{Spread, alternate};
use super::table::{Figure, Figures, Table};
use super::{Bed, Common, Found, povray, tachyon, write};

/// How many of a hundred pixels of a mask have to agree.
const PERCENT_MIN: f64 = 99.0;

/// Ray depth of every picture that is timed, for Tachyon.
const DEPTH: u32 = 5;

/// Settings of every picture that is timed.
const SETTINGS: [&str; 6] = ["--spp", "1", "--depth", "5", "--cutoff", "0"];

/// Time of tracing of POV-Ray, and of Tachyon, over ours: what it ought to be at least.
const GOALS: [f64; 2] = [3.5, 7.0];

/// Seconds of a plain Whitted tracer over Embree on two threads, measured once on a machine of the same kind: the next goal.
const EMBREE: [(&str, &str); 2] = [("spd:balls:4", "0.089"), ("spd:balls:5", "0.113")];

/// `cargo xtask bench pictures`.
#[derive(Args)]
pub struct Options {
    /// Threads that trace, in all programs, one number after the other
    #[arg(
        long,
        value_name = "N,..",
        value_delimiter = ',',
        default_values_t = [1, 2],
        value_parser = clap::value_parser!(u16).range(1..=512),
    )]
    pub threads: Vec<u16>,
    /// How often each program draws each scene
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    /// Give each program no more processors than threads that trace, by `taskset`: Hybray's host has a thread besides
    #[arg(long)]
    pub pin: bool,
    #[command(flatten)]
    pub common: Common,
}

/// Why there is nothing to compare with, if so.
pub fn skip() -> Option<String> {
    let how = "neither POV-Ray nor Tachyon is installed; get them with: apt-get install povray tachyon (Debian)";
    (!povray::is_here() && !tachyon::is_here()).then(|| how.to_owned())
}

/// Times and compares each scene.
pub fn run(bed: &Bed, options: &Options) -> anyhow::Result<Found> {
    let mut found = Found { table: Table::default(), wrong: Vec::new() };
    let (scenes, side): (&[&str], u32) =
        if options.common.small { (&["spd:balls:2"], 64) } else { (&["spd:balls:4", "spd:balls:5"], 512) };
    let others = Others { povray: povray::is_here(), tachyon: tachyon::is_here() };
    for (is_here, package) in [(others.povray, "povray"), (others.tachyon, "tachyon")] {
        if !is_here {
            println!("note: {package} is not installed, and left out; get it with: apt-get install {package} (Debian)");
        }
    }
    for scene in scenes {
        for &threads in &options.threads {
            one(bed, options, threads, others, scene, [side; 2], &mut found)?;
        }
    }
    Ok(found)
}

/// The programs that are installed.
#[derive(Clone, Copy)]
struct Others {
    povray: bool,
    tachyon: bool,
}

/// What one round of all programs came to, each with the seconds of its whole command.
struct Round {
    ours: (Report, f64),
    povray: Option<(povray::Statistics, f64)>,
    tachyon: Option<(f64, f64)>,
}

/// What it gives, and the seconds that it took.
fn timed<T>(of: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<(T, f64)> {
    let start = Instant::now();
    let what = of()?;
    Ok((what, start.elapsed().as_secs_f64()))
}

fn one(
    bed: &Bed,
    options: &Options,
    threads: u16,
    others: Others,
    scene: &str,
    size: [u32; 2],
    found: &mut Found,
) -> anyhow::Result<()> {
    let name = scene.replace(':', "-");
    let whole = Subject { bed, pin: options.pin, threads, scene, name, settings: &SETTINGS, size };
    if others.povray {
        whole.convert("pov")?;
    }
    if others.tachyon {
        whole.convert("nff")?;
        let nff = bed.folder.join(whole.file("nff"));
        let nff = fs::read_to_string(&nff).with_context(|| format!("{}: it cannot be read", nff.display()))?;
        write(&bed.folder.join(whole.file("dat")), &tachyon::scene(&nff, size, DEPTH)?)?;
    }
    let rest = || {
        let povray = others.povray.then(|| timed(|| whole.povray())).transpose()?;
        Ok((povray, others.tachyon.then(|| timed(|| whole.tachyon())).transpose()?))
    };
    let rounds = alternate(&format!("{scene}, {threads} threads"), options.runs, || timed(|| whole.ours()), rest)?;
    let rounds: Vec<Round> =
        rounds.into_iter().map(|(ours, (povray, tachyon))| Round { ours, povray, tachyon }).collect();

    // Programs that are not there have no figures.
    let seconds = |of: &dyn Fn(&Round) -> Option<f64>| {
        let all: Option<Vec<f64>> = rounds.iter().map(of).collect();
        all.map_or_else(|| Figure::from("not installed".to_owned()), |all| Spread::of(all).into())
    };
    let goal = |goal: f64, of: &dyn Fn(&Round) -> Option<f64>| -> Figure {
        let all: Option<Vec<f64>> = rounds.iter().map(of).collect();
        let Some(all) = all else { return format!("{goal}").into() };
        format!("{goal} {}", if Spread::of(all).median >= goal { "kept" } else { "missed" }).into()
    };
    let trace = |round: &Round| round.ours.0.seconds.trace;
    let by_povray = |round: &Round| Some(round.povray?.0.trace_seconds / trace(round));
    let by_tachyon = |round: &Round| Some(round.tachyon?.0 / trace(round));
    let embree = EMBREE.iter().find(|(name, _)| *name == scene).map_or("not known", |(_, seconds)| seconds);
    let mut figures: Figures = vec![
        ("scene", scene.to_owned().into()),
        ("threads", u64::from(threads).into()),
        ("hybray, trace s", seconds(&|round| Some(trace(round)))),
        ("hybray, busy s", seconds(&|round| Some(round.ours.0.busy_seconds()))),
        ("hybray, command s", seconds(&|round| Some(round.ours.1))),
        ("povray, trace s", seconds(&|round| Some(round.povray?.0.trace_seconds))),
        ("povray, CPU s", seconds(&|round| Some(round.povray?.0.busy_seconds))),
        ("povray, command s", seconds(&|round| Some(round.povray?.1))),
        ("tachyon, trace s", seconds(&|round| Some(round.tachyon?.0))),
        ("tachyon, command s", seconds(&|round| Some(round.tachyon?.1))),
        ("povray / hybray, trace", seconds(&by_povray)),
        ("it ought to be", goal(GOALS[0], &by_povray)),
        ("tachyon / hybray, trace", seconds(&by_tachyon)),
        ("that ought to be", goal(GOALS[1], &by_tachyon)),
        ("Whitted over Embree, two threads, s", embree.to_owned().into()),
    ];
    if let Some(Round { ours: (ours, _), povray, .. }) = rounds.first() {
        let theirs = |of: fn(&povray::Statistics) -> u64| -> Figure {
            povray.map_or_else(|| "not installed".to_owned().into(), |(statistics, _)| of(&statistics).into())
        };
        figures.push(("hybray, primary rays", ours.rays.primary.into()));
        figures.push(("hybray, mirrored rays", ours.rays.secondary.into()));
        figures.push(("hybray, shadow rays", ours.rays.shadow.into()));
        figures.push(("povray, rays", theirs(|statistics| statistics.rays)));
        figures.push(("povray, shadow rays", theirs(|statistics| statistics.shadow_rays)));
    }
    if others.tachyon {
        let mean = Comparison::of(&whole.read("hybray.png")?, &whole.read("tachyon.png")?.encoded())?.mean;
        figures.push(("tachyon's picture, mean difference of 255", format!("{mean:.3}").into()));
    }
    if others.povray {
        masks(&whole, &mut figures, found)?;
    }
    found.table.add(figures);
    Ok(())
}

/// Compares four pictures with POV-Ray's; the whole one is drawn already.
fn masks(whole: &Subject<'_>, figures: &mut Figures, found: &mut Found) -> anyhow::Result<()> {
    let (bed, scene) = (whole.bed, whole.scene);
    let mut agree = |[share, worst]: [&'static str; 2], is_mask: bool, comparison: &Comparison| {
        let percent = 100.0 * comparison.share();
        if is_mask && percent < PERCENT_MIN {
            let line = format!("{scene}: {share} is {percent:.3}, and ought to be {PERCENT_MIN} at least");
            found.wrong.push(line);
        }
        let (by, x, y) = comparison.worst;
        figures.push((share, format!("{percent:.4}").into()));
        figures.push((worst, format!("{by} at {x} {y}").into()));
    };
    agree(["whole picture agrees, %", "whole picture, worst pixel"], false, &whole.compare()?);
    for (what, kind, text, is_mask) in [
        (["depth 1 agrees, %", "depth 1, worst pixel"], "direct", DIRECT, false),
        (["silhouettes agree, %", "silhouettes, worst pixel"], "silhouettes", SILHOUETTES, true),
        (["shadows agree, %", "shadows, worst pixel"], "shadows", SHADOWS, true),
    ] {
        eprintln!("{scene}: {kind}");
        let name = format!("{}-{kind}", whole.name);
        let path = bed.folder.join(format!("{name}.toml"));
        write(&path, &text.replace("SCENE", scene))?;
        let scene = &path.display().to_string();
        let mask = Subject { scene, name, settings: &SETTINGS[..2], ..*whole };
        mask.convert("pov")?;
        mask.ours()?;
        mask.povray()?;
        agree(what, is_mask, &mask.compare()?);
    }
    Ok(())
}

/// A scene that all programs draw.
struct Subject<'a> {
    bed: &'a Bed,
    pin: bool,
    threads: u16,
    /// As `hybray` takes it.
    scene: &'a str,
    /// What its files are called.
    name: String,
    settings: &'a [&'a str],
    size: [u32; 2],
}

impl Subject<'_> {
    fn file(&self, extension: &str) -> String {
        format!("{}.{extension}", self.name)
    }

    fn convert(&self, extension: &str) -> anyhow::Result<()> {
        self.bed.hybray.convert(self.scene, self.size, &self.bed.folder.join(self.file(extension)))
    }

    fn pin(&self) -> Option<u16> {
        self.pin.then_some(self.threads)
    }

    fn ours(&self) -> anyhow::Result<Report> {
        let nodes = self.threads.to_string();
        let settings = [self.settings, &["--nodes", &nodes]].concat();
        let picture = self.bed.folder.join(self.file("hybray.png"));
        self.bed.hybray.render(self.scene, self.size, &settings, &picture, self.pin())
    }

    fn povray(&self) -> anyhow::Result<povray::Statistics> {
        let (folder, threads) = (self.bed.folder.as_path(), self.threads);
        let (scene, picture) = (&self.file("pov"), &self.file("povray.png"));
        povray::render(&povray::Job { folder, scene, picture, size: self.size, threads, pin: self.pin() })
    }

    fn tachyon(&self) -> anyhow::Result<f64> {
        let (folder, threads) = (self.bed.folder.as_path(), self.threads);
        let (scene, picture) = (&self.file("dat"), &self.file("tachyon.png"));
        tachyon::render(&tachyon::Job { folder, scene, picture, threads, pin: self.pin() })
    }

    fn read(&self, extension: &str) -> anyhow::Result<Pixels> {
        Pixels::read(&self.bed.folder.join(self.file(extension)))
    }

    /// Compares what POV-Ray drew last, and leaves a picture of the differences.
    fn compare(&self) -> anyhow::Result<Comparison> {
        let comparison = Comparison::of(&self.read("hybray.png")?, &self.read("povray.png")?)?;
        comparison.difference.write(&self.bed.folder.join(self.file("difference.png")))?;
        Ok(comparison)
    }
}

/// The scene as it is, without mirrored rays.
const DIRECT: &str = r#"
[settings]
depth = 1
cutoff = 0
[[include]]
file = "SCENE"
"#;

const SILHOUETTES: &str = r#"
[settings]
depth = 1
cutoff = 0
[background]
colour = [0, 0, 1]
[material.floor]
emission = [1, 0, 0]
[material.balls]
emission = [0, 1, 0]
[[include]]
file = "SCENE"
materials = { floor = "floor", balls = "balls" }
"#;

/// The lights stand where the scene's do.
const SHADOWS: &str = r#"
[settings]
depth = 1
cutoff = 0
[[light]]
kind = "point"
position = [4, 3, 2]
colour = [1000, 0, 0]
[[light]]
kind = "point"
position = [1, -4, 4]
colour = [0, 1000, 0]
[[light]]
kind = "point"
position = [-3, 1, 5]
colour = [0, 0, 1000]
[material.white]
diffuse = 1
[[include]]
file = "SCENE"
material = "white"
"#;
