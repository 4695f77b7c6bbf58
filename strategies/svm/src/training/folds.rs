//! Splits samples for cross-validation.

use std::collections::BTreeMap;

use rand::Rng;
use rand::seq::SliceRandom;

use crate::labelled::LabelledFeatures;

/// What stays together when samples are split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Folding {
    /// All samples of a group (a person) fall into the same fold: the error is that for new people.
    ByGroup,
    /// Every class is spread evenly over the folds: the error is that for more of the same people.
    BySample,
}

/// The fold of each sample, `0..folds`, and what stayed together.
///
/// By group where every sample has one and every class comes to lie in at least two folds, so that no fold's
/// complement lacks a class; else by sample.
pub(super) fn split(
    samples: &[LabelledFeatures],
    classes: usize,
    folds: usize,
    rng: &mut impl Rng,
) -> (Vec<usize>, Folding) {
    if let Some(assignment) = by_group(samples, folds, rng) {
        let mut seen = vec![vec![false; folds]; classes];
        for (sample, &fold) in samples.iter().zip(&assignment) {
            seen[sample.class.index()][fold] = true;
        }
        if seen.iter().all(|folds| folds.iter().filter(|seen| **seen).count() >= 2) {
            return (assignment, Folding::ByGroup);
        }
    }
    (by_sample(samples, classes, folds, rng), Folding::BySample)
}

fn by_group(samples: &[LabelledFeatures], folds: usize, rng: &mut impl Rng) -> Option<Vec<usize>> {
    let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (index, sample) in samples.iter().enumerate() {
        members.entry(sample.group?).or_default().push(index);
    }
    let mut groups: Vec<Vec<usize>> = members.into_values().collect();
    groups.shuffle(rng);
    // The largest first, each to the smallest fold so far: folds of nearly one size.
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    let mut sizes = vec![0; folds];
    let mut assignment = vec![0; samples.len()];
    for group in groups {
        let fold = (0..folds).min_by_key(|&fold| sizes[fold])?;
        sizes[fold] += group.len();
        group.into_iter().for_each(|index| assignment[index] = fold);
    }
    Some(assignment)
}

fn by_sample(samples: &[LabelledFeatures], classes: usize, folds: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut assignment = vec![0; samples.len()];
    let mut next = 0;
    for class in 0..classes {
        let mut members: Vec<usize> =
            (0..samples.len()).filter(|&i| samples[i].class.index() == class).collect();
        members.shuffle(rng);
        for index in members {
            assignment[index] = next % folds;
            next += 1;
        }
    }
    assignment
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::ClassId;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    fn samples(groups: impl Fn(usize) -> Option<u32>) -> Vec<LabelledFeatures> {
        let sample = |i: usize| LabelledFeatures::new(vec![0.0], ClassId((i % 3) as u32), groups(i));
        (0..60).map(sample).collect()
    }

    #[test]
    fn a_person_never_lies_in_two_folds() {
        let samples = samples(|i| Some((i / 6) as u32));
        let (folds, folding) = split(&samples, 3, 5, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(folding, Folding::ByGroup);
        for (person, folds) in folds.chunks(6).enumerate() {
            assert!(folds.iter().all(|fold| *fold == folds[0]), "person {person}: {folds:?}");
        }
        for fold in 0..5 {
            assert_eq!(folds.iter().filter(|f| **f == fold).count(), 12, "folds of one size");
        }
    }

    #[test]
    fn one_person_alone_is_split_by_sample() {
        for samples in [samples(|_| Some(7)), samples(|_| None)] {
            let (folds, folding) = split(&samples, 3, 5, &mut ChaCha8Rng::seed_from_u64(1));
            assert_eq!(folding, Folding::BySample);
            for class in 0..3 {
                for fold in 0..5 {
                    let members = (0..60).filter(|i| i % 3 == class && folds[*i] == fold);
                    assert_eq!(members.count(), 4, "class {class} fold {fold}");
                }
            }
        }
    }
}
