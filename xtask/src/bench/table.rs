//! Figures for people and for programs: on standard output a line for each figure and a column for each scene, in CSV
//! a line for each scene.

use std::fmt;

use super::pairs::Spread;

/// A figure.
#[derive(Clone, Debug, PartialEq)]
pub enum Figure {
    /// As it is to be read.
    Text(String),
    /// Middle and ends; three fields of CSV. Of no figures at all, a dash, and three empty fields.
    Spread(Spread),
}

impl From<String> for Figure {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Figure {
    fn from(count: u64) -> Self {
        Self::Text(count.to_string())
    }
}

impl From<Spread> for Figure {
    fn from(spread: Spread) -> Self {
        Self::Spread(spread)
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(text) => f.write_str(text),
            Self::Spread(spread) if spread.median.is_nan() => f.write_str("-"),
            Self::Spread(spread) => write!(f, "{spread}"),
        }
    }
}

impl Figure {
    fn fields(&self) -> Vec<String> {
        match self {
            Self::Text(text) => vec![text.clone()],
            Self::Spread(s) if s.median.is_nan() => vec![String::new(); 3],
            Self::Spread(s) => [s.median, s.least, s.greatest].iter().map(f64::to_string).collect(),
        }
    }

    /// What the fields are called, if the figure is called `name`.
    fn names(&self, name: &str) -> Vec<String> {
        match self {
            Self::Text(_) => vec![name.to_owned()],
            Self::Spread(_) => ["", " least", " greatest"].iter().map(|part| format!("{name}{part}")).collect(),
        }
    }
}

/// The figures of one scene, each with its name; the first is what the scene is called.
pub type Figures = Vec<(&'static str, Figure)>;

/// Figures of several scenes.
#[derive(Default)]
pub struct Table {
    /// At least one, and the same names in the same order for each.
    scenes: Vec<Vec<(String, Figure)>>,
}

impl Table {
    /// Adds a scene, which must have the figures that the others have.
    pub fn add<N: Into<String>>(&mut self, figures: Vec<(N, Figure)>) {
        let figures: Vec<_> = figures.into_iter().map(|(name, figure)| (name.into(), figure)).collect();
        let names = |figures: &[(String, Figure)]| figures.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        let same = self.scenes.first().is_none_or(|first| names(first) == names(&figures));
        assert!(same, "{:?} do not fit the table", names(&figures));
        self.scenes.push(figures);
    }

    /// RFC 4180 but for the line ends, which are those of every other file here.
    pub fn csv(&self) -> String {
        let line = |fields: Vec<String>| fields.iter().map(|field| quoted(field)).collect::<Vec<_>>().join(",") + "\n";
        let head = self.scenes.first().into_iter().flatten().flat_map(|(name, figure)| figure.names(name)).collect();
        let rows = self.scenes.iter().map(|scene| scene.iter().flat_map(|(_, figure)| figure.fields()).collect());
        std::iter::once(head).chain(rows).map(line).collect()
    }
}

fn quoted(field: &str) -> String {
    let plain = !field.contains(['"', ',', '\n']);
    if plain { field.to_owned() } else { format!("\"{}\"", field.replace('"', "\"\"")) }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = self.scenes.first() else { return Ok(()) };
        let label = first.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let texts: Vec<Vec<String>> =
            self.scenes.iter().map(|scene| scene.iter().map(|(_, figure)| figure.to_string()).collect()).collect();
        for (row, (name, _)) in first.iter().enumerate() {
            write!(f, "{name:label$}")?;
            for column in &texts {
                let width = column.iter().map(String::len).max().unwrap_or(0);
                write!(f, "  {:>width$}", column[row])?;
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
        for (scene, seconds) in [("balls", [1.5, 1.0, 4.0]), ("a, \"b\"", [10.25, 10.0, 11.0])] {
            let trace = Spread::of(seconds);
            table.add(vec![("scene", scene.to_owned().into()), ("rays", 7.into()), ("trace, s", trace.into())]);
        }
        table
    }

    #[test]
    fn for_people() {
        let expected = "\
scene                      balls                     a, \"b\"
rays                           7                          7
trace, s  1.500 (1.000 to 4.000)  10.250 (10.000 to 11.000)
";
        assert_eq!(table().to_string(), expected);
        assert_eq!(Table::default().to_string(), "");
    }

    #[test]
    fn for_programs() {
        let expected = "\
scene,rays,\"trace, s\",\"trace, s least\",\"trace, s greatest\"
balls,7,1.5,1,4
\"a, \"\"b\"\"\",7,10.25,10,11
";
        assert_eq!(table().csv(), expected);
    }

    #[test]
    fn missing_figures_keep_their_places() {
        let mut table = Table::default();
        for (scene, seconds) in [("a", &[1.5][..]), ("b", &[])] {
            let trace = Spread::of(seconds.iter().copied());
            table.add(vec![("scene", scene.to_owned().into()), ("trace, s", trace.into()), ("rays", 7.into())]);
        }
        let expected = "scene,\"trace, s\",\"trace, s least\",\"trace, s greatest\",rays\na,1.5,1.5,1.5,7\nb,,,,7\n";
        assert_eq!(table.csv(), expected);
        assert!(table.to_string().contains("trace, s  1.500 (1.500 to 1.500)  -\n"), "{table}");
    }

    #[test]
    #[should_panic(expected = "do not fit")]
    fn scenes_with_other_figures_do_not_fit() {
        table().add(vec![("scene", "x".to_owned().into())]);
    }
}
