//! Who is whose nearest neighbour, kept up to date.

use std::ops::ControlFlow;

use super::points::Points;

/// For each *seeker* the nearest of the *neighbours*, itself excepted.
///
/// A seeker or neighbour that comes costs one pass over the other side. A neighbour that goes leaves those it was
/// nearest to with a lower bound of their distance, which is looked into when it matters: on average over the
/// neighbours that is one pass as well, since each seeker has one nearest of them.
///
/// Ask for the [`farthest`](Self::farthest) or for the [`closest`](Self::closest), not for both: the first does not
/// look which of equally near neighbours has the smallest key.
#[derive(Clone, Debug)]
pub struct Neighbours {
    seekers: Points,
    /// By place of the seeker.
    nearest: Vec<Nearest>,
    /// `None`: the seekers are each other's.
    neighbours: Option<Points>,
}

#[derive(Clone, Copy, Debug)]
struct Nearest {
    /// Squared; infinite when there is no neighbour.
    distance: f32,
    /// `None`: there is none, or the one there was has gone and `distance` is a lower bound.
    key: Option<u64>,
    stale: bool,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { distance: f32::INFINITY, key: None, stale: false }
    }
}

impl Nearest {
    /// There is a neighbour at that distance.
    fn meet(&mut self, key: u64, distance: f32) {
        // At the lower bound of a stale entry another one with a smaller key may lie.
        let closer = distance < self.distance
            || !self.stale && distance == self.distance && self.key.is_none_or(|held| key < held);
        if closer {
            *self = Self { distance, key: Some(key), stale: false };
        }
    }
}

/// A seeker and its nearest neighbour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestPair {
    /// The key of the seeker.
    pub seeker: u64,
    /// The key of its nearest neighbour; `None` when there is none.
    pub neighbour: Option<u64>,
}

impl Default for Neighbours {
    /// Seekers and neighbours apart.
    fn default() -> Self {
        Self { seekers: Points::default(), nearest: Vec::new(), neighbours: Some(Points::default()) }
    }
}

impl Neighbours {
    /// Points that each seek the nearest of the others: [`add`](Self::add) and [`remove`](Self::remove) are for these, and cost half of
    /// what a seeker and a neighbour do.
    #[must_use]
    pub fn of_each_other() -> Self {
        Self { neighbours: None, ..Self::default() }
    }

    /// Takes in a point that is both.
    ///
    /// # Panics
    /// If seekers and neighbours are apart.
    pub fn add(&mut self, key: u64, vector: &[f32]) {
        assert!(self.neighbours.is_none(), "seekers and neighbours are apart");
        let mut own = Nearest::default();
        let keys = self.seekers.keys();
        self.seekers.measure(vector, |place, distance| {
            if keys[place] != key {
                self.nearest[place].meet(key, distance);
                own.meet(keys[place], distance);
            }
        });
        self.seekers.push(key, vector);
        self.nearest.push(own);
    }

    /// Takes out a point that is both.
    pub fn remove(&mut self, key: u64) {
        self.remove_seeker(key);
        self.lose(key);
    }

    /// Takes a seeker in.
    pub fn add_seeker(&mut self, key: u64, vector: &[f32]) {
        self.seekers.push(key, vector);
        let nearest = self.nearest_to(key, vector, |_| false);
        self.nearest.push(nearest);
    }

    /// Takes a seeker out.
    pub fn remove_seeker(&mut self, key: u64) {
        if let Some(place) = self.seekers.place(key) {
            self.seekers.swap_remove(place);
            self.nearest.swap_remove(place);
        }
    }

    /// Takes a neighbour in.
    pub fn add_neighbour(&mut self, key: u64, vector: &[f32]) {
        if let Some(neighbours) = &mut self.neighbours {
            neighbours.push(key, vector);
        }
        let seekers = self.seekers.keys();
        self.seekers.measure(vector, |place, distance| {
            if seekers[place] != key {
                self.nearest[place].meet(key, distance);
            }
        });
    }

    /// Takes a neighbour out.
    pub fn remove_neighbour(&mut self, key: u64) {
        let Some(neighbours) = &mut self.neighbours else { return };
        if let Some(place) = neighbours.place(key) {
            neighbours.swap_remove(place);
            self.lose(key);
        }
    }

    fn lose(&mut self, key: u64) {
        for nearest in self.nearest.iter_mut().filter(|nearest| nearest.key == Some(key)) {
            (nearest.key, nearest.stale) = (None, true);
        }
    }

    fn neighbours(&self) -> &Points {
        self.neighbours.as_ref().unwrap_or(&self.seekers)
    }

    /// The seekers.
    #[must_use]
    pub fn seekers(&self) -> &Points {
        &self.seekers
    }

    /// Whether there is neither a seeker nor a neighbour.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.seekers.keys().is_empty() && !self.has_neighbours()
    }

    /// Whether there is a neighbour at all.
    #[must_use]
    pub fn has_neighbours(&self) -> bool {
        !self.neighbours().keys().is_empty()
    }

    /// The seeker whose nearest neighbour is farthest; of equals the smaller key.
    pub fn farthest(&mut self) -> Option<NearestPair> {
        for place in 0..self.nearest.len() {
            // Only the distance matters, and there is none below the lower bound: where many are equally near, as
            // copies of one sample are, the search ends at the first of them.
            self.refresh(place, |distance, bound| distance <= bound);
        }
        let place = self.first_by(|a, b| a > b)?;
        Some(self.pair(place))
    }

    /// The seeker whose nearest neighbour is closest, and that neighbour; of equals the smaller keys.
    pub fn closest(&mut self) -> Option<NearestPair> {
        loop {
            // Only a lower bound that nothing undercuts has to be looked into.
            let place = self.first_by(|a, b| a < b)?;
            if !self.refresh(place, |_, _| false) {
                return Some(self.pair(place));
            }
        }
    }

    /// The place of the seeker whose distance goes before all others, ties to the smaller key.
    fn first_by(&self, before: impl Fn(f32, f32) -> bool) -> Option<usize> {
        let keys = self.seekers.keys();
        (0..keys.len()).reduce(|best, place| {
            let (a, b) = (self.nearest[place].distance, self.nearest[best].distance);
            if before(a, b) || !before(b, a) && keys[place] < keys[best] { place } else { best }
        })
    }

    fn pair(&self, place: usize) -> NearestPair {
        NearestPair { seeker: self.seekers.keys()[place], neighbour: self.nearest[place].key }
    }

    /// Looks for the nearest neighbour again if it has gone, until one is near `enough` for the lower bound of the
    /// distance; says whether it had gone.
    fn refresh(&mut self, place: usize, enough: impl Fn(f32, f32) -> bool) -> bool {
        let Nearest { distance: bound, stale, .. } = self.nearest[place];
        if stale {
            let (key, point) = (self.seekers.keys()[place], self.seekers.point(place));
            self.nearest[place] = self.nearest_to(key, &point, |distance| enough(distance, bound));
        }
        stale
    }

    fn nearest_to(&self, seeker: u64, vector: &[f32], enough: impl Fn(f32) -> bool) -> Nearest {
        let neighbours = self.neighbours();
        let keys = neighbours.keys();
        let mut nearest = Nearest::default();
        neighbours.measure_until(vector, |place, distance| {
            let key = keys[place];
            let closer = distance < nearest.distance
                || distance == nearest.distance && nearest.key.is_none_or(|held| key < held);
            if !closer || key == seeker {
                return ControlFlow::Continue(());
            }
            nearest = Nearest { distance, key: Some(key), stale: false };
            if enough(distance) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        nearest
    }
}
