//! Which nodes are given no tiles, by the 1995 report's criteria (table 6.2).

use super::{Plan, Voxels};
use hybray_geometry::{Aabb, Vec3};
use hybray_scheduler::policy::{Candidate, Criterion, admits};

/// Nobody can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoCandidate {
    /// There is no grid, or not one voxel for each node.
    #[error(
        "nodes have no place in a grid: for --demand-driven location give as many voxels as nodes, --voxels {}x{}x1, and \
         a scene that is not packed", .0[0], .0[1]
    )]
    NoGrid([u32; 2]),
    /// Every node has more objects.
    #[error("every node has more than {most} objects: give --demand-driven objects:{least}, or more")]
    Objects {
        /// As asked.
        most: u64,
        /// What the node with fewest has.
        least: u64,
    },
}

/// Who is given no tiles under `criterion`: entry 0 is the host's. Nobody if there is one node alone. `voxels` is how
/// the scene was cut, `objects` what node 1 and the others have in their pages.
///
/// # Errors
/// If that is everybody: what would do.
pub fn barred(criterion: Criterion, voxels: Voxels, objects: &[u64]) -> Result<Vec<bool>, NoCandidate> {
    if objects.len() == 1 {
        return Ok(Vec::new());
    }
    let at_boundary = match voxels {
        Voxels::Grid(sides) if voxels.count() as usize == objects.len() => boundary(sides),
        _ if criterion == Criterion::Location => return Err(NoCandidate::NoGrid(square(objects.len() as u32))),
        _ => vec![false; objects.len()],
    };
    let nodes = objects.iter().zip(at_boundary).enumerate();
    let candidates = nodes.map(|(at, (&objects, at_boundary))| Candidate { has_host: at == 0, at_boundary, objects });
    let barred: Vec<bool> = std::iter::once(false).chain(candidates.map(|node| !admits(criterion, &node))).collect();
    match criterion {
        Criterion::Objects(most) if barred[1..].iter().all(|&barred| barred) => {
            Err(NoCandidate::Objects { most, least: objects.iter().min().copied().unwrap_or(0) })
        }
        _ => Ok(barred),
    }
}

/// Which voxels of a grid have no neighbour on some side. An axis along which nothing is cut has no sides.
fn boundary(sides: [u32; 3]) -> Vec<bool> {
    let plan = Plan::new(Voxels::Grid(sides), &Aabb { lo: Vec3::ZERO, hi: Vec3::ONE }, &[]);
    let everything = Aabb { lo: Vec3::splat(f32::NEG_INFINITY), hi: Vec3::splat(f32::INFINITY) };
    let mut found = vec![false; plan.voxels() as usize];
    plan.place(&everything, |voxel, cell| {
        // The outermost reach to infinity.
        let ends = |axis: usize| cell.lo[axis].is_infinite() || cell.hi[axis].is_infinite();
        found[voxel as usize] = (0..3).any(|axis| sides[axis] > 1 && ends(axis));
    });
    found
}

/// Columns and rows of a grid, as square as it can be.
pub(crate) fn square(nodes: u32) -> [u32; 2] {
    let rows = (1..=nodes).take_while(|rows| rows * rows <= nodes).filter(|rows| nodes.is_multiple_of(*rows)).last();
    let rows = rows.unwrap_or(1);
    [nodes / rows, rows]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of the nodes that are given tiles.
    fn admitted(criterion: Criterion, voxels: &str, objects: &[u64]) -> Vec<usize> {
        let barred = barred(criterion, voxels.parse().unwrap(), objects).unwrap();
        (1..barred.len()).filter(|&node| !barred[node]).collect()
    }

    #[test]
    fn criteria_of_the_report() {
        let objects: Vec<u64> = (1..=16).map(|node| 100 * node).collect();
        let count = |criterion, voxels| admitted(criterion, voxels, &objects).len();
        assert_eq!(count(Criterion::All, "1"), 16);
        assert_eq!(admitted(Criterion::AllButHost, "4x4x1", &objects), (2..=16).collect::<Vec<_>>());
        // Table 6.2: twelve of sixteen.
        assert_eq!(count(Criterion::Location, "4x4x1"), 12);
        assert_eq!(count(Criterion::Location, "16x1x1"), 2);
        assert_eq!(count(Criterion::Location, "8x2x1"), 16);
        assert_eq!(admitted(Criterion::Objects(300), "1", &objects), [1, 2, 3]);
        assert_eq!(barred(Criterion::Objects(0), Voxels::One, &[7]), Ok(Vec::new()), "one alone draws everything");
    }

    /// Voxels are numbered along a curve: against their own coordinates.
    #[test]
    fn the_boundary_is_where_the_coordinates_say() {
        for sides in [[4, 4, 1], [5, 3, 1], [3, 4, 5], [1, 7, 1]] {
            let boundary = boundary(sides);
            let plan = Plan::new(Voxels::Grid(sides), &Aabb { lo: Vec3::ZERO, hi: Vec3::ONE }, &[]);
            for i in 0..sides.iter().product::<u32>() {
                let at = [i % sides[0], i / sides[0] % sides[1], i / sides[0] / sides[1]];
                let centre = Vec3::from_array([0, 1, 2].map(|axis| (at[axis] as f32 + 0.5) / sides[axis] as f32));
                let inner = |axis: usize| sides[axis] == 1 || (1..sides[axis] - 1).contains(&at[axis]);
                plan.place(&Aabb { lo: centre, hi: centre }, |voxel, _| {
                    assert_eq!(boundary[voxel as usize], !(0..3).all(inner), "{sides:?}: {at:?}");
                });
            }
        }
    }

    #[test]
    fn errors_name_what_would_do() {
        for (nodes, grid) in [(16, [4, 4]), (8, [4, 2]), (7, [7, 1]), (2, [2, 1])] {
            for voxels in ["1", "16", "3x3x1"] {
                let objects = vec![1; nodes];
                let location = |voxels| barred(Criterion::Location, voxels, &objects);
                assert_eq!(location(voxels.parse().unwrap()), Err(NoCandidate::NoGrid(grid)), "{nodes} {voxels}");
                assert!(location(Voxels::Grid([grid[0], grid[1], 1])).is_ok());
            }
        }
        let objects = [40, 30, 50];
        let most = |most| barred(Criterion::Objects(most), Voxels::One, &objects);
        assert_eq!(most(29), Err(NoCandidate::Objects { most: 29, least: 30 }));
        assert_eq!(most(30), Ok(vec![false, true, false, true]));
    }
}
