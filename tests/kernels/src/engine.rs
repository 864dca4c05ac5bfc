//! What is compared: something that traces rays, and what it is asked.

use std::time::Instant;

use hybray_geometry::Ray;
use serde::Serialize;

/// Rays of one kind. The first is a picture's, in squares of 16 pixels; the others start where these hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The nearest hit of rays through pixels.
    Primary,
    /// Whether anything lies before a point light.
    Shadow,
    /// The nearest hit of rays with a cosine distribution around the normal.
    Bounce,
}

impl Kind {
    /// Whether any hit will do.
    pub const fn is_any(self) -> bool {
        matches!(self, Self::Shadow)
    }

    /// Whether rays that follow each other are close together.
    pub const fn is_coherent(self) -> bool {
        !matches!(self, Self::Bounce)
    }
}

/// What became of a ray. Where any hit will do, only whether `id` is [`Answer::NOTHING`] counts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Answer {
    /// Distance, in lengths of the ray's direction; infinite without a hit.
    pub t: f32,
    /// Primitive.
    pub id: u32,
}

impl Answer {
    /// `id` of no hit.
    pub const NOTHING: u32 = u32::MAX;
    /// No hit.
    pub const MISS: Self = Self { t: f32::INFINITY, id: Self::NOTHING };
    /// A hit somewhere.
    pub const BLOCKED: Self = Self { t: 0.0, id: 0 };

    /// Whether there is a hit.
    pub const fn is_hit(self) -> bool {
        self.id != Self::NOTHING
    }
}

/// What rays met, on the way to their answers.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Counts {
    /// Boxes tested; `None` where the engine does not tell.
    pub boxes: Option<u64>,
    /// Primitives tested; of ours, blocks of up to four.
    pub tests: u64,
    /// Pages entered, where there are any.
    pub pages: Option<u64>,
}

/// Something that traces rays.
pub trait Engine {
    /// As the table has it.
    fn name(&self) -> &'static str;

    /// Answers every ray; `false` if this engine has no form for such rays. This is what is timed.
    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool;

    /// What `trace` meets, if anybody knows.
    fn counts(&mut self, kind: Kind, rays: &[Ray]) -> Option<Counts>;
}

/// What a build came to, on one thread.
#[derive(Clone, Debug, Serialize)]
pub struct Built {
    /// Of what.
    pub name: String,
    /// By the clock, once for each time it was built.
    pub seconds: Vec<f64>,
    /// Bytes that remain.
    pub kept_bytes: u64,
    /// Most bytes at any time, what remains included; the model, which every builder is given, is not.
    pub peak_bytes: u64,
}

impl Built {
    /// Builds with `build` and counts what this thread allocates. Everything runs on this thread: see `main`.
    pub fn of<T>(name: &str, build: impl FnOnce() -> T) -> (T, Self) {
        let mut made = None;
        let start = Instant::now();
        let info = allocation_counter::measure(|| made = Some(build()));
        let seconds = vec![start.elapsed().as_secs_f64()];
        let kept_bytes = info.bytes_current.max(0) as u64;
        let built = Self { name: name.to_owned(), seconds, kept_bytes, peak_bytes: info.bytes_max };
        (made.expect("it was built"), built)
    }
}
