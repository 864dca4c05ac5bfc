//! The pyramid made ready for clipping: leaned out, of unit normals, with a ray down its middle.

use hybray_geometry::{Pyramid, Ray, RayKernel, Vec3};

/// A pyramid whose four planes are leaned outward by at least [`ClipPyramid::LEAN`].
///
/// The planes that an [`Pyramid`] has are cross products in `f32`, and the rays inside them are rounded too: the
/// leaning lets the planes hold every ray that was meant to be inside. From there on, the leaned normals are taken as
/// exact.
#[derive(Clone, Copy, Debug)]
pub struct ClipPyramid {
    pub(crate) apex: Vec3,
    /// Inward, unit but for rounding, in [`Pyramid`]'s order.
    pub(crate) normals: [Vec3; 4],
    /// A ray strictly inside.
    pub(crate) axis: RayKernel,
}

/// Vectors in `f64`, where the product of two `f32` is exact.
type Wide = [f64; 3];

/// Planes 0 and 1, 2 and 3 face each other: these meet in the pyramid's four edges.
pub(crate) const ADJACENT: [(usize, usize); 4] = [(0, 2), (0, 3), (1, 2), (1, 3)];

impl ClipPyramid {
    /// How far (sine) a ray may be outside a plane of the [`Pyramid`]: the 1e-5 that [`Pyramid::through`] lets its
    /// corners be outside, and a quarter more for rounding.
    pub const LEAN: f32 = 1.25e-5;

    /// A pyramid is too flat to clip with if an edge is further than this (cosine) from its middle.
    pub const COSINE_MIN: f32 = 0.05;

    /// Makes `pyramid` ready.
    ///
    /// `None` if its planes do not bound a pyramid with four edges, or bound one that is too flat: such rays are traced
    /// singly.
    #[must_use]
    pub fn new(pyramid: &Pyramid) -> Option<Self> {
        let mut normals = [[0.0; 3]; 4];
        for (unit, n) in normals.iter_mut().zip(&pyramid.normals) {
            *unit = normalized(wide(*n))?;
        }
        let ahead = normalized(sum(&normals))?;
        let (_, cosine) = edges(&normals, &ahead, -f64::from(Self::LEAN))?;

        // On any direction of the pyramid `ahead` is `cosine` or more, so this adds LEAN or more to each distance; the
        // rounding to f32 takes off 1.1e-7 of it.
        let lean = f64::from(Self::LEAN) / cosine;
        let mut leaned = [Vec3::ZERO; 4];
        for (leaned, n) in leaned.iter_mut().zip(&normals) {
            let n = normalized([0, 1, 2].map(|i| n[i] + lean * ahead[i]))?;
            *leaned = Vec3::from_array(n.map(|x| x as f32));
        }

        let exact = leaned.map(wide);
        let ahead = normalized(sum(&exact))?;
        let (edges, _) = edges(&exact, &ahead, INSIDE)?;
        let axis = normalized(sum(&edges))?.map(|x| x as f32);
        let axis = Vec3::from_array(axis);
        let inside = exact.iter().all(|n| dot(n, &wide(axis)) > INSIDE);
        let ray = Ray { origin: pyramid.apex, direction: axis, t_min: 0.0, t_max: f32::INFINITY };
        (inside && pyramid.apex.is_finite()).then(|| Self {
            apex: pyramid.apex,
            normals: leaned,
            axis: RayKernel::new(&ray),
        })
    }

    /// Where all rays start.
    #[must_use]
    pub fn apex(&self) -> Vec3 {
        self.apex
    }

    /// The four leaned normals: inward, of length 1 but for rounding.
    #[must_use]
    pub fn normals(&self) -> [Vec3; 4] {
        self.normals
    }

    /// Whether `ray` may be traced along this pyramid's cliplists: it starts at the apex, lies inside (in exact
    /// arithmetic, whatever is in doubt being outside), and its longest component is between 2^-100 and 2^100.
    ///
    /// True of all rays between the corners that were given to [`Pyramid::through`].
    #[must_use]
    pub fn holds(&self, ray: &Ray) -> bool {
        let d = wide(ray.direction);
        let longest = ray.direction.abs().max_element();
        let scaled = (f32::from_bits(27 << 23)..=f32::from_bits(227 << 23)).contains(&longest);
        ray.origin == self.apex
            && scaled
            && self.normals.iter().all(|&n| {
                let terms = [0, 1, 2].map(|i| wide(n)[i] * d[i]);
                // Three exact terms, two roundings.
                terms[0] + terms[1] + terms[2] >= 4.0 * f64::EPSILON * terms.iter().map(|t| t.abs()).sum::<f64>()
            })
    }
}

/// What is more than this (sine) inside a plane is inside whatever was rounded. Leaned planes leave 100 times as much.
const INSIDE: f64 = 1e-7;

/// The four edges as unit directions, in the order of [`ADJACENT`], and the least cosine that one has with `ahead`.
///
/// `None` unless each is at least `inside` (sine) inside the two planes that it does not lie in: else a plane bounds
/// nothing, and the pyramid has three edges or none.
fn edges(normals: &[Wide; 4], ahead: &Wide, inside: f64) -> Option<([Wide; 4], f64)> {
    let mut edges = [[0.0; 3]; 4];
    let mut cosine = 1.0f64;
    for (edge, (i, j)) in edges.iter_mut().zip(ADJACENT) {
        let along = normalized(cross(&normals[i], &normals[j]))?;
        let sign = if dot(&along, ahead) < 0.0 { -1.0 } else { 1.0 };
        *edge = along.map(|x| sign * x);
        cosine = cosine.min(dot(edge, ahead));
        if !(dot(edge, &normals[1 - i]) >= inside && dot(edge, &normals[5 - j]) >= inside) {
            return None;
        }
    }
    (cosine >= f64::from(ClipPyramid::COSINE_MIN)).then_some((edges, cosine))
}

fn wide(v: Vec3) -> Wide {
    v.to_array().map(f64::from)
}

fn dot(a: &Wide, b: &Wide) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: &Wide, b: &Wide) -> Wide {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn sum(vectors: &[Wide; 4]) -> Wide {
    [0, 1, 2].map(|i| vectors.iter().map(|v| v[i]).sum())
}

/// `None` for a vector without length, or one that is not finite.
fn normalized(v: Wide) -> Option<Wide> {
    let squared = dot(&v, &v);
    (squared > 0.0 && squared.is_finite()).then(|| {
        // Newton's square root: exact enough in f64, and the same bits everywhere without a library.
        let length = root(squared);
        v.map(|x| x / length)
    })
}

/// The square root of a positive finite number, to a few units in the last place.
fn root(x: f64) -> f64 {
    // Halving the exponent's bits is within 7 percent; four steps each square the error.
    let guess = f64::from_bits((x.to_bits() >> 1) + (1023 << 51));
    (0..5).fold(guess, |r, _| 0.5 * (r + x / r))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_a_square_root() {
        for x in [1e-76, 0.3, 1.0, 2.0, 3.0, 4.0, 1e9, 1e76] {
            assert!((root(x) - x.sqrt()).abs() <= 4.0 * f64::EPSILON * x.sqrt(), "{x}");
        }
    }

    fn through(corners: [[f32; 3]; 4]) -> Option<ClipPyramid> {
        let corners = corners.map(Vec3::from_array);
        ClipPyramid::new(&Pyramid::through(Vec3::ZERO, corners)?)
    }

    #[test]
    fn what_is_no_pyramid_is_refused() {
        let square = |s: f32| [[-s, -s, 1.0], [-s, s, 1.0], [s, s, 1.0], [s, -s, 1.0]];
        assert!(through(square(1.0)).is_some());
        assert!(through(square(1e-4)).is_some());
        assert!(through(square(1e3)).is_none(), "flat");
        let planes = |normals: [[f32; 3]; 4]| {
            ClipPyramid::new(&Pyramid { apex: Vec3::ZERO, normals: normals.map(Vec3::from_array) })
        };
        let (l, r, b, t) = ([1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]);
        assert!(planes([l, r, b, t]).is_some());
        assert!(planes([l, r, b, [0.0, 0.0, 0.0]]).is_none(), "no plane");
        assert!(planes([l, r, b, [0.0, f32::NAN, 1.0]]).is_none(), "not a number");
        assert!(planes([l, r, b, [0.0, -0.1, 1.0]]).is_some(), "high");
        assert!(planes([l, r, b, [0.0, 1.0, 1.0]]).is_none(), "no top");
        assert!(planes([l, b, r, t]).is_none(), "left and bottom do not face each other");
        assert!(planes([[1.0, 2.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]]).is_none(), "three");
    }

    #[test]
    fn the_axis_is_inside_and_the_planes_lean_out() {
        for s in [1e-4f32, 1e-2, 1.0, 3.0] {
            let square = [[-s, -s, 1.0], [-s, s, 1.0], [s, s, 1.0], [s, -s, 1.0]];
            let pyramid = through(square).unwrap();
            let ray = |direction| Ray { origin: Vec3::ZERO, direction, t_min: 0.0, t_max: 1.0 };
            assert!(pyramid.holds(&ray(Vec3::from_array(pyramid.axis.direction))));
            for k in square {
                assert!(pyramid.holds(&ray(Vec3::from_array(k))), "{s}");
                let outside = Vec3::new(k[0] * (1.0 + 1e-3 / s), k[1], 1.0);
                assert!(!pyramid.holds(&ray(outside)), "{s}");
            }
            assert!(!pyramid.holds(&ray(Vec3::NEG_Z)));
            assert!(!pyramid.holds(&ray(Vec3::Z * f32::MAX)));
            assert!(!pyramid.holds(&Ray { origin: Vec3::X, ..ray(Vec3::Z) }));
        }
    }
}
