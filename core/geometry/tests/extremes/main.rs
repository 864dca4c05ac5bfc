//! The numbers of DESIGN section 13, measured again: what usual formulas lose, and that ours lose nothing.
//!
//! `cargo test -p hybray-geometry --test extremes -- --nocapture` prints the figures that `README.md` quotes.

mod bounds;
mod bundles;
mod exact;
mod leaks;
mod random;
mod slabs;
mod spheres;
