//! Verdicts against separating axes in `f64`, and boxes that are only just touched.

mod common;

use common::{Random, interval, trees};
use hybray_geometry::{Aabb, Pyramid, Ray, RayKernel, Vec3};
use hybray_pyraclip::{ClipCounts, ClipPyramid, Verdict, classify};

type Wide = [f64; 3];

fn dot(a: Wide, b: Wide) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Wide, b: Wide) -> Wide {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: Wide) -> Wide {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

fn wide(v: Vec3) -> Wide {
    v.to_array().map(f64::from)
}

/// A pyramid by its planes and its edges, both of length 1.
struct Judge {
    apex: Wide,
    normals: [Wide; 4],
    edges: [Wide; 4],
}

impl Judge {
    fn new(pyramid: &Pyramid) -> Self {
        let normals = pyramid.normals.map(|n| unit(wide(n)));
        let inward = normals.iter().fold([0.0; 3], |s, n| [0, 1, 2].map(|k| s[k] + n[k]));
        let edges = [(0, 2), (0, 3), (1, 3), (1, 2)].map(|(i, j)| {
            let edge = unit(cross(normals[i], normals[j]));
            if dot(edge, inward) < 0.0 { edge.map(|x| -x) } else { edge }
        });
        Self { apex: wide(pyramid.apex), normals, edges }
    }

    fn vertices(&self, aabb: &Aabb) -> [Wide; 8] {
        let (lo, hi) = (wide(aabb.lo), wide(aabb.hi));
        std::array::from_fn(|v| [0, 1, 2].map(|k| if v >> k & 1 == 0 { lo[k] } else { hi[k] } - self.apex[k]))
    }

    /// The widest gap between pyramid and box along an axis that can separate two polyhedra: a normal of either, or the
    /// cross product of an edge of each. Less than 0 if they overlap.
    fn gap(&self, aabb: &Aabb) -> f64 {
        let vertices = self.vertices(aabb);
        let mut gap = f64::NEG_INFINITY;
        let mut axis = |w: Wide| {
            if dot(w, w) > 1e-20 {
                let w = unit(w);
                for w in [w, w.map(|x| -x)] {
                    if self.edges.iter().all(|&e| dot(w, e) >= -1e-13) {
                        let most = vertices.iter().map(|&v| dot(w, v)).fold(f64::NEG_INFINITY, f64::max);
                        gap = gap.max(-most);
                    }
                }
            }
        };
        self.normals.into_iter().for_each(&mut axis);
        for k in 0..3 {
            let mut e = [0.0; 3];
            e[k] = 1.0;
            axis(e);
            self.edges.iter().for_each(|&edge| axis(cross(e, edge)));
        }
        gap
    }

    /// How far the vertex that is furthest out is inside.
    fn depth(&self, aabb: &Aabb) -> f64 {
        let vertices = self.vertices(aabb);
        self.normals.iter().flat_map(|&n| vertices.map(|v| dot(n, v))).fold(f64::INFINITY, f64::min)
    }

    fn reach(&self, aabb: &Aabb) -> f64 {
        self.vertices(aabb).iter().map(|&v| dot(v, v).sqrt()).fold(0.0, f64::max)
    }
}

/// Pyramids of all widths and shapes, in any position.
fn any_pyramid(r: &mut Random) -> Option<Pyramid> {
    let forward = r.point(1.0).try_normalize()?;
    let right = forward.cross(r.point(1.0)).try_normalize()?;
    let up = forward.cross(right) + right * r.within(-0.5, 0.5);
    let width = [0.01, 0.1, 0.5, 1.5][r.bits() as usize % 4];
    let (x, y) = (width * r.within(0.3, 1.0), width * r.within(0.3, 1.0));
    let mut corner =
        |i: f32, j: f32| forward + right * (i * x * r.within(0.8, 1.2)) + up * (j * y * r.within(0.8, 1.2));
    let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    Pyramid::through(r.point(2.0), corners)
}

/// Boxes of all sizes and shapes, near the pyramid, before and behind its apex.
fn any_box(r: &mut Random, pyramid: &Pyramid) -> Aabb {
    let middle: Vec3 = pyramid.normals.iter().map(|n| n.normalize()).sum();
    let far = r.within(-0.5, 3.0);
    let centre = pyramid.apex + middle.normalize() * far + r.point(1.0) * [0.05, 0.3, 1.0][r.bits() as usize % 3];
    let mut half = || [0.003, 0.05, 0.3, 2.0][r.bits() as usize % 4] * (0.5 + r.unit());
    let half = Vec3::new(half(), half(), half());
    Aabb { lo: centre - half, hi: centre + half }
}

#[test]
fn clear_verdicts_are_right() {
    let mut r = Random(11);
    let mut counts = ClipCounts::default();
    let (mut outside, mut partly, mut inside, mut unclear, mut kept_in_vain) = (0, 0, 0, 0, 0);
    for _ in 0..3_000 {
        let Some(plain) = any_pyramid(&mut r) else { continue };
        let Some(pyramid) = ClipPyramid::new(&plain) else { continue };
        let judge = Judge::new(&plain);
        for _ in 0..40 {
            let aabb = any_box(&mut r, &plain);
            let verdict = classify(&pyramid, &aabb, &mut counts);
            let (gap, depth) = (judge.gap(&aabb), judge.depth(&aabb));
            // What the leaning (1.25e-5 over the cosine of the widest edge) and the margins come to.
            let unclear_below = 1e-4 * judge.reach(&aabb);
            if gap.abs() < unclear_below || depth.abs() < unclear_below {
                unclear += 1;
                assert!(gap > 0.0 || verdict != Verdict::Outside);
                kept_in_vain += u64::from(gap > 0.0 && verdict != Verdict::Outside);
                continue;
            }
            let expected = match (gap > 0.0, depth > 0.0) {
                (true, _) => Verdict::Outside,
                (_, true) => Verdict::Inside,
                _ => Verdict::Partly,
            };
            assert_eq!(verdict, expected, "{plain:?} {aabb:?} {gap:e} {depth:e}");
            *match verdict {
                Verdict::Outside => &mut outside,
                Verdict::Partly => &mut partly,
                Verdict::Inside => &mut inside,
            } += 1;
        }
    }
    println!("{outside} outside, {partly} partly, {inside} inside, {unclear} unclear; {kept_in_vain} kept in vain");
    println!("{counts:?}");
    assert!(outside > 10_000 && partly > 10_000 && inside > 1_000 && unclear < 1_000);
    assert!(counts.second_outside > 1_000 && counts.surrounded > 10);
}

#[test]
fn few_leaves_are_listed_in_vain() {
    for (name, tree) in trees() {
        let mut counts = ClipCounts::default();
        let (mut listed, mut in_vain) = (0u64, 0u64);
        for camera in common::cameras() {
            for i in 0..64 {
                let edge = |i: i32| i as f32 / 4.0 - 1.0;
                let plain = camera.tile([edge(i / 8), edge(i / 8 + 1)], [edge(i % 8), edge(i % 8 + 1)]).unwrap();
                let judge = Judge::new(&plain);
                for cell in tree.list(&ClipPyramid::new(&plain).unwrap(), &mut counts) {
                    listed += 1;
                    in_vain += u64::from(judge.gap(&cell.aabb) > 1e-9);
                }
            }
        }
        println!("{name}: {listed} listed, {in_vain} in vain, {counts:?}");
        // The cells of the deep tree are less than a hundred times as large as the error of their coordinates.
        let one_in = if name == "deep" { 10 } else { 200 };
        assert!(in_vain * one_in <= listed, "{name}: {in_vain} of {listed}");
    }
}

/// The ray of the pyramid that is nearest to leaving it on the way from `inside` to `outside`.
fn skimming(pyramid: &ClipPyramid, inside: Vec3, outside: Vec3) -> Option<Ray> {
    let ray = |direction| Ray { origin: pyramid.apex(), direction, t_min: 0.0, t_max: f32::INFINITY };
    let (mut near, mut far) = (0.0f32, 1.0f32);
    for _ in 0..30 {
        let middle = 0.5 * (near + far);
        if pyramid.holds(&ray(inside.lerp(outside, middle))) { near = middle } else { far = middle }
    }
    let ray = ray(inside.lerp(outside, near));
    pyramid.holds(&ray).then_some(ray)
}

/// Boxes one vertex or one edge of which lies on a ray that lies in a plane, or an edge, of the leaned pyramid.
#[test]
fn boxes_that_are_only_just_touched_are_kept() {
    let mut r = Random(12);
    let (mut touched, mut taken) = (0, 0);
    let mut counts = ClipCounts::default();
    for _ in 0..4_000 {
        let Some(pyramid) = any_pyramid(&mut r).as_ref().and_then(ClipPyramid::new) else { continue };
        let normals = pyramid.normals();
        let middle = normals.into_iter().sum::<Vec3>().normalize();
        let (i, j) = (r.bits() as usize % 2, 2 + r.bits() as usize % 2);
        let corner = normals[i].cross(normals[j]).normalize();
        let corner = if corner.dot(middle) < 0.0 { -corner } else { corner };
        for outside in [middle.lerp(corner, 0.9) - normals[i] * 0.9, corner + (corner - middle) * 0.1] {
            let Some(ray) = skimming(&pyramid, middle, outside) else { continue };
            let kernel = RayKernel::new(&ray);
            for _ in 0..20 {
                let p = ray.origin + ray.direction * r.within(0.1, 3.0);
                let (mut lo, mut hi) = (p, p);
                for k in 0..3 {
                    let size = r.within(0.01, 2.0);
                    match r.bits() % 3 {
                        0 => lo[k] -= size,
                        1 => hi[k] += size,
                        _ => (lo[k], hi[k]) = (lo[k] - size, hi[k] + r.within(0.01, 2.0)),
                    }
                }
                let aabb = Aabb { lo, hi };
                let exactly = interval(&ray, &aabb, false).is_some();
                let (entry, exit) = kernel.slab(&aabb);
                if exactly || (entry <= exit && exit >= 0.0) {
                    let verdict = classify(&pyramid, &aabb, &mut counts);
                    // And what is on the border is not surely inside.
                    assert_eq!(verdict, Verdict::Partly, "{pyramid:?} {ray:?} {aabb:?} {exactly}");
                    touched += u64::from(exactly);
                    taken += u64::from(!exactly);
                }
            }
        }
    }
    println!("{touched} touched, {taken} taken to be, {counts:?}");
    assert!(touched > 10_000 && taken > 1_000 && counts.second > 1_000);
}
