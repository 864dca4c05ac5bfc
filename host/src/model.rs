//! What an importer makes of a file: primitives, materials, lights and cameras, before any tree is built.
//!
//! Coordinates are the file's own, in `f32`. Primitive ids follow from the order here: the triangles of each mesh in
//! turn, then spheres, then cones.

use crate::texture::Texture;
use hybray_shading::{Cell, Cut, Environment, Light, LightKind, Map, Maps, Material, Projection, Sky};

/// Triangles that share a material and whether they have vertex normals.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// What the file calls it; used in messages.
    pub name: String,
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Empty, or one unit normal for each vertex.
    pub normals: Vec<[f32; 3]>,
    /// Empty, or texture coordinates of each vertex: v counts from a picture's top down.
    pub coordinates: Vec<[f32; 2]>,
    /// Empty, or a colour of each vertex: red, green and blue encoded as sRGB, and coverage.
    pub colours: Vec<[u8; 4]>,
    /// Vertex indices, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Model::materials`].
    pub material: u16,
}

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre.
    pub centre: [f32; 3],
    /// Radius, more than 0.
    pub radius: f32,
    /// Index into [`Model::materials`].
    pub material: u16,
}

/// NFF's open cone or cylinder (equal radii): no caps, seen from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Centre of the base.
    pub base: [f32; 3],
    /// Radius there, 0 or more.
    pub base_radius: f32,
    /// Centre of the other end, not equal to `base`.
    pub apex: [f32; 3],
    /// Radius there, 0 or more; not both radii are 0.
    pub apex_radius: f32,
    /// Index into [`Model::materials`].
    pub material: u16,
}

/// A material with the name that its file gives it.
#[derive(Clone, Debug)]
pub struct NamedMaterial {
    /// Name, or empty.
    pub name: String,
    /// What a node holds of it.
    pub material: Material,
    /// What it takes from textures; looked at if it has [`Material::DETAIL`].
    pub maps: Maps,
}

impl Default for NamedMaterial {
    fn default() -> Self {
        Self { name: String::new(), material: Material::default(), maps: Maps::EMPTY }
    }
}

/// A camera. Lengths are file units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraSpec {
    /// For `--camera NAME`.
    pub name: String,
    /// Where the eye is.
    pub eye: [f32; 3],
    /// What it looks at; not equal to `eye`.
    pub target: [f32; 3],
    /// Up, not along the view.
    pub up: [f32; 3],
    /// Angle between the top and the bottom edge of the picture, degrees, more than 0 and less than 180. If the camera is not
    /// perspective, that of the perspective one in its place.
    pub fov_y_degrees: f32,
    /// Rays start at this distance along the view axis (NFF's hither); 0 to start at the eye.
    pub hither: f32,
    /// Picture size that the file asks for, in pixels.
    pub size: Option<[u32; 2]>,
    /// How pixels become rays.
    pub projection: Projection,
    /// What an orthographic camera's picture shows from top to bottom, more than 0; if it is missing, as much as `fov_y_degrees`
    /// does at the target.
    pub height: Option<f32>,
    /// Radius of a perspective camera's lens; 0 for none: everything is sharp.
    pub aperture: f32,
    /// Distance along the view axis of what is sharp, more than 0; if it is missing, that of the target.
    pub focus: Option<f32>,
    /// Sides of the lens's opening, 3 to 16; 0 if it is round.
    pub blades: u8,
    /// How far the opening is turned counterclockwise, degrees.
    pub blade_rotation_degrees: f32,
}

impl CameraSpec {
    /// From the eye to the target.
    fn distance(&self) -> f64 {
        let square = |i: usize| (f64::from(self.target[i]) - f64::from(self.eye[i])).powi(2);
        (square(0) + square(1) + square(2)).sqrt()
    }

    /// What an orthographic camera's picture shows from top to bottom.
    #[must_use]
    pub fn picture_height(&self) -> f32 {
        let half = libm::tan(f64::from(self.fov_y_degrees) * (std::f64::consts::PI / 360.0));
        self.height.unwrap_or((2.0 * half * self.distance()) as f32)
    }

    /// Distance along the view axis of what is sharp.
    #[must_use]
    pub fn focus_distance(&self) -> f32 {
        self.focus.unwrap_or(self.distance() as f32)
    }
}

/// Objects as the file counts them: one polygon may become several triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Objects {
    /// Polygons (triangles included) and polygonal patches.
    pub polygons: u64,
    /// Spheres.
    pub spheres: u64,
    /// Cones with unequal radii.
    pub cones: u64,
    /// Cones with equal radii.
    pub cylinders: u64,
}

/// Settings that a scene file may give; the command line goes before them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// Picture size, pixels.
    pub size: Option<[u32; 2]>,
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// Ray depth: 1 is primary rays and their shadows only.
    pub depth: Option<u32>,
    /// A ray whose weight is below this in every channel is not traced.
    pub cutoff: Option<f32>,
    /// Pixel filter: `box`, `tent` or `gaussian`.
    pub filter: Option<String>,
    /// Radiance is multiplied by this before it is encoded.
    pub exposure: Option<f32>,
    /// Seed of every random choice.
    pub seed: Option<u64>,
}

/// A scene as read, before anything is built from it.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Triangles.
    pub meshes: Vec<Mesh>,
    /// Spheres.
    pub spheres: Vec<Sphere>,
    /// Cones and cylinders.
    pub cones: Vec<Cone>,
    /// At least one if there are primitives; at most 65,535.
    pub materials: Vec<NamedMaterial>,
    /// Pictures on surfaces.
    pub textures: Vec<Texture>,
    /// How materials use them.
    pub uses: Vec<Map>,
    /// Lights; empty if the file has none (a default is then made).
    pub lights: Vec<Light>,
    /// Cameras; empty if the file has none (the model is then framed).
    pub cameras: Vec<CameraSpec>,
    /// Radiance where a ray meets nothing.
    pub background: [f32; 3],
    /// Ambient light, multiplied by each material's `ambient`.
    pub ambient: [f32; 3],
    /// What is all around, if anything.
    pub sky: Sky,
    /// What of it lights; empty if nothing does.
    pub cells: Vec<Cell>,
    /// Between them.
    pub cuts: Vec<Cut>,
    /// Settings that the file gives.
    pub settings: Settings,
    /// What the file counts.
    pub objects: Objects,
    /// What could not be honoured, each one line for a person.
    pub warnings: Vec<String>,
}

impl Model {
    /// Triangles, spheres and cones together.
    #[must_use]
    pub fn primitives(&self) -> usize {
        self.meshes.iter().map(|m| m.triangles.len()).sum::<usize>() + self.spheres.len() + self.cones.len()
    }

    /// What is all around.
    #[must_use]
    pub fn environment(&self) -> Environment<'_> {
        Environment { sky: self.sky, cells: &self.cells, cuts: &self.cuts }
    }

    /// All lights: those of the table, and what is all around.
    #[must_use]
    pub fn all_lights(&self) -> Vec<Light> {
        let Sky { samples, colour, .. } = self.sky;
        let around = Light { kind: LightKind::Environment as u32, samples, colour, ..Light::default() };
        self.lights.iter().copied().chain((samples > 0).then_some(around)).collect()
    }

    /// What each material takes from textures; empty if none takes anything.
    #[must_use]
    pub fn maps(&self) -> Vec<Maps> {
        let detailed = self.materials.iter().any(|m| m.material.flags & Material::DETAIL != 0);
        self.materials.iter().filter(|_| detailed).map(|m| m.maps).collect()
    }

    /// Adds a texture and returns its index; one that shows the same is used again.
    pub fn add_texture(&mut self, texture: Texture) -> u32 {
        let found = self.textures.iter().position(|t| t.is_same(&texture));
        found.unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        }) as u32
    }

    /// Adds a use of a texture, and returns its index; an equal one is used again. [`Maps::NONE`] if there are too many.
    pub fn add_use(&mut self, map: Map) -> u16 {
        let index = self.uses.iter().position(|m| *m == map).unwrap_or_else(|| {
            self.uses.push(map);
            self.uses.len() - 1
        });
        u16::try_from(index).unwrap_or(Maps::NONE)
    }

    /// Adds a material and returns its index; an equal one of the same name is used again.
    ///
    /// # Panics
    /// If there are 65,535 already: importers check first.
    pub fn add_material(&mut self, name: &str, material: Material) -> u16 {
        self.add_mapped_material(name, material, Maps::EMPTY)
    }

    /// The same with what it takes from textures.
    ///
    /// # Panics
    /// As [`Model::add_material`].
    pub fn add_mapped_material(&mut self, name: &str, material: Material, maps: Maps) -> u16 {
        let same = |m: &NamedMaterial| m.name == name && m.material == material && m.maps == maps;
        let index = self.materials.iter().rposition(same).unwrap_or_else(|| {
            self.materials.push(NamedMaterial { name: name.to_owned(), material, maps });
            self.materials.len() - 1
        });
        u16::try_from(index).expect("at most 65,535 materials")
    }
}
