//! One loop for every machine: receive, step, send, wait.
#![no_std]
#![forbid(unsafe_code)]
