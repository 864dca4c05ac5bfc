//! Rays on their way from voxel to voxel, where nodes have a grid ([`Grid`]).

use super::Peers;
use super::pool::Pool;
use crate::policy::Grid;
use hybray_geometry::Vec3;
use hybray_link::{HOST, Peer};
use hybray_scene::{PageEntry, PageView, Pages};
use hybray_tracer::Scene;
use hybray_wire::RayRecord;

/// No page is at hand: a primary ray is traced from the voxel on that it starts in, by whose node it may be.
pub(super) struct Nothing;

impl Pages for Nothing {
    fn page(&self, _: u32) -> Option<PageView<'_>> {
        None
    }
}

/// The grid as a node sees it.
pub(super) struct Way<'a> {
    pub grid: Grid,
    pub me: Peer,
    pub entries: &'a [PageEntry],
}

impl Way<'_> {
    fn nodes(&self, ray: &RayRecord) -> impl Iterator<Item = Peer> + '_ {
        self.grid.way(Vec3::from_array(ray.origin), Vec3::from_array(ray.direction))
    }

    /// The node that `ray` goes to next, on its way to node `to`.
    pub fn next(&self, ray: &RayRecord, to: Peer) -> Peer {
        self.grid.next(Vec3::from_array(ray.origin), Vec3::from_array(ray.direction), self.me, to)
    }

    /// Has a primary ray go to the node that it starts at (the report's section D.3, where the host sends it). False if
    /// that is this one, or it has no room, or there is none here.
    pub fn begin(&self, ray: &RayRecord, pool: &mut Pool<'_>, peers: &mut Peers<'_>, now: u64) -> bool {
        let Some(first) = self.nodes(ray).next().filter(|&first| first != self.me && first != HOST) else {
            return false;
        };
        let takes = peers.get(first).is_some_and(|peer| !peer.lost && !peer.full);
        takes && pool.free() > 0 && pool.push_to(peers.send(first, now), *ray).is_ok()
    }

    /// Where a ray that hits nothing ends: a page of the last node on its way that owns any, so that it comes there.
    /// `None` if that is at hand. Owners are looked up as they are where voxels are nodes: in order, but for texels.
    pub fn last<P: Pages + ?Sized>(&self, ray: &RayRecord, scene: &Scene<'_, P>) -> Option<u32> {
        let geometry = self.entries.partition_point(|entry| entry.kind == PageEntry::GEOMETRY);
        let entries = &self.entries[..geometry];
        let first = |node: Peer| {
            let at = entries.partition_point(|entry| entry.owner < node);
            entries.get(at).filter(|entry| entry.owner == node).map(|_| at as u32)
        };
        let last = self.nodes(ray).filter_map(first).last();
        last.filter(|&page| scene.resident.pages.nearest(page).is_none())
    }

    /// The same for a ray that is here, on its way or beside it.
    pub fn beyond<P: Pages + ?Sized>(&self, ray: &RayRecord, scene: &Scene<'_, P>) -> Option<u32> {
        let last = self.last(ray, scene)?;
        let owner = self.entries[last as usize].owner;
        self.nodes(ray).skip_while(|&node| node != self.me).any(|node| node == owner).then_some(last)
    }
}
