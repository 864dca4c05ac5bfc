//! Budgets: whether pages fit nodes of so much memory, who owns them then, and what would do if they do not.
//!
//! A plan (`core/scheduler/src/plan.rs`) divides one node's memory up; here it is asked about a whole farm, and often
//! enough to say which figure is the least that does. Memory is in bytes.

use super::owners::first_between;
use super::owners::owned_bytes;
use super::{LightCaches, Misfit, Pilot, PlacedPage, copies, light_caches, owners, owners_by_use};
use hybray_scene::PAGE_BYTES_MAX;
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{Plan, PlanError, Sizes, bytes_of_copies};
use hybray_tracer::Scene;

/// Places that a node's page memory has at least, if [`page_bytes_for`] can see to it.
pub const PLACES: u64 = 32;
/// The least page that it chooses.
pub const PAGE_BYTES_MIN: u32 = 4096;
/// Figures of memory that are looked for end here: 1 TiB a node.
const MEMORY_MAX: u64 = 1 << 40;
const KIB: u64 = 1024;
/// What of the memory that a cache could have is for copies of pages that a pilot found to be used: the rest is for what it
/// did not find. Measured on the balls of 66,430 spheres: 1/2 and 3/4 are as good, all of it takes a fifth longer.
const COPIES: (u64, u64) = (3, 4);

/// How large the part of the picture is that a node has which gives the tiles out to so many, beside others': its time goes
/// into messages, some ten to each node. Measured on 32 and on 1,024 nodes.
fn dispatchers_share(nodes: u16) -> f64 {
    1.0 / (1.0 + f64::from(nodes) / 64.0)
}

/// The most bytes of a page for nodes of `memory` bytes: the largest of 64, 32, 16, 8 and 4 KiB of which the node's page
/// memory has at least 32 places; 4 KiB if none is so small. Page memory is what is left when the node has all that it
/// needs for a scene without pages, materials and lights: what those take is known only when the pages are made.
#[must_use]
pub fn page_bytes_for(memory: u64, nodes: u16) -> u32 {
    let nothing = Sizes::default();
    let taken =
        Plan::new(nothing, nodes, memory, None, Policy::default()).map_or(memory, |plan| plan.sum().total_bytes());
    let room = memory.saturating_sub(taken);
    let mut bytes = PAGE_BYTES_MAX as u32;
    while bytes > PAGE_BYTES_MIN && room / u64::from(bytes) < PLACES {
        bytes /= 2;
    }
    bytes
}

/// What is to be fitted: a scene on nodes with a budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// What of the scene takes memory.
    pub sizes: Sizes,
    /// How many nodes.
    pub nodes: u16,
    /// What each of them has.
    pub memory: u64,
    /// What of it is for pages at most, bytes; what there is if it is not given.
    pub page_memory: Option<u64>,
    /// How they work.
    pub policy: Policy,
    /// Whether node 1 gives the tiles out.
    pub first_dispatches: bool,
}

/// A scene that fits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fit {
    /// The owner of each page, from 1 on.
    pub owners: Vec<u16>,
    /// Bytes of pages that each node owns, rounded up to lines: node 1's first.
    pub owned_bytes: Vec<u64>,
    /// What every node is made of.
    pub plan: Plan,
    /// What each node has towards the lights.
    pub light_caches: LightCaches,
    /// Pages that each node has from the beginning beside its own, those towards the lights included: node 1's first; none
    /// where every node has all.
    pub copies: Vec<Vec<u32>>,
    /// Where each node's part of the picture begins, and the last ends; none if all are of as many tiles.
    pub parts: Vec<u32>,
}

impl Fit {
    /// The same with light caches of `bytes`, or such as the policy has ([`light_caches`]).
    ///
    /// # Errors
    /// If there is no room for as many as were asked for.
    fn with_light_caches(self, wanted: &Wanted, bytes: Option<u64>, scene: &Scene<'_>) -> Result<Self, PlanError> {
        let memory = wanted.memory_of(&self.plan);
        let (plan, light_caches) =
            light_caches(self.plan, memory, bytes, wanted.policy, scene, &self.owners, wanted.nodes)?;
        Ok(Self { plan, copies: light_caches.pages.clone(), light_caches, ..self })
    }
}

/// Why it does not.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoFit {
    /// The plan says so.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The owners' search does.
    #[error(transparent)]
    Misfit(#[from] Misfit),
}

impl Wanted {
    /// Finds owners and the plan, without light caches ([`light_caches`](super::light_caches)).
    ///
    /// # Errors
    /// If the budget is too small.
    ///
    /// # Panics
    /// If there are no nodes, or a page's voxel is not below `voxels`.
    pub fn fit(&self, pages: &[PlacedPage], voxels: u32) -> Result<Fit, NoFit> {
        let owners = owners(pages, voxels, self.nodes, self.plan(None)?.owned_bytes_max())?;
        let owned_bytes = owned_bytes(pages, &owners, self.nodes);
        let plan = self.plan(owned_bytes.iter().max().copied())?;
        Ok(Fit {
            owners,
            owned_bytes,
            plan,
            light_caches: LightCaches::default(),
            copies: Vec::new(),
            parts: Vec::new(),
        })
    }

    /// The same for one picture: with light caches of `light_cache` bytes, or such as the policy has; and, where a `pilot` has
    /// been ahead, with pages where the picture needs them.
    ///
    /// # Errors
    /// If the budget is too small, also for as large a light cache as was asked for.
    ///
    /// # Panics
    /// As [`Wanted::fit`].
    pub fn fit_picture(
        &self,
        pages: &[PlacedPage],
        voxels: u32,
        scene: &Scene<'_>,
        light_cache: Option<u64>,
        pilot: Option<&Pilot>,
    ) -> Result<Fit, NoFit> {
        let mut fit = self.fit(pages, voxels)?;
        // Who asks for voxels wants each node to have its own.
        let Some(pilot) = pilot.filter(|_| voxels == 1) else {
            return Ok(fit.with_light_caches(self, light_cache, scene)?);
        };
        let parts = pilot.parts(self.nodes, if self.first_dispatches { dispatchers_share(self.nodes) } else { 1.0 });
        let owned_max = self.sizes.even_share(self.nodes).min(self.plan(None)?.owned_bytes_max());
        if let Some(owners) = owners_by_use(pages, &parts, owned_max).filter(|_| !fit.plan.holds_all) {
            let owned_bytes = owned_bytes(pages, &owners, self.nodes);
            let plan = self.plan(owned_bytes.iter().max().copied())?;
            fit = Fit { owners, owned_bytes, plan, ..fit };
        }
        let base = fit.plan;
        let memory = self.memory_of(&base);
        fit = fit.with_light_caches(self, light_cache, scene)?;
        if !fit.plan.holds_all {
            let most = fit.plan.room_for_copies(memory) / COPIES.1 * COPIES.0;
            let copies = copies(pages, &parts, &fit.owners, &fit.copies, most);
            fit.copies.resize(usize::from(self.nodes), Vec::new());
            fit.copies.iter_mut().zip(copies).for_each(|(all, more)| all.extend(more));
            fit.plan = base.with_copies(bytes_of_copies(scene.resident.directory.entries, &fit.copies), memory)?;
        }
        Ok(Fit { parts: parts.bounds, ..fit })
    }

    /// What a node of this plan may take in all: no more than now where page memory is limited.
    fn memory_of(&self, plan: &Plan) -> u64 {
        self.page_memory.map_or(self.memory, |_| plan.sum().total_bytes())
    }

    /// Whole KiB for each of so many nodes that do, such that one KiB less does not; `None` if a TiB does not.
    #[must_use]
    pub fn least_memory(&self) -> Option<u64> {
        let does = |kib: u64| Self { memory: kib * KIB, ..*self }.plan(None).is_ok();
        does(MEMORY_MAX / KIB).then(|| first_between(0, MEMORY_MAX / KIB, does) * KIB)
    }

    /// Nodes of so much memory that do, up to `most`, such that one less does not; `None` if none are found: what a node
    /// knows of its peers grows with their number.
    #[must_use]
    pub fn least_nodes(&self, most: u16) -> Option<u16> {
        let does = |nodes: u64| Self { nodes: nodes as u16, ..*self }.plan(None).is_ok();
        let most = u64::from(most);
        let steps = std::iter::successors(Some(1), |&nodes: &u64| Some((nodes + nodes.div_ceil(8)).min(most)));
        let (mut before, mut found) = (0, None);
        for nodes in steps {
            if does(nodes) {
                found = Some(nodes);
                break;
            }
            if nodes == most {
                break;
            }
            before = nodes;
        }
        found.map(|found| first_between(before, found, does) as u16)
    }

    fn plan(&self, owned_max: Option<u64>) -> Result<Plan, PlanError> {
        let plan = Plan::new(self.sizes, self.nodes, self.memory, owned_max, self.policy)?;
        Ok(match self.page_memory {
            Some(bytes) => plan.with_page_memory(bytes, self.nodes, owned_max),
            None => plan,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::owners::tests::{Random, pages};
    use super::*;

    #[test]
    fn pages_have_32_places_if_they_can() {
        for nodes in [1, 2, 32, 4096] {
            let mut before = 0;
            for memory in (10..400).map(|step: u32| (1.04f64.powi(step as i32) * 1000.0) as u64) {
                let bytes = page_bytes_for(memory, nodes);
                assert!(bytes >= before, "more memory, larger pages: {memory}");
                before = bytes;
                // The room for pages, by what a plan for a scene of such pages has.
                let sizes = |bytes: u32| Sizes {
                    pages: 1000,
                    pages_bytes: 1000 * u64::from(bytes),
                    page_bytes_max: bytes as usize,
                    directory_nodes: 0,
                    ..Sizes::default()
                };
                let policy = Policy::DemandDriven;
                let wanted = |bytes| Wanted {
                    sizes: sizes(bytes),
                    nodes,
                    memory,
                    page_memory: None,
                    policy,
                    first_dispatches: false,
                };
                let fits = |bytes: u32| {
                    wanted(bytes).plan(Some(0)).map_or(0, |plan| plan.lines as u64 * 64 / u64::from(bytes))
                };
                // Tables of 1000 pages and cache take less than eight of the places.
                if bytes > PAGE_BYTES_MIN && bytes < 65_536 {
                    assert!(fits(bytes) + 24 >= PLACES, "{memory} bytes, {nodes} nodes: {} of {bytes}", fits(bytes));
                }
                if bytes < 65_536 {
                    assert!(fits(2 * bytes) < PLACES, "{memory} bytes, {nodes} nodes: larger pages would do");
                }
            }
            assert_eq!(before, 65_536);
        }
        assert_eq!(page_bytes_for(0, 1), 4096);
        assert_eq!(page_bytes_for(1 << 20, 8), 16_384);
        assert_eq!(page_bytes_for(32 << 20, 32), 65_536);
        assert_eq!(page_bytes_for(u64::MAX, 1), 65_536);
    }

    /// What fits is within the budget, and what is said to do does, while less does not.
    #[test]
    fn fits_or_says_what_would_do() {
        let (mut fitted, mut less_nodes) = (0, 0);
        for seed in 0..1500 {
            let random = &mut Random(seed);
            let (pages, voxels) = pages(random);
            let pages: Vec<_> =
                pages.iter().map(|page| PlacedPage { bytes: page.bytes.next_multiple_of(64), ..*page }).collect();
            let sizes = Sizes {
                pages: pages.len(),
                pages_bytes: pages.iter().map(|page| u64::from(page.bytes)).sum(),
                page_bytes_max: pages.iter().map(|page| page.bytes as usize).max().unwrap_or(64),
                directory_nodes: pages.len() / 3,
                materials: random.below(20) as usize,
                lights: random.below(20) as usize,
                maps: [random.below(20) as usize; 3],
                cells: [random.below(20) as usize; 2],
                texel_pages_of_a_hit: 2 * random.below(4) as usize,
            };
            let nodes = 1 + random.below(if seed % 2 == 0 { 24 } else { 2 }) as u16;
            let (_, policy) = Policy::ALL[random.below(4) as usize];
            let memory = 80_000 + random.below(400_000 + sizes.pages_bytes / u64::from(nodes));
            let page_memory = (random.below(3) == 0).then(|| random.below(sizes.pages_bytes + 1));
            let wanted = Wanted { sizes, nodes, memory, page_memory, policy, first_dispatches: false };
            let least = wanted.least_memory().unwrap_or_else(|| panic!("seed {seed}: a TiB does not do"));
            let check = |wanted: Wanted| {
                let fit = wanted.fit(&pages, voxels).unwrap_or_else(|e| panic!("seed {seed}: {wanted:?}: {e}"));
                assert!(fit.plan.sum().total_bytes() <= wanted.memory, "seed {seed}");
                assert!(fit.owned_bytes.iter().all(|&bytes| bytes <= fit.plan.fixed_bytes()), "seed {seed}");
                assert_eq!(fit.owned_bytes.iter().sum::<u64>(), sizes.pages_bytes, "seed {seed}");
            };
            check(Wanted { memory: least, ..wanted });
            assert!(Wanted { memory: least - KIB, ..wanted }.fit(&pages, voxels).is_err(), "seed {seed}");
            match wanted.fit(&pages, voxels) {
                Ok(_) => {
                    fitted += 1;
                    check(wanted);
                }
                Err(_) => assert!(least > memory, "seed {seed}"),
            }
            if let Some(nodes) = wanted.least_nodes(4096) {
                check(Wanted { nodes, ..wanted });
                if nodes > 1 {
                    less_nodes += 1;
                    assert!(Wanted { nodes: nodes - 1, ..wanted }.fit(&pages, voxels).is_err(), "seed {seed}");
                }
            }
        }
        assert!((300..1300).contains(&fitted) && less_nodes > 300, "{fitted} of 1500 fitted, {less_nodes}");
    }
}
