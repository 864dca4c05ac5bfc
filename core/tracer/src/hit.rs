//! From a walk's hit to a surface, and the record that spawns its rays.

use hybray_bintree::cut::FLAT;
use hybray_bintree::walk::Hit;
use hybray_geometry::{Ray, RayKernel, SurfacePoint, Vec3, gamma};
use hybray_scene::{BLOCK, Kind, PageView, Slot};
use hybray_shading::spawn::{self, Facing};
use hybray_shading::{Child, Surface, id, unpack_normal};
use hybray_wire::RayRecord;

/// Whom a ray and its children are traced for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Origin {
    /// Number of the tile.
    pub tile: u32,
    /// The tile's epoch.
    pub epoch: u16,
    /// The node that keeps the tile's sums.
    pub home: u16,
    /// Number of the pixel in its tile, row by row.
    pub pixel: u8,
}

impl Origin {
    /// Whom `ray` is traced for.
    #[must_use]
    pub fn of(ray: &RayRecord) -> Self {
        Self { tile: ray.tile, epoch: ray.epoch, home: ray.home, pixel: ray.pixel }
    }
}

/// A hit that is spawning its children.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HitRecord {
    /// Where.
    pub facing: Facing,
    /// The weight of the ray that hit.
    pub weight: [f32; 3],
    /// The ray that hit.
    pub id: u64,
    /// Sum of the ids of the children so far, wrapping: what the ray's ledger entry will add.
    pub children: u64,
    /// Next child.
    pub cursor: u32,
    /// One past the last child.
    pub end: u32,
    /// Children of the cursor's 64 that were traced with others before their turn, the lowest bit for a multiple of 64.
    pub done: u64,
    /// Children before this have been tried together with others.
    pub tried: u32,
    /// For whom.
    pub origin: Origin,
    /// 1 for a primary ray's hit.
    pub depth: u8,
}

const _: () = assert!(size_of::<HitRecord>() <= 160);

impl HitRecord {
    /// What fills a lane before it is used.
    pub const EMPTY: Self = Self {
        facing: Facing::EMPTY,
        weight: [0.0; 3],
        id: 0,
        children: 0,
        cursor: 0,
        end: 0,
        done: 0,
        tried: 0,
        origin: Origin { tile: 0, epoch: 0, home: 0, pixel: 0 },
        depth: 0,
    };
}

impl HitRecord {
    /// Whether `child`, one of the cursor's 64, was traced before its turn.
    pub(crate) fn is_done(&self, child: u32) -> bool {
        child / 64 == self.cursor / 64 && self.done >> (child % 64) & 1 != 0
    }

    /// The cursor's child has had its turn.
    pub(crate) fn advance(&mut self) {
        self.cursor += 1;
        if self.cursor.is_multiple_of(64) {
            self.done = 0;
        }
    }

    /// The next child's turn is that of one that was not traced before.
    pub(crate) fn pass_over_done(&mut self) {
        while self.cursor < self.end && self.is_done(self.cursor) {
            self.advance();
        }
    }

    /// The child at `cursor`.
    pub(crate) fn child(&self, shading: &hybray_shading::Scene<'_>, cursor: u32) -> Child {
        spawn::child(shading, &self.facing, self.weight, u32::from(self.depth), self.id, cursor)
    }

    /// The id of a child.
    pub(crate) fn child_id(&self, branch: u32) -> u64 {
        id::child_id(self.id, branch)
    }

    /// A child of this id is traced now: the record's entry will add it.
    pub(crate) fn adopt(&mut self, id: u64) {
        self.children = self.children.wrapping_add(id);
    }

    /// What the ray's ledger entry adds once all children have been adopted.
    pub(crate) fn entry(&self) -> u64 {
        self.children.wrapping_sub(self.id)
    }
}

/// The place of `hit` on its primitive, found by `ray` in `page`.
#[must_use]
pub fn surface_point(page: &PageView<'_>, ray: &Ray, hit: &Hit) -> SurfacePoint {
    let kernel = RayKernel::new(ray);
    let (t, slot) = (hit.candidate.t, hit.slot);
    match slot.kind() {
        Kind::Triangle => page.body.triangle(slot.number()).surface(&kernel, t),
        Kind::Sphere => page.spheres[slot.number() / BLOCK].get(slot.number() % BLOCK).surface(&kernel, t),
        Kind::Cone => page.cones[slot.number()].get().surface(&kernel, t),
    }
}

/// What shading sees of `hit`; `None` if `page` has nothing in that place.
///
/// The error given to shading is that of the position, and on every axis that of the test which a ray starting there will
/// be put to.
#[must_use]
pub fn surface(page: &PageView<'_>, ray: &RayRecord, hit: &Hit) -> Option<Surface> {
    let held = match hit.slot.kind() {
        Kind::Triangle => page.body.triangle_lanes(),
        Kind::Sphere => page.spheres.len() * BLOCK,
        Kind::Cone => page.cones.len(),
    };
    if hit.slot.number() >= held {
        return None;
    }
    let point = surface_point(page, &ray.ray(), hit);
    let flat = Surface {
        position: point.position,
        error: point.error + Vec3::splat(point.test_error + gamma(2) * point.position.abs().max_element()),
        geometric_normal: point.normal,
        shading_normal: point.normal,
        shadow_offset: Vec3::ZERO,
        incoming: ray.direction.into(),
        material: page.material(hit.slot),
        medium: ray.medium,
    };
    Some(match vertex_normals(page, hit.slot) {
        Some(packed) => {
            let corners = page.body.triangle(hit.slot.number()).v;
            let [u, v] = point.uv;
            flat.smooth(corners, packed.map(unpack_normal), [1.0 - u - v, u, v])
        }
        None => flat,
    })
}

fn vertex_normals(page: &PageView<'_>, slot: Slot) -> Option<[u32; 3]> {
    if slot.kind() != Kind::Triangle {
        return None;
    }
    page.body.normals(slot.number()).filter(|packed| !packed.contains(&FLAT))
}
