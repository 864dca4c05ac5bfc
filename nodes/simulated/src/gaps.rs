//! How long nothing came of it: the time between two ends of rays, between two turns in which somebody traced, and from
//! asking to the answer.

use hybray_link::Peer;
use hybray_wire::{Message, RayRecord};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// In place of a page: the answer to rays.
const RAYS: u32 = RayRecord::FROM_ROOT;

/// The longest times of a run, virtual nanoseconds. [`Bound`](crate::Bound) says what each is at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Longest {
    /// Between two ends of rays, anywhere: from when the first tile was given out to the last end.
    pub gap_ns: u64,
    /// In which nobody traced, up to the last time that somebody did.
    pub wait_ns: u64,
    /// From when a page was asked for, or rays were sent, until the answer was read.
    pub round_ns: u64,
}

/// What is measured of a run. Times come in as they are reached, but for the ends of turns.
#[derive(Default)]
pub(crate) struct Gaps {
    /// When the last ray ended, or the first tile was given out.
    last_ns: Option<u64>,
    /// Ends of turns in which rays ended, as far as they are to come.
    ends: BinaryHeap<Reverse<u64>>,
    longest: Longest,
    /// Until when somebody has traced.
    traced_ns: u64,
    /// Who asked whom for what, and when.
    open: BTreeMap<(Peer, Peer, u32), u64>,
}

impl Gaps {
    /// The first tile is given out.
    pub fn begin(&mut self, now_ns: u64) {
        self.last_ns.get_or_insert(now_ns);
        self.traced_ns = self.traced_ns.max(now_ns);
    }

    /// Somebody traces from `now_ns` to `end_ns`.
    pub fn traced(&mut self, now_ns: u64, end_ns: u64) {
        self.longest.wait_ns = self.longest.wait_ns.max(now_ns.saturating_sub(self.traced_ns));
        self.traced_ns = self.traced_ns.max(end_ns);
    }

    /// Rays ended in a turn that is over at `end_ns`; it began at `now_ns`, and so will all that come.
    pub fn ended(&mut self, now_ns: u64, end_ns: u64) {
        self.settle(now_ns);
        self.ends.push(Reverse(end_ns));
    }

    fn settle(&mut self, until_ns: u64) {
        while let Some(&Reverse(end_ns)) = self.ends.peek()
            && end_ns <= until_ns
        {
            self.ends.pop();
            let last_ns = self.last_ns.replace(end_ns).unwrap_or(end_ns);
            self.longest.gap_ns = self.longest.gap_ns.max(end_ns.saturating_sub(last_ns));
        }
    }

    /// `me` says something to `to`: it may be a question.
    pub fn said(&mut self, me: Peer, to: Peer, message: &Message, now_ns: u64) {
        let about = match *message {
            Message::Fetch { page } => page,
            Message::Rays { rays, shadows, .. } if rays + shadows > 0 => RAYS,
            _ => return,
        };
        self.open.insert((me, to, about), now_ns);
    }

    /// `me` hears something from `from`: it may be an answer. `bytes` are those of each page.
    pub fn heard(&mut self, me: Peer, from: Peer, message: &Message, pages: &[&[u8]], now_ns: u64) {
        let about = match *message {
            Message::Part { page, offset, bytes } => {
                let all = pages.get(page as usize).map_or(0, |page| page.len());
                if offset as usize + usize::from(bytes) < all {
                    return;
                }
                page
            }
            Message::Took { .. } => RAYS,
            _ => return,
        };
        if let Some(asked_ns) = self.open.remove(&(me, from, about)) {
            self.longest.round_ns = self.longest.round_ns.max(now_ns.saturating_sub(asked_ns));
        }
    }

    /// `me` hears that `peer` is lost: nothing that it was asked is answered.
    pub fn lost(&mut self, me: Peer, peer: Peer) {
        self.open.retain(|&(asker, asked, _), _| (asker, asked) != (me, peer));
    }

    /// What it came to. A question that has not been answered by the end counts as far as it came, unless the asker is gone.
    pub fn end(mut self, now_ns: u64, is_gone: impl Fn(Peer) -> bool) -> Longest {
        self.settle(u64::MAX);
        let open = self.open.iter().filter(|&(&(asker, ..), _)| !is_gone(asker));
        let open = open.map(|(_, asked_ns)| now_ns.saturating_sub(*asked_ns)).max().unwrap_or(0);
        Longest { round_ns: self.longest.round_ns.max(open), ..self.longest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_count_in_the_order_of_time() {
        let mut gaps = Gaps::default();
        gaps.begin(100);
        gaps.begin(500);
        // A long turn, and two short ones that are over before it.
        gaps.ended(110, 1_000);
        gaps.ended(120, 150);
        gaps.ended(400, 420);
        assert_eq!(gaps.end(2_000, |_| false).gap_ns, 580);
    }

    #[test]
    fn nobody_traces_between_turns() {
        let mut gaps = Gaps::default();
        gaps.begin(100);
        gaps.traced(120, 300);
        gaps.traced(150, 160);
        gaps.traced(290, 310);
        gaps.traced(345, 400);
        assert_eq!(gaps.end(9_000, |_| false).wait_ns, 35);
    }

    #[test]
    fn answers_are_those_to_the_question() {
        let page = vec![0; 5000];
        let pages: [&[u8]; 2] = [&page, &page];
        let mut gaps = Gaps::default();
        gaps.said(1, 2, &Message::Fetch { page: 1 }, 10);
        gaps.said(1, 2, &Message::Rays { rays: 0, shadows: 0, load: 0 }, 10);
        gaps.said(1, 3, &Message::Rays { rays: 1, shadows: 0, load: 0 }, 20);
        gaps.heard(1, 2, &Message::Part { page: 0, offset: 4096, bytes: 904 }, &pages, 1_000);
        gaps.heard(1, 2, &Message::Part { page: 1, offset: 0, bytes: 4096 }, &pages, 1_000);
        gaps.heard(3, 1, &Message::Took { taken: true, load: 0 }, &pages, 1_000);
        assert_eq!(gaps.longest.round_ns, 0);
        gaps.heard(1, 2, &Message::Part { page: 1, offset: 4096, bytes: 904 }, &pages, 60);
        assert_eq!(gaps.longest.round_ns, 50);
        gaps.lost(2, 3);
        assert_eq!(gaps.open.len(), 1);
        gaps.heard(1, 3, &Message::Took { taken: true, load: 0 }, &pages, 90);
        assert_eq!((gaps.longest.round_ns, gaps.open.len()), (70, 0));
        gaps.said(1, 3, &Message::Fetch { page: 0 }, 100);
        gaps.said(2, 3, &Message::Fetch { page: 0 }, 50);
        assert_eq!(gaps.end(300, |peer| peer == 2).round_ns, 200);
    }
}
