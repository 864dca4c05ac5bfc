//! Rays that start on a primitive do not meet it again on the side that they leave to: the errors of a hit, as [`surface`]
//! adds them up, are enough, and not much more than enough.

mod world;

use hybray_bintree::walk::Stack;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Cone, Ray, RayKernel, Sphere, Triangle, Vec3};
use hybray_shading::{Material, offset_origin};
use hybray_tracer::{Together, Walker, surface};
use hybray_wire::RayRecord;
use world::{Shape, World};

/// Numbers that depend on nothing but the seed.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
    fn vec(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
    fn decades(&mut self, lo: f32, hi: f32) -> f32 {
        10f32.powf(lo + (hi - lo) * self.unit())
    }
}

/// The first hit of the primitive alone.
fn hit(shape: &Shape, ray: &Ray) -> Option<Candidate> {
    let (kernel, none) = (RayKernel::new(ray), Candidate::none(ray.t_max));
    match shape {
        Shape::Triangle(t) => t.hit(&kernel, 0, &none),
        Shape::Sphere(s) => s.hit(&kernel, 0, &none),
        Shape::Cone(c) => c.hit(&kernel, 0, &none),
    }
}

/// Hits `rounds` primitives and leaves each again, to one or both sides, in 24 directions.
fn check(name: &str, rounds: usize, both_sides: bool, mut make: impl FnMut(&mut Random) -> (Shape, Vec3, Vec3)) {
    let mut random = Random(name.len() as u64);
    let (mut hits, mut again, mut left) = (0, 0, 0);
    let mut offsets = Vec::new();
    for _ in 0..rounds {
        let (shape, origin, target) = make(&mut random);
        let direction = (target - origin) / (target - origin).length();
        World::new(vec![(shape, 0)], vec![Material::MATT], vec![]).with(|scene| {
            let (mut stack, mut together) = (Stack::new(), Together::new());
            let mut walker = Walker::new(Kernels::Portable, &mut stack, &mut together);
            let mut record = RayRecord {
                origin: origin.to_array(),
                direction: direction.to_array(),
                t_max: f32::INFINITY,
                primitive: Candidate::NOTHING,
                page: RayRecord::FROM_ROOT,
                ..bytemuck::Zeroable::zeroed()
            };
            let found = walker.nearest(scene, &mut record).expect("every page is at hand");
            if !found.candidate.is_hit() {
                return;
            }
            hits += 1;
            let place = surface(&scene.resident.pages[found.page as usize], &record, &found).unwrap();
            for side in if both_sides { &[1.0, -1.0][..] } else { &[1.0] } {
                let normal = place.geometric_normal * *side;
                let start = offset_origin(place.position, place.error, normal, normal);
                offsets.push((start - place.position).length());
                for i in 0..24 {
                    let any = random.vec();
                    let flat = any - normal * any.dot(normal);
                    // Every other one leaves as flat as spawned rays may.
                    let up = if i % 2 == 0 { random.decades(-4.5, -1.0) } else { random.unit() };
                    let way = flat / flat.length() + normal * up;
                    let length = if i % 3 == 0 { random.decades(-2.0, 2.0) } else { 1.0 / way.length() };
                    let ray = Ray { origin: start, direction: way * length, t_min: 0.0, t_max: f32::INFINITY };
                    left += 1;
                    again += usize::from(hit(&shape, &ray).is_some());
                }
            }
        });
    }
    offsets.sort_by(f32::total_cmp);
    eprintln!(
        "{name}: of {left} rays from {hits} hits {again} meet their primitive again; half start less than {:.1e} away",
        offsets[offsets.len() / 2]
    );
    assert!(hits * 3 > rounds, "{name}: {hits} hits");
    assert_eq!(again, 0, "{name}");
}

#[test]
fn off_triangles() {
    let any = |size: (f32, f32), at: f32| {
        move |random: &mut Random| {
            let (at, size) = (random.vec() * at, random.decades(size.0, size.1));
            let v = [at, at + random.vec() * size, at + random.vec() * size];
            let (b, c) = (random.unit(), random.unit());
            let target = v[0] + (v[1] - v[0]) * (b * (1.0 - c)) + (v[2] - v[0]) * (b * c);
            (Shape::Triangle(Triangle { v }), random.vec(), target)
        }
    };
    check("triangles of the scene's size", 1500, true, any((-1.0, 0.0), 0.5));
    check("small triangles", 1500, true, any((-4.0, -2.0), 1.0));
    check("triangles at 0", 1500, true, any((-3.0, 0.0), 0.0));
    check("axis-aligned walls", 1500, true, |random| {
        let (plane, axis) = (if random.unit() < 0.5 { 0.0 } else { random.vec().x }, (random.unit() * 2.99) as usize);
        let mut v = [random.vec(), random.vec(), random.vec()];
        v.iter_mut().for_each(|p| p[axis] = plane);
        let target = (v[0] + v[1] + v[2]) / 3.0;
        (Shape::Triangle(Triangle { v }), random.vec(), target)
    });
}

#[test]
fn off_spheres_and_cones() {
    check("spheres", 1500, false, |random| {
        let (centre, radius) = (random.vec(), random.decades(-3.0, 0.0));
        let out = random.vec();
        let origin = centre + out * (random.decades(0.3, 2.0) * radius / out.length());
        (Shape::Sphere(Sphere { centre, radius }), origin, centre + random.vec() * (radius * 0.8))
    });
    check("cones", 1500, false, |random| {
        let (base, size) = (random.vec(), random.decades(-2.0, 0.0));
        let axis = random.vec() * size;
        let (base_radius, apex_radius) = (0.3 * size, [0.0, 0.3, 0.1][(random.unit() * 2.99) as usize] * size);
        let cone = Cone { base, base_radius, apex: base + axis, apex_radius };
        let across = axis.any_orthonormal_vector();
        let side = (across + random.vec() * 0.3) * (4.0 * size);
        (Shape::Cone(cone), base + side, base + axis * random.unit() * 0.6)
    });
}
