//! Which samples of others are trained on, and what follows when that changes.

use std::collections::BTreeMap;

use gestalt_protocol::{Heeded, RobotId};

use super::state::Learning;
use crate::sample::{HeldSample, SetPart};
use crate::scrutiny::{Claim, JUDGED, Scrutiny};

impl Learning {
    /// Whether a sample is trained on, if anything is of its class.
    pub(super) fn trusts(&self, key: u64) -> bool {
        self.scrutiny.as_ref().is_none_or(|scrutiny| !scrutiny.leaves_out(key))
    }

    /// Judges a sample that has just come, or shows another gesture now.
    pub(super) fn judge(&mut self, key: u64) {
        self.scrutinise(|scrutiny, held| scrutiny.judge(held, key));
    }

    /// What was said concerns more samples than those that came with it.
    pub(super) fn doubt_samples(&mut self) {
        if let Some(scrutiny) = &mut self.scrutiny {
            scrutiny.doubt();
        }
    }

    /// Judges all anew, if that is due.
    pub(super) fn reckon_samples(&mut self) {
        if self.scrutiny.as_ref().is_some_and(Scrutiny::is_due) {
            let changed = self.scrutinise(Scrutiny::reckon).unwrap_or_default();
            changed.into_iter().for_each(|key| self.train_on(key));
        }
    }

    /// Judges all that is held, of which nothing is remembered: as when they came, each among those that were the newest about then.
    pub(super) fn judge_from_the_start(&mut self) {
        let mut newer = self.set.len().saturating_sub(JUDGED);
        while newer > 0 {
            self.scrutinise_before(newer, Scrutiny::reckon);
            newer = newer.saturating_sub(JUDGED);
        }
        self.scrutinise(Scrutiny::reckon);
    }

    fn scrutinise<T>(&mut self, judge: impl FnOnce(&mut Scrutiny, &[Claim<'_>]) -> T) -> Option<T> {
        self.scrutinise_before(0, judge)
    }

    /// Judges as if so many of the newest samples had not come yet.
    fn scrutinise_before<T>(
        &mut self,
        newer: usize,
        judge: impl FnOnce(&mut Scrutiny, &[Claim<'_>]) -> T,
    ) -> Option<T> {
        let mut scrutiny = self.scrutiny.take()?;
        let newest = self.set.iter().rev().skip(newer).take(JUDGED);
        let held: Vec<Claim<'_>> = newest.filter_map(|sample| self.claim(sample)).collect();
        let judged = judge(&mut scrutiny, &held);
        self.scrutiny = Some(scrutiny);
        Some(judged)
    }

    /// Nothing of a sample that nobody trains on.
    fn claim<'a>(&self, sample: &'a HeldSample) -> Option<Claim<'a>> {
        let author = sample.author().unwrap_or(self.me);
        Some(Claim {
            key: sample.key,
            author,
            is_of_others: sample.part == SetPart::External && author != self.me,
            class: self.trained_as(sample.class)?,
            vector: &sample.vector,
        })
    }

    /// Of each other robot: how many of its samples are held, and how many of these are trained on.
    pub fn heeded(&self) -> Vec<Heeded> {
        let mut heeded: BTreeMap<RobotId, Heeded> = BTreeMap::new();
        for sample in self.set.iter().filter(|sample| sample.part == SetPart::External) {
            let Some(robot) = sample.author() else { continue };
            let of = heeded.entry(robot).or_insert(Heeded { robot, held: 0, trained: 0 });
            of.held += 1;
            of.trained += usize::from(self.trusts(sample.key));
        }
        heeded.into_values().collect()
    }

    /// Whose samples are not all trained on.
    pub(super) fn doubted(&self) -> Vec<Heeded> {
        if self.scrutiny.is_none() {
            return Vec::new();
        }
        self.heeded().into_iter().filter(|of| of.trained < of.held).collect()
    }
}
