//! The `hybray` program.
#![forbid(unsafe_code)]
fn main() {}
