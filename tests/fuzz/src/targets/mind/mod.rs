//! Three honest minds, a network that does what the input says, and one who means them ill and can say anything, but in whose
//! name no vote is signed.

mod adversary;
mod world;

use std::time::Duration;

use gestalt_protocol::RobotId;
use gestalt_strategies::Mind;

use self::world::{ROBOTS, World};

/// How long nothing bad happens at the end: what a robot lacks is found when its turn comes, every four seconds.
const CALM: Duration = Duration::from_secs(60);

/// An input is a list of events, each of a byte and its arguments, see [`adversary::event`].
///
/// What is final was held by a majority, and never are two gestures final for one round, whatever a stranger says and however late messages
/// are, also where robots are ended in the midst of a round and start again with what is on their disks; unless robots are not told who is there. No robot panics, forgets what it refused or
/// holds more than it may; and after a calm period all know the same.
///
/// # Panics
/// If not.
pub fn run(bytes: &[u8]) {
    let world = live(bytes);
    has_one_final(&world);
    let minds: Vec<&Mind> = world.robots().iter().map(|robot| robot.mind()).collect();
    for other in &minds[1..] {
        alike(&world, minds[0], other);
    }
    // What one has forgotten it gives to nobody.
    if !world.robots().iter().any(|robot| robot.forgot()) {
        for (one, other) in [(0, 1), (1, 2), (2, 0)] {
            saw_the_same(&world, minds[one], minds[other]);
        }
    }
}

/// The same events, of which no more is asked than that what is final was held by a majority, and that no round has two final gestures.
///
/// # Panics
/// If not.
pub fn finals(bytes: &[u8]) {
    has_one_final(&live(bytes));
}

fn has_one_final(world: &World) {
    if !world.misled() && !world.forgot_all() {
        assert_eq!(world.contradiction(), None, "two gestures are final for one round");
    }
}

/// Whether two gestures become final for one round, however late messages are.
#[must_use]
pub fn contradicts(bytes: &[u8]) -> bool {
    live(bytes).contradiction().is_some()
}

/// All events, then calm.
fn live(bytes: &[u8]) -> World {
    let mut world = World::new();
    let mut events = adversary::Events::new(bytes);
    while adversary::event(&mut world, &mut events).is_some() {}
    world.robots().iter().for_each(|robot| robot.check());
    world.introduce();
    world.pass(CALM, true);
    world.robots().iter().for_each(|robot| robot.check());
    world
}

fn alike(world: &World, one: &Mind, other: &Mind) {
    // A round may have another name here than there: whoever opened it under that has forgotten it.
    let counter = |mind: &Mind| mind.round().map(|round| round.counter);
    let gesture = |mind: &Mind| mind.held().and_then(|held| held.class);
    // Whom a stranger has made believe in robots that are not there believes nobody who counts fewer: it keeps what it held, and may not even hear of the
    // round that they decided.
    let was_misled = world.was_misled(one.me()) || world.was_misled(other.me());
    // One that started again goes to no round by its own earlier word alone.
    let one_knows_of_none = one.round().is_none() || other.round().is_none();
    let undecided = gesture(one).or(gesture(other)).is_none();
    let both_know = !(undecided && one_knows_of_none);
    if both_know && !was_misled {
        assert_eq!(counter(one), counter(other), "rounds of robots {} and {}", one.me(), other.me());
    }
    // Of two names of a round, which a cut kept apart, a person spoke of one: for who knew the other, that was another showing.
    let names = [one, other].map(|mind| mind.round());
    let are_two = names[0] != names[1] && names.into_iter().flatten().any(|name| world.was_spoken_of(name));
    // Where robots differ on which rounds of a count are one, what most hold stands; where one of the three believes in robots that are not there, two may be
    // no most of its.
    let of_two = names[0] != names[1] || gesture(one).is_none() || gesture(other).is_none();
    let is_misled = world.misled() && of_two;
    // One that lost its disk may be in a round that it left in its earlier life.
    if !was_misled && !is_misled && !are_two && !world.forgot_all() {
        assert_eq!(gesture(one), gesture(other), "robots {} and {}", one.me(), other.me());
    }
    let lessons = |mind: &Mind| mind.learned().map(|learned| learned.lessons);
    assert_eq!(lessons(one), lessons(other), "lessons of robots {} and {}", one.me(), other.me());
}

fn saw_the_same(world: &World, one: &Mind, other: &Mind) {
    let (Some(mine), Some(theirs)) = (one.training_set(), other.training_set()) else { return };
    for series in mine.seen().series().filter(|series| !world.is_contradictory(*series)) {
        let (mine, theirs) = (mine.seen().intervals(series), theirs.seen().intervals(series));
        assert_eq!(mine, theirs, "samples of {series} that robots {} and {} saw", one.me(), other.me());
    }
}

/// The robot of that number.
fn robot(place: usize) -> RobotId {
    RobotId((place % ROBOTS) as u32 + 1)
}

/// Events to begin with: a gesture is shown, seen and taught, and something goes wrong.
pub fn seed(rng: &mut impl rand::Rng) -> Vec<u8> {
    adversary::seed(rng)
}
