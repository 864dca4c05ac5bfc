//! The film beside a picture that is being drawn: what there was, and what is kept of it.

use super::show::Show;
use crate::film::{FilmFileError, Kept, Save, Subject};
use hybray_native::Watch;
use hybray_scheduler::{Film, Outcome, Progress};
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Shows how far a picture is, puts into its film what was kept of it, and keeps what is finished.
pub(super) struct Keeper<'a> {
    pub show: &'a mut Show,
    pub interrupted: &'a AtomicBool,
    /// Where the film is kept, if anywhere.
    pub path: Option<&'a Path>,
    /// What it is of; asked for when it is first needed.
    pub subject: &'a dyn Fn() -> Subject,
    /// How often it is kept; never if zero.
    pub every: Duration,
    /// What was kept of it.
    pub kept: Option<Kept>,
    pub state: State,
}

/// How it goes.
#[derive(Default)]
pub(super) struct State {
    /// Tiles that were there.
    pub there: u32,
    /// What is wrong with the film that there was.
    pub broken: Option<FilmFileError>,
    /// Why it could not be kept.
    pub trouble: Option<io::Error>,
    /// Tiles in the film's file, if that is of this picture.
    pub in_file: Option<u32>,
    /// When it is to be kept next.
    next: Option<Instant>,
    /// It is being written.
    save: Option<(Save, u32)>,
}

impl State {
    /// Takes in how the writing of so many tiles ended.
    fn saved(&mut self, tiles: u32, result: io::Result<()>) {
        match result {
            Ok(()) => (self.in_file, self.trouble) = (Some(tiles), None),
            Err(error) => self.trouble = Some(error),
        }
    }
}

impl Keeper<'_> {
    /// Begins, or goes on, to write the film, if it is time for that.
    fn save(&mut self, film: &Film<'_>) {
        let (Some(path), false) = (self.path, self.every.is_zero()) else { return };
        if let Some((save, tiles)) = &mut self.state.save {
            if save.go_on(film) {
                let tiles = *tiles;
                let result = self.state.save.take().map_or(Ok(()), |(save, _)| save.finish(film));
                self.state.saved(tiles, result);
                self.state.next = Instant::now().checked_add(self.every);
            }
        } else if self.state.next.is_some_and(|next| Instant::now() >= next) {
            self.state.next = Instant::now().checked_add(self.every);
            if self.is_new(film) {
                match Save::begin(path, &(self.subject)(), film) {
                    Ok(save) => self.state.save = Some((save, film.finished())),
                    Err(error) => self.state.trouble = Some(error),
                }
            }
        }
    }

    /// Whether the film has tiles that the file has not.
    fn is_new(&self, film: &Film<'_>) -> bool {
        film.finished() > self.state.in_file.unwrap_or(0)
    }
}

impl Watch for Keeper<'_> {
    fn begin(&mut self, film: &mut Film<'_>) -> bool {
        if let Some(kept) = self.kept.take() {
            (self.state.there, self.state.in_file) = (kept.tiles(), Some(kept.tiles()));
            self.state.broken = kept.load(film).err();
        }
        self.state.next = Instant::now().checked_add(self.every);
        self.show.begin(self.state.there, film.map().len());
        self.state.broken.is_none()
    }

    fn look(&mut self, progress: Progress, film: &Film<'_>) -> bool {
        self.show.progress(progress);
        if self.state.broken.is_none() {
            self.save(film);
        }
        !self.interrupted.load(Ordering::Relaxed)
    }

    fn end(&mut self, outcome: Outcome, film: &Film<'_>) {
        // What is on its way to the file is finished first, or given up: one writes at a time.
        if let Some((save, tiles)) = self.state.save.take() {
            if outcome != Outcome::Finished {
                self.state.saved(tiles, save.finish(film));
            } else if save.give_up().is_ok() {
                self.state.in_file = Some(tiles);
            }
        }
        if outcome != Outcome::Finished
            && self.state.broken.is_none()
            && self.is_new(film)
            && let Some(path) = self.path
        {
            let result = Save::begin(path, &(self.subject)(), film).and_then(|save| save.finish(film));
            self.state.saved(film.finished(), result);
        }
        self.show.end();
    }
}
