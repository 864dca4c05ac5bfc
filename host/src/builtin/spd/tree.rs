//! `tree`: Aono and Kunii's tree (IEEE CG&A, May 1984): each branch carries two shorter ones, on a green field, under
//! seven lights.

use super::super::vector::{Affine, V, X, Z, narrow};
use super::{View, add_quad, scene, surface};
use crate::model::{Cone, Model, Sphere};
use core::f64::consts::PI;

/// Each branch's radius, of its parent's; also the far end's, of the near end's.
const TAPER: f64 = 0.67;
/// The trunk's radius; its length is 1.
const TRUNK: f64 = 0.15;

const VIEW: View = View { eye: [4.5, 0.4, 2.0], target: [0.0, 0.0, 1.5], up: Z, fov_degrees: 45.0, hither: 1.0 };

const LIGHTS: [V; 7] = [
    [-5.0, 5.0, 50.0],
    [30.0, -30.0, 30.0],
    [-40.0, -30.0, 20.0],
    [10.0, 30.0, 40.0],
    [-30.0, 40.0, 10.0],
    [50.0, 25.0, 20.0],
    [-10.0, -60.0, 30.0],
];

/// 2^(size + 1) - 1 cones and as many spheres.
pub fn tree(size: u32) -> Model {
    let mut model = scene(&VIEW, &LIGHTS);
    let corner = |x: f64, y: f64| [50.0 * x, 50.0 * y, 0.0];
    let field = [corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)];
    add_quad(&mut model, "field", field, surface([0.2, 0.7, 0.2], 1.0, 0.0, 0.0, 0.0, 0.0));
    let material = model.add_material("tree", surface([0.55, 0.4, 0.2], 1.0, 0.0, 0.0, 0.0, 0.0));

    let branches = (2_usize << size) - 1;
    model.cones.reserve_exact(branches);
    model.spheres.reserve_exact(branches);
    // Angle to the parent, angle around it, length of the parent's.
    let children = [child(40.0, 90.0, 0.65), child(25.0, 230.0, 0.70)];
    // At most one waiting sibling for each level.
    let mut waiting = vec![(Affine::IDENTITY, TRUNK, size)];
    while let Some((frame, radius, levels)) = waiting.pop() {
        let apex = narrow(frame.apply(Z));
        let apex_radius = (radius * TAPER) as f32;
        model.cones.push(Cone { base: narrow(frame.t), base_radius: radius as f32, apex, apex_radius, material });
        model.spheres.push(Sphere { centre: apex, radius: apex_radius, material });
        if levels > 0 {
            waiting.extend(children.iter().rev().map(|c| (frame.after(c), radius * TAPER, levels - 1)));
        }
    }
    model.objects.spheres = model.spheres.len() as u64;
    model.objects.cones = model.cones.len() as u64;
    model
}

/// The frame of a branch in its parent's, whose branch runs from the origin along z to 1.
fn child(tilt_degrees: f64, around_degrees: f64, length: f64) -> Affine {
    let tilt = Affine::turn_by(X, tilt_degrees * PI / 180.0);
    let around = Affine::turn_by(Z, around_degrees * PI / 180.0);
    let turn = around.after(&tilt);
    Affine { m: turn.m.map(|row| row.map(|x| x * length)), t: Z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::vector::{dot, length, sub, unit};

    /// The lengths, angles and radii that the generator states, measured on what came out.
    #[test]
    fn branches_are_as_stated() {
        let cones = tree(2).cones;
        let along = |c: &Cone| sub(c.apex.map(f64::from), c.base.map(f64::from));
        let (trunk, first) = (along(&cones[0]), along(&cones[1]));
        // Depth first: trunk, its first child, that one's two, then the trunk's second child.
        let second = along(&cones[4]);
        assert!((length(trunk) - 1.0).abs() < 1e-6);
        assert!((length(first) - 0.65).abs() < 1e-6);
        assert!((length(second) - 0.7).abs() < 1e-6);
        for (branch, degrees) in [(first, 40.0), (second, 25.0)] {
            let cosine = dot(unit(trunk), unit(branch));
            assert!((cosine - libm::cos(degrees * PI / 180.0)).abs() < 1e-6);
        }
        // They leave the trunk 140 degrees apart.
        let flat = |v: V| unit([v[0], v[1], 0.0]);
        assert!((dot(flat(first), flat(second)) - libm::cos(140.0 * PI / 180.0)).abs() < 1e-6);
        for c in &cones {
            assert!((c.apex_radius / c.base_radius - 0.67).abs() < 1e-6);
        }
        assert_eq!(cones[1].base, cones[0].apex);
        assert_eq!(cones[1].base_radius, cones[0].apex_radius);
    }
}
