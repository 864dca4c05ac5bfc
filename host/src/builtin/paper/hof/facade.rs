//! Four facades: rustic stones below, windows with frames and ornaments in each bay, balconies, cornices and a roof.

use super::super::super::noise;
use super::super::super::vector::Affine;
use super::super::put;
use super::super::shapes::{at, block, lathe, quad, smooth, stone, surround, tube, turned};
use super::{BAY, STOREY, STOREYS, YARD, glowing, matt, shiny};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;

/// Windows in a bay, from its left and the storey's floor.
const WINDOW: [[f64; 2]; 2] = [[0.5, 1.7], [0.9, 2.95]];
/// Ground floor openings reach lower.
const DOOR: [[f64; 2]; 2] = [[0.35, 1.85], [0.0, 2.9]];

struct Paints {
    plaster: [u16; 2],
    stone: u16,
    frame: u16,
    glass: u16,
    lit: u16,
    iron: u16,
    wood: u16,
    roof: u16,
}

/// Adds the walls. In a facade's frame, x runs along it to the right of one who faces it from the yard, y goes into
/// the wall and z up.
pub fn facades(model: &mut Model) {
    let paints = Paints {
        plaster: [
            model.add_material("plaster", matt([0.62, 0.5, 0.34])),
            model.add_material("plaster-pale", matt([0.68, 0.62, 0.5])),
        ],
        stone: model.add_material("sandstone", matt([0.6, 0.55, 0.46])),
        frame: model.add_material("window-frame", matt([0.75, 0.74, 0.7])),
        glass: model.add_material("pane", shiny([0.03, 0.04, 0.06], 0.35, 300.0)),
        lit: model.add_material("lit-pane", glowing([0.95, 0.68, 0.3])),
        iron: model.add_material("iron", matt([0.05, 0.055, 0.06])),
        wood: model.add_material("gate", matt([0.2, 0.12, 0.07])),
        roof: model.add_material("roof", matt([0.36, 0.14, 0.09])),
    };
    let [x, y] = YARD;
    let sides = [
        (turned(0.0, [0.0, y, 0.0]), x),
        (turned(-90.0, [x, y, 0.0]), y),
        (turned(180.0, [x, 0.0, 0.0]), x),
        (turned(90.0, [0.0, 0.0, 0.0]), y),
    ];
    for (n, (frame, width)) in (0_u32..).zip(sides) {
        facade(model, &paints, n, &frame, (width / BAY + 0.5) as u32);
    }
}

fn facade(model: &mut Model, paints: &Paints, side: u32, frame: &Affine, bays: u32) {
    let width = BAY * f64::from(bays);
    for storey in 0..STOREYS {
        let z = STOREY * f64::from(storey);
        for bay in 0..bays {
            let corner = frame.after(&at([BAY * f64::from(bay), 0.0, z]));
            let name = format!("{side}-{storey}-{bay}");
            let gate = storey == 0 && bay == bays / 2;
            wall(model, paints.plaster[usize::from(storey == 0)], &name, &corner, storey == 0);
            if storey == 0 {
                rustic(model, paints.stone, &name, &corner);
                entrance(model, paints, &name, &corner, gate);
            } else {
                let random = 0.5 + 0.5 * noise::value(f64::from(bay), f64::from(storey), 90 + side);
                window(model, paints, &name, &corner, if random < 0.2 { paints.lit } else { paints.glass });
                ornament(model, paints.stone, &name, &corner, storey);
                if storey < 4 && (bay + 2 * storey + side) % 4 == 1 {
                    balcony(model, paints, &name, &corner);
                } else {
                    sill(model, paints.stone, &name, &corner, storey < 3);
                }
            }
        }
        cornice(
            model,
            paints.stone,
            &format!("cornice-{side}-{storey}"),
            frame,
            width,
            z + STOREY,
            storey + 1 == STOREYS,
        );
    }
    roof(model, paints, side, frame, width);
    pipes(model, paints.iron, side, frame, width);
}

/// A bay's wall around its opening, and the opening's sides.
fn wall(model: &mut Model, plaster: u16, name: &str, corner: &Affine, ground: bool) {
    let [[x0, x1], [z0, z1]] = if ground { DOOR } else { WINDOW };
    let mut mesh = Mesh::default();
    let mut upright = |x: [f64; 2], z: [f64; 2]| {
        quad(&mut mesh, corner, [[x[0], 0.0, z[0]], [x[1], 0.0, z[0]], [x[1], 0.0, z[1]], [x[0], 0.0, z[1]]]);
    };
    upright([0.0, x0], [0.0, STOREY]);
    upright([x1, BAY], [0.0, STOREY]);
    upright([x0, x1], [z1, STOREY]);
    if !ground {
        upright([x0, x1], [0.0, z0]);
    }
    let ring = [[x0, z0], [x1, z0], [x1, z1], [x0, z1]];
    for i in usize::from(ground)..4 {
        let (p, q) = (ring[i], ring[(i + 1) % 4]);
        let point = |p: [f64; 2], y: f64| [p[0], y, p[1]];
        quad(&mut mesh, corner, [point(p, 0.0), point(q, 0.0), point(q, 0.25), point(p, 0.25)]);
    }
    put(model, format!("wall-{name}"), plaster, mesh);
}

/// Courses of bossed stones at both sides of the ground floor's openings: one mesh each side.
fn rustic(model: &mut Model, material: u16, name: &str, corner: &Affine) {
    let upright = corner.after(&Affine::turn_by([1.0, 0.0, 0.0], 0.5 * PI));
    for (side, x) in [[0.0, DOOR[0][0]], [DOOR[0][1], BAY]].into_iter().enumerate() {
        let mut mesh = Mesh::default();
        for course in 0..5 {
            let z = 0.02 + 0.58 * f64::from(course);
            stone(&mut mesh, &upright, [x[0] + 0.01, z, 0.0], [x[1] - 0.01, z + 0.55, 0.07], 0.03);
        }
        put(model, format!("rustic-{name}-{side}"), material, mesh);
    }
}

/// A shop window with a door beside it, or the gate: panels under a fan of glass.
fn entrance(model: &mut Model, paints: &Paints, name: &str, corner: &Affine, gate: bool) {
    let [[x0, x1], [_, z1]] = DOOR;
    let frame = if gate { paints.wood } else { paints.frame };
    let mut mesh = Mesh::default();
    surround(&mut mesh, corner, [x0, x1], [0.0, z1], [0.15, 0.25], 0.09);
    block(&mut mesh, corner, [x0, 0.15, 2.2], [x1, 0.24, 2.28]);
    block(&mut mesh, corner, [0.5 * (x0 + x1) - 0.04, 0.15, 0.0], [0.5 * (x0 + x1) + 0.04, 0.24, 2.2]);
    put(model, format!("entrance-{name}"), frame, mesh);

    let mut mesh = Mesh::default();
    let mut pane = |z: [f64; 2]| {
        quad(&mut mesh, corner, [[x0, 0.2, z[0]], [x1, 0.2, z[0]], [x1, 0.2, z[1]], [x0, 0.2, z[1]]]);
    };
    pane([if gate { 2.2 } else { 0.5 }, z1]);
    put(model, format!("shop-pane-{name}"), if gate { paints.lit } else { paints.glass }, mesh);

    let mut mesh = Mesh::default();
    block(&mut mesh, corner, [x0, 0.17, 0.0], [x1, 0.22, if gate { 2.2 } else { 0.5 }]);
    let upright = corner.after(&Affine { t: [0.0, 0.17, 0.0], ..Affine::turn_by([1.0, 0.0, 0.0], 0.5 * PI) });
    for (a, b) in [(x0 + 0.14, 1.0), (1.2, x1 - 0.14)] {
        let rows: &[[f64; 2]] = if gate { &[[0.15, 0.8], [0.9, 1.5], [1.6, 2.1]] } else { &[[0.14, 0.42]] };
        for z in rows {
            stone(&mut mesh, &upright, [a, z[0], 0.0], [b, z[1], 0.04], 0.04);
        }
    }
    put(model, format!("door-{name}"), paints.wood, mesh);
}

/// Frame with cross bars, and panes.
fn window(model: &mut Model, paints: &Paints, name: &str, corner: &Affine, glass: u16) {
    let [[x0, x1], [z0, z1]] = WINDOW;
    let middle = 0.5 * (x0 + x1);
    let mut mesh = Mesh::default();
    surround(&mut mesh, corner, [x0, x1], [z0, z1], [0.15, 0.24], 0.07);
    block(&mut mesh, corner, [middle - 0.04, 0.14, z0 + 0.07], [middle + 0.04, 0.22, z1 - 0.07]);
    block(&mut mesh, corner, [x0 + 0.07, 0.16, z0 + 1.34], [x1 - 0.07, 0.21, z0 + 1.38]);
    put(model, format!("frame-{name}"), paints.frame, mesh);
    let mut mesh = Mesh::default();
    quad(&mut mesh, corner, [[x0, 0.2, z0], [x1, 0.2, z0], [x1, 0.2, z1], [x0, 0.2, z1]]);
    put(model, format!("pane-{name}"), glass, mesh);
}

/// A moulded architrave; above it a gable, a keystone or a rosette.
fn ornament(model: &mut Model, stone_paint: u16, name: &str, corner: &Affine, storey: u32) {
    let [[x0, x1], [z0, z1]] = WINDOW;
    let mut mesh = Mesh::default();
    surround(&mut mesh, corner, [x0 - 0.16, x1 + 0.16], [z0 - 0.02, z1 + 0.16], [-0.06, 0.0], 0.16);
    put(model, format!("architrave-{name}"), stone_paint, mesh);
    let middle = 0.5 * (x0 + x1);
    let outward =
        |x: f64, z: f64| corner.after(&Affine { t: [x, 0.0, z], ..Affine::turn_by([1.0, 0.0, 0.0], 0.5 * PI) });
    let mut crown = Mesh::default();
    match storey {
        1 => {
            // A gable: two slanting bars on a shelf.
            block(&mut crown, corner, [x0 - 0.24, -0.2, z1 + 0.16], [x1 + 0.24, 0.0, z1 + 0.22]);
            for side in [-1.0, 1.0] {
                let bar = corner.after(&Affine {
                    t: [middle + side * 0.84, -0.2, z1 + 0.22],
                    ..Affine::turn_by([0.0, 1.0, 0.0], side * 0.42)
                });
                let x = if side < 0.0 { [0.0, 0.92] } else { [-0.92, 0.0] };
                block(&mut crown, &bar, [x[0], 0.0, 0.0], [x[1], 0.2, 0.06]);
            }
            put(model, format!("gable-{name}"), stone_paint, crown);
            let mut rosette = Mesh::default();
            let profile = [[0.13, 0.0], [0.13, 0.03], [0.1, 0.05], [0.08, 0.03], [0.05, 0.04], [0.0, 0.07]];
            lathe(&mut rosette, &outward(middle, z1 + 0.36), &profile, 8);
            put(model, format!("rosette-{name}"), stone_paint, smooth(rosette));
        }
        2 | 3 => {
            block(&mut crown, corner, [x0 - 0.2, -0.14, z1 + 0.16], [x1 + 0.2, 0.0, z1 + 0.21]);
            block(&mut crown, corner, [x0 - 0.26, -0.2, z1 + 0.21], [x1 + 0.26, 0.0, z1 + 0.27]);
            put(model, format!("crown-{name}"), stone_paint, crown);
            let mut key = Mesh::default();
            stone(&mut key, &outward(middle, z1), [-0.11, -0.02, 0.06], [0.11, 0.21, 0.2], 0.03);
            put(model, format!("keystone-{name}"), stone_paint, key);
        }
        _ => {
            let profile = [[0.2, 0.0], [0.2, 0.04], [0.16, 0.06], [0.13, 0.03], [0.0, 0.09]];
            lathe(&mut crown, &outward(0.0, 3.2), &profile, 10);
            put(model, format!("medallion-{name}"), stone_paint, smooth(crown));
        }
    }
}

fn sill(model: &mut Model, material: u16, name: &str, corner: &Affine, corbels: bool) {
    let [[x0, x1], [z0, _]] = WINDOW;
    let mut mesh = Mesh::default();
    block(&mut mesh, corner, [x0 - 0.22, -0.16, z0 - 0.1], [x1 + 0.22, 0.15, z0 - 0.02]);
    put(model, format!("sill-{name}"), material, mesh);
    if !corbels {
        return;
    }
    let mut mesh = Mesh::default();
    for x in [x0 - 0.1, x1 - 0.02] {
        block(&mut mesh, corner, [x, -0.11, z0 - 0.28], [x + 0.12, 0.0, z0 - 0.1]);
    }
    put(model, format!("corbels-{name}"), material, mesh);
}

/// A slab on two brackets, with a railing of bars.
fn balcony(model: &mut Model, paints: &Paints, name: &str, corner: &Affine) {
    let (x0, x1, out, floor) = (0.1, BAY - 0.1, -1.0, 0.3);
    let mut slab = Mesh::default();
    block(&mut slab, corner, [x0, out, floor - 0.14], [x1, 0.0, floor]);
    block(&mut slab, corner, [x0 + 0.05, out + 0.05, floor - 0.2], [x1 - 0.05, 0.0, floor - 0.14]);
    put(model, format!("balcony-{name}"), paints.stone, slab);
    for (n, x) in [x0 + 0.3, x1 - 0.3].into_iter().enumerate() {
        // A bracket is a quarter of a wheel under the slab.
        let wheel =
            corner.after(&Affine { t: [x - 0.1, -0.02, floor - 0.2], ..Affine::turn_by([0.0, 1.0, 0.0], 0.5 * PI) });
        let mut bracket = Mesh::default();
        lathe(&mut bracket, &wheel, &[[0.0, 0.0], [0.42, 0.0], [0.42, 0.0], [0.42, 0.2], [0.42, 0.2], [0.0, 0.2]], 10);
        put(model, format!("bracket-{name}-{n}"), paints.stone, smooth(bracket));
    }
    let mut rail = Mesh::default();
    let top = floor + 1.05;
    for z in [floor + 0.1, top] {
        block(&mut rail, corner, [x0 + 0.05, out + 0.05, z - 0.04], [x1 - 0.05, out + 0.1, z]);
        for x in [x0 + 0.05, x1 - 0.1] {
            block(&mut rail, corner, [x, out + 0.1, z - 0.04], [x + 0.05, 0.0, z]);
        }
    }
    put(model, format!("rail-{name}"), paints.iron, rail);
    let mut bars = Mesh::default();
    let mut bar = |x: f64, y: f64| tube(&mut bars, corner, &[[x, y, floor], [x, y, top - 0.04]], 0.015, 3);
    for i in 1..16 {
        bar(x0 + 0.075 + (x1 - x0 - 0.15) * f64::from(i) / 16.0, out + 0.075);
    }
    for i in 0..7 {
        for x in [x0 + 0.075, x1 - 0.075] {
            bar(x, out + 0.075 + 0.13 * f64::from(i));
        }
    }
    put(model, format!("bars-{name}"), paints.iron, smooth(bars));
    // Flowers in a box along the front.
    let green = model.add_material("geranium-leaf", matt([0.1, 0.26, 0.07]));
    let red = model.add_material("geranium", matt([0.6, 0.05, 0.06]));
    let mut tufts = Mesh::default();
    let mut heads = Mesh::default();
    for i in 0..6_u32 {
        let x = x0 + 0.27 + 0.29 * f64::from(i);
        let random = 0.04 * noise::value(x * 50.0, floor, 95);
        stone(&mut tufts, corner, [x - 0.14, out - 0.12, top - 0.2], [x + 0.14, out + 0.04, top + random], 0.03);
        let head = corner.after(&at([x + random, out - 0.06, top + 0.02 + random]));
        lathe(&mut heads, &head, &[[0.0, 0.0], [0.08, 0.03], [0.07, 0.08], [0.0, 0.1]], 4);
    }
    put(model, format!("tufts-{name}"), green, tufts);
    put(model, format!("geraniums-{name}"), red, heads);
}

/// A band between storeys, or the eaves with their row of dentils.
fn cornice(model: &mut Model, material: u16, name: &str, frame: &Affine, width: f64, z: f64, eaves: bool) {
    let mut mesh = Mesh::default();
    block(&mut mesh, frame, [0.0, -0.08, z - 0.16], [width, 0.0, z - 0.1]);
    block(&mut mesh, frame, [0.0, -0.16, z - 0.1], [width, 0.0, z]);
    if eaves {
        block(&mut mesh, frame, [0.0, -0.5, z], [width, 0.0, z + 0.16]);
        for i in 0..(4.0 * width / BAY) as u32 {
            let x = (f64::from(i) + 0.3) * BAY / 4.0;
            block(&mut mesh, frame, [x, -0.4, z - 0.1], [x + 0.22, -0.16, z]);
        }
    }
    put(model, name.to_owned(), material, mesh);
}

/// A slope of tiles with dormers, and chimneys.
fn roof(model: &mut Model, paints: &Paints, side: u32, frame: &Affine, width: f64) {
    let z = STOREY * f64::from(STOREYS) + 0.16;
    let mut slope = Mesh::default();
    for i in 0..6 {
        let t = |i: i32| [f64::from(i) * 0.55, z + f64::from(i) * 0.38];
        let ([y0, z0], [y1, z1]) = (t(i), t(i + 1));
        let [y0, y1] = [y0 - 0.5, y1 - 0.5];
        quad(&mut slope, frame, [[0.0, y0, z0], [width, y0, z0], [width, y1, z1], [0.0, y1, z1]]);
    }
    put(model, format!("roof-{side}"), paints.roof, slope);
    for i in 0..(width / 4.4) as u32 {
        let place = frame.after(&at([4.4 * f64::from(i) + 1.6, 0.4, z + 0.3]));
        let mut dormer = Mesh::default();
        surround(&mut dormer, &place, [0.0, 1.2], [0.0, 1.3], [-0.3, 1.4], 0.12);
        block(&mut dormer, &place, [-0.1, -0.4, 1.3], [1.3, 1.6, 1.4]);
        put(model, format!("dormer-{side}-{i}"), paints.frame, dormer);
        let mut pane = Mesh::default();
        quad(&mut pane, &place, [[0.1, -0.2, 0.1], [1.1, -0.2, 0.1], [1.1, -0.2, 1.2], [0.1, -0.2, 1.2]]);
        put(model, format!("dormer-pane-{side}-{i}"), paints.glass, pane);
    }
}

fn pipes(model: &mut Model, iron: u16, side: u32, frame: &Affine, width: f64) {
    let top = STOREY * f64::from(STOREYS);
    for (n, x) in [0.15, width - 0.15].into_iter().enumerate() {
        let mut pipe = Mesh::default();
        let path = [[x, -0.22, 0.1], [x, -0.2, 0.4], [x, -0.2, top - 0.5], [x, -0.45, top - 0.05]];
        tube(&mut pipe, frame, &path, 0.055, 8);
        put(model, format!("pipe-{side}-{n}"), iron, smooth(pipe));
    }
}
