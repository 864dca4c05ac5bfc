//! The scenes that the two papers measured with, or stand-ins for those that are not to be had.
//!
//! Sources: Reinhard, *Hybrid scheduling for parallel ray tracing*, 1995, section 6.1 (balls, teapot, conference room),
//! 6.4 (reflectivity) and 6.6 (the large models); Plachetka, *POV||Ray*, section 6 (ROSENTHALERHOF, SKYVASE). The
//! conference room, the courtyard and the vase are of our own design: they have the kind and the number of primitives
//! and lights that the papers state, not their shapes. Cameras ask for the published picture sizes, and settings for
//! rays to depth 5.
//!
//! Units: those of SPD in its scenes, metres with z up in ours.

mod conference;
mod hof;
mod shapes;
mod spheres;
mod vase;

use super::spd;
use super::vector::{V, narrow};
use crate::model::{CameraSpec, Mesh, Model, Settings};
use hybray_shading::{Highlight, Light, LightKind, Material};

pub use conference::conference;
pub use hof::hof;
pub use spheres::{balls, balls5};
pub use vase::vase;

/// Picture size of the report of 1995, pixels.
const SIZE_1995: [u32; 2] = [256, 256];
/// Picture size of POV||Ray, pixels.
const SIZE_POV: [u32; 2] = [640, 480];

/// SPD's teapot of 9,264 polygons, its ground without mirror and highlight.
pub fn teapot() -> Model {
    let mut model = spd::teapot(12);
    for m in model.materials.iter_mut().filter(|m| m.name != "teapot") {
        // SPD's share of the diffuse part is a half. Half of the mirror's half goes to it: with all, white would clip.
        m.material = matt(m.material.diffuse.map(|c| 1.5 * c));
    }
    model.cameras[0].size = Some(SIZE_1995);
    model
}

/// A room or a yard without anything in it yet.
fn empty(name: &str, eye: V, target: V, fov_y_degrees: f32, size: [u32; 2]) -> Model {
    let up = [0.0, 0.0, 1.0];
    let camera = CameraSpec {
        name: name.to_owned(),
        eye: narrow(eye),
        target: narrow(target),
        up,
        fov_y_degrees,
        hither: 0.0,
        size: Some(size),
        ..CameraSpec::default()
    };
    Model { cameras: vec![camera], settings: Settings { depth: Some(5), ..Settings::default() }, ..Model::default() }
}

/// Adds a mesh and counts its triangles.
fn put(model: &mut Model, name: String, material: u16, mesh: Mesh) {
    model.objects.polygons += mesh.triangles.len() as u64;
    model.meshes.push(Mesh { name, material, ..mesh });
}

/// A point light of the same strength at every distance, as both papers' renderers have it.
fn point_light(position: V, colour: [f32; 3]) -> Light {
    Light { position: narrow(position), kind: LightKind::Point as u32, colour, samples: 1, ..Light::default() }
}

/// Matt, in ambient light of the same colour.
fn matt(colour: [f32; 3]) -> Material {
    Material { diffuse: colour, ambient: colour, ..Material::MATT }
}

/// A surface with a highlight that mirrors `share` of what it sees.
fn shiny(colour: [f32; 3], share: f32, exponent: f32) -> Material {
    let specular = [share.max(0.1); 3];
    let highlight = Highlight::Blinn as u32;
    Material { specular, exponent, highlight, mirror: [share; 3], ..matt(colour) }
}

/// Shines by itself.
fn glowing(colour: [f32; 3]) -> Material {
    Material { emission: colour, diffuse: [0.0; 3], ..Material::MATT }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    /// Published: 9,264 of "triangles" (a square of the ground counted as one), a specular pot on a diffuse ground.
    #[test]
    fn teapot_as_modified() {
        let model = teapot();
        checks::sound(&model);
        assert_eq!(model.objects.polygons, 9_264);
        // Each of the 144 squares is two triangles.
        assert_eq!(model.primitives(), 9_264 + 144);
        let mirrors: Vec<_> = model.materials.iter().map(|m| (m.name.as_str(), m.material.mirrors())).collect();
        assert_eq!(mirrors, [("white", false), ("grey", false), ("teapot", true)]);
        assert!(model.materials[..2].iter().all(|m| m.material.highlight() == Highlight::None));
        assert_eq!((model.cameras[0].size, model.settings.depth), (Some([256, 256]), Some(5)));
    }
}
