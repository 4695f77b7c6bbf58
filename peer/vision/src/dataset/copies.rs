//! The same picture under several names: whoever learns from one of them is not to be measured on another.

use std::collections::BTreeSet;

use super::{Dataset, LabelledImage};

/// Leaves each picture with a gesture in once, under whichever name: of copies one whose person is known, else the first. Gives how many are left out.
/// Files that cannot be read stay: whoever looks at them says so.
pub fn leave_out_copies(sets: &mut [Dataset]) -> usize {
    let count = |sets: &[Dataset]| sets.iter().map(|set| set.images.len()).sum::<usize>();
    let (all, mut met) = (count(sets), BTreeSet::new());
    for known in [true, false] {
        let mut is_new =
            |image: &LabelledImage| image.fingerprint().ok().is_none_or(|print| met.insert(print));
        for set in &mut *sets {
            set.images.retain(|image| image.person.is_some() != known || is_new(image));
        }
    }
    all - count(sets)
}
