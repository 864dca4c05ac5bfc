//! Spheres and cones as triangles, for formats that have nothing else.

/// Corners and their unit normals, and triangles counterclockwise seen from outside.
pub(super) struct Facets {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) normals: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// How many triangles all spheres and cones together may become: a file of about 500 MB.
const TRIANGLES_MAX: usize = 8_000_000;

/// Segments around every sphere and cone: 64, and half of that as often as [`TRIANGLES_MAX`] wants it, down to 8.
pub(super) fn segments(spheres: usize, cones: usize) -> usize {
    let total = |n: usize| {
        let spheres = spheres.saturating_mul(n * (n - 2));
        spheres.saturating_add(cones.saturating_mul(2 * n))
    };
    [64, 32, 16].into_iter().find(|&n| total(n) <= TRIANGLES_MAX).unwrap_or(8)
}

/// The unit circle at `segments` even steps: cosine and sine. The quarters are exact.
fn circle(segments: usize) -> Vec<[f64; 2]> {
    let quarter = segments / 4;
    let step = std::f64::consts::TAU / segments as f64;
    (0..segments)
        .map(|i| {
            let (sin, cos) = libm::sincos((i % quarter) as f64 * step);
            match i / quarter {
                0 => [cos, sin],
                1 => [-sin, cos],
                2 => [-cos, -sin],
                _ => [sin, -cos],
            }
        })
        .collect()
}

/// The unit sphere around the origin, with poles on the z axis: `segments * (segments - 2)` triangles. `segments` is a
/// multiple of 4 and at least 8.
pub(super) fn sphere(segments: usize) -> Facets {
    let around = circle(segments);
    let rings = segments / 2 - 1;
    let mut positions = vec![[0.0, 0.0, 1.0]];
    // The first half of the circle serves as the meridian, from pole to pole.
    for &[z, r] in around.iter().take(rings + 1).skip(1) {
        positions.extend(around.iter().map(|&[x, y]| [r * x, r * y, z]));
    }
    positions.push([0.0, 0.0, -1.0]);
    let last = positions.len() as u32 - 1;
    let corner = |ring: usize, i: usize| (1 + ring * segments + i % segments) as u32;
    let mut triangles = Vec::with_capacity(segments * (segments - 2));
    for i in 0..segments {
        triangles.push([0, corner(0, i), corner(0, i + 1)]);
        for ring in 1..rings {
            let (a, b) = (corner(ring - 1, i), corner(ring - 1, i + 1));
            let (c, d) = (corner(ring, i), corner(ring, i + 1));
            triangles.extend([[a, c, d], [a, d, b]]);
        }
        triangles.push([corner(rings - 1, i), last, corner(rings - 1, i + 1)]);
    }
    Facets { normals: positions.clone(), positions, triangles }
}

/// An open cone or cylinder, smooth around: `2 * segments` triangles, half of them where it ends in a point. `segments`
/// is a multiple of 4.
pub(super) fn cone(base: [f32; 3], base_radius: f32, apex: [f32; 3], apex_radius: f32, segments: usize) -> Facets {
    let (base, apex) = (base.map(f64::from), apex.map(f64::from));
    let (base_radius, apex_radius) = (f64::from(base_radius), f64::from(apex_radius));
    let along: [f64; 3] = std::array::from_fn(|i| apex[i] - base[i]);
    let length = norm(along);
    let axis = along.map(|c| c / length);
    let [u, v] = across(axis);
    let mut positions = Vec::with_capacity(2 * segments);
    let mut normals = Vec::with_capacity(2 * segments);
    for [cos, sin] in circle(segments) {
        let out: [f64; 3] = std::array::from_fn(|i| cos * u[i] + sin * v[i]);
        let normal: [f64; 3] = std::array::from_fn(|i| out[i] * length + axis[i] * (base_radius - apex_radius));
        let scale = norm(normal);
        for (centre, radius) in [(base, base_radius), (apex, apex_radius)] {
            positions.push(std::array::from_fn(|i| centre[i] + radius * out[i]));
            normals.push(normal.map(|c| c / scale));
        }
    }
    let mut triangles = Vec::with_capacity(2 * segments);
    for i in 0..segments {
        let [b, a] = [2 * i, 2 * i + 1].map(|c| c as u32);
        let [next_b, next_a] = [2 * i + 2, 2 * i + 3].map(|c| (c % (2 * segments)) as u32);
        if base_radius > 0.0 {
            triangles.push([b, next_b, next_a]);
        }
        if apex_radius > 0.0 {
            triangles.push([b, next_a, a]);
        }
    }
    Facets { positions, normals, triangles }
}

fn norm(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Two unit vectors that make a right-handed frame with the unit vector `axis`: u x v = axis.
fn across(axis: [f64; 3]) -> [[f64; 3]; 2] {
    let [x, y, z] = axis;
    // Crossed with the coordinate axis that is furthest from it.
    let u = if x.abs() <= y.abs() && x.abs() <= z.abs() {
        [0.0, z, -y]
    } else if y.abs() <= z.abs() {
        [-z, 0.0, x]
    } else {
        [y, -x, 0.0]
    };
    let scale = norm(u);
    let u = u.map(|c| c / scale);
    let v = [y * u[2] - z * u[1], z * u[0] - x * u[2], x * u[1] - y * u[0]];
    [u, v]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| a[i] - b[i])
    }

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }

    fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    }

    /// Area, and that each triangle has one and looks the way its normals do.
    fn area(facets: &Facets) -> f64 {
        facets
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| facets.positions[i as usize]);
                let normal = cross(sub(b, a), sub(c, a));
                assert!(norm(normal) > 0.0, "{t:?}");
                for i in t {
                    let n = facets.normals[*i as usize];
                    assert!(dot(n, normal) > 0.9 * norm(normal), "{t:?}");
                    assert!((norm(n) - 1.0).abs() < 1e-12);
                }
                0.5 * norm(normal)
            })
            .sum()
    }

    #[test]
    fn spheres_are_closed_and_nearly_round() {
        for n in [8, 16, 64] {
            let facets = sphere(n);
            assert_eq!(facets.triangles.len(), n * (n - 2));
            // Euler: a closed surface without holes has V - E + F = 2, and 3 F = 2 E.
            let faces = facets.triangles.len();
            assert_eq!(facets.positions.len() + faces - faces * 3 / 2, 2);
            assert!(facets.positions.iter().all(|&p| (norm(p) - 1.0).abs() < 1e-12));
        }
        let exact = 4.0 * std::f64::consts::PI;
        assert!((area(&sphere(64)) / exact - 1.0).abs() < 3e-3);
    }

    #[test]
    fn cones_have_the_area_of_cones() {
        fn check(base: [f32; 3], base_radius: f32, apex: [f32; 3], apex_radius: f32, count: usize) {
            let facets = cone(base, base_radius, apex, apex_radius, 64);
            assert_eq!(facets.triangles.len(), count);
            let (r, s) = (f64::from(base_radius), f64::from(apex_radius));
            let h = norm(sub(apex.map(f64::from), base.map(f64::from)));
            let exact = std::f64::consts::PI * (r + s) * (h * h + (r - s) * (r - s)).sqrt();
            let ratio = area(&facets) / exact;
            assert!((0.997..1.0).contains(&ratio), "{ratio}");
        }
        check([0.0; 3], 1.0, [0.0, 0.0, 2.0], 1.0, 128);
        check([0.0; 3], 1.0, [3.0, 0.0, 0.0], 0.0, 64);
        check([0.0; 3], 0.0, [0.0, -3.0, 0.0], 2.0, 64);
        check([1.0, 2.0, 3.0], 0.5, [-2.0, 1.0, 7.0], 0.25, 128);
    }

    #[test]
    fn many_objects_get_fewer_segments() {
        assert_eq!(segments(0, 0), 64);
        assert_eq!(segments(2_000, 0), 64);
        assert_eq!(segments(7_381, 0), 32);
        assert_eq!(segments(0, 60_000), 64);
        assert_eq!(segments(usize::MAX, usize::MAX), 8);
    }
}
