//! Rust text without its comments and without what stands in its strings, so that a word can be looked for in the code.

/// The text with every character of a comment as a blank, and of a string or character literal as `_` (its quotes are
/// kept). Lines stay where they are.
pub fn mask(text: &str) -> String {
    let mut rest = Masker { text: text.chars().collect(), at: 0, out: String::with_capacity(text.len()) };
    while let Some(next) = rest.peek(0) {
        match next {
            '/' if rest.peek(1) == Some('/') => rest.line_comment(),
            '/' if rest.peek(1) == Some('*') => rest.block_comment(),
            '"' => rest.string(),
            '\'' => rest.quote(),
            'r' | 'b' | 'c' => rest.word_or_raw_string(),
            c if is_word(c) => rest.word(),
            _ => rest.keep(),
        }
    }
    rest.out
}

/// Whether the line of masked code holds this word, not as a part of another.
pub fn has_word(code: &str, word: &str) -> bool {
    code.match_indices(word).any(|(at, _)| {
        let before = code[..at].chars().next_back();
        let after = code[at + word.len()..].chars().next();
        !before.is_some_and(is_word) && !after.is_some_and(is_word)
    })
}

/// The attributes `#![...]` at the top of a file, without blanks.
pub fn head_attributes(text: &str) -> Vec<String> {
    let code: String = mask(text).chars().filter(|c| !c.is_whitespace()).collect();
    let mut rest = code.as_str();
    let mut attributes = Vec::new();
    while rest.starts_with("#![") {
        let Some(end) = closing_bracket(rest) else {
            break;
        };
        let (attribute, after) = rest.split_at(end + 1);
        attributes.push(attribute.to_owned());
        rest = after;
    }
    attributes
}

fn closing_bracket(text: &str) -> Option<usize> {
    let mut depth = 0_usize;
    for (at, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' if depth <= 1 => return Some(at),
            ']' => depth -= 1,
            _ => {}
        }
    }
    None
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

struct Masker {
    text: Vec<char>,
    at: usize,
    out: String,
}

impl Masker {
    fn peek(&self, ahead: usize) -> Option<char> {
        self.text.get(self.at + ahead).copied()
    }

    fn keep(&mut self) {
        self.out.extend(self.peek(0));
        self.at += 1;
    }

    fn hide(&mut self, mark: char) {
        self.out.extend(self.peek(0).map(|c| if c == '\n' { c } else { mark }));
        self.at += 1;
    }

    fn line_comment(&mut self) {
        while self.peek(0).is_some_and(|c| c != '\n') {
            self.hide(' ');
        }
    }

    fn block_comment(&mut self) {
        let mut depth = 0_usize;
        while let (Some(a), b) = (self.peek(0), self.peek(1)) {
            match (a, b) {
                ('/', Some('*')) => depth += 1,
                ('*', Some('/')) => depth -= 1,
                _ => {
                    self.hide(' ');
                    continue;
                }
            }
            self.hide(' ');
            self.hide(' ');
            if depth == 0 {
                return;
            }
        }
    }

    fn string(&mut self) {
        self.keep();
        while let Some(c) = self.peek(0) {
            match c {
                '"' => return self.keep(),
                '\\' => {
                    self.hide('_');
                    self.hide('_');
                }
                _ => self.hide('_'),
            }
        }
    }

    /// A character literal, or the mark of a lifetime.
    fn quote(&mut self) {
        let is_literal = self.peek(1) == Some('\\') || self.peek(2) == Some('\'');
        self.keep();
        if !is_literal {
            return;
        }
        if self.peek(0) == Some('\\') {
            self.hide('_');
        }
        // The first is content even where it is a quote: '\''.
        self.hide('_');
        while self.peek(0).is_some_and(|c| c != '\'' && c != '\n') {
            self.hide('_');
        }
        self.keep();
    }

    fn word(&mut self) {
        while self.peek(0).is_some_and(is_word) {
            self.keep();
        }
    }

    /// `r"..."`, `br#"..."#` and the like; else a word.
    fn word_or_raw_string(&mut self) {
        let start = usize::from(self.peek(0) != Some('r')) + 1;
        let hashes = (start..).take_while(|&i| self.peek(i) == Some('#')).count();
        let is_raw = self.peek(start - 1) == Some('r') && self.peek(start + hashes) == Some('"');
        if !is_raw {
            return self.word();
        }
        for _ in 0..=start + hashes {
            self.keep();
        }
        while let Some(c) = self.peek(0) {
            if c == '"' && (1..=hashes).all(|i| self.peek(i) == Some('#')) {
                (0..=hashes).for_each(|_| self.keep());
                return;
            }
            self.hide('_');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &str) {
        assert_eq!(mask(text), expected);
    }

    #[test]
    fn comments_are_blank_and_literals_are_dashes() {
        check("a // b\nc", "a     \nc");
        check("a /* b /* c */ d\n */ e", "a               \n    e");
        check(r#"f("unsafe \" x") y"#, r#"f("___________") y"#);
        check("f(\"a\nb\")", "f(\"_\n_\")");
        check(r##"r#"un"safe"# z"##, r##"r#"_______"# z"##);
        check("br\"x\" b\"x\" c\"x\"", "br\"_\" b\"_\" c\"_\"");
        check("'\"' + '\\'' + 'a' + '\\u{1f}' + b'/'", "'_' + '__' + '_' + '______' + b'_'");
        check("fn f<'a>(x: &'a str, y: &'static [u8])", "fn f<'a>(x: &'a str, y: &'static [u8])");
        check("\"// no comment\" // yes", "\"_____________\"       ");
        check("barrier r crab\"x\"", "barrier r crab\"_\"");
        check("r#type", "r#type");
        check("\"open", "\"____");
        check("/* open", "       ");
        check("'", "'");
    }

    #[test]
    fn words_are_whole() {
        assert!(has_word("unsafe {", "unsafe"));
        assert!(has_word("x(unsafe{y})", "unsafe"));
        assert!(!has_word("forbid(unsafe_code)", "unsafe"));
        assert!(!has_word("not_unsafe", "unsafe"));
        assert!(has_word("unsafe_code unsafe", "unsafe"));
    }

    fn check_head(text: &str, expected: &[&str]) {
        assert_eq!(head_attributes(text), expected);
    }

    #[test]
    fn head_attributes_are_read_up_to_the_first_item() {
        check_head(
            "//! Promise.\n#![no_std]\n#![forbid( unsafe_code )]\n\nmod a;\n#![late]",
            &["#![no_std]", "#![forbid(unsafe_code)]"],
        );
        check_head("#![cfg_attr(x,\n  doc = [1])] // why\nuse a;", &["#![cfg_attr(x,doc=[1])]"]);
        check_head("// #![no_std]\nfn main() {}", &[]);
        check_head("#![broken", &[]);
    }
}
