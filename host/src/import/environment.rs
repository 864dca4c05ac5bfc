//! Surroundings: a picture of what is all around, given to a model.

use super::error::ImportError;
use super::gltf::picture_file;
use super::polygon::unit;
use super::transform::Transform;
use crate::model::Model;
use crate::texture::{Image, Texture, cells};
use hybray_shading::{Format, Sampling, Sky, Wrap};
use std::path::Path;
use std::sync::Arc;

/// Shadow rays of a hit if nobody says.
pub const SAMPLES: u16 = 16;
/// Cells at most if nobody says.
pub const CELLS: u16 = 1024;

/// How a picture surrounds a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Times the picture.
    pub colour: [f32; 3],
    /// How far it is turned, counterclockwise seen from above; degrees.
    pub rotation_degrees: f64,
    /// Where its top is; needs a length.
    pub up: [f64; 3],
    /// Shadow rays that each hit sends there; 0 for none: then it is only seen.
    pub samples: u16,
    /// Parts that light at most, 1 to [`hybray_shading::Environment::CELLS_MAX`].
    pub cells: u16,
    /// Whether the camera itself sees it.
    pub seen: bool,
}

impl Default for Surroundings {
    fn default() -> Self {
        let up = [0.0, 1.0, 0.0];
        Self { colour: [1.0; 3], rotation_degrees: 0.0, up, samples: SAMPLES, cells: CELLS, seen: true }
    }
}

impl Surroundings {
    /// Gives `model` the picture in the file `path`, in place of what was around it.
    ///
    /// # Errors
    /// If the picture cannot be read.
    pub fn give(&self, model: &mut Model, path: &Path) -> Result<(), ImportError> {
        let file = path.display().to_string();
        let remedy = "name a picture of all around (latitude and longitude): Radiance HDR or OpenEXR, or any that a texture can be";
        let (image, format) = picture_file(path).map_err(|problem| {
            let told = problem.strip_prefix(&format!("{file}: ")).unwrap_or(&problem);
            ImportError::new(&file, told, remedy)
        })?;
        let (width, height) = (u32::from(image.width), u32::from(image.height));
        if width != 2 * height {
            let told = format!(
                "{file}: {width} x {height} texels are taken to be all around, and it is not twice as wide as high"
            );
            model.warnings.push(told);
        }
        self.give_picture(model, file, image, format);
        Ok(())
    }

    /// Gives `model` a picture, in place of what was around it.
    pub fn give_picture(&self, model: &mut Model, name: String, image: Image, format: Format) {
        let lights = self.samples > 0 && self.colour.iter().any(|&c| c > 0.0);
        (model.cells, model.cuts) = if lights { cells(&image, format, self.cells.into()) } else { Default::default() };
        let wrap = [Wrap::Repeat, Wrap::Clamp];
        let texture = Texture { name, image: Arc::new(image), format, wrap, sampling: Sampling::Trilinear };
        model.sky = Sky {
            axes: self.axes(),
            colour: self.colour,
            texture: model.add_texture(texture),
            samples: if model.cells.is_empty() { 0 } else { self.samples },
            flags: if self.seen { 0 } else { Sky::HIDDEN },
        };
        debug_assert!(model.environment().is_sound(model.textures.len()));
    }

    /// The picture's middle, right and top.
    fn axes(&self) -> [[f32; 3]; 3] {
        let top = unit(self.up).unwrap_or([0.0, 1.0, 0.0]);
        // The middle is towards +X, or towards +Y where that is up or near it; made square to the top.
        let towards = if top[0].abs() > 0.999 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
        let along: f64 = (0..3).map(|i| towards[i] * top[i]).sum();
        let middle = unit([0, 1, 2].map(|i| towards[i] - along * top[i])).unwrap_or(towards);
        let turn = Transform::turned(top, self.rotation_degrees).unwrap_or(Transform::IDENTITY.turn);
        let middle = turn.map(|row| (0..3).map(|i| row[i] * middle[i]).sum::<f64>());
        let cross = |i: usize, j: usize| middle[i] * top[j] - middle[j] * top[i];
        let right = [cross(1, 2), cross(2, 0), cross(0, 1)];
        [middle, right, top].map(|axis| axis.map(|c| c as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_shading::Environment;
    use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb};

    #[test]
    fn axes_are_turned_counterclockwise_from_above() {
        let near = |found: [[f32; 3]; 3], wanted: [[f32; 3]; 3]| {
            let far = found.as_flattened().iter().zip(wanted.as_flattened()).any(|(a, b)| (a - b).abs() > 1e-6);
            assert!(!far, "{found:?} {wanted:?}");
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let minus = |v: [f32; 3]| v.map(|c| -c);
        let of = |up: [f32; 3], rotation_degrees| {
            Surroundings { up: up.map(f64::from), rotation_degrees, ..Surroundings::default() }.axes()
        };
        near(of(y, 0.0), [x, z, y]);
        near(of(y, 90.0), [minus(z), x, y]);
        near(of(z, 0.0), [x, minus(y), z]);
        near(of(z, 90.0), [y, x, z]);
        near(of(x, 0.0), [y, minus(z), x]);
        for up in [[1.0, 2.0, -0.5], [0.999, 0.01, 0.0], [-1.0, 0.0, 1e-3]] {
            let sky = Sky { axes: of(up, 33.0), ..Sky::EMPTY };
            assert!(Environment { sky, cells: &[], cuts: &[] }.is_sound(0), "{up:?}");
        }
    }

    #[test]
    fn pictures_of_light_are_given_and_others_refused() {
        let folder = std::env::temp_dir().join(format!("hybray-surroundings-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let light = ImageBuffer::from_fn(8, 4, |x, y| Rgb([x as f32, y as f32 * 10.0, 0.25]));
        for (name, format) in [("a.hdr", ImageFormat::Hdr), ("a.exr", ImageFormat::OpenExr)] {
            let path = folder.join(name);
            DynamicImage::ImageRgb32F(light.clone()).save_with_format(&path, format).unwrap();
            let mut model = Model::default();
            Surroundings::default().give(&mut model, &path).unwrap();
            assert_eq!((model.sky.texture, model.sky.samples, model.textures.len()), (0, SAMPLES, 1), "{name}");
            assert_eq!(model.textures[0].image.width, 8);
            assert!(!model.cells.is_empty() && model.environment().is_sound(1));
            assert!(model.warnings.is_empty());
            let again = &mut Model::default();
            Surroundings { samples: 0, seen: false, ..Surroundings::default() }.give(again, &path).unwrap();
            assert!(again.cells.is_empty() && again.environment().is_sound(1) && again.sky.flags == Sky::HIDDEN);
            let bytes = std::fs::read(&path).unwrap();
            for cut in 0..bytes.len() {
                std::fs::write(&path, &bytes[..cut]).unwrap();
                if let Err(error) = Surroundings::default().give(&mut Model::default(), &path) {
                    assert!(error.to_string().contains(name));
                }
            }
        }
        let path = folder.join("odd.hdr");
        DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(5, 5, Rgb([1.0; 3]))).save(&path).unwrap();
        let mut model = Model::default();
        Surroundings::default().give(&mut model, &path).unwrap();
        assert!(model.warnings[0].contains("not twice as wide as high"), "{:?}", model.warnings);
        let missing = Surroundings::default().give(&mut model, &folder.join("no.hdr")).unwrap_err().to_string();
        assert!(missing.contains("no.hdr") && missing.matches("no.hdr").count() == 1, "{missing}");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
