//! Appendix A over the midpoint tree of `hybray-bintree`: cliplist and exit points find what testing everything finds.

use hybray_bintree::midpoint::{Settings, build};
use hybray_bintree::{BinaryNode, Item};
use hybray_geometry::{Candidate, Pyramid, Ray, RayKernel, Sphere, Vec3};
use hybray_pyraclip::{ClipCounts, ClipPyramid, TraverseCounts, clip, traverse};
use hybray_scene::Kind;
use std::ops::ControlFlow;

#[test]
fn a_pyramid_of_rays_through_balls() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let spheres: Vec<Sphere> = (0..500)
        .map(|_| Sphere { centre: Vec3::new(random(), random(), random()) * 2.0 - 1.0, radius: 0.01 + 0.05 * random() })
        .collect();
    let mut items: Vec<Item> = (0..).zip(&spheres).map(|(id, s)| Item::new(&s.aabb(), Kind::Sphere, id)).collect();
    items.resize(8000, items[0]);
    let mut leaves = items.clone();
    let mut nodes = vec![BinaryNode::EMPTY; 8000];
    let tree = build(&mut items, spheres.len(), &mut leaves, &mut nodes, &Settings { depth_max: 18, objects_max: 6 });
    assert!(tree.nodes.len() > 200, "{} cells", tree.nodes.len());

    let (mut hits, mut listed) = (0, 0);
    for round in 0..60 {
        // Every third apex lies in a split plane, or inside.
        let apex = match round % 3 {
            0 => Vec3::new(0.0, 0.0, 3.0),
            1 => Vec3::new(2.0 * random() - 1.0, 2.0 * random() - 1.0, 2.0 * random() - 1.0),
            _ => Vec3::new(random() * 4.0, -3.0, random()),
        };
        let forward = Vec3::new(random() - 0.5, random() - 0.5, random() - 0.5) - apex;
        let right = forward.cross(Vec3::Y).normalize() * forward.length() * 0.1;
        let up = right.cross(forward).normalize() * forward.length() * 0.1;
        let corners = [forward - right - up, forward + right - up, forward + right + up, forward - right + up];
        let pyramid = ClipPyramid::new(&Pyramid::through(apex, corners).expect("convex")).expect("narrow");
        let mut cells = Vec::new();
        let flow = clip(&tree, &pyramid, &mut ClipCounts::default(), |cell| {
            cells.push(cell);
            ControlFlow::Continue(())
        });
        assert!(flow.is_ok_and(|flow| flow.is_continue()), "a sound tree");
        listed += cells.len();
        for _ in 0..200 {
            let direction = forward + right * (1.98 * random() - 0.99) + up * (1.98 * random() - 0.99);
            let ray = RayKernel::new(&Ray { origin: apex, direction, t_min: 0.0, t_max: f32::INFINITY });
            let far = Candidate::none(f32::INFINITY);
            let test = |ids: &mut dyn Iterator<Item = u32>, best: Candidate| {
                ids.fold(best, |best, id| spheres[id as usize].hit(&ray, id, &best).unwrap_or(best))
            };
            let expected = test(&mut (0..500), far);
            let found = traverse(&cells, &ray, far, &mut TraverseCounts::default(), |cell, best| {
                let node = &tree.nodes[cell.cell as usize];
                let objects = &tree.items[node.first as usize..][..node.count as usize];
                *best = test(&mut objects.iter().map(|item| item.id), *best);
            });
            assert_eq!(found, expected, "round {round}: {ray:?}");
            hits += u32::from(found.is_hit());
        }
    }
    assert!(hits > 1000 && listed > 1000, "{hits} hits, {listed} cells");
}
