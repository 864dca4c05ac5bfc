//! Whitted's model, bit for bit the same on every processor: materials, lights, cameras, pixel filters, ray ids and
//! the rays that a hit spawns, one at a time.
//!
//! Nothing here traces, allocates or keeps state: each function is a function of its arguments. All arithmetic is
//! `+ - * /`, the correctly rounded square root and `libm`.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod camera;
mod filter;
mod highlight;
pub mod id;
mod illuminate;
mod light;
mod material;
pub mod optics;
pub mod spawn;
mod stratify;
mod surface;
mod vector;

pub use camera::{Camera, CameraError, CameraRay};
pub use filter::{Filter, sample_offset};
pub use light::{Light, LightKind};
pub use material::{Highlight, Material};
pub use spawn::{Child, Scene};
pub use surface::{Surface, offset_origin, pack_normal, terminator_shift, unpack_normal};
