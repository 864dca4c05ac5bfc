//! Packed scenes: what comes out is what went in, and a file that is not as it was written is refused.

use hybray::build::{Rule, Settings};
use hybray::model::{self, Model};
use hybray::pack::{self, pack};
use hybray::partition::Voxels;
use hybray::prepare::Prepared;
use hybray_bintree::midpoint;
use hybray_native::{DispatcherAt, Farm};
use hybray_scene::PageForm;
use hybray_scheduler::Options;
use hybray_tests::{Random, drawn, kernels, scene};
use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// A file of a test's own, which goes with it.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        Self(PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{}-{name}.hyb", std::process::id())))
    }

    /// Packs a scene, and gives what was written.
    fn packed(name: &str, settings: &Settings) -> (Self, Model) {
        let scratch = Self::new(&name.replace([':', '@'], "-"));
        let model = scene(name);
        let mut about = model.clone();
        (about.meshes, about.spheres, about.cones) = Default::default();
        pack(model.clone(), &about, settings, Some(settings.voxels), &scratch.0, &AtomicBool::new(false)).unwrap();
        (scratch, model)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn check(name: &str, rule: Rule, voxels: Voxels, pages: PageForm) {
    let settings = Settings { rule, page_bytes: 16 * 1024, pages, voxels };
    let (file, model) = Scratch::packed(name, &settings);
    let opened = Prepared::open(&file.0).unwrap_or_else(|e| panic!("{e}"));
    let built = Prepared::new(model, &settings).unwrap();
    assert_eq!(opened.hash, built.hash, "{name}");
    assert_eq!(opened.cameras, built.cameras);
    assert_eq!(opened.settings, built.settings);
    assert_eq!(opened.objects, built.objects);
    assert_eq!((opened.primitives, opened.smooth), (built.primitives, built.smooth));
    assert_eq!((opened.requires(), opened.tables()), (built.requires(), built.tables()));
    assert_eq!(opened.warnings, built.warnings);
    assert_eq!(opened.packed.voxels(), voxels.count());
    assert_eq!(opened.packed.compact_pages(), if pages == PageForm::Compact { opened.packed.pages() } else { 0 });
    assert_eq!(opened.packed.placed_pages(), built.packed.placed_pages());
    for page in 0..built.packed.pages() as u32 {
        assert_eq!(opened.packed.primitives_of(page), built.packed.primitives_of(page));
    }
    let wanted = model::Settings { size: Some([48, 36]), spp: Some(2), ..model::Settings::default() };
    let options = Options { spread: None, atomic: Some(4), ..Options::default() };
    let farm = Farm { nodes: 2, kernels: kernels(), dispatcher: DispatcherAt::Host, shadow_bundles: true, options };
    let expected = drawn(&built, &wanted, &farm, name);
    assert!(expected.counts.hits > 0, "{name}");
    assert_eq!(drawn(&opened, &wanted, &farm, name), expected, "{name}");
}

#[test]
fn what_comes_out_is_what_went_in() {
    let midpoints = Rule::Midpoint(midpoint::Settings::default());
    check("spd:balls:3", Rule::SurfaceArea, Voxels::One, PageForm::Full);
    check("spd:teapot:5", Rule::SurfaceArea, Voxels::One, PageForm::Compact);
    check("spd:teapot:5", Rule::SurfaceArea, Voxels::Grid([2, 3, 1]), PageForm::Full);
    check("spd:tree:5", midpoints, Voxels::Adaptive(9), PageForm::Full);
    check("cornell:mirror", midpoints, Voxels::One, PageForm::Compact);
    check("spd:balls:2@blades", Rule::SurfaceArea, Voxels::One, PageForm::Full);
    check("spd:balls:2@orthographic", Rule::SurfaceArea, Voxels::One, PageForm::Full);
    check("terrain:3000", Rule::SurfaceArea, Voxels::Adaptive(4), PageForm::Compact);
    check("gallery:40", Rule::SurfaceArea, Voxels::Grid([2, 1, 2]), PageForm::Full);
}

/// Opens a file of these bytes: refused with a line that names it, or else it must be the scene that was written.
fn hostile(file: &Scratch, bytes: &[u8], expected: u64, what: &str) -> bool {
    fs::write(&file.0, bytes).unwrap();
    match Prepared::open(&file.0) {
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains(".hyb: ") && text.contains("; ") && !text.contains('\n'), "{what}: {text}");
            true
        }
        Ok(opened) => {
            assert_eq!(opened.hash, expected, "{what}: taken for another scene");
            opened.packed.open().unwrap_or_else(|e| panic!("{what}: {e}"));
            false
        }
    }
}

#[test]
fn files_that_are_not_as_they_were_written() {
    let settings = Settings { voxels: Voxels::Grid([2, 1, 1]), page_bytes: 4096, ..Settings::default() };
    let (file, model) = Scratch::packed("spd:balls:1", &settings);
    let expected = Prepared::new(model, &settings).unwrap().hash;
    let whole = fs::read(&file.0).unwrap();
    assert!(!hostile(&file, &whole, expected, "whole"));

    for end in (0..whole.len()).step_by(64).chain(whole.len() - 63..whole.len()) {
        assert!(hostile(&file, &whole[..end], expected, &format!("cut at {end}")));
    }
    let mut longer = whole.clone();
    longer.extend([0; 64]);
    assert!(hostile(&file, &longer, expected, "longer"));

    // Every bit of the header, and others here and there: the hash finds each.
    let random = &mut Random(1);
    let flips = (0..128 * 8).chain((0..1000).map(|_| random.below(8 * whole.len())));
    for bit in flips.collect::<Vec<_>>() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(hostile(&file, &bytes, expected, &format!("bit {bit} flipped")), "bit {bit} flipped: not noticed");
    }

    // Each number of the header as large as can be, with and without its neighbour.
    for at in (8..128).step_by(4) {
        for bytes_of_it in [4, 8, 16] {
            let mut bytes = whole.clone();
            bytes[at..(at + bytes_of_it).min(128)].fill(0xff);
            assert!(hostile(&file, &bytes, expected, &format!("{bytes_of_it} ones at {at}")));
        }
    }

    for seed in 0..100 {
        let random = &mut Random(seed);
        let length = random.below(4 * whole.len());
        let mut noise: Vec<u8> = (0..length).map(|_| random.bits() as u8).collect();
        assert!(hostile(&file, &noise, expected, &format!("noise {seed}")));
        // The same behind the true header, as long as that says.
        noise.resize(whole.len(), seed as u8);
        noise[..128].copy_from_slice(&whole[..128]);
        assert!(hostile(&file, &noise, expected, &format!("noise {seed} behind a header")));
    }
}

/// A header that asks for as much as the file's length allows, where the file is a hole: refused before there is room for
/// what is not there.
#[test]
fn a_hole_is_not_read_into_memory() {
    let (file, _) = Scratch::packed("cornell", &Settings::default());
    let mut bytes = fs::read(&file.0).unwrap();
    // Bytes of the file; lines of pages; pages.
    let lines = 1u64 << 28;
    let pages = 1u32 << 24;
    let at = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let (old_lines, old_pages) = (at(&bytes, 32), u64::from(at(&bytes, 80) as u32));
    let grown = |n: u64, size: u64| (n * size).next_multiple_of(64);
    let [more, less] = [u64::from(pages), old_pages].map(|n| grown(n, 8) + grown(n, 4));
    let length = at(&bytes, 16) + 64 * (lines - old_lines) + more - less;
    bytes[16..24].copy_from_slice(&length.to_le_bytes());
    bytes[32..40].copy_from_slice(&lines.to_le_bytes());
    bytes[80..84].copy_from_slice(&pages.to_le_bytes());
    fs::write(&file.0, &bytes[..128]).unwrap();
    File::options().write(true).open(&file.0).unwrap().set_len(length).unwrap();
    let error = Prepared::open(&file.0).err().unwrap().to_string();
    assert!(error.contains("table of pages"), "{error}");
}

/// A directory that leads to a page twice might send a walk in circles.
#[test]
fn a_page_has_one_place() {
    let settings = Settings { page_bytes: 4096, ..Settings::default() };
    let (file, _) = Scratch::packed("terrain:300", &settings);
    let mut bytes = fs::read(&file.0).unwrap();
    let lines = u64::from_le_bytes(bytes[32..40].try_into().unwrap()) as usize;
    // The children of the root, after its boxes.
    let children = 128 + 64 * lines + 192;
    let is_page = |bytes: &[u8], child: usize| bytes[children + 4 * child + 3] >> 6 == 2;
    let pages: Vec<usize> = (0..8).filter(|&child| is_page(&bytes, child)).collect();
    assert!(pages.len() >= 2, "{pages:?}");
    let [one, other] = [pages[0], pages[1]].map(|child| children + 4 * child);
    bytes.copy_within(one..one + 4, other);
    fs::write(&file.0, &bytes).unwrap();
    let error = Prepared::open(&file.0).err().unwrap().to_string();
    assert!(error.contains("more than once"), "{error}");
}

#[test]
fn names_of_packed_scenes() {
    assert!(["a.hyb", "b/c.HYB"].into_iter().all(pack::is_packed));
    assert!(["a.obj", "hyb", "cornell", "a.hyb.nff"].into_iter().all(|name| !pack::is_packed(name)));
}
