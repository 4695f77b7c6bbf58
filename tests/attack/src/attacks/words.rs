//! What instructors signed, told to whoever did not hear it: by a robot that lies.

use std::time::Duration;

use gestalt_protocol::{
    ClassId, Fate, Gesture, Instruction, Lesson, Message, Naming, Namings, RoundId, SignedWord, Topic, Word,
};
use gestalt_strategies::Mind;

use crate::attack::{Attack, Counted, Setting, Tier};
use crate::beside::{beside, learned_alike, unmoved};
use crate::forged;
use crate::swarm::world::instructor;
use crate::swarm::{Parcel, Plan, Swarm};

/// The robot that lies.
const LIAR: u32 = 6;

const fn row(
    what: &'static str,
    tier: Tier,
    expected: &'static str,
    counted: Counted,
    play: fn(u64) -> crate::attack::Played,
) -> Attack {
    Attack { number: "3", what, tier, setting: Setting::Sealed, expected, counted, gap: None, play }
}

pub const ALL: &[Attack] = &[
    row(
        "an enrolled robot relabels in ada's name what she taught",
        Tier::T4,
        "nothing",
        Counted::All(&["refused_lesson_unproven"]),
        |seed| beside(&Plan::sealed().liars(1), seed, relabelled, unmoved),
    ),
    row(
        "an enrolled robot tells ada's word under another round, class, count and name than she signed",
        Tier::T4,
        "nothing",
        Counted::All(&["refused_lesson_unproven"]),
        |seed| beside(&Plan::sealed().liars(1), seed, moved, unmoved),
    ),
    row(
        "an enrolled robot tells ada's older word after her newer one, also to a robot that lost its memory",
        Tier::T4,
        "nothing",
        Counted::Some(&["refused_word_repeated"]),
        |seed| beside(&Plan::sealed().liars(1), seed, replayed, learned_alike),
    ),
    row(
        "an enrolled robot vouches for ada, who has a key of her own",
        Tier::T4,
        "nothing",
        Counted::All(&["refused_lesson_unproven", "refused_word_forged"]),
        |seed| beside(&Plan::sealed().liars(1), seed, vouched_for_ada, unmoved),
    ),
    row(
        "an enrolled robot vouches for people without keys, under the lowest and the highest count",
        Tier::T4,
        "nothing: who has a key goes before who has none",
        Counted::None("they may teach what nobody with a key has"),
        |seed| beside(&Plan::sealed().liars(1), seed, vouched_for_others, learned_alike),
    ),
    row(
        "an instructor who may open rounds, and not teach, says what it was, and a robot passes that on",
        Tier::T5,
        "nothing",
        Counted::Some(&["refused_lesson_unproven", "refused_word_not_allowed"]),
        |seed| beside(&Plan::sealed().liars(1), seed, said_by_olga, learned_alike),
    ),
    row(
        "an instructor who may teach contradicts one who spoke before, and one who may overrule, through a robot that passes it on",
        Tier::T5,
        "nothing: that takes the role",
        Counted::None("it is known as that instructor's word, and another's goes before it"),
        |seed| beside(&Plan::sealed().liars(1), seed, said_by_eve, learned_alike),
    ),
    row(
        "an enrolled robot retires the gesture that ada named, in her name and in that of one without a key",
        Tier::T4,
        "nothing",
        Counted::Some(&["refused_naming_unproven"]),
        |seed| beside(&Plan::sealed().liars(1), seed, retired, named_alike),
    ),
];

fn was(round: RoundId, class: u32) -> Instruction {
    Instruction::Was { round, class: Gesture::Class(ClassId(class)) }
}

fn tell(swarm: &mut Swarm, lessons: Vec<Lesson>) {
    swarm.whisper(LIAR, &forged::lessons(lessons));
}

fn signed(parcel: &Parcel) -> SignedWord {
    SignedWord { word: parcel.bytes.clone(), attachment: parcel.attachment.clone().unwrap_or_default() }
}

/// The words that ada said so far.
fn of_ada(swarm: &Swarm) -> Vec<Parcel> {
    let is_hers = |parcel: &&Parcel| swarm.topic(&parcel.key) == Some(Topic::Word(instructor("ada")));
    swarm.air().iter().filter(is_hers).cloned().collect()
}

fn relabelled(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.teach(round, 1);
    tell(swarm, vec![forged::lesson(round, "ada", at + 1, Word::Was(ClassId(4)))]);
    swarm.pass(Duration::from_secs(5));
}

fn moved(swarm: &mut Swarm) {
    let first = swarm.show(1);
    let at = swarm.teach(first, 1);
    let second = swarm.show(2);
    let (said, one, four) = (signed(&of_ada(swarm)[0]), Word::Was(ClassId(1)), Word::Was(ClassId(4)));
    let of = |round, by, count, word| forged::lesson_of(said.clone(), round, by, count, word);
    for lesson in [
        of(second, "ada", at, one),
        of(first, "ada", at, four),
        of(first, "ada", at, Word::Retracted),
        of(first, "ada", at + 1, one),
        of(first, "eve", at, one),
    ] {
        tell(swarm, vec![lesson]);
    }
    swarm.pass(Duration::from_secs(5));
}

fn replayed(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.teach(round, 1);
    swarm.teach(round, 5);
    let older = of_ada(swarm)[0].clone();
    let lesson = forged::lesson_of(signed(&older), round, "ada", at, Word::Was(ClassId(1)));
    tell(swarm, vec![lesson.clone()]);
    swarm.replay(&older);
    swarm.pass(Duration::from_secs(5));
    swarm.restart(5, true);
    swarm.whisper_to(5, LIAR, &forged::lessons(vec![lesson]));
    swarm.replay_to(5, &older);
    swarm.pass(Duration::from_secs(20));
}

fn vouched_for_ada(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let count = swarm.teach(round, 1) + 1;
    let said = forged::vouched(LIAR, &swarm.id(), "ada", count, &was(round, 4));
    let lesson = forged::lesson_of(said.clone(), round, "ada", count, Word::Was(ClassId(4)));
    tell(swarm, vec![lesson]);
    let key = swarm.key(&Topic::Word(instructor("ada")));
    swarm.replay(&Parcel { key, bytes: said.word, attachment: Some(said.attachment), at: count });
    swarm.pass(Duration::from_secs(5));
}

fn vouched_for_others(swarm: &mut Swarm) {
    let of_ada = swarm.show(1);
    swarm.teach(of_ada, 1);
    let of_eve = swarm.show(2);
    swarm.say("eve", &was(of_eve, 2));
    for (round, class) in [(of_ada, 4), (of_eve, 5)] {
        for (by, count) in [("guest", 0), ("visitor", u64::MAX)] {
            let said = forged::vouched(LIAR, &swarm.id(), by, count, &was(round, class));
            let lesson = forged::lesson_of(said, round, by, count, Word::Was(ClassId(class)));
            tell(swarm, vec![lesson]);
        }
    }
    swarm.pass(Duration::from_secs(5));
}

fn said_by_olga(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let word = swarm.word("olga", &was(round, 4));
    tell(swarm, vec![forged::lesson_of(signed(&word), round, "olga", word.at, Word::Was(ClassId(4)))]);
    swarm.replay(&word);
    swarm.pass(Duration::from_secs(5));
}

fn said_by_eve(swarm: &mut Swarm) {
    for (by, class) in [("ada", 1), ("eve0", 2)] {
        let round = swarm.show(class);
        swarm.say(by, &was(round, class));
        let word = swarm.word("eve", &was(round, 4));
        tell(swarm, vec![forged::lesson_of(signed(&word), round, "eve", word.at, Word::Was(ClassId(4)))]);
        swarm.pass(Duration::from_secs(5));
    }
}

fn retired(swarm: &mut Swarm) {
    let round = swarm.show(1);
    let at = swarm.say("ada", &Instruction::New { label: "circle".to_owned(), round: Some(round) });
    let hers = signed(&of_ada(swarm)[0]);
    let retire = Instruction::Retire { class: Gesture::Label("circle".to_owned()) };
    let vouched = |by, count| forged::vouched(LIAR, &swarm.id(), by, count, &retire);
    let said = [
        ("ada", at + 1, None),
        ("ada", at, Some(hers)),
        ("ada", at + 1, Some(vouched("ada", at + 1))),
        ("guest", u64::MAX, Some(vouched("guest", u64::MAX))),
    ];
    for (said_by, count, said) in said {
        let naming = Naming {
            by: instructor("ada"),
            label: "circle".to_owned(),
            count,
            at: count,
            said_by: instructor(said_by),
            fate: Fate::Retired,
            said,
        };
        swarm.whisper(LIAR, &Message::Namings(Namings { namings: vec![naming] }));
    }
    swarm.pass(Duration::from_secs(5));
}

/// All use the same names as in peace, and there is one.
fn named_alike(peace: &Swarm, war: &Swarm) -> Result<(), String> {
    let names = |swarm: &Swarm| -> Vec<Vec<String>> {
        let of = |mind: &Mind| -> Vec<String> {
            let named = mind.learned().into_iter().flat_map(|status| status.named);
            named.map(|gesture| gesture.label).collect()
        };
        swarm.minds().map(of).collect()
    };
    match names(war) {
        named if named == names(peace) && named.iter().all(|named| named.len() == 1) => {
            learned_alike(peace, war)
        }
        named => Err(format!("named {named:?}")),
    }
}
