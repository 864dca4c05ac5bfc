//! Machines: what one counted operation costs, and the network between nodes.
//!
//! Data alone. Costs are picoseconds, so that the desktop machine's can be whole numbers and every other is that
//! machine's times a fraction: what differs from one processor to another here is how fast it is, not what it is good
//! at. Where a number comes from stands beside it; "estimated" means that nobody measured it.
//!
//! Compute costs of a machine of the papers are fitted by one factor to one published time of one processor, and are
//! then the same for every other table. [`Costs::fitted`] does the arithmetic.

use hybray_link::Peer;
use hybray_scheduler::Settings;
use hybray_scheduler::policy::{LinkCost, Policy};
use hybray_sim::{LinkModel, NetworkModel, Topology};

/// What was counted of a node's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Wide nodes whose eight boxes were tested.
    pub cells: u64,
    /// Blocks of four primitives that were tested.
    pub blocks: u64,
    /// Pages entered.
    pub pages: u64,
    /// Hits shaded.
    pub hits: u64,
    /// Rays started, of any kind.
    pub rays: u64,
    /// Values added to a film.
    pub contributions: u64,
    /// Tiles begun.
    pub tiles: u64,
}

impl Operations {
    /// What was counted since `before`.
    #[must_use]
    pub fn since(&self, before: &Self) -> Self {
        Self {
            cells: self.cells - before.cells,
            blocks: self.blocks - before.blocks,
            pages: self.pages - before.pages,
            hits: self.hits - before.hits,
            rays: self.rays - before.rays,
            contributions: self.contributions - before.contributions,
            tiles: self.tiles - before.tiles,
        }
    }
}

impl std::ops::AddAssign for Operations {
    fn add_assign(&mut self, b: Self) {
        self.cells += b.cells;
        self.blocks += b.blocks;
        self.pages += b.pages;
        self.hits += b.hits;
        self.rays += b.rays;
        self.contributions += b.contributions;
        self.tiles += b.tiles;
    }
}

/// What operations cost, picoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Costs {
    /// A wide node tested: eight boxes.
    pub cell: u64,
    /// A block of four primitives tested.
    pub block: u64,
    /// A page entered.
    pub page: u64,
    /// A hit shaded.
    pub hit: u64,
    /// A ray started.
    pub ray: u64,
    /// A value added to a film.
    pub contribution: u64,
    /// A tile begun.
    pub tile: u64,
}

impl Costs {
    /// A core of a desktop machine with AVX2. Cell, block, hit and ray are rounded from measurements of this program on
    /// one core of an AMD EPYC (docs/BENCHMARKS.md); page (a line of memory that is in no near cache), contribution
    /// (three additions) and tile (clearing its sums, and its corners' rays) are estimated.
    pub const DESKTOP: Self = Self {
        cell: 15_000,
        block: 12_000,
        page: 15_000,
        hit: 150_000,
        ray: 60_000,
        contribution: 5_000,
        tile: 500_000,
    };

    /// All of them times `thousandths` / 1000, rounded down.
    #[must_use]
    pub const fn scaled(self, thousandths: u64) -> Self {
        Self {
            cell: self.cell * thousandths / 1000,
            block: self.block * thousandths / 1000,
            page: self.page * thousandths / 1000,
            hit: self.hit * thousandths / 1000,
            ray: self.ray * thousandths / 1000,
            contribution: self.contribution * thousandths / 1000,
            tile: self.tile * thousandths / 1000,
        }
    }

    /// What `done` costs.
    #[must_use]
    pub fn of(&self, done: &Operations) -> u64 {
        self.cell * done.cells
            + self.block * done.blocks
            + self.page * done.pages
            + self.hit * done.hits
            + self.ray * done.rays
            + self.contribution * done.contributions
            + self.tile * done.tiles
    }

    /// The factor, in thousandths, by which these costs make one node's run last `wanted_ns`, if with them it computed
    /// `done` and lasted `lasted_ns`: what is not computing (messages) stays as it is. `None` if that alone lasts
    /// longer, or nothing was computed.
    #[must_use]
    pub fn fitted(&self, done: &Operations, lasted_ns: u64, wanted_ns: u64) -> Option<u64> {
        let computing_ns = self.of(done) / 1000;
        let rest_ns = lasted_ns.saturating_sub(computing_ns);
        let computing_wanted_ns = wanted_ns.checked_sub(rest_ns)?;
        let factor = u128::from(computing_wanted_ns) * 1000 / u128::from((computing_ns > 0).then_some(computing_ns)?);
        u64::try_from(factor).ok()
    }
}

/// What a message costs its sender and its receiver, picoseconds. What the network takes is beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageCosts {
    /// A message sent.
    pub sent: u64,
    /// A message received.
    pub received: u64,
    /// A record (a ray, a part of a pixel) packed or unpacked.
    pub record: u64,
    /// A byte packed or unpacked.
    pub byte: u64,
}

/// A machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Machine {
    /// What it is called.
    pub name: &'static str,
    /// What it is, for people.
    pub about: &'static str,
    /// What operations cost a node, and the host.
    pub costs: Costs,
    /// What messages cost a node, and the host.
    pub messages: MessageCosts,
    /// The network.
    pub network: NetworkModel,
}

impl Machine {
    /// The machine called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MACHINES.iter().find(|machine| machine.name == name)
    }

    /// How its nodes work under `policy`: the policy knows what a message and a ray cost here.
    #[must_use]
    pub fn settings(&self, policy: Policy) -> Settings {
        let (link, messages, costs) = (self.network.link, &self.messages, &self.costs);
        let message_ns = (messages.sent + messages.received) / 1000 + 2 * link.latency_ns;
        let wire_ps = 1_000_000_000_000 / link.bytes_per_second.max(1);
        // A ray of the scenes that were counted meets some eight nodes and four blocks, and half of them hit.
        let ray_ns = (costs.ray + 8 * costs.cell + 4 * costs.block + costs.hit / 2) / 1000;
        let narrow = |x: u64| u32::try_from(x).unwrap_or(u32::MAX);
        Settings {
            policy,
            link: LinkCost { message_ns: narrow(message_ns), byte_ps: narrow(2 * messages.byte + wire_ps) },
            ray_ns: narrow(ray_ns),
            // Long enough for company: a frame of rays costs as much as some dozens of them.
            deadline_ns: 48 * message_ns,
            steps: 16,
            ..Settings::default()
        }
    }

    /// Its network between a host and so many nodes. A mesh is as square as the papers' (1 x 2, 2 x 2, 2 x 4, 4 x 4,
    /// 4 x 8), wider than high where it cannot be square.
    #[must_use]
    pub fn network(&self, nodes: Peer) -> NetworkModel {
        let topology = match self.network.topology {
            Topology::Mesh2d { .. } => Topology::Mesh2d { columns: columns(nodes) },
            other => other,
        };
        NetworkModel { topology, ..self.network }
    }
}

/// The least number of columns, from the square root on, that makes whole rows, if there is one up to twice the root.
fn columns(nodes: Peer) -> Peer {
    let root = (1..=nodes).find(|&side| u32::from(side) * u32::from(side) >= u32::from(nodes)).unwrap_or(1);
    (root..=root.saturating_mul(2)).find(|&columns| nodes.is_multiple_of(columns)).unwrap_or(root)
}

/// A network whose links are all alike.
const fn alike(topology: Topology, latency_ns: u64, bytes_per_second: u64) -> NetworkModel {
    let link = LinkModel { latency_ns, bytes_per_second };
    NetworkModel { topology, link, host_link: link, room_frames: NetworkModel::ROOM_FRAMES }
}

/// Every machine that there is.
pub const MACHINES: [Machine; 6] = [
    Machine {
        name: "powerxplorer",
        about: "Parsytec PowerXplorer of the 1995 report: PowerPC 601 at 80 MHz, T800 links in a mesh, PVM",
        // Fitted to table 6.4, balls, no subhosts, 1 processor: 63.10 s. The test `the_powerxplorer_is_fitted` says the
        // factor when it is off.
        costs: Costs::DESKTOP.scaled(FITTED_POWERXPLORER),
        messages: MessageCosts {
            // A PVM message is about 1 ms of processor time, half on either side (estimated; the report gives none).
            sent: 500_000_000,
            received: 500_000_000,
            // Packing calls for some dozen fields, about 160 cycles (estimated).
            record: 2_000_000,
            // One copy through memory at 25 MB/s (estimated).
            byte: 40_000,
        },
        // A T800 link: 20 Mbit/s, 1.1 MB/s of data at most in either direction while both are in use; some tens of
        // microseconds a hop for the transputer's software (estimated).
        network: alike(Topology::Mesh2d { columns: 1 }, 30_000, 1_100_000),
    },
    Machine {
        name: "cc48",
        about: "Parsytec CC-48 of POV||Ray: PowerPC 604 at 133 MHz, crossbar of 1 Gbit/s, PVM",
        // Fitted to SKYVASE, 1 worker: 251 s, on the stand-in `paper:vase` with one sample a pixel. It is a factor for
        // POV-Ray and its textures on that processor rather than for the processor. The test `the_cc48_is_fitted` says
        // the factor when it is off.
        costs: Costs::DESKTOP.scaled(FITTED_CC48),
        messages: MessageCosts {
            // PVM over AIX: about 0.4 ms of processor time (estimated).
            sent: 200_000_000,
            received: 200_000_000,
            record: 800_000,
            // One copy at 80 MB/s (estimated).
            byte: 12_500,
        },
        // 1 Gbit/s peak (POV||Ray, section 6); 20 us from end to end (estimated).
        network: alike(Topology::Crossbar, 10_000, 125_000_000),
    },
    Machine {
        name: "gigabit",
        about: "small boards, 50 us a ray, on switched gigabit Ethernet",
        // 50 us a ray, all rays of the balls picture taken together: the test `a_small_board_takes_50_us_a_ray` says
        // the factor when it is off.
        costs: Costs::DESKTOP.scaled(FITTED_BOARD),
        messages: MessageCosts {
            // A small TCP stack: about 30 us (estimated).
            sent: 30_000_000,
            received: 30_000_000,
            record: 500_000,
            // Copy and checksum at 200 MB/s (estimated).
            byte: 5_000,
        },
        // 125 MB/s less Ethernet's, IP's and TCP's headers on full packets; 50 us from end to end, half on either side
        // of the switch.
        network: alike(Topology::Crossbar, 25_000, 117_000_000),
    },
    Machine {
        name: "infiniband",
        about: "a cluster of today: this kind of core, EDR InfiniBand, MPI",
        costs: Costs::DESKTOP,
        messages: MessageCosts {
            // MPI's overhead on either side, about half a microsecond.
            sent: 500_000,
            received: 500_000,
            record: 10_000,
            byte: 50,
        },
        // 100 Gbit/s less encoding and headers; 1.2 us from end to end, as vendors publish for one switch.
        network: alike(Topology::Crossbar, 600, 12_000_000_000),
    },
    Machine {
        name: "serial-115200",
        about: "small boards in a chain of serial lines at 115,200 bit/s",
        costs: Costs::DESKTOP.scaled(FITTED_BOARD),
        messages: MessageCosts {
            // Framing, CRC and an acknowledgement (estimated).
            sent: 20_000_000,
            received: 20_000_000,
            record: 500_000,
            // An interrupt for each byte, and its CRC (estimated).
            byte: 200_000,
        },
        // Ten bits a byte; a board looks at its lines every 100 us (estimated).
        network: alike(Topology::Chain, 100_000, 11_520),
    },
    Machine {
        name: "threads",
        about: "threads of one desktop machine",
        costs: Costs::DESKTOP,
        messages: MessageCosts {
            // A crossbeam channel: a few hundred nanoseconds, the waking included (estimated).
            sent: 300_000,
            received: 200_000,
            record: 5_000,
            // A copy at 10 GB/s.
            byte: 100,
        },
        network: alike(Topology::Crossbar, 100, 20_000_000_000),
    },
];

/// How many thousandths of a desktop core's time a PowerPC 601 at 80 MHz takes, its compiler and program of 1995
/// included.
const FITTED_POWERXPLORER: u64 = 2_943_900;
/// The same for a PowerPC 604 at 133 MHz with POV-Ray 3.
const FITTED_CC48: u64 = 2_769_900;
/// The same for a small board.
const FITTED_BOARD: u64 = 359_100;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_are_the_papers() {
        let grids =
            [(1, 1), (2, 2), (4, 2), (8, 4), (16, 4), (32, 8), (7, 3), (11, 4), (12, 4), (1024, 32), (4096, 64)];
        for (nodes, expected) in grids {
            assert_eq!(columns(nodes), expected, "{nodes}");
        }
    }

    #[test]
    fn names_are_found_and_differ() {
        for machine in &MACHINES {
            assert_eq!(Machine::named(machine.name), Some(machine));
        }
        assert_eq!(Machine::named("abacus"), None);
    }

    /// By hand: 1000 cells of 15 ns are 15 us; 5 us went to messages; for 65 us the rest must be four times as long.
    #[test]
    fn the_fit_leaves_messages_alone() {
        let done = Operations { cells: 1000, ..Operations::default() };
        assert_eq!(Costs::DESKTOP.fitted(&done, 20_000, 65_000), Some(4000));
        assert_eq!(Costs::DESKTOP.scaled(4000).of(&done), 60_000_000);
        assert_eq!(Costs::DESKTOP.fitted(&done, 20_000, 4_000), None);
        assert_eq!(Costs::DESKTOP.fitted(&Operations::default(), 20_000, 40_000), None);
    }
}
