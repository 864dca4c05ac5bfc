//! How many tiles next? POV||Ray's rule (section 2.1), weighted by what nodes can do.

/// What the rule needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// Tiles not yet given out: W.
    pub tiles: u32,
    /// Nodes that share them: N.
    pub nodes: u32,
    /// Bound on how much longer one job may take than another of the same size: T, 1 or more.
    pub spread: f32,
    /// The asking node's rate over the mean rate: 1 if all are alike.
    pub relative_rate: f32,
    /// Least tiles of a job.
    pub atomic: u32,
}

/// The size of the next job: `W / (1 + T (N - 1))`, times the node's relative rate, but never less than an atomic job
/// nor more than there is.
///
/// With T = 1 the picture is cut into N equal parts; with T towards infinity all jobs are atomic.
#[must_use]
pub fn chunk(s: &Shares) -> u32 {
    let spread = if s.spread >= 1.0 { s.spread } else { 1.0 };
    let ratio = 1.0 / (1.0 + spread * (s.nodes.max(1) - 1) as f32);
    let rate = if s.relative_rate > 0.0 { s.relative_rate } else { 1.0 };
    // A float beyond the integers, or no number, becomes the nearest integer, or 0.
    let wanted = (s.tiles as f32 * ratio * rate) as u32;
    wanted.max(s.atomic).max(1).min(s.tiles)
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    fn check(tiles: u32, nodes: u32, spread: f32, relative_rate: f32, atomic: u32, expected: u32) {
        assert_eq!(chunk(&Shares { tiles, nodes, spread, relative_rate, atomic }), expected);
    }

    #[test]
    fn the_papers_rule() {
        check(640, 1, 2.5, 1.0, 1, 640);
        check(640, 8, 1.0, 1.0, 1, 80);
        check(400, 2, 3.0, 1.0, 1, 100); // figure 4: T = 3, N = 2
        check(300, 2, 3.0, 1.0, 1, 75);
        check(1000, 4, f32::INFINITY, 1.0, 1, 1);
        check(1000, 4, f32::NAN, 1.0, 1, 250);
        check(400, 2, 3.0, 0.5, 1, 50);
        check(400, 2, 3.0, f32::INFINITY, 1, 400);
        check(3, 8, 2.5, 1.0, 4, 3);
        check(100, 8, 2.5, 1.0, 16, 16);
        check(0, 8, 2.5, 1.0, 16, 0);
    }

    /// The paper's promise, played through: if no job takes more than T times as long as another of its size, the nodes
    /// end within one atomic job of each other.
    #[test]
    fn no_imbalance_beyond_one_atomic_job() {
        let spread = 3.0;
        for nodes in [2u32, 5, 38] {
            let cost = |tile: u32| if tile % 7 < 2 { spread } else { 1.0 };
            let (mut at, total) = (0u32, 20_000u32);
            let mut ends: Vec<f32> = (0..nodes).map(|_| 0.0).collect();
            while at < total {
                let first = (0..ends.len()).min_by(|&a, &b| ends[a].total_cmp(&ends[b])).unwrap();
                let shares = Shares { tiles: total - at, nodes, spread, relative_rate: 1.0, atomic: 1 };
                let job = chunk(&shares);
                ends[first] += (at..at + job).map(cost).sum::<f32>();
                at += job;
            }
            let (least, most) = ends.iter().fold((f32::MAX, 0.0f32), |(a, b), &e| (a.min(e), b.max(e)));
            assert!(most - least <= spread, "{nodes} nodes: {least} to {most}");
        }
    }
}
