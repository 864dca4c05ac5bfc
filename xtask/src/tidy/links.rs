//! Links from our pages lead somewhere: to a file of the tree, and to a heading that is there.

use std::collections::BTreeMap;

use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// Refuses links in Markdown files to what is not in the tree. Web addresses are not followed.
pub fn check(tree: &Tree, _: &[Member]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (path, text) in tree.texts().filter(|(path, _)| path.ends_with(".md")) {
        for (at, line) in prose(text) {
            let broken = targets(&without_code(line)).into_iter().filter_map(|target| complaint(tree, path, &target));
            problems.extend(broken.map(|what| Problem::at(path, at, what)));
        }
    }
    problems
}

fn complaint(tree: &Tree, page: &str, target: &str) -> Option<String> {
    // A scheme, such as `https:`, has no slash before its colon.
    let has_scheme = target.split_once(':').is_some_and(|(scheme, _)| !scheme.contains(['/', '#', '.']));
    if has_scheme || target.starts_with("//") {
        return None;
    }
    let (file, heading) = target.split_once('#').unwrap_or((target, ""));
    let path = if file.is_empty() { page.to_owned() } else { resolve(page, &file.replace("%20", " ")) };
    if !tree.has(&path) {
        return Some(format!("link to {target}: there is no {path}"));
    }
    let text = tree.text(&path).filter(|_| path.ends_with(".md") && !heading.is_empty())?;
    (!anchors(text).iter().any(|anchor| anchor == heading)).then(|| format!("link to {target}: no such heading"))
}

/// The path that a link in `page` means. One that leads out of the tree keeps a `..` in front, and no file has that name.
fn resolve(page: &str, file: &str) -> String {
    let mut parts: Vec<&str> = if file.starts_with('/') { Vec::new() } else { page.split('/').collect() };
    parts.pop();
    for part in file.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|last| *last != "..") => drop(parts.pop()),
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

/// Lines, counted from one, that do not stand in a fence of code.
fn prose(text: &str) -> Vec<(usize, &str)> {
    let mut lines = Vec::new();
    let mut in_fence = None;
    for (at, line) in (1..).zip(text.lines()) {
        let fence = ["```", "~~~"].into_iter().find(|fence| line.trim_start().starts_with(fence));
        match (in_fence, fence) {
            (None, Some(_)) => in_fence = fence,
            (Some(open), Some(close)) if open == close => in_fence = None,
            (None, None) => lines.push((at, line)),
            _ => {}
        }
    }
    lines
}

/// A line without what stands between backticks.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect()
}

/// Where the links of a line lead: `[text](target "title")`, and `[label]: target` at its beginning.
fn targets(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = line;
    while let Some((_, after)) = rest.split_once("](") {
        let mut depth = 1_usize;
        let end = after.find(|c| {
            depth = depth + usize::from(c == '(') - usize::from(c == ')');
            depth == 0
        });
        found.extend(end.and_then(|end| first_word(&after[..end])));
        rest = after;
    }
    let definition = line.trim_start().strip_prefix('[').filter(|label| !label.starts_with('^'));
    found.extend(definition.and_then(|line| line.split_once("]:")).and_then(|(_, target)| first_word(target)));
    found
}

fn first_word(target: &str) -> Option<String> {
    let word = target.split_whitespace().next()?;
    Some(word.trim_start_matches('<').trim_end_matches('>').to_owned())
}

/// The names by which a page's headings are linked to: in lower case, blanks as dashes, other signs dropped, and a number
/// behind a name that stood before.
fn anchors(text: &str) -> Vec<String> {
    let mut seen = BTreeMap::<String, usize>::new();
    let mut names = Vec::new();
    for (_, line) in prose(text) {
        let Some((_, title)) = line.split_once("# ").filter(|(marks, _)| marks.chars().all(|c| c == '#')) else {
            names.extend(line.split("id=\"").skip(1).filter_map(|id| Some(id.split_once('"')?.0.to_owned())));
            continue;
        };
        let name = slug(&without_targets(title));
        let count = seen.entry(name.clone()).or_insert(0);
        names.push(if *count == 0 { name } else { format!("{name}-{count}") });
        *count += 1;
    }
    names
}

fn without_targets(title: &str) -> String {
    let mut parts = title.split("](");
    let first = parts.next().unwrap_or("").to_owned();
    parts.fold(first, |text, part| text + part.split_once(')').map_or("", |(_, after)| after))
}

fn slug(title: &str) -> String {
    let kept = title.trim().chars().filter(|&c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect::<String>().to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::super::testing::lines;
    use super::*;

    fn check_page(page: &str, expected: &[&str]) {
        let files = [
            ("docs/page.md", page),
            (
                "docs/other.md",
                "# Two words\n## `code`, and: [more](https://example.org)\n# Two words\n```\n# Fenced\n```",
            ),
            ("core/wire/src/lib.rs", ""),
            ("README.md", ""),
        ];
        assert_eq!(lines(check(&Tree::of(&files), &[])), expected);
    }

    #[test]
    fn links_that_lead_somewhere_pass() {
        check_page("[a](other.md) [b](../README.md \"title\") [c](/core/wire) [d](../core/wire/src/lib.rs)", &[]);
        check_page("[a](other.md#two-words) [b](other.md#code-and-more) [c](other.md#two-words-1)", &[]);
        check_page("# Here\n[a](#here) <a id=\"there\"></a> [b](#there)", &[]);
        check_page("[a](https://example.org/none.md) [b](mailto:a@example.org) [c](//example.org)", &[]);
        check_page("`[a](none.md)`\n```\n[b](none.md)\n```\n~~~\n```\n[c](none.md)\n~~~", &[]);
        check_page("[a]: other.md\n[^1]: a note\n[b](<other.md>)", &[]);
        check_page("[![picture](other.md)](../README.md)", &[]);
    }

    #[test]
    fn links_that_lead_nowhere_are_named() {
        check_page("x\n[a](none.md)", &["docs/page.md:2: link to none.md: there is no docs/none.md"]);
        check_page(
            "[![p](none.png)](lost.md)",
            &[
                "docs/page.md:1: link to lost.md: there is no docs/lost.md",
                "docs/page.md:1: link to none.png: there is no docs/none.png",
            ],
        );
        check_page("[a](other.md#three-words)", &["docs/page.md:1: link to other.md#three-words: no such heading"]);
        check_page("[a](other.md#fenced)", &["docs/page.md:1: link to other.md#fenced: no such heading"]);
        check_page("[a](#nowhere)", &["docs/page.md:1: link to #nowhere: no such heading"]);
        check_page("[a]: none.md", &["docs/page.md:1: link to none.md: there is no docs/none.md"]);
        check_page("[a](../../x.md)", &["docs/page.md:1: link to ../../x.md: there is no ../x.md"]);
        check_page("[a](/docs/none.md)", &["docs/page.md:1: link to /docs/none.md: there is no docs/none.md"]);
        check_page("```\ncode\n```\n[a](none.md)", &["docs/page.md:4: link to none.md: there is no docs/none.md"]);
    }
}
