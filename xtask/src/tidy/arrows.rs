//! The arrows between crates: each uses only crates of a lower rank.
//!
//! The ranks are those of docs/ARCHITECTURE.md. Tests, examples and benchmarks of a crate may use its equals too, but no
//! set of crates may come round to itself, whoever uses whom for what.

use std::collections::{BTreeMap, BTreeSet};

use super::{Problem, tree::Tree};
use crate::workspace::Member;

/// A rank of the house, and a step within it where one of the same rank is built upon another.
type Rank = (u8, u8);

/// Every crate's rank, by its folder. A new crate gets its line here.
const RANKS: [(&str, Rank); 19] = [
    ("core/arena", (0, 0)),
    ("core/geometry", (0, 0)),
    ("core/scene", (1, 0)),
    ("core/wire", (1, 0)),
    ("transport/link", (1, 0)),
    ("core/bintree", (2, 0)),
    ("core/shading", (2, 0)),
    ("core/pyraclip", (3, 0)),
    ("core/tracer", (4, 0)),
    ("core/scheduler", (5, 0)),
    ("transport/memory", (6, 0)),
    ("transport/sim", (6, 0)),
    ("nodes/runner", (7, 0)),
    ("nodes/native", (7, 1)),
    ("nodes/simulated", (7, 1)),
    ("host", (8, 0)),
    ("tests", (8, 1)),
    ("tests/kernels", (8, 2)),
    ("xtask", (8, 1)),
];

/// Refuses arrows that do not lead down, circles, and crates without a rank.
pub fn check(_: &Tree, crates: &[Member]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for member in crates.iter().filter(|member| rank(member).is_none()) {
        let what =
            "this crate has no rank: give it one in RANKS, xtask/src/tidy/arrows.rs, and in docs/ARCHITECTURE.md";
        problems.push(Problem::of(&member.folder, what));
    }
    let by_name: BTreeMap<_, _> = crates.iter().map(|member| (member.name.as_str(), member)).collect();
    for member in crates {
        for arrow in &member.uses {
            let used = by_name.get(arrow.name.as_str()).copied();
            let (Some(used), Some(from)) = (used, rank(member)) else {
                continue;
            };
            let Some(to) = rank(used) else { continue };
            let allowed = if arrow.dev_only { to <= from } else { to < from };
            if !allowed {
                let kind = if arrow.dev_only { "dev-dependency" } else { "dependency" };
                let what = format!("{kind} on {}, rank {} on rank {}: not below", used.folder, show(from), show(to));
                problems.push(Problem::of(&member.folder, what));
            }
        }
    }
    if let Some(circle) = circle(crates) {
        problems.push(Problem::of("Cargo.toml", format!("crates in a circle: {}", circle.join(", "))));
    }
    problems
}

fn rank(member: &Member) -> Option<Rank> {
    RANKS.iter().find(|(folder, _)| *folder == member.folder).map(|(_, rank)| *rank)
}

fn show((rank, step): Rank) -> String {
    if step == 0 { rank.to_string() } else { format!("{rank}.{step}") }
}

/// The folders of a set of crates that use each other round and round, or of some that lead there; none without a circle.
///
/// Crates that use nobody are taken away until none is left to take; what remains holds a circle. A crate whose tests
/// want its own features depends on itself for them, and that is none.
fn circle(crates: &[Member]) -> Option<Vec<&str>> {
    let mut left: BTreeMap<&str, &Member> = crates.iter().map(|member| (member.name.as_str(), member)).collect();
    loop {
        let is_free = |member: &Member| {
            member.uses.iter().all(|arrow| arrow.name == member.name || !left.contains_key(arrow.name.as_str()))
        };
        let free: BTreeSet<_> = left.values().filter(|member| is_free(member)).map(|m| m.name.as_str()).collect();
        if free.is_empty() {
            break;
        }
        left.retain(|name, _| !free.contains(name));
    }
    (!left.is_empty()).then(|| left.values().map(|member| member.folder.as_str()).collect())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{lines, member};
    use super::*;

    fn check_house(crates: &[Member], expected: &[&str]) {
        assert_eq!(lines(check(&Tree::of(&[]), crates)), expected);
    }

    #[test]
    fn arrows_lead_down() {
        check_house(&[member("core/geometry", &[]), member("core/scene", &["geometry"])], &[]);
        check_house(&[member("nodes/runner", &[]), member("nodes/native", &["runner"])], &[]);
        check_house(&[member("host", &[]), member("tests", &["host"]), member("xtask", &["host"])], &[]);
        check_house(
            &[member("core/geometry", &["scene"]), member("core/scene", &[])],
            &["core/geometry: dependency on core/scene, rank 0 on rank 1: not below"],
        );
        check_house(
            &[member("core/wire", &["link"]), member("transport/link", &[])],
            &["core/wire: dependency on transport/link, rank 1 on rank 1: not below"],
        );
        check_house(
            &[member("nodes/runner", &["native"]), member("nodes/native", &[])],
            &["nodes/runner: dependency on nodes/native, rank 7 on rank 7.1: not below"],
        );
        check_house(
            &[member("host", &["tests"]), member("tests", &[])],
            &["host: dependency on tests, rank 8 on rank 8.1: not below"],
        );
    }

    #[test]
    fn tests_of_a_crate_may_use_its_equals() {
        check_house(&[member("core/wire", &["dev:scene"]), member("core/scene", &[])], &[]);
        check_house(
            &[member("core/wire", &["dev:bintree"]), member("core/bintree", &[])],
            &["core/wire: dev-dependency on core/bintree, rank 1 on rank 2: not below"],
        );
    }

    #[test]
    fn circles_are_refused() {
        check_house(
            &[member("core/wire", &["dev:scene"]), member("core/scene", &["dev:wire"]), member("core/arena", &[])],
            &["Cargo.toml: crates in a circle: core/scene, core/wire"],
        );
        check_house(&[member("core/wire", &["dev:wire"])], &[]);
    }

    #[test]
    fn a_new_crate_needs_a_rank() {
        let what =
            "this crate has no rank: give it one in RANKS, xtask/src/tidy/arrows.rs, and in docs/ARCHITECTURE.md";
        check_house(&[member("core/novel", &["geometry"])], &[&format!("core/novel: {what}")]);
    }
}
