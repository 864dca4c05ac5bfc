//! Figures 6.3 to 6.8 of the 1995 report for any run, and four more: traffic, queues, memory, efficiency against nodes.
//!
//! More than [`MOST_BARS`] nodes become at most [`MOST_GROUPS`] bars: each is then the mean of a group of neighbours, with a whisker from
//! the least to the most of the group. Time is grouped too, without whiskers.

use super::record::{NodeRun, Report, Run};
use super::svg::{Axis, Bar, Key, Meter, Plot, meters};
use super::text::{Quantity, count, finite};
use std::collections::HashMap;
use std::ops::Range;

/// Nodes that still have a bar each.
const MOST_BARS: usize = 128;
/// Bars with whiskers need more room.
const MOST_GROUPS: usize = 64;
/// More columns than this in an efficiency over time would be thinner than two pixels.
const MOST_INTERVALS: usize = 200;
/// Classes `s0` to `s5` of the style sheet.
const LINE_COLOURS: usize = 6;

const WIDTH: f64 = 528.0;
const HEIGHT: f64 = 270.0;
const WIDE: f64 = 1084.0;
/// Share of a bar's place that is left free.
const GAP: f64 = 0.25;

/// A chart with its words.
pub(super) struct Figure {
    pub title: String,
    /// Where the same is shown in the 1995 report; may be empty.
    pub source: &'static str,
    pub text: String,
    pub svg: String,
    /// Takes the whole width of the page.
    pub wide: bool,
}

/// Neighbouring nodes that share one bar.
struct Group {
    nodes: Range<usize>,
    mean: f64,
    least: f64,
    most: f64,
}

impl Group {
    fn bar(&self, base: f64, top: f64, name: &str, quantity: Quantity) -> Bar {
        let value = quantity.show(self.mean);
        let title = if self.nodes.len() == 1 {
            format!("node {}: {value}{name}", self.nodes.start)
        } else {
            let (least, most) = (quantity.show(self.least), quantity.show(self.most));
            format!("nodes {}–{}: {value}{name} ({least} to {most})", self.nodes.start, self.nodes.end - 1)
        };
        Bar { from: self.nodes.start as f64, to: self.nodes.end as f64, base, top, title }
    }

    fn whisker(&self) -> Option<Bar> {
        let (from, to) = (self.nodes.start as f64, self.nodes.end as f64);
        (self.nodes.len() > 1).then(|| Bar { from, to, base: self.least, top: self.most, title: String::new() })
    }
}

/// Groups of `size` neighbours; the last may be smaller.
fn grouped(values: &[f64], size: usize) -> Vec<Group> {
    let group = |(i, chunk): (usize, &[f64])| Group {
        nodes: i * size..i * size + chunk.len(),
        mean: chunk.iter().sum::<f64>() / chunk.len() as f64,
        least: chunk.iter().copied().fold(f64::INFINITY, f64::min),
        most: chunk.iter().copied().fold(0.0, f64::max),
    };
    values.chunks(size).enumerate().map(group).collect()
}

/// Nodes that share one bar.
fn group_size(nodes: usize) -> usize {
    if nodes <= MOST_BARS { 1 } else { nodes.div_ceil(MOST_GROUPS) }
}

fn of_nodes(run: &Run, value: impl Fn(&NodeRun) -> f64) -> Vec<Group> {
    let values: Vec<f64> = run.per_node.iter().map(|node| finite(value(node))).collect();
    grouped(&values, group_size(values.len()))
}

fn highest(groups: &[Group]) -> f64 {
    groups.iter().map(|group| group.most).fold(0.0, f64::max)
}

/// Said under each chart whose bars are groups.
fn grouping(run: &Run) -> String {
    let size = group_size(run.per_node.len());
    if size > 1 {
        format!(" Each bar is the mean of {size} nodes, its whisker their least and most.")
    } else {
        String::new()
    }
}

/// The figures that compare runs.
pub(super) fn of_report(report: &Report) -> Vec<Figure> {
    if report.runs.is_empty() { Vec::new() } else { vec![speedups(report), efficiencies(report)] }
}

/// The runs of each scheduler by node count, the schedulers in the order of their first run.
fn by_scheduler(report: &Report) -> Vec<(&str, Vec<&Run>)> {
    let mut places = HashMap::new();
    let mut all: Vec<(&str, Vec<&Run>)> = Vec::new();
    for run in &report.runs {
        let place = *places.entry(run.scheduler.as_str()).or_insert_with(|| {
            all.push((&run.scheduler, Vec::new()));
            all.len() - 1
        });
        all[place].1.push(run);
    }
    all.iter_mut().for_each(|(_, runs)| runs.sort_by_key(|run| run.nodes));
    all
}

fn colour(i: usize) -> String {
    format!("s{}", i % LINE_COLOURS)
}

fn speedups(report: &Report) -> Figure {
    let most_nodes = report.runs.iter().map(|run| run.nodes).max().unwrap_or(1).max(1);
    let most = report.runs.iter().map(|run| finite(run.speedup)).fold(f64::from(most_nodes), f64::max);
    let least = report.runs.iter().map(|run| finite(run.speedup)).fold(1.0, f64::min);
    let logarithmic = most_nodes > 64;
    let (x, y) = if logarithmic {
        (Axis::powers_of_two("nodes", 1.0, f64::from(most_nodes)), Axis::powers_of_two("speed-up", least, most))
    } else {
        (Axis::in_nodes("nodes", most_nodes), Axis::in_nodes("speed-up", most.min(1e6).ceil() as u32))
    };
    let schedulers = by_scheduler(report);
    let colours: Vec<String> = (0..schedulers.len()).map(colour).collect();
    let mut legend = vec![(Key::Dashes, "ideal", "ideal")];
    legend.extend(schedulers.iter().zip(&colours).map(|((name, _), class)| (Key::Line, class.as_str(), *name)));
    let mut plot = Plot::new(WIDTH, 330.0, x, y, &legend);
    let from = if logarithmic { 1.0 } else { 0.0 };
    plot.line("ideal dashed", &[(from, from), (f64::from(most_nodes), f64::from(most_nodes))]);
    for ((name, runs), class) in schedulers.iter().zip(&colours) {
        let points: Vec<_> = runs.iter().map(|run| (f64::from(run.nodes), run.speedup)).collect();
        let title = |run: &&Run| format!("{name}, {} nodes: {}", run.nodes, Quantity::Ratio.show(run.speedup));
        plot.line(class, &points);
        plot.marks(class, &runs.iter().map(|run| (f64::from(run.nodes), run.speedup, title(run))).collect::<Vec<_>>());
    }
    let axes = if logarithmic { " Both axes are logarithmic." } else { "" };
    Figure {
        title: "Speed-up against nodes".into(),
        source: "figure 6.8",
        text: format!("Time of one node with unlimited memory over the time of the run.{axes}"),
        svg: plot.finish("Speed-up against nodes, one line for each scheduler"),
        wide: false,
    }
}

fn efficiencies(report: &Report) -> Figure {
    let most_nodes = report.runs.iter().map(|run| run.nodes).max().unwrap_or(1).max(1);
    let most = report.runs.iter().map(|run| finite(run.efficiency).max(finite(run.busy))).fold(1.0, f64::max);
    let x = Axis::powers_of_two("nodes (logarithmic)", 1.0, f64::from(most_nodes));
    let y = Axis::up_to("efficiency", Quantity::Share, most);
    let schedulers = by_scheduler(report);
    let colours: Vec<String> = (0..schedulers.len()).map(colour).collect();
    let mut legend: Vec<_> =
        schedulers.iter().zip(&colours).map(|((name, _), class)| (Key::Line, class.as_str(), *name)).collect();
    legend.push((Key::Dashes, "plain", "busy over total time"));
    let mut plot = Plot::new(WIDTH, 330.0, x, y, &legend);
    for ((name, runs), class) in schedulers.iter().zip(&colours) {
        let points =
            |value: fn(&Run) -> f64| -> Vec<_> { runs.iter().map(|run| (f64::from(run.nodes), value(run))).collect() };
        plot.line(&format!("{class} dashed"), &points(|run| run.busy));
        plot.line(class, &points(|run| run.efficiency));
        let title = |run: &&Run| {
            let (efficiency, busy) = (Quantity::Share.show(run.efficiency), Quantity::Share.show(run.busy));
            format!("{name}, {} nodes: {efficiency}, busy {busy}", run.nodes)
        };
        let marks: Vec<_> = runs.iter().map(|run| (f64::from(run.nodes), run.efficiency, title(run))).collect();
        plot.marks(class, &marks);
    }
    Figure {
        title: "Efficiency against nodes".into(),
        source: "dashed: equation 6.2",
        text: "Speed-up over nodes; dashed, the time in which nodes were busy over the whole time.".into(),
        svg: plot.finish("Efficiency against nodes, one line for each scheduler"),
        wide: false,
    }
}

/// The figures of one run; none for a run without nodes.
pub(super) fn of_run(run: &Run) -> Vec<Figure> {
    let Some(busiest) = by_work(run, |work, best| work > best) else { return Vec::new() };
    let mut figures = vec![
        plain_bars(run, "Object distribution", "figure 6.3, left", "primitives", "s0", Quantity::Count, |node| {
            node.primitives as f64
        }),
        work(run),
    ];
    figures[0].text = format!("Primitives in the pages that each node owns.{}", grouping(run));
    // One node is the sum of all.
    if run.per_node.len() > 1 {
        let idlest = by_work(run, |work, best| work < best).unwrap_or(busiest);
        figures.push(one_node_over_time(run, "the busiest node", busiest));
        figures.push(one_node_over_time(run, "the idlest node", idlest));
    }
    figures.push(sum_over_time(run));
    let sent = |run: &Run, of: &str| format!("{of} that each node sent.{}", grouping(run));
    figures.push(plain_bars(run, "Messages", "traffic", "messages", "s3", Quantity::Count, |n| n.sent_messages as f64));
    figures.push(plain_bars(run, "Bytes", "traffic", "sent", "s3", Quantity::Bytes, |n| n.sent_bytes as f64));
    let traffic = figures.len() - 2;
    figures[traffic].text = sent(run, "Messages");
    figures[traffic + 1].text = sent(run, "Bytes");
    figures.extend(queues(run));
    figures.push(memory(run));
    figures
}

/// The node whose busy time is before all others; the first of equals.
fn by_work(run: &Run, before: fn(f64, f64) -> bool) -> Option<usize> {
    let work = |i: usize| finite(run.per_node[i].busy_seconds);
    (0..run.per_node.len()).reduce(|best, i| if before(work(i), work(best)) { i } else { best })
}

fn plain_bars(
    run: &Run,
    title: &str,
    source: &'static str,
    axis: &str,
    class: &str,
    quantity: Quantity,
    value: fn(&NodeRun) -> f64,
) -> Figure {
    let groups = of_nodes(run, value);
    let y = Axis::up_to(axis, quantity, highest(&groups));
    let mut plot = Plot::new(WIDTH, HEIGHT, Axis::node_numbers(run.per_node.len()), y, &[]);
    let bars: Vec<_> = groups.iter().map(|group| group.bar(0.0, group.mean, "", quantity)).collect();
    plot.bars(class, (0, 1), GAP, &bars);
    plot.whiskers((0, 1), GAP, &groups.iter().filter_map(Group::whisker).collect::<Vec<_>>());
    let svg = plot.finish(&format!("{title} for each node"));
    Figure { title: format!("{title} per node"), source, text: String::new(), svg, wide: false }
}

fn work(run: &Run) -> Figure {
    let own = of_nodes(run, |node| node.demand_driven as f64);
    let arrived = of_nodes(run, |node| node.data_parallel as f64);
    let traced = of_nodes(run, |node| node.demand_driven as f64 + node.data_parallel as f64);
    let forwarded = of_nodes(run, |node| node.forwarded as f64);
    let y = Axis::up_to("rays", Quantity::Count, highest(&traced).max(highest(&forwarded)));
    let legend = [(Key::Bar, "s0", "demand driven"), (Key::Bar, "s1", "data parallel"), (Key::Bar, "s5", "forwarded")];
    let mut plot = Plot::new(WIDTH, HEIGHT, Axis::node_numbers(run.per_node.len()), y, &legend);
    let bars = |groups: &[Group], name: &str| -> Vec<Bar> {
        groups.iter().map(|group| group.bar(0.0, group.mean, name, Quantity::Count)).collect()
    };
    let stacked: Vec<_> = own
        .iter()
        .zip(&arrived)
        .map(|(own, on)| on.bar(own.mean, own.mean + on.mean, " data parallel", Quantity::Count))
        .collect();
    plot.bars("s0", (0, 2), GAP, &bars(&own, " demand driven"));
    plot.bars("s1", (0, 2), GAP, &stacked);
    plot.bars("s5", (1, 2), GAP, &bars(&forwarded, " forwarded"));
    plot.whiskers((0, 2), GAP, &traced.iter().filter_map(Group::whisker).collect::<Vec<_>>());
    plot.whiskers((1, 2), GAP, &forwarded.iter().filter_map(Group::whisker).collect::<Vec<_>>());
    Figure {
        title: "Work per node".into(),
        source: "figures 6.3, right, and 6.6",
        text: format!(
            "Left bars: rays of the node's own tiles traced on the spot, and rays that arrived and were traced. Right bars: rays sent \
             on to another node.{}",
            grouping(run)
        ),
        svg: plot.finish("Rays traced and forwarded by each node"),
        wide: false,
    }
}

/// Efficiency over time from the fractions of the intervals: bars, and a line for those of the host, if there are any.
fn over_time(run: &Run, width: f64, class: &str, fractions: &[f64], host: &[f64], title: &str) -> (String, String) {
    let size = fractions.len().div_ceil(MOST_INTERVALS).max(1);
    let groups = grouped(fractions, size);
    let interval = finite(run.interval_seconds);
    let (length, quantity, axis) =
        if interval > 0.0 { (interval, Quantity::Seconds, "time") } else { (1.0, Quantity::Count, "interval") };
    let x = Axis::until(axis, quantity, length * fractions.len() as f64);
    let y = Axis::up_to("busy", Quantity::Share, highest(&groups).max(1.0));
    let both = [(Key::Bar, class, "nodes"), (Key::Line, "s5", "host")];
    let mut plot = Plot::new(width, HEIGHT, x, y, if host.is_empty() { &[] } else { &both });
    let bar = |group: &Group| {
        let (from, to) = (group.nodes.start as f64 * length, group.nodes.end as f64 * length);
        let shown = if interval > 0.0 { quantity.show(from) } else { format!("interval {}", group.nodes.start) };
        let title = format!("from {shown}: {}", Quantity::Share.show(group.mean));
        Bar { from, to, base: 0.0, top: group.mean, title }
    };
    plot.bars(class, (0, 1), 0.12, &groups.iter().map(bar).collect::<Vec<_>>());
    let middle = |group: &Group| (length * (group.nodes.start + group.nodes.end) as f64 / 2.0, group.mean);
    if !host.is_empty() {
        plot.line("s5", &grouped(host, size).iter().map(middle).collect::<Vec<_>>());
    }
    let note = if interval > 0.0 {
        format!("Each bar is an interval of {}.", Quantity::Seconds.show(interval * size as f64))
    } else {
        "Each bar is an interval of unknown length.".into()
    };
    (plot.finish(title), note)
}

fn one_node_over_time(run: &Run, which: &str, node: usize) -> Figure {
    let fractions: Vec<f64> = run.per_node[node].busy_intervals.iter().map(|f| finite(f64::from(*f))).collect();
    let title = format!("Efficiency over time of {which}");
    let (svg, note) = over_time(run, WIDTH, "s0", &fractions, &[], &title);
    let busy = Quantity::Seconds.show(run.per_node[node].busy_seconds);
    let text = format!("Node {node}, busy for {busy} in all. {note}");
    Figure { title, source: "figure 6.4", text, svg, wide: false }
}

fn sum_over_time(run: &Run) -> Figure {
    let intervals = run.per_node.iter().map(|node| node.busy_intervals.len()).max().unwrap_or(0);
    let mut fractions = vec![0.0; intervals];
    for node in &run.per_node {
        node.busy_intervals.iter().zip(&mut fractions).for_each(|(f, sum)| *sum += finite(f64::from(*f)));
    }
    fractions.iter_mut().for_each(|sum| *sum /= run.per_node.len() as f64);
    let title = "Efficiency over time, all nodes".to_string();
    let host: Vec<f64> = run.host_busy_intervals.iter().map(|f| finite(f64::from(*f))).collect();
    let (svg, note) = over_time(run, WIDE, "s2", &fractions, &host, &title);
    Figure {
        title,
        source: "figures 6.5 and 6.7",
        text: format!(
            "Busy time of all nodes over what they had; the line is the host's, with the messages that it takes in and sends. \
             {note} Loading and gathering are not in it."
        ),
        svg,
        wide: true,
    }
}

/// What the nodes' queues of one name came to.
struct Queue<'a> {
    name: &'a str,
    worst: f64,
    node: usize,
    high_water: u64,
    limit: u64,
    sum: f64,
    nodes: usize,
}

fn queues(run: &Run) -> Option<Figure> {
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut queues: Vec<Queue> = Vec::new();
    for (node, record) in run.per_node.iter().enumerate() {
        for queue in &record.queues {
            // A queue without room that held something has passed its limit.
            let share = match (queue.high_water, queue.limit) {
                (0, _) => 0.0,
                (_, 0) => 2.0,
                (high, limit) => high as f64 / limit as f64,
            };
            let place = *places.entry(&queue.name).or_insert_with(|| {
                queues.push(Queue {
                    name: &queue.name,
                    worst: -1.0,
                    node,
                    high_water: 0,
                    limit: 0,
                    sum: 0.0,
                    nodes: 0,
                });
                queues.len() - 1
            });
            let known = &mut queues[place];
            known.sum += share;
            known.nodes += 1;
            if share > known.worst {
                (known.worst, known.node, known.high_water, known.limit) = (share, node, queue.high_water, queue.limit);
            }
        }
    }
    let row = |queue: &Queue| {
        let value = format!("{} of {}", count(queue.high_water), count(queue.limit));
        let mean = queue.sum / queue.nodes as f64;
        let title = format!("{}: {value} at node {}, mean {}", queue.name, queue.node, Quantity::Share.show(mean));
        Meter { name: queue.name.into(), share: queue.worst, mean, value, title }
    };
    (!queues.is_empty()).then(|| Figure {
        title: "Queues against their limits".into(),
        source: "high-water",
        text:
            "Most entries at one time, at the node that came nearest to its limit; the tick is the mean over the nodes."
                .into(),
        svg: meters(
            (WIDTH, HEIGHT),
            &queues.iter().map(row).collect::<Vec<_>>(),
            "High-water of each queue against its limit",
        ),
        wide: false,
    })
}

fn memory(run: &Run) -> Figure {
    let groups = of_nodes(run, |node| node.memory_high_water as f64);
    let limit = run.memory_limit.map(|limit| limit as f64);
    let y = Axis::up_to("memory", Quantity::Bytes, highest(&groups).max(limit.unwrap_or(0.0)));
    let mut plot = Plot::new(WIDTH, HEIGHT, Axis::node_numbers(run.per_node.len()), y, &[]);
    let bars: Vec<_> = groups.iter().map(|group| group.bar(0.0, group.mean, "", Quantity::Bytes)).collect();
    plot.bars("s4", (0, 1), GAP, &bars);
    plot.whiskers((0, 1), GAP, &groups.iter().filter_map(Group::whisker).collect::<Vec<_>>());
    let budget = match limit {
        Some(limit) => {
            let name = format!("budget {}", Quantity::Bytes.show(limit));
            plot.level(limit, &name);
            format!("The line is the {name}.")
        }
        None => "Memory was not limited.".into(),
    };
    Figure {
        title: "Memory per node".into(),
        source: "high-water",
        text: format!("Bytes in use at the worst moment. {budget}{}", grouping(run)),
        svg: plot.finish("Memory high-water of each node against its budget"),
        wide: false,
    }
}
