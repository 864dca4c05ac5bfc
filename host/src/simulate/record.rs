//! What is known about simulated renders when they have ended: the record that becomes JSON, CSV and the HTML page.
//!
//! It holds results only, and never how they came about: no clock of this computer, no path. Times are virtual seconds (DESIGN 12),
//! memory and traffic are bytes, shares are fractions from 0 to 1. Time runs from the first tile given out to the last tile finished at its
//! owner; loading and gathering stand beside it.
//!
//! The JSON has the fields of these structs under the same names, in the same order.

use serde::Serialize;

/// All runs of one command: the same scene on the same machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// The scene as it was named on the command line.
    pub scene: String,
    /// The machine model.
    pub machine: String,
    /// The runs, in the order in which they were asked for.
    pub runs: Vec<Run>,
}

impl Report {
    /// The record as indented JSON. A number that is not finite is `null`.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("structs of numbers and strings have a JSON form")
    }
}

/// One simulated render.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Run {
    /// Nodes of the virtual machine.
    pub nodes: u32,
    /// The policy, as `--scheduler` names it.
    pub scheduler: String,
    /// Virtual seconds from the first tile given out to the last tile finished at its owner.
    pub seconds: f64,
    /// Seconds of the one-node run with the same costs and unlimited memory, divided by `seconds`.
    pub speedup: f64,
    /// `speedup / nodes`, 0 to 1 (above 1 where several nodes do less work in all than one).
    pub efficiency: f64,
    /// Busy time over total time, summed over the nodes, 0 to 1: equation 6.2 of the 1995 report.
    pub busy: f64,
    /// Virtual seconds until the pages are in place. Not part of `seconds`.
    pub loading_seconds: f64,
    /// Virtual seconds in which the finished tiles come to the host. Not part of `seconds`.
    pub gathering_seconds: f64,
    /// The longest virtual seconds from one ray's end to the next, anywhere.
    pub longest_gap: f64,
    /// What that is at most (docs/PROGRESS.md).
    pub longest_gap_bound: f64,
    /// The longest virtual seconds in which no node traced.
    pub longest_wait: f64,
    /// What that is at most.
    pub longest_wait_bound: f64,
    /// The longest virtual seconds from asking for a page, or sending rays, to the answer.
    pub longest_round: f64,
    /// What that is at most.
    pub longest_round_bound: f64,
    /// Messages sent by all nodes.
    pub messages: u64,
    /// Bytes sent by all nodes, headers included.
    pub bytes: u64,
    /// Bytes in use at the worst moment of the node that needed most.
    pub memory_high_water: u64,
    /// Bytes that a node may use; `None` is unlimited.
    pub memory_limit: Option<u64>,
    /// Hash of the film, 16 hexadecimal digits: equal for equal pictures.
    pub film: String,
    /// Hash of the event log, hexadecimal: equal for equal schedules.
    pub events: String,
    /// Rays by kind, over all nodes.
    pub rays: Rays,
    /// One entry for each node, by node number.
    pub per_node: Vec<NodeRun>,
    /// Fraction of each interval of the run in which the host worked, 0 to 1: what it took in and sent.
    pub host_busy_intervals: Vec<f32>,
    /// Virtual seconds that one entry of [`NodeRun::busy_intervals`] covers.
    pub interval_seconds: f64,
}

/// Rays of a run. Each of the first three counts a ray once, however often it moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Rays {
    /// Rays from the camera.
    pub primary: u64,
    /// Reflected, refracted and bounce rays.
    pub secondary: u64,
    /// Rays towards lights.
    pub shadow: u64,
    /// Times that a ray was sent from one node to another.
    pub forwarded: u64,
}

/// What one node held and did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NodeRun {
    /// Primitives in the pages that it owns.
    pub primitives: u64,
    /// Pages that it owns.
    pub pages: u64,
    /// Tiles given to it.
    pub tiles: u64,
    /// Rays of its own tiles traced on the spot.
    pub demand_driven: u64,
    /// Rays that arrived from other nodes and were traced here.
    pub data_parallel: u64,
    /// Rays sent on to other nodes.
    pub forwarded: u64,
    /// Pages that it fetched.
    pub fetched_pages: u64,
    /// Virtual seconds in which it worked.
    pub busy_seconds: f64,
    /// Fraction of each interval of the run in which it worked, 0 to 1.
    pub busy_intervals: Vec<f32>,
    /// Messages that it sent.
    pub sent_messages: u64,
    /// Bytes that it sent, headers included.
    pub sent_bytes: u64,
    /// Bytes in use at its worst moment.
    pub memory_high_water: u64,
    /// Its queues. The same names in the same order on every node.
    pub queues: Vec<QueueRun>,
}

/// How full one queue of a node became.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct QueueRun {
    /// What waits in it.
    pub name: String,
    /// Most entries at one time.
    pub high_water: u64,
    /// Entries that it has room for.
    pub limit: u64,
}

#[cfg(test)]
mod tests {
    use crate::simulate::made_up::report;
    use serde_json::Value;

    #[test]
    fn json_has_the_fields_that_are_promised() {
        let mut made = report(13, &[2], &["hybrid"]);
        made.runs[0].busy = f64::NAN;
        let json: Value = serde_json::from_str(&made.to_json()).unwrap();
        let (run, was) = (&json["runs"][0], &made.runs[0]);
        assert_eq!((run["nodes"].as_u64(), run["scheduler"].as_str()), (Some(2), Some("hybrid")));
        for (name, value) in [("seconds", was.seconds), ("speedup", was.speedup), ("efficiency", was.efficiency)] {
            assert_eq!(run[name].as_f64(), Some(value), "{name}");
        }
        for (name, value) in
            [("messages", was.messages), ("bytes", was.bytes), ("memory_high_water", was.memory_high_water)]
        {
            assert_eq!(run[name].as_u64(), Some(value), "{name}");
        }
        assert_eq!(run["film"].as_str(), Some(was.film.as_str()));
        assert!(run["busy"].is_null());
        assert_eq!(run["per_node"][1]["tiles"].as_u64(), Some(was.per_node[1].tiles));
    }
}
