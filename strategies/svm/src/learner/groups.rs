//! A learner for each of several groups of authors, whose majority is certified.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::ClassId;
use gestalt_rounds::{Classify, Vocabulary};

use super::samples::Key;
use super::{LearnError, Learner, LearnerOptions};
use crate::classifier::Classifier;
use crate::feature_space::FeatureSpace;

impl Learner {
    /// As many as there are to be groups.
    pub(super) fn members(
        space: &Arc<FeatureSpace>,
        vocabulary: &Vocabulary,
        options: &LearnerOptions,
    ) -> Result<Vec<Self>, LearnError> {
        let alone = LearnerOptions { groups: 0, ..options.clone() };
        (0..options.groups).map(|_| Self::new(space.clone(), vocabulary.clone(), alone.clone())).collect()
    }

    /// Takes in a sample of an author of that group, counted from 0: as [`insert_held`](Self::insert_held), which gives a sample to all groups. Where there are
    /// none, one learns from all.
    ///
    /// # Errors
    /// As of [`Self::insert`].
    pub fn insert_of(
        &mut self,
        group: Option<usize>,
        key: u64,
        class: ClassId,
        vector: Arc<[f32]>,
        showing: u64,
    ) -> Result<(), LearnError> {
        if self.members.is_empty() {
            return self.insert_held(key, class, vector, showing);
        }
        self.insert_by_members(group, key, class, &vector, showing)
    }

    pub(super) fn insert_by_members(
        &mut self,
        group: Option<usize>,
        key: u64,
        class: ClassId,
        vector: &Arc<[f32]>,
        showing: u64,
    ) -> Result<(), LearnError> {
        let groups = self.members.len();
        for (of, member) in self.members.iter_mut().enumerate() {
            if group.is_none_or(|group| group % groups == of) {
                member.insert_held(key, class, vector.clone(), showing)?;
            } else {
                member.remove(key);
            }
        }
        Ok(())
    }

    pub(super) fn remove_by_members(&mut self, key: u64) -> bool {
        let mut was_there = false;
        for member in &mut self.members {
            was_there |= member.remove(key);
        }
        was_there
    }

    pub(super) fn relabel_by_members(&mut self, key: u64, class: ClassId) -> Result<bool, LearnError> {
        let mut was_there = false;
        for member in self.members.iter_mut().filter(|member| member.holds(key)) {
            was_there |= member.relabel(key, class)?;
        }
        Ok(was_there)
    }

    fn holds(&self, key: u64) -> bool {
        self.samples.place(Key::Inserted(key)).is_some()
    }

    pub(super) fn keys_of_members(&self) -> BTreeSet<u64> {
        let keys = self.members.iter().flat_map(|member| member.samples.places().keys());
        keys.filter_map(|key| if let Key::Inserted(key) = key { Some(*key) } else { None }).collect()
    }

    pub(super) fn learn_by_members(&mut self) -> Result<Arc<Classifier>, LearnError> {
        let members: Vec<Arc<Classifier>> =
            self.members.iter_mut().map(Self::learn).collect::<Result<_, _>>()?;
        // Their numbers, not who met one first, say in which order gestures stand that were named.
        let named: BTreeSet<ClassId> =
            members.iter().flat_map(|member| member.vocabulary().named().iter().copied()).collect();
        let mut vocabulary = self.vocabulary.clone();
        for class in named {
            vocabulary.meet(class);
        }
        let first = members[0].clone();
        let classifier = Classifier::of_panel(vocabulary, &first, members);
        Ok(self.classifier.insert(Arc::new(classifier)).clone())
    }
}
