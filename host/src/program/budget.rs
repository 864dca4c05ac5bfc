//! Nodes with a budget, for every command that has them: what fits, and what people are told if it does not.

use super::args::{TreeArgs, Ways};
use crate::partition::{Fit, NoFit, Pilot, Voxels, Wanted, barred, page_bytes_for, square};
use crate::prepare::Prepared;
use anyhow::{Result, bail};
use hybray_scheduler::policy::{Criterion, Grid, Policy};
use hybray_scheduler::{PlanError, Sizes};
use hybray_tracer::Scene;

const KIB: u64 = 1024;

/// A farm of nodes with a budget, before it is known whether a scene fits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Farm<'a> {
    pub nodes: u16,
    /// Of each node, bytes.
    pub memory: u64,
    /// What of it is for pages at most, bytes.
    pub page_memory: Option<u64>,
    pub policy: Policy,
    /// For light caches, bytes; as the policy has it if it is not given.
    pub light_cache: Option<u64>,
    /// What rays of the picture found that were ahead of it, if there were any.
    pub pilot: Option<&'a Pilot>,
    /// Whether node 1 gives the tiles out.
    pub first_dispatches: bool,
    /// Nodes that the command can have.
    pub nodes_most: u16,
    pub tree: &'a TreeArgs,
    /// Whether the scene is a packed one, whose pages are as large as they are.
    pub packed: bool,
}

/// What is enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Least {
    /// For as many nodes: whole KiB each, one less would not do.
    pub memory: Option<u64>,
    /// With as much memory each: one less would not do.
    pub nodes: Option<u16>,
}

impl Farm<'_> {
    /// Finds owners and the plan.
    ///
    /// # Errors
    /// If the scene does not fit: one line that says which arguments would do.
    pub fn fit(&self, prepared: &Prepared, scene: &Scene<'_>) -> Result<Fit> {
        let wanted = self.wanted(scene);
        let (pages, voxels) = (prepared.packed.placed_pages(), prepared.packed.voxels());
        match wanted.fit_picture(&pages, voxels, scene, self.light_cache, self.pilot) {
            Ok(fit) => Ok(fit),
            Err(NoFit::Plan(PlanError::LightCache { bytes, room })) => {
                let room = if room < KIB { room } else { room / KIB * KIB };
                bail!(
                    "--light-cache {} wants {bytes} bytes of pages, too many beside what else each node has with {}: \
                     give --light-cache {}",
                    size(self.light_cache.unwrap_or(bytes)),
                    memory(self.memory),
                    size(room)
                )
            }
            Err(NoFit::Plan(PlanError::Memory { .. })) => {
                bail!(
                    "{} is less than each of {} needs for this scene: {}",
                    memory(self.memory),
                    nodes(self.nodes),
                    self.remedies(&wanted)
                )
            }
            Err(_) => bail!(
                "the scene has {} bytes of pages, too many for {} with {}: {}",
                wanted.sizes.pages_bytes,
                nodes(self.nodes),
                memory(self.memory),
                self.remedies(&wanted)
            ),
        }
    }

    /// `prepared`, or the same scene in compact pages by `again` if nobody said which form they should have, and full ones do
    /// not fit.
    ///
    /// # Errors
    /// Those of `again`.
    pub fn choose_form(
        &self,
        prepared: Prepared,
        again: impl FnOnce(&TreeArgs) -> Result<Prepared>,
    ) -> Result<Prepared> {
        if self.packed || self.tree.pages.is_some() || self.fits(&prepared)? {
            return Ok(prepared);
        }
        drop(prepared);
        again(&self.tree.compact())
    }

    /// Whether all nodes have room. Light caches can be smaller: they are no reason for other pages.
    fn fits(&self, prepared: &Prepared) -> Result<bool> {
        let opened = prepared.packed.open()?;
        let scene = prepared.scene(&opened);
        let (pages, voxels) = (prepared.packed.placed_pages(), prepared.packed.voxels());
        let fit = self.wanted(&scene).fit_picture(&pages, voxels, &scene, self.light_cache, None);
        Ok(matches!(fit, Ok(_) | Err(NoFit::Plan(PlanError::LightCache { .. }))))
    }

    /// Which nodes are given no tiles: entry 0 is the host's.
    ///
    /// # Errors
    /// If that would be all.
    pub fn barred(&self, criterion: Option<Criterion>, prepared: &Prepared, fit: &Fit) -> Result<Vec<bool>> {
        let objects = prepared.packed.objects_of(&fit.owners, self.nodes);
        Ok(barred(criterion.unwrap_or_default(), self.voxels(), &objects)?)
    }

    /// The grid that rays go through from voxel to voxel, if they are to.
    ///
    /// # Errors
    /// If the scene is not cut into as many voxels as nodes.
    pub fn grid(&self, ways: Option<Ways>, scene: &Scene<'_>) -> Result<Option<Grid>> {
        let voxels = self.voxels();
        if ways != Some(Ways::Voxels) || self.nodes == 1 {
            return Ok(None);
        }
        if !matches!(voxels, Voxels::Grid(_)) || voxels.count() != u32::from(self.nodes) {
            let [columns, rows] = square(self.nodes.into());
            bail!(
                "nodes have no place in a grid: for --ways voxels give as many voxels as nodes, --voxels \
                 {columns}x{rows}x1, and a scene that is not packed"
            );
        }
        Ok(voxels.grid(scene))
    }

    /// How the scene is cut, as far as that is known.
    pub fn voxels(&self) -> Voxels {
        self.tree.voxels.filter(|_| !self.packed).unwrap_or_default()
    }

    /// What is enough for this scene.
    pub fn least(&self, scene: &Scene<'_>) -> Least {
        let wanted = self.wanted(scene);
        Least { memory: wanted.least_memory(), nodes: wanted.least_nodes(self.nodes_most) }
    }

    fn wanted(&self, scene: &Scene<'_>) -> Wanted {
        let Self { nodes, memory, page_memory, policy, first_dispatches, .. } = *self;
        Wanted { sizes: Sizes::of(scene), nodes, memory, page_memory, policy, first_dispatches }
    }

    fn remedies(&self, wanted: &Wanted) -> String {
        let least = Least { memory: wanted.least_memory(), nodes: wanted.least_nodes(self.nodes_most) };
        let [memory, nodes] = self.arguments(least);
        let mut remedies = match (memory, nodes) {
            (Some(memory), Some(nodes)) => format!("give {memory}, or {nodes}"),
            (Some(memory), None) => format!("give {memory}"),
            (None, Some(nodes)) => format!("give {nodes}"),
            (None, None) => "no node has so much memory".to_owned(),
        };
        let smaller = page_bytes_for(self.memory, self.nodes);
        if self.packed && wanted.sizes.page_bytes_max > smaller as usize {
            remedies += &format!("; less may do if it is packed with --page-bytes {smaller}");
        }
        remedies
    }

    /// The arguments that do. Where other nodes would get pages of another size, the size is said, too: the figures are
    /// those of these pages.
    pub fn arguments(&self, least: Least) -> [Option<String>; 2] {
        let pages = |memory, nodes| {
            let now = page_bytes_for(self.memory, self.nodes);
            let free = self.tree.page_bytes.is_none() && !self.packed;
            if free && page_bytes_for(memory, nodes) != now { format!(" --page-bytes {now}") } else { String::new() }
        };
        [
            least.memory.map(|m| format!("{}{}", memory(m), pages(m, self.nodes))),
            least.nodes.map(|n| format!("--nodes {n}{}", pages(self.memory, n))),
        ]
    }
}

fn nodes(nodes: u16) -> String {
    format!("{nodes} node{}", if nodes == 1 { "" } else { "s" })
}

/// `--memory 32MiB`: the argument, in the largest unit that says it exactly.
pub(super) fn memory(bytes: u64) -> String {
    format!("--memory {}", size(bytes))
}

/// `32MiB`, in the largest unit that says it exactly.
pub(super) fn size(bytes: u64) -> String {
    let (unit, name) = [(1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")]
        .into_iter()
        .find(|&(unit, _)| bytes > 0 && bytes.is_multiple_of(unit))
        .unwrap_or((1, ""));
    format!("{}{name}", bytes / unit)
}
