//! Tables in Markdown.

use std::fmt::Write as _;

/// A table: one line of names, then lines of as many cells.
pub struct Table {
    columns: usize,
    text: String,
}

impl Table {
    /// No lines yet. A table's first column is on the left, all others on the right.
    pub fn new(columns: &[&str]) -> Self {
        let mut table = Self { columns: columns.len(), text: String::new() };
        table.line(columns.iter().map(|&name| name.to_owned()));
        table.line(std::iter::once("---".to_owned()).chain(columns[1..].iter().map(|_| "--:".to_owned())));
        table
    }

    /// Adds a line.
    ///
    /// # Panics
    /// If it has not as many cells as there are columns.
    pub fn row(&mut self, cells: Vec<String>) {
        assert_eq!(cells.len(), self.columns, "{cells:?}");
        self.line(cells.into_iter().map(|cell| cell.replace('|', "\\|")));
    }

    /// The text.
    pub fn finish(self) -> String {
        self.text
    }

    fn line(&mut self, cells: impl Iterator<Item = String>) {
        let _ = writeln!(self.text, "| {} |", cells.collect::<Vec<_>>().join(" | "));
    }
}

/// 0.794 as `79.4`.
pub fn per_cent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

/// Bytes as megabytes.
pub fn megabytes(bytes: u64) -> String {
    format!("{:.2}", bytes as f64 * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_does_not_end_a_cell() {
        let mut table = Table::new(&["a", "b"]);
        table.row(vec!["POV||Ray".into(), per_cent(0.7942)]);
        assert_eq!(table.finish(), "| a | b |\n| --- | --: |\n| POV\\|\\|Ray | 79.4 |\n");
    }
}
