//! `hybray` as a process, and the part of its JSON report that benchmarks read.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::Context as _;
use serde::Deserialize;

use crate::tools::Tools;
use crate::workspace::Workspace;

/// The program.
pub struct Hybray {
    program: PathBuf,
}

/// What a picture took. Seconds are a clock's, everything else is counted.
#[derive(Clone, Debug, Deserialize)]
pub struct Report {
    /// Hash of the picture before tone mapping.
    pub film: String,
    pub seconds: Seconds,
    pub rays: Rays,
    pub counts: Counts,
    pub memory: Memory,
    pub nodes: Vec<Node>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Seconds {
    pub import: f64,
    pub build: f64,
    pub trace: f64,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Rays {
    pub primary: u64,
    pub secondary: u64,
    pub shadow: u64,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Counts {
    pub triangles: u64,
    pub pages: u64,
    pub walk_nodes: u64,
    pub walk_blocks: u64,
    pub walk_pages: u64,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Memory {
    pub page_bytes: u64,
    /// Not known on every system.
    pub peak_bytes_per_primitive: Option<f64>,
}

#[derive(Clone, Debug, Deserialize)]
pub struct Node {
    pub busy_seconds: f64,
}

impl Rays {
    /// All of them.
    pub fn sum(&self) -> u64 {
        self.primary + self.secondary + self.shadow
    }
}

impl Report {
    /// Seconds in which nodes were at work, added up.
    pub fn busy_seconds(&self) -> f64 {
        self.nodes.iter().map(|node| node.busy_seconds).sum()
    }

    /// Share of the nodes' time in which they were at work.
    pub fn busy_share(&self) -> f64 {
        self.busy_seconds() / (self.seconds.trace * self.nodes.len() as f64)
    }
}

impl Hybray {
    /// Builds it as it is shipped, in the folder where cargo builds.
    pub fn build(tools: &Tools, workspace: &Workspace) -> anyhow::Result<Self> {
        anyhow::ensure!(tools.run(&["build", "--release", "-p", "hybray"], &[])?, "hybray does not build");
        let name = format!("hybray{}", std::env::consts::EXE_SUFFIX);
        Ok(Self::at(workspace.target.join("release").join(name)))
    }

    /// The program that is already there.
    pub fn at(program: PathBuf) -> Self {
        Self { program }
    }

    /// Draws `scene` with one sample for each pixel unless `settings` say otherwise.
    ///
    /// `pin` is the number of processors that the process may use; `None` leaves it to the system.
    pub fn render(
        &self,
        scene: &str,
        size: [u32; 2],
        settings: &[&str],
        picture: &Path,
        pin: Option<u16>,
    ) -> anyhow::Result<Report> {
        let mut command = pinned(&self.program, pin);
        command.args(["render", scene, "--quiet", "--json", "-", "--size", &columns_x_rows(size)]);
        command.args(settings).arg("-o").arg(picture);
        parse(&output(command)?)
    }

    /// Writes `scene` in the format that the name of `file` asks for.
    pub fn convert(&self, scene: &str, size: [u32; 2], file: &Path) -> anyhow::Result<()> {
        let mut command = Command::new(&self.program);
        command.args(["convert", scene, "--size", &columns_x_rows(size)]).arg(file);
        output(command).map(drop)
    }
}

/// A command that may use the first `processors` processors only, as Linux's `taskset` has it.
pub fn pinned(program: &Path, processors: Option<u16>) -> Command {
    let Some(count) = processors else { return Command::new(program) };
    let mut command = Command::new("taskset");
    command.args(["--cpu-list", &format!("0-{}", count.saturating_sub(1))]).arg(program);
    command
}

/// Standard output of a command that has to succeed.
pub fn output(mut command: Command) -> anyhow::Result<Vec<u8>> {
    let run = command.stdin(Stdio::null()).output();
    let run = run.with_context(|| format!("{} does not start", command.get_program().to_string_lossy()))?;
    let complaint = String::from_utf8_lossy(&run.stderr);
    anyhow::ensure!(run.status.success(), "{command:?} failed: {}", complaint.trim());
    Ok(run.stdout)
}

fn columns_x_rows([width, height]: [u32; 2]) -> String {
    format!("{width}x{height}")
}

fn parse(json: &[u8]) -> anyhow::Result<Report> {
    /// Read first: an unfinished picture has no figures worth reading.
    #[derive(Deserialize)]
    struct End {
        finished: bool,
    }
    let unknown = "hybray's report has another form than this benchmark knows";
    let end: End = serde_json::from_slice(json).context(unknown)?;
    anyhow::ensure!(end.finished, "hybray did not finish its picture");
    serde_json::from_slice(json).context(unknown)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As it came out, for `spd:balls:4` at 512 x 512 on one node.
    const RECORDED: &str = r#"{
        "scene": "spd:balls:4", "width": 512, "height": 512, "samples": 1, "film": "f8915dfe8c718f21", "finished": true,
        "seconds": { "import": 0.000329039, "build": 0.035256211, "trace": 1.542186064, "total": 1.757769736 },
        "rays": { "primary": 262144, "secondary": 175423, "shadow": 950715 },
        "counts": { "triangles": 2, "spheres": 7381, "cones": 0, "lights": 3, "materials": 2, "pages": 10,
            "tiles": 4096, "hits": 388210, "contributions": 714262, "refused": 0, "clamped": 0,
            "walk_nodes": 4612279, "walk_blocks": 1625699, "walk_pages": 1150230 },
        "memory": { "page_bytes": 324724, "directory_bytes": 752, "table_bytes": 416, "peak_bytes": 16027648,
            "peak_bytes_per_primitive": 2170.8855478802657 },
        "kernels": "avx2",
        "nodes": [{ "node": 1, "tiles": 4096, "runs": 1, "rays": 1388282, "busy_seconds": 0.967433486 }],
        "warnings": [] }"#;

    #[test]
    fn a_report_is_read() {
        let report = parse(RECORDED.as_bytes()).unwrap();
        assert_eq!(report.rays.sum(), 1_388_282);
        assert_eq!((report.film.as_str(), report.counts.walk_nodes), ("f8915dfe8c718f21", 4_612_279));
        assert_eq!((report.busy_seconds(), report.memory.page_bytes), (0.967433486, 324_724));
        assert!((report.busy_share() - 0.6273).abs() < 1e-4, "{}", report.busy_share());
    }

    #[test]
    fn systems_that_tell_no_peak_are_fine() {
        let report = parse(RECORDED.replace("2170.8855478802657", "null").as_bytes()).unwrap();
        assert_eq!(report.memory.peak_bytes_per_primitive, None);
    }

    fn check_refused(from: &str, to: &str, why: &str) {
        assert!(RECORDED.contains(from));
        let error = parse(RECORDED.replace(from, to).as_bytes()).unwrap_err();
        assert!(format!("{error:#}").contains(why), "{error:#}");
    }

    #[test]
    fn other_reports_are_refused() {
        check_refused("\"finished\": true", "\"finished\": false", "did not finish");
        check_refused("\"trace\"", "\"traced\"", "missing field `trace`");
        check_refused("\"warnings\": [] }", "", "another form");
    }

    #[test]
    fn processors_are_counted_from_0() {
        let command = pinned(Path::new("x"), Some(2));
        assert_eq!(command.get_args().collect::<Vec<_>>(), ["--cpu-list", "0-1", "x"]);
        assert_eq!(pinned(Path::new("x"), None).get_args().count(), 0);
    }
}
