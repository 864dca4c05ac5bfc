//! What a node knows of the scene.

use hybray_bintree::walk::Resident;
use hybray_shading as shading;

/// Pages, tables, and what the scene requires.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// Directory and pages.
    pub resident: Resident<'a>,
    /// Materials, lights and limits.
    pub shading: shading::Scene<'a>,
    /// Radiance where a ray meets nothing.
    pub background: [f32; 3],
    /// Greatest absolute coordinate of the pages, internal units.
    pub magnitude: f32,
    /// Whether some material lets light through: if not, any hit ends a shadow ray, and that is cheaper to find.
    pub transmits: bool,
}
