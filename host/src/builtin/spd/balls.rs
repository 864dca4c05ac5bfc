//! `balls`, the sphereflake: each sphere carries nine of a third of its radius, six around its equator and three
//! above it (as seen from where it touches its parent).

use super::super::vector::{Affine, V, Y, Z, add, cross, narrow, scale, sub, unit};
use super::{View, add_quad, scene, surface};
use crate::model::{Model, Sphere};
use core::f64::consts::PI;

/// Radius of a child, its parent's being 1.
const RATIO: f64 = 1.0 / 3.0;

const VIEW: View =
    View { eye: [2.1, 1.3, 1.7], target: [0.0; 3], up: [0.0, 0.0, 1.0], fov_degrees: 45.0, hither: 0.01 };

const LIGHTS: [V; 3] = [[4.0, 3.0, 2.0], [1.0, -4.0, 4.0], [-3.0, 1.0, 5.0]];

/// (9^(size + 1) - 1) / 8 spheres over a square.
pub fn balls(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    let corner = |x: f64, y: f64| [x, y, -0.5];
    let square = [corner(12.0, 12.0), corner(-12.0, 12.0), corner(-12.0, -12.0), corner(12.0, -12.0)];
    add_quad(&mut model, "floor", square, surface([1.0, 0.75, 0.33], 0.8, 0.0, 0.0, 0.0, 1.0));
    flake(&mut model, size);
    model
}

/// The spheres alone, as in Reinhard's report of 1995.
pub fn balls_noground(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    flake(&mut model, size);
    model
}

fn flake(model: &mut Model, size: u32) {
    let material = model.add_material("balls", surface([1.0, 0.9, 0.7], 0.5, 0.5, 37.0, 0.0, 1.0));
    model.spheres.reserve_exact((9_usize.pow(size + 1) - 1) / 8);
    let petals = petals();
    // Depth first, parents before children. The stack holds at most eight waiting siblings for each level.
    let mut waiting = vec![Ball { centre: [0.0; 3], radius: 0.5, outward: Z, levels: size }];
    while let Some(ball) = waiting.pop() {
        model.spheres.push(Sphere { centre: narrow(ball.centre), radius: ball.radius as f32, material });
        if ball.levels > 0 {
            let turn = from_z_to(ball.outward);
            let child = |petal: &V| ball.child(turn.apply(*petal));
            waiting.extend(petals.iter().rev().map(child));
        }
    }
    model.objects.spheres = model.spheres.len() as u64;
}

struct Ball {
    centre: V,
    radius: f64,
    /// Unit vector from the parent's centre.
    outward: V,
    /// Levels of children that it still gets.
    levels: u32,
}

impl Ball {
    fn child(&self, direction: V) -> Self {
        let distance = self.radius * (1.0 + RATIO);
        let centre = add(self.centre, scale(direction, distance));
        let outward = scale(sub(centre, self.centre), 1.0 / distance);
        Self { centre, radius: self.radius * RATIO, outward, levels: self.levels - 1 }
    }
}

/// The turn that brings +z to `outward` the short way. Where that is nearly no turn, none, and where it is nearly half
/// a turn, half a turn about y: the published generator draws the line at 0.9999 and so do we.
fn from_z_to(outward: V) -> Affine {
    let cosine = outward[2];
    if cosine >= 0.9999 {
        Affine::IDENTITY
    } else if cosine <= -0.9999 {
        Affine::turn(Y, -1.0, 0.0)
    } else {
        Affine::turn(unit(cross(Z, outward)), cosine, (1.0 - cosine * cosine).sqrt())
    }
}

/// Directions of the nine children of a sphere whose parent lies below it.
fn petals() -> [V; 9] {
    let d = 0.5_f64.sqrt();
    // Three directions in the plane through the diagonal of a cube, tipped until two of them are level.
    let tip = Affine::turn_by(unit([1.0, -1.0, 0.0]), libm::asin(2.0 / 6.0_f64.sqrt()));
    let trio = [[d, d, 0.0], [d, 0.0, -d], [0.0, d, -d]].map(|v| tip.apply(v));
    core::array::from_fn(|i| Affine::turn_by(Z, (i / 3) as f64 * 2.0 * PI / 3.0).apply(trio[i % 3]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::vector::{dot, length};

    /// Published description: six children around the equator, three in the upper hemisphere.
    #[test]
    fn six_around_three_above() {
        let petals = petals();
        let level = petals.iter().filter(|p| p[2].abs() < 1e-12).count();
        let above = petals.iter().filter(|p| p[2] > 0.5).count();
        assert_eq!((level, above), (6, 3), "{petals:?}");
        assert!(petals.iter().all(|p| (length(*p) - 1.0).abs() < 1e-12));
        // Children of radius 1/3 at 4/3 do not run into one another: they touch at an angle of 60 degrees or lie apart.
        for (i, a) in petals.iter().enumerate() {
            for b in &petals[..i] {
                let distance = length(sub(scale(*a, 4.0 / 3.0), scale(*b, 4.0 / 3.0)));
                assert!(distance > 2.0 / 3.0 - 1e-9, "{} {distance}", dot(*a, *b));
            }
        }
    }

    /// Depth first: the parent of a sphere is the nearest one before it whose radius is three times as large.
    #[test]
    fn children_touch_their_parents() {
        let spheres = balls_noground(4).spheres;
        let mut path: Vec<Sphere> = Vec::new();
        for sphere in spheres {
            while path.last().is_some_and(|p| p.radius < 2.0 * sphere.radius) {
                path.pop();
            }
            if let Some(parent) = path.last() {
                let [a, b] = [parent.centre, sphere.centre].map(|c| c.map(f64::from));
                let expected = f64::from(parent.radius) + f64::from(sphere.radius);
                assert!((length(sub(a, b)) - expected).abs() < 1e-6);
                assert!((parent.radius / sphere.radius - 3.0).abs() < 1e-5);
            }
            path.push(sphere);
            assert!(path.len() <= 5);
        }
    }

    /// The limit of the flake: 1/2 + 2 (1/6 + 1/18 + ...) = 1.
    #[test]
    fn lies_in_the_unit_sphere() {
        for s in balls_noground(4).spheres {
            assert!(length(s.centre.map(f64::from)) + f64::from(s.radius) < 1.0);
        }
    }
}
