//! What the rules of selection and forgetting pick among the same points of the plane.
//!
//! The rules themselves pick, in training sets as robots have them; only the points are made up, from a fixed seed.

mod drawing;

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use gestalt_protocol::{ClassId, RobotId, RoundId, SampleId};
use gestalt_strategies::{
    Classifier, Classify, Components, FeatureSpace, ForgettingRule, HeldSample, Learner, LearnerOptions,
    ScalingMethod, SelectionRule, SetChange, TrainingSet, Vocabulary,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use gestalt_draw::DrawError;

const SEED: u64 = 4;
/// How many samples are shared.
const SHARED: usize = 8;
/// How many samples are forgotten.
const FORGOTTEN: usize = 12;
const ME: RobotId = RobotId(1);
const ROUND: RoundId = RoundId { counter: 1, opener: ME, life: 0 };

/// Which rules to explain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// Which samples are shared.
    Selection,
    /// Which samples are forgotten.
    Forgetting,
}

/// A sample of the example.
struct Point {
    at: [f32; 2],
    class: ClassId,
    common: bool,
}

/// What one rule picks.
struct Panel {
    title: &'static str,
    caption: String,
    /// The points picked, in their order.
    picks: Vec<usize>,
    /// Which point a pick was compared to.
    ties: Vec<(usize, usize)>,
    /// Means that the rule looks at.
    means: Vec<([f32; 2], ClassId)>,
    /// Where the classifier is undecided, as pieces of a line.
    boundary: Vec<[[f32; 2]; 2]>,
}

impl Panel {
    fn new(title: &'static str, caption: &str) -> Self {
        let caption = caption.to_owned();
        Self { title, caption, picks: Vec::new(), ties: Vec::new(), means: Vec::new(), boundary: Vec::new() }
    }
}

/// Draws what each rule picks as an SVG or PNG file, by its name.
///
/// # Errors
/// See [`DrawError`].
pub fn draw(subject: Subject, path: &Path) -> Result<(), DrawError> {
    gestalt_draw::check(path)?;
    let svg = svg(subject).map_err(|cause| DrawError::Svg(cause.to_string()))?;
    gestalt_draw::write(&svg, path)
}

fn svg(subject: Subject) -> Result<String, Box<dyn Error>> {
    match subject {
        Subject::Selection => {
            let points = points(&KNOWN_IN_PART);
            let learned = Learned::from(&points)?;
            let panels: Result<Vec<_>, _> =
                SelectionRule::ALL.into_iter().map(|rule| shared(rule, &points, &learned)).collect();
            drawing::selection(&points, &panels?)
        }
        Subject::Forgetting => {
            let points = points(&ONE_CLASS_LARGER);
            let room = points.len() - FORGOTTEN;
            let all = Panel::new("all that came", &format!("{} samples, of which {room} fit", points.len()));
            let rules = ForgettingRule::ALL.into_iter().map(|rule| forgotten(rule, &points));
            drawing::forgetting(&points, &[all].into_iter().chain(rules).collect::<Vec<_>>())
        }
    }
}

/// A group of points: class, whether the swarm knows them, how many, centre, spread along x and y.
type Group = (u8, bool, usize, [f32; 2], [f32; 2]);

/// Each class has a part that the swarm knows, and one that only this robot has seen.
const KNOWN_IN_PART: [Group; 7] = [
    (0, true, 7, [-2.0, 0.9], [0.4, 0.6]),
    (0, false, 9, [-1.2, -0.2], [0.6, 0.7]),
    (0, false, 6, [-0.3, 2.2], [0.6, 0.4]),
    (1, true, 6, [2.1, 0.7], [0.4, 0.5]),
    (1, false, 9, [1.2, -0.4], [0.6, 0.6]),
    (1, false, 5, [0.1, -2.2], [0.5, 0.3]),
    (1, false, 1, [2.6, -2.5], [0.0, 0.0]),
];

/// One class comes more often than the other.
const ONE_CLASS_LARGER: [Group; 5] = [
    (0, false, 20, [-1.3, 0.9], [0.7, 0.9]),
    (0, false, 9, [-0.3, -1.8], [0.7, 0.4]),
    (0, false, 1, [-2.7, -2.6], [0.0, 0.0]),
    (1, false, 14, [1.7, 0.1], [0.6, 0.8]),
    (1, false, 4, [1.0, 2.4], [0.6, 0.3]),
];

/// The points of these groups, in the order in which they come: the known ones first, the rest at random.
fn points(groups: &[Group]) -> Vec<Point> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut points: Vec<(bool, u64, Point)> = Vec::new();
    for &(class, common, count, centre, spread) in groups {
        let full = points.len() + count;
        while points.len() < full {
            // About a normal variable: the sum of twelve uniform ones.
            let mut normal = || (0..12).map(|_| rng.random_range(-0.5_f32..0.5)).sum::<f32>();
            let at = [0, 1].map(|j| centre[j] + spread[j] * normal());
            // Apart enough for their numbers to be read.
            let apart = |(.., other): &(bool, u64, Point)| distance(other.at, at) > 0.3;
            if points.iter().all(apart) {
                points.push((!common, rng.random(), Point { at, class: ClassId(class.into()), common }));
            }
        }
    }
    points.sort_by_key(|(later, order, _)| (*later, *order));
    points.into_iter().map(|(.., point)| point).collect()
}

/// A classifier of the points, and their feature space: it only moves, turns and scales them all alike, so what is
/// near in the picture is near to the rules.
struct Learned {
    space: Arc<FeatureSpace>,
    classifier: Arc<Classifier>,
}

impl Learned {
    fn from(points: &[Point]) -> Result<Self, Box<dyn Error>> {
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let rows = points.iter().map(|point| point.at.as_slice());
        let space = FeatureSpace::fit("plane", rows, ScalingMethod::Common, Components::Count(2), &mut rng);
        let space = Arc::new(space);
        let vocabulary = Vocabulary::new(["circle", "square"])?;
        let mut learner = Learner::new(space.clone(), vocabulary, LearnerOptions::default())?;
        for (key, point) in (0..).zip(points) {
            learner.insert(key, point.class, &space.project(&point.at)?)?;
        }
        Ok(Self { space, classifier: learner.learn()? })
    }

    /// Where both classes are equally likely: the zeros of the difference along the sides of a fine grid, joined.
    fn boundary(&self) -> Result<Vec<[[f32; 2]; 2]>, Box<dyn Error>> {
        const STEPS: u8 = 64;
        let place = |i: u8| drawing::EXTENT * (2.0 * f32::from(i) / f32::from(STEPS) - 1.0);
        let lead = |at: [f32; 2]| self.classifier.probabilities(&at).map(|p| (p[0] - p[1]) as f32);
        let mut pieces = Vec::new();
        for i in 0..STEPS {
            for j in 0..STEPS {
                let (x, y, right, up) = (place(i), place(j), place(i + 1), place(j + 1));
                let corners = [[x, y], [right, y], [right, up], [x, up]];
                let mut crossings = Vec::new();
                for k in 0..4 {
                    let (a, b) = (corners[k], corners[(k + 1) % 4]);
                    let (at_a, at_b) = (lead(a)?, lead(b)?);
                    if (at_a < 0.0) != (at_b < 0.0) {
                        let part = at_a / (at_a - at_b);
                        crossings.push([a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])]);
                    }
                }
                pieces.extend(crossings.chunks_exact(2).map(|ends| [ends[0], ends[1]]));
            }
        }
        Ok(pieces)
    }
}

/// What a rule shares, one sample after the other. Point `i` has key `i + 1`.
fn shared(rule: SelectionRule, points: &[Point], learned: &Learned) -> Result<Panel, Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut set = TrainingSet::new(ME, points.len(), rule.build(), ForgettingRule::default().build());
    for (number, point) in (1..).zip(points) {
        let vector = learned.space.project(&point.at)?;
        if point.common {
            let id = SampleId { author: RobotId(2), life: 0, number };
            set.receive(id, point.class, ROUND, vector, &mut rng);
        } else {
            set.keep(point.class, ROUND, vector, &mut rng);
        }
    }

    let mut panel = Panel::new(rule.name(), caption_of_selection(rule));
    let personal = |class| points.iter().filter(move |point| !point.common && point.class == class);
    match rule {
        SelectionRule::Representativity | SelectionRule::Herding => {
            panel.means = [0, 1].map(ClassId).map(|class| (mean(personal(class)), class)).to_vec();
        }
        SelectionRule::Margin => panel.boundary = learned.boundary()?,
        SelectionRule::Random | SelectionRule::Novelty | SelectionRule::KCenter => {}
    }
    for _ in 0..SHARED {
        let known: Vec<usize> = set.common().filter_map(index).collect();
        let changes = set.share(1, Some(&*learned.classifier), &<[f32]>::to_vec, &mut rng);
        let picked = changes.iter().find_map(|change| match change {
            SetChange::Shared(key, _) => set.get(*key).and_then(index),
            _ => None,
        });
        let Some(picked) = picked else { break };
        let compared = match rule {
            SelectionRule::Novelty => nearest(
                points,
                picked,
                known.into_iter().filter(|i| points[*i].class == points[picked].class),
            ),
            SelectionRule::KCenter => nearest(points, picked, known.into_iter()),
            _ => None,
        };
        panel.ties.extend(compared.map(|other| (picked, other)));
        panel.picks.push(picked);
    }
    Ok(panel)
}

/// What a rule forgets while the last points come. Point `i` has key `i + 1`.
fn forgotten(rule: ForgettingRule, points: &[Point]) -> Panel {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let capacity = points.len() - FORGOTTEN;
    let mut set = TrainingSet::new(ME, capacity, SelectionRule::default().build(), rule.build());
    let mut panel = Panel::new(rule.name(), caption_of_forgetting(rule));
    for point in points {
        for change in set.keep(point.class, ROUND, point.at.to_vec(), &mut rng) {
            let SetChange::Removed(sample) = change else { continue };
            let Some(gone) = index(&sample) else { continue };
            if rule == ForgettingRule::Redundancy {
                let held = set.iter().filter(|other| other.class == sample.class).filter_map(index);
                panel.ties.extend(nearest(points, gone, held).map(|other| (gone, other)));
            }
            panel.picks.push(gone);
        }
    }
    if let ForgettingRule::Representativity | ForgettingRule::Herding = rule {
        let of = |class| points.iter().filter(move |point| point.class == class);
        let classes = [0, 1].map(ClassId).into_iter();
        let lost = classes.filter(|class| panel.picks.iter().any(|i| points[*i].class == *class));
        panel.means = lost.map(|class| (mean(of(class)), class)).collect();
    }
    panel
}

fn caption_of_selection(rule: SelectionRule) -> &'static str {
    match rule {
        SelectionRule::Random => "any of a class drawn at random",
        SelectionRule::Novelty => "farthest from its nearest known one of the class",
        SelectionRule::Representativity => "nearest to the centroid (+) of what is not shared yet",
        SelectionRule::Herding => "brings the mean of what is shared to the mean (+)",
        SelectionRule::KCenter => "farthest from its nearest known one of any class",
        SelectionRule::Margin => "where the classifier is least sure (line: undecided)",
    }
}

fn caption_of_forgetting(rule: ForgettingRule) -> &'static str {
    match rule {
        ForgettingRule::Fifo => "the oldest, of whatever class",
        ForgettingRule::Random => "any of the larger class",
        ForgettingRule::Redundancy => "one of the closest pair",
        ForgettingRule::Representativity => "farthest from the centroid (+)",
        ForgettingRule::Reservoir => "what stays is an even sample of all that came",
        ForgettingRule::ClassBalancedReservoir => "what stays is an even sample of each class",
        ForgettingRule::Herding => "what stays has the mean of all that came (+)",
    }
}

fn index(sample: &HeldSample) -> Option<usize> {
    usize::try_from(sample.key).ok()?.checked_sub(1)
}

fn mean<'a>(points: impl Iterator<Item = &'a Point>) -> [f32; 2] {
    let (mut sum, mut count) = ([0.0; 2], 0.0);
    for point in points {
        sum = [sum[0] + point.at[0], sum[1] + point.at[1]];
        count += 1.0;
    }
    sum.map(|total| total / count)
}

fn nearest(points: &[Point], of: usize, among: impl Iterator<Item = usize>) -> Option<usize> {
    let to = |i: usize| distance(points[i].at, points[of].at);
    among.min_by(|a, b| to(*a).total_cmp(&to(*b)))
}

fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_has_a_panel_with_all_its_picks() {
        for (subject, names, picks) in [
            (Subject::Selection, SelectionRule::ALL.map(SelectionRule::name).to_vec(), SHARED),
            (Subject::Forgetting, ForgettingRule::ALL.map(ForgettingRule::name).to_vec(), FORGOTTEN),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("rules.svg");
            draw(subject, &path).unwrap();
            let svg = std::fs::read_to_string(&path).unwrap();
            for name in &names {
                assert!(svg.contains(&format!("\n{name}\n")), "{name} is missing");
            }
            for number in 1..=picks {
                // The first stands in the key as well.
                assert_eq!(
                    svg.matches(&format!("\n{number}\n")).count(),
                    names.len() + usize::from(number == 1),
                    "{subject:?} {number}"
                );
            }
            draw(subject, &path).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), svg, "the same each time");
        }
    }

    #[test]
    fn the_picture_shows_what_its_captions_say() {
        let points = points(&ONE_CLASS_LARGER);
        let oldest: Vec<usize> = (0..FORGOTTEN).collect();
        assert_eq!(forgotten(ForgettingRule::Fifo, &points).picks, oldest);

        let points = self::points(&KNOWN_IN_PART);
        let learned = Learned::from(&points).unwrap();
        for rule in SelectionRule::ALL {
            let panel = shared(rule, &points, &learned).unwrap();
            assert_eq!(panel.picks.len(), SHARED);
            assert!(panel.picks.iter().all(|i| !points[*i].common), "{rule} shares what is not its own");
        }
        // Near to the rules is near in the picture.
        let novel = shared(SelectionRule::KCenter, &points, &learned).unwrap();
        let known: Vec<usize> = (0..points.len()).filter(|i| points[*i].common).collect();
        let gap = |i: usize| {
            let other = nearest(&points, i, known.iter().copied()).unwrap();
            distance(points[i].at, points[other].at)
        };
        let widest = (0..points.len()).max_by(|a, b| gap(*a).total_cmp(&gap(*b)));
        assert_eq!(widest, Some(novel.picks[0]));
    }

    #[test]
    fn a_name_of_no_drawing_is_refused_before_any_work() {
        let refused = draw(Subject::Selection, Path::new("rules.bmp"));
        assert!(matches!(refused, Err(DrawError::Name(_))));
    }
}
