//! Writing a film file beside a picture that is being drawn.
//!
//! A finished tile does not change any more. So the tiles that were finished when the writing began are copied out in
//! pieces, whenever there is time, and are the same film as if they had been copied at once; a thread brings the pieces
//! to the disk.

use super::header::{FileHeader, Subject};
use super::{HASH_BYTES, PIXEL_BYTES, tiles_of, words_for};
use crate::build::hash_bytes;
use crate::picture::pending::Pending;
use hybray_scheduler::Film;
use std::io::{self, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};

/// Bytes that are copied at a time, and a tile more.
const PIECE_BYTES: usize = 1 << 20;
/// Pieces between film and disk.
const PIECES: usize = 2;

enum Piece {
    More(Vec<u8>),
    Last(Vec<u8>),
}

/// A film on its way to its file, which appears whole or not at all. Dropped before it is through, it leaves nothing behind,
/// and what was there stays.
pub struct Save {
    /// Tiles that are to be written.
    tiles: std::vec::IntoIter<u32>,
    hash: u64,
    /// What the thread had no room for.
    ready: Option<Piece>,
    /// `None` when all has been handed over.
    to: Option<SyncSender<Piece>>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

impl Save {
    /// Begins to write the tiles of `film` that are finished now to `path`.
    ///
    /// # Errors
    /// What the system says of the place.
    pub fn begin(path: &Path, subject: &Subject, film: &Film<'_>) -> io::Result<Self> {
        let map = film.map();
        let mut bits = vec![0u64; words_for(map.len())];
        let finished = (0..map.len()).filter(|&tile| film.tile_is_finished(tile));
        finished.for_each(|tile| bits[tile as usize / 64] |= 1 << (tile % 64));
        let tiles: Vec<u32> = tiles_of(&bits).collect();
        let pixels: usize = tiles.iter().map(|&tile| map.tile(tile).pixels()).sum();
        let mut header = FileHeader { kept: tiles.len() as u32, ..FileHeader::of(subject) };
        header.file_bytes =
            (size_of::<FileHeader>() + size_of_val(&bits[..]) + pixels * PIXEL_BYTES + HASH_BYTES) as u64;

        let pending = Pending::create(path)?;
        let (to, from) = sync_channel(PIECES);
        let thread = thread::Builder::new().name("film".to_owned()).spawn(move || write(pending, &from))?;
        let first = [bytemuck::bytes_of(&header), bytemuck::cast_slice(&bits)];
        let hash = hash_bytes(header.hash(), first[1]);
        let ready = Some(Piece::More(first.concat()));
        Ok(Self { tiles: tiles.into_iter(), hash, ready, to: Some(to), thread: Some(thread) })
    }

    /// Copies a piece, if there is room for one; whether the file is written, or cannot be. Bounded, and waits for nothing.
    pub fn go_on(&mut self, film: &Film<'_>) -> bool {
        let Some(to) = self.to.take() else { return self.thread.as_ref().is_none_or(JoinHandle::is_finished) };
        let piece = self.next(film);
        let last = matches!(piece, Piece::Last(_));
        match to.try_send(piece) {
            Ok(()) if last => {}
            Ok(()) => self.to = Some(to),
            Err(TrySendError::Full(piece)) => (self.to, self.ready) = (Some(to), Some(piece)),
            // The thread has met with an error.
            Err(TrySendError::Disconnected(_)) => {}
        }
        false
    }

    /// Writes what is left, and waits for it.
    ///
    /// # Errors
    /// What the system says; what was there is as it was.
    pub fn finish(mut self, film: &Film<'_>) -> io::Result<()> {
        while let Some(to) = self.to.take() {
            let piece = self.next(film);
            let last = matches!(piece, Piece::Last(_));
            if to.send(piece).is_ok() && !last {
                self.to = Some(to);
            }
        }
        self.join()
    }

    /// Gives it up, unless everything has been handed over.
    ///
    /// # Errors
    /// If nothing was written: what was there is as it was.
    pub fn give_up(mut self) -> io::Result<()> {
        self.to = None;
        self.join()
    }

    fn next(&mut self, film: &Film<'_>) -> Piece {
        if let Some(piece) = self.ready.take() {
            return piece;
        }
        let mut bytes = Vec::with_capacity(PIECE_BYTES.min(self.tiles.len() * 64 * PIXEL_BYTES) + 64 * PIXEL_BYTES);
        while bytes.len() < PIECE_BYTES {
            let Some(tile) = self.tiles.next() else {
                bytes.extend(self.hash.to_le_bytes());
                return Piece::Last(bytes);
            };
            let start = bytes.len();
            film.tile_sums(tile).flatten().for_each(|sum| bytes.extend(sum.to_le_bytes()));
            self.hash = hash_bytes(self.hash, &bytes[start..]);
        }
        Piece::More(bytes)
    }

    fn join(&mut self) -> io::Result<()> {
        let result = self.thread.take().map(JoinHandle::join);
        result.unwrap_or(Ok(Ok(()))).unwrap_or_else(|_| Err(io::Error::other("the thread that writes it panicked")))
    }
}

impl Drop for Save {
    fn drop(&mut self) {
        self.to = None;
        // Whoever wanted to know has called `finish`.
        let _ = self.join();
    }
}

fn write(mut pending: Pending, from: &Receiver<Piece>) -> io::Result<()> {
    for piece in from {
        match piece {
            Piece::More(bytes) => pending.file()?.write_all(&bytes)?,
            Piece::Last(bytes) => {
                pending.file()?.write_all(&bytes)?;
                return pending.commit();
            }
        }
    }
    Err(io::ErrorKind::Interrupted.into())
}
