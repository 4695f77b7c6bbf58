//! All attacks, by what they aim at.
//!
//! | file | aims at |
//! |---|---|
//! | `decisions` | what the swarm settles on |
//! | `unfounded` | what is claimed of votes, and who is accused of that |
//! | `votes` | what is counted |
//! | `equivocation` | saying two things at once |
//! | `floods` | saying too much |
//! | `rounds` | when a round begins and ends, and who is waited for |
//! | `lessons` | what instructors said |
//! | `words` | what instructors signed, passed on |
//! | `instructors` | who is an instructor |
//! | `samples` | what robots learn from |
//! | `relays` | what passes on samples and lessons |
//! | `replay` | what was true once |
//! | `rosters` | who is a member |
//! | `proofs` | what a client is shown |

mod decisions;
mod equivocation;
mod floods;
mod instructors;
mod lessons;
mod proofs;
mod relays;
mod replay;
mod rosters;
mod rounds;
mod samples;
mod unfounded;
mod votes;
mod words;

use crate::attack::Attack;

/// Every attack, in the order of the table.
#[must_use]
pub fn all() -> Vec<Attack> {
    let parts = [
        decisions::ALL,
        unfounded::ALL,
        votes::ALL,
        equivocation::ALL,
        floods::ALL,
        rounds::ALL,
        lessons::ALL,
        words::ALL,
        instructors::ALL,
        samples::ALL,
        relays::ALL,
        replay::ALL,
        rosters::ALL,
        proofs::ALL,
    ];
    parts.concat()
}

/// What an open swarm cannot withstand.
const WHOEVER_SAYS_SO: &str = "in an open swarm a robot is whoever says so: seal it";
