//! The crate `obvhs`: its eight-wide compressed tree and its binary one, both clustered bottom-up.
//!
//! Primitives are stored in the order of the tree, in the form that the crate's own examples use for speed. Of spheres
//! the crate knows nothing: the test here is that of *Ray Tracing Gems*, chapter 7, as ours is.

use std::time::{Duration, Instant};

use glam::{UVec2, Vec3A};
use hybray::build::Source;
use hybray_bintree::cut::Primitives;
use hybray_geometry::Ray;
use hybray_scene::Kind as Primitive;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::{build_bvh2, build_bvh2_from_tris};
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::{build_cwbvh, build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams, traverse};

use crate::engine::{Answer, Built, Counts, Engine, Kind};

/// The preset whose build is the bar for ours.
pub const MEDIUM: &str = "medium";
/// Presets to choose the best from, by name.
pub const PRESETS: [(&str, BvhBuildParams); 3] = [
    (MEDIUM, BvhBuildParams::medium_build()),
    ("slow", BvhBuildParams::slow_build()),
    ("very slow", BvhBuildParams::very_slow_build()),
];

/// What stands in a leaf.
pub trait Leaf: Boundable + Copy {
    /// Its distance along the ray; infinite without a hit.
    fn hit(&self, ray: &obvhs::ray::Ray) -> f32;
}

impl Leaf for RtTriangle {
    #[inline(always)]
    fn hit(&self, ray: &obvhs::ray::Ray) -> f32 {
        self.intersect(ray)
    }
}

/// A triangle or a sphere, where a scene has both.
#[derive(Clone, Copy)]
pub enum Either {
    /// A triangle.
    Triangle(RtTriangle),
    /// A sphere: centre and radius.
    Sphere(Vec3A, f32),
}

impl Boundable for Either {
    fn aabb(&self) -> Aabb {
        match self {
            Self::Triangle(triangle) => triangle.aabb(),
            Self::Sphere(centre, radius) => Aabb { min: *centre - *radius, max: *centre + *radius },
        }
    }
}

impl Leaf for Either {
    #[inline(always)]
    fn hit(&self, ray: &obvhs::ray::Ray) -> f32 {
        match self {
            Self::Triangle(triangle) => triangle.intersect(ray),
            Self::Sphere(centre, radius) => sphere(ray, *centre, *radius),
        }
    }
}

#[inline(always)]
fn sphere(ray: &obvhs::ray::Ray, centre: Vec3A, radius: f32) -> f32 {
    let from = ray.origin - centre;
    let square = ray.direction.dot(ray.direction);
    let middle = -from.dot(ray.direction) / square;
    let nearest = from + ray.direction * middle;
    let inside = radius * radius - nearest.dot(nearest);
    if inside < 0.0 {
        return f32::INFINITY;
    }
    let half = (inside / square).sqrt();
    let within = |t: f32| t >= ray.tmin && t <= ray.tmax;
    let (near, far) = (middle - half, middle + half);
    if within(near) {
        near
    } else if within(far) {
        far
    } else {
        f32::INFINITY
    }
}

/// A scene's primitives as the crate takes them, by our ids.
pub enum Given {
    /// Nothing but triangles.
    Triangles(Vec<Triangle>),
    /// Both.
    Mixed(Vec<Either>),
}

impl Given {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Triangles(triangles) => triangles.len(),
            Self::Mixed(all) => all.len(),
        }
    }

    /// All primitives of a scene without cones.
    pub fn new(source: &Source<'_>) -> Self {
        let corners = |id: u32| source.triangle(id).v.map(|v| Vec3A::from_array(v.to_array()));
        let is_triangle = |id: u32| source.aabb(id).0 == Primitive::Triangle;
        if (0..source.len()).all(is_triangle) {
            let triangle = |id: u32| {
                let [v0, v1, v2] = corners(id);
                Triangle { v0, v1, v2 }
            };
            return Self::Triangles((0..source.len()).map(triangle).collect());
        }
        let either = |id: u32| {
            if is_triangle(id) {
                let [v0, v1, v2] = corners(id);
                return Either::Triangle(RtTriangle::new(v0, v1, v2));
            }
            let sphere = source.sphere(id);
            Either::Sphere(Vec3A::from_array(sphere.centre.to_array()), sphere.radius)
        };
        Self::Mixed((0..source.len()).map(either).collect())
    }
}

/// A tree of the crate's, and its primitives.
struct Tree<B, L> {
    tree: B,
    leaves: Vec<L>,
    name: &'static str,
}

fn ray(ray: &Ray) -> obvhs::ray::Ray {
    let vector = |v: hybray_geometry::Vec3| Vec3A::from_array(v.to_array());
    obvhs::ray::Ray::new(vector(ray.origin), vector(ray.direction), ray.t_min, ray.t_max)
}

/// One engine's `trace`, for a tree whose methods have the same names as the other's.
macro_rules! trace {
    ($self:ident, $kind:ident, $rays:ident, $out:ident) => {
        for (from, out) in $rays.iter().zip($out) {
            let from = ray(from);
            *out = Answer::MISS;
            if $kind.is_any() {
                if !$self.tree.ray_traverse_miss(from, |ray, at| $self.leaves[at].hit(ray)) {
                    *out = Answer::BLOCKED;
                }
                continue;
            }
            let mut hit = RayHit::none();
            if $self.tree.ray_traverse(from, &mut hit, |ray, at| $self.leaves[at].hit(ray)) {
                *out = Answer { t: hit.t, id: $self.tree.primitive_indices[hit.primitive_id as usize] };
            }
        }
    };
}

impl<L: Leaf> Engine for Tree<CwBvh, L> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool {
        trace!(self, kind, rays, out);
        true
    }

    fn counts(&mut self, kind: Kind, rays: &[Ray]) -> Option<Counts> {
        let (mut nodes, mut tests) = (0u64, 0);
        let bvh = &self.tree;
        for from in rays {
            let mut ray = ray(from);
            let mut state = bvh.new_traversal(ray.direction);
            let mut node;
            'ray: {
                traverse!(
                    bvh,
                    node,
                    state,
                    {
                        nodes += 1;
                        node.intersect_ray(&ray, state.oct_inv4)
                    },
                    {
                        tests += 1;
                        let t = self.leaves[state.primitive_id as usize].hit(&ray);
                        if t < ray.tmax {
                            if kind.is_any() {
                                break 'ray;
                            }
                            ray.tmax = t;
                        }
                    }
                );
            }
        }
        Some(Counts { boxes: Some(8 * nodes), tests, pages: None })
    }
}

impl<L: Leaf> Engine for Tree<Bvh2, L> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool {
        trace!(self, kind, rays, out);
        true
    }

    /// The crate gives no way to count the boxes of this tree.
    fn counts(&mut self, kind: Kind, rays: &[Ray]) -> Option<Counts> {
        let mut tests = 0;
        for from in rays {
            let mut test = |ray: &obvhs::ray::Ray, at: usize| {
                tests += 1;
                self.leaves[at].hit(ray)
            };
            if kind.is_any() {
                self.tree.ray_traverse_miss(ray(from), test);
            } else {
                self.tree.ray_traverse(ray(from), &mut RayHit::none(), &mut test);
            }
        }
        Some(Counts { boxes: None, tests, pages: None })
    }
}

/// Which of the two trees.
#[derive(Clone, Copy)]
pub enum Form {
    /// Eight boxes of 80 bytes.
    Compressed,
    /// Two.
    Binary,
}

impl Form {
    /// As the table has it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compressed => "obvhs CWBVH",
            Self::Binary => "obvhs BVH2",
        }
    }
}

/// Builds a tree with `preset`. What is measured is the crate's build and the copy of primitives in its order. The
/// compressed tree is built with room for a node a primitive, which is given back.
pub fn build(given: &Given, form: Form, (preset, params): (&str, BvhBuildParams)) -> (Box<dyn Engine>, Built) {
    let none = &mut Duration::default();
    let name = form.name();
    Built::of(&format!("{name}, {preset}"), || -> Box<dyn Engine> {
        match (given, form) {
            (Given::Triangles(given), Form::Compressed) => {
                let mut tree = build_cwbvh_from_tris(given, params, none);
                tree.nodes.shrink_to_fit();
                let leaves = tree.primitive_indices.iter().map(|&id| (&given[id as usize]).into()).collect();
                Box::new(Tree::<_, RtTriangle> { leaves, tree, name })
            }
            (Given::Triangles(given), Form::Binary) => {
                let tree = build_bvh2_from_tris(given, params, none);
                let leaves = tree.primitive_indices.iter().map(|&id| (&given[id as usize]).into()).collect();
                Box::new(Tree::<_, RtTriangle> { leaves, tree, name })
            }
            (Given::Mixed(given), Form::Compressed) => {
                let mut tree = build_cwbvh(given, params, none);
                tree.nodes.shrink_to_fit();
                let leaves = tree.primitive_indices.iter().map(|&id| given[id as usize]).collect();
                Box::new(Tree { leaves, tree, name })
            }
            (Given::Mixed(given), Form::Binary) => {
                let tree = build_bvh2(given, params, none);
                let leaves = tree.primitive_indices.iter().map(|&id| given[id as usize]).collect();
                Box::new(Tree { leaves, tree, name })
            }
        }
    })
}

/// Seconds that `engine` takes for some of the rays of both kinds that ask for the nearest hit: how good its tree is.
pub fn quality(engine: &mut dyn Engine, sets: &[(Kind, Vec<Ray>)]) -> f64 {
    const RAYS: usize = 1 << 17;
    let start = Instant::now();
    for (kind, rays) in sets.iter().filter(|(kind, _)| !kind.is_any()) {
        let rays = &rays[..rays.len().min(RAYS)];
        engine.trace(*kind, rays, &mut vec![Answer::MISS; rays.len()]);
    }
    start.elapsed().as_secs_f64()
}
