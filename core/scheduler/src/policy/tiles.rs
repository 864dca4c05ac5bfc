//! When is a node given tiles? The 1995 report's three forms of scheduling (chapter 3, "static and dynamic scheduling").

use hybray_wire::TILE;

/// When a node is given its next tiles. None of it changes a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tiles {
    /// When it says that a run is done: true dynamic load balancing.
    #[default]
    Dynamic,
    /// When few of its pixels have not come back: the host counts, and nobody says anything (semi-dynamic).
    PixelCount {
        /// A node has at least so many pixels in the system (table 6.1's, divided by the nodes).
        pixels: u32,
    },
    /// Before the start: all tiles are divided, and that is that.
    Static,
}

/// What the dispatcher knows of a node that may be given tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hand {
    /// Runs that it has.
    pub runs: usize,
    /// Tiles of them that have not come back.
    pub tiles: u32,
    /// Runs that it is meant to have now: one, so that each gets its first before any gets its second, or two.
    pub wanted: usize,
}

/// Whether a node is to be given a run now.
#[must_use]
pub fn gives(tiles: Tiles, hand: &Hand) -> bool {
    match tiles {
        Tiles::Dynamic | Tiles::Static => hand.runs < hand.wanted,
        Tiles::PixelCount { .. } => missing(tiles, hand) > 0,
    }
}

/// Tiles that a node lacks of what it is meant to have in the system: only a count of pixels says so. A tile at the edge
/// of the picture is taken for a whole one.
#[must_use]
pub fn missing(tiles: Tiles, hand: &Hand) -> u32 {
    match tiles {
        Tiles::PixelCount { pixels } => pixels.max(1).div_ceil(TILE * TILE).saturating_sub(hand.tiles),
        Tiles::Dynamic | Tiles::Static => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_gives_what_is_missing_and_the_others_go_by_runs() {
        // 9,000 pixels in the system of 16 nodes: 562 each, which are nine tiles.
        let count = Tiles::PixelCount { pixels: 562 };
        let check = |tiles, runs, in_hand, wanted, expected: (bool, u32)| {
            let hand = Hand { runs, tiles: in_hand, wanted };
            assert_eq!((gives(tiles, &hand), missing(tiles, &hand)), expected, "{tiles:?} {hand:?}");
        };
        check(count, 0, 0, 1, (true, 9));
        check(count, 5, 8, 1, (true, 1));
        check(count, 1, 9, 2, (false, 0));
        check(count, 1, 4_000_000_000, 2, (false, 0));
        check(Tiles::PixelCount { pixels: 0 }, 0, 0, 1, (true, 1));
        check(Tiles::PixelCount { pixels: u32::MAX }, 7, 1, 1, (true, (1 << 26) - 1));
        for tiles in [Tiles::Dynamic, Tiles::Static] {
            check(tiles, 0, 0, 1, (true, 0));
            check(tiles, 1, 9, 1, (false, 0));
            check(tiles, 1, 9, 2, (true, 0));
        }
    }
}
