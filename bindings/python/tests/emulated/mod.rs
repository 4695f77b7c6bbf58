//! What swarms do in the emulated network, for minds in Python to do as well: traces as `gestalt emulate --trace` writes them.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use gestalt_lab::emulation::{Scenario, Trace, run_traced};

/// Each scenario, and the seeds of its traces.
const RUNS: [(&str, &[u64]); 2] = [("twenty", &[0, 7]), ("churn", &[0])];

pub fn write(folder: &Path) {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/emulation");
    for (name, seeds) in RUNS {
        let scenario = Scenario::load(&configs.join(format!("{name}.json5"))).expect("a scenario");
        for seed in seeds {
            let file = File::create(folder.join(format!("{name}-{seed}.jsonl"))).expect("a file");
            let mut file = BufWriter::new(file);
            let (_, written) = run_traced(&scenario, *seed, Trace::to(&mut file)).expect("it can be run");
            written.expect("a trace");
        }
    }
}
