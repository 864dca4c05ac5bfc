//! Which crates run without an operating system, and where unsafe code may stand.
//!
//! Every crate forbids unsafe code. Three may deny it instead, and one module of theirs begins by lifting that; there
//! every unsafe block says why it is sound.

use super::rust_text::{has_word, head_attributes, mask};
use super::{Problem, tree::Tree};
use crate::workspace::Member;

const MISPLACED: &str =
    "unsafe code outside the one module of geometry, arena or tests/kernels that begins with `#![allow(unsafe_code)]`";

/// The crates that may have one module with unsafe code: carving memory, the processor's vectors, and a benchmark that calls
/// another renderer.
const MAY_HAVE_UNSAFE: [&str; 3] = ["core/arena", "core/geometry", "tests/kernels"];

/// Refuses a root file without its attributes, unsafe code outside its one module, and unsafe blocks without a reason.
pub fn check(tree: &Tree, crates: &[Member]) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut homes = Vec::new();
    for member in crates {
        let may = MAY_HAVE_UNSAFE.contains(&member.folder.as_str());
        for root in &member.roots {
            let Some(text) = tree.text(root) else {
                problems.push(Problem::of(root, "this crate root is not in the tree"));
                continue;
            };
            problems.extend(check_root(root, text, member.is_bare() && root.ends_with("lib.rs"), may));
        }
        if may {
            homes.extend(unsafe_home(tree, member, &mut problems));
        }
    }
    for (path, text) in tree.rust() {
        let is_home = homes.iter().any(|home| path == format!("{home}.rs") || path.starts_with(&format!("{home}/")));
        problems.extend(if is_home { unexplained(path, text) } else { misplaced(path, text) });
    }
    problems
}

fn check_root(path: &str, text: &str, bare: bool, may_have_unsafe: bool) -> Vec<Problem> {
    let attributes = head_attributes(text);
    let has_level = |level: &str| {
        let start = format!("#![{level}(");
        attributes.iter().any(|attribute| attribute.starts_with(&start) && has_word(attribute, "unsafe_code"))
    };
    let mut problems = Vec::new();
    if bare && !attributes.iter().any(|attribute| attribute == "#![no_std]") {
        problems.push(Problem::of(path, "does not start with #![no_std]"));
    }
    let guarded = has_level("forbid") || (may_have_unsafe && has_level("deny"));
    if !guarded {
        let or_deny = if may_have_unsafe { " or #![deny(unsafe_code)]" } else { "" };
        problems.push(Problem::of(path, format!("does not start with #![forbid(unsafe_code)]{or_deny}")));
    }
    problems
}

/// The one module that begins with `#![allow(unsafe_code)]`, as its path without `.rs`: the modules below it are of it.
fn unsafe_home(tree: &Tree, member: &Member, problems: &mut Vec<Problem>) -> Option<String> {
    let source = format!("{}/src/", member.folder);
    let files = tree.rust().filter(|(path, text)| path.starts_with(&source) && lifts(text));
    let homes: Vec<_> = files.map(|(path, _)| path.trim_end_matches(".rs").trim_end_matches("/mod")).collect();
    for home in homes.iter().skip(1) {
        problems.push(Problem::of(home, "a second module with unsafe code in this crate: one is allowed"));
    }
    homes.first().map(|home| (*home).to_owned())
}

fn lifts(text: &str) -> bool {
    let is_lifting = |attribute: &String| attribute.starts_with("#![allow(") && has_word(attribute, "unsafe_code");
    head_attributes(text).iter().any(is_lifting)
}

fn misplaced(path: &str, text: &str) -> Vec<Problem> {
    let lines = mask(text);
    let lines = lines.lines().enumerate().filter(|(_, code)| has_word(code, "unsafe"));
    lines.map(|(at, _)| Problem::at(path, at + 1, MISPLACED)).collect()
}

/// Blocks and `impl`s: what is claimed to be sound. An `unsafe fn` claims nothing; its caller does.
fn unexplained(path: &str, text: &str) -> Vec<Problem> {
    let code = mask(text);
    let code: Vec<_> = code.lines().collect();
    let raw: Vec<_> = text.lines().collect();
    let claims = (0..code.len()).filter(|&at| claims_soundness(&code[at..]));
    let unexplained = claims.filter(|&at| !is_explained(&raw, &code, at));
    unexplained.map(|at| Problem::at(path, at + 1, "no `// SAFETY:` comment above this unsafe code")).collect()
}

/// Whether the first of the lines holds `unsafe {` or `unsafe impl`; the brace may stand on the next.
fn claims_soundness(lines: &[&str]) -> bool {
    let Some(line) = lines.first() else {
        return false;
    };
    line.match_indices("unsafe").any(|(at, word)| {
        let after = line[at + word.len()..].trim_start();
        let after = if after.is_empty() { lines.get(1).map_or("", |next| next.trim_start()) } else { after };
        has_word(&line[at..], word) && (after.starts_with('{') || after.starts_with("impl"))
    })
}

/// Looks upward over attributes, and over the beginning of the same statement, to the nearest comment.
fn is_explained(raw: &[&str], code: &[&str], at: usize) -> bool {
    let mut in_comment = false;
    for above in (0..at).rev() {
        let (raw, code) = (raw[above].trim(), code[above].trim());
        if raw.starts_with("//") {
            if raw.contains("SAFETY:") {
                return true;
            }
            in_comment = true;
        } else if in_comment || !(code.starts_with("#[") || ends_open(code)) {
            return false;
        }
    }
    false
}

/// Whether a line's statement goes on below it.
fn ends_open(code: &str) -> bool {
    !code.is_empty() && !code.ends_with([';', '{', '}', ','])
}

#[cfg(test)]
mod tests {
    use super::super::testing::{lines, member};
    use super::*;

    const HEAD: &str = "//! Promise.\n#![no_std]\n#![forbid(unsafe_code)]\n";
    const DENY: &str = "//! Promise.\n#![no_std]\n#![deny(unsafe_code)]\nmod lanes;\n";
    const LIFT: &str = "//! Lanes.\n#![allow(unsafe_code)]\n";

    fn check_files(folder: &str, files: &[(&str, &str)], expected: &[&str]) {
        let files: Vec<_> = files.iter().map(|(path, text)| (format!("{folder}/src/{path}"), *text)).collect();
        let files: Vec<_> = files.iter().map(|(path, text)| (path.as_str(), *text)).collect();
        assert_eq!(lines(check(&Tree::of(&files), &[member(folder, &[])])), expected);
    }

    #[test]
    fn roots_have_their_attributes() {
        check_files("core/wire", &[("lib.rs", HEAD)], &[]);
        check_files("host", &[("lib.rs", "#![forbid(unsafe_code)]")], &[]);
        let no_std = "does not start with #![no_std]";
        let forbid = "does not start with #![forbid(unsafe_code)]";
        check_files(
            "core/wire",
            &[("lib.rs", "#![forbid(unsafe_code)]")],
            &[&format!("core/wire/src/lib.rs: {no_std}")],
        );
        check_files(
            "nodes/runner",
            &[("lib.rs", "#![forbid(unsafe_code)]")],
            &[&format!("nodes/runner/src/lib.rs: {no_std}")],
        );
        check_files(
            "core/wire",
            &[("lib.rs", "mod a;\n#![no_std]")],
            &[&format!("core/wire/src/lib.rs: {forbid}"), &format!("core/wire/src/lib.rs: {no_std}")],
        );
        check_files("host", &[("lib.rs", "// #![forbid(unsafe_code)]")], &[&format!("host/src/lib.rs: {forbid}")]);
        check_files("core/wire", &[("lib.rs", DENY)], &[&format!("core/wire/src/lib.rs: {forbid}")]);
        check_files("host", &[], &["host/src/lib.rs: this crate root is not in the tree"]);
    }

    #[test]
    fn unsafe_code_stands_in_one_module() {
        let block = "fn f() {\n    // SAFETY: the length was checked.\n    unsafe { g() }\n}\n";
        let home = format!("{LIFT}{block}");
        let bare = format!("{LIFT}fn f() {{ unsafe {{ g() }} }}\n");
        let misplaced = |path: &str, line: usize| format!("core/geometry/src/{path}:{line}: {MISPLACED}");
        let check = |files: &[(&str, &str)], expected: &[&str]| check_files("core/geometry", files, expected);
        check(&[("lib.rs", DENY), ("lanes.rs", &home)], &[]);
        check(&[("lib.rs", DENY), ("simd/lanes.rs", &home)], &[]);
        check(&[("lib.rs", DENY), ("lanes.rs", LIFT), ("lanes/avx2.rs", block)], &[]);
        check(&[("lib.rs", DENY), ("lanes/mod.rs", LIFT), ("lanes/avx2.rs", block)], &[]);
        check(
            &[("lib.rs", DENY), ("lanes.rs", &bare)],
            &["core/geometry/src/lanes.rs:3: no `// SAFETY:` comment above this unsafe code"],
        );
        check(&[("lib.rs", DENY), ("lanes.rs", LIFT), ("lanes_too.rs", block)], &[&misplaced("lanes_too.rs", 3)]);
        check(&[("lib.rs", DENY), ("lanes.rs", block)], &[&misplaced("lanes.rs", 3)]);
        check(
            &[("lib.rs", DENY), ("lanes.rs", &home), ("more.rs", &home)],
            &[
                "core/geometry/src/more: a second module with unsafe code in this crate: one is allowed",
                &misplaced("more.rs", 5),
            ],
        );
        let forbids = "#![forbid(unsafe_code)]";
        check_files("host", &[("lib.rs", forbids), ("a.rs", &home)], &[&format!("host/src/a.rs:5: {MISPLACED}")]);
        let words = format!("{forbids}\n// unsafe {{}}\nconst A: &str = \"unsafe {{}}\";");
        check_files("host", &[("lib.rs", &words)], &[]);
    }

    fn check_block(text: &str, explained: bool) {
        assert_eq!(unexplained("a.rs", text).is_empty(), explained, "{text}");
    }

    #[test]
    fn unsafe_blocks_say_why() {
        check_block("// SAFETY: checked above.\nunsafe { f() }", true);
        check_block("// SAFETY: checked\n// above, twice.\n#[inline]\nunsafe { f() }", true);
        check_block("// SAFETY: checked above.\nlet x =\n    unsafe { f() };", true);
        check_block("// SAFETY: plain data.\nunsafe impl Pod for A {}", true);
        check_block("unsafe fn f() {}", true);
        check_block("unsafe { f() }", false);
        check_block("// It is fast.\nunsafe { f() }", false);
        check_block("// SAFETY: of another.\nlet y = 1;\nunsafe { f() }", false);
        check_block("// SAFETY: of another.\n\nlet z = a;\n// Here.\nunsafe { f() }", false);
        check_block("unsafe impl Pod for A {}", false);
        check_block("let x = unsafe\n{ f() };", false);
        check_block("unsafe { // SAFETY: too late\n f() }", false);
    }
}
