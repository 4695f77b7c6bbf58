//! How a swarm that is taught gets better: the learning curve, drawn.

use plotters::prelude::*;

use super::Tally;

/// Accuracies are means over this many rounds: those of a single one are all or nothing for the swarm.
pub const WINDOW: usize = 6;

const SIZE: (u32, u32) = (960, 540);
/// Height of the row that says which line is whose.
const LEGEND: u32 = 24;
const SINGLE: RGBColor = RGBColor(213, 94, 0);
const SWARM: RGBColor = RGBColor(0, 114, 178);
const WRONG: RGBColor = RGBColor(120, 120, 120);

type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The curve of a tally as SVG: the accuracy of single robots and of the swarm, and how often the swarm decided for another gesture
/// rather than not at all, each as the mean over the last [`WINDOW`] rounds, and each round by itself as a dot.
///
/// # Errors
/// What plotters says.
pub fn svg(tally: &Tally, title: &str) -> Result<String, DrawingAreaErrorKind<std::io::Error>> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), tally, title)?;
    Ok(text)
}

fn draw(area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>, tally: &Tally, title: &str) -> Drawn {
    area.fill(&WHITE)?;
    let single: Vec<f64> = tally.history().iter().map(|round| 100.0 * round.single).collect();
    let swarm: Vec<f64> = tally.history().iter().map(|round| if round.right { 100.0 } else { 0.0 }).collect();
    let wrong: Vec<f64> = tally.history().iter().map(|round| if round.wrong { 100.0 } else { 0.0 }).collect();
    let last = single.len().max(2) as f64;
    // Above the plot, as anywhere in it a line may be.
    let (head, plot) = area.titled(title, ("sans-serif", 22))?.split_vertically(LEGEND);
    let legend = [
        (90, SINGLE, 3, "a single robot"),
        (270, SWARM, 3, "the swarm"),
        (420, WRONG, 1, "the swarm, wrong rather than undecided"),
    ];
    for (x, colour, width, name) in legend {
        head.draw(&PathElement::new([(x, 14), (x + 26, 14)], colour.stroke_width(width)))?;
        head.draw(&Text::new(name, (x + 34, 7), ("sans-serif", 16)))?;
    }
    let mut chart = ChartBuilder::on(&plot)
        .margin(14)
        .x_label_area_size(52)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..last + 1.0, -4.0..104.0)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225))
        .x_desc("interaction rounds")
        .y_desc(format!("right, %: a round, and the mean of the last {WINDOW}"))
        .axis_desc_style(("sans-serif", 17))
        .label_style(("sans-serif", 15))
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .draw()?;
    let means = |values: &[f64]| -> Vec<(f64, f64)> {
        let mean_of = |n: usize| mean(&values[(n + 1).saturating_sub(WINDOW)..=n]);
        (0..values.len()).map(|n| ((n + 1) as f64, mean_of(n))).collect()
    };
    for (values, colour) in [(&single, SINGLE), (&swarm, SWARM)] {
        let points = (1..).map(f64::from).zip(values.iter().copied());
        chart.draw_series(points.map(|point| Circle::new(point, 4, colour.mix(0.35).filled())))?;
        chart.draw_series(LineSeries::new(means(values), colour.stroke_width(3)))?;
    }
    chart.draw_series(LineSeries::new(means(&wrong), WRONG.stroke_width(1)))?;
    area.present()
}

/// The accuracy of single robots and of the swarm over the last [`WINDOW`] rounds, `0.0..=1.0`.
#[must_use]
pub fn latest(tally: &Tally) -> (f64, f64) {
    let rounds = tally.history();
    let last = &rounds[rounds.len().saturating_sub(WINDOW)..];
    let single: Vec<f64> = last.iter().map(|round| round.single).collect();
    let swarm: Vec<f64> = last.iter().map(|round| f64::from(u8::from(round.right))).collect();
    (mean(&single), mean(&swarm))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use gestalt_protocol::{
        Certificate, ClassId, Decision, FusionRule, RobotId, RoundId, Terms, VocabularyId,
    };

    use super::*;

    fn decision(class: Option<ClassId>) -> Decision {
        Decision {
            round: RoundId { counter: 1, opener: RobotId(1), life: 0 },
            class,
            confidence: 1.0,
            author: RobotId(1),
            is_final: false,
            certificate: Certificate {
                vocabulary: VocabularyId(0),
                rule: FusionRule::LogPool,
                pool: None,
                probabilities: Vec::new(),
                unknown: None,
                votes: Vec::new(),
                others: Vec::new(),
                robots: 1,
                quorum: 1,
                elapsed_ms: 0,
                named: vec![],
                terms: Terms::default(),
            },
        }
    }

    #[test]
    fn the_last_rounds_count_and_a_curve_of_few_or_many_can_be_drawn() {
        let mut tally = Tally::new([RobotId(1)]);
        assert!(svg(&tally, "none").is_ok());
        for right in [false, false, true, true, true, true, true, false] {
            tally.record(ClassId(3), &decision(Some(ClassId(if right { 3 } else { 1 }))));
            let text = svg(&tally, "learning").unwrap();
            assert!(text.contains("the swarm") && text.contains("learning"));
        }
        assert_eq!(latest(&tally).1, 5.0 / 6.0);
    }
}
