//! The sealed swarm that inputs are said in, with signatures that cost next to nothing: the fuzzer gets behind them.

use std::sync::OnceLock;

use gestalt_protocol::{
    Announcement, Decision, Envelope, HeldVote, Holder, InstructorId, Lesson, Question, RobotId, Signature,
    SignedWord,
};
use gestalt_strategies::{Believe, Standing};
use gestalt_trust::{
    Fake, Identity, Instructor, Membership, Role, Roles, Roster, Speaker, SwarmId, WordHeading, statement,
    word,
};

/// Robots 1 to so many are on the roster.
pub const MEMBERS: u32 = 5;

/// One that was expelled.
pub const EXPELLED: RobotId = RobotId(6);

/// Who enrols the robots.
pub fn authority() -> Identity<Fake> {
    Identity::fake(0)
}

/// The identity of a robot, on the roster or not.
pub fn identity(robot: RobotId) -> Identity<Fake> {
    Identity::fake(u64::from(robot.0) + 1)
}

fn ada() -> Identity<Fake> {
    Identity::fake(1 << 40)
}

/// The swarm `demo`.
pub fn members() -> Membership {
    let key = |number| (RobotId(number), identity(RobotId(number)).public_key());
    let ada = ada().public_key();
    Membership {
        swarm: "demo".to_owned(),
        epoch: 3,
        robots: (1..=MEMBERS).map(key).collect(),
        instructors: [(
            "ada".parse().expect("a name"),
            Instructor { key: ada, roles: Roles::up_to(Role::Teach) },
        )]
        .into(),
        local: Roles::up_to(Role::Open),
        expelled: [key(EXPELLED.0)].into(),
    }
}

/// Those, enrolled.
pub fn roster() -> &'static Roster<Fake> {
    static ROSTER: OnceLock<Roster<Fake>> = OnceLock::new();
    ROSTER.get_or_init(|| members().sign(&authority()).expect("members that go together"))
}

/// What that robot's key makes of a statement, said in the swarm.
pub fn sign(robot: RobotId, said: &[u8]) -> Signature {
    sign_in(&roster().swarm_id(), robot, said)
}

fn sign_in(swarm: &SwarmId, robot: RobotId, said: &[u8]) -> Signature {
    statement::sign(&identity(robot), swarm, said)
}

/// Signs the word that a lesson is said to be made of, as ada, whoever it names.
pub fn seal_lesson(lesson: &mut Lesson) {
    let (by, count) = (lesson.instructor.clone(), lesson.count);
    let Some(said) = &mut lesson.said else { return };
    let heading = WordHeading { speaker: Speaker::Own(by.clone()), count };
    said.attachment = word::sign(&ada(), &roster().swarm_id(), &by, &heading, &said.word);
    lesson.at = count;
}

/// Believes words of ada's, and of no other.
#[derive(Debug)]
pub struct Members;

impl Believe for Members {
    fn believe(&self, by: &InstructorId, said: &SignedWord) -> Option<(u64, Standing)> {
        let (heading, roles) = roster().check_word(by, &said.word, Some(&said.attachment)).ok()?;
        roles.has(Role::Teach).then_some((heading.count, Standing::Teaches))
    }
}

/// Puts the author's own signature under a message.
pub fn seal(envelope: &mut Envelope) {
    envelope.signature = Some(sign(envelope.author, &envelope.statement()));
}

/// The same of a vote that somebody passes on.
pub fn seal_vote(held: &mut HeldVote) {
    held.signature = Some(sign(held.robot, &Envelope::from(held.clone()).statement()));
}

/// The same of what a robot holds.
pub fn seal_holder(holder: &mut Holder) {
    holder.signature = Some(sign(holder.robot, &Envelope::from(holder.clone()).statement()));
}

/// The same of an announcement, when its votes are as they are to be.
pub fn seal_announcement(announcement: &mut Announcement) {
    let said = Envelope::from(announcement.clone());
    announcement.signature = Some(sign(announcement.announcer, &said.statement()));
}

/// The same of a question.
pub fn seal_question(question: &mut Question) {
    let said = Envelope::from(question.clone());
    question.signature = Some(sign(question.robot, &said.statement()));
}

/// Puts their own signatures under those votes that a decision rests on whose bit is set.
pub fn seal_decision(decision: &mut Decision, which: u8) {
    let certificate = &mut decision.certificate;
    let mut place = 0;
    let mut chosen = || {
        place += 1;
        which >> ((place - 1) % 8) & 1 == 1
    };
    for counted in &mut certificate.votes {
        if chosen() {
            let mut held = counted.held();
            seal_vote(&mut held);
            counted.signature = held.signature;
        }
    }
    certificate.others.iter_mut().filter(|_| chosen()).for_each(seal_vote);
}
