//! fig:world-sidecar: the candidates of an epoch in random order against the world evaluator's order.

use std::collections::BTreeMap;

use super::error::FigureError;
use super::legend::{self, source};
use crate::draw::{Anchor, Axes, BLACK, BLUE, Figure, GREY, Ink, Mark, Scale};
use crate::evidence::evaluator::order::{Epoch, epochs};
use crate::evidence::evaluator::report;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;

/// Useful candidates that the first panel asks for.
const WANTED: usize = 3;

/// Evaluations to the n-th useful candidate, yield of the first k, and rank correlation by epoch.
pub fn world_order(runs: &[RecordedRun]) -> Result<Figure, FigureError> {
    let all: Vec<&RecordedRun> = runs.iter().collect();
    let asked = epochs(&all);
    if asked.is_empty() {
        return Err(FigureError::NothingRanked);
    }
    let mut sheet = Figure::new(470.0, 180.0, "Candidates in random order and in the world evaluator's order");
    let signs = [
        (Mark::Square, Ink::fill(GREY), "random order (expectation)"),
        (Mark::Disc, Ink::fill(BLUE), "by the evaluator's rank"),
    ];
    legend::row(&mut sheet, 130.0, 12.0, &signs);
    evaluations(&mut sheet, &asked);
    yields(&mut sheet, &asked);
    let pooled = correlation(&mut sheet, &all, &asked);
    let dashed = pooled.map_or(String::new(), |pooled| format!(" Dashed: over all epochs, {pooled:.2}."));
    let caption = format!(
        "{} epochs of {} lineages in which every admitted candidate was ranked and simulated; useful: accepted by the archive.{dashed} {}",
        asked.len(),
        asked.iter().map(|epoch| &epoch.lineage).collect::<std::collections::BTreeSet<_>>().len(),
        source(&all)
    );
    legend::foot(&mut sheet, &caption);
    Ok(sheet)
}

/// Means by rank and in random order; `None` without any.
fn means(pairs: Vec<[f64; 2]>) -> Option<[f64; 2]> {
    let of = |side: usize| num::mean(&pairs.iter().map(|pair| pair[side]).collect::<Vec<f64>>());
    Some([of(0)?, of(1)?])
}

fn evaluations(sheet: &mut Figure, asked: &[Epoch]) {
    sheet.heading((10.0, 28.0), 8.5, "Evaluations to the n-th useful");
    let pairs = |n: usize| asked.iter().filter_map(|epoch| epoch.evaluations_to(n)).collect::<Vec<_>>();
    let placed: Vec<(usize, usize, [f64; 2])> =
        (1..=WANTED).filter_map(|n| Some((n, pairs(n).len(), means(pairs(n))?))).collect();
    let axes = Axes {
        place: [42.0, 40.0, 105.0, 100.0],
        across: Scale::fixed(0.5, WANTED as f64 + 0.5, (1..=WANTED).map(|n| n as f64).collect()),
        up: Scale::over(placed.iter().flat_map(|(.., pair)| *pair).chain([0.0]), 4),
    };
    axes.draw(sheet, "n", "Evaluations (mean)");
    for (n, count, [ranked, random]) in placed {
        let bottom = axes.y(0.0);
        for (value, colour, dx) in [(random, GREY, -14.0), (ranked, BLUE, 1.0)] {
            let (left, top) = (axes.x(n as f64) + dx, axes.y(value));
            sheet.rect([left, top, 13.0, bottom - top], Ink::fill(colour));
            sheet.text((left + 6.5, top - 2.0), 6.5, Anchor::Middle, format!("{value:.1}"));
        }
        sheet.text((axes.x(n as f64), axes.place[1] - 2.0), 6.5, Anchor::Middle, format!("{count} epochs"));
    }
}

fn yields(sheet: &mut Figure, asked: &[Epoch]) {
    sheet.heading((172.0, 28.0), 8.5, "Useful among the first k");
    let most = asked.iter().map(|epoch| epoch.useful.len()).min().unwrap_or(0).max(1);
    let placed: Vec<(f64, [f64; 2])> = (1..=most)
        .filter_map(|k| Some((k as f64, means(asked.iter().filter_map(|e| e.yield_at(k)).collect())?)))
        .collect();
    let axes = Axes {
        place: [203.0, 40.0, 105.0, 100.0],
        across: Scale::over([0.0, most as f64], 4),
        up: Scale::over(placed.iter().flat_map(|(_, pair)| *pair).chain([0.0]), 4),
    };
    axes.draw(sheet, "k", "Useful (mean)");
    for (side, colour) in [(1, GREY), (0, BLUE)] {
        let points: Vec<(f64, f64)> = placed.iter().map(|(k, pair)| axes.at(*k, pair[side])).collect();
        for at in &points {
            let mark = if side == 0 { Mark::Disc } else { Mark::Square };
            sheet.mark(mark, *at, 1.7, Ink::fill(colour));
        }
        sheet.path(points, Ink::line(colour, 1.2));
    }
}

/// Draws the correlation by epoch and gives that over all.
fn correlation(sheet: &mut Figure, runs: &[&RecordedRun], asked: &[Epoch]) -> Option<f64> {
    sheet.heading((333.0, 28.0), 8.5, "Rank against labelled gain");
    let mut by_epoch: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    let mut pooled = Vec::new();
    for run in runs {
        let placed = report(run, None);
        let whole = |epoch: &u32| asked.iter().any(|e| e.epoch == *epoch && e.lineage.0 == run.opened.name);
        for (epoch, quality) in placed.epochs.iter().filter(|(epoch, _)| whole(epoch)) {
            by_epoch.entry(*epoch).or_default().extend(quality.spearman_pooled);
        }
        pooled.extend(placed.pooled.spearman_pooled);
    }
    let placed: Vec<(f64, f64)> =
        by_epoch.iter().filter_map(|(epoch, values)| Some((f64::from(*epoch), num::mean(values)?))).collect();
    let pooled = num::mean(&pooled);
    let ends = placed.iter().map(|(_, value)| *value).chain(pooled).chain([0.0]);
    let axes = Axes {
        place: [365.0, 40.0, 92.0, 100.0],
        across: Scale::over(placed.iter().map(|(epoch, _)| *epoch), 4),
        up: Scale::over(ends, 4),
    };
    axes.draw(sheet, "Epoch", "Spearman's rank correlation");
    sheet.line(axes.at(axes.across.ticks[0], 0.0), (axes.place[0] + axes.place[2], axes.y(0.0)), Ink::line(BLACK, 0.7));
    sheet.path(placed.iter().map(|(x, y)| axes.at(*x, *y)).collect(), Ink::line(BLUE, 1.2));
    for (x, y) in &placed {
        sheet.mark(Mark::Disc, axes.at(*x, *y), 2.0, Ink::fill(BLUE));
    }
    if let Some(pooled) = pooled {
        let y = axes.y(pooled);
        sheet.line((axes.place[0], y), (axes.place[0] + axes.place[2], y), Ink::line(BLUE, 0.8).dashed());
    }
    pooled
}
