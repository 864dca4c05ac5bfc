//! What a node's budget is spent on: decided before anything starts, and carved once (DESIGN section 2, law 2).
//!
//! What must be there comes first: tables, directory, the lane, a bundle. Then shares of the budget for tiles, rays and
//! partial sums. The rest is for pages: those that the node owns, and a cache. docs/MEMORY.md explains each term.

use crate::node::{Cache, CachePlace, Charged, Limits, NodeMemory, Own, Settings};
use crate::policy::Policy;
use hybray_arena::{Arena, Short, Sum};
use hybray_bintree::walk::Resident;
use hybray_scene::{Directory, Line, Node as TreeNode, PageEntry, PageView, Tables, lines_for, parents};
use hybray_shading::{Cell, Cut, Environment, Light, Map, MapTables, Maps, Material, Texture};
use hybray_tracer::Scene;

/// What of a scene takes memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Pages.
    pub pages: usize,
    /// Bytes of all pages, each rounded up to whole lines.
    pub pages_bytes: u64,
    /// Bytes of the largest page, rounded up to whole lines.
    pub page_bytes_max: usize,
    /// Nodes of the directory.
    pub directory_nodes: usize,
    /// Materials.
    pub materials: usize,
    /// Lights.
    pub lights: usize,
    /// What materials take from textures, uses of textures, and textures: all 0 for a scene without.
    pub maps: [usize; 3],
    /// Cells of what is around, and cuts between them.
    pub cells: [usize; 2],
    /// Texel pages that one hit needs at most.
    pub texel_pages_of_a_hit: usize,
}

impl Sizes {
    /// Those of `scene`.
    #[must_use]
    pub fn of(scene: &Scene<'_>) -> Self {
        let directory = scene.resident.directory;
        let bytes = |entry: &PageEntry| lines_for(entry.bytes as usize) * size_of::<Line>();
        Self {
            pages: directory.entries.len(),
            pages_bytes: directory.entries.iter().map(|entry| bytes(entry) as u64).sum(),
            page_bytes_max: directory.entries.iter().map(bytes).max().unwrap_or(size_of::<Line>()),
            directory_nodes: directory.nodes.len(),
            materials: scene.shading.materials.len(),
            lights: scene.shading.lights.len(),
            maps: [scene.shading.maps.maps.len(), scene.shading.maps.uses.len(), scene.shading.maps.textures.len()],
            cells: [scene.shading.maps.environment.cells.len(), scene.shading.maps.environment.cuts.len()],
            texel_pages_of_a_hit: scene.shading.maps.pages_of_a_hit(),
        }
    }

    /// Places of a cache that are the lane's: for a page of the directory, and for the texels that a hit needs.
    #[must_use]
    pub const fn lane_places(&self) -> usize {
        1 + self.texel_pages_of_a_hit
    }

    /// Places of a cache at least: one, and the lane's.
    const fn places_min(&self) -> usize {
        1 + self.lane_places()
    }

    /// Bytes of pages that a node owns at most where shares are even: one page more than the mean.
    #[must_use]
    pub fn even_share(&self, nodes: u16) -> u64 {
        (self.pages_bytes / u64::from(nodes.max(1)) + self.page_bytes_max as u64).min(self.pages_bytes)
    }
}

/// Why a budget does not do, and how many bytes for each node would.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// What every node must have does not fit.
    #[error("too little memory for a node of this scene: give each {needed} bytes or more")]
    Memory {
        /// The least that would do.
        needed: u64,
    },
    /// All nodes together cannot hold the pages.
    #[error("too little memory for this scene's pages: give each node {needed} bytes or more")]
    Pages {
        /// The least that would do.
        needed: u64,
    },
    /// There is no room for as large a light cache.
    #[error("a light cache of {bytes} bytes is too large: {room} bytes or less would do")]
    LightCache {
        /// What it would take.
        bytes: u64,
        /// What there is, beside the node's own pages and the least of a cache.
        room: u64,
    },
}

/// Shares of the budget, and what they are kept within.
const TILES: (u64, u64, u64) = (64, 8, 256);
const RAYS: (u64, u64, u64) = (16, 256, 16_384);
const PARTIALS: (u64, u64, u64) = (64, 64, 4_096);

/// What the node takes for its copies that has most, bytes in whole lines: each node's are a list of pages.
#[must_use]
pub fn bytes_of_copies(entries: &[PageEntry], copies: &[impl AsRef<[u32]>]) -> u64 {
    let bytes = |&page: &u32| (lines_for(entries[page as usize].bytes as usize) * size_of::<Line>()) as u64;
    copies.iter().map(|pages| pages.as_ref().iter().map(bytes).sum()).max().unwrap_or(0)
}

/// What a node is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The scene.
    pub sizes: Sizes,
    /// Pools.
    pub limits: Limits,
    /// Places of the cache, the lane's included.
    pub places: usize,
    /// Lines for pages: the cache's first, then those of pages that stay.
    pub lines: usize,
    /// How many of them are for copies of others' pages, given in advance, which stay, too: light caches, and what a pilot
    /// found to be used.
    pub copied_lines: usize,
    /// Whether the node has room for every page.
    pub holds_all: bool,
}

impl Plan {
    /// Divides `memory` bytes of each of `nodes` nodes up. `owned_max` is the most bytes of pages, rounded up to lines,
    /// that any node is to own: by an even share of them if it is `None`. The 1995 report's policies have each node keep
    /// its own pages only; with the others, nodes that have the room keep every page.
    ///
    /// # Errors
    /// If it does not do: what would.
    pub fn new(
        sizes: Sizes,
        nodes: u16,
        memory: u64,
        owned_max: Option<u64>,
        policy: Policy,
    ) -> Result<Self, PlanError> {
        let mut plan = Self::least(sizes, nodes, memory);
        let place_lines = lines_for(sizes.page_bytes_max);
        let line = size_of::<Line>() as u64;
        let least = plan.least_bytes();
        let owned = owned_max.unwrap_or(sizes.even_share(nodes));
        let room = memory.saturating_sub(least);
        if memory < least || room < owned {
            // The shares grow with the budget, but slower: the first that is enough is met from below.
            let mut needed = memory;
            loop {
                let enough = Self::least(sizes, nodes, needed).least_bytes() + owned;
                if enough <= needed {
                    break;
                }
                needed = enough;
            }
            return Err(if memory < least { PlanError::Memory { needed } } else { PlanError::Pages { needed } });
        }
        let keeps_others = matches!(policy, Policy::Hybrid | Policy::DemandDriven);
        plan.holds_all = keeps_others && room >= sizes.pages_bytes;
        if plan.holds_all {
            plan.lines = sizes.places_min() * place_lines + (sizes.pages_bytes / line) as usize;
        } else {
            let free = room - owned;
            // Texels are fetched, whatever the policy.
            if policy != Policy::DataParallel || sizes.texel_pages_of_a_hit > 0 {
                plan.places = sizes.places_min() + ((free / plan.place_bytes()) as usize).min(sizes.pages);
            }
            plan.lines = plan.places * place_lines + (owned / line) as usize;
        }
        Ok(plan)
    }

    /// What every node of so many must have if each has `memory` bytes, without room for the pages that stay.
    fn least(sizes: Sizes, nodes: u16, memory: u64) -> Self {
        let share = |(part, least, most): (u64, u64, u64), size: usize| {
            (memory / part / size as u64).clamp(least, most) as usize
        };
        let limits = Limits {
            peers: usize::from(nodes) + 1,
            pages: sizes.pages,
            rays: share(RAYS, 92),
            tiles: share(TILES, 1608),
            partials: share(PARTIALS, 44),
        };
        let lines = sizes.places_min() * lines_for(sizes.page_bytes_max);
        Self { sizes, limits, places: sizes.places_min(), lines, copied_lines: 0, holds_all: false }
    }

    fn least_bytes(&self) -> u64 {
        self.sum().total_bytes()
    }

    /// What a place of the cache takes at most.
    fn place_bytes(&self) -> u64 {
        (lines_for(self.sizes.page_bytes_max) * size_of::<Line>() + size_of::<CachePlace>() + size_of::<Line>()) as u64
    }

    /// The same with its cache made smaller or larger, to `places`.
    fn with_places(mut self, places: usize) -> Self {
        let place_lines = lines_for(self.sizes.page_bytes_max);
        self.lines = self.lines - self.places * place_lines + places * place_lines;
        self.places = places;
        self
    }

    /// Bytes that copies could have of a budget of `memory`, if the cache had no more than it must. 0 where every page
    /// is at hand.
    #[must_use]
    pub fn room_for_copies(&self, memory: u64) -> u64 {
        if self.holds_all {
            return 0;
        }
        let line = size_of::<Line>() as u64;
        memory.saturating_sub(self.with_places(self.sizes.places_min()).sum().total_bytes()) / line * line
    }

    /// The same with `bytes`, in whole lines, for copies of others' pages: its cache gets the smaller.
    ///
    /// # Errors
    /// If a budget of `memory` has no room for it. Where every page is at hand it takes nothing, and none is wanted.
    pub fn with_copies(self, bytes: u64, memory: u64) -> Result<Self, PlanError> {
        if bytes == 0 || self.holds_all {
            return Ok(self);
        }
        let room = self.room_for_copies(memory);
        let Some(rest) = room.checked_sub(bytes) else { return Err(PlanError::LightCache { bytes, room }) };
        let places = self.sizes.places_min() + (rest / self.place_bytes()) as usize;
        let mut plan = self.with_places(places.min(self.places));
        plan.copied_lines = bytes as usize / size_of::<Line>();
        plan.lines += plan.copied_lines;
        Ok(plan)
    }

    /// The same with no more than `bytes` for pages: what the node owns, at most `owned_max`, and the least of a cache stay,
    /// whatever they take. For experiments on scenes that are larger than their nodes.
    #[must_use]
    pub fn with_page_memory(mut self, bytes: u64, nodes: u16, owned_max: Option<u64>) -> Self {
        let line = size_of::<Line>() as u64;
        if self.lines as u64 * line > bytes {
            let owned = owned_max.unwrap_or(self.sizes.even_share(nodes));
            let place_lines = lines_for(self.sizes.page_bytes_max);
            let places = bytes.saturating_sub(owned) / (place_lines as u64 * line);
            self.places = (places as usize).clamp(self.sizes.places_min(), self.sizes.pages + self.sizes.places_min());
            self.lines = self.places * place_lines + (owned / line) as usize;
            self.holds_all = false;
        }
        self
    }

    /// A node without a budget: it has every page, and no ray ever waits.
    #[must_use]
    pub fn without_budget(sizes: Sizes) -> Self {
        let limits = Limits { pages: 0, ..Limits::all_at_hand() };
        let lines = sizes.pages_bytes as usize / size_of::<Line>();
        Self { sizes, limits, places: 0, lines, copied_lines: 0, holds_all: true }
    }

    /// Bytes of pages, rounded up to lines, that a node may own or be given for good.
    #[must_use]
    pub fn fixed_bytes(&self) -> u64 {
        let cache = self.places * lines_for(self.sizes.page_bytes_max);
        (self.lines.saturating_sub(cache) * size_of::<Line>()) as u64
    }

    /// Bytes of pages, rounded up to lines, that a node could own if it had no more of a cache than it must.
    #[must_use]
    pub fn owned_bytes_max(&self) -> u64 {
        let least = self.sizes.places_min() * lines_for(self.sizes.page_bytes_max);
        (self.lines.saturating_sub(least) * size_of::<Line>()) as u64
    }

    /// Every term, in bytes.
    #[must_use]
    pub fn sum(&self) -> Sum {
        let s = &self.sizes;
        let mut sum = NodeMemory::sum(&self.limits);
        sum.add::<TreeNode>("directory", s.directory_nodes);
        sum.add::<PageEntry>("sizes and owners of pages", s.pages);
        sum.add::<u32>("parents in the directory", s.directory_nodes + s.pages);
        sum.add::<u32>("where pages are", s.pages);
        sum.add::<Material>("materials", s.materials);
        sum.add::<Light>("lights", s.lights);
        // A scene without textures does not speak of them.
        if s.maps != [0; 3] {
            sum.add::<Maps>("what materials take from textures", s.maps[0]);
            sum.add::<Map>("uses of textures", s.maps[1]);
            sum.add::<Texture>("textures", s.maps[2]);
        }
        if s.cells != [0; 2] {
            sum.add::<Cell>("cells of the environment", s.cells[0]);
            sum.add::<Cut>("cuts between cells", s.cells[1]);
        }
        sum.add::<CachePlace>("places of the cache", self.places);
        sum.add::<Line>("pages", self.lines - self.copied_lines);
        sum.add::<Line>("copies of pages", self.copied_lines);
        sum
    }

    /// Carves a node out of `arena`: what it works in, its pages, and its copy of the tables.
    ///
    /// # Errors
    /// If the arena is smaller than [`Plan::sum`].
    pub fn carve<'m>(
        &self,
        arena: &mut Arena<'m>,
        scene: &Scene<'_>,
    ) -> Result<(NodeMemory<'m>, Cache<'m, Own<'m>>, Scene<'m>), Short> {
        let memory = NodeMemory::carve(arena, &self.limits)?;
        let (from, shading) = (scene.resident.directory, &scene.shading);
        let nodes = &*arena.take_with("directory", from.nodes.len(), |i| from.nodes[i])?;
        let entries = &*arena.take_with("sizes and owners of pages", from.entries.len(), |i| from.entries[i])?;
        let up = arena.take("parents in the directory", nodes.len() + entries.len(), 0u32)?;
        parents(nodes, up);
        let at = arena.take("where pages are", entries.len(), 0u32)?;
        let materials = &*arena.take_with("materials", shading.materials.len(), |i| shading.materials[i])?;
        let lights = &*arena.take_with("lights", shading.lights.len(), |i| shading.lights[i])?;
        let from = &shading.maps;
        let maps = MapTables {
            maps: &*arena.take_with("what materials take from textures", from.maps.len(), |i| from.maps[i])?,
            uses: &*arena.take_with("uses of textures", from.uses.len(), |i| from.uses[i])?,
            textures: &*arena.take_with("textures", from.textures.len(), |i| from.textures[i])?,
            environment: {
                let Environment { sky, cells, cuts } = from.environment;
                Environment {
                    sky,
                    cells: &*arena.take_with("cells of the environment", cells.len(), |i| cells[i])?,
                    cuts: &*arena.take_with("cuts between cells", cuts.len(), |i| cuts[i])?,
                }
            },
        };
        let places = arena.take_with("places of the cache", self.places, |_| CachePlace::free())?;
        let lines = arena.take("pages", self.lines, Line([0; 64]))?;
        let own = Own { lines, tables: Tables { materials: materials.len() } };
        let cache = Cache::new(own, entries, up, at, places, self.sizes.page_bytes_max, self.sizes.lane_places());
        let scene = Scene {
            resident: Resident { directory: Directory { nodes, entries }, pages: &[][..] },
            shading: hybray_shading::Scene { materials, lights, maps, ..*shading },
            background: scene.background,
            magnitude: scene.magnitude,
            transmits: scene.transmits,
            texels: &[],
            layer: scene.layer,
            eye: scene.eye,
        };
        Ok((memory, cache, scene))
    }

    /// Bytes of memory that [`Plan::charge`] takes.
    #[must_use]
    pub fn charged_bytes(&self) -> u64 {
        let mut sum = NodeMemory::sum(&self.limits);
        sum.add::<u32>("where pages are", self.sizes.pages);
        sum.add::<CachePlace>("places of the cache", self.places);
        sum.total_bytes()
    }

    /// The same, for a node that is charged for its pages and tables but refers to the one copy of them in this process:
    /// the arena is smaller by them. `up` is [`parents`] of the directory.
    ///
    /// # Errors
    /// If the arena is too small.
    pub fn charge<'m>(
        &self,
        arena: &mut Arena<'m>,
        scene: &Scene<'m>,
        up: &'m [u32],
        bytes: &'m [&'m [u8]],
    ) -> Result<(NodeMemory<'m>, Cache<'m, Charged<'m>>), Short> {
        let memory = NodeMemory::carve(arena, &self.limits)?;
        let at = arena.take("where pages are", self.sizes.pages, 0u32)?;
        let places = arena.take_with("places of the cache", self.places, |_| CachePlace::free())?;
        let pages: &'m [PageView<'m>] = scene.resident.pages;
        let entries = scene.resident.directory.entries;
        let (bytes_max, lanes) = (self.sizes.page_bytes_max, self.sizes.lane_places());
        Ok((memory, Cache::new(Charged(pages, bytes), entries, up, at, places, bytes_max, lanes)))
    }

    /// Settings that go with this plan.
    #[must_use]
    pub fn settings(&self, settings: Settings) -> Settings {
        let lights_first = settings.lights_first || self.copied_lines > 0;
        Settings { in_system: settings.in_system.min(self.limits.rays as u32 / 2), lights_first, ..settings }
    }
}
