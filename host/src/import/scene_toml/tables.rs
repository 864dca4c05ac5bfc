//! The tables of a scene file, as TOML has them: every value is still to be checked.

use super::super::toml_values::{Colour, Maybe};
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub(super) settings: Option<SettingsTable>,
    pub(super) background: Option<BackgroundTable>,
    pub(super) environment: Option<Spanned<EnvironmentTable>>,
    #[serde(default)]
    pub(super) camera: Vec<Spanned<CameraTable>>,
    #[serde(default)]
    pub(super) light: Vec<Spanned<LightTable>>,
    #[serde(default)]
    pub(super) material: BTreeMap<String, MaterialTable>,
    #[serde(default)]
    pub(super) include: Vec<Spanned<IncludeTable>>,
    #[serde(default)]
    pub(super) sphere: Vec<Spanned<SphereTable>>,
    #[serde(default)]
    pub(super) cone: Vec<Spanned<ConeTable>>,
    #[serde(default)]
    pub(super) triangle: Vec<Spanned<TriangleTable>>,
}

/// A file of cameras alone.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CamerasFile {
    #[serde(default)]
    pub(super) camera: Vec<Spanned<CameraTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SettingsTable {
    pub(super) size: Maybe<Vec<i64>>,
    pub(super) spp: Maybe<i64>,
    pub(super) depth: Maybe<i64>,
    pub(super) cutoff: Maybe<f64>,
    pub(super) filter: Maybe<String>,
    pub(super) exposure: Maybe<f64>,
    pub(super) seed: Maybe<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BackgroundTable {
    pub(super) colour: Maybe<Colour>,
    pub(super) ambient: Maybe<Colour>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EnvironmentTable {
    pub(super) map: Maybe<String>,
    pub(super) colour: Maybe<Colour>,
    pub(super) strength: Maybe<f64>,
    pub(super) rotation: Maybe<f64>,
    pub(super) up: Maybe<Vec<f64>>,
    pub(super) samples: Maybe<i64>,
    pub(super) cells: Maybe<i64>,
    pub(super) seen: Maybe<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    pub(super) name: Maybe<String>,
    pub(super) eye: Maybe<Vec<f64>>,
    pub(super) target: Maybe<Vec<f64>>,
    pub(super) up: Maybe<Vec<f64>>,
    pub(super) fov: Maybe<f64>,
    pub(super) hither: Maybe<f64>,
    pub(super) size: Maybe<Vec<i64>>,
    pub(super) projection: Maybe<String>,
    pub(super) height: Maybe<f64>,
    pub(super) aperture: Maybe<f64>,
    pub(super) focus: Maybe<f64>,
    pub(super) blades: Maybe<i64>,
    pub(super) blade_rotation: Maybe<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightTable {
    pub(super) kind: Maybe<String>,
    pub(super) position: Maybe<Vec<f64>>,
    pub(super) axis: Maybe<Vec<f64>>,
    pub(super) angles: Maybe<Vec<f64>>,
    pub(super) radius: Maybe<f64>,
    pub(super) u: Maybe<Vec<f64>>,
    pub(super) v: Maybe<Vec<f64>>,
    pub(super) colour: Maybe<Colour>,
    pub(super) strength: Maybe<f64>,
    pub(super) falloff: Maybe<bool>,
    pub(super) samples: Maybe<i64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialTable {
    pub(super) diffuse: Maybe<Colour>,
    pub(super) ambient: Maybe<Colour>,
    pub(super) emission: Maybe<Colour>,
    pub(super) specular: Maybe<Colour>,
    pub(super) exponent: Maybe<f64>,
    pub(super) highlight: Maybe<String>,
    pub(super) mirror: Maybe<Colour>,
    pub(super) transmission: Maybe<Colour>,
    pub(super) ior: Maybe<f64>,
    pub(super) fresnel: Maybe<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct IncludeTable {
    pub(super) file: Maybe<String>,
    pub(super) translate: Maybe<Vec<f64>>,
    pub(super) rotate: Maybe<RotateTable>,
    pub(super) scale: Maybe<f64>,
    pub(super) material: Maybe<String>,
    pub(super) materials: Maybe<BTreeMap<String, Spanned<String>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RotateTable {
    pub(super) axis: Maybe<Vec<f64>>,
    pub(super) degrees: Maybe<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereTable {
    pub(super) centre: Maybe<Vec<f64>>,
    pub(super) radius: Maybe<f64>,
    pub(super) material: Maybe<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConeTable {
    pub(super) base: Maybe<Vec<f64>>,
    pub(super) base_radius: Maybe<f64>,
    pub(super) apex: Maybe<Vec<f64>>,
    pub(super) apex_radius: Maybe<f64>,
    pub(super) material: Maybe<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TriangleTable {
    pub(super) a: Maybe<Vec<f64>>,
    pub(super) b: Maybe<Vec<f64>>,
    pub(super) c: Maybe<Vec<f64>>,
    pub(super) normals: Maybe<Vec<Vec<f64>>>,
    pub(super) material: Maybe<String>,
}
