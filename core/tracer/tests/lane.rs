//! Lanes over a small scene: ledgers close, contributions are those of any other order, shadows are right.

mod world;

use hybray_bintree::walk::{self, Stack};
use hybray_geometry::simd::Kernels;
use hybray_geometry::{Candidate, Ray, Sphere, Triangle, Vec3};
use hybray_shading::{Light, Material, id, spawn};
use hybray_tracer::{HitRecord, Lane, Origin, Scene, Sink, TOGETHER, Together, Walker, begin, goes_together, surface};
use hybray_wire::{Counts, RayKind, RayRecord, ShadowRecord};
use world::{Shape, World, hall};

/// What a film would get.
#[derive(Default)]
struct Record {
    /// Bits of each contribution.
    contributions: Vec<[u32; 3]>,
    entries: u64,
    ended: u64,
}

impl Sink for Record {
    fn contribute(&mut self, origin: &Origin, radiance: [f32; 3]) {
        assert_eq!(*origin, ORIGIN, "everything is added where the primary ray belongs");
        self.contributions.push(radiance.map(f32::to_bits));
    }
    fn ended(&mut self, origin: &Origin, entry: u64) {
        assert_eq!(*origin, ORIGIN);
        self.entries = self.entries.wrapping_add(entry);
        self.ended += 1;
    }
}

impl Record {
    fn sum(&self) -> [f64; 3] {
        let channel = |c: usize| self.contributions.iter().map(|x| f64::from(f32::from_bits(x[c]))).sum();
        [channel(0), channel(1), channel(2)]
    }
}

const ORIGIN: Origin = Origin { tile: 5, epoch: 2, home: 3, pixel: 61 };

/// Scratch of a walker.
#[derive(Default)]
struct Room(Stack, Together);

fn walker(room: &mut Room) -> Walker<'_> {
    Walker::new(Kernels::Portable, &mut room.0, &mut room.1)
}

fn primary(origin: Vec3, direction: Vec3, id: u64) -> RayRecord {
    RayRecord {
        origin: origin.to_array(),
        direction: (direction / direction.length()).to_array(),
        t_min: 0.0,
        t_max: f32::INFINITY,
        id,
        primitive: Candidate::NOTHING,
        weight: [1.0; 3],
        pixel: ORIGIN.pixel,
        tile: ORIGIN.tile,
        epoch: ORIGIN.epoch,
        home: ORIGIN.home,
        page: RayRecord::FROM_ROOT,
        kind: RayKind::Primary as u8,
        depth: 1,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Traces `ray` and all that it causes in a lane of `records` records: it brings the same with bundles of shadow rays.
fn trace(scene: &Scene<'_>, ray: &RayRecord, records: usize) -> (Record, Counts) {
    let (single, counts) = trace_with(scene, ray, records, false);
    let (mut together, counts_together) = trace_with(scene, ray, records, true);
    assert_eq!((together.entries, together.ended, counts_together), (single.entries, single.ended, counts), "{ray:?}");
    together.contributions.sort_unstable();
    let mut sorted = single.contributions.clone();
    sorted.sort_unstable();
    assert_eq!(together.contributions, sorted, "{ray:?}");
    (single, counts)
}

fn trace_with(scene: &Scene<'_>, ray: &RayRecord, records: usize, bundles: bool) -> (Record, Counts) {
    let (mut record, mut counts, mut scratch) = (Record::default(), Counts::default(), Room::default());
    let mut room = vec![HitRecord::EMPTY; records];
    let mut lane = Lane::new(&mut room);
    let mut walker = Walker { bundles, ..walker(&mut scratch) };
    assert_eq!(lane.take(scene, &mut walker, *ray, &mut record, &mut counts), None, "every page is at hand");
    let mut steps = 0;
    while !lane.is_empty() {
        assert_eq!(lane.step(scene, &mut walker, &mut record, &mut counts), None, "every page is at hand");
        steps += 1;
        assert!(steps < 10_000_000, "a lane comes to an end");
    }
    (record, counts)
}

fn through_the_hall(count: u32) -> impl Iterator<Item = RayRecord> {
    (0..count).map(|i| {
        let [u, v] = id::unit_pair(99, i);
        let eye = Vec3::new(0.2, 0.6, 2.0);
        let target = Vec3::new(2.4 * u - 1.2, 0.9 * v, 0.0);
        primary(eye, target - eye, id::primary_id(1, i, 0))
    })
}

fn nearest(scene: &Scene<'_>, ray: &Ray) -> walk::Hit {
    walk::nearest(Kernels::Portable, &scene.resident, ray, &mut Stack::new(), &mut walk::Counts::default())
}

/// What of a shadow ray arrives, surface by surface: the end of the ray is worked out again at each from where it is then.
fn arriving_by_hand(scene: &Scene<'_>, ray: &Ray, weight: [f32; 3]) -> [f32; 3] {
    let hit = nearest(scene, ray);
    if !hit.candidate.is_hit() {
        return weight;
    }
    let record = RayRecord {
        origin: ray.origin.to_array(),
        direction: ray.direction.to_array(),
        t_max: hit.candidate.t,
        ..bytemuck::Zeroable::zeroed()
    };
    let place = surface(&scene.resident.pages[hit.page as usize], &record, &hit).unwrap();
    let Some((origin, rest)) = spawn::pass_through(&scene.shading, &place, 1.0, weight) else { return [0.0; 3] };
    let end = ray.origin + ray.direction * ray.t_max;
    let direction = if ray.t_max < f32::INFINITY { (end - origin) / ray.t_max } else { ray.direction };
    arriving_by_hand(scene, &Ray { origin, direction, ..*ray }, rest)
}

/// All rays of a tree by a queue, not a stack, in the crates below the tracer: what a lane must agree with.
fn breadth_first(scene: &Scene<'_>, primary: &RayRecord) -> Vec<[u32; 3]> {
    let mut queue = std::collections::VecDeque::from([*primary]);
    let mut found = Vec::new();
    let mut add = |radiance: [f32; 3]| {
        if radiance != [0.0; 3] {
            found.push(radiance.map(f32::to_bits));
        }
    };
    while let Some(ray) = queue.pop_front() {
        let hit = nearest(scene, &ray.ray());
        if !hit.candidate.is_hit() {
            add([0, 1, 2].map(|c| ray.weight[c] * scene.background[c]));
            continue;
        }
        let place = surface(&scene.resident.pages[hit.page as usize], &ray, &hit).unwrap();
        let facing = spawn::Facing::new(&place, hybray_shading::Look::PLAIN);
        add(spawn::local(&scene.shading, &facing, [1.0; 3], ray.weight));
        for cursor in 0..spawn::children(&scene.shading, &place) {
            let depth = ray.depth.into();
            let (origin, direction, weight, medium, branch, kind) =
                match spawn::child(&scene.shading, &facing, ray.weight, depth, ray.id, cursor) {
                    spawn::Child::None => continue,
                    spawn::Child::Shadow { origin, direction, t_max, contribution, .. } => {
                        add(arriving_by_hand(scene, &Ray { origin, direction, t_min: 0.0, t_max }, contribution));
                        continue;
                    }
                    spawn::Child::Mirror { origin, direction, weight, medium, branch, .. } => {
                        (origin, direction, weight, medium, branch, RayKind::Mirror)
                    }
                    spawn::Child::Refract { origin, direction, weight, medium, branch } => {
                        (origin, direction, weight, medium, branch, RayKind::Refract)
                    }
                };
            queue.push_back(RayRecord {
                origin: origin.to_array(),
                direction: direction.to_array(),
                weight,
                medium,
                kind: kind as u8,
                id: id::child_id(ray.id, branch),
                depth: ray.depth + 1,
                t_min: 0.0,
                ..ray
            });
        }
    }
    found
}

#[test]
fn ledgers_close_exactly() {
    let world = hall();
    let mut most = 0;
    for depth in [1, 2, 5, 12] {
        world.with(|scene| {
            let mut scene = *scene;
            scene.shading.ray_depth_max = depth;
            for ray in through_the_hall(300) {
                let (record, counts) = trace(&scene, &ray, depth as usize);
                assert_eq!(record.entries, ray.id.wrapping_neg(), "{ray:?}");
                assert_eq!(record.ended, 1 + counts.secondary + counts.shadow, "each ray ends once");
                assert!(counts.hits <= 1 + counts.secondary);
                assert!(depth > 1 || counts.secondary == 0);
                most = most.max(record.ended);
            }
        });
    }
    assert!(most > 50, "the hall has deep trees: {most}");
}

/// An entry lost, or one told twice, leaves the ledger open.
#[test]
fn a_ledger_with_a_fault_stays_open() {
    struct Faulty(u64, u64, [u64; 2]);
    impl Sink for Faulty {
        fn contribute(&mut self, _: &Origin, _: [f32; 3]) {}
        fn ended(&mut self, _: &Origin, entry: u64) {
            self.0 = self.0.wrapping_add(entry);
            self.1 += 1;
            self.2[(self.1 % 2) as usize] = entry;
        }
    }
    hall().with(|scene| {
        for ray in through_the_hall(100) {
            let (mut sink, mut counts, mut stack) = (Faulty(ray.id, 0, [0; 2]), Counts::default(), Room::default());
            let mut room = [HitRecord::EMPTY; 5];
            let (mut lane, mut walker) = (Lane::new(&mut room), walker(&mut stack));
            let mut known = ray;
            let hit = walker.nearest(scene, &mut known).expect("every page is at hand");
            assert_eq!((known.settled, known.page, known.t_max), (1, hit.page, hit.candidate.t));
            let walks = &mut walk::Counts::default();
            let begun = begin(scene, &known, &hit, &mut sink, &mut counts, walks).expect("nothing is passed");
            begun.into_iter().for_each(|record| lane.push(record));
            while !lane.is_empty() {
                assert_ne!(sink.0, 0, "not zero before the tree has ended");
                assert_eq!(lane.step(scene, &mut walker, &mut sink, &mut counts), None);
            }
            let last = sink.2[(sink.1 % 2) as usize];
            assert_eq!(sink.0, 0);
            assert_ne!(last, 0, "so it would be seen if it were lost or repeated");
        }
    });
}

/// Hits that stand together, samples of lights, and what is seen in mirrors: no ray is sent twice, and none is left out.
#[test]
fn rays_together_bring_what_they_bring_singly() {
    let (mut answered, mut asked, mut followed) = (0, 0, 0);
    for world in [hall(), hall().opaque(), hall().softly_lit(), hall().softly_lit().opaque()] {
        world.with(|scene| {
            let (mut together, mut counts, mut scratch) = (Record::default(), Counts::default(), Room::default());
            let mut walker = Walker { bundles: true, ..walker(&mut scratch) };
            let (mut single, mut single_counts) = (Record::default(), Counts::default());
            let mut records = Vec::new();
            for mut ray in through_the_hall(400) {
                if records.len() == TOGETHER {
                    break;
                }
                let (record, counted) = trace_with(scene, &ray, 5, false);
                single.contributions.extend(record.contributions);
                single.entries = single.entries.wrapping_add(record.entries);
                single_counts += counted;
                let hit = walker.nearest(scene, &mut ray).expect("every page is at hand");
                let walks = &mut walk::Counts::default();
                records.extend(begin(scene, &ray, &hit, &mut together, &mut counts, walks).expect("nothing is passed"));
            }
            assert_eq!(records.len(), TOGETHER);
            let before = walker.ahead;
            let mut left = Vec::new();
            while !records.is_empty() {
                for cursor in (0..64).filter(|&cursor| goes_together(scene, cursor)) {
                    walker.shadows(scene, &mut records, cursor, &mut together, &mut counts);
                }
                let depth = records[0].depth;
                let (stay, all) = walker.follow(scene, &mut records, &mut together, &mut counts);
                records.truncate(all);
                let new = records.split_off(stay);
                assert!(records.iter().all(|r| r.depth == depth) && new.iter().all(|r| r.depth == depth + 1));
                left.append(&mut records);
                records = new;
            }
            answered += counts.shadow;
            asked += walker.ahead - before - counts.secondary;
            followed += counts.secondary;
            let mut room = [HitRecord::EMPTY; 5];
            let mut lane = Lane::new(&mut room);
            for record in left {
                lane.push(record);
                while !lane.is_empty() {
                    assert_eq!(lane.step(scene, &mut walker, &mut together, &mut counts), None);
                }
            }
            assert_eq!((counts, together.entries), (single_counts, single.entries));
            together.contributions.sort_unstable();
            single.contributions.sort_unstable();
            assert_eq!(together.contributions, single.contributions);
        });
    }
    assert!(answered > 300 && asked > answered + 10, "{asked} asked, {answered} answered");
    assert!(followed > 20, "{followed}");
}

#[test]
fn depth_first_finds_what_breadth_first_finds_under_soft_lights() {
    for world in [hall().softly_lit(), hall().softly_lit().opaque()] {
        world.with(|scene| depth_first_and_breadth_first(scene, 120));
    }
}

#[test]
fn depth_first_finds_what_breadth_first_finds() {
    hall().with(|scene| depth_first_and_breadth_first(scene, 400));
}

fn depth_first_and_breadth_first(scene: &Scene<'_>, rays: u32) {
    let mut all = 0;
    for ray in through_the_hall(rays) {
        let (mut record, _) = trace(scene, &ray, 5);
        let mut expected = breadth_first(scene, &ray);
        record.contributions.sort_unstable();
        expected.sort_unstable();
        assert_eq!(record.contributions, expected, "{ray:?}");
        all += expected.len();
    }
    assert!(all > 1_500, "{all}");
}

/// As many records as rays may be deep are enough, in a hall of mirrors too.
#[test]
fn records_bound_the_depth() {
    let mirror = Material { mirror: [1.0; 3], diffuse: [0.0; 3], emission: [0.25; 3], ..Material::MATT };
    let wall = |x: f32| Triangle { v: [Vec3::new(x, -9.0, -9.0), Vec3::new(x, 9.0, -9.0), Vec3::new(x, 0.0, 9.0)] };
    let shapes = vec![(Shape::Triangle(wall(-1.0)), 0), (Shape::Triangle(wall(1.0)), 0)];
    World::new(shapes, vec![mirror], vec![]).with(|scene| {
        for depth in [1, 2, 7, 64] {
            let mut scene = *scene;
            scene.shading.ray_depth_max = depth;
            let (record, counts) = trace(&scene, &primary(Vec3::ZERO, Vec3::X, 42), depth as usize);
            assert_eq!((counts.hits, counts.secondary), (depth.into(), u64::from(depth) - 1));
            assert_eq!(record.sum(), [0.25 * f64::from(depth); 3]);
            assert_eq!(record.entries, 42u64.wrapping_neg());
        }
    });
}

#[test]
fn what_hits_nothing_shows_the_background() {
    hall().with(|scene| {
        let ray = RayRecord { weight: [0.5, 1.0, 0.0], ..primary(Vec3::Y * 3.0, Vec3::Y, 9) };
        let (record, counts) = trace(scene, &ray, 1);
        let [r, g, _] = scene.background;
        assert_eq!(record.contributions, [[0.5 * r, g, 0.0].map(f32::to_bits)]);
        assert_eq!((record.entries, record.ended, counts.hits), (9u64.wrapping_neg(), 1, 0));
        // Black is not sent, but the ray ends all the same.
        let black = Scene { background: [0.0; 3], ..*scene };
        let (record, _) = trace(&black, &ray, 1);
        assert_eq!((record.contributions.len(), record.ended), (0, 1));
    });
}

/// Horizontal sheets between y = 0 and y = 1, the lowest first, each of its own material, over a matt floor.
fn sheets(transmissions: &[[f32; 3]]) -> World {
    let count = transmissions.len() as f32;
    let mut shapes = Vec::new();
    let mut sheet = |y: f32, material: usize| {
        let corner = |x: f32, z: f32| Vec3::new(x, y, z);
        // Tilted a little, so that no box is flat.
        let v = [corner(-3.0, -2.0), corner(3.1, -2.0), corner(0.1, 4.0) + Vec3::Y * (0.1 / (count + 1.0))];
        shapes.push((Shape::Triangle(Triangle { v }), material as u16));
    };
    sheet(0.0, 0);
    let mut materials = vec![Material::MATT];
    for (i, &transmission) in transmissions.iter().enumerate() {
        sheet((i as f32 + 1.0) / (count + 2.0), i + 1);
        materials.push(Material { transmission, ..Material::MATT });
    }
    let lamp = Light { position: [0.2, 3.0, 0.1], colour: [1.0; 3], ..Light::default() };
    World::new(shapes, materials, vec![lamp])
}

/// A shadow ray as a lane makes them.
fn shadow(origin: Vec3, direction: Vec3, t_max: f32, weight: [f32; 3]) -> RayRecord {
    RayRecord {
        origin: origin.to_array(),
        direction: direction.to_array(),
        t_max,
        t_end: t_max,
        weight,
        primitive: Candidate::NOTHING,
        page: RayRecord::FROM_ROOT,
        kind: RayKind::Shadow as u8,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// What of `[1, 0.5, 0.25]` arrives at the floor through the sheets.
fn arriving(transmissions: &[[f32; 3]]) -> [f32; 3] {
    sheets(transmissions).with(|scene| {
        let mut stack = Room::default();
        let from = Vec3::new(-0.1, 0.5 / (transmissions.len() as f32 + 2.0), -0.3);
        let mut ray = shadow(from, Vec3::new(0.2, 3.0, 0.1) - from, 1.0, [1.0, 0.5, 0.25]);
        walker(&mut stack).arriving(scene, &mut ray).expect("every page is at hand")
    })
}

#[test]
fn shadows_behind_glass() {
    let by_hand = |t: &[[f32; 3]]| t.iter().fold([1.0, 0.5, 0.25], |c, t| [c[0] * t[0], c[1] * t[1], c[2] * t[2]]);
    let check = |t: &[[f32; 3]]| assert_eq!(arriving(t), by_hand(t), "{t:?}");
    check(&[]);
    check(&[[0.5, 0.25, 0.75]]);
    check(&[[0.1, 0.2, 0.3], [0.3, 0.7, 0.9]]);
    check(&[[0.9, 0.8, 0.7], [0.3, 0.0, 1.0], [0.11, 0.5, 0.77], [0.99; 3]]);
    check(&[[0.97, 0.93, 0.99]; 60]);
    // Opaque, wherever it stands.
    for at in 0..4 {
        let mut transmissions = [[0.5; 3]; 4];
        transmissions[at] = [0.0; 3];
        assert_eq!(arriving(&transmissions), [0.0; 3], "{at}");
    }
    // Nothing is left before the end.
    assert_eq!(arriving(&[[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.5; 3]]), [0.0; 3]);
}

/// The documented end of a chain: 255 surfaces are passed, one more is not.
#[test]
fn chains_of_shadow_rays_end() {
    assert_eq!(arriving(&[[1.0; 3]; 255]), [1.0, 0.5, 0.25]);
    assert_eq!(arriving(&[[1.0; 3]; 256]), [0.0; 3]);
}

/// A ball is two surfaces; what is beyond the light does not count.
#[test]
fn shadows_of_a_glass_ball() {
    let glass = Material { transmission: [0.5, 0.25, 1.0], ior: 1.5, ..Material::MATT };
    let ball = |y: f32, radius| Shape::Sphere(Sphere { centre: Vec3::Y * y, radius });
    let world = World::new(vec![(ball(1.0, 0.5), 0), (ball(3.0, 0.25), 1)], vec![glass, Material::MATT], vec![]);
    world.with(|scene| {
        let mut stack = Room::default();
        let mut up = |x: f32, t_max: f32| {
            let mut ray = shadow(Vec3::X * x, Vec3::Y * 2.0, t_max, [1.0; 3]);
            walker(&mut stack).arriving(scene, &mut ray).expect("every page is at hand")
        };
        assert_eq!(up(0.1, 1.0), [0.25, 0.0625, 1.0], "in and out");
        assert_eq!(up(0.1, 0.5), [0.5, 0.25, 1.0], "a light inside");
        assert_eq!(up(0.1, 0.2), [1.0; 3], "a light before it");
        assert_eq!(up(0.1, 1.37), [0.25, 0.0625, 1.0], "a light just before the opaque one");
        assert_eq!(up(0.1, 2.0), [0.0; 3], "an opaque one behind");
        assert_eq!(up(0.6, f32::INFINITY), [1.0; 3], "beside both");
    });
}

/// A matt floor under a lamp, with and without a ball between: the floor's light by hand.
#[test]
fn opaque_things_cast_shadows() {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let floor = Shape::Triangle(Triangle { v: [corner(-9.0, -9.0), corner(0.0, 9.0), corner(9.0, -9.0)] });
    let ball = Shape::Sphere(Sphere { centre: Vec3::Y * 2.0, radius: 0.5 });
    let lamp = Light { position: [0.0, 4.0, 0.0], colour: [2.0, 1.0, 0.5], ..Light::default() };
    for transmits in [false, true] {
        let check = |shapes: Vec<(Shape, u16)>, at: Vec3, expected: [f64; 3]| {
            // A thing of glass far away makes the scene one that transmits.
            let glass = Material { transmission: [0.5; 3], ..Material::MATT };
            let far = Shape::Sphere(Sphere { centre: Vec3::Z * -20.0, radius: 0.5 });
            let mut shapes = shapes;
            if transmits {
                shapes.push((far, 1));
            }
            World::new(shapes, vec![Material::MATT, glass], vec![lamp]).with(|scene| {
                assert_eq!(scene.transmits, transmits);
                let eye = Vec3::new(4.0, 1.0, 0.5);
                let (record, counts) = trace(scene, &primary(eye, at - eye, 3), 1);
                for (found, expected) in record.sum().into_iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-5, "{found} {expected}");
                }
                assert_eq!((counts.shadow, record.entries), (1, 3u64.wrapping_neg()));
            });
        };
        let lit = |cosine: f64| [1.5, 0.75, 0.375].map(|c| c * cosine);
        let away = 4.0 / (16.0f64 + 4.0).sqrt();
        check(vec![(floor, 0)], Vec3::ZERO, lit(1.0));
        check(vec![(floor, 0), (ball, 0)], Vec3::ZERO, [0.0; 3]);
        check(vec![(floor, 0), (ball, 0)], Vec3::X * 2.0, lit(away));
        check(vec![(floor, 0), (ball, 0)], Vec3::X * -0.9, [0.0; 3]);
    }
}

#[test]
fn records_keep_their_size() {
    assert!(size_of::<HitRecord>() <= 160, "{}", size_of::<HitRecord>());
    assert!(size_of::<RayRecord>() <= 96 && size_of::<ShadowRecord>() <= 64);
}
