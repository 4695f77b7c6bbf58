//! `results.csv`: a table that grows run by run and survives an interruption.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::ExperimentError;

/// Rows in a file. Numbers are written so that they are read as what they were.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    file: File,
}

impl Ledger {
    /// Opens the table in a folder, or begins it, and gives the rows of it that `keep` wants, from all that were written
    /// whole. The file then holds just these.
    ///
    /// # Errors
    /// [`ExperimentError::Read`], [`ExperimentError::Write`], or [`ExperimentError::Table`] for a file of another layout.
    pub fn open<R: Serialize + DeserializeOwned>(
        folder: &Path,
        keep: impl FnOnce(Vec<R>) -> Vec<R>,
    ) -> Result<(Self, Vec<R>), ExperimentError> {
        let path = folder.join("results.csv");
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            Err(source) => return Err(ExperimentError::Read { path, source }),
        };
        // A row without its end may be cut in the midst of a number. No name has a line break.
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let rows =
            csv::Reader::from_reader(whole.as_bytes()).into_deserialize().collect::<Result<Vec<R>, _>>();
        let rows = keep(rows.map_err(|cause| ExperimentError::Table { path: path.clone(), cause })?);
        let file = write_anew(&path, &rows)?;
        Ok((Self { path, file }, rows))
    }

    /// Adds the rows of a run that has ended; they are on the disk when this returns.
    ///
    /// # Errors
    /// [`ExperimentError::Write`]; the table is as it was.
    pub fn add<R: Serialize>(&mut self, rows: &[R]) -> Result<(), ExperimentError> {
        let added = all_or_nothing(&self.file, |mut file, begins| file.write_all(&written(rows, begins)?));
        added.map_err(|source| ExperimentError::Write { path: self.path.clone(), source })
    }

    /// Writes the whole table anew: its rows in the order that they are given in.
    ///
    /// # Errors
    /// [`ExperimentError::Write`].
    pub fn finish<R: Serialize>(self, rows: &[R]) -> Result<(), ExperimentError> {
        write_anew(&self.path, rows).map(drop)
    }
}

/// Adds to a file what `write` writes, which is told whether that begins it. Where the disk is full in the midst of a row, another thread's rows would be
/// added behind that half, and nothing of the table could be read any more.
fn all_or_nothing(file: &File, write: impl FnOnce(&File, bool) -> io::Result<()>) -> io::Result<()> {
    let before = file.metadata()?.len();
    write(file, before == 0).and_then(|()| file.sync_data()).inspect_err(|_| drop(file.set_len(before)))
}

fn write_anew<R: Serialize>(path: &Path, rows: &[R]) -> Result<File, ExperimentError> {
    let written = written(rows, true)
        .and_then(|text| gestalt_file::write(path, &text))
        .and_then(|()| OpenOptions::new().append(true).open(path));
    written.map_err(|source| ExperimentError::Write { path: path.to_owned(), source })
}

/// The rows as text, under their head where they begin the table.
fn written<R: Serialize>(rows: &[R], begins: bool) -> io::Result<Vec<u8>> {
    let mut writer = csv::WriterBuilder::new().has_headers(begins).from_writer(Vec::new());
    rows.iter().try_for_each(|row| writer.serialize(row)).map_err(io::Error::other)?;
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Row {
        name: String,
        seed: u64,
        share: f64,
        seconds: Option<f64>,
    }

    fn row(name: &str, seed: u64) -> Row {
        let share = 1.0 / 3.0 + seed as f64;
        Row { name: name.to_owned(), seed, share, seconds: (seed > 0).then_some(0.1) }
    }

    fn open(folder: &Path) -> (Ledger, Vec<Row>) {
        Ledger::open(folder, |rows| rows).unwrap()
    }

    #[test]
    fn rows_are_read_as_they_were_written_whatever_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let rows = [row("plain", 0), row("a, b", 1), row("\"quoted\"", 2), row(" spaced ", 3), row("三", 4)];
        let (mut ledger, none) = open(folder.path());
        assert!(none.is_empty());
        ledger.add(&rows[..2]).unwrap();
        ledger.add(&rows[2..]).unwrap();
        assert_eq!(open(folder.path()).1, rows);
        ledger.finish(&rows[3..]).unwrap();
        assert_eq!(open(folder.path()).1, rows[3..]);
    }

    #[test]
    fn what_an_interruption_left_half_written_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        let (mut ledger, _) = open(folder.path());
        ledger.add(&[row("a", 0), row("a", 1), row("b, c", 2)]).unwrap();
        let whole = std::fs::read_to_string(&path).unwrap();
        let last = whole.trim_end().rfind('\n').unwrap();
        for end in last + 1..whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            let (mut again, rows) = open(folder.path());
            assert_eq!(rows, [row("a", 0), row("a", 1)], "{end}");
            again.add(&[row("b, c", 2)]).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), whole, "{end}");
        }
    }

    #[test]
    fn of_rows_for_which_there_was_no_room_nothing_is_left_before_those_of_the_next_run() {
        let folder = tempfile::tempdir().unwrap();
        let (mut ledger, _) = open(folder.path());
        ledger.add(&[row("a", 0)]).unwrap();
        let full = all_or_nothing(&ledger.file, |mut file, _| {
            file.write_all(b"\"b, c\",1,0.3")?;
            Err(io::ErrorKind::StorageFull.into())
        });
        assert_eq!(full.unwrap_err().kind(), io::ErrorKind::StorageFull);
        ledger.add(&[row("d", 2)]).unwrap();
        assert_eq!(open(folder.path()).1, [row("a", 0), row("d", 2)]);
    }

    #[test]
    fn a_file_of_another_layout_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.csv");
        std::fs::write(&path, "my,own,table\n1,2,3\n").unwrap();
        let refused = Ledger::open(folder.path(), |rows: Vec<Row>| rows);
        assert!(matches!(refused, Err(ExperimentError::Table { .. })));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "my,own,table\n1,2,3\n");
    }
}
