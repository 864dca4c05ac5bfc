//! Demand driven (POV||Ray, section 1; Green and Paddon): every page comes to the node that has its rays.

use super::{Choice, Situation};

pub(super) fn decide(_: &Situation) -> Choice {
    Choice::Fetch
}
