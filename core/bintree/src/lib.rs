//! Bintrees by midpoint or surface area, wide nodes cut into pages, and the single-ray walk.
#![no_std]
#![forbid(unsafe_code)]
