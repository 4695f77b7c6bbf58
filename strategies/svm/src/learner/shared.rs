//! The kernel between vectors that many learners hold alike.

use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use super::Learner;
use super::kernel::{kernel, push};

/// How many vectors there are at least before those that nobody holds any more are looked for.
const FEW: usize = 1024;

/// The kernel between vectors that several learners of one process hold, worked out once: a learner that [shares it](crate::Learner::sharing) looks there
/// before it reckons. What it learns is the same to the bit.
///
/// A vector is known by where it lies in memory, so learners have to hold the very ones that were [told](Self::hold), not copies. It takes n² · 4 bytes
/// for n vectors; those that nobody else holds any more give way to others.
#[derive(Debug)]
pub struct SharedKernel {
    gamma: f32,
    known: RwLock<Known>,
}

/// Vectors by place, and the kernel of each with all.
#[derive(Debug, Default)]
struct Known {
    vectors: Vec<Arc<[f32]>>,
    /// By address.
    places: BTreeMap<usize, u32>,
    rows: Vec<Vec<f32>>,
    free: Vec<u32>,
    /// At how many vectors it is looked through for those that nobody holds.
    full: usize,
}

impl Learner {
    /// A kernel for learners like this one to [share](Self::sharing), of no vectors yet.
    #[must_use]
    pub fn shared_kernel(&self) -> SharedKernel {
        SharedKernel::new(self.gamma)
    }

    /// The same, that looks up what others have worked out of the kernel; nothing of one with another γ. What it learns is the same.
    #[must_use]
    pub fn sharing(mut self, kernel: Arc<SharedKernel>) -> Self {
        if kernel.gamma == self.gamma {
            self.members = self.members.into_iter().map(|member| member.sharing(kernel.clone())).collect();
            self.samples.share(kernel);
        }
        self
    }
}

impl SharedKernel {
    /// Of nothing.
    fn new(gamma: f32) -> Self {
        Self { gamma, known: RwLock::new(Known { full: FEW, ..Known::default() }) }
    }

    /// Another, of no vectors, with the same γ.
    #[must_use]
    pub fn emptied(&self) -> Self {
        Self::new(self.gamma)
    }

    /// Works out the kernel of a vector with those held so far. One that is held already costs a look.
    pub fn hold(&self, vector: &Arc<[f32]>) {
        if self.place(vector).is_none() {
            // Nothing is left half done by a thread that ends in between but for a vector that is worked out and never found.
            self.known.write().unwrap_or_else(PoisonError::into_inner).hold(self.gamma, vector);
        }
    }

    /// The place of a vector that is held.
    pub(super) fn place(&self, vector: &Arc<[f32]>) -> Option<u32> {
        self.read().places.get(&address(vector)).copied()
    }

    /// What is known of the vector at that place. A learner holds the vector, so it stays there.
    pub(super) fn row(&self, place: Option<u32>) -> Row<'_> {
        Row { known: self.read(), place }
    }

    fn read(&self) -> RwLockReadGuard<'_, Known> {
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The kernel of one vector with all others.
pub(super) struct Row<'a> {
    known: RwLockReadGuard<'a, Known>,
    place: Option<u32>,
}

impl Row<'_> {
    /// By place; nothing where the vector is not known.
    pub fn values(&self) -> &[f32] {
        let row = self.place.and_then(|place| self.known.rows.get(place as usize));
        row.map_or(&[], Vec::as_slice)
    }
}

impl Known {
    fn hold(&mut self, gamma: f32, vector: &Arc<[f32]>) {
        if self.places.contains_key(&address(vector)) {
            return;
        }
        if self.free.is_empty() && self.vectors.len() >= self.full {
            self.let_go();
        }
        // As many as there is no number for would take an EiB.
        let number = self.free.pop().unwrap_or(self.vectors.len() as u32);
        let place = number as usize;
        match self.vectors.get_mut(place) {
            Some(free) => *free = vector.clone(),
            None => {
                self.vectors.push(vector.clone());
                self.rows.push(Vec::new());
            }
        }
        let row: Vec<f32> = self.vectors.iter().map(|other| kernel(gamma, other, vector)).collect();
        for (other, value) in self.rows.iter_mut().zip(&row) {
            if place < other.len() { other[place] = *value } else { push(other, *value) }
        }
        self.rows[place] = row;
        self.places.insert(address(vector), number);
    }

    /// Frees the places of vectors that nobody else holds.
    fn let_go(&mut self) {
        for (place, vector) in (0..).zip(&self.vectors) {
            // Nobody can hold it again: it is handed out nowhere.
            if Arc::strong_count(vector) == 1 && self.places.remove(&address(vector)).is_some() {
                self.free.push(place);
            }
        }
        self.full = FEW.max(2 * (self.vectors.len() - self.free.len()));
    }
}

fn address(vector: &Arc<[f32]>) -> usize {
    Arc::as_ptr(vector).addr()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::super::samples::{KernelMatrix, Key};
    use super::super::tests::{generator, vector};
    use super::*;

    #[test]
    fn what_is_looked_up_is_what_each_would_work_out() {
        let mut rng = generator(3);
        let shared = Arc::new(SharedKernel::new(0.3));
        let mut held: Vec<Arc<[f32]>> = Vec::new();
        let mut most = 0;
        for step in 0..6000 {
            if held.len() > 40 {
                held.swap_remove(rng.random_range(0..held.len() as u64) as usize);
            }
            held.push(vector(step % 3, &mut rng).into());
            shared.hold(&held[held.len() - 1]);
            most = most.max(shared.read().vectors.len());
            if step % 500 == 499 {
                // Of what the matrix holds a fifth is its own.
                let mut samples = KernelMatrix::new(3, 0.3);
                samples.share(shared.clone());
                for (key, vector) in (0..).zip(&held) {
                    let vector = if key % 5 == 0 { Arc::from(&**vector) } else { vector.clone() };
                    samples.insert(Key::Inserted(key), key as usize % 3, vector);
                }
                for place in samples.places().values() {
                    for class in 0..3 {
                        let others = samples.of(class).iter();
                        let own = others.map(|other| kernel(0.3, &other.vector, &samples.at(*place).vector));
                        assert!(own.eq(samples.row(*place, class).iter().copied()), "{step}");
                    }
                }
            }
        }
        assert!(most <= FEW, "{most} kept, of 41 that anybody holds");
        assert!(held.iter().all(|vector| shared.place(vector).is_some()));
        assert_eq!(shared.place(&Arc::from(&*held[0])), None, "a copy is another");
    }
}
