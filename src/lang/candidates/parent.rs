//! The parent gate: the patch was written for exactly this parent, and the child follows it in its lineage.

use crate::{
    adapters::{Contract, Problem},
    kernel::{Digest, canon::CanonError},
    objects::{Program, ProgramPatch, SolutionId},
};

pub fn check(
    parent: &Program,
    parent_hash: &Result<Digest, CanonError>,
    patch: &ProgramPatch,
    child: &SolutionId,
    contract: &Contract,
) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut same = |place: &str, found: &str, expected: &str| {
        if found != expected {
            problems.push(Problem::new(place, format!("`{found}`"), format!("`{expected}`")));
        }
    };
    same("patch/source_baseline", patch.source_baseline.as_str(), parent.source_family.as_str());
    same("/source_family", parent.source_family.as_str(), contract.family.as_str());
    same("patch/parent_solution_id", patch.parent_solution_id.as_str(), parent.solution_id.as_str());
    match parent_hash {
        Ok(hash) => same("patch/parent_program_hash", &patch.parent_program_hash, &hash.to_hex()),
        Err(error) => problems.push(Problem::new("/", error.to_string(), "a parent that has a hash")),
    }
    if u32::try_from(parent.ancestor_chain.len()) != Ok(parent.generation) {
        let found = format!("generation {} with {} ancestors", parent.generation, parent.ancestor_chain.len());
        problems.push(Problem::new("/generation", found, "one ancestor for each generation"));
    }
    if parent.generation == u32::MAX {
        problems.push(Problem::new("/generation", "the largest number", "room for one more"));
    }
    let of_lineage = child.as_str().strip_prefix(parent.lineage_id.as_str()).is_some_and(|rest| rest.starts_with('/'));
    if !of_lineage || *child == parent.solution_id {
        let expected = format!("a new id `{}/...`", parent.lineage_id);
        problems.push(Problem::new("/solution_id", format!("`{child}`"), expected));
    }
    problems
}
