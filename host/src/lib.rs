//! The parts of the `hybray` program: import, pack, render, export, reports.
#![forbid(unsafe_code)]

pub mod build;
pub mod builtin;
pub mod export;
pub mod film;
pub mod framing;
pub mod import;
pub mod model;
pub mod nff_material;
pub mod pack;
pub mod partition;
pub mod picture;
pub mod prepare;
pub mod program;
pub mod simulate;
pub mod texture;
