//! Whitted's model and metallic-roughness, bit for bit the same on every processor: materials, textures, lights, cameras, pixel
//! filters, ray ids and the rays that a hit spawns, one at a time.
//!
//! Nothing here traces, allocates or keeps state: each function is a function of its arguments. All arithmetic is
//! `+ - * /`, the correctly rounded square root and `libm`.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod camera;
mod detail;
mod environment;
mod filter;
mod glossy;
mod highlight;
pub mod id;
mod illuminate;
mod lens;
mod light;
mod material;
pub mod optics;
pub mod spawn;
mod stratify;
mod surface;
mod texture;
mod vector;

pub use camera::{Camera, CameraError, CameraRay, Pose, Projection};
pub use detail::{Detail, Look, Map, MapTables, Maps, Seen, coverage, seen};
pub use environment::{Cell, Cut, Environment, Sky, share_of};
pub use filter::{Filter, sample_offset};
pub use lens::Lens;
pub use light::{Light, LightKind};
pub use material::{Highlight, Material};
pub use spawn::{Child, Scene};
pub use surface::{Surface, offset_origin, pack_normal, terminator_shift, unpack_normal};
pub use texture::{Format, SRGB, Sampling, Texture, Wrap, from_shared_exponent, to_shared_exponent};
