//! Messages and ray records, byte by byte.
#![no_std]
#![forbid(unsafe_code)]
