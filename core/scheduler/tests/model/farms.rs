//! The farms that are checked: two and three nodes with the least of everything, so that whatever can be short is.

use crate::farm::{Farm, RayPlan};

fn ray(home: usize, pages: &[usize], children: &[usize]) -> RayPlan {
    RayPlan { home, pages: pages.into(), children: children.into() }
}

/// Room for one of each: pools of one ray, caches of one place beside the lane's, one page under way beside the lane's.
fn farm(nodes: usize, owners: &[usize], rays: Vec<RayPlan>) -> Farm {
    Farm {
        nodes,
        host: false,
        owners: owners.into(),
        rays,
        capacity: 1,
        common: 1,
        room: 1,
        granularity: 1,
        partials: 1,
        requests: 1,
        policy: None,
        shares: 0,
        bug: None,
    }
}

/// Pools that fill with rays for each other's pages; one ray spawns another.
pub fn crossing() -> Farm {
    farm(2, &[0, 1], vec![ray(0, &[1, 0], &[3]), ray(1, &[0, 1], &[]), ray(1, &[0], &[]), ray(0, &[1], &[])])
}

/// More pages than the cache has places, while the lane holds a record.
pub fn contended() -> Farm {
    farm(2, &[0, 1, 1, 1], vec![ray(0, &[1, 2], &[2]), ray(0, &[3, 1], &[]), ray(0, &[2, 3], &[]), ray(1, &[0], &[])])
}

/// Three nodes, each of which needs what the next one has.
pub fn ring() -> Farm {
    farm(3, &[0, 1, 2], vec![ray(0, &[1, 2], &[]), ray(1, &[2], &[]), ray(2, &[0], &[])])
}

/// Pages whose home is the host, where nobody takes rays.
pub fn homeless() -> Farm {
    let rays = vec![ray(0, &[2, 1], &[3]), ray(1, &[3, 0], &[]), ray(1, &[2], &[]), ray(0, &[3], &[])];
    Farm { host: true, ..farm(3, &[0, 1, 2, 2], rays) }
}

/// A node without a tile of its own, with whom the other is told to share, twice.
pub fn shared() -> Farm {
    let rays = vec![ray(0, &[0], &[3]), ray(0, &[0], &[]), ray(0, &[1], &[]), ray(0, &[1], &[])];
    Farm { shares: 2, ..farm(2, &[0, 1], rays) }
}

/// A node that wants three pages of one peer at a time.
pub fn hungry() -> Farm {
    let rays = vec![ray(0, &[1], &[]), ray(0, &[2], &[]), ray(0, &[3], &[])];
    Farm { capacity: 2, common: 2, requests: 2, ..farm(2, &[0, 1, 1, 1], rays) }
}

/// Rays for more pages than places, the lane's included: the lane's page goes when the ray in hand needs another, while a
/// ray of the pool waits for it.
pub fn crowded() -> Farm {
    farm(2, &[0, 1, 1, 1], vec![ray(0, &[1], &[]), ray(0, &[2], &[]), ray(0, &[1, 3], &[]), ray(0, &[3], &[])])
}

/// Some of them with more rays: millions of states.
pub fn large() -> Vec<Farm> {
    let crossing =
        vec![ray(0, &[1, 0], &[4]), ray(0, &[1], &[]), ray(1, &[0, 1], &[]), ray(1, &[0], &[]), ray(0, &[1], &[])];
    let contended = vec![
        ray(0, &[1, 2], &[2, 3]),
        ray(0, &[2, 3], &[]),
        ray(0, &[3, 1], &[]),
        ray(0, &[2], &[]),
        ray(1, &[0, 1], &[]),
    ];
    let ring = vec![ray(0, &[1, 2], &[]), ray(1, &[2, 0], &[]), ray(2, &[0, 1], &[])];
    vec![farm(2, &[0, 1], crossing), farm(2, &[0, 1, 1, 1], contended), farm(3, &[0, 1, 2], ring)]
}

/// Two rays of two nodes with three pages, in every order in which each can need one, two or three of them.
pub fn orders() -> Vec<Farm> {
    let mut lists = Vec::new();
    for a in 0..3 {
        lists.push(vec![a]);
        for b in (0..3).filter(|&b| b != a) {
            lists.push(vec![a, b]);
            lists.push(vec![a, b, 3 - a - b]);
        }
    }
    let pairs = lists.iter().flat_map(|first| lists.iter().map(move |second| (first, second)));
    pairs
        .map(|(first, second)| farm(2, &[0, 1, 1], vec![ray(0, first, &[2]), ray(1, second, &[]), ray(0, second, &[])]))
        .collect()
}
