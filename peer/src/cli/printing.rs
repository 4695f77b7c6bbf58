//! What a verb prints whose work is another: a robot, a fusion centre, a camera that is streamed.

use super::Failure;

/// Whether what is printed arrives. A full disk under the output takes nobody out of the swarm: it is a warning, once until printing works again.
#[derive(Debug, Default)]
pub(super) struct Printing {
    fails: bool,
}

impl Printing {
    /// Takes in what became of something that was printed, if anything was.
    pub(super) fn note(&mut self, printed: impl Into<Option<Result<(), Failure>>>) {
        if let Some(warning) = printed.into().and_then(|printed| self.warning(printed)) {
            tracing::warn!("{warning}");
        }
    }

    fn warning(&mut self, printed: Result<(), Failure>) -> Option<String> {
        let failure = printed.err();
        let failed_before = std::mem::replace(&mut self.fails, failure.is_some());
        let failure = failure.filter(|_| !failed_before)?;
        Some(format!(
            "what happens cannot be printed, and is not until it can: {failure}; make room where the output goes"
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    #[test]
    fn what_cannot_be_printed_is_said_once_until_printing_works_again() {
        let full = || -> Result<(), Failure> { Err(io::Error::from(io::ErrorKind::StorageFull).into()) };
        let mut printing = Printing::default();
        let mut warned = |printed| printing.warning(printed).is_some();
        let printed = [Ok(()), full(), full(), Ok(()), Ok(()), full(), full()];
        assert_eq!(printed.map(&mut warned), [false, true, false, false, false, true, false]);
    }

    #[test]
    fn the_warning_names_the_cause() {
        let warning = Printing::default().warning(Err("no space left on device".into()));
        assert!(warning.is_some_and(|warning| warning.contains("no space left on device")));
    }
}
