//! Claims under two protocols side by side: those that the paper's rules support, those that stricter ones leave, and both with a floor
//! of realism that rejects as large a share of parents here as the paper's rejects of its own.

use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::file::{Claims, ClaimsError, Named};
use super::judge::{Judged, Judgement, judge};
use super::text::estimate;
use crate::archive::{Contender, SelectorOptions, select_active};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Threads;
use crate::objects::downstream::Downstream;
use crate::objects::event::{Finalist, Measured};
use crate::objects::{LineageId, SolutionId};

/// Parents of the paper's policy rows whose realism lies below its floor of .95, of how many: both rows of CAT.
const REJECTED: [usize; 2] = [2, 20];

/// The claims under one protocol.
#[derive(Clone, Debug, Serialize)]
pub struct ClaimsUnder {
    /// Name of the protocol in the file.
    pub protocol: String,
    /// Judgement with the protocol's own floor.
    pub declared: Judgement,
    /// Judgement with the calibrated floor.
    pub calibrated: Judgement,
    /// Name of an experiment and what its calibrated floor is; none in SafeBench's protocol.
    pub floors: BTreeMap<String, Floor>,
}

/// A calibrated floor and what follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Floor {
    /// Least realism as the experiment declares it, 1.
    pub declared: f64,
    /// Parents below that, and how many there are.
    pub rejected: usize,
    /// Lineages of the run.
    pub parents: usize,
    /// The floor at which the paper's share of them is rejected, rounded down to whole parents, 1.
    pub calibrated: f64,
    /// Parents below that one: none of fewer than ten.
    pub rejected_then: usize,
    /// Lineages that report another program then.
    pub others: usize,
    /// Those among them whose program has no held-out labels; they keep the declared choice.
    pub unmeasured: usize,
}

/// Judges the claims whose runs every protocol of the file names, protocol by protocol. `selectors` has the rule of each experiment.
///
/// # Errors
/// A file without two protocols; a table that cannot be made.
pub fn under_protocols(
    claims: &Claims,
    runs: &[RecordedRun],
    selectors: &BTreeMap<String, SelectorOptions>,
    threads: &Threads,
) -> Result<Vec<ClaimsUnder>, ClaimsError> {
    let shared =
        |run: &Option<String>| run.as_ref().is_some_and(|run| claims.protocols.values().all(|of| of.contains_key(run)));
    let asked: Vec<_> = claims.claims.iter().filter(|claim| shared(&claim.run)).cloned().collect();
    let studies: BTreeMap<String, Downstream> = BTreeMap::new();
    let under = |(protocol, named): (&String, &BTreeMap<String, Named>)| -> Result<ClaimsUnder, ClaimsError> {
        let own = Claims { runs: named.clone(), claims: asked.clone(), studies: BTreeMap::new(), ..claims.clone() };
        let is_named = |run: &&RecordedRun| named.values().any(|of| of.experiments().contains(&run.opened.name));
        let mut floors = BTreeMap::new();
        let mut recalibrated = Vec::new();
        for run in runs.iter().filter(is_named) {
            let made = selectors.get(&run.opened.name).and_then(|options| calibrated(run, options));
            let Some((run, floor)) = made else {
                recalibrated.push(run.clone());
                continue;
            };
            floors.insert(run.opened.name.clone(), floor);
            recalibrated.push(run);
        }
        Ok(ClaimsUnder {
            protocol: protocol.clone(),
            declared: judge(&own, runs, &studies, threads)?,
            calibrated: judge(&own, &recalibrated, &studies, threads)?,
            floors,
        })
    };
    claims.protocols.iter().map(under).collect()
}

/// The run with the programs that it would report at a calibrated floor; `None` of SafeBench's protocol and of an unfinished run.
fn calibrated(run: &RecordedRun, options: &SelectorOptions) -> Option<(RecordedRun, Floor)> {
    let mut result = run.result.clone().filter(|_| run.rounds.is_empty())?;
    let score_of = |lineage: &LineageId, solution: &SolutionId| {
        run.finalists.iter().find(|of| of.lineage == *lineage && of.solution == *solution).map(|of| &of.score)
    };
    let parents =
        result.lineages.iter().filter_map(|of| Some(score_of(&of.lineage, &of.parent.solution)?.objectives.realism));
    let mut parents: Vec<f64> = parents.collect();
    let calibrated = calibrated_floor(&mut parents)?;
    let below = |floor: f64| parents.iter().filter(|realism| **realism < floor).count();
    let at = SelectorOptions { realism_min: calibrated, ..options.clone() };
    let (mut others, mut unmeasured) = (0, 0);
    for lineage in &mut result.lineages {
        let contender = |of: &Finalist| Contender {
            solution: of.solution.clone(),
            objectives: of.score.objectives,
            coverage: of.score.coverage,
        };
        let contenders: Vec<Contender> =
            run.finalists.iter().filter(|of| of.lineage == lineage.lineage).map(contender).collect();
        let Some(chosen) = select_active(&contenders, &at).filter(|of| of.solution != lineage.evolved.solution) else {
            continue;
        };
        others += 1;
        let held = run.held_out.iter().find(|of| of.lineage == lineage.lineage && of.solution == chosen.solution);
        match held {
            Some(held) => lineage.evolved = Measured::new(chosen.solution, &held.score),
            None => unmeasured += 1,
        }
    }
    let floor = Floor {
        declared: options.realism_min,
        rejected: below(options.realism_min),
        parents: parents.len(),
        calibrated,
        rejected_then: below(calibrated),
        others,
        unmeasured,
    };
    let mut changed = run.clone();
    changed.result = Some(result);
    Some((changed, floor))
}

/// The floor that rejects as large a share of parents as the paper's, in whole parents; `None` of none.
fn calibrated_floor(parents: &mut [f64]) -> Option<f64> {
    parents.sort_by(f64::total_cmp);
    parents.get(REJECTED[0] * parents.len() / REJECTED[1]).copied()
}

/// A row a claim: verdict and least convincing estimate under each protocol, by the declared floor and by the calibrated one.
pub fn side_by_side(all: &[ClaimsUnder]) -> String {
    let mut out = String::from("# The paper's claims under both protocols\n\n");
    for under in all {
        let _ = writeln!(out, "**{}**\n", under.protocol);
        for (name, root, proposers) in &under.declared.runs {
            let rules = under.declared.rules.get(name).map_or(String::new(), |rules| format!("; {rules}"));
            let once = if under.declared.one_seed.contains(name) { "; one seed" } else { "" };
            let _ = writeln!(
                out,
                "- run {name}, root {}: proposals from {proposers}{once}{rules}",
                root.get(..12).unwrap_or(root)
            );
        }
        for (name, of) in &under.floors {
            let _ = writeln!(
                out,
                "- {name}: R >= {} rejects {} of {} parents; the paper's rejects {} of {}. At R >= {:.4}, which rejects {}, {} \
                 lineages report another program ({} of them without held-out labels, so that they keep theirs)",
                of.declared,
                of.rejected,
                of.parents,
                REJECTED[0],
                REJECTED[1],
                of.calibrated,
                of.rejected_then,
                of.others,
                of.unmeasured
            );
        }
        out.push('\n');
    }
    let _ = writeln!(
        out,
        "Verdicts by the rule of `evodrive claims`, corrected after Holm over each column; beside it the least convincing row.\n"
    );
    let heads = all.iter().flat_map(|under| [under.protocol.clone(), format!("{}, calibrated floor", under.protocol)]);
    let heads: Vec<String> = heads.collect();
    let _ = writeln!(out, "| claim | {} |\n|---|{}", heads.join(" | "), "---|".repeat(heads.len()));
    let Some(first) = all.first() else { return out };
    let mut claims: Vec<&Judged> = first.declared.claims.iter().collect();
    claims.sort_by(|a, b| a.id.cmp(&b.id));
    for claim in claims {
        let cell = |judgement: &Judgement| -> String {
            let Some(own) = judgement.claims.iter().find(|of| of.id == claim.id) else { return "-".into() };
            let least = own.parts.iter().max_by(|a, b| a.p_for.total_cmp(&b.p_for));
            let least = least.map_or(String::new(), |part| format!("; {}: {}", part.row, estimate(part)));
            format!("{}{least}", own.verdict.words())
        };
        let cells: Vec<String> =
            all.iter().flat_map(|under| [cell(&under.declared), cell(&under.calibrated)]).collect();
        let _ = writeln!(out, "| {}: {} | {} |", claim.id, claim.text, cells.join(" | "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calibrated_floor_rejects_two_of_twenty_parents_and_of_a_few_none() {
        let rejected = |count: usize| {
            let mut parents: Vec<f64> = (0..count).map(|k| 0.99 - 0.01 * k as f64).collect();
            let floor = calibrated_floor(&mut parents).unwrap();
            parents.iter().filter(|realism| **realism < floor).count()
        };
        assert_eq!([20, 10, 9, 1].map(rejected), [2, 1, 0, 0]);
        assert_eq!(calibrated_floor(&mut []), None);
    }
}
