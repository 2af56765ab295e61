//! A program of a run, put together as a file.

use clap::Args;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::adapters::ADAPTER_VERSION;
use crate::cli::look::show;
use crate::cli::records::folder::RunFolder;
use crate::cli::records::run_name::OneRun;
use crate::cli::studies::program_form::is_file;
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::evaluation::EVAL_VERSION;
use crate::evidence::RecordedRun;
use crate::experiment::{
    BackendMark, CarriedCounsel, Conditions, ContractMark, PROGRAM_FORMAT, ParentProgram, ProgramFile,
};
use crate::families;
use crate::kernel::Digest;
use crate::objects::event::Versions;
use crate::objects::{LineageId, Origin, Program, RunOrigin, SolutionId};
use crate::scene::Pool;
use crate::sim::SIM_VERSION;

#[derive(Debug, Args)]
pub struct Which {
    /// Run: its folder, its name below runs/, or the beginning of either; without it the latest.
    #[arg(value_name = "RUN")]
    first: Option<String>,
    /// Attempt that left a program, e.g. cat-idm/e2s5, a lineage's parent, e.g. cat-idm/parent, or a program file; without it the
    /// programs that the run reports are named.
    #[arg(value_name = "ATTEMPT")]
    second: Option<String>,
    /// The same as an option.
    #[arg(id = "run_option", long = "run", value_name = "RUN")]
    option: Option<PathBuf>,
}

impl Which {
    /// The run and the attempt, each where it was typed. One word alone is a run where a run is called so, else an attempt.
    fn sorted(&self) -> Result<(OneRun, Option<&str>), Failure> {
        let run = |dir: Option<&Path>| dir.map_or_else(OneRun::default, OneRun::of);
        match (self.first.as_deref(), self.second.as_deref(), self.option.as_deref()) {
            (Some(_), Some(_), Some(_)) => Err(Failure::bad_input("the run is named twice: in its place and by --run")),
            (Some(first), Some(second), None) => Ok((run(Some(Path::new(first))), Some(second))),
            (Some(first), None, None) if !is_file(first) && RunFolder::find(Some(Path::new(first))).is_ok() => {
                Ok((run(Some(Path::new(first))), None))
            }
            (attempt, None, option) | (None, attempt, option) => Ok((run(option), attempt)),
        }
    }
}

/// The program of a file, or put together from its run folder.
///
/// # Errors
/// No attempt is named: the message names the programs that the run reports, each with its command.
pub fn packed(which: &Which) -> Result<ProgramFile, Failure> {
    let (run, attempt) = which.sorted()?;
    if let (None, Some(file)) = (run.named(), attempt.filter(|name| is_file(name))) {
        return Ok(ProgramFile::read(Path::new(file))?);
    }
    let folder = run.folder()?;
    let recorded = folder.recorded()?;
    match attempt {
        Some(attempt) => packed_of(&folder, &recorded, attempt),
        None => Err(reported(&folder, &recorded)),
    }
}

/// Programs that a message names before it counts.
const NAMED_MAX: usize = 12;

/// Which programs a run reports, for whoever named none.
fn reported(folder: &RunFolder, run: &RecordedRun) -> Failure {
    let chosen: Vec<&SolutionId> =
        run.result.iter().flat_map(|of| &of.lineages).map(|of| &of.evolved.solution).collect();
    if chosen.is_empty() {
        return Failure::bad_input(format!("{}: name an attempt; the run reports none yet", folder.dir.display()));
    }
    let line = |name: &&SolutionId| format!("\n  evodrive program export --run {} {name}", folder.dir.display());
    let lines: String = chosen.iter().take(NAMED_MAX).map(line).collect();
    let more = chosen.len().saturating_sub(NAMED_MAX);
    let more = if more > 0 { format!("\n  and those of {more} more lineages") } else { String::new() };
    Failure::bad_input(format!("name an attempt, or a lineage's parent; the run reports{lines}{more}"))
}

/// The file of an attempt's program or a parent.
pub fn packed_of(folder: &RunFolder, run: &RecordedRun, name: &str) -> Result<ProgramFile, Failure> {
    let program = find(run, name)?;
    let lineage = &program.lineage_id;
    let damaged = |what: &str| Failure::corruption(format!("{}: {what}; run `evodrive fsck`", folder.dir.display()));
    let adopted = run.parents.iter().find(|parent| parent.lineage == *lineage);
    let adopted = adopted.ok_or_else(|| damaged(&format!("lineage {lineage} has no parent")))?;
    let experiment = folder.read_experiment()?;
    if experiment.digest()? != run.opened.experiment {
        return Err(damaged("experiment.toml is not the experiment that the transcript names"));
    }
    let group = |id: &LineageId| *id == *lineage || lineage.as_str().starts_with(&format!("{id}-s"));
    let settings = experiment.lineages.iter().find(|of| group(&of.id));
    let family = program.source_family.clone();
    let sources = families::sources_by_hand();
    let source = sources.get(&family).ok_or_else(|| damaged(&format!("no family is called `{family}`")))?;
    let contract = ContractMark::of(&source.contract).map_err(Failure::internal)?;
    let versions = Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION };
    // A contract that grew since leaves its programs what they were.
    if run.opened.versions != versions || !source.contract.check_program(program).is_empty() {
        return Err(Failure::bad_input(format!(
            "{}: the run was made by another version of evodrive (adapter, simulator, evaluation {:?}, here {versions:?}); \
             export with that version, or run the experiment again with this one",
            folder.dir.display(),
            run.opened.versions
        )));
    }
    let pool = folder.read_pool()?;
    let start = settings.and_then(|of| of.parent_program.as_ref());
    let origin = Origin::Run(RunOrigin {
        run: run.opened.name.clone(),
        root: run.root,
        solution: program.solution_id.clone(),
        models: run.models(),
    });
    let file = ProgramFile {
        format: PROGRAM_FORMAT.into(),
        digest: Digest::of_bytes(&[]),
        contract,
        program: program.clone(),
        program_hash: program.hash().map_err(Failure::internal)?,
        parent: adopted.program.clone(),
        parent_settings: settings.map_or_else(BTreeMap::new, |of| of.parent.clone()),
        conditions: Conditions {
            ego: adopted.ego.clone(),
            seed: experiment.seed,
            versions,
            simulator: experiment.simulator.rules(),
            backend: experiment.simulator.backend.as_ref().map(BackendMark::of),
            evaluation: experiment.evaluation.clone(),
        },
        counsel: counsel(run, &pool, lineage),
        sequences: BTreeMap::new(),
        evolution_scenes: evolution_scenes(run, &pool, start),
        origins: adopted.origins.iter().cloned().chain([origin]).collect(),
        family,
    };
    file.sealed().map_err(Failure::internal)
}

/// The program of an attempt or of a lineage's parent.
pub fn find<'s>(run: &'s RecordedRun, name: &str) -> Result<&'s Program, Failure> {
    if let Some(parent) = run.parents.iter().find(|parent| parent.program.solution_id.as_str() == name) {
        return Ok(&parent.program);
    }
    let attempt = show::find(run, name)?;
    let left = || {
        format!("attempt {name} was {}, so there is no program; `evodrive show {name}` says why", attempt.exit.name())
    };
    let candidate = attempt.exit.candidate().ok_or_else(|| Failure::bad_input(left()))?;
    Ok(run.program(&SolutionId::new(name)).unwrap_or(&candidate.program))
}

/// Returns the lineage's counsel, with the digests of the scenes.
fn counsel(run: &RecordedRun, pool: &Pool, lineage: &LineageId) -> BTreeMap<String, CarriedCounsel> {
    let own = run.counsels.iter().filter(|counselled| counselled.lineage == *lineage);
    let carried = own.filter_map(|counselled| {
        let scene = pool.scene(&counselled.scene)?.digest();
        Some((counselled.scene.clone(), CarriedCounsel { scene, counsel: counselled.counsel.clone() }))
    });
    carried.collect()
}

/// The scenes on which the program and what it started from were evolved.
fn evolution_scenes(run: &RecordedRun, pool: &Pool, start: Option<&ParentProgram>) -> BTreeSet<Digest> {
    let own = run.opened.evolution_scenes.iter().filter_map(|id| Some(pool.scene(id)?.digest()));
    own.chain(start.iter().flat_map(|start| start.evolution_scenes.iter().copied())).collect()
}

/// The learned ego that the run's experiment names for a program's lineage; `None` where its ego is another one.
pub fn own_weights(folder: &RunFolder, file: &ProgramFile) -> Result<Option<Policy>, Failure> {
    let lineage = file.program.lineage_id.as_str();
    let is_own = |id: &str| id == lineage || lineage.starts_with(&format!("{id}-s"));
    let experiment = folder.read_experiment()?;
    for lineage in experiment.lineages.iter().filter(|of| is_own(of.id.as_str())) {
        let drivers = lineage.drivers().map_err(Failure::bad_input)?;
        if let Some(learned) = drivers.into_iter().find(|of| matches!(of, Policy::Learned(_))) {
            return Ok(Some(learned));
        }
    }
    Ok(None)
}
