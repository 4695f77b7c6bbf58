//! Decisions that do not follow from the votes that they bring, and what is evidence of that.

use std::time::Duration;

use gestalt_protocol::{
    Announcement, ClassId, Decision, Envelope, RobotId, Signature, Stamp, Topic, decode_json,
};

use super::decisions::{
    FALSE, TRUE, amid_a_round, eight, liar_is_out, of_chosen_votes, once_all_voted, same_gesture,
};
use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, unmoved};
use crate::forged;
use crate::swarm::Swarm;
use crate::swarm::world::key;
use crate::trust::Evidence;

const MS: Duration = Duration::from_millis(1);

pub const ALL: &[Attack] = &[
    Attack {
        number: "A4 · 11",
        what: "an enrolled robot decides on such votes, and claims the gesture that it wants",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all convict it, and decide as in peace",
        counted: Counted::All(&["refused_decision_convicted", "refused_repair_convicted"]),
        gap: None,
        play: |seed| beside(&eight(), seed, underivable, as_in_peace_without_it),
    },
    Attack {
        number: "11",
        what: "an enrolled robot that claimed what does not follow from its votes goes on voting",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "it is expelled: its votes count no more",
        counted: Counted::All(&["refused_decision_convicted", "refused_vote_convicted"]),
        gap: None,
        play: |seed| beside(&eight(), seed, then_votes, liar_is_out),
    },
    Attack {
        number: "11",
        what: "an enrolled robot votes, and gives what does not follow to one robot alone",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all convict it, and its vote counts no more in the open round",
        counted: Counted::Some(&["refused_repair_convicted"]),
        gap: None,
        play: |seed| {
            beside(&eight(), seed, to_one_alone, |peace, war| {
                liar_is_out(peace, war)?;
                as_in_peace_without_it(peace, war)
            })
        },
    },
    Attack {
        number: "11",
        what: "an enrolled robot passes on what another one decided, with one claim altered, from the gesture to the weight of a vote",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all convict it, and nobody the other one",
        counted: Counted::All(&["refused_repair_convicted"]),
        gap: None,
        play: |seed| beside(&eight(), seed, |swarm| altered(swarm, seed), as_in_peace_without_it),
    },
    Attack {
        number: "11",
        what: "an enrolled robot passes on what another one decided, as it is",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::None("it is true, and each has it"),
        gap: None,
        play: |seed| beside(&eight(), seed, as_it_is, unmoved),
    },
    Attack {
        number: "11",
        what: "an enrolled robot says in another's name what does not follow",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_decision_forged"]),
        gap: None,
        play: |seed| beside(&eight(), seed, in_anothers_name, unmoved),
    },
    Attack {
        number: "11",
        what: "shows as evidence what an honest robot announced, as it is, with a vote flipped, signed by another, and a vote of it",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_evidence_false"]),
        gap: None,
        play: |seed| beside(&eight(), seed, |swarm| accuses(swarm, 1), unmoved),
    },
    Attack {
        number: "11",
        what: "shows all of that as fast as it can",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "nothing",
        counted: Counted::All(&["refused_evidence_false"]),
        gap: None,
        play: |seed| beside(&eight(), seed, |swarm| accuses(swarm, 30), unmoved),
    },
    Attack {
        number: "11",
        what: "floods the swarm with false evidence against a liar, so that the true one be lost in it",
        tier: Tier::T4,
        setting: Setting::Sealed,
        expected: "all convict it, and decide as in peace",
        counted: Counted::Some(&["refused_evidence_false", "refused_repair_convicted"]),
        gap: None,
        play: |seed| beside(&eight(), seed, hidden_in_a_flood, as_in_peace_without_it),
    },
];

/// The gesture is that of peace, and all honest robots have convicted the liar and nobody else.
fn as_in_peace_without_it(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    for robot in 1..=war.liar() {
        let expected = if robot == war.liar() { war.honest() } else { 0 };
        let convicting = war.convicting(robot);
        if convicting != expected {
            return Err(format!("{convicting} robots convict robot {robot}"));
        }
    }
    same_gesture(peace, war)
}

fn wanted(swarm: &Swarm) -> Decision {
    Decision { class: Some(ClassId(FALSE)), ..of_chosen_votes(swarm) }
}

fn underivable(swarm: &mut Swarm) {
    once_all_voted(swarm, &|swarm| {
        let decision = wanted(swarm);
        swarm.put_decision(&decision);
        swarm.give(swarm.liar(), Some(decision), Vec::new());
    });
}

/// The liar's vote, its n-th.
fn votes(swarm: &mut Swarm, sequence: u32) {
    let (round, id, liar) = (swarm.round(), swarm.id(), swarm.liar());
    let vote = forged::said(liar, Stamp { boot: 1, sequence }, forged::vote(round, FALSE, 1.0));
    swarm.put_vote(&forged::signed(vote, &key(liar), &id));
}

fn then_votes(swarm: &mut Swarm) {
    underivable(swarm);
    amid_a_round(swarm, &|swarm| votes(swarm, 9));
}

fn to_one_alone(swarm: &mut Swarm) {
    let began = swarm.now();
    swarm.begin(TRUE);
    swarm.pass(50 * MS);
    if swarm.at_war() {
        votes(swarm, 1);
    }
    swarm.pass(70 * MS);
    if swarm.at_war() {
        let give = forged::given(wanted(swarm));
        swarm.whisper_to(3, swarm.liar(), &give);
    }
    swarm.end(began);
}

/// What robot 1 holds at the end of a round.
fn held(swarm: &mut Swarm) -> Option<Decision> {
    swarm.show(TRUE);
    swarm.mind(1).held().cloned()
}

fn altered(swarm: &mut Swarm, seed: u64) {
    let Some(mut decision) = held(swarm) else { return };
    let certificate = &mut decision.certificate;
    match seed % 8 {
        0 => decision.class = Some(ClassId(FALSE)),
        1 => decision.confidence -= 1e-4,
        2 => certificate.probabilities[0] += 1e-4,
        3 => certificate.quorum -= 1,
        4 => certificate.robots += 50,
        5 => certificate.votes[0].class = ClassId(FALSE),
        6 => certificate.votes[0].weight = 0.5,
        _ => {
            let aside = certificate.votes.remove(0).held();
            certificate.others.push(aside);
        }
    }
    swarm.give(swarm.liar(), Some(decision), Vec::new());
}

fn as_it_is(swarm: &mut Swarm) {
    let decision = held(swarm);
    swarm.give(swarm.liar(), decision, Vec::new());
}

fn in_anothers_name(swarm: &mut Swarm) {
    once_all_voted(swarm, &|swarm| {
        let (decision, stamp) = (wanted(swarm), Stamp { boot: 9, sequence: 1 });
        let said = Announcement { decision, label: None, announcer: RobotId(2), stamp, signature: None };
        let said = forged::signed(said.into(), &key(swarm.liar()), &swarm.id());
        swarm.put_announcement(said);
    });
}

/// So often, what may look like evidence against whoever announced the last decision.
fn accuses(swarm: &mut Swarm, times: u32) {
    swarm.show(TRUE);
    let said = swarm.air().iter().rev().filter(|parcel| swarm.topic(&parcel.key) == Some(Topic::Decision));
    let mut said = said.filter_map(|parcel| decode_json::<Announcement>(&parcel.bytes).ok());
    let said = said.next().filter(|_| swarm.at_war());
    for _ in 0..times {
        for evidence in said.as_ref().map_or(Vec::new(), |said| accusations(swarm, said)) {
            swarm.put(&Topic::Evidence, &evidence);
        }
        swarm.pass(10 * MS);
    }
    swarm.show(TRUE + 1);
}

fn accusations(swarm: &Swarm, said: &Announcement) -> Vec<Vec<u8>> {
    let (true_words, id) = (Envelope::from(said.clone()), swarm.id());
    let mut flipped = said.clone();
    let of_first = &mut flipped.decision.certificate.votes[0].vote;
    of_first.evidence.iter_mut().for_each(|nats| *nats = -*nats);
    let flipped = Envelope::from(flipped);
    let vote = Envelope::from(said.decision.certificate.votes[0].held());
    let by_liar = forged::signed(flipped.clone(), &key(swarm.liar()), &id);
    let nobody = Envelope { signature: Some(Signature::from_bytes([7; 64])), ..flipped.clone() };
    let evidence = [true_words, flipped, vote, by_liar, nobody]
        .into_iter()
        .filter_map(|said| Some(Evidence::of_decision(said.statement(), said.signature?).encode()));
    evidence.collect()
}

fn hidden_in_a_flood(swarm: &mut Swarm) {
    once_all_voted(swarm, &|swarm| {
        let flood = |swarm: &mut Swarm, first: u32| {
            for sequence in first..first + 40 {
                let (author, stamp) = (RobotId(swarm.liar()), Stamp { boot: 20, sequence });
                let message = forged::given(wanted(swarm));
                let said = Envelope { author, stamp, message, signature: None };
                let said = forged::signed(said, &key(2), &swarm.id());
                let evidence = said.signature.map(|by| Evidence::of_decision(said.statement(), by));
                evidence.iter().for_each(|it| swarm.put(&Topic::Evidence, &it.encode()));
            }
        };
        flood(swarm, 0);
        let give = forged::given(wanted(swarm));
        swarm.whisper_to(3, swarm.liar(), &give);
        flood(swarm, 40);
    });
}
