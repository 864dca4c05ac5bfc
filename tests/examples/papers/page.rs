//! The page: text by hand, with places for tables.

use anyhow::{Result, bail};

const END: &str = "<!-- end -->";

/// `text` with another table called `name`.
///
/// # Errors
/// If there is not exactly one place for it.
pub fn replaced(text: &str, name: &str, table: &str) -> Result<String> {
    let begin = format!("<!-- table {name} -->\n");
    let [before, rest] = text.split(&begin).collect::<Vec<_>>()[..] else {
        bail!("there must be one line {}", begin.trim_end());
    };
    match rest.split_once(END) {
        Some((old, after)) if !old.contains("<!--") => {
            Ok(format!("{before}{begin}\n{}\n\n{END}{after}", table.trim_end()))
        }
        _ => bail!("{} has no {END}", begin.trim_end()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "a\n<!-- table x -->\nold\n<!-- end -->\nb\n<!-- table y -->\n<!-- end -->\n";

    #[test]
    fn one_table_is_replaced() {
        let expected = "a\n<!-- table x -->\n\n| new |\n\n<!-- end -->\nb\n<!-- table y -->\n<!-- end -->\n";
        assert_eq!(replaced(PAGE, "x", "| new |\n").unwrap(), expected);
        assert_eq!(replaced(expected, "x", "| new |").unwrap(), expected);
    }

    #[test]
    fn a_place_that_is_missing_or_open_is_an_error() {
        assert!(replaced(PAGE, "z", "").is_err());
        assert!(replaced("<!-- table x -->\n<!-- table y -->\n<!-- end -->", "x", "").is_err());
        assert!(replaced(&PAGE.repeat(2), "x", "").is_err());
    }
}
