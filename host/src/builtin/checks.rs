//! What the tests of all built-in scenes ask.

use super::vector::{cross, dot, sub, unit};
use crate::model::{Mesh, Model};

/// Everything finite, in range and not degenerate.
#[track_caller]
pub fn sound(model: &Model) {
    let finite = |v: &[f32]| v.iter().all(|x| x.is_finite());
    let materials = model.materials.len();
    for mesh in &model.meshes {
        let name = &mesh.name;
        assert!(usize::from(mesh.material) < materials, "{name}");
        assert!(mesh.positions.iter().all(|p| finite(p)), "{name}");
        assert!(mesh.normals.is_empty() || mesh.normals.len() == mesh.positions.len(), "{name}");
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
            assert!(a != b && b != c && c != a, "{name}: {t:?} at {a:?} {b:?} {c:?}");
        }
    }
    for s in &model.spheres {
        assert!(finite(&s.centre) && s.radius.is_finite() && s.radius > 0.0, "{s:?}");
        assert!(usize::from(s.material) < materials);
    }
    for c in &model.cones {
        assert!(finite(&c.base) && finite(&c.apex) && c.base != c.apex, "{c:?}");
        assert!(c.base_radius >= 0.0 && c.apex_radius >= 0.0 && c.base_radius + c.apex_radius > 0.0, "{c:?}");
        assert!(usize::from(c.material) < materials);
    }
    assert!(!model.lights.is_empty() && !model.cameras.is_empty());
    for light in &model.lights {
        let numbers = [light.position, light.axis, light.u, light.v, light.colour];
        assert!(finite(numbers.as_flattened()) && light.samples >= 1, "{light:?}");
    }
}

/// Edges that do not belong to exactly two triangles that run along them in opposite directions.
pub fn open_edges(mesh: &Mesh) -> usize {
    let edges = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    let mut all: Vec<([u32; 2], bool)> =
        mesh.triangles.iter().flat_map(edges).map(|[a, b]| ([a.min(b), a.max(b)], a < b)).collect();
    all.sort_unstable();
    all.chunk_by(|a, b| a.0 == b.0).filter(|uses| !matches!(uses, [(_, false), (_, true)])).count()
}

/// What a closed mesh encloses, positive if it faces outward.
pub fn volume(mesh: &Mesh) -> f64 {
    let six = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
        dot(a, cross(b, c))
    };
    mesh.triangles.iter().map(six).sum::<f64>() / 6.0
}

/// Share of the vertices, sphere centres and cone ends (without those of meshes of two triangles, which are grounds
/// and walls) that the first camera's square picture shows.
pub fn share_in_view(model: &Model) -> f64 {
    let camera = &model.cameras[0];
    let eye = camera.eye.map(f64::from);
    let forward = unit(sub(camera.target.map(f64::from), eye));
    let right = unit(cross(forward, camera.up.map(f64::from)));
    let up = cross(right, forward);
    let edge = libm::tan(f64::from(camera.fov_y_degrees) * core::f64::consts::PI / 360.0);
    let shown = |p: [f32; 3]| {
        let v = sub(p.map(f64::from), eye);
        let depth = dot(v, forward);
        depth > f64::from(camera.hither) && dot(v, right).abs() <= edge * depth && dot(v, up).abs() <= edge * depth
    };
    let meshes = model.meshes.iter().filter(|m| m.triangles.len() != 2).flat_map(|m| m.positions.iter().copied());
    let spheres = model.spheres.iter().map(|s| s.centre);
    let cones = model.cones.iter().flat_map(|c| [c.base, c.apex]);
    let (mut seen, mut all) = (0_u64, 0_u64);
    for p in meshes.chain(spheres).chain(cones) {
        seen += u64::from(shown(p));
        all += 1;
    }
    seen as f64 / all as f64
}

/// FNV-1a over everything that makes the geometry, bit by bit.
pub fn fingerprint(model: &Model) -> u64 {
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut eat = |word: u32| {
        for byte in word.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        }
    };
    for mesh in &model.meshes {
        mesh.positions.as_flattened().iter().for_each(|x| eat(x.to_bits()));
        mesh.normals.as_flattened().iter().for_each(|x| eat(x.to_bits()));
        mesh.triangles.as_flattened().iter().for_each(|&i| eat(i));
        eat(u32::from(mesh.material));
    }
    for s in &model.spheres {
        s.centre.iter().chain([&s.radius]).for_each(|x| eat(x.to_bits()));
        eat(u32::from(s.material));
    }
    for c in &model.cones {
        c.base.iter().chain(&c.apex).chain([&c.base_radius, &c.apex_radius]).for_each(|x| eat(x.to_bits()));
        eat(u32::from(c.material));
    }
    hash
}
