//! Walks that are handed from store to store, each with some of the pages: the hit of one walk, to the bit, through the
//! same pages in the same order, or fewer. A walk for any hit goes past pages that are not at hand, and cuts the ray.

mod common;

use common::scenes::{mixed, table};
use common::{Built, Random, Rule, Shapes, build, rays};
use hybray_bintree::walk::{Counts, FROM_ROOT, Hit, Resident, Stack, Walk, Walked, nearest, occluded};
use hybray_bintree::{midpoint, sah};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Aabb, Candidate, Ray, Vec3};
use hybray_scene::{Child, Directory, NO_PARENT, PageView, Pages, parents};
use std::cell::RefCell;

/// Some of a scene's pages, and which of them were looked at.
struct Share<'a> {
    all: &'a [PageView<'a>],
    here: Vec<bool>,
    parents: &'a [u32],
    seen: &'a RefCell<Vec<u32>>,
}

impl Pages for Share<'_> {
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        if !*self.here.get(number as usize)? {
            return None;
        }
        self.seen.borrow_mut().push(number);
        Some(self.all[number as usize])
    }
    fn parents(&self) -> &[u32] {
        self.parents
    }
}

/// A store that says that it has every page, and does.
struct Whole<'a>(&'a Share<'a>);

impl Pages for Whole<'_> {
    const ALL: bool = true;
    fn page(&self, number: u32) -> Option<PageView<'_>> {
        self.0.page(number)
    }
    fn parents(&self) -> &[u32] {
        self.0.parents
    }
}

fn hang(built: &Built) -> Vec<u32> {
    let mut hang = vec![0; built.nodes.len() + built.pages.len()];
    parents(&built.nodes, &mut hang);
    hang
}

fn walk<const ANY: bool, P: Pages>(
    kernels: Kernels,
    directory: Directory<'_>,
    pages: &P,
    ray: &Ray,
    best: Hit,
    from: u32,
    stack: &mut Stack,
) -> Walked {
    let (scene, mut counts) = (Resident { directory, pages }, Counts::default());
    let walked = kernels.run(Walk::<ANY, P> { scene: &scene, ray, best, from, past: true, stack, counts: &mut counts });
    assert!(counts.pages as usize <= directory.entries.len());
    walked
}

fn is_subsequence(of: &[u32], some: &[u32]) -> bool {
    let mut rest = of.iter();
    some.iter().all(|page| rest.any(|other| other == page))
}

/// What the test has seen, so that it is seen to test something.
#[derive(Default, Debug)]
struct Tally {
    handed: usize,
    hits: usize,
    fewer: usize,
    /// Walks for any hit that a page at hand ended though one before it was missing.
    blocked_past: usize,
    /// Walks that cut the ray.
    cut: usize,
}

/// The primitives of a page.
fn ids(page: &PageView<'_>) -> Vec<u32> {
    let triangles = (0..page.body.triangle_lanes()).map(|number| page.body.triangle_id(number));
    let spheres = page.spheres.iter().flat_map(|block| block.id);
    let mut ids: Vec<_> = triangles.chain(spheres).chain(page.cones.iter().map(|cone| cone.id)).collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}

/// Every ray through `stores`, from the root on, at a store that has the page which the walk needs.
fn check(
    name: &str,
    shapes: &Shapes,
    built: &Built,
    rays: &[(Ray, Candidate)],
    random: &mut Random,
    tally: &mut Tally,
) {
    let (views, hang, seen) = (built.views(), hang(built), RefCell::new(Vec::new()));
    let resident = built.resident(&views);
    let share = |here| Share { all: &views, here, parents: &hang, seen: &seen };
    let everything = share(vec![true; views.len()]);
    let whole_scene = Whole(&everything);
    let (of, mut stack) = (1 + random.below(5), Stack::new());
    let mut stores: Vec<Share<'_>> =
        (0..1 + random.below(5)).map(|_| share(views.iter().map(|_| random.below(of) == 1).collect())).collect();
    for page in 0..views.len() {
        let owner = random.below(stores.len());
        stores[owner].here[page] = true;
    }
    let of_page: Vec<_> = views.iter().map(ids).collect();
    // The midpoint rule puts a primitive into several pages, not all of which a ray that hits it meets.
    let stands_once = of_page.iter().map(Vec::len).sum::<usize>() == shapes.all.len();
    for (ray, expected) in rays {
        for kernels in Kernels::available() {
            let what = format!("{name} {kernels:?} {} stores {ray:?}", stores.len());
            let whole = walk::<false, _>(
                kernels,
                resident.directory,
                &everything,
                ray,
                Hit::none(ray.t_max),
                FROM_ROOT,
                &mut stack,
            );
            let full = seen.take();
            assert_eq!(whole.needs, None, "{what}");
            assert_eq!(whole.best, nearest(kernels, &resident, ray, &mut stack, &mut Counts::default()), "{what}");
            let mut once = full.clone();
            once.sort_unstable();
            once.dedup();
            assert_eq!(once.len(), full.len(), "{what}: a page twice");

            let (mut best, mut from, mut carried) = (Hit::none(ray.t_max), FROM_ROOT, *ray);
            loop {
                let with: Vec<_> =
                    stores.iter().filter(|store| from == FROM_ROOT || store.here[from as usize]).collect();
                let store = with[random.below(with.len())];
                let walked = walk::<false, _>(kernels, resident.directory, store, &carried, best, from, &mut stack);
                best = walked.best;
                assert!(seen.borrow().len() <= views.len(), "{what}: on and on");
                let Some(page) = walked.needs else { break };
                assert!(!store.here[page as usize], "{what}: page {page} is here");
                from = page;
                tally.handed += 1;
                // A record's ray ends at its best hit.
                if random.below(2) == 0 {
                    carried.t_max = best.candidate.t;
                }
            }
            let visited = seen.take();
            assert_eq!((best.candidate.t.to_bits(), best.candidate.id), (expected.t.to_bits(), expected.id), "{what}");
            assert_eq!(best, whole.best, "{what}: kept elsewhere");
            assert!(is_subsequence(&full, &visited), "{what}: {visited:?} is not of {full:?}");
            tally.hits += usize::from(best.candidate.is_hit());
            tally.fewer += usize::from(visited.len() < full.len());

            let (mut from, mut carried) = (FROM_ROOT, *ray);
            let blocked = loop {
                let with: Vec<_> =
                    (0..stores.len()).filter(|&at| from == FROM_ROOT || stores[at].here[from as usize]).collect();
                let at = with[random.below(with.len())];
                let (store, none) = (&stores[at], Hit::none(carried.t_max));
                let walked = walk::<true, _>(kernels, resident.directory, store, &carried, none, from, &mut stack);
                assert!(seen.borrow().len() <= views.len(), "{what}: on and on");
                seen.take();
                if from == FROM_ROOT {
                    // Whatever is at hand and in the way is found, whichever pages are missing.
                    let at_hand = of_page.iter().zip(&store.here).filter(|(_, here)| **here).flat_map(|(ids, _)| ids);
                    let in_the_way = shapes.brute_force_of(&carried, at_hand.copied()).is_hit();
                    let found = walked.best.candidate.is_hit();
                    assert!(found == in_the_way || !stands_once && in_the_way, "{what}");
                }
                let Some(page) = walked.needs else { break walked.best.candidate.is_hit() };
                assert!(!walked.best.candidate.is_hit() && !store.here[page as usize], "{what}: page {page}");
                // Nothing that is in the way lies in what was cut off.
                let end = walked.best.candidate.t;
                assert!(end <= carried.t_max, "{what}: a ray that grows");
                if end < carried.t_max {
                    tally.cut += 1;
                    carried.t_max = end;
                    assert_eq!(shapes.brute_force(&carried).is_hit(), expected.is_hit(), "{what}: cut at {end}");
                }
                from = page;
                // One that has them all goes on in the order in which the walk began.
                if random.below(4) == 0 {
                    let none = Hit::none(carried.t_max);
                    let walked =
                        walk::<true, _>(kernels, resident.directory, &whole_scene, &carried, none, from, &mut stack);
                    seen.take();
                    assert_eq!(walked.needs, None, "{what}");
                    break walked.best.candidate.is_hit();
                }
            };
            // The nearest hit would have had to wait for a page.
            let (with, none) = (&stores[0], Hit::none(ray.t_max));
            let any = walk::<true, _>(kernels, resident.directory, with, ray, none, FROM_ROOT, &mut stack);
            let first = walk::<false, _>(kernels, resident.directory, with, ray, none, FROM_ROOT, &mut stack);
            tally.blocked_past += usize::from(any.best.candidate.is_hit() && first.needs.is_some());
            seen.take();
            assert_eq!(blocked, expected.is_hit(), "{what}");
            assert_eq!(blocked, occluded(kernels, &resident, ray, &mut stack, &mut Counts::default()), "{what}");
        }
    }
}

fn rules() -> [Rule; 2] {
    [Rule::Sah(sah::Settings::default()), Rule::Midpoint(midpoint::Settings::default(), 4)]
}

#[test]
fn walks_go_on_where_the_pages_are() {
    let mut tally = Tally::default();
    for seed in 0..12 {
        let shapes = Shapes::new(mixed(300 + 200 * seed as usize, seed));
        let rays = rays(&shapes, 60, seed);
        for rule in rules() {
            for page_bytes in [1024, 4096] {
                let built = build(&shapes, rule, page_bytes).unwrap();
                assert!(built.pages.len() > 5, "{} pages", built.pages.len());
                let name = format!("seed {seed} {rule:?} {page_bytes}");
                check(&name, &shapes, &built, &rays, &mut Random(seed), &mut tally);
            }
        }
    }
    println!("{tally:?}");
    // A walk that is handed on knows no less than one that is not: pages may be left out only if their order says so.
    assert!(tally.handed > 10_000 && tally.hits > 1000, "{tally:?}");
    assert!(tally.cut > 200 && tally.blocked_past > 100, "{tally:?}");
}

#[test]
fn awkward_scenes_are_no_harder() {
    let mut tally = Tally::default();
    for (seed, (name, shapes)) in (0..).zip(table()) {
        let rays = rays(&shapes, 24, seed);
        for rule in rules() {
            let built = build(&shapes, rule, 1200).unwrap();
            let name = format!("{name}, seed {seed} {rule:?}");
            check(&name, &shapes, &built, &rays, &mut Random(seed), &mut tally);
        }
    }
    assert!(tally.handed > 1000 && tally.hits > 500, "{tally:?}");
}

/// Where rounding could make a cut too short: rays along axes and in the faces of pages' boxes, from and to their corners,
/// in scenes a million times as large and as small.
#[test]
fn nothing_is_cut_off() {
    let mut tally = Tally::default();
    for (seed, scale) in (0..).zip([1.0, 1e6, 1e-6]) {
        let shapes = Shapes::new(mixed(700, seed).into_iter().map(|shape| shape.scaled(scale)).collect());
        for rule in rules() {
            let built = build(&shapes, rule, 1024).unwrap();
            let boxes: Vec<_> = built
                .nodes
                .iter()
                .flat_map(|node| node.children().map(|(slot, child)| (node.aabb(slot), child)).collect::<Vec<_>>())
                .filter_map(|(aabb, child)| matches!(child, Child::Page(_)).then_some(aabb))
                .collect();
            let mut random = Random(seed);
            let rays: Vec<_> = (0..500)
                .map(|i| {
                    let (a, b) = (&boxes[random.below(boxes.len())], &boxes[random.below(boxes.len())]);
                    let corner = |random: &mut Random, a: &Aabb| {
                        Vec3::from_array(std::array::from_fn(|axis| [a.lo, a.hi][random.below(2)][axis]))
                    };
                    let origin = corner(&mut random, a);
                    let mut direction = corner(&mut random, b) - origin;
                    // Along a face of the first box; along one of its edges.
                    (0..i % 3).for_each(|_| direction[random.below(3)] = 0.0);
                    if direction == Vec3::ZERO {
                        direction = Vec3::Y * scale;
                    }
                    let t_max = [1.0, f32::INFINITY][random.below(2)];
                    let ray = Ray { origin, direction, t_min: 0.0, t_max };
                    (ray, shapes.brute_force(&ray))
                })
                .collect();
            check(&format!("scale {scale} {rule:?}"), &shapes, &built, &rays, &mut random, &mut tally);
        }
    }
    assert!(tally.cut > 300 && tally.blocked_past > 100, "{tally:?}");
}

/// Pages that the directory does not lead to, or that there are not, or that the ray does not meet: the walk ends, and
/// has found nothing that is not there.
#[test]
fn walks_from_anywhere_end() {
    let mut random = Random(3);
    let shapes = Shapes::new(mixed(1500, 3));
    let mut built = build(&shapes, rules()[0], 2048).unwrap();
    // One more page, to which no node leads.
    let orphan = built.pages.len() as u32;
    built.pages.push(built.pages[0].clone());
    built.entries.push(built.entries[0]);
    let (views, hang, seen) = (built.views(), hang(&built), RefCell::new(Vec::new()));
    assert_eq!(hang[built.nodes.len() + orphan as usize], NO_PARENT);
    assert_eq!(hang[0], NO_PARENT);
    let directory = Directory { nodes: &built.nodes, entries: &built.entries };
    let mut stack = Stack::new();
    let mut later = 0;
    for (round, (ray, expected)) in (0..).zip(rays(&shapes, 400, 9)) {
        let here = views.iter().map(|_| random.below(3) > 0).collect();
        let known: &[u32] = if round % 10 == 9 { &[] } else { &hang };
        let store = Share { all: &views, here, parents: known, seen: &seen };
        let beyond = views.len() as u32 + random.below(100) as u32;
        for from in [orphan, beyond, orphan + 1, u32::MAX - 1, u32::MAX / 2, random.bits() as u32 | 1 << 20] {
            let none = Hit::none(ray.t_max);
            for kernels in Kernels::available() {
                let ended = Walked { best: none, needs: None };
                assert_eq!(walk::<false, _>(kernels, directory, &store, &ray, none, from, &mut stack), ended, "{from}");
                assert_eq!(walk::<true, _>(kernels, directory, &store, &ray, none, from, &mut stack), ended, "{from}");
            }
        }
        let from = random.below(views.len()) as u32;
        let walked =
            walk::<false, _>(Kernels::detect(), directory, &store, &ray, Hit::none(ray.t_max), from, &mut stack);
        assert!(!walked.best.candidate.precedes(&expected), "round {round}: nearer than the nearest from {from}");
        assert!(walked.needs.is_none_or(|page| !store.here[page as usize]), "round {round}");
        later += usize::from(walked.best.candidate.is_hit());
        seen.take();
    }
    assert!(later > 10, "{later}");
}

/// Directories with bytes changed at random that are taken for good: walks from their pages end.
#[test]
fn walks_through_mutated_directories_end() {
    let mut random = Random(4);
    let shapes = Shapes::new(mixed(1500, 3));
    let built = build(&shapes, rules()[0], 2048).unwrap();
    let (views, seen) = (built.views(), RefCell::new(Vec::new()));
    let rays = rays(&shapes, 16, 1);
    let (mut level, mut stack, mut accepted) = (vec![0; built.nodes.len() + views.len()], Stack::new(), 0);
    for round in 0..4000 {
        let mut nodes = built.nodes.clone();
        for _ in 0..1 + random.below(4) {
            let node = random.below(nodes.len());
            let (a, b) = (random.below(8), random.below(8));
            match random.below(3) {
                // Two places that lead to one page, or a page whose box is another's.
                0 => nodes[node].child[a] = nodes[node].child[b],
                1 => nodes[node].child.swap(a, b),
                _ => {
                    let words: &mut [u32] = bytemuck::cast_slice_mut(&mut nodes[node..=node]);
                    words[random.below(48)] ^= 1 << random.below(32);
                }
            }
        }
        let Ok(directory) = Directory::parse(&nodes, &built.entries, &mut level) else { continue };
        accepted += 1;
        let mut hang = vec![0; nodes.len() + views.len()];
        parents(&nodes, &mut hang);
        let here = views.iter().map(|_| random.below(3) > 0).collect();
        let store = Share { all: &views, here, parents: &hang, seen: &seen };
        let (scene, ray) = (Resident { directory, pages: &store }, &rays[round % rays.len()].0);
        let from = random.below(views.len()) as u32;
        let (best, mut counts) = (Hit::none(ray.t_max), Counts::default());
        let walk = Walk::<true, Share<'_>> {
            scene: &scene,
            ray,
            best,
            from,
            past: true,
            stack: &mut stack,
            counts: &mut counts,
        };
        let past = Kernels::detect().run(walk);
        assert!(past.needs.is_none_or(|page| (page as usize) < views.len()), "round {round}");
        assert!(counts.pages as usize <= 8 * nodes.len(), "round {round}: {counts:?}");
        counts = Counts::default();
        let walk = Walk::<false, Share<'_>> {
            scene: &scene,
            ray,
            best,
            from,
            past: true,
            stack: &mut stack,
            counts: &mut counts,
        };
        let walked = Kernels::detect().run(walk);
        assert!(walked.needs.is_none_or(|page| (page as usize) < views.len()), "round {round}");
        assert!(counts.pages as usize <= 8 * nodes.len(), "round {round}: {counts:?}");
        seen.take();
    }
    assert!((500..4000).contains(&accepted), "some of each: {accepted} accepted");
}
