//! One chart as an inline SVG: axes, bars, whiskers, lines, a legend.
//!
//! It knows nothing about renders. Lengths are SVG user units, which are CSS pixels at full size; coordinates are written with two
//! decimals. Colours are classes that the page's style sheet fills in, so that a page can be light or dark.
//!
//! Why not `plotters`: it writes colours and fonts into every element, so the page could not follow the reader's colour scheme; it has no
//! `<title>` for a bar's exact value; and its text layout without a font back end is a guess as ours is.

use super::text::{Quantity, escape, finite, shorten};

/// Room for tick labels, axis labels and the legend.
const LEFT: f64 = 52.0;
const RIGHT: f64 = 14.0;
const BOTTOM: f64 = 40.0;
const TOP: f64 = 24.0;
const LEGEND_ROW: f64 = 20.0;
/// A bar wider than this looks like a wall.
const WIDEST_BAR: f64 = 44.0;
/// Width of an average character of the 12 pixel labels.
const CHARACTER: f64 = 6.6;
const LONGEST_LABEL: usize = 32;

/// One axis: what part of it a value lies at, and where it is marked.
pub(super) struct Axis {
    label: String,
    low: f64,
    high: f64,
    /// Base 2; then `low` is above zero.
    logarithmic: bool,
    ticks: Vec<(f64, String)>,
}

impl Axis {
    /// From zero to the round number at or above `most`.
    pub fn up_to(label: &str, quantity: Quantity, most: f64) -> Self {
        Self::linear(label, quantity, most, true)
    }

    /// From zero to `end` exactly: for time.
    pub fn until(label: &str, quantity: Quantity, end: f64) -> Self {
        Self::linear(label, quantity, end, false)
    }

    fn linear(label: &str, quantity: Quantity, most: f64, round_up: bool) -> Self {
        let most = finite(most);
        let (divisor, unit) = quantity.unit(most);
        let whole = quantity == Quantity::Count && divisor == 1.0;
        let shown = if most > 0.0 { most / divisor } else { 1.0 };
        let step = round_step(shown / if round_up { 5.0 } else { 8.0 }, whole);
        let high = if round_up { (shown / step - 1e-9).ceil() * step } else { shown };
        let decimals = (0..6).find(|d| (step * 10f64.powi(*d)).fract() < 1e-6).unwrap_or(6) as usize;
        let ticks = (0..=(high / step + 1e-9) as u32)
            .map(|i| (f64::from(i) * step * divisor, format!("{:.decimals$}", f64::from(i) * step)))
            .collect();
        let label = if unit.is_empty() { label.into() } else { format!("{label} ({unit})") };
        Self { label, low: 0.0, high: high * divisor, logarithmic: false, ticks }
    }

    /// Node numbers: node `i` covers `i` to `i + 1`, and its number stands in the middle.
    pub fn node_numbers(nodes: usize) -> Self {
        let step = nodes.div_ceil(8).next_power_of_two();
        let ticks = (0..nodes).step_by(step).map(|i| (i as f64 + 0.5, i.to_string())).collect();
        Self { label: "node".into(), low: 0.0, high: nodes.max(1) as f64, logarithmic: false, ticks }
    }

    /// From zero to at least `most` nodes, or what is to be compared with a number of nodes.
    pub fn in_nodes(label: &str, most: u32) -> Self {
        let step = most.max(1).div_ceil(8).next_power_of_two();
        let steps = most.max(1).div_ceil(step);
        let ticks = (0..=steps).map(|i| (f64::from(i * step), (i * step).to_string())).collect();
        Self { label: label.into(), low: 0.0, high: f64::from(steps * step), logarithmic: false, ticks }
    }

    /// Powers of two that enclose `least` and `most`.
    pub fn powers_of_two(label: &str, least: f64, most: f64) -> Self {
        let least = finite(least).clamp(1.0 / 1024.0, 1e9).log2().floor();
        let most = finite(most).clamp(1.0 / 1024.0, 1e9).log2().ceil().max(least + 1.0);
        let step = ((most - least) / 8.0).ceil().max(1.0) as i32;
        // Multiples of the step, so that two axes of different ends have ticks in common.
        let ticks = (least as i32..=most as i32)
            .filter(|power| power % step == 0)
            .map(|power| {
                let label = if power < 0 { format!("1/{}", 1u64 << -power) } else { (1u64 << power).to_string() };
                (f64::from(power).exp2(), label)
            })
            .collect();
        Self { label: label.into(), low: least.exp2(), high: most.exp2(), logarithmic: true, ticks }
    }

    /// 0 at the lower end, 1 at the upper end; never outside.
    fn at(&self, value: f64) -> f64 {
        let value = finite(value).clamp(self.low, self.high);
        if self.logarithmic {
            (value / self.low).log2() / (self.high / self.low).log2()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// 1, 2, 2.5 or 5 times a power of ten, at least `least`; a whole number where asked for.
fn round_step(least: f64, whole: bool) -> f64 {
    let least = least.max(1e-12);
    let power = 10f64.powf(least.log10().floor());
    let allowed = |step: &f64| *step >= least * (1.0 - 1e-9) && (!whole || step.fract() == 0.0);
    let steps = [1.0, 2.0, 2.5, 5.0, 10.0].map(|factor| factor * power);
    let step = steps.into_iter().find(allowed).unwrap_or(10.0 * power);
    if whole { step.max(1.0) } else { step }
}

/// A bar that stands on the x axis.
pub(super) struct Bar {
    /// Its place along the x axis.
    pub from: f64,
    pub to: f64,
    /// Its lower and upper end along the y axis.
    pub base: f64,
    pub top: f64,
    /// What a reader sees who points at it.
    pub title: String,
}

/// What stands in the legend beside its name.
#[derive(Clone, Copy)]
pub(super) enum Key {
    Bar,
    Line,
    Dashes,
}

/// A chart in the making.
pub(super) struct Plot {
    width: f64,
    height: f64,
    top: f64,
    x: Axis,
    y: Axis,
    legend: Vec<(Key, String, String)>,
    body: String,
    over: String,
}

impl Plot {
    /// An empty chart of this size. The legend's entries are a key, the class of its colour and a name.
    pub fn new(width: f64, height: f64, x: Axis, y: Axis, legend: &[(Key, &str, &str)]) -> Self {
        let legend: Vec<_> =
            legend.iter().map(|(key, class, name)| (*key, (*class).into(), shorten(name, LONGEST_LABEL))).collect();
        let mut plot = Self { width, height, top: TOP, x, y, legend, body: String::new(), over: String::new() };
        let rows = plot.legend_places().last().map_or(0.0, |(_, row)| row + 1.0);
        plot.top += rows * LEGEND_ROW;
        // Long legends make the chart higher, not flatter.
        plot.height += (rows - 1.0).max(0.0) * LEGEND_ROW;
        plot
    }

    /// Left end and row of each legend entry.
    fn legend_places(&self) -> Vec<(f64, f64)> {
        let (mut x, mut row) = (LEFT, 0.0);
        let mut places = Vec::new();
        for (_, _, name) in &self.legend {
            let wide = 24.0 + name.chars().count() as f64 * CHARACTER + 14.0;
            if x > LEFT && x + wide > self.width {
                (x, row) = (LEFT, row + 1.0);
            }
            places.push((x, row));
            x += wide;
        }
        places
    }

    fn x(&self, value: f64) -> f64 {
        LEFT + self.x.at(value) * (self.width - LEFT - RIGHT)
    }

    fn y(&self, value: f64) -> f64 {
        let foot = self.height - BOTTOM;
        foot - self.y.at(value) * (foot - self.top)
    }

    /// Bars of one colour. `slot` of `slots`: bars that stand side by side in the same place. `gap` is left free of each place.
    pub fn bars(&mut self, class: &str, (slot, slots): (u32, u32), gap: f64, bars: &[Bar]) {
        self.body += &format!("<g class=\"bars {class}\">");
        for bar in bars {
            let (middle, wide) = self.place(bar, slots, gap);
            let left = middle + (f64::from(slot) - f64::from(slots) / 2.0) * wide;
            let (top, foot) = (self.y(bar.top), self.y(bar.base));
            self.body += &format!(
                "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"><title>{}</title></rect>",
                px(left),
                px(top),
                px(wide),
                px(foot - top),
                escape(&bar.title)
            );
        }
        self.body += "</g>";
    }

    /// Middle of a bar's place, and the width of one of the bars in it.
    fn place(&self, bar: &Bar, slots: u32, gap: f64) -> (f64, f64) {
        let (from, to) = (self.x(bar.from), self.x(bar.to));
        let wide = ((to - from) * (1.0 - gap) / f64::from(slots)).min(WIDEST_BAR);
        ((from + to) / 2.0, wide)
    }

    /// A whisker from `base` to `top` of each bar, in the middle of a slot.
    pub fn whiskers(&mut self, (slot, slots): (u32, u32), gap: f64, whiskers: &[Bar]) {
        let mut path = String::new();
        for whisker in whiskers {
            let (middle, wide) = self.place(whisker, slots, gap);
            let x = middle + (f64::from(slot) + 0.5 - f64::from(slots) / 2.0) * wide;
            path += &format!("M{} {}V{}", px(x), px(self.y(whisker.base)), px(self.y(whisker.top)));
        }
        if !path.is_empty() {
            self.over += &format!("<path class=\"whisker\" d=\"{path}\"/>");
        }
    }

    /// A line through points, without marks.
    pub fn line(&mut self, class: &str, points: &[(f64, f64)]) {
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{},{}", px(self.x(*x)), px(self.y(*y)))).collect();
        self.body += &format!("<polyline class=\"line {class}\" points=\"{}\"/>", path.join(" "));
    }

    /// A mark at each point; a reader who points at it sees its title.
    pub fn marks(&mut self, class: &str, points: &[(f64, f64, String)]) {
        self.over += &format!("<g class=\"marks {class}\">");
        for (x, y, title) in points {
            let (x, y) = (px(self.x(*x)), px(self.y(*y)));
            self.over += &format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"3.5\"><title>{}</title></circle>", escape(title));
        }
        self.over += "</g>";
    }

    /// A level across the whole chart, with its name above its right end.
    pub fn level(&mut self, value: f64, name: &str) {
        let y = self.y(value);
        let (left, right) = (px(LEFT), px(self.width - RIGHT));
        self.over += &format!("<path class=\"limit\" d=\"M{left} {}H{right}\"/>", px(y));
        self.over += &format!(
            "<text class=\"limit-name\" x=\"{right}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            px(y - 5.0),
            escape(&shorten(name, LONGEST_LABEL))
        );
    }

    /// The chart as an `svg` element; `title` is what a reader hears who cannot see it.
    pub fn finish(self, title: &str) -> String {
        let mut out = open(self.width, self.height, title);
        for ((key, class, name), (x, row)) in self.legend.iter().zip(self.legend_places()) {
            let y = 9.0 + row * LEGEND_ROW;
            let end = x + 18.0;
            out += &match key {
                Key::Bar => {
                    let (x, y) = (px(x + 4.0), px(y - 5.5));
                    format!(
                        "<g class=\"key {class}\"><rect x=\"{x}\" y=\"{y}\" width=\"11\" height=\"11\" rx=\"2\"/></g>"
                    )
                }
                Key::Line => format!("<path class=\"line {class}\" d=\"M{} {y}H{}\"/>", px(x), px(end)),
                Key::Dashes => format!("<path class=\"line dashed {class}\" d=\"M{} {y}H{}\"/>", px(x), px(end)),
            };
            out += &format!("<text x=\"{}\" y=\"{}\">{}</text>", px(x + 24.0), px(y + 4.0), escape(name));
        }
        out += &format!("<text class=\"axis\" x=\"4\" y=\"{}\">{}</text>", px(self.top - 12.0), escape(&self.y.label));
        let foot = px(self.height - BOTTOM);
        let (left, right) = (px(LEFT), px(self.width - RIGHT));
        let mut grid = String::new();
        for (value, label) in &self.y.ticks {
            let y = self.y(*value);
            grid += &format!("M{left} {}H{right}", px(y));
            out += &format!(
                "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{label}</text>",
                px(LEFT - 7.0),
                px(y + 4.0)
            );
        }
        out += &format!("<path class=\"grid\" d=\"{grid}\"/>");
        let mut marks = format!("M{left} {foot}H{right}");
        for (value, label) in &self.x.ticks {
            let x = px(self.x(*value));
            marks += &format!("M{x} {foot}v4");
            out += &format!(
                "<text class=\"tick\" x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
                px(self.height - BOTTOM + 17.0)
            );
        }
        out += &format!(
            "<text class=\"axis\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            px((LEFT + self.width - RIGHT) / 2.0),
            px(self.height - 5.0),
            escape(&self.x.label)
        );
        out + &self.body + &format!("<path class=\"foot\" d=\"{marks}\"/>") + &self.over + "</svg>"
    }
}

/// One row of [`meters`].
pub(super) struct Meter {
    pub name: String,
    /// Of the limit, 0 to 1; above 1 where the limit was passed.
    pub share: f64,
    /// Another share, shown as a tick.
    pub mean: f64,
    /// What stands at the right.
    pub value: String,
    /// What a reader sees who points at it.
    pub title: String,
}

/// Horizontal bars against a common limit, which is a line across all of them. They fill the height where they are few.
pub(super) fn meters((width, height): (f64, f64), rows: &[Meter], title: &str) -> String {
    const HEAD: f64 = 24.0;
    const BAR: f64 = 17.0;
    let (left, right) = (138.0, width - 158.0);
    let most = rows.iter().map(|row| finite(row.share)).fold(1.0, f64::max).min(2.0);
    let x = |share: f64| left + finite(share).min(most) / most * (right - left);
    let row_height = ((height - HEAD - 26.0) / rows.len() as f64).clamp(BAR + 10.0, 3.0 * BAR);
    let end = HEAD + row_height * rows.len() as f64;
    let height = height.max(end + 26.0);
    let foot = px(end);
    let mut out = open(width, height, title);
    let mut grid = String::new();
    for quarter in 0..=4 {
        let share = f64::from(quarter) * 0.25;
        grid += &format!("M{} {}V{foot}", px(x(share)), px(HEAD - 4.0));
        out += &format!(
            "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}&#160;%</text>",
            px(x(share)),
            px(end + 16.0),
            quarter * 25
        );
    }
    out += &format!("<path class=\"grid\" d=\"{grid}\"/><g class=\"bars meter\">");
    let mut over = String::new();
    for (i, row) in rows.iter().enumerate() {
        let y = HEAD + row_height * i as f64 + (row_height - BAR) / 2.0;
        let class = if finite(row.share) > 1.0 { " class=\"passed\"" } else { "" };
        out += &format!(
            "<rect{class} x=\"{}\" y=\"{}\" width=\"{}\" height=\"{BAR}\"><title>{}</title></rect>",
            px(left),
            px(y),
            px(x(row.share) - left),
            escape(&row.title)
        );
        over += &format!("<path class=\"whisker\" d=\"M{} {}v{BAR}\"/>", px(x(row.mean)), px(y));
        over += &format!(
            "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>",
            px(left - 8.0),
            px(y + 13.0),
            escape(&shorten(&row.name, 20))
        );
        over += &format!(
            "<text class=\"tick\" x=\"{}\" y=\"{}\">{}</text>",
            px(right + 10.0),
            px(y + 13.0),
            escape(&shorten(&row.value, 24))
        );
    }
    let limit = px(x(1.0));
    out += &format!("</g>{over}<path class=\"limit\" d=\"M{limit} {}V{foot}\"/>", px(HEAD - 4.0));
    out += &format!("<text class=\"limit-name\" x=\"{limit}\" y=\"13\" text-anchor=\"middle\">limit</text>");
    out + "</svg>"
}

fn open(width: f64, height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">",
        escape(title)
    )
}

/// A coordinate with at most two decimals.
fn px(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_large_enough() {
        for (least, whole, step) in [
            (0.13, false, 0.2),
            (2.1, false, 2.5),
            (2.1, true, 5.0),
            (0.2, true, 1.0),
            (1.0, false, 1.0),
            (26.0, true, 50.0),
        ] {
            assert!((round_step(least, whole) - step).abs() < 1e-12, "{least} {whole}: {}", round_step(least, whole));
        }
    }

    #[test]
    fn an_axis_ends_on_a_tick_at_or_above_the_most() {
        for most in [0.0, 1.0, 3.0, 7.3, 99.0, 1e4, 123456.0, 9.9e14, f64::NAN] {
            for quantity in [Quantity::Count, Quantity::Bytes, Quantity::Seconds, Quantity::Share, Quantity::Ratio] {
                let axis = Axis::up_to("", quantity, most);
                let last = axis.ticks.last().unwrap();
                assert!((last.0 / axis.high - 1.0).abs() < 1e-9, "{most} {quantity:?}: {last:?} of {}", axis.high);
                assert!(axis.high * (1.0 + 1e-9) >= finite(most) && axis.ticks.len() <= 7, "{most} {quantity:?}");
            }
        }
    }

    #[test]
    fn powers_of_two_enclose_both_ends() {
        let axis = Axis::powers_of_two("", 0.7, 900.0);
        assert_eq!((axis.low, axis.high), (0.5, 1024.0));
        assert_eq!(axis.ticks[..2], [(1.0, "1".to_string()), (4.0, "4".to_string())]);
        assert_eq!(Axis::powers_of_two("", 0.3, 2.0).ticks[0], (0.25, "1/4".to_string()));
        let middle = axis.at(2f64.powf(4.5));
        assert!((middle - 0.5).abs() < 1e-12);
    }
}
