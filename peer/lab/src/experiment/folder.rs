//! The folder that results go into: one experiment's, measured by one program.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::error::ExperimentError;
use super::materials::{Contents, Materials};
use super::program::Program;

/// What `run.json` says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct RunFile {
    seeds: u32,
    datasets: Materials,
    /// What was in them.
    #[serde(default)]
    contents: Contents,
    program: Program,
}

/// Makes the folder and writes down what is run in it: the experiment as given (`experiment.json5`), seeds, datasets, what is in them, and
/// program (`run.json`). Keeps others that ask for the same out of it, until what is returned is dropped; `None` where folders cannot be locked.
///
/// # Errors
/// [`ExperimentError::Busy`] where another run is under way in it; [`ExperimentError::Other`], [`ExperimentError::OtherPictures`] and [`ExperimentError::OtherProgram`] where something else was run in it;
/// [`ExperimentError::Read`] and [`ExperimentError::Write`].
pub fn claim(
    folder: &Path,
    text: &str,
    materials: &Materials,
    seeds: u32,
    program: &Program,
) -> Result<Option<File>, ExperimentError> {
    fs::create_dir_all(folder)
        .map_err(|source| ExperimentError::Write { path: folder.to_owned(), source })?;
    let alone = alone(folder)?;
    let (experiment, run) = (folder.join("experiment.json5"), folder.join("run.json"));
    let other = || ExperimentError::Other(folder.to_owned());
    if let Some(before) = read(&run)? {
        let before: RunFile = serde_json::from_str(&before).map_err(|_| other())?;
        if read(&experiment)?.as_deref() != Some(text) || before.datasets != *materials {
            return Err(other());
        }
        if before.contents != materials.contents()? {
            return Err(ExperimentError::OtherPictures(folder.to_owned()));
        }
        if before.program != *program {
            let (before, now) = (Box::new(before.program), Box::new(program.clone()));
            return Err(ExperimentError::OtherProgram { folder: folder.to_owned(), before, now });
        }
    } else if folder.join("results.csv").exists() {
        // Nobody knows what these were measured with.
        return Err(other());
    }
    let contents = materials.contents()?;
    let file = RunFile { seeds, datasets: materials.clone(), contents, program: program.clone() };
    let json = serde_json::to_string_pretty(&file).expect("names and numbers can be written as JSON");
    // The run last: where it is, the rest is.
    for (path, text) in [(experiment, text), (run, &format!("{json}\n"))] {
        gestalt_file::write(&path, text.as_bytes())
            .map_err(|source| ExperimentError::Write { path, source })?;
    }
    Ok(alone)
}

/// The folder itself is locked: a file in it would be one more that is no result.
fn alone(folder: &Path) -> Result<Option<File>, ExperimentError> {
    let Ok(held) = File::open(folder) else { return Ok(None) };
    let is_held =
        gestalt_file::hold(&held, Duration::ZERO).map_err(|_| ExperimentError::Busy(folder.to_owned()))?;
    Ok(is_held.then_some(held))
}

fn read(path: &Path) -> Result<Option<String>, ExperimentError> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(ExperimentError::Read { path: path.to_owned(), source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(eyes: u32) -> Program {
        Program { version: "1".to_owned(), eyes, minds: 0 }
    }

    #[test]
    fn a_folder_is_one_experiments_of_one_program() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new");
        let none = Materials::default();
        let claim = |text, materials: &Materials, program| super::claim(&path, text, materials, 2, &program);
        claim("{}", &none, program(1)).unwrap();
        claim("{}", &none, program(1)).unwrap();
        assert!(matches!(claim("{ }", &none, program(1)), Err(ExperimentError::Other(_))));
        let dataset = Materials { dataset: Some("hands".into()), start: None };
        assert!(matches!(claim("{}", &dataset, program(1)), Err(ExperimentError::Other(_))));
        let refused = claim("{}", &none, program(2)).unwrap_err();
        assert!(matches!(refused, ExperimentError::OtherProgram { .. }));
        assert!(
            refused.to_string().contains("eyes 00000001") && refused.to_string().contains("eyes 00000002")
        );
        std::fs::write(path.join("run.json"), "{").unwrap();
        assert!(matches!(claim("{}", &none, program(1)), Err(ExperimentError::Other(_))));
    }

    #[test]
    fn one_run_at_a_time_works_in_a_folder_and_nothing_is_left_of_that() {
        let folder = tempfile::tempdir().unwrap();
        let claim = || claim(folder.path(), "{}", &Materials::default(), 2, &program(1));
        let first = claim().unwrap();
        assert!(first.is_some());
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(files(), 2);
        let refused = claim().unwrap_err();
        assert!(matches!(refused, ExperimentError::Busy(_)), "{refused}");
        drop(first);
        claim().unwrap();
        assert_eq!(files(), 2);
    }

    #[test]
    fn what_was_measured_on_pictures_is_not_gone_on_with_on_changed_ones() {
        let folder = tempfile::tempdir().unwrap();
        let (set, path) = (folder.path().join("hands"), folder.path().join("new"));
        let write = |bytes: &str| {
            std::fs::create_dir_all(set.join("1")).unwrap();
            std::fs::write(set.join("1/a.png"), bytes).unwrap();
        };
        for seen in [true, false] {
            let materials =
                Materials { dataset: seen.then(|| set.clone()), start: (!seen).then(|| set.clone()) };
            let claim = || super::claim(&path, "{}", &materials, 2, &program(1));
            write("a hand");
            claim().unwrap();
            claim().unwrap();
            write("another");
            let refused = claim().unwrap_err();
            assert!(matches!(refused, ExperimentError::OtherPictures(_)), "{refused}");
            write("a hand");
            claim().unwrap();
            // As it was written before pictures were looked into: nobody knows which they were.
            let run = std::fs::read_to_string(path.join("run.json")).unwrap();
            let mut run: serde_json::Value = serde_json::from_str(&run).unwrap();
            run.as_object_mut().unwrap().remove("contents");
            std::fs::write(path.join("run.json"), run.to_string()).unwrap();
            assert!(matches!(claim(), Err(ExperimentError::OtherPictures(_))));
            std::fs::remove_dir_all(&path).unwrap();
        }
    }

    #[test]
    fn results_that_nobody_knows_the_origin_of_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("results.csv"), "my,own,table\n").unwrap();
        let claimed = claim(folder.path(), "{}", &Materials::default(), 2, &program(1));
        assert!(matches!(claimed, Err(ExperimentError::Other(_))));
    }
}
