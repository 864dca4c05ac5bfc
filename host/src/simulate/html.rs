//! The record as one HTML page: a table of the runs, and figures 6.3 to 6.8 of the 1995 report as inline SVG.
//!
//! The page is complete in itself: no script, no other file, no font. It follows the reader's light or dark scheme, prints, and is
//! well-formed XML below its first line. The exact value behind a bar is its `<title>`.

use super::figures::{Figure, of_report, of_run};
use super::record::{Report, Run};
use super::text::{Quantity, count, escape};

const STYLE: &str = include_str!("page.css");

/// The whole page.
pub fn page(report: &Report) -> String {
    let (scene, machine) = (escape(&report.scene), escape(&report.machine));
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
         <title>{scene} on {machine}: hybray simulate</title><style>{STYLE}</style></head><body><main>\
         <header><p class=\"kicker\">hybray simulate</p><h1>{scene} <span>on</span> {machine}</h1>{}</header>\n",
        films(report)
    );
    out += &table(report);
    out += &figures(&of_report(report));
    for (i, run) in report.runs.iter().enumerate() {
        out += &section(i, run);
    }
    out + "</main></body></html>\n"
}

/// Whether all runs drew the same picture.
fn films(report: &Report) -> String {
    let Some(first) = report.runs.first() else { return "<p>No runs.</p>".into() };
    let film = escape(&first.film);
    match report.runs.iter().filter(|run| run.film != first.film).count() {
        0 if report.runs.len() == 1 => format!("<p>Film <code>{film}</code>.</p>"),
        0 => format!("<p>{} runs, one picture: film <code>{film}</code>.</p>", report.runs.len()),
        others => {
            format!(
                "<p class=\"alarm\">The films differ: {others} of {} are not <code>{film}</code>.</p>",
                report.runs.len()
            )
        }
    }
}

fn table(report: &Report) -> String {
    let mut out = String::from(
        "<div class=\"scroll\"><table><thead><tr><th>Nodes</th><th class=\"name\">Scheduler</th><th>Time</th><th>Speed-up</th>\
         <th>Efficiency</th><th>Busy (eq. 6.2)</th><th>Loading</th><th>Gathering</th>\
         <th>Longest without a ray's end</th><th>proved: at most</th><th>Messages</th><th>Bytes</th>\
         <th>Memory</th><th>Rays</th><th>Forwarded</th></tr></thead><tbody>\n",
    );
    for (i, run) in report.runs.iter().enumerate() {
        let rays = run.rays.primary.saturating_add(run.rays.secondary).saturating_add(run.rays.shadow);
        out += &format!(
            "<tr><td>{}</td><td class=\"name\"><a href=\"#run-{i}\">{}</a></td>",
            count(run.nodes.into()),
            escape(&run.scheduler)
        );
        for value in [
            Quantity::Seconds.show(run.seconds),
            Quantity::Ratio.show(run.speedup),
            Quantity::Share.show(run.efficiency),
            Quantity::Share.show(run.busy),
            Quantity::Seconds.show(run.loading_seconds),
            Quantity::Seconds.show(run.gathering_seconds),
            Quantity::Seconds.show(run.longest_gap),
            Quantity::Seconds.show(run.longest_gap_bound),
            count(run.messages),
            Quantity::Bytes.show(run.bytes as f64),
            Quantity::Bytes.show(run.memory_high_water as f64),
            count(rays),
            count(run.rays.forwarded),
        ] {
            out += &format!("<td>{value}</td>");
        }
        out += "</tr>\n";
    }
    out + "</tbody></table></div>\n"
}

fn section(i: usize, run: &Run) -> String {
    let plural = if run.nodes == 1 { "" } else { "s" };
    let mut out = format!(
        "<section id=\"run-{i}\"><h2>{} node{plural}, {}</h2><dl>",
        count(run.nodes.into()),
        escape(&run.scheduler)
    );
    let most = Quantity::Bytes.show(run.memory_high_water as f64);
    let memory = match run.memory_limit {
        Some(limit) => format!("{most} of {}", Quantity::Bytes.show(limit as f64)),
        None => format!("{most}, unlimited"),
    };
    for (name, value) in [
        ("Time", Quantity::Seconds.show(run.seconds)),
        ("Speed-up", Quantity::Ratio.show(run.speedup)),
        ("Efficiency", Quantity::Share.show(run.efficiency)),
        ("Busy", Quantity::Share.show(run.busy)),
        ("Memory, most of any node", memory),
        ("Primary rays", count(run.rays.primary)),
        ("Secondary rays", count(run.rays.secondary)),
        ("Shadow rays", count(run.rays.shadow)),
        ("Times forwarded", count(run.rays.forwarded)),
        ("Pages fetched", count(run.per_node.iter().fold(0u64, |sum, node| sum.saturating_add(node.fetched_pages)))),
    ] {
        out += &format!("<div><dt>{name}</dt><dd>{value}</dd></div>");
    }
    let (film, events) = (escape(&run.film), escape(&run.events));
    out += &format!("</dl><p class=\"hashes\">film <code>{film}</code> · events <code>{events}</code></p>\n");
    out + &figures(&of_run(run)) + "</section>\n"
}

fn figures(figures: &[Figure]) -> String {
    let mut out = String::from("<div class=\"figures\">\n");
    for figure in figures {
        let wide = if figure.wide { " class=\"wide\"" } else { "" };
        out += &format!(
            "<figure{wide}><figcaption><h3>{} <small>{}</small></h3><p>{}</p></figcaption>{}</figure>\n",
            escape(&figure.title),
            figure.source,
            escape(&figure.text),
            figure.svg
        );
    }
    out + "</div>\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::made_up::{HOSTILE, report};
    use roxmltree::{Document, Node};

    /// The page as XML, without its first line.
    fn parse(page: &str) -> Document<'_> {
        let (first, rest) = page.split_once('\n').unwrap();
        assert_eq!(first, "<!DOCTYPE html>");
        Document::parse(rest).unwrap_or_else(|error| panic!("{error}"))
    }

    fn figure<'a>(page: &'a Document, place: &str, title: &str) -> Node<'a, 'a> {
        let within = page.descendants().find(|n| n.attribute("id") == Some(place)).unwrap_or(page.root());
        let caption = |n: &Node| n.tag_name().name() == "h3" && n.text().is_some_and(|text| text.trim() == title);
        let h3 = within.descendants().find(caption).unwrap_or_else(|| panic!("no figure {title}"));
        h3.ancestors().find(|n| n.tag_name().name() == "figure").unwrap()
    }

    /// One side of every bar of a class.
    fn sides(figure: Node, class: &str, side: &str) -> Vec<f64> {
        let class = format!("bars {class}");
        let group = figure.descendants().find(|n| n.attribute("class") == Some(&class)).unwrap();
        let rects = group.children().filter(|n| n.tag_name().name() == "rect");
        rects.map(|rect| rect.attribute(side).unwrap().parse().unwrap()).collect()
    }

    /// Lengths are the values times one factor, which is positive; a value may be off by what two decimals lose.
    fn proportional(lengths: &[f64], values: &[f64]) {
        assert_eq!(lengths.len(), values.len());
        let most = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap();
        let factor = lengths[most] / values[most];
        assert!(lengths[most] > 60.0, "the highest bar is {} high", lengths[most]);
        for (length, value) in lengths.iter().zip(values) {
            assert!((length - value * factor).abs() < 0.02, "{length} for {value}, factor {factor}");
        }
    }

    #[test]
    fn bars_are_as_high_as_their_values() {
        let made = report(3, &[16], &["hybrid"]);
        let run = &made.runs[0];
        let text = page(&made);
        let document = parse(&text);
        let values = |value: fn(&crate::simulate::record::NodeRun) -> u64| -> Vec<f64> {
            run.per_node.iter().map(|node| value(node) as f64).collect()
        };
        let heights = |title, class| sides(figure(&document, "run-0", title), class, "height");
        proportional(&heights("Object distribution per node", "s0"), &values(|n| n.primitives));
        proportional(&heights("Bytes per node", "s3"), &values(|n| n.sent_bytes));
        proportional(&heights("Messages per node", "s3"), &values(|n| n.sent_messages));
        proportional(&heights("Memory per node", "s4"), &values(|n| n.memory_high_water));
        // One scale for all three kinds of rays.
        let rays = ["s0", "s1", "s5"].map(|class| heights("Work per node", class)).concat();
        let counts = [values(|n| n.demand_driven), values(|n| n.data_parallel), values(|n| n.forwarded)].concat();
        proportional(&rays, &counts);
        let busiest = run.per_node.iter().max_by(|a, b| a.busy_seconds.total_cmp(&b.busy_seconds)).unwrap();
        let busy: Vec<f64> = busiest.busy_intervals.iter().map(|f| f64::from(*f)).collect();
        proportional(&heights("Efficiency over time of the busiest node", "s0"), &busy);
        let host: Vec<f64> = run.host_busy_intervals.iter().map(|f| f64::from(*f)).collect();
        let line = figure(&document, "run-0", "Efficiency over time, all nodes");
        let points = line.descendants().find(|n| n.has_tag_name("polyline")).unwrap().attribute("points").unwrap();
        let depths: Vec<f64> = points.split(' ').map(|p| p.split_once(',').unwrap().1.parse().unwrap()).collect();
        // What is higher has less of the picture above it.
        let (top, bottom) =
            (depths.iter().copied().fold(f64::MAX, f64::min), depths.iter().copied().fold(0.0, f64::max));
        let (most, least) = (host.iter().copied().fold(0.0, f64::max), host.iter().copied().fold(1.0, f64::min));
        let expected = host.iter().map(|share| bottom + (top - bottom) * (share - least) / (most - least));
        assert_eq!(depths.len(), host.len());
        assert!(depths.iter().zip(expected).all(|(y, expected)| (y - expected).abs() < 0.02), "the host's line");
        let sums: Vec<f64> =
            (0..busy.len()).map(|t| run.per_node.iter().map(|node| f64::from(node.busy_intervals[t])).sum()).collect();
        proportional(&heights("Efficiency over time, all nodes", "s2"), &sums);
    }

    #[test]
    fn data_parallel_stands_on_demand_driven() {
        let made = report(4, &[8], &["hybrid"]);
        let text = page(&made);
        let document = parse(&text);
        let work = figure(&document, "run-0", "Work per node");
        let (top, high, below) = (sides(work, "s1", "y"), sides(work, "s1", "height"), sides(work, "s0", "y"));
        for i in 0..8 {
            assert!((top[i] + high[i] - below[i]).abs() < 0.02, "node {i}");
        }
    }

    #[test]
    fn queues_are_measured_by_their_limits() {
        let mut made = report(5, &[4], &["hybrid"]);
        made.runs[0].per_node[2].queues[1].high_water = 1024;
        let text = page(&made);
        let document = parse(&text);
        let queues = figure(&document, "run-0", "Queues against their limits");
        let nodes = &made.runs[0].per_node;
        let worst = |q: usize| {
            let shares = nodes.iter().map(|n| n.queues[q].high_water as f64 / n.queues[q].limit as f64);
            shares.fold(0.0, f64::max)
        };
        proportional(&sides(queues, "meter", "width"), &(0..5).map(worst).collect::<Vec<_>>());
        let passed = queues.descendants().filter(|n| n.attribute("class") == Some("passed")).count();
        assert_eq!(passed, 1, "twice its limit");
    }

    #[test]
    fn the_speed_up_lines_go_through_their_points() {
        let made = report(6, &[1, 2, 4, 8, 16, 32], &["hybrid", "data-parallel"]);
        let text = page(&made);
        let document = parse(&text);
        let chart = figure(&document, "", "Speed-up against nodes");
        let line = |class: &str| -> Vec<(f64, f64)> {
            let node = chart
                .descendants()
                .find(|n| n.tag_name().name() == "polyline" && n.attribute("class") == Some(&format!("line {class}")));
            let points = node.unwrap().attribute("points").unwrap().split(' ');
            points.map(|p| p.split_once(',').unwrap()).map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).collect()
        };
        // The ideal line begins at (0, 0) and ends at (32, 32): it gives both scales.
        let ideal = line("ideal dashed");
        let ((x0, y0), (x1, y1)) = (ideal[0], ideal[1]);
        for (class, scheduler) in [("s0", "hybrid"), ("s1", "data-parallel")] {
            let runs = made.runs.iter().filter(|run| run.scheduler == scheduler);
            for ((x, y), run) in line(class).into_iter().zip(runs) {
                assert!((32.0 * (x - x0) / (x1 - x0) - f64::from(run.nodes)).abs() < 0.02);
                assert!((32.0 * (y - y0) / (y1 - y0) - run.speedup).abs() < 0.02);
            }
        }
    }

    #[test]
    fn nothing_but_numbers_is_drawn() {
        let mut made = report(7, &[0, 1, 3], &["hybrid", "data-parallel"]);
        let awkward = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -3.0, 1e300, 0.0];
        for (i, run) in made.runs.iter_mut().enumerate() {
            let value = awkward[i];
            (run.seconds, run.speedup, run.efficiency, run.busy) = (value, value, value, value);
            (run.interval_seconds, run.loading_seconds, run.gathering_seconds) = (value, value, value);
            (run.longest_gap, run.longest_gap_bound, run.host_busy_intervals) = (value, value, vec![value as f32; i]);
            run.memory_limit = [None, Some(0), Some(u64::MAX)][i % 3];
            for node in &mut run.per_node {
                node.busy_seconds = value;
                node.busy_intervals = vec![value as f32; i];
                (node.primitives, node.data_parallel, node.sent_bytes) = (u64::MAX, u64::MAX, u64::MAX);
                node.queues[0].limit = 0;
            }
        }
        let text = page(&made);
        let document = parse(&text);
        for svg in document.descendants().filter(|n| n.tag_name().name() == "svg") {
            for attribute in svg.descendants().flat_map(|n| n.attributes()) {
                let value = attribute.value();
                assert!(!value.contains("NaN") && !value.contains("inf"), "{attribute:?}");
                if matches!(attribute.name(), "x" | "y" | "width" | "height" | "cx" | "cy") {
                    let number: f64 = value.parse().unwrap();
                    assert!((0.0..2000.0).contains(&number), "{attribute:?}");
                }
            }
        }
        assert!(!text.contains("NaN"));
        page(&Report::default());
    }

    #[test]
    fn hostile_names_stay_text() {
        let mut made = report(8, &[2], &[HOSTILE]);
        (made.scene, made.machine) = (HOSTILE.into(), HOSTILE.into());
        let run = &mut made.runs[0];
        (run.film, run.events) = (HOSTILE.into(), HOSTILE.into());
        run.per_node[0].queues[0].name = HOSTILE.into();
        let text = page(&made);
        let document = parse(&text);
        let plain = report(8, &[2], &["hybrid"]);
        let plain = page(&plain);
        let elements =
            |document: &Document, name: &str| document.descendants().filter(|n| n.tag_name().name() == name).count();
        assert_eq!(elements(&document, "script"), 0);
        assert_eq!(elements(&document, "svg"), elements(&parse(&plain), "svg"));
        let h1 = document.descendants().find(|n| n.tag_name().name() == "h1").unwrap();
        let shown = "a,\"b\" </title></svg><script>alert('1')</script>&amp;\u{fffd}";
        assert_eq!(h1.children().next().and_then(|n| n.text()).map(str::trim), Some(shown));
    }

    #[test]
    fn films_that_differ_are_said_first() {
        let mut made = report(9, &[1, 2], &["hybrid"]);
        assert!(!page(&made).contains("class=\"alarm\""));
        made.runs[1].film = "0".into();
        assert!(page(&made).contains("class=\"alarm\""));
    }

    #[test]
    fn thousands_of_nodes_are_a_page() {
        let made = report(10, &[4096], &["hybrid"]);
        let text = page(&made);
        assert!(text.len() < 3_000_000, "{} bytes", text.len());
        let document = parse(&text);
        let heights = sides(figure(&document, "run-0", "Messages per node"), "s3", "height");
        let nodes = &made.runs[0].per_node;
        let means = |chunk: &[crate::simulate::record::NodeRun]| {
            chunk.iter().map(|n| n.sent_messages as f64).sum::<f64>() / chunk.len() as f64
        };
        assert_eq!(heights.len(), 64);
        proportional_below(&heights, &nodes.chunks(64).map(means).collect::<Vec<_>>());
    }

    /// As [`proportional`], where whiskers may be far higher than the bars.
    fn proportional_below(lengths: &[f64], values: &[f64]) {
        let factor = lengths.iter().sum::<f64>() / values.iter().sum::<f64>();
        for (length, value) in lengths.iter().zip(values) {
            assert!((length - value * factor).abs() < 0.02, "{length} for {value}");
        }
    }

    /// `HYBRAY_PAGE=folder cargo test -p hybray --lib pages_to_look_at -- --ignored`
    #[test]
    #[ignore = "writes pages for a person to look at"]
    fn pages_to_look_at() {
        let folder = std::path::PathBuf::from(std::env::var_os("HYBRAY_PAGE").expect("HYBRAY_PAGE names a folder"));
        let both = ["hybrid", "data-parallel"];
        for (name, made) in [
            ("small.html", report(11, &[1, 2, 4, 8, 16, 32], &both)),
            ("large.html", report(12, &[1, 64, 256, 1024, 4096], &["hybrid"])),
        ] {
            std::fs::write(folder.join(name), page(&made)).unwrap();
        }
    }
}
