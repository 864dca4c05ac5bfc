//! Boxes: distances before the own box's near side, and rays that lie in faces.

use crate::random::Random;
use hybray_geometry::{Aabb, Candidate, Ray, RayKernel, Triangle, Vec3};

/// Woop's distance as [`Triangle::hit`] has it before it is clamped.
pub fn unclamped(ray: &RayKernel, v: &[Vec3; 3]) -> f32 {
    let [x, y, z] = ray.axes;
    let (o, s) = (ray.origin, ray.shear);
    let corner = v.map(|p| {
        let away = p[z] - o[z];
        (p[x] - o[x] - s[0] * away, p[y] - o[y] - s[1] * away, s[2] * away)
    });
    let [a, b, c] = corner;
    let edge = |p: (f32, f32, f32), q: (f32, f32, f32)| {
        let e = p.0 * q.1 - p.1 * q.0;
        if e == 0.0 { (f64::from(p.0) * f64::from(q.1) - f64::from(p.1) * f64::from(q.0)) as f32 } else { e }
    };
    // As the test has it: if one is zero, all three are taken from f64.
    let plain = |p: (f32, f32, f32), q: (f32, f32, f32)| p.0 * q.1 - p.1 * q.0;
    let zero = [(c, b), (a, c), (b, a)].iter().any(|&(p, q)| plain(p, q) == 0.0);
    let wide = |p: (f32, f32, f32), q: (f32, f32, f32)| {
        (f64::from(p.0) * f64::from(q.1) - f64::from(p.1) * f64::from(q.0)) as f32
    };
    let of = |p, q| if zero { wide(p, q) } else { edge(p, q) };
    let (u, v, w) = (of(c, b), of(a, c), of(b, a));
    (u * a.2 + v * b.2 + w * c.2) / (u + v + w)
}

fn ray(origin: Vec3, direction: Vec3) -> RayKernel {
    RayKernel::new(&Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY })
}

#[test]
fn clamped_distances_never_lie_before_the_own_box() {
    let mut random = Random(1);
    let (mut hits, mut before, mut beyond) = (0, 0, 0);
    for i in 0..400_000 {
        let mut v = [random.vec(), random.vec(), random.vec()];
        let plane = random.signed();
        v.iter_mut().for_each(|p| p[i % 3] = plane);
        let triangle = Triangle { v };
        let ray = ray(random.vec() * 2.0, random.vec());
        let Some(hit) = triangle.hit(&ray, 0, &Candidate::none(f32::INFINITY)) else { continue };
        hits += 1;
        let (near, far) = ray.slab(&triangle.aabb());
        let raw = unclamped(&ray, &v);
        let (first, last) = ray.slab(&Aabb::around(&v));
        before += usize::from(raw < first);
        beyond += usize::from(raw > last);
        assert!(near <= hit.t && hit.t <= far);
        assert_eq!(
            hit.t.to_bits(),
            raw.clamp(near, far).to_bits(),
            "the formula here is the test's: {triangle:?} {ray:?}"
        );
    }
    let share = |n: usize| 100.0 * n as f64 / hits as f64;
    eprintln!(
        "axis-aligned triangles: of {hits} hits {:.1} % lie before the near side of the box around the \
         vertices, {:.1} % beyond its far side, before they are clamped",
        share(before),
        share(beyond)
    );
    assert!(share(before) > 5.0, "the rule is needed: {before} of {hits}");
}

/// The usual slab test, with `min` and `max` that drop NaN.
fn usual_slab(o: Vec3, d: Vec3, aabb: &Aabb) -> bool {
    let (mut near, mut far) = (0f32, f32::INFINITY);
    for i in 0..3 {
        let (a, b) = ((aabb.lo[i] - o[i]) * (1.0 / d[i]), (aabb.hi[i] - o[i]) * (1.0 / d[i]));
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far
}

#[test]
fn rays_in_faces_are_in_their_boxes() {
    let mut random = Random(2);
    let (mut usual, mut ours) = (0, 0);
    let rays = 100_000;
    for i in 0..rays {
        let (a, b) = (random.vec(), random.vec());
        let aabb = Aabb::around(&[a, b]);
        let axis = i % 3;
        let mut target = aabb.lo + (aabb.hi - aabb.lo) * Vec3::new(random.unit(), random.unit(), random.unit());
        target[axis] = if random.below(2) == 0 { aabb.lo[axis] } else { aabb.hi[axis] };
        let mut direction = random.direction();
        direction[axis] = if random.below(2) == 0 { 0.0 } else { -0.0 };
        if random.below(4) == 0 {
            // In an edge of the box too.
            let other = (axis + 1) % 3;
            target[other] = aabb.hi[other];
            direction[other] = 0.0;
        }
        if direction == Vec3::ZERO {
            continue;
        }
        // A whole number of steps away, so that the origin stays in the plane.
        let mut origin = target - direction * 4.0;
        origin[axis] = target[axis];
        let (near, far) = ray(origin, direction).slab(&aabb);
        ours += usize::from(!(near <= far));
        usual += usize::from(!usual_slab(origin, direction, &aabb));
    }
    eprintln!("of {rays} rays in faces of boxes the slab test with f32::min and max misses {usual}, ours {ours}");
    assert_eq!(ours, 0);
    assert!(usual > rays / 2, "{usual}");
}
