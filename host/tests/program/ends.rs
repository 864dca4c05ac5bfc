//! Ctrl-C: what is finished is written, and the exit code says that it is not all.
#![cfg(unix)]

use super::Folder;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command};

fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// A picture of hours, interrupted when it says for the first time how far it is.
#[test]
fn ctrl_c_keeps_what_is_finished() {
    let folder = Folder::new();
    let arguments = "render spd:balls:2 --size 1024x1024 --spp 4000 --nodes 2 -o a.ppm --json a.json";
    let mut child = folder.command(arguments).spawn().unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("Mrays/s") {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it ended by itself");
    }
    assert_eq!(folder.names().len(), 2, "temporary files: {:?}", folder.names());
    interrupt(&child);
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    assert!(rest.contains("interrupted: ") && rest.contains("tiles are in a.ppm"), "{rest}");
    assert_eq!(folder.names(), ["a.json", "a.ppm"]);

    let report: Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    assert_eq!(report["finished"], false);
    assert_eq!(report["counts"]["tiles"], 128 * 128);
    let ppm = folder.read("a.ppm");
    let pixels = &ppm[ppm.len() - 3 * 1024 * 1024..];
    let drawn = pixels.chunks(3).filter(|rgb| rgb.iter().any(|&c| c > 0)).count();
    let said: usize = rest.split("interrupted: ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(said > 0 && drawn > 0, "nothing was finished in five seconds");
    // Of the scene and its sky nothing is black.
    assert_eq!(drawn, said * 64, "finished tiles are there whole, and others are not there");
}

/// Before the first ray nothing is written, and nothing is left behind.
#[test]
fn ctrl_c_before_the_picture_begins() {
    let folder = Folder::new().with("a.png", "old");
    let mut child = folder.command("render terrain:3000000 -o a.png").spawn().unwrap();
    // From the moment that the temporary file is there on, the program knows of Ctrl-C.
    while folder.names().len() < 2 {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::yield_now();
    }
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let talk = super::talk(&output);
    assert!(talk.ends_with("interrupted: nothing was drawn yet, and nothing is written\n"), "{talk}");
    assert_eq!(folder.names(), ["a.png"]);
    assert_eq!(folder.read("a.png"), b"old");
}
