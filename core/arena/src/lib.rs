//! Carve a budget of bytes once, then seal it: stacks, rings and pools that hand an item back when full.
#![no_std]
#![forbid(unsafe_code)]
