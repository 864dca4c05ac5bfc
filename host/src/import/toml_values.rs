//! The values of a scene file, each checked where it stands: colours, points, numbers in a range.

use super::COORDINATE_MAX;
use super::error::{ImportError, quote};
use serde::de::{self, Deserialize, Deserializer, SeqAccess, Visitor};
use std::fmt;
use std::ops::Range;
use toml::Spanned;

/// A value that may be left out, and where it stands.
pub(crate) type Maybe<T> = Option<Spanned<T>>;

/// Numbers of a colour or point as they stand; more than this are not kept.
const NUMBERS_MAX: usize = 9;

/// A colour as it stands: numbers, one number for a grey, or `#rrggbb`.
#[derive(Clone, Debug)]
pub(crate) enum Colour {
    Grey(f64),
    Numbers(Vec<f64>),
    Text(String),
}

impl<'de> Deserialize<'de> for Colour {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ColourVisitor)
    }
}

struct ColourVisitor;

impl<'de> Visitor<'de> for ColourVisitor {
    type Value = Colour;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a colour ([r, g, b], a number or \"#rrggbb\")")
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Colour, E> {
        Ok(Colour::Grey(value as f64))
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Colour, E> {
        Ok(Colour::Grey(value))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Colour, E> {
        Ok(Colour::Text(text.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Colour, A::Error> {
        let mut numbers = Vec::new();
        while let Some(value) = seq.next_element::<f64>()? {
            if numbers.len() < NUMBERS_MAX {
                numbers.push(value);
            }
        }
        Ok(Colour::Numbers(numbers))
    }
}

/// The file that values stand in, for messages.
pub(crate) struct Source<'a> {
    pub(crate) file: &'a str,
    pub(crate) text: &'a str,
}

impl Source<'_> {
    /// The line, from 1, in which a span begins.
    pub(crate) fn line(&self, span: &Range<usize>) -> u64 {
        let before = self.text.as_bytes().get(..span.start).unwrap_or(self.text.as_bytes());
        before.iter().filter(|&&b| b == b'\n').count() as u64 + 1
    }

    pub(crate) fn error(&self, span: Range<usize>, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> ImportError {
        ImportError::at(self.file, self.line(&span), problem, remedy)
    }

    /// The value, or an error that says which key is missing from the table at `span`.
    pub(crate) fn needed<'v, T>(
        &self,
        value: &'v Maybe<T>,
        key: &str,
        span: &Range<usize>,
        example: &str,
    ) -> Result<&'v Spanned<T>, ImportError> {
        let missing = || self.error(span.clone(), format!("`{key}` is missing"), format!("add {key} = {example}"));
        value.as_ref().ok_or_else(missing)
    }

    /// A number for which `allowed` holds after rounding to f32.
    pub(crate) fn number(
        &self,
        value: &Spanned<f64>,
        key: &str,
        allowed: fn(f32) -> bool,
        rule: &str,
    ) -> Result<f32, ImportError> {
        let rounded = *value.get_ref() as f32;
        if rounded.abs() <= COORDINATE_MAX && allowed(rounded) {
            return Ok(rounded);
        }
        Err(self.error(value.span(), format!("`{key}` is {}", value.get_ref()), format!("give {rule}")))
    }

    /// The same for one that may be left out.
    pub(crate) fn number_or(
        &self,
        value: &Maybe<f64>,
        key: &str,
        otherwise: f32,
        allowed: fn(f32) -> bool,
        rule: &str,
    ) -> Result<f32, ImportError> {
        value.as_ref().map_or(Ok(otherwise), |v| self.number(v, key, allowed, rule))
    }

    /// A whole number in a range.
    pub(crate) fn whole(
        &self,
        value: &Spanned<i64>,
        key: &str,
        range: Range<i64>,
        example: &str,
    ) -> Result<u64, ImportError> {
        if range.contains(value.get_ref()) {
            return Ok(value.get_ref().unsigned_abs());
        }
        let rule = format!("give {} to {}, for example {example}", range.start, range.end - 1);
        Err(self.error(value.span(), format!("`{key}` is {}", value.get_ref()), rule))
    }

    /// As many numbers as `N`, finite and of magnitude up to [`COORDINATE_MAX`].
    pub(crate) fn numbers<const N: usize>(
        &self,
        value: &Spanned<Vec<f64>>,
        key: &str,
        example: &str,
    ) -> Result<[f32; N], ImportError> {
        let numbers = value.get_ref();
        let remedy = format!("give it as {key} = {example}");
        let Ok(found) = <[f64; N]>::try_from(numbers.as_slice()) else {
            let problem = format!("`{key}` has {} numbers", numbers.len());
            return Err(self.error(value.span(), problem, remedy));
        };
        match found.iter().find(|c| !((**c as f32).abs() <= COORDINATE_MAX)) {
            None => Ok(found.map(|c| c as f32)),
            Some(c) => Err(self.error(value.span(), format!("`{key}` holds {c}"), remedy)),
        }
    }

    /// A size in pixels.
    pub(crate) fn size(&self, value: &Spanned<Vec<i64>>, key: &str) -> Result<[u32; 2], ImportError> {
        let max = i64::from(super::SIZE_MAX);
        match value.get_ref()[..] {
            [w, h] if (1..=max).contains(&w) && (1..=max).contains(&h) => Ok([w as u32, h as u32]),
            _ => {
                let remedy = format!("give width and height from 1 to {max}, for example {key} = [640, 480]");
                Err(self.error(value.span(), format!("`{key}` is {:?}", value.get_ref()), remedy))
            }
        }
    }

    /// A colour: linear numbers of 0 and up, or sRGB in hexadecimal made linear (IEC 61966-2-1).
    pub(crate) fn colour(&self, value: &Spanned<Colour>, key: &str) -> Result<[f32; 3], ImportError> {
        let fail = |problem: String| {
            Err(self.error(
                value.span(),
                problem,
                format!("give numbers of 0 and up, {key} = [0.8, 0.2, 0.1], or \"#cc3319\""),
            ))
        };
        let numbers = match value.get_ref() {
            Colour::Grey(grey) => [*grey; 3],
            Colour::Numbers(numbers) => match numbers[..] {
                [r, g, b] => [r, g, b],
                _ => return fail(format!("`{key}` has {} numbers", numbers.len())),
            },
            Colour::Text(text) => match hexadecimal(text) {
                Some(colour) => return Ok(colour),
                None => return fail(format!("`{key}` is {}", quote(text))),
            },
        };
        let colour = numbers.map(|c| c as f32);
        if colour.iter().all(|c| (0.0..=COORDINATE_MAX).contains(c)) {
            return Ok(colour);
        }
        fail(format!("`{key}` is {numbers:?}"))
    }

    pub(crate) fn colour_or(
        &self,
        value: &Maybe<Colour>,
        key: &str,
        otherwise: [f32; 3],
    ) -> Result<[f32; 3], ImportError> {
        value.as_ref().map_or(Ok(otherwise), |v| self.colour(v, key))
    }
}

fn hexadecimal(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#')?.as_bytes();
    if digits.len() != 6 || !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    let nibble = |i: usize| (digits[i] as char).to_digit(16).unwrap_or(0);
    Some([0, 1, 2].map(|i| linear(nibble(2 * i) * 16 + nibble(2 * i + 1))))
}

/// sRGB's curve from a byte.
fn linear(byte: u32) -> f32 {
    let s = f64::from(byte) / 255.0;
    (if s <= 0.04045 { s / 12.92 } else { libm::pow((s + 0.055) / 1.055, 2.4) }) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hexadecimal_colours() {
        assert_eq!(hexadecimal("#000000"), Some([0.0; 3]));
        assert_eq!(hexadecimal("#fFffff"), Some([1.0; 3]));
        // Of the standard's published table: 188 is the byte nearest to half.
        let half = linear(188);
        assert!((half - 0.5029).abs() < 1e-4, "{half}");
        assert!((linear(64) - 0.051_269_46).abs() < 1e-7);
        assert!((linear(10) - 0.003_035_27).abs() < 1e-8);
        for bad in ["", "#", "ffffff", "#fffff", "#ggffff", "#fffffff", "#+1ffff", "#é1234"] {
            assert_eq!(hexadecimal(bad), None, "{bad}");
        }
    }

    #[test]
    fn lines_of_spans() {
        let source = Source { file: "f", text: "a\nb\nc" };
        assert_eq!([0..1, 2..3, 4..5, 99..100].map(|s| source.line(&s)), [1, 2, 3, 3]);
    }
}
