//! How the answers of two engines differ, and why, by a calculation in double precision.

use glam::DVec3;
use hybray::build::Source;
use hybray_bintree::cut::Primitives;
use hybray_geometry::Ray;
use hybray_scene::Kind as Primitive;
use serde::Serialize;

use crate::engine::{Answer, Engine, Kind};

/// What two answers may be apart, and a ray from an edge that it may be taken to miss: this many units in the last
/// place of the greatest coordinate.
const ULPS: f64 = 64.0;

/// How many rays got another answer than from our single walk, by what explains it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Differences {
    /// The same distance, as far as `f32` tells: two primitives that touch or coincide.
    pub tie: u64,
    /// The ray passes an edge, or the rim of a sphere, closer than `f32` tells.
    pub edge: u64,
    /// The hit is at the start or the end of the ray.
    pub end: u64,
    /// We hit something nearer, and are right in double precision.
    pub lost: u64,
    /// Nothing of these: they hit something nearer, or nobody is right. Then we have a bug, as far as this can tell.
    pub unexplained: u64,
    /// The first such ray.
    pub example: Option<String>,
    /// Greatest difference of the distances to one primitive, in units of the greatest coordinate.
    pub apart: f64,
}

/// Compares `theirs` with `ours`, ray by ray.
pub struct Comparison<'s> {
    /// The scene.
    pub source: &'s Source<'s>,
    /// Greatest coordinate of the scene.
    pub magnitude: f32,
}

enum Why {
    Tie,
    Edge,
    End,
    Lost,
}

impl Comparison<'_> {
    /// What is different. Where any hit will do, both engines are asked for the nearest of those rays about which they
    /// disagree.
    pub fn differences(
        &self,
        kind: Kind,
        rays: &[Ray],
        [ours, theirs]: [&[Answer]; 2],
        [we, they]: [&mut dyn Engine; 2],
    ) -> Differences {
        let mut found = Differences::default();
        for (i, ray) in rays.iter().enumerate() {
            let (a, b) = (ours[i], theirs[i]);
            if a.id == b.id || (kind.is_any() && a.is_hit() == b.is_hit()) {
                if a.is_hit() && !kind.is_any() {
                    let apart = f64::from((a.t - b.t).abs() * ray.direction.length()) / self.reach(ray);
                    found.apart = found.apart.max(apart);
                }
                continue;
            }
            let (a, b) = if kind.is_any() { (nearest(we, ray), nearest(they, ray)) } else { (a, b) };
            match self.why(ray, a, b) {
                Some(Why::Tie) => found.tie += 1,
                Some(Why::Edge) => found.edge += 1,
                Some(Why::End) => found.end += 1,
                Some(Why::Lost) => found.lost += 1,
                None => {
                    found.unexplained += 1;
                    found.example.get_or_insert_with(|| format!("{kind:?} {ray:?}: ours {a:?}, theirs {b:?}"));
                }
            }
        }
        found
    }

    fn reach(&self, ray: &Ray) -> f64 {
        f64::from(ray.origin.abs().max_element().max(self.magnitude))
    }

    fn why(&self, ray: &Ray, a: Answer, b: Answer) -> Option<Why> {
        let slack = ULPS * f64::from(f32::EPSILON) * self.reach(ray);
        let length = f64::from(ray.direction.length());
        let hits = || [a, b].into_iter().filter(|answer| answer.is_hit());
        let at_end = |t: f32| {
            let from = |end: f32| f64::from((t - end).abs()) * length <= slack;
            from(ray.t_min) || (ray.t_max.is_finite() && from(ray.t_max))
        };
        if a.is_hit() && b.is_hit() && f64::from((a.t - b.t).abs()) * length <= slack {
            return Some(Why::Tie);
        }
        if hits().any(|hit| at_end(hit.t)) {
            return Some(Why::End);
        }
        if hits().any(|hit| self.edge_distance(ray, hit.id) <= slack) {
            return Some(Why::Edge);
        }
        (a.t < b.t && self.meets(ray, a.id)).then_some(Why::Lost)
    }

    /// How far the line of the ray passes the nearest edge of a triangle, or the rim of a sphere.
    fn edge_distance(&self, ray: &Ray, id: u32) -> f64 {
        let [origin, direction] = [ray.origin, ray.direction].map(double);
        if self.source.aabb(id).0 != Primitive::Triangle {
            let sphere = self.source.sphere(id);
            let off = (double(sphere.centre) - origin).reject_from(direction).length();
            return (off - f64::from(sphere.radius)).abs();
        }
        let v = self.source.triangle(id).v.map(double);
        let edges = (0..3).map(|i| {
            let edge = v[(i + 1) % 3] - v[i];
            let across = direction.cross(edge);
            (origin - v[i]).dot(across).abs() / across.length()
        });
        edges.fold(f64::INFINITY, f64::min)
    }

    /// Whether the line of the ray meets a primitive, which is not near its edge.
    fn meets(&self, ray: &Ray, id: u32) -> bool {
        let [origin, direction] = [ray.origin, ray.direction].map(double);
        if self.source.aabb(id).0 != Primitive::Triangle {
            let sphere = self.source.sphere(id);
            return (double(sphere.centre) - origin).reject_from(direction).length() <= f64::from(sphere.radius);
        }
        let v = self.source.triangle(id).v.map(|v| double(v) - origin);
        let sides = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| direction.dot(v[i].cross(v[j])));
        sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0)
    }
}

fn double(v: hybray_geometry::Vec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(f64::from))
}

fn nearest(engine: &mut dyn Engine, ray: &Ray) -> Answer {
    let mut answer = [Answer::MISS];
    engine.trace(Kind::Bounce, &[*ray], &mut answer);
    answer[0]
}
