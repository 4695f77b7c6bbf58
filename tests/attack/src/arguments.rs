//! What is to be played: `attack [NUMBER…] [--seeds N]`.

use crate::attack::Attack;

/// Which attacks, all where no number is named, and with how many seeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arguments {
    /// The numbers of the table.
    pub numbers: Vec<String>,
    /// How many seeds.
    pub seeds: u64,
}

impl Arguments {
    /// Reads the arguments of the program.
    ///
    /// # Errors
    /// Whatever names nothing that could be played, so that no table without a line passes for one in which all is well.
    pub fn read(arguments: impl IntoIterator<Item = String>) -> Result<Self, String> {
        let mut read = Self { numbers: Vec::new(), seeds: 20 };
        let all = crate::all();
        let mut arguments = arguments.into_iter();
        while let Some(argument) = arguments.next() {
            if argument == "--seeds" {
                let given = arguments.next().and_then(|seeds| seeds.parse().ok());
                read.seeds = given.filter(|seeds| *seeds > 0).ok_or("--seeds needs a number above 0")?;
            } else if all.iter().any(|attack| attack.is_of(&argument)) {
                read.numbers.push(argument);
            } else {
                return Err(format!(
                    "'{argument}' is no number of an attack: `attack` without one plays all, and prints their numbers; \
                     --seeds N plays so many seeds of each"
                ));
            }
        }
        Ok(read)
    }
}

impl Attack {
    /// Whether that is its number, or one of them.
    #[must_use]
    pub fn is_of(&self, number: &str) -> bool {
        self.number.split(" · ").any(|own| own == number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_names_no_attack_is_refused() {
        let read = |text: &str| Arguments::read(text.split_whitespace().map(str::to_owned));
        let of = |numbers: &[&str], seeds| {
            Ok(Arguments { numbers: numbers.iter().map(|n| (*n).to_owned()).collect(), seeds })
        };
        assert_eq!(read(""), of(&[], 20));
        assert_eq!(read("A5 10 --seeds 3"), of(&["A5", "10"], 3));
        for wrong in ["A77", "10 A77", "--seed 3", "--help", "--seeds", "--seeds x", "--seeds 0", "·"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
