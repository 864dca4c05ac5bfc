//! `hybray pack`, and packed scenes where scenes are taken.

use super::{Folder, SPHERE, talk};

fn film(folder: &Folder, scene: &str) -> String {
    folder.succeed(&format!("render {scene} --size 40x30 --spp 2 -q -o p.png --json r.json"));
    let report = String::from_utf8(folder.read("r.json")).unwrap();
    report.lines().find(|line| line.contains("\"film\"")).unwrap().to_owned()
}

#[test]
fn every_command_takes_what_it_made() {
    let folder = Folder::new().with("ball.nff", SPHERE);
    for scene in ["spd:balls:2", "terrain:5000", "ball.nff", "cornell:mirror"] {
        let (said, out) = folder.succeed(&format!("pack {scene} -o packed.hyb --voxels 2x2x1 --json pack.json"));
        assert!(out.is_empty() && said.contains("4 voxels") && said.ends_with("packed.hyb\n"), "{said}");
        let report = String::from_utf8(folder.read("pack.json")).unwrap();
        for key in ["file_bytes", "page_bytes", "pages", "voxels", "triangles", "peak_bytes"] {
            assert!(report.contains(&format!("\"{key}\": ")), "{report}");
        }
        assert_eq!(film(&folder, "packed.hyb"), film(&folder, scene), "{scene}");
        let info = |scene: &str| {
            let (_, out) = folder.succeed(&format!("info {scene}"));
            let text = String::from_utf8(out).unwrap();
            let kept = ["objects", "primitives", "tables", "cameras", "requires"];
            text.lines().filter(|line| kept.iter().any(|k| line.starts_with(k))).map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(info("packed.hyb"), info(scene));
        assert_eq!(info(scene).len(), 5);
        let rays = b"0 0 9 0 0 -1\n0.1 0.2 9 0 0 -1\n3 3 3 -1 -1.01 -1\n";
        let traced = |scene: &str| folder.run_with(&format!("trace {scene}"), rays).stdout;
        assert_eq!(traced("packed.hyb"), traced(scene), "{scene}");
    }
    // Nothing else is left, the file between the passes least of all.
    assert_eq!(folder.names(), ["ball.nff", "p.png", "pack.json", "packed.hyb", "r.json"]);
}

#[test]
fn the_scene_names_the_file() {
    let folder = Folder::new();
    folder.succeed("pack spd:balls:1");
    folder.succeed("pack terrain:100 -q");
    assert_eq!(folder.names(), ["spd-balls-1.hyb", "terrain-100.hyb"]);
}

#[test]
fn mistakes() {
    let folder = Folder::new().with("noise.hyb", "this is not it").with("empty.hyb", "");
    folder.succeed("pack cornell -q -o good.hyb");
    let before = folder.names();
    let check = |arguments: &str, code: i32, expected: &[&str]| {
        let output = folder.run(arguments);
        let said = talk(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments}: {said}");
        assert!(expected.iter().all(|e| said.contains(e)), "{arguments}: {said}");
        assert_eq!(folder.names(), before, "{arguments}");
    };
    check("convert good.hyb a.nff", 1, &["good.hyb", "packed scene", "packed from"]);
    check("pack good.hyb -o a.hyb", 1, &["good.hyb", "packed scene"]);
    check("render noise.hyb -o a.png", 1, &["noise.hyb", "no packed scene", "hybray pack"]);
    check("info empty.hyb", 1, &["empty.hyb", "no packed scene"]);
    check("trace missing.hyb", 1, &["missing.hyb", "no such file"]);
    check("render good.hyb -o a.png --camera none", 1, &["no camera `none`"]);
    check("pack terrain:1 -o a.hyb", 1, &["terrain", "from 2"]);
    check("pack cornell -o nowhere/a.hyb", 1, &["nowhere/a.hyb", "folder"]);
    for verb in ["render", "info", "pack"] {
        check(&format!("{verb} cornell --voxels 0"), 2, &["--voxels", "such as 32"]);
        check(&format!("{verb} cornell --voxels 4x8"), 2, &["--voxels", "4x8x1"]);
        check(&format!("{verb} cornell --voxels 999x999x999"), 2, &["--voxels", "64x64x16"]);
    }
}

#[test]
fn settings_that_come_too_late_are_said() {
    let folder = Folder::new();
    folder.succeed("pack cornell -q -o a.hyb");
    let (said, _) = folder.succeed("render a.hyb --size 8x8 --voxels 4 -o a.png");
    assert!(said.contains("packed already"), "{said}");
}

/// Of a scene that takes long, nothing is left when it is interrupted.
#[cfg(unix)]
#[test]
fn ctrl_c_leaves_nothing() {
    let folder = Folder::new();
    let mut child = folder.command("pack terrain:20000000 -o a.hyb").spawn().unwrap();
    // The program knows of Ctrl-C before it makes the temporary file.
    while folder.names().is_empty() {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::yield_now();
    }
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(talk(&output), "interrupted: nothing is written\n");
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}
