//! What is in the yard: cobbles, a fountain, trees, benches, tubs and lanterns.

use super::super::super::noise;
use super::super::super::vector::{Affine, V, add as sum, scale, sub, unit};
use super::super::put;
use super::super::shapes::{at, block, cushion, lathe, quad, smooth, stone, surround, tube, turned};
use super::{LANTERNS, YARD, glowing, matt, shiny};
use crate::model::{Mesh, Model};
use core::f64::consts::PI;

/// Edge of a cobble; as many along each side of a patch, which is a mesh.
const COBBLE: f64 = 0.55;
const PATCH: u32 = 2;

/// Clumps of leaves of a tree.
const CLUMPS: u32 = 38;

const FOUNTAIN: V = [14.6, 9.0, 0.0];

pub fn add(model: &mut Model) {
    cobbles(model);
    fountain(model);
    for (n, (x, y)) in [(20.5, 5.0), (8.2, 13.2), (21.0, 13.4)].into_iter().enumerate() {
        tree(model, n as u32, [x, y, 0.0]);
    }
    for (n, degrees) in [20.0, 110.0, 200.0, 290.0].into_iter().enumerate() {
        let around = turned(degrees, FOUNTAIN);
        bench(model, n, &around.after(&at([-0.8, -3.6, 0.0])));
    }
    for (n, lantern) in LANTERNS.into_iter().enumerate() {
        hang(model, n, lantern);
    }
    for n in 0..24_u32 {
        // Along the long walls, before the piers between doors.
        let (i, far) = (n / 2, n % 2 == 1);
        let y = if far { YARD[1] - 0.6 } else { 0.6 };
        tub(model, n, [2.2 * f64::from(i) + 2.2, y, 0.0]);
    }
}

fn cobbles(model: &mut Model) {
    let earth = model.add_material("sand", matt([0.22, 0.2, 0.17]));
    let mut ground = Mesh::default();
    let [x, y] = YARD;
    quad(&mut ground, &Affine::IDENTITY, [[0.0; 3], [x, 0.0, 0.0], [x, y, 0.0], [0.0, y, 0.0]]);
    put(model, "ground".to_owned(), earth, ground);
    let greys = [[0.36, 0.34, 0.32], [0.41, 0.38, 0.34], [0.33, 0.32, 0.33]];
    let paints = [0, 1, 2].map(|i| model.add_material(&format!("cobble-{i}"), matt(greys[i])));
    let edge = COBBLE * f64::from(PATCH);
    let (columns, rows) = ((x / edge + 0.5) as u32, (y / edge + 0.5) as u32);
    for j in 0..rows {
        for i in 0..columns {
            let mut mesh = Mesh::default();
            for k in 0..PATCH * PATCH {
                let (u, v) = (i * PATCH + k % PATCH, j * PATCH + k / PATCH);
                let random = |octave: u32| noise::value(f64::from(u), f64::from(v), octave);
                let corner = [COBBLE * (f64::from(u) + 0.5), COBBLE * (f64::from(v) + 0.5), 0.0];
                let half = [0.255 + 0.008 * random(96), 0.255 + 0.008 * random(97)];
                let tall = 0.06 + 0.012 * random(98);
                let place = turned(2.0 * random(99), corner);
                stone(&mut mesh, &place, [-half[0], -half[1], 0.0], [half[0], half[1], tall], 0.035);
            }
            let paint = paints[(1.5 + 1.499 * noise::value(f64::from(i), f64::from(j), 100)) as usize];
            put(model, format!("cobbles-{i}-{j}"), paint, mesh);
        }
    }
}

fn fountain(model: &mut Model) {
    let basalt = model.add_material("basalt", matt([0.34, 0.33, 0.32]));
    let water = model.add_material("water", shiny([0.03, 0.06, 0.08], 0.55, 400.0));
    let bronze = model.add_material("bronze", shiny([0.2, 0.26, 0.18], 0.1, 30.0));
    let place = at(FOUNTAIN);
    let mut basin = Mesh::default();
    let profile = [
        [2.3, 0.0],
        [2.3, 0.2],
        [2.15, 0.25],
        [2.1, 0.6],
        [2.25, 0.68],
        [2.25, 0.76],
        [2.25, 0.76],
        [1.9, 0.76],
        [1.9, 0.76],
        [1.85, 0.3],
        [0.0, 0.3],
    ];
    lathe(&mut basin, &place, &profile, 48);
    put(model, "basin".to_owned(), basalt, smooth(basin));
    for (n, (radius, z)) in [(1.87, 0.64), (0.78, 1.86)].into_iter().enumerate() {
        let mut pool = Mesh::default();
        lathe(&mut pool, &place, &[[radius, z], [0.0, z]], 48);
        put(model, format!("water-{n}"), water, pool);
    }
    let mut column = Mesh::default();
    let profile = [
        [0.45, 0.3],
        [0.42, 0.8],
        [0.2, 0.95],
        [0.17, 1.45],
        [0.28, 1.6],
        [0.75, 1.8],
        [0.86, 1.92],
        [0.8, 1.92],
        [0.72, 1.82],
        [0.2, 1.75],
        [0.14, 2.1],
        [0.22, 2.3],
        [0.1, 2.5],
    ];
    lathe(&mut column, &place, &profile, 32);
    put(model, "column".to_owned(), bronze, smooth(column));
    let mut finial = Mesh::default();
    let top = sum(FOUNTAIN, [0.0, 0.0, 2.72]);
    cushion(&mut finial, [0.26, 0.26, 0.26], 1.0, [24, 12], |p| sum(top, p));
    put(model, "finial".to_owned(), bronze, smooth(finial));
}

/// A trunk with boughs that fork, and a crown of clumps of leaves, each a mesh.
fn tree(model: &mut Model, number: u32, foot: V) {
    let bark = model.add_material("bark", matt([0.2, 0.15, 0.1]));
    let green =
        [model.add_material("leaf-0", matt([0.16, 0.3, 0.07])), model.add_material("leaf-1", matt([0.24, 0.34, 0.08]))];
    let frame = at(foot);
    let mut wood = Mesh::default();
    tube(&mut wood, &frame, &[[0.0; 3], [0.03, 0.0, 1.2], [0.0, 0.05, 2.6]], 0.14, 9);
    for n in 0..CLUMPS {
        let random = |octave: u32| noise::value(f64::from(n), f64::from(number), octave);
        let angle = 137.508 * PI / 180.0 * f64::from(n);
        let height = 2.9 + 2.5 * f64::from(n) / f64::from(CLUMPS) + 0.2 * random(101);
        // Widest a third of the way up the crown.
        let reach = 1.75 * libm::sin(PI * (0.22 + 0.72 * f64::from(n) / f64::from(CLUMPS))) + 0.2 * random(102);
        let clump = [reach * libm::cos(angle), reach * libm::sin(angle), height];
        tube(
            &mut wood,
            &frame,
            &[[0.0, 0.05, 2.2 + 1.4 * f64::from(n) / f64::from(CLUMPS)], scale(clump, 0.75), clump],
            0.025,
            3,
        );
        let mut leaves = Mesh::default();
        for k in 0..22_u32 {
            let random = |octave: u32| noise::value(f64::from(n * 64 + k), f64::from(number), octave);
            let out = unit([random(103), random(104), random(105) + 0.01]);
            let at = sum(clump, scale(out, 0.62 * libm::cbrt(0.5 + 0.5 * random(106))));
            let along = unit([random(107), random(108), 0.4 * random(109) - 0.3]);
            let across = unit([along[1] + 0.01, -along[0], 0.5 * random(110)]);
            let (long, wide) = (scale(along, 0.19), scale(across, 0.1));
            quad(
                &mut leaves,
                &frame,
                [at, sum(sum(at, long), wide), sum(at, scale(long, 2.0)), sub(sum(at, long), wide)],
            );
        }
        put(model, format!("leaves-{number}-{n}"), green[(n % 2) as usize], leaves);
    }
    put(model, format!("tree-{number}"), bark, smooth(wood));
}

fn bench(model: &mut Model, number: usize, frame: &Affine) {
    let slats = model.add_material("slats", matt([0.35, 0.2, 0.1]));
    let iron = model.add_material("iron", matt([0.05, 0.055, 0.06]));
    let mut mesh = Mesh::default();
    for i in 0..4 {
        let y = 0.11 * f64::from(i);
        block(&mut mesh, frame, [0.0, y, 0.44], [1.6, y + 0.08, 0.47]);
    }
    for i in 0..3 {
        let z = 0.56 + 0.12 * f64::from(i);
        block(&mut mesh, frame, [0.0, -0.08, z], [1.6, -0.05, z + 0.09]);
    }
    put(model, format!("bench-{number}"), slats, mesh);
    let mut mesh = Mesh::default();
    for x in [0.1, 1.44] {
        block(&mut mesh, frame, [x, -0.05, 0.0], [x + 0.06, 0.0, 0.9]);
        block(&mut mesh, frame, [x, 0.36, 0.0], [x + 0.06, 0.41, 0.44]);
        block(&mut mesh, frame, [x, 0.0, 0.38], [x + 0.06, 0.36, 0.44]);
    }
    put(model, format!("bench-{number}-feet"), iron, mesh);
}

/// A lantern around its light: open below and at its sides but for four bars, on an arm from the nearest wall.
fn hang(model: &mut Model, number: usize, [x, y, z]: V) {
    let iron = model.add_material("iron", matt([0.05, 0.055, 0.06]));
    let flame = model.add_material("flame", glowing([1.0, 0.85, 0.5]));
    let [width, depth] = YARD;
    // The wall is behind: x' points from it into the yard.
    let inward = [(x, 0.0), (y, 90.0), (width - x, 180.0), (depth - y, 270.0)];
    let nearest = inward.into_iter().fold(inward[0], |a, b| if b.0 < a.0 { b } else { a });
    let frame = turned(nearest.1, [x, y, z]);
    let mut arm = Mesh::default();
    let path = [[-nearest.0, 0.0, 0.2], [-0.3, 0.0, 0.25], [-0.15, 0.0, 0.5], [0.0, 0.0, 0.55], [0.0, 0.0, 0.3]];
    tube(&mut arm, &frame, &path, 0.02, 6);
    put(model, format!("arm-{number}"), iron, smooth(arm));
    let mut cage = Mesh::default();
    surround(&mut cage, &frame, [-0.14, 0.14], [-0.2, 0.22], [-0.14, -0.125], 0.015);
    surround(&mut cage, &frame, [-0.14, 0.14], [-0.2, 0.22], [0.125, 0.14], 0.015);
    lathe(&mut cage, &frame, &[[0.24, 0.22], [0.05, 0.36], [0.0, 0.38]], 8);
    put(model, format!("lantern-{number}"), iron, cage);
    // The flame is above the light, so as not to shade it.
    let mut glow = Mesh::default();
    let middle = [0.0, 0.0, 0.1];
    cushion(&mut glow, [0.05, 0.05, 0.07], 1.0, [8, 4], |p| frame.apply(sum(middle, p)));
    put(model, format!("flame-{number}"), flame, smooth(glow));
}

fn tub(model: &mut Model, number: u32, foot: V) {
    let clay = model.add_material("clay", matt([0.48, 0.25, 0.14]));
    let green = model.add_material("box-tree", matt([0.09, 0.24, 0.06]));
    let mut pot = Mesh::default();
    lathe(&mut pot, &at(foot), &[[0.2, 0.06], [0.28, 0.45], [0.31, 0.45], [0.31, 0.52], [0.26, 0.52], [0.0, 0.46]], 10);
    put(model, format!("tub-{number}"), clay, smooth(pot));
    let mut ball = Mesh::default();
    let middle = sum(foot, [0.0, 0.0, 0.82]);
    let rough = |p: V| {
        let bump = 1.0 + 0.09 * noise::value(p[0] * 16.0 + f64::from(number), p[1] * 16.0 + 7.0 * p[2], 111);
        sum(middle, scale(p, bump))
    };
    cushion(&mut ball, [0.38; 3], 1.0, [12, 7], rough);
    put(model, format!("box-{number}"), green, smooth(ball));
}
