//! Our kernels: the walk of one ray, and bundles.

use hybray_bintree::walk::{self, Hit, Resident, Stack, Walked};
use hybray_geometry::Ray;
use hybray_geometry::simd::Kernels;
use hybray_pyraclip::{shadow, wide};
use hybray_scene::WIDTH;

use crate::engine::{Answer, Counts, Engine, Kind};

/// What both forms need.
struct Walker<'a> {
    scene: Resident<'a>,
    kernels: Kernels,
    stack: Stack,
    counts: walk::Counts,
}

impl<'a> Walker<'a> {
    fn new(scene: Resident<'a>) -> Self {
        let kernels = hybray_tests::kernels();
        Self { scene, kernels, stack: Stack::new(), counts: walk::Counts::default() }
    }

    fn told(&mut self) -> Counts {
        let walk::Counts { nodes, blocks, pages, .. } = std::mem::take(&mut self.counts);
        Counts { boxes: Some(nodes * WIDTH as u64), tests: blocks, pages: Some(pages) }
    }
}

fn answer(hit: &Hit) -> Answer {
    let candidate = hit.candidate;
    if candidate.is_hit() { Answer { t: candidate.t, id: candidate.id } } else { Answer::MISS }
}

/// One ray after another.
pub struct Single<'a> {
    name: &'static str,
    walker: Walker<'a>,
}

impl<'a> Single<'a> {
    /// Over pages that are all at hand.
    pub fn new(name: &'static str, scene: Resident<'a>) -> Self {
        Self { name, walker: Walker::new(scene) }
    }
}

impl Engine for Single<'_> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool {
        let Walker { scene, kernels, stack, counts } = &mut self.walker;
        for (ray, out) in rays.iter().zip(out) {
            *out = if !kind.is_any() {
                answer(&walk::nearest(*kernels, scene, ray, stack, counts))
            } else if walk::occluded(*kernels, scene, ray, stack, counts) {
                Answer::BLOCKED
            } else {
                Answer::MISS
            };
        }
        true
    }

    fn counts(&mut self, kind: Kind, rays: &[Ray]) -> Option<Counts> {
        self.walker.counts = walk::Counts::default();
        self.trace(kind, rays, &mut vec![Answer::MISS; rays.len()]).then(|| self.walker.told())
    }
}

/// 256 rays at a time; 64 of those to a light.
pub struct Bundles<'a> {
    walker: Walker<'a>,
    scratch: wide::Scratch,
    walked: Vec<Walked>,
}

impl<'a> Bundles<'a> {
    /// Over pages that are all at hand.
    pub fn new(scene: Resident<'a>) -> Self {
        let walked = vec![Walked { best: Hit::none(0.0), needs: None }; wide::RAYS_MAX];
        Self { walker: Walker::new(scene), scratch: wide::Scratch::new(), walked }
    }
}

impl Engine for Bundles<'_> {
    fn name(&self) -> &'static str {
        "hybray bundles"
    }

    fn trace(&mut self, kind: Kind, rays: &[Ray], out: &mut [Answer]) -> bool {
        let Walker { scene, kernels, stack, counts } = &mut self.walker;
        let (scratch, walked) = (&mut self.scratch, &mut self.walked);
        let most = if kind.is_any() { shadow::RAYS_MAX } else { wide::RAYS_MAX };
        for (rays, out) in rays.chunks(most).zip(out.chunks_mut(most)) {
            if kind.is_any() {
                shadow::trace::<true, _>(*kernels, scene, rays, walked, scratch, stack, counts);
            } else {
                wide::nearest(*kernels, scene, rays, walked, scratch, stack, counts);
            }
            for (out, walked) in out.iter_mut().zip(&*walked) {
                *out = answer(&walked.best);
            }
        }
        true
    }

    fn counts(&mut self, kind: Kind, rays: &[Ray]) -> Option<Counts> {
        self.walker.counts = walk::Counts::default();
        self.trace(kind, rays, &mut vec![Answer::MISS; rays.len()]).then(|| self.walker.told())
    }
}
