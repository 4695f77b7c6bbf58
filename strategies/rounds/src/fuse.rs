//! The contract of a fusion rule.

use std::fmt::Debug;

use gestalt_protocol::{FusionRule, Pool};

use crate::fusion::Fusion;

/// Makes one distribution over the classes of the votes of many robots.
///
/// The rules that come with Gestalt are the variants of [`FusionRule`]; a user's rule goes into
/// [`Rounds::fused_by`](crate::Rounds::fused_by). All robots of a swarm need the same. Certificates name it, so that nobody
/// takes its decisions for those of another; a robot that does not have it holds what it heard, as of any rule.
///
/// What it gives may depend on the votes handed in and on nothing else, or robots with the same votes would disagree.
///
/// ```
/// use std::sync::Arc;
///
/// use gestalt_protocol::{ClassId, FusionRule, RobotId};
/// use gestalt_rounds::fusion::Fusion;
/// use gestalt_rounds::{Fuse, Life, Rounds, RoundsConfig};
///
/// /// Each robot has one vote for every class that it does not think unlikely.
/// #[derive(Debug)]
/// struct Approval;
///
/// impl Fuse for Approval {
///     fn rule(&self) -> FusionRule {
///         FusionRule::Other("approval".parse().expect("a short plain name"))
///     }
///
///     fn fuse(&self, _clip: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion> {
///         let approving = |class: usize| votes.iter().filter(|vote| vote[class] >= 0.0).count() as f64;
///         let approved: Vec<f64> = (0..classes).map(approving).collect();
///         let all: f64 = approved.iter().sum();
///         let mut order: Vec<usize> = (0..classes).collect();
///         // Stable: of equals the smaller class.
///         order.sort_by(|a, b| approved[*b].total_cmp(&approved[*a]));
///         (all > 0.0).then(|| Fusion {
///             probabilities: approved.iter().map(|n| n / all).collect(),
///             top: ClassId(order[0] as u32),
///             margin: approved[order[0]] - approved[order[1]],
///         })
///     }
/// }
///
/// let life = Life { boot: 1, nonce: 0x3F9A_01C7 };
/// let rounds = Rounds::new(RobotId(1), life, RoundsConfig::default())?.fused_by(Arc::new(Approval));
/// assert_eq!(rounds.config().rule.name(), "approval");
/// # Ok::<(), gestalt_rounds::RoundsConfigError>(())
/// ```
pub trait Fuse: Debug + Send + Sync {
    /// How certificates name it: [`FusionRule::Other`] for a user's rule. One that went by the name of a rule of Gestalt's and made something else of the votes
    /// would have its robot taken for a liar.
    fn rule(&self) -> FusionRule;

    /// Fuses the votes: centred log-evidence, each of `classes` values in nats, as said and not yet clipped to ±`clip`, in
    /// the order of the robots. `None` when they say nothing.
    ///
    /// Where robots tell what is unknown, these are the gestures of the list that any of them was taught, in its order, and the result is what it is if it
    /// is one of them; where there is but one, no rule is asked.
    ///
    /// A result that is no distribution over the classes counts as `None`.
    fn fuse(&self, clip: f64, classes: usize, votes: &[&[f32]]) -> Option<Fusion>;

    /// The least probability that the top class of `fusion`, which these votes gave, has left if so many of the robots lied. `0.0..=1.0`; with
    /// no liars that of the fusion, and 0 where another class is as likely. By default all of it where the margin exceeds their number, and else 0.
    fn withstands(&self, clip: f64, votes: &[&[f32]], fusion: &Fusion, liars: u32) -> f64 {
        let _ = (clip, votes);
        if fusion.margin > f64::from(liars) { fusion.greatest() } else { 0.0 }
    }

    /// The parameters of a correlated pool, for the certificate; `None` for any other rule.
    fn pool(&self) -> Option<Pool> {
        None
    }

    /// The same rule by other parameters; `None` for one that has none.
    fn with(&self, pool: Pool) -> Option<Box<dyn Fuse>> {
        let _ = pool;
        None
    }

    /// What one robot's vote weighs, for the certificate: `0.0..`, finite; anything else is listed as 0.
    fn weight(&self, clip: f64, evidence: &[f32]) -> f64 {
        let _ = (clip, evidence);
        1.0
    }
}
