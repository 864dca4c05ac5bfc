//! A courtyard of our own design, in the place of ROSENTHALERHOF ("about 86,000 triangles (about 2,200 meshes) and 12
//! light sources"): four facades of five storeys around a cobbled yard, seen from a corner in the evening. A low sun
//! and eleven lanterns shine.
//!
//! x runs along the long side; the yard's ground is at z = 0.

mod facade;
mod yard;

use super::super::vector::{V, narrow, unit};
use super::{SIZE_POV, empty, glowing, matt, point_light, shiny};
use crate::model::Model;
use facade::facades;
use hybray_shading::{Light, LightKind};

/// Inner size of the yard.
const YARD: [f64; 2] = [26.4, 17.6];
/// Height of a storey, and how many there are.
const STOREY: f64 = 3.6;
const STOREYS: u32 = 5;
/// Width of a bay: one window.
const BAY: f64 = 2.2;

/// Where the lanterns hang, a little before the walls, or stand.
const LANTERNS: [V; 11] = [
    [5.5, 0.5, 3.3],
    [13.2, 0.5, 3.3],
    [20.9, 0.5, 3.3],
    [5.5, 17.1, 3.3],
    [13.2, 17.1, 3.3],
    [20.9, 17.1, 3.3],
    [0.5, 6.6, 3.3],
    [0.5, 11.0, 3.3],
    [25.9, 4.4, 3.3],
    [25.9, 8.8, 3.3],
    [25.9, 13.2, 3.3],
];

pub fn hof() -> Model {
    let mut model = empty("hof", [1.3, 1.5, 4.6], [17.0, 11.6, 5.4], 62.0, SIZE_POV);
    model.background = [0.3, 0.42, 0.66];
    model.ambient = [0.3, 0.34, 0.44];
    let axis = narrow(unit([0.75, 0.62, -0.62]));
    let sun =
        Light { kind: LightKind::Directional as u32, axis, colour: [1.0, 0.78, 0.5], samples: 1, ..Light::default() };
    // A lantern gives a matt wall half a metre behind it what the sun gives.
    let lantern = |at: &V| Light { flags: Light::FALLOFF, ..point_light(*at, [1.7, 1.2, 0.6]) };
    model.lights = core::iter::once(sun).chain(LANTERNS.iter().map(lantern)).collect();
    facades(&mut model);
    yard::add(&mut model);
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    #[test]
    fn as_large_as_the_original() {
        let model = hof();
        checks::sound(&model);
        assert_eq!((model.primitives(), model.meshes.len()), (86_034, 2_228));
        assert_eq!(model.objects.polygons as usize, model.primitives());
        assert_eq!(model.lights.len(), 12);
        assert_eq!(model.cameras[0].size, Some([640, 480]));
        // Small meshes: none is a tenth of the scene.
        assert!(model.meshes.iter().all(|m| (1..6_000).contains(&m.triangles.len())));
    }

    /// Everything is between the backs of the walls, between the ground and the roofs.
    #[test]
    fn all_is_within_the_walls() {
        let top = STOREY * f64::from(STOREYS) + 3.0;
        for p in hof().meshes.iter().flat_map(|m| &m.positions) {
            let [x, y, z] = p.map(f64::from);
            assert!((-4.0..YARD[0] + 4.0).contains(&x) && (-4.0..YARD[1] + 4.0).contains(&y), "{p:?}");
            assert!((-0.5..top).contains(&z), "{p:?}");
        }
        for lantern in LANTERNS {
            assert!(lantern[0] > 0.0 && lantern[0] < YARD[0] && lantern[1] > 0.0 && lantern[1] < YARD[1]);
        }
    }
}
