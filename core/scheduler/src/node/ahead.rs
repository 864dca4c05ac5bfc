//! The pages of the next bundle, asked for while this one is traced: the cliplist of the 1995 report (chapter 4), whose
//! objects come to the node before the rays begin.

use super::picture::Picture;
use hybray_bintree::walk::Counts;
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Bundle, Ray};
use hybray_pyraclip::wide;
use hybray_tracer::Scene;

/// Pages of a bundle that are asked for in advance at most: those nearest to the eye.
const PAGES: usize = 8;

type List = heapless::Vec<u32, PAGES>;

/// Pages of the next bundle.
#[derive(Default)]
pub(super) struct Ahead {
    /// The first tile of the next bundle.
    first: Option<u32>,
    /// Its pages.
    next: List,
    /// They have been asked for once, as far as there was room.
    pub tried: bool,
}

impl Ahead {
    /// Pages of the next bundle.
    pub fn pages(&self) -> &[u32] {
        &self.next
    }

    /// The next bundle is begun.
    pub fn begin(&mut self) {
        self.next.clear();
        self.first = None;
        self.tried = false;
    }

    /// Looks for the pages of the bundle of `count` tiles from `first` on, if that was not done.
    pub fn look(
        &mut self,
        picture: &Picture,
        scene: &Scene<'_>,
        kernels: Kernels,
        (first, count): (u32, u32),
        scratch: &mut wide::Scratch,
        counts: &mut Counts,
    ) {
        if self.first == Some(first) {
            return;
        }
        self.first = Some(first);
        self.tried = false;
        self.next.clear();
        // The corners' rays: what is looked for are pages, and a page more or less harms nothing.
        let (a, b) = (picture.map.tile(first), picture.map.tile(first + count - 1));
        let corner = |x: u32, y: u32, offset: [f32; 2]| {
            let seen = picture.camera.ray(x, y, offset);
            Ray { origin: seen.origin, direction: seen.direction, t_min: seen.t_min, t_max: f32::INFINITY }
        };
        let (right, below) = (b.x + b.width - 1, b.y + b.height - 1);
        let rays = [
            corner(a.x, a.y, [0.0, 0.0]),
            corner(right, a.y, [1.0, 0.0]),
            corner(a.x, below, [0.0, 1.0]),
            corner(right, below, [1.0, 1.0]),
        ];
        let Some(bundle) = Bundle::around(rays.iter(), scene.magnitude) else { return };
        let mut found = [(0.0, 0); PAGES];
        let used = wide::pages(kernels, &scene.resident.directory, &bundle, &mut found, scratch, counts);
        self.next.extend(found[..used].iter().map(|&(_, page)| page));
    }
}
