//! Which node keeps which pages, when it is known what each node's part of the picture opens ([`super::Pilot`]).
//!
//! A page's owner is the node whose part opened it most, of those that have room. What room a node has beside its own pages
//! goes to copies of pages that its part opened, the most used first, and then to those that all parts together opened most
//! (replicated clusters by importance: report, chapter 8).

use super::{Parts, PlacedPage};
use std::cmp::Reverse;

/// Where pages are when a picture begins.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Placement {
    /// The owner of each page, from 1 on.
    pub owners: Vec<u16>,
    /// Pages of others that each node has from the beginning, node 1's first.
    pub copies: Vec<Vec<u32>>,
}

/// Places `pages`: each node owns `owned_max` bytes of them at most, and has `kept_max` with the copies. `None` if pages
/// do not fit that way: some order of them may.
///
/// # Panics
/// If a part opened a page that there is not.
#[must_use]
pub fn place(pages: &[PlacedPage], parts: &Parts, owned_max: u64, kept_max: u64) -> Option<Placement> {
    let nodes = parts.uses.len();
    let bytes = |page: u32| u64::from(pages[page as usize].bytes);
    let mut owners = vec![0; pages.len()];
    let mut owned = vec![0; nodes];
    let mut own = |owner: &mut u16, node: usize, bytes: u64| {
        let fits = owned[node] + bytes <= owned_max;
        if fits {
            *owner = node as u16 + 1;
            owned[node] += bytes;
        }
        fits
    };
    let mut uses: Vec<_> =
        parts.uses.iter().enumerate().flat_map(|(node, uses)| uses.iter().map(move |&u| (node, u))).collect();
    uses.sort_unstable_by_key(|&(node, (page, count))| (Reverse(count), node, page));
    for &(node, (page, _)) in &uses {
        let owner = &mut owners[page as usize];
        if *owner == 0 {
            own(owner, node, bytes(page));
        }
    }
    // What nobody opened, and what had no room where it was opened: neighbours stay together.
    let mut at = 0;
    for (page, owner) in owners.iter_mut().enumerate().filter(|(_, owner)| **owner == 0) {
        at = (at..at + nodes).map(|node| node % nodes).find(|&node| own(owner, node, bytes(page as u32)))?;
    }
    let mut total = vec![0u64; pages.len()];
    uses.iter().for_each(|&(_, (page, count))| total[page as usize] += u64::from(count));
    let mut all: Vec<u32> = (0..pages.len() as u32).filter(|&page| total[page as usize] > 0).collect();
    all.sort_by_key(|&page| Reverse(total[page as usize]));
    let copies = (0..nodes).map(|node| {
        let mut has: Vec<bool> = owners.iter().map(|&owner| usize::from(owner) == node + 1).collect();
        let mut room = kept_max.saturating_sub(owned[node]);
        let mut own = parts.uses[node].clone();
        own.sort_by_key(|&(_, count)| Reverse(count));
        let wanted = own.iter().map(|&(page, _)| page).chain(all.iter().copied());
        wanted
            .filter(|&page| {
                let takes = !has[page as usize] && bytes(page) <= room;
                if takes {
                    has[page as usize] = true;
                    room -= bytes(page);
                }
                takes
            })
            .collect()
    });
    let copies = copies.collect();
    Some(Placement { owners, copies })
}

#[cfg(test)]
mod tests {
    use super::super::owners::tests::{Random, pages};
    use super::*;

    /// Nobody has too much, or anything twice; and what a part opened most is with it, unless it has no room for it.
    #[test]
    fn placed_within_bounds_and_where_it_is_used() {
        let (mut placed, mut copied) = (0, 0);
        for seed in 0..1000 {
            let random = &mut Random(seed);
            let (pages, _) = pages(random);
            let nodes = 1 + random.below(12) as usize;
            let mut uses = vec![Vec::new(); nodes];
            for uses in &mut uses {
                for page in 0..pages.len() as u32 {
                    if random.below(3) == 0 {
                        uses.push((page, 1 + random.below(50) as u32));
                    }
                }
            }
            let parts = Parts { bounds: Vec::new(), uses };
            let total: u64 = pages.iter().map(|page| u64::from(page.bytes)).sum();
            let largest = pages.iter().map(|page| u64::from(page.bytes)).max().unwrap_or(0);
            let owned_max = total / nodes as u64 + random.below(1 + 2 * largest);
            let kept_max = owned_max + random.below(1 + total);
            let Some(Placement { owners, copies }) = place(&pages, &parts, owned_max, kept_max) else {
                assert!(owned_max < total / nodes as u64 + largest, "seed {seed}: there is room");
                continue;
            };
            placed += 1;
            let bytes = |page: u32| u64::from(pages[page as usize].bytes);
            for node in 0..nodes {
                let owns = |page: &u32| usize::from(owners[*page as usize]) == node + 1;
                let owned: u64 = (0..pages.len() as u32).filter(owns).map(bytes).sum();
                let copied_bytes: u64 = copies[node].iter().map(|&page| bytes(page)).sum();
                assert!(owned <= owned_max && owned + copied_bytes <= kept_max.max(owned), "seed {seed}, node {node}");
                let mut seen = copies[node].clone();
                seen.sort_unstable();
                seen.dedup();
                assert_eq!(seen.len(), copies[node].len(), "seed {seed}: twice");
                assert!(!copies[node].iter().any(owns), "seed {seed}: its own");
                copied += seen.len();
                // What it opened and has not found no room behind what it opened as often or more.
                for &(page, _) in parts.uses[node].iter().filter(|(page, _)| !owns(page) && !seen.contains(page)) {
                    assert!(owned + copied_bytes + bytes(page) > kept_max, "seed {seed}: page {page} would fit");
                }
            }
            for (page, &owner) in (0..).zip(&owners) {
                assert!((1..=nodes as u16).contains(&owner), "seed {seed}");
                let uses_of =
                    |node: usize| parts.uses[node].iter().find(|&&(p, _)| p == page).map_or(0, |&(_, count)| count);
                let most = (0..nodes).map(uses_of).max().unwrap_or(0);
                let here = uses_of(usize::from(owner) - 1);
                // Whoever used it more had no room when its turn came: by the end it has not either.
                let more = (0..nodes).filter(|&node| uses_of(node) > here);
                for node in more {
                    let owned: u64 = (0..pages.len() as u32)
                        .filter(|&p| usize::from(owners[p as usize]) == node + 1)
                        .map(bytes)
                        .sum();
                    assert!(owned + bytes(page) > owned_max, "seed {seed}: page {page}, {here} of {most}");
                }
            }
        }
        assert!(placed > 500 && copied > 5000, "{placed} placed, {copied} copies");
    }
}
