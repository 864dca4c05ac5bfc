//! The nearest hit along the cliplist is, to the bit, that of testing every object.

mod common;

use common::{Tree, for_each_pyramid, trees};
use hybray_geometry::{Candidate, Ray, RayKernel};
use hybray_pyraclip::{ClipCell, ClipCounts, TraverseCounts, traverse};

fn check(name: &str, tree: &Tree, list: &[ClipCell<u32>], ray: &Ray, counts: &mut TraverseCounts) -> Candidate {
    let kernel = RayKernel::new(ray);
    let mut expected = Candidate::none(ray.t_max);
    for (id, object) in tree.objects.iter().enumerate() {
        object.hit(&kernel, id as u32, &mut expected);
    }
    let found = traverse(list, &kernel, Candidate::none(ray.t_max), counts, |cell, best| {
        for &id in &tree.nodes[cell.cell as usize].objects {
            tree.objects[id as usize].hit(&kernel, id, best);
        }
    });
    assert_eq!((found.id, found.t.to_bits()), (expected.id, expected.t.to_bits()), "{name}: {ray:?}");
    found
}

#[test]
fn nearest_hits_are_those_of_brute_force() {
    for (name, tree) in trees() {
        let (mut rays_traced, mut hits, mut counts) = (0u64, 0u64, TraverseCounts::default());
        let mut listed = 0;
        for_each_pyramid(8, 10, |_, pyramid, rays| {
            let list = tree.list(pyramid, &mut ClipCounts::default());
            for ray in rays {
                let nearest = check(name, &tree, &list, ray, &mut counts);
                rays_traced += 1;
                hits += u64::from(nearest.is_hit());
                listed += list.len() as u64;
                // What is beyond the first hit, and what is before its end, by the ray's own limits.
                if nearest.is_hit() {
                    check(name, &tree, &list, &Ray { t_min: nearest.t * 1.001, ..*ray }, &mut counts);
                    check(name, &tree, &list, &Ray { t_max: nearest.t, ..*ray }, &mut counts);
                }
            }
        });
        println!("{name}: {rays_traced} rays, {hits} hits, {listed} cells listed, {counts:?}");
        assert!(hits > 100, "{name}");
        assert!(counts.visits < counts.exits && counts.exits < 3 * listed, "{name}: {counts:?}");
    }
}
