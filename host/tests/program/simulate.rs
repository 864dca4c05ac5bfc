//! `hybray simulate` as people meet it.

use super::{Folder, talk};
use serde_json::Value;

fn runs(folder: &Folder, arguments: &str) -> Vec<Value> {
    let (_, out) = folder.succeed(&format!("simulate {arguments} -q --json -"));
    let report: Value = serde_json::from_slice(&out).unwrap();
    report["runs"].as_array().unwrap().clone()
}

/// Several schedulers in one report, one film; a packed scene is the same scene, and its runs are the same to the digit.
#[test]
fn schedulers_side_by_side_and_packed_scenes() {
    let folder = Folder::new();
    let more = "--machine powerxplorer --nodes 1,4,8 --memory 256KiB --size 40x32 --spp 1 \
                --scheduler hybrid,hybrid-1995,data-parallel,demand-driven";
    let (_, out) = folder.succeed("render spd:balls:4 --size 40x32 --spp 1 -q -o a.png --json -");
    let film = serde_json::from_slice::<Value>(&out).unwrap()["film"].clone();
    let all = runs(&folder, &format!("spd:balls:4 {more}"));
    let names: Vec<_> =
        all.iter().map(|run| (run["scheduler"].as_str().unwrap(), run["nodes"].as_u64().unwrap())).collect();
    let expected: Vec<_> = ["hybrid", "hybrid-1995", "data-parallel", "demand-driven"]
        .into_iter()
        .flat_map(|name| [1, 4, 8].map(|nodes| (name, nodes)))
        .collect();
    assert_eq!(names, expected);
    for run in &all {
        assert_eq!(run["film"], film, "{run}");
        if run["nodes"] != 1 {
            assert!(run["memory_high_water"].as_u64().unwrap() <= 256 * 1024, "{run}");
        }
    }
    // The pages that were chosen for the budget, packed.
    folder.succeed("pack spd:balls:4 -q -o b.hyb --page-bytes 4096");
    assert_eq!(
        runs(&folder, &format!("b.hyb {more}")),
        runs(&folder, &format!("spd:balls:4 {more} --page-bytes 4096"))
    );
}

#[test]
fn how_nodes_work_changes_the_run_and_not_the_film() {
    let folder = Folder::new();
    let usual =
        "spd:balls:3 --machine gigabit --nodes 4 --memory 128KiB --size 160x160 --spp 1 --scheduler data-parallel";
    let first = &runs(&folder, usual)[0];
    for more in [
        "--granularity 2",
        "--in-system 20",
        "--pyramid 8",
        "--voxels 2x2x1",
        "--page-bytes 8192",
        "--tiles static",
        "--tiles pixel-count",
        "--demand-driven all-but-host",
        "--take-over off",
        "--subhosts 0",
        "--subhosts 2",
        "--voxels 2x2x1 --ways voxels",
    ] {
        let run = &runs(&folder, &format!("{usual} {more}"))[0];
        assert_eq!(run["film"], first["film"], "{more}");
        assert_ne!(run["events"], first["events"], "{more} changed nothing");
    }
}

/// Memory for a part of the scene's pages: what is cached is less, and the picture is the same.
#[test]
fn page_memory_is_a_part_of_the_scene() {
    let folder = Folder::new();
    let usual = "spd:balls:4 --machine gigabit --nodes 16 --memory 1MiB --size 64x64 --spp 1 --page-bytes 4096";
    let all = &runs(&folder, usual)[0];
    let fetched = |run: &Value| {
        run["per_node"].as_array().unwrap().iter().map(|n| n["fetched_pages"].as_u64().unwrap()).sum::<u64>()
    };
    assert_eq!(fetched(all), 0, "every node has every page");
    let part = &runs(&folder, &format!("{usual} --page-memory 1/16"))[0];
    assert_eq!(part["film"], all["film"]);
    assert!(fetched(part) > 100, "{}", fetched(part));
    // 323,264 bytes of pages (docs/MEMORY.md), over 16.
    assert_eq!(runs(&folder, &format!("{usual} --page-memory 20204"))[0], *part);
    assert!(part["memory_high_water"].as_u64() < all["memory_high_water"].as_u64());
}

#[test]
fn times_without_a_rays_end_are_within_what_is_said() {
    let folder = Folder::new();
    let all = runs(&folder, "spd:balls:4 --machine powerxplorer --nodes 1,8 --memory 256KiB --size 64x64 --spp 1");
    let (_, out) = folder.succeed("plan spd:balls:4 --nodes 8 --memory 256KiB --machine powerxplorer --json -");
    let plan: Value = serde_json::from_slice(&out).unwrap();
    let number = |of: &Value, name: &str| of[name].as_f64().unwrap();
    for run in &all {
        for name in ["longest_gap", "longest_wait", "longest_round"] {
            let (longest, most) = (number(run, name), number(run, &format!("{name}_bound")));
            assert!(longest <= most, "{name}: {longest} of {most}");
        }
        assert!(number(run, "longest_gap") > 0.0 && number(run, "longest_gap") < number(run, "seconds"));
    }
    // What is planned is what was simulated, but for the tiles: the plan's are those of the scene's own picture.
    let near = |name: &str, planned: &str| {
        let (run, planned) = (number(&all[1], &format!("longest_{name}_bound")), number(&plan["progress"], planned));
        assert!((0.9..=1.0).contains(&(run / planned)), "{name}: {run} of {planned}");
    };
    near("gap", "gap_seconds");
    near("wait", "wait_seconds");
    assert_eq!(plan["progress"]["machine"], "powerxplorer");
    let (_, out) = folder.succeed("plan spd:balls:4 --nodes 8 --memory 256KiB --machine powerxplorer");
    let said = String::from_utf8(out).unwrap();
    let seconds = format!("{:.6} s  from the end of a ray to the next", number(&plan["progress"], "gap_seconds"));
    assert!(said.contains(&seconds), "{said}");
    let (_, out) = folder.succeed("plan spd:balls:4 --nodes 8 --memory 256KiB --json -");
    assert!(serde_json::from_slice::<Value>(&out).unwrap()["progress"].is_null());
}

#[test]
fn mistakes() {
    let folder = Folder::new();
    let check = |arguments: &str, code: i32, words: &[&str]| {
        let output = folder.run(&format!("simulate {arguments}"));
        let said = talk(&output);
        assert_eq!((output.status.code(), output.stdout.len()), (Some(code), 0), "{arguments}: {said}");
        assert!(words.iter().all(|word| said.contains(word)), "{arguments}: {said}");
    };
    check("spd:balls:1 --nodes 2", 2, &["--machine"]);
    check("spd:balls:1 --machine threads", 2, &["--nodes"]);
    check("spd:balls:1 --machine abacus --nodes 2", 2, &["abacus", "powerxplorer", "serial-115200"]);
    check("spd:balls:1 --machine threads --nodes 4097", 2, &["4097", "1..=4096"]);
    check("spd:balls:1 --machine threads --nodes 2 --scheduler hybrid,fifo", 2, &["fifo", "demand-driven"]);
    check(
        "spd:balls:1 --machine threads --nodes 2 --memory 9KiB -q",
        1,
        &["--memory 9KiB", "2 nodes", "give --memory"],
    );
    let two = "spd:balls:1 --machine threads --nodes 2";
    check(&format!("{two} --page-memory 1/4"), 2, &["--memory"]);
    for wrong in ["2/3", "1/0", "1/", "half"] {
        check(&format!("{two} --memory 1MiB --page-memory {wrong}"), 2, &[wrong, "512KiB", "1/16"]);
    }
    let farm = "spd:balls:1 --machine threads --nodes 4 -q";
    check(&format!("{farm} --subhosts 5"), 1, &["5 subhosts", "4 nodes", "--subhosts 4"]);
    check(&format!("{farm} --tiles pixel-count --dispatcher node"), 1, &["pixel-count", "--dispatcher host"]);
    check(&format!("{farm} --demand-driven location"), 1, &["--demand-driven", "--memory 32MiB"]);
    check(&format!("{farm} --memory 1MiB --demand-driven location"), 1, &["--voxels 2x2x1"]);
    check(&format!("{farm} --ways voxels"), 1, &["--ways", "--memory 32MiB"]);
    check(&format!("{farm} --memory 1MiB --voxels 3x1x1 --ways voxels"), 1, &["--ways", "--voxels 2x2x1"]);
    check(
        &format!("{farm} --memory 1MiB --voxels 2x2x1 --demand-driven objects:0"),
        1,
        &["more than 0 objects", "--demand-driven objects:"],
    );
    check("spd:balls:1 --machine threads --nodes 2 --json - --csv -", 1, &["only one", "standard output"]);
    check("nosuch.nff --machine threads --nodes 2", 1, &["nosuch.nff", "no such file"]);
    assert!(folder.names().is_empty());
}
