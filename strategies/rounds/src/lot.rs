//! Chance that all robots draw alike, without a word between them.

use gestalt_protocol::RobotId;

/// What is drawn for: who is drawn for the one is no likelier to be drawn for the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lottery {
    /// Who votes.
    Committee,
    /// Who shares one sample more than others.
    Sharing,
}

/// The lot of a robot in the round of that counter, any number of 64 bits as likely as any other: the same at all robots.
///
/// It goes by the counter alone, not by the whole name of the round, so that rounds which were opened at the same time, and merge, are one
/// for the lottery too. Whoever opens rounds has some choice of the counter, so nothing may rest on nobody knowing whom the lot falls on.
#[must_use]
pub fn lot(lottery: Lottery, counter: u32, robot: RobotId) -> u64 {
    let purpose: u64 = match lottery {
        Lottery::Committee => 0x636f_6d6d_6974_7465,
        Lottery::Sharing => 0x7368_6172_696e_6721,
    };
    // Twice the output function of SplitMix64 (Steele, Lea & Flood 2014): neighbouring ids and counters give unrelated lots.
    mix(mix(purpose ^ u64::from(counter)).wrapping_add(u64::from(robot.0)))
}

fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mixing_is_the_published_one() {
        // The first numbers of SplitMix64 from the seed 1234567, as in its authors' reference code.
        let seeds = [1_234_567_u64, 1_234_567_u64.wrapping_add(0x9e37_79b9_7f4a_7c15)];
        assert_eq!(seeds.map(mix), [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn another_program_draws_the_same() {
        // By examples/verify.py.
        assert_eq!(lot(Lottery::Committee, 5, RobotId(7)), 11_821_268_644_233_891_288);
    }

    #[test]
    fn lots_are_even_over_robots_and_over_rounds() {
        // A tenth of 1000 lots lies below a tenth: a binomial of standard deviation 9.5.
        let low = |lots: Vec<u64>| lots.into_iter().filter(|lot| *lot < u64::MAX / 10).count();
        for n in 0..20 {
            let of_robots = low((1..=1000).map(|robot| lot(Lottery::Committee, n, RobotId(robot))).collect());
            let of_rounds =
                low((1..=1000).map(|counter| lot(Lottery::Committee, counter, RobotId(n))).collect());
            assert!((60..=140).contains(&of_robots), "round {n}: {of_robots}");
            assert!((60..=140).contains(&of_rounds), "robot {n}: {of_rounds}");
        }
        assert_ne!(lot(Lottery::Committee, 1, RobotId(1)), lot(Lottery::Sharing, 1, RobotId(1)));
    }
}
