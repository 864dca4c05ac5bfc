//! Page format, directory and what a scene requires.
#![no_std]
#![forbid(unsafe_code)]
