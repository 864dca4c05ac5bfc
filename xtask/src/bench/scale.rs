//! `cargo xtask bench scale`: what more triangles cost.
//!
//! A terrain is drawn twice. As it is, on all cores: times, bytes, and walks of primary and shadow rays together. Then
//! without light, every surface shining by itself, by one node: then a ray is a primary ray, and nothing else.

use clap::Args;

use super::hybray::{Counts, Report};
use super::table::{Figures, Table};
use super::{Bed, Common, Found, write};

/// `cargo xtask bench scale`.
#[derive(Args)]
pub struct Options {
    /// Triangles of the largest terrain; the others have a tenth of the next one's, down to 10,000
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10_000_000,
        value_parser = clap::value_parser!(u32).range(10_000..=20_000_000),
    )]
    pub triangles: u32,
    #[command(flatten)]
    pub common: Common,
}

/// Draws each terrain.
pub fn run(bed: &Bed, options: &Options) -> anyhow::Result<Found> {
    let (least, most, side) =
        if options.common.small { (1_000, 10_000, 64) } else { (10_000, options.triangles, 1024) };
    let mut found = Found { table: Table::default(), wrong: Vec::new() };
    for triangles in sizes(least, most) {
        let scene = format!("terrain:{triangles}");
        eprintln!("{scene}");
        let picture = bed.folder.join("scale.png");
        let lit = bed.hybray.render(&scene, [side; 2], &["--spp", "1"], &picture, None)?;
        let path = bed.folder.join("scale.toml");
        write(&path, &SHINING.replace("SCENE", &scene))?;
        let settings = ["--spp", "1", "--nodes", "1"];
        let shining = bed.hybray.render(&path.display().to_string(), [side; 2], &settings, &picture, None)?;
        if shining.rays.sum() != shining.rays.primary {
            found.wrong.push(format!("{scene}: a surface that shines by itself sends {} rays", shining.rays.sum()));
        }
        found.table.add(figures(&scene, &lit, &shining));
    }
    Ok(found)
}

/// Powers of ten below `most`, times what is left of it: 10,000, 100,000 and so on.
fn sizes(least: u32, most: u32) -> Vec<u32> {
    let mut sizes: Vec<u32> =
        std::iter::successors(Some(most), |&n| Some(n / 10)).take_while(|&n| n >= least.max(1)).collect();
    sizes.reverse();
    sizes
}

/// A material that sends no shadow rays.
const SHINING: &str = r#"
[material.shining]
emission = 0.5
[[include]]
file = "SCENE"
material = "shining"
"#;

fn figures(scene: &str, lit: &Report, shining: &Report) -> Figures {
    let triangles = lit.counts.triangles;
    let each = |sum: f64| format!("{:.1}", sum / triangles as f64).into();
    let seconds = |seconds: f64| format!("{seconds:.3}").into();
    let walked = |report: &Report, of: fn(&Counts) -> u64| {
        format!("{:.3}", of(&report.counts) as f64 / report.rays.sum() as f64).into()
    };
    let peak = lit.memory.peak_bytes_per_primitive;
    vec![
        ("scene", scene.to_owned().into()),
        ("triangles", triangles.into()),
        ("pages", lit.counts.pages.into()),
        ("import, s", seconds(lit.seconds.import)),
        ("build, s", seconds(lit.seconds.build)),
        ("build, ns a triangle", each(lit.seconds.build * 1e9)),
        ("bytes of pages a triangle", each(lit.memory.page_bytes as f64)),
        ("bytes at the peak a triangle", peak.map_or("not known".to_owned(), |bytes| format!("{bytes:.1}")).into()),
        ("trace, s", seconds(lit.seconds.trace)),
        ("rays", lit.rays.sum().into()),
        ("nodes walked a ray", walked(lit, |c| c.walk_nodes)),
        ("blocks walked a ray", walked(lit, |c| c.walk_blocks)),
        ("pages walked a ray", walked(lit, |c| c.walk_pages)),
        ("primary ray, ns", format!("{:.0}", shining.seconds.trace * 1e9 / shining.rays.primary as f64).into()),
        ("nodes walked a primary ray", walked(shining, |c| c.walk_nodes)),
        ("blocks walked a primary ray", walked(shining, |c| c.walk_blocks)),
        ("pages walked a primary ray", walked(shining, |c| c.walk_pages)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_decades() {
        assert_eq!(sizes(10_000, 10_000_000), [10_000, 100_000, 1_000_000, 10_000_000]);
        assert_eq!(sizes(10_000, 10_000), [10_000]);
        assert_eq!(sizes(10_000, 250_000), [25_000, 250_000]);
        assert_eq!(sizes(0, 30), [3, 30]);
    }
}
