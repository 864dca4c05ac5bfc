//! What an action makes of a state.

use crate::bug::Bug;
use crate::farm::{Action, Broken, Farm, Message, Place, ROOM, Set, State, Unit, bit, count, members};
use hybray_scheduler::Balance;
use hybray_scheduler::policy::Choice;
use hybray_scheduler::rules::{self, PlaceState};

impl Farm {
    /// What `action` makes of `before`: `None` if it changes nothing.
    pub fn next(&self, before: &State, action: Action) -> Option<State> {
        let mut s = *before;
        match action {
            Action::Deliver { from, to } => self.deliver(&mut s, from, to),
            Action::Work { node, page, ray } => self.work(&mut s, node, page, ray),
            Action::Answer { node, to } => {
                if let Some(taken) = s.nodes[node].answers[to]
                    && self.send(&mut s, node, to, Message::Took(taken))
                {
                    s.nodes[node].answers[to] = None;
                }
            }
            Action::Pay { node, to } => {
                let me = s.nodes[node];
                let owed = me.owed[to];
                let idle = self.is_idle(&s, node);
                if rules::pays(idle, self.partials_free(&me), self.partials, count(owed), self.granularity)
                    && self.send(&mut s, node, to, Message::Partials(owed))
                    && !self.is(Bug::PaysTwice)
                {
                    s.nodes[node].owed[to] = 0;
                }
            }
            Action::Serve { node, to } => {
                if let Some(page) = s.nodes[node].serves[to][0]
                    && self.send(&mut s, node, to, Message::Part(page))
                {
                    let queue = &mut s.nodes[node].serves[to];
                    *queue = [queue[1], None];
                }
            }
            Action::Decide { node, page, choice, nth } => {
                let owner = self.owners[page];
                let (full, traces) = (s.nodes[node].full & bit(owner) != 0, self.traces(owner));
                let rays = self.waiting_for(&s, node, page);
                let forwards = choice == Choice::Forward || {
                    let has_place = self.request(&mut s, node, page, false, nth)?;
                    !has_place && rules::goes_again(self.moved(&s, rays), full, traces)
                };
                if forwards {
                    let me = &mut s.nodes[node];
                    me.waiting &= !rays;
                    me.outbox[owner] |= rays;
                    me.sends |= bit(owner);
                }
            }
            Action::DecideLane { node, nth } => {
                let page = self.page(&s, usize::from(s.nodes[node].aside?));
                if !self.at_hand(&s, node, page) && !self.is(Bug::LaneDoesNotFetch) {
                    self.request(&mut s, node, page, true, nth)?;
                }
            }
            Action::Ask { node, page } => {
                let owner = self.owners[page];
                let asked = members(s.nodes[node].sent).filter(|&p| self.owners[p] == owner).count();
                if (rules::may_ask(asked) || self.is(Bug::AsksForMore))
                    && self.send(&mut s, node, owner, Message::Fetch(page as u8))
                {
                    s.nodes[node].asked &= !bit(page);
                    s.nodes[node].sent |= bit(page);
                }
            }
            Action::Send { node, to, rays } => self.send_rays(&mut s, node, to, rays),
            Action::SayNone { node, to } => {
                if self.send(&mut s, node, to, Message::Rays(0)) {
                    s.nodes[node].none_to_share &= !bit(to);
                }
            }
            Action::Share { node, with } => self.share(&mut s, node, with),
            Action::SayIdle { node } => {
                let me = &s.nodes[node];
                if rules::says_idle(me.helped, self.is_idle(&s, node), Self::in_pool(me)) {
                    s.nodes[node].helped = false;
                    s.helping &= !bit(node);
                }
            }
        }
        (s != *before).then_some(s)
    }

    fn send(&self, s: &mut State, from: usize, to: usize, message: Message) -> bool {
        let free = s.wires[from][to][..self.room].iter_mut().find(|m| **m == Message::None);
        free.map(|place| *place = message).is_some()
    }

    fn deliver(&self, s: &mut State, from: usize, to: usize) {
        let wire = &mut s.wires[from][to];
        let message = wire[0];
        wire.rotate_left(1);
        wire[ROOM - 1] = Message::None;
        match message {
            Message::None => {}
            Message::Rays(0) => s.nodes[to].helped = true,
            Message::Rays(rays) => {
                let free = self.free(&s.nodes[to]);
                let taken = rules::takes(count(rays), free, self.capacity) || self.is(Bug::TakesWithoutRoom);
                if s.nodes[to].answers[from].replace(taken).is_some() {
                    s.broken = Some(Broken::TwoFrames);
                }
                if !taken {
                    s.nodes[to].helped |= rules::was_helped(false, false) && !self.is(Bug::ForgetsShare);
                    return;
                }
                for ray in members(rays) {
                    s.hops[ray] += 1;
                    let settled = usize::from(s.step[ray]) + 1 == self.rays[ray].pages.len();
                    s.nodes[to].helped |= rules::was_helped(true, settled && self.is_primary(ray));
                    self.push(s, to, ray);
                }
            }
            Message::Took(taken) => {
                let node = &mut s.nodes[to];
                node.full = node.full & !bit(from) | if taken { 0 } else { bit(from) };
                let back = core::mem::take(&mut node.flight[from]);
                if !rules::frees(taken) {
                    for ray in members(back) {
                        s.back[ray] = (s.back[ray] + 1).min(2);
                        self.push(s, to, ray);
                    }
                }
            }
            Message::Fetch(page) => {
                let queue = &mut s.nodes[to].serves[from];
                let asked = queue.iter().flatten().count();
                // What is beyond its due is not heard.
                if rules::may_ask(asked) {
                    queue[asked] = Some(page);
                }
            }
            Message::Part(page) => {
                let page = usize::from(page);
                s.nodes[to].sent &= !bit(page);
                let places = &mut s.nodes[to].places[..=self.common];
                match places.iter_mut().find(|p| p.page == Some(page as u8) && !p.whole) {
                    Some(place) => place.whole = true,
                    None => {
                        s.broken = Some(Broken::NoPlace);
                        return;
                    }
                }
                if self.waiting_for(s, to, page) != 0 {
                    s.nodes[to].ready |= bit(page);
                }
            }
            Message::Partials(rays) => members(rays).for_each(|ray| self.come_home(s, ray)),
        }
    }

    /// Queues a ray, as the pool does; there is room.
    fn push(&self, s: &mut State, node: usize, ray: usize) {
        let page = self.page(s, ray);
        let here = self.at_hand(s, node, page);
        s.nodes[node].waiting |= bit(ray);
        if here {
            s.nodes[node].ready |= bit(page);
        }
    }

    fn push_or_aside(&self, s: &mut State, node: usize, ray: usize) {
        if self.free(&s.nodes[node]) > 0 {
            self.push(s, node, ray);
        } else {
            s.nodes[node].aside = Some(ray as u8);
        }
    }

    fn come_home(&self, s: &mut State, ray: usize) {
        s.ended[ray] = s.ended[ray].saturating_add(1);
        s.nodes[self.rays[ray].home].balance.add(self.entry(ray));
    }

    fn end(&self, s: &mut State, node: usize, ray: usize) {
        let home = self.rays[ray].home;
        if home == node {
            self.come_home(s, ray);
        } else {
            s.nodes[node].owed[home] |= bit(ray);
        }
    }

    /// Takes a ray on as far as the pages at hand go; whether it needs another.
    fn take(&self, s: &mut State, node: usize, ray: usize) -> bool {
        let plan = &self.rays[ray];
        while usize::from(s.step[ray]) < plan.pages.len() {
            if !self.at_hand(s, node, self.page(s, ray)) {
                return true;
            }
            s.step[ray] += 1;
            s.hops[ray] = 0;
            s.back[ray] = 0;
        }
        if plan.children.is_empty() {
            self.end(s, node, ray);
        } else {
            s.nodes[node].lane |= bit(ray);
        }
        false
    }

    fn work(&self, s: &mut State, n: usize, page: usize, ray: usize) {
        match self.unit(s, n) {
            Unit::Nothing | Unit::Stuck => {}
            Unit::Aside => {
                let Some(ray) = s.nodes[n].aside.take() else { return };
                if self.take(s, n, usize::from(ray)) {
                    s.nodes[n].aside = Some(ray);
                }
            }
            Unit::Lane => {
                // Depth first: the record that none of the others has spawned any of.
                let spawned = |ray: usize| &self.rays[ray].children[..usize::from(s.cursor[ray])];
                let is_top = |&ray: &usize| !spawned(ray).iter().any(|&child| s.nodes[n].lane & bit(child) != 0);
                let Some(top) = members(s.nodes[n].lane).find(is_top) else { return };
                let Some(&child) = self.rays[top].children.get(usize::from(s.cursor[top])) else {
                    s.nodes[n].lane &= !bit(top);
                    return self.end(s, n, top);
                };
                s.cursor[top] += 1;
                s.born |= bit(child);
                if self.take(s, n, child) {
                    self.push_or_aside(s, n, child);
                }
            }
            Unit::Ready => {
                if !self.at_hand(s, n, page) {
                    if !self.is(Bug::StaysReady) {
                        s.nodes[n].ready &= !bit(page);
                    }
                    return;
                }
                s.nodes[n].waiting &= !bit(ray);
                if self.waiting_for(s, n, page) == 0 {
                    s.nodes[n].ready &= !bit(page);
                }
                if self.take(s, n, ray) {
                    self.push_or_aside(s, n, ray);
                }
            }
            Unit::Primary => {
                let Some(ray) = members(self.pending(s, n)).next() else { return };
                s.born |= bit(ray);
                if self.take(s, n, ray) {
                    self.push_or_aside(s, n, ray);
                }
            }
            Unit::Begin => {
                s.nodes[n].begun = true;
                s.nodes[n].balance = Balance::debit(members(self.primaries(n)).map(Self::id));
            }
        }
    }

    /// As `Node::request` and `Cache::reserve`: whether the page has a place. `None` if there are fewer than `nth` + 1
    /// places to choose from.
    fn request(&self, s: &mut State, n: usize, page: usize, for_lane: bool, nth: usize) -> Option<bool> {
        let node = &s.nodes[n];
        let under_way = node.asked | node.sent;
        if under_way & bit(page) != 0 {
            return (nth == 0).then_some(true);
        }
        if !rules::may_request(count(under_way), self.requests, self.requests, for_lane) {
            return (nth == 0).then_some(false);
        }
        if self.is(Bug::FetchesWithoutPlace) {
            s.nodes[n].asked |= bit(page);
            return Some(true);
        }
        let can_go = |place: &Place| {
            let rays_wait = place.page.is_some_and(|p| self.waiting_for(s, n, usize::from(p)) != 0);
            rules::can_go(place.state(), rays_wait && !self.is(Bug::GivesUpWanted))
                || (self.is(Bug::GivesUpLanding) && place.state() == PlaceState::Landing)
        };
        let common = (0..self.common).filter(|&at| can_go(&node.places[at]));
        let found = common.clone().nth(nth);
        if found.is_none() && nth > 0 {
            return None;
        }
        let lanes = node.places[self.common];
        let lane_can = for_lane && rules::lane_can_have(lanes.state()) && !self.is(Bug::LaneHasNoPlace);
        let Some(at) = found.or(lane_can.then_some(self.common)) else { return Some(false) };
        if s.nodes[n].places[at].state() == PlaceState::Landing {
            s.broken = Some(Broken::GivenUp);
        }
        s.nodes[n].places[at] = Place { page: Some(page as u8), whole: false };
        s.nodes[n].asked |= bit(page);
        Some(true)
    }

    fn send_rays(&self, s: &mut State, node: usize, to: usize, rays: Set) {
        let me = s.nodes[node];
        let free = rules::may_send(count(me.flight[to])) || self.is(Bug::SendsTwoFrames);
        if !free || !self.send(s, node, to, Message::Rays(rays)) {
            return;
        }
        let me = &mut s.nodes[node];
        me.outbox[to] &= !rays;
        if !self.is(Bug::FreesBeforeTook) {
            me.flight[to] |= rays;
        }
        if me.outbox[to] == 0 {
            me.sends &= !bit(to);
        }
    }

    fn share(&self, s: &mut State, node: usize, with: usize) {
        let has_run = |n: usize| self.primaries(n) != 0 && (!s.nodes[n].begun || self.pending(s, n) != 0);
        let fits = self.traces(node) && self.traces(with) && has_run(node) && !has_run(with);
        if !fits || s.helping & bit(with) != 0 {
            return;
        }
        s.shares -= 1;
        s.helping |= bit(with);
        let pending = if s.nodes[node].begun { self.pending(s, node) } else { 0 };
        let most = count(pending).div_ceil(2).min(self.granularity);
        // Those whose hit is known and whose hit's page is all that they need.
        let known: Vec<usize> = members(pending).filter(|&ray| self.rays[ray].pages.len() == 1).collect();
        let mut given = false;
        for &ray in known.iter().rev().take(most) {
            if self.free(&s.nodes[node]) == 0 {
                break;
            }
            s.born |= bit(ray);
            s.nodes[node].outbox[with] |= bit(ray);
            s.nodes[node].sends |= bit(with);
            given = true;
        }
        // As it was: whoever had rays to send there anyway did not say so.
        let forgets = self.is(Bug::ForgetsShare) && s.nodes[node].outbox[with] != 0;
        if !given && !forgets {
            s.nodes[node].none_to_share |= bit(with);
        }
    }
}
