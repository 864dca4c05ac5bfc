//! When participants worked: busy time by interval.

use hybray_link::Peer;

/// Intervals at most; when a run outlasts them, pairs of them become one, so that a long run has half as many or more.
const INTERVALS: usize = 400;

/// Busy time of all participants, from a moment on. Intervals are as short as they can be for the time that has passed.
pub(crate) struct Meter {
    from_ns: u64,
    interval_ns: u64,
    peers: Vec<Vec<u64>>,
}

impl Meter {
    pub fn new(peers: Peer) -> Self {
        Self { from_ns: u64::MAX, interval_ns: 1_000, peers: vec![Vec::new(); usize::from(peers)] }
    }

    /// Time counts from here, if it did not yet.
    pub fn begin(&mut self, now_ns: u64) {
        self.from_ns = self.from_ns.min(now_ns);
    }

    /// `peer` works from `start_ns` to `end_ns`.
    pub fn work(&mut self, peer: Peer, start_ns: u64, end_ns: u64) {
        if end_ns <= self.from_ns {
            return;
        }
        let mut at = start_ns.saturating_sub(self.from_ns);
        let end = end_ns - self.from_ns;
        while end > self.interval_ns * INTERVALS as u64 {
            self.interval_ns *= 2;
            for busy in &mut self.peers {
                *busy = busy.chunks(2).map(|pair| pair.iter().sum()).collect();
            }
        }
        let busy = &mut self.peers[usize::from(peer)];
        while at < end {
            let interval = (at / self.interval_ns) as usize;
            let until = end.min((interval as u64 + 1) * self.interval_ns);
            if busy.len() <= interval {
                busy.resize(interval + 1, 0);
            }
            busy[interval] += until - at;
            at = until;
        }
    }

    /// Length of an interval, and of each participant its busy time in each of them until `until_ns`. Of the last interval no
    /// more is given than lies before that.
    pub fn end(mut self, until_ns: u64) -> (u64, Vec<Vec<u64>>) {
        let all = until_ns.saturating_sub(self.from_ns);
        let count = all.div_ceil(self.interval_ns) as usize;
        for busy in &mut self.peers {
            busy.resize(count, 0);
            if let Some(last) = busy.last_mut() {
                *last = (*last).min(all - (count as u64 - 1) * self.interval_ns);
            }
        }
        (self.interval_ns, self.peers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_where_it_was_done_however_long_the_run() {
        let mut meter = Meter::new(2);
        meter.work(0, 0, 50);
        meter.begin(100);
        meter.begin(200);
        meter.work(0, 90, 1_600);
        meter.work(1, 1_100, 1_200);
        meter.work(0, 2_100, 2_200);
        let (interval, peers) = meter.end(2_150);
        assert_eq!(interval, 1_000);
        // The last 50 nanoseconds hold no more than 50.
        assert_eq!(peers, [vec![1_000, 500, 50], vec![0, 100, 0]]);

        let mut meter = Meter::new(1);
        meter.begin(0);
        for i in 0..10_000 {
            meter.work(0, i * 1_000, i * 1_000 + 250);
        }
        let (interval, peers) = meter.end(10_000_000);
        assert!((200..=400).contains(&peers[0].len()), "{}", peers[0].len());
        assert!(peers[0][..300].iter().all(|busy| *busy == interval / 4), "{interval}: {peers:?}");
        assert_eq!(peers[0].iter().sum::<u64>(), 2_500_000);
    }
}
