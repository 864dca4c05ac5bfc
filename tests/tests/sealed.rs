//! Nodes with a budget, once they are carved: they allocate nothing (DESIGN section 2, law 2), and whatever a stranger sends
//! them, they end with the same picture.

use bytemuck::bytes_of;
use hybray::build;
use hybray::model;
use hybray::prepare::Prepared;
use hybray_arena::{Arena, LINE_BYTES};
use hybray_link::HOST;
use hybray_native::plan;
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{
    Asked, Dispatcher, Film, Master, Node, NodeReport, NodeState, Options, Outcome, PageServer, PlanError, Settings,
    TileState,
};
use hybray_tests::{Post, Random, Stranger, kernels, scene, turns, within};
use hybray_wire::{Counts, Frame, MESSAGE_BYTES_MAX, Message, Partial, RayRecord, ShadowRecord, encode};
use std::mem::MaybeUninit;

/// An epoch that no tile comes to: what a stranger says of it must count for nothing.
const NO_EPOCH: u16 = 999;

/// What a render came to.
#[derive(Debug, PartialEq)]
struct Came {
    outcome: Option<Outcome>,
    film: u64,
    counts: Counts,
    allocations: u64,
}

/// Draws a scene with so many nodes, each with the least memory that will do.
fn drawn(name: &str, nodes: u16, settings: Settings, stranger: Option<Stranger<'_>>) -> Came {
    let prepared = Prepared::new(scene(name), &build::Settings { page_bytes: 4096, ..build::Settings::default() });
    let prepared = prepared.unwrap_or_else(|e| panic!("{name}: {e}"));
    let opened = prepared.packed.open().expect("pages");
    let pages = prepared.packed.page_slices();
    let wanted = model::Settings { size: Some([40, 32]), spp: Some(2), depth: Some(4), ..model::Settings::default() };
    let frame: Frame = prepared.frame(&prepared.cameras[0], &wanted);
    let mut scene = prepared.scene(&opened);
    let mut entries = scene.resident.directory.entries.to_vec();
    (0..nodes).cycle().zip(&mut entries).for_each(|(node, entry)| entry.owner = node + 1);
    scene.resident.directory.entries = &entries;
    // With the stranger, or without.
    let peers = usize::from(nodes) + 1 + usize::from(stranger.is_some());
    let all = peers as u16 - 1;
    let least = match plan(&scene, all, 0, settings.policy) {
        Err(PlanError::Memory { needed } | PlanError::Pages { needed }) => needed,
        plan => panic!("nothing is enough: {plan:?}"),
    };
    let plan = plan(&scene, all, least, settings.policy).expect("what is needed");

    let mut memories: Vec<Vec<MaybeUninit<u8>>> =
        (0..nodes).map(|_| vec![MaybeUninit::uninit(); least as usize + LINE_BYTES - 1]).collect();
    let mut carved: Vec<_> = (1..=nodes)
        .zip(&mut memories)
        .map(|(me, memory)| {
            let (memory, mut cache, scene) = plan.carve(&mut Arena::new(memory), &scene).expect("the sum of its terms");
            for (page, bytes) in (0..).zip(&pages) {
                assert!(entries[page as usize].owner != me || cache.put(page, bytes));
            }
            Node::new(scene, cache, prepared.hash, kernels(), me, HOST, plan.settings(settings), memory)
        })
        .collect();
    let map = hybray_wire::TileMap::new(frame.width, frame.height).expect("a picture");
    let mut sums = vec![[0; 3]; map.width() as usize * map.height() as usize];
    let mut tiles = vec![TileState::default(); map.len() as usize];
    let mut reports = vec![NodeReport::default(); peers];
    let mut states = vec![NodeState::default(); peers];
    let (mut asked, mut waiting) = (vec![Asked::NONE; peers], vec![0; peers]);
    let film = Film::new(&frame, &mut sums, &mut tiles).expect("a picture");
    let mut master = Master::new(frame, film, &mut reports, prepared.hash, HOST);
    let mut dispatcher = Dispatcher::new(&mut states, Options::default());
    let mut server = PageServer::new(&mut asked, &mut waiting);
    let mut post = Post::new(peers);

    let mut outcome = None;
    let made = allocation_counter::measure(|| {
        outcome = turns(&mut master, &mut dispatcher, &mut server, &pages, &mut carved, &mut post, stranger);
    });
    let mut counts = Counts::default();
    master.reports().iter().for_each(|node| counts += node.counts);
    Came { outcome, film: master.film().hash(), counts, allocations: made.count_total }
}

#[test]
fn nothing_is_allocated_after_the_seal() {
    for name in ["spd:balls:2", "spd:mount:2@lens", "spd:balls:2@spherical", "spd:balls:2@orthographic"] {
        let alone = drawn(name, 1, Settings::default(), None);
        assert_eq!(alone.outcome, Some(Outcome::Finished), "{name}");
        for (at, (_, policy)) in Policy::ALL.into_iter().enumerate() {
            let subhosts = [None, Some(1)][at % 2];
            let settings = Settings { policy, granularity: 30, deadline_ns: 50_000, subhosts, ..Settings::default() };
            let what = || format!("{name}, {settings:?}");
            let came = within(60, what, || drawn(name, 3, settings, None));
            assert_eq!(came, Came { allocations: 0, ..alone }, "{}", what());
        }
    }
    // The counter counts.
    assert_eq!(allocation_counter::measure(|| drop(std::hint::black_box(Box::new(1)))).count_total, 1);
}

/// A ray of bits at random, but for what would make it a ray of a tile that somebody waits for.
fn ray(random: &mut Random, nodes: u16) -> RayRecord {
    let mut bytes = [0; size_of::<RayRecord>()];
    bytes.fill_with(|| random.bits() as u8);
    let mut ray: RayRecord = bytemuck::pod_read_unaligned(&bytes);
    ray.epoch = NO_EPOCH;
    // Most of it makes sense, each time something else does not.
    let sound = random.bits();
    let set = |bit: u32| sound >> bit & 3 != 0;
    if set(0) {
        (ray.origin, ray.direction) = (random.vec().to_array(), random.vec().to_array());
        (ray.t_min, ray.t_max, ray.t_end) = (0.0, random.signed().abs(), random.signed().abs());
    }
    if set(2) {
        ray.weight = [1.0; 3];
    }
    if set(4) {
        (ray.tile, ray.pixel) = (random.below(20) as u32, random.below(64) as u8);
    }
    if set(6) {
        (ray.page, ray.hit_page) = (random.below(8) as u32, random.below(8) as u32);
        (ray.primitive, ray.slot) = (random.below(200) as u32, random.below(80) as u16);
    }
    if set(8) {
        (ray.kind, ray.depth, ray.settled) = (random.below(4) as u8, 1 + random.below(4) as u8, random.below(2) as u8);
    }
    if set(10) {
        ray.home = 1 + random.below(usize::from(nodes) + 1) as u16;
    }
    if set(12) {
        (ray.medium, ray.passed, ray.around) = (random.below(3) as u16, random.below(3) as u8, random.below(256) as u8);
    }
    ray
}

/// A message that nobody waits for.
fn message(random: &mut Random, frame: u16) -> Message {
    let bits = random.bits();
    let (small, word) = (random.below(8), bits as u32);
    let number = if random.below(2) == 0 { small as u32 } else { word };
    match random.below(16) {
        0..=3 => Message::Rays { rays: small as u16, shadows: random.below(8) as u16, load: frame },
        4 => Message::Took { taken: bits & 1 == 0, load: word as u16 },
        5 => Message::Partials { count: 1 + small as u16 },
        6 => Message::Share { with: number as u16 },
        7 => Message::Idle { given: number % 2 == 0 },
        8 => Message::Fetch { page: number },
        9 => Message::Part { page: number, offset: number, bytes: (100 * small) as u16 },
        10 => Message::Tiles { first: number, count: word, epoch: 0 },
        11 => Message::Done { first: number, count: 1, nanoseconds: bits },
        12 => Message::Finished { tile: u32::MAX },
        13 => Message::Clip { first: number, count: small as u8 },
        14 => Message::Cliplist { first: number, pages: small as u8 },
        _ => [Message::Stop, Message::Again { tile: number, epoch: NO_EPOCH }][random.below(2)],
    }
}

/// Sends somebody a frame that is noise, or a message that nobody waits for.
fn molest(random: &mut Random, nodes: u16, post: &mut Post) {
    let (me, to) = (nodes + 1, random.below(usize::from(nodes) + 1) as u16);
    let noise = random.below(6) == 0;
    post.send(me, to, MESSAGE_BYTES_MAX, &mut |room| {
        if noise {
            let bytes = random.below(300);
            room[..bytes].fill_with(|| random.bits() as u8);
            // A stranger that greets with another scene ends the picture, and rightly.
            room[0] = 2 + room[0] % 20;
            return if bytes > 0 && room[0] != 4 { bytes } else { 0 };
        }
        let message = message(random, 7);
        encode(0, &message, room, |body| match message {
            Message::Rays { rays, .. } => {
                let (nearest, any) = body.split_at_mut(usize::from(rays) * size_of::<RayRecord>());
                for bytes in nearest.chunks_exact_mut(size_of::<RayRecord>()) {
                    bytes.copy_from_slice(bytes_of(&ray(random, nodes)));
                }
                for bytes in any.chunks_exact_mut(size_of::<ShadowRecord>()) {
                    bytes.copy_from_slice(bytes_of(&ShadowRecord::from(&ray(random, nodes))));
                }
            }
            Message::Partials { .. } => {
                for bytes in body.chunks_exact_mut(size_of::<Partial>()) {
                    let (tile, pixel, entry) = (random.below(30) as u32, random.bits() as u8, random.bits());
                    let partial = Partial { sums: [entry; 3], entry, tile, epoch: NO_EPOCH, pixel, reserved: 0 };
                    bytes.copy_from_slice(bytes_of(&partial));
                }
            }
            _ => body.fill_with(|| random.bits() as u8),
        })
        .expect("room enough")
    });
}

#[test]
fn what_a_stranger_sends_changes_nothing() {
    for name in ["spd:balls:2", "spd:mount:2"] {
        let alone = drawn(name, 1, Settings::default(), None);
        for seed in 0..12 {
            let policy = Policy::ALL[seed as usize % 4].1;
            let usual = Settings { policy, granularity: 30, deadline_ns: 50_000, ..Settings::default() };
            let settings = Settings { steps: 64, subhosts: [None, Some(1)][seed as usize / 4 % 2], ..usual };
            let what = || format!("{name}, {settings:?}, seed {seed}");
            let random = &mut Random(seed);
            let came = within(60, what, || drawn(name, 3, settings, Some(&mut |post| molest(random, 3, post))));
            assert_eq!((came.outcome, came.film), (Some(Outcome::Finished), alone.film), "{}", what());
        }
    }
}
