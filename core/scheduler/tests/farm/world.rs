//! Master, dispatcher and nodes on a virtual clock: what `nodes/runner` does with threads, from one seed.

use crate::common::Rng;
use crate::net::{End, Lie, Manner, Net};
use crate::toy::SCENE_HASH;
use hybray_arena::{Arena, LINE_BYTES};
use hybray_geometry::simd::Kernels;
use hybray_link::{Event, HOST, Link, Peer};
use hybray_scheduler::policy::Tiles;
use hybray_scheduler::{
    All, Dispatcher, Film, Limits, Master, Node, NodeMemory, NodeReport, NodeState, Options, Outcome, Settings,
    TileState,
};
use hybray_tracer::Scene;
use hybray_wire::{Frame, Message, TileMap, decode};
use std::collections::VecDeque;

/// How long a participant that has nothing to do sleeps at most.
const WAIT: u64 = 20_000_000;
/// What a turn takes besides tracing.
const TURN: u64 = 1_000;
/// Tiles that a node keeps at a time.
const TILES: u32 = 4;
/// How long a node with a dispatcher beside it traces before it looks up: a node's step is bounded.
const STEP: u64 = 500_000;

/// A farm, and what is to happen to it.
pub struct Plan<'a> {
    pub seed: u64,
    pub frame: Frame,
    pub scene: Scene<'a>,
    pub dispatcher: Peer,
    pub options: Options,
    /// Nodes that are given no tiles: entry 0 is the host's.
    pub barred: Vec<bool>,
    pub manner: Manner,
    /// What each tile costs.
    pub costs: &'a [u64],
    /// Nanoseconds for each unit of cost, of each node: so many nodes there are.
    pub speeds: Vec<u64>,
    /// Frames that a participant reads in one turn.
    pub frames_a_turn: usize,
    /// When so many tiles are finished, this node is lost.
    pub deaths: Vec<(u32, Peer)>,
    /// When so many tiles are finished, somebody asks to stop.
    pub stop_after: Option<u32>,
    /// When so many tiles are finished, these bytes arrive: from, to.
    pub injected: Vec<(u32, Peer, Peer, Vec<u8>)>,
    /// A node that has another scene.
    pub stranger: Option<Peer>,
    /// Tiles that are finished before it begins, and their sums as bytes.
    pub kept: Vec<(u32, Vec<u8>)>,
    /// Each node begins in its own part of the picture.
    pub biased: bool,
    /// The dispatcher has no memory for which tiles are finished before.
    pub forgetful: bool,
}

/// What came of it.
#[derive(Debug)]
pub struct Report {
    pub outcome: Outcome,
    pub hash: u64,
    pub sums: Vec<[u64; 3]>,
    pub finished: Vec<bool>,
    pub epochs: Vec<u16>,
    pub nodes: Vec<NodeReport>,
    pub refused_frames: u64,
    /// From the first tile given out to the last one finished, nanoseconds.
    pub time: u64,
    /// Frames between different participants, and their bytes.
    pub frames: u64,
    pub bytes: u64,
    pub runs: u64,
    /// Time that nodes waited between two runs.
    pub gaps: u64,
    /// When each node ended its last run, after the first tile was given out.
    pub ends: Vec<u64>,
}

/// A node, and what the world knows of it from its messages.
struct Worker<'m, 's> {
    me: Peer,
    node: Node<'m, 's, All<'s>>,
    dispatcher: Option<Dispatcher<'m>>,
    /// First and count of the runs that it has been given and not yet traced; the oldest first.
    runs: VecDeque<(u32, u32)>,
    /// Runs whose `Done` has not been sent.
    held: usize,
    /// What each of these runs, and of those that are done and not told, has cost.
    spent: VecDeque<u64>,
    /// Samples of the bundle in work that are still to be traced.
    samples_left: u16,
    /// Tiles that were begun and have not been sent.
    unsent: u32,
    idle_since: Option<u64>,
    gone: bool,
    /// It was told to end: it takes no more runs.
    stopped: bool,
    /// It is tracing until it wakes, and so much longer; then it sends.
    tracing: bool,
    left: u64,
    gaps: u64,
}

impl Worker<'_, '_> {
    /// Takes in what has arrived. Returns whether that was anything.
    fn receive(&mut self, net: &mut Net<'_>, plan: &Plan<'_>, map: &TileMap, now: u64) -> bool {
        let mut busy = false;
        let mut host_lost = false;
        for _ in 0..plan.frames_a_turn {
            let Self {
                me,
                node,
                dispatcher,
                runs,
                held,
                spent,
                samples_left,
                unsent,
                stopped,
                left,
                idle_since,
                gaps,
                ..
            } = self;
            let more = net.end(*me, now).receive(&mut |event| match event {
                Event::Frame { from, bytes } => {
                    let Ok(view) = decode(bytes) else { return };
                    if let Some(dispatcher) = dispatcher {
                        dispatcher.handle(from, &view, now);
                    }
                    if let Message::Tiles { first, count, .. } = view.message
                        && !*stopped
                        && count > 0
                        && first.checked_add(count).is_some_and(|end| end <= map.len())
                    {
                        runs.push_back((first, count));
                        spent.push_back(0);
                        *held += 1;
                        *gaps += idle_since.take().map_or(0, |since| now - since);
                        let most = if matches!(plan.options.tiles, Tiles::PixelCount { .. }) { 8 } else { 2 };
                        assert!(*held <= most, "node {me} has {held} runs");
                    }
                    if view.message == Message::Stop {
                        // It drops what it has, and only says what it did.
                        *stopped = true;
                        runs.clear();
                        spent.clear();
                        (*samples_left, *unsent, *left) = (0, 0, 0);
                    }
                    node.handle(from, &view);
                }
                Event::Lost { peer } => {
                    host_lost |= peer == HOST;
                    if let Some(dispatcher) = dispatcher {
                        dispatcher.lost(peer);
                    }
                    node.lost(peer);
                }
            });
            if !more {
                break;
            }
            busy = true;
        }
        if host_lost {
            self.gone = true;
            net.leave(self.me, true, now);
        }
        busy
    }

    /// Receives and works, or works on: returns when it is to be woken.
    fn work(&mut self, net: &mut Net<'_>, plan: &Plan<'_>, map: &TileMap, now: u64) -> u64 {
        let busy = self.receive(net, plan, map, now);
        if self.gone {
            return u64::MAX;
        }
        if self.left > 0 {
            if let Some(dispatcher) = &mut self.dispatcher {
                dispatcher.poll(&mut net.end(self.me, now), now);
            }
            return self.trace(self.left, now);
        }
        let mut cost = 0;
        if self.samples_left == 0
            && let Some(run) = self.runs.front_mut()
            && self.unsent + map.square(run.0, run.1) <= TILES
        {
            let count = map.square(run.0, run.1);
            let tiles = run.0 as usize..(run.0 + count) as usize;
            cost = plan.costs[tiles].iter().sum::<u64>() * plan.speeds[usize::from(self.me) - 1];
            *run = (run.0 + count, run.1 - count);
            self.unsent += count;
            // The runs that are not yet traced come after those that are done.
            let at = self.spent.len() - self.runs.len();
            self.spent[at] += cost;
            self.samples_left = plan.frame.samples;
        }
        let mut calls = 0;
        let worked = self.node.step(&mut || {
            calls += 1;
            if calls == 1 { now } else { now + cost }
        });
        // A sample of a bundle in each step, and nothing else to do.
        assert_eq!(worked, self.samples_left > 0, "node {}: {} tiles not sent", self.me, self.unsent);
        if worked {
            self.samples_left -= 1;
            return self.trace(cost, now);
        }
        self.send(net, now, busy)
    }

    fn trace(&mut self, cost: u64, now: u64) -> u64 {
        let step = if self.dispatcher.is_some() { cost.min(STEP) } else { cost };
        self.tracing = true;
        self.left = cost - step;
        now + step
    }

    /// Sends what it has, and says when it is to be woken.
    fn send(&mut self, net: &mut Net<'_>, now: u64, mut busy: bool) -> u64 {
        busy |= self.tracing;
        self.tracing = false;
        if self.samples_left == 0 && self.runs.front().is_some_and(|run| run.1 == 0) {
            self.runs.pop_front();
            if self.runs.is_empty() {
                self.idle_since = Some(now);
            }
        }
        busy |= self.node.poll(&mut net.end(self.me, now), now);
        if let Some(dispatcher) = &mut self.dispatcher {
            dispatcher.poll(&mut net.end(self.me, now), now);
        }
        for message in std::mem::take(&mut net.sent[usize::from(self.me)]) {
            match message {
                Message::Contributions { .. } => self.unsent -= 1,
                Message::Done { nanoseconds, .. } => {
                    self.held -= 1;
                    assert_eq!(Some(nanoseconds), self.spent.pop_front(), "node {}'s time for a run", self.me);
                }
                _ => {}
            }
        }
        if self.node.is_stopped() {
            self.gone = true;
            net.leave(self.me, true, now);
            return u64::MAX;
        }
        if busy { now + TURN } else { asleep(net, self.me, now) }
    }
}

fn asleep(net: &Net<'_>, me: Peer, now: u64) -> u64 {
    (now + WAIT).min(net.next_arrival(me).unwrap_or(u64::MAX).max(now + TURN))
}

/// The host's turn.
fn host(
    master: &mut Master<'_>,
    dispatcher: &mut Option<Dispatcher<'_>>,
    end: &mut End<'_, '_>,
    plan: &Plan<'_>,
    now: u64,
) -> bool {
    let mut busy = false;
    for _ in 0..plan.frames_a_turn {
        let more = end.receive(&mut |event| match event {
            Event::Frame { from, bytes } => match decode(bytes) {
                Ok(view) => {
                    if let Some(dispatcher) = dispatcher {
                        dispatcher.handle(from, &view, now);
                    }
                    master.handle(from, &view);
                }
                Err(_) => master.refuse(),
            },
            Event::Lost { peer } => {
                if let Some(dispatcher) = dispatcher {
                    dispatcher.lost(peer);
                }
                master.lost(peer);
            }
        });
        if !more {
            break;
        }
        busy = true;
    }
    if plan.stop_after.is_some_and(|tiles| master.progress().finished >= tiles) {
        master.stop();
    }
    master.poll(end);
    if let Some(dispatcher) = dispatcher {
        dispatcher.poll(end, now);
    }
    busy
}

/// Plays `plan` through on a link that may lie.
pub fn play(plan: &Plan<'_>, lie: &mut dyn FnMut(Peer, Peer, &Message) -> Lie) -> Result<Report, String> {
    let map = TileMap::new(plan.frame.width, plan.frame.height).ok_or("no picture")?;
    let peers = plan.speeds.len() + 1;
    let mut rng = Rng(plan.seed ^ 0x5eed);
    let mut net = Net::new(peers, plan.manner, rng.next(), lie);

    let mut sums = vec![[0; 3]; (map.width() * map.height()) as usize];
    let mut tiles = vec![TileState::default(); map.len() as usize];
    let mut reports = vec![NodeReport::default(); peers];
    let mut film = Film::new(&plan.frame, &mut sums, &mut tiles).ok_or("no film")?;
    plan.kept.iter().try_for_each(|(tile, values)| film.keep(*tile, values)).map_err(|e| e.to_string())?;
    let mut master = Master::new(plan.frame, film, &mut reports, SCENE_HASH, plan.dispatcher);
    let mut states = vec![NodeState::default(); peers];
    let mut bits = vec![0; if plan.forgetful { 0 } else { map.len().div_ceil(64) as usize }];
    let dispatcher =
        Dispatcher::new(&mut states, plan.options).biased(plan.biased).barring(&plan.barred).keeping(&mut bits);
    let (mut host_dispatcher, mut node_dispatcher) = match plan.dispatcher {
        HOST => (Some(dispatcher), None),
        _ => (None, Some(dispatcher.on(plan.dispatcher))),
    };
    let limits = Limits::all_at_hand();
    let bytes = NodeMemory::sum(&limits).total_bytes() as usize + LINE_BYTES - 1;
    let mut memories: Vec<_> = (1..peers).map(|_| Box::<[u8]>::new_uninit_slice(bytes)).collect();
    let mut workers: Vec<Worker<'_, '_>> = (1..)
        .zip(&mut memories)
        .map(|(me, memory)| {
            let hash = SCENE_HASH + u64::from(plan.stranger == Some(me));
            let memory = NodeMemory::carve(&mut Arena::new(memory), &limits).expect("the sum of its terms");
            let store = All(plan.scene.resident.pages, &[]);
            // A step traces a sample of a bundle to its end, so that the world knows what it costs.
            let settings = Settings { steps: u32::MAX, ..Settings::default() };
            let kernels = Kernels::Portable;
            Worker {
                me,
                node: Node::new(plan.scene, store, hash, kernels, me, plan.dispatcher, settings, memory),
                dispatcher: if me == plan.dispatcher { node_dispatcher.take() } else { None },
                runs: VecDeque::new(),
                held: 0,
                spent: VecDeque::new(),
                samples_left: 0,
                unsent: 0,
                idle_since: None,
                gone: false,
                stopped: false,
                tracing: false,
                left: 0,
                gaps: 0,
            }
        })
        .collect();

    // Nodes are not ready at the same time.
    let mut wakes: Vec<u64> = (0..peers).map(|_| rng.between(0, plan.manner.delay_max)).collect();
    let slowest = plan.speeds.iter().max().copied().unwrap_or(1);
    let messages = u64::from(map.len()) + 8 * peers as u64;
    // All work on the slowest node four times over, every message on its own, and some sleep for each: far beyond any
    // schedule that is not stuck.
    let held_up = plan.manner.held_up.map_or(0, |(_, time)| time);
    // Where pixels are counted, a node is silent for ten seconds before what is lost is given up.
    let silence = if matches!(plan.options.tiles, Tiles::PixelCount { .. }) { 11_000_000_000 } else { 0 };
    let bound = 4 * slowest * plan.costs.iter().sum::<u64>()
        + 8 * messages * (2 * plan.manner.delay_max + held_up + WAIT + TURN)
        + 100 * plan.manner.delay_max
        + u64::from(map.len()) * silence;
    let (mut deaths, mut injected) = (plan.deaths.clone(), plan.injected.clone());
    let mut finished_at = None;
    let mut ended = None;
    loop {
        let turn = (0..peers).min_by_key(|&peer| wakes[peer]).unwrap_or(0);
        let now = wakes[turn];
        if now > bound {
            let state = workers.iter().map(|w| format!("{}: {:?}, {} tiles not sent", w.me, w.runs, w.unsent));
            let state: Vec<_> = state.collect();
            return Err(format!("stuck at {:?} with {:?}; {}", master.progress(), master.outcome(), state.join("; ")));
        }
        if turn == 0 {
            let busy = host(&mut master, &mut host_dispatcher, &mut net.end(HOST, now), plan, now);
            net.sent[0].clear();
            if master.film().is_finished() {
                finished_at.get_or_insert(now);
            }
            wakes[0] = if busy { now + TURN } else { asleep(&net, HOST, now) };
            if let Some(outcome) = master.outcome() {
                ended = Some(outcome);
                net.leave(HOST, true, now);
                wakes[0] = u64::MAX;
            }
        } else {
            let worker = &mut workers[turn - 1];
            wakes[turn] = if worker.tracing && worker.left == 0 {
                worker.send(&mut net, now, true)
            } else {
                worker.work(&mut net, plan, &map, now)
            };
        }
        let done = master.film().finished();
        deaths.retain(|&(tiles, peer)| {
            let worker = &mut workers[usize::from(peer) - 1];
            let due = done >= tiles && ended.is_none();
            if due && !worker.gone {
                worker.gone = true;
                wakes[usize::from(peer)] = u64::MAX;
                net.leave(peer, false, now);
            }
            !due
        });
        injected.retain(|(tiles, from, to, bytes)| {
            let due = done >= *tiles;
            if due {
                net.push(*from, *to, bytes.clone(), now);
            }
            !due
        });
        for (peer, at) in std::mem::take(&mut net.news) {
            let peer = usize::from(peer);
            let can = if peer == 0 { ended.is_none() } else { !workers[peer - 1].gone && !workers[peer - 1].tracing };
            if can && peer != turn {
                wakes[peer] = wakes[peer].min(at.max(now));
            }
        }
        assert!(net.most_unread() <= 2 * plan.manner.room + plan.injected.len(), "a pair has more than its room");
        if let Some(outcome) = ended
            && workers.iter().all(|w| w.gone)
        {
            let film = master.film();
            let first = net.first_tiles_at.unwrap_or(0);
            return Ok(Report {
                outcome,
                hash: film.hash(),
                sums: film.sums().to_vec(),
                finished: (0..map.len()).map(|tile| film.tile_is_finished(tile)).collect(),
                epochs: (0..map.len()).map(|tile| film.epoch(tile)).collect(),
                nodes: master.reports()[1..].to_vec(),
                refused_frames: master.refused_frames(),
                time: finished_at.unwrap_or(now).saturating_sub(first),
                frames: net.frames,
                bytes: net.bytes,
                runs: master.reports()[1..].iter().map(|n| u64::from(n.runs)).sum(),
                gaps: workers.iter().map(|w| w.gaps).sum(),
                ends: workers.iter().map(|w| w.idle_since.unwrap_or(first).saturating_sub(first)).collect(),
            });
        }
    }
}
