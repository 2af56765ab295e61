//! The figures of one run, as its report shows them.

use super::area_rounds::area_rounds;
use super::case_evolution::{Evolved, case_evolution, credit_of};
use super::edits::patch_surface;
use super::world_order::world_order;
use crate::evidence::credit::Credit;
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::LineageId;

/// Most lineages whose steps a report shows: a run of fifty would make its page half as large again.
const LINEAGES_MAX: usize = 12;

/// A figure in a report.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Shown {
    /// Its title.
    pub title: String,
    /// Stand-alone SVG.
    pub svg: String,
}

/// Every figure that one run gives, as SVG: what its report shows. Steps are those of the lineages that the page shows, or of the first ones
/// where it names none yet. Chains are drawn on held-out scenes where their credit is known.
pub fn of_run(run: &RecordedRun, lineages: &[LineageId], credits: &[Credit]) -> Vec<Shown> {
    let alone = std::slice::from_ref(run);
    let whole = [patch_surface(alone), world_order(alone), area_rounds(alone)];
    let first: Vec<LineageId> = run.parents.iter().map(|parent| parent.lineage.clone()).collect();
    let lineages = if lineages.is_empty() { &first } else { lineages };
    let steps = lineages.iter().take(LINEAGES_MAX).map(|lineage| {
        let lineage = lineage.clone();
        let credit = credit_of(run, &lineage, credits);
        case_evolution(&[Evolved { run, lineage, credit, family: None }])
    });
    let files = whole.into_iter().chain(steps).filter_map(Result::ok);
    files.map(|figure| Shown { svg: figure.svg_in_any_font(), title: figure.title }).collect()
}
