//! Who clips for whom? The 1995 report's subhosts (chapter 4, table 6.3).

use hybray_link::{HOST, Peer};

/// Who makes the cliplists of node `me` of `nodes`, if so many of them are subhosts: itself if it is one, else the one that
/// governs it, which is the first of as many nodes as any other governs; with none the host. All are if nothing is said.
#[must_use]
pub fn subhost(me: Peer, nodes: Peer, subhosts: Option<Peer>) -> Peer {
    let (at, nodes) = (u32::from(me.saturating_sub(1)), u32::from(nodes));
    match subhosts.map(u32::from) {
        Some(0) => HOST,
        Some(subhosts) if subhosts < nodes => {
            let group = at * subhosts / nodes;
            (group * nodes).div_ceil(subhosts) as Peer + 1
        }
        _ => me,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    extern crate std;
    use std::vec::Vec;

    #[test]
    fn each_governs_as_many() {
        let all = |nodes, subhosts| (1..=nodes).map(|me| subhost(me, nodes, subhosts)).collect::<Vec<Peer>>();
        assert_eq!(all(4, None), [1, 2, 3, 4]);
        assert_eq!(all(4, Some(4)), [1, 2, 3, 4]);
        assert_eq!(all(4, Some(9)), [1, 2, 3, 4]);
        assert_eq!(all(4, Some(0)), [HOST; 4]);
        assert_eq!(all(4, Some(1)), [1; 4]);
        assert_eq!(all(4, Some(2)), [1, 1, 3, 3]);
        assert_eq!(all(5, Some(2)), [1, 1, 1, 4, 4]);
        for nodes in 1..40 {
            for subhosts in 1..=nodes {
                let all = all(nodes, Some(subhosts));
                let governed = |of: Peer| all.iter().filter(|&&subhost| subhost == of).count() as Peer;
                let mut each: Vec<Peer> = all.clone();
                each.dedup();
                assert_eq!(each.len(), usize::from(subhosts), "{nodes} nodes");
                for of in each {
                    assert_eq!(all[usize::from(of) - 1], of, "a subhost governs itself");
                    assert!((nodes / subhosts..=nodes.div_ceil(subhosts)).contains(&governed(of)), "{nodes}: {all:?}");
                }
            }
        }
        assert_eq!(subhost(4096, 4096, Some(4095)), 4096);
        assert_eq!(subhost(Peer::MAX, Peer::MAX, Some(Peer::MAX - 1)), Peer::MAX);
    }
}
