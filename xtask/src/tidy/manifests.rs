//! What a crate says of itself: a description, a first sentence, and for a core crate a page of its own.

use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// Refuses a crate without a description, a core crate without README.md, and a root that does not open with a sentence.
pub fn check(tree: &Tree, crates: &[Member]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for member in crates {
        if member.description.trim().is_empty() {
            problems.push(Problem::of(&format!("{}/Cargo.toml", member.folder), "no description"));
        }
        if member.folder.starts_with("core/") && !tree.has(&format!("{}/README.md", member.folder)) {
            problems.push(Problem::of(&member.folder, "a core crate without README.md"));
        }
        for root in &member.roots {
            if tree.text(root).is_some_and(|text| !opens_with_a_sentence(text)) {
                problems.push(Problem::at(root, 1, "does not begin with a `//!` sentence"));
            }
        }
    }
    problems
}

/// The paragraph of `//!` lines at the very top holds words and ends one.
fn opens_with_a_sentence(text: &str) -> bool {
    let comment = text.lines().map_while(|line| line.strip_prefix("//!")).map(str::trim);
    let paragraph: Vec<_> = comment.take_while(|line| !line.is_empty()).collect();
    paragraph.join(" ").contains(' ') && paragraph.last().is_some_and(|line| line.ends_with(['.', ':', '?', '!']))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{lines, member};
    use super::*;

    fn check_crate(crate_: Member, files: &[(&str, &str)], expected: &[&str]) {
        assert_eq!(lines(check(&Tree::of(files), &[crate_])), expected);
    }

    #[test]
    fn crates_say_what_they_are() {
        let files = [("core/wire/src/lib.rs", "//! Messages, byte by byte.\n"), ("core/wire/README.md", "")];
        check_crate(member("core/wire", &[]), &files, &[]);
        let silent = Member { description: " ".to_owned(), ..member("core/wire", &[]) };
        check_crate(silent, &files, &["core/wire/Cargo.toml: no description"]);
        check_crate(member("core/wire", &[]), &files[..1], &["core/wire: a core crate without README.md"]);
        check_crate(member("host", &[]), &[("host/src/lib.rs", "//! The parts of the program.\n")], &[]);
        check_crate(
            member("host", &[]),
            &[("host/src/lib.rs", "mod a;")],
            &["host/src/lib.rs:1: does not begin with a `//!` sentence"],
        );
    }

    fn check_opening(text: &str, expected: bool) {
        assert_eq!(opens_with_a_sentence(text), expected, "{text}");
    }

    #[test]
    fn a_sentence_ends() {
        check_opening("//! One loop for\n//! every machine.\n//!\n//! More", true);
        check_opening("//! One loop for every machine", false);
        check_opening("//! Loop.", false);
        check_opening("//!\n//! One loop.", false);
        check_opening("\n//! One loop.", false);
        check_opening("// One loop.", false);
        check_opening("", false);
    }
}
