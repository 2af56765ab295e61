//! The programs that a suite is frozen from: program files, runs, families' parents.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::cli::records::folder::RunFolder;
use crate::cli::studies::packed::packed_of;
use crate::cli::terminal::exit::Failure;
use crate::evaluation::EvaluationOptions;
use crate::evidence::RecordedRun;
use crate::experiment::{ProgramFile, family_named};
use crate::families;
use crate::kernel::{Digest, Seed};
use crate::objects::{Counsel, FamilyName, Program};
use crate::sim::SimulatorOptions;
use crate::stage::Source;
use crate::suite::Member;
use crate::text::nearest;

/// Word for all families.
const ALL: &str = "all";
/// Families of this backend move what SafeBench stages, others what was recorded.
const STAGED: &str = "safebench";

/// A program with what it plans by.
pub struct Planned {
    pub member: Member,
    pub program: Program,
    pub source: Source,
    pub rules: SimulatorOptions,
    pub evaluation: EvaluationOptions,
    /// Counsel on who attacks, by the scene's digest.
    pub counsels: BTreeMap<Digest, Counsel>,
}

impl Planned {
    pub fn is_staged(&self) -> bool {
        self.source.contract.backend == STAGED
    }

    pub fn seed(&self) -> Seed {
        Seed(self.member.seed)
    }
}

/// Sources of programs.
pub struct Sources<'a> {
    pub files: &'a [PathBuf],
    pub runs: &'a [PathBuf],
    /// Of the runs parents and accepted programs too, not only those that lineages are reported by.
    pub all: bool,
    pub parents: &'a [String],
}

/// The programs, each once, in the order of their families and names.
pub fn gathered(sources: &Sources<'_>) -> Result<Vec<Planned>, Failure> {
    let mut planned = Vec::new();
    for path in sources.files {
        planned.push(of_file(ProgramFile::read(path)?)?);
    }
    for path in sources.runs {
        planned.extend(of_run(path, sources.all)?);
    }
    planned.extend(of_families(sources.parents)?);
    let mut seen = BTreeSet::new();
    planned.retain(|of| seen.insert((of.member.program, of.member.seed, of.rules.digest().ok())));
    planned.sort_by(|a, b| (&a.member.family, &a.member.name).cmp(&(&b.member.family, &b.member.name)));
    if planned.is_empty() {
        Err(Failure::bad_input("name programs: --program FILE, --run RUN or --parents FAMILY"))
    } else {
        Ok(planned)
    }
}

fn of_file(file: ProgramFile) -> Result<Planned, Failure> {
    let source = source(&file.family)?;
    if !file.sequences.is_empty() {
        return Err(Failure::bad_input(format!(
            "{}: expected a program that searches by itself, found one that plays control sequences of a file; `evodrive apply` plays it",
            file.program.solution_id
        )));
    }
    let carried = file.counsel.values().map(|carried| (carried.scene, carried.counsel.clone()));
    let member = Member {
        name: file.program.solution_id.clone(),
        family: file.family.clone(),
        program: file.program_hash,
        seed: file.conditions.seed,
        origins: file.origins.clone(),
    };
    Ok(Planned {
        member,
        source,
        rules: file.conditions.simulator,
        evaluation: file.conditions.evaluation,
        counsels: carried.collect(),
        program: file.program,
    })
}

/// The programs that a run's lineages are reported by; or those, their parents and every program that was accepted.
fn of_run(path: &Path, all: bool) -> Result<Vec<Planned>, Failure> {
    let folder = RunFolder::find(Some(path))?;
    let run = folder.recorded()?;
    let Some(result) = &run.result else {
        return Err(Failure::bad_input(format!(
            "{} is not finished, so no lineage is reported by a program; finish it with `evodrive resume`, or name programs with --program",
            folder.dir.display()
        )));
    };
    let reported = result.lineages.iter().map(|of| of.evolved.solution.to_string());
    let mut names: BTreeSet<String> = reported.collect();
    if all {
        names.extend(others(&run));
    }
    names.iter().map(|name| of_file(packed_of(&folder, &run, name)?)).collect()
}

fn others(run: &RecordedRun) -> Vec<String> {
    let parents = run.parents.iter().map(|parent| parent.program.solution_id.to_string());
    let accepted =
        run.attempts.iter().filter(|attempt| attempt.exit.decision().is_some_and(|decision| decision.gates.any()));
    let accepted = accepted.filter_map(|attempt| Some(attempt.exit.candidate()?.program.solution_id.to_string()));
    parents.chain(accepted).collect()
}

/// Published parents under their shipped protocols.
fn of_families(names: &[String]) -> Result<Vec<Planned>, Failure> {
    let sources = families::sources_by_hand();
    let own = |source: &Source| -> Result<Planned, Failure> {
        let mut planned = of_file(ProgramFile::published(&source.contract.family)?)?;
        planned.member.name = source.parent.solution_id.clone();
        Ok(planned)
    };
    let mut planned = Vec::new();
    for name in names {
        if name == ALL {
            planned.extend(sources.iter().map(own).collect::<Result<Vec<_>, _>>()?);
        } else {
            planned.push(own(&asked(name)?)?);
        }
    }
    Ok(planned)
}

fn asked(word: &str) -> Result<Source, Failure> {
    let (name, sources) = (family_named(word), families::sources_by_hand());
    sources.get(&FamilyName::new(name)).cloned().ok_or_else(|| {
        let known: Vec<&str> = sources.iter().map(|source| source.contract.family.as_str()).chain([ALL]).collect();
        let near = nearest(word, known.iter().copied()).map_or(String::new(), |near| format!("; did you mean {near}?"));
        Failure::bad_input(format!("--parents {word}: expected one of {}{near}", known.join(", ")))
    })
}

fn source(family: &FamilyName) -> Result<Source, Failure> {
    families::sources_by_hand().get(family).cloned().ok_or_else(|| Failure::internal("a family that was read is gone"))
}
