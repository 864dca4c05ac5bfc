//! The link between threads of one process.
#![forbid(unsafe_code)]
