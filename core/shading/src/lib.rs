//! Whitted's model: materials, lights, cameras and sampling.
#![no_std]
#![forbid(unsafe_code)]

mod light;
mod material;

pub use light::{Light, LightKind};
pub use material::{Highlight, Material};
