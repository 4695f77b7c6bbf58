//! What is measured after each round of a run.

/// How a swarm stands after a round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// How many rounds there were.
    pub round: u32,
    /// The share of held-out views that the robot which sees them judges rightly, over all robots.
    pub single: f64,
    /// The share of held-out moments that all robots' views together, in a logarithmic pool or by a
    /// rule of your own, are right about.
    pub swarm: f64,
    /// The same by majority.
    pub majority: f64,
    /// Bytes of samples that a robot published so far, on average.
    pub published: f64,
    /// Bytes of samples that a robot put on its links so far, on average: its own, those it relays, repair.
    pub on_links: f64,
    /// Samples that a robot holds, on average.
    pub samples: f64,
    /// How many questions were asked so far.
    pub questions: f64,
    /// How often the instructor said what was shown.
    pub labels: f64,
    /// Of the samples that honest robots hold of other honest ones, the share that they train on.
    pub heeded_honest: f64,
    /// The same of those of liars; 1 where there are none.
    pub heeded_liars: f64,
    /// The least share that any honest robot trains on of the samples of another honest one.
    pub least_heeded: f64,
    /// Where robots learn from groups of authors apart: the share of held-out views that they judge rightly, whatever as many others said as lie, or one. 0 elsewhere.
    pub certified: f64,
    /// The logarithm of the odds that robots give that a held-out view shows nothing that they were taught, on average, of those that can tell: nats.
    pub unknown: f64,
}
