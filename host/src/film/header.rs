//! The first 152 bytes of a film file: whose film it is.

use crate::build::hash_bytes;
use bytemuck::{Pod, Zeroable};
use hybray_shading::Filter;
use hybray_wire::{Frame, TileMap};

/// Bytes that start a file: name, an end of line and an end of text that transfers as text would spoil.
const MAGIC: [u8; 8] = *b"hyfilm\r\x1a";
/// Version of the format.
const VERSION: u32 = 2;
/// Version of the program: another one may draw other bits.
const PROGRAM: [u32; 3] = {
    const fn number(text: &str) -> u32 {
        match u32::from_str_radix(text, 10) {
            Ok(number) => number,
            Err(_) => panic!("a version is made of numbers"),
        }
    }
    [
        number(env!("CARGO_PKG_VERSION_MAJOR")),
        number(env!("CARGO_PKG_VERSION_MINOR")),
        number(env!("CARGO_PKG_VERSION_PATCH")),
    ]
};

/// What a film is of: all that its sums depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subject {
    /// Hash of the scene, however it is cut into pages: [`crate::prepare::Prepared::subject`].
    pub scene: u64,
    /// The picture.
    pub frame: Frame,
}

/// The header. The tiles' bits, their sums and the hash follow.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FileHeader {
    pub magic: [u8; 8],
    pub version: u32,
    /// Bytes of this header.
    pub header_bytes: u32,
    /// Bytes of the file.
    pub file_bytes: u64,
    pub scene: u64,
    pub seed: u64,
    pub program: [u32; 3],
    /// Finished tiles, which are here.
    pub kept: u32,
    pub width: u32,
    pub height: u32,
    /// Of each pixel; above 16 bits of it what is drawn, and above another 8 which half of the samples.
    pub samples: u32,
    pub depth_max: u32,
    pub filter: u32,
    pub step_log2: i32,
    pub weight_cutoff: f32,
    pub eye: [f32; 3],
    pub target: [f32; 3],
    pub up: [f32; 3],
    pub fov_y_degrees: f32,
    pub hither: f32,
    pub projection: u32,
    pub picture_height: f32,
    /// Radius, distance of what is sharp, degrees that the opening is turned.
    pub lens: [f32; 3],
    pub blades: u32,
}

const _: () = assert!(size_of::<FileHeader>() == 152);

impl FileHeader {
    /// Of a film of `subject` that has no tiles yet.
    pub fn of(subject: &Subject) -> Self {
        let f = &subject.frame;
        Self {
            magic: MAGIC,
            version: VERSION,
            header_bytes: size_of::<Self>() as u32,
            file_bytes: 0,
            scene: subject.scene,
            seed: f.seed,
            program: PROGRAM,
            kept: 0,
            width: f.width,
            height: f.height,
            samples: u32::from(f.samples) | u32::from(f.layer) << 16 | u32::from(f.half) << 24,
            depth_max: f.depth_max.into(),
            filter: f.filter.into(),
            step_log2: f.step_log2.into(),
            weight_cutoff: f.weight_cutoff,
            eye: f.eye,
            target: f.target,
            up: f.up,
            fov_y_degrees: f.fov_y_degrees,
            hither: f.hither,
            projection: f.optics.projection.into(),
            picture_height: f.optics.height,
            lens: [f.optics.radius, f.optics.focus, f.optics.rotation_degrees],
            blades: f.optics.blades.into(),
        }
    }

    /// Where tiles are; none if there can be no such picture.
    pub fn map(&self) -> Option<TileMap> {
        TileMap::new(self.width, self.height)
    }

    /// What the hash of everything starts from.
    pub fn hash(&self) -> u64 {
        hash_bytes(0xcbf2_9ce4_8422_2325, bytemuck::bytes_of(self))
    }

    /// Whether these are the first bytes of a film of this version.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<(), String> {
        if self.magic != MAGIC {
            return Err("this is no film".to_owned());
        }
        if self.version != VERSION || self.header_bytes as usize != size_of::<Self>() {
            return Err(format!("its format is version {}, and this program reads version {VERSION}", self.version));
        }
        Ok(())
    }

    /// In what the film's picture is another than `wanted`'s, in words; nothing if it is the same.
    pub fn differences(&self, wanted: &Self) -> Vec<String> {
        let mut all = Vec::new();
        let mut note = |differs: bool, what: &dyn Fn() -> String| {
            if differs {
                all.push(what());
            }
        };
        let program = |[major, minor, patch]: [u32; 3]| format!("{major}.{minor}.{patch}");
        let filter = |number| Filter::from_u32(number).map_or("unknown", Filter::name);
        let (a, b) = (self, wanted);
        note(a.program != b.program, &|| format!("hybray {} and not {}", program(a.program), program(b.program)));
        note(a.scene != b.scene, &|| "another scene".to_owned());
        let size = |h: &Self| [h.width, h.height];
        note(size(a) != size(b), &|| format!("--size {}x{} and not {}x{}", a.width, a.height, b.width, b.height));
        let spp = |h: &Self| h.samples & 0xffff;
        note(spp(a) != spp(b), &|| format!("--spp {} and not {}", spp(a), spp(b)));
        note(a.samples >> 16 != b.samples >> 16, &|| "another layer".to_owned());
        note(a.depth_max != b.depth_max, &|| format!("--depth {} and not {}", a.depth_max, b.depth_max));
        let cutoff = |h: &Self| h.weight_cutoff;
        note(cutoff(a).to_bits() != cutoff(b).to_bits(), &|| format!("--cutoff {} and not {}", cutoff(a), cutoff(b)));
        note(a.filter != b.filter, &|| format!("--filter {} and not {}", filter(a.filter), filter(b.filter)));
        note(a.seed != b.seed, &|| format!("--seed {} and not {}", a.seed, b.seed));
        let exposure = |h: &Self| libm::exp2(f64::from(-32 - h.step_log2));
        note(a.step_log2 != b.step_log2, &|| {
            format!(
                "--exposure {} to {} and not {} to {}",
                exposure(a),
                2.0 * exposure(a),
                exposure(b),
                2.0 * exposure(b)
            )
        });
        // As they are written: what is not equal to itself is no other camera.
        let camera = |h: &Self| {
            let numbers = [h.eye, h.target, h.up, [h.fov_y_degrees, h.hither, h.picture_height], h.lens];
            (numbers.map(|v| v.map(f32::to_bits)), h.projection, h.blades)
        };
        note(camera(a) != camera(b), &|| "another camera".to_owned());
        all
    }
}
