//! Which frame is looked at next, and which camera may send: the newest frame of each robot, robots in turn.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gestalt_protocol::{FrameTaken, RobotId, RoundId};

use gestalt_link::FrameArrival;

/// A camera that was asked and has not sent within this time keeps nobody else waiting: it may be gone.
const ANSWER: Duration = Duration::from_millis(if cfg!(test) { 500 } else { 100 });

/// A round that opens is noticed within this time, whoever sleeps meanwhile.
const NOTICE: Duration = Duration::from_millis(20);

/// A frame that can be acknowledged.
pub(super) trait Acknowledge {
    /// What to say to its camera.
    fn taken(&self, round: Option<RoundId>) -> FrameTaken;
}

/// Whoever looks for a robot.
pub(super) trait Look {
    /// The round that is judged now.
    fn round(&self) -> Option<RoundId>;

    /// When its camera is to be asked for the next frame, if it was asked for the last at that time.
    fn due(&self, asked: Instant, now: Instant) -> Instant;
}

/// The newest frame of each robot, until a worker takes it.
///
/// A camera sends its next frame when the one before was acknowledged, which happens when the next is due: what nobody needs is not
/// sent. When as many frames wait or are on their way as the workers need to be busy, acknowledgements wait too, and go to the
/// robots in the order in which they were served: then every camera sends its frame just before its turn, and overload makes
/// frames fewer, not older.
#[derive(Debug)]
pub(super) struct FrameQueue<S, F> {
    state: Mutex<State<S, F>>,
    changed: Condvar,
    /// How many frames may wait or be on their way before acknowledgements wait.
    ahead: usize,
}

#[derive(Debug)]
struct State<S, F> {
    slots: BTreeMap<RobotId, Slot<S, F>>,
    turn: u64,
    closed: bool,
}

#[derive(Debug)]
struct Slot<S, F> {
    seat: Arc<S>,
    newest: Option<F>,
    /// A worker looks at a frame of this robot: the next one waits for it.
    busy: bool,
    /// The turn in which it was served last.
    served: u64,
    /// The acknowledgement it has not been given yet.
    owed: Option<FrameTaken>,
    /// When it was asked for a frame last, or its first one came.
    asked: Instant,
    /// It has not sent it yet.
    on_its_way: bool,
    count: Count,
}

/// What became of a robot's frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Count {
    pub received: u64,
    pub overwritten: u64,
}

/// What became of a frame that was put into the queue.
#[derive(Debug)]
pub(super) enum Put<F> {
    /// It waits.
    Waits,
    /// It is of a robot that is not served; here it is back.
    Unknown(F),
}

impl<S, F> FrameQueue<S, F> {
    fn lock(&self) -> MutexGuard<'_, State<S, F>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: Look, F: Acknowledge> FrameQueue<S, F> {
    pub fn new(ahead: usize) -> Self {
        let state = State { slots: BTreeMap::new(), turn: 0, closed: false };
        Self { state: Mutex::new(state), changed: Condvar::new(), ahead }
    }

    /// Serves that robot from now on; one that is served already keeps its seat.
    pub fn admit(&self, robot: RobotId, seat: Arc<S>) {
        let mut state = self.lock();
        let served = state.turn;
        let slot = Slot {
            seat,
            newest: None,
            busy: false,
            served,
            owed: None,
            asked: Instant::now(),
            on_its_way: false,
            count: Count::default(),
        };
        state.slots.entry(robot).or_insert(slot);
    }

    /// Serves that robot no more.
    pub fn dismiss(&self, robot: RobotId) -> Option<Arc<S>> {
        self.lock().slots.remove(&robot).map(|slot| slot.seat)
    }

    /// The robots served, in order.
    pub fn seats(&self) -> Vec<(RobotId, Arc<S>)> {
        self.lock().slots.iter().map(|(robot, slot)| (*robot, slot.seat.clone())).collect()
    }

    /// What became of that robot's frames so far.
    pub fn count(&self, robot: RobotId) -> Count {
        self.lock().slots.get(&robot).map(|slot| slot.count).unwrap_or_default()
    }

    /// Puts a frame in the place of an older one.
    pub fn put(&self, robot: RobotId, frame: F) -> Put<F> {
        let mut state = self.lock();
        let Some(slot) = state.slots.get_mut(&robot) else { return Put::Unknown(frame) };
        slot.count.received += 1;
        slot.on_its_way = false;
        slot.count.overwritten += u64::from(slot.newest.replace(frame).is_some());
        drop(state);
        self.changed.notify_one();
        Put::Waits
    }

    /// Waits for a frame: of those waiting, the one of the robot that was served least recently. Until it is dropped, no other
    /// frame of that robot is given out. `grant` is told which frames are to be acknowledged meanwhile. `None` once the queue
    /// is closed.
    pub fn next(&self, grant: impl Fn(RobotId, FrameTaken)) -> Option<Turn<'_, S, F>> {
        let mut state = self.lock();
        loop {
            if state.closed {
                return None;
            }
            let taken = state.take().map(|(robot, seat, frame)| Turn { queue: self, robot, seat, frame });
            let (granted, wait) = state.grants(Instant::now(), self.ahead);
            if taken.is_none() && granted.is_empty() {
                state = match wait {
                    Some(wait) => {
                        self.changed.wait_timeout(state, wait).unwrap_or_else(PoisonError::into_inner).0
                    }
                    None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
                };
                continue;
            }
            // Not under the lock: Zenoh's threads put frames here.
            drop(state);
            granted.into_iter().for_each(|(robot, taken)| grant(robot, taken));
            if taken.is_some() {
                return taken;
            }
            state = self.lock();
        }
    }

    /// Ends the waiting of all workers.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }
}

/// A frame that is looked at. Dropped, however that ended, it frees its robot for the next.
#[derive(Debug)]
pub(super) struct Turn<'a, S, F> {
    queue: &'a FrameQueue<S, F>,
    pub robot: RobotId,
    pub seat: Arc<S>,
    pub frame: F,
}

impl<S, F> Drop for Turn<'_, S, F> {
    fn drop(&mut self) {
        if let Some(slot) = self.queue.lock().slots.get_mut(&self.robot) {
            slot.busy = false;
        }
        self.queue.changed.notify_one();
    }
}

impl<S: Look, F: Acknowledge> State<S, F> {
    fn take(&mut self) -> Option<(RobotId, Arc<S>, F)> {
        let waiting = self.slots.iter_mut().filter(|(_, slot)| slot.newest.is_some() && !slot.busy);
        let (robot, slot) = waiting.min_by_key(|(_, slot)| slot.served)?;
        let frame = slot.newest.take()?;
        self.turn += 1;
        (slot.busy, slot.served) = (true, self.turn);
        slot.owed = Some(frame.taken(None));
        Some((*robot, slot.seat.clone(), frame))
    }

    /// The acknowledgements to be given now, as long as fewer than `ahead` frames wait or are on their way; and for how long at most
    /// no other is, if any is owed.
    fn grants(&mut self, now: Instant, ahead: usize) -> (Vec<(RobotId, FrameTaken)>, Option<Duration>) {
        let is_expected = |slot: &Slot<S, F>| slot.on_its_way && now < slot.asked + ANSWER;
        let expected = self.slots.values().filter(|slot| slot.newest.is_some() || is_expected(slot)).count();
        let mut wait: Option<Duration> = None;
        let mut due = Vec::new();
        for (robot, slot) in self.slots.iter_mut().filter(|(_, slot)| slot.owed.is_some()) {
            let until = slot.seat.due(slot.asked, now).saturating_duration_since(now);
            if until.is_zero() {
                due.push((*robot, slot));
            } else {
                wait = Some(wait.unwrap_or(NOTICE).min(until));
            }
        }
        if !due.is_empty() {
            wait = Some(wait.unwrap_or(NOTICE));
        }
        due.sort_by_key(|(_, slot)| slot.served);
        let first = due.into_iter().take(ahead.saturating_sub(expected));
        let granted = first.filter_map(|(robot, slot)| {
            let round = slot.seat.round();
            (slot.asked, slot.on_its_way) = (now, true);
            Some((robot, FrameTaken { round, ..slot.owed.take()? }))
        });
        (granted.collect(), wait)
    }
}

impl Acknowledge for FrameArrival {
    fn taken(&self, round: Option<RoundId>) -> FrameTaken {
        FrameTaken { nonce: self.header.nonce, sequence: self.header.sequence, round }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Whose camera is asked so often.
    #[derive(Debug)]
    struct Blind(Duration);

    impl Look for Blind {
        fn round(&self) -> Option<RoundId> {
            None
        }
        fn due(&self, asked: Instant, _: Instant) -> Instant {
            asked + self.0
        }
    }

    impl Acknowledge for u32 {
        fn taken(&self, round: Option<RoundId>) -> FrameTaken {
            FrameTaken { nonce: 1, sequence: *self, round }
        }
    }

    fn paced(robots: u32, ahead: usize, pace: Duration) -> FrameQueue<Blind, u32> {
        let queue = FrameQueue::new(ahead);
        (0..robots).for_each(|robot| queue.admit(RobotId(robot), Arc::new(Blind(pace))));
        queue
    }

    fn queue(robots: u32, ahead: usize) -> FrameQueue<Blind, u32> {
        paced(robots, ahead, Duration::ZERO)
    }

    fn put(queue: &FrameQueue<Blind, u32>, robot: u32, frame: u32) {
        assert!(matches!(queue.put(RobotId(robot), frame), Put::Waits));
    }

    /// Takes one frame; says whose, and who was granted the next.
    fn take(queue: &FrameQueue<Blind, u32>) -> (u32, u32, Vec<u32>) {
        let granted = RefCell::new(Vec::new());
        let turn = queue.next(|robot, _| granted.borrow_mut().push(robot.0)).unwrap();
        (turn.robot.0, turn.frame, granted.into_inner())
    }

    #[test]
    fn the_newest_frame_replaces_the_one_before() {
        let queue = queue(1, 4);
        put(&queue, 0, 1);
        put(&queue, 0, 2);
        assert_eq!(take(&queue), (0, 2, vec![0]));
        assert_eq!(queue.count(RobotId(0)), Count { received: 2, overwritten: 1 });
        assert!(matches!(queue.put(RobotId(9), 3), Put::Unknown(3)));
    }

    #[test]
    fn the_robot_served_least_recently_is_next() {
        let queue = queue(3, 4);
        let mut order = Vec::new();
        // All have a frame waiting all the time, the last one most of all.
        for frame in 0..6 {
            (0..3).rev().for_each(|robot| put(&queue, robot, frame));
            order.push(take(&queue).0);
        }
        assert_eq!(order, [0, 1, 2, 0, 1, 2]);
    }

    #[test]
    fn frames_of_one_robot_are_looked_at_one_by_one() {
        let queue = queue(2, 4);
        put(&queue, 0, 1);
        let busy = queue.next(|_, _| {}).unwrap();
        put(&queue, 0, 2);
        put(&queue, 1, 3);
        assert_eq!(take(&queue).0, 1, "0 waits for its own");
        drop(busy);
        assert_eq!(take(&queue).0, 0);
    }

    #[test]
    fn when_frames_wait_cameras_wait_for_their_turn_to_send() {
        let queue = queue(5, 2);
        (0..5).for_each(|robot| put(&queue, robot, 1));
        assert_eq!(take(&queue), (0, 1, vec![]), "four others wait");
        assert_eq!(take(&queue), (1, 1, vec![]));
        assert_eq!(take(&queue), (2, 1, vec![]));
        assert_eq!(take(&queue), (3, 1, vec![0]), "one waits, one more may");
        put(&queue, 0, 2);
        assert_eq!(take(&queue), (4, 1, vec![1]));
        assert_eq!(take(&queue), (0, 2, vec![2]), "that of 1 is on its way");
    }

    #[test]
    fn nobody_is_kept_waiting_by_cameras_that_stay_silent() {
        let queue = queue(5, 1);
        (0..5).for_each(|robot| put(&queue, robot, 1));
        for _ in 0..5 {
            take(&queue);
        }
        let granted = RefCell::new(Vec::new());
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(6 * ANSWER);
                queue.close();
            });
            assert!(queue.next(|robot, _| granted.borrow_mut().push(robot.0)).is_none());
        });
        // The last one taken had granted 0.
        assert_eq!(granted.into_inner(), [1, 2, 3, 4]);
    }

    /// Works on so many frames at so much each, while every camera that is asked sends at once. Says how often each was served, and
    /// how many frames waited at most.
    fn work(queue: &FrameQueue<Blind, u32>, robots: u32, turns: u32, each: Duration) -> (Vec<u32>, usize) {
        (0..robots).for_each(|robot| put(queue, robot, 0));
        let (mut served, mut most) = (vec![0; robots as usize], 0);
        for _ in 0..turns {
            let asked = RefCell::new(Vec::new());
            let turn = queue.next(|robot, _| asked.borrow_mut().push(robot.0)).unwrap();
            std::thread::sleep(each);
            served[turn.robot.0 as usize] += 1;
            drop(turn);
            asked.into_inner().into_iter().for_each(|robot| put(queue, robot, 1));
            let waiting = queue.lock().slots.values().filter(|slot| slot.newest.is_some()).count();
            // All sent once unasked.
            most = most.max(if served.contains(&0) { 0 } else { waiting });
        }
        (served, most)
    }

    #[test]
    fn cameras_are_asked_no_more_often_than_is_due() {
        let queue = paced(4, 8, 40 * MS);
        let (asked, to_ask) = std::sync::mpsc::channel();
        let mut times = [const { Vec::new() }; 4];
        let began = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let grant = |robot: RobotId, _| asked.send((robot.0, Instant::now())).unwrap();
                while let Some(turn) = queue.next(grant) {
                    drop(turn);
                }
            });
            (0..4).for_each(|robot| put(&queue, robot, 0));
            while let Ok((robot, at)) = to_ask.recv_timeout(Duration::from_secs(10)) {
                times[robot as usize].push(at);
                if times.iter().map(Vec::len).sum::<usize>() == 40 {
                    break;
                }
                put(&queue, robot, 1);
            }
            queue.close();
        });
        for times in &times {
            assert!(times.len() >= 8, "{times:?}");
            // Whoever asks may be held up between looking at the clock and asking, so two askings may be nearer to each other than they are due; the
            // n-th never comes before n are due.
            assert!((0..).zip(times).all(|(turn, at): (u32, _)| *at >= began + turn * 40 * MS), "{times:?}");
        }
    }

    #[test]
    fn overload_makes_frames_of_all_fewer_alike_and_none_older() {
        // Forty cameras that are due at any time.
        let (served, waiting) = work(&queue(40, 4), 40, 500, 2 * MS);
        let (least, most) = (served.iter().min().unwrap(), served.iter().max().unwrap());
        assert!(*least > 2 && most - least <= 1, "{served:?}");
        assert!(waiting <= 4, "{waiting} wait");
    }
}
