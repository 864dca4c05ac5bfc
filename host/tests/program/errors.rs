//! Every mistake: one line that names what is wrong and what to do, soon, and no output.

use super::{Folder, SPHERE, talk};
use std::time::{Duration, Instant};

/// The folder that mistakes are made in.
fn folder() -> Folder {
    let folder = Folder::new()
        .with("empty.obj", "")
        .with("empty.nff", "")
        .with("empty.toml", "")
        .with("blank.obj", "# nothing\n")
        .with("broken.obj", "v 0 0 0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n")
        .with("beyond.obj", "v 0 0 0\nf 1 2 3\n")
        .with("sphere.nff", SPHERE)
        .with("broken.nff", &SPHERE.replace("s 0 0 0 1", "s 0 0 zero 1"))
        .with("far.nff", &SPHERE.replace("from 0 0 5", "from 0 0 1e20").replace("s 0 0 0 1", "s 0 0 0 1e-25"))
        .with("text.txt", "hello");
    std::fs::create_dir(folder.0.join("folder")).unwrap();
    std::fs::create_dir(folder.0.join("folder.png")).unwrap();
    folder
}

/// Fails with `code`, and says all of `words`; arguments that are wrong in themselves (code 2) may say it on several lines.
#[track_caller]
fn check(folder: &Folder, code: i32, arguments: &str, words: &[&str]) {
    let before = folder.names();
    let start = Instant::now();
    let output = folder.run_with(arguments, b"0 0 5 0 0 -1\n");
    let time = start.elapsed();
    let talk = talk(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments}: {talk}");
    assert!(output.stdout.is_empty(), "{arguments}: {:?}", String::from_utf8_lossy(&output.stdout));
    for word in words {
        assert!(talk.contains(word), "{arguments}: `{word}` is missing from: {talk}");
    }
    assert!(code == 2 || talk.lines().count() == 1, "{arguments}: more than one line: {talk}");
    assert!(talk.starts_with(if code == 2 { "error: " } else { "hybray: " }), "{arguments}: {talk}");
    assert!(!talk.contains("panicked") && !talk.contains("RUST_BACKTRACE"), "{arguments}: {talk}");
    assert_eq!(folder.names(), before, "{arguments}: something was left behind");
    // Before any work of length; the limit allows for a busy machine.
    assert!(time < Duration::from_secs(10), "{arguments}: took {time:?}");
}

#[test]
fn scenes_that_cannot_be_read() {
    let folder = &folder();
    // A verb by the way it is used: all read scenes alike.
    for verb in ["render -q -o a.png", "info", "trace", "convert"] {
        let check = |scene: &str, words: &[&str]| {
            let rest = if verb == "convert" { " a.nff" } else { "" };
            let words: Vec<_> = [&[scene], words].concat();
            check(folder, 1, &format!("{verb} {scene}{rest}"), &words);
        };
        check("spd:bals:2", &["no built-in scene", "did you mean `spd:balls`?"]);
        check("spd:balls:99", &["`99` is no size", "from 1 to 7"]);
        check("spere.nff", &["no such file", "did you mean `sphere.nff`?"]);
        check("sphere.nf", &["neither a file nor a built-in scene", "did you mean `sphere.nff`?"]);
        check("nosuch", &["neither a file nor a built-in scene", "name a built-in scene or a file"]);
        check("nosuch/a.obj", &["no such file", "no folder `nosuch`"]);
        check("empty.obj", &["the file is empty", "export or copy it again"]);
        check("empty.nff", &["the file is empty", "export or copy it again"]);
        check("empty.toml", &["the file is empty", "export or copy it again"]);
        check("blank.obj", &[]);
        check("broken.obj", &["broken.obj:3"]);
        check("beyond.obj", &["beyond.obj:2"]);
        check("broken.nff", &["broken.nff:11"]);
        check("folder", &["a folder, not a file", "name a file in it"]);
        check("text.txt", &["`.txt` is no format", "use .obj, .gltf, .glb, .ply, .nff or .toml"]);
    }
}

#[test]
fn outputs_that_cannot_be_written() {
    let folder = &folder();
    let check = |arguments: &str, words: &[&str]| check(folder, 1, arguments, words);
    // The scene would take minutes: whether its picture can be written is known before.
    let long = "spd:balls:7 --size 4000x4000 --spp 1000";
    check(&format!("render {long} -o nosuch/a.png"), &["nosuch/a.png", "make the folder"]);
    check(&format!("render {long} -o folder.png"), &["folder.png", "is a directory", "name a file in it"]);
    check(&format!("render {long} -o folder/"), &["folder/", ".png, .exr and .ppm work"]);
    check(&format!("render {long} -o a.jpg"), &["a.jpg", ".png, .exr and .ppm work"]);
    check(&format!("render {long} -o a"), &["`a`", ".png, .exr and .ppm work"]);
    check(&format!("render {long} -o a.png --json nosuch/a.json"), &["nosuch/a.json", "make the folder"]);
    check(&format!("render {long} -o a.png --json folder"), &["folder", "is a directory", "name a file in it"]);
    check(&format!("render {long} -o - --json -"), &["both", "standard output", "give one of them a file"]);
    check("convert sphere.nff a.stl", &["a.stl", ".nff, .obj and .pov work"]);
    check("convert sphere.nff nosuch/a.nff", &["nosuch/a.nff", "make the folder"]);
    check("convert sphere.nff nosuch/a.obj", &["nosuch/a.mtl", "make the folder"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full() {
    let folder = folder();
    let output = folder.run("render sphere.nff -q -o - --json /dev/full");
    let talk = talk(&output);
    assert_eq!(output.status.code(), Some(1), "{talk}");
    assert!(talk.starts_with("hybray: /dev/full: ") && talk.contains("make room"), "{talk}");
    assert_eq!(talk.lines().count(), 1, "{talk}");
}

#[test]
fn a_file_in_the_way_stays() {
    let folder = folder().with("old.png", "old");
    check(&folder, 1, "render nosuch.nff -o old.png", &["nosuch.nff"]);
    assert_eq!(folder.read("old.png"), b"old");
}

#[test]
fn cameras() {
    let folder = &folder();
    check(folder, 1, "render -q sphere.nff -o a.png --camera left", &["no camera `left`", "it has `"]);
    check(folder, 1, "convert sphere.nff a.pov --camera left", &["no camera `left`", "it has `"]);
    check(folder, 2, "render -q sphere.nff -o a.png --projection flat", &["flat", "orthographic, spherical"]);
    check(folder, 2, "render -q sphere.nff -o a.png --aperture 0.1 --blades 2", &["--blades", "3 to 16, or 0"]);
    check(folder, 2, "render -q sphere.nff -o a.png --aperture=-1", &["--aperture", "0 or more"]);
    check(folder, 1, "render -q sphere.nff -o a.png --focus 2", &["nothing without a lens", "--aperture 0.0"]);
    check(folder, 1, "render -q sphere.nff -o a.png --height 2", &["--height", "give --projection orthographic"]);
    let wide = "render -q sphere.nff -o a.png --projection spherical --aperture 0.1";
    check(folder, 1, wide, &["--aperture", "give --projection perspective"]);
    let near = "render -q sphere.nff -o a.png --aperture 1 --focus 0.0001";
    check(folder, 1, near, &["aperture is 1 and its focus 0.0001", "at most 1000 times"]);
    check(folder, 1, "render -q far.nff -o a.png", &["camera", "bring it nearer"]);
}

#[test]
fn arguments_that_are_wrong_in_themselves() {
    let folder = &folder();
    let check = |arguments: &str, words: &[&str]| check(folder, 2, arguments, words);
    for (option, value, words) in [
        ("--size", "0x5", "1 to 32768 columns and rows, such as 640x480"),
        ("--size", "5x0", "1 to 32768 columns and rows, such as 640x480"),
        ("--size", "99999x1", "1 to 32768 columns and rows, such as 640x480"),
        ("--size", "640", "such as 640x480"),
        ("--size", "axb", "such as 640x480"),
        ("--size", "-4x4", "such as 640x480"),
        ("--spp", "0", "1..=65535"),
        ("--spp", "65536", "1..=65535"),
        ("--spp", "many", "'--spp <N>'"),
        ("--spp", "1.5", "'--spp <N>'"),
        ("--depth", "0", "1..=64"),
        ("--depth", "65", "1..=64"),
        ("--nodes", "0", "1..=1024"),
        ("--nodes", "1025", "1..=1024"),
        ("--nodes", "two", "'--nodes <N>'"),
        ("--cutoff", "2", "from 0 to 1"),
        ("--cutoff", "nan", "from 0 to 1"),
        ("--exposure", "0", "above 0"),
        ("--exposure", "inf", "above 0"),
        ("--filter", "mitchell", "box, tent, gaussian"),
        ("--seed", "x", "'--seed <N>'"),
        ("--bits", "12", "8, 16"),
        ("--spread", "0.5", "1 or more"),
        ("--tile", "12", "8, 16, 32, 64, 128, 256 or 512"),
        ("--dispatcher", "moon", "host, node"),
        ("--kernels", "fast", "auto, portable"),
        ("--tree", "oak", "sah, midpoint"),
        ("--page-bytes", "100", "4096..=65536"),
        ("--cell-depth", "0", "1..=48"),
    ] {
        check(&format!("render sphere.nff -o a.png {option}={value}"), &[value, option, words]);
    }
    check("rendr sphere.nff", &["rendr", "render"]);
    check("render sphere.nff --sise 4x4", &["--sise", "--size"]);
    check("render", &["<SCENE>"]);
    check("convert sphere.nff", &["<OUTPUT>"]);
    check("completions klingon", &["klingon", "bash"]);
}

#[test]
fn a_missing_material_file_is_a_warning() {
    let triangle = "mtllib gone.mtl\nusemtl gold\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let folder = Folder::new().with("triangle.obj", triangle);
    let (talk, _) = folder.succeed("render triangle.obj --size 8x8 --spp 1 -o a.png --json a.json");
    assert!(talk.contains("warning: triangle.obj:1: the material file `gone.mtl` is not there"), "{talk}");
    assert!(talk.contains("default"), "what is taken instead: {talk}");
    let report: serde_json::Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    assert!(report["warnings"][0].as_str().unwrap().contains("gone.mtl"), "{report}");
    assert_eq!(folder.names(), ["a.json", "a.png", "triangle.obj"]);
    assert_eq!(folder.succeed("render triangle.obj -q --size 8x8 --spp 1 -o a.png").0, "");
    let (_, out) = folder.succeed("info triangle.obj");
    assert!(String::from_utf8(out).unwrap().contains("gone.mtl"));
}

#[test]
fn views_and_layers_that_cannot_be() {
    let camera = |name: &str| format!("[[camera]]\nname = \"{name}\"\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n");
    let folder = &folder()
        .with("nameless.toml", "[[camera]]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n")
        .with("path.toml", &camera("../up"))
        .with("twice.toml", &(camera("a") + &camera("a")))
        .with("more.toml", &(camera("a") + "[settings]\nspp = 3\n"))
        .with("none.toml", "# nobody\n")
        .with("one.toml", &camera("a"));
    let render = |rest: &str, words: &[&str]| check(folder, 1, &format!("render spd:balls:1 -q {rest}"), words);
    render("-o a.png --cameras nosuch.toml", &["nosuch.toml", "no such file"]);
    render("-o a.png --cameras none.toml", &["none.toml", "no cameras", "[[camera]]"]);
    render("-o a.png --cameras nameless.toml", &["nameless.toml:1", "no `name`"]);
    render("-o a.png --cameras path.toml", &["path.toml:2", "../up", "part of a file's name"]);
    render("-o a.png --cameras twice.toml", &["twice.toml", "two cameras are called"]);
    render("-o a.png --cameras more.toml", &["more.toml:5", "settings"]);
    render("-o - --cameras one.toml", &["standard output", "-o out.png"]);
    render("-o nosuch/a.png --cameras one.toml", &["nosuch/a-a.png"]);
    render("-o a.png --layers depth", &["a.png", "-o out.exr"]);
    render("-o a.exr --spp 1 --layers depth,variance", &["--spp 2"]);
    check(folder, 2, "render spd:balls:1 -o a.png --cameras one.toml --camera a", &["--camera"]);
    check(folder, 2, "render spd:balls:1 -o a.exr --layers colour", &["colour", "albedo"]);
}
