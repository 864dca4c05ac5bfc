//! Runs in pairs, and what a handful of figures has for a middle and for ends.

use std::fmt;

/// Runs `a` and `b` in turn, `runs` times each: A B A B ... Says on standard error how far it is.
pub fn alternate<A, B>(
    what: &str,
    runs: u32,
    mut a: impl FnMut() -> anyhow::Result<A>,
    mut b: impl FnMut() -> anyhow::Result<B>,
) -> anyhow::Result<Vec<(A, B)>> {
    let pair = |run: u32| {
        eprintln!("{what}: pair {run} of {runs}");
        Ok((a()?, b()?))
    };
    (1..=runs).map(pair).collect()
}

/// Middle, least and greatest of some figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub median: f64,
    pub least: f64,
    pub greatest: f64,
}

impl Spread {
    /// Of no figures at all, every part is not a number.
    pub fn of(figures: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = figures.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
        let last = sorted.len().saturating_sub(1);
        Self { median: 0.5 * (at(last / 2) + at(last.div_ceil(2))), least: at(0), greatest: at(last) }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ({:.3} to {:.3})", self.median, self.least, self.greatest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    fn check(figures: &[f64], expected: [f64; 3]) {
        let spread = Spread::of(figures.iter().copied());
        assert_eq!([spread.median, spread.least, spread.greatest], expected, "{figures:?}");
    }

    #[test]
    fn middles_and_ends() {
        check(&[3.0], [3.0, 3.0, 3.0]);
        check(&[3.0, 1.0], [2.0, 1.0, 3.0]);
        check(&[3.0, 1.0, 9.0], [3.0, 1.0, 9.0]);
        check(&[4.0, 1.0, 9.0, 2.0], [3.0, 1.0, 9.0]);
        assert!(Spread::of([]).median.is_nan());
        assert_eq!(Spread::of([0.5, 0.25, 1.0]).to_string(), "0.500 (0.250 to 1.000)");
    }

    #[test]
    fn in_turn() {
        let order = RefCell::new(String::new());
        let say = |name: char| {
            order.borrow_mut().push(name);
            Ok(order.borrow().len())
        };
        let pairs = alternate("test", 3, || say('a'), || say('b')).unwrap();
        assert_eq!(pairs, [(1, 2), (3, 4), (5, 6)]);
        assert_eq!(order.borrow().as_str(), "ababab");
    }

    #[test]
    fn the_first_failure_ends_it() {
        let result = alternate("test", 3, || Ok(1), || -> anyhow::Result<()> { anyhow::bail!("no") });
        assert_eq!(result.unwrap_err().to_string(), "no");
    }
}
