//! NFF, the Neutral File Format of Eric Haines' Standard Procedural Databases, version 3.1.
//!
//! It holds the camera, one background colour, point lights with colours, materials of one colour with grey highlight,
//! mirror and transmission, polygons, spheres and cones. A model that came from NFF goes back without loss, but that
//! polygons of more than three corners stay triangles.

use std::io::{self, Write};

use hybray_shading::{Highlight, Light, LightKind, Projection};

use super::{Notes, Spaced, extent, grey, material_label, mean};
use crate::model::{CameraSpec, Model};

pub(super) fn write(model: &Model, camera: &CameraSpec, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
    view(model, camera, to, notes)?;
    writeln!(to, "b {}", Spaced(model.background))?;
    lights(model, to, notes)?;
    if model.ambient != [0.0; 3] {
        notes.add("NFF has no ambient light", "the scene");
    }
    let mut fill = Fill { model, last: None };
    for mesh in &model.meshes {
        if mesh.triangles.is_empty() {
            continue;
        }
        fill.set(mesh.material, to, notes)?;
        for corners in mesh.triangles.iter().map(|t| t.map(|v| v as usize)) {
            writeln!(to, "{} 3", if mesh.normals.is_empty() { "p" } else { "pp" })?;
            for vertex in corners {
                let Some(&position) = mesh.positions.get(vertex) else {
                    continue;
                };
                match mesh.normals.get(vertex) {
                    Some(&normal) => writeln!(to, "{} {}", Spaced(position), Spaced(normal))?,
                    None => writeln!(to, "{}", Spaced(position))?,
                }
            }
        }
    }
    for s in &model.spheres {
        fill.set(s.material, to, notes)?;
        writeln!(to, "s {} {}", Spaced(s.centre), s.radius)?;
    }
    for c in &model.cones {
        fill.set(c.material, to, notes)?;
        writeln!(to, "c\n{} {}", Spaced(c.base), c.base_radius)?;
        writeln!(to, "{} {}", Spaced(c.apex), c.apex_radius)?;
    }
    Ok(())
}

fn view(model: &Model, camera: &CameraSpec, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
    if camera.projection != Projection::Perspective {
        notes.add("NFF has perspective cameras only, so another picture will be drawn", "the camera");
    } else if camera.aperture > 0.0 {
        notes.add("NFF has no lenses, so all is sharp", "the camera");
    }
    let [width, height] = model.settings.size.or(camera.size).unwrap_or([512, 512]);
    writeln!(to, "v")?;
    writeln!(to, "from {}", Spaced(camera.eye))?;
    writeln!(to, "at {}", Spaced(camera.target))?;
    writeln!(to, "up {}", Spaced(camera.up))?;
    writeln!(to, "angle {}", camera.fov_y_degrees)?;
    writeln!(to, "hither {}", camera.hither)?;
    writeln!(to, "resolution {width} {height}")
}

fn lights(model: &Model, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
    if model.lights.is_empty() {
        notes.add("the scene has no lights, so none are written", "the scene");
    }
    for (i, light) in model.lights.iter().enumerate() {
        let label = format!("light {}", i + 1);
        let position = match light.kind {
            kind if kind == LightKind::Point as u32 => light.position,
            kind if kind == LightKind::Directional as u32 => {
                notes.add("parallel light becomes a far point in NFF", label.as_str());
                far(model, light.axis)
            }
            kind if kind == LightKind::Spot as u32 => {
                notes.add("a spot becomes a point that shines all around in NFF", label.as_str());
                light.position
            }
            _ => {
                notes.add("a light with an area becomes a point in NFF", label.as_str());
                middle(light)
            }
        };
        if light.flags & Light::FALLOFF != 0 {
            notes.add("light does not fall with distance in NFF", label.as_str());
        }
        writeln!(to, "l {} {}", Spaced(position), Spaced(light.colour))?;
    }
    Ok(())
}

/// A point from which light that travels along `axis` seems to come: 1,000 scene diagonals away.
fn far(model: &Model, axis: [f32; 3]) -> [f32; 3] {
    let (centre, diagonal) = extent(model);
    std::array::from_fn(|i| (centre[i] - 1000.0 * diagonal * f64::from(axis[i])) as f32)
}

/// The middle of a light with an area.
fn middle(light: &Light) -> [f32; 3] {
    if light.kind == LightKind::Rectangle as u32 {
        std::array::from_fn(|i| light.position[i] + 0.5 * (light.u[i] + light.v[i]))
    } else {
        light.position
    }
}

/// Writes an `f` line where the material changes.
struct Fill<'a> {
    model: &'a Model,
    last: Option<u16>,
}

impl Fill<'_> {
    fn set(&mut self, index: u16, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
        if self.last == Some(index) {
            return Ok(());
        }
        self.last = Some(index);
        let Some(named) = self.model.materials.get(usize::from(index)) else {
            return Ok(());
        };
        let m = &named.material;
        let mut note = |what| notes.add(what, material_label(self.model, usize::from(index)));
        let shine = match m.highlight {
            h if h == Highlight::Phong as u32 => m.exponent,
            h if h == Highlight::Blinn as u32 => {
                // cos^n of half an angle is close to cos^(n/4) of the angle, for highlights that are not very wide.
                note("Blinn's highlight becomes Phong's with a quarter of the exponent in NFF");
                0.25 * m.exponent
            }
            _ => 0.0,
        };
        if shine > 0.0 && m.specular != m.mirror {
            note("highlight and mirror are one number in NFF; the mirror's is written");
        }
        if !grey(m.mirror) || !grey(m.transmission) {
            note("mirror and transmission have no colour in NFF");
        }
        if m.emission != [0.0; 3] {
            note("NFF surfaces send out no light of their own");
        }
        if m.flags & hybray_shading::Material::FRESNEL != 0 && m.transmits() {
            note("mirror and transmission do not change with the angle in NFF");
        }
        // The surface's whole reflectance goes into the colour, so that reading it back multiplies by 1.
        writeln!(to, "f {} 1 {} {} {} {}", Spaced(m.diffuse), mean(m.mirror), shine, mean(m.transmission), m.ior)
    }
}
