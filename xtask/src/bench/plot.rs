//! Bars in groups, as SVG: for the docs.

use std::path::Path;

use plotters::prelude::*;

use super::pairs::Spread;

/// Bars that stand together.
pub struct Group {
    /// What stands below them.
    pub name: String,
    /// A bar for each series, with its ends; `None` leaves its place free.
    pub bars: Vec<Option<Spread>>,
}

const WIDTH: u32 = 1200;
const CHART_HEIGHT: u32 = 320;
/// One a series: Okabe and Ito's, which the colour-blind can tell apart.
const COLOURS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(170, 215, 190),
    RGBColor(0, 114, 178),
    RGBColor(86, 180, 233),
    RGBColor(204, 121, 167),
];

/// Draws one chart below the other; each has a title and groups of bars, one for each of `series`.
pub fn bars(path: &Path, charts: &[(String, Vec<Group>)], series: &[&str]) -> anyhow::Result<()> {
    let root = SVGBackend::new(path, (WIDTH, CHART_HEIGHT * charts.len() as u32)).into_drawing_area();
    let failed = |error: &dyn std::fmt::Display| anyhow::anyhow!("{}: it cannot be drawn: {error}", path.display());
    root.fill(&WHITE).map_err(|e| failed(&e))?;
    for (area, (title, groups)) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
        chart(area, title, groups, series).map_err(|e| failed(&e))?;
    }
    root.present().map_err(|e| failed(&e))
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn chart<'a>(
    area: &Area<'a>,
    title: &str,
    groups: &[Group],
    series: &[&str],
) -> Result<(), Box<dyn std::error::Error + 'a>> {
    let most = groups.iter().flat_map(|group| &group.bars).flatten().fold(0.0, |most, bar| bar.greatest.max(most));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 18))
        .margin(8)
        .x_label_area_size(28)
        .y_label_area_size(48)
        .build_cartesian_2d(0.0..groups.len() as f64, 0.0..1.05 * most)?;
    // Names stand in the middle of their groups, between the marks of a mesh that counts halves.
    let name = |x: &f64| {
        let group = groups.get(*x as usize).filter(|_| (x.fract() - 0.5).abs() < 1e-6);
        group.map_or_else(String::new, |group| group.name.clone())
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .x_labels(2 * groups.len() + 1)
        .x_label_formatter(&name)
        .draw()?;
    let wide = 0.84 / series.len() as f64;
    for (i, (name, colour)) in series.iter().zip(COLOURS).enumerate() {
        let bars = groups.iter().enumerate().filter_map(|(at, group)| {
            let left = at as f64 + 0.08 + i as f64 * wide;
            group
                .bars
                .get(i)?
                .map(|bar| Rectangle::new([(left, 0.0), (left + 0.9 * wide, bar.median)], colour.filled()))
        });
        let key = move |(x, y)| Rectangle::new([(x, y - 5), (x + 10, y + 5)], colour.filled());
        chart.draw_series(bars)?.label(*name).legend(key);
        let whiskers = groups.iter().enumerate().filter_map(|(at, group)| {
            let middle = at as f64 + 0.08 + (i as f64 + 0.45) * wide;
            group.bars.get(i)?.map(|bar| PathElement::new(vec![(middle, bar.least), (middle, bar.greatest)], BLACK))
        });
        chart.draw_series(whiskers)?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .label_font(("sans-serif", 12))
        .draw()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_a_figure() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let group = |name: &str, bars: &[Option<f64>]| Group {
            name: name.to_owned(),
            bars: bars.iter().map(|bar| bar.map(|x| Spread::of([x, 2.0 * x]))).collect(),
        };
        let groups = vec![group("first", &[Some(1.0), Some(2.0)]), group("second", &[None, Some(3.0)])];
        bars(file.path(), &[("speeds".to_owned(), groups)], &["one", "other"]).unwrap();
        let text = std::fs::read_to_string(file.path()).unwrap();
        for word in ["speeds", "first", "second", "one", "other"] {
            assert!(text.contains(&format!("\n{word}\n")), "{word}: {text}");
        }
        // A bar and its key.
        let count = |colour: &str| text.lines().filter(|line| line.contains("<rect") && line.contains(colour)).count();
        assert_eq!((count("#D55E00"), count("#E69F00")), (2, 3), "{text}");
    }
}
