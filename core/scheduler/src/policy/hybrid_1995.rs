//! The report's rule (chapter 3): primary rays are coherent, and their objects are sent to them; for all others object
//! communication would not pay, and they go to the objects.

use super::{Choice, Situation};
use hybray_wire::RayKind;

pub(super) fn decide(s: &Situation) -> Choice {
    if s.kind == RayKind::Primary { Choice::Fetch } else { Choice::Forward }
}
