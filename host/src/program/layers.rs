//! Layers of a view: which pictures they take, and what becomes of their films.

use super::args::LayerChoice;
use crate::picture::{Channel, Picture, Values};
use hybray_scheduler::{Film, Step, hash_sums};
use hybray_tracer::Layer;
use hybray_wire::Frame;

/// A picture of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Light, all samples.
    Light,
    /// Light, samples with an even number of ones in their number.
    Even,
    /// Light, those with an odd number: what is missing of the former.
    Odd,
    /// What is seen first.
    Seen(Layer),
}

impl Part {
    /// The pictures that a view with these layers takes.
    pub fn of(layers: &[LayerChoice]) -> Vec<Self> {
        let has = |layer| layers.contains(&layer) || layers.contains(&LayerChoice::All);
        let light: &[Self] = if has(LayerChoice::Variance) { &[Self::Even, Self::Odd] } else { &[Self::Light] };
        let seen = [
            (LayerChoice::Albedo, Layer::Albedo),
            (LayerChoice::Normal, Layer::Normal),
            (LayerChoice::Depth, Layer::Depth),
            (LayerChoice::Id, Layer::Id),
        ];
        let seen = seen.into_iter().filter(|&(choice, _)| has(choice)).map(|(_, layer)| Self::Seen(layer));
        light.iter().copied().chain(seen).collect()
    }

    /// What its film's name is told from others by; nothing for the picture itself.
    pub fn name(self) -> Option<&'static str> {
        Some(match self {
            Self::Light | Self::Seen(Layer::Light) => return None,
            Self::Even => "even",
            Self::Odd => "odd",
            Self::Seen(Layer::Albedo) => "albedo",
            Self::Seen(Layer::Normal) => "normal",
            Self::Seen(Layer::Depth) => "depth",
            Self::Seen(Layer::Id) => "id",
        })
    }

    /// Whether it is of the light.
    pub fn is_light(self) -> bool {
        matches!(self, Self::Light | Self::Even | Self::Odd)
    }

    /// What is drawn for it.
    pub fn frame(self, light: Frame) -> Frame {
        match self {
            Self::Light => light,
            Self::Even => Frame { half: 1, ..light },
            Self::Odd => Frame { half: 2, ..light },
            // Numbers of materials have no mean: one sample, through the middle of the pixel.
            Self::Seen(Layer::Id) => {
                Frame { samples: 1, layer: Layer::Id as u8, step_log2: Step::log2_for(1.0), ..light }
            }
            Self::Seen(layer) => Frame { layer: layer as u8, step_log2: Step::log2_for(1.0), ..light },
        }
    }
}

/// A view's picture, as far as it is drawn.
#[derive(Default)]
pub(super) struct Drawing {
    pub picture: Picture,
    /// Layers that were asked for, and file units in an internal one.
    layers: Vec<LayerChoice>,
    unit: f32,
    /// The light's even half, and samples that each of its pixels has.
    even: Option<(Vec<[u64; 3]>, Vec<u32>)>,
    samples: Vec<u32>,
    variance: Option<[Vec<f32>; 3]>,
    albedo: Option<[Vec<f32>; 3]>,
    normal: Option<[Vec<f32>; 3]>,
    depth: Option<Vec<f32>>,
    id: Option<Vec<u32>>,
}

/// Samples that each pixel has: all of a finished tile, none of others.
fn samples_of(frame: &Frame, film: &Film<'_>) -> Vec<u32> {
    let mut samples = vec![0; film.sums().len()];
    let map = film.map();
    for tile in (0..map.len()).filter(|&tile| film.tile_is_finished(tile)) {
        let at = map.tile(tile);
        for y in at.y..at.y + at.height {
            let row = (y * map.width() + at.x) as usize;
            samples[row..row + at.width as usize].fill(u32::from(frame.drawn_samples()));
        }
    }
    samples
}

/// Channel by channel, what `value` makes of each pixel.
fn channels(film: &Film<'_>, value: impl Fn(f32) -> f32) -> [Vec<f32>; 3] {
    let pixels = 0..film.sums().len();
    [0, 1, 2].map(|c| pixels.clone().map(|pixel| value(film.radiance(pixel)[c])).collect())
}

/// Distance of what is not there, as Blender's renderer has it.
const FAR: f32 = 1e10;

impl Drawing {
    /// Of a view with these layers, in a scene of which an internal unit is `unit` of the file's.
    pub fn of(layers: &[LayerChoice], unit: f32) -> Self {
        Self { layers: layers.to_vec(), unit, ..Self::default() }
    }

    /// Of the next view.
    pub fn next(&self) -> Self {
        Self::of(&self.layers, self.unit)
    }

    /// Takes in a film; returns the hash of the light's where that is whole.
    pub fn take(&mut self, part: Part, frame: &Frame, film: &Film<'_>) -> Option<u64> {
        if part.is_light() {
            (self.picture.width, self.picture.height) = (frame.width, frame.height);
        }
        match part {
            Part::Light => {
                self.samples = samples_of(frame, film);
                self.picture.rgb = (0..film.sums().len()).flat_map(|pixel| film.radiance(pixel)).collect();
                return Some(film.hash());
            }
            Part::Even => {
                self.samples = samples_of(frame, film);
                self.picture.rgb = (0..film.sums().len()).flat_map(|pixel| film.radiance(pixel)).collect();
                self.even = Some((film.sums().to_vec(), self.samples.clone()));
            }
            Part::Odd => return self.take_odd(frame, film),
            Part::Seen(Layer::Albedo) => self.albedo = Some(channels(film, |c| c)),
            Part::Seen(Layer::Normal) => {
                let [mut x, mut y, mut z] = channels(film, |c| 2.0 * c - 1.0);
                // A tile that is not finished has no normals, and not those that 0 would stand for.
                for (pixel, &samples) in samples_of(frame, film).iter().enumerate() {
                    if samples == 0 {
                        (x[pixel], y[pixel], z[pixel]) = (0.0, 0.0, 0.0);
                    }
                }
                self.normal = Some([x, y, z]);
            }
            Part::Seen(Layer::Depth) => {
                let mean = |sums: &[u64; 3]| if sums[1] == 0 { f64::INFINITY } else { sums[0] as f64 / sums[1] as f64 };
                let far = |sums| Some(mean(sums) * f64::from(self.unit)).filter(|d| d.is_finite());
                self.depth = Some(film.sums().iter().map(|sums| far(sums).map_or(FAR, |d| d as f32)).collect());
            }
            Part::Seen(Layer::Id) => {
                let step = Step::new(frame.step_log2);
                self.id = Some(film.sums().iter().map(|sums| step.mean(sums[0], 1) as u32).collect());
            }
            Part::Seen(Layer::Light) => {}
        }
        None
    }

    /// The two halves together are the whole: sums of steps have no rounding.
    fn take_odd(&mut self, frame: &Frame, film: &Film<'_>) -> Option<u64> {
        let (mut sums, even) = self.even.take()?;
        let odd = samples_of(frame, film);
        let step = Step::new(frame.step_log2);
        let mut variance = [0, 1, 2].map(|_| vec![0.0; sums.len()]);
        for (pixel, (sum, more)) in sums.iter_mut().zip(film.sums()).enumerate() {
            let (a, b) = (f64::from(even[pixel]), f64::from(odd[pixel]));
            self.samples[pixel] = even[pixel] + odd[pixel];
            for c in 0..3 {
                if a * b > 0.0 {
                    let mean = |sum: u64, samples: u32| f64::from(step.mean(sum, samples as u16));
                    let apart = mean(sum[c], even[pixel]) - mean(more[c], odd[pixel]);
                    variance[c][pixel] = (apart * apart * (a * b / ((a + b) * (a + b)))) as f32;
                }
                sum[c] = sum[c].saturating_add(more[c]);
                let samples = self.samples[pixel].max(1) as u16;
                self.picture.rgb[3 * pixel + c] = step.mean(sum[c], samples);
            }
        }
        self.variance = Some(variance);
        Some(hash_sums(&sums))
    }

    /// The channels that were asked for beside red, green and blue: what was not drawn is 0 or, of depth, far.
    pub fn channels(&self) -> Vec<Channel> {
        let has = |layer| self.layers.contains(&layer) || self.layers.contains(&LayerChoice::All);
        let pixels = self.picture.rgb.len() / 3;
        let mut all = Vec::new();
        let mut put = |names: [&'static str; 3], values: &Option<[Vec<f32>; 3]>| {
            let values = values.clone().unwrap_or_else(|| [0, 1, 2].map(|_| vec![0.0; pixels]));
            all.extend(
                names.into_iter().zip(values).map(|(name, values)| Channel { name, values: Values::Float(values) }),
            );
        };
        if has(LayerChoice::Albedo) {
            put(["albedo.R", "albedo.G", "albedo.B"], &self.albedo);
        }
        if has(LayerChoice::Normal) {
            put(["normal.X", "normal.Y", "normal.Z"], &self.normal);
        }
        if has(LayerChoice::Variance) {
            put(["variance.R", "variance.G", "variance.B"], &self.variance);
        }
        if has(LayerChoice::Depth) {
            let values = self.depth.clone().unwrap_or_else(|| vec![FAR; pixels]);
            all.push(Channel { name: "Z", values: Values::Float(values) });
        }
        if has(LayerChoice::Id) {
            let values = self.id.clone().unwrap_or_else(|| vec![0; pixels]);
            all.push(Channel { name: "id", values: Values::Whole(values) });
        }
        if has(LayerChoice::Samples) {
            all.push(Channel {
                name: "samples",
                values: Values::Float(self.samples.iter().map(|&n| n as f32).collect()),
            });
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Settings;
    use crate::prepare::Prepared;
    use crate::{build, framing, import};
    use hybray_geometry::simd::Kernels;
    use hybray_native::{DispatcherAt, Farm, Watch, trace_all};
    use hybray_scheduler::{Options, Outcome, Progress};

    /// Takes in a view's films as they end.
    struct Takes<'a>(Drawing, std::slice::Iter<'a, (Part, Frame)>, Option<u64>);

    impl Watch for Takes<'_> {
        fn look(&mut self, _: Progress, _: &Film<'_>) -> bool {
            true
        }

        fn end(&mut self, _: Outcome, film: &Film<'_>) {
            let (part, frame) = self.1.next().unwrap();
            self.2 = self.0.take(*part, frame, film).or(self.2);
        }
    }

    const SEEDS: u64 = 200;
    const SAMPLES: u32 = 8;

    /// The estimate's mean over many seeds, and what the pixels vary by over the same seeds.
    fn variances(scene: &str) -> (f64, f64) {
        let mut model = import::load(scene).unwrap();
        framing::complete_with_up(&mut model, import::up_axis(scene));
        let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
        let pages = prepared.packed.open().unwrap();
        let dispatcher = DispatcherAt::Host;
        let options = Options::default();
        let farm = Farm { nodes: 1, kernels: Kernels::detect(), dispatcher, shadow_bundles: true, options };
        let (mut estimate, mut sums, mut squares) = (0.0, Vec::new(), Vec::new());
        for seed in 0..SEEDS {
            let wanted = Settings {
                size: Some([16, 12]),
                spp: Some(SAMPLES),
                seed: Some(seed),
                depth: Some(2),
                ..Settings::default()
            };
            let light = prepared.frame(&prepared.cameras[0], &wanted);
            let parts = Part::of(&[LayerChoice::Variance]).into_iter().map(|part| (part, part.frame(light)));
            let parts: Vec<_> = parts.collect();
            let frames: Vec<Frame> = parts.iter().map(|part| part.1).collect();
            let mut takes = Takes(Drawing::of(&[LayerChoice::All], 1.0), parts.iter(), None);
            trace_all(&prepared.scene(&pages), prepared.hash, &frames, &farm, &mut takes).unwrap();
            let Takes(drawing, _, film) = takes;
            if seed == 0 {
                let parts = [(Part::Light, light)];
                let mut whole = Takes(Drawing::default(), parts.iter(), None);
                trace_all(&prepared.scene(&pages), prepared.hash, &[light], &farm, &mut whole).unwrap();
                assert!(film.is_some() && film == whole.2, "the halves' film is the whole's");
                assert_eq!(drawing.picture, whole.0.picture, "and so is the picture");
                assert_eq!(drawing.samples, whole.0.samples);
            }
            let values = &drawing.picture.rgb;
            sums.resize(values.len(), 0.0);
            squares.resize(values.len(), 0.0);
            for (at, &value) in values.iter().enumerate() {
                sums[at] += f64::from(value);
                squares[at] += f64::from(value) * f64::from(value);
            }
            let variance = drawing.variance.unwrap();
            estimate += variance.iter().flatten().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
        }
        let n = SEEDS as f64;
        let found = sums.iter().zip(&squares).map(|(sum, square)| (square - sum * sum / n) / (n - 1.0));
        (estimate / n, found.sum::<f64>() / sums.len() as f64)
    }

    /// Samples are stratified over the pixel all together, and halves are not that even alone: the estimate is larger where edges
    /// cross pixels, and not smaller than what is found.
    #[test]
    fn the_estimate_is_what_pixels_vary_by_over_seeds() {
        for (scene, most) in [("cornell", 20.0), ("spd:balls:2", 20.0)] {
            let (estimate, found) = variances(scene);
            let ratio = estimate / found;
            assert!((0.9..most).contains(&ratio), "{scene}: {estimate} estimated, {found} found: {ratio}");
        }
    }

    #[test]
    fn each_layer_has_its_pictures() {
        assert_eq!(Part::of(&[]), [Part::Light]);
        assert_eq!(Part::of(&[LayerChoice::Samples]), [Part::Light]);
        assert_eq!(
            Part::of(&[LayerChoice::Depth, LayerChoice::Variance]),
            [Part::Even, Part::Odd, Part::Seen(Layer::Depth)]
        );
        assert_eq!(Part::of(&[LayerChoice::All]).len(), 6);
    }
}
