//! Whom a robot of a Gestalt swarm believes.
//!
//! An authority writes a [`Roster`]: which robots belong to the swarm, and the public key of each. A robot has an [`Identity`] and
//! [signs](statement::sign) what it says; whoever hears it, from the author or through others, asks a [`Verifier`] whether to
//! believe it. A [`Witness`] notices who says two things under one stamp, a [`Judge`] who gives a decision that does not follow from the votes it brings,
//! and the [`Evidence`] convicts the liar everywhere.
//!
//! ```text
//! Envelope ─encode─► statement ─sign─► statement, Signature ~~ any relays ~~► Verifier::check ─► Ok: the author's own words
//!                                                                                  ▲    └─► Distrust: why not, for a counter
//!                                         Roster, signed by the authority ─────────┘
//!                                                       believed ─► Witness::observe ─► Evidence ─► Verifier::convict
//! ```
//!
//! Pure: no clock, no entropy, no network. Time is an argument, and so is the generator that keys are drawn from; files are touched
//! by the functions that are given a path alone. What is believed is true to its author, not to the world: robots that are enrolled
//! may still lie, and fusion has to withstand them.
//!
//! Signatures are [`Ed25519`] by its strict rule, checked one by one, so that any two robots agree on every signature.
//!
//! ```
//! use std::time::Duration;
//!
//! use gestalt_protocol::{Envelope, Message, RobotId, RoundId, Stamp, VocabularyId, Vote};
//! use gestalt_trust::{Budget, Distrust, Identity, Membership, Verifier, statement};
//! use rand::SeedableRng;
//!
//! // Three robots and who enrols them. A real robot draws its key from the entropy of its system, not from a seed.
//! let mut rng = rand_chacha::ChaCha20Rng::seed_from_u64(1);
//! let authority = Identity::generate(&mut rng);
//! let robots: Vec<Identity> = (0..3).map(|_| Identity::generate(&mut rng)).collect();
//! let members = Membership {
//!     swarm: "demo".to_owned(),
//!     epoch: 1,
//!     robots: (0..3).map(RobotId).zip(robots.iter().map(Identity::public_key)).collect(),
//!     ..Membership::default()
//! };
//! let roster = members.sign(&authority)?;
//!
//! // Robot 0 signs a vote.
//! let round = RoundId { counter: 1, opener: RobotId(0), life: 0xA1 };
//! let vote = Vote { round, vocabulary: VocabularyId(9), evidence: vec![2.0, -1.0, -1.0], looks: 3.0, unknown: None, named: Vec::new() };
//! let stamp = Stamp { boot: 1, sequence: 1 };
//! let said = Envelope { author: RobotId(0), stamp, message: Message::Vote(vote), signature: None }.encode();
//! let signature = statement::sign(&robots[0], &roster.swarm_id(), &said);
//!
//! // Robot 1 believes it and passes it on; robot 2 need not trust robot 1.
//! let now = Duration::from_secs(5);
//! for _ in 1..=2 {
//!     let mut verifier = Verifier::new(roster.clone(), Budget::default());
//!     verifier.check(now, &said, Some(&signature))?;
//! }
//!
//! // Robot 1 cannot vote in robot 0's name.
//! let forged = statement::sign(&robots[1], &roster.swarm_id(), &said);
//! let mut verifier = Verifier::new(roster, Budget::default());
//! assert_eq!(verifier.check(now, &said, Some(&forged)), Err(Distrust::Forged));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod answer;
mod budget;
mod channel;
mod distrust;
mod docket;
mod document;
mod evidence;
mod evidence_file;
#[cfg(any(test, feature = "fake"))]
mod fake;
pub mod frame;
mod identity;
mod judge;
mod key_file;
mod membership;
#[cfg(any(test, feature = "memoised"))]
mod memoised;
mod public_key;
mod request;
mod roles;
mod roster;
mod roster_error;
mod roster_file;
mod scheme;
mod signed;
pub mod statement;
#[cfg(test)]
mod testing;
mod verify;
mod witness;
pub mod word;

pub use answer::{ANSWER_DOMAIN, Answers};
pub use budget::Budget;
pub use channel::{CHANNEL_DOMAIN, Channels, Tag};
pub use distrust::Distrust;
pub use evidence::{Conviction, Evidence, EvidenceError, Lie, Refutes};
pub use evidence_file::KeptEvidence;
#[cfg(feature = "fake")]
pub use fake::Fake;
pub use frame::{CHALLENGE_DOMAIN, FRAME_DOMAIN, FrameClaim, FrameGuard, FrameSigner};
pub use identity::Identity;
pub use judge::Judge;
pub use key_file::KeyFileError;
pub use membership::{Instructor, MAX_INSTRUCTORS, Membership, ROSTER_DOMAIN};
#[cfg(feature = "memoised")]
pub use memoised::Memoised;
pub use public_key::PublicKey;
pub use request::{Applicant, REQUEST_DOMAIN, Request, RequestError};
pub use roles::{Role, RoleError, Roles};
pub use roster::{MAX_ROSTER, Roster};
pub use roster_error::{Member, RosterError};
pub use scheme::{Ed25519, Scheme};
pub use signed::MAX_EVIDENT;
pub use statement::{Heading, STATEMENT_DOMAIN, SwarmId};
pub use verify::Verifier;
pub use witness::Witness;
pub use word::{Attention, Speaker, WORD_DOMAIN, WordHeading};
