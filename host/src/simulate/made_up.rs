//! Records for tests: nobody ran them, a seed made them up.

use super::record::{NodeRun, QueueRun, Rays, Report, Run};

/// A name that tries to break out of CSV, of an attribute and of an element.
pub(super) const HOSTILE: &str = "a,\"b\"\n</title></svg><script>alert('1')</script>&amp;\u{1}";

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e3779b97f4a7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d049bb133111eb);
        (z ^ (z >> 31)) % limit
    }

    fn share(&mut self) -> f64 {
        self.below(1 << 20) as f64 / (1u64 << 20) as f64
    }
}

/// One run of each node count for each scheduler.
pub(super) fn report(seed: u64, nodes: &[u32], schedulers: &[&str]) -> Report {
    println!("seed {seed}");
    let mut random = Random(seed);
    let all = schedulers.iter().flat_map(|name| nodes.iter().map(move |n| (*n, *name)));
    let runs = all.map(|(n, name)| run(&mut random, n, name)).collect();
    Report { scene: "balls".into(), machine: "powerxplorer".into(), runs }
}

fn run(random: &mut Random, nodes: u32, scheduler: &str) -> Run {
    let hybrid = scheduler == "hybrid";
    let efficiency =
        if hybrid { 1.0 / (1.0 + 0.008 * f64::from(nodes)) } else { 1.05 / (0.5 + 0.55 * f64::from(nodes)) };
    let seconds = 62.0 / (efficiency * f64::from(nodes));
    let intervals = 120;
    let per_node: Vec<NodeRun> = (0..nodes).map(|i| node(random, i, nodes, intervals, seconds, hybrid)).collect();
    Run {
        nodes,
        scheduler: scheduler.into(),
        seconds,
        speedup: 62.0 / seconds,
        efficiency,
        busy: per_node.iter().map(|node| node.busy_seconds).sum::<f64>() / f64::from(nodes) / seconds,
        loading_seconds: 1.5 + random.share(),
        gathering_seconds: 0.2 + random.share() / 4.0,
        longest_gap: 0.01 + random.share() / 16.0,
        longest_gap_bound: 1000.0 + random.share(),
        longest_wait: 0.02 + random.share() / 16.0,
        longest_wait_bound: 100.0 + random.share(),
        longest_round: 0.1 + random.share() / 16.0,
        longest_round_bound: 10.0 + random.share(),
        messages: per_node.iter().map(|node| node.sent_messages).sum(),
        bytes: per_node.iter().map(|node| node.sent_bytes).sum(),
        memory_high_water: per_node.iter().map(|node| node.memory_high_water).max().unwrap_or(0),
        memory_limit: Some(32 << 20),
        film: "09f3a1c47be25d60".into(),
        events: format!("{:016x}", random.below(u64::MAX)),
        rays: Rays {
            primary: 65_536,
            secondary: 187_344,
            shadow: 402_118,
            forwarded: per_node.iter().map(|node| node.forwarded).sum(),
        },
        host_busy_intervals: (0..intervals).map(|_| random.share() as f32).collect(),
        interval_seconds: seconds / intervals as f64,
        per_node,
    }
}

fn node(random: &mut Random, i: u32, nodes: u32, intervals: usize, seconds: f64, hybrid: bool) -> NodeRun {
    let share = 1.0 / f64::from(nodes);
    let near = (-(f64::from(i) - f64::from(nodes) * 0.4).powi(2) / (0.03 * f64::from(nodes * nodes).max(30.0))).exp();
    let arrived =
        654_998.0 * share * (0.15 + 1.6 * near) * (0.7 + 0.6 * random.share()) * if nodes > 1 { 0.6 } else { 0.0 };
    let own = if hybrid { (654_998.0 * share - arrived * 0.9).max(0.0) } else { 0.0 };
    let level = if hybrid { 0.93 } else { 0.2 + 0.6 * near };
    let busy_intervals: Vec<f32> = (0..intervals)
        .map(|t| {
            let late = if hybrid && t * 10 > intervals * 9 { 0.45 } else { 1.0 };
            (level * late * (0.8 + 0.26 * random.share())).min(1.0) as f32
        })
        .collect();
    let busy = busy_intervals.iter().map(|f| f64::from(*f)).sum::<f64>() / intervals as f64;
    let messages = (arrived / 12.0) as u64 + 40 + random.below(50);
    NodeRun {
        primitives: (7381.0 * share * (0.3 + 1.4 * random.share())) as u64,
        pages: 1 + random.below(9),
        tiles: if hybrid { 256 / u64::from(nodes) } else { 0 },
        demand_driven: own as u64,
        data_parallel: arrived as u64,
        forwarded: (arrived * (0.3 + 0.5 * random.share())) as u64,
        fetched_pages: random.below(300),
        busy_seconds: busy * seconds,
        busy_intervals,
        sent_messages: messages,
        sent_bytes: messages * 1060,
        memory_high_water: (19 << 20) + random.below(9 << 20),
        queues: [
            ("rays", 4096),
            ("hits", 512),
            ("page requests", 16),
            ("served requests", 64),
            ("contributions", 1024),
        ]
        .map(|(name, limit)| QueueRun { name: name.into(), high_water: random.below(limit) * 9 / 10, limit })
        .into(),
    }
}
