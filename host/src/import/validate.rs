//! Checks that a model must pass whatever it came from: after this, nothing downstream meets a number it cannot use.
//!
//! Numbers must be finite and of magnitude at most [`COORDINATE_MAX`] = 2^100: squares of differences still fit in an
//! f64, and coordinates scaled by a power of two at load lose nothing. A sphere or cone must have an extent that f32
//! can tell from a point: where `centre + radius` is `centre`, its box is empty inside.

use super::COORDINATE_MAX;
use super::error::{ImportError, quote};
use super::polygon::unit;
use crate::model::{CameraSpec, Cone, Model, Sphere};
use hybray_shading::{Lens, Light, LightKind, Material, Projection};

/// Primitives that a model may have: their ids leave one bit of an `u32` free.
pub const PRIMITIVES_MAX: u64 = (1 << 31) - 1;

/// Width and height that a picture may have, pixels.
pub const SIZE_MAX: u32 = hybray_wire::TileMap::SIDE_MAX;

/// What is wrong, and what to do.
pub(crate) type Complaint = (String, String);

fn complaint<T>(problem: impl Into<String>, remedy: impl Into<String>) -> Result<T, Complaint> {
    Err((problem.into(), remedy.into()))
}

fn in_range(values: &[f32]) -> bool {
    // NaN is in no range.
    values.iter().all(|v| v.abs() <= COORDINATE_MAX)
}

/// Checks every part of a model; the error names the part.
///
/// # Errors
/// For the first part that breaks a rule of this module's page or of a field's documentation in [`crate::model`].
pub fn validate(model: &Model) -> Result<(), ImportError> {
    let fail = |part: String, (problem, remedy): Complaint| ImportError::new(&part, problem, remedy);
    let count = model.primitives() as u64;
    if count > PRIMITIVES_MAX {
        let problem = (format!("{count} primitives"), format!("keep to {PRIMITIVES_MAX}"));
        return Err(fail("the scene".to_owned(), problem));
    }
    let materials = model.materials.len();
    if materials > usize::from(u16::MAX) {
        return Err(fail("the scene".to_owned(), (format!("{materials} materials"), "keep to 65,535".to_owned())));
    }
    let named = |index: u16| match model.materials.get(usize::from(index)) {
        Some(m) => Ok(m.name.as_str()),
        None => complaint(format!("material {index} of {materials}"), "give it a material that there is"),
    };
    for (i, mesh) in model.meshes.iter().enumerate() {
        let part = || format!("mesh {} {}", i + 1, quote(&mesh.name));
        named(mesh.material).map_err(|c| fail(part(), c))?;
        let flat = |points: &[[f32; 3]]| points.iter().all(|p| in_range(p));
        if !flat(&mesh.positions) || !flat(&mesh.normals) {
            let problem = "a coordinate is not finite or beyond 2^100".to_owned();
            return Err(fail(part(), (problem, "scale the model down".to_owned())));
        }
        let attributes = [("texture coordinates", mesh.coordinates.len()), ("colours", mesh.colours.len())];
        if let Some((what, count)) = attributes.into_iter().find(|(_, n)| *n != 0 && *n != mesh.positions.len()) {
            let problem = format!("{count} {what} for {} vertices", mesh.positions.len());
            return Err(fail(part(), (problem, "give each vertex one, or none any".to_owned())));
        }
        if !mesh.coordinates.iter().flatten().all(|c| in_range(&[*c])) {
            let problem = "a texture coordinate is not finite or beyond 2^100".to_owned();
            return Err(fail(part(), (problem, "map the texture again".to_owned())));
        }
        if !mesh.normals.is_empty() && mesh.normals.len() != mesh.positions.len() {
            let problem = format!("{} normals for {} vertices", mesh.normals.len(), mesh.positions.len());
            return Err(fail(part(), (problem, "give each vertex one, or none any".to_owned())));
        }
        let beyond = |i: &&u32| **i as usize >= mesh.positions.len();
        if let Some(index) = mesh.triangles.iter().flatten().find(beyond) {
            let problem = format!("vertex {index} of {}", mesh.positions.len());
            return Err(fail(part(), (problem, "give triangles vertices that there are".to_owned())));
        }
    }
    for (i, s) in model.spheres.iter().enumerate() {
        let check =
            named(s.material).and_then(|name| sphere(s).map_err(|(p, r)| (format!("{p} (material {name})"), r)));
        check.map_err(|c| fail(format!("sphere {}", i + 1), c))?;
    }
    for (i, c) in model.cones.iter().enumerate() {
        let check = named(c.material).and_then(|name| cone(c).map_err(|(p, r)| (format!("{p} (material {name})"), r)));
        check.map_err(|e| fail(format!("cone {}", i + 1), e))?;
    }
    for m in &model.materials {
        material(&m.material).map_err(|c| fail(format!("material {}", quote(&m.name)), c))?;
    }
    for (i, l) in model.lights.iter().enumerate() {
        light(l).map_err(|c| fail(format!("light {}", i + 1), c))?;
    }
    if !model.environment().is_sound(usize::MAX) {
        let problem = "what is all around makes no sense".to_owned();
        return Err(fail("the scene".to_owned(), (problem, "give it anew".to_owned())));
    }
    for c in &model.cameras {
        camera(c).map_err(|e| fail(format!("camera {}", quote(&c.name)), e))?;
    }
    colours(&[("background", model.background), ("ambient", model.ambient)])
        .map_err(|c| fail("the scene".to_owned(), c))
}

/// A sphere by itself; its material is not looked at.
pub(crate) fn sphere(s: &Sphere) -> Result<(), Complaint> {
    if !in_range(&s.centre) || !in_range(&[s.radius]) {
        return complaint("the sphere's numbers are not finite or beyond 2^100", "scale the scene down");
    }
    if s.radius <= 0.0 {
        return complaint(format!("the sphere's radius is {}", s.radius), "give it a radius of more than 0");
    }
    if s.centre.iter().any(|&c| c + s.radius == c || c - s.radius == c) {
        let problem = format!("a radius of {} around {:?} is too small for f32 to tell", s.radius, s.centre);
        return complaint(problem, "move the scene to the origin, or make the sphere larger");
    }
    Ok(())
}

/// A cone by itself; its material is not looked at.
pub(crate) fn cone(c: &Cone) -> Result<(), Complaint> {
    if !in_range(&c.base) || !in_range(&c.apex) || !in_range(&[c.base_radius, c.apex_radius]) {
        return complaint("the cone's numbers are not finite or beyond 2^100", "scale the scene down");
    }
    if c.base_radius < 0.0 || c.apex_radius < 0.0 {
        return complaint("the cone has a negative radius", "give radii of 0 and up");
    }
    if c.base_radius == 0.0 && c.apex_radius == 0.0 {
        return complaint("both radii of the cone are 0", "give one of them more than 0");
    }
    if c.base == c.apex {
        return complaint("the cone's two ends are the same point", "move one of them");
    }
    let (low, high) = cone_bounds(c);
    if (0..3).any(|i| low[i] == high[i]) {
        let problem = format!("the cone at {:?} is too thin for f32 to tell", c.base);
        return complaint(problem, "move the scene to the origin, or make the cone larger");
    }
    Ok(())
}

/// Box of a cone: the rings at its ends reach `radius * sqrt(1 - d^2)` along an axis, where `d` is the component of
/// its unit direction. Rounded to nearest: what must contain it widens it by an ulp.
pub(crate) fn cone_bounds(c: &Cone) -> ([f32; 3], [f32; 3]) {
    let ends = [c.base, c.apex].map(|p| p.map(f64::from));
    let along = unit([0, 1, 2].map(|i| ends[1][i] - ends[0][i])).unwrap_or([0.0; 3]);
    let mut bounds = ([0.0; 3], [0.0; 3]);
    for i in 0..3 {
        // 1 - d^2 as the sum of the other squares: it does not cancel.
        let across = (along[(i + 1) % 3] * along[(i + 1) % 3] + along[(i + 2) % 3] * along[(i + 2) % 3]).sqrt();
        let reach = [f64::from(c.base_radius) * across, f64::from(c.apex_radius) * across];
        let (low, high) =
            ([ends[0][i] - reach[0], ends[1][i] - reach[1]], [ends[0][i] + reach[0], ends[1][i] + reach[1]]);
        bounds.0[i] = (if low[0] < low[1] { low[0] } else { low[1] }) as f32;
        bounds.1[i] = (if high[0] > high[1] { high[0] } else { high[1] }) as f32;
    }
    bounds
}

fn colours(named: &[(&str, [f32; 3])]) -> Result<(), Complaint> {
    for (name, colour) in named {
        if !in_range(colour) || colour.iter().any(|&c| c < 0.0) {
            return complaint(format!("{name} is {colour:?}"), "give it three numbers of 0 and up");
        }
    }
    Ok(())
}

fn material(m: &Material) -> Result<(), Complaint> {
    colours(&[
        ("diffuse", m.diffuse),
        ("ambient", m.ambient),
        ("emission", m.emission),
        ("specular", m.specular),
        ("mirror", m.mirror),
        ("transmission", m.transmission),
    ])?;
    if !(m.exponent >= 0.0 && m.exponent <= COORDINATE_MAX) {
        return complaint(format!("exponent is {}", m.exponent), "give 0 and up");
    }
    if !(m.ior > 0.0 && m.ior <= COORDINATE_MAX) {
        return complaint(format!("ior is {}", m.ior), "give more than 0, for example 1.5");
    }
    Ok(())
}

/// A light by itself.
pub(crate) fn light(l: &Light) -> Result<(), Complaint> {
    colours(&[("colour", l.colour)])?;
    let vectors = [l.position, l.axis, l.u, l.v];
    if !vectors.iter().all(|v| in_range(v)) || !in_range(&[l.radius, l.cos_inner, l.cos_outer]) {
        return complaint("the light's numbers are not finite or beyond 2^100", "scale the scene down");
    }
    let is = |kind: LightKind| l.kind == kind as u32;
    if (is(LightKind::Directional) || is(LightKind::Spot)) && unit(l.axis.map(f64::from)).is_none() {
        return complaint("the light's axis has no length", "give the direction in which it shines");
    }
    if is(LightKind::Spot) && l.cos_outer > l.cos_inner {
        return complaint("the spot's inner angle is above its outer one", "exchange them");
    }
    if is(LightKind::Sphere) && l.radius <= 0.0 {
        return complaint(format!("the light's radius is {}", l.radius), "give more than 0");
    }
    if is(LightKind::Rectangle) && parallel(l.u, l.v) {
        return complaint("the light's edges `u` and `v` span no rectangle", "give edges in different directions");
    }
    Ok(())
}

/// An opening is at most so many times as far across from the middle as what is sharp is away: less than nodes would take, so
/// that rounding does not matter.
const APERTURE_MAX: f32 = 1000.0;

/// A camera by itself.
pub(crate) fn camera(c: &CameraSpec) -> Result<(), Complaint> {
    // What is not used may be anything that a file can say, but not what a projection makes of the rest.
    let is_flat = c.projection == Projection::Orthographic;
    let height = if is_flat { c.picture_height() } else { c.height.unwrap_or(1.0) };
    let focus = if c.aperture > 0.0 { c.focus_distance() } else { c.focus.unwrap_or(1.0) };
    let lengths = [c.hither, c.aperture, height, focus, c.blade_rotation_degrees];
    if ![c.eye, c.target, c.up].iter().all(|v| in_range(v)) || !in_range(&lengths) {
        return complaint("the camera's numbers are not finite or beyond 2^100", "scale the scene down");
    }
    if c.eye == c.target {
        return complaint("the camera looks at the point where it stands", "move the eye or the target");
    }
    let view = [0, 1, 2].map(|i| c.target[i] - c.eye[i]);
    if parallel(view, c.up) {
        return complaint("the camera's up points along its view", "give another up, for example one of the axes");
    }
    if !(c.fov_y_degrees > 0.0 && c.fov_y_degrees < 180.0) {
        let problem = format!("the camera's angle is {} degrees", c.fov_y_degrees);
        return complaint(problem, "give more than 0 and less than 180, for example 40");
    }
    if c.hither < 0.0 {
        return complaint(format!("the camera's hither is {}", c.hither), "give 0 and up");
    }
    if height <= 0.0 {
        return complaint(format!("the height of the camera's picture is {height}"), "give more than 0");
    }
    if c.aperture < 0.0 {
        return complaint(
            format!("the camera's aperture is {}", c.aperture),
            "give the radius of its lens, or 0 for none",
        );
    }
    if focus <= 0.0 || c.aperture / focus > APERTURE_MAX {
        let problem = format!("the camera's aperture is {} and its focus {focus}", c.aperture);
        return complaint(
            problem,
            format!("give a focus of more than 0, and an aperture of at most {APERTURE_MAX} times that"),
        );
    }
    if c.aperture > 0.0 && c.projection != Projection::Perspective {
        let problem = format!("an aperture means nothing for a camera that is {}", c.projection.name());
        return complaint(problem, "leave it out, or make the camera perspective");
    }
    if matches!(c.blades, 1 | 2) || u32::from(c.blades) > Lens::BLADES_MAX {
        let problem = format!("the camera's lens has {} blades", c.blades);
        return complaint(problem, format!("give 3 to {}, or 0 for a round one", Lens::BLADES_MAX));
    }
    match c.size {
        Some(size) if size.iter().any(|&s| s == 0 || s > SIZE_MAX) => {
            complaint(format!("the picture is {} x {}", size[0], size[1]), format!("give 1 to {SIZE_MAX} pixels"))
        }
        _ => Ok(()),
    }
}

/// Whether two vectors span nothing; so does one without length.
fn parallel(a: [f32; 3], b: [f32; 3]) -> bool {
    !super::polygon::has_area([0.0; 3], a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Mesh, NamedMaterial};

    fn sound() -> Model {
        let mut model = Model::default();
        model.materials.push(NamedMaterial { name: "red".to_owned(), ..NamedMaterial::default() });
        model.meshes.push(Mesh {
            name: "roof".to_owned(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        });
        model.spheres.push(Sphere { centre: [0.0; 3], radius: 1.0, material: 0 });
        let (base, apex) = ([0.0; 3], [0.0, 0.0, 1.0]);
        model.cones.push(Cone { base, base_radius: 1.0, apex, apex_radius: 0.0, material: 0 });
        model.lights.push(Light { colour: [1.0; 3], samples: 1, ..Light::default() });
        model.cameras.push(CameraSpec {
            name: "front".to_owned(),
            eye: [0.0, 0.0, 5.0],
            target: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            fov_y_degrees: 40.0,
            ..CameraSpec::default()
        });
        model
    }

    #[test]
    fn a_sound_model_passes() {
        assert_eq!(validate(&sound()), Ok(()));
        assert_eq!(validate(&Model::default()), Ok(()));
        let mut large = sound();
        large.meshes[0].positions[0] = [COORDINATE_MAX; 3];
        assert_eq!(validate(&large), Ok(()));
    }

    #[test]
    fn every_rule_can_fail() {
        let check = |spoil: fn(&mut Model), expected: &str| {
            let mut model = sound();
            spoil(&mut model);
            let error = validate(&model).expect_err(expected).to_string();
            assert!(error.starts_with(expected), "{error}");
        };
        check(|m| m.meshes[0].positions[1][2] = f32::NAN, "mesh 1 `roof`: a coordinate");
        check(|m| m.meshes[0].positions[1][2] = COORDINATE_MAX * 1.001, "mesh 1 `roof`: a coordinate");
        check(|m| m.meshes[0].normals[1][2] = f32::INFINITY, "mesh 1 `roof`: a coordinate");
        check(|m| m.meshes[0].normals.truncate(2), "mesh 1 `roof`: 2 normals for 3");
        check(|m| m.meshes[0].triangles[0][1] = 3, "mesh 1 `roof`: vertex 3 of 3");
        check(|m| m.meshes[0].material = 1, "mesh 1 `roof`: material 1 of 1");
        check(|m| m.spheres[0].radius = 0.0, "sphere 1: the sphere's radius is 0 (material red)");
        check(|m| m.spheres[0].radius = f32::NAN, "sphere 1: the sphere's numbers");
        check(|m| m.spheres[0].centre = [1e9, 0.0, 0.0], "sphere 1: a radius of 1 around [1000000000.0, 0.0, 0.0]");
        check(|m| m.spheres[0].material = 7, "sphere 1: material 7 of 1");
        check(|m| m.cones[0].base_radius = 0.0, "cone 1: both radii");
        check(|m| m.cones[0].base_radius = -1.0, "cone 1: the cone has a negative");
        check(|m| m.cones[0].apex = [0.0; 3], "cone 1: the cone's two ends");
        check(|m| (m.cones[0].base[0], m.cones[0].apex[0]) = (1e9, 1e9), "cone 1: the cone at");
        check(|m| m.materials[0].material.mirror[1] = -0.1, "material `red`: mirror is");
        check(|m| m.materials[0].material.ior = 0.0, "material `red`: ior is 0");
        check(|m| m.materials[0].material.exponent = f32::NAN, "material `red`: exponent");
        check(|m| m.lights[0].colour[0] = -1.0, "light 1: colour");
        check(|m| m.lights[0].kind = LightKind::Directional as u32, "light 1: the light's axis");
        check(|m| m.lights[0].kind = LightKind::Sphere as u32, "light 1: the light's radius");
        check(|m| m.lights[0].kind = LightKind::Rectangle as u32, "light 1: the light's edges");
        check(|m| m.cameras[0].eye = [0.0; 3], "camera `front`: the camera looks at");
        check(|m| m.cameras[0].up = [0.0, 0.0, -2.0], "camera `front`: the camera's up");
        check(|m| m.cameras[0].fov_y_degrees = 180.0, "camera `front`: the camera's angle is 180");
        check(|m| m.cameras[0].hither = -1.0, "camera `front`: the camera's hither");
        check(|m| m.cameras[0].height = Some(0.0), "camera `front`: the height of the camera's picture is 0");
        check(|m| m.cameras[0].aperture = -1.0, "camera `front`: the camera's aperture is -1");
        check(|m| m.cameras[0].focus = Some(0.0), "camera `front`: the camera's aperture is 0 and its focus 0");
        check(|m| m.cameras[0].aperture = 6000.0, "camera `front`: the camera's aperture is 6000 and its focus 5");
        check(|m| m.cameras[0].focus = Some(f32::NAN), "camera `front`: the camera's numbers");
        check(
            |m| (m.cameras[0].aperture, m.cameras[0].projection) = (1.0, Projection::Spherical),
            "camera `front`: an aperture means nothing for a camera that is spherical",
        );
        check(|m| m.cameras[0].blades = 2, "camera `front`: the camera's lens has 2 blades");
        check(|m| m.cameras[0].blades = 17, "camera `front`: the camera's lens has 17 blades");
        check(|m| m.cameras[0].size = Some([0, 5]), "camera `front`: the picture is 0 x 5");
        check(|m| m.background[0] = f32::NAN, "the scene: background");
    }

    #[test]
    fn boxes_of_cones() {
        let check = |base, base_radius, apex, apex_radius, expected| {
            assert_eq!(cone_bounds(&Cone { base, base_radius, apex, apex_radius, material: 0 }), expected);
        };
        check([0.0; 3], 2.0, [0.0, 0.0, 5.0], 1.0, ([-2.0, -2.0, 0.0], [2.0, 2.0, 5.0]));
        check([1.0; 3], 0.0, [4.0, 5.0, 1.0], 5.0, ([0.0, 1.0, -4.0], [8.0, 8.0, 6.0]));
    }
}
