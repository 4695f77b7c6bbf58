//! A whole swarm killed and started again: other gestures in another order, clocks that are wrong, disks that are lost or old.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use gestalt_link::boot_number;
use gestalt_protocol::{ClassId, RoundId, SampleId};
use gestalt_tests::{Process, unique};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use redb::{ReadableDatabase, ReadableTable, TableDefinition};
use serde_json::{Value, json};

use crate::siege::REFRACTORY;

const PATIENCE: Duration = Duration::from_secs(30);
const HOUR: Duration = Duration::from_secs(3600);
const CLASSES: u64 = 6;

/// Three robots in a line, of which only the disks outlive a death.
struct Swarm {
    name: String,
    disks: [PathBuf; 3],
    robots: Vec<Process>,
}

impl Swarm {
    /// Starts all, and waits until each knows both others.
    fn start(&mut self, clock: SystemTime) {
        for i in 0..3_usize {
            let connect: Vec<String> =
                i.checked_sub(1).map(|before| self.locator(before)).into_iter().collect();
            let orders = json!({
                "id": i + 1,
                "swarm": self.name,
                "sees": 0,
                "boot": boot_number(clock),
                "learn": {"keep": 3, "share": 0.5, "memory": self.disks[i]},
                "link": {"listen": ["tcp/127.0.0.1:0"], "connect": connect},
            });
            self.robots.push(Process::start(Path::new(env!("CARGO_BIN_EXE_test-robot")), None, &orders));
        }
        for (i, robot) in self.robots.iter().enumerate() {
            let all = |told: &[Value]| {
                let alive = told.iter().rfind(|told| told["event"] == "alive")?;
                (alive["robots"].as_array()?.iter().filter(|id| **id != json!(i + 1)).count() == 2)
                    .then_some(())
            };
            robot.wait(PATIENCE, all).expect("all know all");
        }
    }

    fn locator(&self, robot: usize) -> String {
        let started = |told: &[Value]| {
            let started = told.iter().find(|told| told["event"] == "started")?;
            Some(started["locators"][0].as_str()?.to_owned())
        };
        self.robots[robot].wait(PATIENCE, started).expect("it listens")
    }

    /// Lets that robot open a round in which all see this class.
    fn open(&mut self, opener: usize, class: u64) {
        self.robots.iter_mut().for_each(|robot| robot.order(&format!("shown {class}")));
        self.robots[opener].order("open");
    }

    /// The round that the robot has just opened, once it is over for all.
    fn over(&self, opener: usize, before: usize) -> RoundId {
        let over = |told: &[Value]| {
            let of = |event| told[before..].iter().rfind(|told| told["event"] == event);
            let (closed, held) = (of("closed")?, of("held")?);
            (closed["round"] == held["round"]).then(|| held["decision"]["round"].clone())
        };
        let round = self.robots[opener].wait(PATIENCE, over);
        let round =
            round.unwrap_or_else(|| panic!("robot {opener}: {:#?}", &self.robots[opener].told()[before..]));
        for robot in &self.robots {
            let times = |told: &[Value], event| told.iter().filter(|told| told["event"] == event).count();
            let over = |told: &[Value]| (times(told, "opened") == times(told, "closed")).then_some(());
            robot.wait(PATIENCE, over).expect("the round ends everywhere");
        }
        serde_json::from_value(round).expect("the name of a round")
    }

    /// Kills all, in that order.
    fn kill(&mut self, mut order: impl FnMut(usize) -> usize) {
        while !self.robots.is_empty() {
            let next = order(self.robots.len());
            drop(self.robots.swap_remove(next));
        }
    }

    /// What each has on its disk, nothing where there is none.
    fn copies(&self) -> [Option<Vec<u8>>; 3] {
        [0, 1, 2].map(|i| std::fs::read(&self.disks[i]).ok())
    }

    fn put_back(&self, robot: usize, copy: Option<&Vec<u8>>) {
        match copy {
            Some(copy) => std::fs::write(&self.disks[robot], copy).unwrap(),
            None => drop(std::fs::remove_file(&self.disks[robot])),
        }
    }
}

/// A sample as it lies on a robot's disk: the part of the set, its name where it was shared, its class and round, its coordinates.
type Stored = (u8, Option<SampleId>, ClassId, RoundId, Vec<f32>);

/// All samples on a disk.
fn samples(disk: &Path) -> Vec<Stored> {
    const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
    const OF_SAMPLE: u8 = 2;
    // A copy, since to open the file of a robot that was killed is to repair it: that is for the robot to do.
    let copy = disk.with_extension("copy");
    std::fs::copy(disk, &copy).unwrap();
    let database = redb::Database::open(&copy).expect("a robot that was killed leaves its memory whole");
    let records = database.begin_read().unwrap().open_table(RECORDS).unwrap();
    let of_samples =
        records.iter().unwrap().map(Result::unwrap).filter(|(key, _)| key.value()[0] == OF_SAMPLE);
    of_samples.map(|(_, value)| postcard::from_bytes(value.value()).expect("a sample")).collect()
}

/// What was ever said, and what was ever numbered, by anybody in any life.
#[derive(Default)]
struct Truth {
    said: BTreeMap<RoundId, ClassId>,
    numbered: BTreeMap<SampleId, (RoundId, Vec<u32>)>,
}

impl Truth {
    /// How many samples there are on all disks, none of which has a label that nobody gave it, or the number of another.
    fn audit(&mut self, life: usize, disks: &[PathBuf]) -> usize {
        let mut held = 0;
        for disk in disks.iter().filter(|disk| disk.exists()) {
            for (_, id, class, round, vector) in samples(disk) {
                held += 1;
                let said = self.said.get(&round);
                assert_eq!(said, Some(&class), "life {life}, {}: a sample of {round}", disk.display());
                let vector: Vec<u32> = vector.iter().map(|x| x.to_bits()).collect();
                let Some(id) = id else { continue };
                let first = self.numbered.entry(id).or_insert_with(|| (round, vector.clone()));
                assert_eq!(*first, (round, vector), "life {life}: two samples have the number {id}");
            }
        }
        held
    }
}

/// With `GESTALT_LONG` a hundred lives.
pub fn no_sample_has_a_label_that_nobody_gave_it_after_all_were_killed() {
    let lives = if std::env::var_os("GESTALT_LONG").is_some() { 100 } else { 8 };
    let folder = tempfile::tempdir().unwrap();
    let disks = [1, 2, 3].map(|id| folder.path().join(format!("{id}.memory")));
    let mut swarm = Swarm { name: unique("restarts"), disks, robots: Vec::new() };
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let mut below = |n: usize| (rng.next_u64() % n as u64) as usize;
    let (mut truth, mut names) = (Truth::default(), BTreeSet::new());
    let mut copies = vec![swarm.copies()];
    let mut held = 0;
    for life in 0..lives {
        let now = SystemTime::now();
        swarm.start([now, now + HOUR, now - HOUR, SystemTime::UNIX_EPOCH][below(4)]);
        // Not all of what is shown is named; in the last round of a life all die, before, amid or after the word.
        for showing in 0..3_usize {
            std::thread::sleep(REFRACTORY);
            let (opener, class) = (below(3), (life * 5 + life / 6 + 2 * showing) as u64 % CLASSES);
            let before = swarm.robots[opener].told().len();
            swarm.open(opener, class);
            if showing == 2 && below(2) == 0 {
                break;
            }
            let round = swarm.over(opener, before);
            assert!(names.insert(round), "life {life}: {round} is the name of another showing");
            if below(3) > 0 {
                truth.said.insert(round, ClassId(class as u32));
                let said = |told: &[Value]| told.iter().filter(|told| told["event"] == "said").count();
                let before = said(&swarm.robots[opener].told());
                let word = json!({"say": "was", "round": round, "class": class});
                swarm.robots[opener].order(&format!("says ada {word}"));
                if showing < 2 {
                    let heard = |told: &[Value]| (said(told) > before).then_some(());
                    swarm.robots[opener].wait(PATIENCE, heard).expect("it is told");
                }
            }
        }
        std::thread::sleep(Duration::from_millis(below(1500) as u64));
        swarm.kill(&mut below);
        held = truth.audit(life, &swarm.disks);
        copies.push(swarm.copies());
        let old = below(copies.len());
        match life % 5 {
            1 => swarm.put_back(below(3), None),
            2 => (0..3).for_each(|robot| swarm.put_back(robot, None)),
            3 => swarm.put_back(life % 3, copies[old][life % 3].as_ref()),
            // Each from another day.
            4 => (0..3).for_each(|robot| swarm.put_back(robot, copies[below(life + 1)][robot].as_ref())),
            _ => {}
        }
    }
    eprintln!(
        "{lives} lives, {} rounds, {} of them named, {} samples numbered, {held} on the disks in the end",
        names.len(),
        truth.said.len(),
        truth.numbered.len()
    );
    assert!(truth.numbered.len() > lives, "they hardly shared anything");
}
