//! A lane: rays finished on the spot, depth first, in bounded memory, as far as the pages at hand go.

use crate::hit::{HitRecord, Origin, detail, footprint_at, place};
use crate::layer::Layer;
use crate::scene::Scene;
use crate::together::{self, Together};
use bytemuck::Zeroable;
use hybray_bintree::walk::{self, FROM_ROOT, Hit, Stack, Walk, Walked};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_scene::{PageView, Pages, Slot};
use hybray_shading::spawn::{self, Facing};
use hybray_shading::{Child, Look, Material, Seen, Sky, Surface, share_of};
use hybray_wire::{Counts, RayKind, RayRecord};

/// Where results go.
pub trait Sink {
    /// Adds `radiance` to a pixel. Returns whether it was added whole, cut, or refused.
    fn contribute(&mut self, origin: &Origin, radiance: [f32; 3]);
    /// A ray has ended: `entry` is minus its id plus the sum of its children's (DESIGN section 7).
    fn ended(&mut self, origin: &Origin, entry: u64);
}

/// Says where a ray goes that hits nothing.
pub type Beyond<'s> = &'s dyn Fn(&RayRecord) -> Option<u32>;

/// What walks need: kernels, a stack, and counters.
pub struct Walker<'s> {
    /// Which kernels the processor can run.
    pub kernels: Kernels,
    /// Whether shadow rays are tested against all pages at hand first ([`Walk::past`]).
    pub past: bool,
    /// Whether shadow rays that go to or from one place are traced together.
    pub bundles: bool,
    /// Where a ray that hits nothing is still to go, if anywhere: a page that is not at hand.
    pub beyond: Option<Beyond<'s>>,
    /// Scratch of walks.
    pub stack: &'s mut Stack,
    /// Scratch of bundles.
    pub together: &'s mut Together,
    /// Nodes, blocks and pages.
    pub counts: walk::Counts,
    /// Rays that were traced together with others so far.
    pub ahead: u64,
}

impl<'s> Walker<'s> {
    /// Traces each ray singly, until the first page that is not at hand.
    #[must_use]
    pub fn new(kernels: Kernels, stack: &'s mut Stack, together: &'s mut Together) -> Self {
        Self {
            kernels,
            past: false,
            bundles: false,
            beyond: None,
            stack,
            together,
            counts: walk::Counts::default(),
            ahead: 0,
        }
    }

    fn walk<const ANY: bool, P: Pages + ?Sized>(
        &mut self,
        scene: &Scene<'_, P>,
        ray: &Ray,
        best: Hit,
        from: u32,
    ) -> Walked {
        let resident = &scene.resident;
        let stack = &mut *self.stack;
        self.kernels.run(Walk::<ANY, P> {
            scene: resident,
            ray,
            best,
            from,
            past: self.past,
            stack,
            counts: &mut self.counts,
        })
    }

    /// Takes a nearest-hit ray on from where it is. Its nearest hit, or none to its end, once that is known and the page
    /// that holds it is at hand; before that `None`, and the record names the page that it needs.
    #[must_use]
    pub fn nearest<P: Pages + ?Sized>(&mut self, scene: &Scene<'_, P>, ray: &mut RayRecord) -> Option<Hit> {
        let mut best = Hit { candidate: ray.candidate(), page: ray.hit_page, slot: Slot(ray.slot) };
        if ray.settled == 0 {
            let walked = self.walk::<false, P>(scene, &ray.ray(), best, ray.page);
            best = walked.best;
            (ray.t_max, ray.primitive) = (best.candidate.t, best.candidate.id);
            (ray.hit_page, ray.slot) = (best.page, best.slot.0);
            if let Some(page) = walked.needs {
                ray.moved &= u8::from(ray.page == page);
                ray.page = page;
                return None;
            }
            ray.settled = 1;
            ray.page = best.page;
            if !best.candidate.is_hit()
                && ray.kind != RayKind::Shadow as u8
                && let Some(page) = self.beyond.and_then(|beyond| beyond(ray))
            {
                (ray.page, ray.moved) = (page, 0);
                return None;
            }
        }
        if best.candidate.is_hit() && scene.resident.pages.page(best.page).is_none() {
            ray.page = best.page;
            return None;
        }
        Some(best)
    }

    /// Takes a shadow ray on from where it is: what of its weight arrives at the light, once that is known. Before that
    /// `None`, and the record names the page that it needs; where nothing lets light through, it ends where all beyond is
    /// known to be free ([`Walk`]).
    ///
    /// Behind transparent things it is a chain of nearest hits in order along the ray, each with its material's
    /// transmission, so that the product does not depend on the order of pages. A ray that meets more than
    /// [`SHADOW_CHAIN_MAX`] of them is taken to be blocked.
    #[must_use]
    pub fn arriving<P: Pages + ?Sized>(&mut self, scene: &Scene<'_, P>, ray: &mut RayRecord) -> Option<[f32; 3]> {
        if !scene.transmits {
            let walked = self.walk::<true, P>(scene, &ray.ray(), Hit::none(ray.t_max), ray.page);
            let page = walked.needs.unwrap_or(ray.page);
            ray.t_max = walked.best.candidate.t;
            ray.moved &= u8::from(ray.page == page);
            ray.page = page;
            let blocked = walked.best.candidate.is_hit();
            return walked.needs.is_none().then_some(if blocked { [0.0; 3] } else { ray.weight });
        }
        loop {
            let hit = self.nearest(scene, ray)?;
            if !hit.candidate.is_hit() {
                return Some(ray.weight);
            }
            let Some((page, (place, uv))) =
                scene.resident.pages.page(hit.page).and_then(|page| Some((page, place(&page, ray, &hit)?)))
            else {
                return Some([0.0; 3]);
            };
            let coverage = match flags(scene, place.material) & (Material::CUTOUT | Material::BLEND) {
                0 => Ok(1.0),
                _ => covers(scene, &page, ray, &hit, (&place, uv), &mut self.counts),
            };
            let coverage = match coverage {
                Ok(coverage) => coverage,
                Err(page) => {
                    *ray = wants(ray, &hit, page);
                    return None;
                }
            };
            let Some((origin, rest)) = spawn::pass_through(&scene.shading, &place, coverage, ray.weight)
                .filter(|_| u32::from(ray.passed) < SHADOW_CHAIN_MAX)
            else {
                return Some([0.0; 3]);
            };
            // The end of the ray stays where it is, just before the light, though its start is moved off the surface.
            if ray.t_end < f32::INFINITY {
                let end = Vec3::from_array(ray.origin) + Vec3::from_array(ray.direction) * ray.t_end;
                ray.direction = ((end - origin) / ray.t_end).to_array();
            }
            ray.origin = origin.to_array();
            ray.weight = rest;
            ray.passed += 1;
            (ray.t_max, ray.primitive, ray.page, ray.settled) = (ray.t_end, Candidate::NOTHING, FROM_ROOT, 0);
            ray.tries = 0;
        }
    }
}

/// Surfaces that a ray may pass: transparent ones or holes for a shadow ray, holes for others.
pub const SHADOW_CHAIN_MAX: u32 = u8::MAX as u32;

fn flags<P: Pages + ?Sized>(scene: &Scene<'_, P>, material: u16) -> u32 {
    scene.shading.materials.get(usize::from(material)).map_or(0, |material| material.flags)
}

/// How much of a surface is there where a ray hits it, or the page of texels that says it and is not at hand.
fn covers<P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    page: &PageView<'_>,
    ray: &RayRecord,
    hit: &Hit,
    (surface, uv): (&Surface, [f32; 2]),
    counts: &mut walk::Counts,
) -> Result<f32, u32> {
    let detail = detail(page, ray, hit, surface, uv);
    hybray_shading::coverage(&scene.shading, scene.resident.pages, surface.material, &detail, &mut counts.look_ups)
}

/// The ray whose hit is known and wants a page of texels.
fn wants(ray: &RayRecord, hit: &Hit, page: u32) -> RayRecord {
    RayRecord {
        t_max: hit.candidate.t,
        primitive: hit.candidate.id,
        hit_page: hit.page,
        slot: hit.slot.0,
        settled: 1,
        tries: ray.tries.saturating_add(1),
        page,
        ..*ray
    }
}

/// Records for one ray and all that it causes: one for each level of depth.
pub struct Lane<'r> {
    records: &'r mut [HitRecord],
    depth: usize,
}

impl<'r> Lane<'r> {
    /// A lane that needs `records.len()` to be at least the greatest depth.
    #[must_use]
    pub fn new(records: &'r mut [HitRecord]) -> Self {
        Self { records, depth: 0 }
    }

    /// A lane that goes on with the first `depth` of `records`, as [`Lane::depth`] said when it was put aside.
    #[must_use]
    pub fn resume(records: &'r mut [HitRecord], depth: usize) -> Self {
        Self { depth: depth.min(records.len()), records }
    }

    /// Records in use.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Whether nothing is left to do.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.depth == 0
    }

    /// Takes in a hit ([`begin`]).
    ///
    /// # Panics
    /// If it is deeper than the lane.
    pub fn push(&mut self, record: HitRecord) {
        self.records[self.depth] = record;
        self.depth += 1;
    }

    /// Takes a ray on from where it is: it ends here, or becomes a record, or comes back with the page that it needs.
    ///
    /// # Panics
    /// If the ray is deeper than the lane.
    pub fn take<S: Sink, P: Pages + ?Sized>(
        &mut self,
        scene: &Scene<'_, P>,
        walker: &mut Walker<'_>,
        mut ray: RayRecord,
        sink: &mut S,
        counts: &mut Counts,
    ) -> Option<RayRecord> {
        if ray.kind == RayKind::Shadow as u8 {
            let origin = Origin::of(&ray);
            let Some(arrived) = walker.arriving(scene, &mut ray) else { return Some(ray) };
            add(sink, &origin, arrived);
            sink.ended(&origin, ray.id.wrapping_neg());
            return None;
        }
        loop {
            let Some(hit) = walker.nearest(scene, &mut ray) else { return Some(ray) };
            match begin(scene, &ray, &hit, sink, counts, &mut walker.counts) {
                Ok(None) => return None,
                Ok(Some(record)) => {
                    self.push(record);
                    return None;
                }
                Err(on) if on.settled == 1 => return Some(on),
                Err(on) => ray = on,
            }
        }
    }

    /// Traces the next child of the deepest record, or its next shadow rays to one light, or ends it. A child that needs a
    /// page that is not at hand comes back. Bounded: one walk, or one chain of a shadow ray; or a bundle of them.
    pub fn step<S: Sink, P: Pages + ?Sized>(
        &mut self,
        scene: &Scene<'_, P>,
        walker: &mut Walker<'_>,
        sink: &mut S,
        counts: &mut Counts,
    ) -> Option<RayRecord> {
        let top = self.depth.checked_sub(1)?;
        let record = &mut self.records[top];
        record.pass_over_done();
        if record.cursor == record.end {
            sink.ended(&record.origin, record.entry());
            self.depth = top;
            return None;
        }
        if walker.bundles && together::samples(scene, walker, record, sink, counts) {
            return None;
        }
        let cursor = record.cursor;
        record.advance();
        let spawned = Spawned::of(&record.child(&scene.shading, cursor))?;
        let ray = spawned.record(record, scene);
        record.adopt(ray.id);
        match spawned.kind {
            RayKind::Shadow => counts.shadow += 1,
            _ => counts.secondary += 1,
        }
        self.take(scene, walker, ray, sink, counts)
    }
}

/// A ray that a hit spawns.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spawned {
    pub kind: RayKind,
    /// From where, whereto, and how far.
    pub ray: Ray,
    /// Times its radiance, if it is a shadow ray.
    pub weight: [f32; 3],
    pub medium: u16,
    /// As [`RayRecord::around`], of a mirrored ray; others show as much as the ray that hit.
    pub around: u8,
    pub branch: u32,
}

impl Spawned {
    /// What fills unused room.
    pub(crate) const EMPTY: Self = Self {
        kind: RayKind::Shadow,
        ray: Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 0.0 },
        weight: [0.0; 3],
        medium: 0,
        around: 0,
        branch: 0,
    };

    pub(crate) fn of(child: &Child) -> Option<Self> {
        let (kind, origin, direction, t_max, weight, (medium, around), branch) = match *child {
            Child::None => return None,
            Child::Shadow { origin, direction, t_max, contribution, branch } => {
                (RayKind::Shadow, origin, direction, t_max, contribution, (0, 0), branch)
            }
            Child::Mirror { origin, direction, weight, medium, around, branch } => {
                (RayKind::Mirror, origin, direction, f32::INFINITY, weight, (medium, around), branch)
            }
            Child::Refract { origin, direction, weight, medium, branch } => {
                (RayKind::Refract, origin, direction, f32::INFINITY, weight, (medium, 0), branch)
            }
        };
        Some(Self { kind, ray: Ray { origin, direction, t_min: 0.0, t_max }, weight, medium, around, branch })
    }

    /// As it travels from a hit.
    pub(crate) fn record<P: Pages + ?Sized>(&self, hit: &HitRecord, scene: &Scene<'_, P>) -> RayRecord {
        let Self { kind, ray, weight, medium, around, branch } = *self;
        let origin = hit.origin;
        let (t_end, medium) = if !scene.has_textures() {
            (ray.t_max, medium)
        } else if kind == RayKind::Shadow {
            (ray.t_max, (hit.footprint.to_bits() >> 16) as u16)
        } else {
            let [width, spread] = RayRecord { t_end: hit.footprint, ..RayRecord::zeroed() }.footprint();
            let spread = spread + spawn::opening(&scene.shading, &hit.facing);
            (RayRecord::packed_footprint([width, spread]), medium)
        };
        RayRecord {
            origin: ray.origin.to_array(),
            direction: ray.direction.to_array(),
            t_max: ray.t_max,
            t_end,
            id: hit.child_id(branch),
            primitive: Candidate::NOTHING,
            weight,
            pixel: origin.pixel,
            tile: origin.tile,
            epoch: origin.epoch,
            home: origin.home,
            page: FROM_ROOT,
            medium,
            kind: kind as u8,
            depth: hit.depth + u8::from(kind != RayKind::Shadow),
            // Shadow rays go straight through glass, with their part of what is behind.
            around: if kind == RayKind::Mirror { around } else { hit.around },
            ..RayRecord::zeroed()
        }
    }
}

/// Takes in a ray whose nearest hit is known, and whose hit's page is at hand: it becomes a record, or it ends here.
/// A hit that its page does not have (from a peer that lies) is no hit, and no entry: its tile will not balance.
///
/// # Errors
/// The ray as it goes on: from the root behind what it passes, or with the page of texels that it wants, and its hit. Nothing has
/// been told to `sink` then.
pub fn begin<S: Sink, P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    ray: &RayRecord,
    hit: &Hit,
    sink: &mut S,
    counts: &mut Counts,
    walks: &mut walk::Counts,
) -> Result<Option<HitRecord>, RayRecord> {
    let origin = Origin::of(ray);
    if !hit.candidate.is_hit() {
        let seen: [f32; 3] = match scene.layer {
            Layer::Light => {
                let around = around(scene, ray, walks).map_err(|page| wants(ray, hit, page))?;
                core::array::from_fn(|c| ray.weight[c] * around[c])
            }
            layer => layer.of_nothing(),
        };
        add(sink, &origin, seen);
        sink.ended(&origin, ray.id.wrapping_neg());
        return Ok(None);
    }
    let Some(page) = scene.resident.pages.page(hit.page) else { return Ok(None) };
    let Some((surface, uv)) = place(&page, ray, hit) else { return Ok(None) };
    let flags = flags(scene, surface.material);
    let looked = if flags & (Material::DETAIL | Material::CUTOUT | Material::SINGLE_SIDED) == 0 {
        None
    } else {
        look(scene, &page, ray, hit, (&surface, uv), flags, walks)?
    };
    let (surface, look, emission) = match looked {
        None => (surface, Look::PLAIN, [1.0; 3]),
        Some(Seen { look, emission, shading_normal }) => (Surface { shading_normal, ..surface }, look, emission),
    };
    counts.hits += 1;
    if scene.layer != Layer::Light {
        let material = scene.shading.materials.get(usize::from(surface.material)).map(|material| look.of(material));
        add(sink, &origin, scene.layer.of(&surface, material.as_ref(), scene.eye));
        sink.ended(&origin, ray.id.wrapping_neg());
        return Ok(None);
    }
    let facing = Facing::new(&surface, look);
    let weight = match ray.medium {
        0 => ray.weight,
        medium => spawn::absorbed(&scene.shading, medium, hit.candidate.t, ray.weight),
    };
    add(sink, &origin, spawn::local(&scene.shading, &facing, emission, weight));
    let end = spawn::children(&scene.shading, &surface);
    let footprint = if scene.has_textures() { RayRecord::packed_footprint(footprint_at(ray, hit)) } else { 0.0 };
    Ok(Some(HitRecord {
        facing,
        weight,
        id: ray.id,
        end,
        footprint,
        origin,
        depth: ray.depth,
        around: ray.around,
        ..HitRecord::EMPTY
    }))
}

/// What a ray sees that hits nothing, or the page of texels that says it and is not at hand.
fn around<P: Pages + ?Sized>(scene: &Scene<'_, P>, ray: &RayRecord, walks: &mut walk::Counts) -> Result<[f32; 3], u32> {
    let environment = &scene.shading.maps.environment;
    let hidden = ray.kind == RayKind::Primary as u8 && environment.sky.flags & Sky::HIDDEN != 0;
    if !environment.is_there() || hidden {
        return Ok(scene.background);
    }
    let direction = Vec3::from(ray.direction);
    let [_, spread] = ray.footprint();
    // What a ray grows by with each unit of its length.
    let spread = spread / libm::sqrtf(direction.dot(direction));
    let textures = scene.shading.maps.textures;
    let seen = environment.radiance(textures, scene.resident.pages, direction, spread, &mut walks.look_ups)?;
    let share = share_of(ray.around);
    Ok(seen.map(|c| c * share))
}

/// What textures say at a hit, if the material has any and the ray does not pass it.
#[inline(never)]
fn look<P: Pages + ?Sized>(
    scene: &Scene<'_, P>,
    page: &PageView<'_>,
    ray: &RayRecord,
    hit: &Hit,
    (surface, uv): (&Surface, [f32; 2]),
    flags: u32,
    walks: &mut walk::Counts,
) -> Result<Option<Seen>, RayRecord> {
    let cut = flags & Material::CUTOUT != 0;
    let coverage = if cut { covers(scene, page, ray, hit, (surface, uv), walks) } else { Ok(1.0) };
    let coverage = coverage.map_err(|page| wants(ray, hit, page))?;
    if u32::from(ray.passed) < SHADOW_CHAIN_MAX && spawn::passes(&scene.shading, surface, coverage) {
        return Err(RayRecord {
            origin: spawn::past(surface).to_array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
            t_end: if scene.has_textures() { RayRecord::packed_footprint(footprint_at(ray, hit)) } else { ray.t_end },
            primitive: Candidate::NOTHING,
            page: FROM_ROOT,
            passed: ray.passed + 1,
            settled: 0,
            tries: 0,
            ..*ray
        });
    }
    if flags & Material::DETAIL == 0 {
        return Ok(None);
    }
    let detail = detail(page, ray, hit, surface, uv);
    let seen = hybray_shading::seen(&scene.shading, scene.resident.pages, surface, &detail, &mut walks.look_ups);
    seen.map(Some).map_err(|page| wants(ray, hit, page))
}

/// Zero adds nothing, and is not sent.
pub(crate) fn add<S: Sink>(sink: &mut S, origin: &Origin, radiance: [f32; 3]) {
    if radiance != [0.0; 3] {
        sink.contribute(origin, radiance);
    }
}
