//! `render --cameras` and `--layers`: each view is what it is alone, and each channel has its name.

use super::resume::{RENDER, TILES, json, keep};
use super::{Folder, talk};
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};
use std::collections::BTreeMap;

const OWN: &str =
    "[[camera]]\nname = \"own\"\neye = [2.1, 1.3, 1.7]\ntarget = [0, 0, 0]\nup = [0, 0, 1]\nfov = 45\nhither = 0.01\n";
const TOP: &str = "[[camera]]\nname = \"from above\"\neye = [0.5, 0, 4]\ntarget = [0, 0, 0]\nsize = [50, 30]\n";

fn folder() -> Folder {
    let scene = |camera: &str| format!("{camera}\n[[include]]\nfile = \"spd:balls:2\"\n");
    Folder::new().with("both.toml", &format!("{OWN}{TOP}")).with("own.toml", &scene(OWN)).with("top.toml", &scene(TOP))
}

#[test]
fn views_are_those_that_are_drawn_alone() {
    for farm in ["--nodes 1", "--nodes 3 --dispatcher node", "--nodes 3 --memory 256KiB"] {
        let folder = folder();
        let views = json(&folder, &format!("render spd:balls:2 --cameras both.toml -o a.ppm --spp 2 -q {farm}"));
        let views = views.as_array().expect("one object for each view");
        assert_eq!(views.iter().map(|view| &view["view"]).collect::<Vec<_>>(), ["own", "from above"]);
        for (view, (scene, picture)) in views.iter().zip([("own", "a-own.ppm"), ("top", "a-from above.ppm")]) {
            let alone = json(&folder, &format!("render {scene}.toml -o {scene}.ppm --spp 2 -q {farm}"));
            assert!(alone.get("view").is_none() && alone.get("layers").is_none());
            for what in ["film", "rays", "width", "samples", "finished"] {
                assert_eq!(view[what], alone[what], "{scene}, {farm}: {what}");
            }
            for what in ["hits", "contributions", "tiles", "tiles_kept"] {
                assert_eq!(view["counts"][what], alone["counts"][what], "{scene}, {farm}: {what}");
            }
            assert_eq!(folder.read(picture), folder.read(&format!("{scene}.ppm")), "{scene}, {farm}");
        }
        let left = ["a-from above.ppm", "a-own.ppm", "both.toml", "own.ppm", "own.toml", "top.ppm", "top.toml"];
        assert_eq!(folder.names(), left, "films are gone");
    }
}

/// What ended early goes on: a view whose film is whole is not traced, one without is.
#[test]
fn views_go_on_where_they_ended() {
    let folder = folder();
    let whole = json(&folder, &format!("render spd:balls:2 --cameras both.toml {RENDER}"));
    for kept in [TILES, 40] {
        keep(&folder, "spd:balls:2", &|tile| tile < kept, None);
        std::fs::rename(folder.0.join("a.ppm.film"), folder.0.join("a-own.ppm.film")).unwrap();
        let report = json(&folder, &format!("render spd:balls:2 --cameras both.toml {RENDER} --resume --nodes 2"));
        for (view, kept) in [(0, kept), (1, 0)] {
            assert_eq!(report[view]["film"], whole[view]["film"]);
            assert_eq!(report[view]["counts"]["tiles_kept"], kept);
        }
        assert!(!folder.names().iter().any(|name| name.ends_with(".film")), "{:?}", folder.names());
    }
    // Another view's film is refused before anything is drawn.
    keep(&folder, "spd:balls:2", &|_| true, None);
    std::fs::rename(folder.0.join("a.ppm.film"), folder.0.join("a-from above.ppm.film")).unwrap();
    let output = folder.run(&format!("render spd:balls:2 --cameras both.toml {RENDER} --resume"));
    assert_eq!(output.status.code(), Some(1));
    assert!(talk(&output).contains("another camera"), "{}", talk(&output));
}

fn channels(folder: &Folder, name: &str) -> BTreeMap<String, Vec<f32>> {
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let image = image.from_file(folder.0.join(name)).expect("an EXR");
    let values = |samples: FlatSamples| match samples {
        FlatSamples::F32(values) => values,
        FlatSamples::U32(values) => values.into_iter().map(|value| value as f32).collect(),
        FlatSamples::F16(_) => panic!("nothing is written in 16 bits"),
    };
    let list = image.layer_data.channel_data.list;
    list.into_iter().map(|channel| (channel.name.to_string(), values(channel.sample_data))).collect()
}

#[test]
fn layers_are_channels_beside_the_picture() {
    let folder = Folder::new();
    let arguments = "render cornell --size 40x24 --spp 4 --depth 3 -q --nodes 2";
    let plain = json(&folder, &format!("{arguments} -o plain.exr"));
    let all = json(&folder, &format!("{arguments} -o all.exr --layers all"));
    for what in ["film", "rays"] {
        assert_eq!(plain[what], all[what], "{what}");
    }
    assert_eq!(plain["counts"]["contributions"], all["counts"]["contributions"]);
    let names = all["layers"].as_array().unwrap().iter().map(|layer| layer["layer"].as_str().unwrap());
    assert_eq!(names.collect::<Vec<_>>(), ["albedo", "normal", "depth", "id"]);
    let (plain, all) = (channels(&folder, "plain.exr"), channels(&folder, "all.exr"));
    let names =
        "B G R Z albedo.B albedo.G albedo.R id normal.X normal.Y normal.Z samples variance.B variance.G variance.R";
    assert_eq!(all.keys().map(String::as_str).collect::<Vec<_>>(), names.split(' ').collect::<Vec<_>>());
    for (name, values) in &plain {
        assert_eq!(values, &all[name], "{name}");
    }
    assert!(all["samples"].iter().all(|&samples| samples == 4.0));
    assert!(all["variance.G"].iter().all(|&v| v >= 0.0) && all["variance.G"].iter().any(|&v| v > 0.0));
    let length = |pixel: usize| ["X", "Y", "Z"].map(|c| all[&format!("normal.{c}")][pixel].powi(2)).iter().sum::<f32>();
    let unit = (0..40 * 24).filter(|&pixel| (length(pixel).sqrt() - 1.0).abs() < 1e-5).count();
    // The box does not fill the picture, and edges have shorter ones.
    assert!(unit > 300 && (0..40 * 24).all(|pixel| length(pixel) < 1.0 + 1e-5), "{unit}");
    assert!(all["id"].iter().all(|id| id.fract() == 0.0), "numbers have no mean");
    folder.succeed("compare plain.exr all.exr");
    // Only what was asked for; whoever reads the picture alone reads the same.
    json(&folder, &format!("{arguments} -o some.exr --layers depth,samples"));
    let some = channels(&folder, "some.exr");
    assert_eq!(some.keys().map(String::as_str).collect::<Vec<_>>(), ["B", "G", "R", "Z", "samples"]);
    assert_eq!((&some["Z"], &some["R"]), (&all["Z"], &all["R"]));
    assert_eq!(folder.names(), ["all.exr", "plain.exr", "some.exr"], "films are gone");
}
