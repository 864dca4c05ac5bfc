//! Thirty lamps at the ceiling: eight troughs with louvres, in two rows above the table's long sides, and twenty-two
//! round ones along the walls. Each holds a point light just below.

use super::super::super::vector::V;
use super::super::put;
use super::super::shapes::{at, block, lathe, quad, smooth};
use super::{ROOM, glowing, matt, shiny};
use crate::model::{Mesh, Model};

/// Edge of a ceiling tile.
pub const TILE: f64 = 0.6;

/// A lamp by the middle of where it hangs, at the ceiling's height.
#[derive(Clone, Copy)]
pub enum Lamp {
    /// Two tiles long along x, one wide.
    Trough(V),
    Round(V),
}

/// Troughs first.
pub fn lamps() -> impl Iterator<Item = Lamp> {
    let troughs = (0..8_u32).map(|i| {
        let (along, across) = (f64::from(i / 2), f64::from(i % 2));
        Lamp::Trough([TILE * (4.0 + 4.0 * along), TILE * (3.5 + 5.0 * across), ROOM[2]])
    });
    let sides = (0..18_u32).map(|i| {
        let (along, across) = (f64::from(i / 2), f64::from(i % 2));
        Lamp::Round([TILE * (1.5 + 2.125 * along), TILE * (1.5 + 9.0 * across), ROOM[2]])
    });
    let ends = (0..4_u32).map(|i| {
        let (along, across) = (f64::from(i / 2), f64::from(i % 2));
        Lamp::Round([TILE * (1.5 + 17.0 * along), TILE * (4.5 + 3.0 * across), ROOM[2]])
    });
    troughs.chain(sides).chain(ends)
}

/// Where a lamp's light is: below all of its housing.
pub fn shine(lamp: Lamp) -> V {
    let (Lamp::Trough([x, y, z]) | Lamp::Round([x, y, z])) = lamp;
    [x, y, z - 0.1]
}

/// All lamps, the first `lit` of which glow.
pub fn add(model: &mut Model, lit: u32) {
    let white = model.add_material("lamp-housing", matt([0.85; 3]));
    let louvre = model.add_material("lamp-louvre", shiny([0.55; 3], 0.35, 60.0));
    let on = model.add_material("lamp-on", glowing([1.0, 0.97, 0.9]));
    for (i, lamp) in (0_u32..).zip(lamps()) {
        let glass = if i < lit { on } else { model.add_material("lamp-off", matt([0.6; 3])) };
        match lamp {
            Lamp::Trough(middle) => trough(model, i, middle, [white, louvre, glass]),
            Lamp::Round(middle) => round(model, i, middle, [white, glass]),
        }
    }
}

fn trough(model: &mut Model, number: u32, middle: V, [white, louvre, glass]: [u16; 3]) {
    let frame = at(middle);
    let (half_x, half_y) = (TILE, 0.5 * TILE);
    let mut housing = Mesh::default();
    let mut blades = Mesh::default();
    for side in [-1.0, 1.0] {
        let y = [side * half_y, side * (half_y - 0.03)];
        block(&mut housing, &frame, [-half_x, y[0].min(y[1]), -0.07], [half_x, y[0].max(y[1]), 0.0]);
        let x = [side * half_x, side * (half_x - 0.03)];
        block(&mut housing, &frame, [x[0].min(x[1]), 0.03 - half_y, -0.07], [x[0].max(x[1]), half_y - 0.03, 0.0]);
    }
    for i in -3..=3 {
        let x = 0.15 * f64::from(i);
        block(&mut blades, &frame, [x - 0.004, 0.03 - half_y, -0.06], [x + 0.004, half_y - 0.03, -0.02]);
    }
    let mut panel = Mesh::default();
    let corner = |x: f64, y: f64| [x * half_x, y * half_y, -0.01];
    quad(&mut panel, &frame, [corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]);
    put(model, format!("trough-{number}"), white, housing);
    put(model, format!("trough-{number}-louvre"), louvre, blades);
    put(model, format!("trough-{number}-panel"), glass, panel);
}

fn round(model: &mut Model, number: u32, middle: V, [white, glass]: [u16; 2]) {
    let mut ring = Mesh::default();
    lathe(&mut ring, &at(middle), &[[0.08, -0.02], [0.1, -0.05], [0.13, -0.04], [0.14, 0.0]], 12);
    put(model, format!("lamp-{number}"), white, smooth(ring));
    let mut disc = Mesh::default();
    lathe(&mut disc, &at(middle), &[[0.0, -0.02], [0.081, -0.02]], 12);
    put(model, format!("lamp-{number}-glass"), glass, disc);
}
