//! Saying one thing here and another there.

use std::collections::BTreeMap;
use std::time::Duration;

use gestalt_protocol::{Envelope, Message, RobotId, SampleId, Samples, Stamp, Topic};
use gestalt_strategies::is_refuted;

use super::decisions::liar_is_out;
use crate::attack::{Attack, Counted, Played, Setting, Tier};
use crate::beside::{beside, decided_alike};
use crate::forged;
use crate::swarm::world::{key, roster, space};
use crate::swarm::{Plan, Swarm};
use crate::trust::{Budget, Conviction, Distrust, Verifier, Witness, statement};

const MS: Duration = Duration::from_millis(1);

pub const ALL: &[Attack] = &[
    Attack {
        number: "9",
        what: "an enrolled robot says two votes under one stamp, each to half of the swarm",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "the decision is the same",
        counted: Counted::None(
            "each vote is its author's own, and the first that is heard of one stamp stays",
        ),
        gap: None,
        play: |seed| {
            beside(&Plan::sealed().liars(1).withstanding(1), seed, two_faced, |peace, war| {
                decided_alike(peace, war, 1000 * MS)
            })
        },
    },
    Attack {
        number: "9",
        what: "the two votes meet at a witness of gestalt-trust, and the evidence at a verifier",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "whoever is shown the evidence believes that key no more",
        counted: Counted::All(&["refused_convicted"]),
        gap: None,
        play: convicted,
    },
    Attack {
        number: "9",
        what: "a robot that said two votes under one stamp goes on voting in later rounds",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "evidence at all honest robots within two repair periods, and it is not counted in any later round",
        counted: Counted::Some(&["refused_vote_convicted"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1).withstanding(1), seed, goes_on, liar_is_out),
    },
    Attack {
        number: "9",
        what: "an enrolled robot shares two samples under one number, the second a while after the first",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all honest robots convict it",
        counted: Counted::Some(&["refused_vote_convicted"]),
        gap: None,
        play: |seed| beside(&Plan::sealed().liars(1).withstanding(1), seed, two_samples, liar_is_out),
    },
];

fn two_samples(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    let round = swarm.end(began);
    let (id, key) = (SampleId { author: RobotId(6), life: 5, number: 1 }, key(6));
    for (sequence, at) in [(1, 0.5), (2, -0.5)] {
        let samples = Samples { space: space().id(), samples: vec![forged::sample(id, 1, round, &[at])] };
        let stamp = Stamp { boot: 1, sequence };
        let message = Message::Samples(samples);
        let said = Envelope { author: RobotId(6), stamp, message, signature: None };
        swarm.put(&Topic::Sample(RobotId(6)), &forged::signed(said, &key, &swarm.id()).encode());
        swarm.pass(1000 * MS);
    }
    votes_on(swarm, 3);
}

fn two_votes(swarm: &Swarm, sequence: u32, classes: [u32; 2]) -> [Envelope; 2] {
    let (round, id) = (swarm.round(), swarm.id());
    classes.map(|class| {
        let said = forged::said(6, Stamp { boot: 1, sequence }, forged::vote(round, class, 2.0));
        forged::signed(said, &key(6), &id)
    })
}

fn two_faced(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(1);
    swarm.pass(50 * MS);
    let [one, other] = two_votes(swarm, 1, [3, 4]);
    for robot in 1..=5 {
        let said = if robot <= 2 { &one } else { &other };
        swarm.put_to(robot, &Topic::Vote(RobotId(6)), &said.encode());
    }
    swarm.end(began);
}

fn goes_on(swarm: &mut Swarm) {
    two_faced(swarm);
    votes_on(swarm, 2);
}

/// Votes in another round, after those who were lied to have had time to tell each other.
fn votes_on(swarm: &mut Swarm, sequence: u32) {
    swarm.pass(8000 * MS);
    let began = swarm.now();
    swarm.begin(2);
    swarm.pass(50 * MS);
    let [vote, _] = two_votes(swarm, sequence, [5, 5]);
    swarm.put_vote(&vote);
    swarm.end(began);
}

fn convicted(seed: u64) -> Played {
    let (now, swarm) = (Duration::from_secs(seed), Swarm::new(&Plan::sealed().liars(1), seed, false));
    let (roster, [one, other]) = (roster(6), two_votes(&swarm, 1, [3, 4]));
    let mut witness = Witness::new(&roster);
    let mut verifiers = vec![Verifier::new(roster.clone(), Budget::default()); 5];
    let observe = |witness: &mut Witness, said: &Envelope| {
        let signature = said.signature.as_ref()?;
        witness.observe(&said.statement(), signature)
    };
    let mut refused = BTreeMap::new();
    let reached = match (observe(&mut witness, &one), observe(&mut witness, &other)) {
        (None, Some(evidence)) => verifiers.iter_mut().try_for_each(|verifier| {
            let convicted = verifier.convict(now, &evidence, is_refuted);
            if !matches!(convicted, Ok(Conviction { robot: RobotId(6), .. })) {
                return Err(format!("{convicted:?}"));
            }
            let later = two_votes(&swarm, 2, [5, 5])[0].clone();
            match verifier.check(now, &later.statement(), later.signature.as_ref()) {
                Err(cause @ Distrust::Convicted) => {
                    *refused.entry(cause.name().to_owned()).or_default() += 1;
                    Ok(())
                }
                other => Err(format!("its next vote: {other:?}")),
            }
        }),
        other => Err(format!("{other:?}")),
    };
    // Nobody makes an honest robot look like that: its second statement needs its key.
    let framed = Envelope { author: RobotId(2), ..other.clone() };
    let framed = Envelope {
        signature: Some(statement::sign(&key(6), &roster.swarm_id(), &framed.statement())),
        ..framed
    };
    let reached = reached.and_then(|()| {
        match verifiers[0].check(now, &framed.statement(), framed.signature.as_ref()) {
            Err(Distrust::Forged) => Ok(()),
            other => Err(format!("a statement in robot 2's name: {other:?}")),
        }
    });
    Played { reached, refused, silent: 0 }
}
