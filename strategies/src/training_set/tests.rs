//! What goes of a set that was stored where there was far more room.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::SelectionRule;

/// The newest goes. Says how often it was asked.
#[derive(Debug, Default)]
struct Newest(usize);

impl Forgetting for Newest {
    fn victim(&mut self, samples: &HeldSamples, _: &mut dyn Rng) -> Option<u64> {
        self.0 += 1;
        assert!(self.0 <= MOST_CHOSEN, "a rule may take time by the square");
        samples.iter().next_back().map(|newest| newest.key)
    }
}

#[test]
fn of_far_too_many_the_oldest_go_unasked_but_none_of_what_there_is_little_of() {
    let last = MOST_CHOSEN as u64 + 80;
    let stored = (1..=last).map(|key| HeldSample {
        key,
        part: SetPart::Personal,
        id: None,
        class: ClassId(u32::from(key > 20)),
        round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
        vector: [key as f32].into(),
    });
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut set =
        TrainingSet::new(RobotId(1), 30, SelectionRule::default().build(), Box::<Newest>::default());
    set.restore(stored.collect(), SeenSamples::default(), last + 1).unwrap();
    assert_eq!(set.trim(&mut rng).len(), MOST_CHOSEN + 50);
    let held: Vec<u64> = set.iter().map(|sample| sample.key).collect();
    assert_eq!(held, (1..=20).chain(71..=80).collect::<Vec<_>>());
}
