//! `cargo xtask bench pictures`: Hybray against POV-Ray 3.7, in time and in what the pictures show.
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
//! The last two are masks, in which a pixel is either right or wrong; their floor is [`PERCENT_MIN`].

use clap::Args;

use super::compare::{Comparison, Pixels};
use super::hybray::Report;
use super::pairs::{Spread, alternate};
use super::table::{Figures, Table};
use super::{Bed, Common, Found, povray, write};

/// How many of a hundred pixels of a mask have to agree.
const PERCENT_MIN: f64 = 99.0;

/// Settings of every picture that is timed.
const SETTINGS: [&str; 6] = ["--spp", "1", "--depth", "5", "--cutoff", "0"];

/// `cargo xtask bench pictures`.
#[derive(Args)]
pub struct Options {
    /// Threads that trace, in both programs
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=512))]
    pub threads: u16,
    /// How often each program draws each scene
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub runs: u32,
    /// Give both programs no more processors than threads that trace, by `taskset`: Hybray's host has a thread besides
    #[arg(long)]
    pub pin: bool,
    #[command(flatten)]
    pub common: Common,
}

/// Why there is nothing to compare with, if so.
pub fn skip() -> Option<String> {
    let how = "POV-Ray is not installed; get it with: apt-get install povray (Debian), or from povray.org";
    (!povray::is_here()).then(|| how.to_owned())
}

/// Times and compares each scene.
pub fn run(bed: &Bed, options: &Options) -> anyhow::Result<Found> {
    let mut found = Found { table: Table::default(), wrong: Vec::new() };
    let (scenes, side): (&[&str], u32) =
        if options.common.small { (&["spd:balls:2"], 64) } else { (&["spd:balls:4", "spd:balls:5"], 512) };
    for scene in scenes {
        one(bed, options, scene, [side; 2], &mut found)?;
    }
    Ok(found)
}

fn one(bed: &Bed, options: &Options, scene: &str, size: [u32; 2], found: &mut Found) -> anyhow::Result<()> {
    let whole = Subject { bed, options, scene, name: scene.replace(':', "-"), settings: &SETTINGS, size };
    whole.convert()?;
    let pairs = alternate(scene, options.runs, || whole.ours(), || whole.theirs())?;
    let seconds = |of: &dyn Fn(&Pair) -> f64| Spread::of(pairs.iter().map(of)).into();
    let mut figures: Figures = vec![
        ("scene", scene.to_owned().into()),
        ("threads", u64::from(options.threads).into()),
        ("hybray, trace s", seconds(&|(ours, _)| ours.seconds.trace)),
        ("hybray, busy s", seconds(&|(ours, _)| ours.busy_seconds())),
        ("povray, trace s", seconds(&|(_, theirs)| theirs.trace_seconds)),
        ("povray, CPU s", seconds(&|(_, theirs)| theirs.busy_seconds)),
        ("hybray / povray", seconds(&|(ours, theirs)| ours.seconds.trace / theirs.trace_seconds)),
    ];
    if let Some((ours, theirs)) = pairs.first() {
        figures.push(("hybray, primary rays", ours.rays.primary.into()));
        figures.push(("hybray, mirrored rays", ours.rays.secondary.into()));
        figures.push(("hybray, shadow rays", ours.rays.shadow.into()));
        figures.push(("povray, rays", theirs.rays.into()));
        figures.push(("povray, shadow rays", theirs.shadow_rays.into()));
    }
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
        let mask = Subject { scene, name, settings: &SETTINGS[..2], ..whole };
        mask.convert()?;
        mask.ours()?;
        mask.theirs()?;
        agree(what, is_mask, &mask.compare()?);
    }
    found.table.add(figures);
    Ok(())
}

/// What one run of each came to.
type Pair = (Report, povray::Statistics);

/// A scene that both programs draw.
struct Subject<'a> {
    bed: &'a Bed,
    options: &'a Options,
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

    fn convert(&self) -> anyhow::Result<()> {
        self.bed.hybray.convert(self.scene, self.size, &self.bed.folder.join(self.file("pov")))
    }

    fn pin(&self) -> Option<u16> {
        self.options.pin.then_some(self.options.threads)
    }

    fn ours(&self) -> anyhow::Result<Report> {
        let nodes = self.options.threads.to_string();
        let settings = [self.settings, &["--nodes", &nodes]].concat();
        let picture = self.bed.folder.join(self.file("hybray.png"));
        self.bed.hybray.render(self.scene, self.size, &settings, &picture, self.pin())
    }

    fn theirs(&self) -> anyhow::Result<povray::Statistics> {
        let (folder, threads) = (self.bed.folder.as_path(), self.options.threads);
        let (scene, picture) = (&self.file("pov"), &self.file("povray.png"));
        povray::render(&povray::Job { folder, scene, picture, size: self.size, threads, pin: self.pin() })
    }

    /// Compares what was drawn last, and leaves a picture of the differences.
    fn compare(&self) -> anyhow::Result<Comparison> {
        let read = |extension: &str| Pixels::read(&self.bed.folder.join(self.file(extension)));
        let comparison = Comparison::of(&read("hybray.png")?, &read("povray.png")?)?;
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
