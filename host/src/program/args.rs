//! Arguments.

use crate::build::{Rule, Settings};
use crate::import::ENVIRONMENT_SAMPLES;
use crate::partition::{PILOT_RAYS, Voxels};
use crate::picture::PIXELS_PER_DEGREE;
use anyhow::{Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use hybray_bintree::midpoint;
use hybray_geometry::simd::Kernels;
use hybray_scene::{PAGE_BYTES_MAX, PageForm};
use hybray_scheduler::policy::{Criterion, Policy, Tiles};
use hybray_scheduler::{Options, Settings as NodeSettings};
use hybray_shading::Projection;
use hybray_simulated::{MACHINES, Machine, NODES_MAX};
use hybray_wire::{BODY_BYTES_MAX, RayRecord};
use std::path::PathBuf;

/// Ray-trace scenes that do not fit in any one machine, on machines of any size
#[derive(Debug, Parser)]
#[command(name = "hybray", version, arg_required_else_help = true, max_term_width = 110)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(super) enum Verb {
    /// Render a scene to a picture
    Render(RenderArgs),
    /// Say what each node's memory would be spent on, term by term, before anything is drawn
    Plan(PlanArgs),
    /// Render a scene on a virtual machine, and say how long that machine would take
    Simulate(SimulateArgs),
    /// Say what a scene holds and what it takes
    Info(InfoArgs),
    /// Build a scene and keep the result in a .hyb file, which every command takes as a scene
    Pack(PackArgs),
    /// Answer rays from standard input: `t primitive u v nx ny nz` or `miss`
    Trace(TraceArgs),
    /// Write a scene in another format: .nff, .obj (with .mtl) or .pov
    Convert(ConvertArgs),
    /// Say how far one picture is from another
    Compare(CompareArgs),
    /// List the built-in scenes
    Scenes,
    /// Print a shell's completion script
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
}

#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// A file (.obj, .gltf, .glb, .ply, .nff, .toml, .hyb), or a built-in scene such as `spd:balls:4`: `hybray scenes` lists them
    pub scene: String,
    /// A picture of what is all around (latitude and longitude; .hdr, .exr): it is seen where rays meet nothing, and lights the scene
    #[arg(long, value_name = "FILE", help_heading = "Environment")]
    pub environment: Option<PathBuf>,
    /// What it is multiplied by
    #[arg(long, value_name = "F", allow_negative_numbers = true, value_parser = not_negative, default_value_t = 1.0, help_heading = "Environment")]
    pub environment_strength: f32,
    /// How far it is turned, counterclockwise seen from above
    #[arg(
        long,
        value_name = "DEGREES",
        allow_negative_numbers = true,
        default_value_t = 0.0,
        help_heading = "Environment"
    )]
    pub environment_rotation: f64,
    /// Shadow rays that each hit sends there; 0 for none: then it is only seen
    #[arg(long, value_name = "N", default_value_t = ENVIRONMENT_SAMPLES, help_heading = "Environment")]
    pub environment_samples: u16,
}

#[derive(Clone, Debug, Args)]
pub(super) struct TreeArgs {
    /// How the tree is split. The picture does not depend on it
    #[arg(long, value_enum, default_value_t = Tree::Sah, help_heading = "Tree")]
    pub tree: Tree,
    /// Depth limit of the midpoint rule
    #[arg(long, default_value_t = 18, value_parser = clap::value_parser!(u32).range(1..=48), help_heading = "Tree")]
    pub cell_depth: u32,
    /// Objects in a cell that the midpoint rule does not split
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Tree")]
    pub cell_objects: u32,
    /// Most bytes of a page, 4096 to 65536. Default: 65536; for nodes with a budget the largest of 64, 32, 16, 8 and 4 KiB
    /// of which a node has room for 32
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(4096..=65536), help_heading = "Tree")]
    pub page_bytes: Option<u32>,
    /// In which form pages are: full ones are faster, compact ones take half the memory. The picture does not depend on it.
    /// Default: full; for nodes with a budget compact if full ones do not fit
    #[arg(long, value_enum, value_name = "FORM", help_heading = "Tree")]
    pub pages: Option<Pages>,
    /// Cut the scene into voxels: a grid, such as 4x8x1, or so many of equal work, such as 32. The picture does not
    /// depend on it
    #[arg(long, value_name = "N|WxHxD", help_heading = "Tree")]
    pub voxels: Option<Voxels>,
}

impl TreeArgs {
    /// What was asked for.
    pub fn settings(&self) -> Settings {
        self.settings_with(PAGE_BYTES_MAX as u32)
    }

    /// The same, with compact pages.
    pub fn compact(&self) -> Self {
        Self { pages: Some(Pages::Compact), ..self.clone() }
    }

    /// What was asked for, with pages of `page_bytes` at most if nobody said how large they may be.
    pub fn settings_with(&self, page_bytes: u32) -> Settings {
        let rule = match self.tree {
            Tree::Sah => Rule::SurfaceArea,
            Tree::Midpoint => {
                Rule::Midpoint(midpoint::Settings { depth_max: self.cell_depth, objects_max: self.cell_objects })
            }
        };
        let page_bytes = self.page_bytes.unwrap_or(page_bytes) as usize;
        let pages = match self.pages {
            None | Some(Pages::Full) => PageForm::Full,
            Some(Pages::Compact) => PageForm::Compact,
        };
        Settings { rule, page_bytes, pages, voxels: self.voxels.unwrap_or_default() }
    }
}

/// How nodes with a budget work. None of it changes a picture.
#[derive(Debug, Args)]
pub(super) struct WorkArgs {
    /// Rays in a message at most, 1 to 186 (the 1995 report's granularity, table 6.1). Default: 100
    #[arg(long, value_name = "RAYS", value_parser = clap::value_parser!(u16).range(1..=GRANULARITY_MAX), help_heading = BUDGET)]
    pub granularity: Option<u16>,
    /// A node begins no new tile while so many rays wait in it (table 6.1: pixels in the system). Default: 4096, or half
    /// of what the node has room for. With --tiles pixel-count also the pixels of a node that the host keeps in the system
    #[arg(long, value_name = "RAYS", value_parser = clap::value_parser!(u32).range(1..), help_heading = BUDGET)]
    pub in_system: Option<u32>,
    /// Side in pixels of a pyramid of primary rays: 8 or 16 (table 6.1). Default: 16
    #[arg(long, value_name = "PIXELS", value_parser = PossibleValuesParser::new(["8", "16"]).map(|side| if side == "8" { 8u8 } else { 16 }), help_heading = BUDGET)]
    pub pyramid: Option<u8>,
    /// When nodes are given tiles (the report's chapter 3). Default: dynamic
    #[arg(long, value_enum, help_heading = BUDGET)]
    pub tiles: Option<When>,
    /// Which nodes are given tiles (table 6.2): `all`, `all-but-host` (all but node 1, where the host is), `location`
    /// (those whose voxel lies at the boundary of the grid), or `objects:N` (those with N objects at most). Default:
    /// all; one node alone is always given them
    #[arg(long, value_name = "WHO", value_parser = criterion, help_heading = BUDGET)]
    pub demand_driven: Option<Criterion>,
    /// Nodes that clip pyramids, each for itself and the same number of others (chapter 4, table 6.3): 0 has the host do it
    /// for all. Default: every node for itself
    #[arg(long, value_name = "N", help_heading = BUDGET)]
    pub subhosts: Option<u16>,
    /// Whether shadow rays of hits that stand together, and those to the samples of an area light, are traced as bundles
    /// (chapter 4). Default: on
    #[arg(long, value_enum, help_heading = "Farm (none of these changes the picture)")]
    pub shadow_bundles: Option<Switch>,
    /// How rays go to the node that has the next page that they meet: straight there, or from voxel to neighbouring
    /// voxel and on to the end of the grid (the report's data-parallel network, section 6.3). The second wants a grid
    /// of as many voxels as nodes, and keeps light caches for shadow rays alone. Default: direct
    #[arg(long, value_enum, help_heading = BUDGET)]
    pub ways: Option<Ways>,
    /// Whether nodes that have nothing to do at the end of the picture are given some of the others' rays and
    /// tiles; never with --tiles static. Default: on
    #[arg(long, value_enum, help_heading = BUDGET)]
    pub take_over: Option<Switch>,
}

/// Which pages nodes have from the beginning besides their own.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct CopyArgs {
    /// Memory of each node for pages between its own and the lights, such as 4MiB, at most (the 1995 report's light caches): they
    /// are there from the start and stay. Default: with hybrid-1995 all, if they fit in half of what is left; else 0: none
    #[arg(long, value_name = "BYTES", value_parser = bytes_or_none, help_heading = BUDGET)]
    pub light_cache: Option<u64>,
    /// Rays that the host traces before a picture with hybrid, at most, four a tile: they say which nodes need which pages, and
    /// how to divide the picture. 0: none; pages are placed by space
    #[arg(long, value_name = "RAYS", default_value_t = PILOT_RAYS, help_heading = BUDGET)]
    pub pilot: u32,
}

impl WorkArgs {
    /// `settings` with what was asked for.
    pub fn settings(&self, settings: NodeSettings) -> NodeSettings {
        NodeSettings {
            granularity: self.granularity.unwrap_or(settings.granularity),
            in_system: self.in_system.unwrap_or(settings.in_system),
            bundle_tiles: self.pyramid.map_or(settings.bundle_tiles, |side| if side == 8 { 1 } else { 4 }),
            shadow_bundles: self.shadow_bundles.map_or(settings.shadow_bundles, |on| matches!(on, Switch::On)),
            subhosts: self.subhosts.or(settings.subhosts),
            ..settings
        }
    }

    /// How tiles are given out to nodes with these settings, in pieces of `tile` pixels a side.
    pub fn options(&self, spread: Option<f32>, tile: Option<u32>, settings: &NodeSettings) -> Options {
        let tiles = match self.tiles.unwrap_or(When::Dynamic) {
            When::Dynamic => Tiles::Dynamic,
            When::PixelCount => Tiles::PixelCount { pixels: settings.in_system },
            When::Static => Tiles::Static,
        };
        let take_over = !matches!(self.take_over, Some(Switch::Off));
        Options { spread, atomic: tile.map(|side| (side / 8) * (side / 8)), tiles, take_over }
    }

    /// Refuses what cannot be, with so many nodes.
    pub fn check(&self, dispatcher: Where, memory: Option<u64>, nodes: u16) -> Result<()> {
        if let Some(subhosts) = self.subhosts.filter(|&subhosts| subhosts > nodes) {
            let s = if nodes == 1 { "" } else { "s" };
            bail!("there cannot be {subhosts} subhosts among {nodes} node{s}: give --subhosts {nodes}, or fewer");
        }
        if let (Some(When::PixelCount), Where::Node) = (self.tiles, dispatcher) {
            bail!(
                "the host counts the pixels for --tiles pixel-count, so it must give out tiles: give --dispatcher host"
            );
        }
        if self.demand_driven.is_some() && memory.is_none() {
            bail!(
                "--demand-driven is about nodes with a budget, and there is none: give --memory, such as --memory 32MiB"
            );
        }
        if self.ways.is_some() && memory.is_none() {
            bail!("--ways is about nodes with a budget, and there is none: give --memory, such as --memory 32MiB");
        }
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum When {
    /// When they say that they are done
    Dynamic,
    /// When fewer of their pixels have not come back than --in-system says: the host counts
    PixelCount,
    /// Before the start
    Static,
}

impl When {
    /// What users call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dynamic => "dynamic",
            Self::PixelCount => "pixel-count",
            Self::Static => "static",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Ways {
    /// Straight to the owner of the page
    Direct,
    /// From voxel to voxel
    Voxels,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Switch {
    /// Yes
    On,
    /// No
    Off,
}

/// Rays that a message has room for.
const GRANULARITY_MAX: i64 = (BODY_BYTES_MAX / size_of::<RayRecord>()) as i64;
const _: () = assert!(GRANULARITY_MAX == 186, "help and documents say 186");

const BUDGET: &str = "Nodes with a budget (none of these changes the picture)";

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Tree {
    /// Surface-area heuristic
    Sah,
    /// Midpoints, as in the 1995 report
    Midpoint,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Pages {
    /// Boxes and triangles as the walk wants them
    Full,
    /// Boxes of eight bits a side, and vertices that triangles share
    Compact,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum KernelChoice {
    /// The best that this processor has
    Auto,
    /// Plain code, the same bits
    Portable,
}

impl KernelChoice {
    pub fn kernels(self) -> Kernels {
        match self {
            Self::Auto => Kernels::detect(),
            Self::Portable => Kernels::Portable,
        }
    }
}

/// Through which camera a scene is seen.
#[derive(Debug, Args)]
pub(super) struct CameraArgs {
    /// Which of the scene's cameras
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// How it makes rays of pixels: `spherical` sees 360 x 180 degrees. Default: the camera's own
    #[arg(long, value_parser = Projection::NAMES)]
    pub projection: Option<String>,
    /// What an orthographic picture shows from top to bottom, in the unit of the scene's file. Default: the camera's own, or as
    /// much as a perspective one shows at what it looks at
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    pub height: Option<f32>,
    /// Radius of the lens, in the unit of the scene's file: what is not in focus is blurred. 0: everything is sharp.
    /// Default: the camera's own
    #[arg(long, value_name = "RADIUS", value_parser = not_negative)]
    pub aperture: Option<f32>,
    /// Distance of what is in focus. Default: the camera's own, or that of what it looks at
    #[arg(long, value_name = "DISTANCE", value_parser = positive)]
    pub focus: Option<f32>,
    /// Sides of the lens's opening, 3 to 16; 0: it is round. Default: the camera's own
    #[arg(long, value_name = "N", value_parser = blades)]
    pub blades: Option<u8>,
}

#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Where the picture goes: .png, .exr (linear) or .ppm; `-` is standard output (PNG). Default: the scene's name, .png
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Columns and rows, pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[u32; 2]>,
    /// Samples a pixel, 1 to 65535. One sample goes through the middle of the pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65535))]
    pub spp: Option<u32>,
    /// Ray depth, 1 to 64: 1 is what is seen directly and its shadows
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub depth: Option<u32>,
    /// Rays with less weight than this are not traced, 0 to 1
    #[arg(long, value_name = "W", value_parser = fraction)]
    pub cutoff: Option<f32>,
    /// How samples are spread around the pixel
    #[arg(long, value_parser = ["box", "tent", "gaussian"])]
    pub filter: Option<String>,
    /// Radiance is multiplied by this before it is encoded
    #[arg(long, value_name = "X", value_parser = positive)]
    pub exposure: Option<f32>,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Draw the views of all cameras of this file, one after the other on the same nodes: TOML with `[[camera]]` tables as in
    /// scene files, each with a name. `out.png` becomes `out-NAME.png`
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera", "projection", "height", "aperture", "focus", "blades"])]
    pub cameras: Option<PathBuf>,
    /// Channels to write beside red, green and blue, to an .exr
    #[arg(long, value_enum, value_name = "LAYER,..", value_delimiter = ',')]
    pub layers: Vec<LayerChoice>,
    /// Seed of every random choice
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Bits of a PNG's channel
    #[arg(long, value_parser = ["8", "16"], default_value = "8")]
    pub bits: String,
    /// Go on with a picture that ended early: tiles that are in its film, the picture's file with `.film` after its name,
    /// are not traced again. The same scene and settings are to be given; the farm may be another
    #[arg(long)]
    pub resume: bool,
    /// Keep finished tiles in the film every so many seconds, so that --resume goes on even where the program was killed; 0
    /// keeps them only where the picture ends early
    #[arg(long, value_name = "SECONDS", default_value_t = 30)]
    pub save_every: u32,
    /// Write a report in JSON to this file, or to standard output (`-`)
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    /// Nodes: threads that trace, 1 to 1024. Default: as many as there are cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Farm (none of these changes the picture)")]
    pub nodes: Option<u16>,
    /// Where tiles are given out (POV||Ray, section 2.2)
    #[arg(long, value_enum, default_value_t = Where::Host, help_heading = "Farm (none of these changes the picture)")]
    pub dispatcher: Where,
    /// T of POV||Ray's rule W / (1 + T (N - 1)), 1 and up. Default: 2.5 to start, then learned
    #[arg(long, value_name = "T", value_parser = at_least_one, help_heading = "Farm (none of these changes the picture)")]
    pub spread: Option<f32>,
    /// Side in pixels of the least piece that is given out: 8, 16, 32 .. 512. Default: adapted to what tiles cost
    #[arg(long, value_name = "PIXELS", value_parser = tile, help_heading = "Farm (none of these changes the picture)")]
    pub tile: Option<u32>,
    /// Which kernels to run. `HYBRAY_KERNELS` gives the default
    #[arg(long, value_enum, env = "HYBRAY_KERNELS", default_value_t = KernelChoice::Auto, help_heading = "Farm (none of these changes the picture)")]
    pub kernels: KernelChoice,
    /// Memory of each node, such as 32MiB: everything that it works in, and its part of the scene. Without it the nodes are
    /// threads that share the whole scene
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = BUDGET)]
    pub memory: Option<u64>,
    /// Whether rays go to pages or pages to rays. Default: hybrid
    #[arg(long, value_name = "NAME", value_parser = scheduler(), help_heading = BUDGET)]
    pub scheduler: Option<Policy>,
    #[command(flatten)]
    pub work: WorkArgs,
    #[command(flatten)]
    pub copies: CopyArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
}

/// What may be written of a view beside its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LayerChoice {
    /// All of them
    All,
    /// Diffuse, mirrored and refracted share of what is seen first: albedo.R, .G, .B
    Albedo,
    /// Unit normal of what is seen first, towards the eye: normal.X, .Y, .Z
    Normal,
    /// Distance along the ray, file units: Z
    Depth,
    /// Number of the material plus 1: id
    Id,
    /// Samples that the pixel has: samples
    Samples,
    /// Estimated variance of the pixel: variance.R, .G, .B
    Variance,
}

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Nodes, 1 to 4096
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(NODES_MAX)))]
    pub nodes: u16,
    /// Memory of each node, such as 32MiB
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub memory: u64,
    /// What of it is for pages at most: bytes, or a part of what the scene's pages take, such as 1/16
    #[arg(long, value_name = "BYTES|1/N", value_parser = page_memory)]
    pub page_memory: Option<PageMemory>,
    /// Whether rays go to pages or pages to rays
    #[arg(long, value_name = "NAME", default_value = "hybrid", value_parser = scheduler())]
    pub scheduler: Policy,
    /// The machine that nodes are simulated on: how long it is at most until a ray ends there
    #[arg(long, value_name = "NAME", value_parser = machine())]
    pub machine: Option<&'static Machine>,
    #[command(flatten)]
    pub copies: CopyArgs,
    /// Write the plan in JSON to this file, or to standard output (`-`) instead of the table
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    #[command(flatten)]
    pub tree: TreeArgs,
}

/// Memory for pages: so much, or a part of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PageMemory {
    Bytes(u64),
    /// What all pages take, over this.
    Part(u64),
}

impl PageMemory {
    /// Bytes, for a scene whose pages take so many.
    pub fn bytes(self, pages_bytes: u64) -> u64 {
        match self {
            Self::Bytes(bytes) => bytes,
            Self::Part(parts) => pages_bytes / parts,
        }
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum Where {
    /// By the host, beside the film
    Host,
    /// By the first node, near the others
    Node,
}

#[derive(Debug, Args)]
pub(super) struct SimulateArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The machine
    #[arg(long, value_name = "NAME", value_parser = machine())]
    pub machine: &'static Machine,
    /// Numbers of nodes, 1 to 4096 each, such as 1,2,4,8
    #[arg(long, value_name = "N,..", value_delimiter = ',', required = true, value_parser = clap::value_parser!(u16).range(1..=i64::from(NODES_MAX)))]
    pub nodes: Vec<u16>,
    /// Memory of each node, such as 32MiB: everything that it works in, and its part of the scene. Without it, and on one
    /// node alone, each has the whole scene
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = BUDGET)]
    pub memory: Option<u64>,
    /// What of it is for pages at most: bytes, or a part of what the scene's pages take, such as 1/16. A node that owns more
    /// has what it owns, and the least of a cache
    #[arg(long, value_name = "BYTES|1/N", value_parser = page_memory, requires = "memory", help_heading = BUDGET)]
    pub page_memory: Option<PageMemory>,
    /// Whether rays go to pages or pages to rays; several are run one after the other
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', default_value = "hybrid", value_parser = scheduler(), help_heading = BUDGET)]
    pub scheduler: Vec<Policy>,
    #[command(flatten)]
    pub work: WorkArgs,
    #[command(flatten)]
    pub copies: CopyArgs,
    /// Columns and rows, pixels
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[u32; 2]>,
    /// Samples a pixel, 1 to 65535. One sample goes through the middle of the pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65535))]
    pub spp: Option<u32>,
    /// Ray depth, 1 to 64: 1 is what is seen directly and its shadows
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub depth: Option<u32>,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Seed of every random choice
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Where tiles are given out (POV||Ray, section 2.2)
    #[arg(long, value_enum, default_value_t = Where::Host)]
    pub dispatcher: Where,
    /// T of POV||Ray's rule W / (1 + T (N - 1)), 1 and up. Default: 2.5 to start, then learned
    #[arg(long, value_name = "T", value_parser = at_least_one)]
    pub spread: Option<f32>,
    /// Side in pixels of the least piece that is given out: 8, 16, 32 .. 512. Default: adapted to what tiles cost
    #[arg(long, value_name = "PIXELS", value_parser = tile)]
    pub tile: Option<u32>,
    /// Write all runs in JSON to this file, or to standard output (`-`)
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write a line for each run to this file (CSV), or to standard output (`-`)
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write a page with figures to this file, or to standard output (`-`)
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Say nothing but errors and results
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub tree: TreeArgs,
}

#[derive(Debug, Args)]
pub(super) struct InfoArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
}

#[derive(Debug, Args)]
pub(super) struct PackArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Where the pages go. Default: the scene's name, .hyb
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a report in JSON to this file, or to standard output (`-`)
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
    #[command(flatten)]
    pub tree: TreeArgs,
}

#[derive(Debug, Args)]
pub(super) struct TraceArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Rays are eight little-endian f32 each: ox oy oz dx dy dz tmin tmax. Answers are 28 bytes: t as f32 (infinite for a
    /// miss), the primitive as u32 (4294967295 for a miss), and u v nx ny nz as f32
    #[arg(long)]
    pub binary: bool,
    /// Which kernels to run. `HYBRAY_KERNELS` gives the default
    #[arg(long, value_enum, env = "HYBRAY_KERNELS", default_value_t = KernelChoice::Auto)]
    pub kernels: KernelChoice,
    #[command(flatten)]
    pub tree: TreeArgs,
}

#[derive(Debug, Args)]
pub(super) struct ConvertArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// What to write: .nff, .obj or .pov
    pub output: PathBuf,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Columns and rows, pixels, for formats that say so
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[u32; 2]>,
}

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// The picture to compare with: PNG, EXR or PPM
    pub reference: PathBuf,
    /// The picture that is looked at
    pub test: PathBuf,
    /// Draw where a difference is seen: black for nowhere, white for most
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// Pixels in a degree of what is seen
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE, value_parser = pixels_per_degree)]
    pub pixels_per_degree: f32,
    /// Write the figures as JSON to this file; `-` is standard output
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

fn pixels_per_degree(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|n| (1.0..=1000.0).contains(n)).ok_or_else(|| "give a number from 1 to 1000".to_owned())
}

fn not_negative(text: &str) -> Result<f32, String> {
    number(text, "of 0 or more, such as 0.05", |x| x >= 0.0 && x.is_finite())
}

fn blades(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(blades @ (0 | 3..=16)) => Ok(blades),
        _ => Err("give 3 to 16, or 0 for a round opening".to_owned()),
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let side_max = hybray_wire::TileMap::SIDE_MAX;
    match parsed {
        Some(size) if hybray_wire::TileMap::new(size[0], size[1]).is_some() => Ok(size),
        Some(_) => Err(format!(
            "a picture has 1 to {side_max} columns and rows, such as 640x480, and at most {} pixels",
            hybray_wire::TileMap::PIXELS_MAX
        )),
        None => Err("give columns and rows, such as 640x480".to_owned()),
    }
}

fn machine() -> impl TypedValueParser<Value = &'static Machine> {
    let values = MACHINES.iter().map(|machine| PossibleValue::new(machine.name).help(machine.about));
    PossibleValuesParser::new(values).map(|name| Machine::named(&name).expect("one of those that there are"))
}

fn scheduler() -> impl TypedValueParser<Value = Policy> {
    let values = Policy::ALL.map(|(name, policy)| {
        PossibleValue::new(name).help(match policy {
            Policy::Hybrid => "whichever costs less by what is known",
            Policy::Hybrid1995 => "pages come to primary rays, all others go to their pages (the 1995 report)",
            Policy::DataParallel => "rays go to the node that has their page",
            Policy::DemandDriven => "pages come to the node that has their rays (POV||Ray)",
        })
    });
    PossibleValuesParser::new(values).map(|name| {
        let named = Policy::ALL.into_iter().find(|&(known, _)| known == name);
        named.map_or_else(Policy::default, |(_, policy)| policy)
    })
}

fn criterion(text: &str) -> Result<Criterion, String> {
    match text.split_once(':') {
        None if text == "all" => Ok(Criterion::All),
        None if text == "all-but-host" => Ok(Criterion::AllButHost),
        None if text == "location" => Ok(Criterion::Location),
        Some(("objects", most)) if most.parse::<u64>().is_ok() => Ok(Criterion::Objects(most.parse().unwrap_or(0))),
        _ => Err("give all, all-but-host, location, or a number of objects, such as objects:500".to_owned()),
    }
}

/// Bytes, with a unit: 32MiB, 512KiB, 1GiB, or a plain number.
fn bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor: u64 = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kb" | "kib" => 1 << 10,
        "m" | "mb" | "mib" => 1 << 20,
        "g" | "gb" | "gib" => 1 << 30,
        unit => return Err(format!("`{unit}` is no unit of memory: give bytes, such as 32MiB, 512KiB or 1GiB")),
    };
    let number = digits.parse::<u64>().ok().and_then(|n| n.checked_mul(factor)).filter(|&bytes| bytes > 0);
    number.ok_or_else(|| "give bytes, such as 32MiB, 512KiB or 1GiB".to_owned())
}

/// Memory for pages: as [`bytes`], or 1/16.
fn page_memory(text: &str) -> Result<PageMemory, String> {
    let wanted = || "give bytes, such as 512KiB, or a part of the scene, such as 1/16".to_owned();
    match text.split_once('/') {
        Some((one, parts)) => {
            let parts = parts.parse().ok().filter(|&parts| one == "1" && parts > 0);
            parts.map(PageMemory::Part).ok_or_else(wanted)
        }
        None => bytes(text).map(PageMemory::Bytes).map_err(|_| wanted()),
    }
}

/// Bytes, or 0.
fn bytes_or_none(text: &str) -> Result<u64, String> {
    if text == "0" { Ok(0) } else { bytes(text) }
}

fn number(text: &str, what: &str, holds: impl Fn(f32) -> bool) -> Result<f32, String> {
    text.parse().ok().filter(|&x| holds(x)).ok_or_else(|| format!("give a number {what}"))
}

fn fraction(text: &str) -> Result<f32, String> {
    number(text, "from 0 to 1, such as 0.002", |x| (0.0..=1.0).contains(&x))
}

fn positive(text: &str) -> Result<f32, String> {
    number(text, "above 0, such as 1.5", |x| x > 0.0 && x.is_finite())
}

fn at_least_one(text: &str) -> Result<f32, String> {
    number(text, "of 1 or more, such as 2.5", |x| x >= 1.0)
}

fn tile(text: &str) -> Result<u32, String> {
    text.parse()
        .ok()
        .filter(|side: &u32| side.is_power_of_two() && (8..=512).contains(side))
        .ok_or_else(|| "give 8, 16, 32, 64, 128, 256 or 512".to_owned())
}
