//! Nothing is left to be done later in silence.

use super::rust_text::{has_word, mask};
use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// Macros that mark unfinished work, or that somebody forgot to take out.
const MACROS: [&str; 3] = ["todo", "unimplemented", "dbg"];

/// Refuses their use below any `src`.
pub fn check(tree: &Tree, _: &[Member]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (path, text) in tree.rust_sources() {
        for (at, code) in (1..).zip(mask(text).lines()) {
            let used = MACROS.iter().filter(|name| calls(code, name));
            problems.extend(used.map(|name| Problem::at(path, at, format!("{name}! left in the source"))));
        }
    }
    problems
}

fn calls(code: &str, name: &str) -> bool {
    has_word(code, name) && code.contains(&format!("{name}!"))
}

#[cfg(test)]
mod tests {
    use super::super::testing::lines;
    use super::*;

    #[test]
    fn unfinished_code_is_found() {
        let text = "fn f() { todo!() }\nlet x = dbg!(y);\nunimplemented![];\n// todo!()\n\"dbg!(x)\";\nmy_todo!();\nlet todo = 1;";
        let tree = Tree::of(&[("a/src/lib.rs", text), ("a/tests/t.rs", "todo!()")]);
        assert_eq!(
            lines(check(&tree, &[])),
            [
                "a/src/lib.rs:1: todo! left in the source",
                "a/src/lib.rs:2: dbg! left in the source",
                "a/src/lib.rs:3: unimplemented! left in the source",
            ]
        );
    }
}
