//! How much is shared, and held.

use super::*;

#[test]
fn ten_robots_hold_what_the_source_says() {
    let mut swarm = Swarm::new(10, config(5, 0.2), 1);
    for class in 0..CLASSES {
        let round = swarm.show(class);
        swarm.was(round, class);
    }
    for i in 0..10 {
        assert_eq!(swarm.sizes(i), [24, 6, 54], "robot {}", i + 1);
    }
    assert_eq!(swarm.common().len(), 1);
    swarm.check();
}

#[test]
fn the_size_follows_the_formula() {
    for (n, fraction) in [(5, 0.0), (5, 0.1), (5, 0.5), (5, 1.0), (20, 0.1)] {
        let mut swarm = Swarm::new(n, config(5, fraction), 2);
        for class in 0..CLASSES {
            let round = swarm.show(class);
            swarm.was(round, class);
        }
        let own = f64::from(CLASSES) * 5.0;
        let expected = own + fraction * own * (n as f64 - 1.0);
        for i in 0..n {
            assert_eq!(swarm.sizes(i).iter().sum::<usize>() as f64, expected, "{n} robots, B = {fraction}");
        }
    }
}

#[test]
fn bytes_bound_what_a_round_shares() {
    let mut swarm = Swarm::new(2, LearningConfig { share_bytes: Some(128), ..config(8, 1.0) }, 10);
    let round = swarm.show(1);
    swarm.was(round, 1);
    for mind in &swarm.minds {
        let learning = mind.learning.as_ref().unwrap();
        let own = learning.set().common().filter(|sample| sample.part == Part::Shared);
        let message = Message::Samples(learning.told(own));
        let stamp = Stamp { boot: 1, sequence: 100 };
        let length = Envelope { author: mind.me(), stamp, message }.encode().len();
        assert!((80..=128).contains(&length), "{length} bytes");
    }
}
