//! What it costs to fuse the votes of a hundred robots. `cargo bench -p gestalt-strategies --bench fusion`

use gestalt_protocol::{FusionRule, HeldVote, RobotId, RoundId, Stamp, VocabularyId, Vote};
use gestalt_rounds::{Ballot, Scale};

const SCALE: Scale = Scale { vocabulary: VocabularyId(1), classes: 6 };

fn main() {
    divan::main();
}

fn ballot(robots: u32) -> Ballot {
    let mut ballot = Ballot::default();
    for robot in 0..robots {
        let evidence = (0..6).map(|class| ((robot * 7 + class * 13) as f32).sin() * 4.0).collect();
        let round = RoundId { counter: 1, opener: RobotId(0), life: 0 };
        let vote =
            Vote { round, vocabulary: SCALE.vocabulary, evidence, looks: 3.0, unknown: None, named: vec![] };
        let stamp = Stamp { boot: 1, sequence: 1 };
        ballot.cast(HeldVote { robot: RobotId(robot), stamp, vote, signature: None });
    }
    ballot
}

#[divan::bench(args = FusionRule::ALL)]
fn a_ballot_of_100_robots(bencher: divan::Bencher, rule: FusionRule) {
    let ballot = ballot(100);
    bencher.bench(|| divan::black_box(&ballot).fuse(&rule, 6.0, SCALE));
}
