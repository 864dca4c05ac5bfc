//! Appendix A of the 1995 report: figures A.9, A.10 and A.11.
//!
//! What is counted is a function of scene and code, and stands in the page's tables. What a clock says is in a table of its own,
//! made only where it is asked for, with the machine that it was measured on above it; nothing else reads a clock.

mod bintree;
mod grid;
mod measure;

pub use measure::{Job, Measured, measure};

use anyhow::Result;

use crate::bench::Bench;
use crate::published::Published;
use crate::table::Table;
use measure::{Taken, Tally, Way};

/// The appendix's picture.
pub const SIDE: u32 = 512;
/// Its pyramids, side by side.
const PYRAMIDS: [u32; 7] = [2, 4, 8, 16, 32, 64, 128];
/// What it found best: 16 x 16 rays each.
const BEST: u32 = 32;
/// Those that the eight-wide form takes as they are: `RAYS_MAX` rays at most.
const BUNDLES: [u32; 3] = [32, 64, 128];
/// The models of its figure A.9, of a size that it used.
const MODELS: [&str; 2] = ["spd:balls:4", "spd:teapot:12"];
/// The models of its figures A.10 and A.11.
const SIZES: [[&str; 6]; 2] = [
    ["spd:balls:2", "spd:balls:3", "spd:balls:4", "spd:balls:5", "spd:balls:6", "spd:balls:7"],
    ["spd:teapot:2", "spd:teapot:6", "spd:teapot:12", "spd:teapot:32", "spd:teapot:64", "spd:teapot:144"],
];
/// Rounds of what is timed.
const ROUNDS: usize = 3;

fn by_size(scene: &str, rounds: usize) -> Job {
    let mut ways = vec![Way::WideSingle, Way::Single, Way::Grid];
    ways.extend(PYRAMIDS.map(Way::PyraClip));
    ways.extend(BUNDLES.map(Way::WideBundles));
    Job { scene: scene.to_owned(), side: SIDE, ways, rounds }
}

fn by_primitives(scene: &str, rounds: usize) -> Job {
    let ways = vec![Way::WideSingle, Way::Single, Way::Grid, Way::PyraClip(BEST), Way::WideBundles(BEST)];
    Job { scene: scene.to_owned(), side: SIDE, ways, rounds }
}

impl Measured {
    fn taken(&self, way: Way) -> Option<&Taken> {
        self.ways.iter().find(|taken| taken.way == way)
    }

    /// A count for each ray, to two decimals.
    fn per_ray(&self, way: Way, of: fn(&Tally) -> u64) -> String {
        self.cell(way, |taken| format!("{:.2}", of(&taken.tally) as f64 / self.rays as f64))
    }

    /// A count for each pyramid of `side` times `side`, to one decimal.
    fn per_pyramid(&self, way: Way, side: u32, of: fn(&Tally) -> u64) -> String {
        self.cell(way, |taken| format!("{:.1}", of(&taken.tally) as f64 / f64::from(side * side)))
    }

    fn cell(&self, way: Way, of: impl Fn(&Taken) -> String) -> String {
        self.taken(way).map_or_else(|| "–".to_owned(), of)
    }

    /// Time of `way` over that of `other`, median of the rounds; `traversal` leaves out the cliplists of the midpoint tree.
    fn ratio(&self, way: Way, other: Way, traversal: bool) -> Option<f64> {
        let (way, other) = (self.taken(way)?, self.taken(other)?);
        let rounds = way.seconds.iter().zip(&way.clip_seconds).zip(&other.seconds);
        median(rounds.map(|((all, clips), other)| (all - if traversal { *clips } else { 0.0 }) / other).collect())
    }

    /// Seconds of `way`, median of the rounds.
    fn seconds(&self, way: Way, of: fn(&Taken) -> &[f64]) -> Option<f64> {
        median(of(self.taken(way)?).to_vec())
    }
}

fn median(mut figures: Vec<f64>) -> Option<f64> {
    figures.sort_unstable_by(f64::total_cmp);
    let middle = figures.len() / 2;
    let upper = *figures.get(middle)?;
    Some(if figures.len() % 2 == 1 { upper } else { (figures[middle - 1] + upper) / 2.0 })
}

fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(String::from_utf8_lossy).collect();
    groups.join(",")
}

/// Figure A.9 by counts.
pub fn pyramid_size(bench: &Bench, _: &Published) -> Result<String> {
    let mut text = String::new();
    for scene in MODELS {
        let Some(found) = bench.measured(&by_size(scene, 0)) else { continue };
        let mut table = Table::new(&[
            scene,
            "rays each",
            "midpoint: cells clipped a pyramid",
            "cells listed",
            "exits a ray",
            "tests a ray",
            "wide: nodes clipped a bundle",
            "leaves listed",
            "without list, %",
            "nodes a ray",
            "blocks a ray",
        ]);
        for side in PYRAMIDS {
            let (clip, wide) = (Way::PyraClip(side), Way::WideBundles(side));
            let share =
                |taken: &Taken| format!("{:.1}", 100.0 * taken.tally.without_list as f64 / f64::from(side * side));
            table.row(vec![
                format!("{side} x {side}"),
                thousands(found.rays / u64::from(side * side)),
                found.per_pyramid(clip, side, |t| t.clipped),
                found.per_pyramid(clip, side, |t| t.listed),
                found.per_ray(clip, |t| t.steps),
                found.per_ray(clip, |t| t.tests),
                found.per_pyramid(wide, side, |t| t.clipped),
                found.per_pyramid(wide, side, |t| t.listed),
                found.cell(wide, share),
                found.per_ray(wide, |t| t.steps),
                found.per_ray(wide, |t| t.tests),
            ]);
        }
        let row = |name: &str, way: Way, places: [usize; 2]| {
            let mut cells = vec![String::new(); 11];
            name.clone_into(&mut cells[0]);
            cells[places[0]] = found.per_ray(way, |t| t.steps);
            cells[places[1]] = found.per_ray(way, |t| t.tests);
            cells
        };
        table.row(row("single rays, midpoint", Way::Single, [4, 5]));
        table.row(row("grid", Way::Grid, [4, 5]));
        table.row(row("single rays, wide", Way::WideSingle, [9, 10]));
        text += &table.finish();
        text += "\n";
    }
    Ok(text)
}

/// Figures A.10 and A.11 by counts.
pub fn primitives(bench: &Bench, _: &Published) -> Result<String> {
    let mut clips = Table::new(&[
        "scene",
        "primitives",
        "midpoint: cells clipped a pyramid",
        "cells listed",
        "wide: nodes clipped a bundle",
        "leaves listed",
        "without list, %",
    ]);
    let mut walks = Table::new(&[
        "scene",
        "primitives",
        "hits, %",
        "single, midpoint: cells",
        "tests",
        "PyraClip: exits",
        "tests",
        "grid: voxels",
        "tests",
        "single, wide: nodes",
        "blocks",
        "bundles, wide: nodes",
        "blocks",
    ]);
    for scene in SIZES.as_flattened() {
        let Some(found) = bench.measured(&by_primitives(scene, 0)) else { continue };
        let (clip, wide) = (Way::PyraClip(BEST), Way::WideBundles(BEST));
        let share = |taken: &Taken| format!("{:.1}", 100.0 * taken.tally.without_list as f64 / f64::from(BEST * BEST));
        let first = [(*scene).to_owned(), thousands(found.primitives)];
        let mut cells = first.to_vec();
        cells.extend([found.per_pyramid(clip, BEST, |t| t.clipped), found.per_pyramid(clip, BEST, |t| t.listed)]);
        cells.extend([found.per_pyramid(wide, BEST, |t| t.clipped), found.per_pyramid(wide, BEST, |t| t.listed)]);
        cells.push(found.cell(wide, share));
        clips.row(cells);
        let mut cells = first.to_vec();
        cells.push(format!("{:.1}", 100.0 * found.hits as f64 / found.rays as f64));
        for way in [Way::Single, clip, Way::Grid, Way::WideSingle, wide] {
            cells.extend([found.per_ray(way, |t| t.steps), found.per_ray(way, |t| t.tests)]);
        }
        walks.row(cells);
    }
    Ok(format!("Cliplists (figure A.10):\n\n{}\nFor each ray (figure A.11):\n\n{}", clips.finish(), walks.finish()))
}

/// Times, each over that of single rays in the same tree and round.
pub fn times(bench: &Bench, _: &Published) -> Result<String> {
    let figure = |figure: Option<f64>| figure.map_or_else(|| "–".to_owned(), |figure| format!("{figure:.2}"));
    let seconds = |figure: Option<f64>| figure.map_or_else(|| "–".to_owned(), |figure| format!("{figure:.4}"));
    let mut text = format!("Measured on {}, one thread, {ROUNDS} rounds.\n\n", processor());
    let mut columns = vec!["pyramids".to_owned()];
    let sizes: Vec<_> =
        MODELS.iter().filter_map(|scene| Some((scene, bench.measured(&by_size(scene, ROUNDS))?))).collect();
    for (scene, _) in &sizes {
        columns.push(format!("{scene}: cliplists, s"));
        columns.extend(["PyraClip / single", "with cliplists", "bundles / single, wide"].map(str::to_owned));
    }
    let mut table = Table::new(&columns.iter().map(String::as_str).collect::<Vec<_>>());
    for side in PYRAMIDS {
        let mut cells = vec![format!("{side} x {side}")];
        for (_, found) in &sizes {
            let clip = Way::PyraClip(side);
            cells.extend([
                seconds(found.seconds(clip, |taken| &taken.clip_seconds)),
                figure(found.ratio(clip, Way::Single, true)),
                figure(found.ratio(clip, Way::Single, false)),
                figure(found.ratio(Way::WideBundles(side), Way::WideSingle, false)),
            ]);
        }
        table.row(cells);
    }
    text += &format!("By pyramid size (figure A.9):\n\n{}\n", table.finish());
    let mut table = Table::new(&[
        "scene",
        "primitives",
        "cliplists, s",
        "single, midpoint, s",
        "PyraClip / single",
        "with cliplists",
        "grid / single",
        "single, wide, s",
        "bundles / single, wide",
    ]);
    for scene in SIZES.as_flattened() {
        let Some(found) = bench.measured(&by_primitives(scene, ROUNDS)) else { continue };
        let clip = Way::PyraClip(BEST);
        table.row(vec![
            (*scene).to_owned(),
            thousands(found.primitives),
            seconds(found.seconds(clip, |taken| &taken.clip_seconds)),
            seconds(found.seconds(Way::Single, |taken| &taken.seconds)),
            figure(found.ratio(clip, Way::Single, true)),
            figure(found.ratio(clip, Way::Single, false)),
            figure(found.ratio(Way::Grid, Way::Single, false)),
            seconds(found.seconds(Way::WideSingle, |taken| &taken.seconds)),
            figure(found.ratio(Way::WideBundles(BEST), Way::WideSingle, false)),
        ]);
    }
    text +=
        &format!("By number of primitives (figures A.10 and A.11), {BEST} x {BEST} pyramids:\n\n{}", table.finish());
    Ok(text)
}

/// What the system calls its processor.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    name.map_or_else(|| "a processor of unknown name".to_owned(), |(_, name)| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middles_and_digits() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
        assert_eq!([7, 1_234, 5_000_012].map(thousands), ["7", "1,234", "5,000,012"]);
    }
}
