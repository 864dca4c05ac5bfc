//! `terrain`: fractal mountains of exactly as many triangles as asked for, in one sheet without cracks.

use super::noise::ridges;
use super::strip::{Row, strip};
use super::vector::{V, narrow, unit};
use crate::build::{Object, Objects};
use crate::model::{self, CameraSpec, Mesh, Model};
use hybray_shading::{Light, LightKind, Material};

/// Widest lattice cell of the noise, as a share of the terrain's side.
const COARSEST: f64 = 1.0 / 5.0;
/// Height of one unit of noise; the terrain's side is 2.
const RELIEF: f64 = 0.17;

/// The terrain without its triangles, and those one after the other.
pub fn streamed(triangles: u32) -> (Model, Triangles) {
    (about(triangles), Triangles(triangles))
}

/// A square of exactly `triangles` triangles, over x and y from -1 to 1, z up.
///
/// Rows of vertices are joined by strips ([`strip`]). Two rows of c segments make 2 c triangles; where the count does
/// not divide evenly, some rows get one segment more: an inner row adds two triangles, the last one adds one. Vertices
/// and triangles are made in order into room of the exact size, and nothing else is allocated.
/// 20,000,000 triangles take 360 MB, mesh and peak alike, and 2.9 s on one core of an AMD EPYC.
pub fn terrain(triangles: u32) -> Model {
    let mut model = about(triangles);
    model.meshes.push(Mesh { name: "terrain".to_owned(), material: 0, ..sheet(triangles) });
    model
}

fn about(triangles: u32) -> Model {
    let ground = [0.42, 0.40, 0.30];
    let mut model = Model {
        lights: vec![sun()],
        cameras: vec![camera()],
        background: [0.45, 0.62, 0.85],
        ambient: [0.12, 0.15, 0.20],
        objects: model::Objects { polygons: u64::from(triangles), ..model::Objects::default() },
        ..Model::default()
    };
    let material = Material { diffuse: ground, ambient: ground, ..Material::MATT };
    model.add_material("ground", material);
    model
}

fn sun() -> Light {
    Light {
        kind: LightKind::Directional as u32,
        axis: narrow(unit([0.8, -0.35, -0.5])),
        colour: [1.7, 1.57, 1.36],
        samples: 1,
        ..Light::default()
    }
}

fn camera() -> CameraSpec {
    CameraSpec {
        name: "whole".to_owned(),
        eye: [0.0, -2.7, 2.2],
        target: [0.0, -0.15, 0.0],
        up: [0.0, 0.0, 1.0],
        fov_y_degrees: 45.0,
        hither: 0.0,
        size: None,
        ..CameraSpec::default()
    }
}

/// How the rows are laid out.
struct Plan {
    /// Strips; there is one row more.
    strips: u32,
    /// Segments of a plain row.
    segments: u32,
    /// Triangles still missing when all rows are plain, less than 2 `strips`.
    missing: u32,
}

impl Plan {
    fn new(triangles: u32) -> Self {
        let strips = (f64::from(triangles) / 2.0).sqrt() as u32;
        let strips = strips.max(1);
        let segments = triangles / (2 * strips);
        Self { strips, segments, missing: triangles - 2 * strips * segments }
    }

    /// Segments of row `i`, 0 to `strips`. Rows 1 to `missing / 2` are inner ones, for `missing < 2 strips`.
    fn row(&self, i: u32) -> u32 {
        let longer = if i == self.strips { self.missing % 2 == 1 } else { (1..=self.missing / 2).contains(&i) };
        self.segments + u32::from(longer)
    }

    fn vertices(&self) -> usize {
        (0..=self.strips).map(|i| self.row(i) as usize + 1).sum()
    }

    /// The finest octave has two cells or more to a lattice cell: finer would only be sampled badly.
    fn octaves(&self) -> u32 {
        let mut octaves = 1;
        while octaves < 14 && f64::from(2_u32 << octaves) <= f64::from(self.strips) * COARSEST {
            octaves += 1;
        }
        octaves
    }

    /// The vertices of row `i`.
    fn points(&self, i: u32, octaves: u32) -> impl Iterator<Item = [f32; 3]> {
        let (segments, v) = (self.row(i), f64::from(i) / f64::from(self.strips));
        (0..=segments).map(move |j| narrow(place(f64::from(j) / f64::from(segments), v, octaves)))
    }
}

/// A terrain's triangles, made while they are told: two rows of vertices are all that is held.
pub struct Triangles(u32);

impl Objects for Triangles {
    fn len(&self) -> u64 {
        u64::from(self.0)
    }

    fn each<E>(&self, mut tell: impl FnMut(&Object) -> Result<(), E>) -> Result<(), E> {
        let plan = Plan::new(self.0);
        let octaves = plan.octaves();
        let (mut points, mut triangles, mut id) = (Vec::new(), Vec::new(), 0);
        points.extend(plan.points(0, octaves));
        for i in 1..=plan.strips {
            let below = points.len() as u32;
            points.extend(plan.points(i, octaves));
            let rows = [(0, i - 1), (below, i)].map(|(first, row)| Row { first, segments: plan.row(row) });
            triangles.clear();
            strip(rows[0], rows[1], false, i, &mut triangles);
            for t in &triangles {
                tell(&Object::triangle(id, 0, t.map(|vertex| points[vertex as usize]), None))?;
                id += 1;
            }
            points.drain(..below as usize);
        }
        Ok(())
    }
}

fn sheet(triangles: u32) -> Mesh {
    let plan = Plan::new(triangles);
    let octaves = plan.octaves();
    let mut mesh = Mesh {
        positions: Vec::with_capacity(plan.vertices()),
        triangles: Vec::with_capacity(triangles as usize),
        ..Mesh::default()
    };
    let mut below = None;
    for i in 0..=plan.strips {
        let row = Row { first: mesh.positions.len() as u32, segments: plan.row(i) };
        mesh.positions.extend(plan.points(i, octaves));
        if let Some(below) = below {
            strip(below, row, false, i, &mut mesh.triangles);
        }
        below = Some(row);
    }
    mesh
}

/// The point over `u` and `v`, 0 to 1.
fn place(u: f64, v: f64, octaves: u32) -> V {
    [2.0 * u - 1.0, 2.0 * v - 1.0, RELIEF * ridges(u / COARSEST, v / COARSEST, octaves)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::checks;

    /// Exactly as many as asked for; the boundary is the rim and nothing else; a disc by Euler's formula; all of the
    /// square covered once (areas seen from above are positive and add up to 4).
    #[track_caller]
    fn check(triangles: u32) {
        let model = terrain(triangles);
        checks::sound(&model);
        let mesh = &model.meshes[0];
        assert_eq!(mesh.triangles.len(), triangles as usize);
        assert_eq!(mesh.triangles.capacity(), mesh.triangles.len());
        assert_eq!(mesh.positions.capacity(), mesh.positions.len());
        let rim = checks::open_edges(mesh);
        let plan = Plan::new(triangles);
        assert_eq!(rim as u32, plan.row(0) + plan.row(plan.strips) + 2 * plan.strips, "{triangles}");
        let edges = (3 * mesh.triangles.len() + rim) / 2;
        assert_eq!(mesh.positions.len() + mesh.triangles.len(), edges + 1, "{triangles}");
        let mut area = 0.0;
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
            let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            assert!(twice > 0.0, "{triangles}: {t:?}");
            area += twice / 2.0;
        }
        assert!((area - 4.0).abs() < 1e-5, "{triangles}: {area}");
    }

    #[test]
    fn exact_counts() {
        (2..400).for_each(check);
        for triangles in [999, 4_096, 65_537, 99_991, 250_000] {
            check(triangles);
        }
    }

    /// Told one after the other, they are those of the mesh.
    #[test]
    fn streamed_triangles_are_the_same() {
        for triangles in [2, 3, 100, 10_007] {
            let model = terrain(triangles);
            let mesh = &model.meshes[0];
            let (about, stream) = streamed(triangles);
            assert_eq!((about.lights, about.cameras, about.materials.len()), (model.lights, model.cameras, 1));
            let mut expected = (0..).zip(&mesh.triangles).map(|(id, t)| {
                Object::triangle(id, mesh.material, t.map(|vertex| mesh.positions[vertex as usize]), None)
            });
            let told = stream.each(|object| if expected.next() == Some(*object) { Ok(()) } else { Err(*object) });
            assert_eq!((told, expected.next()), (Ok(()), None), "{triangles}");
        }
    }

    #[test]
    fn the_largest_plans_add_up() {
        for triangles in [19_999_999, 20_000_000, 12_345_679] {
            let plan = Plan::new(triangles);
            let total: u32 = (0..plan.strips).map(|i| plan.row(i) + plan.row(i + 1)).sum();
            assert_eq!(total, triangles);
        }
    }

    #[test]
    fn seen_whole_at_every_size() {
        for triangles in [2, 3, 100, 10_007, 200_000] {
            assert_eq!(checks::share_in_view(&tagged(triangles)), 1.0, "{triangles}");
        }
    }

    /// Two triangles would count as a ground: one more keeps the mesh in the count.
    fn tagged(triangles: u32) -> Model {
        let mut model = terrain(triangles);
        model.meshes[0].triangles.push([0, 1, 2]);
        model
    }

    /// Mountains, not a plane and not spikes.
    #[test]
    fn has_relief() {
        let mesh = &terrain(20_000).meshes[0];
        let heights = mesh.positions.iter().map(|p| p[2]);
        let (low, high) = heights.fold((f32::MAX, f32::MIN), |(l, h), z| (l.min(z), h.max(z)));
        assert!(low >= 0.0 && high < 0.33 && high - low > 0.15, "{low} {high}");
    }
}
