//! Which sets of pictures there are, where they lie, and what their folders show.

use std::path::{Path, PathBuf};

use thiserror::Error;

const SETS: &str = include_str!("../truth/sets.csv");
const GESTURES: &str = include_str!("../truth/gestures.csv");

/// The folder of a set in which no hand is raised.
pub const NONE: &str = "none";

/// A line that says nothing.
#[derive(Debug, Error)]
#[error("this line of the truth is damaged: {0}")]
pub struct Damaged(pub String);

/// What the pictures of a set show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shows {
    /// Hands that raise 0 to 5 fingers, each often enough to be judged by.
    Counts,
    /// Hands, of some counts or of none.
    Gestures,
    /// No raised hand.
    Nothing,
}

/// One set, and how often its pictures are taken.
#[derive(Clone, Debug)]
pub struct Set {
    pub name: String,
    pub shows: Shows,
    /// There is more in the pictures than the hand.
    pub surroundings: bool,
    /// For scenes.
    pub scenes: f32,
    /// For what the counter is shown.
    pub counter: f32,
}

/// Which fingers the hands of a folder raise; set `None`: of any set.
struct Gesture {
    set: Option<String>,
    folder: String,
    fingers: [bool; 5],
}

/// All sets that the truth knows, and the folders in which they may be.
pub struct Sets {
    pub all: Vec<Set>,
    gestures: Vec<Gesture>,
    folders: Vec<PathBuf>,
}

fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter(|line| !line.starts_with('#') && !line.is_empty())
}

fn set(line: &str) -> Option<Set> {
    let [name, shows, surroundings, scenes, counter] = line.split(',').collect::<Vec<_>>().try_into().ok()?;
    let shows = match shows {
        "counts" => Shows::Counts,
        "gestures" => Shows::Gestures,
        "nothing" => Shows::Nothing,
        _ => return None,
    };
    let surroundings = match surroundings {
        "yes" => true,
        "no" => false,
        _ => return None,
    };
    let share = |text: &str| text.parse().ok().filter(|share: &f32| share.is_finite() && *share >= 0.0);
    Some(Set { name: name.to_owned(), shows, surroundings, scenes: share(scenes)?, counter: share(counter)? })
}

fn gesture(line: &str) -> Option<Gesture> {
    let [set, folder, bits @ ..]: [&str; 7] = line.split(',').collect::<Vec<_>>().try_into().ok()?;
    let mut fingers = [false; 5];
    for (finger, bit) in fingers.iter_mut().zip(bits) {
        *finger = match bit {
            "0" => false,
            "1" => true,
            _ => return None,
        };
    }
    Some(Gesture { set: (set != "*").then(|| set.to_owned()), folder: folder.to_owned(), fingers })
}

impl Sets {
    /// Those of the truth; each is looked for in these folders, in order.
    ///
    /// # Errors
    /// A line of the truth that says nothing.
    pub fn in_folders(folders: &[PathBuf]) -> Result<Self, Damaged> {
        fn read<T>(text: &str, one: fn(&str) -> Option<T>) -> Result<Vec<T>, Damaged> {
            lines(text).map(|line| one(line).ok_or_else(|| Damaged(line.to_owned()))).collect()
        }
        Ok(Self { all: read(SETS, set)?, gestures: read(GESTURES, gesture)?, folders: folders.to_vec() })
    }

    /// The names of those that show all counts.
    pub fn counted(&self) -> impl Iterator<Item = &str> {
        self.all.iter().filter(|set| set.shows == Shows::Counts).map(|set| set.name.as_str())
    }

    /// Its number among all.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.all.iter().position(|set| set.name == name)
    }

    /// Where a set lies, whether the truth knows it or not.
    pub fn folder(&self, name: &str) -> Option<PathBuf> {
        self.folders.iter().map(|folder| folder.join(name)).find(|folder| folder.is_dir())
    }

    /// Where a picture lies: its path begins with its set.
    pub fn picture(&self, path: &str) -> PathBuf {
        let (name, rest) = path.split_once('/').unwrap_or((path, ""));
        self.folder(name).unwrap_or_else(|| Path::new(name).to_owned()).join(rest)
    }

    /// How many fingers the hands of a folder raise, `None` for other gestures; and which, where that is known.
    pub fn meaning(&self, set: &str, folder: &str) -> (Option<u8>, Option<[bool; 5]>) {
        let of = |name: Option<&str>| {
            self.gestures.iter().find(|known| known.set.as_deref() == name && known.folder == folder)
        };
        if let Some(Gesture { fingers, .. }) = of(Some(set)).or_else(|| of(None)) {
            return (Some(fingers.iter().map(|finger| u8::from(*finger)).sum()), Some(*fingers));
        }
        let digits = folder.bytes().take_while(u8::is_ascii_digit).count();
        (folder[..digits].parse().ok().filter(|count| *count < 6), None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_truth_belongs_to_a_set() {
        let sets = Sets::in_folders(&[]).unwrap();
        for line in lines(include_str!("../truth/hands.csv")).chain(lines(include_str!("../truth/faces.csv")))
        {
            let name = line.split('/').next().unwrap();
            assert!(sets.number(name).is_some(), "{name}");
        }
        assert!(sets.counted().count() >= 5);
    }

    #[test]
    fn a_folder_says_the_count_and_where_it_can_the_fingers() {
        let sets = Sets::in_folders(&[]).unwrap();
        let three = Some([false, true, true, true, false]);
        assert_eq!(sets.meaning("asl-digits", "6"), (Some(3), three), "a sign that raises three fingers");
        assert_eq!(sets.meaning("phone_home", "3"), (Some(3), None), "any three");
        assert_eq!(sets.meaning("phone_home", "5"), (Some(5), Some([true; 5])));
        assert_eq!(sets.meaning("asl_letters", "1_little").0, Some(1));
        assert_eq!(sets.meaning("asl_letters", "call"), (None, None));
        assert_eq!(sets.meaning("asl_letters", "7"), (None, None));
    }

    #[test]
    fn damaged_lines_are_told_from_good_ones() {
        assert!(set("rooms,nothing,yes,1.0,0").is_some_and(|set| set.shows == Shows::Nothing));
        for bad in ["rooms", "rooms,walls,yes,1,0", "rooms,nothing,maybe,1,0", "rooms,nothing,yes,-1,0"] {
            assert!(set(bad).is_none(), "{bad}");
        }
        assert!(gesture("*,5,1,1,1,1,1").is_some());
        assert!(gesture("*,5,1,1,1,1").is_none() && gesture("*,5,1,1,1,1,2").is_none());
    }
}
