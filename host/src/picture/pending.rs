//! A file that appears whole or not at all.
//!
//! What is written goes to a temporary file in the same folder, which takes the target's name in one step at the end.
//! Something that is not a regular file (a pipe, a device) cannot be replaced so and is written directly.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// A file on its way. Dropped without [`Pending::commit`], it leaves nothing behind.
#[derive(Debug)]
pub(crate) struct Pending {
    /// `None` only while a commit closes it.
    file: Option<File>,
    /// `None` when the target is written directly.
    temporary: Option<PathBuf>,
    target: PathBuf,
}

impl Pending {
    /// Makes the temporary file for `path`, and so finds out that there can be one: that the folder exists and may be
    /// written, and that a file which is there already is a file and may be written.
    ///
    /// # Errors
    /// What the system says of any of these.
    pub(crate) fn create(path: &Path) -> io::Result<Self> {
        if path.file_name().is_none() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let present = match fs::metadata(path) {
            Ok(metadata) => Some(metadata),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        let mut target = path.to_owned();
        if let Some(metadata) = &present {
            if metadata.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            // A file that is there and write-protected stays as it is, though its folder would let us replace it.
            let file = OpenOptions::new().write(true).open(path)?;
            if !metadata.is_file() {
                return Ok(Self { file: Some(file), temporary: None, target });
            }
            // A link keeps pointing where it points: what it points to is replaced.
            target = fs::canonicalize(path)?;
        }
        let (file, temporary) = create_beside(&target)?;
        let pending = Self { file: Some(file), temporary: Some(temporary), target };
        if let (Some(metadata), Some(file)) = (present, &pending.file) {
            file.set_permissions(metadata.permissions())?;
        }
        Ok(pending)
    }

    /// The file to write to.
    ///
    /// # Errors
    /// None until it is committed.
    pub(crate) fn file(&mut self) -> io::Result<&mut File> {
        self.file.as_mut().ok_or_else(|| io::ErrorKind::BrokenPipe.into())
    }

    /// Puts the file in place, after its bytes are on the disk.
    ///
    /// # Errors
    /// What the system says; the target is then as it was.
    pub(crate) fn commit(mut self) -> io::Result<()> {
        let Some(temporary) = &self.temporary else {
            return Ok(());
        };
        if let Some(file) = self.file.take() {
            file.sync_all()?;
        }
        fs::rename(temporary, &self.target)?;
        self.temporary = None;
        Ok(())
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        self.file = None;
        if let Some(temporary) = &self.temporary {
            // Nobody is left to hear of a failure, and a stray temporary file harms nothing.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// A new file in the folder of `target`. Its name does not contain the target's, which may be as long as a name can be.
fn create_beside(target: &Path) -> io::Result<(File, PathBuf)> {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let folder = match target.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    // Another process of this number on another machine may share the folder, hence a few attempts.
    let mut last = io::ErrorKind::AlreadyExists.into();
    for _ in 0..64 {
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!(".hybray-{}-{number}.tmp", std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => return Ok((file, path)),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => last = error,
            Err(error) => return Err(error),
        }
    }
    Err(last)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::io::Write;

    /// A folder of its own for a test, removed at the end.
    pub(crate) struct Scratch(pub PathBuf);

    impl Scratch {
        pub(crate) fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("hybray-{name}-{}", std::process::id()));
            let _ = fs::remove_dir_all(&path);
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        pub(crate) fn names(&self) -> Vec<String> {
            let mut names: Vec<String> =
                fs::read_dir(&self.0).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        }
    }

    impl Drop for Scratch {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn committed_or_not_at_all() {
        let scratch = Scratch::new("pending");
        let path = scratch.0.join("a.txt");

        let mut pending = Pending::create(&path).unwrap();
        pending.file().unwrap().write_all(b"half").unwrap();
        assert!(!path.exists());
        assert_eq!(scratch.names().len(), 1);
        drop(pending);
        assert!(scratch.names().is_empty());

        let mut pending = Pending::create(&path).unwrap();
        pending.file().unwrap().write_all(b"first").unwrap();
        pending.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"first");

        let mut pending = Pending::create(&path).unwrap();
        pending.file().unwrap().write_all(b"2").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"first");
        pending.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"2");
        assert_eq!(scratch.names(), ["a.txt"]);
    }

    #[test]
    fn two_at_once_do_not_meet() {
        let scratch = Scratch::new("pending-two");
        let (a, b) = (scratch.0.join("a"), scratch.0.join("b"));
        let (first, second) = (Pending::create(&a).unwrap(), Pending::create(&b).unwrap());
        assert_eq!(scratch.names().len(), 2);
        first.commit().unwrap();
        second.commit().unwrap();
        assert_eq!(scratch.names(), ["a", "b"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let scratch = Scratch::new("pending-link");
        let (file, link) = (scratch.0.join("file"), scratch.0.join("link"));
        fs::write(&file, b"old").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o604)).unwrap();
        symlink("file", &link).unwrap();
        let mut pending = Pending::create(&link).unwrap();
        pending.file().unwrap().write_all(b"new").unwrap();
        pending.commit().unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o604);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_not_replaced() {
        let null = Path::new("/dev/null");
        let mut pending = Pending::create(null).unwrap();
        pending.file().unwrap().write_all(b"gone").unwrap();
        pending.commit().unwrap();
        assert!(!fs::metadata(null).unwrap().is_file());
    }
}
