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
    ("spd:balls:3", 0),
    ("spd:balls-noground:2", 0),
    ("spd:gears:2", 0),
    ("spd:lattice:3", 0),
    ("spd:mount:4", 0),
    ("spd:rings:3", 0),
    ("spd:sombrero:1", 0),
    ("spd:teapot:5", 0),
    ("spd:tetra:5", 0),
    ("spd:tree:7", 0),
    ("cornell", 0),
    ("cornell:mirror", 0),
    ("organic:3000", 0),
    ("terrain:8000", 0),
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
