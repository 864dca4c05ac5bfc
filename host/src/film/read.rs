//! Reading a film file.
//!
//! How long everything must be follows from the picture that is wanted, and not from the file: no room is asked for but
//! for that picture's bits.

use super::header::{FileHeader, Subject};
use super::{HASH_BYTES, PIXEL_BYTES, tiles_of, words_for};
use crate::build::hash_bytes;
use hybray_scheduler::Film;
use hybray_wire::{TILE, TileMap};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// Why a film cannot be gone on with, as one line for a person.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {problem}; {remedy}")]
pub struct FilmFileError {
    file: String,
    problem: String,
    remedy: &'static str,
}

/// What is wrong, and what to do.
pub(super) type Complaint = (String, &'static str);

const AFRESH: &str = "render without --resume, which begins from the start";

fn broken(problem: impl Into<String>) -> Complaint {
    (problem.into(), AFRESH)
}

fn unreadable(error: &io::Error) -> Complaint {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => broken("it is cut short"),
        _ => (format!("it cannot be read ({error})"), "check the file and its disk"),
    }
}

/// A film file whose beginning fits the picture: which tiles it has is known, their sums are still to be read.
pub struct Kept<R = BufReader<File>> {
    file: String,
    from: R,
    map: TileMap,
    bits: Vec<u64>,
    /// Of what has been read.
    hash: u64,
}

impl Kept {
    /// Opens the film at `path`; none if there is no such file.
    ///
    /// # Errors
    /// If it is broken, or of another picture than `wanted`: one line that names the file, what is wrong, and what to do.
    pub fn open(path: &Path, wanted: &Subject) -> Result<Option<Self>, FilmFileError> {
        let name = path.display().to_string();
        let error = |(problem, remedy)| FilmFileError { file: name.clone(), problem, remedy };
        let file = match File::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(error((format!("it cannot be opened ({e})"), "check its permissions"))),
        };
        let about = file.metadata().map_err(|e| error(unreadable(&e)))?;
        if !about.is_file() {
            return Err(error(("it is no regular file".to_owned(), "move it, or name another picture")));
        }
        let kept = Self::read(name.clone(), BufReader::new(file), about.len(), wanted);
        kept.map(Some).map_err(error)
    }
}

impl<R: Read> Kept<R> {
    pub(super) fn read(file: String, mut from: R, length: u64, wanted: &Subject) -> Result<Self, Complaint> {
        let mut header = FileHeader::of(wanted);
        let map = header.map().ok_or_else(|| broken("there is no picture"))?;
        let mut bits = vec![0u64; words_for(map.len())];
        let differences = {
            let mut told: FileHeader = bytemuck::Zeroable::zeroed();
            from.read_exact(bytemuck::bytes_of_mut(&mut told)).map_err(|e| unreadable(&e))?;
            told.check().map_err(broken)?;
            (header.file_bytes, header.kept) = (told.file_bytes, told.kept);
            told.differences(&header)
        };
        if !differences.is_empty() {
            let problem = format!("it is of another picture ({})", differences.join(", "));
            return Err((problem, "give the settings that it was begun with, or render without --resume"));
        }
        let bits_bytes = bytemuck::cast_slice_mut(&mut bits);
        from.read_exact(bits_bytes).map_err(|e| unreadable(&e))?;
        let hash = hash_bytes(header.hash(), bits_bytes);
        let (mut kept, mut bytes) = (0, (size_of::<FileHeader>() + bits_bytes.len() + HASH_BYTES) as u64);
        for tile in tiles_of(&bits) {
            if tile >= map.len() {
                return Err(broken("it has tiles that the picture has not"));
            }
            kept += 1;
            bytes += (map.tile(tile).pixels() * PIXEL_BYTES) as u64;
        }
        if (kept, bytes) != (header.kept, header.file_bytes) {
            return Err(broken("its header and its tiles contradict each other"));
        }
        if length != bytes {
            return Err(broken(format!("it has {length} bytes, and should have {bytes}")));
        }
        Ok(Self { file, from, map, bits, hash })
    }

    /// How many tiles it has.
    #[must_use]
    pub fn tiles(&self) -> u32 {
        self.bits.iter().map(|word| word.count_ones()).sum()
    }

    /// Puts its tiles into `film`, which is of the same picture.
    ///
    /// # Errors
    /// If the rest of the file is not what was written: the film is then good for nothing.
    pub fn load(mut self, film: &mut Film<'_>) -> Result<(), FilmFileError> {
        self.tiles_into(film).map_err(|(problem, remedy)| FilmFileError { file: self.file, problem, remedy })
    }

    pub(super) fn tiles_into(&mut self, film: &mut Film<'_>) -> Result<(), Complaint> {
        let mut room = [0; (TILE * TILE) as usize * PIXEL_BYTES];
        for tile in tiles_of(&self.bits) {
            let values = &mut room[..self.map.tile(tile).pixels() * PIXEL_BYTES];
            self.from.read_exact(values).map_err(|e| unreadable(&e))?;
            self.hash = hash_bytes(self.hash, values);
            film.keep(tile, values).map_err(|e| broken(e.to_string()))?;
        }
        let mut hash = [0; HASH_BYTES];
        self.from.read_exact(&mut hash).map_err(|e| unreadable(&e))?;
        if u64::from_le_bytes(hash) != self.hash {
            return Err(broken("its bytes are not those that were written (the hash differs)"));
        }
        Ok(())
    }
}
