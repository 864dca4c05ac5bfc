//! Pages and directories with bytes changed at random: refused, or walked to an end.

mod common;

use common::scenes::mixed;
use common::{Built, Random, Rule, Shapes, build, build_compact};
use hybray_bintree::check::{Coverage, check};
use hybray_bintree::walk::{Counts, Resident, Stack, nearest, occluded};
use hybray_bintree::{midpoint, sah};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Ray, Vec3};
use hybray_scene::{Child, Directory, Line, Node, PageEntry, PageView, Tables};

/// Small pages of every sort: one kind and all, one node and many, with normals and materials and without.
fn originals() -> Vec<Built> {
    let mut all = Vec::new();
    for (count, materials, smooth) in [(1, 1, false), (9, 1, true), (40, 3, true), (60, 7, false), (300, 2, true)] {
        let shapes = Shapes { all: mixed(count, count as u64), materials, smooth };
        for rule in [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 4)] {
            all.push(build(&shapes, rule, 4096).unwrap());
            all.push(build_compact(&shapes, rule, 4096).unwrap());
        }
    }
    all
}

/// Changes a few bits, bytes or words; half of the words become numbers that mean something.
fn mutate(bytes: &mut [u8], random: &mut Random) {
    const TELLING: [u32; 12] = [
        0,
        1,
        2,
        15,
        40,
        u32::MAX,
        0x7fc0_0000,
        0x7f80_0000,
        Child::Inner(1).pack(),
        Child::Page(0).pack(),
        Child::Unused.pack(),
        1 << 30,
    ];
    // The header and the first nodes matter most.
    let head = bytes.len().min(1024);
    for _ in 0..1 + random.below(6) {
        let reach = if random.below(3) == 0 { bytes.len() } else { head };
        let at = random.below(reach);
        match random.below(4) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.bits() as u8,
            2 => bytes[at / 4 * 4..][..4].copy_from_slice(&TELLING[random.below(TELLING.len())].to_le_bytes()),
            _ => bytes[at / 4 * 4..][..4].copy_from_slice(&(random.bits() as u32).to_le_bytes()),
        }
    }
}

fn some_rays() -> Vec<Ray> {
    let mut random = Random(77);
    let mut rays: Vec<Ray> = (0..3)
        .map(|_| Ray { origin: random.vec() * 2.0, direction: random.vec(), t_min: 0.0, t_max: f32::INFINITY })
        .collect();
    rays.push(Ray { origin: Vec3::ZERO, direction: Vec3::X, t_min: 0.0, t_max: 1.0 });
    rays
}

/// Walks to the end, with as many nodes at most as there are: each has one parent.
fn walk(scene: &Resident<'_>, ray: &Ray, kernels: Kernels, stack: &mut Stack) {
    let mut counts = Counts::default();
    let hit = nearest(kernels, scene, ray, stack, &mut counts);
    if hit.candidate.is_hit() {
        let _ = scene.pages[hit.page as usize].material(hit.slot);
    }
    let pages: usize = scene.pages.iter().map(|p| p.body.nodes().len()).sum();
    assert!(counts.nodes as usize <= scene.directory.nodes.len() + pages.max(1) * counts.pages as usize);
    let _ = occluded(kernels, scene, ray, stack, &mut Counts::default());
}

#[test]
fn mutated_pages_are_refused_or_walked() {
    let (mut random, mut stack, rays) = (Random(1), Stack::new(), some_rays());
    let pages: Vec<(Vec<Line>, usize)> =
        originals().into_iter().flat_map(|b| b.pages.into_iter().map(move |p| (p, b.materials))).collect();
    let mut directory = [Node::EMPTY];
    let kernels: Vec<_> = Kernels::available().collect();
    let mut accepted = 0;
    for round in 0..100_000 {
        let (page, materials) = &pages[round % pages.len()];
        let mut page = page.clone();
        mutate(bytemuck::cast_slice_mut(&mut page), &mut random);
        if random.below(50) == 0 {
            page.truncate(random.below(page.len() + 1));
        }
        let Ok(view) = PageView::parse(&page, Tables { materials: *materials }) else { continue };
        accepted += 1;
        let whole = hybray_geometry::Aabb { lo: Vec3::MIN, hi: Vec3::MAX };
        directory[0].set(0, &whole, Child::Page(0));
        let entries = [PageEntry { bytes: view.header.bytes, owner: 0, kind: 0 }];
        let scene = Resident { directory: Directory { nodes: &directory, entries: &entries }, pages: &[view][..] };
        walk(&scene, &rays[round % rays.len()], kernels[round % kernels.len()], &mut stack);
        let _ = check(&scene, &mut [Coverage::NONE; 300], &mut [0]);
    }
    assert!((10_000..90_000).contains(&accepted), "some of each: {accepted} accepted");
}

#[test]
fn mutated_directories_are_refused_or_walked() {
    let (mut random, mut stack, rays) = (Random(2), Stack::new(), some_rays());
    let shapes = Shapes::new(mixed(1500, 3));
    let built = build(&shapes, Rule::Sah(sah::Settings::default()), 2048).unwrap();
    assert!(built.nodes.len() > 5, "{}", built.nodes.len());
    let views = built.views();
    let mut level = vec![0; built.nodes.len() + built.entries.len()];
    let mut accepted = 0;
    for round in 0..20_000 {
        let (mut nodes, mut entries) = (built.nodes.clone(), built.entries.clone());
        mutate(bytemuck::cast_slice_mut(&mut nodes), &mut random);
        if random.below(10) == 0 {
            mutate(bytemuck::cast_slice_mut(&mut entries), &mut random);
        }
        let Ok(directory) = Directory::parse(&nodes, &entries, &mut level) else { continue };
        accepted += 1;
        let scene = Resident { directory, pages: &views[..] };
        walk(&scene, &rays[round % rays.len()], Kernels::detect(), &mut stack);
        let _ = check(&scene, &mut [Coverage::NONE; 1500], &mut vec![0; views.len()]);
    }
    assert!((2_000..18_000).contains(&accepted), "some of each: {accepted} accepted");
}
