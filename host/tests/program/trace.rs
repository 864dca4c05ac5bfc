//! `hybray trace`: the answers are those of brute force, in words and in bytes.

use super::{Folder, SPHERE, talk};
use hybray::build::Source;
use hybray::{framing, import};
use hybray_bintree::cut::Primitives;
use hybray_geometry::{Candidate, Ray, RayKernel, Vec3};
use hybray_scene::Kind;

/// Origin, direction and interval.
type Asked = [f32; 8];

/// Distance, primitive, barycentrics and normal; bits, so that all of them compare.
type Answer = (u32, u32, [u32; 5]);

const MISS: Answer = (f32::INFINITY.to_bits(), Candidate::NOTHING, [0; 5]);

/// Numbers from -1 to 1 that depend on the seed alone (SplitMix64).
fn numbers(mut state: u64) -> impl FnMut() -> f32 {
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

fn by_brute_force(source: &Source<'_>, unit: f32, rays: &[Asked]) -> Vec<(u32, u32)> {
    let nearest = |&[ox, oy, oz, dx, dy, dz, t_min, t_max]: &Asked| {
        let (origin, direction) = (Vec3::new(ox, oy, oz) * unit, Vec3::new(dx, dy, dz) * unit);
        let kernel = RayKernel::new(&Ray { origin, direction, t_min, t_max });
        let best = (0..source.len()).fold(Candidate::none(t_max), |best, id| {
            let hit = match source.aabb(id).0 {
                Kind::Triangle => source.triangle(id).hit(&kernel, id, &best),
                Kind::Sphere => source.sphere(id).hit(&kernel, id, &best),
                Kind::Cone => source.cone(id).hit(&kernel, id, &best),
            };
            hit.unwrap_or(best)
        });
        if best.is_hit() { (best.t.to_bits(), best.id) } else { (MISS.0, MISS.1) }
    };
    rays.iter().map(nearest).collect()
}

fn text(folder: &Folder, arguments: &str, input: &str) -> Vec<Answer> {
    let output = folder.run_with(&format!("trace {arguments}"), input.as_bytes());
    assert_eq!((output.status.code(), talk(&output).as_str()), (Some(0), ""), "{arguments}");
    let answer = |line: &str| {
        if line == "miss" {
            return MISS;
        }
        let words: Vec<_> = line.split(' ').collect();
        assert_eq!(words.len(), 7, "{line}");
        let number = |i: usize| words[i].parse::<f32>().unwrap().to_bits();
        (number(0), words[1].parse().unwrap(), [2, 3, 4, 5, 6].map(number))
    };
    String::from_utf8(output.stdout).unwrap().lines().map(answer).collect()
}

fn binary(folder: &Folder, arguments: &str, rays: &[Asked]) -> Vec<Answer> {
    let input: Vec<u8> = rays.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let output = folder.run_with(&format!("trace --binary {arguments}"), &input);
    assert_eq!((output.status.code(), talk(&output).as_str()), (Some(0), ""), "{arguments}");
    let words: Vec<u32> = output.stdout.as_chunks::<4>().0.iter().map(|&bytes| u32::from_le_bytes(bytes)).collect();
    assert_eq!(words.len(), 7 * rays.len());
    words.as_chunks::<7>().0.iter().map(|&[t, primitive, u, v, x, y, z]| (t, primitive, [u, v, x, y, z])).collect()
}

fn lines(rays: &[Asked]) -> String {
    rays.iter().map(|ray| ray.map(|x| x.to_string()).join(" ") + "\n").collect()
}

fn check(scene: &str, rays: usize) {
    let folder = Folder::new();
    let model = import::load(scene).unwrap();
    let (source, scale) = Source::new(&model).unwrap();
    let (lo, hi) = framing::bounds(&model).unwrap();
    let mut number = numbers(scene.len() as u64);
    let mut point = |grow: f32| [0, 1, 2].map(|i| 0.5 * (lo[i] + hi[i] + grow * number() * (hi[i] - lo[i])));
    let rays: Vec<Asked> = (0..rays)
        .map(|i| {
            let (from, to) = (point(3.0), point(1.0));
            let [dx, dy, dz] = [0, 1, 2].map(|i| to[i] - from[i]);
            let [t_min, t_max] = [[0.0, f32::INFINITY], [0.5, 2.0], [0.0, 1.0]][i % 3];
            [from[0], from[1], from[2], dx, dy, dz, t_min, t_max]
        })
        .collect();
    let expected = by_brute_force(&source, 2f32.powi(scale), &rays);
    let hits = expected.iter().filter(|e| e.1 != MISS.1).count();
    assert!(hits > rays.len() / 20 && hits < rays.len(), "{scene}: {hits} of {} rays hit", rays.len());

    let spoken = text(&folder, scene, &lines(&rays));
    assert_eq!(spoken.iter().map(|a| (a.0, a.1)).collect::<Vec<_>>(), expected, "{scene}");
    for more in ["", "--tree midpoint --page-bytes 4096", "--kernels portable"] {
        assert_eq!(binary(&folder, &format!("{scene} {more}"), &rays), spoken, "{scene} {more}");
    }
    for (answer, ray) in spoken.iter().zip(&rays).filter(|(a, _)| **a != MISS) {
        let [u, v, x, y, z] = answer.2.map(f32::from_bits);
        let length = (x * x + y * y + z * z).sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{scene} {ray:?}: a normal of length {length}");
        assert!(u >= 0.0 && v >= 0.0 && u + v < 1.0 + 1e-5, "{scene} {ray:?}: {u} {v}");
    }
}

#[test]
fn triangles() {
    check("organic:1000", 600);
}

#[test]
fn cones_and_spheres() {
    check("spd:tree:5", 900);
}

#[test]
fn a_coarse_scene_unit() {
    // Its coordinates are in hundreds, so that the internal unit is another.
    check("cornell:mirror", 300);
}

/// A ray at the unit sphere, and the distance and normal that school gives.
#[test]
fn known_answers() {
    let folder = Folder::new().with("sphere.nff", SPHERE);
    let check = |line: &str, expected: Option<(f32, [f32; 3])>| {
        let expected = expected.map_or(MISS, |(t, n)| {
            let [x, y, z] = n.map(f32::to_bits);
            (t.to_bits(), 0, [0, 0, x, y, z])
        });
        let found = text(&folder, "sphere.nff", &format!("{line}\n"));
        // The sign of a zero in a normal is nobody's matter.
        let plain = |(t, id, rest): Answer| (t, id, rest.map(|bits| if bits == 1 << 31 { 0 } else { bits }));
        assert_eq!(found.into_iter().map(plain).collect::<Vec<_>>(), [expected], "{line}");
    };
    let (near, far) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    check("0 0 5 0 0 -1", Some((4.0, near)));
    check("0 0 5 0 0 -2", Some((2.0, near)));
    check("0 0 5 0 0 -9.5367431640625e-7", Some((4_194_304.0, near)));
    check("0 0 5 0 0 -1.2379400392853803e27", Some((2f32.powi(-88), near)));
    check("  0\t0 5 0 0 -1  ", Some((4.0, near)));
    check("0 0 5 0 0 -1 0", Some((4.0, near)));
    check("0 0 5 0 0 -1 4.5", Some((6.0, far)));
    check("0 0 5 0 0 -1 4 4", Some((4.0, near)));
    check("0 0 5 0 0 -1 0 3.9", None);
    check("0 0 5 0 0 -1 0 4", Some((4.0, near)));
    check("0 0 5 0 0 -1 4.1 5.9", None);
    check("0 0 5 0 0 -1 6.1 inf", None);
    check("0 0 0 0 0 -1", Some((1.0, far)));
    check("0 0 5 0 0 1", None);
    check("0 2 5 0 0 -1", None);
}

/// Answers to what came before the mistake are given; the mistake is named by its line.
#[test]
fn bad_lines() {
    let folder = Folder::new().with("sphere.nff", SPHERE);
    let good = "0 0 5 0 0 -1\n";
    let check = |input: &[u8], arguments: &str, answers: usize, words: &[&str]| {
        let output = folder.run_with(&format!("trace sphere.nff {arguments}"), input);
        let talk = talk(&output);
        assert_eq!(output.status.code(), Some(1), "{talk}");
        assert_eq!(talk.lines().count(), 1, "{talk}");
        for word in words {
            assert!(talk.contains(word), "`{word}` is missing from: {talk}");
        }
        let size = if arguments.is_empty() { "4 0 0 0 0 0 1\n".len() } else { 28 };
        assert_eq!(output.stdout.len(), answers * size, "{talk}");
    };
    for (line, words) in [
        ("0 0 5 0 0", "ox oy oz dx dy dz [tmin tmax]"),
        ("0 0 5 0 0 -1 0 1 2", "ox oy oz dx dy dz [tmin tmax]"),
        ("0 0 5 0 0 down", "all numbers"),
        ("0 0 5 0 0 0", "the direction is zero"),
        ("0 0 nan 0 0 1", "must be finite"),
        ("0 0 5 0 inf 1", "must be finite"),
        ("0 0 5 0 0 -1 -1", "tmin must be 0 or more"),
        ("0 0 5 0 0 -1 2 1", "tmax not less"),
        ("0 0 5 0 0 -1 nan", "tmin must be 0 or more"),
    ] {
        // Comments and empty lines are passed over, and counted.
        check(format!("{good}# a comment\n\n{good}{line}\n{good}").as_bytes(), "", 2, &["line 5", words]);
    }
    check(format!("{good}{}", "0".repeat(100_000)).as_bytes(), "", 1, &["line 2", "longer than"]);
    check(b"0 0 5 0 0 -1\n\xff\xfe\n", "", 1, &["line 2"]);

    let ray = [0.0f32, 0.0, 5.0, 0.0, 0.0, -1.0, 0.0, f32::INFINITY];
    let bytes = |ray: [f32; 8]| ray.map(f32::to_le_bytes).concat();
    check(&[bytes(ray), bytes(ray)[..20].to_vec()].concat(), "--binary", 1, &["ray 2", "32 bytes"]);
    check(&[bytes(ray), bytes([0.0; 8])].concat(), "--binary", 1, &["ray 2", "the direction is zero"]);
}

#[test]
fn no_rays_no_answers() {
    let folder = Folder::new().with("sphere.nff", SPHERE);
    assert_eq!(text(&folder, "sphere.nff", ""), []);
    assert_eq!(text(&folder, "sphere.nff", "# nothing\n\n"), []);
    assert_eq!(binary(&folder, "sphere.nff", &[]), []);
    // A last line needs no end.
    assert_eq!(text(&folder, "sphere.nff", "0 0 5 0 0 1"), [MISS]);
}
