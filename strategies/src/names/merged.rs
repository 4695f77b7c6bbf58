//! What gestures have become that were found to be the same as others.

use std::collections::{BTreeMap, BTreeSet};
use std::iter;

use gestalt_protocol::{ClassId, Fate};

use super::NameBook;

impl NameBook {
    /// The gesture that one is by now: itself, or that which it was found to be the same as; `None` for one that is retired, or that nobody named.
    /// Where gestures are said to be the same in a circle, it is the smallest of them.
    #[must_use]
    pub fn stands_for(&self, gesture: ClassId) -> Option<ClassId> {
        let mut at = gesture;
        for _ in 0..=self.namings.len() {
            let next = self.said_to_be(at)?;
            if next == at {
                return Some(at);
            }
            at = next;
        }
        // More steps than there are gestures: it is a circle.
        let others = iter::successors(self.said_to_be(at), |other| self.said_to_be(*other));
        others.take_while(|other| *other != at).chain([at]).min()
    }

    /// The same of all that were named, in the time that one of them can take: each may be the same as the next.
    pub(crate) fn all_stand_for(&self) -> BTreeMap<ClassId, Option<ClassId>> {
        let mut known: BTreeMap<ClassId, Option<ClassId>> = BTreeMap::new();
        for gesture in self.namings.keys() {
            let (mut passed, mut met) = (Vec::new(), BTreeSet::new());
            let mut at = *gesture;
            let now = loop {
                if let Some(now) = known.get(&at) {
                    break *now;
                }
                if !met.insert(at) {
                    let others = passed.iter().rev().take_while(|other| **other != at);
                    break others.chain([&at]).min().copied();
                }
                match self.said_to_be(at) {
                    Some(next) if next != at => {
                        passed.push(at);
                        at = next;
                    }
                    end => break end,
                }
            };
            known.insert(*gesture, now);
            known.extend(passed.into_iter().map(|gesture| (gesture, now)));
        }
        known
    }

    /// The gestures that were found to be the same as another, each with what it is by now.
    pub(crate) fn merged(&self) -> impl Iterator<Item = (ClassId, ClassId)> {
        let now = self.all_stand_for().into_iter().filter_map(|(gesture, now)| Some((gesture, now?)));
        now.filter(|(gesture, now)| gesture != now)
    }

    /// What the latest word on a gesture makes of it, if anything.
    fn said_to_be(&self, gesture: ClassId) -> Option<ClassId> {
        if !gesture.is_named() {
            return Some(gesture);
        }
        match self.get(gesture)?.fate {
            Fate::InUse => Some(gesture),
            Fate::Retired => None,
            Fate::Same(other) => Some(other),
        }
    }
}
