//! A picture of what is all around, cut into cells that light by what shines in each: as few as it takes.
//!
//! A cell shines evenly, so light in it is moved by at most its size. What is cut next is the cell in which most light moves
//! farthest: its size (radians) times how much its light deviates from the mean. Where it is cut, and along which side, is where least
//! is left of that. Cells are no larger than 45 degrees, for they are also what samples are spread over.
//! Source of the criterion: Viriyothai and Debevec, *Variance Minimization Light Probe Sampling*, SIGGRAPH 2009 posters; of the cuts:
//! Debevec, *A Median Cut Algorithm for Light Probe Sampling*, SIGGRAPH 2005 posters.

use super::{Image, value};
use hybray_shading::{Cell, Cut, Format};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Columns that are told apart; a texel of 0.18 degrees. Half as many rows.
const COLUMNS_MAX: usize = 2048;
/// Share of all light times radians that may be left: nothing that can be seen moves.
const ENOUGH: f64 = 1e-4;
/// Sides of cells at most, radians.
const SIDE_MAX: f64 = PI / 4.0 + 1e-9;
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Sums over all texels above and to the left: solid angle, luminance, its square and the three channels, each times the solid angle.
struct Sums {
    columns: usize,
    rows: usize,
    /// Left edges of columns and the right edge of the last: turns.
    turns: Vec<f64>,
    /// Upper edges of rows and the lower edge of the last: angles from the top.
    angles: Vec<f64>,
    sums: Vec<[f64; 6]>,
}

/// Columns and rows.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Part {
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Sums {
    fn new(image: &Image, format: Format) -> Self {
        let (width, height) = (usize::from(image.width), usize::from(image.height));
        let (columns, rows) = (width.min(COLUMNS_MAX), height.min(COLUMNS_MAX / 2));
        let edges = |of: usize, parts: usize| (0..=parts).map(|i| i * of / parts).collect::<Vec<_>>();
        let (across, down) = (edges(width, columns), edges(height, rows));
        let angle = |row: usize| PI * row as f64 / height as f64;
        let of_row = |row: usize| {
            let mut sums = vec![[0.0; 6]; columns];
            for y in down[row]..down[row + 1] {
                let texel = TAU / width as f64 * (angle(y).cos() - angle(y + 1).cos());
                for (column, sum) in sums.iter_mut().enumerate() {
                    for x in across[column]..across[column + 1] {
                        let [r, g, b, _] = value(image.get(x, y), format).map(f64::from);
                        let luminance = LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b;
                        let terms = [1.0, luminance, luminance * luminance, r, g, b];
                        (0..6).for_each(|i| sum[i] += terms[i] * texel);
                    }
                }
            }
            sums
        };
        let found: Vec<_> = (0..rows).into_par_iter().map(of_row).collect();
        let stride = columns + 1;
        let mut sums = vec![[0.0; 6]; stride * (rows + 1)];
        for (row, found) in found.iter().enumerate() {
            let mut left = [0.0; 6];
            for (column, terms) in found.iter().enumerate() {
                (0..6).for_each(|i| left[i] += terms[i]);
                let above = sums[row * stride + column + 1];
                sums[(row + 1) * stride + column + 1] = std::array::from_fn(|i| above[i] + left[i]);
            }
        }
        let turns = across.iter().map(|&x| x as f64 / width as f64).collect();
        Self { columns, rows, turns, angles: down.into_iter().map(angle).collect(), sums }
    }

    fn of(&self, part: &Part) -> [f64; 6] {
        let at = |row: usize, column: usize| &self.sums[row * (self.columns + 1) + column];
        let Part { columns, rows } = part;
        let corners = [
            at(rows.end, columns.end),
            at(rows.start, columns.end),
            at(rows.end, columns.start),
            at(rows.start, columns.start),
        ];
        // Differences of large sums may be a little less than nothing.
        std::array::from_fn(|i| (corners[0][i] - corners[1][i] - corners[2][i] + corners[3][i]).max(0.0))
    }

    /// Its sides, radians: along the circle of latitude that is the longest in it, and down.
    fn sides(&self, part: &Part) -> [f64; 2] {
        let [from, to] = [self.angles[part.rows.start], self.angles[part.rows.end]];
        let widest = if from < PI / 2.0 && to > PI / 2.0 { 1.0 } else { from.sin().max(to.sin()) };
        [TAU * (self.turns[part.columns.end] - self.turns[part.columns.start]) * widest, to - from]
    }

    /// Light that deviates from the mean, times radians.
    fn moved(&self, part: &Part) -> f64 {
        let [solid, light, squares, ..] = self.of(part);
        if solid <= 0.0 || part.columns.len() * part.rows.len() == 1 {
            return 0.0;
        }
        let variance = (squares / solid - (light / solid).powi(2)).max(0.0);
        // What is left of sums of so many digits is no deviation.
        let variance = if variance < 1e-12 * squares / solid { 0.0 } else { variance };
        let [across, down] = self.sides(part);
        solid * variance.sqrt() * across.max(down)
    }

    /// In two, where least is moved.
    fn cut(&self, part: &Part) -> Option<[Part; 2]> {
        let Part { columns, rows } = part;
        let mut by_column = (columns.start + 1..columns.end).map(|at| {
            let part = |columns| Part { columns, rows: rows.clone() };
            [part(columns.start..at), part(at..columns.end)]
        });
        let mut by_row = (rows.start + 1..rows.end).map(|at| {
            let part = |rows| Part { columns: columns.clone(), rows };
            [part(rows.start..at), part(at..rows.end)]
        });
        let [across, down] = self.sides(part);
        if across > SIDE_MAX || down > SIDE_MAX {
            // In the middle.
            let halves = |range: &Range<usize>| range.len() / 2;
            return if across >= down && columns.len() > 1 || rows.len() == 1 {
                by_column.nth(halves(columns).max(1) - 1)
            } else {
                by_row.nth(halves(rows).max(1) - 1)
            };
        }
        let cost = |two: &[Part; 2]| self.moved(&two[0]) + self.moved(&two[1]);
        by_column.chain(by_row).map(|two| (cost(&two), two)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, two)| two)
    }

    /// What it comes to that a part is cut next.
    fn urgency(&self, part: &Part) -> f64 {
        let [_, light, ..] = self.of(part);
        let [across, down] = self.sides(part);
        let cuts = part.columns.len() * part.rows.len() > 1;
        if light > 0.0 && cuts && (across > SIDE_MAX || down > SIDE_MAX) { f64::INFINITY } else { self.moved(part) }
    }
}

/// The most urgent first; of equals the first.
struct Next {
    urgency: f64,
    node: usize,
}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        self.urgency.total_cmp(&other.urgency).then(other.node.cmp(&self.node))
    }
}
impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Next {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Next {}

/// At most `most` cells of a picture (latitude and longitude), and the cuts between them; none if it is black. Neighbours follow one
/// another.
#[must_use]
pub fn cells(image: &Image, format: Format, most: usize) -> (Vec<Cell>, Vec<Cut>) {
    let sums = Sums::new(image, format);
    let all = Part { columns: 0..sums.columns, rows: 0..sums.rows };
    let total = sums.of(&all)[1];
    let mut nodes = vec![(all.clone(), None)];
    let mut next = BinaryHeap::from([Next { urgency: sums.urgency(&all), node: 0 }]);
    let (mut leaves, mut left) = (1, 0.0);
    while leaves < most
        && let Some(Next { urgency, node }) = next.pop()
        && (urgency == f64::INFINITY || left > ENOUGH * total || left == 0.0 && urgency > 0.0)
    {
        let Some(two) = sums.cut(&nodes[node].0) else { continue };
        nodes[node].1 = Some(nodes.len());
        for part in two {
            next.push(Next { urgency: sums.urgency(&part), node: nodes.len() });
            nodes.push((part, None));
        }
        leaves += 1;
        left = next.iter().map(|next| next.urgency).filter(|u| u.is_finite()).sum();
    }
    if total <= 0.0 {
        return (Vec::new(), Vec::new());
    }
    let mut cells = Vec::with_capacity(leaves);
    let mut cuts: Vec<Cut> = Vec::with_capacity(nodes.len());
    let (mut sum, mut before) = (0.0, 0.0f32);
    let height = |row: usize| sums.angles[row].cos() as f32;
    // A node, and the cut whose other side it is.
    let mut stack = vec![(0, None)];
    while let Some((node, of)) = stack.pop() {
        if let Some(of) = of {
            let next = cuts.len() as u32;
            let cut: &mut Cut = &mut cuts[of];
            cut.to |= next;
        }
        let (Part { columns, rows }, inner) = &nodes[node];
        if let &Some(first) = inner {
            let upper = &nodes[first].0;
            let cut = if upper.rows == *rows {
                Cut { at: sums.turns[upper.columns.end] as f32, to: 0 }
            } else {
                Cut { at: height(upper.rows.end), to: Cut::LATITUDE }
            };
            stack.extend([(first + 1, Some(cuts.len())), (first, None)]);
            cuts.push(cut);
            continue;
        }
        let [_, light, _, r, g, b] = sums.of(&nodes[node].0);
        sum += light;
        let up_to = (sum / total) as f32;
        // What has no chance is not there; of a light of 2^-24 of all, nothing is seen.
        let is_there = up_to > before;
        cuts.push(Cut { at: 0.0, to: Cut::CELL | if is_there { cells.len() as u32 } else { Cut::DARK } });
        if is_there {
            let chance = f64::from(up_to) - f64::from(before);
            cells.push(Cell {
                turns: [sums.turns[columns.start] as f32, sums.turns[columns.end] as f32],
                heights: [height(rows.end), height(rows.start)],
                colour: [r, g, b].map(|c| (c / (PI * chance)) as f32),
                up_to,
            });
            before = up_to;
        }
    }
    // The last one's is 1, whatever was rounded.
    if let Some(last) = cells.last_mut() {
        last.up_to = 1.0;
    }
    (cells, cuts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hybray_shading::to_shared_exponent;

    fn light(width: u16, height: u16, radiance: impl Fn(f64, f64) -> [f32; 3] + Sync) -> Image {
        Image::from_fn(width, height, |x, y| {
            let turn = (x as f64 + 0.5) / f64::from(width);
            let angle = (y as f64 + 0.5) / f64::from(height) * PI;
            to_shared_exponent(radiance(turn, angle)).to_le_bytes()
        })
    }

    fn direction(turn: f64, height: f64) -> [f64; 3] {
        let across = (1.0 - height * height).max(0.0).sqrt();
        let (sin, cos) = (TAU * (turn - 0.5)).sin_cos();
        [cos * across, height, sin * across]
    }

    /// Irradiance over pi, texel by texel.
    fn exact(image: &Image, normal: [f64; 3]) -> [f64; 3] {
        let (w, h) = (f64::from(image.width), f64::from(image.height));
        let mut sum = [0.0; 3];
        for y in 0..usize::from(image.height) {
            let (top, bottom) = ((PI * y as f64 / h).cos(), (PI * (y as f64 + 1.0) / h).cos());
            for x in 0..usize::from(image.width) {
                let towards = direction((x as f64 + 0.5) / w, (top + bottom) / 2.0);
                let cosine: f64 = (0..3).map(|i| towards[i] * normal[i]).sum();
                let seen = value(image.get(x, y), Format::SharedExponent);
                (0..3).for_each(|c| sum[c] += f64::from(seen[c]) * cosine.max(0.0) * TAU / w * (top - bottom) / PI);
            }
        }
        sum
    }

    /// The same from cells, each cut into 8 x 8.
    fn of_cells(cells: &[Cell], normal: [f64; 3]) -> [f64; 3] {
        let (mut sum, mut before) = ([0.0; 3], 0.0);
        for cell in cells {
            let chance = f64::from(cell.up_to) - before;
            before = f64::from(cell.up_to);
            let mix = |[a, b]: [f32; 2], t: f64| f64::from(a) + f64::from(b - a) * t;
            for i in 0..64 {
                let (s, t) = (f64::from(i % 8) / 8.0 + 1.0 / 16.0, f64::from(i / 8) / 8.0 + 1.0 / 16.0);
                let towards = direction(mix(cell.turns, s), mix(cell.heights, t));
                let cosine: f64 = (0..3).map(|i| towards[i] * normal[i]).sum();
                (0..3).for_each(|c| sum[c] += f64::from(cell.colour[c]) * cosine.max(0.0) * chance / 64.0);
            }
        }
        sum
    }

    /// A sky that is brighter towards the horizon, a brown ground, and a sun of 30,000.
    fn sky(turn: f64, angle: f64) -> [f32; 3] {
        let from_sun = {
            let (a, b) = (direction(turn, angle.cos()), direction(0.3, 0.6));
            (0..3).map(|i| a[i] * b[i]).sum::<f64>().min(1.0).acos()
        };
        if from_sun < 0.01 {
            [30_000.0, 28_000.0, 25_000.0]
        } else if angle < PI / 2.0 {
            let low = angle as f32 / 1.6;
            [0.2 + 0.6 * low, 0.4 + 0.5 * low, 1.0]
        } else {
            [0.2, 0.15, 0.1]
        }
    }

    #[test]
    fn cells_light_as_the_picture_does() {
        // An odd size that is more than what is told apart, and a small one.
        for (width, height) in [(2500, 1249), (64, 32)] {
            let image = light(width, height, sky);
            for (most, slack) in [(64, 0.03), (1024, 0.004)] {
                let (cells, _) = cells(&image, Format::SharedExponent, most);
                assert!(cells.len() <= most && cells.last().unwrap().up_to == 1.0);
                for normal in
                    [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-0.48, 0.6, -0.64], [0.36, -0.8, 0.48]]
                {
                    let (wanted, found) = (exact(&image, normal), of_cells(&cells, normal));
                    for c in 0..3 {
                        let error = (found[c] / wanted[c] - 1.0).abs();
                        assert!(error < slack, "{width} {most} {normal:?}: {found:?} {wanted:?}");
                    }
                }
            }
        }
    }

    /// The sun's cells are as small as the sun: shadows have edges.
    #[test]
    fn the_sun_is_small() {
        let image = light(1024, 512, sky);
        let (cells, _) = cells(&image, Format::SharedExponent, 256);
        let mut before = 0.0;
        let (mut near, mut all) = (0.0, 0.0);
        for cell in &cells {
            let chance = cell.up_to - before;
            before = cell.up_to;
            let towards = |i: usize, j: usize| direction(f64::from(cell.turns[i]), f64::from(cell.heights[j]));
            let sun = direction(0.3, 0.6);
            let farthest = [(0, 0), (0, 1), (1, 0), (1, 1)]
                .into_iter()
                .map(|(i, j)| (0..3).map(|k| towards(i, j)[k] * sun[k]).sum::<f64>().min(1.0).acos())
                .fold(0.0, f64::max);
            if farthest < 0.05 {
                near += chance;
            }
            all += chance;
        }
        let share = {
            let sun = PI * 0.01 * 0.01 * 28_000.0;
            sun / (sun + TAU * 0.8 + TAU * 0.15)
        };
        assert!(f64::from(near / all) > 0.97 * share, "{near} {share}");
    }

    /// What is even needs no more cells than samples are spread over, and what is black none.
    #[test]
    fn as_many_as_it_takes() {
        let even = light(512, 256, |_, _| [0.5, 0.25, 1.0]);
        let (found, _) = cells(&even, Format::SharedExponent, 1024);
        assert!((24..=64).contains(&found.len()), "{}", found.len());
        let lit = of_cells(&found, [0.6, 0.0, -0.8]);
        assert!((lit[0] - 0.5).abs() < 2e-3 && (lit[2] - 1.0).abs() < 4e-3, "{lit:?}");
        assert_eq!(cells(&light(8, 4, |_, _| [0.0; 3]), Format::SharedExponent, 64), (Vec::new(), Vec::new()));
        let (one, _) = cells(&light(1, 1, |_, _| [1.0; 3]), Format::SharedExponent, 64);
        assert_eq!((one.len(), one[0].turns, one[0].up_to), (1, [0.0, 1.0], 1.0));
    }
}
