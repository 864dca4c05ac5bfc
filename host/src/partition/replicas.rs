//! Which pages a node is given in advance, beside its own (report, chapter 8: replicated clusters by importance).

use super::PlacedPage;
use std::cmp::Ordering;

/// For each node, from node 1 on, the pages that it gets in advance beside those it owns, the most useful first.
///
/// A node has `memory` bytes for pages; what its own leave, less `cache` bytes, is filled with pages that it lacks, by
/// `weights`: the expected use of each page. Where not all fit, half of the room goes to the heaviest ones, which every node
/// wants; the other half to pages further down, from a place in the ranking that moves from node to node, so that each
/// of them is near somebody. Among equal weights the same shift decides. A weight that is no number counts as 0.
///
/// # Panics
/// If `owners` and `weights` are not as many as `pages`.
#[must_use]
pub fn replicas(
    pages: &[PlacedPage],
    owners: &[u16],
    nodes: u16,
    memory: u64,
    cache: u64,
    weights: &[f32],
) -> Vec<Vec<u32>> {
    assert_eq!((owners.len(), weights.len()), (pages.len(), pages.len()));
    let weight = |page: u32| if weights[page as usize] > 0.0 { weights[page as usize] } else { 0.0 };
    let mut ranking: Vec<u32> = (0..pages.len() as u32).collect();
    ranking.sort_by(|&a, &b| weight(b).partial_cmp(&weight(a)).unwrap_or(Ordering::Equal).then(a.cmp(&b)));
    let total: u64 = pages.iter().map(|page| u64::from(page.bytes)).sum();
    let mut owned = vec![0u64; usize::from(nodes) + 1];
    for (page, &owner) in pages.iter().zip(owners) {
        owned[usize::from(owner)] += u64::from(page.bytes);
    }
    (1..=nodes)
        .map(|node| {
            let own = owned[usize::from(node)];
            let room = memory.saturating_sub(own).saturating_sub(cache);
            let mut filling = Filling { pages, owners, node, room, taken: Vec::new(), has: vec![false; pages.len()] };
            let shift = |n: usize| n * (usize::from(node) - 1) / usize::from(nodes);
            let fits = total - own <= room;
            let reserved = if fits { 0 } else { room / 2 };
            filling.room -= reserved;
            // One rotated group of equal weights after the other, until one page did not fit.
            let mut ranked = 0;
            'ranking: for group in ranking.chunk_by(|&a, &b| weight(a) == weight(b)) {
                let (before, after) = group.split_at(shift(group.len()));
                for &page in after.iter().chain(before) {
                    if !filling.take(page) && !fits {
                        break 'ranking;
                    }
                }
                ranked += group.len();
            }
            filling.room += reserved;
            let rest = &ranking[ranked..];
            let (before, after) = rest.split_at(shift(rest.len()));
            for &page in after.iter().chain(before) {
                filling.take(page);
            }
            filling.taken
        })
        .collect()
}

/// A node's replicas as they are chosen.
struct Filling<'a> {
    pages: &'a [PlacedPage],
    owners: &'a [u16],
    node: u16,
    room: u64,
    taken: Vec<u32>,
    has: Vec<bool>,
}

impl Filling<'_> {
    /// Takes a page if it is lacking and fits; whether it is there now.
    fn take(&mut self, page: u32) -> bool {
        let number = page as usize;
        if self.has[number] || self.owners[number] == self.node {
            return true;
        }
        let Some(room) = self.room.checked_sub(u64::from(self.pages[number].bytes)) else { return false };
        self.room = room;
        self.taken.push(page);
        self.has[number] = true;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::owners;
    use super::super::owners::tests::{Random, pages};
    use super::*;
    use std::collections::BTreeSet;

    /// No node over its memory less the cache; nothing twice, nothing that it owns; all of it where all fits, and where
    /// not, no page left out that there would have been room for.
    #[test]
    fn within_the_room_and_of_use() {
        for seed in 0..1000 {
            let random = &mut Random(seed);
            let (pages, voxels) = pages(random);
            let nodes = 1 + random.below(12) as u16;
            let total: u64 = pages.iter().map(|page| u64::from(page.bytes)).sum();
            let memory = total / u64::from(nodes) + random.below(1 + total);
            let cache = random.below(1 + memory / 4);
            let Ok(owners) = owners(&pages, voxels, nodes, memory) else { continue };
            let kinds = 1 + random.below(10);
            let mut weights: Vec<f32> = pages.iter().map(|_| random.below(kinds) as f32).collect();
            if let Some(first) = weights.first_mut() {
                *first = f32::NAN;
            }
            let replicas = replicas(&pages, &owners, nodes, memory, cache, &weights);
            assert_eq!(replicas.len(), usize::from(nodes));
            for (node, list) in (1..).zip(&replicas) {
                let has: BTreeSet<u32> = list.iter().copied().collect();
                assert_eq!(has.len(), list.len(), "seed {seed}: nothing twice");
                let sum = |filter: &dyn Fn(u32) -> bool| -> u64 {
                    (0..pages.len() as u32).filter(|&p| filter(p)).map(|p| u64::from(pages[p as usize].bytes)).sum()
                };
                let own = sum(&|p| owners[p as usize] == node);
                let taken = sum(&|p| has.contains(&p));
                assert!(list.iter().all(|&p| owners[p as usize] != node), "seed {seed}: its own");
                assert!(
                    taken == 0 || own + taken + cache <= memory,
                    "seed {seed}: {own} + {taken} + {cache} > {memory}"
                );
                let room = memory.saturating_sub(own + cache) - taken;
                for p in (0..pages.len() as u32).filter(|&p| owners[p as usize] != node && !has.contains(&p)) {
                    assert!(u64::from(pages[p as usize].bytes) > room, "seed {seed}: page {p} would have fitted");
                }
            }
        }
    }

    #[test]
    fn the_heaviest_everywhere_and_the_rest_spread() {
        let pages = [PlacedPage { bytes: 10, voxel: 0 }; 100];
        let owners: Vec<u16> = (0..100).map(|page| page / 25 + 1).collect();
        let weights: Vec<f32> = (0..100).map(|page| page as f32).collect();
        let replicas = replicas(&pages, &owners, 4, 250 + 200 + 7, 7, &weights);
        let mut near: BTreeSet<u32> = BTreeSet::new();
        for (node, list) in (1..).zip(&replicas) {
            assert_eq!(list.len(), 20);
            let heaviest: Vec<u32> = (0..100).rev().filter(|&p| owners[p as usize] != node).take(10).collect();
            assert_eq!(list[..10], heaviest);
            near.extend(&list[10..]);
        }
        assert!(near.len() >= 30, "{near:?}");
    }

    #[test]
    fn equal_weights_are_spread() {
        let pages = [PlacedPage { bytes: 10, voxel: 0 }; 100];
        let owners: Vec<u16> = (0..100).map(|page| page / 25 + 1).collect();
        let replicas = replicas(&pages, &owners, 4, 250 + 250, 0, &[1.0; 100]);
        let held: BTreeSet<u32> = replicas.iter().flatten().copied().collect();
        assert!(replicas.iter().all(|list| list.len() == 25));
        assert!(held.len() >= 75, "{} different pages", held.len());
    }
}
