//! The importers as the program calls them: good files, files that are not there, and files that were broken.

use super::testing::{Choices, Folder};
use super::*;
use std::time::{Duration, Instant};

const OBJ: &str = "mtllib m.mtl\no square\nv 0 0 0\nv 1 0 0\nv 1 1 0.5 1\nv 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3/1/-1\n\
    usemtl blue\nf -4//1 -2//1 -1//1\nf 1 2 \\\n 3 4\nl 1 2\n";
const MTL: &str = "newmtl red\nKd 1 0 0\nKs 0.5\nNs 10\nNi 1.5\nillum 7\nTf 0.5 0.5 0.5\nnewmtl blue\nd 0.5\nKe 1 1 1\nmap_Kd a.png\n";
const NFF: &str = "v\nfrom 2 1 3\nat 0 0 0\nup 0 0 1\nangle 45\nhither 0.01\nresolution 64 64\nb 0.1 0.2 0.3\nl 4 3 2\nl 1 -4 4 1 1 1\n\
    f 1 0.75 0.33 1 0.5 10 0.5 1.5\np 5 0 0 0 4 0 0 4 4 0 1 1 0 0 4 0\ns 0 0 0 0.5\nc 0 0 0 1 0 0 5 0.5\npp 3\n\
    0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n";
const TOML: &str = "[settings]\nsize = [64, 48]\nspp = 4\n[background]\ncolour = '#102030'\nambient = 0.1\n[[camera]]\nname = 'a'\n\
    eye = [0, 0, 5]\ntarget = [0, 0, 0]\nfov = 40\n[[light]]\nkind = 'spot'\nposition = [1, 2, 3]\naxis = [0, -1, 0]\nangles = [10, 20]\n\
    [material.gold]\ndiffuse = [0.5, 0.4, 0.1]\nspecular = 1\n[[include]]\nfile = 'a.obj'\ntranslate = [1, 0, 0]\n\
    rotate = { axis = [0, 1, 0], degrees = 45 }\nscale = 2\nmaterials = { red = 'gold' }\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n\
    material = 'gold'\n[[triangle]]\na = [0, 0, 0]\nb = [1, 0, 0]\nc = [0, 1, 0]\n";

fn folder() -> Folder {
    Folder::new(&[("a.obj", OBJ), ("m.mtl", MTL), ("a.nff", NFF), ("a.toml", TOML), ("A B.OBJ", OBJ)])
}

#[test]
fn every_format_by_its_extension() {
    let folder = folder();
    let check = |name: &str, triangles: usize, spheres: usize, cones: usize| {
        let model = load(&folder.file(name)).expect(name);
        let found: usize = model.meshes.iter().map(|m| m.triangles.len()).sum();
        assert_eq!((found, model.spheres.len(), model.cones.len()), (triangles, spheres, cones), "{name}");
    };
    check("a.obj", 4, 0, 0);
    check("A B.OBJ", 4, 0, 0);
    check("a.nff", 4, 1, 1);
    check("a.toml", 5, 1, 0);
    assert_eq!(load("spd:balls:1").expect("built in").spheres.len(), 10);
    assert_eq!(
        [up_axis("a.nff"), up_axis("a.obj"), up_axis("cornell")],
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    );
}

#[test]
fn sources_that_cannot_be_read() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("folder.obj")).expect("a folder");
    std::fs::create_dir(folder.path().join("plain")).expect("a folder");
    for (name, text) in [
        ("empty.obj", ""),
        ("none.obj", "v 0 0 0\n"),
        ("none.nff", "b 0 0 0\n"),
        ("none.toml", "[settings]\nspp = 1\n"),
        ("a.stl", "solid"),
        ("bare", "x"),
        ("lost.toml", "\n[[include]]\nfile = 'lost.nff'\n"),
        ("flat.obj", "v 0 0 0\nf 1 1 1\n"),
    ] {
        folder.write(name, text.as_bytes());
    }
    folder.write("latin.toml", b"# a\n# \xe9\n");
    folder.write("latin.obj", b"v 0 0 0\nusemtl \xe9\n");
    folder.write("picture.obj", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR");
    let check = |name: &str, expected: &str| {
        let source = folder.file(name);
        let error = load(&source).expect_err(name).to_string();
        assert_eq!(error.strip_prefix(&source).unwrap_or(&error), expected, "{name}");
        assert_eq!(error.lines().count(), 1);
    };
    check("b.obj", ": there is no such file; did you mean `a.obj` or `A B.OBJ`?".replace(" or `A B.OBJ`", "").as_str());
    check("zzzzzzzz.nff", ": there is no such file; check the path");
    check("a.ob", ": neither a file nor a built-in scene; did you mean `a.obj`?");
    check("empty.obj", ": the file is empty; export or copy it again");
    check("folder.obj", ": a folder, not a file; name a file in it");
    check("plain", ": a folder, not a file; name a file in it");
    check("a.stl", ": `.stl` is no format that can be read; use .obj, .gltf, .glb, .ply, .nff or .toml");
    check("bare", ": the file has no extension to tell its format by; use .obj, .gltf, .glb, .ply, .nff or .toml");
    check("none.obj", ": holds no faces; check that it is an OBJ file with `f` lines");
    check("none.nff", ": the scene holds no primitives; give it something to draw");
    check("none.toml", ": the scene holds no primitives; give it something to draw");
    check("flat.obj", ": the scene holds no primitives; give it something to draw");
    check("latin.toml", ":2: not UTF-8 text; save the file as UTF-8");
    check("latin.obj", ":2: not UTF-8 text; save the file as UTF-8, or check that it is what its name says");
    check("picture.obj", ":1: not UTF-8 text; save the file as UTF-8, or check that it is what its name says");
    check("lost.toml", ":3: `lost.nff`: there is no such file; check the path");

    let problem = |source: &str| load(source).expect_err(source).to_string();
    assert!(problem("no/such/folder/a.obj").contains("there is no folder `no/such/folder` either"));
    assert!(problem("ternain:100").ends_with("did you mean `terrain`?"), "{}", problem("ternain:100"));
    assert!(problem("spd:bals:4").contains("spd:balls"), "{}", problem("spd:bals:4"));
    assert!(problem("").starts_with(": neither a file nor a built-in scene"));
    assert!(problem("a\nb").starts_with("a b: neither"));
}

#[cfg(unix)]
#[test]
fn files_that_are_not_for_reading() {
    use std::os::unix::fs::PermissionsExt as _;
    use std::os::unix::net::UnixListener;
    let folder = folder();
    let socket = folder.file("socket.obj");
    let _listener = UnixListener::bind(&socket).expect("a socket");
    let error = load(&socket).expect_err("a socket").to_string();
    assert!(error.ends_with(": not a regular file; copy what it gives into a file"), "{error}");

    let secret = folder.file("a.nff");
    std::fs::set_permissions(&secret, std::fs::Permissions::from_mode(0o000)).expect("no permissions");
    if File::open(&secret).is_ok() {
        eprintln!("skipped: this user may read files without permission");
        return;
    }
    let error = load(&secret).expect_err("no permission").to_string();
    assert!(error.contains("cannot be opened") && error.ends_with("check its permissions"), "{error}");
}

#[test]
fn a_material_file_that_is_not_there_is_a_warning() {
    let folder = Folder::new(&[("a.obj", OBJ), ("e.obj", &OBJ.replace("m.mtl", "e.mtl")), ("e.mtl", "")]);
    let model = load(&folder.file("a.obj")).expect("reads");
    assert_eq!(model.materials.len(), 1);
    assert_eq!(model.materials[0].material, mtl::DEFAULT);
    assert!(
        model.warnings[0]
            .ends_with("a.obj:1: the material file `m.mtl` is not there, its materials are the default grey")
    );
    let model = load(&folder.file("e.obj")).expect("reads");
    assert!(model.warnings[0].ends_with("e.mtl: the material file is empty"));
}

/// Small valid files with bytes changed, dropped, doubled and exchanged: an answer, in little time, whatever it is.
#[test]
fn broken_bytes_break_nothing() {
    let folder = folder();
    let words: [&[u8]; 16] = [
        b"nan",
        b"-1",
        b"0",
        b"1e39",
        b"/",
        b"\n",
        b"\\\n",
        b" ",
        b"99999999999",
        b"f ",
        b"\xff",
        b"[[",
        b"'",
        b"= ",
        b"-",
        b"#",
    ];
    let seed = 0x9e37_79b9_7f4a_7c15;
    let mut choices = Choices(seed);
    let (mut read, mut slowest) = (0, Duration::ZERO);
    for case in 0..4_000 {
        let (name, text) = [("a.obj", OBJ), ("m.mtl", MTL), ("a.nff", NFF), ("a.toml", TOML)][case % 4];
        let mut bytes = text.as_bytes().to_vec();
        for _ in 0..=choices.below(4) {
            let at = choices.below(bytes.len());
            let end = (at + 1 + choices.below(12)).min(bytes.len());
            match choices.below(6) {
                0 => bytes[at] = choices.next() as u8,
                1 => drop(bytes.drain(at..end)),
                2 => bytes.truncate(at.max(1)),
                3 => {
                    let part = bytes[at..end].to_vec();
                    let to = choices.below(bytes.len());
                    bytes.splice(to..to, part);
                }
                _ => drop(bytes.splice(at..end.min(at + 2), words[choices.below(words.len())].iter().copied())),
            }
            if bytes.is_empty() {
                bytes.push(b'v');
            }
        }
        let start = Instant::now();
        let library = |_: &str| {
            let mut warnings = error::Warnings::default();
            let found = mtl::read(&bytes[..], name, &mut warnings).map_err(mtl_maps::MaterialFile::Broken)?;
            let found = mtl_maps::Known::all(Path::new(""), found, &mut warnings);
            Ok((found, Vec::new()))
        };
        let result = match name {
            "a.obj" => obj::read(&bytes[..], name, |_| Err(mtl_maps::MaterialFile::Missing)),
            "m.mtl" => obj::read(OBJ.as_bytes(), "a.obj", library),
            "a.nff" => nff::read(&bytes[..], name),
            _ => scene_toml::read(&String::from_utf8_lossy(&bytes), name, folder.path()),
        };
        let result = result.and_then(|model| validate(&model));
        slowest = slowest.max(start.elapsed());
        match result {
            Ok(()) => read += 1,
            Err(error) => {
                let error = error.to_string();
                assert!(error.lines().count() == 1 && error.contains("; "), "case {case}: {error}");
                // The guard is there so that the parser behind it never has to refuse or fail.
                assert!(!error.contains("parser"), "case {case} of seed {seed:#x}: {error}\n{bytes:?}");
            }
        }
    }
    assert!((200..3_800).contains(&read), "{read} of 4000 were read: the changes are too many or too few");
    assert!(slowest < Duration::from_secs(1), "one took {slowest:?}");
}

/// Tables and brackets within each other by the thousand: no parser here may recurse without a bound.
#[test]
fn deep_nesting_is_refused() {
    let folder = Folder::new(&[]);
    for text in [
        "a = ".to_owned() + &"[".repeat(100_000),
        "a = ".to_owned() + &"{a=".repeat(100_000),
        "[a".to_owned() + &".a".repeat(100_000) + "]",
    ] {
        folder.write("a.toml", text.as_bytes());
        assert!(load(&folder.file("a.toml")).is_err());
    }
}

/// Meshes that others made, where they are at hand: counts as published with them.
#[test]
fn real_meshes() {
    let Some(models) = std::env::var_os("HYBRAY_MODELS") else {
        eprintln!("skipped: HYBRAY_MODELS does not name a folder of meshes");
        return;
    };
    let check = |name: &str, faces: u64, triangles: usize, warnings: usize| {
        let path = Path::new(&models).join(name);
        if !path.exists() {
            eprintln!("skipped: {name} is not in HYBRAY_MODELS");
            return;
        }
        let start = Instant::now();
        let mut model = load(&path.display().to_string()).expect(name);
        eprintln!("{name}: {:?}, {:?}", start.elapsed(), model.warnings);
        assert_eq!((model.objects.polygons, model.primitives()), (faces, triangles), "{name}");
        assert_eq!(model.warnings.len(), warnings, "{name}: {:?}", model.warnings);
        crate::framing::complete(&mut model);
        assert_eq!(validate(&model), Ok(()));
    };
    check("stanford-bunny.obj", 69_451, 69_451, 0);
    check("spot.obj", 5_856, 5_856, 1);
    check("teapot.obj", 6_320, 6_320, 0);
    check("rocker-arm.obj", 20_088, 20_088, 0);
    check("suzanne.obj", 500, 968, 0);
}

/// Ten million triangles as OBJ, by hand: `cargo test --release -p hybray --lib ten_million -- --ignored --nocapture`.
/// The high-water mark of the process is read from Linux's `/proc`. Measured in November 2026 (AMD EPYC): 35 bytes a
/// triangle at the peak where neighbours follow each other in the file, 63 where only pairs do.
#[test]
#[ignore = "writes files of 400 MB"]
fn ten_million_triangles() {
    use std::io::Write as _;
    let side = 2237usize;
    for scattered in [false, true] {
        let folder = Folder::new(&[]);
        let source = folder.file("big.obj");
        let mut out = io::BufWriter::new(File::create(&source).expect("a file"));
        for y in 0..side {
            for x in 0..side {
                let height = (x * 7919 + y * 104_729) % 1000;
                writeln!(out, "v {x}.5 {height}.25 {y}.125").expect("written");
            }
        }
        let cells = (side - 1) * (side - 1);
        for cell in 0..cells {
            // A prime that does not divide the number of cells visits each once, far from the one before.
            let cell = if scattered { cell * 1_000_003 % cells } else { cell };
            let a = cell / (side - 1) * side + cell % (side - 1) + 1;
            writeln!(out, "f {a} {} {}\nf {} {} {}", a + 1, a + side, a + 1, a + side + 1, a + side).expect("written");
        }
        drop(out);
        let start = Instant::now();
        let model = load(&source).expect("reads");
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let peak = status.lines().find(|l| l.starts_with("VmHWM")).unwrap_or("VmHWM unknown").to_owned();
        println!("scattered {scattered}: {} meshes, {:?}, {peak}", model.meshes.len(), start.elapsed());
        assert_eq!(model.primitives(), 2 * cells);
    }
}
