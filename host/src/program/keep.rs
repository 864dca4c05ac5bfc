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
    /// It is kept when it is finished, too: others follow.
    pub stays: bool,
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
            if outcome != Outcome::Finished || self.stays {
                self.state.saved(tiles, save.finish(film));
            } else if save.give_up().is_ok() {
                self.state.in_file = Some(tiles);
            }
        }
        if (outcome != Outcome::Finished || self.stays)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::pending::tests::Scratch;
    use hybray_scheduler::TileState;
    use hybray_wire::Frame;

    /// A picture of two tiles, of which one is finished.
    fn ended(outcome: Outcome, every: Duration, stays: bool, folder: &Scratch, path: &str) -> State {
        let frame = Frame {
            width: 16,
            height: 8,
            samples: 1,
            depth_max: 1,
            filter: 0,
            seed: 0,
            weight_cutoff: 0.0,
            step_log2: 0,
            eye: [0.0; 3],
            target: [0.0; 3],
            up: [0.0; 3],
            fov_y_degrees: 1.0,
            hither: 0.0,
            layer: 0,
            half: 0,
            optics: hybray_wire::Optics::PINHOLE,
        };
        let (mut sums, mut tiles) = ([[0; 3]; 128], [TileState::default(); 2]);
        let mut film = Film::new(&frame, &mut sums, &mut tiles).unwrap();
        let mut keeper = Keeper {
            show: &mut Show::new(true),
            interrupted: &AtomicBool::new(false),
            path: Some(&folder.0.join(path)),
            subject: &|| Subject { scene: 1, frame },
            every,
            kept: None,
            stays,
            state: State::default(),
        };
        assert!(keeper.begin(&mut film));
        film.keep(1, &[1; 64 * 24]).unwrap();
        assert!(keeper.look(Progress::default(), &film));
        keeper.end(outcome, &film);
        keeper.state
    }

    #[test]
    fn what_ends_early_is_kept_however_it_ends() {
        let folder = Scratch::new("keep");
        let hour = Duration::from_secs(3600);
        for outcome in [Outcome::Stopped, Outcome::Abandoned, Outcome::Missing { page: 1 }] {
            let state = ended(outcome, hour, false, &folder, "film");
            assert_eq!((state.in_file, folder.names()), (Some(1), vec!["film".to_owned()]), "{outcome:?}");
            std::fs::remove_file(folder.0.join("film")).unwrap();
        }
        assert_eq!(ended(Outcome::Stopped, Duration::ZERO, false, &folder, "film").in_file, Some(1));
        std::fs::remove_file(folder.0.join("film")).unwrap();
        assert_eq!(ended(Outcome::Finished, hour, false, &folder, "film").in_file, None);
        assert_eq!(ended(Outcome::Finished, hour, true, &folder, "film").in_file, Some(1), "others follow");
        std::fs::remove_file(folder.0.join("film")).unwrap();
        let state = ended(Outcome::Abandoned, hour, false, &folder, "missing/film");
        assert!(state.in_file.is_none() && state.trouble.is_some());
        assert!(folder.names().is_empty());
    }
}
