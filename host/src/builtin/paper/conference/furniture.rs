//! The table and eighteen chairs.

use super::super::super::noise;
use super::super::super::vector::{Affine, V};
use super::super::put;
use super::super::shapes::{at, block, cushion, lathe, sheet, smooth, tube, turned};
use super::{MIDDLE, TABLE, matt, shiny};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;

/// Half the table's length and width.
const HALF: [f64; 2] = [3.3, 0.95];

pub fn add(model: &mut Model) {
    table(model);
    for i in 0..8_u32 {
        for side in [-1.0, 1.0] {
            let x = MIDDLE[0] + 0.74 * (f64::from(i) - 3.5);
            // Chairs look at the table, none quite straight.
            let number = 2 * i + u32::from(side > 0.0);
            let sloppy = |octave: u32| noise::value(f64::from(number), 1.0, octave);
            let back = 0.16 + 0.1 * sloppy(70);
            let facing = if side < 0.0 { 0.0 } else { 180.0 };
            let place = [x, MIDDLE[1] + side * (HALF[1] + back), 0.0];
            chair(model, number, &turned(facing + 16.0 * sloppy(71), place));
        }
    }
    for (number, side, facing) in [(16, -1.0, -90.0), (17, 1.0, 90.0)] {
        chair(model, number, &turned(facing, [MIDDLE[0] + side * (HALF[0] + 0.3), MIDDLE[1], 0.0]));
    }
}

/// A boat-shaped top with rounded edges on two drums.
fn table(model: &mut Model) {
    let wood = model.add_material("table", shiny([0.36, 0.16, 0.07], 0.14, 90.0));
    let dark = model.add_material("drum", matt([0.12, 0.07, 0.05]));
    let metal = model.add_material("metal", shiny([0.35, 0.36, 0.38], 0.45, 80.0));
    // Inset from the outline, and height.
    let mut profile = vec![[0.95, TABLE - 0.05], [0.025, TABLE - 0.05]];
    profile.extend((0..=8).map(|i| {
        let a = PI * (f64::from(i) / 8.0 - 0.5);
        [0.025 * (1.0 - libm::cos(a)), TABLE - 0.025 + 0.025 * libm::sin(a)]
    }));
    profile.extend([[0.025, TABLE], [0.95, TABLE]]);
    let segments = 48;
    let mut top = Mesh::default();
    sheet(&mut top, profile.len() as u32, segments, true, |i, j| {
        let [inset, z] = profile[i as usize];
        let a = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(segments);
        let rounded = |c: f64| libm::copysign(libm::pow(c.abs(), 0.55), c);
        let (x, y) = (rounded(libm::cos(a)), rounded(libm::sin(a)));
        [MIDDLE[0] + x * (HALF[0] - inset), MIDDLE[1] + y * (HALF[1] - inset), z]
    });
    put(model, "table-top".to_owned(), wood, smooth(top));
    for (n, side) in [-1.0, 1.0].into_iter().enumerate() {
        let place = at([MIDDLE[0] + side * 1.7, MIDDLE[1], 0.0]);
        let mut drum = Mesh::default();
        lathe(&mut drum, &place, &[[0.36, 0.04], [0.36, TABLE - 0.05]], 20);
        put(model, format!("drum-{n}"), dark, smooth(drum));
        let mut foot = Mesh::default();
        lathe(&mut foot, &place, &[[0.45, 0.0], [0.45, 0.025], [0.44, 0.04], [0.36, 0.045]], 20);
        put(model, format!("drum-{n}-foot"), metal, smooth(foot));
    }
}

/// Faces along the frame's y.
fn chair(model: &mut Model, number: u32, frame: &Affine) {
    let fabric = model.add_material("fabric", matt([0.09, 0.16, 0.32]));
    let black = model.add_material("plastic", shiny([0.04; 3], 0.0, 30.0));
    let metal = model.add_material("metal", shiny([0.35, 0.36, 0.38], 0.45, 80.0));

    let mut soft = Mesh::default();
    cushion(&mut soft, [0.25, 0.24, 0.045], 0.45, [12, 6], |[x, y, z]| {
        // The front edge falls off.
        let fall = (y - 0.1).max(0.0);
        frame.apply([x, y, 0.46 + z - 0.8 * fall * fall])
    });
    cushion(&mut soft, [0.23, 0.27, 0.035], 0.5, [12, 6], |[x, up, thick]| {
        // Bent around the sitter and leaning back.
        frame.apply([x, -0.23 + 0.9 * x * x - 0.22 * (up + 0.27) - thick, 0.84 + up])
    });
    put(model, format!("chair-{number}-cushions"), fabric, smooth(soft));

    let mut arms = Mesh::default();
    for side in [-1.0, 1.0] {
        let x = 0.29 * side;
        let path: [V; 7] = [
            [0.2 * side, 0.0, 0.41],
            [x, 0.0, 0.43],
            [x, 0.01, 0.6],
            [x, -0.02, 0.665],
            [x, -0.1, 0.675],
            [0.28 * side, -0.2, 0.67],
            [0.2 * side, -0.235, 0.66],
        ];
        tube(&mut arms, frame, &path, 0.018, 5);
    }
    put(model, format!("chair-{number}-arms"), black, smooth(arms));

    let mut column = Mesh::default();
    lathe(&mut column, frame, &[[0.05, 0.08], [0.05, 0.12], [0.028, 0.13], [0.028, 0.3], [0.1, 0.41]], 8);
    put(model, format!("chair-{number}-column"), metal, smooth(column));
    let mut star = Mesh::default();
    let mut castors = Mesh::default();
    for leg in 0..5 {
        let spoke = frame.after(&turned(72.0 * f64::from(leg) + 18.0, [0.0; 3]));
        block(&mut star, &spoke, [0.04, -0.02, 0.075], [0.3, 0.02, 0.105]);
        let axle = spoke.after(&Affine { t: [0.28, -0.02, 0.035], ..Affine::turn_by([1.0, 0.0, 0.0], -0.5 * PI) });
        lathe(&mut castors, &axle, &[[0.0, 0.0], [0.035, 0.0], [0.035, 0.04], [0.0, 0.04]], 6);
    }
    put(model, format!("chair-{number}-star"), metal, star);
    put(model, format!("chair-{number}-castors"), black, castors);
}
