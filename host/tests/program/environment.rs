//! What is all around, from the command line.

use super::{Folder, SPHERE, talk};

/// Two texels of 1/8.
const SKY: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n@@@\x7f@@@\x7f";

#[test]
fn any_scene_can_have_surroundings() {
    let folder = Folder::new().with("sphere.nff", SPHERE).with("sky.hdr", SKY);
    let (_, info) = folder.succeed("info sphere.nff --environment sky.hdr");
    let info = String::from_utf8(info).unwrap();
    assert!(info.contains("2 x 1 texels; 2 cells of 88 bytes light, 16 rays a hit"), "{info}");
    folder.succeed("render sphere.nff --environment sky.hdr --environment-strength 4 -o a.ppm --json a.json");
    folder.succeed("render sphere.nff --environment sky.hdr --environment-strength 4 -o b.ppm --nodes 3 --memory 2MiB");
    assert!(folder.read("a.ppm") == folder.read("b.ppm"));
    // Blue was the background; half is what the sky shows now.
    let ppm = folder.read("a.ppm");
    assert_eq!(ppm[ppm.len() - 3..], [188; 3]);
    let report: serde_json::Value = serde_json::from_slice(&folder.read("a.json")).unwrap();
    assert!(report["rays"]["shadow"].as_u64() > report["rays"]["primary"].as_u64(), "{report}");
    // What is only seen sends no rays, and packed it is the same.
    folder.succeed("render sphere.nff --environment sky.hdr --environment-samples 0 -o c.ppm");
    folder.succeed("pack sphere.nff --environment sky.hdr --environment-strength 4 -o s.hyb");
    folder.succeed("render s.hyb -o d.ppm");
    assert!(folder.read("d.ppm") == ppm && folder.read("c.ppm") != ppm);
    let (said, _) = folder.succeed("convert sphere.nff --environment sky.hdr o.pov");
    assert!(said.contains("what is all around is not written"), "{said}");
}

#[test]
fn mistakes_are_named() {
    let folder = Folder::new().with("sphere.nff", SPHERE).with("sky.hdr", SKY).with("bad.hdr", "nothing");
    folder.succeed("pack sphere.nff -o s.hyb");
    for (command, words) in [
        ("info sphere.nff --environment no.hdr", "no.hdr: there is no such file"),
        ("info sphere.nff --environment bad.hdr", "bad.hdr"),
        ("info sphere.nff --environment .", "."),
        ("info s.hyb --environment sky.hdr", "pack it with --environment"),
        ("info sphere.nff --environment sky.hdr --environment-strength -1", "of 0 or more"),
        ("info sphere.nff --environment sky.hdr --environment-rotation nan", "give degrees"),
    ] {
        let output = folder.run(command);
        let said = talk(&output);
        assert!(!output.status.success() && said.contains(words), "{command}: {said}");
        assert!(!said.contains("panicked"), "{said}");
    }
}
