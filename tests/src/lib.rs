//! What the whole-system tests share: random numbers from a seed, scenes that are awkward, brute force, rays and
//! pictures.
#![forbid(unsafe_code)]

mod picture;
mod rays;
mod turns;
mod within;

pub use picture::{Picture, drawn, kernels, scene};
pub use rays::{camera_rays, close_rays, random_ray, rays_at};
pub use turns::{Post, Stranger, turns};
pub use within::within;

use hybray::build::Source;
use hybray::model::{Mesh, Model, NamedMaterial, Sphere};
use hybray_bintree::cut::Primitives;
use hybray_geometry::{Candidate, Ray, RayKernel, Vec3};
use hybray_scene::Kind;

/// Numbers that depend on nothing but the seed.
pub struct Random(pub u64);

impl Random {
    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// -1 to 1.
    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }

    /// Below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// The same things in another order.
    pub fn shuffled<T>(&mut self, mut things: Vec<T>) -> Vec<T> {
        for i in (1..things.len()).rev() {
            things.swap(i, self.below(i + 1));
        }
        things
    }

    /// In the cube from -1 to 1.
    pub fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// The nearest hit by testing every primitive with the function that the pages' kernels are.
#[must_use]
pub fn brute_force(source: &Source<'_>, ray: &Ray) -> Candidate {
    let kernel = RayKernel::new(ray);
    (0..source.len()).fold(Candidate::none(ray.t_max), |best, id| {
        let hit = match source.aabb(id).0 {
            Kind::Triangle => source.triangle(id).hit(&kernel, id, &best),
            Kind::Sphere => source.sphere(id).hit(&kernel, id, &best),
            Kind::Cone => source.cone(id).hit(&kernel, id, &best),
        };
        hit.unwrap_or(best)
    })
}

fn model(triangles: Vec<[Vec3; 3]>, spheres: Vec<Sphere>) -> Model {
    let positions = triangles.iter().flatten().map(|v| v.to_array()).collect();
    let triangles = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Model {
        meshes: vec![Mesh { positions, triangles, ..Mesh::default() }],
        spheres,
        materials: vec![NamedMaterial::default()],
        ..Model::default()
    }
}

/// Triangles and spheres of all sizes at random.
#[must_use]
pub fn soup(seed: u64, count: usize) -> Model {
    let mut random = Random(seed);
    let size = |random: &mut Random| [1.0, 0.1, 0.01][random.below(3)];
    let triangles = (0..count)
        .map(|_| {
            let (at, size) = (random.vec(), size(&mut random));
            [at, at + random.vec() * size, at + random.vec() * size]
        })
        .collect();
    let spheres = (0..count / 4)
        .map(|_| Sphere {
            centre: random.vec().to_array(),
            radius: 0.2 * size(&mut random) * (random.signed().abs() + 0.01),
            material: 0,
        })
        .collect();
    model(triangles, spheres)
}

/// Axis-aligned walls on a coarse grid: coplanar, overlapping, doubled, with splits and rays in their planes.
#[must_use]
pub fn walls(seed: u64, count: usize) -> Model {
    let mut random = Random(seed);
    let mut grid = move || Vec3::new(random.signed(), random.signed(), random.signed()) * 4.0;
    let triangles = (0..count)
        .flat_map(|i| {
            let (a, b) = (grid().round() * 0.25, grid().round() * 0.25);
            let axis = i % 3;
            let corner = |u: bool, v: bool| {
                let mut p = a;
                p[(axis + 1) % 3] = if u { b[(axis + 1) % 3] } else { a[(axis + 1) % 3] };
                p[(axis + 2) % 3] = if v { b[(axis + 2) % 3] } else { a[(axis + 2) % 3] };
                p
            };
            let [c00, c10, c11, c01] =
                [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
            [[c00, c10, c11], [c00, c11, c01]]
        })
        .collect();
    model(triangles, Vec::new())
}

/// All in one place, or in a line: nothing that a plane could separate.
#[must_use]
pub fn degenerate(count: usize) -> Model {
    let triangles = (0..count)
        .map(|i| {
            let at = Vec3::new(0.0, 0.0, if i % 2 == 0 { 0.5 } else { (i / 64) as f32 * 1e-3 });
            [at, at + Vec3::X, at + Vec3::Y]
        })
        .collect();
    let spheres = vec![Sphere { centre: [0.5; 3], radius: 0.25, material: 0 }; count / 2];
    model(triangles, spheres)
}
