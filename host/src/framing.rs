//! What a model lacks to be drawn: a camera that frames it, lights that show its shape, a background.
//!
//! The camera looks from the front, a little from the right and from above, from just so far that the model's box
//! fills the picture up to a margin. Without lights there are two, both directional: a key from the upper left of the
//! camera and a weaker fill from its right, and, if the model has no ambient light of its own, a little of that, so
//! that what neither reaches is dark but not lost. All materials then reflect ambient light as they do direct light:
//! where there is no ambient light to go with it, files say whatever their program's default is.

use crate::import::{cone_bounds, unit};
use crate::model::{CameraSpec, Model};
use hybray_shading::{Light, LightKind};

/// Angle of the picture's height, degrees.
const FOV_Y_DEGREES: f32 = 40.0;

/// The box may fill this part of the picture's width and height.
const FILLED: f64 = 0.9;

/// Background behind a model that has neither camera nor background.
const GREY: [f32; 3] = [0.6; 3];

/// Ambient light beside the two lights.
const AMBIENT: [f32; 3] = [0.1; 3];

/// Gives the model a camera, lights and a background where it has none; `+Y` is up.
///
/// What the model has is left as it is. A model without primitives gets no camera.
pub fn complete(model: &mut Model) {
    complete_with_up(model, [0.0, 1.0, 0.0]);
}

/// The same with another axis that is up: see [`crate::import::up_axis`]. It must be a coordinate axis.
pub fn complete_with_up(model: &mut Model, up: [f32; 3]) {
    if model.cameras.is_empty()
        && let Some(bounds) = bounds(model)
    {
        let size = model.settings.size.unwrap_or([4, 3]);
        let aspect = f64::from(size[0].max(1)) / f64::from(size[1].max(1));
        model.cameras.push(frame(bounds, up, aspect));
        if model.background == [0.0; 3] {
            model.background = GREY;
        }
    }
    if model.lights.is_empty()
        && model.cells.is_empty()
        && let Some([right, above, back]) = model.cameras.first().and_then(basis)
    {
        let light = |from: [f64; 3], strength: f32| {
            let to = [0, 1, 2].map(|i| -(from[0] * right[i] + from[1] * above[i] + from[2] * back[i]));
            let axis = unit(to).unwrap_or([0.0, 0.0, -1.0]).map(|c| c as f32);
            Light { axis, kind: LightKind::Directional as u32, colour: [strength; 3], samples: 1, ..Light::default() }
        };
        // The sum stays below 1 for a white surface, so that nothing is drawn whiter than white.
        model.lights.push(light([-0.6, 0.8, 0.9], 0.7));
        model.lights.push(light([0.9, 0.2, 0.6], 0.2));
        if model.ambient == [0.0; 3] {
            model.ambient = AMBIENT;
            for m in &mut model.materials {
                m.material.ambient = m.material.diffuse;
            }
        }
    }
}

/// Smallest box around every primitive: least and greatest corner; `None` without primitives.
#[must_use]
pub fn bounds(model: &Model) -> Option<([f32; 3], [f32; 3])> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    let mut add = |a: [f32; 3], b: [f32; 3]| {
        for i in 0..3 {
            if a[i] < low[i] {
                low[i] = a[i];
            }
            if b[i] > high[i] {
                high[i] = b[i];
            }
        }
    };
    for mesh in &model.meshes {
        // Vertices that no triangle has are not seen.
        for &i in mesh.triangles.iter().flatten() {
            if let Some(&p) = mesh.positions.get(i as usize) {
                add(p, p);
            }
        }
    }
    for s in &model.spheres {
        add(s.centre.map(|c| c - s.radius), s.centre.map(|c| c + s.radius));
    }
    for c in &model.cones {
        let (a, b) = cone_bounds(c);
        add(a, b);
    }
    (0..3).all(|i| low[i] <= high[i]).then_some((low, high))
}

/// The camera that shows a box.
fn frame((low, high): ([f32; 3], [f32; 3]), up: [f32; 3], aspect: f64) -> CameraSpec {
    let [low, high] = [low, high].map(|p| p.map(f64::from));
    let centre = [0, 1, 2].map(|i| low[i] + (high[i] - low[i]) / 2.0);
    // The front is +Z where Y is up, and -Y where Z is.
    let from = if up[2] != 0.0 { [0.55, -1.0, 0.45] } else { [0.55, 0.45, 1.0] };
    let back = unit(from).unwrap_or([0.0, 0.0, 1.0]);
    let right = unit(cross(up.map(f64::from), back)).unwrap_or([1.0, 0.0, 0.0]);
    let above = cross(back, right);
    let half_height = libm::tan(f64::from(FOV_Y_DEGREES) / 2.0 * (std::f64::consts::PI / 180.0));
    let slopes = [half_height * aspect * FILLED, half_height * FILLED];
    let mut distance: f64 = 0.0;
    for corner in 0..8 {
        let offset = [0, 1, 2].map(|i| if corner >> i & 1 == 0 { low[i] } else { high[i] } - centre[i]);
        for (axis, slope) in [(right, slopes[0]), (above, slopes[1])] {
            // In the picture if |offset . axis| <= slope * (distance - offset . back).
            let needed = dot(offset, back) + dot(offset, axis).abs() / slope;
            if needed > distance {
                distance = needed;
            }
        }
    }
    CameraSpec {
        name: "framed".to_owned(),
        eye: [0, 1, 2].map(|i| (centre[i] + distance * back[i]) as f32),
        target: centre.map(|c| c as f32),
        up,
        fov_y_degrees: FOV_Y_DEGREES,
        hither: 0.0,
        size: None,
        ..CameraSpec::default()
    }
}

/// Right, above and back (towards the eye) of a camera; `None` if it has no direction.
pub(crate) fn basis(camera: &CameraSpec) -> Option<[[f64; 3]; 3]> {
    let back = unit([0, 1, 2].map(|i| f64::from(camera.eye[i]) - f64::from(camera.target[i])))?;
    let right = unit(cross(camera.up.map(f64::from), back))?;
    Some([right, cross(back, right), back])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::validate;
    use crate::model::{Cone, Mesh, NamedMaterial, Sphere};
    use hybray_shading::Material;

    fn block(low: [f32; 3], high: [f32; 3]) -> Model {
        let mut model = Model::default();
        let positions = vec![low, high, [low[0], high[1], low[2]], [1e9; 3]];
        model.meshes.push(Mesh { positions, triangles: vec![[0, 1, 2]], ..Mesh::default() });
        let material = Material { ambient: [1.0; 3], ..Material::MATT };
        model.materials.push(NamedMaterial { name: "m".to_owned(), material, ..Default::default() });
        model
    }

    #[test]
    fn boxes() {
        assert_eq!(bounds(&Model::default()), None);
        let mut model = block([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]);
        assert_eq!(bounds(&model), Some(([-1.0, -2.0, -3.0], [1.0, 2.0, 3.0])));
        model.spheres.push(Sphere { centre: [5.0, 0.0, 0.0], radius: 3.0, material: 0 });
        assert_eq!(bounds(&model), Some(([-1.0, -3.0, -3.0], [8.0, 3.0, 3.0])));
        let (base, apex) = ([0.0; 3], [0.0, 0.0, 9.0]);
        model.cones.push(Cone { base, base_radius: 4.0, apex, apex_radius: 0.0, material: 0 });
        assert_eq!(bounds(&model), Some(([-4.0, -4.0, -3.0], [8.0, 4.0, 9.0])));
    }

    /// Projects the box's corners by the definition of a pinhole camera: all are within the margin, and one is at it.
    #[test]
    fn the_box_fills_the_picture() {
        let check = |low: [f32; 3], high: [f32; 3], up: [f32; 3], size: [u32; 2]| {
            let mut model = block(low, high);
            model.settings.size = Some(size);
            complete_with_up(&mut model, up);
            assert_eq!(validate(&model), Ok(()));
            let camera = &model.cameras[0];
            let [right, above, back] = basis(camera).expect("a basis");
            let half = libm::tan(f64::from(camera.fov_y_degrees).to_radians() / 2.0);
            let mut widest: f64 = 0.0;
            for corner in 0..8 {
                let p =
                    [0, 1, 2].map(|i| f64::from(if corner >> i & 1 == 0 { low[i] } else { high[i] } - camera.eye[i]));
                let depth = -dot(p, back);
                assert!(depth > 0.0, "{low:?} {high:?}: a corner behind the eye");
                let x = dot(p, right).abs() / (depth * half * f64::from(size[0]) / f64::from(size[1]));
                let y = dot(p, above).abs() / (depth * half);
                widest = widest.max(x).max(y);
            }
            assert!((widest - FILLED).abs() < 1e-3, "{low:?} {high:?} {size:?}: {widest}");
            let over = dot(up.map(f64::from), [0, 1, 2].map(|i| f64::from(camera.eye[i] - camera.target[i])));
            assert!(over > 0.0, "the eye is above");
        };
        let (y, z) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        for up in [y, z] {
            for size in [[640, 480], [100, 400], [400, 100]] {
                check([-1.0; 3], [1.0; 3], up, size);
                check([10.0, 20.0, 30.0], [11.0, 29.0, 31.0], up, size);
                check([-100.0, 0.0, -1.0], [100.0, 0.0, 1.0], up, size);
                check([0.0; 3], [1e-20, 2e-20, 1e-20], up, size);
                check([-1e25; 3], [1e25; 3], up, size);
            }
        }
    }

    #[test]
    fn only_what_lacks_is_given() {
        let mut model = block([-1.0; 3], [1.0; 3]);
        complete(&mut model);
        assert_eq!((model.cameras.len(), model.lights.len()), (1, 2));
        assert_eq!((model.background, model.ambient), (GREY, AMBIENT));
        assert_eq!(model.materials[0].material.ambient, Material::MATT.diffuse);
        let key = model.lights[0];
        let length: f32 = key.axis.iter().map(|c| c * c).sum();
        assert!((length - 1.0).abs() < 1e-6);
        assert!(key.axis[1] < 0.0 && key.flags == 0, "the key shines down, the same at every distance");

        let mut again = model.clone();
        complete(&mut again);
        assert_eq!((again.cameras, again.lights.len()), (model.cameras.clone(), 2));

        let mut lit = block([-1.0; 3], [1.0; 3]);
        (lit.background, lit.ambient) = ([0.1; 3], [0.2; 3]);
        lit.cameras.clone_from(&model.cameras);
        complete(&mut lit);
        assert_eq!((lit.background, lit.ambient, lit.lights.len()), ([0.1; 3], [0.2; 3], 2));
        assert_eq!(lit.materials[0].material.ambient, [1.0; 3]);

        let mut dark = block([-1.0; 3], [1.0; 3]);
        dark.cameras.clone_from(&model.cameras);
        dark.lights.push(key);
        complete(&mut dark);
        assert_eq!((dark.background, dark.ambient, dark.lights.len()), ([0.0; 3], [0.0; 3], 1));

        let mut empty = Model::default();
        complete(&mut empty);
        assert!(empty.cameras.is_empty() && empty.lights.is_empty());
    }
}
