//! fig:carla-pareto-evolution: the Pareto area of every group of family and route over the rounds, with their mean, a panel a
//! generator.

use std::collections::{BTreeMap, BTreeSet};

use super::error::FigureError;
use super::legend::{self, source};
use crate::archive::hypervolume;
use crate::draw::{Axes, BLACK, BLUE, Figure, Ink, Mark, ORANGE, Scale};
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::called;
use crate::kernel::num;
use crate::objects::benchmark::ArchiveRound;

/// Grey that many lines may lie upon each other in.
const FAINT: crate::draw::Rgb = [186, 192, 199];

/// Area of every group after each round, of all scenes that balanced selection kept up to it.
/// Indices: group, round.
pub fn areas(rounds: &[&ArchiveRound]) -> BTreeMap<String, Vec<f64>> {
    let groups: BTreeSet<&str> =
        rounds.iter().flat_map(|round| &round.selected).map(|scene| scene.group.as_str()).collect();
    let of = |group: &str| {
        let mut points: Vec<[f64; 2]> = Vec::new();
        let after = |round: &&ArchiveRound| {
            let own = round.selected.iter().filter(|scene| scene.group == group);
            points.extend(own.map(|scene| [scene.attack, scene.realism]));
            hypervolume(&points, [0.0, 0.0])
        };
        rounds.iter().map(after).collect()
    };
    groups.into_iter().map(|group| (group.to_string(), of(group))).collect()
}

/// A lineage's areas, and the means of its parent's where that was drawn as often.
struct Panel {
    /// Its method, and the ego that it is evolved against.
    name: String,
    ego: String,
    areas: BTreeMap<String, Vec<f64>>,
    redrawn: Vec<f64>,
}

/// A panel a lineage, in their order.
fn panels(runs: &[RecordedRun]) -> Vec<Panel> {
    let mut panels = Vec::new();
    for (run, parent) in runs.iter().flat_map(|run| run.parents.iter().map(move |parent| (run, parent))) {
        let lineage = &parent.lineage;
        let mut rounds: Vec<&ArchiveRound> = run.rounds.iter().filter(|round| round.lineage == *lineage).collect();
        rounds.sort_by_key(|round| round.round);
        let redrawn = run.redrawn.iter().filter(|of| of.lineage == *lineage).flat_map(|of| &of.rounds);
        if !rounds.is_empty() {
            let redrawn = means(&areas(&redrawn.collect::<Vec<_>>()));
            let called = called(run, lineage);
            let (name, ego) = called.split_once(" against ").unwrap_or((&called, ""));
            panels.push(Panel { name: name.into(), ego: ego.into(), areas: areas(&rounds), redrawn });
        }
    }
    panels
}

/// Means over the groups, round by round.
fn means(areas: &BTreeMap<String, Vec<f64>>) -> Vec<f64> {
    (0..)
        .map_while(|round| num::mean(&areas.values().filter_map(|of| of.get(round)).copied().collect::<Vec<_>>()))
        .collect()
}

/// A panel a lineage, at most four in a row.
pub fn area_rounds(runs: &[RecordedRun]) -> Result<Figure, FigureError> {
    let measured = panels(runs);
    if measured.is_empty() {
        return Err(FigureError::NoRounds);
    }
    let rows = measured.len().div_ceil(4);
    let mut sheet = Figure::new(470.0, 20.0 + 155.0 * rows as f64, "Pareto area by group over rounds");
    let signs = [
        (Mark::Square, Ink::fill(FAINT), "a group of family and route"),
        (Mark::Square, Ink::fill(ORANGE), "quartiles of the groups"),
        (Mark::Disc, Ink::fill(BLACK), "mean over the groups"),
        (Mark::Disc, Ink::fill(BLUE), "the parent, drawn as often"),
    ];
    legend::row(&mut sheet, 30.0, 12.0, &signs);
    let egos: BTreeSet<&str> = measured.iter().map(|of| of.ego.as_str()).collect();
    let highest = measured.iter().flat_map(|of| of.areas.values().flatten()).copied().fold(0.0, f64::max);
    for (place, of) in measured.iter().enumerate() {
        let left = 40.0 + 110.0 * (place % 4) as f64;
        let top = 36.0 + 155.0 * (place / 4) as f64;
        panel(&mut sheet, [left, top, 82.0, 100.0], of, highest, place % 4 == 0);
        // A panel says its ego only where there are several.
        let ego = if egos.len() > 1 { format!(", {}", of.ego) } else { String::new() };
        sheet.heading((left - 16.0, top - 6.0), 7.5, format!("{}{ego}", of.name));
    }
    let all_against = if egos.len() > 1 { String::new() } else { format!("All against {}. ", measured[0].ego) };
    let runs: Vec<&RecordedRun> = runs.iter().collect();
    let caption = format!(
        "{all_against}Area of attack and ARS from the origin, of all scenes that balanced selection kept in a group up to the round; round 0 is the \
         parent's. It can only grow, whatever is drawn: the parent that takes every program's place shows how much of it is that. {}",
        source(&runs)
    );
    legend::foot(&mut sheet, &caption);
    Ok(sheet)
}

fn panel(sheet: &mut Figure, place: [f64; 4], of: &Panel, highest: f64, named: bool) {
    let rounds = of.areas.values().map(Vec::len).max().unwrap_or(1);
    let last = rounds.saturating_sub(1) as f64;
    let ticks = (0..rounds).map(|round| round as f64).collect();
    let axes = Axes { place, across: Scale::fixed(-0.3, last + 0.3, ticks), up: Scale::over([0.0, highest], 4) };
    axes.draw(sheet, "Round", if named { "Pareto area" } else { "" });
    for values in of.areas.values() {
        let points = values.iter().enumerate().map(|(round, value)| axes.at(round as f64, *value)).collect();
        sheet.path(points, Ink::line(FAINT, 0.4));
    }
    for round in 0..rounds {
        let values: Vec<f64> = of.areas.values().filter_map(|values| values.get(round)).copied().collect();
        if let (Some(low), Some(high)) = (num::quantile(&values, 0.25), num::quantile(&values, 0.75)) {
            let (x, top) = (axes.x(round as f64), axes.y(high));
            sheet.rect([x - 3.5, top, 7.0, axes.y(low) - top], Ink::line(ORANGE, 1.3));
        }
    }
    for (means, colour) in [(&of.redrawn, BLUE), (&means(&of.areas), BLACK)] {
        let points: Vec<_> = means.iter().enumerate().map(|(round, mean)| axes.at(round as f64, *mean)).collect();
        for at in &points {
            sheet.mark(Mark::Disc, *at, 2.0, Ink::fill(colour));
        }
        sheet.path(points, Ink::line(colour, 1.4));
    }
}
