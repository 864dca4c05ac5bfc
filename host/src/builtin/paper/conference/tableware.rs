//! What lies and stands on the table: laptops, notepads, pens, cups and bottles.

use super::super::super::noise;
use super::super::super::vector::Affine;
use super::super::put;
use super::super::shapes::{at, block, lathe, quad, smooth, tube, turned};
use super::{MIDDLE, TABLE, glowing, matt, shiny};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;

pub fn add(model: &mut Model) {
    for (n, (x, side)) in [(-1.85, -1.0), (-0.4, 1.0), (1.08, -1.0), (2.5, 1.0)].into_iter().enumerate() {
        laptop(model, n, &seat(x, side, 0.68));
    }
    for n in 0..16_u32 {
        let (x, side) = (0.74 * (f64::from(n / 2) - 3.5), if n.is_multiple_of(2) { -1.0 } else { 1.0 });
        if n % 3 != 1 {
            notepad(model, n, &seat(x + 0.2, side, 0.72));
        }
        if n % 2 == u32::from(n > 7) {
            cup(model, n, &seat(x - 0.26, side, 0.55));
        }
    }
    for (n, (x, y)) in [(-1.6, 0.05), (-1.45, -0.08), (0.3, 0.1), (0.45, -0.05), (2.1, 0.0)].into_iter().enumerate() {
        bottle(model, n, &at([MIDDLE[0] + x, MIDDLE[1] + y, TABLE]));
    }
}

/// A place on the table as one at that side sees it: y away from the one who sits there.
fn seat(along: f64, side: f64, across: f64) -> Affine {
    let straight = if side < 0.0 { 0.0 } else { 180.0 };
    let crooked = 8.0 * noise::value(libm::floor(along * 10.0), side, 80);
    turned(straight + crooked, [MIDDLE[0] + along, MIDDLE[1] + side * across, TABLE])
}

fn laptop(model: &mut Model, number: usize, frame: &Affine) {
    let grey = model.add_material("laptop", shiny([0.3, 0.31, 0.33], 0.05, 60.0));
    let black = model.add_material("plastic", shiny([0.04; 3], 0.0, 30.0));
    let screen = model.add_material("screen", glowing([0.25, 0.4, 0.6]));
    // The lid leans back by 15 degrees.
    let lid = frame.after(&Affine { t: [0.0, 0.12, 0.02], ..Affine::turn_by([1.0, 0.0, 0.0], -PI / 12.0) });
    let mut body = Mesh::default();
    block(&mut body, frame, [-0.17, -0.12, 0.0], [0.17, 0.12, 0.018]);
    block(&mut body, &lid, [-0.17, 0.0, 0.0], [0.17, 0.008, 0.23]);
    put(model, format!("laptop-{number}"), grey, body);
    let mut keys = Mesh::default();
    for row in 0..5 {
        for column in 0..12 {
            let (x, y) = (-0.15 + 0.025 * f64::from(column), 0.08 - 0.025 * f64::from(row));
            let corner = |dx: f64, dy: f64| [x + dx, y - dy, 0.0185];
            quad(&mut keys, frame, [corner(0.0, 0.02), corner(0.02, 0.02), corner(0.02, 0.0), corner(0.0, 0.0)]);
        }
    }
    put(model, format!("laptop-{number}-keys"), black, keys);
    let mut shown = Mesh::default();
    let corner = |x: f64, z: f64| [x, -0.0005, z];
    quad(&mut shown, &lid, [corner(-0.155, 0.02), corner(0.155, 0.02), corner(0.155, 0.215), corner(-0.155, 0.215)]);
    put(model, format!("laptop-{number}-screen"), screen, shown);
}

fn notepad(model: &mut Model, number: u32, frame: &Affine) {
    let paper = model.add_material("paper", matt([0.85, 0.84, 0.76]));
    let ink = model.add_material("blue", matt([0.05, 0.1, 0.5]));
    let mut pad = Mesh::default();
    block(&mut pad, frame, [-0.1, -0.14, 0.0], [0.1, 0.14, 0.008]);
    put(model, format!("notepad-{number}"), paper, pad);
    let mut pen = Mesh::default();
    tube(&mut pen, frame, &[[-0.06, -0.05, 0.0125], [0.05, 0.06, 0.0125]], 0.0045, 6);
    put(model, format!("pen-{number}"), ink, smooth(pen));
}

fn cup(model: &mut Model, number: u32, frame: &Affine) {
    let china = model.add_material("china", shiny([0.75, 0.74, 0.7], 0.05, 80.0));
    let mut cup = Mesh::default();
    let saucer = [[0.0, 0.002], [0.05, 0.002], [0.08, 0.014], [0.08, 0.017], [0.05, 0.006], [0.0, 0.006]];
    lathe(&mut cup, frame, &saucer, 12);
    let body =
        [[0.025, 0.006], [0.036, 0.02], [0.042, 0.045], [0.045, 0.08], [0.042, 0.08], [0.038, 0.045], [0.0, 0.014]];
    lathe(&mut cup, frame, &body, 12);
    let handle = [[0.042, 0.0, 0.07], [0.062, 0.0, 0.066], [0.068, 0.0, 0.05], [0.058, 0.0, 0.034], [0.038, 0.0, 0.03]];
    tube(&mut cup, frame, &handle, 0.005, 6);
    put(model, format!("cup-{number}"), china, smooth(cup));
}

fn bottle(model: &mut Model, number: usize, frame: &Affine) {
    let glass = model.add_material("bottle", shiny([0.03, 0.16, 0.07], 0.22, 150.0));
    let label = model.add_material("paper", matt([0.85, 0.84, 0.76]));
    let mut mesh = Mesh::default();
    let profile = [
        [0.0, 0.0],
        [0.036, 0.0],
        [0.036, 0.0],
        [0.037, 0.005],
        [0.037, 0.15],
        [0.032, 0.175],
        [0.018, 0.205],
        [0.013, 0.225],
        [0.013, 0.26],
        [0.016, 0.262],
        [0.016, 0.275],
        [0.0, 0.275],
    ];
    lathe(&mut mesh, frame, &profile, 12);
    put(model, format!("bottle-{number}"), glass, smooth(mesh));
    let mut mesh = Mesh::default();
    lathe(&mut mesh, frame, &[[0.0375, 0.05], [0.0375, 0.12]], 12);
    put(model, format!("label-{number}"), label, smooth(mesh));
}
