//! What a recorder received, what it wrote, and what it lost.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::kind::Kind;

/// Messages by kind.
pub type Tally = BTreeMap<Kind, u64>;

/// The account of a recording. Everything received is written, dropped, lost, or still on its way.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ledger {
    /// What arrived.
    pub received: Tally,
    /// What is in the file.
    pub written: Tally,
    /// What found the queue full: the disk was slower than the swarm.
    pub dropped: Tally,
    /// What could not be written any more: the disk is full, or gone.
    pub lost: Tally,
    /// How long the file is, in bytes.
    pub bytes: u64,
    /// For how many milliseconds nothing could be heard, for the recorder was attached to no robot.
    pub unattached_ms: u64,
}

impl Ledger {
    /// Adds one to a tally.
    pub(crate) fn count(tally: &mut Tally, kind: Kind) {
        *tally.entry(kind).or_default() += 1;
    }

    /// Moves what was under way to `tally`.
    pub(crate) fn settle(tally: &mut Tally, under_way: &mut Tally) {
        for (kind, count) in std::mem::take(under_way) {
            *tally.entry(kind).or_default() += count;
        }
    }

    /// How many messages a tally comes to.
    #[must_use]
    pub fn total(tally: &Tally) -> u64 {
        tally.values().sum()
    }

    /// Whether all that arrived is in the file, and nothing could have arrived unheard.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        Self::total(&self.dropped) + Self::total(&self.lost) + self.unattached_ms == 0
    }

    /// What is missing, in words; `None` when nothing is.
    #[must_use]
    pub fn missing(&self) -> Option<String> {
        let named = |tally: &Tally| {
            let each: Vec<String> =
                tally.iter().map(|(kind, count)| format!("{count} {}", kind.name())).collect();
            format!("{} ({})", Self::total(tally), each.join(", "))
        };
        let mut parts = Vec::new();
        if Self::total(&self.dropped) > 0 {
            parts.push(format!("{} dropped, for the disk was too slow", named(&self.dropped)));
        }
        if Self::total(&self.lost) > 0 {
            parts.push(format!("{} lost, for the disk took no more", named(&self.lost)));
        }
        if self.unattached_ms > 0 {
            parts.push(format!("attached to no robot for {} ms", self.unattached_ms));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// As metadata of a recording: one text for each number.
    #[must_use]
    pub fn metadata(&self) -> BTreeMap<String, String> {
        let mut texts = BTreeMap::from([
            ("bytes".to_owned(), self.bytes.to_string()),
            ("unattached_ms".to_owned(), self.unattached_ms.to_string()),
        ]);
        let tallies = [
            ("received", &self.received),
            ("written", &self.written),
            ("dropped", &self.dropped),
            ("lost", &self.lost),
        ];
        for (what, tally) in tallies {
            texts.insert(what.to_owned(), Self::total(tally).to_string());
            texts.extend(
                tally.iter().map(|(kind, count)| (format!("{what}.{}", kind.name()), count.to_string())),
            );
        }
        texts
    }
}
