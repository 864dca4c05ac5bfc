//! POV-Ray 3.7: a scene file that gives the picture that Hybray gives, as nearly as POV-Ray can.
//!
//! The picture's size is POV-Ray's to choose (`+W800 +H600`); the angle from top to bottom stays. The camera is
//! right-handed, colours are linear, and POV-Ray's own output has the same sRGB curve as ours.
//!
//! What POV-Ray cannot say exactly; each comes back as a warning where the scene has it:
//!
//! - the hither distance: POV-Ray's rays start at the eye;
//! - sphere lights: their shadows are those of a disc that faces the point;
//! - rectangle lights: a point in the penumbra gets the mean light of the whole lamp times the share of it that it
//!   sees;
//! - spots wider than 90 degrees from the axis: POV-Ray's are dark beyond;
//! - refraction at total reflection: POV-Ray traces the reflected ray with weight 1 where we give it mirror and
//!   transmission together;
//! - Fresnel's equations where the transmission is not 1 or there is a mirror besides: POV-Ray then takes more from
//!   the refracted ray than the mirrored one gains;
//! - glass inside glass: a ray that leaves it is in the air for us, and in the outer glass for POV-Ray;
//! - a transmitted ray that is not bent: we count it towards the ray depth, POV-Ray does not.
//!
//! Not warned of, because they are everywhere and small: POV-Ray leaves out hits nearer than 0.0001 and shadows from
//! things nearer than 0.001 (scenes are scaled by a power of two where that would show), and it has no remedy for
//! jagged shadows on smooth meshes. What the file says of samples per pixel is a setting of POV-Ray's command line.

mod texture;

use std::fmt;
use std::io::{self, Write};

use hybray_shading::{Light, LightKind, Material, Projection};

use self::texture::texture;
use super::{DEFAULT_DEPTH, Notes, extent, material_label};
use crate::framing::basis;
use crate::model::{CameraSpec, Mesh, Model};

/// A number in the fewest digits: those of `f32` where it is one, and else those of `f64`.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let narrow = self.0 as f32;
        if f64::from(narrow) == self.0 { write!(f, "{narrow}") } else { write!(f, "{}", self.0) }
    }
}

/// Three numbers as POV-Ray writes vectors.
struct Angled([f64; 3]);

impl Angled {
    /// Exact: the product of two `f32` fits in `f64`, and so does a power of two times one.
    fn times(v: [f32; 3], factor: f64) -> Self {
        Self(v.map(|c| f64::from(c) * factor))
    }
}

impl fmt::Display for Angled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.map(Short);
        write!(f, "<{x},{y},{z}>")
    }
}

pub(super) fn write(model: &Model, camera: &CameraSpec, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
    let scale = scale(model, camera);
    let exposure = f64::from(model.settings.exposure.unwrap_or(1.0));
    header(model, camera, scale, exposure, to)?;
    view(camera, scale, to, notes)?;
    if model.lights.is_empty() {
        notes.add("the scene has no lights, so none are written", "the scene");
    }
    for (i, light) in model.lights.iter().enumerate() {
        let whom = format!("light {}", i + 1);
        Lamp::new(model, light, scale, exposure).write(&whom, to, notes)?;
    }
    for (i, named) in model.materials.iter().enumerate() {
        writeln!(to, "#declare M{i} =\n{}", texture(&named.material, exposure))?;
        doubts(model, i, &named.material, notes);
    }
    meshes(model, scale, to)?;
    let length = |value: f32| Short(f64::from(value) * scale);
    let surface = |index: u16| Surface { model, index: usize::from(index) };
    for s in &model.spheres {
        let (centre, radius) = (Angled::times(s.centre, scale), length(s.radius));
        writeln!(to, "sphere {{ {centre}, {radius} {} }}", surface(s.material))?;
    }
    for c in &model.cones {
        let (base, apex) = (Angled::times(c.base, scale), Angled::times(c.apex, scale));
        let (r, s) = (length(c.base_radius), length(c.apex_radius));
        let surface = surface(c.material);
        if c.base_radius == c.apex_radius {
            writeln!(to, "cylinder {{ {base}, {apex}, {r} open {surface} }}")?;
        } else {
            writeln!(to, "cone {{ {base}, {r}, {apex}, {s} open {surface} }}")?;
        }
    }
    Ok(())
}

/// What lengths are multiplied by: 1 for a scene of 10 to 100,000 units across, and else the power of two that makes it
/// about a thousand. POV-Ray's tolerances are lengths, not ratios; a power of two changes no digit of a coordinate.
fn scale(model: &Model, camera: &CameraSpec) -> f64 {
    let (centre, diagonal) = extent(model);
    let off = |i: usize| f64::from(camera.eye[i]) - centre[i];
    let reach = diagonal + (0..3).map(|i| off(i) * off(i)).sum::<f64>().sqrt();
    if (10.0..=1e5).contains(&reach) {
        return 1.0;
    }
    libm::exp2(libm::rint(libm::log2(1000.0 / reach)))
}

fn header(model: &Model, camera: &CameraSpec, scale: f64, exposure: f64, to: &mut dyn Write) -> io::Result<()> {
    let [width, height] = model.settings.size.or(camera.size).unwrap_or([512, 512]);
    writeln!(to, "#version 3.7;")?;
    writeln!(to, "// povray +W{width} +H{height} and the name of this file")?;
    if scale != 1.0 {
        writeln!(to, "// Lengths are {scale} times those of the scene.")?;
    }
    writeln!(to, "global_settings {{")?;
    writeln!(to, "  assumed_gamma 1.0")?;
    let depth = model.settings.depth.unwrap_or(DEFAULT_DEPTH);
    writeln!(to, "  max_trace_level {depth}")?;
    writeln!(to, "  adc_bailout {}", model.settings.cutoff.unwrap_or(0.0))?;
    writeln!(to, "  ambient_light rgb {}", Angled::times(model.ambient, exposure))?;
    writeln!(to, "}}")?;
    writeln!(to, "background {{ color rgb {} }}", Angled::times(model.background, exposure))
}

/// Rays through the lens for each pixel.
const BLUR_SAMPLES: u32 = 200;

fn view(camera: &CameraSpec, scale: f64, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
    if camera.hither > 0.0 {
        notes.add("POV-Ray shows what is nearer than the hither distance", "the camera");
    }
    // The minus at `right` makes the view right-handed: POV-Ray's x is left unless told.
    let place = |to: &mut dyn Write| {
        writeln!(to, "  sky {}", Angled::times(camera.up, 1.0))?;
        writeln!(to, "  look_at {}", Angled::times(camera.target, scale))
    };
    writeln!(to, "camera {{")?;
    match camera.projection {
        Projection::Perspective => {}
        Projection::Orthographic => {
            let height = f64::from(camera.picture_height()) * scale;
            writeln!(to, "  orthographic")?;
            writeln!(to, "  location {}", Angled::times(camera.eye, scale))?;
            writeln!(to, "  up y*{height}")?;
            writeln!(to, "  right -x*{height}*image_width/image_height")?;
            place(to)?;
            return writeln!(to, "}}");
        }
        Projection::Spherical => {
            // Turned around `right` and then `up` from `direction`: both are the other way round for rows to go down and
            // columns to the right, and a `look_at` would put one of them back.
            let [right, above, back] = basis(camera).unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            writeln!(to, "  spherical")?;
            writeln!(to, "  location {}", Angled::times(camera.eye, scale))?;
            writeln!(to, "  direction {}", Angled(back.map(|c| -c)))?;
            writeln!(to, "  up {}", Angled(above.map(|c| -c)))?;
            writeln!(to, "  right {}", Angled(right.map(|c| -c)))?;
            writeln!(to, "  angle 360 180")?;
            return writeln!(to, "}}");
        }
    }
    // The picture is 1 high at this distance. An `angle` would be that from left to right, and so would change with the
    // picture's shape.
    let half = f64::from(camera.fov_y_degrees) * (std::f64::consts::PI / 360.0);
    let distance = 0.5 / libm::tan(half);
    writeln!(to, "  location {}", Angled::times(camera.eye, scale))?;
    writeln!(to, "  direction z*{distance}")?;
    writeln!(to, "  up y")?;
    writeln!(to, "  right -x*image_width/image_height")?;
    place(to)?;
    if camera.aperture > 0.0 {
        if camera.blades > 0 {
            notes.add("POV-Ray's lens is round", "the camera");
        }
        // A point on the plane that is sharp.
        let view = [0, 1, 2].map(|i| f64::from(camera.target[i]) - f64::from(camera.eye[i]));
        let length = view.iter().map(|c| c * c).sum::<f64>().sqrt();
        let focus = along(camera.eye.map(f64::from), view, f64::from(camera.focus_distance()) / length);
        // Twice the diameter: POV-Ray's samples fill a circle of half of what it is told.
        writeln!(to, "  aperture {}", 4.0 * f64::from(camera.aperture) * scale)?;
        writeln!(to, "  focal_point {}", Angled(focus.map(|c| c * scale)))?;
        writeln!(to, "  blur_samples {BLUR_SAMPLES}")?;
        writeln!(to, "  variance 0")?;
    }
    writeln!(to, "}}")
}

/// A light in POV-Ray's terms: lengths scaled, colour exposed.
struct Lamp<'a> {
    light: &'a Light,
    scale: f64,
    position: [f64; 3],
    colour: [f64; 3],
    /// Middle and diagonal of the scene.
    centre: [f64; 3],
    diagonal: f64,
}

impl<'a> Lamp<'a> {
    fn new(model: &Model, light: &'a Light, scale: f64, exposure: f64) -> Self {
        let (centre, diagonal) = extent(model);
        Self {
            light,
            scale,
            position: Angled::times(light.position, scale).0,
            colour: Angled::times(light.colour, exposure).0,
            centre: centre.map(|c| c * scale),
            diagonal: diagonal * scale,
        }
    }

    fn write(&self, whom: &str, to: &mut dyn Write, notes: &mut Notes) -> io::Result<()> {
        let light = self.light;
        match light.kind {
            kind if kind == LightKind::Directional as u32 => {
                // Parallel light shines from a plane, which has to lie outside of the scene.
                let axis = light.axis.map(f64::from);
                let from = along(self.centre, axis, -2.0 * self.diagonal);
                writeln!(to, "light_source {{ {} color rgb {}", Angled(from), Angled(self.colour))?;
                writeln!(to, "  parallel point_at {} }}", Angled(along(from, axis, self.diagonal)))
            }
            kind if kind == LightKind::Spot as u32 => {
                self.begin(self.position, to)?;
                let degrees = |cosine: f32| libm::acos(f64::from(cosine.clamp(-1.0, 1.0))).to_degrees();
                if light.cos_outer < 0.0 {
                    notes.add("a POV-Ray spot is dark beyond 90 degrees from its axis", whom);
                }
                // Both blend by the same cubic of the cosine between the two angles.
                let (radius, falloff) = (degrees(light.cos_inner), degrees(light.cos_outer));
                writeln!(to, "  spotlight radius {radius} falloff {falloff} tightness 0")?;
                let at = along(self.position, light.axis.map(f64::from), self.diagonal);
                writeln!(to, "  point_at {} }}", Angled(at))
            }
            kind if kind == LightKind::Sphere as u32 => {
                notes.add("POV-Ray has a disc that faces the point in place of a sphere light", whom);
                self.begin(self.position, to)?;
                let across = 2.0 * f64::from(light.radius) * self.scale;
                self.area([across, 0.0, 0.0], [0.0, across, 0.0], to)?;
                writeln!(to, "  circular orient }}")
            }
            kind if kind == LightKind::Rectangle as u32 => {
                notes.add("POV-Ray's penumbra of a rectangle does not ask which part of it is hidden", whom);
                let edge = |v: [f32; 3]| v.map(|c| f64::from(c) * self.scale);
                let (u, v) = (edge(light.u), edge(light.v));
                self.begin(along(along(self.position, u, 0.5), v, 0.5), to)?;
                let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
                let norm = normal.iter().map(|c| c * c).sum::<f64>().sqrt();
                let unit = normal.map(|c| if norm > 0.0 { c / norm } else { c });
                // A spot of 90 degrees whose light falls with the cosine, which is what a flat lamp is.
                let at = along(along(along(self.position, u, 0.5), v, 0.5), unit, self.diagonal);
                writeln!(to, "  spotlight radius 90 falloff 90 tightness 1 point_at {}", Angled(at))?;
                self.area(u, v, to)?;
                writeln!(to, "  area_illumination on }}")
            }
            _ => {
                self.begin(self.position, to)?;
                writeln!(to, "}}")
            }
        }
    }

    /// Position, colour and falloff.
    ///
    /// POV-Ray's light falls with 2 / (1 + (d/f)^2), f being `fade_distance`. That is 2 f^2 / (f^2 + d^2), so with the
    /// colour divided by 2 f^2 it is colour / d^2 but for one part in (d/f)^2, and f can be as small as we like:
    /// 1/65536 of the scene. (0 would be exact, but only newer versions of POV-Ray know it.)
    fn begin(&self, position: [f64; 3], to: &mut dyn Write) -> io::Result<()> {
        let falls = self.light.flags & Light::FALLOFF != 0;
        let fade = self.diagonal / 65536.0;
        // The colour is that at distance 1 in the scene's units.
        let factor = self.scale * self.scale / (2.0 * fade * fade);
        let colour = self.colour.map(|c| if falls { c * factor } else { c });
        writeln!(to, "light_source {{ {} color rgb {}", Angled(position), Angled(colour))?;
        if falls {
            writeln!(to, "  fade_distance {fade} fade_power 2")?;
        }
        Ok(())
    }

    /// A grid of `n * n` points, each anywhere in its own cell. POV-Ray puts the outermost points on the edges: the
    /// axes are shortened by (n - 1) / n, so that the cells tile the light. It halves the grid over and over, and
    /// weighs the points alike only if `n` is a power of two.
    fn area(&self, u: [f64; 3], v: [f64; 3], to: &mut dyn Write) -> io::Result<()> {
        let mut n = 2u32;
        while n * n < u32::from(self.light.samples) {
            n *= 2;
        }
        let share = f64::from(n - 1) / f64::from(n);
        let cells = |axis: [f64; 3]| Angled(axis.map(|c| c * share));
        writeln!(to, "  area_light {}, {}, {n}, {n} jitter", cells(u), cells(v))
    }
}

/// `from` moved by `distance` times `direction`.
fn along(from: [f64; 3], direction: [f64; 3], distance: f64) -> [f64; 3] {
    std::array::from_fn(|i| from[i] + distance * direction[i])
}

/// What POV-Ray does otherwise with this material.
fn doubts(model: &Model, index: usize, m: &Material, notes: &mut Notes) {
    if !m.transmits() {
        return;
    }
    let mut note = |what| notes.add(what, material_label(model, index));
    if m.ior == 1.0 {
        note("POV-Ray does not count unbent transmitted rays towards the ray depth");
        return;
    }
    note("a ray that leaves glass inside other glass is in that glass for POV-Ray, in the air for us");
    if (0..3).any(|c| m.mirror[c] + m.transmission[c] != 1.0) {
        note("POV-Ray gives total reflection weight 1");
    }
    if m.flags & Material::FRESNEL != 0 && (m.transmission != [1.0; 3] || m.mirror != [0.0; 3]) {
        note("POV-Ray's Fresnel takes another share from the refracted ray than from white glass");
    }
}

/// A material as an object refers to it.
struct Surface<'a> {
    model: &'a Model,
    index: usize,
}

impl Surface<'_> {
    fn material(&self) -> Option<&Material> {
        self.model.materials.get(self.index).map(|named| &named.material)
    }
}

impl fmt::Display for Surface<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "texture {{ M{} }}", self.index)?;
        match self.material() {
            Some(m) if m.transmits() => write!(f, " interior {{ ior {} }}", m.ior),
            _ => Ok(()),
        }
    }
}

/// All meshes. POV-Ray knows by its interior which object a ray leaves; two meshes that make up one piece of glass have
/// to share it, which the children of a union do.
fn meshes(model: &Model, scale: f64, to: &mut dyn Write) -> io::Result<()> {
    let mut order: Vec<usize> =
        (0..model.meshes.len()).filter(|&i| model.meshes.get(i).is_some_and(|m| !m.triangles.is_empty())).collect();
    let material = |i: usize| model.meshes.get(i).map_or(0, |m| m.material);
    order.sort_by_key(|&i| (material(i), i));
    for group in order.chunk_by(|&a, &b| material(a) == material(b)) {
        let surface = Surface { model, index: usize::from(group.first().map_or(0, |&i| material(i))) };
        let meshes = group.iter().filter_map(|&i| model.meshes.get(i));
        if group.len() > 1 && surface.material().is_some_and(Material::transmits) {
            writeln!(to, "union {{")?;
            for one in meshes {
                mesh(one, scale, to)?;
                writeln!(to, "}}")?;
            }
            writeln!(to, "{surface} }}")?;
        } else {
            for one in meshes {
                mesh(one, scale, to)?;
                writeln!(to, "{surface} }}")?;
            }
        }
    }
    Ok(())
}

/// A mesh without its end.
fn mesh(mesh: &Mesh, scale: f64, to: &mut dyn Write) -> io::Result<()> {
    writeln!(to, "mesh2 {{ vertex_vectors {{ {}", mesh.positions.len())?;
    for &position in &mesh.positions {
        writeln!(to, ",{}", Angled::times(position, scale))?;
    }
    if !mesh.normals.is_empty() {
        writeln!(to, "}} normal_vectors {{ {}", mesh.normals.len())?;
        for &normal in &mesh.normals {
            writeln!(to, ",{}", Angled::times(normal, 1.0))?;
        }
    }
    writeln!(to, "}} face_indices {{ {}", mesh.triangles.len())?;
    for [a, b, c] in &mesh.triangles {
        writeln!(to, ",<{a},{b},{c}>")?;
    }
    writeln!(to, "}}")
}

#[cfg(test)]
mod tests;
