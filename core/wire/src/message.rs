//! Messages: a small head (postcard), then a body whose length the head determines.

use crate::{Partial, RayRecord, ShadowRecord, TILE};
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
    /// What it shows: the number of a `Layer`, 0 for light.
    pub layer: u8,
    /// Which of the samples it has: 0 all, 1 or 2 one half ([`Frame::sample_from`]).
    pub half: u8,
    /// What the camera makes of pixels.
    pub optics: Optics,
}

impl Frame {
    /// The first sample from `from` on that it has. Halves are those of the Thue-Morse sequence, by the parity of the ones in a
    /// sample's number: sample points are stratified by its bits, and every second of them would lie in one half of the pixel.
    #[must_use]
    pub fn sample_from(&self, from: u32) -> Option<u16> {
        let has = |sample: &u32| self.half == 0 || sample.count_ones() % 2 + 1 == u32::from(self.half);
        (from..u32::from(self.samples)).find(has).map(|sample| sample as u16)
    }

    /// Numbers of the samples that it has, of [`Frame::samples`].
    pub fn drawn(&self) -> impl Iterator<Item = u16> + Clone + use<> {
        let frame = *self;
        core::iter::successors(frame.sample_from(0), move |&sample| frame.sample_from(u32::from(sample) + 1))
    }

    /// How many these are.
    #[must_use]
    pub const fn drawn_samples(&self) -> u16 {
        if self.half == 0 || self.samples == 0 {
            return self.samples;
        }
        // One of each pair, and the last if it has none beside it.
        let last = self.samples % 2 == 1 && ((self.samples - 1).count_ones() % 2 + 1) as u8 == self.half;
        self.samples / 2 + last as u16
    }
}

/// A projection and a lens. Numbers are not checked here: a node passes over a picture whose camera is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Optics {
    /// The number of a `Projection`.
    pub projection: u8,
    /// From the picture's top to its bottom, if the camera is orthographic.
    pub height: f32,
    /// Radius of the lens; 0 for none.
    pub radius: f32,
    /// Distance along the view of what is sharp.
    pub focus: f32,
    /// Sides of the lens's opening; 0 if it is round.
    pub blades: u8,
    /// How far the opening is turned.
    pub rotation_degrees: f32,
}

impl Optics {
    /// Perspective, without a lens.
    pub const PINHOLE: Self =
        Self { projection: 0, height: 0.0, radius: 0.0, focus: 0.0, blades: 0, rotation_degrees: 0.0 };
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
    /// Node to host, at the end: what it did for this picture.
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
    /// Node to node: rays for pages that you have, [`crate::RayRecord`]s and then [`crate::ShadowRecord`]s. The sender
    /// keeps them until it hears [`Message::Took`], and sends this peer no others before.
    Rays {
        /// Records of the first kind.
        rays: u16,
        /// Records of the second.
        shadows: u16,
        /// Rays that wait at the sender.
        load: u16,
    },
    /// Node to node: the answer to [`Message::Rays`].
    Took {
        /// Whether there was room for them: if not, they are still yours.
        taken: bool,
        /// Rays that wait here.
        load: u16,
    },
    /// Node to node: adds to tiles that you keep. The body is [`crate::Partial`]s.
    Partials {
        /// How many.
        count: u16,
    },
    /// Node to node: send me this page; a place is reserved for it.
    Fetch {
        /// Its number.
        page: u32,
    },
    /// Node to node: a part of a page that was asked for; parts come in order.
    Part {
        /// The page.
        page: u32,
        /// Where in it the body belongs.
        offset: u32,
        /// Bytes of the body; none if the sender has no such page.
        bytes: u16,
    },
    /// Dispatcher to node: no tiles are left, and this node has nothing to do: send it some of your rays.
    Share {
        /// Who.
        with: u16,
    },
    /// Node to dispatcher: what others shared with me is done.
    Idle {
        /// Whether there was anything.
        given: bool,
    },
    /// Node to dispatcher: the last tiles of my last run, which I have not begun and that node is to have.
    Back {
        /// Who.
        with: u16,
        /// The first of them.
        first: u32,
        /// How many.
        count: u32,
    },
    /// Host to dispatcher, before the picture begins: these tiles are finished already, do not give them out.
    Kept {
        /// First tile.
        first: u32,
        /// How many, 1 or more.
        count: u32,
    },
    /// Node to its subhost, or to the host: which pages does this bundle meet?
    Clip {
        /// First tile.
        first: u32,
        /// How many, 1 to 4.
        count: u8,
    },
    /// The answer to [`Message::Clip`]: the body is the pages' numbers, the nearest first, each 4 bytes.
    Cliplist {
        /// First tile.
        first: u32,
        /// How many pages, [`CLIPLIST_MAX`] at most.
        pages: u8,
    },
    /// Host to all nodes: this picture ends, say what you did for it, and wait for the next.
    End,
}

/// What a frame of any picture but the first begins with: no message has this number.
const LATER: u8 = 0x7f;

/// Pages of a cliplist at most.
pub const CLIPLIST_MAX: usize = 8;

/// Bytes of the longest head.
pub const HEAD_BYTES_MAX: usize = 128;
/// Bytes of the longest body.
pub const BODY_BYTES_MAX: usize = 16 * 1024;
/// Bytes of the longest message.
pub const MESSAGE_BYTES_MAX: usize = HEAD_BYTES_MAX + BODY_BYTES_MAX;

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
    /// The picture that it is about: 0 is the first of a run.
    pub picture: u16,
    /// The head.
    pub message: Message,
    /// What the head announces; empty for most messages.
    pub body: &'a [u8],
}

impl From<Message> for View<'_> {
    /// A message about the first picture, without a body.
    fn from(message: Message) -> Self {
        Self { picture: 0, message, body: &[] }
    }
}

impl Message {
    /// Bytes of the body.
    #[must_use]
    pub const fn body_bytes(&self) -> usize {
        match self {
            Self::Contributions { width, height, .. } => *width as usize * *height as usize * 24,
            Self::Rays { rays, shadows, .. } => {
                *rays as usize * size_of::<RayRecord>() + *shadows as usize * size_of::<ShadowRecord>()
            }
            Self::Partials { count } => *count as usize * size_of::<Partial>(),
            Self::Part { bytes, .. } => *bytes as usize,
            Self::Cliplist { pages, .. } => *pages as usize * 4,
            _ => 0,
        }
    }
}

/// Writes a message about `picture` into `room`; `body` is called to write the body. Returns the bytes used.
///
/// # Errors
/// If it does not fit.
pub fn encode(
    picture: u16,
    message: &Message,
    room: &mut [u8],
    body: impl FnOnce(&mut [u8]),
) -> Result<usize, WireError> {
    let bytes = room.len();
    // One picture, as most runs have, is not told from others: nothing is paid for what is not there.
    let head = match picture {
        0 => postcard::to_slice(message, room),
        _ => postcard::to_slice(&(LATER, picture, message), room),
    };
    let head = head.map_err(|_| WireError::Room(bytes))?.len();
    let all = head + message.body_bytes();
    body(room.get_mut(head..all).ok_or(WireError::Room(bytes))?);
    Ok(all)
}

/// Reads a message. postcard would ignore bytes at the end: they are the body, and must be as many as the head says.
///
/// # Errors
/// See [`WireError`].
pub fn decode(bytes: &[u8]) -> Result<View<'_>, WireError> {
    let (picture, bytes) = match bytes {
        [LATER, rest @ ..] => match postcard::take_from_bytes::<u16>(rest) {
            Ok((picture, bytes)) if picture > 0 => (picture, bytes),
            _ => return Err(WireError::Head),
        },
        _ => (0, bytes),
    };
    let (message, body) = postcard::take_from_bytes::<Message>(bytes).map_err(|_| WireError::Head)?;
    if let Message::Contributions { width, height, .. } = message
        && (u32::from(width) > TILE || u32::from(height) > TILE)
    {
        return Err(WireError::Head);
    }
    if matches!(message, Message::Cliplist { pages, .. } if usize::from(pages) > CLIPLIST_MAX) {
        return Err(WireError::Head);
    }
    if message.body_bytes() > BODY_BYTES_MAX {
        return Err(WireError::Head);
    }
    if body.len() != message.body_bytes() {
        return Err(WireError::Body { bytes: body.len(), expected: message.body_bytes() });
    }
    Ok(View { picture, message, body })
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
        layer: 0,
        half: 0,
        optics: Optics { blades: 255, focus: f32::MAX, ..Optics::PINHOLE },
    };

    fn check(message: Message) {
        let mut room = [0; MESSAGE_BYTES_MAX];
        for picture in [0, 1, 127, 128, u16::MAX] {
            let used = encode(picture, &message, &mut room, |body| body.fill(7)).unwrap();
            assert!(used - message.body_bytes() <= HEAD_BYTES_MAX, "{message:?}");
            let view = decode(&room[..used]).unwrap();
            assert_eq!((view.picture, view.message), (picture, message));
            assert!(view.body.iter().all(|&b| b == 7));
            assert!(decode(&room[..used - 1]).is_err(), "cut short: {message:?}");
            let more = (used + 1).min(room.len());
            assert!(decode(&room[..more]).is_err() || used == room.len(), "too long: {message:?}");
            assert!(encode(picture, &message, &mut room[..used - 1], |_| {}).is_err());
        }
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
        check(Message::End);
        check(Message::Rays { rays: 100, shadows: 100, load: u16::MAX });
        check(Message::Took { taken: false, load: u16::MAX });
        check(Message::Partials { count: 400 });
        check(Message::Share { with: u16::MAX });
        check(Message::Idle { given: true });
        check(Message::Back { with: u16::MAX, first: u32::MAX, count: u32::MAX });
        check(Message::Kept { first: u32::MAX, count: u32::MAX });
        check(Message::Clip { first: u32::MAX, count: 4 });
        check(Message::Cliplist { first: u32::MAX, pages: 8 });
        check(Message::Cliplist { first: 0, pages: 0 });
        check(Message::Fetch { page: u32::MAX });
        check(Message::Part { page: u32::MAX, offset: u32::MAX, bytes: 4096 });
        check(Message::Rays { rays: 186, shadows: 0, load: 0 });
        check(Message::Rays { rays: 0, shadows: 256, load: 0 });
        check(Message::Rays { rays: 0, shadows: 0, load: 0 });
        check(Message::Took { taken: true, load: 0 });
        check(Message::Partials { count: 409 });
        check(Message::Part { page: 0, offset: 0, bytes: 0 });
        check(Message::Part { page: 0, offset: 65_535, bytes: 16_384 });
        assert_eq!(decode(&[]), Err(WireError::Head));
        assert_eq!(decode(&[200]), Err(WireError::Head));
        assert_eq!(decode(&[LATER]), Err(WireError::Head));
        assert_eq!(decode(&[LATER, 1]), Err(WireError::Head));
        assert_eq!(decode(&[LATER, 0, 8]), Err(WireError::Head), "the first has no number");
        assert_eq!(decode(&[LATER, 1, LATER, 1, 8]), Err(WireError::Head), "a number is given once");
        assert_eq!(decode(&[LATER, 0xff, 0xff, 4, 8]), Err(WireError::Head), "a number of 17 bits");
    }

    #[test]
    fn halves_share_the_samples_and_the_pixel() {
        for samples in 0..70 {
            let [all, even, odd] = [0, 1, 2].map(|half| Frame { samples, half, ..FRAME });
            assert_eq!(all.drawn().count(), usize::from(samples));
            for half in [all, even, odd] {
                assert_eq!(half.drawn().count(), usize::from(half.drawn_samples()), "{samples}");
            }
            assert!(even.drawn().all(|sample| !odd.drawn().any(|other| other == sample)));
            assert_eq!(even.drawn_samples() + odd.drawn_samples(), samples);
            assert!(even.drawn_samples().abs_diff(odd.drawn_samples()) <= 1);
            // In each half as many of either half of the pixel: the lowest bit says which, and above it quarters.
            for half in [even, odd].iter().filter(|_| samples % 8 == 0) {
                for bit in [1, 2] {
                    assert_eq!(half.drawn().filter(|sample| sample & bit == 0).count(), usize::from(samples) / 4);
                }
            }
        }
    }

    /// The examples of docs/WIRE.md.
    #[test]
    fn heads_are_as_the_specification_has_them() {
        let check = |message: Message, expected: &[u8]| {
            let mut room = [0; MESSAGE_BYTES_MAX];
            let used = encode(0, &message, &mut room, |_| {}).unwrap();
            assert_eq!(&room[..expected.len()], expected, "{message:?}");
            assert_eq!(used, expected.len() + message.body_bytes(), "{message:?}");
            let used = encode(300, &message, &mut room, |_| {}).unwrap();
            assert_eq!((&room[..3], &room[3..3 + expected.len()]), (&[0x7f, 0xac, 2][..], expected), "{message:?}");
            assert_eq!(used, 3 + expected.len() + message.body_bytes(), "{message:?}");
        };
        let scene = 0x0123_4567_89ab_cdef;
        check(Message::Hello { version: 5, scene }, &[0, 5, 0xef, 0x9b, 0xaf, 0xcd, 0xf8, 0xac, 0xd1, 0x91, 1]);
        check(Message::Tiles { first: 1172, count: 300, epoch: 0 }, &[2, 0x94, 9, 0xac, 2, 0]);
        check(Message::Rays { rays: 100, shadows: 3, load: 300 }, &[9, 100, 3, 0xac, 2]);
        check(Message::Took { taken: true, load: 0 }, &[10, 1, 0]);
        check(Message::Kept { first: 1172, count: 300 }, &[17, 0x94, 9, 0xac, 2]);
        check(Message::Partials { count: 409 }, &[11, 0x99, 3]);
        check(Message::Fetch { page: 1172 }, &[12, 0x94, 9]);
        check(Message::Part { page: 1172, offset: 4096, bytes: 4096 }, &[13, 0x94, 9, 0x80, 0x20, 0x80, 0x20]);
        check(Message::Clip { first: 1172, count: 4 }, &[18, 0x94, 9, 4]);
        check(Message::Cliplist { first: 1172, pages: 3 }, &[19, 0x94, 9, 3]);
        let body = |message: Message| message.body_bytes();
        assert_eq!(body(Message::Rays { rays: 100, shadows: 3, load: 300 }), 8992);
        assert_eq!(body(Message::Partials { count: 409 }), 16_360);
    }

    /// Bodies that are too long are refused, though they be as long as their heads say.
    #[test]
    fn bodies_have_an_end() {
        let check = |message: Message, taken: bool| {
            let mut room = [0; 96 * 1024];
            let bytes = message.body_bytes();
            let head = postcard::to_slice(&message, &mut room).unwrap().len();
            let decoded = decode(&room[..(head + bytes).min(96 * 1024)]);
            match taken {
                true => assert_eq!(decoded.map(|view| view.body.len()), Ok(bytes), "{message:?}"),
                false => assert_eq!(decoded, Err(WireError::Head), "{message:?}"),
            }
            // With another body it is none in any case.
            assert!(decode(&room[..head + (bytes / 2).min(1000)]).is_err(), "{message:?}");
        };
        check(Message::Rays { rays: 186, shadows: 0, load: 0 }, true);
        check(Message::Rays { rays: 187, shadows: 0, load: 0 }, false);
        check(Message::Rays { rays: 186, shadows: 1, load: 0 }, false);
        check(Message::Rays { rays: 0, shadows: 256, load: 0 }, true);
        check(Message::Rays { rays: 0, shadows: 257, load: 0 }, false);
        check(Message::Rays { rays: u16::MAX, shadows: 1, load: 0 }, false);
        check(Message::Partials { count: 409 }, true);
        check(Message::Partials { count: 410 }, false);
        check(Message::Partials { count: u16::MAX }, false);
        check(Message::Part { page: 0, offset: 0, bytes: 16_384 }, true);
        check(Message::Part { page: 0, offset: 0, bytes: 16_385 }, false);
        check(Message::Part { page: 0, offset: 0, bytes: u16::MAX }, false);
        let tile = |width, height| Message::Contributions { tile: 0, epoch: 0, width, height, rays: 0, entry: 0 };
        check(tile(8, 8), true);
        check(tile(9, 8), false);
        check(tile(255, 255), false);
        check(Message::Cliplist { first: 0, pages: 8 }, true);
        check(Message::Cliplist { first: 0, pages: 9 }, false);
        check(Message::Cliplist { first: 0, pages: 255 }, false);
    }

    /// Messages with bodies, of which bits are changed, or the end is cut off or drawn out.
    #[test]
    fn mutated_messages_are_refused_calmly() {
        let mut state = 7u64;
        let mut next = |end: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % end
        };
        let (mut taken, mut refused) = (0, 0);
        for _ in 0..40_000 {
            let small = next(4) as u16;
            let message = match next(7) {
                0 => Message::Rays { rays: small, shadows: next(4) as u16, load: next(65_536) as u16 },
                1 => Message::Partials { count: small },
                2 => Message::Part { page: next(1 << 32) as u32, offset: next(70_000) as u32, bytes: 100 * small },
                3 => Message::Took { taken: small > 1, load: small },
                4 => Message::Fetch { page: next(1 << 32) as u32 },
                5 => Message::Cliplist { first: next(1 << 32) as u32, pages: small as u8 },
                _ => {
                    Message::Contributions { tile: 1, epoch: 0, width: small as u8, height: 8, rays: 9, entry: 1 << 60 }
                }
            };
            let mut room = [0; 2048];
            let mut used = encode(0, &message, &mut room, |body| body.fill(0x80)).unwrap();
            match next(4) {
                0 => used = next(used as u64 + 1) as usize,
                1 => used += next(9) as usize,
                _ => (0..=next(3)).for_each(|_| room[next(used.min(16) as u64) as usize] ^= 1 << next(8)),
            }
            match decode(&room[..used]) {
                Ok(view) => {
                    assert_eq!(view.body.len(), view.message.body_bytes());
                    taken += 1;
                }
                Err(_) => refused += 1,
            }
        }
        assert!(taken > 1000 && refused > 1000, "some of each: {taken} taken, {refused} refused");
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
            bytes[0] %= 21;
            taken += u32::from(decode(&bytes[..(round % 49) as usize]).is_ok());
        }
        assert!(taken > 100, "some noise is a message: {taken}");
    }
}
