//! fig:carla-pareto-evolution: the Pareto area of every group of family and route over the rounds, with their mean, a panel a
//! generator.

use std::collections::{BTreeMap, BTreeSet};

use super::error::FigureError;
use super::legend::{self, source};
use crate::archive::hypervolume;
use crate::draw::{Axes, BLACK, Figure, Ink, Mark, ORANGE, Scale};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::LineageId;
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

/// The rounds of every lineage, in their order.
fn lineages<'s>(runs: &'s [RecordedRun]) -> Vec<(&'s LineageId, Vec<&'s ArchiveRound>)> {
    let of = |run: &'s RecordedRun, lineage: &'s LineageId| {
        let mut rounds: Vec<&ArchiveRound> = run.rounds.iter().filter(|round| round.lineage == *lineage).collect();
        rounds.sort_by_key(|round| round.round);
        (lineage, rounds)
    };
    let all = runs.iter().flat_map(|run| run.parents.iter().map(move |parent| of(run, &parent.lineage)));
    all.filter(|(_, rounds)| !rounds.is_empty()).collect()
}

/// A panel a lineage, at most four in a row.
pub fn area_rounds(runs: &[RecordedRun]) -> Result<Figure, FigureError> {
    let all = lineages(runs);
    if all.is_empty() {
        return Err(FigureError::NoRounds);
    }
    let measured: Vec<(&LineageId, BTreeMap<String, Vec<f64>>)> =
        all.into_iter().map(|(lineage, rounds)| (lineage, areas(&rounds))).collect();
    let rows = measured.len().div_ceil(4);
    let mut sheet = Figure::new(470.0, 20.0 + 155.0 * rows as f64, "Pareto area by group over rounds");
    let signs = [
        (Mark::Square, Ink::fill(FAINT), "a group of family and route"),
        (Mark::Square, Ink::fill(ORANGE), "quartiles of the groups"),
        (Mark::Disc, Ink::fill(BLACK), "mean over the groups"),
    ];
    legend::row(&mut sheet, (90.0, 12.0), &signs);
    let highest = measured.iter().flat_map(|(_, areas)| areas.values().flatten()).copied().fold(0.0, f64::max);
    for (place, (lineage, areas)) in measured.iter().enumerate() {
        let left = 40.0 + 110.0 * (place % 4) as f64;
        let top = 36.0 + 155.0 * (place / 4) as f64;
        panel(&mut sheet, [left, top, 82.0, 100.0], lineage, areas, highest, place % 4 == 0);
    }
    let runs: Vec<&RecordedRun> = runs.iter().collect();
    let caption = format!(
        "Area of attack and ARS from the origin, of all scenes that balanced selection kept in a group up to the round; round 0 is the \
         parent's. It can only grow: what the figure shows is how much and in how many groups. {}",
        source(&runs)
    );
    legend::foot(&mut sheet, &caption);
    Ok(sheet)
}

fn panel(
    sheet: &mut Figure,
    place: [f64; 4],
    lineage: &LineageId,
    areas: &BTreeMap<String, Vec<f64>>,
    highest: f64,
    named: bool,
) {
    let rounds = areas.values().map(Vec::len).max().unwrap_or(1);
    let last = rounds.saturating_sub(1) as f64;
    let ticks = (0..rounds).map(|round| round as f64).collect();
    let axes = Axes { place, across: Scale::fixed(-0.3, last + 0.3, ticks), up: Scale::over([0.0, highest], 4) };
    sheet.heading((place[0], place[1] - 6.0), 8.0, lineage.as_str());
    axes.draw(sheet, "Round", if named { "Pareto area" } else { "" });
    for values in areas.values() {
        let points = values.iter().enumerate().map(|(round, value)| axes.at(round as f64, *value)).collect();
        sheet.path(points, Ink::line(FAINT, 0.4));
    }
    let mut means = Vec::new();
    for round in 0..rounds {
        let of: Vec<f64> = areas.values().filter_map(|values| values.get(round)).copied().collect();
        if let (Some(low), Some(high)) = (num::quantile(&of, 0.25), num::quantile(&of, 0.75)) {
            let (x, top) = (axes.x(round as f64), axes.y(high));
            sheet.rect([x - 3.5, top, 7.0, axes.y(low) - top], Ink::line(ORANGE, 1.3));
        }
        means.extend(num::mean(&of).map(|mean| axes.at(round as f64, mean)));
    }
    for at in &means {
        sheet.mark(Mark::Disc, *at, 2.0, Ink::fill(BLACK));
    }
    sheet.path(means, Ink::line(BLACK, 1.4));
}
