//! Results go to standard output and talk to standard error; a reader who has enough is no error.

use super::{Folder, SPHERE, talk};
use hybray::builtin;
use std::io::Write;
use std::process::Stdio;

fn text(folder: &Folder, arguments: &str) -> String {
    let (talk, out) = folder.succeed(arguments);
    assert_eq!(talk, "", "{arguments}");
    String::from_utf8(out).unwrap()
}

#[test]
fn scenes_are_listed_with_their_sizes() {
    let listed = text(&Folder::new(), "scenes");
    let lines: Vec<_> = listed.lines().collect();
    assert_eq!(lines.len(), builtin::names().len());
    for (line, scene) in lines.iter().zip(builtin::names()) {
        assert!(line.starts_with(scene.name) && line.contains(scene.about), "{line}");
        // What the line gives to be typed, makes the scene.
        if let Some(size) = scene.size {
            assert!(
                line.contains(&format!(":{}]", size.default)) && line.contains(&size.largest.to_string()),
                "{line}"
            );
        }
    }
}

#[test]
fn info_says_what_a_scene_holds() {
    let folder = Folder::new().with("sphere.nff", SPHERE);
    let info = text(&folder, "info spd:tree:4");
    for words in ["2 triangles", "31 spheres", "31 cones", "7 lights", "cameras", "extent", "pages", "bytes"] {
        assert!(info.contains(words), "{words}: {info}");
    }
    let info = text(&folder, "info sphere.nff --tree midpoint --page-bytes 4096");
    assert!(info.contains("1 spheres") && info.contains("[-1.0, -1.0, -1.0] to [1.0, 1.0, 1.0]"), "{info}");
}

#[test]
fn completions_and_manual() {
    let folder = Folder::new();
    for (shell, word) in [("bash", "complete -F _hybray"), ("zsh", "#compdef hybray"), ("fish", "complete -c hybray")] {
        let script = text(&folder, &format!("completions {shell}"));
        assert!(script.contains(word) && script.contains("page-bytes"), "{shell}");
        for word in ["plan", "granularity", "in-system", "pyramid", "hybrid-1995", "powerxplorer"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    let manual = text(&folder, "man");
    for word in [
        ".TH hybray",
        "render",
        "trace",
        "convert",
        ".TH hybray-render",
        ".TH hybray-trace",
        ".TH hybray-plan",
        "demand\\-driven",
        "T800",
    ] {
        assert!(manual.contains(word), "{word}");
    }
    let help = text(&folder, "render --help");
    for word in ["--output", "--size", "--nodes", "--json", "--memory", "--granularity", "data-parallel"] {
        assert!(help.contains(word), "{word}");
    }
    assert!(text(&folder, "--version").starts_with("hybray "));
    // Without a verb it says which there are; that is a mistake, and no result.
    let alone = folder.run("");
    assert_eq!((alone.status.code(), alone.stdout.as_slice()), (Some(2), &b""[..]));
    assert!(talk(&alone).contains("render"));
}

/// As in `hybray ... | head -1`, at its worst: nobody reads from the start.
#[track_caller]
fn check_unread(folder: &Folder, arguments: &str) {
    let mut child = folder.command(arguments).stdin(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    // Enough rays that their answers do not all fit a buffer.
    let _ = child.stdin.take().unwrap().write_all("0 0 9 0 0 -1\n".repeat(5000).as_bytes());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), talk(&output).as_str()), (Some(0), ""), "{arguments}");
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = Folder::new();
    for arguments in [
        "scenes",
        "man",
        "info spd:balls:1",
        "completions bash",
        "completions zsh",
        "completions fish",
        "--help",
        "render spd:balls:1 --size 8x8 --spp 1 -q -o a.png --json -",
        "trace spd:balls:1",
        "plan spd:balls:1 --nodes 2 --memory 1MiB",
        "simulate spd:balls:1 --machine threads --nodes 2 --size 8x8 -q",
    ] {
        check_unread(&folder, arguments);
    }
    assert_eq!(folder.names(), ["a.png"]);
}

#[test]
fn a_closed_pipe_is_no_error_for_a_picture() {
    check_unread(&Folder::new(), "render spd:balls:1 --size 100x100 --spp 1 -q -o -");
}
