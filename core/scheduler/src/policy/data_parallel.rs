//! Data parallel (the report's sections 6.3 and D.3): every ray goes to the node that has its page.

use super::{Choice, Situation};

pub(super) fn decide(_: &Situation) -> Choice {
    Choice::Forward
}
