//! What a node knows of the scene.

use crate::layer::Layer;
use hybray_bintree::walk::Resident;
use hybray_scene::{PageView, Pages, Texels};
use hybray_shading as shading;

/// Pages, tables, and what the scene requires.
#[derive(Debug)]
pub struct Scene<'a, P: Pages + ?Sized = [PageView<'a>]> {
    /// Directory, and the pages at hand: all of them unless `P` says otherwise.
    pub resident: Resident<'a, P>,
    /// Materials, lights and limits.
    pub shading: shading::Scene<'a>,
    /// Radiance where a ray meets nothing.
    pub background: [f32; 3],
    /// Greatest absolute coordinate of the pages, internal units.
    pub magnitude: f32,
    /// Whether some material lets light through: if not, any hit ends a shadow ray, and that is cheaper to find.
    pub transmits: bool,
    /// Pages of texels, behind all others, for who has every page.
    pub texels: &'a [Texels<'a>],
    /// What pictures show.
    pub layer: Layer,
    /// Where the distances of a layer of them are from.
    pub eye: [f32; 3],
}

impl<P: Pages + ?Sized> Clone for Scene<'_, P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: Pages + ?Sized> Copy for Scene<'_, P> {}

impl<'a, P: Pages + ?Sized> Scene<'a, P> {
    /// Whether rays tell how much they stand for.
    #[must_use]
    pub fn has_textures(&self) -> bool {
        !self.shading.maps.textures.is_empty()
    }

    /// The same scene as somebody sees it who has these pages.
    #[must_use]
    pub fn at_hand<'b, Q: Pages + ?Sized>(&self, pages: &'b Q) -> Scene<'b, Q>
    where
        'a: 'b,
    {
        Scene {
            resident: Resident { directory: self.resident.directory, pages },
            shading: self.shading,
            background: self.background,
            magnitude: self.magnitude,
            transmits: self.transmits,
            texels: self.texels,
            layer: self.layer,
            eye: self.eye,
        }
    }
}
