//! The same picture under several names: whoever learns from one of them is not to be measured on another.

use std::collections::BTreeSet;

use super::{Dataset, LabelledImage};

/// Leaves each picture with a gesture in once, under whichever name: of copies one whose person is known, else the first. Gives how many are left out.
/// Files that cannot be read stay: whoever looks at them says so.
pub fn leave_out_copies(sets: &mut [Dataset]) -> usize {
    let print = |image: &LabelledImage| image.fingerprint().ok();
    let prints: Vec<Vec<Option<u64>>> =
        sets.iter().map(|set| set.images.iter().map(print).collect()).collect();
    let (mut met, mut kept) = (BTreeSet::new(), BTreeSet::new());
    for known in [true, false] {
        for (n, set) in sets.iter().enumerate() {
            for (m, image) in set.images.iter().enumerate() {
                if image.person.is_some() == known && prints[n][m].is_none_or(|print| met.insert(print)) {
                    kept.insert((n, m));
                }
            }
        }
    }
    let all: usize = sets.iter().map(|set| set.images.len()).sum();
    for (n, set) in sets.iter_mut().enumerate() {
        let mut places = 0..;
        set.images.retain(|_| places.next().is_some_and(|m| kept.contains(&(n, m))));
    }
    all - kept.len()
}
