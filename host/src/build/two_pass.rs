//! A build that never holds the scene both as objects and as pages (report, chapter 4: bounds in a first pass, distribution
//! in a second).
//!
//! The first pass finds the scale, and a sample for the planes between voxels; the second writes each object to the
//! voxels that it reaches into, in a file; then the source is dropped, and voxel by voxel is read, built, and told as
//! pages. What is held at once is the largest voxel (about 92 + 32 bytes an object, and its pages), the directory, and
//! buffers of 32 MiB at most.
//!
//! The pages are those of [`super::build`] with the same settings, byte for byte.

use super::objects::{Held, Object, Objects};
use super::packed::{Assembler, Index};
use super::source::scale_log2_for;
use super::spill::Spill;
use super::tree::VoxelTree;
use super::{BuildError, SAMPLE_MAX, Settings, TooMany};
use crate::partition::{Plan, Step, Voxels};
use hybray_bintree::Item;
use hybray_geometry::Aabb;
use hybray_scene::{Kind, Line};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Primitives of a voxel when nobody says how many voxels there should be.
const VOXEL_OBJECTS: u64 = 1 << 17;

/// What the first pass finds.
pub(crate) struct Survey {
    /// Triangles, spheres and cones.
    pub primitives: [u64; 3],
    /// Triangles with vertex normals.
    pub smooth: u64,
    /// File units times 2 to this power are internal units.
    pub scale_log2: i32,
    /// The box of everything, file units.
    pub bounds: Aabb,
    sample: Vec<Object>,
}

impl Survey {
    fn new(objects: &impl Objects, stop: &Stop<'_>) -> Result<Self, BuildError> {
        let count = usize::try_from(objects.len()).unwrap_or(usize::MAX);
        if count > i32::MAX as usize {
            return Err(TooMany(count).into());
        }
        let stride = count.div_ceil(SAMPLE_MAX).max(1) as u64;
        let mut survey = Self { primitives: [0; 3], smooth: 0, scale_log2: 0, bounds: Aabb::EMPTY, sample: Vec::new() };
        let mut next = 0;
        objects.each(|object| {
            let (kind, aabb) = object.aabb();
            survey.primitives[match kind {
                Kind::Triangle => 0,
                Kind::Sphere => 1,
                Kind::Cone => 2,
            }] += 1;
            survey.smooth += u64::from(object.is_smooth());
            survey.bounds = survey.bounds.union(&aabb);
            if next % stride == 0 {
                survey.sample.push(*object);
            }
            next += 1;
            stop.check(next)
        })?;
        let magnitude = if survey.bounds.is_empty() { 0.0 } else { survey.bounds.magnitude() };
        survey.scale_log2 = scale_log2_for(magnitude);
        Ok(survey)
    }
}

/// Voxels for a scene of so many primitives if nobody says.
pub(crate) fn voxels_for(primitives: u64) -> Voxels {
    match primitives.div_ceil(VOXEL_OBJECTS) {
        0 | 1 => Voxels::One,
        n => Voxels::Adaptive(n.min(4096) as u32),
    }
}

/// Whether to go on.
struct Stop<'a>(&'a AtomicBool);

impl Stop<'_> {
    /// Looks now and then.
    fn check(&self, count: u64) -> Result<(), BuildError> {
        let stop = count.is_multiple_of(1 << 12) && self.0.load(Ordering::Relaxed);
        if stop { Err(BuildError::Interrupted) } else { Ok(()) }
    }
}

/// Builds `objects`, which it drops on the way, and tells pages in their order, some of them at a time. `folder` is where
/// the file between the passes goes. It ends with an error soon after `stop` is true.
///
/// # Errors
/// See [`BuildError`]; that of `tell`.
pub(crate) fn build_in_two_passes(
    objects: impl Objects,
    settings: &Settings,
    folder: &Path,
    stop: &AtomicBool,
    tell: &mut impl FnMut(&[Line]) -> Result<(), BuildError>,
) -> Result<(Index, Survey), BuildError> {
    let stop = Stop(stop);
    let mut survey = Survey::new(&objects, &stop)?;
    let scale = libm::ldexpf(1.0, survey.scale_log2);
    let item = |object: &Object| {
        let (kind, aabb) = object.aabb();
        Item::new(&aabb, kind, 0)
    };
    let sample: Vec<Item> = std::mem::take(&mut survey.sample).iter().map(|o| item(&o.scaled(scale))).collect();
    let bounds = Aabb { lo: survey.bounds.lo * scale, hi: survey.bounds.hi * scale };
    let plan = Plan::new(settings.voxels, &bounds, &sample);
    drop(sample);

    let mut spill = Spill::new(folder, plan.voxels()).map_err(BuildError::Spill)?;
    let mut held = vec![Aabb::EMPTY; plan.voxels() as usize];
    let mut count = 0;
    objects.each(|object| {
        count += 1;
        stop.check(count)?;
        let object = object.scaled(scale);
        let mut written = Ok(());
        plan.place(&object.aabb().1, |voxel, part| {
            held[voxel as usize] = held[voxel as usize].union(part);
            if written.is_ok() {
                written = spill.push(voxel, &object);
            }
        });
        written.map_err(BuildError::Spill)
    })?;
    drop(objects);

    let mut assembler = Assembler::new(&plan);
    for step in plan.above(&held) {
        match step {
            Step::Above(aabb) => assembler.above(&aabb),
            Step::Voxel(voxel) => {
                stop.check(0)?;
                let objects = spill.take(voxel).map_err(BuildError::Spill)?;
                let items = items_of(&objects, &plan, voxel);
                let tree = VoxelTree::build(items, &Held(&objects), settings, plan.depth())?;
                drop(objects);
                for lines in assembler.voxel(voxel, tree) {
                    tell(&lines)?;
                }
            }
        }
    }
    Ok((assembler.finish(), survey))
}

/// Objects with the parts of their boxes in a voxel.
fn items_of(objects: &[Object], plan: &Plan, voxel: u32) -> Vec<Item> {
    let items = (0..).zip(objects).map(|(number, object)| {
        let (kind, aabb) = object.aabb();
        let mut item = Item::new(&aabb, kind, number);
        plan.place(&aabb, |other, part| {
            if other == voxel {
                (item.lo, item.hi) = (part.lo, part.hi);
            }
        });
        item
    });
    items.collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Packed, Rule, build};
    use super::*;
    use crate::import;
    use hybray_bintree::midpoint;
    use hybray_scene::PageForm;

    fn check(name: &str, voxels: Voxels, rule: Rule, pages: PageForm) {
        let model = import::load(name).unwrap();
        let settings = Settings { rule, page_bytes: 8192, pages, voxels };
        let expected = build(&model, &settings).unwrap();
        let materials = model.materials.len();
        let smooth = model.meshes.iter().filter(|m| !m.normals.is_empty()).map(|m| m.triangles.len() as u64).sum();
        let (spheres, cones) = (model.spheres.len() as u64, model.cones.len() as u64);
        let triangles = model.primitives() as u64 - spheres - cones;
        let mut lines = Vec::new();
        let go_on = AtomicBool::new(false);
        let (index, survey) = build_in_two_passes(model, &settings, &std::env::temp_dir(), &go_on, &mut |piece| {
            lines.extend_from_slice(piece);
            Ok(())
        })
        .unwrap();
        assert_eq!((survey.primitives, survey.smooth), ([triangles, spheres, cones], smooth), "{name}");
        let packed = Packed::new(index, vec![lines], survey.scale_log2, materials, Vec::new());
        assert_eq!(packed.hash(), expected.hash(), "{name} {voxels:?} {rule:?}");
        assert_eq!(packed.scale_log2, expected.scale_log2);
        packed.open().unwrap();
        for page in 0..packed.pages() as u32 {
            let (a, b) = (packed.page(page), expected.page(page));
            assert_eq!(bytemuck::cast_slice::<_, u8>(a), bytemuck::cast_slice::<_, u8>(b));
            assert_eq!(packed.voxel_of(page), expected.voxel_of(page));
            assert_eq!(packed.primitives_of(page), expected.primitives_of(page));
        }
    }

    #[test]
    fn the_pages_of_the_build_in_memory() {
        let midpoints = Rule::Midpoint(midpoint::Settings::default());
        for voxels in [Voxels::One, Voxels::Grid([3, 2, 2]), Voxels::Adaptive(5)] {
            check("spd:balls:3", voxels, Rule::SurfaceArea, PageForm::Full);
            check("spd:teapot:4", voxels, Rule::SurfaceArea, PageForm::Full);
            check("spd:teapot:4", voxels, midpoints, PageForm::Compact);
            check("spd:tree:5", voxels, midpoints, PageForm::Full);
            check("cornell:mirror", voxels, midpoints, PageForm::Compact);
            check("terrain:40000", voxels, Rule::SurfaceArea, PageForm::Full);
            check("terrain:40000", voxels, Rule::SurfaceArea, PageForm::Compact);
        }
    }

    #[test]
    fn stops_when_it_is_told() {
        let model = import::load("terrain:5000").unwrap();
        let stop = AtomicBool::new(true);
        let built = build_in_two_passes(model, &Settings::default(), &std::env::temp_dir(), &stop, &mut |_| {
            panic!("there is nothing to tell yet")
        });
        assert!(matches!(built, Err(BuildError::Interrupted)));
    }

    #[test]
    fn voxels_that_nobody_asked_for() {
        assert_eq!(voxels_for(0), Voxels::One);
        assert_eq!(voxels_for(VOXEL_OBJECTS), Voxels::One);
        assert_eq!(voxels_for(VOXEL_OBJECTS + 1), Voxels::Adaptive(2));
        assert_eq!(voxels_for(u64::MAX), Voxels::Adaptive(4096));
    }
}
