//! Floor, walls, ceiling, windows with blinds, door, whiteboard, pictures, shelf and plant.

use super::super::super::noise;
use super::super::super::vector::{Affine, V};
use super::super::put;
use super::super::shapes::{at, block, lathe, quad, sheet, smooth, surround, tube, turned};
use super::lamps::TILE;
use super::{ROOM, matt, shiny};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;

/// Windows along the wall at the greatest y: where each begins, and their width, sill and lintel.
const WINDOWS: [f64; 4] = [0.9, 3.6, 6.3, 9.0];
const WIDTH: f64 = 2.1;
const SILL: f64 = 0.95;
const LINTEL: f64 = 2.55;

const HERE: Affine = Affine::IDENTITY;

pub fn add(model: &mut Model) {
    shell(model);
    ceiling(model);
    windows(model);
    far_wall(model);
    shelf(model);
    plant(model, [11.2, 6.4, 0.0]);
}

fn shell(model: &mut Model) {
    let [x, y, z] = ROOM;
    let carpet = model.add_material("carpet", matt([0.2, 0.22, 0.27]));
    let paint = model.add_material("paint", matt([0.72, 0.69, 0.61]));
    let accent = model.add_material("accent", matt([0.42, 0.22, 0.16]));
    let skirting = model.add_material("skirting", matt([0.5, 0.36, 0.22]));
    let mut mesh = Mesh::default();
    // Squares of two metres.
    sheet(&mut mesh, 5, 6, false, |i, j| [f64::from(j) * x / 6.0, f64::from(i) * y / 4.0, 0.0]);
    put(model, "floor".to_owned(), carpet, mesh);

    let mut mesh = Mesh::default();
    quad(&mut mesh, &HERE, [[0.0; 3], [0.0, 0.0, z], [x, 0.0, z], [x, 0.0, 0.0]]);
    quad(&mut mesh, &HERE, [[0.0, y, 0.0], [0.0, y, z], [0.0, 0.0, z], [0.0; 3]]);
    let mut upright = |x0: f64, x1: f64, z0: f64, z1: f64| {
        quad(&mut mesh, &HERE, [[x0, y, z0], [x1, y, z0], [x1, y, z1], [x0, y, z1]]);
    };
    upright(0.0, x, 0.0, SILL);
    upright(0.0, x, LINTEL, z);
    let mut from = 0.0;
    for start in WINDOWS.into_iter().chain([x]) {
        upright(from, start, SILL, LINTEL);
        from = start + WIDTH;
    }
    put(model, "walls".to_owned(), paint, mesh);

    let mut mesh = Mesh::default();
    quad(&mut mesh, &HERE, [[x, 0.0, 0.0], [x, 0.0, z], [x, y, z], [x, y, 0.0]]);
    put(model, "far-wall".to_owned(), accent, mesh);

    let mut mesh = Mesh::default();
    block(&mut mesh, &HERE, [0.0, 0.0, 0.0], [x, 0.02, 0.1]);
    block(&mut mesh, &HERE, [0.0, y - 0.02, 0.0], [x, y, 0.1]);
    block(&mut mesh, &HERE, [x - 0.02, 1.5, 0.0], [x, y - 0.02, 0.1]);
    put(model, "skirting".to_owned(), skirting, mesh);
}

/// Tiles a little above the bars that carry them.
fn ceiling(model: &mut Model) {
    let [x, y, z] = ROOM;
    let tile = model.add_material("ceiling-tile", hybray_shading::Material { ambient: [2.5; 3], ..matt([0.85; 3]) });
    let bar = model.add_material("ceiling-bar", hybray_shading::Material { ambient: [1.6; 3], ..matt([0.6; 3]) });
    let (columns, rows) = ((x / TILE + 0.5) as u32, (y / TILE + 0.5) as u32);
    let mut mesh = Mesh::default();
    sheet(&mut mesh, rows + 1, columns, false, |i, j| [x - TILE * f64::from(j), TILE * f64::from(i), z]);
    put(model, "ceiling".to_owned(), tile, mesh);
    let mut mesh = Mesh::default();
    for i in 1..columns {
        let at = TILE * f64::from(i);
        block(&mut mesh, &HERE, [at - 0.012, 0.0, z - 0.012], [at + 0.012, y, z - 0.002]);
    }
    for i in 1..rows {
        let at = TILE * f64::from(i);
        block(&mut mesh, &HERE, [0.0, at - 0.012, z - 0.014], [x, at + 0.012, z - 0.004]);
    }
    put(model, "ceiling-bars".to_owned(), bar, mesh);
}

fn windows(model: &mut Model) {
    let y = ROOM[1];
    let reveal = model.add_material("reveal", matt([0.8, 0.78, 0.72]));
    let white = model.add_material("window-frame", matt([0.85; 3]));
    let slat = model.add_material("blind", matt([0.75, 0.73, 0.66]));
    for (n, x) in WINDOWS.into_iter().enumerate() {
        let ends = [x, x + WIDTH];
        let mut hole = Mesh::default();
        let deep = y + 0.25;
        let (a, b, c, d) = ([x, SILL], [ends[1], SILL], [ends[1], LINTEL], [x, LINTEL]);
        for [p, q] in [[a, b], [b, c], [c, d], [d, a]] {
            let corner = |p: [f64; 2], y: f64| [p[0], y, p[1]];
            quad(&mut hole, &HERE, [corner(p, y), corner(q, y), corner(q, deep), corner(p, deep)]);
        }
        block(&mut hole, &HERE, [x - 0.05, y - 0.12, SILL - 0.04], [ends[1] + 0.05, y + 0.25, SILL]);
        put(model, format!("window-{n}-reveal"), reveal, hole);

        let mut frame = Mesh::default();
        for half in [0.0, 0.5 * WIDTH] {
            let x = [x + half, x + half + 0.5 * WIDTH];
            surround(&mut frame, &HERE, x, [SILL, LINTEL], [y + 0.17, y + 0.23], 0.06);
        }
        block(&mut frame, &HERE, [x, y + 0.18, 1.98], [ends[1], y + 0.22, 2.02]);
        put(model, format!("window-{n}-frame"), white, frame);

        let mut blind = Mesh::default();
        block(&mut blind, &HERE, [x + 0.03, y + 0.02, LINTEL - 0.05], [ends[1] - 0.03, y + 0.08, LINTEL]);
        for i in 0..18 {
            let z = LINTEL - 0.09 - 0.042 * f64::from(i);
            let corner = |x: f64, side: f64| [x, y + 0.05 + 0.022 * side, z + 0.012 * side];
            let (l, r) = (x + 0.04, ends[1] - 0.04);
            quad(&mut blind, &HERE, [corner(l, -1.0), corner(r, -1.0), corner(r, 1.0), corner(l, 1.0)]);
        }
        for x in [x + 0.3, ends[1] - 0.3] {
            block(&mut blind, &HERE, [x, y + 0.049, LINTEL - 0.85], [x + 0.006, y + 0.051, LINTEL]);
        }
        put(model, format!("window-{n}-blind"), slat, blind);
    }
}

/// Whiteboard, door, clock and pictures. The frame looks from the wall into the room: its x along the wall to the
/// right of somebody who faces it, its y into the wall.
fn far_wall(model: &mut Model) {
    let wall = turned(-90.0, [ROOM[0], ROOM[1], 0.0]);
    let metal = model.add_material("metal", shiny([0.35, 0.36, 0.38], 0.45, 80.0));
    let board = model.add_material("whiteboard", shiny([0.72, 0.74, 0.76], 0.1, 200.0));
    let wood = model.add_material("door", matt([0.5, 0.3, 0.14]));
    let pale = model.add_material("skirting", matt([0.5, 0.36, 0.22]));

    let mut mesh = Mesh::default();
    block(&mut mesh, &wall, [2.2, -0.03, 0.9], [5.0, -0.001, 2.3]);
    put(model, "whiteboard".to_owned(), board, mesh);
    let mut mesh = Mesh::default();
    surround(&mut mesh, &wall, [2.15, 5.05], [0.85, 2.35], [-0.05, -0.001], 0.05);
    block(&mut mesh, &wall, [2.7, -0.13, 0.86], [4.5, -0.05, 0.88]);
    put(model, "whiteboard-frame".to_owned(), metal, mesh);
    for (i, colour) in [[0.6, 0.05, 0.05], [0.05, 0.1, 0.5], [0.05, 0.4, 0.1], [0.05; 3]].into_iter().enumerate() {
        let ink = model.add_material(["red", "blue", "green", "black"][i], matt(colour));
        let mut mesh = Mesh::default();
        let x = 3.0 + 0.3 * i as f64;
        block(&mut mesh, &wall, [x, -0.11, 0.88], [x + 0.14, -0.09, 0.9]);
        // What was written: lines of strokes of uneven length.
        for line in 0..3_u32 {
            let mut at = 2.5 + 0.9 * f64::from(line % 2);
            let z = 2.05 - 0.25 * i as f64 - 0.07 * f64::from(line);
            for word in 0..4_u32 {
                let long = 0.1 + 0.05 * noise::value(f64::from(word), f64::from(line), 40 + i as u32);
                let corner = |x: f64, z: f64| [x, -0.031, z];
                quad(
                    &mut mesh,
                    &wall,
                    [corner(at, z), corner(at + long, z), corner(at + long, z + 0.022), corner(at, z + 0.022)],
                );
                at += long + 0.04;
            }
        }
        put(model, format!("marker-{i}"), ink, mesh);
    }

    let mut mesh = Mesh::default();
    block(&mut mesh, &wall, [5.72, -0.03, 0.0], [6.62, -0.001, 2.1]);
    for z in [0.2, 1.15] {
        surround(&mut mesh, &wall, [5.85, 6.49], [z, z + 0.8], [-0.045, -0.03], 0.04);
    }
    put(model, "door".to_owned(), wood, mesh);
    let mut mesh = Mesh::default();
    surround(&mut mesh, &wall, [5.64, 6.70], [-0.08, 2.18], [-0.06, -0.001], 0.08);
    put(model, "door-frame".to_owned(), pale, mesh);
    let mut mesh = Mesh::default();
    tube(&mut mesh, &wall, &[[5.8, -0.03, 1.05], [5.8, -0.09, 1.05], [5.82, -0.1, 1.05], [5.93, -0.1, 1.05]], 0.012, 8);
    put(model, "door-handle".to_owned(), metal, smooth(mesh));

    let mut mesh = Mesh::default();
    // A clock's axis points into the room.
    let upright = Affine { t: [ROOM[0] - 0.001, 3.6, 2.65], ..Affine::turn_by([0.0, 1.0, 0.0], -0.5 * PI) };
    lathe(&mut mesh, &upright, &[[0.19, 0.0], [0.19, 0.04], [0.17, 0.05], [0.165, 0.03], [0.0, 0.03]], 18);
    put(model, "clock".to_owned(), board, smooth(mesh));
    let hands = model.add_material("black", matt([0.05; 3]));
    let mut mesh = Mesh::default();
    block(&mut mesh, &wall, [3.595, -0.034, 2.64], [3.605, -0.032, 2.78]);
    block(&mut mesh, &wall, [3.6, -0.034, 2.645], [3.69, -0.032, 2.655]);
    put(model, "clock-hands".to_owned(), hands, mesh);
}

/// A low shelf with books under the windows.
fn shelf(model: &mut Model) {
    let wood = model.add_material("shelf", matt([0.55, 0.37, 0.2]));
    let base = at([6.2, ROOM[1] - 0.36, 0.0]);
    let mut mesh = Mesh::default();
    for z in [0.08, 0.45, 0.8] {
        block(&mut mesh, &base, [0.0, 0.0, z], [4.2, 0.34, z + 0.03]);
    }
    for i in 0..5 {
        let x = 1.045 * f64::from(i);
        block(&mut mesh, &base, [x - 0.01, 0.0, 0.0], [x + 0.01, 0.34, 0.83]);
    }
    put(model, "shelf".to_owned(), wood, mesh);
    let covers = [[0.45, 0.08, 0.07], [0.07, 0.14, 0.34], [0.1, 0.28, 0.14], [0.5, 0.42, 0.2]];
    for (k, colour) in (0_u32..).zip(covers) {
        let cover = model.add_material(&format!("cover-{k}"), matt(colour));
        let mut mesh = Mesh::default();
        // Two books are missing: so the room has as many triangles as the original has polygons.
        for i in 0..26 - k / 2 {
            let n = 4 * i + k;
            let random = |octave: u32| 0.5 + 0.5 * noise::value(f64::from(n), 3.0, octave);
            let (row, place) = (n % 2, n / 2);
            let x = 0.03 + 0.078 * f64::from(place) + 0.02 * random(51);
            let z = 0.11 + 0.37 * f64::from(row);
            block(&mut mesh, &base, [x, 0.02, z], [x + 0.03 + 0.02 * random(52), 0.26, z + 0.2 + 0.08 * random(53)]);
        }
        put(model, format!("books-{k}"), cover, mesh);
    }
}

fn plant(model: &mut Model, foot: V) {
    let clay = model.add_material("clay", matt([0.5, 0.24, 0.13]));
    let green = model.add_material("leaf", matt([0.08, 0.3, 0.06]));
    let mut pot = Mesh::default();
    let profile = [
        [0.0, 0.0],
        [0.16, 0.0],
        [0.16, 0.0],
        [0.22, 0.38],
        [0.24, 0.38],
        [0.24, 0.44],
        [0.2, 0.44],
        [0.19, 0.38],
        [0.0, 0.38],
    ];
    lathe(&mut pot, &at(foot), &profile, 18);
    put(model, "pot".to_owned(), clay, smooth(pot));
    let mut leaves = Mesh::default();
    for i in 0..54_u32 {
        let random = |octave: u32| noise::value(f64::from(i), 7.0, octave);
        // The golden angle spreads the leaves around.
        let around = turned(137.508 * f64::from(i), foot);
        let (reach, rise) = (0.42 + 0.16 * random(60), 0.75 + 0.55 * random(61));
        sheet(&mut leaves, 6, 2, false, |row, column| {
            let t = f64::from(row) / 5.0;
            let width = 0.055 * libm::sin(PI * (0.08 + 0.9 * t)) * (f64::from(column) - 1.0);
            // Up in an arch, drooping at the end, folded along the middle.
            let z = 0.38 + rise * (1.7 * t - 0.9 * t * t) + 0.3 * width.abs();
            around.apply([0.03 + reach * t * t.max(0.3), width, z])
        });
    }
    put(model, "leaves".to_owned(), green, smooth(leaves));
}
