//! What became of proposals, a row a source family and ego over all its lineages: how far they came, what refused them, how many
//! of the simulated children do nothing new, and how many patches only change numbers.

use std::collections::BTreeMap;

use super::bootstrap::Estimate;
use super::error::TableError;
use super::layout::{Cell, Column, Form, Head, METHOD, Numbers, POLICY, Part, Row, Table};
use super::metadrive::SEEDS;
use super::{labels, notes, paper};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::attempt::Gate;
use crate::objects::{Attempt, Exit, Role};

/// What a share is taken of.
#[derive(Clone, Copy)]
enum Of {
    /// All proposals.
    Proposals,
    /// Proposals with a patch that could be read.
    Patches,
    /// Simulated children.
    Children,
}

impl Of {
    fn counts(self, attempt: &Attempt) -> bool {
        match self {
            Of::Proposals => true,
            Of::Patches => attempt.proposal.patch().is_some(),
            Of::Children => attempt.exit.decision().is_some(),
        }
    }
}

/// Whether a proposal counts for a share.
type Holds = fn(&Attempt) -> bool;

const fn column(key: &'static str, group: &'static str, head: &'static str) -> Column {
    Column { key, group, head, upward: None, form: Form::Percent }
}

/// Every share with what it is taken of.
const SHARES: [(Column, Of, Holds); 12] = [
    (column("readable_at_once_pct", "Of proposals", "Readable at once"), Of::Proposals, readable_at_once),
    (column("repaired_pct", "Of proposals", "Repaired"), Of::Proposals, |of| of.proposal.rounds.len() > 1),
    (column("declined_pct", "Of proposals", "Declined"), Of::Proposals, |of| matches!(of.exit, Exit::Declined { .. })),
    (column("refused_pct", "Of proposals", "Refused by gates"), Of::Proposals, |of| of.exit.name() == "invalid"),
    (column("refused_effect_pct", "Of proposals", "By effect gate"), Of::Proposals, |of| refused_by(of, Gate::Effect)),
    (column("refused_compile_pct", "Of proposals", "By compile gate"), Of::Proposals, |of| {
        refused_by(of, Gate::Compile)
    }),
    (column("not_simulated_pct", "Of proposals", "Not simulated"), Of::Proposals, |of| of.exit.name() == "rejected"),
    (column("evaluated_pct", "Of proposals", "Evaluated"), Of::Proposals, |of| of.exit.decision().is_some()),
    (column("accepted_pct", "Of proposals", "Accepted"), Of::Proposals, accepted),
    (column("numbers_only_pct", "Of patches", "Numbers only"), Of::Patches, numbers_only),
    (column("without_effect_pct", "Of children", "Without effect"), Of::Children, without_effect),
    (column("acting_less_pct", "Of children", "Act too rarely"), Of::Children, acts_too_rarely),
];

/// Whether a proposal counts for a column at all, and whether what the column says holds of it; `None` without such a column.
pub(super) fn counted(key: &str, attempt: &Attempt) -> Option<(bool, bool)> {
    let (_, of, holds) = SHARES.iter().find(|(column, ..)| column.key == key)?;
    let counts = of.counts(attempt);
    Some((counts, counts && holds(attempt)))
}

const COUNTS: [Head; 3] = [
    Head { key: "attempts", head: "Proposals" },
    Head { key: "patches", head: "Patches" },
    Head { key: "children", head: "Children" },
];

/// The actor's own answer held a patch.
fn readable_at_once(attempt: &Attempt) -> bool {
    attempt
        .proposal
        .exchanges
        .iter()
        .find(|asked| asked.role == Role::Actor)
        .is_some_and(|asked| asked.refusal.is_none())
}

fn refused_by(attempt: &Attempt, gate: Gate) -> bool {
    let Exit::Invalid { gates } = &attempt.exit else { return false };
    gates.failed().next().is_some_and(|verdict| verdict.gate == gate)
}

fn accepted(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some_and(|decision| decision.gates.any())
}

/// Every operation puts a number in the place of another.
fn numbers_only(attempt: &Attempt) -> bool {
    let number =
        |operation: &crate::objects::Operation| operation.value.as_ref().is_some_and(serde_json::Value::is_number);
    attempt.proposal.patch().is_some_and(|patch| patch.operations.iter().all(number))
}

/// The child has its parent's labels in every scene.
fn without_effect(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some_and(|decision| decision.gates.differing_scenes == 0)
}

fn acts_too_rarely(attempt: &Attempt) -> bool {
    attempt.exit.decision().is_some_and(|decision| !decision.gates.coverage.holds)
}

/// What became of the proposals of these runs.
pub fn proposals(stories: &[RecordedRun]) -> Result<Table, TableError> {
    let mut rows: BTreeMap<(String, String), Group<'_>> = BTreeMap::new();
    for story in stories {
        for parent in &story.parents {
            let key = (parent.program.source_family.to_string(), parent.ego.clone());
            let group = rows.entry(key).or_default();
            group.lineages.push(parent.lineage.to_string());
            group.attempts.extend(story.attempts.iter().filter(|attempt| attempt.lineage == parent.lineage));
            group.proposals = labels::proposals(story);
        }
    }
    let mut told = vec![
        "Shares are of what stands above them: of all proposals, of those with a patch that could be read (the last one of each), \
         of the children that were simulated. Refused by gates: nothing was simulated; the first gate that refused counts. Numbers \
         only: every operation puts a number in the place of another. Without effect: the child has its parent's labels in every scene."
            .to_string(),
    ];
    told.extend(stories.iter().map(notes::run));
    told.extend(notes::different_versions(stories));
    Ok(Table {
        name: "proposals",
        labels: vec![METHOD, POLICY],
        columns: SHARES.iter().map(|(column, ..)| *column).collect(),
        counts: COUNTS.into_iter().chain([SEEDS]).collect(),
        parts: vec![Part {
            name: "proposals".into(),
            title: "What became of proposals".into(),
            source: None,
            rows: rows.into_iter().map(|((family, ego), group)| group.row(family, &ego)).collect(),
        }],
        runs: notes::runs(stories)?,
        notes: told,
    })
}

/// The attempts of one family against one ego.
#[derive(Default)]
struct Group<'a> {
    lineages: Vec<String>,
    attempts: Vec<&'a Attempt>,
    proposals: String,
}

impl Group<'_> {
    fn row(self, family: String, ego: &str) -> Row {
        let of = |of: Of| self.attempts.iter().filter(move |attempt| of.counts(attempt));
        let share = |(column, among, holds): &(Column, Of, Holds)| {
            let (all, found) = (of(*among).count(), of(*among).filter(|attempt| holds(attempt)).count());
            (all > 0).then(|| (column.key, Estimate::plain(100.0 * found as f64 / all as f64)))
        };
        let numbers: Numbers = SHARES.iter().filter_map(share).collect();
        let columns: Vec<Column> = SHARES.iter().map(|(column, ..)| *column).collect();
        let counts = [Of::Proposals, Of::Patches, Of::Children].map(|what| of(what).count());
        Row {
            labels: vec![family, paper::policy(ego)],
            cells: Cell::row(&columns, &numbers, None),
            counts: counts.into_iter().chain([self.lineages.len()]).collect(),
            lineages: self.lineages,
            proposals: self.proposals,
            notes: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::tests::{CAT, add, attempt, run, simulated};
    use super::proposals;
    use crate::objects::attempt::{Exchange, Round};
    use crate::objects::{
        Attempt, Exit, FamilyName, Operation, OperationKind, ProgramPatch, Role, RouteDecision, SolutionId,
    };

    /// A proposal with one patch that puts these values in place, `repairs` times repaired.
    fn proposed(slot: u32, exit: Exit, values: &[Value], repairs: usize) -> Attempt {
        let mut attempt = attempt("cat-idm", slot, exit);
        let operation = |value: &Value| Operation {
            op: OperationKind::Replace,
            path: "/parameters/duration_s".into(),
            value: Some(value.clone()),
        };
        let patch = ProgramPatch {
            source_baseline: FamilyName::new("cat"),
            parent_solution_id: SolutionId::new("cat-idm/parent"),
            parent_program_hash: String::new(),
            operations: values.iter().map(operation).collect(),
            hypothesis: String::new(),
            memory_refs_used: vec![],
            cluster_refs_used: vec![],
            repair_summary: None,
        };
        attempt.proposal.rounds = vec![Round { patch: Some(patch), reviews: vec![] }; 1 + repairs];
        let any = attempt.parent_hash;
        let refusal = (repairs > 0).then(|| "no JSON".to_string());
        let actor = Exchange { role: Role::Actor, round: 0, request: any, response: any, model: "m".into(), refusal };
        attempt.proposal.exchanges = vec![actor];
        attempt
    }

    /// A simulated child whose labels are its parent's everywhere.
    fn inert() -> Exit {
        let mut exit = simulated(RouteDecision::Select, false, 0.0);
        if let Exit::Evaluated { decision, .. } = &mut exit {
            decision.gates.differing_scenes = 0;
        }
        exit
    }

    #[test]
    fn shares_are_of_proposals_patches_and_children() {
        let mut story = run("made", &[("actor", "scripted (s, s)")]);
        add(&mut story, &CAT);
        let module = json!({"slot": "actor_score"});
        story.attempts = vec![
            attempt("cat-idm", 0, Exit::Declined { reason: "no JSON".into() }),
            proposed(1, simulated(RouteDecision::Select, true, 0.1), &[json!(2.0), json!(3)], 0),
            proposed(2, inert(), &[json!(2.0), module], 1),
            proposed(3, simulated(RouteDecision::Reject, false, 0.0), &[json!("nearest_path")], 0),
        ];
        let table = proposals(&[story]).unwrap();
        let row = table.rows().next().unwrap();
        let share = |key: &str| row.cell(key).ours.unwrap().value;
        assert_eq!(row.counts, [4, 3, 2, 1]);
        assert_eq!([share("declined_pct"), share("repaired_pct"), share("readable_at_once_pct")], [25.0, 25.0, 50.0]);
        assert_eq!([share("evaluated_pct"), share("accepted_pct"), share("not_simulated_pct")], [50.0, 25.0, 25.0]);
        assert_eq!(share("without_effect_pct"), 50.0, "of the two that were simulated");
        assert!((share("numbers_only_pct") - 100.0 / 3.0).abs() < 1e-9, "of the three patches");
    }
}
