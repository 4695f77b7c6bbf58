//! What is signed, and when.

use std::sync::Mutex;

use gestalt_protocol::Signature;

use super::*;
use crate::sign::Sign;

/// What was signed and what was said to be done, in order.
pub(super) type Course = Arc<Mutex<Vec<String>>>;

/// Writes down which kind of message it signs.
#[derive(Debug)]
pub(super) struct Scribe(pub(super) Course);

impl Sign for Scribe {
    fn sign(&self, statement: &[u8]) -> Signature {
        let said = match Envelope::decode(statement).unwrap().message {
            Message::Vote(_) => "signs its vote",
            Message::Holding(_) => "signs what it holds",
            _ => "signs something else",
        };
        self.0.lock().unwrap().push(said.to_owned());
        Signature::from_bytes([7; 64])
    }
}

#[test]
fn a_decision_is_held_before_anything_about_it_is_signed_or_anybody_told() {
    let course = Course::default();
    let mut mind = blind(7).signed_by(Arc::new(Scribe(course.clone())));
    let mut note = |output: Output| {
        let done = match output {
            Output::Broadcast(Envelope { message: Message::Vote(_), .. }) => "votes",
            Output::Broadcast(Envelope { message: Message::Holding(_), .. }) => "says what it holds",
            Output::Hold(_) => "holds",
            _ => return,
        };
        course.lock().unwrap().push(done.to_owned());
    };
    mind.handle_into(ms(0), votes(1, 1, vote(1, 2, SURE)), &mut (), &mut note);
    let expected = ["signs its vote", "holds", "votes", "signs what it holds", "says what it holds"];
    assert_eq!(*course.lock().unwrap(), expected);
    // Whoever asks is answered under a stamp of its own, which is signed when somebody does.
    let before = course.lock().unwrap().len();
    let [first, second] = [0, 1].map(|_| mind.held_aloud().unwrap());
    assert!(first.stamp < second.stamp && first.signature.is_none());
    assert_eq!(course.lock().unwrap().len(), before);
}
