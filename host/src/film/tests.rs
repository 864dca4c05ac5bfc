use super::header::FileHeader;
use super::*;
use crate::build::{Rule, Settings, hash_bytes};
use crate::model::Model;
use crate::picture::pending::tests::Scratch;
use crate::prepare::Prepared;
use crate::{framing, import};
use hybray_bintree::midpoint;
use hybray_scheduler::{Film, TileState};
use hybray_wire::{Frame, Optics, TileMap};
use proptest::prelude::*;
use std::fs;

const FRAME: Frame = Frame {
    width: 37,
    height: 20,
    samples: 3,
    depth_max: 4,
    filter: 1,
    seed: 5,
    weight_cutoff: 0.25,
    step_log2: -32,
    eye: [1.0, 2.0, 3.0],
    target: [0.0; 3],
    up: [0.0, 1.0, 0.0],
    fov_y_degrees: 40.0,
    hither: 0.5,
    layer: 0,
    half: 0,
    optics: Optics::PINHOLE,
};

fn subject() -> Subject {
    Subject { scene: 77, frame: FRAME }
}

/// The memory of a film.
struct Room(Vec<[u64; 3]>, Vec<TileState>);

impl Room {
    fn of(frame: &Frame) -> Self {
        let map = TileMap::new(frame.width, frame.height).unwrap();
        Self(vec![[0; 3]; (map.width() * map.height()) as usize], vec![TileState::default(); map.len() as usize])
    }

    fn film(&mut self, frame: &Frame) -> Film<'_> {
        Film::new(frame, &mut self.0, &mut self.1).unwrap()
    }
}

/// Finishes a tile with sums that are like no others.
fn finish(film: &mut Film<'_>, tile: u32) {
    let pixels = film.map().tile(tile).pixels() as u64;
    let sum = |n: u64| (n + 1000 * u64::from(tile)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let values: Vec<u8> = (0..3 * pixels).flat_map(|n| sum(n).to_le_bytes()).collect();
    film.keep(tile, &values).unwrap();
}

/// The file of a film with these tiles.
fn file(scratch: &Scratch, frame: &Frame, tiles: &[u32]) -> Vec<u8> {
    let mut room = Room::of(frame);
    let mut film = room.film(frame);
    tiles.iter().for_each(|&tile| finish(&mut film, tile));
    let path = scratch.0.join("film");
    let subject = Subject { frame: *frame, ..subject() };
    Save::begin(&path, &subject, &film).unwrap().finish(&film).unwrap();
    fs::read(path).unwrap()
}

/// Reads a film to its end.
fn read(bytes: &[u8], length: u64) -> Result<Vec<[u64; 3]>, String> {
    let mut room = Room::of(&FRAME);
    let mut kept = Kept::read("film".to_owned(), bytes, length, &subject())
        .map_err(|(what, remedy)| format!("{what}; {remedy}"))?;
    let mut film = room.film(&FRAME);
    kept.tiles_into(&mut film).map_err(|(what, remedy)| format!("{what}; {remedy}"))?;
    assert_eq!(film.finished(), kept.tiles());
    Ok(film.sums().to_vec())
}

#[test]
fn what_is_read_is_what_was_written() {
    let scratch = Scratch::new("film");
    let all: Vec<u32> = (0..15).collect();
    for tiles in [&[][..], &[0], &[14], &[2, 3, 9], &all] {
        let bytes = file(&scratch, &FRAME, tiles);
        let mut expected = Room::of(&FRAME);
        let mut film = expected.film(&FRAME);
        tiles.iter().for_each(|&tile| finish(&mut film, tile));
        assert_eq!(read(&bytes, bytes.len() as u64).unwrap(), film.sums(), "{tiles:?}");

        let mut room = Room::of(&FRAME);
        let kept = Kept::open(&scratch.0.join("film"), &subject()).unwrap().unwrap();
        assert_eq!(kept.tiles() as usize, tiles.len());
        let mut opened = room.film(&FRAME);
        kept.load(&mut opened).unwrap();
        assert!((0..15).all(|tile| opened.tile_is_finished(tile) == tiles.contains(&tile)));
        assert_eq!(opened.hash(), film.hash());
    }
    assert!(Kept::open(&scratch.0.join("nothing"), &subject()).unwrap().is_none());
    let Err(error) = Kept::open(&scratch.0, &subject()) else { panic!("a folder is no film") };
    assert!(error.to_string().contains("no regular file"), "{error}");
}

/// The bytes as `docs/FILM.md` has them, put together by hand.
#[test]
fn the_format_is_as_documented() {
    let scratch = Scratch::new("film-format");
    let bytes = file(&scratch, &FRAME, &[4, 14]);
    let version = env!("CARGO_PKG_VERSION").split('.').map(|n| n.parse().unwrap());
    let mut expected = b"hyfilm\r\x1a".to_vec();
    // Tile 4 is whole, tile 14 has the last five columns and four rows.
    let length = 152 + 8 + (64 + 5 * 4) * 24 + 8;
    expected.extend([2u32, 152].iter().flat_map(|n| n.to_le_bytes()));
    expected.extend([length as u64, 77, 5].iter().flat_map(|n| n.to_le_bytes()));
    expected.extend(version.chain([2u32, 37, 20, 3, 4, 1]).flat_map(u32::to_le_bytes));
    expected.extend((-32i32).to_le_bytes());
    let floats = [0.25f32, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 40.0, 0.5];
    expected.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
    expected.extend([0u8; 24]);
    assert_eq!(expected.len(), 152);
    expected.extend((1u64 << 4 | 1 << 14).to_le_bytes());
    assert_eq!(bytes[..160], expected);
    assert_eq!(bytes.len(), length);
    let sum = |tile: u64, n: u64| (n + 1000 * tile).wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes();
    assert_eq!(bytes[160..168], sum(4, 0));
    assert_eq!(bytes[160 + 64 * 24..][..16], [sum(14, 0), sum(14, 1)].concat());
}

#[test]
fn a_file_that_is_cut_short_or_drawn_out_is_refused() {
    let scratch = Scratch::new("film-cut");
    let bytes = file(&scratch, &FRAME, &[0, 3, 14]);
    for length in 0..bytes.len() {
        // As it is found when it is opened, and as if it were cut short only then.
        for told in [length, bytes.len()] {
            let error = read(&bytes[..length], told as u64).unwrap_err();
            assert!(error.contains("it is cut short") || error.contains("and should have"), "{length}: {error}");
            assert!(error.contains("render without --resume"), "{error}");
        }
    }
    for more in [1, 24, 4096] {
        let long = [&bytes[..], &vec![0; more]].concat();
        assert!(read(&long, long.len() as u64).unwrap_err().contains("and should have"));
    }
}

#[test]
fn a_file_with_a_bit_flipped_is_refused() {
    let scratch = Scratch::new("film-flip");
    let mut bytes = file(&scratch, &FRAME, &[0, 3, 14]);
    for at in 0..bytes.len() {
        for bit in [1, 0x10, 0x80] {
            bytes[at] ^= bit;
            assert!(read(&bytes, bytes.len() as u64).is_err(), "byte {at}, {bit:#x}");
            bytes[at] ^= bit;
        }
    }
    assert!(read(&bytes, bytes.len() as u64).is_ok());
}

#[test]
fn another_picture_is_named() {
    let scratch = Scratch::new("film-other");
    let path = scratch.0.join("film");
    file(&scratch, &FRAME, &[1]);
    let check = |scene: u64, frame: Frame, expected: &str| {
        let Err(error) = Kept::open(&path, &Subject { scene, frame }) else { panic!("taken, though {expected}") };
        let error = error.to_string();
        assert!(error.contains(&format!("it is of another picture ({expected}); ")), "{error}");
        assert!(error.starts_with(&path.display().to_string()) && error.contains("render without --resume"), "{error}");
    };
    check(78, FRAME, "another scene");
    check(77, Frame { width: 38, ..FRAME }, "--size 37x20 and not 38x20");
    check(77, Frame { height: 21, ..FRAME }, "--size 37x20 and not 37x21");
    check(77, Frame { samples: 1, ..FRAME }, "--spp 3 and not 1");
    check(77, Frame { depth_max: 64, ..FRAME }, "--depth 4 and not 64");
    check(77, Frame { filter: 2, ..FRAME }, "--filter tent and not gaussian");
    check(77, Frame { seed: 6, ..FRAME }, "--seed 5 and not 6");
    check(77, Frame { weight_cutoff: 0.5, ..FRAME }, "--cutoff 0.25 and not 0.5");
    check(77, Frame { step_log2: -34, ..FRAME }, "--exposure 1 to 2 and not 4 to 8");
    for frame in [
        Frame { eye: [1.0, 2.0, 4.0], ..FRAME },
        Frame { target: [0.0, 0.0, -0.0], ..FRAME },
        Frame { up: [1.0, 0.0, 0.0], ..FRAME },
        Frame { fov_y_degrees: 41.0, ..FRAME },
        Frame { hither: 0.0, ..FRAME },
        Frame { optics: Optics { projection: 2, ..FRAME.optics }, ..FRAME },
        Frame { optics: Optics { height: 1.0, ..FRAME.optics }, ..FRAME },
        Frame { optics: Optics { radius: 1.0, ..FRAME.optics }, ..FRAME },
        Frame { optics: Optics { focus: 1.0, ..FRAME.optics }, ..FRAME },
        Frame { optics: Optics { blades: 5, ..FRAME.optics }, ..FRAME },
        Frame { optics: Optics { rotation_degrees: 1.0, ..FRAME.optics }, ..FRAME },
    ] {
        check(77, frame, "another camera");
    }
    check(1, Frame { seed: 6, samples: 9, ..FRAME }, "another scene, --spp 3 and not 9, --seed 5 and not 6");

    let mut bytes = fs::read(&path).unwrap();
    let mut refused = |at: usize, expected: &str| {
        let before = bytes[at];
        bytes[at] = before.wrapping_add(1);
        let error = read(&bytes, bytes.len() as u64).unwrap_err();
        assert!(error.contains(expected), "{error}");
        bytes[at] = before;
    };
    refused(0, "this is no film");
    refused(8, "its format is version 3, and this program reads version 2");
    refused(48, concat!("and not ", env!("CARGO_PKG_VERSION")));
}

/// Tiles that are finished while the film is written are not in it, and what is in it is whole.
#[test]
fn a_film_is_that_of_one_moment() {
    let scratch = Scratch::new("film-moment");
    let path = scratch.0.join("film");
    // 6 MB: several pieces.
    let frame = Frame { width: 512, height: 500, ..FRAME };
    let mut room = Room::of(&frame);
    let mut film = room.film(&frame);
    let tiles = film.map().len();
    (0..tiles).filter(|tile| tile % 3 != 1).for_each(|tile| finish(&mut film, tile));
    let before = film.finished();
    let subject = Subject { frame, ..subject() };
    let mut save = Save::begin(&path, &subject, &film).unwrap();
    let mut next = (0..tiles).filter(|tile| tile % 3 == 1);
    while !save.go_on(&film) {
        next.by_ref().take(1).for_each(|tile| finish(&mut film, tile));
        assert!(Kept::open(&path, &subject).unwrap().is_none_or(|kept| kept.tiles() == before), "half a film");
    }
    save.finish(&film).unwrap();
    assert!(film.finished() > before);
    let mut room = Room::of(&frame);
    let mut read = room.film(&frame);
    Kept::open(&path, &subject).unwrap().unwrap().load(&mut read).unwrap();
    assert!((0..tiles).all(|tile| read.tile_is_finished(tile) == (tile % 3 != 1)));
    assert!((0..tiles).filter(|tile| tile % 3 != 1).all(|tile| read.tile_sums(tile).eq(film.tile_sums(tile))));
    assert_eq!(scratch.names(), ["film"]);
}

#[test]
fn a_film_that_is_not_through_leaves_what_was_there() {
    let scratch = Scratch::new("film-dropped");
    let path = scratch.0.join("film");
    let before = file(&scratch, &FRAME, &[1]);
    let mut room = Room::of(&FRAME);
    let mut film = room.film(&FRAME);
    finish(&mut film, 2);
    drop(Save::begin(&path, &subject(), &film).unwrap());
    assert!(Save::begin(&path, &subject(), &film).unwrap().give_up().is_err());
    assert!(Save::begin(&scratch.0.join("missing/film"), &subject(), &film).is_err());
    assert_eq!(fs::read(&path).unwrap(), before);
    assert_eq!(scratch.names(), ["film"]);
    #[cfg(target_os = "linux")]
    {
        let mut save = Save::begin(Path::new("/dev/full"), &subject(), &film).unwrap();
        while !save.go_on(&film) {}
        assert!(save.finish(&film).is_err(), "the disk is full");
    }
}

#[test]
fn a_film_lies_beside_its_picture() {
    let scratch = Scratch::new("film-beside");
    let picture = scratch.0.join("a.png");
    let film = scratch.0.join("a.png.film");
    assert_eq!(path_for(&picture), Some(film.clone()));
    fs::write(&picture, b"old").unwrap();
    assert_eq!(path_for(&picture), Some(film));
    assert_eq!(path_for(Path::new("a.exr")), Some("a.exr.film".into()));
    assert_eq!(path_for(Path::new("-")), None);
    #[cfg(unix)]
    assert_eq!(path_for(Path::new("/dev/null")), None);
}

/// The scene of a film is the same for every tree, and another for every change of what is drawn.
#[test]
fn a_scene_is_known_by_what_it_holds() {
    let model = |name: &str| {
        let mut model = import::load(name).unwrap();
        framing::complete_with_up(&mut model, import::up_axis(name));
        model
    };
    let hash = |model: Model, settings: &Settings| {
        let prepared = Prepared::new(model, settings).unwrap();
        prepared.subject(&prepared.packed.open().unwrap(), &FRAME).scene
    };
    let midpoint = Rule::Midpoint(midpoint::Settings { depth_max: 9, objects_max: 4 });
    let mut seen = Vec::new();
    for name in ["terrain:2000", "spd:teapot:3", "spd:tree:4", "cornell:mirror"] {
        let usual = hash(model(name), &Settings::default());
        for (rule, voxels) in [(Rule::SurfaceArea, "1"), (Rule::SurfaceArea, "5"), (midpoint, "2x3x1")] {
            let settings = Settings { rule, page_bytes: 4096, voxels: voxels.parse().unwrap(), ..Settings::default() };
            assert_eq!(hash(model(name), &settings), usual, "{name}, {settings:?}");
        }
        let changes: [fn(&mut Model); 9] = [
            |m| m.meshes[0].positions[2][1] += 0.01,
            |m| m.meshes[0].triangles[0].rotate_left(1),
            |m| m.meshes[0].triangles.truncate(1),
            |m| m.meshes.iter_mut().filter(|mesh| !mesh.normals.is_empty()).for_each(|mesh| mesh.normals[0] = [0.0; 3]),
            |m| m.spheres.iter_mut().take(1).for_each(|s| s.radius *= 1.01),
            |m| m.cones.iter_mut().take(1).for_each(|c| c.apex_radius *= 1.01),
            |m| m.materials.reverse(),
            |m| m.lights[0].position[0] += 0.5,
            |m| m.background[2] += 0.5,
        ];
        seen.push(usual);
        for (number, change) in changes.iter().enumerate() {
            let (mut changed, before) = (model(name), model(name));
            change(&mut changed);
            let differs = format!("{changed:?}") != format!("{before:?}");
            let hash = hash(changed, &Settings::default());
            if differs {
                assert!(!seen.contains(&hash), "{name}, change {number}");
                seen.push(hash);
            } else {
                assert_eq!(hash, usual, "{name}, change {number} changes nothing");
            }
        }
    }
    assert!(seen.len() > 4 + 4 * 6, "of {} changes most should change something", 4 * 9);
}

/// A film whose hash is right, whatever it says.
fn sealed(header: FileHeader, bits: u64, rest: &[u8]) -> Vec<u8> {
    let tiles = TileMap::new(FRAME.width, FRAME.height).unwrap();
    let mut hash = hash_bytes(header.hash(), &bits.to_le_bytes());
    let mut left = rest;
    for tile in tiles_of(&[bits]).filter(|&tile| tile < tiles.len()) {
        let (values, after) = left.split_at(left.len().min(tiles.tile(tile).pixels() * PIXEL_BYTES));
        (hash, left) = (hash_bytes(hash, values), after);
    }
    [bytemuck::bytes_of(&header), &bits.to_le_bytes(), rest, &hash.to_le_bytes()].concat()
}

proptest! {
    /// Whatever the bytes, an answer, and never more tiles than the picture has.
    #[test]
    fn any_bytes_get_an_answer(bytes in prop::collection::vec(any::<u8>(), 0..400), told in any::<u64>()) {
        prop_assert!(read(&bytes, bytes.len() as u64).is_err());
        prop_assert!(read(&bytes, told).is_err());
    }

    /// Files with a right header and a right hash: they are taken if their tiles are the picture's, and as many bytes
    /// are there as these have.
    #[test]
    fn only_what_fits_together_is_taken(
        bits in any::<u64>(),
        few in 0..4u32,
        kept in prop::option::of(any::<u32>()),
        more in prop::option::of(-100..100i64),
        beyond in any::<bool>(),
    ) {
        let mut bits = (0..few).fold(bits, |bits, turn| bits & bits.rotate_left(turn + 7));
        if !beyond {
            bits &= (1 << 15) - 1;
        }
        let map = TileMap::new(FRAME.width, FRAME.height).unwrap();
        let own: usize = tiles_of(&[bits & ((1 << 15) - 1)]).map(|tile| map.tile(tile).pixels() * PIXEL_BYTES).sum();
        let rest: Vec<u8> = (0..(own as i64 + more.unwrap_or(0)).max(0)).map(|n| n as u8).collect();
        let header = FileHeader {
            kept: kept.unwrap_or(bits.count_ones()),
            file_bytes: (152 + 8 + rest.len() + 8) as u64,
            ..FileHeader::of(&subject())
        };
        let bytes = sealed(header, bits, &rest);
        let fits = bits < 1 << 15 && header.kept == bits.count_ones() && rest.len() == own;
        let answer = read(&bytes, bytes.len() as u64);
        prop_assert_eq!(answer.is_ok(), fits, "{:?}", answer.err());
    }
}
