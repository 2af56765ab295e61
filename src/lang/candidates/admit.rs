//! V_app: the seven gates over one proposal (paper eq. app-validation-gates), and an eighth that turns away a child which
//! does what its parent does. All run, all are recorded, and one failure is enough.

use super::{ApplyError, apply, bodies, free_ranges, interface, isolation, parent as parent_gate, protected, schema};
use crate::{
    adapters::{Contract, Problem, Registry},
    kernel::Digest,
    objects::{Candidate, Gate, GateReport, GateVerdict, ProbePair, Program, ProgramPatch, SolutionId},
};

/// Most problems that a gate writes down.
const PROBLEMS_MAX: usize = 12;

/// Verdicts of the gates, and the candidate if all passed.
#[derive(Clone, Debug, PartialEq)]
pub struct Admission {
    pub gates: GateReport,
    pub candidate: Option<Candidate>,
}

/// Findings of the compiler on probe scenes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trials {
    /// Parts that it could not lower; empty = none.
    pub problems: Vec<String>,
    /// Number of scenes on which the child was compiled beside its parent, with the parent's random draws.
    pub compared: usize,
    /// Number of them in which their interventions differ in any bit.
    pub differing: usize,
    /// Probes of both there, scene by scene.
    pub probes: Vec<ProbePair>,
}

/// Function that compiles a program with this hash over probe scenes.
pub type Compiles<'a> = dyn Fn(&Program, Digest) -> Trials + Sync + 'a;

/// Rules by which patches are judged.
#[derive(Clone, Debug)]
pub struct Judging<'a> {
    /// I_b of the family.
    pub contract: &'a Contract,
    /// All families, for the isolation gate.
    pub registry: &'a Registry,
    /// Gates that an ablation skips: they refuse nothing.
    pub skipped: Vec<Gate>,
    /// Parts of a program that no patch of the run may touch.
    pub closed: Vec<&'static str>,
    /// True if no patch may bring in a sort of road user that the parent does not insert.
    pub fixed_bodies: bool,
}

impl<'a> Judging<'a> {
    /// Judges by all gates, with no part closed.
    pub fn whole(contract: &'a Contract, registry: &'a Registry) -> Judging<'a> {
        Judging { contract, registry, skipped: Vec::new(), closed: Vec::new(), fixed_bodies: false }
    }
}

/// Judges a patch for a parent. `compiles` is the compiler over probe scenes; it sees only programs that are clean by the
/// contract.
pub fn admit(
    parent: &Program,
    patch: &ProgramPatch,
    child: SolutionId,
    judging: &Judging<'_>,
    compiles: &Compiles<'_>,
) -> Admission {
    let Judging { contract, registry, ref skipped, ref closed, fixed_bodies } = *judging;
    // Free constants are judged at their first value: a search sets them where that passes.
    let free =
        if patch.free.is_empty() { Vec::new() } else { free_ranges(parent, patch, contract).err().unwrap_or_default() };
    let patch = &patch.at_start();
    let about_patch = texts(&[free, schema::check_patch(patch)].concat());
    let parent_hash = parent.hash();
    let applied = match &parent_hash {
        _ if !about_patch.is_empty() => Err(ApplyError::Refused),
        Ok(hash) => apply(parent, *hash, patch, child.clone()),
        Err(error) => Err(ApplyError::Canon(error.clone())),
    };
    let child_hash = applied.as_ref().ok().and_then(|program| program.hash().ok());
    let schema = if about_patch.is_empty() { schema::check_child(contract, &applied) } else { about_patch };
    let changes_nothing = applied.is_ok() && child_hash == parent_hash.as_ref().ok().copied();
    let compile = |program: &Program| compile(contract, program, child_hash, compiles);
    let (lowered, effect) = match applied.as_ref().map(compile) {
        Ok(Ok(trials)) => (trials.problems.clone(), effect(&trials)),
        // A program that was not compiled is a matter of the compile gate.
        Ok(Err(problems)) => (problems, vec![]),
        Err(_) => (nothing_to_look_at(), vec![]),
    };
    let mut verdicts = vec![
        verdict(Gate::Schema, schema),
        verdict(Gate::Parent, texts(&parent_gate::check(parent, &parent_hash, patch, &child, contract))),
        verdict(
            Gate::Interface,
            [closed_parts(patch, closed), texts(&interface::check(patch, contract, changes_nothing))].concat(),
        ),
        verdict(Gate::Isolation, texts(&isolation::check(parent, patch, contract, registry, &applied))),
        verdict(
            Gate::Protected,
            texts(
                &[protected::check(parent, patch, contract, &applied), fixed(parent, &applied, fixed_bodies)].concat(),
            ),
        ),
        verdict(Gate::Mechanism, of_child(&applied, |program| mechanism(contract, program))),
        verdict(Gate::Compile, lowered),
        verdict(Gate::Effect, effect),
    ];
    verdicts.iter_mut().filter(|verdict| skipped.contains(&verdict.gate)).for_each(|verdict| verdict.problems.clear());
    let gates = GateReport { verdicts };
    let candidate = if gates.passed() {
        applied.ok().zip(child_hash).and_then(|(p, hash)| candidate(p, hash, patch))
    } else {
        None
    };
    Admission { gates, candidate }
}

/// Returns the findings of a gate on the child. Without a child there is nothing to check, and the gate fails.
fn of_child(applied: &Result<Program, super::ApplyError>, gate: impl FnOnce(&Program) -> Vec<String>) -> Vec<String> {
    match applied {
        Ok(program) => gate(program),
        Err(_) => nothing_to_look_at(),
    }
}

/// Returns bodies that are not the parent's, where the run fixes them.
fn fixed(parent: &Program, applied: &Result<Program, super::ApplyError>, asked: bool) -> Vec<Problem> {
    applied.as_ref().ok().filter(|_| asked).map_or_else(Vec::new, |child| bodies::check(parent, child))
}

/// Returns edits of parts that the run has closed.
fn closed_parts(patch: &ProgramPatch, closed: &[&str]) -> Vec<String> {
    let touched = |path: &str| closed.iter().any(|part| path == *part || path.starts_with(&format!("{part}/")));
    let paths = patch.operations.iter().map(|operation| operation.path.as_str()).filter(|path| touched(path));
    paths.map(|path| format!("{path} is closed in this run; expected edits of other parts alone")).collect()
}

fn nothing_to_look_at() -> Vec<String> {
    vec!["nothing to look at: the patch could not be applied".into()]
}

fn mechanism(contract: &Contract, program: &Program) -> Vec<String> {
    let limits = contract.check_limits(program);
    if !limits.is_empty() {
        return texts(&limits);
    }
    texts(&[contract.check_mechanisms(program), contract.check_conditions(program)].concat())
}

/// Returns the result of trying the child, or why it cannot be tried.
fn compile(
    contract: &Contract,
    program: &Program,
    hash: Option<Digest>,
    compiles: &Compiles<'_>,
) -> Result<Trials, Vec<String>> {
    let problems = texts(&contract.check_program(program));
    match hash {
        _ if !problems.is_empty() => Err(problems),
        Some(hash) => Ok(compiles(program, hash)),
        None => Err(vec!["a number of the program is not finite, so it has no hash".into()]),
    }
}

/// A child that could not be lowered somewhere is a matter of the compile gate.
fn effect(trials: &Trials) -> Vec<String> {
    let same = trials.problems.is_empty() && trials.compared > 0 && trials.differing == 0;
    let text = || {
        format!(
            "no effect: on all {} probe scenes the child does what its parent does, bit for bit; expected an edit of \
             something that is used there: a parameter that a node's setting names, a rule or guard that holds",
            trials.compared
        )
    };
    same.then(text).into_iter().collect()
}

fn candidate(program: Program, program_hash: Digest, patch: &ProgramPatch) -> Option<Candidate> {
    let tags = program.mechanism_modules.values().flat_map(|module| module.tags.iter().cloned());
    let mut mechanism_tags: Vec<String> = tags.collect();
    mechanism_tags.sort();
    mechanism_tags.dedup();
    // The patch has a hash: applying it took one.
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
