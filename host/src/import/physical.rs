//! Metallic-roughness materials, as glTF and the newer MTL say them.

use hybray_shading::{Maps, Material};

/// All but `ior`, `emission` and `absorption` are 0 to 1.
pub(super) struct Physical {
    /// Linear.
    pub base: [f32; 3],
    pub metal: f32,
    pub rough: f32,
    /// Share of what is no metal that light is refracted by.
    pub through: f32,
    pub ior: f32,
    /// How much is there; the rest of the light goes straight on.
    pub seen: f32,
    pub emission: [f32; 3],
    /// Of a file unit inside: what is left of light is e to minus this.
    pub absorption: [f32; 3],
}

impl Physical {
    /// The material, and what it takes from textures: nothing yet. What lets light through as glass is wholly there.
    pub(super) fn material(&self) -> (Material, Maps) {
        let Self { base, metal, rough, through, ior, seen, emission, absorption } = *self;
        let blends = seen < 1.0 && through == 0.0;
        let material = Material {
            diffuse: base,
            ambient: absorption,
            emission,
            mirror: [metal; 3],
            transmission: [through; 3],
            exponent: rough,
            ior: if ior > 0.0 { ior } else { 1.0 },
            flags: Material::PHYSICAL | if blends { Material::BLEND | Material::DETAIL } else { 0 },
            ..Material::MATT
        };
        (material, Maps { coverage: if blends { seen } else { 1.0 }, ..Maps::EMPTY })
    }
}
