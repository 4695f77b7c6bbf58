//! Cameras, those who look at them, and those who would rather be seen instead.

use gestalt_protocol::{ImageEncoding, Signature};

use super::*;
use crate::membership::Membership;
use crate::testing::{authority, members, robot, roster};

const NOW: Duration = Duration::from_secs(9);

/// One who looks at cameras: as `gestalt-link` puts it together.
struct Looking {
    guard: FrameGuard,
    me: RobotId,
    drawn: u64,
}

impl Looking {
    fn new(me: u32) -> Self {
        Self { guard: FrameGuard::default(), me: RobotId(me), drawn: u64::from(me) << 32 }
    }

    fn fresh(&mut self) -> u64 {
        self.drawn += 1;
        self.drawn
    }

    fn see(&mut self, frame: &Sent) -> Result<(), Distrust> {
        let (roster, fresh) = (roster(1), self.fresh());
        let claim = FrameClaim {
            robot: frame.robot,
            header: &frame.header,
            proof: &frame.proof,
            picture: &frame.picture,
        };
        let key = roster.key(frame.robot)?;
        self.guard.weigh(NOW, key, &claim, fresh)?;
        if !claim.is_signed::<Ed25519>(key, &roster.swarm_id()) {
            return Err(Distrust::Forged);
        }
        self.guard.admit(NOW, key, &claim, fresh)
    }

    fn ask(&mut self, of: RobotId) -> FrameChallenge {
        let (roster, fresh) = (roster(1), self.fresh());
        let next = self.guard.challenge(NOW, of, roster.key(of).unwrap(), fresh);
        challenge(&robot(self.me.0), &roster.swarm_id(), self.me, of, next)
    }
}

#[derive(Clone)]
struct Sent {
    robot: RobotId,
    header: FrameHeader,
    proof: FrameProof,
    picture: Vec<u8>,
}

/// A camera's program, from its start.
struct Filming {
    signer: FrameSigner,
    nonce: u64,
    sequence: u32,
}

fn header(nonce: u64, sequence: u32) -> FrameHeader {
    let camera = "parrot".to_owned();
    FrameHeader { nonce, sequence, age_us: 0, encoding: ImageEncoding::Jpeg, fps: 30.0, camera }
}

impl Filming {
    fn start(of: u32, nonce: u64) -> Self {
        let signer = FrameSigner::new(RobotId(of), Arc::new(robot(of)), roster(1));
        Self { signer, nonce, sequence: 0 }
    }

    fn film(&mut self) -> Sent {
        self.sequence += 1;
        let (header, picture) = (header(self.nonce, self.sequence), vec![7; 5000]);
        Sent { robot: self.signer.robot, proof: self.signer.sign(&header, &picture), header, picture }
    }

    fn hear(&mut self, asked: &FrameChallenge) -> Result<(), Distrust> {
        self.signer.hear(NOW, asked)
    }
}

#[test]
fn a_frame_counts_once_it_answers_and_none_twice_or_out_of_order() {
    let (mut centre, mut parrot) = (Looking::new(0), Filming::start(3, 50));
    assert_eq!(centre.see(&parrot.film()), Err(Distrust::Unasked));
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    let [first, second, third] = [(); 3].map(|()| parrot.film());
    assert_eq!(centre.see(&first), Ok(()));
    assert_eq!(centre.see(&third), Ok(()));
    for old in [&first, &second, &third] {
        assert_eq!(centre.see(old), Err(Distrust::Repeated));
    }
    // It goes on, whether it heard the next challenge or not.
    assert_eq!(centre.see(&parrot.film()), Ok(()));
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    assert_eq!(centre.see(&parrot.film()), Ok(()));
}

#[test]
fn what_was_recorded_counts_no_more_after_either_has_started_again() {
    let (mut centre, mut parrot) = (Looking::new(0), Filming::start(3, 50));
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    let recorded = [(); 4].map(|()| parrot.film());
    recorded[..2].iter().for_each(|frame| centre.see(frame).unwrap());
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    let kept_back = parrot.film();

    let mut again = Filming::start(3, 51);
    again.hear(&centre.ask(RobotId(3))).unwrap();
    let new = again.film();
    assert_eq!(centre.see(&new), Ok(()));
    for old in recorded.iter().chain([&kept_back]) {
        assert_eq!(centre.see(old), Err(Distrust::Unasked), "{:?}", old.header);
    }
    let mut centre = Looking { drawn: 900, ..Looking::new(0) };
    for old in recorded.iter().chain([&kept_back, &new]) {
        assert_eq!(centre.see(old), Err(Distrust::Unasked), "{:?}", old.header);
    }
}

#[test]
fn nobody_films_in_anothers_name_and_nothing_of_a_frame_can_be_altered() {
    let (mut centre, mut parrot) = (Looking::new(0), Filming::start(3, 50));
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    let mut neighbour = Filming::start(2, 60);
    neighbour.hear(&centre.ask(RobotId(2))).unwrap();
    let true_one = parrot.film();

    let thief = FrameSigner { identity: Arc::new(robot(2)), ..parrot.signer.clone() };
    let forged = Sent { proof: thief.sign(&true_one.header, &true_one.picture), ..true_one.clone() };
    let mut altered = vec![forged, Sent { robot: RobotId(2), ..true_one.clone() }];
    altered.push(Sent { picture: vec![8; 5000], ..true_one.clone() });
    altered.push(Sent { header: header(50, 2), ..true_one.clone() });
    altered.push(Sent { header: header(51, 1), ..true_one.clone() });
    let challenges = vec![true_one.proof.challenges[0], 1];
    altered.push(Sent { proof: FrameProof { challenges, ..true_one.proof.clone() }, ..true_one.clone() });
    for altered in &altered {
        let cause = centre.see(altered).expect_err("altered");
        assert!(matches!(cause, Distrust::Forged | Distrust::Unasked), "{cause}");
    }
    assert_eq!(centre.see(&Sent { robot: RobotId(9), ..true_one.clone() }), Err(Distrust::Stranger));
    assert_eq!(centre.see(&true_one), Ok(()), "none of it kept the true one out");
    // Streams that change places are none of either.
    let swapped = Sent { robot: RobotId(3), ..neighbour.film() };
    assert!(centre.see(&swapped).is_err());
}

#[test]
fn those_who_look_are_answered_all_and_nobody_else_is() {
    let mut parrot = Filming::start(3, 50);
    let mut looking = [0, 1, 2].map(Looking::new);
    for one in &mut looking {
        parrot.hear(&one.ask(RobotId(3))).unwrap();
    }
    let frame = parrot.film();
    assert!(looking.iter_mut().all(|one| one.see(&frame).is_ok()));

    let swarm = roster(1).swarm_id();
    let asked = |by, of, with| challenge(&robot(with), &swarm, RobotId(by), RobotId(of), 5);
    assert_eq!(parrot.hear(&asked(0, 3, 1)), Err(Distrust::Forged), "in another's name");
    assert_eq!(parrot.hear(&asked(0, 2, 0)), Err(Distrust::Forged), "of another camera");
    assert_eq!(parrot.hear(&asked(7, 3, 7)), Err(Distrust::Stranger));
    assert_eq!(parrot.film().proof.challenges.len(), 3);
}

#[test]
fn a_sender_answers_the_latest_of_each_and_of_no_more_than_are_read() {
    let many = (0..12).map(|n| (RobotId(n), robot(n).public_key())).collect();
    let roster = Membership { robots: many, ..members(1) }.sign(&authority()).unwrap();
    let swarm = roster.swarm_id();
    let mut signer = FrameSigner::<Ed25519>::new(RobotId(3), Arc::new(robot(3)), roster);
    let asked = |by, number| challenge(&robot(by), &swarm, RobotId(by), RobotId(3), number);
    for by in 0..12 {
        signer.hear(NOW, &asked(by, u64::from(by))).unwrap();
    }
    signer.hear(NOW, &asked(6, 60)).unwrap();
    let proof = signer.sign(&header(1, 1), &[1]);
    assert_eq!(proof.challenges, [4, 5, 7, 8, 9, 10, 11, 60]);
    // Whoever floods it with challenges that are not true is not checked for ever; what it knows costs nothing.
    let mut forged = FrameChallenge { signature: Signature::from_bytes([1; 64]), ..asked(6, 61) };
    let refused = (0..600).map(|n| {
        forged.challenge = 100 + n;
        signer.hear(NOW, &forged)
    });
    assert_eq!(refused.filter(|it| *it == Err(Distrust::Forged)).count(), 512 - 13);
    assert_eq!(signer.hear(NOW, &asked(6, 60)), Ok(()));
    assert_eq!(signer.hear(NOW + Duration::from_millis(2), &asked(6, 62)), Ok(()));
}

#[test]
fn a_flood_of_frames_is_checked_within_a_budget_of_bytes() {
    for (length, checked) in [(1, 256), (65_536, 256), (65_537, 128), (262_144, 64)] {
        let (mut centre, mut parrot) = (Looking::new(0), Filming::start(3, 50));
        parrot.hear(&centre.ask(RobotId(3))).unwrap();
        let forged = Sent { picture: vec![0; length], ..parrot.film() };
        let refused = (0..400).map(|_| centre.see(&forged).expect_err("forged"));
        assert_eq!(refused.take_while(|cause| *cause == Distrust::Forged).count(), checked, "{length} bytes");
        assert_eq!(centre.see(&forged), Err(Distrust::TooFast));
    }
}

#[test]
fn a_new_key_begins_anew() {
    let (mut centre, mut parrot) = (Looking::new(0), Filming::start(3, 50));
    parrot.hear(&centre.ask(RobotId(3))).unwrap();
    centre.see(&parrot.film()).unwrap();
    let asked = centre.ask(RobotId(3)).challenge;
    let (key, fresh) = (*roster(1).key(RobotId(2)).unwrap(), centre.fresh());
    assert_ne!(centre.guard.challenge(NOW, RobotId(3), &key, fresh), asked);
}

#[test]
fn the_signed_bytes_are_what_is_written_above() {
    let swarm = roster(1).swarm_id();
    let (header, robot) = (header(1, 2), RobotId(3));
    let bytes = signed_bytes(&swarm, robot, &header, &[4], b"picture");
    let head = header.encode_answering(&[4]);
    let digest: [u8; 32] = Sha256::digest(b"picture").into();
    assert_eq!(bytes, [b"gestalt-frame-1\0", &swarm.as_bytes()[..], &[3, 0, 0, 0], &head, &digest].concat());
    let bytes = challenge_bytes(&swarm, RobotId(1), robot, 5);
    let numbers = [1, 0, 0, 0, 3, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0];
    assert_eq!(bytes, [b"gestalt-challenge-1\0", &swarm.as_bytes()[..], &numbers].concat());
}
