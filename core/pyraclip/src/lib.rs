//! A pyramid against a tree: ordered cliplists, and bundles traced along them.
#![no_std]
#![forbid(unsafe_code)]
