//! Light caches (report, chapter 4 and figure 4.2): pages between what a node owns and the lights.
//!
//! The report keeps all objects between a process' voxel and each light, and leaves a bound to be added. Here the bound is a
//! number of bytes, and what a node has for each light is an unbroken run of pages, the nearest to the light first: a shadow
//! ray that gets through it needs nothing that lies nearer to the light than the run goes, and what is left of it is
//! forwarded (`core/bintree/src/walk.rs`). Pure functions; lengths are in the scene's internal unit.

use hybray_geometry::{Aabb, Vec3};
use hybray_scene::{Child, Directory, Line, lines_for};
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{Plan, PlanError, bytes_of_copies};
use hybray_shading::{Light, LightKind};
use hybray_tracer::Scene;

/// Light caches of nodes: what is given out, and what it takes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightCaches {
    /// The pages of each node, node 1's first; none if there are no caches.
    pub pages: Vec<Vec<u32>>,
    /// Bytes of the largest, in whole lines.
    pub bytes: u64,
}

/// Light caches of `bytes` for each of `nodes`, or such as the policy has, and the plan with them. `memory` is what `plan` was
/// made for.
///
/// By default `hybrid-1995` has all pages between, as published, if they fit in half of what is left of a node's memory, and
/// otherwise none: where pages are few, what primary rays fetch needs the room more. The others have none.
///
/// # Errors
/// If there is no room for as many as were asked for.
pub fn light_caches(
    plan: Plan,
    memory: u64,
    bytes: Option<u64>,
    policy: Policy,
    scene: &Scene<'_>,
    owners: &[u16],
    nodes: u16,
) -> Result<(Plan, LightCaches), PlanError> {
    let by_default = if policy == Policy::Hybrid1995 { u64::MAX } else { 0 };
    let most = bytes.unwrap_or(by_default);
    if most == 0 || plan.holds_all {
        return Ok((plan, LightCaches::default()));
    }
    let pages = towards_lights(&scene.resident.directory, scene.shading.lights, owners, nodes, most);
    let taken = bytes_of_copies(scene.resident.directory.entries, &pages);
    if bytes.is_none() && taken > plan.room_for_copies(memory) / 2 {
        return Ok((plan, LightCaches::default()));
    }
    Ok((plan.with_copies(taken, memory)?, LightCaches { pages, bytes: taken }))
}

/// For each node, the pages of others between the box of those that it owns and the lights, `most` bytes of them: one for
/// each light in turn, the nearest to the light first. A light's turns are over when a page does not fit.
fn towards_lights(directory: &Directory<'_>, lights: &[Light], owners: &[u16], nodes: u16, most: u64) -> Vec<Vec<u32>> {
    let boxes = page_boxes(directory);
    let of_node = |node: u16| {
        let own = boxes.iter().zip(owners).filter(|&(_, &owner)| owner == node);
        let own = own.fold(Aabb::EMPTY, |all, (aabb, _)| all.union(aabb));
        if own.is_empty() {
            return Vec::new();
        }
        let mut runs: Vec<_> = lights.iter().map(|light| Sweep::new(&own, light).run(&boxes).into_iter()).collect();
        let mut has: Vec<bool> = owners.iter().map(|&owner| owner == node).collect();
        let (mut taken, mut room) = (Vec::new(), most);
        while !runs.is_empty() {
            runs.retain_mut(|run| {
                // Pages that are there already are passed over: the run is not broken by them.
                let Some(page) = run.find(|&page| !has[page as usize]) else { return false };
                let lines = lines_for(directory.entries[page as usize].bytes as usize);
                let Some(rest) = room.checked_sub((lines * size_of::<Line>()) as u64) else { return false };
                room = rest;
                has[page as usize] = true;
                taken.push(page);
                true
            });
        }
        taken
    };
    (1..=nodes).map(of_node).collect()
}

fn page_boxes(directory: &Directory<'_>) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; directory.entries.len()];
    for node in directory.nodes {
        for (slot, child) in node.children() {
            if let Child::Page(page) = child {
                boxes[page as usize] = node.aabb(slot);
            }
        }
    }
    boxes
}

/// A box that moves to a light and becomes it on the way: what it sweeps is all that lies between. Every shadow ray from the
/// box has its point at `t` in the box at `t`.
struct Sweep {
    from: Aabb,
    /// What each corner moves by up to `t` = 1.
    by: [Vec3; 2],
    end: f32,
}

impl Sweep {
    fn new(from: &Aabb, light: &Light) -> Self {
        let position = Vec3::from(light.position);
        let to = match light.kind() {
            LightKind::Point | LightKind::Spot => Aabb::around(&[position]),
            LightKind::Sphere => {
                Aabb { lo: position - Vec3::splat(light.radius), hi: position + Vec3::splat(light.radius) }
            }
            LightKind::Rectangle => {
                let (u, v) = (Vec3::from(light.u), Vec3::from(light.v));
                Aabb::around(&[position, position + u, position + v, position + u + v])
            }
            // From all around: no page lies before others.
            LightKind::Environment => return Self { from: *from, by: [Vec3::ZERO; 2], end: -1.0 },
            LightKind::Directional => {
                return Self { from: *from, by: [-Vec3::from(light.axis); 2], end: f32::INFINITY };
            }
        };
        Self { from: *from, by: [to.lo - from.lo, to.hi - from.hi], end: 1.0 }
    }

    /// The last `t` at which the box touches `other`; `None` if it never does.
    fn leaves(&self, other: &Aabb) -> Option<f32> {
        let (mut from, mut until) = (0.0f32, self.end);
        // A distance that must not be below 0, and what it grows by.
        let mut bound = |distance: f32, by: f32| {
            if by > 0.0 {
                from = from.max(-distance / by);
            } else if by < 0.0 {
                until = until.min(distance / -by);
            } else if distance < 0.0 {
                until = f32::NEG_INFINITY;
            }
        };
        for axis in 0..3 {
            bound(self.from.hi[axis] - other.lo[axis], self.by[1][axis]);
            bound(other.hi[axis] - self.from.lo[axis], -self.by[0][axis]);
        }
        (from <= until).then_some(until)
    }

    /// The pages that it touches, from the light on.
    fn run(&self, boxes: &[Aabb]) -> Vec<u32> {
        let met = (0..).zip(boxes).filter(|(_, aabb)| !aabb.is_empty());
        let mut met: Vec<(f32, u32)> = met.filter_map(|(page, aabb)| Some((self.leaves(aabb)?, page))).collect();
        met.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        met.into_iter().map(|(_, page)| page).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::owners::tests::Random;
    use super::*;
    use hybray_scene::{Node, PageEntry};

    /// Boxes as pages of so many bytes under one directory of one level or two.
    fn directory(pages: &[(Aabb, u32)]) -> (Vec<Node>, Vec<PageEntry>) {
        let entries = pages.iter().map(|&(_, bytes)| PageEntry { bytes, owner: 0, kind: 0 }).collect();
        let numbered: Vec<_> = (0..).zip(pages).collect();
        let nodes = numbered.chunks(8).map(|of_node| {
            let mut node = Node::EMPTY;
            of_node.iter().enumerate().for_each(|(slot, (page, (aabb, _)))| node.set(slot, aabb, Child::Page(*page)));
            node
        });
        (nodes.collect(), entries)
    }

    fn cube(x: f32, y: f32) -> Aabb {
        Aabb { lo: Vec3::new(x, y, 0.0), hi: Vec3::new(x + 1.0, y + 1.0, 1.0) }
    }

    fn taken(pages: &[(Aabb, u32)], lights: &[Light], owners: &[u16], nodes: u16, most: u64) -> Vec<Vec<u32>> {
        let (nodes_of, entries) = directory(pages);
        towards_lights(&Directory { nodes: &nodes_of, entries: &entries }, lights, owners, nodes, most)
    }

    /// A row of cubes from x = 0 to 9, another beside it that is in nobody's way, and lights at its end, of all kinds.
    #[test]
    fn from_the_light_to_the_node() {
        let mut pages: Vec<_> = (0..10).map(|x| (cube(x as f32, 0.0), 100)).collect();
        pages.extend((0..10).map(|x| (cube(x as f32, 3.0), 100)));
        let mut owners = vec![2; 20];
        owners[0] = 1;
        let lights = [
            Light { position: [20.0, 0.5, 0.5], ..Light::default() },
            Light { position: [20.0, 0.5, 0.5], kind: LightKind::Spot as u32, ..Light::default() },
            Light { position: [20.0, 0.5, 0.5], radius: 0.25, kind: LightKind::Sphere as u32, ..Light::default() },
            Light {
                position: [20.0, 0.25, 0.25],
                u: [0.0, 0.5, 0.0],
                v: [0.0, 0.0, 0.5],
                kind: LightKind::Rectangle as u32,
                ..Light::default()
            },
            Light { axis: [-1.0, 0.0, 0.0], kind: LightKind::Directional as u32, ..Light::default() },
        ];
        for light in &lights {
            let of = |most| taken(&pages, std::slice::from_ref(light), &owners, 2, most).swap_remove(0);
            assert_eq!(of(u64::MAX), [9, 8, 7, 6, 5, 4, 3, 2, 1], "{light:?}");
            // 100 bytes are two lines.
            assert_eq!((of(128 * 4), of(128 * 4 - 1), of(127)), (vec![9, 8, 7, 6], vec![9, 8, 7], vec![]), "{light:?}");
            // Page 7 is its own, and breaks no run; a page that does not fit does.
            owners[7] = 1;
            assert_eq!(taken(&pages, &[*light], &owners, 2, 128 * 3)[0], [9, 8, 6], "{light:?}");
            owners[7] = 2;
            pages[7].1 = 1000;
            assert_eq!(taken(&pages, &[*light], &owners, 2, 128 * 5)[0], [9, 8], "{light:?}");
            pages[7].1 = 100;
        }
        // Lights take turns, and what is there for one is there for the other.
        let behind = Light { position: [-10.0, 0.5, 0.5], ..Light::default() };
        (owners[0], owners[4]) = (2, 1);
        assert_eq!(taken(&pages, &[lights[0], behind], &owners, 2, u64::MAX)[0], [9, 0, 8, 1, 7, 2, 6, 3, 5]);
        assert_eq!(
            taken(&pages, &[lights[0], lights[1], behind], &owners, 2, u64::MAX)[0],
            [9, 8, 0, 7, 6, 1, 5, 3, 2]
        );
        // Whoever owns nothing spawns nothing there.
        assert!(taken(&pages, &lights, &owners, 3, u64::MAX)[2].is_empty());
        assert!(taken(&pages, &[], &owners, 2, u64::MAX).iter().all(Vec::is_empty));
    }

    /// Whatever a shadow ray from the box to the light meets, the sweep meets, and leaves it no sooner than the ray.
    #[test]
    fn no_shadow_ray_meets_another_page() {
        let random = &mut Random(5);
        let mut at =
            |scale: f32| Vec3::from_array(std::array::from_fn(|_| (random.below(2001) as f32 / 1000.0 - 1.0) * scale));
        let (mut met, mut passed) = (0, 0);
        for round in 0..3000 {
            let scale = [1.0, 1e6, 1e-6][round % 3];
            let mut aabb = |size: f32| {
                let corner = at(scale);
                Aabb::around(&[corner, corner + at(scale * size)])
            };
            let (from, to, other) = (aabb(0.6), aabb(0.2), aabb(1.0));
            let middle = |b: &Aabb| (b.lo + b.hi) * 0.5;
            let axis = at(1.0);
            let light = match round % 4 {
                0 => Light { position: to.lo.to_array(), ..Light::default() },
                1 => Light { axis: axis.to_array(), kind: LightKind::Directional as u32, ..Light::default() },
                2 => Light {
                    position: middle(&to).to_array(),
                    radius: 0.1 * scale,
                    kind: LightKind::Sphere as u32,
                    ..Light::default()
                },
                _ => Light {
                    position: to.lo.to_array(),
                    u: (to.hi - to.lo).to_array(),
                    v: at(0.1 * scale).to_array(),
                    kind: LightKind::Rectangle as u32,
                    ..Light::default()
                },
            };
            let left = Sweep::new(&from, &light).leaves(&other);
            for _ in 0..40 {
                let share = at(1.0);
                let start = middle(&from) + (from.hi - from.lo) * 0.5 * share;
                let position = Vec3::from(light.position);
                let way = match light.kind() {
                    LightKind::Directional => -axis,
                    LightKind::Rectangle => {
                        position + (Vec3::from(light.u) * share.x.abs() + Vec3::from(light.v) * share.y.abs()) - start
                    }
                    LightKind::Sphere => position + at(1.0).normalize_or_zero() * light.radius - start,
                    _ => position - start,
                };
                let end = if light.kind() == LightKind::Directional { f64::INFINITY } else { 1.0 };
                // The ray's interval in the other box, in f64.
                let (mut near, mut far): (f64, f64) = (0.0, end);
                for i in 0..3 {
                    let [o, d, lo, hi] = [start[i], way[i], other.lo[i], other.hi[i]].map(f64::from);
                    let [a, b] = [(lo - o) / d, (hi - o) / d];
                    (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
                }
                if near <= far {
                    met += 1;
                    let left = left.unwrap_or_else(|| panic!("round {round}: not met at all"));
                    assert!(f64::from(left) >= far - 1e-4 * far.abs().max(1.0), "round {round}: {left}, not {far}");
                } else {
                    passed += 1;
                }
            }
        }
        assert!(met > 2000 && passed > 2000, "{met} met, {passed} passed");
    }
}
