//! Distant spheres: the usual quadratic against ours.

use crate::random::Random;
use hybray_geometry::{Candidate, Ray, RayKernel, Sphere, Vec3};

/// `b^2 - 4ac` in `f32`, as it is usually written: the first root at or after 0.
fn usual(ray: &Ray, sphere: &Sphere) -> Option<f32> {
    let (f, d) = (ray.origin - sphere.centre, ray.direction);
    let (a, b, c) = (d.dot(d), 2.0 * f.dot(d), f.dot(f) - sphere.radius * sphere.radius);
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let (t0, t1) = ((-b - root) / (2.0 * a), (-b + root) / (2.0 * a));
    if t0 >= 0.0 { Some(t0) } else { (t1 >= 0.0).then_some(t1) }
}

/// In `f64`: the distance, and by how much of the radius the ray passes inside (or outside) of the outline.
fn truth(ray: &Ray, sphere: &Sphere) -> (Option<f64>, f64) {
    let (f, d) = (ray.origin.as_dvec3() - sphere.centre.as_dvec3(), ray.direction.as_dvec3());
    let r = f64::from(sphere.radius);
    let along = -f.dot(d) / d.dot(d);
    let nearest = (f + d * along).length();
    let half = r * r - nearest * nearest;
    let t = (half >= 0.0).then(|| along - half.sqrt() / d.length());
    (t, (nearest / r - 1.0).abs())
}

/// Shares of rays, in percent, for which hit or miss is wrong: the usual form's and ours; then those for which the hit
/// is off by more than 1 % of the radius.
fn check(distance: f32) -> [f64; 4] {
    let mut random = Random(distance.to_bits().into());
    let (mut rays, mut wrong) = (0, [0; 4]);
    while rays < 50_000 {
        let sphere = Sphere { centre: random.vec(), radius: 1.0 };
        let origin = sphere.centre + random.direction() * distance;
        let target = sphere.centre + random.vec() * 1.2;
        let ray = Ray { origin, direction: (target - origin) / distance, t_min: 0.0, t_max: f32::INFINITY };
        let (t, clear) = truth(&ray, &sphere);
        if clear < 0.01 {
            continue;
        }
        rays += 1;
        // At this distance a coordinate itself is known to 1e-7 of the distance only.
        let most = 0.01 + 4e-7 * f64::from(distance);
        let kernel = RayKernel::new(&ray);
        let ours = sphere.hit(&kernel, 0, &Candidate::none(f32::INFINITY)).map(|c| c.t);
        for (i, found) in [usual(&ray, &sphere), ours].into_iter().enumerate() {
            wrong[i] += usize::from(found.is_some() != t.is_some());
            let off = found.zip(t).is_some_and(|(found, t)| (f64::from(found) - t).abs() > most);
            wrong[2 + i] += usize::from(off);
        }
    }
    let share = wrong.map(|n| 100.0 * n as f64 / f64::from(rays));
    eprintln!(
        "spheres from {distance} radii: the usual quadratic takes hit for miss or miss for hit for {:.2} % of rays, ours \
         for {:.2} %; further from the surface than 1 % of the radius: {:.2} %, {:.2} %",
        share[0], share[1], share[2], share[3]
    );
    share
}

#[test]
fn distant_spheres_are_where_they_are() {
    for distance in [10.0, 100.0, 1_000.0, 10_000.0] {
        let [usual, ours, _, ours_off] = check(distance);
        assert_eq!((ours, ours_off), (0.0, 0.0), "{distance}");
        assert!(distance < 10_000.0 || usual > 5.0, "the usual form does fail: {usual}");
    }
}

/// A sphere's distance, like a triangle's, is clamped to the own box, and the second hit counts where the first is behind.
#[test]
fn from_inside_the_far_side_is_hit() {
    let mut random = Random(9);
    for _ in 0..20_000 {
        let sphere = Sphere { centre: random.vec() * 10.0, radius: random.decades(-3.0, 2.0) };
        let origin = sphere.centre + random.vec() * (0.5 * sphere.radius);
        let kernel = RayKernel::new(&Ray { origin, direction: random.direction(), t_min: 0.0, t_max: f32::INFINITY });
        let hit = sphere.hit(&kernel, 3, &Candidate::none(f32::INFINITY)).expect("no way out of a sphere");
        let at = Vec3::from_array(kernel.origin).as_dvec3()
            + Vec3::from_array(kernel.direction).as_dvec3() * f64::from(hit.t);
        let radius = (at - sphere.centre.as_dvec3()).length();
        let r = f64::from(sphere.radius);
        assert!((radius / r - 1.0).abs() < 1e-5 + 1e-6 / r, "{radius} {r}");
    }
}
