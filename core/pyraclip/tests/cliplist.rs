//! No leaf that any ray touches is missing, and the order is front to back: judged in whole numbers.

mod common;

use common::{for_each_pyramid, interval, trees};
use hybray_pyraclip::ClipCounts;

#[test]
fn no_touched_leaf_is_missing_and_the_order_is_front_to_back() {
    for (name, tree) in trees() {
        let leaves: Vec<u32> = tree.leaves().collect();
        let (mut touched, mut listed) = (0, 0);
        for_each_pyramid(4, 4, |camera, pyramid, rays| {
            let list = tree.list(pyramid, &mut ClipCounts::default());
            listed += list.len();
            let mut place = vec![usize::MAX; tree.nodes.len()];
            for (i, cell) in list.iter().enumerate() {
                assert_eq!(place[cell.cell as usize], usize::MAX, "{name}: listed twice");
                assert_eq!(cell.aabb, tree.nodes[cell.cell as usize].aabb);
                place[cell.cell as usize] = i;
            }
            for ray in rays {
                for &leaf in &leaves {
                    if interval(ray, &tree.nodes[leaf as usize].aabb, false).is_some() {
                        touched += 1;
                        let missing = place[leaf as usize] == usize::MAX;
                        assert!(!missing, "{name}: {:?} {ray:?} {:?}", camera.eye, tree.nodes[leaf as usize].aabb);
                    }
                }
                let mut reached = None;
                for cell in &list {
                    let Some((entry, exit)) = interval(ray, &cell.aabb, true) else { continue };
                    if let Some(reached) = reached {
                        assert!(entry.at_most(exit) && !entry.less(reached), "{name}: {ray:?} {:?}", cell.aabb);
                    }
                    reached = Some(exit);
                }
            }
        });
        println!("{name}: {} leaves, {listed} listed, {touched} touched", leaves.len());
        assert!(touched > 2_000, "{name}: {touched}");
    }
}
