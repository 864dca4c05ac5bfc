//! A source file holds one thing: it has a limit.

use super::rust_text::mask;
use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// Lines of code in one file, its tests included; blank lines and comments are free.
const LINES_MAX: usize = 700;

/// Refuses longer files below any `src`.
pub fn check(tree: &Tree, _: &[Member]) -> Vec<Problem> {
    let counted = tree.rust_sources().map(|(path, text)| (path, lines_of_code(text)));
    let long = counted.filter(|&(_, count)| count > LINES_MAX);
    long.map(|(path, count)| Problem::of(path, format!("{count} lines of code, more than {LINES_MAX}"))).collect()
}

fn lines_of_code(text: &str) -> usize {
    mask(text).lines().filter(|line| !line.trim().is_empty()).count()
}

#[cfg(test)]
mod tests {
    use super::super::testing::lines;
    use super::*;

    #[test]
    fn comments_and_blanks_are_free() {
        assert_eq!(lines_of_code("//! a\n\nfn f() {\n    // b\n    g(\"//\"); // c\n\n/* d\n e */\n}\n"), 3);
    }

    #[test]
    fn long_files_are_named_with_their_count() {
        let fits = "f();\n".repeat(LINES_MAX);
        let long = format!("{fits}g();\n");
        let tree = Tree::of(&[("a/src/fits.rs", &fits), ("a/src/long.rs", &long), ("a/tests/long.rs", &long)]);
        assert_eq!(lines(check(&tree, &[])), ["a/src/long.rs: 701 lines of code, more than 700"]);
    }
}
