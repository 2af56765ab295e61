//! V_app: all seven gates over one proposal (paper eq. app-validation-gates). All run, all are recorded, and one
//! failure is enough.

use super::{apply, interface, isolation, parent as parent_gate, protected, schema};
use crate::{
    adapters::{Contract, Problem, Registry},
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

/// Judges a patch for a parent. `compiles` is the compiler over probe scenes: it gives what it could not lower, and
/// it sees only programs that are clean by the contract.
pub fn admit(
    parent: &Program,
    patch: &ProgramPatch,
    child: SolutionId,
    contract: &Contract,
    registry: &Registry,
    compiles: &(dyn Fn(&Program) -> Vec<String> + Sync),
) -> Admission {
    let about_patch = texts(&schema::check_patch(patch));
    let applied =
        if about_patch.is_empty() { apply(parent, patch, child.clone()) } else { Err(super::ApplyError::Refused) };
    let schema = if about_patch.is_empty() { schema::check_child(contract, &applied) } else { about_patch };
    let verdicts = vec![
        verdict(Gate::Schema, schema),
        verdict(Gate::Parent, texts(&parent_gate::check(parent, patch, &child, contract))),
        verdict(Gate::Interface, texts(&interface::check(parent, patch, contract, &applied))),
        verdict(Gate::Isolation, texts(&isolation::check(parent, patch, contract, registry, &applied))),
        verdict(Gate::Protected, texts(&protected::check(parent, patch, contract, &applied))),
        verdict(Gate::Mechanism, of_child(&applied, |program| mechanism(contract, program))),
        verdict(Gate::Compile, of_child(&applied, |program| compile(contract, program, compiles))),
    ];
    let gates = GateReport { verdicts };
    let candidate = if gates.passed() { applied.ok().and_then(|program| candidate(program, patch)) } else { None };
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

fn compile(contract: &Contract, program: &Program, compiles: &(dyn Fn(&Program) -> Vec<String> + Sync)) -> Vec<String> {
    let problems = texts(&contract.check_program(program));
    if problems.is_empty() { compiles(program) } else { problems }
}

fn candidate(program: Program, patch: &ProgramPatch) -> Option<Candidate> {
    let tags = program.mechanism_modules.values().flat_map(|module| module.tags.iter().cloned());
    let mut mechanism_tags: Vec<String> = tags.collect();
    mechanism_tags.sort();
    mechanism_tags.dedup();
    // Both have a hash: applying took the patch's, the interface gate compared the program's.
    let (program_hash, patch_hash) = (program.hash().ok()?, patch.hash().ok()?);
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
