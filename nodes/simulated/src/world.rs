//! The world: everybody's turns, one after the other on one clock.

use crate::gaps::Gaps;
use crate::machine::Operations;
use crate::meter::Meter;
use crate::schedule::{Phase, Schedule};
use crate::take::{Arrival, Taken, take};
use crate::turn::{KINDS, Said, Turn};
use crate::worker::{Worker, of_walks};
use crate::{Bound, Drawn, Farm, NodeRun, SimulateError, Simulated};
use hybray_link::{HOST, Peer};
use hybray_scheduler::policy::Policy;
use hybray_scheduler::{Clipper, Dispatcher, Film, Master, NodeReport, NodeState, Outcome, PageServer, Plan, Progress};
use hybray_sim::Network;
use hybray_wire::{Counts, Frame, Message};

/// Virtual time in which nobody does anything, after which nobody ever will: far beyond any latency.
const IDLE_NS_MAX: u64 = 100_000_000_000_000;
/// Frames, and as many again for each node, that may be delivered while nothing is traced and no tile is finished.
const FRAMES_MAX: u64 = 1_000_000;

/// A node, and what the world keeps of it.
struct Seat<'s> {
    worker: Worker<'s>,
    /// Tiles of its own that are finished.
    finished: u32,
    /// Rays that have ended there.
    ended: u64,
    operations: Operations,
    /// Time spent on the run that ends next.
    run_ns: u64,
    computing_ns: u64,
    messaging_ns: u64,
}

/// The participants, their network, and the time.
pub(crate) struct World<'a, 'm, 's> {
    farm: &'a Farm<'a>,
    network: Network,
    master: Master<'m>,
    dispatcher: Dispatcher<'m>,
    /// At the host, where there are no subhosts; what it has counted, and the time spent on that.
    clipper: Option<Clipper<'m, 's>>,
    clipped: Operations,
    clipping_ps: u64,
    /// At the host, for pages whose owners are lost.
    server: PageServer<'m>,
    pages: &'a [&'a [u8]],
    seats: Vec<Seat<'s>>,
    /// Frames and bytes of each kind, to others.
    kinds: [(u64, u64); KINDS.len()],
    plan: Plan,
    schedule: Schedule,
    meter: Meter,
    gaps: Gaps,
    /// Parts of nanoseconds that each participant still owes.
    owed_ps: Vec<u64>,
    first_tiles_ns: Option<u64>,
    /// When the last tile was finished at its owner.
    finished_ns: u64,
    gathered_ns: Option<u64>,
    /// End of the last turn in which something was done.
    done_ns: u64,
    /// Frames delivered and tiles finished when last something was traced or finished.
    progress: (u64, u32),
    /// Pictures that follow, and what became of those before this one.
    scene_hash: u64,
    more: std::vec::IntoIter<(Frame, Film<'m>)>,
    drawn: Vec<Drawn>,
}

impl<'a: 'm, 'm, 's> World<'a, 'm, 's> {
    pub fn new(
        farm: &'a Farm<'a>,
        plan: Plan,
        master: Master<'m>,
        states: &'m mut [NodeState],
        clipper: Option<Clipper<'m, 's>>,
        server: PageServer<'m>,
        pages: &'a [&'a [u8]],
        workers: Vec<Worker<'s>>,
    ) -> Self {
        let peers = farm.nodes + 1;
        Self {
            farm,
            network: Network::new(&farm.machine.network(farm.nodes), peers),
            master,
            dispatcher: Dispatcher::new(states, farm.options)
                .on(farm.dispatcher)
                .biased(farm.settings.policy != Policy::DemandDriven)
                .with_parts(farm.budget.map_or(&[], |budget| budget.parts))
                .barring(farm.budget.map_or(&[][..], |budget| budget.barred)),
            clipper,
            clipped: Operations::default(),
            clipping_ps: 0,
            server,
            pages,
            seats: workers
                .into_iter()
                .map(|worker| Seat {
                    worker,
                    finished: 0,
                    ended: 0,
                    operations: Operations::default(),
                    run_ns: 0,
                    computing_ns: 0,
                    messaging_ns: 0,
                })
                .collect(),
            plan,
            schedule: Schedule::new(peers),
            meter: Meter::new(peers),
            gaps: Gaps::default(),
            owed_ps: vec![0; usize::from(peers)],
            first_tiles_ns: None,
            finished_ns: 0,
            gathered_ns: None,
            done_ns: 0,
            progress: (0, 0),
            scene_hash: 0,
            more: Vec::new().into_iter(),
            drawn: Vec::new(),
            kinds: [(0, 0); KINDS.len()],
        }
    }

    /// Other pictures follow the first.
    pub fn followed_by(self, scene_hash: u64, more: Vec<(Frame, Film<'m>)>) -> Self {
        Self { scene_hash, more: more.into_iter(), ..self }
    }

    pub fn network(&mut self) -> &mut Network {
        &mut self.network
    }

    pub fn run(mut self, watch: &mut dyn FnMut(Progress) -> bool) -> Result<Simulated, SimulateError> {
        loop {
            if let Some(outcome) = self.master.outcome()
                && (outcome != Outcome::Finished || !self.next())
            {
                return Ok(self.end(outcome));
            }
            let turn = self.schedule.first();
            let turn_ns = turn.map_or(u64::MAX, |(time, _)| time);
            // Frames move first: what arrives now is there when somebody looks now.
            if let Some(now) = self.network.next_event()
                && now <= turn_ns
            {
                self.network.advance(now);
                self.spread_news(now);
                continue;
            }
            let Some((now, me)) = turn else { return Err(self.stuck(self.done_ns)) };
            if self.is_stuck(now) {
                return Err(self.stuck(now));
            }
            if self.network.is_gone(me) {
                self.schedule.leave(me);
                continue;
            }
            match (self.schedule.begin(me), me) {
                (Phase::Send { busy }, _) => self.send(me, now, busy),
                (_, HOST) => self.take_host(now, watch),
                _ => self.take_node(me, now),
            }
            self.spread_news(now);
        }
    }

    /// Begins the next picture, if there is one.
    fn next(&mut self) -> bool {
        let Some((frame, film)) = self.more.next() else { return false };
        let drawn = Drawn { film: self.master.film().hash(), counts: self.counts() };
        self.drawn.push(drawn);
        let Self { master, farm, .. } = self;
        let (number, last) = (self.drawn.len() as u16, self.more.len() == 0);
        let nodes = master.release();
        *master = Master::of_run(number, last, frame, film, nodes, self.scene_hash, farm.dispatcher);
        if farm.dispatcher == HOST {
            self.dispatcher.next(number);
        }
        if let Some(clipper) = &mut self.clipper {
            clipper.next(number);
        }
        true
    }

    /// What all nodes have reported of this picture; nothing if some are not known to.
    fn counts(&self) -> Option<Counts> {
        let mut counts = Counts::default();
        self.master.reports()[1..].iter().for_each(|node| counts += node.counts);
        self.master.reports()[1..].iter().all(NodeReport::is_known).then_some(counts)
    }

    fn spread_news(&mut self, now: u64) {
        while let Some(peer) = self.network.pop_news() {
            self.schedule.wake(peer, now);
        }
    }

    /// Whole nanoseconds of what `me` has spent; the rest is owed.
    fn nanoseconds(&mut self, me: Peer, spent_ps: u64) -> u64 {
        let owed = &mut self.owed_ps[usize::from(me)];
        let all = *owed + spent_ps;
        *owed = all % 1000;
        all / 1000
    }

    fn take_host(&mut self, now: u64, watch: &mut dyn FnMut(Progress) -> bool) {
        let Self { network, master, dispatcher, clipper, server, farm, gathered_ns, .. } = self;
        let dispatches = farm.dispatcher == HOST;
        let Taken { spent_ps, frames, .. } = take(network, farm.machine, HOST, now, |arrival, now| {
            match arrival {
                Arrival::Message { from, view } => {
                    if dispatches {
                        dispatcher.handle(from, &view, now);
                    }
                    if let Some(clipper) = clipper {
                        clipper.handle(from, &view);
                    }
                    if let Message::Fetch { page } = view.message {
                        server.fetch(from, page);
                    }
                    master.handle(from, &view);
                }
                Arrival::Nonsense => master.refuse(),
                Arrival::Lost { peer } => {
                    if dispatches {
                        dispatcher.lost(peer);
                    }
                    if let Some(clipper) = clipper {
                        clipper.lost(peer);
                    }
                    server.lost(peer);
                    master.lost(peer);
                }
            }
            if gathered_ns.is_none() && master.film().is_finished() {
                *gathered_ns = Some(now);
            }
        });
        if !watch(self.master.progress()) {
            self.master.stop();
        }
        let spent_ns = self.nanoseconds(HOST, spent_ps);
        self.meter.work(HOST, now, now + spent_ns);
        self.go_on(HOST, now, spent_ns, frames > 0);
    }

    fn take_node(&mut self, me: Peer, now: u64) {
        let Self { network, dispatcher, seats, farm, gaps, pages, .. } = self;
        let number = usize::from(me) - 1;
        let seat = &mut seats[number];
        let dispatches = farm.dispatcher == me;
        let taken = take(network, farm.machine, me, now, |arrival, now| match arrival {
            Arrival::Message { from, view } => {
                if dispatches {
                    dispatcher.handle(from, &view, now);
                }
                gaps.heard(me, from, &view.message, pages, now);
                seat.worker.handle(from, &view);
            }
            Arrival::Lost { peer } => {
                if dispatches {
                    dispatcher.lost(peer);
                }
                gaps.lost(me, peer);
                seat.worker.lost(peer);
            }
            Arrival::Nonsense => {}
        });
        if taken.host_lost {
            self.schedule.leave(me);
            return;
        }
        let worked = seat.worker.step(now + taken.spent_ps / 1000);
        let operations = seat.worker.operations();
        let step_ps = farm.machine.costs.of(&operations.since(&seat.operations));
        seat.operations = operations;
        seat.run_ns += step_ps / 1000;
        seat.computing_ns += step_ps / 1000;
        seat.messaging_ns += taken.spent_ps / 1000;
        let spent_ns = self.nanoseconds(me, taken.spent_ps + step_ps);
        if step_ps > 0 {
            self.progress.0 = self.network.delivered();
            self.gaps.traced(now, now + spent_ns);
        }
        let seat = &mut self.seats[number];
        let finished = seat.worker.finished_tiles();
        if core::mem::replace(&mut seat.finished, finished) != finished {
            self.finished_ns = self.finished_ns.max(now + spent_ns);
        }
        let ended = seat.worker.ended();
        if core::mem::replace(&mut seat.ended, ended) != ended {
            self.gaps.ended(now, now + spent_ns);
        }
        self.meter.work(me, now, now + spent_ns);
        self.go_on(me, now, spent_ns, worked || taken.frames > 0);
    }

    /// After taking in and working, it sends: at once if that took no time.
    fn go_on(&mut self, me: Peer, now: u64, spent_ns: u64, busy: bool) {
        if spent_ns == 0 {
            self.send(me, now, busy);
        } else {
            self.schedule.busy(me, now + spent_ns, Phase::Send { busy });
        }
    }

    fn send(&mut self, me: Peer, now: u64, busy: bool) {
        let Self { network, master, dispatcher, clipper, server, pages, seats, farm, gaps, .. } = self;
        let machine = farm.machine;
        let seat = usize::from(me).checked_sub(1).map(|number| &mut seats[number]);
        let mut no_run = 0;
        let (worker, run_ns, computing_ns) = match seat {
            Some(Seat { worker, run_ns, computing_ns, .. }) => (Some(worker), run_ns, *computing_ns),
            None => (None, &mut no_run, 0),
        };
        let mut turn = Turn { network, machine, me, now_ns: now, run_ns, computing_ns, gaps, said: Said::default() };
        let mut stopped = false;
        match worker {
            Some(worker) => {
                worker.poll(&mut turn, now);
                stopped = worker.is_stopped();
            }
            None => {
                server.serve(&mut turn, &|page| pages.get(page as usize).copied());
                if let Some(clipper) = clipper {
                    clipper.serve(&mut turn);
                }
                if let Some(page) = server.missing() {
                    master.missing(page);
                }
                master.poll(&mut turn);
            }
        }
        if farm.dispatcher == me {
            dispatcher.poll(&mut turn, now);
        }
        let Said { spent_ps, frames, first_tiles_ns, kinds } = turn.said;
        let computing_ps = self.clipping_ps(me);
        for (all, (frames, bytes)) in self.kinds.iter_mut().zip(kinds) {
            *all = (all.0 + frames, all.1 + bytes);
        }

        if let (None, Some(first)) = (self.first_tiles_ns, first_tiles_ns) {
            self.first_tiles_ns = Some(first);
            self.meter.begin(first);
            self.gaps.begin(first);
        }
        let spent_ns = self.nanoseconds(me, spent_ps + computing_ps);
        if let Some(number) = usize::from(me).checked_sub(1) {
            self.seats[number].messaging_ns += spent_ps / 1000;
        }
        self.meter.work(me, now, now + spent_ns);
        if stopped {
            self.schedule.leave(me);
        } else if busy || frames > 0 {
            self.done_ns = self.done_ns.max(now);
            // Time goes on, whatever the machine: nobody could do for ever what takes no time.
            self.schedule.busy(me, now + spent_ns.max(1), Phase::Take);
        } else {
            self.schedule.sleep(me, now);
        }
    }

    /// What clipping for others took, picoseconds: it is done where there is room for the answer.
    fn clipping_ps(&mut self, me: Peer) -> u64 {
        let costs = &self.farm.machine.costs;
        let Some(number) = usize::from(me).checked_sub(1) else {
            let clipped = self.clipper.as_ref().map_or(Operations::default(), |clipper| of_walks(&clipper.counts()));
            let spent_ps = costs.of(&clipped.since(&self.clipped));
            self.clipped = clipped;
            self.clipping_ps += spent_ps;
            return spent_ps;
        };
        let seat = &mut self.seats[number];
        let operations = seat.worker.operations();
        let spent_ps = costs.of(&operations.since(&seat.operations));
        seat.operations = operations;
        seat.computing_ns += spent_ps / 1000;
        spent_ps
    }

    fn is_stuck(&mut self, now: u64) -> bool {
        let finished = self.master.film().finished();
        if finished != self.progress.1 {
            self.progress = (self.network.delivered(), finished);
        }
        let frames = self.network.delivered() - self.progress.0;
        now.saturating_sub(self.done_ns) > IDLE_NS_MAX || frames > FRAMES_MAX * (u64::from(self.farm.nodes) + 1)
    }

    fn stuck(&self, now: u64) -> SimulateError {
        use std::fmt::Write;
        let mut state = format!("{:?}", self.master.progress());
        for (number, seat) in self.seats.iter().enumerate().take(16) {
            let me = number as Peer + 1;
            let Operations { cells, rays, .. } = seat.operations;
            let [up, down] = [self.network.unread(me, HOST), self.network.unread(HOST, me)];
            let phase = self.schedule.phase(me);
            // Writing to a string does not fail.
            let _ = write!(
                state,
                "; node {me}: {phase:?}, {cells} cells, {rays} rays, {up} frames to the host, {down} from it"
            );
        }
        SimulateError::Stuck { seconds: now / 1_000_000_000, state }
    }

    fn end(self, outcome: Outcome) -> Simulated {
        let first = self.first_tiles_ns.unwrap_or(0);
        let until = self.finished_ns.max(first);
        let (interval_ns, busy) = self.meter.end(until);
        let mut busy = busy.into_iter();
        let host_busy_ns = busy.next().unwrap_or_default();
        let longest = self.gaps.end(until, |peer| self.network.is_gone(peer));
        let network = &self.network;
        let nodes = self.seats.iter().zip(busy).enumerate().map(|(number, (seat, busy_ns))| NodeRun {
            report: self.master.reports()[number + 1],
            operations: seat.operations,
            computing_ns: seat.computing_ns,
            messaging_ns: seat.messaging_ns,
            busy_ns,
            traffic: network.traffic(number as Peer + 1),
            exchange: seat.worker.exchange(),
            high_water: seat.worker.high_water(),
            ended: seat.ended,
        });
        Simulated {
            outcome,
            before: self.drawn,
            film: self.master.film().hash(),
            events: network.log_hash(),
            loading_ns: first,
            time_ns: until - first,
            gathering_ns: self.gathered_ns.map_or(0, |gathered| gathered.saturating_sub(until)),
            longest,
            bound: Bound::default(),
            interval_ns,
            nodes: nodes.collect(),
            host: network.traffic(HOST),
            host_busy_ns,
            host_clipping_ns: self.clipping_ps / 1000,
            links: network.links().collect(),
            kinds: KINDS.into_iter().zip(self.kinds).collect(),
            frames: network.delivered(),
            refused_frames: self.master.refused_frames(),
            plan: self.plan,
        }
    }
}
