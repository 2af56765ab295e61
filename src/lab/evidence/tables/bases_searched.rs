//! The bases of cells in tables that compare runs: search methods, left-out parts, parallel proposals. p-values and wall clocks have
//! none: the former come from resamples of all differences of the table, the latter from declared latencies.

use super::ablations::{self as columns, ACTED_REALISM};
use super::bases::Derivations;
use super::basis::{Combine, Derivation, Leaf, Repetition};
use super::gains;
use super::key::Side;
use super::labels::{self, LineageLabels, Reading};
use super::layout::{Row, Table};
use crate::objects::Attempt;

impl Derivations<'_> {
    /// The basis of a cell of `attack-only`, `without` or `kwidth`.
    pub(super) fn of_searches(&self, table: &Table, row: &Row, key: &str) -> Option<Derivation> {
        let run = row.key.one_run()?;
        let of_row = |lineage: &&LineageLabels| row.key.has(run, &lineage.lineage);
        let own: Vec<&LineageLabels> = self.searched.get(run)?.iter().filter(of_row).collect();
        let side = row.key.side().unwrap_or(Side::Evolved);
        let read = |of: &[&LineageLabels], (what, reading): (&str, Reading)| {
            self.means_of(of.iter().copied(), side, what, Box::new(reading))
        };
        let against = |reading| {
            let whole = self.searched.get(columns::whole_of(table, run, self.recorded_runs)?)?;
            let all: Vec<&LineageLabels> = whole.iter().collect();
            Some((paired(&own, &all, |of| read(of, reading)), read(&all, reading)))
        };
        let relative = |reading| {
            let (change, whole) = against(reading)?;
            let formula = "100 times the paired difference over the number of the whole".to_string();
            Some(Derivation { terms: vec![change, whole], ..Derivation::of(formula, Combine::Percent, Vec::new()) })
        };
        let (attack, realism): ((&str, Reading), (&str, Reading)) =
            (("attack", labels::ATTACK), ("realism where the program acts", ACTED_REALISM));
        match key {
            _ if key == columns::ATTACK.key => Some(read(&own, attack)),
            _ if key == columns::REALISM.key => Some(read(&own, realism)),
            _ if key == columns::PF_AREA.key => Some(self.frontier(own.into_iter())),
            _ if key == columns::ATTACK_CHANGE.key => against(attack).map(|(change, _)| change),
            _ if key == columns::REALISM_CHANGE.key => against(realism).map(|(change, _)| change),
            _ if key == columns::ATTACK_REL.key => relative(attack),
            _ if key == columns::REALISM_REL.key => relative(realism),
            _ if key == columns::PROPOSED_MEAN.key => Some(self.numbered(run, &own, "proposals", |_| true)),
            _ if key == columns::SIMULATED_MEAN.key => {
                Some(self.numbered(run, &own, "simulated proposals", columns::simulated))
            }
            _ if key == columns::ACCEPTED_MEAN.key => {
                Some(self.numbered(run, &own, "accepted proposals", columns::accepted))
            }
            _ if key == columns::YIELD.key => {
                let terms = vec![
                    self.numbered(run, &own, "accepted proposals", columns::accepted),
                    self.numbered(run, &own, "simulated proposals", columns::simulated),
                ];
                let formula = "100 times accepted over simulated proposals".to_string();
                Some(Derivation { terms, ..Derivation::of(formula, Combine::Percent, Vec::new()) })
            }
            _ => None,
        }
    }

    /// The basis of a cell of `metadrive-gains`.
    pub(super) fn of_gains(&self, row: &Row, key: &str) -> Option<Derivation> {
        let own: Vec<&LineageLabels> =
            self.searched.first()?.iter().filter(|l| row.key.has(l.place, &l.lineage)).collect();
        let read = |of: &[&LineageLabels], side: Side| {
            self.means_of(of.iter().copied(), side, "attack", Box::new(labels::ATTACK))
        };
        if let Some(side) = gains::side_of(key) {
            return Some(read(&own, side));
        }
        if let Some(number) = gains::area_of(key) {
            let formula = "mean over searches of the mean over their repetitions of an area in the plane of attack and strict realism, \
                           on held-out objectives"
                .to_string();
            return Some(self.spanned(own.into_iter(), formula, |spanned, _| spanned.map(number)));
        }
        let null = self.searched.get(gains::null_run(self.recorded_runs, gains::null_of(key)?)?)?;
        let all: Vec<&LineageLabels> = null.iter().collect();
        gains::is_matched(&own, null).then(|| paired(&own, &all, |of| read(of, Side::Evolved)))
    }

    /// How many proposals of a lineage something holds of, in the mean.
    fn numbered(&self, run: usize, own: &[&LineageLabels], what: &str, holds: fn(&Attempt) -> bool) -> Derivation {
        let part = |l: &&LineageLabels| -> Option<Repetition> {
            let attempts = self.recorded_runs.get(run)?.attempts.iter().filter(|attempt| attempt.lineage == l.lineage);
            let leaf = |attempt: &Attempt| Leaf {
                attempt: Some(attempt.id.clone()),
                ..Leaf::scene(attempt.id.as_str(), &[], Some(labels::share(holds(attempt))))
            };
            let leaves: Vec<Leaf> = attempts.map(leaf).collect();
            let value = leaves.iter().filter_map(|leaf| leaf.value).sum();
            let (search, lineage) = (format!("{} {}", l.name, l.ego), l.lineage.to_string());
            Some(Repetition {
                search,
                run,
                lineage,
                replica: l.replica,
                programs: Vec::new(),
                value: Some(value),
                leaves,
                steps: Vec::new(),
            })
        };
        let formula = format!("mean over searches of the mean over their repetitions of the number of {what}");
        Derivation::of(formula, Combine::Means, own.iter().filter_map(part).collect())
    }
}

/// A difference of lineages to others, from what `read` gives of each.
fn paired(
    own: &[&LineageLabels],
    others: &[&LineageLabels],
    read: impl Fn(&[&LineageLabels]) -> Derivation,
) -> Derivation {
    let terms = vec![read(&shared(others, own)), read(&shared(own, others))];
    let formula = "the second term minus the first, paired by lineage and scene, over scenes that count in both";
    Derivation { terms, ..Derivation::of(formula.into(), Combine::Paired, Vec::new()) }
}

/// Those of some lineages that others have too.
fn shared<'l>(of: &[&'l LineageLabels], with: &[&LineageLabels]) -> Vec<&'l LineageLabels> {
    of.iter().copied().filter(|one| one.counterpart(with.iter().copied()).is_some()).collect()
}
