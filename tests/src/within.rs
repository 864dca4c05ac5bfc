//! Runs that must end.

use std::io::Write;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Does `work`. If it does not end in so many `seconds`, far beyond what it takes, the process does, and says what it was:
/// a test that hangs would hang the gate.
///
/// # Panics
/// If `work` does.
pub fn within<T>(seconds: u64, what: impl FnOnce() -> String, work: impl FnOnce() -> T) -> T {
    let (done, wait) = channel::<()>();
    let what = what();
    std::thread::spawn(move || {
        if wait.recv_timeout(Duration::from_secs(seconds)) == Err(RecvTimeoutError::Timeout) {
            // Not `eprintln`: what a test prints is kept until it ends.
            let _ = writeln!(std::io::stderr(), "not at its end after {seconds} s: {what}");
            std::process::exit(101);
        }
    });
    let result = work();
    drop(done);
    result
}
