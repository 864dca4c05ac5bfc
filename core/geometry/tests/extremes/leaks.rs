//! Rays aimed at vertices and edges of closed meshes: none may get through.

use crate::random::Random;
use hybray_geometry::{Candidate, Ray, RayKernel, Triangle, Vec3};
use std::collections::HashMap;

struct Mesh {
    vertices: Vec<Vec3>,
    triangles: Vec<[usize; 3]>,
    /// Triangles around each vertex.
    around: Vec<Vec<usize>>,
}

impl Mesh {
    fn new(vertices: Vec<Vec3>, triangles: Vec<[usize; 3]>) -> Self {
        let mut around = vec![Vec::new(); vertices.len()];
        for (number, triangle) in triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| around[v].push(number));
        }
        Self { vertices, triangles, around }
    }

    /// A point of the unit sphere's mesh: every other time a vertex, else on an edge; and a vertex near it.
    fn target(&self, random: &mut Random) -> (Vec3, usize) {
        let triangle = self.triangles[random.below(self.triangles.len())];
        let (i, j) = (triangle[0], triangle[1]);
        let along = if random.below(2) == 0 { 0.0 } else { random.unit() };
        (self.vertices[i] + (self.vertices[j] - self.vertices[i]) * along, i)
    }

    /// Whether `hit` holds for no triangle; those around `near` are asked first.
    fn lets_through(&self, near: usize, hit: impl Fn(&[Vec3; 3]) -> bool) -> bool {
        let corners = |number: usize| self.triangles[number].map(|v| self.vertices[v]);
        !self.around[near].iter().any(|&n| hit(&corners(n))) && !(0..self.triangles.len()).any(|n| hit(&corners(n)))
    }
}

/// An icosahedron, each face cut into four `levels` times.
fn icosphere(levels: u32, place: impl Fn(Vec3) -> Vec3) -> Mesh {
    let golden = 1.618_034;
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
        vertices.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
    }
    let near = |a: Vec3, b: Vec3| (a - b).length() < 2.1;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(vertices[i], vertices[j]) && near(vertices[j], vertices[k]) && near(vertices[k], vertices[i]) {
                    triangles.push([i, j, k]);
                }
            }
        }
    }
    assert_eq!(triangles.len(), 20);
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |i: usize, j: usize| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    vertices.push((vertices[i] + vertices[j]) * 0.5);
                    vertices.len() - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh::new(vertices.into_iter().map(|v| place(v / v.length())).collect(), triangles)
}

/// The twelve triangles of an axis-aligned box.
fn room(lo: Vec3, hi: Vec3) -> Mesh {
    let pick = |i: usize, bit: usize, axis: usize| if i >> bit & 1 == 0 { lo[axis] } else { hi[axis] };
    let vertices = (0..8).map(|i| Vec3::new(pick(i, 0, 0), pick(i, 1, 1), pick(i, 2, 2))).collect();
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        for side in [0, 1 << axis] {
            triangles.extend([[side, side + u, side + u + v], [side, side + u + v, side + v]]);
        }
    }
    Mesh::new(vertices, triangles)
}

fn ours(ray: &Ray) -> impl Fn(&[Vec3; 3]) -> bool {
    let (kernel, t_max) = (RayKernel::new(ray), ray.t_max);
    move |&v| Triangle { v }.hit(&kernel, 0, &Candidate::none(t_max)).is_some()
}

/// Moller and Trumbore (1997) as it is usually written.
macro_rules! moller_trumbore {
    ($name:ident, $as_vec:ident) => {
        fn $name(ray: &Ray) -> impl Fn(&[Vec3; 3]) -> bool {
            let (o, d, t_max) = (ray.origin.$as_vec(), ray.direction.$as_vec(), ray.t_max.into());
            move |&v| {
                let [a, b, c] = v.map(|p| p.$as_vec());
                let (e1, e2) = (b - a, c - a);
                let p = d.cross(e2);
                let det = e1.dot(p);
                if det == 0.0 {
                    return false;
                }
                let (s, inverse) = (o - a, 1.0 / det);
                let u = s.dot(p) * inverse;
                let q = s.cross(e1);
                let v = d.dot(q) * inverse;
                u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=t_max).contains(&(e2.dot(q) * inverse))
            }
        }
    };
}
moller_trumbore!(single, into_same);
moller_trumbore!(double, as_dvec3);

/// For the macro's sake.
trait IntoSame {
    fn into_same(self) -> Self;
}
impl IntoSame for Vec3 {
    fn into_same(self) -> Self {
        self
    }
}

/// `target` is at `t` = 1, or the direction has some other length, rounded.
fn towards(origin: Vec3, target: Vec3, random: &mut Random) -> Ray {
    let scale = if random.below(3) == 0 { 1.0 } else { 1.0 + random.unit() };
    Ray { origin, direction: (target - origin) * scale, t_min: 0.0, t_max: f32::INFINITY }
}

/// Aims at the icosphere of `radius` around `centre`: from inside (`distance` 0), or from so many radii away at the part
/// that faces the origin. Returns how many rays of `rays` Moller-Trumbore loses in `f32` and in `f64`; ours none.
fn check(radius: f32, centre: Vec3, distance: f32, rays: usize) -> [usize; 2] {
    let mesh = icosphere(3, |v| centre + v * radius);
    let mut random = Random(radius.to_bits() as u64 ^ (u64::from(distance.to_bits()) << 32));
    let mut lost = [0; 3];
    for _ in 0..rays {
        let (target, near) = mesh.target(&mut random);
        let origin = if distance == 0.0 {
            centre + random.vec() * (0.4 * radius)
        } else {
            let up = (target - centre) / radius + random.vec() * 0.3;
            centre + up / up.length() * (radius * distance)
        };
        let mut ray = towards(origin, target, &mut random);
        if ray.direction == Vec3::ZERO {
            continue;
        }
        if distance > 0.0 {
            // What comes out on the far side does not hide a hole in the near one.
            ray.t_max = 1.0 + 0.5 / distance;
        }
        lost[0] += usize::from(mesh.lets_through(near, ours(&ray)));
        lost[1] += usize::from(mesh.lets_through(near, single(&ray)));
        lost[2] += usize::from(mesh.lets_through(near, double(&ray)));
    }
    let percent = lost.map(|n| 100.0 * n as f64 / rays as f64);
    eprintln!(
        "radius {radius:e}, centre {centre}, from {distance} radii: of {rays} rays aimed at vertices and edges \
         Moller-Trumbore loses {:.2} % in f32, {:.2} % in f64; Woop {:.2} %",
        percent[1], percent[2], percent[0]
    );
    assert_eq!(lost[0], 0, "leaks: radius {radius}, centre {centre}, distance {distance}");
    [lost[1], lost[2]]
}

#[test]
fn closed_meshes_do_not_leak() {
    let off = |extents: f32, radius: f32| Vec3::new(0.3, -1.0, 0.7) * (extents * radius);
    let mut lost = [0; 2];
    for radius in [1e-3, 1.0, 1e3] {
        for (extents, distance) in
            [(0.0, 0.0), (0.0, 3.0), (0.0, 100.0), (1.0, 0.0), (100.0, 0.0), (1e4, 0.0), (1e4, 3.0)]
        {
            let [f32s, f64s] = check(radius, off(extents, radius), distance, 6_000);
            lost = [lost[0] + f32s, lost[1] + f64s];
        }
    }
    assert!(lost[0] > 0 && lost[1] > 0, "the rays are aimed well enough to find leaks: {lost:?}");
}

/// From inside an axis-aligned room at its edges and corners. The own box of a wall is flat, so whether a ray is in it is
/// a matter of roundings too; `closeness` is the distance from the edge in room sizes.
fn check_room(closeness: f32, rays: usize) -> usize {
    let mut random = Random(closeness.to_bits().into());
    let mut lost = 0;
    for _ in 0..rays {
        let size = Vec3::ONE + random.vec() * 0.5;
        let at = match random.below(4) {
            // Its floor and two walls at 0, as models have it; around 0; far off.
            0 => size,
            1 => random.vec() * random.decades(0.0, 3.0),
            _ => random.vec(),
        };
        let (lo, hi) = (at - size, at + size);
        let mesh = room(lo, hi);
        let (target, near) = mesh.target(&mut random);
        let inwards = (at - target) * random.vec().abs();
        let origin = target + inwards * closeness;
        let inside = origin.cmpgt(lo).all() && origin.cmplt(hi).all();
        // Next to the edge, too: there the test and the box may see a ray on different sides.
        let aside = random.vec() * (closeness * random.decades(-8.0, -2.0));
        let ray = towards(origin, target + aside, &mut random);
        if inside && ray.direction != Vec3::ZERO {
            lost += usize::from(mesh.lets_through(near, ours(&ray)));
        }
    }
    eprintln!(
        "from {closeness:e} room sizes away, {lost} of {rays} rays at edges and corners of an axis-aligned room are lost"
    );
    lost
}

/// Along z from the origin of coordinates nothing is rounded before the edge functions, so a hit can be decided in
/// integers: many of these edges pass the ray by less than `f32` can tell.
#[test]
fn signs_of_edges_are_exact() {
    let mut random = Random(3);
    let (mut hits, mut close) = (0, 0);
    let unit = (1i64 << 23) as f32;
    for _ in 0..200_000 {
        let mut whole = || (random.bits() >> 41) as i64 + (1 << 23);
        let b = [whole(), whole()];
        // Opposite to b, but for a few units in the last place.
        let mut near = |x: i64| -x + random.below(3) as i64 - 1;
        let c = [near(b[0]), near(b[1])];
        let a = [random.bits() as i64 >> 41, random.bits() as i64 >> 41];
        let corners = [a, b, c];
        let edge = |p: [i64; 2], q: [i64; 2]| p[0] * q[1] - p[1] * q[0];
        let edges = [edge(c, b), edge(a, c), edge(b, a)];
        let inside = edges.iter().all(|&e| e >= 0) || edges.iter().all(|&e| e <= 0);
        let expected = inside && edges.iter().sum::<i64>() != 0;
        let v = corners.map(|p| Vec3::new(p[0] as f32 / unit, p[1] as f32 / unit, 1.0));
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_min: 0.0, t_max: 2.0 };
        assert_eq!(ours(&ray)(&v), expected, "{v:?} {edges:?}");
        hits += usize::from(expected);
        close += usize::from(edges[0] != 0 && edges[0].abs() < 1 << 22);
    }
    eprintln!("{hits} of 200,000 triangles hit; {close} edges passed by less than f32 can tell");
    assert!(hits > 20_000 && close > 20_000);
}

const CLOSENESS: [f32; 6] = [1.0, 0.3, 0.1, 1e-2, 1e-3, 1e-4];

/// Woop's test shifts an edge by a few roundings of the distance to its ends, which may be a thousand times that to the hit,
/// and then a ray beside the edge is given to the wall whose vertices it passes by: with boxes as wide as the vertices, up
/// to 0.2 % of these rays were lost.
#[test]
fn axis_aligned_rooms_do_not_leak() {
    let lost: Vec<usize> = CLOSENESS.into_iter().map(|c| check_room(c, 100_000)).collect();
    assert_eq!(lost.iter().sum::<usize>(), 0, "{lost:?}");
}
