//! The swarm in numbers, as OpenMetrics text.

use std::collections::BTreeSet;
use std::fmt;
use std::time::Duration;

use gestalt_protocol::CameraState;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::text::encode;
use prometheus_client::encoding::{DescriptorEncoder, MetricEncoder, NoLabelSet};
use prometheus_client::metrics::MetricType;
use prometheus_client::registry::Registry;

use crate::view::{RobotView, SECONDS, Tally, View};

/// How metrics are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// OpenMetrics 1.0.0.
    OpenMetrics,
    /// The text of Prometheus, 0.0.4: what programs read that know nothing newer.
    Text,
}

impl Format {
    /// The one that a reader asks for in its `Accept` header: the older text if it names that and not the newer.
    pub fn accepted(accept: &str) -> Self {
        let is_old = accept.contains("text/plain") && !accept.contains("application/openmetrics-text");
        if is_old { Self::Text } else { Self::OpenMetrics }
    }

    pub fn content_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Text => "text/plain; version=0.0.4; charset=utf-8",
        }
    }
}

/// So many robots are measured one by one, those of the smallest ids: each is some sixty time series. What is said of the swarm is
/// of all.
const MAX_ROBOTS: usize = 256;

/// What a view says at one moment. Labels are robots, and names of the robots' own counters, both bounded in number.
#[derive(Debug)]
struct Moment {
    robots: Vec<RobotView>,
    there: usize,
    answering: usize,
    counters: Vec<(String, Vec<(String, u64)>)>,
    tally: Tally,
    readers: usize,
}

/// All metrics, for one scrape.
pub(crate) fn text(view: &View, now: Duration, readers: usize, format: Format) -> Result<String, fmt::Error> {
    let mut robots = view.swarm(now).robots;
    let there = robots.len();
    let answering = robots.iter().filter(|robot| robot.answers).count();
    robots.truncate(MAX_ROBOTS);
    let counters = view.counters().take(MAX_ROBOTS);
    let counters = counters.map(|(robot, counters)| {
        (robot.to_string(), counters.iter().map(|(name, count)| (name.clone(), *count)).collect())
    });
    let (counters, tally) = (counters.collect(), view.tally().clone());
    let moment = Moment { there, answering, counters, robots, tally, readers };
    let mut registry = Registry::with_prefix("gestalt");
    registry.register_collector(Box::new(moment));
    let mut text = String::new();
    encode(&mut text, &registry)?;
    Ok(if format == Format::Text { older(&text) } else { text })
}

/// OpenMetrics in the older text, which describes a counter under the name of its samples, and knows no units and no end.
fn older(text: &str) -> String {
    let counters: BTreeSet<&str> =
        text.lines().filter_map(|line| line.strip_prefix("# TYPE ")?.strip_suffix(" counter")).collect();
    let mut old = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.splitn(4, ' ');
        match (words.next(), words.next(), words.next(), words.next()) {
            (Some("#"), Some("UNIT" | "EOF"), ..) => continue,
            (Some("#"), Some(what), Some(name), Some(rest)) if counters.contains(name) => {
                old.push_str(&format!("# {what} {name}_total {rest}"));
            }
            _ => old.push_str(line),
        }
        old.push('\n');
    }
    old
}

impl Collector for Moment {
    fn encode(&self, mut to: DescriptorEncoder) -> fmt::Result {
        let to = &mut to;
        // A gauge, for Prometheus's older text knows no info.
        gauge(
            to,
            "build_info",
            "The program that measures",
            [([("version", env!("CARGO_PKG_VERSION"))], 1.0)],
        )?;
        gauge(to, "robots", "Robots that are there", [(NONE, self.there as f64)])?;
        gauge(to, "robots_answering", "Robots that report themselves", [(NONE, self.answering as f64)])?;
        gauge(to, "page_readers", "Readers of the page", [(NONE, self.readers as f64)])?;
        self.encode_swarm(to)?;
        self.encode_robots(to)
    }
}

impl Moment {
    fn encode_swarm(&self, to: &mut DescriptorEncoder) -> fmt::Result {
        let Tally { decided, undecided, refused, answers, questions, seconds, total_seconds } = &self.tally;
        let rounds = [([("outcome", "decided")], *decided), ([("outcome", "undecided")], *undecided)];
        counter(to, "rounds", "Rounds that ended, as first heard", rounds)?;
        let answers = Tally::OUTCOMES.into_iter().zip(answers);
        let answers = answers.map(|(outcome, count)| ([("outcome", outcome)], *count));
        counter(to, "answers", "Answers of the swarm to instructors", answers)?;
        let questions =
            Tally::KINDS.into_iter().zip(questions).map(|(kind, count)| ([("kind", kind)], *count));
        counter(to, "questions", "Questions of the swarm to its instructor, as first heard", questions)?;
        counter(
            to,
            "robots_refused",
            "Tokens and reports of robots for which there was no room",
            [(NONE, *refused)],
        )?;
        let bounds = SECONDS.into_iter().chain([f64::INFINITY]);
        let buckets: Vec<(f64, u64)> = bounds.zip(seconds.iter().copied()).collect();
        let help = "From the opening of a round to its decision";
        let unit = prometheus_client::registry::Unit::Seconds;
        let mut histogram = to.encode_descriptor("decision", help, Some(&unit), MetricType::Histogram)?;
        histogram.encode_histogram::<NoLabelSet>(*total_seconds, seconds.iter().sum(), &buckets, None)
    }

    fn encode_robots(&self, to: &mut DescriptorEncoder) -> fmt::Result {
        let of_each = self.counters.iter().flat_map(|(robot, counters)| {
            counters.iter().map(move |(name, count)| ([("robot", robot.as_str()), ("event", name)], *count))
        });
        let help = "What a robot has counted since its start: sent, received, refused by cause";
        counter(to, "robot_events", help, of_each)?;
        let each = |pick: fn(&RobotView) -> f64| {
            self.robots.iter().map(move |robot| ([("robot", robot.id.to_string())], pick(robot)))
        };
        gauge(to, "robot_links", "Direct links of a robot", each(|robot| robot.links.len() as f64))?;
        gauge(
            to,
            "robot_errors",
            "Latest errors that a robot reports",
            each(|robot| robot.errors.len() as f64),
        )?;
        gauge(to, "camera_frames_per_second", "Rate of a robot's camera", each(|it| it.camera.fps.into()))?;
        let delay = each(|robot| f64::from(robot.camera.delay_ms) / 1000.0);
        gauge(to, "camera_delay_seconds", "From a frame's being taken to its being judged", delay)?;
        let states = self.robots.iter().flat_map(|robot| {
            STATES.iter().map(|(state, name)| {
                let is = if robot.camera.state == *state { 1.0 } else { 0.0 };
                ([("robot", robot.id.to_string()), ("state", (*name).to_owned())], is)
            })
        });
        gauge(to, "camera_state", "1 for the state in which a robot's camera is", states)?;
        let learning =
            self.robots.iter().filter_map(|robot| Some((robot.id.to_string(), robot.learning.as_ref()?)));
        let samples = learning.clone().flat_map(|(robot, it)| {
            [("personal", it.personal), ("shared", it.shared), ("external", it.external)]
                .map(|(kind, count)| ([("robot", robot.clone()), ("kind", kind.to_owned())], count as f64))
        });
        gauge(to, "samples", "Samples that a robot holds", samples)?;
        let trainings = learning.map(|(robot, it)| ([("robot", robot)], it.trainings));
        counter(to, "trainings", "How often a robot has trained", trainings)
    }
}

/// Of a metric without labels.
const NONE: [(&str, &str); 0] = [];

const STATES: [(CameraState, &str); 6] = [
    (CameraState::None, "none"),
    (CameraState::Opening, "opening"),
    (CameraState::Live, "live"),
    (CameraState::Frozen, "frozen"),
    (CameraState::Failing, "failing"),
    (CameraState::Ended, "ended"),
];

fn gauge<const N: usize, V: prometheus_client::encoding::EncodeLabelValue>(
    to: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    values: impl IntoIterator<Item = ([(&'static str, V); N], f64)>,
) -> fmt::Result {
    family(to, name, help, MetricType::Gauge, values, |encoder, value| encoder.encode_gauge(&value))
}

fn counter<const N: usize, V: prometheus_client::encoding::EncodeLabelValue>(
    to: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    values: impl IntoIterator<Item = ([(&'static str, V); N], u64)>,
) -> fmt::Result {
    family(to, name, help, MetricType::Counter, values, |encoder, value| {
        encoder.encode_counter::<NoLabelSet, u64, f64>(&value, None)
    })
}

fn family<const N: usize, V: prometheus_client::encoding::EncodeLabelValue, T>(
    to: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    kind: MetricType,
    values: impl IntoIterator<Item = ([(&'static str, V); N], T)>,
    write: impl Fn(&mut MetricEncoder, T) -> fmt::Result,
) -> fmt::Result {
    let mut encoder = to.encode_descriptor(name, help, None, kind)?;
    for (labels, value) in values {
        if N == 0 {
            write(&mut encoder, value)?;
        } else {
            write(&mut encoder.encode_family(&labels)?, value)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::RobotId;

    use super::*;
    use crate::view::{Input, SILENT};

    #[test]
    fn robots_that_are_not_measured_one_by_one_are_counted() {
        let mut view = View::default();
        for robot in 0..300 {
            let heard = if robot % 3 == 0 { Duration::ZERO } else { SILENT };
            view.hear(heard, Input::Came(RobotId(robot)));
        }
        let now = SILENT + Duration::from_secs(1);
        let text = text(&view, now, 0, Format::OpenMetrics).unwrap();
        for line in ["gestalt_robots 300", "gestalt_robots_answering 200"] {
            assert!(text.lines().any(|found| found.starts_with(line)), "{line} is not in {text}");
        }
        let measured = text.lines().filter(|line| line.starts_with("gestalt_robot_links{"));
        assert_eq!(measured.count(), MAX_ROBOTS);
    }
}
