//! Tachyon 0.99 as a process: its scene format, and the times that it prints.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::Context as _;

use super::hybray::{output, pinned};

/// The program.
const PROGRAM: &str = "tachyon";

/// Whether it is installed.
pub fn is_here() -> bool {
    let mut ask = Command::new(PROGRAM);
    ask.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    // Without a scene it says how it is used.
    ask.status().is_ok()
}

/// A picture to be drawn.
pub struct Job<'a> {
    /// Where scene and picture lie.
    pub folder: &'a Path,
    /// Name of the scene.
    pub scene: &'a str,
    /// Name of the picture, a PNG of 8 bits.
    pub picture: &'a str,
    /// How many threads trace.
    pub threads: u16,
    /// How many processors the process may use; `None` leaves it to the system.
    pub pin: Option<u16>,
}

/// Draws it; the seconds of its *Ray Tracing Time*. It tells no number of rays.
pub fn render(job: &Job<'_>) -> anyhow::Result<f64> {
    let mut command = pinned(&PathBuf::from(PROGRAM), job.pin);
    command.args([job.scene, "-o", job.picture, "-format", "PNG", "-numthreads", &job.threads.to_string()]);
    command.current_dir(job.folder);
    let text = String::from_utf8_lossy(&output(command)?).into_owned();
    parse(&text).with_context(|| format!("{PROGRAM} printed other times than this benchmark knows:\n{text}"))
}

/// Reads the time out of everything that Tachyon prints.
fn parse(text: &str) -> Option<f64> {
    let (_, rest) = text.split_once("Ray Tracing Time:")?;
    rest.split_whitespace().next()?.parse().ok()
}

/// A scene of spheres and polygons in NFF, as `hybray convert` writes it, as Tachyon's own format has it.
///
/// Tachyon's camera is left-handed: the whole scene is mirrored at x = 0, and the picture of it is that of ours. `depth` counts
/// as ours does, 1 for what is seen directly.
///
/// # Errors
/// For what a benchmark's scene has no need of: other primitives, or lights without a colour.
pub fn scene(nff: &str, size: [u32; 2], depth: u32) -> anyhow::Result<String> {
    let mut out = String::from("BEGIN_SCENE\n");
    let [width, height] = size;
    let _ = writeln!(out, "RESOLUTION {width} {height}");
    let (mut body, mut view) = (String::new(), View::default());
    let mut materials = 0;
    let mut lines = nff.lines().map(str::trim).filter(|line| !line.is_empty());
    while let Some(line) = lines.next() {
        let (word, rest) = line.split_once(' ').unwrap_or((line, ""));
        let numbers: Vec<f64> = rest.split_whitespace().map_while(|number| number.parse().ok()).collect();
        match (word, &numbers[..]) {
            ("v" | "hither" | "resolution", _) => {}
            ("from", &[x, y, z]) => view.from = [-x, y, z],
            ("at", &[x, y, z]) => view.at = [-x, y, z],
            ("up", &[x, y, z]) => view.up = [-x, y, z],
            ("angle", &[degrees]) => view.degrees = degrees,
            ("b", &[r, g, b]) => {
                let _ = writeln!(body, "BACKGROUND {r} {g} {b}");
            }
            ("l", &[x, y, z, r, g, b]) => {
                // A point: its size is what is seen of the light itself, and our lights are not seen.
                let _ = writeln!(body, "LIGHT CENTER {} {y} {z} RAD 0.0001 COLOR {r} {g} {b}", -x);
            }
            ("f", &[r, g, b, diffuse, specular, shine, 0.0, _]) => {
                materials += 1;
                let _ = write!(body, "TEXDEF m{materials} AMBIENT 0 DIFFUSE {diffuse} SPECULAR {specular} OPACITY 1 ");
                if specular > 0.0 {
                    let _ = write!(body, "PHONG PLASTIC {specular} PHONG_SIZE {shine} ");
                }
                let _ = writeln!(body, "COLOR {r} {g} {b} TEXFUNC 0");
            }
            ("s", &[x, y, z, radius]) => {
                let _ = writeln!(body, "SPHERE CENTER {} {y} {z} RAD {radius} m{materials}", -x);
            }
            ("p", &[corners]) => {
                let corners: Vec<_> = lines.by_ref().take(corners as usize).map(point).collect::<Result<_, _>>()?;
                for pair in corners.windows(2).skip(1) {
                    let [v0, v1, v2] = [corners[0], pair[0], pair[1]].map(|[x, y, z]| format!("{x} {y} {z}"));
                    let _ = writeln!(body, "TRI V0 {v0} V1 {v1} V2 {v2} m{materials}");
                }
            }
            _ => anyhow::bail!("{line:?} is nothing that this benchmark tells Tachyon"),
        }
    }
    out += &view.text(depth);
    Ok(out + &body + "END_SCENE\n")
}

/// A corner, mirrored.
fn point(line: &str) -> anyhow::Result<[f64; 3]> {
    let numbers: Vec<f64> = line.split_whitespace().map_while(|number| number.parse().ok()).collect();
    let &[x, y, z] = &numbers[..] else { anyhow::bail!("{line:?} is no corner") };
    Ok([-x, y, z])
}

#[derive(Default)]
struct View {
    from: [f64; 3],
    at: [f64; 3],
    up: [f64; 3],
    /// Of the picture's height.
    degrees: f64,
}

impl View {
    fn text(&self, depth: u32) -> String {
        // Tachyon's picture is one unit high at a distance of the zoom.
        let zoom = 0.5 / (self.degrees.to_radians() / 2.0).tan();
        let [x, y, z] = self.from;
        let [dx, dy, dz] = [0, 1, 2].map(|i| self.at[i] - self.from[i]);
        let [ux, uy, uz] = self.up;
        format!(
            "CAMERA\nZOOM {zoom}\nASPECTRATIO 1\nANTIALIASING 0\nRAYDEPTH {depth}\nCENTER {x} {y} {z}\n\
             VIEWDIR {dx} {dy} {dz}\nUPDIR {ux} {uy} {uz}\nEND_CAMERA\n"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read() {
        assert_eq!(parse("Preprocessing Time: 0.1 seconds\n  Ray Tracing Time:    13.0576 seconds\n"), Some(13.0576));
        assert_eq!(parse("Rendering Progress: 100% complete"), None);
    }

    const NFF: &str = "v\nfrom 2 1 3\nat 0 0 0\nup 0 0 1\nangle 90\nhither 0.01\nresolution 8 8\nb 0.1 0.2 0.3\n\
        l 4 3 2 0.5 0.6 0.7\nf 1 0.5 0.25 1 0 0 0 1\np 4\n1 0 0\n0 1 0\n0 0 1\n2 2 2\nf 1 1 1 0.9 0.5 3 0 1\ns 7 8 9 0.5\n";

    #[test]
    fn scenes_are_mirrored_and_polygons_are_fans() {
        let expected = "BEGIN_SCENE\nRESOLUTION 16 8\nCAMERA\nZOOM 0.5000000000000001\nASPECTRATIO 1\nANTIALIASING 0\nRAYDEPTH 5\n\
            CENTER -2 1 3\nVIEWDIR 2 -1 -3\nUPDIR -0 0 1\nEND_CAMERA\nBACKGROUND 0.1 0.2 0.3\n\
            LIGHT CENTER -4 3 2 RAD 0.0001 COLOR 0.5 0.6 0.7\n\
            TEXDEF m1 AMBIENT 0 DIFFUSE 1 SPECULAR 0 OPACITY 1 COLOR 1 0.5 0.25 TEXFUNC 0\n\
            TRI V0 -1 0 0 V1 -0 1 0 V2 -0 0 1 m1\nTRI V0 -1 0 0 V1 -0 0 1 V2 -2 2 2 m1\n\
            TEXDEF m2 AMBIENT 0 DIFFUSE 0.9 SPECULAR 0.5 OPACITY 1 PHONG PLASTIC 0.5 PHONG_SIZE 3 COLOR 1 1 1 TEXFUNC 0\n\
            SPHERE CENTER -7 8 9 RAD 0.5 m2\nEND_SCENE\n";
        assert_eq!(scene(NFF, [16, 8], 5).unwrap(), expected);
    }

    #[test]
    fn what_it_is_not_told_is_an_error() {
        for line in ["c", "l 1 2 3", "f 1 1 1 1 0 0 0.5 1", "p 3\n1 2 x\n", "pp 3"] {
            assert!(scene(&format!("{NFF}{line}\n"), [8, 8], 5).is_err(), "{line}");
        }
    }
}
