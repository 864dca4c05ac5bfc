//! The longest that no ray ends anywhere: a bound, computed before anything starts. docs/PROGRESS.md is the argument,
//! and each term here is one of its sentences.
//!
//! All of it is counted as if whatever can happen at the same time happened one after the other, with every pool, link and
//! queue full. So it is far from what happens; but nothing is left out, and a farm that passes it is wrong.

use crate::machine::{Costs, Machine};
use crate::take::FRAMES;
use hybray_link::Peer;
use hybray_scene::{BLOCK, DEPTH_MAX as LEVELS_MAX};
use hybray_scheduler::{BUNDLE, DEPTH_MAX, FETCHES, PART_BYTES, Plan, REQUESTS_MAX, Settings};
use hybray_tracer::{SHADOW_CHAIN_MAX, Scene, TOGETHER};
use hybray_wire::{BODY_BYTES_MAX, Frame, HEAD_BYTES_MAX, Partial, RayRecord, TILE, TileMap};

/// What the longest time without a ray's end is made of. Virtual nanoseconds; no fault, no loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bound {
    /// A walk of one ray: every node and block of the whole scene, once.
    pub walk_ns: u128,
    /// A participant's turn: it takes in, traces, and sends.
    pub turn_ns: u128,
    /// A frame's way from one participant to another, until it is read there.
    pub way_ns: u128,
    /// From asking for a page, or sending rays, until the answer has been read.
    pub round_ns: u128,
    /// The same while nobody traces.
    pub quiet_round_ns: u128,
    /// The longest that nobody traces anything.
    pub wait_ns: u128,
    /// Rays that may be under way at one time, in all nodes.
    pub rays: u128,
    /// Times that one ray can come on before it ends.
    pub steps: u128,
    /// Rounds that it waits for at most, one after the other, or a ray that ends before it.
    pub rounds: u128,
    /// Of the time without an end, that in which somebody traces.
    pub tracing_ns: u128,
    /// The whole of it: `wait_ns` until there is a ray, `rounds` without tracing, and `tracing_ns`.
    pub gap_ns: u128,
}

impl Bound {
    /// That of `nodes` nodes of this plan on a machine, for the picture of `frame`. `scene` has all pages; `delay_ns` is what
    /// chance may add to the way of a frame.
    #[must_use]
    pub fn new(
        scene: &Scene<'_>,
        plan: &Plan,
        settings: &Settings,
        machine: &Machine,
        nodes: Peer,
        frame: &Frame,
        delay_ns: u64,
    ) -> Self {
        let (costs, limits) = (&machine.costs, &plan.limits);
        let per_node = limits.rays + DEPTH_MAX + 2 + BUNDLE;
        let rays = u128::from(nodes) * per_node as u128;
        let walks = Walks::of(scene, costs);
        let tiles = TileMap::new(frame.width, frame.height).map_or(0, |map| map.len());
        let tiles_ps = u128::from(costs.tile) * u128::from(tiles);

        // A turn. Frames are as large as what they carry lets them be.
        let waiting_bytes = usize::from(settings.granularity.max(1)).min(limits.rays) * size_of::<RayRecord>();
        let tile_bytes = (TILE * TILE) as usize * size_of::<[u64; 3]>();
        let part_bytes = PART_BYTES.min(plan.sizes.page_bytes_max);
        let body_bytes = [waiting_bytes, limits.partials * size_of::<Partial>(), tile_bytes, part_bytes]
            .into_iter()
            .fold(0, usize::max)
            .min(BODY_BYTES_MAX);
        let records = (body_bytes / size_of::<Partial>()) as u64;
        let frame_bytes = (HEAD_BYTES_MAX + body_bytes) as u64;
        let messages = &machine.messages;
        let frame_ps = messages.sent.max(messages.received) + messages.byte * frame_bytes + messages.record * records;
        let peers = nodes + 1;
        // The most that one participant can have on the way to all, and unread from all.
        let network = machine.network(nodes);
        let room = u128::from(peers) * u128::from(network.room_frames.max(1));
        let quiet_ps = (FRAMES as u128 + room) * u128::from(frame_ps);
        // The last unit may be a bundle of shadow rays.
        let units = u128::from(settings.steps.max(1)) + TOGETHER as u128;
        let step_ps = units * walks.unit_ps + walks.bundle_ps + tiles_ps;

        // Two lost parts of nanoseconds, and one that each turn takes at least.
        let turn_ns = |ps: u128| ps / 1000 + 3;
        let network_ns = network.way_ns(peers, frame_bytes as u32) + u128::from(delay_ns);
        let way_ns = |turn_ns: u128| network_ns + (room.div_ceil(FRAMES as u128) + 1) * turn_ns;
        // Two pages, part by part; and the peer that they go to must read a part before there is room for another.
        let parts = FETCHES as u128 * (plan.sizes.page_bytes_max.div_ceil(PART_BYTES).max(1)) as u128;
        let round_ns = |turn_ns: u128| 3 * way_ns(turn_ns) + parts * (way_ns(turn_ns) + turn_ns);

        let quiet_round_ns = round_ns(turn_ns(quiet_ps));
        // A node that has every page waits for none. A ray that has its hit may wait for that page once more.
        let pages = if plan.holds_all { 0 } else { limits.pages as u128 };
        // From voxel to voxel it comes to each page, and once more to its way's end, over as many nodes as the grid has
        // voxels along its axes.
        let hops = settings.grid.map_or(1, |grid| grid.sides.iter().map(|&side| u128::from(side)).sum());
        let pages = pages + u128::from(settings.grid.is_some() && pages > 0);
        let steps = (pages + 1) * walks.chain + 1;
        // Pages that are asked for have places, and a peer is asked for so many at a time; the lane's goes before the others.
        let common = plan.places.saturating_sub(plan.sizes.lane_places());
        let open = usize::from(settings.requests).clamp(1, REQUESTS_MAX).min(common).max(1);
        let asks = (open + 1).div_ceil(FETCHES) as u128;
        // A hit waits for each page of texels, in vain up to so many times, and then once more in the lane: nothing is traced
        // meanwhile.
        let texels = plan.sizes.texel_pages_of_a_hit as u128;
        let waits = if texels == 0 { 1 } else { 3 * texels + 5 };
        let wait_ns = (asks + 2) * quiet_round_ns * waits;
        // A page behind all others that may be wanted, and rays at the end of a full outbox. Each twice a step, and two ways
        // until there is room for a sum.
        let wanted = limits.pages.min(limits.rays);
        let turn = (wanted.div_ceil(open) as u128 + 1) * asks;
        let sent =
            limits.rays.div_ceil(usize::from(settings.granularity).clamp(1, BODY_BYTES_MAX / size_of::<RayRecord>()));
        let sums = limits.partials.clamp(1, BODY_BYTES_MAX / size_of::<Partial>()) as u128;
        let in_pool = steps * hops * (2 * turn + 2 * sent as u128 + 1) + rays.div_ceil(sums);
        // The lane stands still: a round until its page can be asked for, and one until it comes.
        let in_lane = (u128::from(frame.depth_max) + 1) * steps * 2;
        let rounds = if pages == 0 { 1 } else { (in_pool + in_lane) * waits };
        let tracing_ns = (rays * walks.life_ps(pages) + tiles_ps) / 1000 + steps;
        Self {
            walk_ns: walks.walk_ps / 1000 + 1,
            turn_ns: turn_ns(quiet_ps + step_ps),
            way_ns: way_ns(turn_ns(quiet_ps + step_ps)),
            round_ns: round_ns(turn_ns(quiet_ps + step_ps)),
            quiet_round_ns,
            wait_ns,
            rays,
            steps,
            rounds,
            tracing_ns,
            gap_ns: wait_ns + rounds * quiet_round_ns + tracing_ns,
        }
    }
}

/// What tracing costs at most, picoseconds.
struct Walks {
    /// One walk.
    walk_ps: u128,
    /// One level of the directory after the other, down to a page.
    descent_ps: u128,
    /// Walks of one ray one after the other, each from the root.
    chain: u128,
    /// A unit of work: a ray or its child, from birth to where it needs a page or ends.
    unit_ps: u128,
    /// A bundle, and a look at the next one.
    bundle_ps: u128,
    /// What a ray and its hit cost beside walks.
    ray_ps: u128,
}

impl Walks {
    fn of(scene: &Scene<'_>, costs: &Costs) -> Self {
        let (directory, pages) = (&scene.resident.directory, scene.resident.pages);
        let directory_nodes = directory.nodes.len();
        let cells = directory_nodes + pages.iter().map(|page| page.body.nodes().len()).sum::<usize>();
        let blocks: usize =
            pages.iter().map(|p| p.body.triangle_lanes() / BLOCK + p.spheres.len() + p.cones.len()).sum();
        let times = |cost: u64, count: usize| u128::from(cost) * count as u128;
        let walk_ps = times(costs.cell, cells) + times(costs.block, blocks) + times(costs.page, pages.len());
        let chain = if scene.transmits { u128::from(SHADOW_CHAIN_MAX) + 1 } else { 1 };
        // One value where it is, and one of a light or of the sky. Children that are not spawned cost the turn that they
        // are passed over in, which is a nanosecond.
        let ray_ps = u128::from(costs.ray + costs.hit + 2 * costs.contribution)
            + 1000 * (u128::from(scene.shading.shadow_rays) + 2);
        // A bundle is the single walks of its rays, and as many clips. Four corners look for the next one's pages, twice.
        let bundle = BUNDLE as u128;
        Self {
            walk_ps,
            descent_ps: times(costs.cell, directory_nodes.min(LEVELS_MAX)),
            chain,
            // A shadow ray may have gone along in a bundle before: its clip, and a walk.
            unit_ps: ray_ps + (chain + 2) * walk_ps,
            bundle_ps: bundle * (u128::from(costs.ray) + 2 * walk_ps) + 2 * walk_ps,
            ray_ps,
        }
    }

    /// A ray that goes through the whole scene, page by page, and its part of two bundles.
    fn life_ps(&self, pages: u128) -> u128 {
        self.ray_ps + 6 * self.walk_ps + self.chain * (self.walk_ps + pages * self.descent_ps)
    }
}
