//! A model's primitives by their ids.

use super::{BuildError, TooMany};
use crate::model::Model;
use hybray_bintree::cut::{FLAT, Primitives};
use hybray_geometry::{Aabb, Cone, Sphere, Triangle, Vec3};
use hybray_scene::{Colours, Coordinates, Kind};
use hybray_shading::pack_normal;
use rayon::prelude::*;

/// A model's primitives by id, in internal units.
pub struct Source<'m> {
    model: &'m Model,
    /// First id of each mesh, then of the spheres, then of the cones, then the end.
    starts: Vec<u32>,
    scale: f32,
}

impl<'m> Source<'m> {
    /// Numbers the primitives of `model`, and chooses a power of two that brings coordinates near 1.
    ///
    /// # Errors
    /// If there are too many.
    pub fn new(model: &'m Model) -> Result<(Self, i32), BuildError> {
        let primitives = model.primitives();
        if primitives > i32::MAX as usize {
            return Err(TooMany(primitives).into());
        }
        let unscaled = Self::unscaled(model);
        let magnitude = (0..unscaled.len())
            .into_par_iter()
            .map(|id| unscaled.aabb(id).1.magnitude())
            .reduce(|| 0.0, |a, b| if a > b { a } else { b });
        let scale_log2 = scale_log2_for(magnitude);
        Ok((Self { scale: libm::ldexpf(1.0, scale_log2), ..unscaled }, scale_log2))
    }

    /// The primitives in file units; there must not be too many.
    pub(super) fn unscaled(model: &'m Model) -> Self {
        let mut starts = vec![0u32];
        let lengths = model.meshes.iter().map(|m| m.triangles.len()).chain([model.spheres.len(), model.cones.len()]);
        for n in lengths {
            starts.push(starts[starts.len() - 1] + n as u32);
        }
        Self { model, starts, scale: 1.0 }
    }

    /// How many primitives there are.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.starts[self.starts.len() - 1]
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn point(&self, p: [f32; 3]) -> Vec3 {
        Vec3::from_array(p) * self.scale
    }

    /// Which mesh (or spheres, or cones) an id falls into, and its number there.
    fn place(&self, id: u32) -> (usize, usize) {
        let part = self.starts.partition_point(|&start| start <= id) - 1;
        (part, (id - self.starts[part]) as usize)
    }

    /// Kind and box of a primitive.
    #[must_use]
    pub fn aabb(&self, id: u32) -> (Kind, Aabb) {
        let meshes = self.model.meshes.len();
        match self.place(id).0 {
            part if part < meshes => (Kind::Triangle, self.triangle(id).aabb()),
            part if part == meshes => (Kind::Sphere, self.sphere(id).aabb()),
            _ => (Kind::Cone, self.cone(id).aabb()),
        }
    }
}

/// The power of two that brings `magnitude` to at least 0.5 and below 1, or as far as one can.
pub(super) fn scale_log2_for(magnitude: f32) -> i32 {
    if magnitude > 0.0 { (-exponent(magnitude)).clamp(-126, 126) } else { 0 }
}

/// `e` with `x` in `2^(e-1)..2^e`.
fn exponent(x: f32) -> i32 {
    libm::frexpf(x).1
}

impl Primitives for Source<'_> {
    fn triangle(&self, id: u32) -> Triangle {
        let (part, number) = self.place(id);
        let mesh = &self.model.meshes[part];
        Triangle { v: mesh.triangles[number].map(|v| self.point(mesh.positions[v as usize])) }
    }

    fn sphere(&self, id: u32) -> Sphere {
        let s = &self.model.spheres[self.place(id).1];
        Sphere { centre: self.point(s.centre), radius: s.radius * self.scale }
    }

    fn cone(&self, id: u32) -> Cone {
        let c = &self.model.cones[self.place(id).1];
        Cone {
            base: self.point(c.base),
            base_radius: c.base_radius * self.scale,
            apex: self.point(c.apex),
            apex_radius: c.apex_radius * self.scale,
        }
    }

    fn material(&self, id: u32) -> u16 {
        let meshes = self.model.meshes.len();
        match self.place(id) {
            (part, _) if part < meshes => self.model.meshes[part].material,
            (part, number) if part == meshes => self.model.spheres[number].material,
            (_, number) => self.model.cones[number].material,
        }
    }

    fn normals(&self, id: u32) -> Option<[u32; 3]> {
        let (part, number) = self.place(id);
        let mesh = self.model.meshes.get(part)?;
        (!mesh.normals.is_empty()).then(|| {
            mesh.triangles[number].map(|v| {
                let n = Vec3::from_array(mesh.normals[v as usize]);
                if n.length_squared() > 0.0 { pack_normal(n / n.length()) } else { FLAT }
            })
        })
    }

    fn coordinates(&self, id: u32) -> Option<Coordinates> {
        let (part, number) = self.place(id);
        let mesh = self.model.meshes.get(part).filter(|mesh| !mesh.coordinates.is_empty())?;
        Some(mesh.triangles[number].map(|v| mesh.coordinates[v as usize]))
    }

    fn colours(&self, id: u32) -> Option<Colours> {
        let (part, number) = self.place(id);
        let mesh = self.model.meshes.get(part).filter(|mesh| !mesh.colours.is_empty())?;
        Some(mesh.triangles[number].map(|v| mesh.colours[v as usize]))
    }
}
