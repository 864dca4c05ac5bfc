//! The one error of every importer, the tally of what could not be honoured, and what both say of names.

/// Why a scene cannot be read, as one line for a person: where, what is wrong, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {problem}; {remedy}")]
pub struct ImportError {
    place: String,
    problem: String,
    remedy: String,
}

impl ImportError {
    /// About a file or a scene as a whole.
    pub(crate) fn new(place: &str, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Self {
        Self { place: one_line(place), problem: one_line(problem.as_ref()), remedy: one_line(remedy.as_ref()) }
    }

    /// About a line of a file; lines count from 1.
    pub(crate) fn at(file: &str, line: u64, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Self {
        Self::new(&format!("{file}:{line}"), problem, remedy)
    }

    /// Where: `file`, `file:line` or the name of a scene.
    #[must_use]
    pub fn place(&self) -> &str {
        &self.place
    }

    /// What is wrong.
    #[must_use]
    pub fn problem(&self) -> &str {
        &self.problem
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &str {
        &self.remedy
    }
}

/// A file's own text may hold anything: it must not break a message into lines or move a terminal's cursor.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// `text` in backquotes, control characters shown as escapes, cut to 40 characters.
pub(crate) fn quote(text: &str) -> String {
    let mut quoted: String = text.chars().take(40).flat_map(char::escape_debug).collect();
    if text.chars().nth(40).is_some() {
        quoted.push_str("...");
    }
    format!("`{quoted}`")
}

/// Kinds of warning that one file may give before the rest are counted together.
const KINDS_MAX: usize = 32;

/// What could not be honoured in one file: each kind once, with its count and its first line.
#[derive(Debug, Default)]
pub(crate) struct Warnings {
    kinds: Vec<Kind>,
}

#[derive(Debug)]
struct Kind {
    text: String,
    line: u64,
    count: u64,
}

impl Warnings {
    /// Counts one case of `text`, found at `line`.
    pub(crate) fn add(&mut self, line: u64, text: &str) {
        let text = if self.kinds.len() >= KINDS_MAX && !self.kinds.iter().any(|k| k.text == text) {
            "more kinds of trouble than are listed here"
        } else {
            text
        };
        match self.kinds.iter_mut().find(|k| k.text == text) {
            Some(kind) => kind.count += 1,
            None => self.kinds.push(Kind { text: text.to_owned(), line, count: 1 }),
        }
    }

    /// One line each, in the order in which they were met.
    pub(crate) fn lines(&self, file: &str) -> impl Iterator<Item = String> {
        let file = one_line(file);
        self.kinds.iter().map(move |Kind { text, line, count }| {
            let times = if *count == 1 { String::new() } else { format!(" ({count} times, here first)") };
            // A file without lines has line 0.
            let line = if *line == 0 { String::new() } else { format!(":{line}") };
            one_line(&format!("{file}{line}: {text}{times}"))
        })
    }
}

/// Up to three of `names` that `wanted` may be a slip of, nearest first.
pub(crate) fn near<'a>(wanted: &str, names: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let wanted: Vec<char> = wanted.chars().take(64).flat_map(char::to_lowercase).collect();
    let farthest = (wanted.len() / 3).max(1);
    let mut found: Vec<(usize, &str)> = names
        .into_iter()
        .filter_map(|name| {
            let other: Vec<char> = name.chars().take(64).flat_map(char::to_lowercase).collect();
            let distance = edits(&wanted, &other);
            (distance <= farthest).then_some((distance, name))
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found.into_iter().take(3).map(|(_, name)| name).collect()
}

/// Edits from one to the other: a character put in, left out or replaced, or two neighbours exchanged (the distance of
/// Damerau and Levenshtein where no part is edited twice).
fn edits(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut row = vec![i + 1];
        for (j, y) in b.iter().enumerate() {
            let mut least = (last[j] + usize::from(x != y)).min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && *x == b[j - 1] && *y == a[i - 1] {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

/// "did you mean a, b or c?", or `otherwise` where there is nothing near.
pub(crate) fn did_you_mean(near: &[&str], otherwise: &str) -> String {
    let quoted: Vec<String> = near.iter().map(|n| quote(n)).collect();
    match quoted.split_last() {
        None => otherwise.to_owned(),
        Some((only, [])) => format!("did you mean {only}?"),
        Some((last, rest)) => format!("did you mean {} or {last}?", rest.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_counts_edits() {
        let check = |a: &str, b: &str, expected| {
            let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
            assert_eq!(edits(&a, &b), expected);
            assert_eq!(edits(&b, &a), expected);
        };
        check("kitten", "sitting", 3);
        check("", "abc", 3);
        check("bunny", "bunny", 0);
        check("bnuny", "bunny", 1);
        check("ca", "abc", 3);
        check("flaw", "lawn", 2);
    }

    #[test]
    fn names_that_are_near() {
        let names = ["teapot.obj", "bunny.obj", "bunny.nff", "BUNNY.OBJ"];
        assert_eq!(near("buny.obj", names), ["BUNNY.OBJ", "bunny.obj", "bunny.nff"][..2].to_vec());
        assert!(near("x", names).is_empty());
        assert_eq!(did_you_mean(&["a", "b", "c"], ""), "did you mean `a`, `b` or `c`?");
        assert_eq!(did_you_mean(&["a"], ""), "did you mean `a`?");
        assert_eq!(did_you_mean(&[], "none"), "none");
    }

    #[test]
    fn messages_are_one_line() {
        let error = ImportError::at("a\nb.obj", 3, "x\r\ny\u{1b}[2J", "z");
        assert_eq!(error.to_string(), "a b.obj:3: x  y [2J; z");
        assert_eq!(quote(&"a".repeat(50)), format!("`{}...`", "a".repeat(40)));
        assert_eq!(quote("a\tb"), "`a\\tb`");
    }

    #[test]
    fn warnings_are_counted_by_kind_and_bounded() {
        let mut w = Warnings::default();
        for i in 1..=1000 {
            w.add(i, "often");
            w.add(i, &format!("kind {i}"));
        }
        let lines: Vec<String> = w.lines("f").collect();
        assert_eq!(lines.len(), KINDS_MAX + 1);
        assert_eq!(lines[0], "f:1: often (1000 times, here first)");
        assert_eq!(lines[1], "f:1: kind 1");
        assert!(lines[KINDS_MAX].contains("(969 times"), "{}", lines[KINDS_MAX]);
    }
}
