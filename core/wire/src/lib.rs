//! Messages and ray records, byte by byte. `docs/WIRE.md` is their specification.
//!
//! Everything that arrives is hostile: [`decode`] checks lengths before it looks, recurses nowhere and allocates nothing.
#![no_std]
#![forbid(unsafe_code)]

mod message;
mod record;
mod tiles;

pub use message::{
    BODY_BYTES_MAX, CLIPLIST_MAX, Counts, Frame, HEAD_BYTES_MAX, MESSAGE_BYTES_MAX, Message, Optics, View, WireError,
    decode, encode,
};
pub use record::{Partial, RayKind, RayRecord, ShadowRecord};
pub use tiles::{TILE, Tile, TileMap};

/// Version of everything in this crate: peers with another one are refused.
pub const VERSION: u16 = 5;
