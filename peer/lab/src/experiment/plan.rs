//! An experiment file: a base setting, what is varied, and how often.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::error::ExperimentError;
use super::results::Run;
use super::setting::{Drift, Method, Setting, Start};
use super::standing::Standing;
use gestalt_vision::camera_model::CameraModel;
use gestalt_vision::perception::FeatureSet;
use gestalt_vision::pose::Placement;
use gestalt_vision::source::Glove;
use gestalt_vision::vocabulary::GestureBook;

/// The most places that hands are looked at from.
pub(super) const MOST_PLACES: usize = 200;

/// What is asked, and how: a commented JSON5 file. See `configs/experiments/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// The question, for tables and plots.
    pub title: String,
    /// What stays the same: fields of a [`Setting`].
    pub base: Map<String, Value>,
    /// What is varied.
    pub axis: Axis,
    /// What is varied beside: the lines of the plot.
    #[serde(default)]
    pub lines: Option<Axis>,
    /// How robots see rendered hands.
    #[serde(default)]
    pub hands: Hands,
    /// How they see the photographs of a dataset.
    #[serde(default = "Hands::photographed")]
    pub photographs: Hands,
    /// How many seeds, unless the command line says otherwise.
    #[serde(default = "twenty")]
    pub seeds: u32,
}

fn twenty() -> u32 {
    20
}

/// What is varied, and through which values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// What it is called in tables and plots.
    pub name: String,
    /// The values, in order. The first is what the others are compared with.
    pub values: Vec<Choice>,
}

/// One value of an axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// What it is called; a number where values are to be plotted along a scale.
    pub name: String,
    /// Fields of the [`Setting`] by path, such as `"learning.share_fraction"`.
    pub set: Map<String, Value>,
}

/// What hands the robots see, and from where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Hands {
    /// How many places there are; each robot of a run stands at one drawn from them, and where robots are more, several do.
    pub places: usize,
    /// Where they lie around the hand.
    pub placement: Placement,
    /// The robots' camera: `footbot`, `parrot` or `laptop`.
    pub camera: String,
    /// What robots learn from: `shape`, `hog` or `embedding`. Embeddings are of learned eyes, which know bare hands.
    #[serde(skip_serializing_if = "is_shape")]
    pub features: FeatureSet,
    /// What the rendered hands wear.
    pub glove: Glove,
    /// A ready vocabulary that rendered hands show, by name: `spatial`, `rescue`. `None`: they count 0 to 5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vocabulary: Option<String>,
    /// How many people show each gesture, of rendered hands.
    pub people: usize,
    /// The most pictures of a gesture that are used of a dataset.
    pub pictures: usize,
    /// How many metres a dataset's picture is high.
    pub picture_height_m: f64,
}

fn is_shape(features: &FeatureSet) -> bool {
    *features == FeatureSet::Shape
}

impl Hands {
    /// Photographs are flat, so robots stand before them, not beside, with cameras that are no worse than those that
    /// took them.
    fn photographed() -> Self {
        let placement = Placement { half_deg: 30.0, elevation_deg: [-15.0, 10.0], distance_m: [0.6, 0.9] };
        Self { placement, camera: "laptop".to_owned(), ..Self::default() }
    }

    /// The vocabulary that rendered hands show; `None` where they count.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn book(&self) -> Result<Option<GestureBook>, ExperimentError> {
        let Some(name) = &self.vocabulary else { return Ok(None) };
        GestureBook::find(name).map(Some).map_err(|error| ExperimentError::Setting(error.to_string()))
    }

    fn check(&self) -> Result<(), ExperimentError> {
        let wrong = |what: &str| Err(ExperimentError::Setting(format!("hands or photographs: {what}")));
        if CameraModel::named(&self.camera).is_none() {
            return wrong("the camera is none of footbot, parrot and laptop");
        }
        if !(1..=MOST_PLACES).contains(&self.places) || !(4..=1000).contains(&self.people) {
            return wrong("choose 1 to 200 places and 4 to 1000 people");
        }
        if !(4..=1000).contains(&self.pictures) {
            return wrong("choose 4 to 1000 pictures of a gesture");
        }
        Ok(())
    }
}

impl Default for Hands {
    fn default() -> Self {
        Self {
            places: 24,
            placement: Placement::default(),
            camera: "footbot".to_owned(),
            features: FeatureSet::Shape,
            glove: Glove::Cyan,
            vocabulary: None,
            people: 36,
            pictures: 60,
            picture_height_m: 0.5,
        }
    }
}

/// One point of the grid that an experiment runs: a value of the axis on one of the lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// The line's name; empty where there is but one.
    pub line: String,
    /// The value's name.
    pub value: String,
    /// What is run.
    pub setting: Setting,
}

impl Cell {
    /// What its run with that seed is called.
    #[must_use]
    pub fn run(&self, seed: u64) -> Run {
        (self.line.clone(), self.value.clone(), seed)
    }

    /// Its runs, of the seeds from 0 up to `seeds`.
    #[must_use]
    pub fn runs<'a>(
        &self,
        all: &'a BTreeMap<Run, Vec<Standing>>,
        seeds: u32,
    ) -> BTreeMap<u64, &'a [Standing]> {
        (0..u64::from(seeds)).filter_map(|seed| Some((seed, all.get(&self.run(seed))?.as_slice()))).collect()
    }

    /// What it is called in tables that have no column for lines.
    #[must_use]
    pub fn name(&self) -> String {
        if self.line.is_empty() { self.value.clone() } else { format!("{}, {}", self.line, self.value) }
    }
}

impl Experiment {
    /// Whether a JSON5 text is meant as an experiment, and not as a scenario.
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        json5::from_str::<Map<String, Value>>(text).is_ok_and(|map| map.contains_key("axis"))
    }

    /// Reads an experiment from JSON5 text; `origin` names it in errors.
    ///
    /// # Errors
    /// See [`ExperimentError`].
    pub fn parse(text: &str, origin: &Path) -> Result<Self, ExperimentError> {
        let mut deserializer = json5::Deserializer::from_str(text);
        let experiment: Self = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
            let (key, cause) = (error.path().to_string(), error.inner().to_string());
            ExperimentError::Syntax { path: origin.to_owned(), key, cause }
        })?;
        experiment.validate()?;
        Ok(experiment)
    }

    fn validate(&self) -> Result<(), ExperimentError> {
        let wrong = |what: &str| Err(ExperimentError::Setting(what.to_owned()));
        if self.seeds == 0 || self.axis.values.is_empty() {
            return wrong("no seeds or no values: choose at least one of each");
        }
        self.hands.check()?;
        self.photographs.check()?;
        let cells = self.cells()?;
        let names: std::collections::BTreeSet<_> =
            cells.iter().map(|cell| (&cell.line, &cell.value)).collect();
        if names.len() < cells.len() {
            return wrong("two values of the same name: name them apart");
        }
        let mut named = names.iter().flat_map(|(line, value)| [*line, *value]).chain([&self.axis.name]);
        if named.any(|name| name.contains(|sign: char| sign == '|' || sign.is_control())) {
            return wrong("a name with a bar or a line break: write it without");
        }
        let drifts = cells.iter().map(|cell| cell.setting.drift).filter(|drift| *drift != Drift::None);
        if drifts.collect::<Vec<_>>().windows(2).any(|pair| pair[0] != pair[1]) {
            return wrong("two kinds of drift in one experiment: make two of it");
        }
        if self.hands.book()?.is_some()
            && cells
                .iter()
                .any(|cell| (cell.setting.start, cell.setting.reduction) != (Start::Nothing, Method::Pca))
        {
            return wrong(
                "robots know fingers that count, and no ready vocabulary: let them start from nothing, with reduction pca",
            );
        }
        cells.iter().try_for_each(|cell| cell.setting.scenario(2).map(drop))
    }

    /// What robots see: the photographs of a dataset where there is one.
    #[must_use]
    pub fn seen(&self, dataset: Option<&Path>) -> &Hands {
        if dataset.is_some() { &self.photographs } else { &self.hands }
    }

    /// All that is run, line by line.
    ///
    /// # Errors
    /// A field that no [`Setting`] has, or a value it cannot have.
    pub fn cells(&self) -> Result<Vec<Cell>, ExperimentError> {
        let only = [Choice { name: String::new(), set: Map::new() }];
        let lines = self.lines.as_ref().map_or(&only[..], |axis| &axis.values);
        let mut cells = Vec::new();
        for line in lines {
            for value in &self.axis.values {
                let mut setting = Value::Object(self.base.clone());
                for (path, new) in line.set.iter().chain(&value.set) {
                    set(&mut setting, path, new);
                }
                let named = |cause: serde_json::Error| {
                    ExperimentError::Setting(format!("{} {}: {cause}", line.name, value.name))
                };
                let setting = serde_json::from_value(setting).map_err(named)?;
                cells.push(Cell { line: line.name.clone(), value: value.name.clone(), setting });
            }
        }
        Ok(cells)
    }

    /// How many robots the largest swarm has.
    ///
    /// # Errors
    /// See [`Self::cells`].
    pub fn most_robots(&self) -> Result<usize, ExperimentError> {
        Ok(self.cells()?.iter().map(|cell| cell.setting.robots).max().unwrap_or(0))
    }

    /// The drift of those settings that have one.
    #[must_use]
    pub fn drift(&self) -> Drift {
        let cells = self.cells().unwrap_or_default();
        cells.iter().map(|cell| cell.setting.drift).find(|drift| *drift != Drift::None).unwrap_or_default()
    }
}

/// Puts a value where a path of keys, joined by dots, leads to.
fn set(object: &mut Value, path: &str, new: &Value) {
    let mut place = object;
    for key in path.split('.') {
        if !place.is_object() {
            *place = Value::Object(Map::new());
        }
        let Value::Object(map) = place else { return };
        place = map.entry(key).or_insert(Value::Null);
    }
    *place = new.clone();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Experiment, ExperimentError> {
        Experiment::parse(text, Path::new("test"))
    }

    const SHARING: &str = "{ title: 't', base: { rounds: 3, learning: { keep: 2 } },
        axis: { name: 'B', values: [
            { name: '0', set: { 'learning.share_fraction': 0 } }, { name: '1', set: { 'learning.share_fraction': 1 } } ] },
        lines: { name: 'size', values: [ { name: 'few', set: { robots: 2 } }, { name: 'many', set: { robots: 9 } } ] } }";

    #[test]
    fn each_value_is_run_on_each_line() {
        let cells = parse(SHARING).unwrap().cells().unwrap();
        let seen: Vec<_> = cells
            .iter()
            .map(|cell| {
                (&*cell.line, &*cell.value, cell.setting.robots, cell.setting.learning.share_fraction)
            })
            .collect();
        assert_eq!(
            seen,
            [("few", "0", 2, 0.0), ("few", "1", 2, 1.0), ("many", "0", 9, 0.0), ("many", "1", 9, 1.0)]
        );
        assert!(cells.iter().all(|cell| cell.setting.rounds == 3 && cell.setting.learning.keep == 2));
    }

    #[test]
    fn what_no_setting_has_is_named() {
        for (from, to, named) in [
            ("rounds: 3", "round: 3", "round"),
            ("'learning.share_fraction': 0", "'learning.sharefraction': 0", "sharefraction"),
            ("'learning.share_fraction': 0", "'learning.share_fraction': 2", "share_fraction"),
            ("robots: 2", "robots: 0", "robots"),
            ("name: '1'", "name: '0'", "same name"),
            ("name: 'B'", "name: 'a|b'", "with a bar"),
            ("name: '1'", "name: 'a|b'", "with a bar"),
            ("title: 't'", "titel: 't'", "titel"),
            ("title: 't'", "title: 't', hands: { vocabulary: 'semaphore' }", "spatial, rescue"),
            (
                "title: 't', base: {",
                "title: 't', hands: { vocabulary: 'rescue' }, base: { start: 'model',",
                "from nothing",
            ),
        ] {
            let error = parse(&SHARING.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(named), "{error}");
        }
    }

    #[test]
    fn every_shipped_experiment_can_be_run_with_twenty_seeds_or_more() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/experiments");
        let mut found = 0;
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(Experiment::is_one(&text), "{}", path.display());
            let experiment = Experiment::parse(&text, &path).unwrap();
            assert!(experiment.seeds >= 20, "{}", path.display());
            found += 1;
        }
        assert!(found >= 12);
    }
}
