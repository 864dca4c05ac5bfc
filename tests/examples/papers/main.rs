//! The experiments of the two papers on the simulator (DESIGN section 12): writes the tables of `docs/PAPERS.md`.
//!
//! The page is written by hand but for its tables: between `<!-- table NAME -->` and `<!-- end -->` stands what this
//! program put there. Published figures are read from `docs/paper-tables`. Times are virtual, so that the page is the same
//! on every computer; nothing reads a clock but `A-times`, which is made when it is asked for. `cargo xtask papers` runs it.
#![forbid(unsafe_code)]

mod appendix_a;
mod bench;
mod chapter_6;
mod page;
mod pov;
mod published;
mod reach;
mod table;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use clap::Parser;

use bench::Bench;
use published::Published;

#[derive(Parser)]
#[command(name = "papers")]
struct Args {
    /// Print these tables instead of writing the page
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    only: Vec<String>,
    /// Run what takes long, too: 1,024 nodes
    #[arg(long)]
    full: bool,
}

type Block = fn(&Bench, &Published) -> Result<String>;

/// A table of the page.
struct Experiment {
    name: &'static str,
    /// Left as it is on the page unless it is asked for.
    is_long: bool,
    block: Block,
}

const fn table(name: &'static str, block: Block) -> Experiment {
    Experiment { name, is_long: false, block }
}

const EXPERIMENTS: [Experiment; 16] = [
    table("reach", reach::goals),
    Experiment { name: "thousand", is_long: true, block: reach::thousand },
    table("mechanisms", reach::mechanisms),
    table("6.2", chapter_6::criteria),
    table("6.3", chapter_6::subhosts),
    table("6.4", chapter_6::balls),
    table("6.5", chapter_6::teapot),
    table("6.6", chapter_6::light_cache),
    table("6.7", chapter_6::data_parallel),
    table("6.8", chapter_6::reflectivity),
    table("6.9-balls5", chapter_6::balls5),
    table("6.9-conference", chapter_6::conference),
    table("A.9", appendix_a::pyramid_size),
    table("A.11", appendix_a::primitives),
    Experiment { name: "A-times", is_long: true, block: appendix_a::times },
    table("pov", pov::speed_up),
];

fn main() -> Result<ExitCode> {
    let args = Args::parse();
    if let Some(name) = args.only.iter().find(|name| EXPERIMENTS.iter().all(|e| e.name != **name)) {
        let names: Vec<_> = EXPERIMENTS.iter().map(|e| e.name).collect();
        bail!("there is no table {name}: give one of {}", names.join(", "));
    }
    let is_wanted = |e: &&Experiment| {
        if args.only.is_empty() { args.full || !e.is_long } else { args.only.iter().any(|name| name == e.name) }
    };
    let wanted: Vec<_> = EXPERIMENTS.iter().filter(is_wanted).collect();
    let docs = docs();
    let mut bench = Bench::default();
    let blocks = blocks(&mut bench, &Published::read(&docs.join("paper-tables"))?, &wanted)?;
    if args.only.is_empty() {
        write(&docs.join("PAPERS.md"), &blocks)?;
    } else {
        blocks.iter().for_each(|(name, text)| println!("{name}\n\n{text}"));
    }
    let wrong = bench.wrong();
    wrong.iter().for_each(|line| println!("WRONG: {line}"));
    println!("{} runs", bench.len());
    Ok(if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// Each table is made twice: the first time to learn which runs it wants.
fn blocks(bench: &mut Bench, published: &Published, wanted: &[&Experiment]) -> Result<Vec<(&'static str, String)>> {
    for experiment in wanted {
        (experiment.block)(bench, published)?;
    }
    bench.run();
    wanted.iter().map(|e| Ok((e.name, (e.block)(bench, published)?))).collect()
}

fn write(path: &Path, blocks: &[(&'static str, String)]) -> Result<()> {
    let mut text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
    for (name, block) in blocks {
        text = page::replaced(&text, name, block).with_context(|| path.display().to_string())?;
    }
    fs::write(path, text).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every table, with pictures of a few pixels: each run ends, and all runs of a scene draw the same picture.
    #[test]
    fn all_tables_can_be_made() {
        let published = Published::read(&docs().join("paper-tables")).unwrap();
        let wanted: Vec<_> = EXPERIMENTS.iter().filter(|e| !e.is_long).collect();
        let mut bench = Bench::small();
        let blocks = blocks(&mut bench, &published, &wanted).unwrap();
        assert_eq!(bench.wrong(), Vec::<String>::new());
        assert!(bench.len() > 100, "{} runs", bench.len());
        assert!(blocks.iter().all(|(_, text)| text.lines().count() > 3));
    }

    /// The page has a place for every table, and what stands there is this program's, by its head.
    #[test]
    fn the_page_has_all_tables() {
        let text = fs::read_to_string(docs().join("PAPERS.md")).unwrap();
        for experiment in &EXPERIMENTS {
            let with = page::replaced(&text, experiment.name, "| another |").unwrap();
            assert_ne!(with, text, "{}", experiment.name);
        }
    }
}
