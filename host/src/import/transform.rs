//! Moving an included model: scaled, then turned, then shifted.

use super::polygon::unit;
use crate::model::Model;
use hybray_shading::{Light, LightKind};

/// `p -> turn (scale p) + shift`, in f64; each result is rounded to f32 once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Transform {
    /// More than 0.
    pub(crate) scale: f64,
    /// Rows of a rotation.
    pub(crate) turn: [[f64; 3]; 3],
    pub(crate) shift: [f64; 3],
}

impl Transform {
    pub(crate) const IDENTITY: Self =
        Self { scale: 1.0, turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], shift: [0.0; 3] };

    /// A turn by `degrees`, counterclockwise for who looks against the axis (Rodrigues). Quarter turns around the
    /// coordinate axes are exact.
    pub(crate) fn turned(axis: [f64; 3], degrees: f64) -> Option<[[f64; 3]; 3]> {
        let [x, y, z] = unit(axis)?;
        let (s, c) = sin_cos_degrees(degrees);
        let d = 1.0 - c;
        Some([
            [c + x * x * d, x * y * d - z * s, x * z * d + y * s],
            [y * x * d + z * s, c + y * y * d, y * z * d - x * s],
            [z * x * d - y * s, z * y * d + x * s, c + z * z * d],
        ])
    }

    fn direction(&self, v: [f32; 3]) -> [f64; 3] {
        let v = v.map(f64::from);
        self.turn.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
    }

    fn point(&self, p: [f32; 3]) -> [f32; 3] {
        let turned = self.direction(p);
        [0, 1, 2].map(|i| (turned[i] * self.scale + self.shift[i]) as f32)
    }

    fn edge(&self, v: [f32; 3]) -> [f32; 3] {
        self.direction(v).map(|c| (c * self.scale) as f32)
    }

    fn unit(&self, v: [f32; 3]) -> [f32; 3] {
        unit(self.direction(v)).map_or(v, |u| u.map(|c| c as f32))
    }

    fn length(&self, l: f32) -> f32 {
        (f64::from(l) * self.scale) as f32
    }

    /// Moves everything in the model that has a place.
    pub(crate) fn apply(&self, model: &mut Model) {
        if *self == Self::IDENTITY {
            return;
        }
        for mesh in &mut model.meshes {
            mesh.positions.iter_mut().for_each(|p| *p = self.point(*p));
            mesh.normals.iter_mut().for_each(|n| *n = self.unit(*n));
        }
        for s in &mut model.spheres {
            (s.centre, s.radius) = (self.point(s.centre), self.length(s.radius));
        }
        for c in &mut model.cones {
            (c.base, c.apex) = (self.point(c.base), self.point(c.apex));
            (c.base_radius, c.apex_radius) = (self.length(c.base_radius), self.length(c.apex_radius));
        }
        for camera in &mut model.cameras {
            (camera.eye, camera.target) = (self.point(camera.eye), self.point(camera.target));
            (camera.up, camera.hither) = (self.unit(camera.up), self.length(camera.hither));
            (camera.height, camera.focus) =
                (camera.height.map(|l| self.length(l)), camera.focus.map(|l| self.length(l)));
            camera.aperture = self.length(camera.aperture);
        }
        model.lights.iter_mut().for_each(|light| self.light(light));
        model.sky.axes = model.sky.axes.map(|axis| self.unit(axis));
    }

    fn light(&self, light: &mut Light) {
        light.position = self.point(light.position);
        (light.u, light.v) = (self.edge(light.u), self.edge(light.v));
        light.radius = self.length(light.radius);
        if light.kind == LightKind::Directional as u32 || light.kind == LightKind::Spot as u32 {
            light.axis = self.unit(light.axis);
        }
        // Its colour holds at distance 1, and what was at 1 is at `scale` now.
        if light.flags & Light::FALLOFF != 0 {
            light.colour = light.colour.map(|c| (f64::from(c) * self.scale * self.scale) as f32);
        }
    }
}

/// Sine and cosine, exact at quarter turns.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let within = degrees % 360.0;
    let quarter = match within {
        0.0 => Some((0.0, 1.0)),
        90.0 | -270.0 => Some((1.0, 0.0)),
        180.0 | -180.0 => Some((0.0, -1.0)),
        270.0 | -90.0 => Some((-1.0, 0.0)),
        _ => None,
    };
    let radians = within * (std::f64::consts::PI / 180.0);
    quarter.unwrap_or((libm::sin(radians), libm::cos(radians)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{CameraSpec, Cone, Mesh, Sphere};

    #[test]
    fn quarter_turns_are_exact() {
        let check = |axis, degrees, from, to| {
            let turn = Transform::turned(axis, degrees).expect("an axis");
            let t = Transform { turn, ..Transform::IDENTITY };
            assert_eq!(t.point(from), to, "{axis:?} {degrees}");
        };
        check([0.0, 0.0, 1.0], 90.0, [1.0, 2.0, 3.0], [-2.0, 1.0, 3.0]);
        check([0.0, 0.0, 7.0], -90.0, [1.0, 2.0, 3.0], [2.0, -1.0, 3.0]);
        check([1.0, 0.0, 0.0], 450.0, [1.0, 2.0, 3.0], [1.0, -3.0, 2.0]);
        check([0.0, -1.0, 0.0], 180.0, [1.0, 2.0, 3.0], [-1.0, 2.0, -3.0]);
        assert_eq!(Transform::turned([0.0; 3], 90.0), None);
    }

    #[test]
    fn a_turn_keeps_lengths_and_its_axis() {
        let turn = Transform::turned([1.0, 2.0, -3.0], 33.0).expect("an axis");
        for (i, row) in turn.iter().enumerate() {
            for (j, other) in turn.iter().enumerate() {
                let dot: f64 = (0..3).map(|k| row[k] * other[k]).sum();
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-15);
            }
            let axis = [1.0, 2.0, -3.0];
            let along: f64 = (0..3).map(|k| row[k] * axis[k]).sum();
            assert!((along - axis[i]).abs() < 1e-14);
        }
    }

    #[test]
    fn every_part_moves() {
        let mut m = Model::default();
        let positions = vec![[1.0, 0.0, 0.0]];
        m.meshes.push(Mesh { positions, normals: vec![[1.0, 0.0, 0.0]], ..Mesh::default() });
        m.spheres.push(Sphere { centre: [1.0, 0.0, 0.0], radius: 3.0, material: 0 });
        let (base, apex) = ([1.0, 0.0, 0.0], [0.0; 3]);
        m.cones.push(Cone { base, base_radius: 1.0, apex, apex_radius: 0.5, material: 0 });
        let (eye, target, up) = ([1.0, 0.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0]);
        let (fov_y_degrees, hither, size) = (40.0, 1.0, None);
        let (height, aperture, focus) = (Some(3.0), 0.5, Some(4.0));
        let name = String::new();
        let camera = CameraSpec { name, eye, target, up, fov_y_degrees, hither, size, ..CameraSpec::default() };
        m.cameras.push(CameraSpec { height, aperture, focus, ..camera });
        let axis = [1.0, 0.0, 0.0];
        let kind = LightKind::Spot as u32;
        m.lights.push(Light {
            position: axis,
            axis,
            colour: [1.0; 3],
            flags: Light::FALLOFF,
            kind,
            ..Light::default()
        });
        let turn = Transform::turned([0.0, 0.0, 1.0], 90.0).expect("an axis");
        Transform { scale: 2.0, turn, shift: [10.0, 0.0, 0.0] }.apply(&mut m);

        let moved = [10.0, 2.0, 0.0];
        assert_eq!((m.meshes[0].positions[0], m.meshes[0].normals[0]), (moved, [0.0, 1.0, 0.0]));
        assert_eq!((m.spheres[0].centre, m.spheres[0].radius), (moved, 6.0));
        assert_eq!((m.cones[0].base, m.cones[0].base_radius), (moved, 2.0));
        assert_eq!((m.cones[0].apex, m.cones[0].apex_radius), ([10.0, 0.0, 0.0], 1.0));
        assert_eq!((m.cameras[0].eye, m.cameras[0].target), (moved, [10.0, 0.0, 0.0]));
        assert_eq!((m.cameras[0].up, m.cameras[0].hither), ([-1.0, 0.0, 0.0], 2.0));
        assert_eq!((m.lights[0].position, m.lights[0].axis, m.lights[0].colour), (moved, [0.0, 1.0, 0.0], [4.0; 3]));
    }
}
