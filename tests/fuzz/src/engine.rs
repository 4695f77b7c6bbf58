//! A fuzzer of a few lines, for where no compiler instruments the code: it is not guided by coverage, but by the form of the inputs.

use std::fs;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::mutate::mutate;
use crate::targets::Target;

/// Inputs that are tried, one after the other: the same seed gives the same ones.
#[derive(Debug)]
pub struct Fuzzer {
    target: Target,
    corpus: Vec<Vec<u8>>,
    rng: ChaCha8Rng,
    input: Vec<u8>,
}

impl Fuzzer {
    /// One that begins with these inputs.
    #[must_use]
    pub fn new(target: Target, corpus: Vec<Vec<u8>>, seed: u64) -> Self {
        Self { target, corpus, rng: ChaCha8Rng::seed_from_u64(seed), input: Vec::new() }
    }

    /// Tries one input: a new one of the form that is expected, or one of the corpus, each mostly changed.
    ///
    /// # Errors
    /// The input, if the target panics.
    pub fn step(&mut self) -> Result<(), Vec<u8>> {
        let rng = &mut self.rng;
        let known = self.corpus.len();
        if known == 0 || rng.random_range(0..4) == 0 {
            self.input = self.target.seed(rng);
        } else {
            self.input.clear();
            self.input.extend(&self.corpus[rng.random_range(0..known)]);
        }
        if rng.random_range(0..16) != 0 {
            let other = match known {
                0 => &[][..],
                known => &self.corpus[rng.random_range(0..known)],
            };
            mutate(&mut self.input, other, rng);
        }
        if passes(self.target, &self.input) { Ok(()) } else { Err(self.input.clone()) }
    }
}

/// Tries one input. If the target panics, the panic hook has said why.
#[must_use]
pub fn passes(target: Target, input: &[u8]) -> bool {
    catch_unwind(AssertUnwindSafe(|| target.run(input))).is_ok()
}

/// Writes an input that failed into a folder, under a name that its bytes give it.
///
/// # Errors
/// Those of the file system.
pub fn keep(folder: &Path, target: Target, input: &[u8]) -> io::Result<PathBuf> {
    let mut hash = gestalt_protocol::Fnv1a::default();
    hash.add(input.iter().copied());
    let path = folder.join(format!("{target}-{:016x}", hash.hash()));
    fs::create_dir_all(folder)?;
    fs::write(&path, input)?;
    Ok(path)
}
