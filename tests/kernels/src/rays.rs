//! The rays that all engines are given.

use hybray::prepare::Prepared;
use hybray_bintree::walk::{Counts, Stack, nearest};
use hybray_geometry::{Candidate, Ray, Vec3};
use hybray_shading::{Child, Light, LightKind, Look, Scene as Shading, Surface, offset_origin, spawn};
use hybray_tests::Random;
use hybray_tracer::{Scene, surface};
use hybray_wire::RayRecord;

use crate::engine::Kind;

/// Of the bounce rays' directions.
const SEED: u64 = 4;

/// Primary rays of the first camera along Morton's curve, so that 256 of them are a square of 16 pixels; from their
/// hits, in the same order, a shadow ray where the surface faces the light, and a bounce ray. All start where our
/// tracer's would.
pub fn sets(prepared: &Prepared, scene: &Scene<'_>, primary: Vec<Ray>) -> Vec<(Kind, Vec<Ray>)> {
    let light = [light(prepared, scene)];
    // Without materials every surface is matt.
    let shading = Shading { materials: &[], lights: &light, shadow_rays: 1, ..scene.shading };
    let (mut stack, mut counts, mut random) = (Stack::new(), Counts::default(), Random(SEED));
    let (mut shadow, mut bounce) = (Vec::new(), Vec::new());
    for ray in &primary {
        let hit = nearest(hybray_tests::kernels(), &scene.resident, ray, &mut stack, &mut counts);
        let page = hit.candidate.is_hit().then(|| scene.resident.pages[hit.page as usize]);
        let Some(place) = page.and_then(|page| surface(&page, &record(ray), &hit)) else { continue };
        if let Child::Shadow { origin, direction, t_max, .. } =
            spawn::child(&shading, &spawn::Facing::new(&place, Look::PLAIN), [1.0; 3], 1, 0, 0)
        {
            shadow.push(Ray { origin, direction, t_min: 0.0, t_max });
        }
        bounce.push(bounced(&place, &mut random));
    }
    vec![(Kind::Primary, primary), (Kind::Shadow, shadow), (Kind::Bounce, bounce)]
}

/// The scene's first light that is a point or a spot, as a point; without one, a point above a corner of the scene.
fn light(prepared: &Prepared, scene: &Scene<'_>) -> Light {
    let has_place = |light: &&Light| matches!(light.kind(), LightKind::Point | LightKind::Spot);
    let position = scene.shading.lights.iter().find(has_place).map_or_else(
        || {
            let unit = 2f32.powi(prepared.packed.scale_log2);
            let [lo, hi] = prepared.extent.map(|corner| Vec3::from(corner) * unit);
            (hi + (hi - lo)).to_array()
        },
        |light| light.position,
    );
    Light { position, colour: [1.0; 3], ..Light::default() }
}

fn record(ray: &Ray) -> RayRecord {
    RayRecord {
        origin: ray.origin.to_array(),
        direction: ray.direction.to_array(),
        t_min: ray.t_min,
        t_max: ray.t_max,
        primitive: Candidate::NOTHING,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// A ray from `place`, with a cosine distribution around the normal on the side from which it is seen: a point of the
/// unit sphere around the normal's tip.
fn bounced(place: &Surface, random: &mut Random) -> Ray {
    let normal = place.geometric_normal;
    let normal = if normal.dot(place.incoming) > 0.0 { -normal } else { normal };
    let direction = loop {
        let point = random.vec();
        let square = point.dot(point);
        let direction = normal + point / square.sqrt();
        // In the ball, not too near its centre, and not straight into the surface.
        if (1e-4..=1.0).contains(&square) && direction.dot(normal) > 1e-3 {
            break direction / direction.length();
        }
    };
    let origin = offset_origin(place.position, place.error, normal, normal);
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}
