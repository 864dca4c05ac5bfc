//! Awkward scenes. Coordinates are those of internal units: the greatest is about 1, as the host scales them.

use super::{Random, Shape, Shapes};
use hybray_geometry::{Cone, Sphere, Triangle, Vec3};

fn triangle(a: Vec3, b: Vec3, c: Vec3) -> Shape {
    Shape::Triangle(Triangle { v: [a, b, c] })
}

fn sphere(centre: Vec3, radius: f32) -> Shape {
    Shape::Sphere(Sphere { centre, radius })
}

fn cone(base: Vec3, apex: Vec3, base_radius: f32, apex_radius: f32) -> Shape {
    Shape::Cone(Cone { base, base_radius, apex, apex_radius })
}

/// All three kinds, of three sizes, at random.
pub fn mixed(count: usize, seed: u64) -> Vec<Shape> {
    let mut random = Random(seed);
    (0..count)
        .map(|i| {
            let (at, size) = (random.vec(), [0.5, 0.05, 0.005][random.below(3)]);
            match i % 3 {
                0 => triangle(at, at + random.vec() * size, at + random.vec() * size),
                1 => sphere(at, size * (random.signed().abs() + 0.01)),
                _ => cone(at, at + random.vec() * size, size * 0.3, [0.0, 0.3, 0.2][random.below(3)] * size),
            }
        })
        .collect()
}

fn soup(count: usize, seed: u64) -> Vec<Shape> {
    mixed(3 * count, seed).into_iter().step_by(3).collect()
}

/// Sizes over `decades` powers of ten, the largest 1: most of them are denormal, or vanish into a point.
fn sizes(decades: i32) -> Vec<Shape> {
    let mut random = Random(5);
    let scale = |i: i32| 10f64.powi(-i) as f32;
    (0..=decades)
        .flat_map(|i| {
            let (s, at) = (scale(i), random.vec());
            let near = random.vec() * s;
            [
                triangle(at, at + random.vec() * s, at + random.vec() * s),
                triangle(near, near + random.vec() * s, near + random.vec() * s),
                sphere(random.vec() * s, (0.5 * s).max(f32::MIN_POSITIVE)),
                sphere(random.vec(), (0.1 * s).max(f32::MIN_POSITIVE)),
            ]
        })
        .collect()
}

/// Boxes in boxes around one point, and spheres in spheres, each half the one outside it.
fn nested(levels: i32) -> Vec<Shape> {
    let mut all = Vec::new();
    for i in 0..levels {
        let s = 0.5f32.powi(i);
        all.push(sphere(Vec3::ZERO, s));
        for side in [-s, s] {
            all.push(triangle(Vec3::new(side, -s, -s), Vec3::new(side, s, -s), Vec3::new(side, s, s)));
            all.push(triangle(Vec3::new(-s, side, -s), Vec3::new(s, side, -s), Vec3::new(s, side, s)));
        }
    }
    all
}

/// Every scene of the table, by name.
pub fn table() -> Vec<(&'static str, Shapes)> {
    let mut random = Random(11);
    let x = |i: usize, n: usize| i as f32 / n as f32;
    let line = |n: usize| (0..n).map(move |i| sphere(Vec3::X * x(i, n), 0.3 / n as f32));
    let long = |random: &mut Random| {
        let at = random.vec() * 0.1;
        let way = random.vec();
        triangle(at - way, at + way, at + way + random.vec() * 1e-4)
    };
    let mut scenes: Vec<(&'static str, Vec<Shape>)> = vec![
        ("one triangle", soup(1, 1)),
        ("one sphere", vec![sphere(Vec3::new(0.5, -0.25, 0.0), 0.5)]),
        ("one cone", vec![cone(Vec3::ZERO, Vec3::new(0.1, 0.9, 0.2), 0.25, 0.0)]),
        ("two", soup(2, 2)),
        ("one of each kind", mixed(3, 3)),
        ("identical triangles", vec![soup(1, 7)[0]; 2500]),
        ("identical spheres", vec![sphere(Vec3::splat(0.25), 0.5); 1000]),
        ("identical cones", vec![cone(Vec3::ZERO, Vec3::Y, 0.25, 0.125); 300]),
        ("identical points", vec![triangle(Vec3::ONE, Vec3::ONE, Vec3::ONE); 500]),
        ("on a line", line(700).collect()),
        ("on a line, one far off", line(200).chain([sphere(Vec3::X * -1e6, 1e5)]).collect()),
        ("sizes over 30 decades", sizes(30)),
        ("sizes over 60 decades", sizes(60)),
        ("denormals", (0..200).map(|i| sphere(Vec3::splat(1e-44 * i as f32), 1e-40)).collect()),
        ("denormals and a wall", {
            let tiny = |i: usize| Vec3::new(3e-45 * i as f32, 1e-42, -7e-44 * i as f32);
            let wall = triangle(Vec3::ZERO, Vec3::X, Vec3::Y);
            (0..300).map(|i| triangle(tiny(i), tiny(i + 1), tiny(2 * i))).chain([wall]).collect()
        }),
        ("nested", nested(60)),
        ("long and thin", (0..400).map(|_| long(&mut random)).collect()),
        ("mixed kinds", mixed(900, 4)),
        ("soup", soup(1200, 5)),
    ];
    scenes.push(("coplanar", {
        let corner = |i: usize, j: usize| Vec3::new(i as f32 / 16.0 - 1.0, 0.25, j as f32 / 16.0 - 1.0);
        let square = |k: usize| {
            let (i, j) = (k % 32, k / 32);
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [triangle(a, b, c), triangle(a, c, d)]
        };
        (0..32 * 32).flat_map(square).collect()
    }));
    let mut shapes: Vec<(&'static str, Shapes)> =
        scenes.into_iter().map(|(name, all)| (name, Shapes::new(all))).collect();
    shapes.push(("with normals and materials", Shapes { all: mixed(500, 6), materials: 5, smooth: true }));
    shapes
}
