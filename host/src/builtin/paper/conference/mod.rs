//! A conference room of our own design, in the place of Grynberg and Ward's (23,966 polygons, 8 and 30 point lights):
//! a long table with eighteen chairs, a whiteboard, windows with blinds, and a ceiling of tiles with eight troughs and
//! twenty-two round lamps. Most of the triangles are in the chairs and on the table, few in the room around them.
//!
//! The lamps are the same in number whatever shines: a scene of n lights has the first n of them lit.

mod furniture;
mod lamps;
mod room;
mod tableware;

use super::{SIZE_1995, empty, glowing, matt, point_light, shiny};
use crate::model::Model;
use lamps::{lamps, shine};

/// Inner size of the room.
const ROOM: [f64; 3] = [12.0, 7.2, 3.0];
/// The middle of the table.
const MIDDLE: [f64; 2] = [6.4, 3.6];
/// Height of the table's top.
const TABLE: f64 = 0.74;

/// 1 to 30 point lights of equal strength, the same in sum.
pub fn conference(lights: u32) -> Model {
    let mut model = empty("conference", [0.35, 0.95, 1.85], [6.1, 3.75, 0.88], 60.0, SIZE_1995);
    model.background = [0.62, 0.78, 1.0];
    model.ambient = [0.2; 3];
    room::add(&mut model);
    lamps::add(&mut model, lights);
    furniture::add(&mut model);
    tableware::add(&mut model);
    // Every light falls on the table more or less from above: so much in sum, however many there are.
    let strength = 1.1 / lights as f32;
    let colour = [1.0, 0.95, 0.87].map(|c| c * strength);
    model.lights = lamps().take(lights as usize).map(|lamp| point_light(shine(lamp), colour)).collect();
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;
    use crate::builtin::vector::{V, add, cross, dot, scale, sub};

    /// As many as the original has polygons.
    const TRIANGLES: usize = 23_966;

    fn triangles(model: &Model) -> Vec<[V; 3]> {
        let of = |m: &crate::model::Mesh| {
            let corner = |v: u32| m.positions[v as usize].map(f64::from);
            m.triangles.iter().map(|t| t.map(corner)).collect::<Vec<_>>()
        };
        model.meshes.iter().flat_map(of).collect()
    }

    /// Whether a triangle comes between two points (Moeller and Trumbore's test).
    fn between(a: V, b: V, [p, q, r]: &[V; 3]) -> bool {
        let (way, e1, e2) = (sub(b, a), sub(*q, *p), sub(*r, *p));
        let h = cross(way, e2);
        let det = dot(e1, h);
        if det.abs() < 1e-14 {
            return false;
        }
        let s = sub(a, *p);
        let u = dot(s, h) / det;
        let n = cross(s, e1);
        let v = dot(way, n) / det;
        u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (1e-6..1.0 - 1e-6).contains(&(dot(e2, n) / det))
    }

    #[test]
    fn as_large_as_the_original() {
        for lights in [1, 8, 30] {
            let model = conference(lights);
            checks::sound(&model);
            assert_eq!((model.primitives(), model.lights.len()), (TRIANGLES, lights as usize));
            assert_eq!(model.objects.polygons as usize, TRIANGLES);
            assert_eq!(model.cameras[0].size, Some([256, 256]));
            let shares = |m: &crate::model::NamedMaterial| m.material.mirrors();
            assert!(model.materials.iter().filter(|m| shares(m)).count() >= 4);
            assert_eq!(model.materials.len(), conference(8).materials.len() - usize::from(lights == 30));
        }
    }

    /// Nothing is outside but for walls, sills and what the door needs.
    #[test]
    fn all_is_in_the_room() {
        for p in conference(8).meshes.iter().flat_map(|m| &m.positions) {
            for (x, size) in p.iter().zip(ROOM) {
                assert!(f64::from(*x) > -0.31 && f64::from(*x) < size + 0.31, "{p:?}");
            }
        }
    }

    /// Each light is between floor and ceiling and the four walls, and most of the table's top sees it: asked of every
    /// triangle.
    #[test]
    fn every_light_sees_the_table() {
        let model = conference(30);
        let all = triangles(&model);
        for light in &model.lights {
            let light = light.position.map(f64::from);
            assert!(light.iter().zip(ROOM).all(|(x, size)| *x > 0.05 && *x < size - 0.05), "{light:?}");
            let spot = |i: u32| [f64::from(i % 5) - 2.0, f64::from(i / 5) - 1.0];
            let spots = (0..15).map(|i| add([MIDDLE[0], MIDDLE[1], TABLE], [1.3 * spot(i)[0], 0.4 * spot(i)[1], 1e-3]));
            let seen = spots.filter(|&s| !all.iter().any(|t| between(s, light, t))).count();
            assert!(seen >= 9, "{light:?}: {seen} of 15");
        }
    }

    /// Light that falls on the middle of the table, by the cosine law alone, is about the same by 8 lamps and by 30.
    #[test]
    fn equally_exposed() {
        let falls = |lights: u32| -> f64 {
            let middle = [MIDDLE[0], MIDDLE[1], TABLE];
            let light = |l: &hybray_shading::Light| {
                let way = sub(l.position.map(f64::from), middle);
                f64::from(l.colour[0]) * way[2] / dot(way, way).sqrt()
            };
            conference(lights).lights.iter().map(light).sum()
        };
        let (few, many) = (falls(8), falls(30));
        assert!((0.5..1.0).contains(&few) && (many / few - 1.0).abs() < 0.3, "{few} {many}");
    }

    /// A sixth of the room's volume, around table and chairs, has two thirds of the triangles.
    #[test]
    fn unequally_distributed() {
        let all = triangles(&conference(8));
        let near = |t: &&[V; 3]| {
            let c = scale(add(add(t[0], t[1]), t[2]), 1.0 / 3.0);
            (c[0] - MIDDLE[0]).abs() < 4.3 && (c[1] - MIDDLE[1]).abs() < 2.0 && c[2] < 1.2
        };
        let share = all.iter().filter(near).count() as f64 / all.len() as f64;
        assert!(8.6 * 4.0 * 1.2 < ROOM.iter().product::<f64>() / 6.0 && share > 2.0 / 3.0, "{share}");
    }
}
