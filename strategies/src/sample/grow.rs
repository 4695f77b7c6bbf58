//! Lists that grow little by little: a thousand robots that each hold as many would otherwise hold room for as many again.

/// One place in so many is empty at most, and as much room is made for more.
pub(super) const EMPTY: usize = 8;

/// Puts an item into its place.
pub(super) fn insert<T>(list: &mut Vec<T>, place: usize, item: T) {
    if list.len() == list.capacity() {
        list.reserve_exact(1 + list.len() / EMPTY);
    }
    list.insert(place, item);
}
