//! The nearest hit along the cliplist is, to the bit, that of testing every object.

mod common;

use common::{Object, Tree, for_each_pyramid, trees};
use hybray_geometry::{Candidate, Pyramid, Ray, RayKernel, Sphere, Triangle, Vec3};
use hybray_pyraclip::{ClipCell, ClipCounts, ClipPyramid, TraverseCounts, midpoint, traverse};

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

/// A triangle whose nearest vertex is within rounding of the edge in which four cells meet, but in one of them only,
/// and not in one that the ray passes through. Comparing exits as the paper does would skip that cell.
#[test]
fn an_object_in_the_corner_of_a_cell_beside_the_ray_is_found() {
    let triangle = Triangle { v: [[1e-6, -1e-6, 0.0], [0.1, -0.05, 0.1], [0.1, -0.1, -0.1]].map(Vec3::from_array) };
    // The other cells hold something that the ray does not hit.
    let away = |x: f32, y: f32| Object::Sphere(Sphere { centre: Vec3::new(x, y, 0.5), radius: 0.01 });
    let objects = vec![Object::Triangle(triangle), away(-0.5, -0.5), away(-0.5, 0.5), away(0.5, 0.5), away(0.5, -0.5)];
    let tree = Tree::cut(objects, common::cube(1.0), 2, 0, midpoint);
    let ray = Ray {
        origin: Vec3::new(-1000.0, -1000.0, 0.0),
        direction: Vec3::new(1.0, 1.0, 0.0),
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let corner = |i: f32, j: f32| Vec3::new(1.0 + i * 1e-3, 1.0 - i * 1e-3, j * 1e-3);
    let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    let pyramid = ClipPyramid::new(&Pyramid::through(ray.origin, corners).unwrap()).unwrap();
    let list = tree.list(&pyramid, &mut ClipCounts::default());
    assert_eq!(tree.leaves().filter(|&l| tree.nodes[l as usize].objects.contains(&0)).count(), 1);
    let found = check("corner", &tree, &list, &ray, &mut TraverseCounts::default());
    assert_eq!(found.id, 0);
}
