//! glTF's materials and textures.

use super::super::error::{ImportError, quote};
use super::super::physical::Physical;
use super::super::{mtl, open};
use super::{AlphaMode, Reader};
use crate::texture::{self, Image, Texture};
use gltf::texture::{MagFilter, MinFilter, TextureTransform, WrappingMode};
use hybray_shading::{Format, Map, Maps, Material, Sampling, Wrap};
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

/// Bytes of a picture's file at most.
const FILE_BYTES_MAX: u64 = 1 << 30;

/// A material of the file where it stands in the model.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub index: u16,
    /// Which of a mesh's texture coordinates it uses.
    pub set: Option<u32>,
}

/// A use of a texture as glTF says it in three ways.
struct Use<'a> {
    texture: gltf::Texture<'a>,
    set: u32,
    transform: Option<TextureTransform<'a>>,
    strength: f32,
}

impl<'a> Use<'a> {
    fn of(info: gltf::texture::Info<'a>) -> Self {
        let transform = info.texture_transform();
        let set = transform.as_ref().and_then(TextureTransform::tex_coord).unwrap_or(info.tex_coord());
        Self { texture: info.texture(), set, transform, strength: 1.0 }
    }
}

impl Reader<'_> {
    /// Where a primitive's material stands in the model; `None` if nothing of it is seen.
    pub(super) fn material(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        coloured: bool,
    ) -> Result<Option<Placed>, ImportError> {
        let from = primitive.material();
        let pbr = from.pbr_metallic_roughness();
        let is_cut = from.alpha_mode() == AlphaMode::Mask
            && pbr.base_color_texture().is_none()
            && !coloured
            && pbr.base_color_factor()[3] < from.alpha_cutoff().unwrap_or(0.5);
        if is_cut {
            return Ok(None);
        }
        let key = (from.index(), coloured);
        if let Some(&placed) = self.materials.get(&key) {
            return Ok(Some(placed));
        }
        if from.transmission().is_some_and(|t| t.transmission_texture().is_some()) {
            self.warn("textures of transmission are not used");
        }
        if self.model.materials.len() >= usize::from(u16::MAX) {
            return Err(self.error("more than 65,535 materials", "use fewer materials"));
        }
        let name = from
            .name()
            .map_or_else(|| from.index().map_or("default".into(), |i| format!("material {i}")), str::to_owned);
        let (mut material, mut maps) =
            if from.index().is_some() { translated(&from) } else { (mtl::DEFAULT, Maps::EMPTY) };
        let unlit = from.unlit();
        let base = if unlit { Maps::EMISSION } else { Maps::BASE };
        let normal = from.normal_texture().map(|info| {
            let strength = info.scale();
            let transform = info.extension_value("KHR_texture_transform").and_then(transform_of);
            (Use { texture: info.texture(), set: info.tex_coord(), transform: None, strength }, transform)
        });
        let uses = [
            (base, pbr.base_color_texture().map(|i| (Use::of(i), None)), Format::Srgb),
            (Maps::EMISSION, from.emissive_texture().filter(|_| !unlit).map(|i| (Use::of(i), None)), Format::Srgb),
            (
                Maps::SURFACE,
                pbr.metallic_roughness_texture().filter(|_| !unlit).map(|i| (Use::of(i), None)),
                Format::Linear,
            ),
            (Maps::NORMAL, normal.filter(|_| !unlit), Format::Linear),
        ];
        let mut set = None;
        for (which, wanted, format) in uses {
            let Some((mut wanted, affine)) = wanted else { continue };
            if set.is_some_and(|set| set != wanted.set) {
                self.warn("textures by other coordinates than the first one's are not used");
                continue;
            }
            let Some(texture) = self.texture(&wanted.texture, format) else { continue };
            set = Some(wanted.set);
            let transform = affine.unwrap_or_else(|| matrix(wanted.transform.take().as_ref()));
            maps.maps[which] = self.model.add_use(Map { texture, transform, strength: wanted.strength });
        }
        if coloured || maps.count() > 0 {
            material.flags |= Material::DETAIL;
        }
        if from.index().is_some() && !from.double_sided() && !material.refracts() {
            material.flags |= Material::SINGLE_SIDED;
        }
        let index = self.model.add_mapped_material(&name, material, maps);
        let placed = Placed { index, set };
        self.materials.insert(key, placed);
        Ok(Some(placed))
    }

    /// The index of a texture; `None`, with a warning, if it cannot be used.
    fn texture(&mut self, from: &gltf::Texture<'_>, format: Format) -> Option<u32> {
        let (image, is_light) = self.image(&from.source())?;
        let sampler = from.sampler();
        let wrap = |mode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        let sampling = match (sampler.mag_filter(), sampler.min_filter()) {
            (Some(MagFilter::Nearest), _) => Sampling::Nearest,
            (_, Some(MinFilter::Nearest | MinFilter::Linear)) => Sampling::Bilinear,
            _ => Sampling::Trilinear,
        };
        Some(self.model.add_texture(Texture {
            name: from.name().map_or_else(|| format!("texture {}", from.index()), str::to_owned),
            image,
            format: if is_light { Format::SharedExponent } else { format },
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
            sampling,
        }))
    }

    /// A picture of the file, and whether it is one of light.
    fn image(&mut self, from: &gltf::Image<'_>) -> Option<(Arc<Image>, bool)> {
        if let Some(known) = self.images.get(&from.index()) {
            return known.clone();
        }
        let found = match self.picture(from) {
            Ok((image, format)) => Some((Arc::new(image), format == Format::SharedExponent)),
            Err(problem) => {
                self.warn(&format!("image {} is not used: {problem}", from.index()));
                None
            }
        };
        self.images.insert(from.index(), found.clone());
        found
    }

    fn picture(&self, from: &gltf::Image<'_>) -> Result<(Image, Format), String> {
        let decoded = |bytes: &[u8], extension| texture::decode(bytes, extension).map_err(|e| e.to_string());
        match from.source() {
            gltf::image::Source::View { view, .. } => {
                let end = view.offset().checked_add(view.length());
                let buffer = self.buffers.get(view.buffer().index());
                let bytes = buffer.and_then(|buffer| buffer.get(view.offset()..end?));
                decoded(bytes.ok_or("it does not lie within its buffer")?, None)
            }
            gltf::image::Source::Uri { uri, .. } if uri.starts_with("data:") => {
                let url = data_url::DataUrl::process(uri).map_err(|e| format!("no data URI ({e:?})"))?;
                decoded(&url.decode_to_vec().map_err(|e| format!("no data URI ({e:?})"))?.0, None)
            }
            gltf::image::Source::Uri { uri, .. } if uri.contains("://") => {
                Err(format!("{} is not on this machine", quote(uri)))
            }
            gltf::image::Source::Uri { uri, .. } => {
                let name = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
                picture_file(&self.folder.join(&*name))
            }
        }
    }
}

/// The picture in a file.
pub(in crate::import) fn picture_file(path: &Path) -> Result<(Image, Format), String> {
    let told = |what: String| format!("{}: {what}", path.display());
    let reader = open(path).map_err(|e| e.into_error(&path.display().to_string()).to_string())?;
    let mut bytes = Vec::new();
    reader.take(FILE_BYTES_MAX).read_to_end(&mut bytes).map_err(|e| told(format!("it cannot be read ({e})")))?;
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    texture::decode(&bytes, extension.as_deref()).map_err(|e| told(e.to_string()))
}

/// `KHR_texture_transform`: scaled, then turned, then moved.
fn affine(offset: [f32; 2], turn: f32, scale: [f32; 2]) -> [f32; 6] {
    let (sin, cos) = libm::sincosf(turn);
    let [x, y] = scale;
    [cos * x, sin * y, offset[0], -sin * x, cos * y, offset[1]]
}

fn matrix(transform: Option<&TextureTransform<'_>>) -> [f32; 6] {
    transform.map_or(IDENTITY, |t| affine(t.offset(), t.rotation(), t.scale()))
}

/// Texture coordinates as they are.
const IDENTITY: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// The same from JSON, where the crate does not know it.
fn transform_of(value: &serde_json::Value) -> Option<[f32; 6]> {
    let numbers = |key: &str, otherwise: f32| {
        let list = value.get(key).and_then(serde_json::Value::as_array);
        let at = |i: usize| list.and_then(|l| l.get(i)?.as_f64()).map_or(otherwise, |v| v as f32);
        [at(0), at(1)]
    };
    let turn = value.get("rotation").and_then(serde_json::Value::as_f64).unwrap_or(0.0) as f32;
    Some(affine(numbers("offset", 0.0), turn, numbers("scale", 1.0)))
}

/// A material without its textures.
fn translated(from: &gltf::Material<'_>) -> (Material, Maps) {
    let pbr = from.pbr_metallic_roughness();
    let [r, g, b, alpha] = pbr.base_color_factor();
    let base = [r, g, b];
    let (mode, cutoff) = (from.alpha_mode(), from.alpha_cutoff().unwrap_or(0.5));
    let through = from.transmission().map_or(0.0, |t| t.transmission_factor());
    let absorption = from.volume().map_or([0.0; 3], |volume| {
        let distance = volume.attenuation_distance();
        volume.attenuation_color().map(|left| {
            let within = left.clamp(1e-6, 1.0);
            if distance > 0.0 && distance.is_finite() { -libm::logf(within) / distance } else { 0.0 }
        })
    });
    let (mut material, mut maps) = Physical {
        base,
        metal: pbr.metallic_factor(),
        rough: pbr.roughness_factor(),
        through,
        ior: from.ior().unwrap_or(1.5),
        seen: 1.0,
        emission: from.emissive_factor().map(|c| c * from.emissive_strength().unwrap_or(1.0)),
        absorption,
    }
    .material();
    if from.unlit() {
        let black = [0.0; 3];
        material = Material { diffuse: black, ambient: black, emission: base, ..Material::MATT };
    }
    match mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask => {
            material.flags |= Material::CUTOUT | Material::DETAIL;
            maps.cutoff = cutoff;
        }
        AlphaMode::Blend if through == 0.0 => material.flags |= Material::BLEND | Material::DETAIL,
        AlphaMode::Blend => {}
    }
    if mode != AlphaMode::Opaque {
        maps.coverage = alpha.clamp(0.0, 1.0);
    }
    (material, maps)
}
