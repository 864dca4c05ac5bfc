//! The pictures of one run: which there are, and what becomes of each film when it ends.
//!
//! A view is a camera, and a file that its picture goes to. It takes one picture, or several if layers are asked for: light,
//! whole or in two halves, and a picture for each layer that rays must find. They are drawn one after the other by the same
//! nodes.

use super::keep::{Keeper, State};
use super::layers::{Drawing, Part};
use super::show::Show;
use crate::film::{FilmFileError, Kept, Subject, path_for, path_for_part};
use crate::model::CameraSpec;
use crate::picture::{Format, Output, PictureError};
use hybray_native::Watch;
use hybray_scheduler::{Film, Outcome, Progress};
use hybray_wire::Frame;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A camera, and where its picture goes.
pub(super) struct View {
    /// Of the camera, if there may be several.
    pub name: Option<String>,
    pub path: PathBuf,
    pub format: Format,
    pub camera: CameraSpec,
}

impl View {
    /// The only one.
    pub fn one(path: &Path, format: Format, camera: &CameraSpec) -> Self {
        Self { name: None, path: path.to_owned(), format, camera: camera.clone() }
    }

    /// One of several: `out.png` becomes `out-NAME.png`.
    pub fn named(path: &Path, format: Format, camera: CameraSpec) -> Self {
        let part = |part: Option<&std::ffi::OsStr>| part.map(|p| p.to_string_lossy().into_owned()).unwrap_or_default();
        let (stem, extension) = (part(path.file_stem()), part(path.extension()));
        let path = path.with_file_name(format!("{stem}-{}.{extension}", camera.name));
        Self { name: Some(camera.name.clone()), path, format, camera }
    }
}

/// A picture that is drawn.
pub(super) struct Job {
    /// Of which view.
    pub view: usize,
    pub part: Part,
    pub frame: Frame,
    /// Where its film is kept, if anywhere.
    pub film: Option<PathBuf>,
    /// The view's last.
    last: bool,
}

impl Job {
    /// The pictures that a view takes.
    pub fn of(view: usize, at: &View, frame: Frame, parts: &[Part]) -> impl Iterator<Item = Self> {
        let count = parts.len();
        parts.iter().enumerate().map(move |(number, &part)| Self {
            view,
            part,
            frame: part.frame(frame),
            film: match part.name() {
                None => path_for(&at.path),
                Some(name) => path_for_part(&at.path, name),
            },
            last: number + 1 == count,
        })
    }
}

/// Looks after all of them.
pub(super) struct Views<'a> {
    pub show: &'a mut Show,
    pub interrupted: &'a AtomicBool,
    pub views: &'a [View],
    /// Where the picture goes, if it is one and its place is open.
    pub output: Option<Output>,
    pub jobs: &'a [Job],
    /// Hash of the scene, asked for when it is first needed.
    pub scene: &'a dyn Fn() -> u64,
    /// How often films are kept; never if zero.
    pub every: Duration,
    pub resume: bool,
    pub exposure: f32,
    /// The job in work.
    pub at: usize,
    pub state: State,
    pub kept: Option<Kept>,
    pub drawing: Drawing,
    /// What has become of those that have ended.
    pub ended: Vec<Ended>,
    /// Why a finished view's picture could not be written: there is no other then.
    pub unwritten: Option<PictureError>,
}

/// What is known of a job when it has ended.
pub(super) struct Ended {
    /// Tiles that were there.
    pub there: u32,
    /// Why its film could not be kept.
    pub trouble: Option<io::Error>,
    /// A film of it is at its place.
    pub in_file: bool,
    /// What is wrong with the film that there was.
    pub broken: Option<FilmFileError>,
    /// Film hash of the view's light, where that is whole now.
    pub light: Option<u64>,
}

impl<'a> Views<'a> {
    fn keeper<R>(&mut self, work: impl FnOnce(&mut Keeper<'_>) -> R) -> R {
        let job = &self.jobs[self.at];
        let scene = self.scene;
        let mut keeper = Keeper {
            show: &mut *self.show,
            interrupted: self.interrupted,
            path: job.film.as_deref(),
            subject: &|| Subject { scene: scene(), frame: job.frame },
            every: self.every,
            kept: self.kept.take(),
            // What has come of a run is kept until all of it is done.
            stays: self.at + 1 < self.jobs.len() && !self.every.is_zero(),
            state: std::mem::take(&mut self.state),
        };
        let result = work(&mut keeper);
        self.state = keeper.state;
        result
    }

    /// Opens what is kept of a picture; says so if nothing is, or is left alone.
    ///
    /// # Errors
    /// If it is of another picture, or broken.
    pub fn open(&self, job: &Job) -> Result<Option<Kept>, FilmFileError> {
        let Some(path) = job.film.as_deref() else { return Ok(None) };
        let name = path.display();
        if !self.resume {
            if path.exists() {
                let told = "has tiles of a picture that ended early: --resume would go on with it";
                self.show.line(&format!("{name} {told}"));
            }
            return Ok(None);
        }
        let kept = Kept::open(path, &Subject { scene: (self.scene)(), frame: job.frame })?;
        match &kept {
            Some(kept) => self.show.line(&format!("{name}: {} tiles are there", kept.tiles())),
            None => self.show.line(&format!("there is no {name}: the picture begins from the start")),
        }
        Ok(kept)
    }

    /// Films that are at their places, with the picture's part of each.
    pub fn films(&self) -> impl Iterator<Item = &Path> {
        self.ended.iter().zip(self.jobs).filter(|(ended, _)| ended.in_file).filter_map(|(_, job)| job.film.as_deref())
    }

    fn write(&mut self, view: &View) {
        let next = self.drawing.next();
        let drawing = std::mem::replace(&mut self.drawing, next);
        let output = self.output.take().map_or_else(|| Output::create(&view.path, view.format), Ok);
        let written = output.and_then(|output| output.write_with(&drawing.picture, self.exposure, &drawing.channels()));
        match written {
            Ok(()) if self.views.len() > 1 => self.show.line(&format!("{}", view.path.display())),
            Ok(()) => {}
            Err(error) => self.unwritten = Some(error),
        }
    }
}

impl Watch for Views<'_> {
    fn begin(&mut self, film: &mut Film<'_>) -> bool {
        self.state = State::default();
        if self.at > 0 {
            match self.open(&self.jobs[self.at]) {
                Ok(kept) => self.kept = kept,
                Err(error) => self.state.broken = Some(error),
            }
        }
        self.keeper(|keeper| keeper.begin(film)) && self.unwritten.is_none()
    }

    fn look(&mut self, progress: Progress, film: &Film<'_>) -> bool {
        self.keeper(|keeper| keeper.look(progress, film))
    }

    fn end(&mut self, outcome: Outcome, film: &Film<'_>) {
        let (jobs, views) = (self.jobs, self.views);
        let job = &jobs[self.at];
        self.keeper(|keeper| keeper.end(outcome, film));
        let state = &mut self.state;
        let broken = state.broken.take();
        let begun = film.finished() > 0 || self.at == 0 || job.view == jobs[self.at - 1].view;
        let good = broken.is_none() && self.unwritten.is_none();
        self.ended.push(Ended {
            there: state.there,
            trouble: state.trouble.take(),
            in_file: state.in_file.is_some(),
            broken,
            light: None,
        });
        if good && begun {
            let light = self.drawing.take(job.part, &job.frame, film);
            if let Some(ended) = self.ended.last_mut() {
                ended.light = light;
            }
            let goes_on = matches!(outcome, Outcome::Finished) && !job.last;
            let is_picture = matches!(outcome, Outcome::Finished | Outcome::Stopped);
            if is_picture && !goes_on {
                self.write(&views[job.view]);
            }
        }
        self.at += 1;
    }
}
