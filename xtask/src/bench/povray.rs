//! POV-Ray 3.7 as a process, and the statistics that it prints.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::Context as _;

use super::hybray::pinned;

/// The program.
const PROGRAM: &str = "povray";

/// What a picture took, as POV-Ray counts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// From the first pixel to the last, seconds; neither reading the scene nor its bounding boxes.
    pub trace_seconds: f64,
    /// Of all threads, within that time.
    pub busy_seconds: f64,
    /// Primary, reflected and refracted rays, with those that the trace level then stops.
    pub rays: u64,
    /// Shadow rays; no line says so in a scene without lights.
    pub shadow_rays: u64,
}

/// Whether it is installed.
pub fn is_here() -> bool {
    let mut ask = Command::new(PROGRAM);
    ask.arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    ask.status().is_ok_and(|status| status.success())
}

/// A picture to be drawn.
pub struct Job<'a> {
    /// Where scene and picture lie; POV-Ray may be configured to touch nothing else.
    pub folder: &'a Path,
    /// Name of the scene.
    pub scene: &'a str,
    /// Name of the picture, a PNG of 8 bits.
    pub picture: &'a str,
    /// Columns and rows.
    pub size: [u32; 2],
    /// How many threads trace.
    pub threads: u16,
    /// How many processors the process may use; `None` leaves it to the system.
    pub pin: Option<u16>,
}

/// Draws it: no display, no antialiasing, values encoded by the sRGB curve, as ours are.
pub fn render(job: &Job<'_>) -> anyhow::Result<Statistics> {
    let [width, height] = job.size;
    let mut command = pinned(&PathBuf::from(PROGRAM), job.pin);
    command.args([
        format!("+I{}", job.scene),
        format!("+O{}", job.picture),
        format!("+W{width}"),
        format!("+H{height}"),
    ]);
    command.args([format!("+WT{}", job.threads), "-D".into(), "-A".into(), "-P".into(), "-V".into(), "+FN8".into()]);
    // HOME, lest somebody's own configuration changes the picture.
    command.arg("File_Gamma=sRGB").current_dir(job.folder).env("HOME", job.folder);
    let run = command.stdin(Stdio::null()).output().with_context(|| format!("{PROGRAM} does not start"))?;
    let text = String::from_utf8_lossy(&run.stderr);
    anyhow::ensure!(run.status.success(), "{command:?} failed:\n{text}");
    parse(&text).with_context(|| format!("{PROGRAM} printed other statistics than this benchmark knows:\n{text}"))
}

/// Reads the statistics out of everything that POV-Ray prints.
fn parse(text: &str) -> Option<Statistics> {
    let mut lines = text.lines().map(str::trim);
    let count = |label: &str| {
        let rest = text.lines().find_map(|line| line.trim().strip_prefix(label))?;
        rest.split_whitespace().next()?.parse().ok()
    };
    // Trace Time:       0 hours  0 minutes  0 seconds (0.963 seconds)
    let (_, seconds) = lines.find_map(|line| line.strip_prefix("Trace Time:"))?.split_once('(')?;
    // using 1 thread(s) with 0.858 CPU-seconds total
    let (_, busy) = lines.next()?.split_once(" with ")?;
    Some(Statistics {
        trace_seconds: seconds.strip_suffix("seconds)")?.trim().parse().ok()?,
        busy_seconds: busy.split_whitespace().next()?.parse().ok()?,
        rays: count("Rays:")?,
        shadow_rays: count("Shadow Ray Tests:").unwrap_or(0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As POV-Ray 3.7.0.10 printed it, shortened where nothing is read.
    const RECORDED: &str = "\
==== [Rendering...] ========================================================
----------------------------------------------------------------------------
Render Statistics
Image Resolution 512 x 512
----------------------------------------------------------------------------
Pixels:           262144   Samples:               0   Smpls/Pxl: 0.00
Rays:             449030   Saved:                 0   Max Level: 5/5
----------------------------------------------------------------------------
Ray->Shape Intersection          Tests       Succeeded  Percentage
----------------------------------------------------------------------------
Mesh                            201328          201328    100.00
----------------------------------------------------------------------------
Shadow Ray Tests:            950727   Succeeded:                285806
Shadow Cache Hits:           189404
Reflected Rays:              186886
----------------------------------------------------------------------------
Render Time:
  Photon Time:      No photons
  Radiosity Time:   No radiosity
  Trace Time:       0 hours  0 minutes  0 seconds (0.963 seconds)
              using 1 thread(s) with 0.858 CPU-seconds total
POV-Ray finished
";

    fn check(from: &str, to: &str, expected: Option<(f64, f64, u64, u64)>) {
        assert!(RECORDED.contains(from));
        let expected = expected.map(|(trace_seconds, busy_seconds, rays, shadow_rays)| Statistics {
            trace_seconds,
            busy_seconds,
            rays,
            shadow_rays,
        });
        assert_eq!(parse(&RECORDED.replace(from, to)), expected, "{to}");
    }

    #[test]
    fn statistics_are_read() {
        check("", "", Some((0.963, 0.858, 449_030, 950_727)));
        check("0 minutes  0 seconds (0.963 ", "1 minutes  2 seconds (62.5 ", Some((62.5, 0.858, 449_030, 950_727)));
        check("using 1 thread(s) with 0.858", "using 2 thread(s) with 1.9", Some((0.963, 1.9, 449_030, 950_727)));
        check("Shadow Ray Tests:            950727", "", Some((0.963, 0.858, 449_030, 0)));
    }

    #[test]
    fn what_is_missing_is_told() {
        check("Trace Time:  ", "Tracing:", None);
        check("Rays:             449030", "", None);
        check("449030", "many", None);
        check("0.858 CPU-seconds", "no time", None);
        assert_eq!(parse(""), None);
    }
}
