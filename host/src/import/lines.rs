//! A text file line by line, in bounded memory: the ground of the OBJ, MTL and NFF importers.
//!
//! Line ends are LF or CRLF, a last line needs none, a byte order mark is dropped. Blank lines and lines that begin
//! with `#` are left out, whatever bytes they hold (comments are where old encodings hide); any other line must be
//! UTF-8 and at most `bytes_max` long.

use super::error::ImportError;
use std::io::{BufRead, Read};

/// A line longer than this (1 MiB) is refused: a polygon of the most corners that are allowed needs a quarter of it.
pub(crate) const LINE_BYTES_MAX: usize = 1 << 20;

/// See the module's page.
#[derive(Debug)]
pub(crate) struct Lines<R> {
    reader: R,
    file: String,
    /// Physical lines read.
    read: u64,
    /// Where the current line begins.
    first: u64,
    buffer: Vec<u8>,
    /// Whether a backslash at a line's end joins it to the next (OBJ, MTL).
    joins: bool,
    bytes_max: usize,
}

impl<R: BufRead> Lines<R> {
    /// `file` is its name in messages.
    pub(crate) fn new(reader: R, file: &str, joins: bool) -> Self {
        let (read, first, buffer) = (0, 0, Vec::new());
        Self { reader, file: file.to_owned(), read, first, buffer, joins, bytes_max: LINE_BYTES_MAX }
    }

    /// Name in messages.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// The line, from 1, where what [`Lines::next`] gave last begins.
    pub(crate) fn number(&self) -> u64 {
        self.first
    }

    /// An error about the current line.
    pub(crate) fn error(&self, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> ImportError {
        ImportError::at(&self.file, self.first, problem, remedy)
    }

    /// The next line that says something, without its end; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> Result<Option<&str>, ImportError> {
        loop {
            if !self.fill()? {
                return Ok(None);
            }
            if !self.buffer.trim_ascii().is_empty() {
                break;
            }
        }
        if self.buffer.contains(&b'\r') {
            return Err(self.error("lines end in CR alone", "save the file with LF or CRLF line ends"));
        }
        // Not `map_err` on the result that is returned: the borrow checker would hold `self` for the error as well.
        if std::str::from_utf8(&self.buffer).is_err() {
            return Err(self.error("not UTF-8 text", "save the file as UTF-8, or check that it is what its name says"));
        }
        Ok(std::str::from_utf8(&self.buffer).ok())
    }

    /// What [`Lines::next`] gave last.
    pub(crate) fn current(&self) -> &str {
        std::str::from_utf8(&self.buffer).unwrap_or("")
    }

    /// Reads a line and those that it is joined to; false at the end. A comment leaves the buffer empty.
    fn fill(&mut self) -> Result<bool, ImportError> {
        self.buffer.clear();
        self.first = self.read + 1;
        loop {
            let start = self.buffer.len();
            let room = (self.bytes_max + 2).saturating_sub(start) as u64;
            let taken = self.reader.by_ref().take(room).read_until(b'\n', &mut self.buffer);
            match taken {
                Ok(0) if room > 0 => return Ok(start > 0),
                Ok(_) => self.read += 1,
                Err(error) => {
                    let problem = format!("cannot be read on ({error})");
                    return Err(ImportError::at(&self.file, self.read + 1, problem, "check the disk and the file"));
                }
            }
            if self.buffer.last() == Some(&b'\n') {
                self.buffer.pop();
            }
            if self.buffer.last() == Some(&b'\r') {
                self.buffer.pop();
            }
            if self.buffer.len() > self.bytes_max {
                let problem = format!("a line of more than {} bytes", self.bytes_max);
                return Err(self.error(problem, "check that this is the text file that its name says"));
            }
            if self.read == 1 && self.buffer.starts_with(b"\xef\xbb\xbf") {
                self.buffer.drain(..3);
            }
            if start == 0 && self.buffer.trim_ascii_start().starts_with(b"#") {
                self.buffer.clear();
                return Ok(true);
            }
            if !self.joins || self.buffer.last() != Some(&b'\\') {
                return Ok(true);
            }
            // A blank, so that `f 1 2\` and `3` stay two numbers.
            self.buffer.pop();
            self.buffer.push(b' ');
        }
    }
}

/// `text` up to a `#` that begins a word: what a comment at a line's end leaves.
pub(crate) fn without_comment(text: &str) -> &str {
    let mut before = ' ';
    for (i, c) in text.char_indices() {
        if c == '#' && before.is_whitespace() {
            return &text[..i];
        }
        before = c;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8], joins: bool) -> Result<Vec<(u64, String)>, String> {
        let mut lines = Lines::new(text, "f", joins);
        lines.bytes_max = 20;
        let mut out = Vec::new();
        loop {
            match lines.next() {
                Ok(None) => return Ok(out),
                Ok(Some(line)) => {
                    let line = line.to_owned();
                    out.push((lines.number(), line));
                }
                Err(error) => return Err(error.to_string()),
            }
        }
    }

    #[test]
    fn lines_and_their_numbers() {
        let check = |text: &str, expected: &[(u64, &str)]| {
            let expected: Vec<(u64, String)> = expected.iter().map(|(n, s)| (*n, (*s).to_owned())).collect();
            assert_eq!(all(text.as_bytes(), true), Ok(expected), "{text:?}");
        };
        check("", &[]);
        check("\n\n", &[]);
        check("a", &[(1, "a")]);
        check("a\nb\n", &[(1, "a"), (2, "b")]);
        check("a\r\n\r\nb\r\n", &[(1, "a"), (3, "b")]);
        check("\u{feff}a\n#x\\\nb", &[(1, "a"), (3, "b")]);
        check("  # x\n b \n", &[(2, " b ")]);
        check("a\\\nb\\\r\nc\nd", &[(1, "a b c"), (4, "d")]);
        check("a\\", &[(1, "a ")]);
        check(&"a".repeat(20), &[(1, &"a".repeat(20))]);
        assert_eq!(all(b"#\xff\nb", false), Ok(vec![(2, "b".to_owned())]));
        assert_eq!(all(b"a\\\nb", false), Ok(vec![(1, "a\\".to_owned()), (2, "b".to_owned())]));
    }

    #[test]
    fn lines_that_are_refused() {
        let check = |text: &[u8], expected: &str| {
            let error = all(text, true).expect_err("refused");
            assert!(error.starts_with(expected), "{error}");
        };
        check(b"a\n\xff\n", "f:2: not UTF-8");
        check(b"a\rb\r", "f:1: lines end in CR alone");
        check(&[b'a'; 21], "f:1: a line of more than 20 bytes");
        check(&[b'a'; 4000], "f:1: a line of more than 20 bytes");
        check(&b"aaaaaaa\\\n".repeat(100), "f:1: a line of more than 20 bytes");
    }

    #[test]
    fn comments_at_the_end() {
        assert_eq!(without_comment("f 1 2 3 # x"), "f 1 2 3 ");
        assert_eq!(without_comment("usemtl a#1"), "usemtl a#1");
        assert_eq!(without_comment("#"), "");
    }
}
