//! No file names a place on the machine where it was written.

use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// Top folders that hold somebody's own files. Kept without slashes, so that this file passes.
const TOP_FOLDERS: [&str; 3] = ["work", "root", "home"];

/// Refuses absolute paths below such a folder, in every text file.
pub fn check(tree: &Tree, _: &[Member]) -> Vec<Problem> {
    let lines = tree.texts().flat_map(|(path, text)| (1..).zip(text.lines()).map(move |(at, line)| (path, at, line)));
    lines.filter_map(|(path, at, line)| Some(Problem::at(path, at, format!("machine path {}", find(line)?)))).collect()
}

fn find(line: &str) -> Option<String> {
    let paths = TOP_FOLDERS.iter().map(|folder| format!("/{folder}/"));
    paths.into_iter().find(|path| line.match_indices(path.as_str()).any(|(at, _)| begins_a_path(&line[..at])))
}

/// A path after a name, as in a web address or below another folder, is not one from the top.
fn begins_a_path(before: &str) -> bool {
    !before.chars().next_back().is_some_and(|c| c.is_alphanumeric() || "._-~/})]*".contains(c))
}

#[cfg(test)]
mod tests {
    use super::super::testing::lines;
    use super::*;

    fn check_line(line: &str, found: bool) {
        let line = line.replace('%', "/");
        assert_eq!(find(&line).is_some(), found, "{line}");
    }

    #[test]
    fn absolute_paths_are_found_and_others_are_not() {
        check_line("see %work%main", true);
        check_line("cd %root%x", true);
        check_line("\"%home%somebody%scene.nff\"", true);
        check_line("path=%home%a:%usr%bin", true);
        check_line("file:(%work%x)", true);
        check_line("https:%%example.org%home%a", false);
        check_line(".%work%x and $HOME%work%x and ${X}%work%x", false);
        check_line("%homes%x, %workshop%, %root", false);
        check_line("core%root%x", false);
    }

    #[test]
    fn the_place_is_named() {
        let text = "first\nsecond %home%x\n".replace('%', "/");
        let tree = Tree::of(&[("docs/a.md", &text)]);
        assert_eq!(lines(check(&tree, &[])), ["docs/a.md:2: machine path %home%".replace('%', "/")]);
    }
}
