//! The count of the last word that was said with a client's key, kept beside that key: robots heed no word whose count is not higher than the last
//! one's, so a clock that was set back would silence the client until it has caught up.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::words::next_count;

/// From here on nothing is counted further: the last second that a count can show.
const USED_UP: u64 = u64::MAX - (1 << 32);

/// Counts the words of one client.
#[derive(Debug)]
pub(crate) struct WordCount {
    /// Where the last count stands, also for other programs with this key; `None` where this one alone knows it.
    file: Option<PathBuf>,
    said: Mutex<Said>,
}

#[derive(Debug, Default)]
struct Said {
    last: u64,
    /// It was told that the file is of no use, which it may be at every word.
    is_told: bool,
}

impl WordCount {
    pub fn new(file: Option<PathBuf>) -> Self {
        Self { file, said: Mutex::default() }
    }

    /// The count of the next word. Where the file cannot be read or written the clock and this program's own words have to do, and the log says so.
    pub fn next(&self) -> u64 {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(file) = &self.file else {
            said.last = next_count(said.last);
            return said.last;
        };
        // Of two programs that speak at once the second counts on from the first.
        let alone = gestalt_file::lock(file);
        let before = last_in(file);
        said.last = next_count(said.last.max(*before.as_ref().unwrap_or(&0)));
        let kept = gestalt_file::replace(file, format!("{}\n", said.last).as_bytes());
        drop(alone);
        if let Err(error) = before.and(kept)
            && !std::mem::replace(&mut said.is_told, true)
        {
            tracing::warn!(
                "the count of the last word is not kept in {}: {error}: robots heed no word of this key that is said while the clock is behind an \
                 earlier one's",
                file.display()
            );
        }
        said.last
    }
}

/// The count that stands in that file; 0 where there is none yet.
fn last_in(file: &Path) -> io::Result<u64> {
    match gestalt_file::open(file).and_then(io::read_to_string) {
        Ok(text) => match text.trim().parse() {
            Ok(count) if count < USED_UP => Ok(count),
            Ok(_) => Err(io::Error::other("it has the last count there is")),
            Err(error) => Err(io::Error::other(error)),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;

    use super::*;

    /// An hour of the clock.
    const HOUR: u64 = 3600 << 32;

    #[test]
    fn counts_of_one_key_grow_whatever_program_speaks_and_whatever_the_clock_shows() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("client-desk.words");
        // Of a clock that was ahead, or right; none; and no count.
        for last in [Some(next_count(0) + HOUR), Some(next_count(0) - HOUR), None] {
            match last {
                Some(count) => fs::write(&file, format!("{count}\n")).unwrap(),
                None => fs::remove_file(&file).unwrap(),
            }
            let (clock, one) = (next_count(0), WordCount::new(Some(file.clone())));
            let counts = [one.next(), one.next(), WordCount::new(Some(file.clone())).next(), one.next()];
            assert!(counts.is_sorted_by(|one, next| one < next), "{counts:?}");
            assert!(
                counts[0] >= clock && last.is_none_or(|last| counts[0] > last),
                "{counts:?} after {last:?}"
            );
        }
    }

    #[test]
    fn what_is_no_count_is_not_counted_on_from_and_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("client-desk.words");
        for text in ["", "nonsense", "-7", "18446744073709551615", "99999999999999999999"] {
            fs::write(&file, text).unwrap();
            let first = WordCount::new(Some(file.clone())).next();
            assert!(first.abs_diff(next_count(0)) < HOUR, "{text}");
            assert!(WordCount::new(Some(file.clone())).next() > first, "{text}");
        }
    }

    #[test]
    fn where_nothing_can_be_kept_a_program_counts_its_own_words() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("taken");
        fs::create_dir(&taken).unwrap();
        for file in [None, Some(folder.path().join("none/client-desk.words")), Some(taken)] {
            let count = WordCount::new(file.clone());
            let counts: Vec<u64> = (0..20).map(|_| count.next()).collect();
            assert!(counts.is_sorted_by(|one, next| one < next), "{file:?}");
        }
    }

    #[test]
    fn of_words_said_at_once_no_two_have_one_count() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("client-desk.words");
        // By a clock that was ahead, so that none of them shows the time.
        fs::write(&file, (next_count(0) + HOUR).to_string()).unwrap();
        let counts: Vec<u64> = std::thread::scope(|scope| {
            let programs: Vec<_> = (0..8)
                .map(|_| {
                    let count = WordCount::new(Some(file.clone()));
                    scope.spawn(move || count.next())
                })
                .collect();
            programs.into_iter().map(|program| program.join().unwrap()).collect()
        });
        assert_eq!(counts.iter().collect::<BTreeSet<_>>().len(), 8, "{counts:?}");
    }
}
