//! The JSON report: its fields are there, are what they say, and agree with one another.

use super::Folder;
use serde_json::Value;

fn report(folder: &Folder, arguments: &str) -> Value {
    let (talk, out) = folder.succeed(&format!("render {arguments} -o a.png --json -"));
    serde_json::from_slice(&out).unwrap_or_else(|e| panic!("{arguments}: {e}: {talk}"))
}

fn whole(report: &Value, path: &str) -> u64 {
    let value = report.pointer(path).unwrap_or_else(|| panic!("{path} is missing from {report}"));
    value.as_u64().unwrap_or_else(|| panic!("{path} is no whole number: {value}"))
}

fn number(report: &Value, path: &str) -> f64 {
    let value = report.pointer(path).unwrap_or_else(|| panic!("{path} is missing from {report}"));
    value.as_f64().filter(|x| x.is_finite() && *x >= 0.0).unwrap_or_else(|| panic!("{path} is no number: {value}"))
}

#[test]
fn fields() {
    let folder = Folder::new();
    let r = report(&folder, "spd:tree:4 --size 50x20 --spp 3 --nodes 2 --kernels portable");
    assert_eq!(r["scene"], "spd:tree:4");
    assert_eq!((whole(&r, "/width"), whole(&r, "/height"), whole(&r, "/samples")), (50, 20, 3));
    let film = r["film"].as_str().unwrap();
    assert!(film.len() == 16 && film.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b)), "{film}");
    assert_eq!(r["finished"], true);
    assert_eq!(r["kernels"], "portable");
    assert_eq!(r["warnings"], Value::Array(Vec::new()));

    let [import, build, trace, total] =
        ["import", "build", "trace", "total"].map(|s| number(&r, &format!("/seconds/{s}")));
    assert!(import + build + trace <= total && trace > 0.0, "{}", r["seconds"]);

    assert_eq!(whole(&r, "/rays/primary"), 50 * 20 * 3);
    let rays = ["primary", "secondary", "shadow"].map(|kind| whole(&r, &format!("/rays/{kind}"))).iter().sum::<u64>();
    let hits = whole(&r, "/counts/hits");
    assert!(hits > 0 && hits <= whole(&r, "/rays/primary") + whole(&r, "/rays/secondary"));
    assert!(whole(&r, "/rays/shadow") > 0 && whole(&r, "/counts/contributions") > 0);

    // The published count of the scene: 2^(4+1) - 1 cones and spheres over one polygon, seven lights.
    assert_eq!(["triangles", "spheres", "cones", "lights"].map(|c| whole(&r, &format!("/counts/{c}"))), [2, 31, 31, 7]);
    assert!(whole(&r, "/counts/materials") >= 2 && whole(&r, "/counts/pages") >= 1);
    assert_eq!((whole(&r, "/counts/refused"), whole(&r, "/counts/clamped")), (0, 0));
    for walk in ["walk_nodes", "walk_blocks", "walk_pages"] {
        assert!(whole(&r, &format!("/counts/{walk}")) > 0, "{walk}");
    }
    // Tiles of 8 x 8.
    assert_eq!(whole(&r, "/counts/tiles"), 7 * 3);

    let nodes = r["nodes"].as_array().unwrap();
    assert_eq!(nodes.len(), 2);
    let sum = |field: &str| nodes.iter().map(|node| whole(node, field)).sum::<u64>();
    assert_eq!((sum("/tiles"), sum("/rays")), (21, rays));
    for (node, expected) in nodes.iter().zip(1..) {
        assert_eq!(whole(node, "/node"), expected);
        assert!(number(node, "/busy_seconds") <= number(&r, "/seconds/total"));
        assert!(whole(node, "/runs") <= whole(node, "/tiles"));
    }

    for bytes in ["page_bytes", "directory_bytes", "table_bytes"] {
        assert!(whole(&r, &format!("/memory/{bytes}")) > 0, "{bytes}");
    }
    if cfg!(target_os = "linux") {
        let (peak, each) = (whole(&r, "/memory/peak_bytes"), number(&r, "/memory/peak_bytes_per_primitive"));
        assert!((peak as f64 / 64.0 - each).abs() < 1.0 && peak > 1 << 20, "{peak} {each}");
    }
}

/// What the picture is a function of changes the film; the farm does not, and the rays neither.
#[test]
fn films() {
    let folder = Folder::new();
    let report = |more: &str| report(&folder, &format!("spd:balls:2 -q {more}"));
    let usual = "--size 40x40 --spp 2 --filter tent";
    let first = report(usual);
    for more in [
        "",
        "--nodes 1",
        "--nodes 5 --dispatcher node",
        "--spread 8 --tile 8",
        "--tree midpoint --cell-depth 9",
        "--kernels portable --page-bytes 4096",
    ] {
        let again = report(&format!("{usual} {more}"));
        for field in ["film", "rays"] {
            assert_eq!(again[field], first[field], "{more}");
        }
    }
    let mut films = vec![first["film"].clone()];
    for other in [
        "--size 40x40 --spp 2 --filter tent --seed 1",
        "--size 40x40 --spp 3 --filter tent",
        "--size 40x40 --spp 2 --filter tent --depth 1",
        "--size 40x40 --spp 2 --filter box",
        "--size 40x40 --spp 2 --filter gaussian",
        "--size 41x40 --spp 2 --filter tent",
        "--size 40x40 --spp 2 --filter tent --cutoff 0.3",
    ] {
        let film = report(other)["film"].clone();
        assert!(!films.contains(&film), "{other}: a picture that there was before");
        films.push(film);
    }
}

#[test]
fn to_a_file_and_in_silence() {
    let folder = Folder::new();
    let (talk, out) = folder.succeed("render spd:balls:1 --size 16x16 -q -o a.png --json a.json");
    assert_eq!((talk.as_str(), out.as_slice()), ("", &b""[..]));
    let report: Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    assert_eq!(report["finished"], true);
    assert_eq!(folder.names(), ["a.json", "a.png"]);
}
