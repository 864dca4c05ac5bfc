//! Scenes that the program makes itself, for trying things out and for measuring, without a file: `spd:balls:4`,
//! `terrain:1000000`, `cornell`, `organic`, `paper:balls`.
//!
//! A scene is the same on every machine, to the last bit: it is computed with basic arithmetic and `libm`, in one
//! order. Nothing here reads a file or a clock.

mod cornell;
mod gallery;
mod noise;
mod organic;
mod paper;
mod spd;
mod strip;
mod terrain;
mod vector;

#[cfg(test)]
mod checks;

use crate::model::Model;
use thiserror::Error;

/// No built-in scene has more primitives than this.
pub const PRIMITIVES_MAX: u32 = 20_000_000;

/// A built-in scene as help texts and completions want it.
#[derive(Debug)]
pub struct BuiltinScene {
    /// What to type, without a size: `spd:balls`.
    pub name: &'static str,
    /// One line.
    pub about: &'static str,
    /// The size that may follow after a colon; `None` if the scene has but one.
    pub size: Option<Size>,
    make: Maker,
}

/// Which sizes a scene comes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Taken if none is given. For SPD scenes, that of the package's published tables.
    pub default: u32,
    /// Least.
    pub smallest: u32,
    /// Greatest; beyond it there would be more than [`PRIMITIVES_MAX`] primitives.
    pub largest: u32,
    /// What the size counts.
    pub counts: &'static str,
}

#[derive(Clone, Copy, Debug)]
enum Maker {
    Fixed(fn() -> Model),
    Sized(fn(u32) -> Model),
}

/// Why a built-in name makes no scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BuiltinError {
    /// No such scene in a family that is there.
    #[error("there is no built-in scene `{name}`{}; there are {known}", hint(nearest))]
    Unknown {
        /// As given.
        name: String,
        /// The scene whose name is most like it, if one is.
        nearest: Option<&'static str>,
        /// The family's scenes, with commas.
        known: String,
    },
    /// The size is not a number, or out of range.
    #[error(
        "`{given}` is no size for `{scene}`: it takes a whole number from {} to {} ({})",
        size.smallest, size.largest, size.counts
    )]
    Size {
        /// The scene, without its size.
        scene: &'static str,
        /// As given.
        given: String,
        /// What it takes.
        size: Size,
    },
}

fn hint(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |n| format!(" (did you mean `{n}`?)"))
}

/// All built-in scenes, for help texts and completions.
#[must_use]
pub fn names() -> &'static [BuiltinScene] {
    &SCENES
}

/// Makes the scene that `name` stands for: `FAMILY[:SCENE][:SIZE]`.
///
/// `None` if the part before the first colon is no built-in family, so that the name is a file's. (A file that is
/// called like a family can be had as `./cornell`.)
///
/// # Errors
/// [`BuiltinError`] if the family is built in but the scene or its size is not.
#[must_use]
pub fn builtin(name: &str) -> Option<Result<Model, BuiltinError>> {
    let family = family_of(name);
    SCENES.iter().any(|s| family_of(s.name) == family).then(|| make(name, family))
}

/// A scene that can be made piece by piece, if `name` is one: the model without its primitives, and those.
pub(crate) fn streamed(name: &str) -> Option<(Model, terrain::Triangles)> {
    let size = SCENES.iter().find(|scene| scene.name == "terrain")?.size?;
    let triangles = match name.strip_prefix("terrain")? {
        "" => size.default,
        given => given.strip_prefix(':')?.parse().ok()?,
    };
    (size.smallest..=size.largest).contains(&triangles).then(|| terrain::streamed(triangles))
}

fn family_of(name: &str) -> &str {
    name.split_once(':').map_or(name, |(family, _)| family)
}

fn make(name: &str, family: &str) -> Result<Model, BuiltinError> {
    let find = |name: &str| SCENES.iter().find(|s| s.name == name);
    if let Some(scene) = find(name) {
        return Ok(match scene.make {
            Maker::Fixed(make) => make(),
            Maker::Sized(make) => make(scene.size.map_or(0, |s| s.default)),
        });
    }
    let (head, given) = name.rsplit_once(':').unwrap_or((name, ""));
    if let Some(BuiltinScene { name: scene, size: Some(size), make: Maker::Sized(make), .. }) = find(head) {
        let sizes = size.smallest..=size.largest;
        return match given.parse() {
            Ok(number) if sizes.contains(&number) => Ok(make(number)),
            _ => Err(BuiltinError::Size { scene, given: given.to_owned(), size: *size }),
        };
    }
    let siblings = || SCENES.iter().map(|s| s.name).filter(|s| family_of(s) == family);
    // A size may stand behind a misspelt name.
    let distance = |scene: &&str| edits(name, scene).min(edits(head, scene));
    let nearest = siblings().min_by_key(distance).filter(|scene| distance(scene) <= 3);
    let known: Vec<_> = siblings().collect();
    Err(BuiltinError::Unknown { name: name.to_owned(), nearest, known: known.join(", ") })
}

/// Levenshtein's distance: letters to insert, drop or replace.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

const fn sized(
    name: &'static str,
    about: &'static str,
    make: fn(u32) -> Model,
    counts: &'static str,
    [smallest, default, largest]: [u32; 3],
) -> BuiltinScene {
    BuiltinScene { name, about, size: Some(Size { default, smallest, largest, counts }), make: Maker::Sized(make) }
}

const fn fixed(name: &'static str, about: &'static str, make: fn() -> Model) -> BuiltinScene {
    BuiltinScene { name, about, size: None, make: Maker::Fixed(make) }
}

static SCENES: [BuiltinScene; 21] = [
    sized("spd:balls", "SPD: the sphereflake over a square", spd::balls, "levels of spheres", [1, 4, 7]),
    sized("spd:balls-noground", "SPD: the sphereflake alone", spd::balls_noground, "levels of spheres", [1, 4, 7]),
    sized("spd:gears", "SPD: meshed gears, some of them clear", spd::gears, "gears along each side", [1, 4, 32]),
    sized("spd:lattice", "SPD: shiny balls joined by rods", spd::lattice, "cells along each side", [1, 12, 170]),
    sized("spd:mount", "SPD: a fractal mountain and glass balls", spd::mount, "halvings of the grid", [1, 6, 11]),
    sized("spd:rings", "SPD: a pyramid of interlocking rings", spd::rings, "layers of the pyramid", [1, 7, 99]),
    sized("spd:sombrero", "SPD: a height field of waves", spd::sombrero, "1 + doublings of 32 x 32", [1, 1, 7]),
    sized("spd:teapot", "SPD: the teapot on a checkerboard", spd::teapot, "cells along a patch", [2, 12, 550]),
    sized("spd:tetra", "SPD: a recursive tetrahedron", spd::tetra, "levels", [1, 6, 12]),
    sized("spd:tree", "SPD: a tree under seven lights", spd::tree, "levels of branches", [1, 11, 22]),
    sized("terrain", "fractal mountains", terrain::terrain, "triangles", [2, 1_000_000, PRIMITIVES_MAX]),
    fixed("cornell", "the Cornell box with its two blocks", cornell::blocks),
    fixed("cornell:mirror", "the Cornell box with a mirror and a glass sphere", cornell::spheres),
    sized(
        "gallery",
        "Textures, cut-outs, rough metal and glass",
        gallery::gallery,
        "texels along each side of the floor",
        [1, 256, 16_384],
    ),
    sized("organic", "a closed knotted tube", organic::organic, "triangles", [200, 70_000, PRIMITIVES_MAX]),
    sized(
        "paper:balls",
        "1995: 7,381 balls, the ten largest matt",
        paper::balls,
        "1 + levels that are matt",
        [1, 3, 6],
    ),
    sized(
        "paper:balls5",
        "1995: 66,430 balls, the ten largest matt",
        paper::balls5,
        "1 + levels that are matt",
        [1, 3, 7],
    ),
    fixed("paper:teapot", "1995: the teapot on a matt checkerboard", paper::teapot),
    sized("paper:conference", "1995: like its conference room", paper::conference, "lights", [1, 8, 30]),
    fixed("paper:hof", "POV||Ray: like its ROSENTHALERHOF, a courtyard", paper::hof),
    fixed("paper:vase", "POV||Ray: like its SKYVASE", paper::vase),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_names_are_files() {
        for name in ["teapot.obj", "balls", "./cornell", "C:/spd:balls", "spds:balls", "", ":", "Cornell"] {
            assert!(builtin(name).is_none(), "{name}");
        }
    }

    #[track_caller]
    fn fails(name: &str, expected: &str) {
        let error = builtin(name).expect("a built-in family").expect_err("no scene").to_string();
        assert_eq!(error, expected);
    }

    #[test]
    fn errors_say_what_would_do() {
        let spd = "there are spd:balls, spd:balls-noground, spd:gears, spd:lattice, spd:mount, spd:rings, \
                   spd:sombrero, spd:teapot, spd:tetra, spd:tree";
        fails("spd:bals:4", &format!("there is no built-in scene `spd:bals:4` (did you mean `spd:balls`?); {spd}"));
        fails("spd:trees", &format!("there is no built-in scene `spd:trees` (did you mean `spd:tree`?); {spd}"));
        fails("spd:shells", &format!("there is no built-in scene `spd:shells` (did you mean `spd:balls`?); {spd}"));
        fails("spd:hypercube", &format!("there is no built-in scene `spd:hypercube`; {spd}"));
        fails("spd", &format!("there is no built-in scene `spd`; {spd}"));
        let cornell = "there are cornell, cornell:mirror";
        fails("cornell:4", &format!("there is no built-in scene `cornell:4` (did you mean `cornell`?); {cornell}"));
        let balls = "is no size for `spd:balls`: it takes a whole number from 1 to 7 (levels of spheres)";
        for given in ["8", "0", "-1", "4.5", "", "four", "99999999999999999999", " 4", "4 "] {
            fails(&format!("spd:balls:{given}"), &format!("`{given}` {balls}"));
        }
        fails(
            "terrain:20000001",
            "`20000001` is no size for `terrain`: it takes a whole number from 2 to 20000000 (triangles)",
        );
    }

    #[test]
    fn edit_distance() {
        for (a, b, expected) in [("", "", 0), ("abc", "", 3), ("kitten", "sitting", 3), ("flaw", "lawn", 2)] {
            assert_eq!((edits(a, b), edits(b, a)), (expected, expected));
        }
    }

    #[test]
    fn names_are_distinct_and_sizes_ordered() {
        for (i, scene) in SCENES.iter().enumerate() {
            assert!(SCENES[..i].iter().all(|s| s.name != scene.name));
            assert!(scene.size.is_none_or(|s| s.smallest <= s.default && s.default <= s.largest));
            assert_eq!(scene.size.is_some(), matches!(scene.make, Maker::Sized(_)));
        }
    }

    /// Primitives at a size by formulas that follow from the published descriptions, not from the code.
    fn primitives(scene: &str, n: u64) -> u64 {
        match scene {
            "spd:balls" => (9_u64.pow(n as u32 + 1) - 1) / 8 + 2,
            "spd:balls-noground" => (9_u64.pow(n as u32 + 1) - 1) / 8,
            "spd:gears" => 2 + n.pow(3) * (2 * 142 + 2 * 144),
            "spd:lattice" => (n + 1).pow(3) + 3 * n * (n + 1).pow(2),
            "spd:mount" => 2 * 4_u64.pow(n as u32) + 4,
            "spd:rings" => 2 + 10 * n * (n + 1) * (2 * n + 1),
            "spd:sombrero" => 2 * ((32 << (n - 1)) - 1_u64).pow(2),
            "spd:teapot" => 64 * n * n - 8 * n + 2 * n * n,
            "spd:tetra" => 4_u64.pow(n as u32),
            "spd:tree" => 2 + 2 * ((2 << n) - 1),
            "terrain" => n,
            "organic" => n / 2 * 2,
            "paper:balls" => 7_381,
            "paper:balls5" => 66_430,
            "paper:conference" => 23_966,
            // Its size is that of its pictures: six rectangles, a block, and balls of 48 by 24 quads but for the poles.
            "gallery" => 6 * 2 + 12 + 2 * (2 * 48 * 24 - 2 * 48),
            other => panic!("{other}"),
        }
    }

    /// The largest size is the last within the limit, and the small ones have what the formula says.
    #[test]
    fn sizes_end_at_the_limit() {
        for scene in &SCENES {
            let (Some(size), Maker::Sized(make)) = (scene.size, scene.make) else {
                continue;
            };
            let at = |n: u32| primitives(scene.name, u64::from(n));
            assert!(at(size.largest) <= u64::from(PRIMITIVES_MAX), "{}", scene.name);
            assert!(at(size.largest + 1) > u64::from(PRIMITIVES_MAX) || at(size.largest + 1) == at(size.largest));
            for n in [size.smallest, size.smallest + 1, size.smallest + 2] {
                assert_eq!(make(n).primitives() as u64, at(n), "{}:{n}", scene.name);
            }
        }
    }

    /// Nothing degenerates where the scenes are finest.
    #[test]
    #[ignore = "ten seconds in a release build, and half a gigabyte"]
    fn largest_sizes_are_sound() {
        for scene in &SCENES {
            let (Some(size), Maker::Sized(make)) = (scene.size, scene.make) else {
                continue;
            };
            let model = make(size.largest);
            assert_eq!(model.primitives() as u64, primitives(scene.name, u64::from(size.largest)), "{}", scene.name);
            checks::sound(&model);
        }
    }

    /// Geometry, bit by bit, as it was when these were written down. A change here is a change of pictures.
    #[test]
    fn geometry_stays() {
        let expected = [
            ("spd:balls:3", 0x2D0C_3C0B_DC89_1DCA),
            ("spd:gears:2", 0xCC17_8716_9FBC_F5FF),
            ("spd:lattice:3", 0x3A18_A418_E3CF_82A5),
            ("spd:mount:5", 0x2B94_0E6B_10E6_8FA5),
            ("spd:rings:2", 0xE0B2_FC7A_C9AD_A2A0),
            ("spd:sombrero:1", 0xD972_5A24_3996_A968),
            ("spd:teapot:5", 0xC9E1_BF5A_A3F3_A8EF),
            ("spd:tetra:4", 0xCE57_4B0B_0043_DEF5),
            ("spd:tree:6", 0x7095_1533_6701_87F1),
            ("terrain:10007", 0x8AC4_1B53_932F_2E58),
            ("cornell", 0x49D0_8CAD_7038_66B5),
            ("cornell:mirror", 0x5A68_7898_14A4_172F),
            ("organic:2000", 0x96F8_FACF_246E_DC85),
            ("paper:balls", 0x13C2_FEB6_86A3_31D6),
            ("paper:teapot", 0xC5E0_6D2C_11E7_9640),
            ("paper:conference", 0x9DEE_4909_1D3D_4991),
            ("paper:hof", 0xCD45_480A_C288_0EC9),
            ("paper:vase", 0xE164_E2DB_FECB_0F01),
        ];
        let found = expected.map(|(name, _)| {
            let model = builtin(name).expect("built in").expect("in range");
            (name, checks::fingerprint(&model))
        });
        assert_eq!(found, expected, "{found:#x?}");
    }
}
