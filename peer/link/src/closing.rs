//! What ends a thing that nobody holds any more: of a session Zenoh's own threads keep it alive otherwise.

use std::pin::Pin;

use tokio::runtime::{Builder, Handle};

type Close = Box<dyn FnOnce() -> Pin<Box<dyn Future<Output = ()> + Send>> + Send + Sync>;

/// Done when it is dropped, wherever that is.
pub(crate) struct Closing(Option<Close>);

impl Closing {
    pub fn new<F: Future<Output = ()> + Send + 'static>(
        close: impl FnOnce() -> F + Send + Sync + 'static,
    ) -> Self {
        Self(Some(Box::new(|| Box::pin(close()))))
    }

    /// It is closed otherwise, or held by somebody else now.
    pub fn forget(mut self) {
        self.0 = None;
    }
}

impl Drop for Closing {
    fn drop(&mut self) {
        let Some(close) = self.0.take() else { return };
        match Handle::try_current() {
            Ok(runtime) => drop(runtime.spawn(close())),
            // Who drops it elsewhere waits.
            Err(_) => {
                let runtime = Builder::new_current_thread().enable_all().build();
                drop(runtime.map(|runtime| runtime.block_on(close())));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_is_dropped_is_closed_within_tokio_and_elsewhere_and_what_is_forgotten_is_not() {
        let (closed, ends) = mpsc::channel();
        let closing = |name: &'static str| {
            let closed = closed.clone();
            Closing::new(move || async move { closed.send(name).unwrap() })
        };
        drop(closing("elsewhere"));
        assert_eq!(ends.try_recv(), Ok("elsewhere"));
        let runtime = Builder::new_multi_thread().worker_threads(1).build().unwrap();
        runtime.block_on(async { drop(closing("within")) });
        assert_eq!(ends.recv_timeout(Duration::from_secs(10)), Ok("within"));
        closing("forgotten").forget();
        assert!(ends.try_recv().is_err());
    }
}
