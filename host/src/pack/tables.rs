//! What a packed scene holds beside pages, materials and lights: written with postcard.

use crate::model::{CameraSpec, Model, Objects, Settings};
use hybray_shading::Projection;
use serde::{Deserialize, Serialize};

#[derive(Debug, Serialize, Deserialize)]
struct Camera {
    name: String,
    eye: [f32; 3],
    target: [f32; 3],
    up: [f32; 3],
    fov_y_degrees: f32,
    hither: f32,
    size: Option<[u32; 2]>,
    /// The number of a [`Projection`].
    projection: u8,
    height: Option<f32>,
    aperture: f32,
    focus: Option<f32>,
    blades: u8,
    blade_rotation_degrees: f32,
}

/// The tables, in the order of the file. `docs/HYB.md` lists the fields: a change here is a new version there.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Rest {
    cameras: Vec<Camera>,
    background: [f32; 3],
    ambient: [f32; 3],
    size: Option<[u32; 2]>,
    spp: Option<u32>,
    depth: Option<u32>,
    cutoff: Option<f32>,
    filter: Option<String>,
    exposure: Option<f32>,
    seed: Option<u64>,
    objects: [u64; 4],
    warnings: Vec<String>,
    /// Corners of the scene's box, file units.
    pub extent: [[f32; 3]; 2],
}

impl Rest {
    /// What `model` holds of it.
    pub fn of(model: &Model, extent: [[f32; 3]; 2]) -> Self {
        let cameras = model.cameras.iter().cloned().map(|c| Camera {
            name: c.name,
            eye: c.eye,
            target: c.target,
            up: c.up,
            fov_y_degrees: c.fov_y_degrees,
            hither: c.hither,
            size: c.size,
            projection: c.projection as u8,
            height: c.height,
            aperture: c.aperture,
            focus: c.focus,
            blades: c.blades,
            blade_rotation_degrees: c.blade_rotation_degrees,
        });
        let Settings { size, spp, depth, cutoff, filter, exposure, seed } = model.settings.clone();
        let Objects { polygons, spheres, cones, cylinders } = model.objects;
        Self {
            cameras: cameras.collect(),
            background: model.background,
            ambient: model.ambient,
            size,
            spp,
            depth,
            cutoff,
            filter,
            exposure,
            seed,
            objects: [polygons, spheres, cones, cylinders],
            warnings: model.warnings.clone(),
            extent,
        }
    }

    /// A model of it, without primitives, materials and lights. `None` if a camera has a projection that is none.
    pub fn into_model(self) -> Option<Model> {
        let Self { size, spp, depth, cutoff, filter, exposure, seed, .. } = self;
        let camera = |c: Camera| {
            Some(CameraSpec {
                name: c.name,
                eye: c.eye,
                target: c.target,
                up: c.up,
                fov_y_degrees: c.fov_y_degrees,
                hither: c.hither,
                size: c.size,
                projection: Projection::from_u32(c.projection.into())?,
                height: c.height,
                aperture: c.aperture,
                focus: c.focus,
                blades: c.blades,
                blade_rotation_degrees: c.blade_rotation_degrees,
            })
        };
        let [polygons, spheres, cones, cylinders] = self.objects;
        Some(Model {
            cameras: self.cameras.into_iter().map(camera).collect::<Option<_>>()?,
            background: self.background,
            ambient: self.ambient,
            settings: Settings { size, spp, depth, cutoff, filter, exposure, seed },
            objects: Objects { polygons, spheres, cones, cylinders },
            warnings: self.warnings,
            ..Model::default()
        })
    }
}
