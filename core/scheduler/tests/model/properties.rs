//! What must hold in every state.

use crate::farm::{Action, Broken, Farm, ITEMS, Message, Node, Place, State, bit, members};
use hybray_scheduler::Balance;
use stateright::{Model, Property};

pub const PLACES: &str = "each ray is in one place";
pub const CAPACITY: &str = "no pool is over its capacity";
pub const LANDS: &str = "each page that is asked for has one place";
pub const STAYS: &str = "no page is given up while it lands";
pub const ONE_FRAME: &str = "one frame of rays is under way between two nodes";
pub const BACK: &str = "a ray comes back at most once between two pages";
pub const BALANCES: &str = "a tile balances exactly when all its rays have ended";
pub const GOES_ON: &str = "nothing stands still before the end";

/// A name, and what must hold.
type Law = (&'static str, fn(&Farm, &State) -> bool);

pub const LAWS: [Law; 10] = [
    (PLACES, |farm, s| (0..farm.rays.len()).all(|ray| places_of(farm, s, ray) == s.born >> ray & 1)),
    (CAPACITY, |farm, s| s.nodes.iter().all(|node| Farm::in_pool(node) <= farm.capacity)),
    (LANDS, |farm, s| {
        s.broken != Some(Broken::NoPlace)
            && s.nodes.iter().all(|node| {
                members(node.asked | node.sent).all(|page| {
                    let lands = |p: &&Place| p.page == Some(page as u8) && !p.whole;
                    node.places[..=farm.common].iter().filter(lands).count() == 1
                })
            })
    }),
    (STAYS, |_, s| s.broken != Some(Broken::GivenUp)),
    (ONE_FRAME, |farm, s| {
        let frames = |a: usize, b: usize| {
            let rays = s.wires[a][b].iter().filter(|m| matches!(m, Message::Rays(rays) if *rays != 0)).count();
            let took = s.wires[b][a].iter().filter(|m| matches!(m, Message::Took(_))).count();
            rays + took + usize::from(s.nodes[b].answers[a].is_some())
        };
        s.broken != Some(Broken::TwoFrames) && (0..farm.nodes).all(|a| (0..farm.nodes).all(|b| frames(a, b) <= 1))
    }),
    ("a ray moves at most once between two pages, twice when shared", |farm, s| {
        s.hops.iter().all(|&hops| hops <= 1 + u8::from(farm.shares > 0))
    }),
    (BACK, |_, s| s.back.iter().all(|&back| back <= 1)),
    ("no ray waits unheeded for a page at hand", |farm, s| {
        (0..farm.nodes).all(|n| {
            members(s.nodes[n].waiting)
                .map(|ray| farm.page(s, ray))
                .all(|page| !farm.at_hand(s, n, page) || s.nodes[n].ready & bit(page) != 0)
        })
    }),
    (BALANCES, |farm, s| {
        (0..farm.nodes).filter(|&n| s.nodes[n].begun).all(|n| {
            let all = (0..farm.rays.len()).filter(|&r| farm.rays[r].home == n).all(|r| s.ended[r] == 1);
            s.nodes[n].balance.is_zero() == all
        })
    }),
    (GOES_ON, |farm, s| {
        let mut actions = Vec::new();
        farm.actions(s, &mut actions);
        is_finished(farm, s) || actions.into_iter().any(|action| farm.next(s, action).is_some())
    }),
];

/// Every ray has ended once, and nothing is left over.
pub fn is_finished(farm: &Farm, s: &State) -> bool {
    let over = |node: &Node| {
        *node == Node { begun: node.begun, places: node.places, full: node.full, ..farm.start().nodes[0] }
    };
    let quiet = s.wires.as_flattened().as_flattened().iter().all(|m| *m == Message::None);
    let landing = s.nodes.iter().flat_map(|node| node.places).any(|p| p.page.is_some() && !p.whole);
    let all = (0..farm.rays.len()).all(|ray| s.ended[ray] == 1);
    let zero = s.nodes.iter().all(|node| node.balance == Balance::ZERO);
    all && zero && quiet && !landing && s.helping == 0 && s.nodes.iter().all(over)
}

/// In how many places a ray is. What a frame left behind counts once the frame was refused: before, the ray is the frame.
fn places_of(farm: &Farm, s: &State, ray: usize) -> u8 {
    let holds = |set: u8| set >> ray & 1;
    let mut places = s.ended[ray];
    for a in 0..farm.nodes {
        let node = &s.nodes[a];
        places += holds(node.lane) + holds(node.waiting) + u8::from(node.aside == Some(ray as u8));
        for b in 0..farm.nodes {
            places += holds(node.outbox[b]) + holds(node.owed[b]);
            let refused = s.nodes[b].answers[a] == Some(false) || s.wires[b][a].contains(&Message::Took(false));
            if refused {
                places += holds(node.flight[b]);
            }
            for message in s.wires[a][b] {
                if let Message::Rays(rays) | Message::Partials(rays) = message {
                    places += holds(rays);
                }
            }
        }
    }
    places
}

impl Model for Farm {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        assert!(self.rays.len() <= ITEMS && self.owners.len() <= ITEMS);
        vec![self.start()]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        // What is broken once says nothing about what comes after.
        if state.broken.is_none() && state.ended.iter().all(|&ended| ended <= 1) {
            Farm::actions(self, state, actions);
        }
    }

    fn next_state(&self, state: &State, action: Action) -> Option<State> {
        self.next(state, action)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        LAWS.map(|(name, law)| Property::always(name, law)).into()
    }
}
