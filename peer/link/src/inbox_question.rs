//! What arrives of the swarm's questions.

use gestalt_protocol::{MAX_JSON, Question, decode_json};
use gestalt_strategies::Input;
use zenoh::sample::Sample;

use crate::account::Refusal;
use crate::inbox::{Inbox, payload};

impl Inbox {
    /// In a sealed swarm none but its robots ask.
    pub(super) fn on_question(&self, sample: &Sample, expulsions: u64) -> Result<(), Refusal> {
        let question: Question = decode_json(&payload(sample, MAX_JSON)?)?;
        question.check()?;
        self.believe(&question.clone().into())?;
        self.queue(Input::Asked(question), sample, expulsions)
    }
}
