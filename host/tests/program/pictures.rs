//! Pictures in every format: read back by other code, they are one picture.

use super::Folder;
use hybray::picture::{encode_srgb8, encode_srgb16};
use std::io::Cursor;

const SIZE: [usize; 2] = [37, 26];
const SCENE: &str = "spd:balls:2 --size 37x26 --spp 2 -q --exposure 1.25";

fn png(bytes: &[u8], depth: png::BitDepth) -> Vec<u8> {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!([info.width as usize, info.height as usize], SIZE);
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, depth));
    pixels.truncate(info.buffer_size());
    pixels
}

/// Linear radiance, row by row.
fn exr(bytes: &[u8]) -> Vec<f32> {
    use exr::prelude::*;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| {
                assert_eq!([size.x(), size.y()], SIZE);
                vec![0.0; 3 * size.area()]
            },
            |pixels: &mut Vec<f32>, at, (r, g, b): (f32, f32, f32)| {
                let first = 3 * (at.y() * SIZE[0] + at.x());
                pixels[first..first + 3].copy_from_slice(&[r, g, b]);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .unwrap();
    image.layer_data.channel_data.pixels
}

#[test]
fn all_formats_hold_one_picture() {
    let folder = Folder::new();
    for output in ["a.png", "b.png --bits 16", "c.exr", "d.ppm", "e.PNG", "f.png --nodes 3 --kernels portable"] {
        let (talk, out) = folder.succeed(&format!("render {SCENE} -o {output}"));
        assert_eq!((talk.as_str(), out.as_slice()), ("", &b""[..]), "{output}");
    }
    assert_eq!(folder.names(), ["a.png", "b.png", "c.exr", "d.ppm", "e.PNG", "f.png"]);

    let radiance = exr(&folder.read("c.exr"));
    assert!(radiance.iter().any(|&c| c > 0.5) && radiance.iter().any(|&c| c < 0.2), "a picture of something");
    // The exposure is for encoded pictures: radiance is kept as it is.
    let eight: Vec<u8> = radiance.iter().map(|&c| encode_srgb8(c * 1.25)).collect();
    let sixteen: Vec<u8> = radiance.iter().flat_map(|&c| encode_srgb16(c * 1.25).to_be_bytes()).collect();
    assert_eq!(png(&folder.read("a.png"), png::BitDepth::Eight), eight);
    assert_eq!(png(&folder.read("b.png"), png::BitDepth::Sixteen), sixteen);
    let ppm = folder.read("d.ppm");
    assert!(ppm.starts_with(b"P6\n37 26\n255\n"));
    assert_eq!(ppm[ppm.len() - eight.len()..], eight);
    assert_eq!(folder.read("e.PNG"), folder.read("a.png"));
    assert_eq!(folder.read("f.png"), folder.read("a.png"));
}

#[test]
fn standard_output_is_a_picture_and_nothing_else() {
    let folder = Folder::new();
    folder.succeed(&format!("render {SCENE} -o a.png"));
    let loud = SCENE.replace("-q ", "");
    let (talk, out) = folder.succeed(&format!("render {loud} -o -"));
    assert_eq!(out, folder.read("a.png"));
    assert!(talk.contains("spd:balls:2") && talk.contains("37 x 26"), "{talk}");
    assert_eq!(folder.names(), ["a.png"]);
}

#[test]
fn the_scene_names_the_picture() {
    let folder = Folder::new().with("ball.nff", super::SPHERE);
    for (scene, expected) in
        [("spd:balls:1", "spd-balls-1.png"), ("./ball.nff", "ball.png"), ("cornell", "cornell.png")]
    {
        let (talk, _) = folder.succeed(&format!("render {scene} --size 8x8 --spp 1"));
        assert!(folder.names().contains(&expected.to_owned()), "{scene}: {:?}", folder.names());
        assert!(talk.ends_with(&format!("{expected}\n")), "the last line says where the picture is: {talk}");
    }
}

#[test]
fn a_picture_that_is_there_is_replaced() {
    let folder = Folder::new().with("a.png", "old");
    folder.succeed(&format!("render {SCENE} -o a.png"));
    png(&folder.read("a.png"), png::BitDepth::Eight);
    assert_eq!(folder.names(), ["a.png"]);
}

#[test]
fn pictures_are_compared() {
    let folder = Folder::new();
    for name in ["a.exr", "a.png"] {
        folder.succeed(&format!("render {SCENE} -o {name}"));
    }
    folder.succeed(&format!("render {SCENE} -o b.exr --seed 2"));
    folder.succeed("render cornell -q --size 8x8 --spp 1 -o small.png");
    let json = |arguments: &str| -> serde_json::Value {
        serde_json::from_slice(&folder.succeed(&format!("compare {arguments} --json -")).1).unwrap()
    };
    let same = json("a.exr a.exr");
    assert_eq!(
        (same["rmse"].as_f64(), same["channels_that_differ"].as_u64(), same["flip"].as_f64()),
        (Some(0.0), Some(0), Some(0.0))
    );
    // By the formula, from the values themselves.
    let [a, b] = ["a.exr", "b.exr"].map(|name| exr(&folder.read(name)));
    let sum: f64 = a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let found = json("a.exr b.exr --map map.png");
    assert!((found["rmse"].as_f64().unwrap() - (sum / a.len() as f64).sqrt()).abs() < 1e-9 && sum > 0.0, "{found}");
    png(&folder.read("map.png"), png::BitDepth::Eight);
    let (_, out) = folder.succeed("compare a.exr b.exr --json report.json");
    let text = String::from_utf8(out).unwrap();
    assert!(["RMSE ", "relMSE ", "worst pixel ", "FLIP "].iter().all(|line| text.contains(line)), "{text}");
    assert_eq!(
        serde_json::from_slice::<serde_json::Value>(&folder.read("report.json")).unwrap()["rmse"],
        found["rmse"]
    );

    for (arguments, expected) in [
        ("a.png small.png", "`a.png` has 37 x 26 pixels and `small.png` 8 x 8; compare pictures of one size"),
        ("a.png none.png", "cannot read picture `none.png`"),
        ("a.png report.json", "cannot read picture `report.json`: neither PNG, EXR nor binary PPM"),
    ] {
        let output = folder.run(&format!("compare {arguments}"));
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        assert!(super::talk(&output).contains(expected), "{}", super::talk(&output));
    }
}
