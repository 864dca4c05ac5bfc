//! Figures for people and for programs: on standard output a line for each figure and a column for each scene, in CSV
//! the other way round.

use std::fmt;

/// Figures of several scenes.
#[derive(Default)]
pub struct Table {
    names: Vec<String>,
    /// One for each scene, as long as `names`.
    columns: Vec<Vec<String>>,
}

impl Table {
    /// Adds a scene. Every scene must have the same figures in the same order; the first is what it is called.
    pub fn add(&mut self, figures: Vec<(&str, String)>) {
        let (names, values): (Vec<_>, Vec<_>) =
            figures.into_iter().map(|(name, value)| (name.to_owned(), value)).unzip();
        assert!(self.columns.is_empty() || self.names == names, "{:?} is not {names:?}", self.names);
        self.names = names;
        self.columns.push(values);
    }

    /// RFC 4180 but for the line ends, which are those of every other file here.
    pub fn csv(&self) -> String {
        let line = |fields: &Vec<String>| fields.iter().map(|field| quoted(field)).collect::<Vec<_>>().join(",") + "\n";
        std::iter::once(&self.names).chain(&self.columns).map(line).collect()
    }
}

fn quoted(field: &str) -> String {
    let plain = !field.contains(['"', ',', '\n']);
    if plain { field.to_owned() } else { format!("\"{}\"", field.replace('"', "\"\"")) }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |fields: &[String]| fields.iter().map(|field| field.chars().count()).max().unwrap_or(0);
        let first = width(&self.names);
        for (row, name) in self.names.iter().enumerate() {
            write!(f, "{name:first$}")?;
            for column in &self.columns {
                let (value, width) = (&column[row], width(column));
                write!(f, "  {value:>width$}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::default();
        for (scene, seconds) in [("balls", "1.5"), ("a, \"b\"", "10.25")] {
            table.add(vec![("scene", scene.to_owned()), ("trace, s", seconds.to_owned())]);
        }
        table
    }

    #[test]
    fn for_people() {
        assert_eq!(table().to_string(), "scene     balls  a, \"b\"\ntrace, s    1.5   10.25\n");
    }

    #[test]
    fn for_programs() {
        assert_eq!(table().csv(), "scene,\"trace, s\"\nballs,1.5\n\"a, \"\"b\"\"\",10.25\n");
    }

    #[test]
    #[should_panic(expected = "is not")]
    fn scenes_with_other_figures_do_not_fit() {
        table().add(vec![("scene", "x".to_owned())]);
    }
}
