//! What it costs to sign and to check what robots say. `cargo bench -p gestalt-trust --bench trust`

use std::sync::Arc;
use std::time::Duration;

use gestalt_protocol::{
    Envelope, FrameHeader, ImageEncoding, Message, RobotId, RoundId, Signature, Stamp, VocabularyId, Vote,
};
use gestalt_trust::{
    Budget, Channels, Ed25519, FrameClaim, FrameSigner, Identity, Membership, Roster, Verifier, statement,
};

const CAMERA: RobotId = RobotId(1);

fn main() {
    divan::main();
}

fn robot(number: u32) -> Identity {
    let mut secret = [1; 32];
    secret[..4].copy_from_slice(&number.to_le_bytes());
    Identity::from_bytes(&secret)
}

fn roster(robots: u32) -> Roster {
    let robots = (0..robots).map(|number| (RobotId(number), robot(number).public_key())).collect();
    let members = Membership { swarm: "demo".to_owned(), epoch: 1, robots, ..Membership::default() };
    members.sign(&robot(u32::MAX)).expect("members that go together")
}

fn header() -> FrameHeader {
    let (encoding, camera) = (ImageEncoding::Jpeg, "parrot".to_owned());
    FrameHeader { nonce: 1, sequence: 1, age_us: 0, encoding, fps: 30.0, camera }
}

/// A vote over six classes.
fn vote(author: u32) -> Vec<u8> {
    let evidence = (0..6).map(|class| ((author * 7 + class * 13) as f32).sin() * 4.0).collect();
    let round = RoundId { counter: 1, opener: RobotId(0), life: 0xA1A1_A1A1 };
    let vote = Vote {
        round,
        vocabulary: VocabularyId(0xDEAD_BEEF),
        evidence,
        looks: 3.0,
        unknown: None,
        named: vec![],
    };
    let stamp = Stamp { boot: 1, sequence: 1000 };
    Envelope { author: RobotId(author), stamp, message: Message::Vote(vote), signature: None }.encode()
}

fn votes(roster: &Roster, robots: u32) -> Vec<(Vec<u8>, Signature)> {
    let signed = |author| {
        let said = vote(author);
        let signature = statement::sign(&robot(author), &roster.swarm_id(), &said);
        (said, signature)
    };
    (0..robots).map(signed).collect()
}

#[divan::bench]
fn sign_a_vote(bencher: divan::Bencher) {
    let (robot, swarm, said) = (robot(1), roster(1).swarm_id(), vote(1));
    bencher.bench(|| statement::sign(&robot, &swarm, divan::black_box(&said)));
}

/// As they come in: none of them is known.
#[divan::bench(args = [1, 100])]
fn check_votes(bencher: divan::Bencher, robots: u32) {
    let roster = roster(robots);
    let votes = votes(&roster, robots);
    bencher.with_inputs(|| Verifier::new(roster.clone(), Budget::default())).bench_refs(|verifier| {
        for (said, signature) in &votes {
            verifier.check(Duration::ZERO, said, Some(signature)).expect("a true vote");
        }
    });
}

/// As votes repeat: all of them are known.
#[divan::bench(args = [1, 100])]
fn check_known_votes(bencher: divan::Bencher, robots: u32) {
    let roster = roster(robots);
    let votes = votes(&roster, robots);
    let mut verifier = Verifier::new(roster, Budget::default());
    let mut check = || {
        for (said, signature) in &votes {
            verifier.check(Duration::ZERO, said, Some(signature)).expect("a true vote");
        }
    };
    check();
    bencher.bench_local(check);
}

/// What one robot tells another alone, once they have spoken.
#[divan::bench]
fn tag_what_is_told(bencher: divan::Bencher) {
    let (roster, said) = (roster(2), vote(0));
    let mut channels = Channels::new(RobotId(0), Arc::new(robot(0)), roster.swarm_id());
    bencher.bench_local(|| channels.tag(&roster, RobotId(1), divan::black_box(&said)).expect("members"));
}

/// When they first speak: what they have in common is worked out.
#[divan::bench]
fn find_what_two_have_in_common(bencher: divan::Bencher) {
    let (roster, said, me) = (roster(2), vote(0), Arc::new(robot(0)));
    let new = || Channels::new(RobotId(0), me.clone(), roster.swarm_id());
    bencher
        .with_inputs(new)
        .bench_refs(|channels| channels.tag(&roster, RobotId(1), &said).expect("members"));
}

/// A JPEG of so many bytes, as a camera signs it.
#[divan::bench(args = [12_000, 60_000])]
fn sign_a_frame(bencher: divan::Bencher, bytes: usize) {
    let (signer, header, picture) =
        (FrameSigner::new(CAMERA, Arc::new(robot(1)), roster(2)), header(), vec![7; bytes]);
    bencher.bench(|| signer.sign(divan::black_box(&header), divan::black_box(&picture)));
}

/// And as whoever looks checks it, but for what it remembers of the camera.
#[divan::bench(args = [12_000, 60_000])]
fn check_a_frame(bencher: divan::Bencher, bytes: usize) {
    let (roster, header, picture) = (roster(2), header(), vec![7; bytes]);
    let proof = FrameSigner::new(CAMERA, Arc::new(robot(1)), roster.clone()).sign(&header, &picture);
    let frame = FrameClaim { robot: CAMERA, header: &header, proof: &proof, picture: &picture };
    let key = roster.key(CAMERA).expect("a member");
    bencher.bench(|| assert!(divan::black_box(&frame).is_signed::<Ed25519>(key, &roster.swarm_id())));
}

#[divan::bench]
fn read_a_roster_of_100(bencher: divan::Bencher) {
    let json = roster(100).to_json();
    bencher.bench(|| -> Roster { Roster::parse(divan::black_box(json.as_bytes())).expect("a roster") });
}
