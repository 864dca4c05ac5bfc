//! Messages: a small head (postcard), then a body whose length the head determines.

use crate::TILE;
use serde::{Deserialize, Serialize};

/// What every node must know of a picture before it traces a ray. Lengths are internal units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// Columns, pixels.
    pub width: u32,
    /// Rows, pixels.
    pub height: u32,
    /// Samples of each pixel.
    pub samples: u16,
    /// Rays of this depth spawn no others but shadow rays; primary rays have depth 1. At most 64.
    pub depth_max: u8,
    /// Pixel filter: the number of a `Filter`.
    pub filter: u8,
    /// Seed of every random choice.
    pub seed: u64,
    /// Rays with less weight than this in every channel are not traced.
    pub weight_cutoff: f32,
    /// Steps of the film are 2 to this power.
    pub step_log2: i8,
    /// Where the camera is.
    pub eye: [f32; 3],
    /// What it looks at.
    pub target: [f32; 3],
    /// Up.
    pub up: [f32; 3],
    /// Angle between the picture's top and bottom edge.
    pub fov_y_degrees: f32,
    /// Distance along the view from which on something is seen.
    pub hither: f32,
}

/// What was traced, exactly: the same on any nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Rays from the camera.
    pub primary: u64,
    /// Mirrored and refracted rays.
    pub secondary: u64,
    /// Rays to lights.
    pub shadow: u64,
    /// Nearest-hit rays that hit something.
    pub hits: u64,
    /// Values added to the film.
    pub contributions: u64,
    /// Contributions that were not finite, or negative, and were left out.
    pub refused: u64,
    /// Contributions that were cut to the film's greatest.
    pub clamped: u64,
}

impl core::ops::AddAssign for Counts {
    fn add_assign(&mut self, b: Self) {
        self.primary = self.primary.saturating_add(b.primary);
        self.secondary = self.secondary.saturating_add(b.secondary);
        self.shadow = self.shadow.saturating_add(b.shadow);
        self.hits = self.hits.saturating_add(b.hits);
        self.contributions = self.contributions.saturating_add(b.contributions);
        self.refused = self.refused.saturating_add(b.refused);
        self.clamped = self.clamped.saturating_add(b.clamped);
    }
}

/// What travels between host, dispatcher and nodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// Node to dispatcher and host: I am here, and have this scene.
    Hello {
        /// [`crate::VERSION`].
        version: u16,
        /// Hash of the scene.
        scene: u64,
    },
    /// Host to all: a picture begins.
    Begin(Frame),
    /// Dispatcher to node: trace this run of tiles.
    Tiles {
        /// First tile.
        first: u32,
        /// How many, 1 or more.
        count: u32,
        /// Their epoch.
        epoch: u16,
    },
    /// Node to dispatcher: the oldest run is done, and took this long.
    Done {
        /// First tile.
        first: u32,
        /// How many.
        count: u32,
        /// Time spent on it.
        nanoseconds: u64,
    },
    /// Node to film: adds to a tile. The body is red, green and blue of its pixels, row by row, each 8 bytes.
    Contributions {
        /// The tile.
        tile: u32,
        /// Its epoch.
        epoch: u16,
        /// Columns of the tile.
        width: u8,
        /// Rows of the tile.
        height: u8,
        /// Rays that ended: for people to watch.
        rays: u32,
        /// Sum of the ledger entries of the rays that ended.
        entry: u64,
    },
    /// Dispatcher to node: nothing is left to give out, report to the host. `tile` is `u32::MAX`.
    Finished {
        /// The tile.
        tile: u32,
    },
    /// Film to dispatcher: give this tile out again. After the last one comes one with `tile` at `u32::MAX`.
    Again {
        /// The tile.
        tile: u32,
        /// Its new epoch.
        epoch: u16,
    },
    /// Node to host, at the end: what it did.
    Report {
        /// What it traced.
        counts: Counts,
        /// Tiles that it traced.
        tiles: u32,
        /// Runs of tiles that it was given.
        runs: u32,
        /// Time spent tracing.
        busy_nanoseconds: u64,
    },
    /// Host to all: the program ends; send nothing more.
    Stop,
}

/// Bytes of the longest message: a head, and a body of 64 pixels.
pub const MESSAGE_BYTES_MAX: usize = 128 + (TILE * TILE) as usize * 24;

/// Why bytes are no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The head is not one of this version's.
    #[error("a frame does not begin with a message of this version")]
    Head,
    /// The body is not as long as the head says.
    #[error("a message has a body of {bytes} bytes and should have {expected}")]
    Body {
        /// Bytes after the head.
        bytes: usize,
        /// What the head asks for.
        expected: usize,
    },
    /// The room that the link gave is too small.
    #[error("a message does not fit the {0} bytes that the link has")]
    Room(usize),
}

/// A message and its body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View<'a> {
    /// The head.
    pub message: Message,
    /// Red, green and blue of a tile's pixels; empty for other messages.
    pub body: &'a [u8],
}

impl Message {
    /// Bytes of the body.
    #[must_use]
    pub const fn body_bytes(&self) -> usize {
        match self {
            Self::Contributions { width, height, .. } => *width as usize * *height as usize * 24,
            _ => 0,
        }
    }
}

/// Writes a message into `room`; `body` is called to write the body. Returns the bytes used.
///
/// # Errors
/// If it does not fit.
pub fn encode(message: &Message, room: &mut [u8], body: impl FnOnce(&mut [u8])) -> Result<usize, WireError> {
    let bytes = room.len();
    let head = postcard::to_slice(message, room).map_err(|_| WireError::Room(bytes))?.len();
    let all = head + message.body_bytes();
    body(room.get_mut(head..all).ok_or(WireError::Room(bytes))?);
    Ok(all)
}

/// Reads a message. postcard would ignore bytes at the end: they are the body, and must be as many as the head says.
///
/// # Errors
/// See [`WireError`].
pub fn decode(bytes: &[u8]) -> Result<View<'_>, WireError> {
    let (message, body) = postcard::take_from_bytes::<Message>(bytes).map_err(|_| WireError::Head)?;
    if let Message::Contributions { width, height, .. } = message
        && (u32::from(width) > TILE || u32::from(height) > TILE)
    {
        return Err(WireError::Head);
    }
    if body.len() != message.body_bytes() {
        return Err(WireError::Body { bytes: body.len(), expected: message.body_bytes() });
    }
    Ok(View { message, body })
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Frame = Frame {
        width: u32::MAX,
        height: u32::MAX,
        samples: u16::MAX,
        depth_max: 64,
        filter: 2,
        seed: u64::MAX,
        weight_cutoff: 0.1,
        step_log2: -32,
        eye: [1.5; 3],
        target: [f32::MAX; 3],
        up: [0.0, 1.0, 0.0],
        fov_y_degrees: 45.0,
        hither: 0.0,
    };

    fn check(message: Message) {
        let mut room = [0; MESSAGE_BYTES_MAX];
        let used = encode(&message, &mut room, |body| body.fill(7)).unwrap();
        let view = decode(&room[..used]).unwrap();
        assert_eq!(view.message, message);
        assert!(view.body.iter().all(|&b| b == 7));
        assert!(decode(&room[..used - 1]).is_err(), "cut short: {message:?}");
        assert!(decode(&room[..(used + 1).min(room.len())]).is_err() || used == room.len(), "too long: {message:?}");
        assert!(encode(&message, &mut room[..used - 1], |_| {}).is_err());
    }

    #[test]
    fn messages_come_back_and_nothing_else_is_taken_for_one() {
        check(Message::Hello { version: 1, scene: u64::MAX });
        check(Message::Begin(FRAME));
        check(Message::Tiles { first: 3, count: u32::MAX, epoch: 65535 });
        check(Message::Done { first: 3, count: 1, nanoseconds: u64::MAX });
        check(Message::Contributions {
            tile: u32::MAX,
            epoch: 65535,
            width: 8,
            height: 8,
            rays: u32::MAX,
            entry: u64::MAX,
        });
        check(Message::Contributions { tile: 0, epoch: 0, width: 3, height: 1, rays: 0, entry: 0 });
        check(Message::Finished { tile: 9 });
        check(Message::Again { tile: 9, epoch: 1 });
        let most = u64::MAX;
        let counts = Counts {
            primary: most,
            secondary: most,
            shadow: most,
            hits: most,
            contributions: most,
            refused: most,
            clamped: most,
        };
        check(Message::Report { counts, tiles: u32::MAX, runs: u32::MAX, busy_nanoseconds: most });
        check(Message::Stop);
        assert_eq!(decode(&[]), Err(WireError::Head));
        assert_eq!(decode(&[200]), Err(WireError::Head));
    }

    /// Any bytes: an error or a message, never a panic (a small fuzzer; the seed is the loop variable).
    #[test]
    fn noise_is_refused_calmly() {
        let mut state = 1u64;
        let mut taken = 0;
        for round in 0..200_000u32 {
            let mut bytes = [0u8; 48];
            for b in &mut bytes {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                *b = (state >> 56) as u8;
            }
            bytes[0] %= 10;
            taken += u32::from(decode(&bytes[..(round % 49) as usize]).is_ok());
        }
        assert!(taken > 100, "some noise is a message: {taken}");
    }
}
