//! Which node owns which page.
//!
//! With as many voxels as nodes, each node owns one: the paper's distribution (report, chapter 3). Otherwise pages are
//! handed out in their order, which follows voxels and, within one, its tree, so that each node gets a piece of space;
//! shares are equal in bytes, to within a page. What a node's memory does not hold goes to those with most room.
//! Node 0 is the host and owns nothing.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What placing needs to know of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacedPage {
    /// Bytes that it takes at a node.
    pub bytes: u32,
    /// Its voxel.
    pub voxel: u32,
}

/// Pages do not fit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "pages of {bytes} bytes do not fit {nodes} nodes with {memory} bytes for pages each; {memory_enough} bytes each would \
     do{}", others(*nodes_enough)
)]
pub struct Misfit {
    /// Bytes of all pages.
    pub bytes: u64,
    /// As asked.
    pub nodes: u16,
    /// As asked: bytes for pages at a node.
    pub memory: u64,
    /// Bytes a node that would do for as many nodes; one less would not.
    pub memory_enough: u64,
    /// Nodes that would do with as much memory; one less would not. `None` if no number does.
    pub nodes_enough: Option<u16>,
}

fn others(nodes: Option<u16>) -> String {
    nodes.map_or_else(String::new, |nodes| format!(", or {nodes} nodes"))
}

/// The owner of each page, from 1 to `nodes`, such that no node owns more than `memory` bytes.
///
/// # Errors
/// [`Misfit`], with figures that would do.
///
/// # Panics
/// If there are no nodes, or a page's voxel is not below `voxels`.
pub fn owners(pages: &[PlacedPage], voxels: u32, nodes: u16, memory: u64) -> Result<Vec<u16>, Misfit> {
    assert!(nodes > 0, "somebody must own pages");
    if let Some(owners) = place(pages, voxels, nodes, memory) {
        return Ok(owners);
    }
    let bytes = pages.iter().map(|page| u64::from(page.bytes)).sum();
    // Between a figure that fails and one that does lies a pair of neighbours of which the first fails and the second
    // does, even if it is not the only such pair.
    let memory_enough = first_between(memory, bytes, |memory| place(pages, voxels, nodes, memory).is_some());
    let enough = |nodes: u64| place(pages, voxels, nodes as u16, memory).is_some();
    let most = u64::from(u16::MAX - 1).min((pages.len() as u64).max(u64::from(voxels)));
    let nodes_enough =
        (most > u64::from(nodes) && enough(most)).then(|| first_between(u64::from(nodes), most, enough) as u16);
    Err(Misfit { bytes, nodes, memory, memory_enough, nodes_enough })
}

/// Bytes of pages that each of `nodes` owns, node 1's first.
#[must_use]
pub fn owned_bytes(pages: &[PlacedPage], owners: &[u16], nodes: u16) -> Vec<u64> {
    let mut owned = vec![0; usize::from(nodes)];
    for (page, &owner) in pages.iter().zip(owners) {
        owned[usize::from(owner) - 1] += u64::from(page.bytes);
    }
    owned
}

/// A number above `fails` up to `does` that does, while the one before it fails (or is `fails`).
pub(super) fn first_between(mut fails: u64, mut does: u64, holds: impl Fn(u64) -> bool) -> u64 {
    while does - fails > 1 {
        let middle = fails + (does - fails) / 2;
        if holds(middle) {
            does = middle;
        } else {
            fails = middle;
        }
    }
    does
}

fn place(pages: &[PlacedPage], voxels: u32, nodes: u16, memory: u64) -> Option<Vec<u16>> {
    let total: u64 = pages.iter().map(|page| u64::from(page.bytes)).sum();
    if u128::from(total) > u128::from(nodes) * u128::from(memory) {
        return None;
    }
    let mut room = vec![memory; usize::from(nodes)];
    let mut owners = vec![0; pages.len()];
    let mut left = Vec::new();
    let mut before = 0;
    for (number, page) in pages.iter().enumerate() {
        assert!(page.voxel < voxels, "page {number} is in no voxel");
        let bytes = u64::from(page.bytes);
        let wanted = if voxels == u32::from(nodes) {
            page.voxel as usize
        } else {
            // The share that the page's middle falls into.
            let middle = u128::from(2 * before + bytes) * u128::from(nodes) / u128::from(2 * total.max(1));
            (middle as usize).min(usize::from(nodes) - 1)
        };
        before += bytes;
        match room[wanted].checked_sub(bytes) {
            Some(rest) => {
                room[wanted] = rest;
                owners[number] = wanted as u16 + 1;
            }
            None => left.push(number),
        }
    }
    if left.is_empty() {
        return Some(owners);
    }
    // The largest first: small ones find room anywhere.
    left.sort_by_key(|&number| Reverse(pages[number].bytes));
    let mut roomy: BinaryHeap<_> = room.iter().enumerate().map(|(node, &room)| (room, Reverse(node))).collect();
    for number in left {
        let (room, Reverse(node)) = roomy.pop()?;
        roomy.push((room.checked_sub(u64::from(pages[number].bytes))?, Reverse(node)));
        owners[number] = node as u16 + 1;
    }
    Some(owners)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) struct Random(pub u64);

    impl Random {
        pub(crate) fn below(&mut self, n: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % n
        }
    }

    /// Pages in the order of their voxels, some of which are empty.
    pub(crate) fn pages(random: &mut Random) -> (Vec<PlacedPage>, u32) {
        let voxels = 1 + random.below(40) as u32;
        let pages_max = 1 + random.below(20);
        let bytes_max = [64, 4096, 65_536][random.below(3) as usize];
        let mut pages = Vec::new();
        for voxel in 0..voxels {
            for _ in 0..random.below(pages_max) {
                pages.push(PlacedPage { bytes: 1 + random.below(bytes_max) as u32, voxel });
            }
        }
        (pages, voxels)
    }

    fn check(pages: &[PlacedPage], owners: &[u16], nodes: u16, memory: u64) -> Vec<u64> {
        assert_eq!(owners.len(), pages.len());
        let mut held = vec![0; usize::from(nodes)];
        for (page, &owner) in pages.iter().zip(owners) {
            assert!((1..=nodes).contains(&owner));
            held[usize::from(owner) - 1] += u64::from(page.bytes);
        }
        assert!(held.iter().all(|&bytes| bytes <= memory), "{held:?} over {memory}");
        held
    }

    /// Every page has an owner and no owner is over its memory; or the figures of the error do, and one less does not.
    #[test]
    fn placed_or_told_what_would_do() {
        let mut told = 0;
        for seed in 0..2000 {
            let random = &mut Random(seed);
            let (pages, voxels) = pages(random);
            let nodes = 1 + random.below(24) as u16;
            let total: u64 = pages.iter().map(|page| u64::from(page.bytes)).sum();
            let memory = random.below(1 + 3 * total / u64::from(nodes));
            match owners(&pages, voxels, nodes, memory) {
                Ok(owners) => drop(check(&pages, &owners, nodes, memory)),
                Err(misfit) => {
                    told += 1;
                    let enough = misfit.memory_enough;
                    assert_eq!((misfit.bytes, misfit.nodes, misfit.memory), (total, nodes, memory), "seed {seed}");
                    assert!(enough > memory, "seed {seed}");
                    let owned = owners(&pages, voxels, nodes, enough).unwrap();
                    check(&pages, &owned, nodes, enough);
                    assert!(owners(&pages, voxels, nodes, enough - 1).is_err(), "seed {seed}");
                    match misfit.nodes_enough {
                        Some(enough) => {
                            assert!(enough > nodes, "seed {seed}");
                            let owned = owners(&pages, voxels, enough, memory).unwrap();
                            check(&pages, &owned, enough, memory);
                            assert!(owners(&pages, voxels, enough - 1, memory).is_err(), "seed {seed}");
                            assert!(misfit.to_string().contains(&format!("or {enough} nodes")));
                        }
                        None => {
                            // Some page is larger than a node.
                            let largest = pages.iter().map(|page| u64::from(page.bytes)).max().unwrap();
                            assert!(largest > memory, "seed {seed}: {misfit}");
                        }
                    }
                }
            }
        }
        assert!((400..1600).contains(&told), "{told} misfits of 2000");
    }

    /// With room enough, shares are equal to within a page, and follow the pages' order.
    #[test]
    fn balanced_to_within_a_page() {
        for seed in 0..500 {
            let random = &mut Random(seed);
            let (pages, voxels) = pages(random);
            let nodes = 1 + random.below(24) as u16;
            let owners = owners(&pages, voxels, nodes, u64::MAX).unwrap();
            let held = check(&pages, &owners, nodes, u64::MAX);
            assert!(owners.is_sorted(), "seed {seed}");
            if voxels == u32::from(nodes) {
                assert!(pages.iter().zip(&owners).all(|(page, &owner)| page.voxel + 1 == u32::from(owner)));
                continue;
            }
            let total: u64 = held.iter().sum();
            let largest = pages.iter().map(|page| u64::from(page.bytes)).max().unwrap_or(0);
            for &bytes in &held {
                let nodes = u64::from(nodes);
                assert!(nodes * bytes <= total + nodes * largest, "seed {seed}: {held:?}");
                assert!(total <= nodes * (bytes + largest), "seed {seed}: {held:?}");
            }
        }
    }

    #[test]
    fn nothing_to_place() {
        assert_eq!(owners(&[], 1, 3, 0), Ok(vec![]));
    }

    #[test]
    fn a_page_that_fits_nowhere() {
        let page = PlacedPage { bytes: 100, voxel: 0 };
        let misfit = owners(&[page], 1, 2, 99).unwrap_err();
        assert_eq!((misfit.memory_enough, misfit.nodes_enough), (100, None));
        assert_eq!(
            misfit.to_string(),
            "pages of 100 bytes do not fit 2 nodes with 99 bytes for pages each; 100 bytes each would do"
        );
    }
}
