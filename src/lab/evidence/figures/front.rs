//! Results of searches on held-out scenes: the plane of attack and realism, a panel a generator, with the parent, the programs that each
//! search reports, their intervals, and what they dominate.

use super::error::FigureError;
use super::legend;
use crate::draw::{
    Axes, BLACK, BLUE, Figure, GREEN, GREY, Ink, LIGHT, Mark, ORANGE, PURPLE, Rgb, Scale, VERMILION, WHITE, tick_text,
};
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::{Estimate, Placed, PlacedPoint, SearchKind, placed};
use crate::objects::LineageId;

/// Width of the sheet, points: both columns of a page; of one panel, one column.
const WIDE: f64 = 494.0;
const NARROW: f64 = 240.0;
/// Panels side by side, and the height of one.
const BESIDE: usize = 4;
const HIGH: f64 = 118.0;
/// Left of a panel's plot, above and below it.
const EDGES: [f64; 3] = [34.0, 16.0, 30.0];
/// Most panels of a sheet.
const PANELS_MAX: usize = 12;
/// Realism below which a point lies on the lower edge: one that is far off must not squeeze the others.
const REALISM_MIN: f64 = 0.8;
/// The floor of realism that decides which program is reported.
const FLOOR: f64 = 0.95;
/// Size of letters, points.
const LETTERS: f64 = 7.0;

const PARENT: (Mark, Rgb) = (Mark::Diamond, BLACK);

fn sign(of: SearchKind) -> (Mark, Rgb, &'static str) {
    let (mark, colour) = match of {
        SearchKind::Model => (Mark::Disc, BLUE),
        SearchKind::StandIn => (Mark::Triangle, ORANGE),
        SearchKind::Random => (Mark::Square, VERMILION),
        SearchKind::Shuffled => (Mark::Cross, PURPLE),
        SearchKind::Other => (Mark::Square, GREEN),
    };
    (mark, colour, of.words())
}

/// The searches of a generator against an ego.
struct Panel {
    title: String,
    all: Vec<Placed>,
}

/// The runs with the results of the named lineages alone; as they are where none is named.
pub(super) fn of_lineages(runs: &[RecordedRun], named: &[LineageId]) -> Result<Vec<RecordedRun>, FigureError> {
    let known: Vec<String> = runs.iter().flat_map(|run| &run.parents).map(|of| of.lineage.to_string()).collect();
    if let Some(wanted) = named.iter().find(|wanted| !known.contains(&wanted.to_string())) {
        return Err(FigureError::NoLineage { wanted: wanted.clone(), known });
    }
    let mut own = runs.to_vec();
    if !named.is_empty() {
        for result in own.iter_mut().filter_map(|run| run.result.as_mut()) {
            result.lineages.retain(|of| named.contains(&of.lineage));
        }
    }
    Ok(own)
}

/// A panel a generator; of all, or of the lineages that are named.
pub fn front(runs: &[RecordedRun], named: &[LineageId]) -> Result<Figure, FigureError> {
    let all = placed(&of_lineages(runs, named)?)?;
    let several = all.iter().any(|of| of.policy != all[0].policy);
    let mut panels: Vec<Panel> = Vec::new();
    for of in all {
        let title = if several { format!("{}, {}", of.method, of.policy) } else { of.method.clone() };
        match panels.iter_mut().find(|panel| panel.title == title) {
            Some(panel) => panel.all.push(of),
            None => panels.push(Panel { title, all: vec![of] }),
        }
    }
    if panels.is_empty() {
        return Err(FigureError::NoLabels);
    }
    if panels.len() > PANELS_MAX {
        let known = panels.into_iter().map(|panel| panel.title).collect();
        return Err(FigureError::TooManyLineages { most: PANELS_MAX, known });
    }
    Ok(drawn(&panels, &legend::source(&runs.iter().collect::<Vec<_>>())))
}

fn drawn(panels: &[Panel], source: &str) -> Figure {
    let beside = panels.len().min(BESIDE);
    let wide = if panels.len() == 1 { NARROW } else { WIDE };
    let rows = panels.len().div_ceil(BESIDE);
    let mut sheet = Figure::new(wide, 0.0, "Attack and realism of reported programs on held-out scenes");
    let kinds: std::collections::BTreeSet<SearchKind> =
        panels.iter().flat_map(|panel| &panel.all).map(|of| of.searched).collect();
    let parent = [(PARENT.0, Ink::fill(PARENT.1), "parent")];
    let signs = kinds.into_iter().map(sign).map(|(mark, colour, words)| (mark, ink(mark, colour), words));
    let signs: Vec<legend::Entry<'_>> = parent.into_iter().chain(signs).collect();
    // On a narrow sheet the signs stand in two lines.
    let (first, second) = signs.split_at(if wide > NARROW { signs.len() } else { signs.len().min(2) });
    legend::row(&mut sheet, 8.0, 10.0, first);
    legend::row(&mut sheet, 8.0, 21.0, second);
    let head = if second.is_empty() { 14.0 } else { 25.0 };
    sheet.height = head + rows as f64 * HIGH;
    let up = realisms(panels);
    for (at, panel) in panels.iter().enumerate() {
        let room = wide / beside as f64;
        let (column, row) = (at % BESIDE, at / BESIDE);
        let [left, above, below] = EDGES;
        let place =
            [column as f64 * room + left, head + row as f64 * HIGH + above, room - left - 8.0, HIGH - above - below];
        let ticks =
            [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().filter(|tick| panels.len() == 1 || *tick * 2.0 % 1.0 == 0.0);
        // A point's sign has room beyond 1, not below 0: there the axes meet.
        let across = Scale::fixed(0.0, 1.06, ticks.collect());
        one(&mut sheet, &Axes { place, across, up: up.clone() }, panel, column == 0, row + 1 == rows);
    }
    let note = format!(
        "Up and to the right is better. Shaded: what the parent and the first search of the legend dominate, from where the axes begin, attack {} and          strict realism {}. Dashed: realism {FLOOR}, the floor of what is reported. Bars: 95 % intervals.{}",
        tick_text(0.0, &[0.0]),
        tick_text(up.ticks[0], &up.ticks),
        if up.ticks[0] > REALISM_MIN { "" } else { " A point below the axis is drawn on it." }
    );
    legend::foot(&mut sheet, &format!("{note} {source}"));
    sheet
}

/// One scale of realism for all panels, from what is lowest to 1.
fn realisms(panels: &[Panel]) -> Scale {
    let ends = |of: &PlacedPoint| [of.realism.value, of.realism.interval.map_or(1.0, |interval| interval[0])];
    let all = panels.iter().flat_map(|panel| &panel.all).flat_map(|of| [&of.parent, &of.evolved]).flat_map(ends);
    let low = all.fold(FLOOR - 0.01, f64::min).max(REALISM_MIN);
    let low = (low * 20.0 + 1e-9).floor() / 20.0;
    let count = ((1.0 - low) * 20.0).round() as usize;
    Scale::fixed(low, 1.005, (0..=count).map(|k| low + 0.05 * k as f64).collect())
}

fn ink(mark: Mark, colour: Rgb) -> Ink {
    if mark == Mark::Cross { Ink::line(colour, 1.4) } else { Ink::fill(colour).edged(WHITE, 0.4) }
}

fn one(sheet: &mut Figure, axes: &Axes, panel: &Panel, first_column: bool, last_row: bool) {
    let [left, top, wide, high] = axes.place;
    let parent = panel.all.first().map(|of| of.parent);
    // The model's program, or else the one that gains most, shows what a search adds.
    let best = panel
        .all
        .iter()
        .min_by(|a, b| a.searched.cmp(&b.searched).then(b.evolved.attack.value.total_cmp(&a.evolved.attack.value)));
    for (point, colour) in [(best.map(|of| of.evolved), [205, 226, 240]), (parent, LIGHT)] {
        let Some(point) = point else { continue };
        let (x, y) = place(axes, &point);
        sheet.rect([left, y, x - left, top + high - y], Ink::fill(colour));
    }
    let floor = axes.y(FLOOR);
    sheet.line((left, floor), (left + wide, floor), Ink::line(GREY, 0.6).dashed());
    axes.draw_small(
        sheet,
        LETTERS,
        if last_row { "Attack" } else { "" },
        if first_column { "Strict realism" } else { "" },
    );
    sheet.heading((left, top - 4.0), 8.0, panel.title.as_str());
    for of in panel.all.iter().rev() {
        let (mark, colour, _) = sign(of.searched);
        shown(sheet, axes, &of.evolved, mark, colour, 3.0);
    }
    if let Some(parent) = parent {
        shown(sheet, axes, &parent, PARENT.0, PARENT.1, 2.6);
    }
}

/// A point that lies below the scale is drawn on its lower edge.
fn place(axes: &Axes, point: &PlacedPoint) -> (f64, f64) {
    axes.at(point.attack.value, held(axes, point.realism.value))
}

fn held(axes: &Axes, realism: f64) -> f64 {
    realism.clamp(axes.up.ticks.first().copied().unwrap_or(0.0), 1.0)
}

fn shown(sheet: &mut Figure, axes: &Axes, point: &PlacedPoint, mark: Mark, colour: Rgb, r: f64) {
    let (x, y) = place(axes, point);
    let interval = |of: &Estimate| of.interval.unwrap_or([of.value; 2]);
    let ([from, to], [low, high]) = (interval(&point.attack), interval(&point.realism));
    sheet.line((axes.x(from), y), (axes.x(to), y), Ink::line(colour, 0.8));
    sheet.line((x, axes.y(held(axes, low))), (x, axes.y(held(axes, high))), Ink::line(colour, 0.8));
    sheet.mark(mark, (x, y), r, ink(mark, colour));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::{Anchor, Shape, Words, pdf};

    fn point(attack: f64, realism: f64) -> PlacedPoint {
        let with =
            |value: f64| Estimate { interval: Some([value - 0.02, (value + 0.02).min(1.0)]), ..Estimate::plain(value) };
        PlacedPoint { attack: with(attack), realism: with(realism) }
    }

    fn panel(title: &str, realism: f64) -> Panel {
        let of = |searched, attack| Placed {
            method: title.into(),
            policy: "IDM".into(),
            searched,
            seeds: 1,
            parent: point(0.3, 0.95),
            evolved: point(attack, realism),
        };
        Panel { title: title.into(), all: vec![of(SearchKind::StandIn, 0.4), of(SearchKind::Model, 0.9)] }
    }

    fn texts(figure: &Figure) -> Vec<&Words> {
        figure
            .shapes
            .iter()
            .filter_map(|shape| if let Shape::Text(words) = shape { Some(words) } else { None })
            .collect()
    }

    #[test]
    fn nothing_is_smaller_than_seven_points_or_leaves_the_sheet() {
        for panels in
            [vec![panel("CAT", 0.97)], ["A", "B", "C", "D", "E"].map(|title| panel(title, 0.97)).into_iter().collect()]
        {
            let figure = drawn(&panels, "Recorded: x.");
            assert!(pdf(&figure).is_ok());
            for words in texts(&figure) {
                assert!(words.size >= LETTERS, "{words:?}");
                let room = crate::draw::width(&words.text, words.size);
                let end = words.at.0 + if words.anchor == Anchor::Start && !words.upwards { room } else { 0.0 };
                assert!(words.at.0 >= 0.0 && end <= figure.width && words.at.1 <= figure.height, "{words:?}");
            }
        }
    }

    #[test]
    fn every_search_has_its_own_mark_and_is_named_once() {
        let figure = drawn(&[panel("CAT", 0.97), panel("AT", 0.97)], "Recorded: x.");
        for name in ["parent", "language model", "rule-based stand-in"] {
            assert_eq!(texts(&figure).iter().filter(|words| words.text == name).count(), 1, "{name}");
        }
        assert!(!texts(&figure).iter().any(|words| words.text == "random patches"));
        let discs = figure.shapes.iter().filter(|shape| matches!(shape, Shape::Disc(..))).count();
        assert_eq!(discs, 3, "one in the legend, one a panel");
    }

    #[test]
    fn a_point_far_below_does_not_squeeze_the_others() {
        let scale = realisms(&[panel("CAT", 0.97), panel("AT", 0.1)]);
        assert!((scale.ticks[0] - REALISM_MIN).abs() < 1e-9, "{scale:?}");
        let axes = Axes { place: [0.0, 0.0, 100.0, 100.0], across: Scale::fixed(0.0, 1.0, vec![]), up: scale };
        let (_, y) = place(&axes, &point(0.5, 0.1));
        assert!(y <= 100.0, "on the lower edge: {y}");
    }
}
