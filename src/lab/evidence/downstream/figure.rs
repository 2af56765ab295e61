//! fig:sac-adv-bmt: crash rate and route completion over the trainings, in adversarial scenes and in plain ones.

use super::found::{ADVERSARIAL, Question, Read, examinations, mean};
use crate::draw::{Anchor, Axes, BLACK, BLUE, Figure, Ink, Mark, ORANGE, PURPLE, Rgb, SKY, Scale, VERMILION};
use crate::evidence::figures::legend;
use crate::evidence::tables::{Estimate, Form, RESAMPLES, estimates};
use crate::kernel::num;
use crate::objects::downstream::{Downstream, SetName};

/// One after the other for the arms.
const SIGNS: [(Mark, Rgb); 6] = [
    (Mark::Disc, BLACK),
    (Mark::Square, SKY),
    (Mark::Triangle, ORANGE),
    (Mark::Diamond, BLUE),
    (Mark::Disc, VERMILION),
    (Mark::Square, PURPLE),
];
/// The distance by which arms stand apart, so that their intervals can be told, points.
const APART: f64 = 3.0;

/// The least that an axis of a rate reaches, so that rates near 0 look like that.
const LEAST: f64 = 0.2;

/// A point of a curve: updates and estimate.
type Point = (f64, Estimate);

/// The figure of a record.
pub fn figure(record: &Downstream) -> Figure {
    let opening = &record.opening;
    let mut sheet = Figure::new(470.0, 344.0, format!("Downstream training: {}", opening.describes));
    let signs: Vec<(Mark, Ink, &str)> = opening
        .arms
        .iter()
        .enumerate()
        .map(|(i, (arm, _))| (SIGNS[i % SIGNS.len()].0, Ink::fill(SIGNS[i % SIGNS.len()].1), arm.as_str()))
        .collect();
    sheet.text((52.0, 14.0), legend::LETTERS, Anchor::Start, "Trained on scenes:");
    legend::row(&mut sheet, 124.0, 14.0, &signs);
    let (of, way) = if opening.families.is_empty() {
        (Read::Completion, "Route completion")
    } else {
        (Read::Score, "Overall score")
    };
    let asked = |sets: &'static [SetName], read: Read| Question { sets, read, family: None };
    for (top, name, read) in [(40.0, "Crash rate", Read::Crash), (196.0, way, of)] {
        let adversarial = curves(record, asked(&ADVERSARIAL, read));
        let plain = curves(record, asked(&[SetName::Plain], read));
        // One scale a row, so that heights compare.
        let up = Scale::over(
            [&adversarial, &plain]
                .into_iter()
                .flatten()
                .flatten()
                .flat_map(|(_, found)| ends(found))
                .chain([0.0, LEAST]),
            4,
        );
        for (left, title, curves) in [(52.0, "Adversarial scenes", adversarial), (284.0, "Plain scenes", plain)] {
            let axes = Axes { place: [left, top, 172.0, 108.0], across: across(record), up: up.clone() };
            panel(&mut sheet, &axes, title, name, &curves);
        }
    }
    let caption = format!(
        "Means over {} seeds and {} scenes (adversarial: the same scenes as both generators play them) with 95 % intervals: Student's t over \
         seeds and {RESAMPLES} draws of scenes. Crash: contact with anyone, whoever caused it. Generators: the parent and {}; its patches are of: {}.",
        opening.seeds.len(),
        opening.sets.evaluation.first().map_or(0, |set| set.scenes.len()),
        opening.generator,
        opening.proposals,
    );
    legend::foot(&mut sheet, &caption);
    sheet
}

/// The curves of all arms.
fn curves(record: &Downstream, what: Question<'_>) -> Vec<Vec<Point>> {
    let of = |(arm, _): &(String, Vec<SetName>)| -> Vec<Point> {
        let trained: Vec<_> = record.trainings.iter().filter(|trained| trained.arm == *arm).collect();
        let point = |place: usize| {
            let updates: Vec<f64> = trained.iter().map(|of| of.examinations[place].updates as f64).collect();
            let estimated = estimates(&[mean(record, arm, place, what)]).into_iter().next().flatten()?;
            // Every panel shows shares.
            Some((num::mean(&updates)?, Form::Rate.bounded(estimated)))
        };
        (0..examinations(record, arm)).filter_map(point).collect()
    };
    record.opening.arms.iter().map(of).collect()
}

/// Updates in thousands, from where the arms part; a little wider than that, so that points that stand apart stay within.
fn across(record: &Downstream) -> Scale {
    let [first, last] = [record.opening.plain_updates, record.opening.updates].map(|updates| updates as f64 / 1000.0);
    Scale::over([first, last], 4).widened(0.04)
}

/// The ends of an interval.
fn ends(found: &Estimate) -> [f64; 2] {
    found.interval.unwrap_or([found.value; 2])
}

fn panel(sheet: &mut Figure, axes: &Axes, title: &str, up: &str, curves: &[Vec<Point>]) {
    let [left, top, ..] = axes.place;
    sheet.heading((left, top - 8.0), 8.0, title);
    axes.draw(sheet, "Updates, thousands", up);
    let middle = 0.5 * (curves.len() as f64 - 1.0);
    for (i, points) in curves.iter().enumerate() {
        let (mark, colour) = SIGNS[i % SIGNS.len()];
        let aside = APART * (i as f64 - middle);
        let at = |updates: f64, value: f64| (axes.x(updates / 1000.0) + aside, axes.y(value));
        for point in points {
            let [low, high] = ends(&point.1);
            sheet.line(at(point.0, low), at(point.0, high), Ink::line(colour, 0.7));
        }
        sheet.path(points.iter().map(|(x, found)| at(*x, found.value)).collect(), Ink::line(colour, 1.2));
        for (x, found) in points {
            sheet.mark(mark, at(*x, found.value), 2.4, Ink::fill(colour));
        }
    }
}
