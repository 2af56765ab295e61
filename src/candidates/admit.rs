//! V_app: all seven gates over one proposal (paper eq. app-validation-gates). All run, all are recorded, and one
//! failure is enough.

use super::{ApplyError, apply, interface, isolation, parent as parent_gate, protected, schema};
use crate::{
    adapters::{Contract, Problem, Registry},
    kernel::Digest,
    objects::{Candidate, Gate, GateReport, GateVerdict, Program, ProgramPatch, SolutionId},
};

/// Most problems that a gate writes down.
const PROBLEMS_MAX: usize = 12;

/// What the gates said, and the candidate if all passed.
#[derive(Clone, Debug, PartialEq)]
pub struct Admission {
    pub gates: GateReport,
    pub candidate: Option<Candidate>,
}

/// What the compiler says of a program with this hash over probe scenes.
pub type Compiles<'a> = dyn Fn(&Program, Digest) -> Vec<String> + Sync + 'a;

/// Judges a patch for a parent. `compiles` is the compiler over probe scenes: it gives what it could not lower, and
/// it sees only programs that are clean by the contract.
pub fn admit(
    parent: &Program,
    patch: &ProgramPatch,
    child: SolutionId,
    contract: &Contract,
    registry: &Registry,
    compiles: &Compiles<'_>,
) -> Admission {
    let about_patch = texts(&schema::check_patch(patch));
    let parent_hash = parent.hash();
    let applied = match &parent_hash {
        _ if !about_patch.is_empty() => Err(ApplyError::Refused),
        Ok(hash) => apply(parent, *hash, patch, child.clone()),
        Err(error) => Err(ApplyError::Canon(error.clone())),
    };
    let child_hash = applied.as_ref().ok().and_then(|program| program.hash().ok());
    let schema = if about_patch.is_empty() { schema::check_child(contract, &applied) } else { about_patch };
    let changes_nothing = applied.is_ok() && child_hash == parent_hash.as_ref().ok().copied();
    let verdicts = vec![
        verdict(Gate::Schema, schema),
        verdict(Gate::Parent, texts(&parent_gate::check(parent, &parent_hash, patch, &child, contract))),
        verdict(Gate::Interface, texts(&interface::check(patch, contract, changes_nothing))),
        verdict(Gate::Isolation, texts(&isolation::check(parent, patch, contract, registry, &applied))),
        verdict(Gate::Protected, texts(&protected::check(parent, patch, contract, &applied))),
        verdict(Gate::Mechanism, of_child(&applied, |program| mechanism(contract, program))),
        verdict(Gate::Compile, of_child(&applied, |program| compile(contract, program, child_hash, compiles))),
    ];
    let gates = GateReport { verdicts };
    let candidate = if gates.passed() {
        applied.ok().zip(child_hash).and_then(|(p, hash)| candidate(p, hash, patch))
    } else {
        None
    };
    Admission { gates, candidate }
}

/// Of a patch that has no child there is nothing to look at, and nothing passes unseen.
fn of_child(applied: &Result<Program, super::ApplyError>, gate: impl FnOnce(&Program) -> Vec<String>) -> Vec<String> {
    match applied {
        Ok(program) => gate(program),
        Err(_) => vec!["nothing to look at: the patch could not be applied".into()],
    }
}

fn mechanism(contract: &Contract, program: &Program) -> Vec<String> {
    let limits = contract.check_limits(program);
    if !limits.is_empty() {
        return texts(&limits);
    }
    texts(&[contract.check_mechanisms(program), contract.check_conditions(program)].concat())
}

fn compile(contract: &Contract, program: &Program, hash: Option<Digest>, compiles: &Compiles<'_>) -> Vec<String> {
    let problems = texts(&contract.check_program(program));
    match hash {
        _ if !problems.is_empty() => problems,
        Some(hash) => compiles(program, hash),
        None => vec!["a number of the program is not finite, so it has no hash".into()],
    }
}

fn candidate(program: Program, program_hash: Digest, patch: &ProgramPatch) -> Option<Candidate> {
    let tags = program.mechanism_modules.values().flat_map(|module| module.tags.iter().cloned());
    let mut mechanism_tags: Vec<String> = tags.collect();
    mechanism_tags.sort();
    mechanism_tags.dedup();
    // It has one: applying took it.
    let patch_hash = patch.hash().ok()?;
    Some(Candidate { program, program_hash, patch_hash, mechanism_tags })
}

fn texts(problems: &[Problem]) -> Vec<String> {
    problems.iter().map(Problem::to_string).collect()
}

fn verdict(gate: Gate, mut problems: Vec<String>) -> GateVerdict {
    let more = problems.len().saturating_sub(PROBLEMS_MAX);
    if more > 0 {
        problems.truncate(PROBLEMS_MAX);
        problems.push(format!("and {more} more"));
    }
    GateVerdict { gate, problems }
}
