//! PyraClip over a tree of one's own: dust in a cube, cut at midpoints, and the cliplist of one pyramid.
//!
//! `cargo run -p hybray-pyraclip --example any_tree`

use hybray_geometry::{Aabb, Pyramid, Vec3};
use hybray_pyraclip::{Bintree, ClipCounts, ClipPyramid, Split, clip, midpoint};
use std::ops::ControlFlow;

/// A cell is a range of grains, which the building of the tree has sorted.
#[derive(Clone, Copy, Debug)]
struct Cell {
    first: usize,
    count: usize,
    halves: Option<(usize, f32, usize, usize)>,
}

struct Dust {
    grains: Vec<Vec3>,
    cells: Vec<Cell>,
}

const CUBE: Aabb = Aabb { lo: Vec3::ZERO, hi: Vec3::ONE };
const GRAINS_IN_CELL: usize = 12;
const LEVELS: usize = 18;

impl Dust {
    fn new(grains: Vec<Vec3>) -> Self {
        let whole = Cell { first: 0, count: grains.len(), halves: None };
        let mut dust = Self { grains, cells: vec![whole] };
        let mut open = vec![(0, CUBE, 0)];
        while let Some((at, aabb, level)) = open.pop() {
            let Cell { first, count, .. } = dust.cells[at];
            if count <= GRAINS_IN_CELL || level == LEVELS {
                continue;
            }
            let axis = level % 3;
            let plane = midpoint(aabb.lo[axis], aabb.hi[axis]);
            // A grain has no size: one on the plane needs to be in one half only, and no ray will ask.
            let grains = &mut dust.grains[first..first + count];
            grains.sort_by(|a, b| a[axis].total_cmp(&b[axis]));
            let below = grains.partition_point(|g| g[axis] < plane);
            let (mut lower, mut upper) = (aabb, aabb);
            lower.hi[axis] = plane;
            upper.lo[axis] = plane;
            for (first, count, aabb) in [(first, below, lower), (first + below, count - below, upper)] {
                dust.cells.push(Cell { first, count, halves: None });
                open.push((dust.cells.len() - 1, aabb, level + 1));
            }
            dust.cells[at].halves = Some((axis, plane, dust.cells.len() - 2, dust.cells.len() - 1));
        }
        dust
    }
}

impl Bintree for Dust {
    type Cell = usize;
    fn root(&self) -> (usize, Aabb) {
        (0, CUBE)
    }
    fn split(&self, cell: usize) -> Option<Split<usize>> {
        self.cells[cell].halves.map(|(axis, plane, lower, upper)| Split { axis, plane, lower, upper })
    }
    fn is_empty(&self, cell: usize) -> bool {
        self.cells[cell].count == 0
    }
}

fn main() {
    // Three square roots, multiplied: a cheap sequence that fills a cube evenly.
    let grain = |i: usize| Vec3::new(0.414_213_56, 0.732_050_8, 0.236_067_98).map(|root| (root * i as f32).fract());
    let dust = Dust::new((1..=2_000).map(grain).collect());

    let eye = Vec3::new(0.5, 0.4, -1.0);
    let corner = |x: f32, y: f32| Vec3::new(x, y, 1.0);
    let corners = [corner(0.0, 0.0), corner(0.0, 0.05), corner(0.05, 0.05), corner(0.05, 0.0)];
    let Some(pyramid) = Pyramid::through(eye, corners).as_ref().and_then(ClipPyramid::new) else {
        println!("not a pyramid");
        return;
    };

    let mut counts = ClipCounts::default();
    let done = clip(&dust, &pyramid, &mut counts, |cell| {
        let inside = if cell.inside { "  inside" } else { "" };
        println!("{:2} grains  {} .. {}{inside}", dust.cells[cell.cell].count, cell.aabb.lo, cell.aabb.hi);
        ControlFlow::Continue(())
    });
    match done {
        Ok(_) => println!("{counts:#?}"),
        Err(error) => println!("{error}"),
    }
}
