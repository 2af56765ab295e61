//! The schema gate: required fields, sizes, presence of values, and types once applied.

use std::collections::BTreeSet;

use super::{
    apply::{ApplyError, shortened},
    weight,
};
use crate::{
    adapters::{Contract, Problem},
    objects::{Operation, OperationKind, Program, ProgramPatch},
};

const PATH_MAX_BYTES: usize = 256;
const ID_MAX_BYTES: usize = 128;
const HYPOTHESIS_MAX_BYTES: usize = 4_000;
const REFERENCES_MAX: usize = 32;
/// Beyond this a patch is not even applied; the contract's own bound is far below and checked by the interface gate.
const OPERATIONS_MAX: usize = 64;

/// Returns findings on the patch alone. A patch with a finding here is not applied.
pub fn check_patch(patch: &ProgramPatch) -> Vec<Problem> {
    let mut problems = check_texts(patch);
    let count = patch.operations.len();
    if !(1..=OPERATIONS_MAX).contains(&count) {
        let expected = format!("1 to {OPERATIONS_MAX} (the contract allows fewer)");
        problems.push(Problem::new("patch/operations", format!("{count} operations"), expected));
        return problems;
    }
    let mut seen = BTreeSet::new();
    for (index, operation) in patch.operations.iter().enumerate() {
        let place = format!("patch/operations/{index}");
        problems.extend(check_operation(&place, operation));
        if !operation.path.ends_with("/-") && !seen.insert(&operation.path) {
            let found = format!("the path {} a second time", operation.path);
            problems.push(Problem::new(format!("{place}/path"), found, "each place edited once"));
        }
    }
    problems
}

fn check_texts(patch: &ProgramPatch) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut bounded = |name: &str, text: &str, most: usize, may_be_empty: bool| {
        let place = format!("patch/{name}");
        if text.len() > most {
            problems.push(Problem::new(place, format!("{} bytes", text.len()), format!("at most {most}")));
        } else if text.trim().is_empty() && !may_be_empty {
            problems.push(Problem::new(place, "nothing", "a text"));
        }
    };
    bounded("source_baseline", patch.source_baseline.as_str(), ID_MAX_BYTES, false);
    bounded("parent_solution_id", patch.parent_solution_id.as_str(), ID_MAX_BYTES, false);
    bounded("parent_program_hash", &patch.parent_program_hash, ID_MAX_BYTES, false);
    bounded("hypothesis", &patch.hypothesis, HYPOTHESIS_MAX_BYTES, false);
    bounded("repair_summary", patch.repair_summary.as_deref().unwrap_or_default(), HYPOTHESIS_MAX_BYTES, true);
    for (name, references) in
        [("memory_refs_used", &patch.memory_refs_used), ("cluster_refs_used", &patch.cluster_refs_used)]
    {
        let long = references.iter().any(|reference| reference.len() > ID_MAX_BYTES);
        if references.len() > REFERENCES_MAX || long {
            let found = format!("{} references, the longest too long: {long}", references.len());
            let expected = format!("at most {REFERENCES_MAX} of at most {ID_MAX_BYTES} bytes");
            problems.push(Problem::new(format!("patch/{name}"), found, expected));
        }
    }
    problems
}

fn check_operation(place: &str, operation: &Operation) -> Vec<Problem> {
    let mut problems = Vec::new();
    if operation.path.len() > PATH_MAX_BYTES {
        let found = format!("{} bytes", operation.path.len());
        problems.push(Problem::new(format!("{place}/path"), found, format!("at most {PATH_MAX_BYTES}")));
    }
    let value = format!("{place}/value");
    match (operation.op, &operation.value) {
        (OperationKind::Remove, Some(_)) => {
            problems.push(Problem::new(value, "a value", "none: `remove` takes no value"))
        }
        (OperationKind::Add | OperationKind::Replace, None) => {
            problems.push(Problem::new(value, "no value", "a value"))
        }
        (_, Some(given)) => {
            let reason = weight::too_large(given);
            problems.extend(reason.map(|reason| Problem::new(value, reason, "a value of ordinary size")));
        }
        _ => {}
    }
    problems
}

/// Returns the error of the application, or the child's excess over the size limits.
pub fn check_child(contract: &Contract, child: &Result<Program, ApplyError>) -> Vec<String> {
    match child {
        Err(error) => vec![shortened(&error.to_string())],
        Ok(program) => contract.check_limits(program).iter().map(Problem::to_string).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{add, patch};
    use super::*;
    use serde_json::json;

    /// The findings of a changed patch.
    fn found(change: impl FnOnce(&mut ProgramPatch)) -> Vec<String> {
        let mut patch = patch(vec![add("/parameters/a", json!(1))]);
        change(&mut patch);
        check_patch(&patch).into_iter().map(|problem| problem.to_string()).collect()
    }

    #[test]
    fn texts_references_and_paths_may_be_as_long_as_their_bounds_and_no_longer() {
        assert!(found(|_| {}).is_empty());
        let text = |length: usize| "x".repeat(length);
        assert!(found(|patch| patch.hypothesis = text(HYPOTHESIS_MAX_BYTES)).is_empty());
        assert!(found(|patch| patch.hypothesis = text(HYPOTHESIS_MAX_BYTES + 1))[0].contains("patch/hypothesis"));
        assert!(found(|patch| patch.repair_summary = Some(" ".into())).is_empty());
        let long = |count: usize, length: usize| vec![text(length); count];
        assert!(found(|patch| patch.memory_refs_used = long(REFERENCES_MAX, ID_MAX_BYTES)).is_empty());
        assert!(
            found(|patch| patch.memory_refs_used = long(REFERENCES_MAX + 1, 1))[0].contains("patch/memory_refs_used")
        );
        assert!(
            found(|patch| patch.cluster_refs_used = long(1, ID_MAX_BYTES + 1))[0].contains("patch/cluster_refs_used")
        );
        assert!(found(|patch| patch.operations[0].path = text(PATH_MAX_BYTES)).is_empty());
        assert!(found(|patch| patch.operations[0].path = text(PATH_MAX_BYTES + 1))[0].contains("operations/0/path"));
    }
}
