//! `program`: one program of a run, shown or taken out as a file.

use clap::{Args, Subcommand};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::PathBuf;

use crate::adapters::ADAPTER_VERSION;
use crate::cli::look::show;
use crate::cli::records::{folder::RunFolder, run_name::OneRun};
use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::evaluation::EVAL_VERSION;
use crate::evidence::RecordedRun;
use crate::experiment::{
    BackendMark, CarriedCounsel, Conditions, ContractMark, PROGRAM_FORMAT, ParentProgram, ProgramFile,
};
use crate::families;
use crate::kernel::Digest;
use crate::objects::event::Versions;
use crate::objects::{LineageId, Origin, Program, SolutionId, program_diff};
use crate::scene::Pool;
use crate::sim::SIM_VERSION;
use crate::text::counted;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show a program: where it came from, what it changes in its parent, and its whole content.
    Show(Which),
    /// Write a program with everything that it needs into one file, for `apply` or for `lineage[].parent_program` in
    /// an experiment.
    Export(ExportOptions),
}

#[derive(Debug, Args)]
#[command(allow_missing_positional = true)]
pub struct Which {
    #[command(flatten)]
    pub run: OneRun,
    /// Attempt that left a program, e.g. cat-idm/e2s5, or a lineage's parent, e.g. cat-idm/parent.
    pub attempt: String,
}

#[derive(Debug, Args)]
#[command(allow_missing_positional = true)]
pub struct ExportOptions {
    #[command(flatten)]
    pub which: Which,
    /// File to write; without it the file goes to stdout.
    #[arg(long)]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(command: &Command) -> Result<Answer, Failure> {
    match command {
        Command::Show(which) => {
            let file = packed(which)?;
            Ok(Answer::new(described(&file)?, json!({"program": file})))
        }
        Command::Export(ExportOptions { which, out, output }) => {
            let file = packed(which)?;
            let bytes = file.to_bytes().map_err(Failure::internal)?;
            let Some(path) = out else {
                return Ok(Answer::exact(String::from_utf8_lossy(&bytes), json!(file)));
            };
            output.write(path, &bytes)?;
            let text = format!(
                "{}, family {}, as {}\ndigest {}\n",
                file.program.solution_id,
                file.family,
                path.display(),
                file.digest
            );
            let object = json!({"file": path, "digest": file.digest, "program": file.program.solution_id});
            Ok(Answer::new(text, object))
        }
    }
}

/// The program's file, put together from its run folder.
fn packed(which: &Which) -> Result<ProgramFile, Failure> {
    let folder = which.run.folder()?;
    packed_of(&folder, &folder.recorded()?, &which.attempt)
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
    let sources = families::sources();
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
    let origin = Origin {
        run: run.opened.name.clone(),
        root: run.root,
        solution: program.solution_id.clone(),
        models: run.opened.models.clone(),
    };
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

/// What the lineage was counselled, with the digests of the scenes.
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

fn described(file: &ProgramFile) -> Result<String, Failure> {
    let mut text = format!(
        "program {}  (family {}, generation {})\nhash     {}\ncontract {}, adapter version {}\n",
        file.program.solution_id,
        file.family,
        file.program.generation,
        file.program_hash,
        file.contract.digest,
        file.contract.adapter
    );
    for origin in &file.origins {
        let _ = writeln!(text, "from     {origin}");
    }
    let _ = writeln!(text, "played   ego {}, seed {}", file.conditions.ego, file.conditions.seed);
    if let Some(backend) = &file.conditions.backend {
        let _ = writeln!(text, "labels   of {} {}, worker {}", backend.name, backend.version, backend.digest.short(16));
    }
    if !file.counsel.is_empty() {
        let _ = writeln!(text, "counsel  for {}", counted(file.counsel.len(), "scene"));
    }
    let diff = program_diff(&file.parent, &file.program);
    let unchanged = diff.is_empty().then(|| "  nothing\n".to_string());
    let _ = write!(text, "\nchanged of {}:\n{}", file.parent.solution_id, unchanged.unwrap_or(diff));
    let content = serde_json::to_string_pretty(&file.program).map_err(Failure::internal)?;
    let _ = writeln!(text, "\n{content}");
    Ok(text)
}
