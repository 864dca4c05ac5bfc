//! Where a picture goes, opened before there is one.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::pending::Pending;
use super::{Channel, Format, Picture, PictureError, encode, layers};

/// A place for a picture. Dropped without [`Output::write`], it leaves nothing behind.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    format: Format,
    /// `None` is standard output.
    pending: Option<Pending>,
}

impl Output {
    /// Opens the place for a picture, to be called before any rendering. A file is written beside its final place and
    /// moved there at the end; a file that is there stays as it is until then. The path `-` is standard output.
    ///
    /// # Errors
    /// [`PictureError::Create`] if the folder is missing or may not be written, or the path is a folder or a
    /// write-protected file.
    pub fn create(path: &Path, format: Format) -> Result<Self, PictureError> {
        let pending = if path == Path::new("-") {
            None
        } else {
            Some(Pending::create(path).map_err(|source| PictureError::Create { path: path.to_owned(), source })?)
        };
        Ok(Self { path: path.to_owned(), format, pending })
    }

    /// Encodes the picture and puts the file in place, after its bytes are on the disk.
    ///
    /// `exposure` multiplies every value before it is encoded; EXR holds the radiance as it is.
    ///
    /// # Errors
    /// [`PictureError::Size`] if the picture is empty or its values do not match its sides, [`PictureError::Write`] if
    /// the disk is full or the pipe closed. A file that was there is then as it was.
    pub fn write(self, picture: &Picture, exposure: f32) -> Result<(), PictureError> {
        self.write_with(picture, exposure, &[])
    }

    /// The same with more `channels`, which EXR has and other formats leave out.
    ///
    /// # Errors
    /// As [`Output::write`]; a channel has as many values as the picture has pixels.
    pub fn write_with(self, picture: &Picture, exposure: f32, channels: &[Channel]) -> Result<(), PictureError> {
        picture.check()?;
        let pixels = picture.rgb.len() / 3;
        if let Some(channel) = channels.iter().find(|channel| channel.values.len() != pixels) {
            let (width, height) = (picture.width, picture.height);
            return Err(PictureError::Size { width, height, values: channel.values.len() });
        }
        let Self { path, format, pending } = self;
        let result = match pending {
            Some(pending) => write_file(pending, picture, exposure, format, channels),
            None => write_standard_output(picture, exposure, format),
        };
        result.map_err(|source| PictureError::Write { path, source })
    }
}

fn write_file(
    mut pending: Pending,
    picture: &Picture,
    exposure: f32,
    format: Format,
    channels: &[Channel],
) -> io::Result<()> {
    let mut writer = BufWriter::new(pending.file()?);
    if format == Format::Exr && !channels.is_empty() {
        let mut bytes = io::Cursor::new(Vec::new());
        layers::exr(picture, channels, &mut bytes)?;
        writer.write_all(bytes.get_ref())?;
    } else {
        encode::stream(picture, exposure, format, &mut writer)?;
    }
    writer.flush()?;
    drop(writer);
    pending.commit()
}

fn write_standard_output(picture: &Picture, exposure: f32, format: Format) -> io::Result<()> {
    let mut writer = BufWriter::new(io::stdout().lock());
    encode::stream(picture, exposure, format, &mut writer)?;
    writer.flush()
}

#[cfg(test)]
mod tests {
    use super::super::pending::tests::Scratch;
    use super::*;
    use std::fs;

    fn picture() -> Picture {
        Picture { width: 2, height: 2, rgb: vec![0.5; 12] }
    }

    #[test]
    fn a_file_appears_only_when_it_is_whole() {
        let scratch = Scratch::new("output");
        for (name, start) in [("a.png", &b"\x89PNG"[..]), ("a.exr", b"\x76\x2f\x31\x01"), ("a.ppm", b"P6\n")] {
            let path = scratch.0.join(name);
            let format = Format::of(&path, false).unwrap();
            let output = Output::create(&path, format).unwrap();
            assert!(!path.exists(), "{name}");
            output.write(&picture(), 1.0).unwrap();
            assert!(fs::read(&path).unwrap().starts_with(start), "{name}");
        }
        assert_eq!(scratch.names(), ["a.exr", "a.png", "a.ppm"]);
    }

    #[test]
    fn what_goes_wrong_leaves_the_old_file() {
        let scratch = Scratch::new("output-old");
        let path = scratch.0.join("a.ppm");
        fs::write(&path, b"old").unwrap();
        drop(Output::create(&path, Format::Ppm).unwrap());
        let empty = Picture::default();
        let error = Output::create(&path, Format::Ppm).unwrap().write(&empty, 1.0);
        assert!(matches!(error, Err(PictureError::Size { .. })));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(scratch.names(), ["a.ppm"]);
    }

    #[test]
    fn bad_places_are_told_before_any_work() {
        let scratch = Scratch::new("output-bad");
        fs::create_dir(scratch.0.join("folder.png")).unwrap();
        fs::write(scratch.0.join("file"), b"").unwrap();
        fn check(path: &Path, expected: io::ErrorKind) {
            match Output::create(path, Format::Png8) {
                Err(PictureError::Create { source, path: told }) => {
                    assert_eq!((source.kind(), told.as_path()), (expected, path))
                }
                other => panic!("{path:?}: {other:?}"),
            }
        }
        check(&scratch.0.join("folder.png"), io::ErrorKind::IsADirectory);
        check(&scratch.0.join("missing/a.png"), io::ErrorKind::NotFound);
        check(&scratch.0.join("file/a.png"), io::ErrorKind::NotADirectory);
        check(Path::new(".."), io::ErrorKind::IsADirectory);
        check(Path::new(""), io::ErrorKind::IsADirectory);
        assert_eq!(scratch.names(), ["file", "folder.png"]);
    }

    #[cfg(unix)]
    #[test]
    fn write_protected_places_are_told_before_any_work() {
        use std::os::unix::fs::PermissionsExt;
        let scratch = Scratch::new("output-protected");
        let (folder, file) = (scratch.0.join("folder"), scratch.0.join("file.png"));
        fs::create_dir(&folder).unwrap();
        fs::write(&file, b"old").unwrap();
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o555)).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o444)).unwrap();
        if fs::write(folder.join("probe"), b"").is_ok() {
            eprintln!("skipped: this user may write to write-protected folders");
            return;
        }
        for path in [folder.join("a.png"), file] {
            let error = Output::create(&path, Format::Png8);
            assert!(matches!(error, Err(PictureError::Create { source, .. })
                if source.kind() == io::ErrorKind::PermissionDenied));
        }
        fs::set_permissions(&folder, fs::Permissions::from_mode(0o755)).unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error() {
        let output = Output::create(Path::new("/dev/full"), Format::Ppm).unwrap();
        assert!(matches!(output.write(&picture(), 1.0), Err(PictureError::Write { .. })));
    }
}
