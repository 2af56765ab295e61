//! Reasons why a lineage shows no gain: the ends of its attempts, counted from the record.

use std::collections::BTreeMap;

use super::form::Form;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::{Attempt, Exit, attempt::Gate, event::LineageResult};
use crate::text::counted;

/// Numbers of a lineage's attempts by where they ended.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ends {
    pub declined: usize,
    /// Numbers by the first gate that failed: later ones may have failed only because nothing was left to look at.
    pub gates: BTreeMap<Gate, usize>,
    /// The router judged a rollout not worth its cost.
    pub routed_away: usize,
    /// Evaluated, and some acceptance gate held.
    pub accepted: usize,
    /// Evaluated and not accepted: more attack than the parent, bought with too much realism.
    pub lost_realism: usize,
    /// Evaluated and not accepted: no more attack than the parent.
    pub no_more_attack: usize,
}

impl Ends {
    pub fn of<'a>(attempts: impl IntoIterator<Item = &'a Attempt>) -> Ends {
        let mut ends = Ends::default();
        for attempt in attempts {
            match &attempt.exit {
                Exit::Declined { .. } => ends.declined += 1,
                Exit::Invalid { gates } => {
                    if let Some(verdict) = gates.failed().next() {
                        *ends.gates.entry(verdict.gate).or_default() += 1;
                    }
                }
                Exit::Rejected { .. } => ends.routed_away += 1,
                Exit::Evaluated { decision, .. } if decision.gates.any() => ends.accepted += 1,
                Exit::Evaluated { decision, .. } if decision.gates.parent_tradeoff.attack_change > 0.0 => {
                    ends.lost_realism += 1;
                }
                Exit::Evaluated { .. } => ends.no_more_attack += 1,
            }
        }
        ends
    }

    fn text(&self) -> String {
        let invalid: usize = self.gates.values().sum();
        let by_gate: Vec<String> = self.gates.iter().map(|(gate, n)| format!("{} {n}", gate.name())).collect();
        let by_gate = if by_gate.is_empty() { String::new() } else { format!(" (gates: {})", by_gate.join(", ")) };
        let evaluated = self.accepted + self.lost_realism + self.no_more_attack;
        format!(
            "{}: {} declined, {invalid} invalid{by_gate}, {} rejected, {evaluated} evaluated, \
             of these {} accepted, {} not accepted with more attack than the parent but too little realism, {} with no more attack",
            counted(self.declined + invalid + self.routed_away + evaluated, "attempt"),
            self.declined,
            self.routed_away,
            self.accepted,
            self.lost_realism,
            self.no_more_attack
        )
    }
}

/// One sentence for a lineage whose active generator is still its parent or whose frontier did not grow; else `None`.
pub fn note(run: &RecordedRun, result: &LineageResult) -> Option<String> {
    let kept = result.evolved.solution == result.parent.solution;
    let what = match (kept, grows(result)) {
        (false, true) => return None,
        (true, true) => "no gain, the parent stays active (its descendants add frontier area only)",
        (true, false) => "no gain, the parent stays active and descendants add no frontier area",
        (false, false) => "no frontier gain, descendants add no area on held-out scenes",
    };
    Some(sentence(what, run, result))
}

/// The same for SafeBench's archive: whether its attack rose from the parent's scenes to the last round's, and whether
/// anything of the last round is a descendant's.
pub fn archive_note(run: &RecordedRun, result: &LineageResult, attack_change: f64, descends: bool) -> Option<String> {
    let rises = num::rounded(attack_change, Form::Rate.digits()) > 0.0;
    let what = match (descends, rises, grows(result)) {
        (_, true, true) => return None,
        (false, _, true) => "no gain in the archive, balanced selection keeps the parent's scenes alone",
        (false, _, false) => "no gain, balanced selection keeps the parent's scenes alone",
        (true, false, true) => "no gain in attack, the archive changes without it",
        (true, false, false) => "no gain, the archive changes without more attack and no group's frontier grows",
        (true, true, false) => "no frontier gain, the chosen descendants add no area in any group",
    };
    Some(sentence(what, run, result))
}

/// A gain that the tables print as 0 counts as no gain.
fn grows(result: &LineageResult) -> bool {
    num::rounded(result.pf_area_at_3_pct, Form::Gain.digits()) > 0.0
}

fn sentence(what: &str, run: &RecordedRun, result: &LineageResult) -> String {
    let ends = Ends::of(run.attempts.iter().filter(|a| a.lineage == result.lineage));
    format!("{what}; {}; final choice: {}", ends.text(), result.selection)
}
