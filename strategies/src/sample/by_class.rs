//! What a rule keeps of each class.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use gestalt_protocol::ClassId;

/// Takes out of what is kept of a class, if anything is, and drops that when `take` says that nothing is left: who takes part in a swarm can make up
/// classes without end.
pub(crate) fn take_out<T>(
    classes: &mut BTreeMap<ClassId, T>,
    class: ClassId,
    take: impl FnOnce(&mut T) -> bool,
) {
    if let Entry::Occupied(mut kept) = classes.entry(class)
        && take(kept.get_mut())
    {
        kept.remove();
    }
}
