//! The record as CSV (RFC 4180): one line for each run, or one line for each node of each run, under a line of names.
//!
//! Units are in the names or are those of [`record`](super::record); shares are fractions from 0 to 1. A number that is not finite, and the
//! limit of a run without one, is an empty field. Time lines are only in the JSON.

use super::record::{NodeRun, Report, Run};

/// One line for each run.
pub fn runs(report: &Report) -> String {
    let mut out = String::from(
        "scene,machine,nodes,scheduler,seconds,speedup,efficiency,busy,loading_seconds,gathering_seconds,\
         longest_gap,longest_gap_bound,longest_wait,longest_wait_bound,longest_round,longest_round_bound,messages,bytes,memory_high_water,memory_limit,rays_primary,rays_secondary,rays_shadow,rays_forwarded,film,events\n",
    );
    for run in &report.runs {
        let rays = &run.rays;
        line(
            &mut out,
            [
                text(&report.scene),
                text(&report.machine),
                run.nodes.to_string(),
                text(&run.scheduler),
                real(run.seconds),
                real(run.speedup),
                real(run.efficiency),
                real(run.busy),
                real(run.loading_seconds),
                real(run.gathering_seconds),
                real(run.longest_gap),
                real(run.longest_gap_bound),
                real(run.longest_wait),
                real(run.longest_wait_bound),
                real(run.longest_round),
                real(run.longest_round_bound),
                run.messages.to_string(),
                run.bytes.to_string(),
                run.memory_high_water.to_string(),
                run.memory_limit.map_or_else(String::new, |limit| limit.to_string()),
                rays.primary.to_string(),
                rays.secondary.to_string(),
                rays.shadow.to_string(),
                rays.forwarded.to_string(),
                text(&run.film),
                text(&run.events),
            ],
        );
    }
    out
}

/// One line for each node of each run. `run` counts from 0, as in the JSON. The last columns are the queues, two for each name.
pub fn nodes(report: &Report) -> String {
    let mut queues: Vec<&str> = Vec::new();
    for queue in report.runs.iter().flat_map(|run| &run.per_node).flat_map(|node| &node.queues) {
        if !queues.contains(&queue.name.as_str()) {
            queues.push(&queue.name);
        }
    }
    let mut out = String::from(
        "run,nodes,scheduler,node,primitives,pages,tiles,demand_driven,data_parallel,forwarded,fetched_pages,busy_seconds,\
         sent_messages,sent_bytes,memory_high_water",
    );
    for name in &queues {
        let names = [text(&format!("{name} high_water")), text(&format!("{name} limit"))];
        out += &format!(",{}", names.join(","));
    }
    out.push('\n');
    for (i, run) in report.runs.iter().enumerate() {
        for (number, node) in run.per_node.iter().enumerate() {
            line(&mut out, node_fields(i, run, number, node, &queues));
        }
    }
    out
}

fn node_fields(i: usize, run: &Run, number: usize, node: &NodeRun, queues: &[&str]) -> Vec<String> {
    let mut fields = vec![
        i.to_string(),
        run.nodes.to_string(),
        text(&run.scheduler),
        number.to_string(),
        node.primitives.to_string(),
        node.pages.to_string(),
        node.tiles.to_string(),
        node.demand_driven.to_string(),
        node.data_parallel.to_string(),
        node.forwarded.to_string(),
        node.fetched_pages.to_string(),
        real(node.busy_seconds),
        node.sent_messages.to_string(),
        node.sent_bytes.to_string(),
        node.memory_high_water.to_string(),
    ];
    for name in queues {
        match node.queues.iter().find(|queue| queue.name == *name) {
            Some(queue) => fields.extend([queue.high_water.to_string(), queue.limit.to_string()]),
            None => fields.extend([String::new(), String::new()]),
        }
    }
    fields
}

fn line(out: &mut String, fields: impl IntoIterator<Item = String>) {
    *out += &fields.into_iter().collect::<Vec<_>>().join(",");
    out.push('\n');
}

fn real(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// Quoted where it has to be.
fn text(value: &str) -> String {
    if value.contains([',', '"', '\n', '\r']) { format!("\"{}\"", value.replace('"', "\"\"")) } else { value.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::made_up::{HOSTILE, report};

    /// Reads CSV by the grammar of RFC 4180, character by character.
    fn parse(csv: &str) -> Vec<Vec<String>> {
        let (mut rows, mut row, mut field, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
        let mut rest = csv.chars().peekable();
        while let Some(c) = rest.next() {
            match c {
                '"' if quoted && rest.peek() == Some(&'"') => field.push(rest.next().unwrap()),
                '"' => quoted = !quoted,
                ',' if !quoted => row.push(std::mem::take(&mut field)),
                '\n' if !quoted => {
                    row.push(std::mem::take(&mut field));
                    rows.push(std::mem::take(&mut row));
                }
                c => field.push(c),
            }
        }
        assert!(row.is_empty() && field.is_empty() && !quoted, "an unfinished line");
        rows
    }

    fn column<'a>(rows: &'a [Vec<String>], name: &str) -> Vec<&'a str> {
        let at = rows[0].iter().position(|n| n == name).unwrap_or_else(|| panic!("no column {name}"));
        rows[1..].iter().map(|row| row[at].as_str()).collect()
    }

    #[test]
    fn runs_read_back_as_they_were() {
        let mut made = report(1, &[1, 4, 16], &["hybrid"]);
        made.scene = HOSTILE.into();
        made.runs[1].seconds = f64::NAN;
        made.runs[1].memory_limit = None;
        let rows = parse(&runs(&made));
        assert!(rows.len() == 4 && rows.iter().all(|row| row.len() == 26));
        for (i, run) in made.runs.iter().enumerate() {
            assert_eq!(column(&rows, "scene")[i], HOSTILE);
            assert_eq!(column(&rows, "nodes")[i].parse(), Ok(run.nodes));
            assert_eq!(column(&rows, "scheduler")[i], run.scheduler);
            assert_eq!(column(&rows, "film")[i], run.film);
            assert_eq!(column(&rows, "bytes")[i].parse(), Ok(run.bytes));
            assert_eq!(column(&rows, "rays_forwarded")[i].parse(), Ok(run.rays.forwarded));
            assert_eq!(column(&rows, "gathering_seconds")[i].parse(), Ok(run.gathering_seconds));
            assert_eq!(column(&rows, "longest_gap")[i].parse(), Ok(run.longest_gap));
            assert_eq!(column(&rows, "longest_gap_bound")[i].parse(), Ok(run.longest_gap_bound));
            assert_eq!(column(&rows, "longest_wait")[i].parse(), Ok(run.longest_wait));
            assert_eq!(column(&rows, "longest_wait_bound")[i].parse(), Ok(run.longest_wait_bound));
            assert_eq!(column(&rows, "longest_round")[i].parse(), Ok(run.longest_round));
            assert_eq!(column(&rows, "longest_round_bound")[i].parse(), Ok(run.longest_round_bound));
            assert_eq!(column(&rows, "busy")[i].parse(), Ok(run.busy));
        }
        assert_eq!(column(&rows, "seconds")[0].parse(), Ok(made.runs[0].seconds));
        assert_eq!((column(&rows, "seconds")[1], column(&rows, "memory_limit")[1]), ("", ""));
    }

    #[test]
    fn nodes_read_back_as_they_were() {
        let mut made = report(2, &[3, 5], &["data-parallel"]);
        made.runs[0].per_node[1].queues.remove(0);
        let first = made.runs[0].per_node[0].queues[0].clone();
        let rows = parse(&nodes(&made));
        assert_eq!(rows.len(), 1 + 3 + 5);
        let all: Vec<_> = made.runs.iter().flat_map(|run| &run.per_node).collect();
        for (i, node) in all.iter().enumerate() {
            assert_eq!(column(&rows, "primitives")[i].parse(), Ok(node.primitives));
            assert_eq!(column(&rows, "data_parallel")[i].parse(), Ok(node.data_parallel));
            assert_eq!(column(&rows, "busy_seconds")[i].parse(), Ok(node.busy_seconds));
            assert_eq!(column(&rows, "memory_high_water")[i].parse(), Ok(node.memory_high_water));
        }
        assert_eq!(column(&rows, "node"), ["0", "1", "2", "0", "1", "2", "3", "4"]);
        assert_eq!(column(&rows, "run"), ["0", "0", "0", "1", "1", "1", "1", "1"]);
        let highs = column(&rows, &format!("{} high_water", first.name));
        assert_eq!(highs[..2], [first.high_water.to_string(), String::new()]);
    }
}
