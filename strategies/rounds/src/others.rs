//! The other robots that are alive.

use std::collections::BTreeSet;
use std::sync::Arc;

use gestalt_protocol::RobotId;

/// The robots alive but for one: the list itself is of all, so that ten thousand of one process share it.
#[derive(Clone, Debug)]
pub(crate) struct Others {
    me: RobotId,
    all: Arc<BTreeSet<RobotId>>,
}

impl Others {
    /// All of these but that one, whether or not it is among them.
    pub fn new(me: RobotId, all: Arc<BTreeSet<RobotId>>) -> Self {
        Self { me, all }
    }

    pub fn contains(&self, robot: RobotId) -> bool {
        robot != self.me && self.all.contains(&robot)
    }

    /// In ascending order.
    pub fn iter(&self) -> impl Iterator<Item = RobotId> + Clone + '_ {
        self.all.iter().copied().filter(|robot| *robot != self.me)
    }

    pub fn len(&self) -> usize {
        self.all.len() - usize::from(self.all.contains(&self.me))
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Those that were not among these.
    pub fn since(&self, before: &Self) -> impl Iterator<Item = RobotId> {
        self.iter().filter(|robot| !before.contains(*robot))
    }

    /// How many have a smaller name.
    pub fn below(&self, robot: RobotId) -> usize {
        self.all.range(..robot).filter(|other| **other != self.me).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_all_but_one_whether_or_not_that_is_listed() {
        let robots = |ids: &[u32]| Arc::new(ids.iter().copied().map(RobotId).collect::<BTreeSet<_>>());
        for all in [robots(&[1, 3, 5]), robots(&[1, 2, 3, 5])] {
            let others = Others::new(RobotId(2), all);
            assert_eq!(others.iter().collect::<Vec<_>>(), [1, 3, 5].map(RobotId));
            assert_eq!((others.len(), others.is_empty(), others.below(RobotId(3))), (3, false, 1));
            assert!(others.contains(RobotId(3)) && !others.contains(RobotId(2)));
            let before = Others::new(RobotId(2), robots(&[2, 3]));
            assert_eq!(others.since(&before).collect::<Vec<_>>(), [1, 5].map(RobotId));
        }
        assert!(Others::new(RobotId(2), robots(&[2])).is_empty());
    }
}
