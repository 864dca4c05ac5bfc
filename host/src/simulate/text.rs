//! Numbers and names as a person reads them, and made safe for HTML and SVG.
//!
//! Nothing that is not a number gets through: [`finite`] stands before every value that is drawn or printed.

/// The value, 0 to 1e15; 0 where it is negative, infinite or no number.
pub(super) fn finite(value: f64) -> f64 {
    if value.is_finite() { value.clamp(0.0, 1e15) } else { 0.0 }
}

/// Text for an element or a quoted attribute of HTML and XML. Characters that XML has no way to write become U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' => out.push(' '),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// At most `most` characters, the last of them an ellipsis where something was left out.
pub(super) fn shorten(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

/// `1234567` as `1,234,567`.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Three significant digits, as few decimals as that takes, and never an exponent.
pub(super) fn number(value: f64) -> String {
    let value = finite(value);
    let decimals = match value {
        v if v == 0.0 || v >= 99.95 => 0,
        v if v >= 9.995 => 1,
        v if v >= 0.9995 => 2,
        v if v >= 0.09995 => 3,
        _ => 4,
    };
    if decimals == 0 { count(value.round() as u64) } else { format!("{value:.decimals$}") }
}

/// What a value is: it decides the unit in which it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Count,
    Bytes,
    Seconds,
    /// 0 to 1, shown in per cent.
    Share,
    /// A plain ratio.
    Ratio,
}

impl Quantity {
    /// What to divide values up to `most` by, and the unit that they then have; empty where there is none.
    pub fn unit(self, most: f64) -> (f64, &'static str) {
        let steps: &[(f64, &str)] = match self {
            Self::Count => &[(1e9, "billions"), (1e6, "millions"), (2e4, "thousands")],
            Self::Bytes => &[(1073741824.0, "GiB"), (1048576.0, "MiB"), (1024.0, "KiB")],
            // A bound may be days or years.
            Self::Seconds => &[(31_557_600.0, "years"), (86_400.0, "days"), (3600.0, "h"), (1.0, "s"), (1e-3, "ms")],
            Self::Share | Self::Ratio => &[],
        };
        let smallest = match self {
            Self::Count | Self::Ratio => (1.0, ""),
            Self::Bytes => (1.0, "bytes"),
            Self::Seconds => (1e-6, "µs"),
            Self::Share => (0.01, "%"),
        };
        match steps.iter().find(|step| most >= step.0) {
            Some(&(_, unit @ "thousands")) => (1e3, unit),
            Some(&step) => step,
            None => smallest,
        }
    }

    /// The value with its unit.
    pub fn show(self, value: f64) -> String {
        let value = finite(value);
        match self {
            Self::Count => number(value),
            _ if self == Self::Bytes && value < 1024.0 => format!("{} B", number(value)),
            _ if value == 0.0 && self == Self::Seconds => "0 s".into(),
            _ => {
                let (divisor, unit) = self.unit(value);
                let space = if unit.is_empty() { "" } else { "\u{a0}" };
                format!("{}{space}{unit}", number(value / divisor))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes() {
        assert_eq!(escape("<a href=\"x\" b='y'>&\0\n"), "&lt;a href=&quot;x&quot; b=&#39;y&#39;&gt;&amp;\u{fffd} ");
    }

    #[test]
    fn numbers() {
        for (value, shown) in [
            (0.0, "0"),
            (0.01234, "0.0123"),
            (0.99949, "0.999"),
            (0.9996, "1.00"),
            (9.996, "10.0"),
            (99.96, "100"),
            (1234567.4, "1,234,567"),
            (f64::NAN, "0"),
            (f64::INFINITY, "0"),
            (-1.0, "0"),
        ] {
            assert_eq!(number(value), shown, "{value}");
        }
        assert_eq!(count(u64::MAX), "18,446,744,073,709,551,615");
        assert_eq!((count(0), count(999), count(1000)), ("0".into(), "999".into(), "1,000".into()));
    }

    #[test]
    fn units() {
        assert_eq!(Quantity::Bytes.show(33554432.0), "32.0\u{a0}MiB");
        assert_eq!(Quantity::Bytes.show(12.0), "12.0 B");
        assert_eq!(Quantity::Seconds.show(0.00025), "250\u{a0}µs");
        assert_eq!(Quantity::Seconds.show(3599.0), "3,599\u{a0}s");
        assert_eq!(Quantity::Seconds.show(5400.0), "1.50\u{a0}h");
        assert_eq!(Quantity::Seconds.show(4.48e8), "14.2\u{a0}years");
        assert_eq!(Quantity::Share.show(0.8), "80.0\u{a0}%");
        assert_eq!(Quantity::Ratio.show(31.5), "31.5");
        assert_eq!(shorten("abcdef", 4), "abc…");
    }
}
