//! Progress for a person: a bar on a terminal, plain lines otherwise.

use hybray_scheduler::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Shows how far a picture is.
pub(super) struct Show {
    form: Form,
    start: Instant,
    next: Duration,
    /// Tiles that were there when the tracing began.
    there: u32,
}

enum Form {
    Quiet,
    Bar(ProgressBar),
    Lines,
}

/// Between two looks at a bar, and between two lines.
const BAR: Duration = Duration::from_millis(100);
const LINES: Duration = Duration::from_secs(5);

impl Show {
    pub fn new(quiet: bool) -> Self {
        let form = if quiet {
            Form::Quiet
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::new(0);
            let style = ProgressStyle::with_template("{bar:30} {percent:>3} %  {msg}  {eta} left");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            Form::Bar(bar)
        } else {
            Form::Lines
        };
        Self { form, start: Instant::now(), next: Duration::ZERO, there: 0 }
    }

    /// Says something that stays.
    pub fn line(&self, text: &str) {
        match &self.form {
            Form::Quiet => {}
            Form::Bar(bar) => bar.suspend(|| eprintln!("{text}")),
            Form::Lines => eprintln!("{text}"),
        }
    }

    /// The clock of the tracing starts now; `there` of `tiles` are finished already.
    pub fn begin(&mut self, there: u32, tiles: u32) {
        (self.start, self.there) = (Instant::now(), there);
        if let Form::Bar(bar) = &self.form {
            bar.update(|state| {
                state.set_len(u64::from(tiles));
                state.set_pos(u64::from(there));
            });
            bar.reset_eta();
        }
        self.next = if matches!(self.form, Form::Lines) { LINES } else { BAR };
    }

    /// Shows how far it is, now and then.
    pub fn progress(&mut self, progress: Progress) {
        let elapsed = self.start.elapsed();
        if elapsed < self.next {
            return;
        }
        let rate = rays_per_second(progress.rays, elapsed);
        match &self.form {
            Form::Quiet => {}
            Form::Bar(bar) => {
                bar.set_length(u64::from(progress.tiles));
                bar.set_position(u64::from(progress.finished));
                bar.set_message(rate);
                self.next = elapsed + BAR;
            }
            Form::Lines => {
                let done = f64::from(progress.finished) / f64::from(progress.tiles.max(1));
                let new = f64::from(progress.finished - self.there.min(progress.finished));
                let missing = f64::from(progress.tiles - progress.finished);
                let left = if new > 0.0 { elapsed.as_secs_f64() * missing / new } else { f64::INFINITY };
                eprintln!("{:3.0} %, {rate}, {left:.0} s left", 100.0 * done);
                self.next = elapsed + LINES;
            }
        }
    }

    pub fn end(&self) {
        if let Form::Bar(bar) = &self.form {
            bar.finish_and_clear();
        }
    }
}

/// `3.21 Mrays/s`
pub(super) fn rays_per_second(rays: u64, time: Duration) -> String {
    format!("{:.2} Mrays/s", rays as f64 * 1e-6 / time.as_secs_f64().max(1e-9))
}
