//! Builds, images, benchmarks and the one gate.
fn main() {}
