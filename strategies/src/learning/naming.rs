//! What becomes of samples by what instructors name, merge, retire and restore.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use gestalt_protocol::{ClassId, MAX_CLASSES, NamedGesture, Naming};

use super::changes::{TrainingChange, inserted_as};
use super::memory::Item;
use super::state::Learning;
use super::unresolved;
use crate::believe::Standing;
use crate::candidates::Candidates;
use crate::names::{NameBook, NamingReceipt};
use crate::sample::HeldSample;

/// What samples of each class that is held are trained on as; `None`: on none.
type TrainedAs = BTreeMap<ClassId, Option<ClassId>>;

impl Learning {
    pub fn names(&self) -> &NameBook {
        &self.names
    }

    /// How many gestures there may be beside those of the list.
    pub fn room_for_names(&self) -> usize {
        MAX_CLASSES.saturating_sub(self.vocabulary.labels().len())
    }

    /// Takes in what was said of a gesture that was named, and trains by it.
    pub fn hear_naming(&mut self, naming: &Naming) -> NamingReceipt {
        let mut heard = NamingReceipt::Known;
        self.hear_namings([naming], |_, receipt| {
            heard = receipt;
            ControlFlow::Continue(())
        });
        heard
    }

    /// Takes in many words, until it is told by what came of one to take in no more, and trains by them: once for all, because what one of them makes of
    /// all samples takes as long.
    pub fn hear_namings<'a>(
        &mut self,
        namings: impl IntoIterator<Item = &'a Naming>,
        mut came_of: impl FnMut(&'a Naming, NamingReceipt) -> ControlFlow<()>,
    ) {
        let mut before = None;
        for naming in namings {
            let (heard, standing) = self.would_hear_naming(naming);
            if heard == NamingReceipt::New {
                before.get_or_insert_with(|| self.all_trained_as());
                let gone = self.names.take_in(naming, standing);
                self.dirty.extend(gone.into_iter().chain([naming.gesture()]).map(Item::Naming));
            }
            if came_of(naming, heard).is_break() {
                break;
            }
        }
        if let Some(before) = before {
            self.follow_names(before);
        }
    }

    /// What would come of a word, and by which right it is said. Of one that is not new there may still be the first to keep.
    fn would_hear_naming(&mut self, naming: &Naming) -> (NamingReceipt, Option<Standing>) {
        // Neighbours say all they know: mostly there is nothing to be done.
        let lacks_first = self.names.lacks_first(naming);
        if self.names.is_known(naming) && !lacks_first {
            return (NamingReceipt::Known, None);
        }
        let standing = self.standing_of_naming(naming);
        if standing == Some(Standing::Unproven) {
            return (NamingReceipt::Unproven, standing);
        }
        if lacks_first {
            self.names.keep_first(naming);
            self.dirty.insert(Item::Naming(naming.gesture()));
        }
        (self.names.would_hear(naming, standing), standing)
    }

    /// Changes what is known of names, and trains by it.
    pub(super) fn rename(&mut self, change: impl FnOnce(&mut NameBook)) {
        let before = self.all_trained_as();
        change(&mut self.names);
        self.follow_names(before);
    }

    /// Trains by what is known of names now, where samples were trained on as that `before`.
    fn follow_names(&mut self, before: TrainedAs) {
        self.gestures = self.all_gestures();
        self.judged.doubt();
        self.doubt_samples();
        let now = self.all_trained_as();
        let changed = now.iter().filter(|(class, now)| before.get(class) != Some(now));
        let changed: BTreeSet<ClassId> = changed.map(|(class, _)| *class).collect();
        self.train_anew(&changed);
        let rounds: Vec<_> = self.lessons.all_rounds().collect();
        rounds.into_iter().for_each(|round| self.apply_to_round(round));
    }

    /// What samples of each class are trained on as.
    fn all_trained_as(&self) -> TrainedAs {
        let now = self.names.all_stand_for();
        let stands_for = |class| now.get(&class).copied().flatten();
        let classes: BTreeSet<ClassId> = self.classes_of_samples().collect();
        classes.into_iter().map(|class| (class, self.trained_by(class, stands_for))).collect()
    }

    /// Puts a word into the memory that the rules would not let in.
    #[cfg(test)]
    pub fn remember_naming(&mut self, naming: &Naming) {
        self.names.hear_again(naming);
        self.dirty.insert(Item::Naming(naming.gesture()));
    }

    /// The gesture that a sample of that class is trained on as; `None` where it is on none: nobody named it that this robot heard, or it is retired.
    pub(super) fn trained_as(&self, class: ClassId) -> Option<ClassId> {
        self.trained_by(class, |class| self.names.stands_for(class))
    }

    /// The same, by what a gesture that was named stands for.
    fn trained_by(
        &self,
        class: ClassId,
        stands_for: impl FnOnce(ClassId) -> Option<ClassId>,
    ) -> Option<ClassId> {
        if class.is_named() {
            stands_for(class).filter(|class| self.gestures.contains(*class))
        } else {
            Some(class)
        }
    }

    /// Those of the list, and those that were named and are in use; what is the same as another counts as that.
    pub(super) fn all_gestures(&self) -> Candidates {
        let listed = self.vocabulary.all();
        let in_use = listed.chain(self.names.in_use(self.room_for_names()));
        Candidates::of(in_use).with_merged(self.names.merged())
    }

    fn classes_of_samples(&self) -> impl Iterator<Item = ClassId> + '_ {
        let guessed = self.aside.iter().filter_map(|(_, aside)| aside.guess);
        self.set.iter().map(|sample| sample.class).chain(guessed)
    }

    /// What makes a new learner train on all that is held.
    pub fn training_anew(&self) -> Vec<TrainingChange> {
        let changes = self.changes_for(|_| true).into_iter().map(|(_, change)| change);
        changes.filter(|change| matches!(change, TrainingChange::Insert { .. })).collect()
    }

    /// Trains on a sample of the set.
    pub(super) fn train_on(&mut self, key: u64) {
        if let Some(sample) = self.set.get(key) {
            let change = self.change_for(sample);
            self.training.push(change);
        }
    }

    /// What makes a learner train on a sample of the set as what it now is, or no longer.
    fn change_for(&self, sample: &HeldSample) -> TrainingChange {
        let class = self.trained_as(sample.class).filter(|_| self.trusts(sample.key));
        let group = self.groups().and_then(|groups| groups.of(sample));
        inserted_as(class, sample.key, &sample.vector, sample.round, group)
    }

    /// Trains on a sample of the set as what it now shows, where it showed that before.
    pub(super) fn train_as_another(&mut self, key: u64, before: ClassId) {
        match self.set.get(key).map(|sample| sample.class) {
            // What is of the list is trained on; of what was named nobody may have heard the name.
            Some(class) if !class.is_named() && !before.is_named() && self.scrutiny.is_none() => {
                self.training.push(TrainingChange::Relabel { key, class })
            }
            _ => self.train_on(key),
        }
    }

    /// The gestures that were named and are in use, for the status.
    pub(super) fn named_gestures(&self) -> Vec<NamedGesture> {
        let titles = self.names.titles(self.vocabulary.labels());
        let mut samples: BTreeMap<ClassId, usize> = BTreeMap::new();
        for class in self.classes_of_samples().filter(|class| class.is_named()) {
            if let Some(gesture) = self.trained_as(class) {
                *samples.entry(gesture).or_default() += 1;
            }
        }
        let in_use = self.names.in_use(self.room_for_names());
        let in_use = in_use.into_iter().map(|class| NamedGesture {
            class,
            label: titles.get(&class).cloned().unwrap_or_default(),
            samples: samples.get(&class).copied().unwrap_or(0),
        });
        in_use.collect()
    }

    /// Trains on all samples of these classes as what they now are, class by class: first what goes, for where there are as many gestures as can be told apart, a new
    /// one takes the place of one that has no samples any more.
    fn train_anew(&mut self, classes: &BTreeSet<ClassId>) {
        let mut changes = self.changes_for(|of| classes.contains(&of));
        changes.sort_by_key(|(class, change)| (!matches!(change, TrainingChange::Remove(_)), *class));
        self.training.extend(changes.into_iter().map(|(_, change)| change));
    }

    /// What makes a learner train on all samples of these classes as what they now are, each with its class.
    fn changes_for(&self, is_wanted: impl Fn(ClassId) -> bool) -> Vec<(ClassId, TrainingChange)> {
        let held = self.set.iter().filter(|sample| is_wanted(sample.class));
        let guessed = self.aside.iter().filter_map(|(number, aside)| {
            let guess = aside.guess.filter(|class| is_wanted(*class))?;
            let (class, key) = (self.trained_as(guess), unresolved::training_key(number));
            Some((guess, inserted_as(class, key, &aside.vector, aside.round, None)))
        });
        held.map(|sample| (sample.class, self.change_for(sample))).chain(guessed).collect()
    }
}
