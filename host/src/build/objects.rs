//! Primitives one after the other, for builds that do not hold them all.

use super::Source;
use crate::model::Model;
use bytemuck::{Pod, Zeroable};
use hybray_bintree::cut::Primitives;
use hybray_geometry::{Aabb, Cone, Sphere, Triangle, Vec3};
use hybray_scene::{Colours, Coordinates, Header, Kind};

/// A primitive, in file units or the internal unit: 92 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Object {
    /// Corners of a triangle; centre and radius of a sphere; base, its radius, apex, its radius of a cone.
    shape: [f32; 9],
    /// Packed vertex normals, if `form` says so.
    normals: [u32; 3],
    /// Of a triangle, if `attributes` says so.
    coordinates: Coordinates,
    colours: Colours,
    id: u32,
    material: u16,
    /// 0 a triangle, 1 a triangle with normals, 2 a sphere, 3 a cone.
    form: u8,
    /// [`Header::attributes`] of a triangle.
    attributes: u8,
}

const _: () = assert!(size_of::<Object>() == 92);

const TRIANGLE: u8 = 0;
const SMOOTH: u8 = 1;
const SPHERE: u8 = 2;
const CONE: u8 = 3;

impl Object {
    /// A triangle.
    #[must_use]
    pub fn triangle(id: u32, material: u16, corners: [[f32; 3]; 3], normals: Option<[u32; 3]>) -> Self {
        let form = if normals.is_some() { SMOOTH } else { TRIANGLE };
        let normals = normals.unwrap_or([0; 3]);
        Self { shape: bytemuck::cast(corners), normals, id, material, form, ..Zeroable::zeroed() }
    }

    /// The primitive `id` of a source.
    fn of(source: &Source<'_>, id: u32) -> Self {
        let material = source.material(id);
        let mut shape = [0.0; 9];
        let form = match source.aabb(id).0 {
            Kind::Triangle => {
                let corners = source.triangle(id).v.map(|v| v.to_array());
                return Self {
                    coordinates: source.coordinates(id).unwrap_or_default(),
                    colours: source.colours(id).unwrap_or_default(),
                    attributes: source.attributes(id) as u8,
                    ..Self::triangle(id, material, corners, source.normals(id))
                };
            }
            Kind::Sphere => {
                let s = source.sphere(id);
                shape[..3].copy_from_slice(&s.centre.to_array());
                shape[3] = s.radius;
                SPHERE
            }
            Kind::Cone => {
                let c = source.cone(id);
                shape[..3].copy_from_slice(&c.base.to_array());
                shape[3] = c.base_radius;
                shape[4..7].copy_from_slice(&c.apex.to_array());
                shape[7] = c.apex_radius;
                CONE
            }
        };
        Self { shape, id, material, form, ..Zeroable::zeroed() }
    }

    /// All lengths times a power of two.
    #[must_use]
    pub(super) fn scaled(self, scale: f32) -> Self {
        Self { shape: self.shape.map(|x| x * scale), ..self }
    }

    fn at(&self, first: usize) -> Vec3 {
        Vec3::new(self.shape[first], self.shape[first + 1], self.shape[first + 2])
    }

    fn as_triangle(&self) -> Triangle {
        Triangle { v: [self.at(0), self.at(3), self.at(6)] }
    }

    fn as_sphere(&self) -> Sphere {
        Sphere { centre: self.at(0), radius: self.shape[3] }
    }

    fn as_cone(&self) -> Cone {
        Cone { base: self.at(0), base_radius: self.shape[3], apex: self.at(4), apex_radius: self.shape[7] }
    }

    /// Kind and box.
    #[must_use]
    pub fn aabb(&self) -> (Kind, Aabb) {
        match self.form {
            SPHERE => (Kind::Sphere, self.as_sphere().aabb()),
            CONE => (Kind::Cone, self.as_cone().aabb()),
            _ => (Kind::Triangle, self.as_triangle().aabb()),
        }
    }

    /// Whether it is a triangle with vertex normals.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        self.form == SMOOTH
    }
}

/// Objects as primitives: numbers are places in the slice, ids those of the scene.
pub(super) struct Held<'a>(pub &'a [Object]);

impl Primitives for Held<'_> {
    fn id(&self, number: u32) -> u32 {
        self.0[number as usize].id
    }
    fn triangle(&self, number: u32) -> Triangle {
        self.0[number as usize].as_triangle()
    }
    fn sphere(&self, number: u32) -> Sphere {
        self.0[number as usize].as_sphere()
    }
    fn cone(&self, number: u32) -> Cone {
        self.0[number as usize].as_cone()
    }
    fn material(&self, number: u32) -> u16 {
        self.0[number as usize].material
    }
    fn normals(&self, number: u32) -> Option<[u32; 3]> {
        let object = &self.0[number as usize];
        object.is_smooth().then_some(object.normals)
    }
    fn coordinates(&self, number: u32) -> Option<Coordinates> {
        let object = &self.0[number as usize];
        (u32::from(object.attributes) & Header::COORDINATES != 0).then_some(object.coordinates)
    }
    fn colours(&self, number: u32) -> Option<Colours> {
        let object = &self.0[number as usize];
        (u32::from(object.attributes) & Header::COLOURS != 0).then_some(object.colours)
    }
}

/// A scene whose primitives can be told twice, in file units, in the order of their ids from 0.
pub trait Objects {
    /// How many there are.
    fn len(&self) -> u64;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Tells each.
    ///
    /// # Errors
    /// That of `tell`.
    fn each<E>(&self, tell: impl FnMut(&Object) -> Result<(), E>) -> Result<(), E>;
}

impl Objects for Model {
    fn len(&self) -> u64 {
        self.primitives() as u64
    }

    fn each<E>(&self, mut tell: impl FnMut(&Object) -> Result<(), E>) -> Result<(), E> {
        let source = Source::unscaled(self);
        (0..source.len()).try_for_each(|id| tell(&Object::of(&source, id)))
    }
}
