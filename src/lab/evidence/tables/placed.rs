//! Places of searched programs in the plane of attack and realism on held-out scenes, with their intervals: the data of a figure of
//! several searches.

use super::ablations::method;
use super::error::TableError;
use super::key::Side;
use super::labels::{self, LineageLabels};
use super::metadrive::quantity;
use super::notes;
use super::searches::searches;
use crate::archive::search::Method;
use crate::evidence::recorded_run::RecordedRun;
use crate::statistics::bootstrap;
use crate::statistics::bootstrap::Estimate;

/// Kind of a search, as a figure tells searches apart: who proposed and what decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SearchKind {
    /// Somebody who reads questions and is not the rule-based stand-in.
    Model,
    /// The rule-based stand-in.
    StandIn,
    /// A random legal patch in place of every proposal.
    Random,
    /// The stand-in's proposals, accepted by the labels of others.
    Shuffled,
    /// Another search method.
    Other,
}

/// A program's place: strict realism is the smaller one of realism where it acts and where it succeeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub attack: Estimate,
    pub realism: Estimate,
}

/// Result of one search, its repetitions together.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    pub method: String,
    pub policy: String,
    pub searched: SearchKind,
    pub seeds: usize,
    pub parent: Point,
    pub evolved: Point,
}

impl SearchKind {
    /// Returns the kind in words for readers.
    pub fn words(self) -> &'static str {
        match self {
            SearchKind::Model => "language model",
            SearchKind::StandIn => "rule-based stand-in",
            SearchKind::Random => "random patches",
            SearchKind::Shuffled => "shuffled labels",
            SearchKind::Other => "another method",
        }
    }
}

/// The kind of search that a run is.
pub fn searched(run: &RecordedRun) -> SearchKind {
    let own = method(run);
    let is = |of: Method| own == of.name();
    if is(Method::RandomProposals) || is(Method::Random) {
        SearchKind::Random
    } else if is(Method::ShuffledLabels) {
        SearchKind::Shuffled
    } else if !is(Method::Pareto) {
        SearchKind::Other
    } else if run.proposer() == "scripted" {
        SearchKind::StandIn
    } else {
        SearchKind::Model
    }
}

/// The point of one side; `None` where nothing acts.
fn point(of: &[&LineageLabels], side: Side) -> Option<Point> {
    let read = [labels::ATTACK, labels::PENALTY_PCT, labels::SUCCESS_PENALTY_PCT];
    let mut estimated =
        bootstrap::estimates(&read.map(|reading| quantity(of, |l| l.read(side, reading.of)))).into_iter();
    let (attack, penalty, of_successes) = (estimated.next()??, estimated.next()?, estimated.next()?);
    let strict = [penalty, of_successes].into_iter().flatten().max_by(|a, b| a.value.total_cmp(&b.value))?;
    let realism = |penalty: f64| 1.0 - penalty / 100.0;
    Some(Point {
        attack: attack.within([0.0, 1.0]),
        realism: Estimate {
            interval: strict.interval.map(|[low, high]| [realism(high), realism(low).min(1.0)]),
            ..Estimate::plain(realism(strict.value))
        },
    })
}

/// Every search of these runs in their order. Runs under different measures of attack have no common plane.
///
/// # Errors
/// An unfinished run, one of the other protocol, or attacks that are different measures.
pub fn placed(runs: &[RecordedRun]) -> Result<Vec<Placed>, TableError> {
    notes::one_attack(runs)?;
    let mut all = Vec::new();
    for (place, run) in runs.iter().enumerate() {
        let own = labels::of_run(runs, place)?;
        all.extend(searches(own.iter()).iter().filter_map(|of| {
            Some(Placed {
                method: of[0].label.clone(),
                policy: of[0].policy.clone(),
                searched: searched(run),
                seeds: of.len(),
                parent: point(of, Side::Parent)?,
                evolved: point(of, Side::Evolved)?,
            })
        }));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAT, add, run};
    use super::*;

    #[test]
    fn a_search_has_its_parents_and_its_own_place_and_who_proposed() {
        let mut stand_in = run("made", &[("actor", "scripted")]);
        add(&mut stand_in, &CAT);
        let mut model = run("asked", &[("actor", "exchange (agent, big)"), ("realism_critic", "scripted")]);
        add(&mut model, &CAT);
        let all = placed(&[stand_in, model]).unwrap();
        assert_eq!(all.iter().map(|of| of.searched).collect::<Vec<_>>(), [SearchKind::StandIn, SearchKind::Model]);
        // CAT of the worked examples: the table prints the same numbers.
        assert_eq!((all[0].parent.attack.value, all[0].evolved.attack.value), (0.25, 0.5));
        let realism = all[0].parent.realism;
        assert!(
            realism.interval.is_some_and(|[low, high]| low <= realism.value && realism.value <= high),
            "{realism:?}"
        );
    }

    #[test]
    fn strict_realism_is_the_smaller_one_of_the_two() {
        let mut made = run("made", &[("actor", "scripted")]);
        add(&mut made, &CAT);
        let table = super::super::metadrive_policy(std::slice::from_ref(&made)).unwrap();
        let row = table.rows().find(|row| row.labels[0] == "CAT").unwrap();
        let rp = |key: &str| row.cell(key).ours.map_or(0.0, |of| of.value);
        let larger = rp("parent_rp_pct").max(rp("parent_success_rp_pct"));
        assert!((placed(&[made]).unwrap()[0].parent.realism.value - (1.0 - larger / 100.0)).abs() < 1e-12);
    }
}
