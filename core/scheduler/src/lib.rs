//! Dispatcher, node, ledger and film: state machines and pure functions.
#![no_std]
#![forbid(unsafe_code)]
