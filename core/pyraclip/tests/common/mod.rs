//! Scenes, a midpoint bintree over them, cameras, and exact arithmetic to judge by.
#![allow(dead_code)]

use hybray_geometry::{Aabb, Candidate, Pyramid, Ray, RayKernel, Sphere, Triangle, Vec3};
use hybray_pyraclip::{Bintree, ClipCell, ClipCounts, ClipPyramid, Split, clip, midpoint};
use std::ops::ControlFlow;

/// Splitmix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In 0..1, in steps of 2^-24.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }
    pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * self.unit()
    }
    pub fn point(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.within(-size, size), self.within(-size, size), self.within(-size, size))
    }
    /// Multiples of 1/4.
    pub fn grid_point(&mut self, size: f32) -> Vec3 {
        (self.point(size) * 4.0).round() / 4.0
    }
}

pub enum Object {
    Sphere(Sphere),
    Triangle(Triangle),
}

impl Object {
    pub fn aabb(&self) -> Aabb {
        match self {
            Self::Sphere(s) => s.aabb(),
            Self::Triangle(t) => t.aabb(),
        }
    }
    pub fn hit(&self, ray: &RayKernel, id: u32, best: &mut Candidate) {
        let found = match self {
            Self::Sphere(s) => s.hit(ray, id, best),
            Self::Triangle(t) => t.hit(ray, id, best),
        };
        if let Some(found) = found {
            *best = found;
        }
    }
}

/// Small spheres and triangles anywhere within 1.
pub fn scattered(seed: u64, count: usize) -> Vec<Object> {
    let mut r = Random(seed);
    let object = |i: usize| {
        let centre = r.point(0.95);
        if i.is_multiple_of(2) {
            Object::Sphere(Sphere { centre, radius: r.within(0.002, 0.04) })
        } else {
            Object::Triangle(Triangle { v: [0; 3].map(|_| centre + r.point(0.05)) })
        }
    };
    (0..count).map(object).collect()
}

/// Triangles with corners on a coarse grid, many in planes of the tree, and spheres that touch such planes. Many
/// coincide.
pub fn on_the_grid(seed: u64, count: usize) -> Vec<Object> {
    let mut r = Random(seed);
    let object = |i: usize| {
        if i.is_multiple_of(4) {
            Object::Sphere(Sphere { centre: r.grid_point(0.75), radius: 0.125 })
        } else {
            let mut v = [0; 3].map(|_| r.grid_point(0.875));
            let axis = i % 5;
            if axis < 3 {
                (v[1][axis], v[2][axis]) = (v[0][axis], v[0][axis]);
            }
            Object::Triangle(Triangle { v })
        }
    };
    (0..count).map(object).collect()
}

pub struct Node {
    pub aabb: Aabb,
    pub split: Option<Split<u32>>,
    pub objects: Vec<u32>,
}

/// Every object in every leaf whose closed box its own overlaps.
pub struct Tree {
    pub nodes: Vec<Node>,
    pub objects: Vec<Object>,
}

impl Tree {
    /// The paper's limits: 12 objects a cell, some depth. `plane` chooses where a cell is cut.
    pub fn new(objects: Vec<Object>, root: Aabb, depth: usize, plane: impl Fn(f32, f32) -> f32) -> Self {
        Self::cut(objects, root, depth, 12, plane)
    }

    /// Cuts across the longest axis until a cell is `depth` levels down or holds no more than `few`.
    pub fn cut(objects: Vec<Object>, root: Aabb, depth: usize, few: usize, plane: impl Fn(f32, f32) -> f32) -> Self {
        assert!(objects.iter().all(|o| root.contains(&o.aabb())));
        let all = (0..objects.len() as u32).collect();
        let mut nodes = vec![Node { aabb: root, split: None, objects: all }];
        let mut open = vec![(0, 0)];
        while let Some((at, level)) = open.pop() {
            let aabb = nodes[at].aabb;
            let size = aabb.hi - aabb.lo;
            let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
            let plane = plane(aabb.lo[axis], aabb.hi[axis]);
            if nodes[at].objects.len() <= few || level == depth {
                continue;
            }
            if !(aabb.lo[axis] < plane && plane < aabb.hi[axis]) {
                continue;
            }
            let held = std::mem::take(&mut nodes[at].objects);
            let first = nodes.len();
            nodes[at].split = Some(Split { axis, plane, lower: first as u32, upper: first as u32 + 1 });
            for upper in [false, true] {
                let mut half = aabb;
                if upper {
                    half.lo[axis] = plane
                } else {
                    half.hi[axis] = plane
                }
                let inside = |&o: &u32| half.overlaps(&objects[o as usize].aabb());
                let held = held.iter().copied().filter(inside).collect();
                nodes.push(Node { aabb: half, split: None, objects: held });
                open.push((nodes.len() - 1, level + 1));
            }
        }
        Self { nodes, objects }
    }

    pub fn leaves(&self) -> impl Iterator<Item = u32> {
        (0..self.nodes.len() as u32).filter(|&n| self.split(n).is_none() && !self.is_empty(n))
    }

    pub fn list(&self, pyramid: &ClipPyramid, counts: &mut ClipCounts) -> Vec<ClipCell<u32>> {
        let mut list = Vec::new();
        let flow = clip(self, pyramid, counts, |cell| {
            list.push(cell);
            ControlFlow::Continue(())
        });
        assert_eq!(flow, Ok(ControlFlow::Continue(())));
        list
    }
}

impl Bintree for Tree {
    type Cell = u32;
    fn root(&self) -> (u32, Aabb) {
        (0, self.nodes[0].aabb)
    }
    fn split(&self, cell: u32) -> Option<Split<u32>> {
        self.nodes[cell as usize].split
    }
    fn is_empty(&self, cell: u32) -> bool {
        self.nodes[cell as usize].objects.is_empty()
    }
}

pub fn cube(size: f32) -> Aabb {
    Aabb { lo: Vec3::splat(-size), hi: Vec3::splat(size) }
}

/// A box of which no midpoint is exact.
pub fn crooked() -> Aabb {
    Aabb { lo: Vec3::new(-1.000_123, -1.1, -1.0 - 1.0 / 3.0), hi: Vec3::new(1.3, 1.000_001, 1.0 + 1.0 / 7.0) }
}

/// Trees, each with a name.
pub fn trees() -> Vec<(&'static str, Tree)> {
    vec![
        ("scattered", Tree::new(scattered(1, 1500), cube(1.0), 24, midpoint)),
        ("scattered, inexact midpoints", Tree::new(scattered(2, 1500), crooked(), 18, midpoint)),
        ("scattered, cut at a third", Tree::new(scattered(3, 700), crooked(), 18, |lo, hi| lo + (hi - lo) * 0.35)),
        ("on the grid", Tree::new(on_the_grid(4, 200), cube(1.0), 12, midpoint)),
        ("deep", Tree::new(scattered(5, 40).into_iter().chain(cluster(6)).collect(), crooked(), 54, midpoint)),
    ]
}

/// Tiny spheres in one place, for cells not much larger than the error of their coordinates.
fn cluster(seed: u64) -> Vec<Object> {
    let mut r = Random(seed);
    let sphere = |_| Object::Sphere(Sphere { centre: Vec3::new(0.3, -0.2, 0.6) + r.point(1e-4), radius: 4e-6 });
    (0..600).map(sphere).collect()
}

pub struct Camera {
    pub eye: Vec3,
    pub forward: Vec3,
    pub right: Vec3,
    pub up: Vec3,
}

impl Camera {
    fn new(eye: [f32; 3], forward: [f32; 3], right: [f32; 3], up: [f32; 3]) -> Self {
        let [eye, forward, right, up] = [eye, forward, right, up].map(Vec3::from_array);
        Self { eye, forward, right, up }
    }
    pub fn towards(&self, x: f32, y: f32) -> Vec3 {
        self.forward + self.right * x + self.up * y
    }
    /// The pyramid of a rectangle of the picture, which is from -1 to 1; `None` if that is too narrow for `f32`.
    pub fn tile(&self, x: [f32; 2], y: [f32; 2]) -> Option<Pyramid> {
        let corners = [(x[0], y[0]), (x[0], y[1]), (x[1], y[1]), (x[1], y[0])].map(|(x, y)| self.towards(x, y));
        Pyramid::through(self.eye, corners)
    }
}

const AXES: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Outside, inside, on split planes, far away; straight, askew.
pub fn cameras() -> Vec<Camera> {
    let [x, y, z] = AXES;
    let minus = |a: [f32; 3]| a.map(|a| -a);
    vec![
        Camera::new([0.0, 0.0, -3.0], z, x, y),
        Camera::new([0.0, 0.0, 0.0], z, x, y),
        Camera::new([0.25, 0.5, -0.5], minus(y), z, x),
        Camera::new([0.5, -1.0, 0.0], minus(x), y, z),
        Camera::new([0.25, 0.25, 0.25], [1.0, 1.0, 1.0], [0.5, -0.5, 0.0], [0.25, 0.25, -0.5]),
        Camera::new([-2.1, 1.7, 1.3], [0.8, -0.63, -0.5], [0.2, 0.1, 0.2], [-0.1, 0.22, -0.3]),
        Camera::new([0.31, -0.12, 0.577], [-0.1, 0.7, 0.3], [0.6, 0.1, 0.0], [0.0, -0.2, 0.5]),
        Camera::new([7.3, 0.01, 0.02], [-1.0, 0.0, 0.003], [0.0, 0.1, 0.02], [0.004, 0.03, -0.15]),
        Camera::new([0.3004, -0.1996, 0.599], [-0.0004, -0.0004, 0.001], [0.0002, 0.0, 0.0], [0.0, 0.0002, 0.0]),
    ]
}

/// Rays of a rectangle: its corners, its sides, its middle, and any.
pub fn rays(camera: &Camera, x: [f32; 2], y: [f32; 2], random: &mut Random, any: usize) -> Vec<Ray> {
    let mut directions = Vec::new();
    for i in [x[0], (x[0] + x[1]) * 0.5, x[1]] {
        for j in [y[0], (y[0] + y[1]) * 0.5, y[1]] {
            directions.push(camera.towards(i, j));
        }
    }
    for _ in 0..any {
        directions.push(camera.towards(random.within(x[0], x[1]), random.within(y[0], y[1])));
    }
    let ray = |direction| Ray { origin: camera.eye, direction, t_min: 0.0, t_max: f32::INFINITY };
    directions.into_iter().map(ray).collect()
}

/// Every pyramid of every camera's picture with some rays, and a narrow one.
pub fn for_each_pyramid(tiles: usize, any: usize, mut f: impl FnMut(&Camera, &ClipPyramid, &[Ray])) {
    let mut random = Random(99);
    for camera in cameras() {
        let edge = |i: usize| 2.0 * i as f32 / tiles as f32 - 1.0;
        let mut all = Vec::new();
        for i in 0..tiles {
            for j in 0..tiles {
                all.push(([edge(i), edge(i + 1)], [edge(j), edge(j + 1)]));
            }
        }
        all.push(([-0.003, 0.002], [0.25, 0.2505]));
        all.push(([0.0, 1e-3], [0.0, 1e-3]));
        all.push(([-1.0, 1.0], [-1.0, 1.0]));
        for (x, y) in all {
            let Some(pyramid) = camera.tile(x, y) else {
                assert!(x[1] - x[0] < 0.01, "{x:?} {y:?}");
                continue;
            };
            let pyramid = ClipPyramid::new(&pyramid).unwrap();
            let rays = rays(&camera, x, y, &mut random, any);
            assert!(rays.iter().all(|r| pyramid.holds(r)), "{x:?} {y:?} {pyramid:?}");
            f(&camera, &pyramid, &rays);
        }
    }
}

/// A number over another that is more than 0.
#[derive(Clone, Copy, Debug)]
pub struct Fraction(i128, i128);

impl Fraction {
    pub fn at_most(self, b: Self) -> bool {
        self.0 * b.1 <= b.0 * self.1
    }
    pub fn less(self, b: Self) -> bool {
        !b.at_most(self)
    }
}

/// Units of 2^-52: whatever `f32` of these scenes is a whole number of them. With differences below 2^57 and directions
/// below 2^56 no product overflows.
fn exact(x: f32) -> i128 {
    let units = f64::from(x) * (1u64 << 52) as f64;
    assert!(units == units.trunc() && units.abs() < (1u64 << 56) as f64, "{x:e}");
    units as i128
}

/// Where `ray`, from 0 on, is in the closed box, or between its open faces if `open`: exactly.
pub fn interval(ray: &Ray, aabb: &Aabb, open: bool) -> Option<(Fraction, Fraction)> {
    let (mut entry, mut exit) = (Fraction(0, 1), Fraction(1, 0));
    for k in 0..3 {
        let (o, d) = (exact(ray.origin[k]), exact(ray.direction[k]));
        let (lo, hi) = (exact(aabb.lo[k]) - o, exact(aabb.hi[k]) - o);
        if d == 0 {
            if lo > 0 || hi < 0 || (open && (lo == 0 || hi == 0)) {
                return None;
            }
            continue;
        }
        let (near, far) =
            if d > 0 { (Fraction(lo, d), Fraction(hi, d)) } else { (Fraction(-hi, -d), Fraction(-lo, -d)) };
        if entry.less(near) {
            entry = near;
        }
        if far.less(exit) {
            exit = far;
        }
    }
    let met = if open { entry.less(exit) } else { entry.at_most(exit) };
    met.then_some((entry, exit))
}
