//! The protocol of rays, pages and entries between nodes, model-checked: every order of events of small farms (DESIGN
//! section 2, law 3).
//!
//! stateright looks at every state that can be reached, and at the laws that hold in each (`properties`); `graph` looks at
//! whether every run ends. What is left out is said in `farm`. `HYBRAY_MODEL_STATES=<count>` bounds the large farms, which
//! are run with `cargo test --release -p hybray-scheduler --test model -- --ignored --nocapture`.

mod bug;
mod farm;
mod farms;
mod graph;
mod properties;
mod step;

use bug::Bug;
use farm::Farm;
use graph::{Seen, Wrong, runs_end};
use hybray_scheduler::policy::Policy;
use properties::{BACK, BALANCES, CAPACITY, GOES_ON, LANDS, ONE_FRAME, PLACES, STAYS};
use stateright::{Checker, HasDiscoveries, Model};

const STATES_MAX: usize = 400_000;

/// `farm` with pools of one ray and of two, and links with room for one message and for two.
fn sizes(farm: &Farm) -> impl Iterator<Item = Farm> {
    let sizes = [(1, 1), (1, 2), (2, 1), (2, 2)];
    sizes.map(|(capacity, room)| Farm { capacity, room, granularity: capacity, ..farm.clone() }).into_iter()
}

fn must_end(farm: &Farm, limit: usize) -> Seen {
    match runs_end(farm, limit) {
        Ok(seen) => seen,
        Err(Wrong::Law(law, state)) => panic!("{farm:#?}\n{state:#?}\nbroken: {law}"),
        Err(Wrong::Circle(states, state)) => panic!("{farm:#?}\n{state:#?}\na circle among {states} states"),
        Err(Wrong::TooMany(states)) => panic!("{farm:#?}\nhas more than {states} states"),
    }
}

/// Whichever way policies decide, the laws hold and every run ends.
fn check(name: &str, farm: &Farm) {
    for farm in sizes(farm) {
        let seen = must_end(&farm, STATES_MAX);
        println!("{name}, pools of {}, links of {}: {seen:?}", farm.capacity, farm.room);
        let checker = farm.checker().spawn_bfs().join();
        checker.assert_properties();
        assert_eq!(checker.unique_state_count(), seen.states, "the two searches see the same");
    }
}

#[test]
fn crossing() {
    check("crossing", &farms::crossing());
}

#[test]
fn contended() {
    check("contended", &farms::contended());
}

#[test]
fn ring() {
    check("ring", &farms::ring());
}

#[test]
fn homeless() {
    check("homeless", &farms::homeless());
}

#[test]
fn shared() {
    check("shared", &farms::shared());
}

#[test]
fn hungry() {
    check("hungry", &farms::hungry());
}

#[test]
fn crowded() {
    check("crowded", &farms::crowded());
}

#[test]
fn orders() {
    let mut states = 0;
    for farm in farms::orders() {
        states += must_end(&farm, STATES_MAX).states;
    }
    println!("orders of pages: {states} states");
}

#[test]
fn policies() {
    for (name, policy) in Policy::ALL {
        let mut states = 0;
        for farm in [farms::crossing(), farms::contended(), farms::ring(), farms::homeless(), farms::shared()] {
            states += must_end(&Farm { policy: Some(policy), ..farm }, STATES_MAX).states;
        }
        println!("{name}: {states} states");
    }
}

#[test]
#[ignore = "two minutes, and two gigabytes"]
fn large() {
    let limit = std::env::var("HYBRAY_MODEL_STATES").ok().and_then(|text| text.parse().ok()).unwrap_or(20_000_000);
    for farm in farms::large() {
        for farm in sizes(&farm) {
            println!("{:?} of {farm:?}", must_end(&farm, limit));
        }
    }
}

/// A law that must be found broken.
fn breaks(bug: Bug, farm: Farm, law: &'static str) {
    let farm = Farm { bug: Some(bug), ..farm };
    let checker = farm.checker().finish_when(HasDiscoveries::AnyFailures).target_state_count(STATES_MAX);
    let checker = checker.spawn_bfs().join();
    let found = checker.discoveries();
    let names: Vec<_> = found.keys().collect();
    let steps = found.get(law).map(|path| path.clone().into_actions().len());
    println!("{bug:?}: {names:?}, {steps:?} steps, {} states", checker.unique_state_count());
    assert!(found.contains_key(law), "{bug:?} was to break '{law}', and broke {names:?}");
}

#[test]
fn bugs_break_laws() {
    let two = |farm: Farm| Farm { capacity: 2, granularity: 1, ..farm };
    breaks(Bug::TakesWithoutRoom, farms::crossing(), CAPACITY);
    breaks(Bug::FreesBeforeTook, farms::crossing(), PLACES);
    breaks(Bug::SendsTwoFrames, Farm { room: 2, ..two(farms::crossing()) }, ONE_FRAME);
    breaks(Bug::FetchesWithoutPlace, farms::crossing(), LANDS);
    breaks(Bug::GivesUpLanding, farms::contended(), STAYS);
    breaks(Bug::LaneHasNoPlace, farms::contended(), GOES_ON);
    breaks(Bug::LaneDoesNotFetch, farms::contended(), GOES_ON);
    breaks(Bug::ForwardsToTheFull, farms::crossing(), BACK);
    breaks(Bug::AsksForMore, farms::hungry(), GOES_ON);
    breaks(Bug::StaysReady, two(farms::crowded()), GOES_ON);
    breaks(Bug::EntryWithoutChildren, farms::crossing(), BALANCES);
    breaks(Bug::PaysTwice, farms::crossing(), PLACES);
    breaks(Bug::ForgetsShare, farms::shared(), GOES_ON);
}

/// A bug that breaks no law in any state, but lets a run go on for ever.
#[test]
fn a_bug_goes_in_circles() {
    let found = runs_end(&Farm { capacity: 2, bug: Some(Bug::GivesUpWanted), ..farms::contended() }, STATES_MAX);
    let Err(Wrong::Circle(states, _)) = found else { panic!("{found:?}") };
    println!("a circle among {states} states");
}
