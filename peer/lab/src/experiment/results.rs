//! What was measured, in a file that survives an interruption.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::ExperimentError;
use super::trial::Standing;

/// Names a run: line, value, seed.
pub type Run = (String, String, u64);

const HEAD: &str = "line,value,seed,round,single,swarm,majority,published_bytes,link_bytes,samples";

/// `results.csv`: all rounds of each run that ended.
#[derive(Debug)]
pub struct Results {
    path: PathBuf,
    file: File,
    /// The standings of each run, from before the first round on.
    pub runs: BTreeMap<Run, Vec<Standing>>,
}

impl Results {
    /// Opens or begins the results in `folder`. What an interruption left half-written is dropped.
    ///
    /// # Errors
    /// [`ExperimentError::Read`], [`ExperimentError::Write`], or [`ExperimentError::Other`] for a file of another layout.
    pub fn open(folder: &Path) -> Result<Self, ExperimentError> {
        let path = folder.join("results.csv");
        let failed = |source| ExperimentError::Write { path: path.clone(), source };
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(source) => return Err(ExperimentError::Read { path, source }),
        };
        let mut runs: BTreeMap<Run, Vec<Standing>> = BTreeMap::new();
        let mut lines = text.lines();
        if lines.next().is_some_and(|head| head != HEAD) {
            return Err(ExperimentError::Other(folder.to_owned()));
        }
        // A line without its end may be cut in the midst of a number.
        let whole = text.rfind('\n').map_or("", |end| &text[..end]);
        for (run, standing) in whole.lines().skip(1).filter_map(parse) {
            runs.entry(run).or_default().push(standing);
        }
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(failed)?;
        Ok(Self { path, file, runs })
    }

    /// Keeps only these runs, if they have as many rounds as they should: the file is written anew.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn keep_whole(&mut self, rounds: impl Fn(&Run) -> Option<u32>) -> Result<(), ExperimentError> {
        self.runs.retain(|run, standings| {
            let numbered = standings.iter().map(|standing| standing.round);
            rounds(run).is_some_and(|rounds| numbered.eq(0..=rounds))
        });
        let mut text = format!("{HEAD}\n");
        self.runs.iter().for_each(|(run, standings)| text.push_str(&lines(run, standings)));
        let failed = |source| ExperimentError::Write { path: self.path.clone(), source };
        let new = self.path.with_extension("new");
        std::fs::write(&new, text).and_then(|()| std::fs::rename(&new, &self.path)).map_err(failed)?;
        self.file = OpenOptions::new().append(true).open(&self.path).map_err(failed)?;
        Ok(())
    }

    /// Writes down a run that has ended.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn add(&mut self, run: Run, standings: Vec<Standing>) -> Result<(), ExperimentError> {
        let failed = |source| ExperimentError::Write { path: self.path.clone(), source };
        self.file.write_all(lines(&run, &standings).as_bytes()).map_err(failed)?;
        self.runs.insert(run, standings);
        Ok(())
    }
}

fn lines((line, value, seed): &Run, standings: &[Standing]) -> String {
    let line = |s: &Standing| {
        let Standing { round, single, swarm, majority, published, on_links, samples } = s;
        format!(
            "{line},{value},{seed},{round},{single:.6},{swarm:.6},{majority:.6},{published:.1},{on_links:.1},{samples:.2}\n"
        )
    };
    standings.iter().map(line).collect()
}

fn parse(line: &str) -> Option<(Run, Standing)> {
    let fields: Vec<&str> = line.split(',').collect();
    let [line, value, seed, round, numbers @ ..] = fields.as_slice() else { return None };
    let numbers: Option<Vec<f64>> = numbers.iter().map(|number| number.parse().ok()).collect();
    let [single, swarm, majority, published, on_links, samples] = numbers?.try_into().ok()?;
    let run = ((*line).to_owned(), (*value).to_owned(), seed.parse().ok()?);
    let round = round.parse().ok()?;
    Some((run, Standing { round, single, swarm, majority, published, on_links, samples }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standings(rounds: u32) -> Vec<Standing> {
        let standing = |round| Standing {
            round,
            single: 0.25,
            swarm: 0.5,
            majority: 0.75,
            published: 10.5,
            on_links: 20.0,
            samples: 3.0,
        };
        (0..=rounds).map(standing).collect()
    }

    fn run(seed: u64) -> Run {
        ("a".to_owned(), "0.5".to_owned(), seed)
    }

    #[test]
    fn what_was_written_is_read_again_and_what_was_cut_short_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        let mut results = Results::open(folder.path()).unwrap();
        results.keep_whole(|_| Some(2)).unwrap();
        results.add(run(0), standings(2)).unwrap();
        results.add(run(1), standings(2)).unwrap();
        let whole = std::fs::read_to_string(&path).unwrap();
        // In the midst of the second run: 0.25 is cut to 0.2 of another round.
        for cut in [10, 80, 100] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let mut again = Results::open(folder.path()).unwrap();
            again.keep_whole(|_| Some(2)).unwrap();
            assert_eq!(again.runs, [(run(0), standings(2))].into(), "{cut}");
            again.add(run(1), standings(2)).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
        }
    }

    #[test]
    fn runs_of_other_settings_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let mut results = Results::open(folder.path()).unwrap();
        results.keep_whole(|_| None).unwrap();
        results.add(run(0), standings(2)).unwrap();
        let mut again = Results::open(folder.path()).unwrap();
        again.keep_whole(|_| Some(3)).unwrap();
        assert!(again.runs.is_empty(), "another number of rounds");
    }

    #[test]
    fn a_file_that_is_none_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("results.csv"), "my,own,table\n1,2,3\n").unwrap();
        assert!(matches!(Results::open(folder.path()), Err(ExperimentError::Other(_))));
    }
}
