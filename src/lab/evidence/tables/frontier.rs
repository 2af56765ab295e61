//! Derivation of a lineage's PF-Area@3: the parent's point, the descendants' points, and the area that they span.

use crate::archive::{ArchiveOptions, hypervolume, non_dominated, pf_area_pct, point};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::event::{HeldOut, LineageResult};
use crate::objects::{RealismMean, Score};

/// Descendants that count, as in the paper's tables.
const DESCENDANTS: usize = 3;

/// The area of a lineage's held-out frontier, over its parent's.
pub(super) struct Spanned {
    /// PF-Area@3, percent.
    pub gain_pct: f64,
    /// Area spanned by the parent, and by the parent with its descendants; dimensionless.
    pub areas: [f64; 2],
    /// Its parts in words, a line each.
    pub steps: Vec<String>,
}

impl Spanned {
    /// `None` where the archive's options are not at hand or the held-out labels do not say whose descendants they are.
    pub fn of(recorded: &RecordedRun, result: &LineageResult) -> Option<Spanned> {
        let options = recorded.declared.archive.as_ref()?;
        // Whoever acts nowhere has no place in the plane, but by the plain mean.
        let placed = |of: &Score| of.coverage > 0.0 || of.rules.mean == RealismMean::Plain;
        let with = |role: &str| -> Vec<&HeldOut> {
            let own = recorded.held_out.iter().filter(|held_out| held_out.lineage == result.lineage);
            own.filter(|held_out| held_out.roles.iter().any(|of| of == role) && placed(&held_out.score)).collect()
        };
        let (parents, descendants) = (with("parent"), with("descendant"));
        if parents.is_empty() && descendants.is_empty() {
            return None;
        }
        let objectives = |of: &[&HeldOut]| of.iter().map(|held_out| held_out.score.objectives).collect::<Vec<_>>();
        let (before, after) = (objectives(&parents), objectives(&descendants));
        let gain_pct = pf_area_pct(&before, &after, DESCENDANTS, options);
        let points: Vec<[f64; 2]> = before.iter().chain(&after).map(point).collect();
        let area = |of: &[[f64; 2]]| hypervolume(of, options.reference);
        let areas = [area(&points[..before.len()]), area(&points)];
        let steps = steps(&parents, &descendants, &points, areas, gain_pct, options);
        Some(Spanned { gain_pct, areas, steps })
    }
}

fn steps(
    parents: &[&HeldOut],
    descendants: &[&HeldOut],
    points: &[[f64; 2]],
    [own, all]: [f64; 2],
    gain_pct: f64,
    options: &ArchiveOptions,
) -> Vec<String> {
    let placed = |of: &HeldOut| {
        let [attack, realism] = point(&of.score.objectives);
        format!("{}: attack {attack}, {} {realism}", of.solution, of.score.realism_name())
    };
    let [attack, realism] = options.reference;
    let name = parents.iter().chain(descendants).next().map_or("realism", |of| of.score.realism_name());
    let mut out = vec![format!("areas are measured from the reference point: attack {attack}, {name} {realism}")];
    match parents.first() {
        Some(parent) => out.push(format!("parent {}; it spans {own}", placed(parent))),
        None => out.push("the parent acts nowhere, so it spans 0".into()),
    }
    if descendants.is_empty() {
        out.push("no descendant that acts was measured, so none adds an area".into());
    }
    let spans = non_dominated(points);
    for (at, descendant) in (parents.len()..).zip(descendants) {
        let without: Vec<[f64; 2]> = points.iter().enumerate().filter(|(k, _)| *k != at).map(|(_, of)| *of).collect();
        let share = match all - hypervolume(&without, options.reference) {
            alone if alone > 0.0 => format!("it spans the area with the others, and {alone} of it alone"),
            _ if spans[at] => "it has no area beyond the reference point or the others' points".into(),
            _ => "it adds nothing: another one of these has no less of both".into(),
        };
        out.push(format!("descendant {}; {share}", placed(descendant)));
    }
    let over = if own < options.epsilon_pf {
        format!("{}, the least that is divided by (archive.epsilon_pf)", options.epsilon_pf)
    } else {
        own.to_string()
    };
    out.push(format!("together they span {all}; 100 ({all} - {own}) / {over} = {gain_pct}"));
    out
}
