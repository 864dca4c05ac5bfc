//! The transport trait alone: whole frames, once and in order, or the peer is lost.
#![no_std]
#![forbid(unsafe_code)]
