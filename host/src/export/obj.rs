//! Wavefront OBJ with a material library (MTL).
//!
//! Triangles keep their order and their vertices; spheres and cones become triangles. OBJ has no camera, lights or
//! background. Source: the OBJ and MTL appendices of the Advanced Visualizer manual.

use std::collections::BTreeSet;
use std::io::{self, Write};

use hybray_shading::{Highlight, Material};

use super::facets::{self, Facets};
use super::{Notes, Spaced, material_label, mean};
use crate::model::Model;

/// A name for each material that OBJ can say: no blanks or control characters, none empty, no two equal.
pub(super) fn material_names(model: &Model) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let mut names = Vec::with_capacity(model.materials.len());
    for (i, named) in model.materials.iter().enumerate() {
        let mut name = word(&named.name);
        if name.is_empty() {
            name = format!("material_{i}");
        }
        while !taken.insert(name.clone()) {
            name = format!("{name}_{i}");
        }
        names.push(name);
    }
    names
}

/// `name` as one word: what separates words, starts a comment or continues a line becomes an underscore.
fn word(name: &str) -> String {
    let plain = |c: char| if c.is_whitespace() || c.is_control() || c == '#' || c == '\\' { '_' } else { c };
    name.chars().map(plain).collect()
}

/// The material library.
pub(super) fn write_materials(
    model: &Model,
    names: &[String],
    to: &mut dyn Write,
    notes: &mut Notes,
) -> io::Result<()> {
    for (i, (named, name)) in model.materials.iter().zip(names).enumerate() {
        let m = &named.material;
        let mut note = |what| notes.add(what, material_label(model, i));
        let mirrors = m.mirror != [0.0; 3];
        let highlight = m.highlight != Highlight::None as u32 && m.specular != [0.0; 3];
        let fresnel = m.flags & Material::FRESNEL != 0 && m.transmits();
        // `Ks` is the highlight, and from 3 on the mirror too, but for 7, whose mirror is Fresnel's alone.
        let illumination = match (m.transmits(), fresnel) {
            (true, true) => 7,
            (true, false) => 6,
            _ if mirrors => 3,
            _ if highlight => 2,
            _ => 1,
        };
        let specular = match illumination {
            3 | 6 => m.mirror,
            2 | 7 if highlight => m.specular,
            _ => [0.0; 3],
        };
        if highlight && specular != m.specular {
            note("highlight and mirror are one colour in MTL; the mirror's is written");
        }
        if fresnel && mirrors {
            note("MTL's glass with Fresnel has no other mirror");
        }
        let exponent = match m.highlight {
            kind if kind == Highlight::Phong as u32 && highlight => {
                // cos^n of an angle is close to cos^(4n) of its half, for highlights that are not very wide.
                note("Phong's highlight becomes Blinn's with four times the exponent in MTL");
                4.0 * m.exponent
            }
            _ if highlight => m.exponent,
            _ => 0.0,
        };
        writeln!(to, "newmtl {name}")?;
        writeln!(to, "Ka {}", Spaced(m.ambient))?;
        writeln!(to, "Kd {}", Spaced(m.diffuse))?;
        writeln!(to, "Ks {}", Spaced(specular))?;
        if m.emission != [0.0; 3] {
            writeln!(to, "Ke {}", Spaced(m.emission))?;
        }
        writeln!(to, "Ns {exponent}")?;
        if m.transmits() {
            writeln!(to, "Ni {}", m.ior)?;
            writeln!(to, "Tf {}", Spaced(m.transmission))?;
            // For readers that know transparency only as this number.
            writeln!(to, "d {}", (1.0 - mean(m.transmission)).clamp(0.0, 1.0))?;
        }
        writeln!(to, "illum {illumination}\n")?;
    }
    Ok(())
}

/// The geometry, which refers to the library by its file name.
pub(super) fn write(
    model: &Model,
    names: &[String],
    library: &str,
    to: &mut dyn Write,
    notes: &mut Notes,
) -> io::Result<()> {
    notes.add("OBJ has no camera, lights, background and ambient light", "the scene");
    if library.contains(char::is_whitespace) {
        notes.add("many readers of OBJ do not find a library with blanks in its name", library);
    }
    writeln!(to, "mtllib {library}")?;
    let mut writer = Objects { to, names, material: None, vertices: 0, normals: 0 };
    for (i, mesh) in model.meshes.iter().enumerate() {
        writer.begin(&word(&mesh.name), &format!("mesh_{i}"), mesh.material)?;
        let first_normal = (!mesh.normals.is_empty()).then_some(writer.normals);
        let first_vertex = writer.vertices;
        writer.vertices(mesh.positions.iter().copied())?;
        writer.normals(mesh.normals.iter().copied())?;
        writer.faces(&mesh.triangles, first_vertex, first_normal)?;
    }
    curved(model, &mut writer, notes)
}

/// Spheres and cones.
fn curved(model: &Model, writer: &mut Objects<'_>, notes: &mut Notes) -> io::Result<()> {
    let (spheres, cones) = (model.spheres.len(), model.cones.len());
    if spheres + cones == 0 {
        return Ok(());
    }
    let segments = facets::segments(spheres, cones);
    let inside = 100.0 * (1.0 - libm::cos(std::f64::consts::PI / segments as f64));
    notes.add(
        "spheres and cones become triangles in OBJ",
        format!(
            "{spheres} spheres and {cones} cones ({segments} segments around, up to {inside:.2} % of the radius inside)"
        ),
    );
    if spheres > 0 {
        // The normals of all spheres are the same: they are written once.
        let unit = facets::sphere(segments);
        let first_normal = writer.normals;
        writer.normals(unit.normals.iter().map(narrow))?;
        for (i, s) in model.spheres.iter().enumerate() {
            writer.begin("", &format!("sphere_{i}"), s.material)?;
            let first_vertex = writer.vertices;
            let place =
                |p: &[f64; 3]| std::array::from_fn(|k| (f64::from(s.centre[k]) + f64::from(s.radius) * p[k]) as f32);
            writer.vertices(unit.positions.iter().map(place))?;
            writer.faces(&unit.triangles, first_vertex, Some(first_normal))?;
        }
    }
    for (i, c) in model.cones.iter().enumerate() {
        let Facets { positions, normals, triangles } =
            facets::cone(c.base, c.base_radius, c.apex, c.apex_radius, segments);
        writer.begin("", &format!("cone_{i}"), c.material)?;
        let (first_vertex, first_normal) = (writer.vertices, writer.normals);
        writer.vertices(positions.iter().map(narrow))?;
        writer.normals(normals.iter().map(narrow))?;
        writer.faces(&triangles, first_vertex, Some(first_normal))?;
    }
    Ok(())
}

fn narrow(v: &[f64; 3]) -> [f32; 3] {
    v.map(|c| c as f32)
}

/// Counts what is written, because faces refer to vertices and normals by their number in the file.
struct Objects<'a> {
    to: &'a mut dyn Write,
    names: &'a [String],
    material: Option<u16>,
    vertices: u64,
    normals: u64,
}

impl Objects<'_> {
    fn begin(&mut self, name: &str, otherwise: &str, material: u16) -> io::Result<()> {
        writeln!(self.to, "o {}", if name.is_empty() { otherwise } else { name })?;
        if self.material != Some(material) {
            self.material = Some(material);
            if let Some(name) = self.names.get(usize::from(material)) {
                writeln!(self.to, "usemtl {name}")?;
            }
        }
        Ok(())
    }

    fn vertices(&mut self, positions: impl Iterator<Item = [f32; 3]>) -> io::Result<()> {
        for position in positions {
            writeln!(self.to, "v {}", Spaced(position))?;
            self.vertices += 1;
        }
        Ok(())
    }

    fn normals(&mut self, normals: impl Iterator<Item = [f32; 3]>) -> io::Result<()> {
        for normal in normals {
            writeln!(self.to, "vn {}", Spaced(normal))?;
            self.normals += 1;
        }
        Ok(())
    }

    /// Triangles whose corners count from the given vertex and normal on (from 0; the file counts from 1).
    fn faces(&mut self, triangles: &[[u32; 3]], vertex: u64, normal: Option<u64>) -> io::Result<()> {
        for triangle in triangles {
            let [a, b, c] = triangle.map(|i| vertex + 1 + u64::from(i));
            match normal {
                Some(normal) => {
                    let [x, y, z] = triangle.map(|i| normal + 1 + u64::from(i));
                    writeln!(self.to, "f {a}//{x} {b}//{y} {c}//{z}")?;
                }
                None => writeln!(self.to, "f {a} {b} {c}")?,
            }
        }
        Ok(())
    }
}
