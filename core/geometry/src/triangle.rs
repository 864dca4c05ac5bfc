//! Triangles: Woop's watertight test (Woop, Benthin and Wald, JCGT 2013).

use crate::ray::own_slab;
use crate::simd::{Lanes, Mask, ONE_LANE};
use crate::{Aabb, Candidate, LaneRay, RayKernel, SurfacePoint, Vec3, gamma};

/// Three vertices, counterclockwise seen from its front; hit from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Vertices.
    pub v: [Vec3; 3],
}

/// Triangles side by side: `[vertex][axis]`, the axes in the order of the ray's sheared space ([`LaneRay::axes`]).
pub type TriangleLanes<F> = [[F; 3]; 3];

/// Edge functions of a triangle in the ray's sheared space, whose sum is the determinant.
struct Edges<F> {
    u: F,
    v: F,
    w: F,
    /// Scaled distances of the three vertices.
    z: [F; 3],
    /// Sheared x and y of the three vertices: `[vertex][x, y]`.
    xy: [[F; 2]; 3],
}

/// Where an edge function is zero, its sign is taken in `f64`: products of two `f32` are exact there, so the sign of
/// their difference is too, and a ray on a shared edge is inside one of its triangles or the other.
#[inline(always)]
fn edges<F: Lanes>(ray: &LaneRay<F>, triangle: &TriangleLanes<F>) -> Edges<F> {
    let origin = &ray.turned_origin;
    let mut xy = [[ray.shear[0]; 2]; 3];
    let mut depth = [ray.shear[0]; 3];
    for i in 0..3 {
        let away = triangle[i][2] - origin[2];
        xy[i] = [triangle[i][0] - origin[0] - ray.shear[0] * away, triangle[i][1] - origin[1] - ray.shear[1] * away];
        depth[i] = ray.shear[2] * away;
    }
    let [a, b, c] = xy;
    let mut edge = [c[0] * b[1] - c[1] * b[0], a[0] * c[1] - a[1] * c[0], b[0] * a[1] - b[1] * a[0]];
    let zero = ray.shear[0].splat_like(0.0);
    let on_edge = (edge[0].equal(zero) | edge[1].equal(zero) | edge[2].equal(zero)).bits();
    if on_edge != 0 {
        edge = exact_edges(edge, xy, on_edge);
    }
    Edges { u: edge[0], v: edge[1], w: edge[2], z: depth, xy }
}

#[cold]
#[inline(never)]
fn exact_edges<F: Lanes>(mut edge: [F; 3], xy: [[F; 2]; 3], lanes: u32) -> [F; 3] {
    let corner = xy.map(|p| p.map(F::to_array));
    let mut arrays = edge.map(F::to_array);
    for lane in (0..F::LANES).filter(|lane| lanes >> lane & 1 != 0) {
        let at = |i: usize, axis: usize| f64::from(corner[i][axis].as_ref()[lane]);
        for (i, (p, q)) in [(2, 1), (0, 2), (1, 0)].into_iter().enumerate() {
            arrays[i].as_mut()[lane] = (at(p, 0) * at(q, 1) - at(p, 1) * at(q, 0)) as f32;
        }
    }
    for i in 0..3 {
        edge[i] = edge[i].load_like(&arrays[i]);
    }
    edge
}

/// Tests each lane's ray against its triangle. Lanes in the mask are hit, at the distance returned, clamped to the own
/// box; `t_min` and the best distance are the caller's to compare.
#[inline(always)]
pub fn triangle_lanes<F: Lanes>(ray: &LaneRay<F>, triangle: &TriangleLanes<F>) -> (F, u32) {
    let origin = &ray.turned_origin;
    let e = edges(ray, triangle);
    let zero = e.u.splat_like(0.0);
    let below = e.u.lt(zero) | e.v.lt(zero) | e.w.lt(zero);
    let above = zero.lt(e.u) | zero.lt(e.v) | zero.lt(e.w);
    let det = e.u + e.v + e.w;
    let accepted = !(below & above) & !det.equal(zero);
    if accepted.bits() == 0 {
        return (zero, 0);
    }
    let t = (e.u * e.z[0] + e.v * e.z[1] + e.w * e.z[2]) / det;
    let (lo, hi) = own_box(triangle);
    let (near, far) = own_slab(origin, &ray.turned_inverse, &lo, &hi);
    let inside = accepted & near.le(far);
    (near.select(t.lt(near), far.select(far.lt(t), t)), inside.bits())
}

/// How much wider than its vertices a triangle's own box is, relative to its longest side.
///
/// Woop's test shifts an edge by some roundings of the distance to the edge's ends, which may be far larger than the
/// distance to the hit, and so gives a ray beside an edge to either triangle. Where both lie in faces of their own boxes
/// (the walls of a room), a bare box would refuse the one that the ray was given to, and the ray would be lost: up to one in
/// 600 of those aimed beside an edge (`tests/extremes/leaks.rs`). Half of this is enough for 600,000 such rays.
const PAD: f32 = 4.0 * f32::EPSILON;

/// The box around the vertices, widened by [`PAD`] and by an ulp or two for boxes whose coordinates would swallow that.
#[inline(always)]
fn own_box<F: Lanes>(v: &TriangleLanes<F>) -> ([F; 3], [F; 3]) {
    let (mut lo, mut hi) = (v[0], v[0]);
    for i in 0..3 {
        lo[i] = v[2][i].or_less(v[1][i].or_less(v[0][i]));
        hi[i] = v[2][i].or_greater(v[1][i].or_greater(v[0][i]));
    }
    let size = (hi[2] - lo[2]).or_greater((hi[1] - lo[1]).or_greater(hi[0] - lo[0]));
    let pad = size * size.splat_like(PAD);
    let ulp = size.splat_like(f32::EPSILON);
    for i in 0..3 {
        let wider = pad + lo[i].abs().or_greater(hi[i].abs()) * ulp;
        lo[i] = lo[i] - wider;
        hi[i] = hi[i] + wider;
    }
    (lo, hi)
}

impl Triangle {
    /// Its own box: a little wider than the vertices, so that walls which meet at an edge leave no gap between their tests.
    #[must_use]
    #[inline]
    pub fn aabb(&self) -> Aabb {
        let (lo, hi) = own_box(&self.one_lane([0, 1, 2]));
        let corner = |c: [crate::simd::OneLane; 3]| Vec3::from_array(c.map(|x| x.to_array()[0]));
        Aabb { lo: corner(lo), hi: corner(hi) }
    }

    fn one_lane(&self, axes: [usize; 3]) -> TriangleLanes<crate::simd::OneLane> {
        self.v.map(|p| axes.map(|axis| ONE_LANE.splat_like(p[axis])))
    }

    /// The hit of `ray` before `best`, if there is one: [`triangle_lanes`] with one lane.
    #[must_use]
    pub fn hit(&self, ray: &RayKernel, id: u32, best: &Candidate) -> Option<Candidate> {
        let (t, hit) = triangle_lanes(&ray.splat(ONE_LANE), &self.one_lane(ray.axes));
        let found = Candidate { t: t.to_array()[0], id };
        (hit != 0 && found.t >= ray.t_min && found.precedes(best)).then_some(found)
    }

    /// The place of a hit that [`Triangle::hit`] found at `t`.
    ///
    /// Position from barycentrics: error gamma(7) of the terms' magnitudes; distance: the bound of Pharr, Jakob and
    /// Humphreys, *Physically Based Rendering*, 4th edition, section 6.8.7.
    #[must_use]
    pub fn surface(&self, ray: &RayKernel, t: f32) -> SurfacePoint {
        let e = edges(&ray.splat(ONE_LANE), &self.one_lane(ray.axes));
        let get = |x: crate::simd::OneLane| x.to_array()[0];
        let (u, v, w) = (get(e.u), get(e.v), get(e.w));
        let inverse_det = 1.0 / (u + v + w);
        let b = [u * inverse_det, v * inverse_det, w * inverse_det];
        let terms = [self.v[0] * b[0], self.v[1] * b[1], self.v[2] * b[2]];

        let most = |a: [f32; 3]| a.into_iter().fold(0.0f32, |m, x| if x.abs() > m { x.abs() } else { m });
        let x = most(e.xy.map(|p| get(p[0])));
        let y = most(e.xy.map(|p| get(p[1])));
        let z = most(e.z.map(get));
        // The shear acts on depths as lengths, whatever the length of the direction.
        let depth = z * ray.direction[ray.axes[2]].abs();
        let (dz, dx, dy) = (gamma(3) * z, gamma(8) * (x + depth), gamma(8) * (y + depth));
        let de = 2.0 * (gamma(2) * x * y + dy * x + dx * y + dx * dy);
        let edge = most([u, v, w]);

        let position = terms[0] + terms[1] + terms[2];
        let extent = self.v.iter().fold(0.0, |m: f32, &v| m.max((v - position).abs().max_element()));

        SurfacePoint {
            t,
            test_error: gamma(32) * extent,
            t_error: 3.0 * (gamma(3) * edge * z + de * z + dz * edge) * inverse_det.abs(),
            position,
            error: (terms[0].abs() + terms[1].abs() + terms[2].abs()) * gamma(7),
            normal: self.normal(),
            uv: [b[1], b[2]],
        }
    }

    /// Unit normal of the counterclockwise side; an arbitrary axis for a triangle without area, which nothing hits.
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        // In f64: the edges of a sliver all but cancel in f32, and its normal would turn by degrees.
        let [a, b, c] = self.v.map(Vec3::as_dvec3);
        let n = (b - a).cross(c - a);
        let length = libm::sqrt(n.dot(n));
        if length > 0.0 { (n / length).as_vec3() } else { Vec3::Z }
    }
}
