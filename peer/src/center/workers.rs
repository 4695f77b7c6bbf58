//! The threads that look: none of them is lost to a panic, and none is left when they are dropped.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::thread::JoinHandle;

use gestalt_protocol::{FrameTaken, RobotId};
use gestalt_vision::steady::caught;

use super::frame_queue::{Acknowledge, FrameQueue, Look, Turn};

/// As many workers as the machine has cores.
pub(super) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get)
}

/// What workers do.
pub(super) trait Work<S, F>: Send + Sync + 'static {
    /// Acknowledges a frame to its robot.
    fn grant(&self, robot: RobotId, taken: &FrameTaken);

    /// Looks at a frame.
    fn look(&self, turn: &Turn<'_, S, F>);

    /// One of these two panicked.
    fn panicked(&self, message: &str);
}

/// Workers at one queue. Dropping them closes the queue and waits until each has finished the frame it has at hand.
pub(super) struct Workers<S: Look, F: Acknowledge> {
    queue: Arc<FrameQueue<S, F>>,
    threads: Vec<JoinHandle<()>>,
}

impl<S, F> Workers<S, F>
where
    S: Look + Send + Sync + 'static,
    F: Acknowledge + Send + 'static,
{
    /// Starts that many.
    ///
    /// # Errors
    /// When the system has no thread to spare; then none is left.
    pub fn start(
        count: usize,
        queue: &Arc<FrameQueue<S, F>>,
        work: &Arc<impl Work<S, F>>,
    ) -> std::io::Result<Self> {
        let mut workers = Self { queue: queue.clone(), threads: Vec::with_capacity(count) };
        for _ in 0..count {
            let (queue, work) = (queue.clone(), work.clone());
            let thread = std::thread::Builder::new().name("centre".to_owned());
            workers.threads.push(thread.spawn(move || run(&queue, &*work))?);
        }
        Ok(workers)
    }
}

impl<S: Look, F: Acknowledge> Drop for Workers<S, F> {
    fn drop(&mut self) {
        self.queue.close();
        for thread in self.threads.drain(..) {
            if thread.join().is_err() {
                tracing::error!("a worker of the centre ended badly");
            }
        }
    }
}

/// Looks at one frame after the other.
fn run<S: Look, F: Acknowledge>(queue: &FrameQueue<S, F>, work: &impl Work<S, F>) {
    loop {
        let worked = caught(|| {
            let turn = queue.next(|robot, taken| work.grant(robot, &taken))?;
            work.look(&turn);
            Some(())
        });
        match worked {
            Ok(Some(())) => {}
            Ok(None) => return,
            Err(message) => work.panicked(&message),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::mpsc;
    use std::thread::ThreadId;
    use std::time::Instant;

    use gestalt_protocol::RoundId;

    use super::*;

    struct Blind;

    impl Look for Blind {
        fn round(&self) -> Option<RoundId> {
            None
        }
        fn due(&self, asked: Instant, _: Instant) -> Instant {
            asked
        }
    }

    /// A frame at which whoever looks panics, or does not.
    struct Trap(bool);

    impl Acknowledge for Trap {
        fn taken(&self, round: Option<RoundId>) -> FrameTaken {
            FrameTaken { nonce: 1, sequence: 1, round }
        }
    }

    struct Watched {
        looked: Mutex<mpsc::Sender<(u32, ThreadId)>>,
        panics: Mutex<Vec<String>>,
    }

    impl Work<Blind, Trap> for Watched {
        fn grant(&self, _: RobotId, _: &FrameTaken) {}
        fn look(&self, turn: &Turn<'_, Blind, Trap>) {
            assert!(!turn.frame.0, "a trap");
            let seen = (turn.robot.0, std::thread::current().id());
            self.looked.lock().unwrap().send(seen).unwrap();
        }
        fn panicked(&self, message: &str) {
            self.panics.lock().unwrap().push(message.to_owned());
        }
    }

    #[test]
    fn a_panic_frees_its_robot_and_costs_no_worker() {
        let queue = Arc::new(FrameQueue::new(4));
        for robot in 0..3 {
            queue.admit(RobotId(robot), Arc::new(Blind));
        }
        let (looked, seen) = mpsc::channel();
        let work = Arc::new(Watched { looked: Mutex::new(looked), panics: Mutex::default() });
        let workers = Workers::start(1, &queue, &work).unwrap();
        for times in 1..=10 {
            let _ = queue.put(RobotId(1), Trap(true));
            // The same robot's next frame is looked at, by the same only thread, and so are those of others.
            while work.panics.lock().unwrap().len() < times {
                std::thread::yield_now();
            }
            for robot in 0..3 {
                let _ = queue.put(RobotId(robot), Trap(false));
                let seen = seen.recv_timeout(std::time::Duration::from_secs(10));
                assert_eq!(seen.map(|(robot, _)| robot), Ok(robot));
            }
        }
        assert_eq!(work.panics.lock().unwrap()[..], vec!["a trap"; 10]);
        drop(workers);
        assert_eq!(Arc::strong_count(&work), 1, "no thread is left");
    }
}
