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
const GOLDEN: [(&str, u64); 15] = [
    ("spd:balls:3", 0x598587831af9062c),
    ("spd:balls-noground:2", 0x349e78c93249cc4b),
    ("spd:gears:2", 0x6fbe117293fe9e98),
    ("spd:lattice:3", 0x1988a1c8fdea759b),
    ("spd:mount:4", 0x3f2ce5fa2312f215),
    ("spd:rings:3", 0x21215e3b4bddecbf),
    ("spd:sombrero:1", 0xd22ed08171e321d2),
    ("spd:teapot:5", 0x56601244c2a42b20),
    ("spd:tetra:5", 0xc6bc7b4b44eddb7b),
    ("spd:tree:7", 0x5e0e5736f1b0463b),
    ("cornell", 0x2c77a0ed424aaa5e),
    ("cornell:mirror", 0x2dc36ae38a0590e5),
    ("organic:3000", 0xa8734b777f7e6cce),
    ("terrain:8000", 0x0f44243739ae19fd),
    ("gallery:64", 0xc0bf571fc1e4e145),
];

#[test]
fn pictures_are_what_they_were() {
    let bless = std::env::var_os("HYBRAY_BLESS").is_some();
    let wanted = Settings { size: Some([48, 36]), spp: Some(2), ..Settings::default() };
    let farm = Farm {
        nodes: 2,
        kernels: kernels(),
        dispatcher: DispatcherAt::Host,
        shadow_bundles: true,
        options: Options::default(),
    };
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
