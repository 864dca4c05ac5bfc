//! Whole-system tests: parity, faults, extremes, golden pictures.
#![forbid(unsafe_code)]
