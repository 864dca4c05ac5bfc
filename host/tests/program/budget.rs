//! Nodes with a budget: `render --memory`, `plan`, and what docs/MEMORY.md says of them.

use super::{Folder, talk};
use serde_json::Value;

const POLICIES: [&str; 4] = ["hybrid", "hybrid-1995", "data-parallel", "demand-driven"];
const MEMORY_MD: &str = include_str!("../../../docs/MEMORY.md");

fn json(folder: &Folder, arguments: &str) -> Value {
    let (talk, out) = folder.succeed(&format!("{arguments} --json -"));
    serde_json::from_slice(&out).unwrap_or_else(|e| panic!("{arguments}: {e}: {talk}"))
}

#[track_caller]
fn whole(report: &Value, path: &str) -> u64 {
    report.pointer(path).and_then(Value::as_u64).unwrap_or_else(|| panic!("{path} of {report}"))
}

#[track_caller]
fn sum(nodes: &[Value], path: &str) -> u64 {
    nodes.iter().map(|node| whole(node, path)).sum()
}

/// Law 1 through the program, and the counts of a report against one another.
#[test]
fn a_budget_changes_how_and_not_what() {
    let folder = Folder::new();
    for (scene, memory) in [("terrain:30000", "512KiB"), ("spd:balls:4", "192KiB"), ("cornell:mirror", "128KiB")] {
        let usual = format!("render {scene} --size 72x56 --spp 2 -q -o a.png");
        let free = json(&folder, &usual);
        assert!(free.get("budget").is_none() && free["nodes"][0].get("traffic").is_none(), "nodes without a budget");
        for policy in POLICIES {
            let what = format!("{scene}, {policy}");
            let r = json(&folder, &format!("{usual} --nodes 8 --memory {memory} --scheduler {policy}"));
            assert_eq!(
                (&r["film"], &r["rays"], &r["counts"]["hits"]),
                (&free["film"], &free["rays"], &free["counts"]["hits"]),
                "{what}"
            );
            assert_eq!(r["budget"]["scheduler"], policy);
            let limit = whole(&r, "/budget/memory");
            let plan = &r["budget"]["plan"];
            assert!(whole(plan, "/total_bytes") <= limit, "{what}");
            let nodes = r["nodes"].as_array().unwrap();
            // The word that the last ones were taken may be on its way when all is finished.
            assert!(sum(nodes, "/traffic/arrived") >= sum(nodes, "/traffic/forwarded"), "{what}");
            assert_eq!(sum(nodes, "/traffic/fetched"), sum(nodes, "/traffic/served"), "{what}");
            for node in nodes {
                assert!(whole(node, "/memory_high_water") <= limit, "{what}: {node}");
                let owned = whole(node, "/owned_bytes");
                assert!(
                    (whole(plan, "/owned_bytes_least")..=whole(plan, "/owned_bytes_most")).contains(&owned),
                    "{what}"
                );
                for queue in node["queues"].as_array().unwrap() {
                    assert!(whole(queue, "/high_water") <= whole(queue, "/limit"), "{what}: {queue}");
                }
            }
            let holds_all = plan["holds_all"] == true;
            assert_eq!(
                holds_all && policy == "hybrid",
                scene == "cornell:mirror" && policy == "hybrid",
                "{what}: {plan}"
            );
            let moved = [sum(nodes, "/traffic/forwarded"), sum(nodes, "/traffic/fetched")];
            match policy {
                _ if holds_all => {}
                "data-parallel" => assert!(moved[0] > 100, "{what}: {moved:?}"),
                "demand-driven" => assert!(moved[1] > 0, "{what}: {moved:?}"),
                _ => assert!(moved[0] + moved[1] > 0, "{what}: {moved:?}"),
            }
        }
    }
}

/// What a person is told, against the report.
#[test]
fn what_travelled_is_said() {
    let folder = Folder::new();
    let arguments = "render terrain:20000 --size 40x30 --spp 1 --nodes 4 --memory 512KiB -o a.png --json a.json";
    let (said, out) = folder.succeed(arguments);
    assert!(out.is_empty() && said.contains("4 nodes of 512KiB, hybrid, each with its own pages"), "{said}");
    let r: Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    let nodes = r["nodes"].as_array().unwrap();
    let moved = ["forwarded", "fetched"].map(|what| sum(nodes, &format!("/traffic/{what}")));
    assert!(said.contains(&format!("{} rays and {} pages went from node to node", moved[0], moved[1])), "{said}");
    let high = nodes.iter().map(|node| whole(node, "/memory_high_water")).max().unwrap();
    assert!(said.contains(&format!("none used more than {high} bytes of 524288")), "{said}");
}

#[test]
fn how_nodes_work_changes_no_picture_either() {
    let folder = Folder::new();
    let usual = "render spd:balls:3 --size 64x48 --spp 1 -q -o a.png";
    let film = json(&folder, usual)["film"].clone();
    for more in [
        "--nodes 1 --memory 1MiB",
        "--nodes 3 --memory 120KiB --dispatcher node",
        "--nodes 2 --shadow-bundles off",
        "--nodes 4 --memory 128KiB --shadow-bundles off",
        "--nodes 4 --memory 128KiB --granularity 1",
        "--nodes 4 --memory 128KiB --granularity 186 --scheduler data-parallel",
        "--nodes 4 --memory 128KiB --in-system 1",
        "--nodes 4 --memory 128KiB --pyramid 8 --scheduler demand-driven",
        "--nodes 4 --memory 256KiB --page-bytes 65536 --voxels 2x2x1",
        "--nodes 4 --memory 128KiB --tiles static --take-over off",
        "--nodes 4 --memory 128KiB --subhosts 0",
        "--nodes 4 --memory 128KiB --subhosts 1 --pyramid 8",
        "--nodes 5 --memory 128KiB --subhosts 5",
        "--nodes 4 --memory 128KiB --tiles pixel-count --in-system 64 --demand-driven all-but-host",
        "--nodes 6 --memory 256KiB --voxels 3x2x1 --demand-driven location --scheduler hybrid-1995",
        "--nodes 6 --memory 256KiB --voxels 3x2x1 --ways voxels --scheduler data-parallel --page-bytes 4096",
        "--nodes 4 --memory 256KiB --voxels 2x2x1 --ways voxels --light-cache 24KiB --page-bytes 4096",
        "--nodes 8 --memory 1000GiB --kernels portable",
        "--nodes 4 --memory 256KiB --light-cache 24KiB --page-bytes 4096",
        "--nodes 4 --memory 256KiB --light-cache 0 --scheduler hybrid-1995 --page-bytes 4096",
        "--nodes 4 --memory 256KiB --light-cache 1GiB --scheduler data-parallel --page-bytes 4096",
    ] {
        assert_eq!(json(&folder, &format!("{usual} {more}"))["film"], film, "{more}");
    }
    let r = json(&folder, &format!("{usual} --nodes 4 --memory 128KiB --granularity 7 --in-system 9 --pyramid 8"));
    let said = ["granularity", "in_system", "pyramid"].map(|name| whole(&r, &format!("/budget/{name}")));
    assert_eq!(said, [7, 9, 8]);
    assert_eq!((&r["budget"]["tiles"], &r["budget"]["take_over"]), (&"dynamic".into(), &true.into()));
}

/// Who may be given tiles is, and nobody else; an error says who could be.
#[test]
fn tiles_go_to_those_that_a_criterion_admits() {
    let folder = Folder::new();
    let usual = "render spd:balls-noground:3 --size 64x64 --spp 1 -q -o a.png --nodes 9 --voxels 3x3x1 --memory 256KiB \
                 --scheduler hybrid-1995";
    let with_tiles = |more: &str| {
        let r = json(&folder, &format!("{usual} {more}"));
        let nodes = r["nodes"].as_array().unwrap();
        let numbers: Vec<u64> = nodes.iter().filter(|n| whole(n, "/runs") > 0).map(|n| whole(n, "/node")).collect();
        assert!(numbers.len() as u64 <= whole(&r, "/budget/nodes_with_tiles"), "{more}");
        (numbers, whole(&r, "/budget/nodes_with_tiles"), nodes.iter().map(|n| whole(n, "/runs")).max())
    };
    // Static: each has a part of the picture, in one run.
    assert_eq!(with_tiles("--tiles static --take-over off"), ((1..=9).collect(), 9, Some(1)));
    assert_eq!(
        with_tiles("--tiles static --take-over off --demand-driven all-but-host"),
        ((2..=9).collect(), 8, Some(1))
    );
    let (location, admitted, _) = with_tiles("--tiles static --take-over off --demand-driven location");
    assert_eq!((location.len(), admitted), (8, 8));
    let said = talk(&folder.run(&format!("{usual} --demand-driven objects:1")));
    let (_, advice) = said.split_once("give ").unwrap_or_else(|| panic!("{said}"));
    let least = advice.split_once(',').unwrap().0;
    assert_eq!(with_tiles(&format!("--tiles static {least}")).1, 1);
    let said = talk(&folder.run(&usual.replace("3x3x1", "4x4x1").replace("-q", "-q --demand-driven location")));
    assert!(said.contains("--voxels 3x3x1"), "{said}");
}

/// What an error says would do, does; both ways out of it.
#[test]
fn errors_name_what_would_do() {
    let folder = Folder::new();
    folder.succeed("pack terrain:20000 -q -o t.hyb");
    let before = folder.names();
    let mut ways = 0;
    for (scene, nodes, memory) in [
        ("spd:balls:3", 2, "1"),
        ("spd:balls:3", 2, "64KiB"),
        ("terrain:20000", 2, "256KiB"),
        ("terrain:20000", 2, "300KiB --scheduler data-parallel"),
        ("terrain:20000", 4, "200000 --page-bytes 16384"),
        ("t.hyb", 3, "384KiB"),
    ] {
        for verb in ["render -o a.png --size 24x16 --spp 1", "plan"] {
            let run = |arguments: &str| folder.run(&format!("{verb} {scene} {arguments}"));
            let rest = memory.split_once(' ').map_or("", |(_, rest)| rest);
            let failed = run(&format!("--nodes {nodes} --memory {memory}"));
            let said = talk(&failed);
            assert_eq!((failed.status.code(), failed.stdout.len()), (Some(1), 0), "{scene} {memory}: {said}");
            assert_eq!(folder.names(), before);
            let last = said.lines().last().unwrap();
            assert!(last.starts_with("hybray: ") && last.contains(&format!("{nodes} nodes")), "{last}");
            let advice = last.split_once("give ").unwrap_or_else(|| panic!("{last}")).1;
            let advice = advice.split_once(';').map_or(advice, |(advice, _)| advice);
            for way in advice.split(", or ") {
                ways += 1;
                let rest = if way.contains("--page-bytes") { "" } else { rest };
                let first = memory.split(' ').next().unwrap();
                let all = if way.starts_with("--memory") {
                    format!("--nodes {nodes} {way} {rest}")
                } else {
                    format!("--memory {first} {way} {rest}")
                };
                let output = run(&all);
                assert_eq!(output.status.code(), Some(0), "{scene}: {last}: {all}: {}", talk(&output));
                let _ = std::fs::remove_file(folder.0.join("a.png"));
            }
        }
    }
    assert!(ways >= 18, "{ways}");
    let said = talk(&folder.run("plan t.hyb --nodes 3 --memory 384KiB"));
    assert!(said.contains("packed with --page-bytes"), "{said}");
}

/// Full pages if they fit; compact ones if they do not, unless somebody says otherwise; and one picture.
#[test]
fn pages_are_compact_where_full_ones_do_not_fit() {
    let folder = Folder::new();
    let scene = "terrain:20000 --nodes 2 --page-bytes 16384";
    let plan = |more: &str| json(&folder, &format!("plan {scene} {more}"));
    let [full, compact] = ["full", "compact"].map(|form| {
        let r = plan(&format!("--memory 64MiB --pages {form}"));
        assert_eq!(whole(&r, "/compact_pages"), if form == "full" { 0 } else { whole(&r, "/pages") });
        whole(&r, "/least_memory") / 1024
    });
    assert!(compact < full - full / 4, "{compact} {full}");
    assert_eq!(whole(&plan(&format!("--memory {full}KiB")), "/compact_pages"), 0);
    for memory in [compact, full - 1] {
        let r = plan(&format!("--memory {memory}KiB"));
        assert_eq!(whole(&r, "/compact_pages"), whole(&r, "/pages"), "{memory}");
    }
    let too_little = folder.run(&format!("plan {scene} --memory {}KiB --pages full", full - 1));
    assert_eq!(too_little.status.code(), Some(1));
    let film =
        |more: &str| json(&folder, &format!("render {scene} --size 48x36 --spp 1 -q -o a.png {more}"))["film"].clone();
    let expected = film("");
    for more in [format!("--memory {}KiB", full - 1), format!("--memory {full}KiB"), "--pages compact".to_owned()] {
        assert_eq!(film(&more), expected, "{more}");
    }
}

#[test]
fn settings_of_budgets_want_one() {
    let folder = Folder::new();
    for (option, value) in [
        ("--scheduler", "hybrid"),
        ("--granularity", "9"),
        ("--in-system", "9"),
        ("--pyramid", "8"),
        ("--light-cache", "0"),
        ("--tiles", "static"),
        ("--demand-driven", "all"),
        ("--subhosts", "0"),
        ("--ways", "direct"),
        ("--take-over", "off"),
    ] {
        let output = folder.run(&format!("render spd:balls:1 -o a.png {option} {value}"));
        let said = talk(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(option) && said.contains("--memory 32MiB"), "{said}");
    }
    for (option, value, words) in [
        ("--scheduler", "fifo", "hybrid, hybrid-1995, data-parallel, demand-driven"),
        ("--granularity", "0", "1..=186"),
        ("--granularity", "187", "1..=186"),
        ("--in-system", "0", "--in-system"),
        ("--pyramid", "12", "8, 16"),
        ("--light-cache", "12parsecs", "`parsecs` is no unit of memory"),
        ("--tiles", "sometimes", "dynamic, pixel-count, static"),
        ("--demand-driven", "some", "objects:500"),
        ("--demand-driven", "objects:-1", "objects:500"),
        ("--subhosts", "-1", "--subhosts"),
        ("--take-over", "maybe", "on, off"),
        ("--ways", "long", "direct, voxels"),
        ("--memory", "0", "such as 32MiB"),
        ("--memory", "99999999999GiB", "such as 32MiB"),
        ("--memory", "12parsecs", "`parsecs` is no unit of memory"),
    ] {
        for verb in
            ["render spd:balls:1 --memory 1MiB", "simulate spd:balls:1 --machine threads --nodes 2 --memory 1MiB"]
        {
            let verb = if option == "--memory" { verb.replace(" --memory 1MiB", "") } else { verb.to_owned() };
            let output = folder.run(&format!("{verb} {option}={value}"));
            let said = talk(&output);
            assert_eq!(output.status.code(), Some(2), "{said}");
            assert!(said.contains(option) && said.contains(words), "{option} {value}: {said}");
        }
    }
    assert!(folder.names().is_empty());
}

/// The table's figures are those of the JSON, and they add up.
#[test]
fn the_plan_in_words_and_in_json() {
    let folder = Folder::new();
    let arguments = "plan terrain:20000 --nodes 8 --memory 512KiB --scheduler hybrid-1995";
    let r = json(&folder, arguments);
    let (talk, out) = folder.succeed(arguments);
    assert_eq!(talk, "");
    let table = String::from_utf8(out).unwrap();
    let mut total = 0;
    for (term, line) in r["terms"].as_array().unwrap().iter().zip(table.lines().skip(1)) {
        let [count, each, bytes] = ["/count", "/bytes_each", "/bytes"].map(|field| whole(term, field));
        assert!((count * each).next_multiple_of(64) == bytes, "{term}");
        total += bytes;
        let words: Vec<_> = line.split_whitespace().collect();
        let (name, figures) = words.split_at(words.len() - 3);
        assert_eq!(name.join(" "), *term["name"].as_str().unwrap());
        assert_eq!(figures, [count, each, bytes].map(|figure| figure.to_string()), "{line}");
    }
    assert_eq!(whole(&r, "/total_bytes"), total);
    assert!(total <= 512 * 1024 && total > 480 * 1024, "{total}");
    assert_eq!((whole(&r, "/nodes"), whole(&r, "/memory")), (8, 512 * 1024));
    assert_eq!(r["holds_all"], false);
    assert!(8 * whole(&r, "/owned_bytes_most") >= whole(&r, "/page_bytes"));
    assert!(8 * whole(&r, "/owned_bytes_least") <= whole(&r, "/page_bytes"));
    assert!(whole(&r, "/page_memory") >= whole(&r, "/owned_bytes_most"));
    // At least 32 places of a page.
    assert!(whole(&r, "/page_memory") / whole(&r, "/page_bytes_max") >= 32, "{r}");
    let (memory, nodes) = (whole(&r, "/least_memory"), whole(&r, "/least_nodes"));
    assert!((1..=8).contains(&nodes) && memory <= 512 * 1024 && memory.is_multiple_of(1024));
    for words in [
        format!("--memory {}KiB", memory / 1024),
        format!("--nodes {nodes}"),
        "hybrid-1995".to_owned(),
        format!("a cache of {} places", whole(&r, "/cache_places")),
    ] {
        assert!(table.contains(&words), "{words}: {table}");
    }
    let (_, out) = folder.succeed("plan cornell --nodes 3 --memory 1MiB --json p.json");
    assert!(String::from_utf8(out).unwrap().contains("has room for all others, too"));
    assert_eq!(serde_json::from_slice::<Value>(&folder.read("p.json")).unwrap()["holds_all"], true);
}

/// Light caches: what is set, what is used, what is said when it is too much, and that what is said would do does.
#[test]
fn light_caches_are_planned() {
    let folder = Folder::new();
    let plan = |more: &str| json(&folder, &format!("plan spd:balls:4 --nodes 8 --memory 256KiB {more}"));
    let term = |r: &Value| {
        let terms = r["terms"].as_array().unwrap();
        let found = terms.iter().find(|term| term["name"] == "copies of pages").unwrap_or_else(|| panic!("{r}"));
        (whole(found, "/bytes"), whole(r, "/light_caches/pages_most"), whole(r, "/light_caches/lights"))
    };
    let without = plan("--scheduler demand-driven");
    for none in [&without, &plan("--light-cache 0 --scheduler hybrid-1995")] {
        assert_eq!((term(none), whole(none, "/copies_most")), ((0, 0, 0), 0));
    }
    let some = plan("--light-cache 20000 --scheduler demand-driven");
    let (bytes, pages, lights) = term(&some);
    assert!((10_000..=20_000).contains(&bytes) && pages > 1 && lights == 3, "{bytes}, {pages}, {lights}");
    assert_eq!(whole(&some, "/light_caches/bytes"), bytes);
    assert!(whole(&some, "/cache_places") < whole(&without, "/cache_places"));
    assert!(whole(&some, "/total_bytes") <= 256 * 1024);
    assert_eq!(whole(&some, "/copies_most"), pages);
    // What a pilot found comes beside them.
    let (piloted, both) = (plan(""), plan("--light-cache 20000"));
    assert_eq!((term(&piloted).1, term(&piloted).2, term(&both).2), (0, 0, 3));
    assert!(term(&piloted).0 > 0 && whole(&piloted, "/copies_least") > 0 && term(&both).0 > bytes);
    // Without one there is none of that; fewer rays find something else.
    let pilot = |rays: u32| whole(&plan(&format!("--pilot {rays}")), "/copies_most");
    assert_eq!((pilot(0), pilot(16_384)), (0, whole(&piloted, "/copies_most")));
    assert_ne!(
        (pilot(30), whole(&plan("--pilot 30"), "/copies_least")),
        (pilot(16_384), whole(&piloted, "/copies_least"))
    );
    for r in [&piloted, &both] {
        assert!(whole(r, "/total_bytes") <= 256 * 1024 && whole(r, "/cache_places") > 2, "{r}");
    }
    // By default all that there are, or none.
    assert_eq!(term(&plan("--scheduler hybrid-1995")), (0, 0, 0));
    let roomy = json(&folder, "plan spd:balls:4 --nodes 8 --memory 1MiB --scheduler hybrid-1995");
    let (bytes, ..) = term(&roomy);
    assert!(bytes > 100_000, "{bytes}");
    let all = json(&folder, "plan spd:balls:4 --nodes 8 --memory 1MiB --scheduler hybrid-1995 --light-cache 512KiB");
    assert_eq!(term(&all), term(&roomy));
    let table = "plan spd:balls:4 --nodes 8 --memory 256KiB --light-cache 20000 --scheduler demand-driven";
    let (_, table) = folder.succeed(table);
    let table = String::from_utf8(table).unwrap();
    assert!(table.contains(&format!(" to {pages} pages of others from the beginning")), "{table}");
    assert!(table.contains(&format!(" to {pages} lie towards 3 lights")), "{table}");
    // Every page fits.
    assert_eq!(term(&json(&folder, "plan spd:balls:4 --nodes 8 --memory 2MiB --light-cache 1MiB")), (0, 0, 0));

    for verb in ["plan", "render -o a.png --size 24x16 --spp 1", "simulate --machine threads --size 16x16 --spp 1"] {
        let run =
            |more: &str| folder.run(&format!("{verb} spd:balls:4 --nodes 8 --memory 192KiB --light-cache {more}"));
        let failed = run("1MiB");
        let said = talk(&failed);
        let last = said.lines().last().unwrap();
        assert_eq!(failed.status.code(), Some(1), "{said}");
        assert!(last.starts_with("hybray: --light-cache 1MiB wants "), "{last}");
        let would_do = last.split_once("give --light-cache ").unwrap_or_else(|| panic!("{last}")).1;
        let output = run(would_do);
        assert_eq!(output.status.code(), Some(0), "{last}: {}", talk(&output));
    }
}

/// The examples of docs/MEMORY.md are what the program prints.
#[test]
fn the_examples_in_the_document() {
    let examples: Vec<_> = MEMORY_MD.split("\n$ hybray ").skip(1).collect();
    assert_eq!(examples.len(), 2);
    for example in examples {
        let (command, rest) = example.split_once('\n').unwrap();
        let (shown, _) = rest.split_once("```").unwrap();
        let output = Folder::new().run(command);
        let printed = String::from_utf8(output.stdout.clone()).unwrap() + &talk(&output);
        assert!(shown == printed, "docs/MEMORY.md shows\n{shown}\nwhere `hybray {command}` prints\n{printed}");
    }
}

/// Every term has a line in docs/MEMORY.md, with its size, how many there are, and in the right order; what it says of the
/// cost of a peer and a page follows from them.
#[test]
fn the_terms_in_the_document() {
    let folder = Folder::new();
    let plan = |nodes: u16| json(&folder, &format!("plan spd:balls:4 --nodes {nodes} --memory 1MiB"));
    let (r, more) = (plan(9), plan(10));
    let (_, table) = MEMORY_MD.split_once("| term | each | how many |").expect("the table of terms");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    let pages = whole(&r, "/pages");
    let (mut a_peer, mut a_page) = (0, 0);
    let mut expected = String::new();
    for (at, (term, later)) in r["terms"].as_array().unwrap().iter().zip(more["terms"].as_array().unwrap()).enumerate()
    {
        let (count, each) = (whole(term, "/count"), whole(term, "/bytes_each"));
        let said = rows.get(at).and_then(|row| row.get(2)).copied().unwrap_or("?");
        expected += &format!("| {} | {each} | {said} |\n", term["name"].as_str().unwrap());
        match said {
            "a peer" => {
                assert_eq!((count, whole(later, "/count")), (10, 11), "{term}");
                a_peer += each;
            }
            "a page" => {
                assert_eq!(count, pages, "{term}");
                a_page += each;
            }
            "a page and a node of it" => a_page += each,
            "a share" | "the scene's" | "what is left" | "as set" => {}
            said => assert_eq!(said, count.to_string(), "{term}"),
        }
    }
    let written: String = rows.iter().map(|row| format!("| {} | {} | {} |\n", row[0], row[1], row[2])).collect();
    assert!(written == expected, "docs/MEMORY.md has\n{written}\nand the plan\n{expected}");
    for words in [format!("A peer costs {a_peer} bytes"), format!("a page {a_page}")] {
        assert!(MEMORY_MD.contains(&words), "{words}");
    }
}
