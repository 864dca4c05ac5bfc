//! Which node keeps which pages, when it is known what each node's part of the picture opens ([`super::Pilot`]).
//!
//! A page's owner is the node whose part opened it most, of those that have room. What room a node has beside its own pages
//! goes to copies of pages that its part opened, the most used first, and then to those that all parts together opened most
//! (replicated clusters by importance: report, chapter 8).

use super::{Parts, PlacedPage};
use std::cmp::Reverse;

/// The owner of each page, from 1 on, such that no node owns more than `owned_max` bytes. `None` if pages do not fit that
/// way: some order of them may.
///
/// # Panics
/// If a part opened a page that there is not.
#[must_use]
pub fn owners_by_use(pages: &[PlacedPage], parts: &Parts, owned_max: u64) -> Option<Vec<u16>> {
    let nodes = parts.uses.len();
    let mut owners = vec![0; pages.len()];
    let mut owned = vec![0; nodes];
    let mut own = |owner: &mut u16, node: usize, bytes: u32| {
        let fits = owned[node] + u64::from(bytes) <= owned_max;
        if fits {
            *owner = node as u16 + 1;
            owned[node] += u64::from(bytes);
        }
        fits
    };
    let of_node = |(node, uses): (usize, &Vec<(u32, u32)>)| uses.iter().map(|&u| (node, u)).collect::<Vec<_>>();
    let mut uses: Vec<_> = parts.uses.iter().enumerate().flat_map(of_node).collect();
    uses.sort_unstable_by_key(|&(node, (page, count))| (Reverse(count), node, page));
    for &(node, (page, _)) in &uses {
        let owner = &mut owners[page as usize];
        if *owner == 0 {
            own(owner, node, pages[page as usize].bytes);
        }
    }
    // What nobody opened, and what had no room where it was opened: neighbours stay together.
    let mut at = 0;
    for (page, owner) in pages.iter().zip(&mut owners).filter(|(_, owner)| **owner == 0) {
        at = (at..at + nodes).map(|node| node % nodes).find(|&node| own(owner, node, page.bytes))?;
    }
    Some(owners)
}

/// Pages that each node gets beside its own and those of `before`, up to `most` bytes: node 1's first, the most useful first.
///
/// # Panics
/// If a part opened a page that there is not.
#[must_use]
pub fn copies(pages: &[PlacedPage], parts: &Parts, owners: &[u16], before: &[Vec<u32>], most: u64) -> Vec<Vec<u32>> {
    let mut total = vec![0u64; pages.len()];
    parts.uses.iter().flatten().for_each(|&(page, count)| total[page as usize] += u64::from(count));
    let mut all: Vec<u32> = (0..pages.len() as u32).filter(|&page| total[page as usize] > 0).collect();
    all.sort_by_key(|&page| Reverse(total[page as usize]));
    let of_node = |(node, uses): (usize, &Vec<(u32, u32)>)| {
        let mut has: Vec<bool> = owners.iter().map(|&owner| usize::from(owner) == node + 1).collect();
        before.get(node).into_iter().flatten().for_each(|&page| has[page as usize] = true);
        let mut room = most;
        let mut own = uses.clone();
        own.sort_by_key(|&(_, count)| Reverse(count));
        let takes = |page: &u32| {
            let bytes = u64::from(pages[*page as usize].bytes);
            let takes = !has[*page as usize] && bytes <= room;
            if takes {
                has[*page as usize] = true;
                room -= bytes;
            }
            takes
        };
        own.iter().map(|&(page, _)| page).chain(all.iter().copied()).filter(takes).collect()
    };
    parts.uses.iter().enumerate().map(of_node).collect()
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
            let most = random.below(1 + total);
            let Some(owners) = owners_by_use(&pages, &parts, owned_max) else {
                assert!(owned_max < total / nodes as u64 + largest, "seed {seed}: there is room");
                continue;
            };
            placed += 1;
            let before: Vec<Vec<u32>> = if pages.is_empty() || random.below(2) == 0 {
                Vec::new()
            } else {
                (0..nodes)
                    .map(|_| (0..random.below(3)).map(|_| random.below(pages.len() as u64) as u32).collect())
                    .collect()
            };
            let copies = copies(&pages, &parts, &owners, &before, most);
            let had = |node: usize, page: u32| before.get(node).is_some_and(|before| before.contains(&page));
            let bytes = |page: u32| u64::from(pages[page as usize].bytes);
            for node in 0..nodes {
                let owns = |page: &u32| usize::from(owners[*page as usize]) == node + 1;
                let owned: u64 = (0..pages.len() as u32).filter(owns).map(bytes).sum();
                let copied_bytes: u64 = copies[node].iter().map(|&page| bytes(page)).sum();
                assert!(owned <= owned_max && copied_bytes <= most, "seed {seed}, node {node}");
                assert!(!copies[node].iter().any(|&page| had(node, page)), "seed {seed}: has it");
                let mut seen = copies[node].clone();
                seen.sort_unstable();
                seen.dedup();
                assert_eq!(seen.len(), copies[node].len(), "seed {seed}: twice");
                assert!(!copies[node].iter().any(owns), "seed {seed}: its own");
                copied += seen.len();
                // What it opened and has not found no room behind what it opened as often or more.
                for &(page, _) in
                    parts.uses[node].iter().filter(|(page, _)| !owns(page) && !seen.contains(page) && !had(node, *page))
                {
                    assert!(copied_bytes + bytes(page) > most, "seed {seed}: page {page} would fit");
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
