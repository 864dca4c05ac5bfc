//! Nodes as threads of this process.
#![forbid(unsafe_code)]
