//! `bench shards`: how long it takes to plan, write and merge so many rollouts, and what memory that needs. The records are
//! one real one under other names; everything else is the code that plans and merges.

use clap::Args;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use crate::adapters::ADAPTER_VERSION;
use crate::cli::records::folder::{files, open_store};
use crate::cli::terminal::{answer::Answer, exit::Failure, timed::timed};
use crate::compiler::{Prepared, Situation};
use crate::ego::Policy;
use crate::epoch::{Task, Wanted};
use crate::evaluation::{EVAL_VERSION, RolloutRecord, Written};
use crate::experiment::read_scenes;
use crate::families;
use crate::kernel::{Digest, Seed, Threads};
use crate::objects::event::Versions;
use crate::objects::{FamilyName, LineageId, Program, SolutionId};
use crate::shard::{Merge, RESULT_ENDING, ResultFile, Shard, StudyMark, TaskOutcome, TaskResult, split};
use crate::sim::{SIM_VERSION, rollout_assessed};
use crate::store;

#[derive(Debug, Args)]
pub struct ShardsOptions {
    /// A pool or scenario files; a record of the first scene that can be driven is taken.
    #[arg(long, num_args = 1.., required = true)]
    pub pool: Vec<PathBuf>,
    /// Rollouts to plan and merge, a thousand scenes a program.
    #[arg(long, default_value_t = 100_000)]
    pub rollouts: usize,
    /// Tasks in a shard.
    #[arg(long, default_value_t = 1000)]
    pub size: usize,
    /// Empty folder for shards, results and the store; it stays.
    #[arg(long)]
    pub folder: PathBuf,
}

const SCENES: usize = 1000;

pub fn run(options: &ShardsOptions, jobs: usize) -> Result<Answer, Failure> {
    if options.folder.exists() {
        return Err(Failure::bad_input(format!("{} exists; name a folder that does not", options.folder.display())));
    }
    let threads = Threads::new(jobs)?;
    let (record, program) = one_record(options, &threads)?;
    let study = mark();
    let shards = options.folder.join("shards");
    let (planned, planning) = timed(|| plan(options, &program, &study));
    let planned = planned?;
    let (worked, writing) = timed(|| write_results(&planned, &record, &study));
    worked?;
    let store = open_store(&options.folder.join("store"))?;
    let results = files(&shards, RESULT_ENDING)?;
    let merge = || {
        Merge { study: &study, shards: &shards, store: &store, withdrawn: &[], cassette: None, key: None }
            .merge(&results)
    };
    let (merged, merging) = timed(merge);
    let merged = merged?;
    if merged.records != options.rollouts {
        return Err(Failure::internal(format!("merged {} records of {}", merged.records, options.rollouts)));
    }
    let seconds = [planning, writing, merging].map(|took| took.as_secs_f64());
    let text = format!(
        "{} rollouts in {} shards: planned and written in {:.1} s, results written in {:.1} s, merged in {:.1} s\n",
        options.rollouts,
        planned.len(),
        seconds[0],
        seconds[1],
        seconds[2]
    );
    let object = json!({
        "rollouts": options.rollouts, "shards": planned.len(),
        "seconds": {"plan": seconds[0], "results": seconds[1], "merge": seconds[2]},
    });
    Ok(Answer::new(text, object))
}

fn mark() -> StudyMark {
    StudyMark {
        name: "bench".into(),
        experiment: Digest::of_bytes(b"experiment"),
        pool: Digest::of_bytes(b"pool"),
        versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
        backend: None,
    }
}

/// A record of CAT's parent against the IDM ego, and that program.
fn one_record(options: &ShardsOptions, threads: &Threads) -> Result<(RolloutRecord, Program), Failure> {
    let (sources, ego) = (families::sources(), Policy::Idm);
    let family = sources.get(&FamilyName::new("cat")).ok_or_else(|| Failure::internal("no family is called cat"))?;
    let prepared = Prepared::new(&family.parent, family).map_err(Failure::internal)?;
    for scene in read_scenes(&options.pool, threads)?.scenes.into_iter().map(Arc::new) {
        let Ok(situation) = Situation::new(scene.clone(), &ego) else { continue };
        let Ok(compiled) = prepared.compile(&situation, Seed(0)) else { continue };
        let outcome = rollout_assessed(&situation.plant, &compiled.intervention, ego.driver().as_mut());
        let record = RolloutRecord {
            scene: scene.id.clone(),
            scene_digest: scene.digest(),
            program: prepared.hash(),
            ego: ego.name().to_string(),
            intervened: compiled.decision.applies,
            meets_anyway: situation.ego_meets,
            decision: Written::of(&compiled.decision).map_err(Failure::internal)?,
            outcome: outcome.map_err(Failure::internal)?,
        };
        return Ok((record, family.parent.clone()));
    }
    Err(Failure::bad_input("no scene of the pool can be driven by the IDM ego"))
}

/// Gathers and writes what a run of this many rollouts would miss.
fn plan(options: &ShardsOptions, program: &Program, study: &StudyMark) -> Result<Vec<PathBuf>, Failure> {
    let wanted = Wanted::default();
    let mut left = options.rollouts;
    for number in 0..options.rollouts.div_ceil(SCENES) {
        let mut program = program.clone();
        program.solution_id = SolutionId::new(format!("bench/{number}"));
        let hash = program.hash().map_err(Failure::internal)?;
        for scene in 0..SCENES.min(left) {
            let key = Digest::of("evodrive/bench/1", &(number, scene)).map_err(Failure::internal)?;
            let scene = format!("synth/bench/{SCENES}/{scene}");
            let task = Task::Label { lineage: LineageId::new("bench"), program: hash, scene, counsel: None, ego: None };
            wanted.ask(key, task, Some(&program));
        }
        left = left.saturating_sub(SCENES);
    }
    let (tasks, programs): (BTreeMap<Digest, Task>, BTreeMap<Digest, Program>) = wanted.into_tasks();
    let folder = options.folder.join("shards");
    split(study, tasks, &programs, &[], options.size).map(|shard| Ok(shard.saved(&folder)?.0)).collect()
}

fn write_results(shards: &[PathBuf], record: &RolloutRecord, study: &StudyMark) -> Result<(), Failure> {
    for path in shards {
        let (shard, digest) = Shard::load(path)?;
        let result = |(key, task): &(Digest, Task)| {
            let (scene, program) = (task.scene().to_string(), task.program().unwrap_or(record.program));
            let record = RolloutRecord { scene, program, ..record.clone() };
            let text = serde_json::value::to_raw_value(&record).map_err(Failure::internal)?;
            Ok(TaskResult { key: *key, came: TaskOutcome::Record(text) })
        };
        let results = shard.tasks.iter().map(result).collect::<Result<Vec<TaskResult>, Failure>>()?;
        let file = path.with_file_name(ResultFile::name(digest));
        store::write_atomic(&file, &ResultFile::bytes(digest, study, &results, None, None))?;
    }
    Ok(())
}
