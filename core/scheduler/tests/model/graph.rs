//! Does every run end? stateright's `eventually` does not look at runs that go round in circles, so the states and steps are
//! taken as a graph here, and its circles looked at.
//!
//! A run is fair if nobody's turn is put off for ever: a class of actions (a node's units of work; its looking at one page;
//! a link's delivering ...) that can be taken in every state from some state on is taken now and then; and one that only
//! waits for room on a link is, if there is room for it again and again. A run that never ends stays, from some state on, in
//! one strongly connected component, and a run that visits all of it is the fairest. So if in each component with a circle
//! some class can be taken in every state, and never leads back into it, no fair run stays; and if some class that needs
//! room can be taken in a few and never leads back, what is left without these is looked at again.

use crate::farm::{Action, Farm, State};
use crate::properties::LAWS;
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

/// A quick hash: equal states are compared whole.
#[derive(Default)]
struct Mix(u64);

impl Hasher for Mix {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }
    fn write_u8(&mut self, i: u8) {
        self.write_u64(i.into());
    }
    fn write_u64(&mut self, i: u64) {
        self.0 = (self.0.rotate_left(5) ^ i).wrapping_mul(0x517c_c1b7_2722_0a95);
    }
    fn write_usize(&mut self, i: usize) {
        self.write_u64(i as u64);
    }
}

/// What was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    pub states: usize,
    pub steps: usize,
    /// States without a next one.
    pub ends: usize,
    /// Components with a circle.
    pub circles: usize,
}

/// Why not every run ends well.
#[derive(Debug)]
pub enum Wrong {
    /// A law is broken.
    Law(&'static str, Box<State>),
    /// A fair run may go on for ever among so many states; one of them.
    Circle(usize, Box<State>),
    /// More states than were allowed, and nothing wrong in so many.
    TooMany(usize),
}

/// Tries everything, at most `limit` states: whether the laws hold and every fair run ends.
pub fn runs_end(farm: &Farm, limit: usize) -> Result<Seen, Wrong> {
    let mut numbers: HashMap<State, u32, BuildHasherDefault<Mix>> = HashMap::default();
    let mut states = vec![farm.start()];
    numbers.insert(states[0], 0);
    // For each state where its steps begin; steps as (state, class).
    let (mut first, mut steps, mut can) = (vec![0], Vec::<(u32, u32)>::new(), Vec::<u128>::new());
    let mut actions: Vec<Action> = Vec::new();
    let mut seen = Seen::default();
    let (mut at, mut needs_room) = (0, 0u128);
    while at < states.len() {
        let state = states[at];
        if let Some((name, _)) = LAWS.iter().find(|(_, law)| !law(farm, &state)) {
            return Err(Wrong::Law(name, Box::new(state)));
        }
        actions.clear();
        farm.actions(&state, &mut actions);
        let mut classes = 0;
        for &action in &actions {
            let Some(next) = farm.next(&state, action) else { continue };
            let new = states.len() as u32;
            let number = *numbers.entry(next).or_insert(new);
            if number == new {
                states.push(next);
            }
            let class = action.class().unwrap_or(127);
            classes |= 1u128 << class;
            needs_room |= u128::from(action.needs_room()) << class;
            steps.push((number, class));
        }
        can.push(classes & !(1 << 127));
        first.push(steps.len());
        if *first.last().unwrap_or(&0) == first[at] {
            seen.ends += 1;
        }
        if states.len() > limit {
            return Err(Wrong::TooMany(states.len()));
        }
        at += 1;
    }
    (seen.states, seen.steps) = (states.len(), steps.len());
    // Sets of states that a run might stay in, the whole first.
    let mut sets = vec![(0..states.len()).collect::<Vec<usize>>()];
    let (mut set_of, mut set_count) = (vec![0; states.len()], 0);
    while let Some(set) = sets.pop() {
        set_count += 1;
        set.iter().for_each(|&at| set_of[at] = set_count);
        let inside = |to: usize| set_of[to] == set_count;
        for circle in components(&first, &steps, &set, &inside).into_iter().filter(|c| c.len() > 1) {
            seen.circles += usize::from(set_count == 1);
            let members: HashSet<usize, BuildHasherDefault<Mix>> = circle.iter().copied().collect();
            let (mut always, mut ever, mut taken) = (u128::MAX, 0, 0u128);
            for &at in &circle {
                (always, ever) = (always & can[at], ever | can[at]);
                let within = steps[first[at]..first[at + 1]].iter().filter(|step| members.contains(&(step.0 as usize)));
                taken = within.fold(taken, |taken, step| taken | 1 << step.1);
            }
            if always & !taken != 0 {
                continue;
            }
            let put_off = ever & needs_room & !taken;
            if put_off == 0 {
                return Err(Wrong::Circle(circle.len(), Box::new(states[circle[0]])));
            }
            // A fair run that stays here keeps away from the states where it could be taken.
            sets.push(circle.into_iter().filter(|&at| can[at] & put_off == 0).collect());
        }
    }
    Ok(seen)
}

/// The strongly connected components of some of the states, those that are `inside`: Tarjan's algorithm, without
/// recursion.
fn components(first: &[usize], steps: &[(u32, u32)], set: &[usize], inside: &dyn Fn(usize) -> bool) -> Vec<Vec<usize>> {
    const NEW: u32 = u32::MAX;
    let count = first.len() - 1;
    let (mut index, mut low, mut done) = (vec![NEW; count], vec![0; count], vec![false; count]);
    let (mut stack, mut path, mut next, mut found) = (Vec::new(), Vec::<(usize, usize)>::new(), 0, Vec::new());
    for &root in set {
        if index[root] != NEW {
            continue;
        }
        path.push((root, first[root]));
        while let Some((at, mut step)) = path.pop() {
            if index[at] == NEW {
                (index[at], low[at]) = (next, next);
                next += 1;
                stack.push(at);
            } else {
                // Back from the state that the last step led to.
                low[at] = low[at].min(low[steps[step - 1].0 as usize]);
            }
            let mut deeper = None;
            while step < first[at + 1] && deeper.is_none() {
                let to = steps[step].0 as usize;
                step += 1;
                if !inside(to) {
                    continue;
                }
                if index[to] == NEW {
                    deeper = Some(to);
                } else if !done[to] {
                    low[at] = low[at].min(index[to]);
                }
            }
            if let Some(to) = deeper {
                path.push((at, step));
                path.push((to, first[to]));
            } else if low[at] == index[at] {
                let begin = stack.iter().rposition(|&member| member == at).unwrap_or(0);
                let component = stack.split_off(begin);
                component.iter().for_each(|&member| done[member] = true);
                found.push(component);
            }
        }
    }
    found
}
