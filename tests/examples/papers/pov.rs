//! Section 6 of POV||Ray.

use anyhow::Result;
use hybray_scheduler::policy::Policy;

use crate::bench::{Bench, Job};
use crate::published::Published;
use crate::table::{Table, per_cent};

/// The published scene, and ours of its kind.
const SCENES: [(&str, &str); 2] = [("rosenthalerhof", "paper:hof"), ("skyvase", "paper:vase")];
/// The atomic job was a screen column (section 2.1): 480 pixels, which are seven and a half tiles.
const COLUMN_TILES: u32 = 8;

/// A run of the farm with the default scheduler: 640 x 480 pixels, one sample, the load balancer near the workers.
pub fn job(scene: &str, nodes: u16) -> Job {
    let machine = "cc48";
    Job { machine, size: [640, 480], memory_mib: None, is_dispatched_by_node: true, ..Job::of_1995(scene, nodes) }
}

/// Speed-up with T of 1, 2 and 3, and learned.
pub fn speed_up(bench: &Bench, published: &Published) -> Result<String> {
    let mut names = vec!["scene", "workers"];
    names.extend(["paper, T = 1: s", "speed-up", "T = 2: s", "speed-up", "T = 3: s", "speed-up"]);
    names.extend(["`demand-driven`, T = 1: s", "speed-up", "T = 2: s", "speed-up", "T = 3: s", "speed-up"]);
    names.extend(["`hybrid`: s", "speed-up", "eff. %", "busy %", "messages", "gathering, s"]);
    let mut table = Table::new(&names);
    for row in published.table("pov_speedup")? {
        let mut line = Vec::new();
        for name in ["scene", "workers", "t1_s", "t1_speedup", "t2_s", "t2_speedup", "t3_s", "t3_speedup"] {
            line.push(row.cell(name)?);
        }
        let ours = SCENES.iter().find(|(theirs, _)| row.text("scene").is_ok_and(|name| name == *theirs));
        let Some((_, scene)) = ours else {
            line.push("not simulated".to_owned());
            line.resize(names.len(), String::new());
            table.row(line);
            continue;
        };
        let job = job(scene, row.number("workers")?);
        for spread in 1..=3 {
            let policy = Policy::DemandDriven;
            let job = Job { policy, spread: Some(spread), atomic: Some(COLUMN_TILES), ..job.clone() };
            line.extend(match bench.compared(&job) {
                Ok(found) => [format!("{:.2}", found.run.seconds), format!("{:.1}", found.speedup)],
                Err(without) => [without.cell(), String::new()],
            });
        }
        match bench.compared(&job) {
            Ok(found) => line.extend([
                format!("{:.2}", found.run.seconds),
                format!("{:.1}", found.speedup),
                per_cent(found.efficiency),
                per_cent(found.run.busy),
                found.run.messages.to_string(),
                format!("{:.2}", found.run.gathering_seconds),
            ]),
            Err(without) => line.push(without.cell()),
        }
        line.resize(names.len(), String::new());
        table.row(line);
    }
    Ok(table.finish())
}
