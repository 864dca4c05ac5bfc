//! From a walk's hit to a surface, and the record that spawns its rays.

use hybray_bintree::cut::FLAT;
use hybray_bintree::walk::Hit;
use hybray_geometry::{Ray, RayKernel, SurfacePoint, Vec3, gamma};
use hybray_scene::{BLOCK, Kind, PageView, Slot};
use hybray_shading::spawn::{self, Facing};
use hybray_shading::{Child, Detail, Surface, id, unpack_normal};
use hybray_wire::{RayKind, RayRecord};

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
    /// What the ray stood for there, as [`RayRecord::packed_footprint`].
    pub footprint: f32,
    /// For whom.
    pub origin: Origin,
    /// 1 for a primary ray's hit.
    pub depth: u8,
    /// That of the ray that hit: [`RayRecord::around`].
    pub around: u8,
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
        footprint: 0.0,
        origin: Origin { tile: 0, epoch: 0, home: 0, pixel: 0 },
        depth: 0,
        around: 0,
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
    place(page, ray, hit).map(|(surface, _)| surface)
}

/// The surface, and the hit's place on a triangle: shares of its second and third corner.
pub(crate) fn place(page: &PageView<'_>, ray: &RayRecord, hit: &Hit) -> Option<(Surface, [f32; 2])> {
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
    let surface = match vertex_normals(page, hit.slot) {
        Some(packed) => {
            let corners = page.body.triangle(hit.slot.number()).v;
            let [u, v] = point.uv;
            flat.smooth(corners, packed.map(unpack_normal), [1.0 - u - v, u, v])
        }
        None => flat,
    };
    Some((surface, point.uv))
}

/// Half the width of what a ray stands for where it hits, and what is added with each unit of its way from there on.
pub(crate) fn footprint_at(ray: &RayRecord, hit: &Hit) -> [f32; 2] {
    if ray.kind == RayKind::Shadow as u8 {
        return [f32::from_bits(u32::from(ray.medium) << 16), 0.0];
    }
    let [width, spread] = ray.footprint();
    [width + hit.candidate.t * spread, spread]
}

/// What `hit` at `uv` of a triangle tells of textures. Seen from aside, more of the surface is within the footprint: the width that
/// counts is that along the slope (Akenine-Moller et al., *Texture Level of Detail Strategies for Real-Time Ray Tracing*, Ray Tracing
/// Gems, chapter 20, 2019).
pub(crate) fn detail(page: &PageView<'_>, ray: &RayRecord, hit: &Hit, surface: &Surface, uv: [f32; 2]) -> Detail {
    let mut detail = Detail { uv: [0.0; 2], footprint: 0.0, along: [Vec3::ZERO; 2], colour: [1.0; 4] };
    if hit.slot.kind() != Kind::Triangle {
        return detail;
    }
    let number = hit.slot.number();
    let shares = [1.0 - uv[0] - uv[1], uv[0], uv[1]];
    if let Some(corners) = page.colours().get(number) {
        detail.colour = Detail::colour(corners, shares);
    }
    if let Some(&[a, b, c]) = page.coordinates().get(number) {
        let [p, q, r] = page.body.triangle(number).v;
        let (first, second) = (q - p, r - p);
        let ([b_u, b_v], [c_u, c_v]) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let double_area = b_u * c_v - b_v * c_u;
        detail.uv = [0, 1].map(|i| a[i] * shares[0] + b[i] * shares[1] + c[i] * shares[2]);
        if double_area != 0.0 {
            detail.along = [first * c_v - second * b_v, second * b_u - first * c_u].map(|v| v / double_area);
        }
        let across = first.cross(second);
        let [width, _] = footprint_at(ray, hit);
        let direction = surface.incoming;
        let slope = direction.dot(surface.geometric_normal).abs() / libm::sqrtf(direction.dot(direction));
        // Texture coordinates of a unit of length, the mean of both ways.
        let scale = libm::sqrtf(double_area.abs() / libm::sqrtf(across.dot(across)));
        let footprint = 2.0 * width * scale / slope;
        detail.footprint = if footprint.is_finite() { footprint } else { f32::MAX };
    }
    detail
}

fn vertex_normals(page: &PageView<'_>, slot: Slot) -> Option<[u32; 3]> {
    if slot.kind() != Kind::Triangle {
        return None;
    }
    page.body.normals(slot.number()).filter(|packed| !packed.contains(&FLAT))
}
