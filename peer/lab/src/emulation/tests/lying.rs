//! Robots that lie, as long as they are there.

use super::*;

#[test]
fn a_liar_that_is_gone_or_stands_still_says_nothing() {
    for event in [Event::Kill(RobotId(1)), Event::Freeze(RobotId(1))] {
        for lies in [Lies::Together, Lies::TwoFaced, Lies::Choosing] {
            let fault = Fault { at: Duration::from_secs(1), event };
            let mut scenario = Scenario { faults: vec![fault], ..calm(2, 6, NetworkShape::Full, 5) };
            scenario.robots[1].view = scenario.robots[0].view;
            scenario.robots[0].lies = Some(lies);
            let mut emulation = emulation(&scenario, 1);
            while emulation.show_next() {}
            assert_eq!(emulation.traffic(0), Traffic::default(), "{event:?}, {lies:?}");
            assert!(emulation.traffic(1).votes > 0, "the other goes on: {event:?}, {lies:?}");
        }
    }
}
