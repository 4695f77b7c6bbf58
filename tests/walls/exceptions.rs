//! What does not keep to the rules yet, each with its reason. The lists may only shrink: an entry that is not needed any more
//! fails the test until it is taken off.

/// Files that import each other in a circle.
pub const CIRCLES: &[(&[&str], &str)] = &[
    (&["peer/draw/src/file.rs", "peer/draw/src/png.rs"], "they share an error type"),
    (
        &[
            "peer/lab/src/emulation/learning.rs",
            "peer/lab/src/emulation/observer.rs",
            "peer/lab/src/emulation/scenario.rs",
        ],
        "a scenario names the observers that it configures",
    ),
    (
        &[
            "peer/lab/src/experiment/chart.rs",
            "peer/lab/src/experiment/eyes.rs",
            "peer/lab/src/experiment/pool.rs",
            "peer/lab/src/experiment/results.rs",
            "peer/lab/src/experiment/runner.rs",
            "peer/lab/src/experiment/school.rs",
            "peer/lab/src/experiment/table.rs",
            "peer/lab/src/experiment/trial.rs",
        ],
        "the runner's count of threads and the table's materials are used where they are made",
    ),
    (
        &["peer/link/src/guest.rs", "peer/link/src/host.rs", "peer/link/src/robot.rs"],
        "host and guest hold each other",
    ),
    (
        &[
            "peer/vision/src/human.rs",
            "peer/vision/src/source/mod.rs",
            "peer/vision/src/source/rendered/mod.rs",
            "peer/vision/src/source/rendered/scheduled.rs",
        ],
        "a human is drawn on a schedule of its own",
    ),
    (
        &[
            "protocol/src/decision.rs",
            "protocol/src/envelope.rs",
            "protocol/src/message.rs",
            "protocol/src/sample.rs",
        ],
        "the bounds on what a message may hold are declared with the messages",
    ),
];

/// Files that are too long, and how long they are at most.
pub const LONG: &[(&str, usize)] = &[
    ("peer/lab/src/emulation/swarm.rs", 606),
    ("peer/src/cli/swarm.rs", 457),
    ("peer/src/config/mod.rs", 504),
];

/// Public types of one crate that share a name: the crate, and the name.
pub const NAMES: &[(&str, &str)] = &[
    ("gestalt-lab", "Run"),
    ("gestalt-lab", "Summary"),
    // The arguments of each verb, in the verb's own module.
    ("gestalt-peer", "Args"),
];
