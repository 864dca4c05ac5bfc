//! One step of a ray against the pages at hand.
#![no_std]
#![forbid(unsafe_code)]
