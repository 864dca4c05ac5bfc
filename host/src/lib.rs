//! The parts of the `hybray` program: import, pack, render, export, reports.
#![forbid(unsafe_code)]

pub mod model;
