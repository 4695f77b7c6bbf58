//! Which moments of a run are taught and which are only judged.

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::error::ExperimentError;
use super::pool::Moment;

/// The most held-out moments that are judged after each round.
const JUDGED: usize = 60;

/// Of so many people or more some are held out; of fewer, moments.
const PEOPLE: usize = 8;

/// The moments of a run: which are shown to be learned from, and which are only to be judged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Split {
    /// Taught moments before and after the drift, by class.
    pub taught: [Vec<Vec<usize>>; 2],
    /// Held-out moments before and after the drift.
    pub held_out: [Vec<usize>; 2],
    /// Whether they are of people who taught nothing in that half; else of those who taught it, at other moments.
    pub of_others: [bool; 2],
}

impl Split {
    /// How many hands are judged after each round, where before and after a drift differ the fewer.
    #[must_use]
    pub fn judged(&self) -> usize {
        self.held_out.iter().map(Vec::len).filter(|judged| *judged > 0).min().unwrap_or(0)
    }

    /// Whose hands are judged, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        let whose = |half: usize| match self.of_others[half] {
            true => "hands of people who taught nothing",
            false => "other moments of the hands that taught",
        };
        match &self.held_out {
            [_, after] if after.is_empty() || whose(0) == whose(1) => whose(0).to_owned(),
            _ => format!("{} (after the change on {})", whose(0), whose(1)),
        }
    }
}

/// Who and what is held out of one half of a run.
struct Draw {
    /// All people.
    people: Vec<u32>,
    /// Of each class, which moment in the order in which they are listed comes at which place; empty where people are held out.
    order: Vec<Vec<usize>>,
    /// Those people who are held out.
    held_out: Vec<u32>,
}

impl Draw {
    fn new(people: Vec<u32>, of_classes: &[Vec<usize>], rng: &mut ChaCha8Rng) -> Self {
        let mut held_out = people.clone();
        held_out.shuffle(rng);
        held_out.truncate(people.len() / 2);
        let mut order: Vec<Vec<usize>> = Vec::new();
        if people.len() < PEOPLE {
            order.extend(of_classes.iter().map(|of_class| (0..of_class.len()).collect()));
            order.iter_mut().for_each(|of_class| of_class.shuffle(rng));
        }
        Self { people, order, held_out }
    }

    /// Held out and taught moments of a class.
    fn part(&self, moments: &[Moment], class: usize, of_class: &[usize]) -> (Vec<usize>, Vec<usize>) {
        match self.order.get(class) {
            Some(order) => {
                let all: Vec<usize> = order.iter().filter_map(|n| of_class.get(*n).copied()).collect();
                let (held, taught) = all.split_at(all.len() / 2);
                (held.to_vec(), taught.to_vec())
            }
            None => of_class
                .iter()
                .partition(|n| moments[**n].person.is_some_and(|person| self.held_out.contains(&person))),
        }
    }
}

impl Split {
    /// Draws half of the people to be held out; where there are few, half of the moments of each gesture. Where the same are shown before and after a
    /// drift, the same are held out: who was taught before it is not judged after it.
    ///
    /// # Errors
    /// A gesture that too few show.
    pub fn draw(
        gestures: &[String],
        moments: &[Moment],
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, ExperimentError> {
        let mut split = Self::default();
        let mut draw: Option<Draw> = None;
        for (half, after) in [false, true].into_iter().enumerate() {
            let of_half = || moments.iter().enumerate().filter(|(_, moment)| moment.after == after);
            let mut people: Vec<u32> = of_half().filter_map(|(_, moment)| moment.person).collect();
            people.sort_unstable();
            people.dedup();
            let of_classes: Vec<Vec<usize>> = (0..gestures.len())
                .map(|class| {
                    of_half().filter(|(_, moment)| moment.class.index() == class).map(|(n, _)| n).collect()
                })
                .collect();
            let before = draw.take().filter(|before| before.people == people);
            let drawn = draw.insert(before.unwrap_or_else(|| Draw::new(people, &of_classes, rng)));
            split.of_others[half] = drawn.order.is_empty();
            let mut held_out: Vec<Vec<usize>> = Vec::new();
            for (class, of_class) in of_classes.iter().enumerate() {
                let (held, taught) = drawn.part(moments, class, of_class);
                if (held.is_empty() || taught.is_empty()) && of_half().next().is_some() {
                    return Err(ExperimentError::Setting(format!(
                        "too few hands show '{}' to teach with some and to judge others: take more",
                        gestures[class]
                    )));
                }
                split.taught[half].push(taught);
                held_out.push(held);
            }
            let each = JUDGED / gestures.len().max(1);
            for mut class in held_out {
                class.shuffle(rng);
                split.held_out[half].extend(class.into_iter().take(each.max(1)));
            }
        }
        Ok(split)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use gestalt_protocol::ClassId;
    use rand::SeedableRng;

    use super::*;

    /// Three gestures, each shown once by each of so many people, or so many times by nobody known, before a change and after it.
    fn shown(times: u32, known: bool, later: u32) -> Vec<Moment> {
        let moment = |after, n, class| Moment {
            class: ClassId(class),
            person: known.then_some(n + if after { later } else { 0 }),
            after,
        };
        let of_half = |after| (0..times).flat_map(move |n| (0..3).map(move |class| moment(after, n, class)));
        of_half(false).chain(of_half(true)).collect()
    }

    fn split(moments: &[Moment], seed: u64) -> Split {
        let gestures: Vec<String> = ["a", "b", "c"].map(str::to_owned).into();
        Split::draw(&gestures, moments, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap()
    }

    #[test]
    fn who_was_taught_before_a_change_is_not_judged_after_it() {
        for (times, known) in [(36, true), (5, true), (7, false), (60, false)] {
            let moments = shown(times, known, 0);
            for seed in 0..20 {
                let split = split(&moments, seed);
                // Each moment comes again after the change, so many further on.
                let again = moments.len() / 2;
                let taught: BTreeSet<usize> =
                    split.taught.iter().flatten().flatten().map(|n| n % again).collect();
                let judged: BTreeSet<usize> = split.held_out.iter().flatten().map(|n| n % again).collect();
                assert!(taught.is_disjoint(&judged), "{times} {known} {seed}");
                assert!(split.held_out.iter().all(|held_out| !held_out.is_empty()));
            }
        }
    }

    #[test]
    fn other_people_after_a_change_are_taught_and_judged_too() {
        let moments = shown(20, true, 20);
        let Split { taught, held_out, .. } = split(&moments, 1);
        for half in 0..2 {
            assert_eq!(taught[half].iter().map(Vec::len).sum::<usize>(), 30);
            assert_eq!(held_out[half].len(), 30);
            assert!(held_out[half].iter().all(|n| moments[*n].after == (half == 1)));
        }
    }

    #[test]
    fn it_is_said_whether_people_or_only_moments_are_held_out() {
        let said = |times, known, later| split(&shown(times, known, later), 1).describe();
        assert_eq!(said(36, true, 36), "hands of people who taught nothing");
        assert_eq!(said(60, false, 0), "other moments of the hands that taught");
        let mut few_then_many = shown(20, true, 20);
        few_then_many.iter_mut().filter(|moment| !moment.after).for_each(|moment| moment.person = Some(1));
        let of = split(&few_then_many, 1);
        assert_eq!(
            of.describe(),
            "other moments of the hands that taught (after the change on hands of people who taught nothing)"
        );
        assert_eq!(of.judged(), 30);
    }

    #[test]
    fn a_gesture_that_one_hand_shows_cannot_be_taught_and_judged() {
        let gestures = ["a".to_owned()];
        let alone = [Moment { class: ClassId(0), person: None, after: false }];
        let refused = Split::draw(&gestures, &alone, &mut ChaCha8Rng::seed_from_u64(1)).unwrap_err();
        assert!(refused.to_string().contains("too few hands show 'a'"), "{refused}");
    }
}
