//! The page that describes the wire is pinned to the source: who changes one is sent to the other.

use super::{Problem, tree::Tree};
use crate::workspace::Member;

const PAGE: &str = "docs/WIRE.md";
const SOURCE: &str = "core/wire/src/";

/// Refuses a page whose line `source: <16 hex digits>` is not the hash of the wire crate's source. No page, no problem.
pub fn check(tree: &Tree, _: &[Member]) -> Vec<Problem> {
    let Some(page) = tree.text(PAGE) else {
        return Vec::new();
    };
    let source = tree.rust().filter(|(path, _)| path.starts_with(SOURCE));
    let hash = format!("{:016x}", fnv1a(source.flat_map(|(_, text)| text.bytes())));
    let mut pins = (1..).zip(page.lines()).filter_map(|(at, line)| Some((at, line.trim().strip_prefix("source: ")?)));
    match pins.next() {
        Some((_, pin)) if pin == hash => Vec::new(),
        Some((at, _)) => {
            let what = format!("the source is now {hash}: read {PAGE} again, and bring it up to date");
            vec![Problem::at(PAGE, at, what)]
        }
        None => vec![Problem::of(PAGE, format!("has no line `source: {hash}`"))],
    }
}

/// Fowler, Noll and Vo's hash 1a of 64 bits. Carriage returns are left out, since a checkout may add them.
fn fnv1a(bytes: impl Iterator<Item = u8>) -> u64 {
    let bytes = bytes.filter(|&byte| byte != b'\r');
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::super::testing::lines;
    use super::*;

    /// From the test vectors that the authors publish with their draft.
    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(fnv1a("".bytes()), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a("a".bytes()), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a("foobar".bytes()), 0x8594_4171_f739_67e8);
        assert_eq!(fnv1a("foo\rbar".bytes()), 0x8594_4171_f739_67e8);
    }

    fn check_page(page: &str, expected: &[&str]) {
        // "foobar", cut in two files; what stands elsewhere does not count.
        let source = [("core/wire/src/b.rs", "bar"), ("core/wire/src/a.rs", "foo"), ("core/wire/tests/t.rs", "x")];
        let tree = Tree::of(&[&source[..], &[("docs/WIRE.md", page)]].concat());
        assert_eq!(lines(check(&tree, &[])), expected);
    }

    #[test]
    fn the_page_follows_the_source() {
        check_page("# Wire\n\nsource: 85944171f73967e8\n", &[]);
        let again = "the source is now 85944171f73967e8: read docs/WIRE.md again, and bring it up to date";
        check_page("# Wire\n\nsource: 85944171f73967e9\n", &[&format!("docs/WIRE.md:3: {again}")]);
        check_page("source: \n", &["docs/WIRE.md: has no line `source: 85944171f73967e8`"]);
        check_page("# Wire\n", &["docs/WIRE.md: has no line `source: 85944171f73967e8`"]);
        assert!(check(&Tree::of(&[("core/wire/src/a.rs", "foo")]), &[]).is_empty());
    }
}
