//! What a node works in, carved before it starts: the sum of docs/MEMORY.md, term by term.

use super::pool::{PageState, Pool};
use super::tiles::OpenTile;
use super::{BUNDLE, Peers, Place};
use crate::DEPTH_MAX;
use crate::clips::{Clips, Unclipped};
use crate::server::{Asked, PageServer};
use hybray_arena::{Arena, List, Ring, Short, Slab, Sum};
use hybray_bintree::walk::{Hit, Stack, Walked};
use hybray_geometry::{Ray, Vec3};
use hybray_tracer::{HitRecord, TOGETHER, Together};
use hybray_wire::{Partial, RayRecord};

/// Chosen limits: bytes follow from them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Participants, the host included; 0 if no ray ever goes to another.
    pub peers: usize,
    /// Pages of the scene; 0 if all of them are at hand, so that no ray ever waits.
    pub pages: usize,
    /// Rays that may wait, or be on their way to others.
    pub rays: usize,
    /// Tiles whose sums are kept at a time, 4 or more.
    pub tiles: usize,
    /// Partial sums for tiles of other nodes.
    pub partials: usize,
}

impl Limits {
    /// Those of a node that has every page.
    #[must_use]
    pub const fn all_at_hand() -> Self {
        Self { peers: 0, pages: 0, rays: 0, tiles: 4, partials: 1 }
    }
}

/// A bundle of primary rays, hits of it whose shadow rays go together, and scratch of walks.
pub(super) struct Bundle {
    pub rays: [Ray; BUNDLE],
    pub walked: [Walked; BUNDLE],
    pub places: [Place; BUNDLE],
    pub lit: [HitRecord; TOGETHER],
    pub together: Together,
    pub stack: Stack,
}

/// Everything that a node works in but its pages.
pub struct NodeMemory<'m> {
    pub(super) bundle: &'m mut Bundle,
    pub(super) lane: &'m mut [HitRecord],
    pub(super) tiles: &'m mut [OpenTile],
    pub(super) pool: Pool<'m>,
    pub(super) partials: Slab<'m, Partial>,
    pub(super) owed: &'m mut [List],
    pub(super) owing: Ring<'m, u16>,
    pub(super) peers: Peers<'m>,
    pub(super) server: PageServer<'m>,
    pub(super) clips: Clips<'m>,
}

/// The terms, in order: `$do!(name, type, count, value)` for each.
macro_rules! terms {
    ($limits:expr, $do:ident) => {{
        let l: &Limits = $limits;
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 0.0 };
        let record: RayRecord = bytemuck::Zeroable::zeroed();
        (
            $do!("a bundle of primary rays, and scratch of walks", Bundle, 1, || Bundle {
                rays: [ray; BUNDLE],
                walked: [Walked { best: Hit::none(0.0), needs: None }; BUNDLE],
                places: [Place::default(); BUNDLE],
                lit: [HitRecord::EMPTY; TOGETHER],
                together: Together::new(),
                stack: Stack::new(),
            }),
            $do!("hit records of the lane", HitRecord, DEPTH_MAX + 1, || HitRecord::EMPTY),
            $do!("sums of tiles", OpenTile, l.tiles, || OpenTile::FREE),
            $do!("rays that wait", RayRecord, l.rays, || record),
            $do!("links between rays that wait", u32, l.rays, || 0u32),
            $do!("what is known of pages", PageState, l.pages, || PageState::NEW),
            $do!("pages at hand that rays wait for", u32, l.pages, || 0u32),
            $do!("partial sums for others' tiles", Partial, l.partials, Partial::default),
            $do!("links between partial sums", u32, l.partials, || 0u32),
            $do!("partial sums by peer", List, l.peers, || List::EMPTY),
            $do!("peers that partial sums are for", u16, l.peers, || 0u16),
            $do!("what is known of peers", super::PeerState, l.peers, || super::PeerState::NEW),
            $do!("peers to answer", u16, l.peers, || 0u16),
            $do!("what peers ask for", Asked, l.peers, || Asked::NONE),
            $do!("peers to send pages to", u16, l.peers, || 0u16),
            $do!("peers to send rays to", u16, l.peers, || 0u16),
            $do!("bundles that peers want clipped", Unclipped, l.peers, || Unclipped::NONE),
            $do!("peers to send cliplists to", u16, l.peers, || 0u16),
        )
    }};
}

impl<'m> NodeMemory<'m> {
    /// The bytes that [`NodeMemory::carve`] takes, term by term.
    #[must_use]
    pub fn sum(limits: &Limits) -> Sum {
        let mut sum = Sum::new();
        macro_rules! add {
            ($name:expr, $type:ty, $count:expr, $value:expr) => {{
                let _ = || -> $type { ($value)() };
                sum.add::<$type>($name, $count);
            }};
        }
        let _ = terms!(limits, add);
        sum
    }

    /// Carves it.
    ///
    /// # Errors
    /// If the arena is too small: which term did not fit.
    pub fn carve(arena: &mut Arena<'m>, limits: &Limits) -> Result<Self, Short> {
        macro_rules! take {
            ($name:expr, $type:ty, $count:expr, $value:expr) => {
                arena.take_with::<$type>($name, $count, |_| ($value)())?
            };
        }
        let t = terms!(limits, take);
        let (bundle, lane, tiles, rays, ray_links, pages, ready) = (t.0, t.1, t.2, t.3, t.4, t.5, t.6);
        let (partials, partial_links, owed, owing) = (t.7, t.8, t.9, t.10);
        let (peers, answers, asked, turns, sends, unclipped, clip_turns) = (t.11, t.12, t.13, t.14, t.15, t.16, t.17);
        Ok(Self {
            bundle: &mut bundle[0],
            lane,
            tiles,
            pool: Pool::new(Slab::new(rays, ray_links), pages, Ring::new(ready)),
            partials: Slab::new(partials, partial_links),
            owed,
            owing: Ring::new(owing),
            peers: Peers::new(peers, Ring::new(answers), Ring::new(sends)),
            server: PageServer::new(asked, turns),
            clips: Clips::new(unclipped, Ring::new(clip_turns)),
        })
    }
}
