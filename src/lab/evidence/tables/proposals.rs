//! Outcomes of proposals, a row a source family and ego over all its lineages: how far they came, what refused them, how many
//! of the simulated children do nothing new, and how many patches only change numbers.

use super::error::TableError;
use super::layout::{Head, Table};
use super::shares::{self, Holds, Share, Spec, percent};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::attempt::Gate;
use crate::objects::{Attempt, Exit, Role};

/// Bases of the shares: all proposals, those with a patch that could be read, simulated children.
const PROPOSALS: Holds = |_| true;
const PATCHES: Holds = |of| of.proposal.patch().is_some();
const CHILDREN: Holds = |of| of.exit.decision().is_some();

/// Every share with what it is taken of.
const SHARES: [Share; 12] = [
    percent("readable_at_once_pct", "Of proposals", "Readable at once", PROPOSALS, readable_at_once),
    percent("repaired_pct", "Of proposals", "Repaired", PROPOSALS, |of| of.proposal.rounds.len() > 1),
    percent("declined_pct", "Of proposals", "Declined", PROPOSALS, |of| matches!(of.exit, Exit::Declined { .. })),
    percent("refused_pct", "Of proposals", "Invalid", PROPOSALS, |of| of.exit.name() == "invalid"),
    percent("refused_effect_pct", "Of proposals", "By effect gate", PROPOSALS, |of| refused_by(of, Gate::Effect)),
    percent("refused_compile_pct", "Of proposals", "By compile gate", PROPOSALS, |of| refused_by(of, Gate::Compile)),
    percent("not_simulated_pct", "Of proposals", "Rejected", PROPOSALS, |of| of.exit.name() == "rejected"),
    percent("evaluated_pct", "Of proposals", "Evaluated", PROPOSALS, |of| of.exit.decision().is_some()),
    percent("accepted_pct", "Of proposals", "Accepted", PROPOSALS, accepted),
    percent("numbers_only_pct", "Of patches", "Numbers only", PATCHES, numbers_only),
    percent("without_effect_pct", "Of children", "Without effect", CHILDREN, without_effect),
    percent("acting_less_pct", "Of children", "Act too rarely", CHILDREN, acts_too_rarely),
];

/// The table.
const SPEC: Spec = Spec {
    name: "proposals",
    title: "What became of proposals",
    source: None,
    shares: &SHARES,
    counts: &[
        (Head { key: "attempts", head: "Proposed" }, PROPOSALS),
        (Head { key: "patches", head: "Patches" }, PATCHES),
        (Head { key: "children", head: "Children" }, CHILDREN),
    ],
    figures: |_, _| None,
    note: "Shares are of what stands above them: of all proposals, of those with a patch that could be read (the last one of each), \
           of the children that were simulated. Declined: no usable patch. Invalid: a gate refused it; \
           the first that did counts. Rejected: the world evaluator gave it no rollout. Numbers only: every operation puts a number in the place of another. Without effect: the child has its parent's labels in every scene.",
};

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

/// Makes the table of what became of the proposals of these runs.
pub fn proposals(runs: &[RecordedRun]) -> Result<Table, TableError> {
    shares::table(&SPEC, runs)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::derivations::Derivations;
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
            free: Default::default(),
        };
        attempt.proposal.rounds = vec![Round { patch: Some(patch), reviews: vec![] }; 1 + repairs];
        let any = attempt.parent_hash;
        let refusal = (repairs > 0).then(|| "no JSON".to_string());
        let actor = Exchange {
            role: Role::Actor,
            round: 0,
            request: any,
            response: any,
            model: "m".into(),
            metadata: None,
            unwrapped: vec![],
            refusal,
        };
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
        let mut recorded = run("made", &[("actor", "scripted (s, s)")]);
        add(&mut recorded, &CAT);
        let module = json!({"slot": "actor_score"});
        recorded.attempts = vec![
            attempt("cat-idm", 0, Exit::Declined { reason: "no JSON".into() }),
            proposed(1, simulated(RouteDecision::Select, true, 0.1), &[json!(2.0), json!(3)], 0),
            proposed(2, inert(), &[json!(2.0), module], 1),
            proposed(3, simulated(RouteDecision::Reject, false, 0.0), &[json!("nearest_path")], 0),
        ];
        let table = proposals(&[recorded]).unwrap();
        let row = table.rows().next().unwrap();
        let share = |key: &str| row.cell(key).ours.unwrap().value;
        assert_eq!(row.counts, [4, 3, 2, 1]);
        assert_eq!([share("declined_pct"), share("repaired_pct"), share("readable_at_once_pct")], [25.0, 25.0, 50.0]);
        assert_eq!([share("evaluated_pct"), share("accepted_pct"), share("not_simulated_pct")], [50.0, 25.0, 25.0]);
        assert_eq!(share("without_effect_pct"), 50.0, "of the two that were simulated");
        assert!((share("numbers_only_pct") - 100.0 / 3.0).abs() < 1e-9, "of the three patches");
    }

    /// Runs of one proposer are told in one row, those of two in two, and each cell comes out of its own run's proposals.
    #[test]
    fn what_two_proposers_did_is_told_apart() {
        let made = |name: &str, model: &str, attempts: Vec<Attempt>| {
            let mut recorded = run(name, &[("actor", model)]);
            add(&mut recorded, &CAT);
            recorded.attempts = attempts;
            recorded
        };
        let declined = || attempt("cat-idm", 0, Exit::Declined { reason: "no JSON".into() });
        let taken = || proposed(1, simulated(RouteDecision::Select, true, 0.1), &[json!(2.0)], 0);
        let runs = [
            made("rules", "scripted (s, s)", vec![declined(), taken()]),
            made("agent", "exchange (a, a)", vec![taken()]),
        ];
        let table = proposals(&runs).unwrap();
        let listed: Vec<(&str, f64, usize)> = table
            .rows()
            .map(|row| (row.labels[0].as_str(), row.cell("declined_pct").ours.unwrap().value, row.counts[0]))
            .collect();
        assert_eq!(listed, [("cat (agent)", 0.0, 1), ("cat (rules)", 50.0, 2)]);
        let bases = Derivations::of(&runs);
        for row in table.rows() {
            let basis = row.derivation("declined_pct", &bases).unwrap();
            assert_eq!(basis.value(), Some(row.cell("declined_pct").ours.unwrap().value), "{:?}", row.labels);
        }
        let together = [made("a", "scripted (s, s)", vec![declined()]), made("b", "scripted (s, s)", vec![taken()])];
        let table = proposals(&together).unwrap();
        assert_eq!(table.rows().map(|row| row.labels[0].as_str()).collect::<Vec<_>>(), ["cat"]);
    }
}
