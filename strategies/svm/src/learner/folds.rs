//! Which samples of a class are held out together.

use super::samples::{KernelRow, Key};

/// The fold of each sample of a class, `0..folds`, given the showing that each is of: samples of one repeat each other, so they are held out together.
///
/// It depends on the showing alone, so that it stays when others come and go and does not depend on their order. Chance would deal a class of few showings
/// unevenly: those are dealt in turn, so that one with fewer than `folds` is left out one by one.
pub(super) fn folds(samples: &[KernelRow], folds: usize, showing: impl Fn(Key) -> u64) -> Vec<usize> {
    let few = 4 * folds;
    let hashes: Vec<u64> = samples.iter().map(|sample| hash(showing(sample.key))).collect();
    let mut distinct = hashes.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let fold = |hash: &u64| {
        if distinct.len() >= few {
            (hash % folds as u64) as usize
        } else {
            distinct.partition_point(|other| other < hash) % folds
        }
    };
    hashes.iter().map(fold).collect()
}

/// The finaliser of SplitMix64, a bijection: G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number
/// generators", OOPSLA 2014.
fn hash(showing: u64) -> u64 {
    let mut z = showing;
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own(key: Key) -> u64 {
        let Key::Inserted(key) = key else { unreachable!() };
        key
    }

    fn samples(keys: impl Iterator<Item = u64>) -> Vec<KernelRow> {
        keys.map(|key| KernelRow::new(Key::Inserted(key), [].into(), 0)).collect()
    }

    #[test]
    fn few_samples_are_dealt_in_turn_and_fewer_left_out_one_by_one() {
        for count in 1..20 {
            let folds = folds(&samples(0..count), 5, own);
            for fold in 0..5 {
                let held_out = folds.iter().filter(|of| **of == fold).count() as u64;
                assert!((count / 5..=count.div_ceil(5)).contains(&held_out), "{held_out} of {count}");
            }
        }
    }

    #[test]
    fn a_sample_of_many_keeps_its_fold() {
        let all = folds(&samples(0..100), 5, own);
        let some = folds(&samples((0..100).filter(|key| key % 3 != 0).rev()), 5, own);
        let expected: Vec<usize> = (0..100).filter(|key| key % 3 != 0).rev().map(|key| all[key]).collect();
        assert_eq!(some, expected);
        assert!(
            (0..5).all(|fold| (10..=30).contains(&all.iter().filter(|of| **of == fold).count())),
            "{all:?}"
        );
    }

    #[test]
    fn samples_of_a_showing_are_held_out_together() {
        for count in [12, 60, 400] {
            let folds = folds(&samples(0..count), 5, |key| own(key) / 4);
            assert!(folds.chunks(4).all(|showing| showing.iter().all(|fold| *fold == showing[0])), "{count}");
            assert!((0..5.min(count as usize / 4)).all(|fold| folds.contains(&fold)), "{count}: {folds:?}");
        }
    }
}
