//! Small pictures whose bits are written down.
//!
//! The first law says that a picture is a function of the scene, the camera and the settings that change pictures. These
//! hashes hold in debug and in release, with any kernels and on any machine. **If one of them changes, pictures change**:
//! everybody who compares films with those of another version will see it. Only a change that is meant to alter pictures
//! may do so (another default of shading, a scene that is made otherwise), and it is explained in the CHANGELOG. A change
//! that only makes something faster, or moves it, must leave all of them as they are.
//!
//! `HYBRAY_BLESS=1 cargo test -p hybray-tests --test golden -- --nocapture` prints the table anew.

use hybray::build;
use hybray::model::Settings;
use hybray_native::{DispatcherAt, Farm};
use hybray_scheduler::Options;
use hybray_tests::{Picture, kernels, scene};

/// Film of each scene at 48 x 36 pixels, 2 samples each, all else as the scene has it.
#[rustfmt::skip]
const GOLDEN: [(&str, u64); 14] = [
    ("spd:balls:3", 0x29eceff5ff69ee8a),
    ("spd:balls-noground:2", 0x349e78c93249cc4b),
    ("spd:gears:2", 0x61eb48c79cc4031d),
    ("spd:lattice:3", 0x1988a1c8fdea759b),
    ("spd:mount:4", 0x0d295582c0df66aa),
    ("spd:rings:3", 0xb004a8a0d19377f6),
    ("spd:sombrero:1", 0x81b6b1ae74413030),
    ("spd:teapot:5", 0x3b8a743afe741a2f),
    ("spd:tetra:5", 0x855d360f2abaffda),
    ("spd:tree:7", 0x7d21176ca49f50db),
    ("cornell", 0xf2208b176d039c34),
    ("cornell:mirror", 0x729b7b64f4b372f0),
    ("organic:3000", 0xa8734b777f7e6cce),
    ("terrain:8000", 0x0f44243739ae19fd),
];

#[test]
fn pictures_are_what_they_were() {
    let bless = std::env::var_os("HYBRAY_BLESS").is_some();
    let wanted = Settings { size: Some([48, 36]), spp: Some(2), ..Settings::default() };
    let farm = Farm { nodes: 2, kernels: kernels(), dispatcher: DispatcherAt::Host, options: Options::default() };
    let mut wrong = Vec::new();
    for (name, expected) in GOLDEN {
        let Picture { film, .. } = Picture::of(scene(name), &build::Settings::default(), &wanted, &farm, name);
        if bless {
            println!("    ({name:?}, 0x{film:016x}),");
        } else if film != expected {
            wrong.push(format!("{name}: 0x{film:016x}, was 0x{expected:016x}"));
        }
    }
    assert!(wrong.is_empty(), "pictures have changed (see the top of this file):\n{}", wrong.join("\n"));
}
