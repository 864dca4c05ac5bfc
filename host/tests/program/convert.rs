//! `hybray convert`: what goes out and comes back is the same scene, where the format can say all.

use super::Folder;
use serde_json::Value;

fn film(folder: &Folder, scene: &str, more: &str) -> String {
    let (_, out) = folder.succeed(&format!("render {scene} -q --size 60x60 --spp 2 {more} -o - --json a.json"));
    assert!(!out.is_empty());
    let report: Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    report["film"].as_str().unwrap().to_owned()
}

/// NFF says all of these scenes but the ray depth.
#[test]
fn nff_there_and_back() {
    let folder = Folder::new();
    for scene in ["spd:balls:2", "spd:tree:5", "spd:lattice:2", "spd:mount:3", "spd:gears:1", "spd:teapot:3"] {
        let (talk, out) = folder.succeed(&format!("convert {scene} a.nff"));
        assert_eq!((talk.as_str(), out.as_slice()), ("a.nff\n", &b""[..]), "{scene}");
        let first = film(&folder, scene, "--depth 5");
        assert_eq!(film(&folder, "a.nff", "--depth 5"), first, "{scene}");
        folder.succeed("convert a.nff b.nff");
        assert_eq!(folder.read("b.nff"), folder.read("a.nff"), "{scene}: what came from NFF goes back as it was");
    }
}

#[test]
fn what_a_format_cannot_say_is_said() {
    let folder = Folder::new();
    let (talk, _) = folder.succeed("convert cornell a.nff");
    assert!(talk.lines().any(|l| l.starts_with("warning: ") && l.contains("area")), "{talk}");
    assert!(talk.ends_with("a.nff\n"), "{talk}");
}

#[test]
fn obj_and_pov() {
    let folder = Folder::new();
    folder.succeed("convert organic:500 a.obj");
    folder.succeed("convert spd:balls:2 a.pov --size 320x240");
    assert_eq!(folder.names(), ["a.mtl", "a.obj", "a.pov"]);
    let (_, out) = folder.succeed("info a.obj");
    assert!(String::from_utf8(out).unwrap().contains("500 triangles"));
    let pov = String::from_utf8(folder.read("a.pov")).unwrap();
    assert!(pov.contains("camera") && pov.matches("sphere").count() > 90, "91 spheres");
}

#[test]
fn sizes_and_cameras() {
    let scene = "[[camera]]\nname = \"a\"\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n[[camera]]\nname = \"b\"\n\
                 eye = [0, 0, 7]\ntarget = [0, 0, 0]\nsize = [30, 20]\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let folder = Folder::new().with("scene.toml", scene);
    for (arguments, eye, size) in [
        ("", "from 0 0 9\n", "resolution 512 512\n"),
        ("--camera b", "from 0 0 7\n", "resolution 30 20\n"),
        ("--camera b --size 64x48", "from 0 0 7\n", "resolution 64 48\n"),
    ] {
        folder.succeed(&format!("convert scene.toml a.nff {arguments}"));
        let nff = String::from_utf8(folder.read("a.nff")).unwrap();
        assert!(nff.contains(eye) && nff.contains(size), "{arguments}: {nff}");
    }
}
