//! `render --resume`: what is in the film is not traced again, and the picture is that of one go.

use super::{Folder, talk};
use hybray::film::{Kept, Save, Subject};
use hybray::model::Settings;
use hybray::prepare::Prepared;
use hybray::{build, framing, import};
use hybray_geometry::simd::Kernels;
use hybray_native::{DispatcherAt, Farm, Watch, trace};
use hybray_scheduler::{Film, Options, Outcome, Progress, TileState};
use serde_json::Value;
use std::path::Path;

const SIZE: [u32; 2] = [120, 70];
/// 15 columns and 9 rows, the last one of six lines of pixels.
pub(super) const TILES: u32 = 15 * 9;
pub(super) const RENDER: &str = "--size 120x70 --spp 2 -q -o a.ppm";

/// Writes a film of a whole picture's tiles, as if it had ended when these were finished.
struct Cut<'a> {
    path: &'a Path,
    subject: Subject,
    has: &'a dyn Fn(u32) -> bool,
    /// This tile's sums are zero.
    black: Option<u32>,
}

impl Watch for Cut<'_> {
    fn look(&mut self, _: Progress, _: &Film<'_>) -> bool {
        true
    }

    fn end(&mut self, outcome: Outcome, film: &Film<'_>) {
        assert_eq!((outcome, film.map().len()), (Outcome::Finished, TILES));
        let mut sums = vec![[0; 3]; film.sums().len()];
        let mut tiles = vec![TileState::default(); TILES as usize];
        let mut part = Film::new(&self.subject.frame, &mut sums, &mut tiles).unwrap();
        for tile in (0..TILES).filter(|&tile| (self.has)(tile)) {
            let factor = u64::from(self.black != Some(tile));
            let values: Vec<u8> = film.tile_sums(tile).flatten().flat_map(|sum| (factor * sum).to_le_bytes()).collect();
            part.keep(tile, &values).unwrap();
        }
        Save::begin(self.path, &self.subject, &part).unwrap().finish(&part).unwrap();
    }
}

/// What [`RENDER`] draws of a scene, with another tree.
pub(super) fn keep(folder: &Folder, scene: &str, has: &dyn Fn(u32) -> bool, black: Option<u32>) {
    let mut model = import::load(scene).unwrap();
    model.settings.size = Some(SIZE);
    framing::complete_with_up(&mut model, import::up_axis(scene));
    let prepared = Prepared::new(model, &build::Settings { page_bytes: 8192, ..Default::default() }).unwrap();
    let pages = prepared.packed.open().unwrap();
    let wanted = Settings { size: Some(SIZE), spp: Some(2), ..Settings::default() };
    let frame = prepared.frame(&prepared.cameras[0], &wanted);
    let subject = prepared.subject(&pages, &frame);
    let farm = Farm {
        nodes: 1,
        kernels: Kernels::detect(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
    let mut cut = Cut { path: &folder.0.join("a.ppm.film"), subject, has, black };
    trace(&prepared.scene(&pages), prepared.hash, &frame, &farm, &mut cut).unwrap();
}

pub(super) fn json(folder: &Folder, arguments: &str) -> Value {
    let (talk, out) = folder.succeed(&format!("{arguments} --json -"));
    serde_json::from_slice(&out).unwrap_or_else(|e| panic!("{arguments}: {e}: {talk}"))
}

fn traced(report: &Value) -> u64 {
    report["nodes"].as_array().unwrap().iter().map(|node| node["tiles"].as_u64().unwrap()).sum()
}

#[test]
fn only_what_is_missing_is_traced_and_the_picture_is_the_same() {
    for (scene, memory) in [("terrain:3000", "192KiB"), ("spd:balls:3", "128KiB")] {
        let folder = Folder::new();
        let whole = json(&folder, &format!("render {scene} {RENDER}"));
        let picture = folder.read("a.ppm");
        assert_eq!((traced(&whole), &whole["counts"]["tiles_kept"]), (u64::from(TILES), &0.into()));
        let within = format!("--memory {memory} --nodes 4");
        let farms = [
            "--nodes 3 --save-every 0",
            "--nodes 2 --dispatcher node --tile 8 --tree midpoint",
            &format!("{within} --scheduler data-parallel --granularity 7"),
            &format!("{within} --scheduler demand-driven --dispatcher node"),
            &format!("{within} --voxels 3 --kernels portable"),
        ];
        let films: [&dyn Fn(u32) -> bool; 5] =
            [&|tile| tile < 50, &|tile| tile % 3 == 0, &|tile| !(40..44).contains(&tile), &|_| false, &|_| true];
        for (farm, has) in farms.iter().flat_map(|farm| films.iter().map(move |has| (farm, has))) {
            keep(&folder, scene, has, None);
            let kept = (0..TILES).filter(|&tile| has(tile)).count() as u64;
            let what = format!("{scene}, {farm}, {kept} tiles");
            std::fs::remove_file(folder.0.join("a.ppm")).unwrap();
            let report = json(&folder, &format!("render {scene} {RENDER} --resume {farm}"));
            assert_eq!(report["film"], whole["film"], "{what}");
            assert_eq!((&report["finished"], &report["counts"]["tiles"]), (&true.into(), &TILES.into()), "{what}");
            assert_eq!(
                (traced(&report), &report["counts"]["tiles_kept"]),
                (u64::from(TILES) - kept, &kept.into()),
                "{what}"
            );
            assert_eq!(folder.read("a.ppm"), picture, "{what}");
            assert_eq!(folder.names(), ["a.ppm"], "{what}: the film is removed");
        }
    }
}

/// What is in the film is believed.
#[test]
fn kept_tiles_are_those_of_the_film() {
    let folder = Folder::new();
    keep(&folder, "spd:balls:2", &|tile| (10..20).contains(&tile), Some(12));
    folder.succeed(&format!("render spd:balls:2 {RENDER} --resume"));
    let ppm = folder.read("a.ppm");
    let pixels = &ppm[ppm.len() - 3 * 120 * 70..];
    let black: Vec<usize> = (0..120 * 70).filter(|&pixel| pixels[3 * pixel..][..3] == [0; 3]).collect();
    // Tile 12 is the first of the fourth square.
    let expected: Vec<usize> = (0..8).flat_map(|y| (48..56).map(move |x| 120 * y + x)).collect();
    assert_eq!(black, expected);
}

#[track_caller]
fn refused(folder: &Folder, arguments: &str, words: &[&str]) {
    let before: Vec<_> = folder.names().iter().map(|name| (name.clone(), folder.read(name))).collect();
    let output = folder.run(arguments);
    let talk = talk(&output);
    assert_eq!(output.status.code(), Some(1), "{arguments}: {talk}");
    assert!(talk.starts_with("hybray: ") && talk.lines().count() == 1, "{arguments}: {talk}");
    words.iter().for_each(|word| assert!(talk.contains(word), "`{word}` is missing from: {talk}"));
    let after: Vec<_> = folder.names().iter().map(|name| (name.clone(), folder.read(name))).collect();
    assert!(before == after, "{arguments}: a file is another one");
}

#[test]
fn a_film_of_another_picture_is_refused() {
    let folder = Folder::new().with("a.ppm", "old");
    keep(&folder, "spd:balls:2", &|tile| tile < 9, None);
    let check = |arguments: &str, words: &[&str]| {
        let all: Vec<_> =
            ["a.ppm.film: it is of another picture", "render without --resume"].iter().chain(words).copied().collect();
        refused(&folder, &format!("render {arguments} -q -o a.ppm --resume"), &all);
    };
    check("spd:balls:3 --size 120x70 --spp 2", &["another scene"]);
    check("spd:balls:2 --size 119x70 --spp 2", &["--size 120x70 and not 119x70"]);
    check("spd:balls:2 --size 120x70", &["(--spp 2 and not 4)"]);
    check(
        "spd:balls:2 --size 120x70 --spp 2 --seed 1 --filter tent",
        &["(--filter box and not tent, --seed 0 and not 1)"],
    );
    check("spd:balls:2 --size 120x70 --spp 2 --exposure 3", &["(--exposure 1 to 2 and not 2 to 4)"]);
    refused(&folder, "render spd:balls:2 -q -o - --resume", &["goes to no file: name one with -o"]);
}

/// Damage to sums is found when nodes are at work already.
#[test]
fn a_damaged_film_is_refused_and_left_alone() {
    let folder = Folder::new().with("a.ppm", "old");
    keep(&folder, "spd:balls:2", &|tile| tile < 9, None);
    let film = folder.read("a.ppm.film");
    let check = |bytes: &[u8], word: &str| {
        std::fs::write(folder.0.join("a.ppm.film"), bytes).unwrap();
        for farm in ["", "--nodes 5 --dispatcher node", "--nodes 3 --memory 1MiB --save-every 0"] {
            let words = [word, "render without --resume"];
            refused(&folder, &format!("render spd:balls:2 {RENDER} --resume {farm}"), &words);
        }
    };
    for length in [0, 1, 127, 128, 150] {
        check(&film[..length], "cut short");
    }
    for length in [film.len() / 2, film.len() - 8, film.len() - 1] {
        check(&film[..length], "and should have");
    }
    for at in [200, film.len() / 2, film.len() - 1] {
        let mut flipped = film.clone();
        flipped[at] ^= 4;
        check(&flipped, "the hash differs");
    }
    check(b"P6\n1 1\n255\nabc", "cut short");
    check(&[7; 500], "this is no film");
}

#[test]
fn without_a_film_it_begins_and_without_resume_it_stays() {
    let folder = Folder::new();
    let loud = "--size 120x70 --spp 2 -o a.ppm";
    let (talk, _) = folder.succeed(&format!("render spd:balls:2 {loud} --resume"));
    assert!(talk.contains("there is no a.ppm.film: the picture begins from the start"), "{talk}");
    let picture = folder.read("a.ppm");
    keep(&folder, "spd:balls:2", &|tile| tile < 9, Some(3));
    let (talk, _) = folder.succeed(&format!("render spd:balls:2 {loud}"));
    assert!(
        talk.contains("a.ppm.film has tiles of a picture that ended early: --resume would go on with it"),
        "{talk}"
    );
    assert_eq!((folder.read("a.ppm"), folder.names()), (picture, vec!["a.ppm".into(), "a.ppm.film".into()]));
    let (talk, _) = folder.succeed(&format!("render spd:balls:2 {loud} --resume"));
    assert!(talk.contains("a.ppm.film: 9 tiles are there"), "{talk}");
}

/// How many tiles are in a film, as the program reads it.
#[cfg(unix)]
pub fn tiles_in(path: &Path, scene: &str, wanted: &Settings) -> u32 {
    let mut model = import::load(scene).unwrap();
    model.settings.size = wanted.size;
    framing::complete_with_up(&mut model, import::up_axis(scene));
    let prepared = Prepared::new(model, &build::Settings::default()).unwrap();
    let pages = prepared.packed.open().unwrap();
    let frame = prepared.frame(&prepared.cameras[0], wanted);
    let kept = Kept::open(path, &prepared.subject(&pages, &frame)).unwrap().unwrap();
    let tiles = kept.tiles();
    let (mut sums, mut states) = (vec![[0; 3]; (frame.width * frame.height) as usize], Vec::new());
    states.resize(frame.width.div_ceil(8) as usize * frame.height.div_ceil(8) as usize, TileState::default());
    kept.load(&mut Film::new(&frame, &mut sums, &mut states).unwrap()).unwrap();
    tiles
}
