//! A scene ready to be traced: pages, tables, and what it requires.

use crate::build::{self, BuildError, Packed, Pages};
use crate::film::Subject;
use crate::framing;
use crate::model::{CameraSpec, Model, Objects, Settings};
use crate::pack::{self, HybError, Packing};
use hybray_scheduler::Step;
use hybray_shading::{
    Cell, Cut, Environment, Filter, Light, LightKind, Map, MapTables, Maps, Material, Projection, Sky, spawn,
};
use hybray_tracer::{Layer, Scene};
use hybray_wire::{Frame, Optics};
use std::path::Path;
use std::time::{Duration, Instant};

/// Samples of a pixel if nobody says.
pub const SAMPLES: u32 = 4;
/// Ray depth if nobody says.
pub const DEPTH: u32 = 8;
/// Least weight if nobody says: below half a step of an 8-bit picture.
pub const CUTOFF: f32 = 1.0 / 512.0;
/// Picture size if nobody says.
pub const SIZE: [u32; 2] = [640, 480];

/// A model built into pages, its tables in internal units.
pub struct Prepared {
    /// Pages and directory.
    pub packed: Packed,
    materials: Vec<Material>,
    lights: Vec<Light>,
    maps: Vec<Maps>,
    uses: Vec<Map>,
    sky: Sky,
    cells: Vec<Cell>,
    cuts: Vec<Cut>,
    ambient: [f32; 3],
    background: [f32; 3],
    /// Cameras, in file units.
    pub cameras: Vec<CameraSpec>,
    /// Settings that the scene gives.
    pub settings: Settings,
    /// What the file counted.
    pub objects: Objects,
    /// Triangles, spheres and cones.
    pub primitives: [u64; 3],
    /// Triangles with vertex normals.
    pub smooth: u64,
    /// Least and greatest corner of everything, file units.
    pub extent: [[f32; 3]; 2],
    /// What could not be honoured.
    pub warnings: Vec<String>,
    /// How long the build took.
    pub build_time: Duration,
    /// Hash of pages and tables.
    pub hash: u64,
}

impl Prepared {
    /// Builds `model`, and lets it go.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn new(mut model: Model, settings: &build::Settings) -> Result<Self, BuildError> {
        let start = Instant::now();
        let packed = build::build(&model, settings)?;
        let build_time = start.elapsed();
        let (lo, hi) = framing::bounds(&model).unwrap_or_default();
        let meshes = std::mem::take(&mut model.meshes);
        let triangles = meshes.iter().map(|m| m.triangles.len() as u64).sum();
        let smooth = meshes.iter().filter(|m| !m.normals.is_empty()).map(|m| m.triangles.len() as u64).sum();
        let primitives = [triangles, model.spheres.len() as u64, model.cones.len() as u64];
        Ok(Self::of(Packing { packed, model, primitives, smooth, extent: [lo, hi] }, build_time))
    }

    /// Opens a `.hyb` file.
    ///
    /// # Errors
    /// See [`HybError`].
    pub fn open(path: &Path) -> Result<Self, HybError> {
        Ok(Self::of(pack::open(path)?, Duration::ZERO))
    }

    fn of(packing: Packing, build_time: Duration) -> Self {
        let Packing { packed, model, primitives, smooth, extent } = packing;
        let scale = libm::ldexpf(1.0, packed.scale_log2);
        let scaled = |v: [f32; 3]| v.map(|x| x * scale);
        let lights: Vec<Light> = model
            .all_lights()
            .into_iter()
            .map(|light| Light {
                position: scaled(light.position),
                radius: light.radius * scale,
                u: scaled(light.u),
                v: scaled(light.v),
                ..light
            })
            .collect();
        let materials: Vec<Material> = model.materials.iter().map(|m| m.material).collect();
        let maps = model.maps();
        let mut prepared = Self {
            hash: 0,
            packed,
            materials,
            lights,
            maps,
            uses: model.uses,
            sky: model.sky,
            cells: model.cells,
            cuts: model.cuts,
            ambient: model.ambient,
            background: model.background,
            cameras: model.cameras,
            settings: model.settings,
            objects: model.objects,
            primitives,
            smooth,
            extent,
            warnings: model.warnings,
            build_time,
        };
        prepared.hash = prepared.hash_tables(prepared.packed.hash());
        prepared
    }

    /// Adds to a hash what nodes know of the scene besides pages.
    fn hash_tables(&self, hash: u64) -> u64 {
        let colours = [self.ambient, self.background];
        let tables: [&[u8]; 5] = [
            bytemuck::cast_slice(&self.materials),
            bytemuck::cast_slice(&self.lights),
            bytemuck::cast_slice(&colours),
            bytemuck::cast_slice(&self.maps),
            bytemuck::cast_slice(&self.uses),
        ];
        // What a scene does not have changes nothing.
        let count = if self.maps.is_empty() && self.uses.is_empty() { 3 } else { 5 };
        let hash = tables.into_iter().take(count).fold(hash, build::hash_bytes);
        if self.sky == Sky::EMPTY {
            return hash;
        }
        [bytemuck::bytes_of(&self.sky), bytemuck::cast_slice(&self.cells)].into_iter().fold(hash, build::hash_bytes)
    }

    /// What a film of `frame` is of: the same for all trees, page sizes and voxels, as the picture is.
    #[must_use]
    pub fn subject(&self, pages: &Pages<'_>, frame: &Frame) -> Subject {
        let primitives = build::hash_bytes(pages.hash_primitives(), &self.packed.scale_log2.to_le_bytes());
        let primitives = pages.hash_textures(primitives);
        Subject { scene: self.hash_tables(primitives), frame: *frame }
    }

    /// What the scene requires of a node beyond primary rays, in words (DESIGN section 2, law 6).
    #[must_use]
    pub fn requires(&self) -> Vec<&'static str> {
        let area = |l: &Light| matches!(l.kind(), LightKind::Sphere | LightKind::Rectangle);
        let [triangles, spheres, cones] = self.primitives;
        [
            (triangles > 0, "triangles"),
            (self.smooth > 0, "vertex normals"),
            (spheres > 0, "spheres"),
            (cones > 0, "cones"),
            (!self.lights.is_empty(), "shadow rays"),
            (self.lights.iter().any(area), "area lights"),
            (self.materials.iter().any(Material::mirrors), "mirrored rays"),
            (self.materials.iter().any(Material::refracts), "refracted rays"),
            (self.materials.iter().any(|m| m.flags & Material::PHYSICAL != 0), "sampled reflection"),
            (self.materials.iter().any(|m| m.flags & Material::CUTOUT != 0), "cut-outs"),
            (!self.packed.textures.is_empty(), "textures"),
            (!self.cells.is_empty(), "light from all around"),
        ]
        .into_iter()
        .filter_map(|(required, what)| required.then_some(what))
        .collect()
    }

    /// Lights and materials: how many.
    #[must_use]
    pub fn tables(&self) -> [usize; 2] {
        [self.lights.len(), self.materials.len()]
    }

    /// What is all around.
    #[must_use]
    pub fn environment(&self) -> Environment<'_> {
        Environment { sky: self.sky, cells: &self.cells, cuts: &self.cuts }
    }

    /// Bytes of the tables that every node has.
    #[must_use]
    pub fn table_bytes(&self) -> u64 {
        let maps = size_of_val(&self.maps[..]) + size_of_val(&self.uses[..]) + size_of_val(&self.packed.textures[..]);
        let tables = size_of_val(&self.materials[..]) + size_of_val(&self.lights[..]);
        (tables + maps + size_of_val(&self.cells[..]) + size_of_val(&self.cuts[..])) as u64
    }

    /// What nodes need, over opened `pages`.
    #[must_use]
    pub fn scene<'a>(&'a self, pages: &'a Pages<'a>) -> Scene<'a> {
        Scene {
            resident: pages.resident(),
            shading: hybray_shading::Scene {
                materials: &self.materials,
                lights: &self.lights,
                ambient: self.ambient,
                ray_depth_max: DEPTH,
                weight_cutoff: CUTOFF,
                distance_scale: libm::ldexpf(1.0, -self.packed.scale_log2),
                shadow_rays: spawn::shadow_rays(&self.lights),
                maps: MapTables {
                    maps: &self.maps,
                    uses: &self.uses,
                    textures: &self.packed.textures,
                    environment: self.environment(),
                },
            },
            background: self.background,
            magnitude: self.packed.magnitude,
            transmits: self.materials.iter().any(Material::transmits),
            texels: pages.texels(),
            layer: Layer::Light,
            eye: [0.0; 3],
        }
    }

    /// What is drawn: the settings of the scene, overridden by those of the caller, seen by `camera`.
    #[must_use]
    pub fn frame(&self, camera: &CameraSpec, wanted: &Settings) -> Frame {
        let own = &self.settings;
        let scale = libm::ldexpf(1.0, self.packed.scale_log2);
        let scaled = |v: [f32; 3]| v.map(|x| x * scale);
        // All around is twice as wide as high.
        let usual = if camera.projection == Projection::Spherical { [2 * SIZE[1], SIZE[1]] } else { SIZE };
        let [width, height] = wanted.size.or(own.size).or(camera.size).unwrap_or(usual);
        let filter = wanted.filter.as_deref().or(own.filter.as_deref()).and_then(Filter::parse);
        Frame {
            width,
            height,
            samples: wanted.spp.or(own.spp).unwrap_or(SAMPLES).clamp(1, u32::from(u16::MAX)) as u16,
            depth_max: wanted.depth.or(own.depth).unwrap_or(DEPTH).clamp(1, hybray_scheduler::DEPTH_MAX as u32) as u8,
            filter: filter.unwrap_or(Filter::Box) as u8,
            seed: wanted.seed.or(own.seed).unwrap_or(0),
            weight_cutoff: wanted.cutoff.or(own.cutoff).unwrap_or(CUTOFF),
            step_log2: Step::log2_for(self.exposure(wanted)),
            eye: scaled(camera.eye),
            target: scaled(camera.target),
            up: camera.up,
            fov_y_degrees: camera.fov_y_degrees,
            hither: camera.hither * scale,
            layer: Layer::Light as u8,
            half: 0,
            optics: match camera.projection {
                Projection::Perspective if camera.aperture > 0.0 => Optics {
                    radius: camera.aperture * scale,
                    focus: camera.focus_distance() * scale,
                    blades: camera.blades,
                    rotation_degrees: camera.blade_rotation_degrees,
                    ..Optics::PINHOLE
                },
                projection => Optics {
                    projection: projection as u8,
                    height: if projection == Projection::Orthographic { camera.picture_height() * scale } else { 0.0 },
                    ..Optics::PINHOLE
                },
            },
        }
    }

    /// File units in an internal one.
    #[must_use]
    pub fn unit(&self) -> f32 {
        libm::ldexpf(1.0, -self.packed.scale_log2)
    }

    /// What radiance is multiplied by before it is encoded.
    #[must_use]
    pub fn exposure(&self, wanted: &Settings) -> f32 {
        wanted.exposure.or(self.settings.exposure).unwrap_or(1.0)
    }
}
