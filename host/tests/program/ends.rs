//! Ctrl-C: what is finished is written, and the exit code says that it is not all.
#![cfg(unix)]

use super::Folder;
use super::resume::tiles_in;
use hybray::model::Settings;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command};

fn interrupt(child: &Child) {
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// A picture of many minutes, a tile of milliseconds.
const LONG: &str = "render spd:balls:2 --size 1024x1024 --spp 500 --nodes 2 -o a.ppm";

fn tiles_in_film(folder: &Folder) -> u32 {
    let wanted = Settings { size: Some([1024; 2]), spp: Some(500), ..Settings::default() };
    tiles_in(&folder.0.join("a.ppm.film"), "spd:balls:2", &wanted)
}

/// Interrupts it when it says for the first time how far it is; what it says after that.
fn interrupted(mut child: Child, folder: &Folder) -> String {
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.contains("Mrays/s") {
        line.clear();
        assert!(stderr.read_line(&mut line).unwrap() > 0, "it ended by itself");
    }
    assert_eq!(folder.names().iter().filter(|name| name.ends_with(".tmp")).count(), 2, "{:?}", folder.names());
    interrupt(&child);
    let mut rest = String::new();
    stderr.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    rest
}

/// How many tiles it says to be finished.
fn said(rest: &str) -> u32 {
    let said = rest.split("interrupted: ").nth(1).unwrap_or_else(|| panic!("{rest}"));
    assert!(said.contains("tiles are in a.ppm; what is finished is kept in a.ppm.film: --resume goes on"), "{rest}");
    said.split(' ').next().unwrap().parse().unwrap()
}

/// Twice.
#[test]
fn ctrl_c_keeps_what_is_finished() {
    let folder = Folder::new();
    let rest = interrupted(folder.command(&format!("{LONG} --json a.json")).spawn().unwrap(), &folder);
    assert_eq!(folder.names(), ["a.json", "a.ppm", "a.ppm.film"]);
    let first = said(&rest);
    assert_eq!(tiles_in_film(&folder), first);

    let report: Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    assert_eq!(report["finished"], false);
    assert_eq!(report["counts"]["tiles"], 128 * 128);
    let ppm = folder.read("a.ppm");
    let pixels = &ppm[ppm.len() - 3 * 1024 * 1024..];
    let drawn = pixels.chunks(3).filter(|rgb| rgb.iter().any(|&c| c > 0)).count();
    assert!(first > 0 && drawn > 0, "nothing was finished in five seconds");
    // Of the scene and its sky nothing is black.
    assert_eq!(drawn, first as usize * 64, "finished tiles are there whole, and others are not there");

    let rest = interrupted(
        folder.command(&format!("{LONG} --json a.json --resume --dispatcher node")).spawn().unwrap(),
        &folder,
    );
    let second = said(&rest);
    assert!(second > first, "{first} and {second}");
    assert_eq!(tiles_in_film(&folder), second);
}

/// A program that is killed leaves the film that it wrote last.
#[test]
fn what_was_kept_on_the_way_outlives_the_program() {
    let folder = Folder::new();
    let mut child = folder.command(&format!("{LONG} --save-every 1")).spawn().unwrap();
    while !folder.0.join("a.ppm.film").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(tiles_in_film(&folder) > 0 && !folder.0.join("a.ppm").exists());
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
