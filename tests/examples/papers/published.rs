//! The papers' figures, from `docs/paper-tables`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

/// All tables, by the names of their files.
pub struct Published(BTreeMap<String, Rows>);

/// Lines of a table.
pub type Rows = Vec<Row>;

/// A line: its fields by the names of their columns.
pub struct Row(BTreeMap<String, String>);

impl Published {
    /// Reads every CSV file of `folder`.
    ///
    /// # Errors
    /// If one cannot be read, or a line has not as many fields as the first.
    pub fn read(folder: &Path) -> Result<Self> {
        let mut tables = BTreeMap::new();
        for file in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let path = file?.path();
            let Some(name) = path.file_stem().filter(|_| path.extension().is_some_and(|e| e == "csv")) else {
                continue;
            };
            let text = fs::read_to_string(&path)?;
            let rows = rows(&text).with_context(|| path.display().to_string())?;
            tables.insert(name.to_string_lossy().into_owned(), rows);
        }
        Ok(Self(tables))
    }

    /// The table of that name.
    ///
    /// # Errors
    /// If there is none.
    pub fn table(&self, name: &str) -> Result<&Rows> {
        self.0.get(name).with_context(|| format!("there is no table {name}"))
    }
}

impl Row {
    /// A field, as it is printed.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn text(&self, column: &str) -> Result<&str> {
        self.0.get(column).map(String::as_str).with_context(|| format!("there is no column {column}"))
    }

    /// The same for a table: a figure that the paper does not print is a dash.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn cell(&self, column: &str) -> Result<String> {
        Ok(Some(self.text(column)?).filter(|text| !text.is_empty()).unwrap_or("–").to_owned())
    }

    /// A whole number.
    ///
    /// # Errors
    /// If it is none.
    pub fn number(&self, column: &str) -> Result<u16> {
        let text = self.text(column)?;
        text.parse().with_context(|| format!("{column}: {text}"))
    }
}

/// No field of these tables is quoted.
fn rows(text: &str) -> Result<Rows> {
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().context("it is empty")?;
    let mut rows = Vec::new();
    for line in lines {
        if line.len() != head.len() {
            bail!("{} fields instead of {}: {}", line.len(), head.len(), line.join(","));
        }
        rows.push(Row(head.iter().cloned().zip(line).collect()));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_names() {
        let rows = rows("nodes,s\n1,63.10\n2,\n").unwrap();
        assert_eq!((rows[0].number("nodes").unwrap(), rows[0].cell("s").unwrap()), (1, "63.10".to_owned()));
        assert_eq!(rows[1].cell("s").unwrap(), "–");
        assert!(rows[0].text("busy").is_err());
    }

    #[test]
    fn a_line_that_does_not_fit_is_an_error() {
        assert!(super::rows("a,b\n1\n").is_err());
        assert!(super::rows("").is_err());
    }
}
